"""Commands for the demo of Texas Instruments' mmWave SDK (``.cfg``), as the description of a capture.

References
----------
.. [1] Texas Instruments, *MMWAVE SDK User Guide*, release 3.5, section 3.4, "Configuration (.cfg) File Format".
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from scarl_sionna.core.errors import InputFileError
from scarl_sionna.core.untrusted.files import MEGABYTE, read_text

from .ti_setup import MOST_CHIRPS, Profile, Setup, bits, one_profile, samples, sender

LEAST = {
    "channelCfg": 2, "adcCfg": 2, "profileCfg": 11, "chirpCfg": 8, "frameCfg": 5, "adcbufCfg": 3,
    "dfeDataOutputMode": 1, "lvdsStreamCfg": 4,
}  # fmt: skip # a table
"""Commands that are read, and how many numbers each has at least; all others are of no concern to raw data."""
NEEDED = ("channelCfg", "adcCfg", "profileCfg", "chirpCfg", "frameCfg")
LARGEST = 1e9
"""No number of such a file is larger."""


def read_cfg(path: Path) -> Setup:
    """Return what a ``.cfg`` file says.

    Raises
    ------
    InputFileError
        If it is no such file, lacks a command, or describes what is not read: several profiles or subframes,
        transmitters at once, headers between the samples.
    """
    try:
        text = read_text(path, MEGABYTE)
    except InputFileError:
        raise
    except OSError as error:
        raise InputFileError(f"cannot be read ({error.strerror})", path) from error
    found = _commands(text, path)
    for name in NEEDED:
        if name not in found:
            raise InputFileError(f"has no {name}", path, "give the file that was sent to the device")
    if (mode := found.get("dfeDataOutputMode", [[1.0]])[-1][0]) != 1.0:
        raise InputFileError(f"has dfeDataOutputMode {mode:g}", path, "captures of frames (mode 1) are read")
    _check_stream(found.get("lvdsStreamCfg"), path)
    profiles = {int(row[0]): _profile(row) for row in found["profileCfg"]}
    frame = found["frameCfg"][-1]
    chirps = _loop(found["chirpCfg"], int(frame[0]), int(frame[1]), path)
    platform = _platform(text)
    buffer = found.get("adcbufCfg", [[0.0, 0.0, 0.0, 1.0]])[-1]
    swap, interleave = (buffer[2:4] if len(buffer) > 4 else buffer[1:3]) if len(buffer) > 3 else (0.0, 1.0)
    return Setup(
        profile=one_profile([int(row[2]) for row in chirps], profiles, path),
        transmitters=tuple(sender(int(row[7]), path) for row in chirps),
        receivers=bits(_mask(found["channelCfg"][-1][0], path)),
        num_loops=max(int(frame[2]), 0),
        frame_period=frame[4] / 1e3,
        **samples(found["adcCfg"][-1][1], found["adcCfg"][-1][0], path),
        q_first=swap == 1.0,
        is_interleaved=interleave == 0.0,
        num_lanes=4 if platform.lower().startswith(("xwr12", "xwr14")) else 2,
        device=platform,
    )


def _commands(text: str, path: Path) -> dict[str, list[list[float]]]:
    """Return the numbers of each command that is read, of those after the last ``flushCfg``, which forgets the rest."""
    found: dict[str, list[list[float]]] = {}
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("%", 1)[0].split()
        if words and words[0] == "flushCfg":
            found.clear()
        if not words or words[0] not in LEAST:
            continue
        try:
            values = [float(word) for word in words[1:]]
        except ValueError:
            values = [math.nan]
        if len(values) < LEAST[words[0]] or not all(abs(value) <= LARGEST for value in values):
            raise InputFileError(
                f"line {number}: {words[0]} has {LEAST[words[0]]} numbers or more, not {line.strip()[:60]!r}", path
            )
        found.setdefault(words[0], []).append(values)
        if len(found[words[0]]) > MOST_CHIRPS:
            raise InputFileError(f"line {number}: {words[0]} for the {MOST_CHIRPS + 1}th time", path)
    return found


def _check_stream(commands: list[list[float]] | None, path: Path) -> None:
    """Raise if what is captured is not samples alone."""
    for _, header, data, _ in (row[:4] for row in commands or ()):
        if header != 0.0 or data not in (0.0, 1.0):
            raise InputFileError(
                f"has lvdsStreamCfg with enableHeader {header:g} and dataFmt {data:g}",
                path,
                "captures without headers (0) and of samples (1) are read",
            )


def _profile(row: Sequence[float]) -> Profile:
    """Return a profile; the numbers are GHz, us, MHz/us and ksps."""
    return Profile(
        start_frequency=row[1] * 1e9,
        slope=row[7] * 1e12,
        idle_time=row[2] / 1e6,
        adc_start_time=row[3] / 1e6,
        ramp_time=row[4] / 1e6,
        num_samples=int(row[9]),
        sample_rate=row[10] * 1e3,
    )


def _loop(commands: list[list[float]], first: int, last: int, path: Path) -> list[list[float]]:
    """Return the command of each chirp of a loop: the last one that names it, as the device takes them in turn."""
    if not 0 <= first <= last < MOST_CHIRPS:
        raise InputFileError(f"has frameCfg with chirps {first} to {last} of {MOST_CHIRPS}", path)
    chirps = []
    for number in range(first, last + 1):
        row = next((one for one in reversed(commands) if one[0] <= number <= one[1]), None)
        if row is None:
            raise InputFileError(f"has no chirpCfg for chirp {number}", path)
        if any(row[3:7]):
            raise InputFileError(f"has a chirpCfg that varies the profile (chirp {number})", path)
        chirps.append(row)
    return chirps


def _mask(value: float, path: Path) -> int:
    if not 1.0 <= value <= 15.0:
        raise InputFileError(f"has channelCfg with receivers {value:g}, 1 to 15 are", path)
    return int(value)


def _platform(text: str) -> str:
    """Return the name of the chip that a comment tells: ``% Platform:xWR18xx``."""
    for line in text.splitlines():
        words = line.split()
        if line.lstrip().startswith("%") and "Platform:" in line and words:
            return line.partition("Platform:")[2].strip()[:40]
    return ""
