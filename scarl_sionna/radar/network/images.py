"""Coherent images of a network: back-projection of the raw data of all pairs onto points."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import finufft
import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.synthesis.phase import FrameGrid, delay_terms, phasor

from .suites import NetworkFrame, Pair

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

TOLERANCE = 1e-5
"""Of the transforms: below the quantisation of any converter."""
MOST_RESIDUAL = 0.1
"""Cycles of range migration that blur an image without a warning: 3 % of a point's amplitude."""


def back_project(
    frame: NetworkFrame,
    points: npt.ArrayLike,
    velocity: npt.ArrayLike = (0.0, 0.0, 0.0),
    *,
    pairs: Sequence[Pair] | None = None,
    coherent: bool = True,
    clocks: bool = True,
) -> Complex:
    r"""Return the image of a network at points.

    Parameters
    ----------
    frame : NetworkFrame
    points : array_like of float, shape (..., 3)
        At the frame's start [m, world].
    velocity : array_like of float, shape (3,) or that of `points`
        For which the image is focused [m/s, world].
    pairs : sequence of (int, int), optional
        Which pairs count; default: all.
    coherent : bool
        Sum the pairs with their phases; False: the root of their mean power.
    clocks : bool
        Take the stated time offsets and phases of the radars out; False shows what they do.

    Returns
    -------
    ndarray of complex128, shape (...)
        Mean over all antenna pairs [sqrt(W)]: at a point alone its received amplitude, if all pairs see it alike.

    Raises
    ------
    ParameterRangeError
        If the radars are not equal ramps whose rows hold one transmitter each, a shape is wrong, or a pair is not
        there.

    Warns
    -----
    ScarlWarning
        If range migration over the frame blurs the image.

    Notes
    -----
    For every antenna pair the data are compared with the beat signal of a point there,

    .. math:: I(x) = \frac{1}{K} \sum_k \sum_{m,n} \frac{1}{M N} \, y_k[m, n] \, e^{-j 2 \pi \psi_k(x; m, n)}

    with the exact bistatic delay and its rate at the frame's middle; the sum over chirps and samples is a
    two-dimensional non-uniform transform.

    References
    ----------
    .. [1] M. Soumekh, *Synthetic Aperture Radar Signal Processing with MATLAB Algorithms*, Wiley, 1999.
    """
    network, radar = frame.network, frame.network.radar
    _check(radar)
    where = np.asarray(points, dtype=np.float64)
    if where.ndim == 0 or where.shape[-1] != 3:
        raise ParameterRangeError("points", where.shape, "(..., 3)")
    place, moving = np.broadcast_arrays(where.reshape(-1, 3), np.asarray(velocity, np.float64).reshape(-1, 3))
    chosen = list(frame.adc) if pairs is None else list(pairs)
    if missing := [pair for pair in chosen if pair not in frame.adc]:
        raise ParameterRangeError("pairs", missing[0], f"pairs of {len(frame.adc)} in the frame")
    images, blur = [], 0.0
    for pair in chosen:
        delay = network.delay(pair) if clocks else 0.0
        ends = network.places[pair[0]], network.places[pair[1]]
        image, residual = _of_pair(radar, frame.adc[pair], ends, place, moving, delay)
        blur = max(blur, residual)
        images.append(image / network.turn(pair) if clocks else image)
    if blur > MOST_RESIDUAL:
        warnings.warn(
            f"range migration over the frame is {blur:.2g} cycles and blurs the image; take fewer chirps",
            ScarlWarning,
            stacklevel=2,
        )
    stack = np.stack(images)
    total = stack.mean(axis=0) if coherent else np.sqrt(np.mean(np.abs(stack) ** 2, axis=0)) + 0.0j
    return np.asarray(total.reshape(where.shape[:-1]))


def _check(radar: RadarSpec) -> None:
    shown = f"{radar.multiplexing.kind!r} with {radar.waveform.kind!r}"
    if radar.waveform.kind != "fmcw" or not FrameGrid(radar).even or radar.multiplexing.is_coded:
        allowed = "'ideal' or 'tdm' with equal ramps ('fmcw')"
        raise ParameterRangeError("network.radar", shown, allowed, "process other waveforms pair by pair")


def _of_pair(
    radar: RadarSpec,
    adc: npt.NDArray[np.complex64],
    ends: tuple[Mount, Mount],
    points: Array,
    velocity: Array,
    delay: float,
) -> tuple[Complex, float]:
    """Return the mean over a pair's antennas at points, and the phase that range migration leaves [cycles]."""
    grid = FrameGrid(radar)
    image, blur = np.zeros(len(points), dtype=np.complex128), 0.0
    legs = [
        [_leg(place, arm, points, velocity) for arm in array]
        for place, array in zip(ends, (radar.tx_array, radar.rx_array), strict=True)
    ]
    for tx, there in enumerate(legs[0]):
        for rx, back in enumerate(legs[1]):
            length, rate, bend = (a + b for a, b in zip(there, back, strict=True))
            terms = delay_terms(length + SPEED_OF_LIGHT * delay, rate, bend)
            constant, over_x, over_y, middle_rate = grid.expand(*terms, tx)
            left = grid.residual_cycles(float(np.abs(middle_rate).max()), float(np.abs(terms[2]).max()), True)
            blur = max(blur, float(np.abs(left).max()))
            data = adc[rx, tx :: radar.num_tx].astype(np.complex128) / (radar.num_chirps * radar.num_samples)
            data *= 2.0 if radar.adc.is_real else 1.0  # half of a signal is in its image, below 0 Hz
            image += phasor(-constant) * _transform(data, over_y * radar.doppler_interval, over_x / radar.sample_rate)
    return image / radar.num_virtual, blur


def _leg(place: Mount, arm: Array, points: Array, velocity: Array) -> tuple[Array, Array, Array]:
    """Return distances from an antenna with two derivatives, at the frame's start."""
    lever = place.pose.rotate(arm)
    ahead = points - place.pose.position - lever
    distance = np.linalg.norm(ahead, axis=1)
    relative = velocity - place.twist.velocity_at(lever)
    rate = np.einsum("pi,pi->p", ahead, relative) / distance
    return distance, rate, (np.einsum("pi,pi->p", relative, relative) - rate**2) / distance


def _transform(data: Complex, over_chirps: Array, over_samples: Array) -> Complex:
    """Return sums of data times conjugate tones [cycles a step], about the middle of chirps and samples."""
    cycles = (over_chirps, over_samples)
    out = finufft.nufft2d2(*(2.0 * np.pi * np.mod(c, 1.0) for c in cycles), data, eps=TOLERANCE, isign=-1, nthreads=1)
    for value, count in zip(cycles, data.shape, strict=True):
        if count % 2 == 0:  # the middle lies half a step after the transform's
            out = out * phasor(-0.5 * value)
    return np.asarray(out)
