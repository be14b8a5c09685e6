"""Phase noise, ripple of the ramps and jitter of their starts: phases that depend on the delay of an echo."""

from __future__ import annotations

import copy

import numpy as np
import numpy.typing as npt
import scipy.fft

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.radar.impairments import PhaseNoise
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveforms.coded import is_coded

Array = npt.NDArray[np.float64]


def mask_density(noise: PhaseNoise, frequency: Array) -> Array:
    """Return the two-sided power density of the phase [rad2/Hz] at offsets [Hz].

    By definition of the mask: the level in dBc/Hz is linear over the logarithm of the offset, and held outside.
    """
    offset, level = np.array(noise.mask, dtype=np.float64).T
    place = np.log10(np.maximum(np.abs(frequency), offset[0]))
    return np.asarray(10.0 ** (np.interp(place, np.log10(offset), level) / 10.0))


def residual_density(noise: PhaseNoise, frequency: Array, delay: float) -> Array:
    """Return the density of the beat signal's phase [rad2/Hz] for an echo of some delay [s] and one oscillator.

    References
    ----------
    .. [1] M. C. Budge, M. P. Burt, "Range correlation effects in radars", Proc. IEEE National Radar Conf., 1993.
    """
    return mask_density(noise, frequency) * 4.0 * np.sin(np.pi * frequency * delay) ** 2


class Oscillators:
    r"""Phases of a frame's oscillators, and starts of its ramps.

    Parameters
    ----------
    radar : RadarSpec
        Whose rows hold one transmitter each.
    rng : numpy.random.Generator or None
        None leaves out all that is random: noise and jitter.

    Raises
    ------
    ParameterRangeError
        If there are errors of ramps, and the waveform has none.

    Notes
    -----
    A record of the phase runs over the whole frame at the sample rate, so that chirps are correlated as far as the mask
    says. An echo of delay tau has the phase ``phi_rx(t) - phi_tx(t - tau)``, exactly, for any tau; with one oscillator
    that is the range correlation ``4 sin(pi f tau)**2``. Offsets beyond half the sample rate are left out, as behind an
    ideal filter. Starts of ramps are rounded to samples, the same for both terms. A ramp that starts early by d has the
    beat phase ``2 pi slope tau d``, a ripple of phase theta ``theta(t_s) - theta(t_s - tau)``.

    What one radar sends and another hears (:meth:`heard_by`) has the oscillators and starts of each: phases that are
    independent whatever the delay, and for ramps that start early by :math:`d_t` and :math:`d_r`, while their carriers
    run on,

    .. math:: 2 \pi S \, [\tau d_t - (d_t - d_r) t_s - (d_t^2 - d_r^2) / 2]

    Symbols are sampled as they arrive, mixed with the receiver's oscillator: their phase is the opposite one. Periods
    that are averaged have the mean of its phasors.
    """

    def __init__(self, radar: RadarSpec, rng: np.random.Generator | None) -> None:
        self.radar, front = radar, radar.front_end
        noise, errors = front.phase_noise, front.chirp_errors
        if errors is not None and not hasattr(radar.waveform, "chirp_slope"):
            raise ParameterRangeError(
                "front_end.chirp_errors", "given", "None: the waveform has no ramps", "use phase_noise, which any has"
            )
        latest = radar.frame_time + max(radar.waveform.chirp_delays or (0.0,))
        count = scipy.fft.next_fast_len(int(np.ceil(latest * radar.sample_rate)) + self._window)
        self._frequency = scipy.fft.rfftfreq(count, 1.0 / radar.sample_rate)
        self._count = count
        self.tx = (noise and noise.tx_oscillator) or (0,) * radar.num_tx
        self.rx = (noise and noise.rx_oscillator) or (0,) * radar.num_rx
        self._spectra: dict[int, npt.NDArray[np.complex128]] = {}
        if noise is not None and rng is not None:
            sigma = np.sqrt(0.5 * mask_density(noise, self._frequency) * radar.sample_rate * count)
            sigma[0] = 0.0  # a constant phase is no noise
            for number in sorted({*self.tx, *self.rx}):
                draws = rng.standard_normal((2, len(sigma)))
                self._spectra[number] = sigma * (draws[0] + 1j * draws[1])
        shape = (radar.num_chirps, radar.num_tx)
        jitter = errors.start_jitter if errors is not None and rng is not None else 0.0
        self._early = rng.normal(0.0, jitter, shape) if jitter and rng is not None else np.zeros(shape)
        self._sent, self._sent_early = self._spectra, self._early

    def heard_by(self, receiver: Oscillators) -> Oscillators:
        """Return the phases of what this radar sends in the receiver of a radar, that one's own or another's.

        By definition each has its own oscillators and starts of ramps.
        """
        if receiver is self:
            return self
        pair = copy.copy(receiver)
        pair._sent, pair._sent_early = self._spectra, self._early
        return pair

    @property
    def _are_two(self) -> bool:
        """Whether transmitters and receivers are those of two radars."""
        return self._sent is not self._spectra

    @property
    def _repetitions(self) -> int:
        waveform = self.radar.waveform
        return waveform.repetitions if is_coded(waveform) else 1

    @property
    def _window(self) -> int:
        """Samples of a chirp before periods are averaged."""
        return self._repetitions * self.radar.num_samples

    def factor(self, tx: int, rx: int, delay: float) -> npt.NDArray[np.complex64]:
        """Return what the samples of an echo are multiplied with, shape (num_chirps, num_samples)."""
        phase, radar = self.phase(tx, rx, delay), self.radar
        if not is_coded(radar.waveform):
            return np.exp(1j * phase).astype(np.complex64)
        each = np.exp(-1j * phase).reshape(radar.num_chirps, self._repetitions, radar.num_samples)
        return np.asarray(each.mean(axis=1), dtype=np.complex64)

    def phase(self, tx: int, rx: int, delay: float) -> Array:
        """Return the phase of an echo in a beat signal [rad], shape (num_chirps, repetitions * num_samples)."""
        radar = self.radar
        out = np.zeros((radar.num_chirps, self._window))
        if self._spectra:
            turn = np.exp(-2j * np.pi * self._frequency * delay)
            record = scipy.fft.irfft(self._spectra[self.rx[rx]] - self._sent[self.tx[tx]] * turn, self._count)
            start = np.arange(radar.num_chirps) * radar.doppler_interval + radar.tx_delay(tx)
            start += np.asarray(radar.waveform.chirp_delays or 0.0)
            out += record[np.rint(start * radar.sample_rate).astype(np.intp)[:, None] + np.arange(self._window)]
        errors = radar.front_end.chirp_errors
        if errors is not None:
            slope, early = radar.waveform.sweep.slope, self._sent_early[:, tx, None]
            out += 2.0 * np.pi * slope * delay * early
            if self._are_two:
                own = self._early[:, tx, None]
                after = radar.waveform.sweep.first + np.arange(radar.num_samples) / radar.sample_rate
                out -= 2.0 * np.pi * slope * (early - own) * (after + 0.5 * (early + own))
            time = np.arange(radar.num_samples) / radar.sample_rate
            rate = 2.0 * np.pi * errors.ripple_periods * radar.sample_rate / radar.num_samples
            peak = 2.0 * np.pi * errors.ripple_frequency_error / rate
            out += peak * (np.cos(rate * (time - delay)) - np.cos(rate * time))
        return out

    def power(self, delay: float) -> float:
        """Return the variance of an echo's phase noise [rad2], by the integral of its density, and of its jitter."""
        front, radar, total = self.radar.front_end, self.radar, 0.0
        if self._spectra and front.phase_noise is not None:
            step = self._frequency[1]
            if len(self._spectra) > 1 or self._are_two:
                total += float(4.0 * mask_density(front.phase_noise, self._frequency[1:]).sum() * step)
            else:
                total += float(2.0 * residual_density(front.phase_noise, self._frequency[1:], delay).sum() * step)
        if front.chirp_errors is not None:
            turn = 2.0 * np.pi * radar.waveform.sweep.slope * front.chirp_errors.start_jitter
            early = (turn * delay) ** 2
            if self._are_two:
                after = radar.waveform.sweep.first + np.arange(radar.num_samples) / radar.sample_rate
                early = float(np.mean((turn * (delay - after)) ** 2 + (turn * after) ** 2))
            total += early + (2.0 * np.pi * front.chirp_errors.ripple_frequency_error * delay) ** 2
        return total
