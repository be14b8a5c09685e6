r"""How the lengths of paths change over a frame, for every transmit-receive pair.

End points move straight on, antennas with their radars. With the offset x of an end point from the radar's origin, its
relative velocity v and the arm A(t) of an antenna, which turns with the radar, the distance of that end is

.. math:: D(t) = |x + v t - A(t)|, \quad A(t) = e^{[\omega]_\times t} A(0)

and a path is as long as both ends and what lies between, whose rate and acceleration are what the path's own have
beyond those of its ends, seen from the array centres. Strengths follow the distances, and what :mod:`.fading` says.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.blocks import in_blocks
from scarl_sionna.core.arrays.rows import row_all
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.paths import RadarPaths

from .fading import Fading

Array = npt.NDArray[np.float64]

_VALUES_AT_ONCE = 1 << 16
"""Distances whose derivatives are worked out at once: they take seven times as much memory, in the cache."""


class Terms(NamedTuple):
    """A length [m], its rate [m/s] and its acceleration [m/s2]."""

    value: Array
    rate: Array
    acceleration: Array


class Ends(NamedTuple):
    """Lengths [m] and strengths over those at time 0 between the centres, complex where paths fade over the frame."""

    length: Array
    strength: npt.NDArray[np.inexact]


@dataclass(frozen=True, eq=False)
class Arms:
    """Antennas about the origin of a radar that turns.

    Attributes
    ----------
    start : ndarray of float64, shape (num_antennas, 3)
        At time 0 [m, world axes].
    spin : ndarray of float64, shape (3,)
        [rad/s].
    """

    start: Array
    spin: Array

    def at(self, antenna: int | None, times: Array) -> Array:
        """Return an antenna's places, shape (num_times, 3) [m]; that of the centre if None."""
        if antenna is None:
            return np.zeros((len(times), 3))
        start, rate = self.start[antenna], float(np.linalg.norm(self.spin))
        if not rate:
            return np.broadcast_to(start, (len(times), 3))
        axis, angle = self.spin / rate, rate * times[:, None]
        along = (start @ axis) * axis
        return np.asarray(along + np.cos(angle) * (start - along) + np.sin(angle) * (self._across @ start / rate))

    @cached_property
    def _across(self) -> Array:
        """Matrix that makes the cross product of the spin with a vector."""
        x, y, z = self.spin
        return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])

    def motion(self, antenna: int | None, times: Array) -> tuple[Array, Array, Array]:
        """Return places, velocities and accelerations, shape (num_times, 3) [m], [m/s], [m/s2]."""
        place = self.at(antenna, times)
        velocity = place @ self._across.T
        return place, velocity, velocity @ self._across.T


@dataclass(frozen=True, eq=False)
class End:
    """End points that move straight on past a radar.

    Attributes
    ----------
    offset, velocity : ndarray of float64, shape (num_paths, 3)
        From the radar's origin [m], and relative to it [m/s], world axes.
    arms : Arms
    """

    offset: Array
    velocity: Array
    arms: Arms

    @cached_property
    def _columns(self) -> Array:
        """Factors of the squared distance: by 1, t, t**2, and for each axis of an arm by 1 and t, (9, num_paths)."""
        offset, velocity = self.offset.T, self.velocity.T
        own = [np.sum(offset**2, axis=0), 2.0 * np.sum(offset * velocity, axis=0), np.sum(velocity**2, axis=0)]
        return np.concatenate([own, -2.0 * offset, -2.0 * velocity])

    def distance(self, antenna: int | None, times: Array) -> Array:
        """Return distances to an antenna, shape (num_times, num_paths) [m]."""
        arm, time = self.arms.at(antenna, times), times[:, None]
        rows = np.concatenate([np.ones_like(time), time, time**2, arm, time * arm], axis=1)
        square = rows @ self._columns
        square += np.einsum("ti,ti->t", arm, arm)[:, None]
        return np.sqrt(np.maximum(square, 0.0, out=square), out=square)

    def terms(self, antenna: int | None, times: Array) -> Terms:
        """Return distances with their derivatives, shape (num_times, num_paths) each."""
        count, moved = len(self.offset), self.arms.motion(antenna, times)
        size = max(1, _VALUES_AT_ONCE // max(1, len(times)))
        if count <= size:
            return self._terms(slice(count), times, moved)
        found = Terms(*(np.empty((len(times), count)) for _ in range(3)))
        for block in in_blocks(count, size):
            for column, part in zip(found, self._terms(block, times, moved), strict=True):
                column[:, block] = part
        return found

    def _terms(self, block: slice, times: Array, moved: tuple[Array, Array, Array]) -> Terms:
        """Return :meth:`terms` of some paths, from the places of the antenna and their derivatives."""
        offset, own = (columns[:, None, block] for columns in self._axes)
        place, velocity, acceleration = (moving.T[..., None] for moving in moved)
        ahead = offset - place
        if times.any():
            ahead += times[:, None] * own
        moving = own - velocity if velocity.any() else own
        value = np.sqrt(np.einsum("itp,itp->tp", ahead, ahead))
        bend = np.broadcast_to(np.einsum("itp,itp->tp", moving, moving), value.shape).copy()
        if acceleration.any():
            bend -= np.einsum("itp,itp->tp", np.broadcast_to(acceleration, ahead.shape), ahead)
        with np.errstate(divide="ignore", invalid="ignore"):
            rate = np.einsum("itp,itp->tp", ahead, np.broadcast_to(moving, ahead.shape)) / value
            bend -= rate * rate
            bend /= value
        return Terms(value, rate, bend)

    def rates(self, distance: Array, block: slice) -> Array:
        """Return the rates at time 0 of distances of some paths to all antennas, (num_antennas, num_paths), [m/s]."""
        offset, own = (columns[:, block] for columns in self._axes)
        start, moving = self.arms.start, self.arms.start @ self.arms._across.T
        found = np.einsum("ip,ip->p", offset, own) - start @ own
        if moving.any():
            found -= moving @ offset
        found /= distance
        return found

    @cached_property
    def _axes(self) -> tuple[Array, Array]:
        """Offsets and velocities axis after axis, shape (3, num_paths)."""
        return self.offset.T.copy(), self.velocity.T.copy()


@dataclass(frozen=True, eq=False)
class Reflected:
    """The receiver's antennas in mirrors, seen from the transmitter: the only end of a path of mirrors only.

    Attributes
    ----------
    offset, velocity : ndarray of float64, shape (num_paths, 3)
        Of the image of the receiver's origin, from that of the transmitter [m], [m/s].
    turn : ndarray of float64, shape (num_paths, 3, 3)
        What the mirrors do to the receiver's arms.
    tx_arms, rx_arms : Arms
    """

    offset: Array
    velocity: Array
    turn: Array
    tx_arms: Arms
    rx_arms: Arms

    def terms(self, tx: int | None, rx: int | None, times: Array) -> Terms:
        """Return distances between a pair with their derivatives, shape (num_times, num_paths) each."""
        here = self.tx_arms.motion(tx, times)
        there = (np.einsum("pij,tj->tpi", self.turn, moving) for moving in self.rx_arms.motion(rx, times))
        place, velocity, acceleration = (image - own[:, None] for image, own in zip(there, here, strict=True))
        ahead = self.offset + times[:, None, None] * self.velocity + place
        return _terms(ahead, self.velocity + velocity, acceleration)


def _terms(ahead: Array, velocity: Array, acceleration: Array) -> Terms:
    """Return the length of vectors (..., 3) and its derivatives from theirs."""
    length = np.sqrt(np.einsum("...i,...i->...", ahead, ahead))
    with np.errstate(divide="ignore", invalid="ignore"):
        rate = np.einsum("...i,...i->...", ahead, velocity) / length
        bend = np.einsum("...i,...i->...", velocity, velocity) + np.einsum("...i,...i->...", ahead, acceleration)
        return Terms(length, rate, (bend - rate**2) / length)


@dataclass(frozen=True, eq=False)
class PathMotion:
    """Lengths and strengths of paths over a frame, for every pair.

    Attributes
    ----------
    tx, rx : End
        Of all paths; a path of mirrors only has its length in `reflected`.
    mirror : ndarray of bool, shape (num_paths,)
    reflected : Reflected
        Of the paths of mirrors only.
    between : Terms
        What lies between the ends, at time 0, shape (num_paths,).
    amplitude : ndarray of complex128, shape (num_paths,)
        Of the beat signal between the array centres at time 0 [sqrt(W)]; see :meth:`of_pair`.
    reach : ndarray of float64, shape (num_paths,)
        Product of both ends' distances from the centres at time 0 [m2]; of a path of mirrors only its length [m].
    geometry : PathGeometry or None
        Where antennas are described one by one: has the amplitude of each pair.
    fading : Fading or None
        What strengths do beyond following the distances; None: nothing.
    """

    tx: End
    rx: End
    mirror: npt.NDArray[np.bool_]
    reflected: Reflected
    between: Terms
    amplitude: npt.NDArray[np.complex128]
    reach: Array
    geometry: PathGeometry | None = None
    fading: Fading | None = None

    @classmethod
    def of(cls, paths: RadarPaths, radar: RadarSpec, geometry: PathGeometry | None = None) -> PathMotion:
        """Return the motion of paths whose velocities are known; of the others as if their ends stood still.

        `geometry` is that of the paths, if it is at hand.
        """
        geometry = geometry or PathGeometry.of(paths, radar)
        motion = cls._of(paths, radar.tx_array, radar.rx_array, geometry.amplitude)
        known = is_known(paths) & ~paths.filled("linear_motion")
        seen = None if geometry.fields is None else geometry
        return replace(motion, geometry=seen, fading=Fading.of(paths, radar, known))

    def of_pair(self, tx: int, rx: int) -> npt.NDArray[np.complex128]:
        """Return the amplitudes at time 0 for a pair whose antennas stood at the centres [sqrt(W)], (num_paths,)."""
        return self.amplitude if self.geometry is None else self.geometry.at_centers(tx, rx)

    @classmethod
    def _of(
        cls, paths: RadarPaths, tx_array: Array, rx_array: Array, amplitude: npt.NDArray[np.complex128]
    ) -> PathMotion:
        tx_offset, rx_offset = paths.end_vectors()
        tx_arms = Arms(paths.world_from_tx.rotate(tx_array), paths.tx_twist.angular)
        rx_arms = Arms(paths.world_from_rx.rotate(rx_array), paths.rx_twist.angular)
        tx_velocity, rx_velocity = (np.nan_to_num(paths.filled(name), nan=0.0) for name in _VELOCITIES)
        tx, rx = End(tx_offset, tx_velocity, tx_arms), End(rx_offset, rx_velocity, rx_arms)
        mirror = paths.is_mirror_chain
        turn = paths.filled("rx_image")[mirror, :, :3]
        reflected = Reflected(tx_offset[mirror], rx_velocity[mirror], turn, tx_arms, rx_arms)
        own = (paths.length_rate, paths.length_acceleration)
        start = np.zeros(1)
        ends = [tx.terms(None, start), rx.terms(None, start)]
        both = [ends[0][k][0] + ends[1][k][0] for k in range(3)]
        reach = ends[0].value[0] * ends[1].value[0]
        through = reflected.terms(None, None, start)
        reach[mirror] = through.value[0]
        for k in range(3):
            both[k][mirror] = through[k][0]
        inner = np.where(mirror, 0.0, paths.inner_length)
        between = Terms(inner, own[0] - both[1], own[1] - both[2])
        return cls(tx, rx, mirror, reflected, between, amplitude, reach)

    def select(self, rows: npt.NDArray[np.intp]) -> PathMotion:
        """Return the motion of some paths, without the amplitudes of single pairs."""
        mirror = self.mirror[rows]
        seen = (np.cumsum(self.mirror) - 1)[rows[mirror]]
        tx, rx = (End(end.offset[rows], end.velocity[rows], end.arms) for end in (self.tx, self.rx))
        image = self.reflected
        reflected = Reflected(image.offset[seen], image.velocity[seen], image.turn[seen], image.tx_arms, image.rx_arms)
        between = Terms(*(column[rows] for column in self.between))
        fading = None if self.fading is None else self.fading.select(rows)
        columns = between, self.amplitude[rows], self.reach[rows]
        return PathMotion(tx, rx, mirror, reflected, *columns, fading=fading)

    def ends(self, tx: int | None, rx: int | None, times: Array, known: tuple[Array, Array] | None = None) -> Ends:
        """Return lengths, and strengths over those at time 0 between the centres, shape (num_times, num_paths) each.

        Parameters
        ----------
        tx, rx : int or None
            Of the pair; None is the centre.
        times : ndarray of float64, shape (num_times,)
            [s].
        known : pair of ndarray, optional
            Distances of `self.tx` and of `self.rx` at these times.

        Raises
        ------
        ParameterRangeError
            If a path ends at an antenna.
        """
        out, home = known or (self.tx.distance(tx, times), self.rx.distance(rx, times))
        time = times[:, None]
        length = out + home
        with np.errstate(divide="ignore"):
            strength = self.reach / (out * home)
            if self.mirror.any():
                length[:, self.mirror] = through = self.reflected.terms(tx, rx, times).value
                strength[:, self.mirror] = self.reach[self.mirror] / through
        length += self.between.value + time * (self.between.rate + 0.5 * time * self.between.acceleration)
        if not np.isfinite(strength).all():
            index = int(np.flatnonzero(~np.isfinite(strength).all(axis=0))[0])
            raise ParameterRangeError("paths", f"path {index} ends at an antenna", "end points away from every antenna")
        return Ends(length, strength if self.fading is None else strength * self.fading.at(times))

    def terms(
        self, tx: int | None, rx: int | None, times: Array
    ) -> tuple[Terms, npt.NDArray[np.inexact], npt.NDArray[np.inexact]]:
        """Return lengths with derivatives, strengths and their relative rates [1/s], (num_times, num_paths) each."""
        return self.joined((tx, rx), times, self.tx.terms(tx, times), self.rx.terms(rx, times))

    def joined(
        self, pair: tuple[int | None, int | None], times: Array, out: Terms, home: Terms
    ) -> tuple[Terms, npt.NDArray[np.inexact], npt.NDArray[np.inexact]]:
        """Return what :meth:`terms` does, from the distances of both ends."""
        strength = self.reach / (out.value * home.value)
        growth = -(out.rate / out.value + home.rate / home.value)
        through = self.through(pair, times)
        if through is not None:
            strength[:, self.mirror] = self.reach[self.mirror] / through.value
            growth[:, self.mirror] = -through.rate / through.value
        lengths = self.lengths(times, out, home, through)
        if self.fading is None:
            return lengths, strength, growth
        return lengths, strength * self.fading.at(times), growth + self.fading.growth(times)

    def through(self, pair: tuple[int | None, int | None], times: Array) -> Terms | None:
        """Return the distances of the paths over a mirror, from end to end; None if there are none."""
        return self.reflected.terms(*pair, times) if self.mirror.any() else None

    def lengths(self, times: Array, out: Terms, home: Terms, through: Terms | None) -> Terms:
        """Return lengths with derivatives from the distances of both ends, (num_times, num_paths) each.

        `through` is what :meth:`through` gives.
        """
        time, (value, rate, acceleration) = times[:, None], self.between
        length = [a + b for a, b in zip(out, home, strict=True)]
        if through is not None:
            for column, part in zip(length, through, strict=True):
                column[:, self.mirror] = part
        length[0] += value + time * (rate + 0.5 * time * acceleration)
        length[1] += rate + time * acceleration
        length[2] += acceleration
        return Terms(*length)


_VELOCITIES = ("tx_velocity", "rx_velocity")


def is_known(paths: RadarPaths) -> npt.NDArray[np.bool_]:
    """Return the paths whose end points' velocities are known, shape (num_paths,)."""
    if paths.tx_velocity is None or paths.rx_velocity is None:
        return np.zeros(paths.num_paths, dtype=np.bool_)
    return row_all(np.isfinite(paths.tx_velocity)) & row_all(np.isfinite(paths.rx_velocity))


def center_terms(paths: RadarPaths, time: float) -> tuple[Array, Array, Array, Array]:
    """Return lengths between the array centres at a time [s], their derivatives, and strengths over those at 0.

    Parameters
    ----------
    paths : RadarPaths
        Of known velocities.
    time : float
        [s].
    """
    none = np.zeros((0, 3))
    motion = PathMotion._of(paths, none, none, np.ones(paths.num_paths, dtype=np.complex128))
    length, strength, _ = motion.terms(None, None, np.array([time]))
    return length.value[0], length.rate[0], length.acceleration[0], strength[0]


@dataclass(frozen=True, eq=False)
class PairTerms:
    """Lengths of pairs about the frame's start, to second order, of paths of any kind.

    Paths whose velocities are not known have the rates of the array centres for every pair; those in linear motion have
    no acceleration, and strengths of both stay.

    Attributes
    ----------
    paths : RadarPaths
    geometry : PathGeometry
    motion : PathMotion or None
        None if no velocity is known.
    """

    paths: RadarPaths
    geometry: PathGeometry
    motion: PathMotion | None

    @classmethod
    def of(cls, paths: RadarPaths, radar: RadarSpec) -> PairTerms:
        """Return the terms of paths for a radar."""
        geometry = PathGeometry.of(paths, radar)
        motion = PathMotion.of(paths, radar, geometry) if is_known(paths).any() else None
        return cls(paths, geometry, motion)

    def start(self, tx: int, rx: int) -> Terms:
        """Return lengths with their derivatives at the frame's start, shape (num_paths,) each."""
        length = self.geometry.length(tx, rx)
        own = self.paths.length_rate, self.paths.length_acceleration
        if self.motion is None:
            return Terms(length, *own)
        start, (out, home) = np.zeros(1), self._of_antennas
        found = self.motion.lengths(start, out[tx], home[rx], self.motion.through((tx, rx), start))
        rate, bend = found.rate[0], np.where(self._bends, found.acceleration[0], 0.0)
        if self._known.all():
            return Terms(length, rate, bend)
        return Terms(length, np.where(self._known, rate, own[0]), np.where(self._known, bend, own[1]))

    @property
    def is_linear(self) -> bool:
        """Whether :meth:`shares` says all: known and linear motion, a scattering point, antennas that are all alike."""
        alone = self.motion is None or self.geometry.fields is not None or self.motion.mirror.any()
        return not alone and bool(self._known.all()) and not self._bends.any()

    def shares(self, block: slice) -> tuple[list[tuple[Array, Array, Array]], list[tuple[Array, Array, Array]]]:
        """Return of each transmitter and of each receiver what it has of lengths, rates, and amplitudes as a factor.

        Of some paths at the frame's start, (num_paths,) each, where :attr:`is_linear`; what lies between the ends is
        with the transmitters.

        Raises
        ------
        ParameterRangeError
            If a path ends at an antenna.
        """
        assert self.motion is not None  # by `is_linear`
        geometry, motion = self.geometry, self.motion
        out, home = geometry.tx_distance[:, block], geometry.rx_distance[:, block]
        if not all(((ends > 0.0) & (ends < np.inf)).all() for ends in (out, home)):
            for tx, rx in np.ndindex(len(out), len(home)):
                geometry.pair_amplitude(tx, rx)
        inner, rate = geometry.inner_length[block], motion.between.rate[block]
        tx_center, rx_center = (center[block] for center in geometry.center_distance[:2])
        sent = zip(out + inner, motion.tx.rates(out, block) + rate, tx_center / out, strict=True)
        heard = zip(home, motion.rx.rates(home, block), rx_center / home, strict=True)
        return list(sent), list(heard)

    @cached_property
    def _known(self) -> npt.NDArray[np.bool_]:
        return is_known(self.paths)

    @cached_property
    def _bends(self) -> npt.NDArray[np.bool_]:
        """Paths in known motion that is not linear."""
        return np.asarray(self._known & ~self.paths.filled("linear_motion"))

    @cached_property
    def _bent(self) -> PathMotion | None:
        """The motion of those alone; None if there are none."""
        return self.motion.select(np.flatnonzero(self._bends)) if self.motion and self._bends.any() else None

    @cached_property
    def _of_antennas(self) -> tuple[list[Terms], list[Terms]]:
        """Distances of both ends from every antenna at the frame's start."""
        assert self.motion is not None  # asked for by `start` alone
        start, ends = np.zeros(1), (self.motion.tx, self.motion.rx)
        out, home = ([end.terms(number, start) for number in range(len(end.arms.start))] for end in ends)
        return out, home

    def growth(self, tx: int, rx: int, time: float) -> npt.NDArray[np.complex128]:
        """Return strengths at a time [s] over those at the frame's start, shape (num_paths,)."""
        grown = np.ones(self.paths.num_paths, dtype=np.complex128)
        if self._bent is not None:
            start, then = self._bent.ends(tx, rx, np.array([0.0, time])).strength
            grown[self._bends] = then / start
        return grown
