"""Echoes and leakage through a front end that is not ideal: what depends on an echo's delay, group by group."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.specs.radar.multiplexing import IdealMimo
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.tones import seen_by
from scarl_sionna.core.specs.radar.waveforms.coded import Ofdm, Pmcw
from scarl_sionna.core.specs.radar.waveforms.phase_coded import PcFmcw
from scarl_sionna.core.units import SPEED_OF_LIGHT, dbm_to_watt
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.radome import radome_echo
from scarl_sionna.signal.front_end.chain import receive
from scarl_sionna.signal.front_end.oscillators import Oscillators
from scarl_sionna.signal.noise import sample_noise_power

from . import direct
from .coded.symbols import modulated
from .phase import chirps_of, phasor

Adc = npt.NDArray[np.complex64]
Index = npt.NDArray[np.intp]

GROUP_RATIO = 1.1
"""Longest over shortest delay of a group: its noise is off by less than 10 % of itself (-20 dB) near the carrier."""
BELOW_NOISE = 0.01
"""Groups whose oscillator noise is below this part of the thermal noise get none."""


def received(
    paths: RadarPaths,
    radar: RadarSpec,
    rng: np.random.Generator | None,
    signal: Callable[[RadarPaths, RadarSpec], Adc],
    lines: Oscillators | None = None,
) -> Adc:
    """Return the raw data of a radar whose front end is not ideal, whose radome sends something back, or that has no Q.

    Parameters
    ----------
    paths : RadarPaths
    radar : RadarSpec
    rng : numpy.random.Generator or None
        None leaves out all that is random: thermal and phase noise, jitter.
    signal : callable
        Paths and a radar with an ideal front end -> its raw data without noise.
    lines : Oscillators, optional
        Phases of its oscillators and ramps; drawn if left out (:func:`oscillators`).

    Returns
    -------
    ndarray of complex64, shape (num_rx, num_chirps_total, num_samples)
        [sqrt(W)]

    Notes
    -----
    Errors of the oscillators and ramps turn the phase of an echo by an amount that depends on its delay. Echoes whose
    delays are within `GROUP_RATIO` share that of the group's mean delay, weighted by power. Groups too weak to matter
    (`BELOW_NOISE`) get none.

    References
    ----------
    .. [1] M. C. Budge, M. P. Burt, "Range correlation effects in radars", Proc. IEEE National Radar Conf., 1993.
    """
    alone = radar.separated
    plain = alone.with_(
        front_end=alone.front_end.ideal(), array=alone.array.without_echo(), adc=alone.adc.with_(sampling="complex")
    )
    if radar.adc.is_real and (radar.front_end.filters is None or radar.front_end.filters.low_pass is None):
        paths = below_half_rate(paths, radar)
    if lines is None:
        lines = oscillators(radar, rng)
        if lines is not None and not paths.is_monostatic:
            lines = Oscillators(alone, rng).heard_by(lines)
    total = signal(paths, plain) if lines is None else _with_lines(paths, plain, lines, signal, rng is not None)
    if paths.is_monostatic:  # a separate receiver has no way within the sensor
        for way in radar.front_end.leakage:
            total += _leak(way.length, way.level_db, way.phase_deg, plain, lines)
        if radar.array.has_echo:
            total += _radome_echo(plain, lines)
    return receive(total, radar, rng)


def oscillators(radar: RadarSpec, rng: np.random.Generator | None) -> Oscillators | None:
    """Return the phases of a radar's oscillators and ramps in a frame, by its front end; None if there are none."""
    front = radar.front_end
    return None if front.phase_noise is None and front.chirp_errors is None else Oscillators(radar.separated, rng)


def _with_lines(
    paths: RadarPaths, plain: RadarSpec, lines: Oscillators, signal: Callable[[RadarPaths, RadarSpec], Adc], noisy: bool
) -> Adc:
    """Return the echoes with the phases of oscillators and ramps."""
    geometry = PathGeometry.of(paths, plain)
    delay = geometry.center_length() / SPEED_OF_LIGHT
    power = geometry.mean_power() if paths.num_paths else np.zeros(0)
    least = BELOW_NOISE * sample_noise_power(plain) if noisy else 0.0
    total = np.zeros((plain.num_rx, plain.num_chirps_total, plain.num_samples), dtype=np.complex64)
    clean: list[Index] = []
    weak = least
    for index, middle in sorted(groups(delay, power), key=lambda item: power[item[0]].sum() * lines.power(item[1])):
        weak -= float(power[index].sum()) * lines.power(middle)  # the weakest groups may have so much in all
        if weak >= 0.0:
            clean.append(index)
            continue
        echoes = signal(paths.select(index), plain)
        total += turned(echoes, plain, lines, middle)
    if clean or not paths.num_paths:
        rest = np.sort(np.concatenate(clean)) if clean else np.arange(0)
        total += signal(paths.select(rest), plain)
    return total


def below_half_rate(paths: RadarPaths, radar: RadarSpec) -> RadarPaths:
    """Return the paths whose beat frequencies are below half of the rate of real samples: an ideal filter before them.

    By definition of the unambiguous range.

    Warns
    -----
    ScarlWarning
        If there are others: only a low pass that is stated lets them through, and they fold.
    """
    length = PathGeometry.of(paths, radar).center_length()
    beyond = length >= 2.0 * radar.max_range
    if not beyond.any():
        return paths
    warnings.warn(
        f"{int(beyond.sum())} of {paths.num_paths} paths are longer than twice the unambiguous range of "
        f"{radar.max_range:.4g} m of real samples (up to {length.max():.4g} m) and are filtered out before sampling; "
        "sample faster, or state the filter (IfFilter.low_pass) to see what it lets through, folded",
        ScarlWarning,
        stacklevel=5,
    )
    return paths.select(~beyond)


def groups(delay: npt.NDArray[np.float64], power: npt.NDArray[np.float64]) -> list[tuple[Index, float]]:
    """Return groups of paths of similar delay and the mean delay of each, weighted by power [s]."""
    out = []
    number = np.floor(np.log(np.maximum(delay, 1e-12)) / np.log(GROUP_RATIO)).astype(np.int64)
    for value in np.unique(number):
        index = np.flatnonzero(number == value)
        weight = power[index] if power[index].sum() > 0.0 else np.ones(len(index))
        out.append((index, float(np.average(delay[index], weights=weight))))
    return out


def turned(echoes: Adc, radar: RadarSpec, lines: Oscillators, delay: float) -> Adc:
    """Return raw data, a transmitter a row, with the phases that echoes of some delay [s] have."""
    out = np.empty_like(echoes)
    for tx in range(radar.num_tx):
        known: dict[int, npt.NDArray[np.complex64]] = {}
        for rx in range(radar.num_rx):
            oscillator = lines.rx[rx]
            if oscillator not in known:
                known[oscillator] = lines.factor(tx, rx, delay)
            out[rx, tx :: radar.num_tx] = echoes[rx, tx :: radar.num_tx] * known[oscillator]
    return out


def _leak(length: float, level_db: float, phase_deg: float, plain: RadarSpec, lines: Oscillators | None) -> Adc:
    """Return what leaks into every receiver from every transmitter over a fixed way."""
    power = dbm_to_watt(plain.front_end.tx_power_dbm + level_db)
    amplitude = complex(np.sqrt(power) * np.exp(1j * np.radians(phase_deg)))
    leak = np.empty((plain.num_rx, plain.num_chirps_total, plain.num_samples), dtype=np.complex64)
    for tx in range(plain.num_tx):
        leak[:, tx :: plain.num_tx] = _way(amplitude, length, plain, tx)
    return leak if lines is None else turned(leak, plain, lines, length / SPEED_OF_LIGHT)


def _radome_echo(plain: RadarSpec, lines: Oscillators | None) -> Adc:
    """Return what the radome sends back from every transmitter into every receiver."""
    echo = radome_echo(plain)
    out = np.zeros((plain.num_rx, plain.num_chirps_total, plain.num_samples), dtype=np.complex64)
    for tx in range(plain.num_tx):
        for rx in range(plain.num_rx):
            amplitude, length = np.conj(echo.amplitude[tx, rx]), float(echo.length[tx, rx])
            out[rx, tx :: plain.num_tx] = _way(complex(amplitude), length, plain, tx)
    return out if lines is None else turned(out, plain, lines, float(echo.length.mean()) / SPEED_OF_LIGHT)


def _way(amplitude: complex, length: float, radar: RadarSpec, tx: int) -> npt.NDArray[np.complexfloating]:
    """Return what comes over a fixed way [m] with an amplitude [sqrt(W)], shape (num_chirps or 1, num_samples)."""
    still, own = np.zeros(1), radar.waveform_of(tx)
    columns = np.array([amplitude]), np.array([length]), still, still
    if isinstance(own, Ofdm | Pmcw):
        alike = radar.with_(multiplexing=IdealMimo(), waveform=own)
        signal = direct.sum_paths(*columns, seen_by(alike, every=True), 0)
        return modulated(lambda tx, rx: signal, alike, own, 0, {0: np.ones(own.num_samples)})(0, 0)
    if isinstance(own, PcFmcw):
        beat = direct.sum_paths(*columns, radar.with_(multiplexing=IdealMimo(), waveform=own.ramps()), 0)
        if own.coding == "across":
            return np.asarray(beat * np.conj(own.by_chirp)[:, None])
        ts = own.adc_start_time + np.arange(own.num_samples) / own.sample_rate
        frequency, strength = own.lines
        return np.asarray(beat * np.conj(phasor(np.outer(ts - length / SPEED_OF_LIGHT, frequency)) @ strength))
    one = radar.waveform.chirp_frequencies is None  # for all
    return direct.sum_paths(*columns, chirps_of(radar, 0, 1) if one else radar, tx)
