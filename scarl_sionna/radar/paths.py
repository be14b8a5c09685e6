"""What every channel solver returns: geometric paths between the radar's antennas, exact for each antenna."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_all, row_norm
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.prompt.describe import Described, Row, field_rows, listed

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class RadarPaths(
    Described,
    units={
        "tx_point": "m",
        "rx_point": "m",
        "inner_length": "m",
        "length_rate": "m/s",
        "length_acceleration": "m/s2",
        "tx_velocity": "m/s",
        "rx_velocity": "m/s",
    },
):
    """Propagation paths of one radar at one instant.

    The length of a path from an antenna at p to one at q is ``|tx_point - p| + inner_length + |rx_point - q|``. For a
    single scattering both points are the hit point and the inner length is 0; behind a chain of mirror reflections a
    point is the image of the scatterer. A path of mirror reflections only has no scattering point: its length is
    ``|rx_image(q) - p|``, and `rx_image` holds the isometry.

    Over a frame the end points move with their velocities and the antennas with the radars, so that every
    transmit-receive pair has its own rate. What `length_rate` and `length_acceleration` have beyond that is taken as
    the change of `inner_length`.

    Attributes
    ----------
    tx_point, rx_point : ndarray of float64, shape (num_paths, 3)
        Virtual end points [m, world].
    inner_length : ndarray of float64, shape (num_paths,)
        Length between the two end points [m].
    a : ndarray of complex128, shape (num_paths, 2, 2)
        Polarimetric transfer, dimensionless, between the array centres (the radar frame's origins), without the
        carrier's phase over the length and without antennas, so that ``|a|**2`` is received over transmitted power of
        isotropic antennas. Rows: received theta-hat (V), phi-hat (H); columns: transmitted. Spherical basis of the
        radar frame (z up) at each end. The field at the receiver is ``a * exp(-2j pi f tau)``.
    length_rate : ndarray of float64, shape (num_paths,)
        d(length)/dt at the array centres [m/s].
    length_acceleration : ndarray of float64, shape (num_paths,)
        Second derivative of the length [m/s2]; zero where a solver keeps to first order (SCaRL's linear motion).
    instance, interaction : ndarray of int32, shape (num_paths, max_depth)
        Instance id and kind of each interaction, -1 beyond the path's depth.
    depth : ndarray of int32, shape (num_paths,)
        Number of interactions.
    semantic : ndarray of uint8, shape (num_paths,)
        Semantic class of the last scatterer.
    rx_image : ndarray of float64, shape (num_paths, 3, 4), or None
        For paths of mirror reflections only: isometry that maps the receiver to its image, last column [m];
        NaN for other paths.
    world_from_tx, world_from_rx : Pose
        Radar frames of the transmitter and of the receiver; equal for a monostatic radar.
    tx_velocity, rx_velocity : ndarray of float64, shape (num_paths, 3), or None
        Velocities of the end points relative to the origins of the two radar frames [m/s, world axes, which do not
        turn with the radar]. For a path of mirror reflections only, `rx_velocity` is that of the receiver's image
        relative to the transmitter, and `tx_velocity` is not used. NaN, or None for all: not known; directions then
        stay those of the frame's start.
    tx_slope, rx_slope : ndarray of complex128, shape (num_paths, 3, 2, 2), or None
        Change of `a` per metre by which an antenna is off the array's centre along the axes of the radar frame, of the
        transmitter and of the receiver [1/m], at equal spreading. None: not known; `a` then serves all antennas.
    over_time : ndarray of complex128, shape (num_paths, 2), or None
        Change of `a` over a frame, as directions to what scatters turn, at equal spreading: at the time t after its
        start it is ``a * (1 + over_time[:, 0] * t + over_time[:, 1] * t**2)`` [1/s], [1/s2]. None: of no path.
    linear_motion : ndarray of bool, shape (num_paths,), or None
        Whether a path keeps to first order over a frame, as SCaRL has it: the length of every pair is linear in time,
        strengths stay. None: of no path.
    random_phase : ndarray of bool, shape (num_paths,), or None
        Whether the phase of `a` is one draw of a rough surface's: what is known is the power. None: of no path.
    over_band : ndarray of complex128, shape (num_paths, num_frequencies), or None
        Transfer at the Chebyshev nodes of `band` (:func:`band_nodes`) over `a`, dimensionless. None: `a` is that of
        all frequencies.
    band : tuple of float, or None
        Lowest and highest frequency of `over_band` [Hz].
    tx_twist, rx_twist : Twist
        Motion of the two radar frames. Only the angular velocity acts on a frame's signal: velocities are relative.
    diagnostics : mapping
        What the solver chose and left out.
    """

    tx_point: npt.NDArray[np.float64]
    rx_point: npt.NDArray[np.float64]
    inner_length: npt.NDArray[np.float64]
    a: npt.NDArray[np.complex128]
    length_rate: npt.NDArray[np.float64]
    length_acceleration: npt.NDArray[np.float64]
    instance: npt.NDArray[np.int32]
    interaction: npt.NDArray[np.int32]
    depth: npt.NDArray[np.int32]
    semantic: npt.NDArray[np.uint8]
    world_from_tx: Pose
    world_from_rx: Pose
    rx_image: npt.NDArray[np.float64] | None = None
    tx_velocity: npt.NDArray[np.float64] | None = None
    rx_velocity: npt.NDArray[np.float64] | None = None
    tx_slope: npt.NDArray[np.complex128] | None = None
    rx_slope: npt.NDArray[np.complex128] | None = None
    over_time: npt.NDArray[np.complex128] | None = None
    linear_motion: npt.NDArray[np.bool_] | None = None
    random_phase: npt.NDArray[np.bool_] | None = None
    over_band: npt.NDArray[np.complex128] | None = None
    band: tuple[float, float] | None = None
    tx_twist: Twist = field(default_factory=Twist)
    rx_twist: Twist = field(default_factory=Twist)
    diagnostics: Mapping[str, Any] = field(default_factory=dict)

    def _facts(self) -> Iterable[Row]:
        yield "num_paths", f"{self.num_paths}, of at most {self.instance.shape[1]} interactions"
        yield "method", str(self.diagnostics.get("method", "not stated"))
        yield from field_rows(self, without=("diagnostics",))
        yield "diagnostics", listed(self.diagnostics)

    @property
    def num_paths(self) -> int:
        """Number of paths."""
        return int(self.inner_length.shape[0])

    @cached_property
    def is_mirror_chain(self) -> npt.NDArray[np.bool_]:
        """Whether each path is of mirror reflections only, shape (num_paths,); not to be written to."""
        if self.rx_image is None:
            found = np.zeros(self.num_paths, dtype=np.bool_)
        else:
            found = row_all(np.isfinite(self.rx_image).reshape(self.num_paths, 12))
        found.flags.writeable = False
        return found

    @property
    def is_monostatic(self) -> bool:
        """Whether one radar sends and receives: both radar frames are one."""
        return _same(self.world_from_tx, self.world_from_rx)

    @cached_property
    def is_one_end(self) -> bool:
        """Whether every path comes back from the point that it goes to, to the place that it came from."""
        if self.rx_image is not None or not np.array_equal(self.world_from_tx.position, self.world_from_rx.position):
            return False
        return self.rx_point is self.tx_point or np.array_equal(self.tx_point, self.rx_point)

    def end_vectors(self) -> tuple[Array, Array]:
        """Return the vectors along which paths leave the transmitter's origin and arrive at the receiver's.

        Returns
        -------
        tx_vector, rx_vector : ndarray of float64, shape (num_paths, 3)
            [m, world]: to `tx_point` and `rx_point`; for a path of mirror reflections only, to the image of the other
            end.
        """
        tx_vector = self.tx_point - self.world_from_tx.position
        if self.is_one_end:
            return tx_vector, tx_vector
        rx_vector = self.rx_point - self.world_from_rx.position
        mirror = self.is_mirror_chain
        if self.rx_image is not None and mirror.any():
            turn, shift = self.rx_image[mirror, :, :3], self.rx_image[mirror, :, 3]
            there = turn @ self.world_from_rx.position + shift - self.world_from_tx.position
            tx_vector[mirror] = there
            # seen from the receiver, the path arrives from the image of the transmitter under the inverse isometry
            rx_vector[mirror] = -np.einsum("pji,pj->pi", turn, there)
        return tx_vector, rx_vector

    @property
    def length(self) -> Array:
        """Length of each path between the array centres [m], shape (num_paths,); of its reverse the same number."""
        tx_vector, rx_vector = self.end_vectors()
        there = row_norm(tx_vector)
        back = there if rx_vector is tx_vector else row_norm(rx_vector)
        return np.where(self.is_mirror_chain, there, there + back + self.inner_length)

    @classmethod
    def empty(cls, world_from_tx: Pose, world_from_rx: Pose | None = None, max_depth: int = 1) -> RadarPaths:
        """Return no path.

        Parameters
        ----------
        world_from_tx, world_from_rx : Pose
            Radar frames; the second is the first where left out.
        max_depth : int
            Columns of `instance` and `interaction`.
        """
        return cls(
            tx_point=np.zeros((0, 3)),
            rx_point=np.zeros((0, 3)),
            inner_length=np.zeros(0),
            a=np.zeros((0, 2, 2), np.complex128),
            length_rate=np.zeros(0),
            length_acceleration=np.zeros(0),
            instance=np.zeros((0, max_depth), np.int32),
            interaction=np.zeros((0, max_depth), np.int32),
            depth=np.zeros(0, np.int32),
            semantic=np.zeros(0, np.uint8),
            world_from_tx=world_from_tx,
            world_from_rx=world_from_tx if world_from_rx is None else world_from_rx,
        )

    @classmethod
    def concatenate(cls, blocks: Sequence[RadarPaths], diagnostics: Mapping[str, Any] | None = None) -> RadarPaths:
        """Return the paths of several blocks of one radar, in their order.

        Parameters
        ----------
        blocks : sequence of RadarPaths
            At least one, all between the same poses. Labels are padded with -1 to the longest chain. The twists are
            those of the first block that has paths.
        diagnostics : mapping, optional
            Of the result; empty where left out, since no block's own would tell of the others.

        Raises
        ------
        ParameterRangeError
            If there is no block, or two are of different radar poses.
        """
        if not blocks:
            raise ParameterRangeError("blocks", "none", "at least one", "use RadarPaths.empty(pose) for no path")
        first = blocks[0]
        for number, block in enumerate(blocks):
            if not (
                _same(block.world_from_tx, first.world_from_tx) and _same(block.world_from_rx, first.world_from_rx)
            ):
                raise ParameterRangeError(
                    "blocks",
                    f"number {number} is of another radar pose than the first",
                    "paths of one radar at one instant",
                )
        width = max(block.instance.shape[1] for block in blocks)
        moving = next((block for block in blocks if block.num_paths), first)
        merged: dict[str, Any] = {}
        column: list[npt.NDArray[Any]]
        for item in fields(cls):
            if item.name in _OF_ALL_PATHS:
                continue
            if item.name in ("instance", "interaction"):
                column = [_padded(getattr(block, item.name), width) for block in blocks]
            elif item.name == "over_band":
                column = _over_one_band(blocks)
            elif item.name in _NOT_KNOWN:
                known = any(getattr(block, item.name) is not None for block in blocks)
                column = [block.filled(item.name) for block in blocks] if known else []
            else:
                column = [getattr(block, item.name) for block in blocks]
            merged[item.name] = np.concatenate(column) if column else None
        merged |= {"world_from_tx": first.world_from_tx, "world_from_rx": first.world_from_rx}
        merged |= {"tx_twist": moving.tx_twist, "rx_twist": moving.rx_twist}
        merged["band"] = next((block.band for block in blocks if block.band is not None), None)
        return cls(**merged, diagnostics={} if diagnostics is None else diagnostics)

    def filled(self, name: str) -> npt.NDArray[Any]:
        """Return an optional column, of one value that says so where it is not known."""
        column: npt.NDArray[Any] | None = getattr(self, name)
        shape, value = _NOT_KNOWN[name]
        return np.full((self.num_paths, *shape), value) if column is None else column

    @property
    def apparent_points(self) -> Array:
        """Where the receiver sees each path: along its direction of arrival, at half its length.

        (num_paths, 3) [m, world].
        """
        arrival = self.end_vectors()[1]
        unit = arrival / np.maximum(np.linalg.norm(arrival, axis=1, keepdims=True), 1e-12)
        return np.asarray(self.world_from_rx.position + unit * (self.length / 2.0)[:, None])

    def plot(self, view: str = "range", dynamic_range_db: float = 60.0, ax: Axes | None = None) -> Axes:
        """Draw the paths.

        Parameters
        ----------
        view : {"range", "map"}
            ``"range"``: received power of isotropic antennas over half the length, coloured by radial velocity.
            ``"map"``: from above, where the radar sees each path (its direction of arrival, at half its length),
            coloured by power.
        dynamic_range_db : float
            Paths farther below the strongest are left out [dB].
        ax : matplotlib.axes.Axes, optional
            Drawn into; default: those of a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        UnknownNameError
            If there is no such view.
        """
        from .path_plot import plot_paths

        return plot_paths(self, view, dynamic_range_db, ax)

    def select(self, index: npt.ArrayLike | slice) -> RadarPaths:
        """Return the paths of an index of any shape (n,), a mask of shape (num_paths,) or a slice."""
        chosen = np.asarray(index) if not isinstance(index, slice) else index
        every = {item.name: getattr(self, item.name) for item in fields(self)}
        arrays = {name: value for name, value in every.items() if isinstance(value, np.ndarray)}
        known = {id(value): _some(value, chosen) for value in arrays.values()}  # what is one array stays one
        changed: dict[str, Any] = {name: known[id(value)] for name, value in arrays.items()}
        rest = {name: value for name, value in every.items() if name not in changed}
        return RadarPaths(**changed, **rest)

    def scaled(self, factor: npt.ArrayLike) -> RadarPaths:
        """Return the paths with fields, and what they change by over arrays, times a factor.

        Parameters
        ----------
        factor : array_like, shape (), (num_paths,) or (num_paths, 2, 2)
            Of each path, or of each pair of polarisations.
        """
        times = np.asarray(factor)
        times = times.reshape(times.shape + (1,) * (3 - times.ndim)) if times.ndim < 3 else times
        changed: dict[str, Any] = {"a": self.a * times}
        for name in ("tx_slope", "rx_slope"):
            if (slope := getattr(self, name)) is not None:
                changed[name] = slope * times[:, None]
        return replace(self, **changed)

    def reversed(self) -> RadarPaths:
        """Return the same paths the other way round, with the two radars exchanged (reciprocity).

        `semantic` stays that of the last scatterer of the paths as they are.

        Raises
        ------
        ParameterRangeError
            If there are paths of mirror reflections only.
        """
        if self.is_mirror_chain.any():
            raise ParameterRangeError("paths", "of mirror reflections only", "paths with a scatterer", "select others")
        swapped: dict[str, Any] = {f"{one}_{what}": getattr(self, f"{other}_{what}") for one, other, what in _ENDS}
        swapped |= {"world_from_tx": self.world_from_rx, "world_from_rx": self.world_from_tx}
        for one, other in (("tx_slope", self.rx_slope), ("rx_slope", self.tx_slope)):
            swapped[one] = None if other is None else other.transpose(0, 1, 3, 2).copy()
        swapped |= {name: _backward(getattr(self, name), self.depth) for name in ("instance", "interaction")}
        return replace(self, a=self.a.transpose(0, 2, 1).copy(), **swapped)


_AT_HAND = 1e-9
"""A point this near [m] is at the observer: a guard against division by zero."""
_OF_ALL_PATHS = ("world_from_tx", "world_from_rx", "tx_twist", "rx_twist", "band", "diagnostics")
_NOT_KNOWN: Mapping[str, tuple[tuple[int, ...], complex | float | bool]] = {
    "rx_image": ((3, 4), np.nan),
    "tx_velocity": ((3,), np.nan),
    "rx_velocity": ((3,), np.nan),
    "tx_slope": ((3, 2, 2), 0.0j),
    "rx_slope": ((3, 2, 2), 0.0j),
    "over_time": ((2,), 0.0j),
    "linear_motion": ((), False),
    "random_phase": ((), False),
}
"""Optional columns: shape of a path's value, and what stands for none."""


def bend_of(offset: Array, velocity: Array) -> Array:
    """Return the second derivative of the distance to points in straight motion [m/s2].

    By definition: what moves across the line of sight, squared, over the distance.

    Parameters
    ----------
    offset, velocity : ndarray of float64, shape (num_points, 3)
        From the observer to the points [m], and relative to it [m/s].
    """
    squared = np.maximum(np.einsum("pi,pi->p", offset, offset), _AT_HAND**2)
    across = velocity - (np.einsum("pi,pi->p", offset, velocity) / squared)[:, None] * offset
    return np.asarray(np.einsum("pi,pi->p", across, across) / np.sqrt(squared))


def band_nodes(band: tuple[float, float], count: int) -> Array:
    """Return Chebyshev's nodes of a band [Hz], falling, shape (count,).

    By definition.
    """
    angle = (np.arange(count) + 0.5) * np.pi / count
    return np.asarray(0.5 * (band[0] + band[1]) + 0.5 * (band[1] - band[0]) * np.cos(angle))


def _over_one_band(blocks: Sequence[RadarPaths]) -> list[npt.NDArray[Any]]:
    """Return the transfers over the band of blocks, 1 where a block has none; none if no block has any."""
    known = [block for block in blocks if block.over_band is not None]
    if not known:
        return []
    count = known[0].over_band.shape[1]  # type: ignore[union-attr]
    if {block.band for block in known} != {known[0].band} or any(block.over_band.shape[1] != count for block in known):  # type: ignore[union-attr]
        allowed = "the same band and number of frequencies"
        raise ParameterRangeError("blocks", "of several bands", allowed, "solve all with the same num_band_frequencies")
    ones = (np.ones((block.num_paths, count), dtype=np.complex128) for block in blocks)
    return [one if block.over_band is None else block.over_band for block, one in zip(blocks, ones, strict=True)]


_ENDS = tuple(
    (one, other, what) for what in ("point", "velocity", "twist") for one, other in (("tx", "rx"), ("rx", "tx"))
)
"""Columns of the two ends of a path."""


def _backward(labels: npt.NDArray[np.int32], depth: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
    """Return the labels of chains from the other end, -1 beyond their depth, shape (num_paths, max_depth)."""
    step = np.arange(labels.shape[1])
    place = np.where(step < depth[:, None], depth[:, None] - 1 - step, step)
    return np.take_along_axis(labels, place, axis=1)


def _padded(labels: npt.NDArray[np.int32], width: int) -> npt.NDArray[np.int32]:
    return np.pad(labels, [(0, 0), (0, width - labels.shape[1])], constant_values=-1)


def _same(one: Pose, other: Pose) -> bool:
    return np.array_equal(one.position, other.position) and np.array_equal(one.quaternion, other.quaternion)


def _some(values: npt.NDArray[Any], chosen: npt.NDArray[Any] | slice) -> npt.NDArray[Any]:
    """Return some rows; by `take`, which moves rows whole, where they are given by number."""
    if isinstance(chosen, slice) or chosen.dtype.kind not in "iu" or chosen.ndim != 1:
        return values[chosen]
    return np.take(values, chosen, axis=0)
