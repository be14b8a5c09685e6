"""Raw data that a real radar recorded, frame after frame, as the rest of the program takes that of a simulated one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import overload

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputFileError, ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.describe import Described, Row, quantity, short
from scarl_sionna.core.results import RadarFrame
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveform import Fmcw
from scarl_sionna.signal.processing import virtual_cube

MOST_FRAME = 1_000_000_000
"""Largest frame that is read [bytes]; a description that claims more is not believed."""

LEVELS = "levels are relative: give full_scale_dbm= for absolute ones; noise figure and pattern are the defaults"
"""Note of a capture whose full scale nobody told."""

ReadFrame = Callable[[int], npt.NDArray[np.int16]]
"""From a number of a frame to its I and Q, shape (num_rx, num_chirps_total, num_samples, 2)."""


@dataclass(frozen=True, eq=False, repr=False)
class Capture(Described):
    """Frames of one real radar; each is read when it is asked for.

    ``capture[k]`` is frame k as :class:`RadarFrame`, which :func:`scarl_sionna.range_doppler` takes;
    ``capture.cube(k)`` is its cube, with the format's calibration where it brings one. The radar is at the origin of
    the world: a capture does not tell where it was.

    Attributes
    ----------
    format : str
        Name of the format.
    radar : RadarSpec
        What the capture's own description says; see `notes` for the rest.
    num_frames : int
        Whole frames.
    timestamp_ns : ndarray of int64, shape (num_frames,)
        Time of each frame [ns].
    notes : tuple of str
        What was taken for granted, or left out.
    scale : float
        Value of one step [sqrt(W)].
    read : callable
        From the number of a frame to its I and Q, shape (num_rx, num_chirps_total, num_samples, 2).
    calibration : ndarray of complex64, shape (num_rx, num_chirps_total, num_samples) or broadcast to it, or None
        By what `cube` multiplies the raw data.
    """

    format: str
    radar: RadarSpec
    num_frames: int
    timestamp_ns: npt.NDArray[np.int64]
    notes: tuple[str, ...]
    scale: float
    read: ReadFrame
    calibration: npt.NDArray[np.complex64] | None = None

    def _facts(self) -> Iterable[Row]:
        yield "format", self.format
        yield "num_frames", str(self.num_frames)
        if self.num_frames > 1:
            yield "duration", quantity(float(self.timestamp_ns[-1] - self.timestamp_ns[0]) * 1e-9, "s")
        yield "radar", short(self.radar)
        yield from (("note", note) for note in self.notes)

    def __len__(self) -> int:
        return self.num_frames

    def __iter__(self) -> Iterator[RadarFrame]:
        return (self[index] for index in range(self.num_frames))

    @overload
    def __getitem__(self, index: int) -> RadarFrame: ...

    @overload
    def __getitem__(self, index: slice) -> list[RadarFrame]: ...

    def __getitem__(self, index: int | slice) -> RadarFrame | list[RadarFrame]:
        if isinstance(index, slice):
            return [self[position] for position in range(*index.indices(self.num_frames))]
        number = range(self.num_frames)[index]
        about = {"format": self.format, "frame": number}
        return RadarFrame(self.radar, Pose(), self.read(number), self.scale, diagnostics=about)

    def cube(self, index: int) -> npt.NDArray[np.complex64]:
        """Return the calibrated data of a frame by transmit-receive pair.

        Parameters
        ----------
        index : int
            Number of the frame, from 0.

        Returns
        -------
        ndarray of complex64, shape (num_virtual, num_chirps, num_samples)
            As :func:`scarl_sionna.virtual_cube`; its unit is sqrt(W) only if the converter's full scale was given.

        Raises
        ------
        InputFileError
            If the file is shorter than its description says, or cannot be read.
        """
        adc = self[index].adc
        return virtual_cube(adc if self.calibration is None else adc * self.calibration, self.radar)

    def burst(self, start: int = 0, stop: int | None = None) -> Capture:
        """Return frames of one chirp each as one frame, whose chirps they are.

        Vibrations and breathing are often recorded so: a chirp a millisecond, with the time from frame to frame as the
        chirp interval. Velocities and Doppler then follow from :func:`scarl_sionna.range_doppler` as of any frame.

        Parameters
        ----------
        start, stop : int
            Frames from `start` to before `stop`; left out: all.

        Returns
        -------
        Capture
            One frame of ``stop - start`` chirps; all of them are read at once.

        Raises
        ------
        ParameterRangeError
            If a frame has more than one chirp, there are fewer than two, or they are not equally far apart in time.
        InputFileError
            If they are more than 1 GB.
        """
        numbers = range(*slice(start, stop).indices(self.num_frames))
        steps = np.diff(self.timestamp_ns[numbers.start : numbers.stop])
        wave = self.radar.waveform
        if self.radar.num_chirps_total != 1 or not isinstance(wave, Fmcw):
            raise ParameterRangeError("capture", f"{self.radar.num_chirps_total} chirps a frame", "one chirp a frame")
        if len(numbers) < 2:
            raise ParameterRangeError("start, stop", f"{len(numbers)} frames", f"two or more of {self.num_frames}")
        if np.ptp(steps) > 1 or steps[0] * 1e-9 <= wave.chirp_interval:
            raise ParameterRangeError(
                "capture", f"frames {steps.min()} to {steps.max()} ns apart", "equal times, longer than a chirp"
            )
        check_frame_size(4 * len(numbers) * self.radar.num_rx * self.radar.num_samples, "a burst")
        idle = float(steps[0]) * 1e-9 - wave.ramp_time

        def read(_: int) -> npt.NDArray[np.int16]:
            return np.concatenate([self.read(number) for number in numbers], axis=1)

        return replace(
            self,
            radar=self.radar.with_(num_chirps=len(numbers), idle_time=idle),
            num_frames=1,
            timestamp_ns=self.timestamp_ns[numbers.start : numbers.start + 1],
            read=read,
        )


def check_frame_size(num_bytes: int, path: object) -> int:
    """Return the size of a frame if it is one that is read.

    Raises
    ------
    InputFileError
        If it is larger than `MOST_FRAME`.
    """
    if num_bytes > MOST_FRAME:
        raise InputFileError(
            f"would have frames of {num_bytes} bytes, at most {MOST_FRAME} are read", path, "correct the description"
        )
    return num_bytes
