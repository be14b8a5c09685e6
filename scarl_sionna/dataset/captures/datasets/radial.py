"""Raw data of RADIal: a file for each of four chips, and a log that tells where each frame stands in them.

References
----------
.. [1] J. Rebut et al., "Raw high-definition radar for multi-task learning", CVPR 2022; log and order of the samples as
   in github.com/valeoai/RADIal, DBReader and SignalProcessing/rpl.py.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputFileError
from scarl_sionna.core.specs.radar.array import AntennaArray
from scarl_sionna.core.specs.radar.multiplexing import Ddm
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.untrusted.files import MEGABYTE
from scarl_sionna.signal.converter import step_size

from ..capture import LEVELS, Capture
from ..pieces import Pieces, text_of

FORMAT = "radial"
CHIPS = ("radar_ch3", "radar_ch0", "radar_ch1", "radar_ch2")
"""Files of receivers 0 to 3, 4 to 7, 8 to 11, 12 to 15."""
AFTER_FIRST = {"radar_ch3": 0, "radar_ch0": 1, "radar_ch2": 2, "radar_ch1": 3}
"""How much later than that of ``radar_ch3`` the number of a chip's sample of the same frame is."""
BANDS = (0, *range(5, 16))
"""Doppler band of each transmitter (rpl.py: the first one, then those from 5 on, of 16)."""
LARGEST_LOG = 256 * MEGABYTE
DELAY_US = 180_000
"""How much earlier than its log says the dataset takes a radar's frame for (DBReader.py, offsetTable) [us]."""
FIELDS = {"timestamp": 1, "issue": 4, "sample": 7, "sensor": 10, "offset": 13, "size": 16}
"""Word of a line of the log, of 17 words."""
ASSUMED = (
    "carrier, ramp and antennas are this project's assumptions (preset radial_hd): ranges and velocities are scaled by "
    "the published 103 m and 0.1 m/s, their sign is not published, directions mean nothing without array="
)


def read_radial_capture(
    path: str | Path, *, array: AntennaArray | None = None, full_scale_dbm: float | None = None
) -> Capture:
    """Return the raw data of a sequence of RADIal.

    Parameters
    ----------
    path : str or Path
        Folder of a sequence, ``RECORD@...``, with ``RECORD@..._radar_ch0.bin`` to ``ch3`` and
        ``RECORD@..._events_log.rec``.
    array : AntennaArray, optional
        The 12 x 16 antennas; left out: those of the preset ``radial_hd``, an assumption.
    full_scale_dbm : float, optional
        Power at an antenna that a full-scale tone stands for [dBm]. Left out, powers are relative.

    Returns
    -------
    Capture
        Frames of which the log has all four chips. Times are those of the dataset's own reader, on the clock that all
        its sensors share: the log's, shifted so that the first frame has its time of issue, less `DELAY_US`.

    Raises
    ------
    InputFileError
        If a file is missing or damaged, or the log tells of another size of a frame.
    ParameterRangeError
        If the array has another number of antennas.
    """
    folder = Path(path).absolute()
    log = _single(folder, "*_events_log.rec")
    radar = RadarSpec.preset("radial_hd").with_(multiplexing=Ddm(num_empty_bands=16 - len(BANDS), bands=BANDS))
    if array is not None:
        radar = radar.with_(array=array)
    if full_scale_dbm is not None:
        radar = radar.with_(full_scale_dbm=full_scale_dbm)
    events = _events(log)
    files = {chip: Pieces([_single(folder, f"*_{chip}.bin")]) for chip in CHIPS}
    frames = _together(events)
    if not frames:
        raise InputFileError("tells of no frame of all four chips", log, "copy the sequence again")
    size = 4 * radar.num_chirps_total * radar.num_samples * 4
    wrong = next((event for frame in frames for event in frame.values() if event.size != size), None)
    if wrong is not None:
        raise InputFileError(f"tells of a frame of {wrong.size} bytes a chip, {size} are read", log)
    begin = events["radar_ch3"][0]
    shift = begin.issue - begin.timestamp - DELAY_US
    left_out = len(events["radar_ch3"]) - len(frames)
    notes = [*([LEVELS] if full_scale_dbm is None else []), *([ASSUMED] if array is None else [])]
    if left_out:
        notes.append(f"{left_out} frames without data of all four chips are left out")
    return Capture(
        format=FORMAT,
        radar=radar,
        num_frames=len(frames),
        timestamp_ns=np.array([(frame["radar_ch3"].timestamp + shift) * 1000 for frame in frames], dtype=np.int64),
        notes=tuple(notes),
        scale=step_size(radar),
        read=_Frames(files, frames, radar).read,
    )


class _Event(NamedTuple):
    """A line of the log about a radar chip.

    Time and time of issue [us], number of the sample, place in the file and size [bytes].
    """

    timestamp: int
    issue: int
    sample: int
    offset: int
    size: int


@dataclass(frozen=True)
class _Frames:
    """Frames whose parts stand in four files: sample fastest, then receiver, then chirp; I and Q side by side."""

    files: Mapping[str, Pieces]
    frames: Sequence[Mapping[str, _Event]]
    radar: RadarSpec

    def read(self, frame: int) -> npt.NDArray[np.int16]:
        """Return I and Q of a frame, shape (num_rx, num_chirps_total, num_samples, 2)."""
        shape = self.radar.num_chirps_total, 4, self.radar.num_samples, 2
        parts = []
        for chip in CHIPS:
            event = self.frames[frame][chip]
            raw = self.files[chip].int16(event.offset, event.size // 2).reshape(shape)
            parts.append(raw.transpose(1, 0, 2, 3))
        return np.concatenate(parts)


def _single(folder: Path, pattern: str) -> Path:
    found = sorted(folder.glob(pattern))
    if len(found) != 1:
        raise InputFileError(f"has {len(found)} files {pattern}", folder, "give the folder of one sequence")
    return found[0]


def _events(log: Path) -> dict[str, list[_Event]]:
    """Return what the log tells of each chip; lines of other sensors are passed over."""
    out: dict[str, list[_Event]] = {chip: [] for chip in CHIPS}
    for number, line in enumerate(text_of(log, LARGEST_LOG).splitlines(), start=1):
        words = line.split()
        if len(words) <= FIELDS["sensor"] or words[FIELDS["sensor"]] not in out:
            continue
        try:
            event = _Event(*(int(words[FIELDS[name]]) for name in _Event._fields))
        except (ValueError, IndexError) as error:
            raise InputFileError(f"has no numbers of a radar's frame in line {number}", log) from error
        is_time = abs(event.timestamp) < 9e14 and abs(event.issue) < 9e14
        if not (is_time and 0 <= event.sample < 2**62 and 0 <= event.offset < 2**62 and 0 <= event.size < 2**40):
            raise InputFileError(f"has a number in line {number} that none of a frame can be", log)
        out[words[FIELDS["sensor"]]].append(event)
    return out


def _together(events: Mapping[str, Sequence[_Event]]) -> list[dict[str, _Event]]:
    """Return the frames of which all chips are there, by the numbers of their samples."""
    by_sample = {chip: {event.sample: event for event in found} for chip, found in events.items()}
    frames = []
    for first in events["radar_ch3"]:
        parts = {chip: by_sample[chip].get(first.sample + after) for chip, after in AFTER_FIRST.items()}
        whole = {chip: event for chip, event in parts.items() if event is not None}
        if len(whole) == len(parts):
            frames.append(whole)
    return frames
