"""The radar that listens: when its receiver samples, what it mixes with, and what its filter lets through."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.fft

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveforms.coded import is_coded, window_start
from scarl_sionna.signal.front_end.filters import transfer

from .emission import rows_of

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

OVER = 4
"""Rate before the filter over that of the samples: the band, and as much again and a half on either side."""
CORNERS = 12.0
"""That rate over the corner of a low pass, at least: what is left out lies 3.6 corners away, 44 dB down at order 4."""
FLAT, ZERO = 0.3, 0.5
"""Where what is left out before the filter begins and ends, over the rate; the filter stops it anyway."""
EDGE = 0.1
"""Width of the ideal filter's edges over the sample rate: a step would ring over the whole row."""
PAD = 32
"""Samples before and after a row that are computed with it, so that the filter has settled."""
SETTLED = 8.0
"""Time constants of a high pass that are computed before a row."""


@dataclass(frozen=True, eq=False)
class Listener:
    """A radar's receiver in time.

    Attributes
    ----------
    radar : RadarSpec
    ramp : ndarray of float64, shape (num_rows,)
        Starts of the chirps in the frame [s].
    first : float
        From there to the first sample [s].
    carrier : ndarray of float64, shape (num_rows,)
        What it mixes with at a chirp's start [Hz].
    slope : float
        [Hz/s]
    sign : int
        -1 where it mixes transmit times conj(receive), as ramps do; +1 where it samples what arrives.
    copies : int
        Rows of the raw data that share a chirp.
    repetitions : int
        Periods that are averaged.
    over, pad : int
        Rate before the filter over that of the samples, and samples before and after a row.
    middle : float
        Of the frequencies before the filter, of receive times conj(mixer) [Hz].
    """

    radar: RadarSpec
    ramp: Array
    first: float
    carrier: Array
    slope: float
    sign: int
    copies: int
    repetitions: int
    over: int
    pad: int
    middle: float

    @classmethod
    def of(cls, radar: RadarSpec) -> Listener:
        """Return the receiver of a radar."""
        waveform, filters = radar.waveform, radar.front_end.filters
        start, chirp, _ = rows_of(radar)
        steps, rate = waveform.chirp_frequencies, radar.sample_rate
        over, pad, middle = OVER, PAD, 0.0
        if filters is not None and filters.high_pass:
            pad = max(pad, math.ceil(SETTLED * rate / (2.0 * np.pi * min(filters.high_pass))))
        if filters is not None and filters.low_pass is not None:
            over = max(over, math.ceil(CORNERS * filters.low_pass / rate))
        elif not is_coded(waveform) and not radar.adc.is_real:
            middle = -0.5 * math.copysign(rate, waveform.sweep.slope)
        if is_coded(waveform):
            first, slope, carrier = window_start(waveform), 0.0, np.full(len(start), waveform.carrier_frequency)
        else:
            first, slope = waveform.sweep.first, waveform.sweep.slope
            carrier = np.full(len(start), waveform.sweep.start_frequency)
            carrier += 0.0 if steps is None else np.asarray(steps)[chirp]
        return cls(
            radar=radar,
            ramp=start,
            first=first,
            carrier=carrier,
            slope=slope,
            sign=1 if is_coded(waveform) else -1,
            copies=radar.num_chirps_total // len(start),
            repetitions=waveform.repetitions if is_coded(waveform) else 1,
            over=over,
            pad=pad,
            middle=middle,
        )

    @property
    def rate(self) -> float:
        """Samples a second before the filter [Hz]."""
        return self.over * self.radar.sample_rate

    @property
    def count(self) -> int:
        """Samples of a row, all repetitions."""
        return self.radar.num_samples * self.repetitions

    @property
    def time(self) -> Array:
        """Times before the filter, after a chirp's start [s], shape (num_before,)."""
        steps = np.arange(-self.pad * self.over, (self.count + self.pad) * self.over)
        return self.first + steps / self.rate

    @property
    def size(self) -> int:
        """Length of the transforms of a row."""
        return int(scipy.fft.next_fast_len(len(self.time)))

    def taper(self, frequency: Array) -> Array:
        """Return the weight of what has some frequency before the filter: 1 in and about the band, 0 far from it."""
        share = (np.abs(frequency - self.middle) / self.rate - FLAT) / (ZERO - FLAT)
        return np.asarray(np.cos(0.5 * np.pi * np.clip(share, 0.0, 1.0)) ** 2)

    def filter(self, mirrored: bool = False) -> tuple[Array, Complex]:
        """Return frequencies [Hz] and the filter's transfer, as of `scipy.fft.fft`; of the conjugate if `mirrored`.

        The filters of the front end; without a low pass one whose noise bandwidth is the sample rate, with the edges of
        a root raised cosine: of ramps it lets through the echoes' beat frequencies, where I alone is sampled those of
        both signs below half of the rate; of symbols the band about the carrier.
        """
        frequency = scipy.fft.fftfreq(self.size, 1.0 / self.rate)
        middle = -self.middle if mirrored else self.middle
        frequency = frequency + self.rate * np.rint((middle - frequency) / self.rate)  # about the middle
        filters, rate = self.radar.front_end.filters, self.radar.sample_rate
        gain = np.ones(self.size, dtype=np.complex128) if filters is None else transfer(filters, frequency)
        if filters is None or filters.low_pass is None:
            share = (np.abs(frequency - self.middle) / rate - 0.5) / EDGE + 0.5
            gain = gain * np.cos(0.5 * np.pi * np.clip(share, 0.0, 1.0))
        return frequency, np.asarray(gain)

    def sampled(self, spectrum: Complex) -> Complex:
        """Return the samples of a row from its spectrum behind the filter, shape (num_samples,)."""
        values = scipy.fft.ifft(spectrum)[self.pad * self.over :: self.over][: self.count]
        return np.asarray(values)
