"""Signal of radar paths: what every transmit-receive pair's converter sees, whatever the waveform."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.cores import usable_cores
from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.prompt.arguments import HOW_TO_RADAR, expect, expect_generator
from scarl_sionna.core.settings.accuracy import DEFAULT_ACCURACY, Accuracy
from scarl_sionna.core.specs.radar.multiplexing import IdealMimo
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.tones import seen_by
from scarl_sionna.core.specs.radar.waveforms.coded import is_coded
from scarl_sionna.core.specs.radar.waveforms.phase_coded import PcFmcw
from scarl_sionna.core.units import SPEED_OF_LIGHT, dbm_to_watt, watt_to_dbm
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.radome import settled
from scarl_sionna.signal.front_end.oscillators import Oscillators
from scarl_sionna.signal.multiplexing import multiplex
from scarl_sionna.signal.noise import add_noise

from . import band, direct, groups
from .coded import late, passing, symbols
from .coded import ramps as coded_ramps
from .moving import Signal, Tolerances, linear_signal, moving_signals
from .orders import orders
from .receiver import received

MAX_THREADS = 8
"""Most threads that work on pairs at once: each holds its own strengths and spectra (some 50 MB)."""


def synthesize(
    paths: RadarPaths,
    radar: RadarSpec,
    rng: np.random.Generator | None = None,
    accuracy: Accuracy = DEFAULT_ACCURACY,
    method: Literal["nufft", "direct"] = "nufft",
) -> npt.NDArray[np.complex64]:
    r"""Return the signal of every receiver, as sampled: of ramps de-chirped, of symbols as it arrives.

    Parameters
    ----------
    paths : RadarPaths
        Geometry, transfer and motion at the start of the first ramp.
    radar : RadarSpec
    rng : numpy.random.Generator, optional
        Adds the receiver's thermal noise (:func:`add_noise`), and where the front end has them phase noise and jitter;
        left out: nothing random.
    accuracy : Accuracy
        `synthesis_tolerance` bounds the error of the transforms relative to the peak, `motion_tolerance` that of a
        path's motion relative to its amplitude.
    method : {"nufft", "direct"}
        ``"direct"`` is the exact sum in float64, for reference.

    Returns
    -------
    ndarray of complex64, shape (num_rx, num_chirps_total, num_samples)
        Beat signal [sqrt(W)]: ``abs(sample)**2`` is received power. Row ``m * num_tx + i`` is chirp m of transmitter i;
        of a coded multiplexing row m is chirp m, the sum of all transmitters. Real samples are its I, without imaginary
        part.

    Raises
    ------
    ParameterRangeError
        If a path's length or amplitude is not finite, the method is unknown, or transmitters take turns with a code
        that has no prefix.

    Warns
    -----
    ScarlWarning
        If paths are longer than twice ``radar.max_range``: the receiver of ramps filters them out. If paths are longer
        than the prefix of symbols.

    Notes
    -----
    For transmitter i, receiver j and the time t since the first ramp's start, ts since the ramp's own start,

    .. math:: s_{ij}(t) = \sum_p \bar a_p \sqrt{P G_t G_r}\,
        e^{j 2 \pi (f_0 \tau + S \tau t_s - S \tau^2 / 2)}, \quad
        \tau(t) = L_{ij}(t) / (c + L_{ij}'(t)/2)

    for ramps; symbols are in :mod:`scarl_sionna.radar.synthesis.coded.symbols`.

    *Kept*: exact delay and strength of each pair at every time (spherical wavefronts, end points that move straight on,
    antennas that move and turn with the radar), gains in directions that turn, `over_time` of the paths, motion within
    a ramp, range migration, residual video phase. Paths of which `motion_tolerance` lets it have the rate of the
    array's centre; those of unknown velocities have its rate and acceleration. *Not modelled*: gains and reflection
    differ between antennas only by the array's extent over the distance and are taken at the array's centre, unless
    paths have slopes over it; reflection at the frame's start, unless paths say how it changes; derivatives above the
    second of what is not straight motion.

    References
    ----------
    .. [1] A. Nittur Ramesh et al., "SCaRL", eqs. (2) and (3).
    """
    expect("paths", paths, RadarPaths, "give ss.solve_paths(world.at(time), radar, pose), or ss.point_targets(...)")
    expect("radar", radar, RadarSpec, HOW_TO_RADAR)
    expect_generator(rng, needed=False)
    if method not in ("nufft", "direct"):
        raise ParameterRangeError("method", repr(method), "'nufft' or 'direct'")
    return raw_data(paths, radar, rng, accuracy, method)


def raw_data(
    paths: RadarPaths,
    radar: RadarSpec,
    rng: np.random.Generator | None,
    accuracy: Accuracy,
    method: Literal["nufft", "direct"] = "nufft",
    lines: Oscillators | None = None,
) -> npt.NDArray[np.complex64]:
    """Return what :func:`synthesize` does, with the phases of oscillators and ramps that several frames share.

    Parameters
    ----------
    paths, radar, rng, accuracy, method
        As of :func:`synthesize`, not checked.
    lines : Oscillators, optional
        Left out: drawn, if the front end has any.
    """
    codes = codes_of(radar)
    if not radar.front_end.is_ideal or radar.array.has_echo or radar.adc.is_real:
        return received(paths, radar, rng, lambda some, ideal: alone(some, ideal, accuracy, method, codes), lines)
    adc = alone(paths, radar.separated, accuracy, method, codes)
    if radar.multiplexing.is_coded:
        adc = multiplex(adc, radar)
    return adc if rng is None else add_noise(adc, radar, rng)


def codes_of(radar: RadarSpec) -> npt.NDArray[np.complex128] | None:
    """Return the transmitters' factors of symbols that they all send at once, (num_rows, num_tx); else None.

    By definition of the multiplexing. Echoes that come late have the factor of the chirp before. Of ramps none do: they
    beat above the filter's band.
    """
    if not radar.multiplexing.is_coded or not is_coded(radar.waveform) or not radar.multiplexing.shares_band:
        return None
    return radar.multiplexing.codes(radar.num_chirps, radar.num_tx)


def alone(
    paths: RadarPaths,
    radar: RadarSpec,
    accuracy: Accuracy,
    method: Literal["nufft", "direct"],
    codes: npt.NDArray[np.complex128] | None,
) -> npt.NDArray[np.complex64]:
    """Return the signal of every receiver without noise, each transmitter in rows of its own.

    As of :func:`synthesize`, of an ideal front end.

    Parameters
    ----------
    paths : RadarPaths
    radar : RadarSpec
        Without codes: ``RadarSpec.separated``.
    accuracy, method
        As of :func:`synthesize`.
    codes : ndarray of complex128, shape (num_chirps, num_tx), optional
        With which the rows will be multiplied: what comes late has the one before, and is divided by its own.
    """
    adc = np.zeros((radar.num_rx, radar.num_chirps_total, radar.num_samples), dtype=np.complex64)
    tolerance = accuracy.synthesis_tolerance if method == "nufft" else None
    radar = settled(radar)
    make = partial(_of_symbols, codes=codes) if is_coded(radar.waveform) else _of_ramps
    if isinstance(radar.waveform, PcFmcw):
        make = _of_coded_ramps
    workers = min(usable_cores(), radar.num_tx * radar.num_rx, MAX_THREADS)
    with ThreadPoolExecutor(workers) as pool:
        for senders, alike in _by_band(radar):
            pairs = [(tx, rx) for tx in senders for rx in range(radar.num_rx)]
            for first, signal in make(paths, alike, tolerance, accuracy.motion_tolerance):
                # pairs write to rows of their own, so the bytes do not depend on the order
                list(pool.map(partial(_add, adc, radar, signal, first), pairs))
    _warn_of_more_than_sent(adc, radar)
    return adc


def _warn_of_more_than_sent(adc: npt.NDArray[np.complex64], radar: RadarSpec) -> None:
    """Warn if a receiver gets more power than a transmitter sends: the radar equation is of the far field."""
    sent = radar.front_end.tx_power_dbm
    largest = float(np.abs(adc).max(initial=0.0))
    if largest**2 > dbm_to_watt(sent):
        warnings.warn(
            f"a receiver gets up to {watt_to_dbm(largest**2):.1f} dBm of {sent:.1f} dBm sent: the radar equation does "
            "not hold for points that near, or of such a cross section",
            ScarlWarning,
            stacklevel=4,
        )


def _by_band(radar: RadarSpec) -> Iterator[tuple[Sequence[int], RadarSpec]]:
    """Yield transmitters that send the same frequencies, and a radar all of whose transmitters do."""
    if radar.multiplexing.shares_band:
        yield range(radar.num_tx), radar
        return
    for tx in range(radar.num_tx):
        yield (tx,), radar.with_(multiplexing=IdealMimo(), waveform=radar.waveform_of(tx))


def _of_ramps(
    paths: RadarPaths, radar: RadarSpec, tolerance: float | None, motion_tolerance: float | None
) -> Iterator[tuple[int, Signal]]:
    """Yield first chirps and what makes the signals of ramps, or of tones, from there on, to be added up."""
    for part, screen in band.parts(paths, radar, tolerance):
        for first, signal in _of_constant(part, radar, tolerance, motion_tolerance):
            yield first, signal if screen is None else band.screened(signal, screen, first)


def _of_constant(
    paths: RadarPaths, radar: RadarSpec, tolerance: float | None, motion_tolerance: float | None
) -> Iterator[tuple[int, Signal]]:
    """Yield first chirps and what makes the signals of ramps, or of tones, of paths of constant transfer."""
    kept = _within_band(paths, radar)
    held, bent, linear, moving = orders(kept, radar, motion_tolerance)
    if linear.any():  # one transform for both
        linear, held = linear | held, np.zeros_like(held)
    if held.any():
        kept = replace(kept, length_acceleration=np.where(held, 0.0, kept.length_acceleration))
    if (held | bent).any():
        for signal in _signals(_some(kept, held | bent), radar, tolerance):
            yield 0, signal
    if linear.any():
        yield 0, linear_signal(_some(kept, linear), radar, tolerance)
    if moving.any():
        wanted = None if tolerance is None else Tolerances(tolerance, motion_tolerance or tolerance)
        yield from moving_signals(_some(kept, moving), radar, wanted)


def _some(paths: RadarPaths, mask: npt.NDArray[np.bool_]) -> RadarPaths:
    return paths if mask.all() else paths.select(mask)


def _of_symbols(
    paths: RadarPaths,
    radar: RadarSpec,
    tolerance: float | None,
    motion_tolerance: float | None,
    codes: npt.NDArray[np.complex128] | None = None,
) -> Iterator[tuple[int, Signal]]:
    """Yield first chirps and what makes the signals of symbols from there on, to be added up."""
    waveform = radar.waveform
    assert is_coded(waveform)  # by the caller
    _check_finite(paths)
    inside = symbols.within_prefix(paths, radar, waveform)
    alone_in_turn = inside | late.alone_in_turn(paths, radar, waveform)
    if not inside.all():
        warnings.warn(late.told(paths, inside, alone_in_turn, radar, waveform), ScarlWarning, stacklevel=4)
    change = passing.changes(codes, radar)
    if change is not None and paths.num_paths:
        end = passing.end_of(paths, radar)
        for first, signal in _of_symbols(paths, end, *passing.tolerances(radar, end, tolerance, motion_tolerance)):
            yield first, passing.passed(signal, radar, end, change[first:])
    plainly = paths.select(~alone_in_turn) if tolerance is not None else paths
    if plainly.num_paths:
        yield 0, symbols.plain(band.constant(plainly), radar, waveform, motion_tolerance, codes)
    if tolerance is None:
        return
    groups = [(paths.select(inside), {0: (0, waveform.repetitions * waveform.num_samples)})]
    beyond = alone_in_turn & ~inside
    if beyond.any():
        parts = late.Late(band.constant(paths.select(beyond)), radar, waveform, motion_tolerance, codes)
        yield 0, parts.rest()
        groups += parts.groups()
    for kept, spans in groups:
        if not kept.num_paths:
            continue
        fastest = float((np.abs(kept.length_rate) + radar.frame_time * np.abs(kept.length_acceleration)).max())
        nodes = symbols.Nodes.of(waveform, fastest, tolerance)
        for node, wait in enumerate(nodes.wait):
            tones, weights = seen_by(radar, float(wait), every=True), nodes.shares(node, spans)
            for first, signal in _of_ramps(kept, tones, symbols.CHANNEL_SHARE * tolerance, motion_tolerance):
                yield first, symbols.modulated(signal, radar, waveform, first, weights, codes)


def _of_coded_ramps(
    paths: RadarPaths, radar: RadarSpec, tolerance: float | None, motion_tolerance: float | None
) -> Iterator[tuple[int, Signal]]:
    """Yield first chirps and what makes the signals of ramps with a phase code from there on, to be added up."""
    waveform = radar.waveform
    assert isinstance(waveform, PcFmcw)  # by the caller
    kept = _within_band(paths, radar)
    if not kept.num_paths:
        return
    if tolerance is None:
        yield 0, coded_ramps.plain(band.constant(kept), radar, waveform, motion_tolerance)
        return
    higher, screens = np.zeros(1), np.ones((1, radar.num_samples), dtype=np.complex128)
    share, chips = 1.0, np.conj(waveform.by_chirp)
    if waveform.coding == "within":
        length = kept.length
        arms = sum(float(np.linalg.norm(array, axis=1).max()) for array in (radar.tx_array, radar.rx_array))
        arms += radar.frame_time * float(np.abs(kept.length_rate).max())
        delays = (float(length.min()) - arms) / SPEED_OF_LIGHT, (float(length.max()) + arms) / SPEED_OF_LIGHT
        higher, screens = coded_ramps.carriers(waveform, delays, tolerance)
        share = symbols.CHANNEL_SHARE / float(np.abs(screens).sum(axis=0).max())
    for above, screen in zip(higher, screens, strict=True):
        ramps = radar.with_(waveform=waveform.ramps(float(above)))
        for first, signal in _of_ramps(kept, ramps, share * tolerance, motion_tolerance):
            yield first, coded_ramps.screened(signal, chips[first:], screen)


def _check_finite(paths: RadarPaths) -> None:
    for name in ("a", "tx_point", "rx_point", "inner_length", "length_rate", "length_acceleration"):
        if not np.isfinite(getattr(paths, name)).all():
            raise ParameterRangeError(
                f"paths.{name}", "NaN or infinity", "finite values", "check the solver's geometry"
            )


def _within_band(paths: RadarPaths, radar: RadarSpec) -> RadarPaths:
    """Return the paths whose beat frequency passes the receiver's filter."""
    _check_finite(paths)
    if not radar.waveform.sweep.video:  # nothing is mixed down by a ramp: long delays are ambiguous, not filtered out
        return paths
    length = paths.length
    beyond = length >= 2.0 * radar.max_range
    if not beyond.any():
        return paths
    warnings.warn(
        f"{int(beyond.sum())} of {paths.num_paths} paths are longer than twice the unambiguous range of "
        f"{radar.max_range:.4g} m (up to {length.max():.4g} m) and are filtered out before sampling; "
        "sample faster or sweep less to see them",
        ScarlWarning,
        stacklevel=6,
    )
    return paths.select(~beyond)


def _signals(paths: RadarPaths, radar: RadarSpec, tolerance: float | None) -> Iterator[Signal]:
    """Yield what makes the signals of paths with the rates of the array centres, group by group."""
    partition: list[tuple[npt.NDArray[np.intp], groups.Method | None]] = [(np.arange(paths.num_paths), None)]
    if tolerance is not None:
        motion = (paths.length_rate, paths.length_acceleration)
        partition = groups.partition(radar, paths.length, *motion, tolerance)
    for index, transform in partition:
        yield _of_center(paths.select(index), radar, transform)


def _of_center(paths: RadarPaths, radar: RadarSpec, transform: groups.Method | None) -> Signal:
    """Return what makes the signal of some paths: by their transform, or by the plain sum."""
    geometry = PathGeometry.of(paths, radar)
    motion = paths.length_rate, paths.length_acceleration

    def of_pair(tx: int, rx: int) -> npt.NDArray[np.complexfloating]:
        columns = geometry.pair_amplitude(tx, rx), geometry.length(tx, rx), *motion
        return direct.sum_paths(*columns, radar, tx) if transform is None else transform.signal(*columns, tx)

    return of_pair


def _add(adc: npt.NDArray[np.complex64], radar: RadarSpec, signal: Signal, first: int, pair: tuple[int, int]) -> None:
    """Add the signal of a pair to `adc`, from some chirp on."""
    tx, rx = pair
    values = signal(tx, rx)
    ramp = first * radar.num_tx + tx
    adc[rx, ramp : ramp + len(values) * radar.num_tx : radar.num_tx] += values


__all__ = ["synthesize"]
