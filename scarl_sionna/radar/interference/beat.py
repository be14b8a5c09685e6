r"""The beat of another radar's signal with a receiver's mixer, behind its filter, sample by sample.

With the phase of what is sent, that of the mixer and the one-way delay tau(t) = L(t) / c, what the mixer gives is ``a
exp(2j pi (sent(t - tau) - mixer(t)))``, conjugated for ramps. It sweeps through the receiver's band, or stays in it. It
is computed at several times the sample rate, without what is far outside of the band, filtered by the transfer function
itself, and only then sampled. Antennas see it later by differences of delay that are multiplied in exactly.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import finufft
import numpy as np
import numpy.typing as npt
import scipy.fft

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT, watt_to_dbm
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.synthesis.phase import phasor
from scarl_sionna.signal.front_end.channels import apply_rx
from scarl_sionna.signal.front_end.mixer import image_factors, in_phase

from .emission import Emission
from .listener import Listener

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

BLOCK = 64
"""Times at once for which the lines of a code in the band are summed."""
NUFFT_TOLERANCE = 1e-9
NEAR_COMPRESSION_DB = 10.0
"""Signals stronger than so much below the amplifier's compression point are warned of."""


def synthesize_interference(
    paths: RadarPaths,
    sender: RadarSpec,
    radar: RadarSpec,
    start_time: float = 0.0,
    frame_interval: float | None = None,
    frequency_offset: float = 0.0,
) -> npt.NDArray[np.complex64]:
    r"""Return what the chirps of another radar leave in the raw data of a radar.

    Parameters
    ----------
    paths : RadarPaths
        One-way, from the other radar to the radar that listens, see :func:`one_way_paths`.
    sender : RadarSpec
        The other radar.
    radar : RadarSpec
        The radar that listens.
    start_time : float
        Start of one of the other radar's frames after that of the listening radar's frame [s]. Its frames repeat.
    frame_interval : float, optional
        From frame to frame [s], no shorter than these are; without pause if left out.
    frequency_offset : float
        Of the other radar's carrier from what its waveform says [Hz].

    Returns
    -------
    ndarray of complex64, shape (num_rx, num_chirps_total, num_samples)
        [sqrt(W)], behind the filters before the converter, without noise: it is added to that of
        :func:`scarl_sionna.synthesize`. Real samples are its I, of beat frequencies of both signs.

    Raises
    ------
    ParameterRangeError
        If `frame_interval` is shorter than the sender's frames.

    Warns
    -----
    ScarlWarning
        If the receiver's amplifier would be compressed: that is not modelled for signals of other radars.

    Notes
    -----
    For two ramps of slopes S1 and S2 the beat sweeps at S1 - S2: the burst lasts ``band / |S1 - S2|`` and has the power
    of the path, :math:`P G_t G_r (\lambda / 4 \pi L)^2`. Ramps of one slope stay in the band all the time that their
    delay lets them.

    *Not modelled*: phase noise and errors of the other radar's ramps, compression by it, directions that change over
    the frame (all pairs have the rate of the array centres).

    References
    ----------
    .. [1] G. M. Brooker, "Mutual interference of millimeter-wave radar systems", IEEE Trans. Electromagn. Compat.
       49(1), 2007.
    """
    if frame_interval is not None and not frame_interval >= sender.frame_time * (1.0 - 1e-9):
        allowed = f">= the frame time of the sender, {sender.frame_time:g} s"
        raise ParameterRangeError("frame_interval", f"{frame_interval:g} s", allowed, "leave it out for no pause")
    heard = Listener.of(radar)
    shape = (radar.num_rx, len(heard.ramp), radar.num_samples)
    straight: Complex = np.zeros(shape, dtype=np.complex128)
    image: Complex = np.zeros(shape, dtype=np.complex128)
    geometry = PathGeometry.of(paths, sender, radar)
    _warn_of_compression(geometry, radar)
    interval = frame_interval or sender.frame_time
    begin, end = heard.ramp[0] + heard.time[0], heard.ramp[-1] + heard.time[-1]
    length = geometry.center_length()
    late = float(length.max(initial=0.0)) / SPEED_OF_LIGHT
    sent = Emission.of(sender).repeated(start_time, interval, begin - 1.1 * late - 1e-6, end)
    mixer = radar.front_end.mixer
    for tx in range(sender.num_tx):
        if not sent.factor[:, tx].any():
            continue
        ways = _Ways.of(geometry, paths, tx, radar.num_rx)
        beat = _Beat(heard, sent, tx, frequency_offset)
        for path in range(paths.num_paths):
            for row in range(len(heard.ramp)):
                beat.add(straight[:, row], image[:, row] if mixer is not None else None, row, ways, path)
    if heard.sign < 0:
        straight, image = np.conj(straight), np.conj(image)
    channels = radar.front_end.channels
    if channels is not None:
        straight = apply_rx(straight, channels, heard.sign < 0).astype(np.complex128)
        image = np.conj(apply_rx(np.conj(image), channels, heard.sign < 0)).astype(np.complex128)
    if mixer is not None:
        kept, other = image_factors(mixer)
        straight = kept * straight + other * image
    rows = np.repeat(straight.astype(np.complex64), heard.copies, axis=1)
    return in_phase(rows) if radar.adc.is_real else rows


def _warn_of_compression(geometry: PathGeometry, radar: RadarSpec) -> None:
    amplifier = radar.front_end.amplifier
    level = float(np.sum(np.abs(geometry.amplitude)))
    if amplifier is None or level == 0.0 or watt_to_dbm(level**2) < amplifier.p1db_dbm - NEAR_COMPRESSION_DB:
        return
    warnings.warn(
        f"another radar arrives with up to {watt_to_dbm(level**2):.1f} dBm, near the amplifier's compression point of "
        f"{amplifier.p1db_dbm:g} dBm: what it does to the echoes there is not modelled",
        ScarlWarning,
        stacklevel=4,
    )


@dataclass(frozen=True, eq=False)
class _Ways:
    """Delays and strengths of one transmitter's paths: of the first receiver, and of the others after it."""

    delay: Array
    rate: Array
    acceleration: Array
    apart: Array
    amplitude: Complex

    @classmethod
    def of(cls, geometry: PathGeometry, paths: RadarPaths, tx: int, num_rx: int) -> _Ways:
        lengths = np.stack([geometry.length(tx, rx) for rx in range(num_rx)])
        strengths = np.stack([np.conj(geometry.pair_amplitude(tx, rx)) for rx in range(num_rx)])
        rates = paths.length_rate / SPEED_OF_LIGHT, paths.length_acceleration / SPEED_OF_LIGHT
        return cls(lengths[0] / SPEED_OF_LIGHT, *rates, (lengths - lengths[0]) / SPEED_OF_LIGHT, strengths)

    def at(self, path: int, time: Array) -> Array:
        """Return a path's delay at times in the frame [s]."""
        return np.asarray(self.delay[path] + time * (self.rate[path] + 0.5 * time * self.acceleration[path]))


class _Beat:
    """What one transmitter leaves in a receiver's rows."""

    def __init__(self, heard: Listener, sent: Emission, tx: int, offset: float) -> None:
        self.heard, self.sent, self.tx, self.offset = heard, sent, tx, offset
        self.time, self.size = heard.time, heard.size
        self.frequency, self.gain = heard.filter()
        self.mirror_frequency, self.mirror_gain = heard.filter(mirrored=True)
        self.ends = sent.start + sent.after

    def add(self, straight: Complex, image: Complex | None, row: int, ways: _Ways, path: int) -> None:
        """Add a path to the samples of a row of all receivers, (num_rx, num_samples), and to those of the conjugate."""
        heard = self.heard
        values = self.before_filter(row, ways, path)
        if values is None:
            return
        spectrum = scipy.fft.fft(values, self.size)
        shape = (heard.repetitions, heard.radar.num_samples)
        after = heard.first + np.arange(heard.count) / heard.radar.sample_rate
        mixer = heard.carrier[row] + heard.slope * after
        for rx in range(len(straight)):
            apart = ways.apart[rx, path]
            turn = ways.amplitude[rx, path] * phasor(-mixer * apart)
            seen = heard.sampled(spectrum * self.gain * phasor(-self.frequency * apart)) * turn
            straight[rx] += seen.reshape(shape).mean(axis=0)
            if image is not None:
                mirrored = np.conj(np.roll(spectrum[::-1], 1)) * phasor(-self.mirror_frequency * apart)
                seen = heard.sampled(mirrored * self.mirror_gain) * np.conj(turn)
                image[rx] += seen.reshape(shape).mean(axis=0)

    def before_filter(self, row: int, ways: _Ways, path: int) -> Complex | None:
        """Return the mixer's output for a path of strength 1, without what is far from the band; None if none is."""
        heard, sent = self.heard, self.sent
        time = heard.ramp[row] + self.time
        delay = ways.at(path, time)
        left = time - delay
        some = np.flatnonzero((self.ends > left[0]) & (sent.start - sent.before < left[-1]))
        values: Complex | None = None
        for chirp in some:
            factor = sent.factor[chirp, self.tx]
            if factor == 0.0:
                continue
            u = left - sent.start[chirp]
            carrier = sent.carrier[chirp] + self.offset
            ahead = carrier - heard.carrier[row]
            instant = ahead + sent.slope * u - heard.slope * self.time
            reach = 0.5 * heard.rate
            top, bottom = sent.line[-1], sent.line[0]
            near = (instant + top > heard.middle - reach) & (instant + bottom < heard.middle + reach)
            chosen = np.flatnonzero(near & (u >= -sent.before) & (u < sent.after))
            if not len(chosen):
                continue
            if values is None:
                values = np.zeros(len(time), dtype=np.complex128)
            u, x = u[chosen], self.time[chosen]
            cycles = ahead * time[chosen] - carrier * delay[chosen]
            cycles += 0.5 * (sent.slope * u * u - heard.slope * x * x)
            envelope = self._lines(sent.strength[chirp], instant[chosen], u)
            values[chosen] += factor * envelope * phasor(cycles)
        return values

    def _lines(self, strength: Complex, instant: Array, u: Array) -> Complex:
        """Return the sum of a chirp's lines that are in or about the band, at times u after its start."""
        heard, line = self.heard, self.sent.line
        if len(line) == 1:
            return np.asarray(strength[0] * heard.taper(instant + line[0]) * phasor(line[0] * u))
        if self.sent.slope == heard.slope:
            weighted = strength * heard.taper(instant.mean() + line)
            step = line[1] - line[0]
            turns = 2.0 * np.pi * np.mod(step * u, 1.0)
            middle = line[0] + step * (len(line) // 2)
            summed = finufft.nufft1d2(turns, weighted, eps=NUFFT_TOLERANCE, isign=1, nthreads=1)
            return np.asarray(summed * phasor(middle * u))
        out = np.empty(len(u), dtype=np.complex128)
        for first in range(0, len(u), BLOCK):
            part = slice(first, first + BLOCK)
            lowest, highest = instant[part].min(), instant[part].max()
            reach = 0.5 * heard.rate
            some = np.flatnonzero((line + highest > heard.middle - reach) & (line + lowest < heard.middle + reach))
            weight = heard.taper(instant[part, None] + line[some]) * strength[some]
            out[part] = np.einsum("tl,tl->t", weight, phasor(np.outer(u[part], line[some])))
        return out
