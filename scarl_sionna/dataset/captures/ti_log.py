"""The log of Texas Instruments' mmWave Studio (``LogFile.txt``), as the description of a capture.

Studio writes the calls that it makes, one a line, with the numbers that the device gets::

    20-Oct-2024 19:38:44: API:ProfileConfig,0,1435384036,10000,600,6000,0,0,621,0,256,5000,0,0,30,0,

References
----------
.. [1] Texas Instruments, *mmWaveLink* interface documents: order and units of the fields of ``rlChanCfg_t``,
   ``rlAdcOutCfg_t``, ``rlDevDataFmtCfg_t``, ``rlProfileCfg_t``, ``rlChirpCfg_t`` and ``rlFrameCfg_t``. Units were
   checked on public recordings, whose logs give 77.000 GHz, 29.98 MHz/us and 1 ms where their authors say so.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from scarl_sionna.core.errors import InputFileError
from scarl_sionna.core.untrusted.files import MEGABYTE, read_text

from .ti_setup import MOST_CHIRPS, Profile, Setup, bits, one_profile, samples, sender

LARGEST = 16 * MEGABYTE
LEAST = {
    "ChannelConfig": 2, "AdcOutConfig": 2, "DataFmtConfig": 5, "DataPathConfig": 2, "LaneConfig": 1,
    "ProfileConfig": 11, "ChirpConfig": 8, "FrameConfig": 5,
}  # fmt: skip # a table
"""Calls that are read, and how many numbers each has at least."""
NEEDED = ("ChannelConfig", "AdcOutConfig", "ProfileConfig", "ChirpConfig", "FrameConfig")
CALL = re.compile(r"API:(\w+),(.*)")
SYNTHESISER = {"6": 2.7e9}
"""Reference of the synthesiser by the first digit of the chip's number [Hz]; all others: 3.6 GHz."""
TICK, FRAME_TICK = 10e-9, 5e-9
"""Units of times in a chirp, and of the time from frame to frame [s]."""


def read_log(path: Path) -> Setup:
    """Return what was in force when the sensor was started last.

    Raises
    ------
    InputFileError
        If it is no such file, lacks a call, or describes what is not read: several profiles in a loop, transmitters at
        once, other data than samples.
    """
    try:
        text = read_text(path, LARGEST)
    except InputFileError:
        raise
    except OSError as error:
        raise InputFileError(f"cannot be read ({error.strerror})", path) from error
    calls, chip = _in_force(text, path)
    for name in NEEDED:
        if name not in calls:
            raise InputFileError(f"has no call of {name}", path, "give the log of the session that recorded")
    if (data := calls.get("DataPathConfig", [(1, 1)])[-1][1]) != 1:
        raise InputFileError(f"has DataPathConfig with {data:#x}", path, "captures of samples alone (0x1) are read")
    number = re.sub(r"^\D*", "", chip)
    frame, chirps = calls["FrameConfig"][-1], _loop(calls, path)
    profiles = {row[0]: _profile(row, SYNTHESISER.get(number[:1], 3.6e9)) for row in calls["ProfileConfig"]}
    receivers = bits(calls["ChannelConfig"][-1][1] & 15)
    if not receivers:
        raise InputFileError("has no receiver switched on", path)
    lanes = len(bits(calls.get("LaneConfig", [(3,)])[-1][0] & 15))
    if lanes not in (2, 4):
        raise InputFileError(f"has {lanes} lanes, captures of 2 and 4 are read", path)
    form = calls.get("DataFmtConfig", [(15, 2, 1, 0, 1)])[-1]
    return Setup(
        profile=one_profile([row[2] for row in chirps], profiles, path),
        transmitters=tuple(sender(row[7], path) for row in chirps),
        receivers=receivers,
        num_loops=frame[3],
        frame_period=frame[4] * FRAME_TICK,
        **samples(calls["AdcOutConfig"][-1][1], calls["AdcOutConfig"][-1][0], path),
        q_first=form[3] == 1,
        is_interleaved=form[4] == 0,
        num_lanes=lanes,
        device=f"awr{number}" if number else "",
    )


def _in_force(text: str, path: Path) -> tuple[dict[str, list[tuple[int, ...]]], str]:
    """Return the numbers of the calls up to the last start of the sensor, and the chip's name."""
    calls: dict[str, list[tuple[int, ...]]] = {}
    started: dict[str, list[tuple[int, ...]]] | None = None
    chip = ""
    for place, line in enumerate(text.splitlines(), 1):
        found = CALL.search(line)
        if not found:
            continue
        name, words = found[1], [word for word in found[2].split(",") if word.strip()]
        if name == "select_chip_version" and words:
            chip = words[0].strip()[:40]
        elif name == "SensorStart":
            started = {key: list(rows) for key, rows in calls.items()}
        elif name in LEAST:
            rows = _replaced(calls.get(name, []), _numbers(words, name, place, path), name)
            if len(rows) > MOST_CHIRPS:
                raise InputFileError(f"line {place}: {name} of more than {MOST_CHIRPS} chirps or profiles", path)
            calls[name] = rows
    return calls if started is None else started, chip


def _replaced(rows: list[tuple[int, ...]], new: tuple[int, ...], name: str) -> list[tuple[int, ...]]:
    """Return the calls that are in force after a new one: it takes the place of those of the same profile or chirps."""
    if name == "ProfileConfig":
        return [row for row in rows if row[0] != new[0]] + [new]
    if name == "ChirpConfig":
        return [row for row in rows if not new[0] <= row[0] <= row[1] <= new[1]] + [new]
    return [new]


def _numbers(words: Sequence[str], name: str, place: int, path: Path) -> tuple[int, ...]:
    try:
        values = tuple(int(word) for word in words) if max(map(len, words), default=0) < 16 else ()
    except ValueError:
        values = ()
    if len(values) < LEAST[name]:
        raise InputFileError(f"line {place}: {name} has {LEAST[name]} whole numbers or more, not {words!r:.60}", path)
    return values


def _loop(calls: dict[str, list[tuple[int, ...]]], path: Path) -> list[tuple[int, ...]]:
    """Return the call for each chirp of a loop; the last one counts."""
    first, last = calls["FrameConfig"][-1][:2]
    if not 0 <= first <= last < MOST_CHIRPS:
        raise InputFileError(f"has FrameConfig with chirps {first} to {last} of {MOST_CHIRPS}", path)
    chirps = []
    for number in range(first, last + 1):
        row = next((one for one in reversed(calls["ChirpConfig"]) if one[0] <= number <= one[1]), None)
        if row is None:
            raise InputFileError(f"has no ChirpConfig for chirp {number}", path)
        if any(row[3:7]):
            raise InputFileError(f"has a ChirpConfig that varies the profile (chirp {number})", path)
        chirps.append(row)
    return chirps


def _profile(row: Sequence[int], reference: float) -> Profile:
    """Return a profile of numbers as the device gets them."""
    step = reference / 2**26
    return Profile(
        start_frequency=row[1] * step,
        slope=row[7] * step * 900.0 * 1e6,
        idle_time=row[2] * TICK,
        adc_start_time=row[3] * TICK,
        ramp_time=row[4] * TICK,
        num_samples=row[9],
        sample_rate=row[10] * 1e3,
    )
