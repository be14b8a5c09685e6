"""Beat signals of a scanning radar: the paths of a block of its turn through the beam of every azimuth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.accuracy import DEFAULT_ACCURACY, Accuracy
from scarl_sionna.core.settings.scanning import ScanningSettings
from scarl_sionna.core.specs.radar.scanning.spec import ScanningRadarSpec
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.link import received_amplitude
from scarl_sionna.radar.paths import RadarPaths, bend_of
from scarl_sionna.radar.synthesis.blocks import later
from scarl_sionna.radar.synthesis.nufft import Box, Transform
from scarl_sionna.radar.synthesis.phase import FrameGrid

Array = npt.NDArray[np.float64]

NEAREST = 0.1
"""Points nearer than this to the antenna [m], within its aperture, do not count."""
GROUP_TIME = 2.5e-3
"""Paths are carried on to moments so far apart at most [s]; around each one to second order in time: what crosses at
30 m/s 5 m away is then off by 1e-3 rad at 77 GHz."""
_ENDS = (np.min, np.max)


@dataclass(frozen=True, eq=False)
class Block:
    """Paths of one instant of a turn, for the azimuths around it.

    Attributes
    ----------
    paths : RadarPaths
        From the sensor's origin; the solver's frame has the sensor's z axis and its x axis in the azimuth `ahead`.
    time : float
        Of the paths after the turn's start [s].
    ahead : float
        [rad], sensor frame.
    azimuths : ndarray of int64
        Numbers of the azimuths.
    """

    paths: RadarPaths
    time: float
    ahead: float
    azimuths: npt.NDArray[np.int64]


def block_beats(
    block: Block, radar: ScanningRadarSpec, settings: ScanningSettings, accuracy: Accuracy = DEFAULT_ACCURACY
) -> npt.NDArray[np.complex64]:
    r"""Return the beat signal of the ramps of a block, without noise.

    Parameters
    ----------
    block : Block
    radar : ScanningRadarSpec
    settings : ScanningSettings
        Its `beam_floor_db` and `num_pointings`.
    accuracy : Accuracy
        Its `synthesis_tolerance`.

    Returns
    -------
    ndarray of complex64, shape (num_azimuths of the block, num_samples)
        [sqrt(W)].

    Notes
    -----
    Points move straight on from the block's time to the middle of each ramp's samples, and about it to second order in
    time. The gain follows the antenna, which turns by :math:`\omega` a second, and the points during the ramp: with the
    Lagrange polynomials :math:`l_m` of Chebyshev's nodes :math:`t_m` over the samples,

    .. math:: s(t) = \sum_m l_m(t) \sum_p a_p\, g^2(\varphi_p(t_m) - \varphi_k - \omega t_m)\, e^{j \psi_p(t)}

    References
    ----------
    .. [1] A. G. Stove, "Linear FMCW radar techniques", IEE Proc. F 139(5), 1992.
    """
    out = np.zeros((len(block.azimuths), radar.waveform.num_samples), dtype=np.complex64)
    found = _bending(block.paths)
    if not found.num_paths:
        return out
    waits, is_up = radar.time[block.azimuths] - block.time, radar.is_up[block.azimuths]
    near = _Near.of(block, radar, settings.beam_floor_db)
    rates, bends = near.motion(found, float(waits.min()), float(waits.max()))
    ramps = {up: _Ramp.of(radar.ramp(up), rates, bends, accuracy) for up in set(is_up.tolist())}
    nodes, weights = _pointings(radar, settings.num_pointings)
    turning = radar.azimuth_rate + near.spin
    groups = max(1, round(float(np.ptp(waits)) / GROUP_TIME))
    for rows in np.array_split(np.arange(len(waits)), min(groups, len(waits))):
        time = 0.5 * float(waits[rows[0]] + waits[rows[-1]])
        azimuths = radar.azimuth[block.azimuths[rows]]
        chosen = near.within(azimuths, time, float(np.abs(waits[rows] - time).max()))
        if not len(chosen):
            continue
        moment = _Moment.of(later(found.select(chosen), time))
        for row, azimuth in zip(rows.tolist(), azimuths.tolist(), strict=True):
            after = float(waits[row]) - time
            ahead = azimuth - block.ahead
            out[row] += ramps[is_up[row]].signal(moment, after, (ahead + near.spin * after, turning, nodes, weights))
    return out


def _bending(paths: RadarPaths) -> RadarPaths:
    """Return paths whose lengths bend as those of points in straight motion do.

    Some keep to first order, which serves a frame of some ms and not a turn.
    """
    linear = paths.filled("linear_motion")
    if not linear.any():
        return paths
    names = ("tx_velocity", "rx_velocity")
    bends = [bend_of(end, paths.filled(name)) for end, name in zip(paths.end_vectors(), names, strict=True)]
    bend = np.where(linear & np.isfinite(sum(bends)), sum(bends), paths.length_acceleration)
    return replace(paths, linear_motion=None, length_acceleration=bend)


def _pointings(radar: ScanningRadarSpec, count: int) -> tuple[Array, Array]:
    """Return nodes of a ramp after the middle of its samples [s], and their weights over the samples.

    Shapes (count,) and (count, num_samples); Chebyshev's nodes and Lagrange's polynomials of them.
    """
    nodes = np.cos((np.arange(count) + 0.5) * np.pi / count)
    place = np.linspace(-1.0, 1.0, radar.waveform.num_samples)
    half = (radar.waveform.num_samples - 1) / (2.0 * radar.waveform.sample_rate)
    weights = np.ones((count, len(place)))
    for row, own in zip(weights, nodes, strict=True):
        for other in nodes[nodes != own]:
            row *= (place - other) / (own - other)
    return half * nodes, weights


@dataclass(frozen=True, eq=False)
class _Near:
    """Directions of the paths of a block as time goes on, and how far beside the beam they count.

    Attributes
    ----------
    offset, velocity : ndarray of float64, shape (num_paths, 3)
        Along which paths leave, and how that moves relative to the sensor [m], [m/s], in the solver's frame.
    spin : float
        Of the sensor about its z axis [rad/s].
    ahead, reach : float
        [rad].
    """

    offset: Array
    velocity: Array
    spin: float
    ahead: float
    reach: float

    @classmethod
    def of(cls, block: Block, radar: ScanningRadarSpec, floor_db: float) -> _Near:
        turn = block.paths.world_from_tx.rotation
        mirror = block.paths.is_mirror_chain[:, None]
        velocity = np.where(mirror, block.paths.filled("rx_velocity"), block.paths.filled("tx_velocity"))
        reach = radar.beam_reach(floor_db) + 0.5 * abs(radar.azimuth_rate) * radar.waveform.ramp_time
        spin = float(block.paths.tx_twist.angular @ turn[:, 2])
        return cls(block.paths.end_vectors()[0] @ turn, np.nan_to_num(velocity) @ turn, spin, block.ahead, reach)

    @cached_property
    def speed(self) -> Array:
        """Of the points relative to the sensor, shape (num_paths,) [m/s]."""
        return np.asarray(np.linalg.norm(self.velocity, axis=1))

    def motion(self, paths: RadarPaths, first: float, last: float) -> tuple[Array, Array]:
        """Return rates [m/s] and accelerations [m/s2] between whose extremes those of all times in between lie.

        In straight motion rates only grow, and a length bends most where its point is nearest.
        """
        ends = [later(paths.select(self._far(time)), time) for time in (first, last)]
        rates = np.concatenate([one.length_rate for one in ends])
        speed = np.einsum("pi,pi->p", self.velocity, self.velocity)
        nearest = -np.einsum("pi,pi->p", self.offset, self.velocity) / np.maximum(speed, 1e-12)
        there = self.offset + np.clip(nearest, first, last)[:, None] * self.velocity
        distance = np.maximum(np.linalg.norm(there, axis=1), NEAREST)
        across = np.linalg.norm(np.cross(self.offset, self.velocity), axis=1)
        bends = [one.length_acceleration for one in ends]
        return rates, np.concatenate([*bends, 2.0 * across**2 / distance**3])

    def _far(self, after: float) -> npt.NDArray[np.bool_]:
        """Return which points are not at the antenna itself some time after the block's [s]."""
        return np.asarray(np.linalg.norm(self.offset + after * self.velocity, axis=1) > NEAREST)

    def within(self, azimuths: Array, after: float, around: float) -> npt.NDArray[np.int64]:
        """Return the numbers of the paths that count at some azimuths, all `around` a time after the block's."""
        middle, half = 0.5 * (azimuths[0] + azimuths[-1]), 0.5 * abs(float(azimuths[-1] - azimuths[0]))
        moved = self.offset + after * self.velocity
        away = np.arctan2(moved[:, 1], moved[:, 0]) - self.spin * after + self.ahead - middle
        away -= 2.0 * np.pi * np.rint(away / (2.0 * np.pi))
        distance = np.sqrt(np.einsum("pi,pi->p", moved, moved))
        # by so much directions may change around that time
        slack = around * (self.speed / np.maximum(distance, NEAREST) + abs(self.spin))
        return np.flatnonzero((np.abs(away) <= self.reach + half + slack) & (distance > NEAREST + around * self.speed))


@dataclass(frozen=True, eq=False)
class _Ramp:
    """What makes the signals of ramps of one kind for the paths of a block."""

    radar: RadarSpec
    transform: Transform

    @classmethod
    def of(cls, radar: RadarSpec, rates: Array, bends: Array, accuracy: Accuracy) -> _Ramp:
        corners = (np.repeat([one(rates) for one in _ENDS], 2), np.tile([one(bends) for one in _ENDS], 2))
        tolerance = accuracy.synthesis_tolerance
        return cls(radar, Transform(radar, Box.of(radar, *corners, tolerance), tolerance))

    def signal(
        self, moment: _Moment, after: float, pointing: tuple[float, float, Array, Array]
    ) -> npt.NDArray[np.complex128]:
        """Return the signal of the ramp whose samples' middle is some time after a moment [s]; [sqrt(W)].

        `pointing` is the antenna's direction then, from the solver's x axis of the moment [rad], its rate [rad/s], and
        nodes [s] with their weights over the samples.
        """
        start = after - float(FrameGrid(self.radar).ts_center)
        bend = moment.bend
        motion = moment.length + start * (moment.rate + 0.5 * start * bend), moment.rate + start * bend, bend
        ends = [end + after * move for end, move in zip(moment.ends, moment.moves, strict=True)]
        nearer = [_distance(old) / _distance(new) for old, new in zip(moment.ends, ends, strict=True)]
        transfer = moment.a * np.where(moment.mirror, 1.0, nearer[0] * nearer[-1])[:, None, None]
        ahead, rate, nodes, weights = pointing
        amplitudes = []
        for node in nodes.tolist():
            own = Pose.from_heading(np.zeros(3), ahead + rate * node).rotation
            seen = [(end + node * move) @ own for end, move in zip(ends, moment.moves, strict=True)]
            amplitudes.append(received_amplitude(transfer, seen[0], seen[-1], self.radar))
        # the beat is tx conj(rx)
        signals = self.transform.signals(np.conj(amplitudes), *motion[:2], 0, motion[2])
        return np.asarray(sum(weight * one[0] for weight, one in zip(weights, signals, strict=True)))


def _distance(vectors: Array) -> Array:
    return np.asarray(np.sqrt(np.einsum("pi,pi->p", vectors, vectors)))


@dataclass(frozen=True, eq=False)
class _Moment:
    """Paths at a time around which everything moves straight on, for a few ramps.

    Attributes
    ----------
    a : ndarray of complex128, shape (num_paths, 2, 2)
    length, rate, bend : ndarray of float64, shape (num_paths,)
        [m], [m/s], [m/s2].
    ends, moves : tuple of ndarray of float64, shape (num_paths, 3)
        Along which paths leave and, where it is another, arrive, and how that moves [m], [m/s]; solver's frame.
    mirror : ndarray of bool, shape (num_paths,)
    """

    a: npt.NDArray[np.complex128]
    length: Array
    rate: Array
    bend: Array
    ends: tuple[Array, ...]
    moves: tuple[Array, ...]
    mirror: npt.NDArray[np.bool_]

    @classmethod
    def of(cls, paths: RadarPaths) -> _Moment:
        turn, mirror = paths.world_from_tx.rotation, paths.is_mirror_chain
        ends = paths.end_vectors()
        moves = [np.nan_to_num(paths.filled(name)) @ turn for name in ("tx_velocity", "rx_velocity")]
        for move in moves:
            move[mirror] = 0.0
        one = np.array_equal(*ends) and np.array_equal(*moves)  # single scattering: back as it came
        count = 1 if one else 2
        return cls(
            a=paths.a,
            length=paths.length,
            rate=paths.length_rate,
            bend=paths.length_acceleration,
            ends=tuple(end @ turn for end in ends[:count]),
            moves=tuple(moves[:count]),
            mirror=mirror,
        )
