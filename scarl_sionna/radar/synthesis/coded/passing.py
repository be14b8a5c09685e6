r"""The change from a chirp's factor to the next one's in a code that is sent all the time.

Without a prefix a code passes from chirp to chirp without a pause. Where chirps have factors of their own (Doppler
division, binary phases), what arrives in the first tau of a receiver's window has that of the chirp before. With the
factors F_m a window holds, instead of ``F_m c(t - tau)``,

.. math:: F_m c(t - \tau) + (F_{m-1} - F_m) g(t - \tau) c(t - \tau)

where g falls from 1 to 0 in the `CHANGE` chips after the chirp's start. The end of the code, ``g c``, is made of tones
in a period of its own, some delays long, so that the transforms of codes make it.
"""

from __future__ import annotations

import math
import warnings

import numpy as np
import numpy.typing as npt
import scipy.fft
from pydantic import Field

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveforms.coded import Pmcw
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.paths import RadarPaths

from .symbols import Signal

Complex = npt.NDArray[np.complex128]

CHANGE = 4
"""Chips that a factor takes to become the next one, as a raised cosine."""
BAND = 1.5
"""Tones of the end over its chips: a change within so many chips takes more band than the code."""
FINE = 4
"""Samples a chip from which the tones are made."""
SHARE = 0.2
"""Share of the tolerance of a frame that this part of it may take."""
COARSEST = 1e-2
"""Largest tolerance asked of it."""


class End(Pmcw):
    """The last chips of a code, before nothing, in a period of its own; of a code alone in a frame's synthesis.

    By definition.
    """

    code_length: int = Field(ge=2, description="chips of the period")
    of_code: Pmcw
    reach: int = Field(ge=1, description="chips of the longest delay")

    @property
    def chips(self) -> Complex:
        """Chips of the whole code."""
        return self.of_code.chips

    @property
    def sent(self) -> npt.NDArray[np.intp]:
        """Tones, some below and above those of the samples."""
        half = math.ceil(0.5 * BAND * self.code_length)
        return np.arange(-half, half) + self.code_length // 2

    @property
    def spectrum(self) -> Complex:
        """Strengths of the tones, shape (1, num_sent)."""
        code, period = self.of_code, FINE * self.code_length
        lines = np.zeros(FINE * code.code_length, dtype=np.complex128)
        lines[np.arange(code.code_length) - code.code_length // 2] = code.spectrum[0]
        chips = np.fft.ifft(lines, norm="forward")
        place = np.arange(period)
        place = np.where(place < FINE * (self.reach + CHANGE), place, place - period)
        falls, rises = place / (FINE * CHANGE), (place / FINE + self.reach) / CHANGE + 1.0
        level = (
            np.cos(0.5 * np.pi * np.clip(falls, 0.0, 1.0)) ** 2 * np.sin(0.5 * np.pi * np.clip(rises, 0.0, 1.0)) ** 2
        )
        strength = np.fft.fft(level * chips[place % len(chips)], norm="forward")
        return np.asarray(strength[None, self.sent - self.code_length // 2])

    @property
    def chirp_interval(self) -> float:
        """Time from chirp to chirp of the code [s]."""
        return self.of_code.chirp_interval


def changes(codes: Complex | None, radar: RadarSpec) -> Complex | None:
    """Return (F_{m-1} - F_m) / F_m for each chirp and transmitter, (num_chirps, num_tx); None if nothing changes.

    Before the first chirp its own factor was sent. None, too, for waveforms that pause, or have a prefix.
    """
    waveform = radar.waveform
    if codes is None or not isinstance(waveform, Pmcw) or math.isfinite(waveform.prefix_time):
        return None
    change = np.zeros_like(codes)
    change[1:] = codes[:-1] / codes[1:] - 1.0
    return change if np.abs(change).max(initial=0.0) > 1e-12 else None


def end_of(paths: RadarPaths, radar: RadarSpec) -> RadarSpec:
    """Return a radar that sends the end of the code, as long as the longest delay of some paths.

    Warns
    -----
    ScarlWarning
        If that is longer than a chirp.
    """
    waveform = radar.waveform
    assert isinstance(waveform, Pmcw)  # by the caller
    arms = sum(float(np.linalg.norm(array, axis=1).max()) for array in (radar.tx_array, radar.rx_array))
    length = PathGeometry.of(paths, radar).center_length() + arms
    length = length + radar.frame_time * (
        np.abs(paths.length_rate) + radar.frame_time * np.abs(paths.length_acceleration)
    )
    chips = math.ceil(float(length.max()) / SPEED_OF_LIGHT * waveform.chip_rate)
    reach = min(chips, waveform.repetitions * waveform.code_length - CHANGE)
    if reach < chips:
        warnings.warn(
            f"paths of up to {float(length.max()):.4g} m are longer than a chirp of "
            f"{waveform.chirp_interval * 1e6:.4g} us: what arrives of them has the factor of the chirp before, not "
            "of one before that; more repetitions make chirps longer",
            ScarlWarning,
            stacklevel=5,
        )
    end = End(
        carrier_frequency=waveform.carrier_frequency,
        chip_rate=waveform.chip_rate,
        num_chirps=waveform.num_chirps,
        repetitions=1,
        code_length=scipy.fft.next_fast_len(2 * (reach + CHANGE)),
        of_code=waveform,
        reach=reach,
    )
    return radar.model_copy(update={"waveform": end})


def tolerances(
    radar: RadarSpec, end: RadarSpec, tolerance: float | None, motion: float | None
) -> tuple[float | None, float | None]:
    """Return the tolerances of the transforms and of the motion of the end, from those of the frame."""
    assert isinstance(end.waveform, End) and isinstance(radar.waveform, Pmcw)  # by the caller
    size = 2.0 * math.ceil((end.waveform.reach + CHANGE) / radar.num_samples) / radar.waveform.repetitions
    known = (None if value is None else min(SHARE * value / size, COARSEST) for value in (tolerance, motion))
    return next(known), next(known)


def passed(signal: Signal, radar: RadarSpec, end: RadarSpec, change: Complex) -> Signal:
    """Return what makes the samples of a pair from those of the end of the code.

    Parameters
    ----------
    signal : callable
        Of the end, some chirps.
    radar, end : RadarSpec
        With the code, and with its end.
    change : ndarray of complex128, shape (num_chirps, num_tx)
        Of these chirps.
    """
    waveform, count = radar.waveform, radar.num_samples
    assert isinstance(end.waveform, End) and isinstance(waveform, Pmcw)  # by the caller
    reach = end.waveform.reach + CHANGE
    periods = math.ceil(reach / count)

    def of_pair(tx: int, rx: int) -> npt.NDArray[np.complexfloating]:
        if not change[:, tx].any():
            return np.zeros((0, count), dtype=np.complex128)
        found = signal(tx, rx)[:, :reach]
        rows = np.zeros((len(found), periods * count), dtype=np.complex128)
        rows[:, :reach] = found * change[: len(found), tx, None]
        return rows.reshape(len(found), periods, count).sum(axis=1) / waveform.repetitions

    return of_pair
