"""Raw beat signals of a heterodyne lidar, and the estimator that works on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from camera_lidar.lidar.detections import NO_ECHO, Detections, keep_strongest, match
from camera_lidar.lidar.returns import Echoes, join, nearest_of
from scarl_sionna.core.specs.lidar.receiver import HeterodyneReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

from .air import air_profile
from .detection import beat_limits, threshold
from .link import full_scale_cnr, mean_cnr
from .tones import Tones, fold, paired

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Signal = npt.NDArray[np.complex64]

_SAMPLES_AT_ONCE = 1 << 21
"""Samples that are worked on at once: 32 MB each temporary array."""
_PADDING = 4
"""Length of the transform over that of the signal: a tone is at most an eighth of a line off, 0.2 dB down, when it is
looked for."""
_REFINEMENTS = (0.25, 0.1, 0.02)
"""Half widths of the parabolas through the power's logarithm by which a peak is found [lines], one after the other."""


def synthesize_beats(spec: LidarSpec, echoes: Echoes, air_velocity: Array, rng: np.random.Generator) -> Signal:
    r"""Return the beat signals of all shots in units of the standard deviation of a noise sample.

    Parameters
    ----------
    spec : LidarSpec
        With a heterodyne receiver.
    echoes : Echoes
        Every ray and surface on its own, by shot.
    air_velocity : ndarray of float64, shape (num_shots,)
        Radial velocity of still air along each shot [m/s].
    rng : numpy.random.Generator
        Speckle, phases and noise.

    Returns
    -------
    ndarray of complex64, shape (num_shots, 2, num_samples)
        Up and down chirp.

    Notes
    -----
    Transmitted times the conjugate of received, as for the radar. With the local time t of a chirp of slope +-S, the
    carrier f_0 in the middle of the chirp, t_m, and a delay :math:`\tau(t) = 2 (R + v (t - t_0)) / c`, where t_0 is the
    shot's time between the two chirps:

    .. math:: \phi(t) = 2 \pi \left( \frac{2 v}{\lambda} t \pm S \tau(t) (t - t_m) \mp \tfrac12 S \tau(t)^2 \right)
        + \phi_0

    Echoes have circular normal amplitudes (fully developed speckle; without speckle: random phases), the same in both
    chirps, so that what falls into one cell adds up alike in both. Fog and rain fill the cells of the range resolution
    up to the first surface. I and Q are clipped at full
    scale. The samples are those in which the return overlaps the chirp: the sweep runs on for the longest delay before
    they begin.
    """
    receiver = spec.receiver
    assert isinstance(receiver, HeterodyneReceiver)
    number = spec.num_samples
    out = np.empty((spec.num_shots, 2, number), dtype=np.complex64)
    amplitude = np.sqrt(mean_cnr(spec, echoes.intensity, echoes.distance) / number) * _amplitudes(
        rng, echoes.number, receiver.speckle
    )
    first = np.searchsorted(echoes.shot, np.arange(spec.num_shots + 1))
    nearest = nearest_of(spec.num_shots, echoes.shot, echoes.distance)
    full_scale = np.sqrt(full_scale_cnr(spec) / number)
    step = max(_SAMPLES_AT_ONCE // (2 * number), 1)
    fog = receiver.backscatter and spec.atmosphere.weather_extinction(spec.wavelength) > 0.0
    for start in range(0, spec.num_shots, step):
        shots = np.arange(start, min(start + step, spec.num_shots))
        block = np.zeros((len(shots), 2, number), dtype=np.complex128)
        if receiver.noise:
            noise = rng.standard_normal((*block.shape, 2)) * np.sqrt(0.5)
            block += noise[..., 0] + 1j * noise[..., 1]
        for echo in range(first[shots[0]], first[shots[-1] + 1]):
            block[echoes.shot[echo] - start] += amplitude[echo] * _tones(
                spec, float(echoes.distance[echo]), float(echoes.radial_velocity[echo])
            )
        if fog:
            block += _fog(spec, nearest[shots], air_velocity[shots], rng)
        if np.isfinite(full_scale):
            block.real, block.imag = (np.clip(part, -full_scale, full_scale) for part in (block.real, block.imag))
        out[shots] = block
    return out


def _amplitudes(rng: np.random.Generator, number: int | tuple[int, ...], speckle: bool) -> npt.NDArray[np.complex128]:
    """Return complex amplitudes of unit mean power."""
    if speckle:
        return (rng.standard_normal(number) + 1j * rng.standard_normal(number)) * np.sqrt(0.5)
    return np.exp(2j * np.pi * rng.random(number))


def _tones(spec: LidarSpec, distance: float, velocity: float) -> npt.NDArray[np.complex128]:
    """Return the beats of one echo of unit amplitude in the up and the down chirp, shape (2, num_samples)."""
    time = np.arange(spec.num_samples) * (spec.chirp_time / spec.num_samples)
    cycles = np.empty((2, spec.num_samples))
    for chirp, (sign, shot_time) in enumerate(((1.0, spec.chirp_time), (-1.0, 0.0))):
        delay = 2.0 * (distance + velocity * (time - shot_time)) / SPEED_OF_LIGHT
        slope = sign * spec.chirp_slope
        chirped = slope * delay * (time - spec.chirp_time / 2.0) - 0.5 * slope * delay**2
        cycles[chirp] = 2.0 * velocity / spec.wavelength * time + chirped
    return np.exp(2j * np.pi * (cycles - np.floor(cycles)))


def _fog(spec: LidarSpec, nearest: Array, air_velocity: Array, rng: np.random.Generator) -> npt.NDArray[np.complex128]:
    """Return the beats of fog and rain: its cells lie on the lines of the transform, half a line off.

    The down chirp runs through the same frequencies backwards: its beats are those of the up chirp in reverse, but for
    the Doppler shift.
    """
    profile, number = air_profile(spec), spec.num_samples
    cells = min(len(profile.cnr), number)
    distance = (np.arange(cells) + 0.5) * spec.range_resolution
    amplitude = _amplitudes(rng, (len(nearest), cells), True) * np.sqrt(profile.cnr[:cells] / number)
    amplitude[distance > nearest[:, None]] = 0.0
    spectrum = np.zeros((len(nearest), number), dtype=np.complex128)
    spectrum[:, :cells] = amplitude
    time = np.arange(number) * (spec.chirp_time / number)
    half_line = np.exp(2j * np.pi * 0.5 * time / spec.chirp_time)
    shift = np.exp(2j * np.pi * (2.0 * air_velocity / spec.wavelength)[:, None] * time)
    delay = (np.arange(number) + 0.5) / spec.bandwidth
    late = np.exp(-1j * np.pi * spec.chirp_slope * delay**2)  # the middle of what overlaps is half a delay later
    up, down = (np.fft.ifft(spectrum * turn, axis=-1) * number * half_line for turn in (late, np.conj(late)))
    return np.stack([up, down[:, ::-1]], axis=1) * shift[:, None, :]


def estimate_beats(spec: LidarSpec, signal: Signal, returns: Echoes) -> Detections:
    """Return what the receiver reports, from raw beat signals.

    Parameters
    ----------
    spec : LidarSpec
    signal : ndarray of complex64, shape (num_shots, 2, num_samples)
    returns : Echoes
        True returns by shot and distance; only to name the surface that a detection comes from.

    Returns
    -------
    Detections

    Notes
    -----
    Of each chirp the strongest line of the transform within the band of beats is taken, refined between the lines, and
    subtracted, up to `max_returns` times. Tones above the threshold count; :func:`.tones.paired` makes
    returns of them.
    """
    chirps: tuple[list[Tones], list[Tones]] = ([], [])
    step = max(_SAMPLES_AT_ONCE // (2 * spec.num_samples), 1)
    for start in range(0, len(signal), step):
        block = signal[start : start + step].astype(np.complex128)
        for chirp, sign in enumerate((1, -1)):
            for tone in strongest_tones(spec, block[:, chirp], sign, spec.max_returns):
                shot = np.flatnonzero(tone[2])
                nothing = np.full(len(shot), NO_ECHO)
                chirps[chirp].append(Tones(shot + start, sign * tone[0][shot], tone[1][shot] + 1.0, nothing))
    found = keep_strongest(paired(spec, join(chirps[0]), join(chirps[1])), spec.max_returns)
    return replace(found, echo=match(spec, found, returns))


Tone = tuple[Array, Array, npt.NDArray[np.bool_]]
"""Frequency [Hz], carrier-to-noise ratio, and whether it is above the threshold, of one tone a signal."""


def strongest_tones(spec: LidarSpec, signal: npt.NDArray[np.complex128], sign: int, number: int) -> list[Tone]:
    r"""Return the strongest tones of signals, strongest first; `signal`, shape (num_signals, num_samples), is used up.

    Notes
    -----
    The highest point of the power spectrum, found by parabolas of smaller and smaller width: of one tone the maximum
    likelihood estimate [1]_, of fog, whose peaks are no tones, still a peak.

    References
    ----------
    .. [1] D. C. Rife, R. R. Boorstyn, "Single-tone parameter estimation from discrete-time observations", IEEE Trans.
       Inf. Theory 20(5), 1974.
    """
    length = signal.shape[1]
    level, highest = threshold(spec), beat_limits(spec)[1]
    line = np.arange(_PADDING * length) / (_PADDING * spec.chirp_time)
    searched = fold(spec, sign * line) <= highest
    sample = np.arange(length)
    tones: list[Tone] = []
    for _ in range(number):
        power = np.abs(np.fft.fft(signal, _PADDING * length, axis=-1))
        power[:, ~searched] = 0.0
        place = np.argmax(power, axis=-1) / _PADDING
        for half in _REFINEMENTS:
            place = _climb(signal, place, half, sample)
        tone = np.exp(2j * np.pi * np.mod(place[:, None] / length * sample, 1.0))
        amplitude = np.einsum("ns,ns->n", np.conj(tone), signal) / length
        signal -= amplitude[:, None] * tone
        frequency = sign * fold(spec, sign * place / spec.chirp_time)
        height = np.abs(amplitude) ** 2 * length
        tones.append((frequency, height - 1.0, height > level))
    return tones


def _climb(signal: npt.NDArray[np.complex128], place: Array, half: float, sample: Index) -> Array:
    """Return the top of the parabola through the logarithm of the power at, below and above a place in lines."""
    below, middle, above = (
        2.0 * np.log(np.abs(_coefficient(signal, place + side, sample)) + 1e-300) for side in (-half, 0.0, half)
    )
    bend = below - 2.0 * middle + above
    step = np.divide(half * (below - above), 2.0 * bend, out=np.zeros_like(bend), where=bend < 0.0)
    return place + np.clip(step, -half, half)


def _coefficient(signal: npt.NDArray[np.complex128], place: Array, sample: Index) -> npt.NDArray[np.complex128]:
    """Return the Fourier coefficient of each signal at its own place in lines of the transform."""
    turn = np.exp(-2j * np.pi * np.mod(place[:, None] / len(sample) * sample, 1.0))
    return np.einsum("ns,ns->n", turn, signal)
