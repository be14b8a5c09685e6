"""Ground truth on radar data: which instance, which class, directly or by multipath; of paths, cells and detections."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_any
from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.prompt.describe import Described
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.paths.tracing import DIFFUSE, REFRACTION
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.point_scatterers import POINT_INTERACTION
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.angle import directions, near_steering
from scarl_sionna.signal.detection import RadarPoints
from scarl_sionna.signal.direction.several import separating_weights
from scarl_sionna.signal.processing import RangeDoppler, range_doppler, virtual_cube

from .spread import CellSpread, PathCells

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]
Ids = npt.NDArray[np.int32]
Mask = npt.NDArray[np.bool_]

MAIN_LOBE = 2.0
"""Bins from the middle of Hann's main lobe to its end."""
SIDELOBE_LIMIT = 0.1
"""Power of an instance's sidelobes in a cell, over the noise in it, down to which they count."""
_COUNTED = 1 << 16
"""Whole numbers up to so many above the number of values are counted, not sorted: decides no result."""
NO_INSTANCE = 0
"""Instance of what no path explains: noise, sidelobes, a line of sight between two radars."""


@dataclass(frozen=True, eq=False, repr=False)
class PathLabels(Described):
    """Label of every path.

    Attributes
    ----------
    instance : ndarray of int32, shape (num_paths,)
        Instance that scatters; 0 for a line of sight.
    semantic : ndarray of uint8, shape (num_paths,)
        Its class.
    is_ghost : ndarray of bool, shape (num_paths,)
        True if the path touches another instance beside it (multipath); a pane that it passes straight does not count.
    mirror : ndarray of int32, shape (num_paths, max_depth)
        The other instances along the way, in order, -1 behind the last.
    """

    instance: Ids
    semantic: npt.NDArray[np.uint8]
    is_ghost: Mask
    mirror: Ids


@dataclass(frozen=True, eq=False, repr=False)
class CellLabels(Described, units={"power": "W"}):
    """Labels of a range-Doppler map. Instance and class are 0 and shares are 0 where no path reaches.

    Attributes
    ----------
    instance, semantic : ndarray of int32 and uint8, shape (num_doppler_bins, num_range_bins)
        Of the instance with most power in the cell, direct and multipath together.
    share : ndarray of float32, same shape
        Its part of the power of all instances.
    ghost_share : ndarray of float32, same shape
        Part of the power of all instances that came by multipath.
    power : ndarray of float32, same shape
        Sum over instances of their power, averaged over the channels [W]. Compare with `RangeDoppler.noise_power` to
        leave out cells of noise.
    cell, entry_instance, entry_semantic, entry_is_ghost, entry_share : ndarray, shape (num_entries,)
        All that is in the cells, sorted by `cell`, the flat index into the map, then by instance, direct first. The
        shares of one cell sum to 1.
    """

    instance: Ids
    semantic: npt.NDArray[np.uint8]
    share: npt.NDArray[np.float32]
    ghost_share: npt.NDArray[np.float32]
    power: npt.NDArray[np.float32]
    cell: npt.NDArray[np.int64]
    entry_instance: Ids
    entry_semantic: npt.NDArray[np.uint8]
    entry_is_ghost: Mask
    entry_share: Array

    def shares(self, doppler_index: int, range_index: int) -> dict[tuple[int, bool], float]:
        """Return the share of every (instance, multipath) of one cell."""
        flat = np.ravel_multi_index((doppler_index, range_index), self.instance.shape)
        first, last = np.searchsorted(self.cell, [flat, flat + 1])
        return {
            (int(self.entry_instance[row]), bool(self.entry_is_ghost[row])): float(self.entry_share[row])
            for row in range(first, last)
        }


@dataclass(frozen=True, eq=False, repr=False)
class PointLabels(Described):
    """Labels of detections, one row a point.

    Attributes
    ----------
    instance : ndarray of int32, shape (num_points,)
        With most power at the point's range, velocity and angle; 0 if no path is near.
    semantic : ndarray of uint8, shape (num_points,)
    share : ndarray of float64, shape (num_points,)
        Its part of the power of all instances there.
    is_ghost : ndarray of bool, shape (num_points,)
        True if more of that instance's power came by multipath than directly.
    ghost_share : ndarray of float64, shape (num_points,)
        Part of the power of all instances that came by multipath.
    mirror : ndarray of int32, shape (num_points,)
        First mirror of the strongest path of a ghost; -1 for the others.
    explained : ndarray of float64, shape (num_points,)
        Power of all paths together there, with their phases, over the detected power, dimensionless: near 1 for a
        target, near 0 for noise.
    """

    instance: Ids
    semantic: npt.NDArray[np.uint8]
    share: Array
    is_ghost: Mask
    ghost_share: Array
    mirror: Ids
    explained: Array


def label_paths(paths: RadarPaths, state: WorldState | None = None) -> PathLabels:
    """Return instance, class and directness of every path.

    Parameters
    ----------
    paths : RadarPaths
    state : WorldState, optional
        Gives the class of the scattering instance where the last instance of the path is a mirror. Left out, it is
        looked up among the paths that end at that instance, and 0 if there is none.

    Returns
    -------
    PathLabels

    Notes
    -----
    The scattering instance is the last one that scatters (a point, a scattering centre, a rough or physical-optics
    patch). A path of mirror reflections and edges only has none: then it is the middle one of a chain that reads the
    same both ways (it turns back there), else the last. A chain within one instance, such as the corner of a guardrail,
    is direct.
    """
    kind, touched = paths.interaction, paths.instance
    step = np.arange(touched.shape[1])
    inside = step < paths.depth[:, None]
    solid = inside & (kind != REFRACTION)
    column = _scattering_column(paths, solid)
    row = np.arange(paths.num_paths)
    found = column >= 0
    if touched.shape[1] == 0:
        instance = np.zeros(paths.num_paths, dtype=np.int32)
    else:
        instance = np.where(found, touched[row, np.maximum(column, 0)], NO_INSTANCE).astype(np.int32)
    other = solid & (touched != instance[:, None])
    order = np.argsort(~other, axis=1, kind="stable")
    mirror = np.take_along_axis(np.where(other, touched, -1), order, axis=1).astype(np.int32)
    return PathLabels(instance, _classes(paths, instance, state), row_any(other), mirror)


def _scattering_column(paths: RadarPaths, solid: Mask) -> npt.NDArray[np.int64]:
    """Return which interaction of a path is labelled, -1 for none."""
    width = solid.shape[1]
    if width == 0:
        return np.full(paths.num_paths, -1, dtype=np.int64)
    scatters = solid & np.isin(paths.interaction, (POINT_INTERACTION, DIFFUSE))
    last = width - 1 - np.argmax(solid[:, ::-1], axis=1)
    scattered = row_any(scatters)
    column = np.where(row_any(solid), last, -1)
    for row in np.flatnonzero(~scattered & (solid.sum(axis=1) >= 3)):
        where = np.flatnonzero(solid[row])
        chain = paths.instance[row, where]
        if len(where) % 2 and np.array_equal(chain, chain[::-1]):
            column[row] = where[len(where) // 2]
    return np.where(scattered, width - 1 - np.argmax(scatters[:, ::-1], axis=1), column)


def _classes(paths: RadarPaths, instance: Ids, state: WorldState | None) -> npt.NDArray[np.uint8]:
    """Return the class of the labelled instances."""
    known = {NO_INSTANCE: 0}
    if paths.instance.shape[1]:
        ends = paths.instance[np.arange(paths.num_paths), np.maximum(paths.depth - 1, 0)]
        numbers, inverse = _distinct(ends)
        first = np.empty(len(numbers), dtype=np.int64)
        first[inverse[::-1]] = np.arange(len(ends))[::-1]  # the last that is written stays
        known |= {int(number): int(paths.semantic[row]) for number, row in zip(numbers, first, strict=True)}
    if state is not None:
        known |= {number: int(info.semantic) for number, info in state.world.instances.items()}
    numbers, inverse = _distinct(instance)
    return np.array([known.get(int(number), 0) for number in numbers], dtype=np.uint8)[inverse]


def _distinct(values: npt.NDArray[np.integer]) -> tuple[npt.NDArray[np.integer], npt.NDArray[np.int64]]:
    """Return which whole numbers there are, rising, and the place of each value among them."""
    if not len(values) or values.min() < 0 or values.max() > len(values) + _COUNTED:
        numbers, inverse = np.unique(values, return_inverse=True)
        return numbers, inverse.reshape(-1).astype(np.int64)
    numbers = np.flatnonzero(np.bincount(values))
    place = np.zeros(int(numbers[-1]) + 1, dtype=np.int64)
    place[numbers] = np.arange(len(numbers))
    return numbers, place[values]


def label_cells(
    rd: RangeDoppler,
    paths: RadarPaths,
    state: WorldState | None = None,
    method: Literal["spread", "sidelobes", "synthesis"] = "spread",
) -> CellLabels:
    r"""Return which instances fill the cells of a range-Doppler map, and with which share of the power.

    Parameters
    ----------
    rd : RangeDoppler
        The map; its axes, windows and radar are used, not its data.
    paths : RadarPaths
        That the raw data was made of.
    state : WorldState, optional
        See :func:`label_paths`.
    method : {"spread", "sidelobes", "synthesis"}
        ``"spread"`` puts each path's field onto the cells of the windows' main lobes; ``"sidelobes"`` along both axes
        as far as the sidelobes of an instance are above a tenth of the map's noise. ``"synthesis"`` makes the raw
        data of each instance alone and transforms it: exact, sidelobes included, one synthesis for each instance.
        Always synthesized are: all instances where chirps have carriers of their own, whose lobe is no product over
        range and Doppler; those with paths beyond the unambiguous velocity of staggered chirps or of stepped bursts,
        which have images at several rows or ranges; and for ``"sidelobes"`` those whose strongest cell is above that
        tenth where chirps are staggered, whose sidelobes are not the window's.

    Returns
    -------
    CellLabels

    Raises
    ------
    ParameterRangeError
        If the method is unknown.

    Notes
    -----
    For group g (an instance, direct or multipath) and channel c the field of a cell is

    .. math:: X_{gc} = \sum_{p \in g} A_{pc} e^{j \phi_{pc}} W_r(k - k_p) W_d(l - l_p)

    with the beat amplitude (antenna gains and power included) and exact phase of the path at the middle of the frame,
    and the transforms W of the windows, cut at their first minimum. The power of a group is the mean over channels of
    :math:`|X_{gc}|^2`, its share that over the sum of all groups: interference between groups belongs to none of them.

    *Not modelled* by ``"spread"``: sidelobes; by both: the smear of range migration within the frame and of the delay's
    acceleration. Cells that hold only sidelobes of what is elsewhere are empty. Measured errors: docs/radar_labels.md.
    """
    if method not in ("spread", "sidelobes", "synthesis"):
        raise ParameterRangeError("method", repr(method), "'sidelobes', 'spread' or 'synthesis'")
    labels = label_paths(paths, state)
    lobes = rd.radar.waveform.chirp_frequencies is None or rd.radar.waveform.burst > 1
    table = CellSpread.of(rd, paths) if method != "synthesis" and lobes else None
    limit = SIDELOBE_LIMIT * rd.noise_power if method == "sidelobes" else None
    beyond, uneven = _beyond_lobes(rd.radar, paths), rd.radar.waveform.chirp_delays is not None
    cells, powers, rows = [], [], []
    groups = _groups(labels)
    for number, index in enumerate(groups.rows()):
        filled, power = table.power(index, limit) if table is not None else (None, np.zeros(0))
        sides = uneven and limit is not None and power.max(initial=0.0) > limit
        if filled is None or sides or beyond[index].any():
            filled, power = _synthesized(rd, paths.select(index))
        cells.append(filled)
        powers.append(power)
        rows.append(np.full(len(filled), number))
    empty = np.zeros(0, dtype=np.int64)
    cell, row = (np.concatenate([empty, *blocks]) for blocks in (cells, rows))
    power = np.concatenate([np.zeros(0), *powers])
    return _assemble(_Entries(cell, power, row), groups, labels.semantic, rd.data.shape[1:])


@dataclass(frozen=True, eq=False)
class _Groups:
    """Paths by instance and directness.

    `key` (instance, multipath), rising, shape (num_groups, 2), and `member`, the group of every path.
    """

    key: npt.NDArray[np.int64]
    member: npt.NDArray[np.int64]

    def rows(self) -> list[npt.NDArray[np.int64]]:
        """Return the paths of each group, rising."""
        counts = np.bincount(self.member, minlength=len(self.key))
        member = self.member.astype(np.uint16) if len(counts) < 1 << 16 else self.member  # sorted by counting
        return np.split(np.argsort(member, kind="stable"), np.cumsum(counts)[:-1]) if len(counts) else []


@dataclass(frozen=True, eq=False)
class _Entries:
    """Power [W] of groups in cells: flat index of the cell, power, and row of the group, each (num_entries,)."""

    cell: npt.NDArray[np.int64]
    power: Array
    group: npt.NDArray[np.int64]


def _groups(labels: PathLabels) -> _Groups:
    """Return the groups of paths."""
    both = 2 * labels.instance.astype(np.int64) + labels.is_ghost  # one number: rows of two sort many times as long
    number, member = _distinct(both)
    return _Groups(np.stack([number // 2, number % 2], axis=1), member)


def _beyond_lobes(radar: RadarSpec, paths: RadarPaths) -> npt.NDArray[np.bool_]:
    """Return which paths are so fast that a point has more than one lobe, or another one than at rest.

    Beyond the unambiguous velocity of staggered chirps; of stepped bursts also where the main lobe reaches beyond it.
    """
    waveform, fastest = radar.waveform, radar.unambiguous_velocity
    if waveform.chirp_delays is None and waveform.burst == 1:
        return np.zeros(paths.num_paths, dtype=np.bool_)
    reach = MAIN_LOBE * radar.velocity_resolution if waveform.burst > 1 else 0.0
    return np.asarray(0.5 * np.abs(paths.length_rate) > fastest - reach)


def _synthesized(rd: RangeDoppler, paths: RadarPaths) -> tuple[npt.NDArray[np.int64], Array]:
    """Return the cells that paths alone fill in a map like the given one, flat, and their power there [W]."""
    cube = virtual_cube(synthesize(paths, rd.radar), rd.radar)
    num_doppler, num_range = rd.data.shape[1:]
    alone = range_doppler(cube, rd.radar, *rd.window, num_range_bins=num_range, num_doppler_bins=num_doppler)
    power = alone.power.astype(np.float64).reshape(-1)
    filled = np.flatnonzero(power)
    return filled, power[filled]


def _assemble(
    entries: _Entries, groups: _Groups, semantic: npt.NDArray[np.uint8], shape: tuple[int, ...]
) -> CellLabels:
    """Return the maps from the power of groups in cells; `semantic` is the class of every path."""
    order = np.argsort(entries.cell * len(groups.key) + entries.group, kind="stable")  # runs, one a group, are merged
    cell, power, row = entries.cell[order], entries.power[order], entries.group[order]
    size = int(np.prod(shape))
    total = np.bincount(cell, weights=power, minlength=size)
    share = power / total[cell]
    semantic_of = np.zeros(len(groups.key), dtype=np.uint8)
    semantic_of[groups.member] = semantic
    instance, ghost = groups.key[row, 0].astype(np.int32), groups.key[row, 1].astype(bool)
    # direct and multipath of one instance are neighbours in the order: sum them for the instance's share
    starts = np.flatnonzero((np.diff(cell, prepend=-1) != 0) | (np.diff(instance, prepend=-1) != 0))
    whole = np.add.reduceat(share, starts) if len(starts) else np.zeros(0)
    own = cell[starts]
    first = np.flatnonzero(np.diff(own, prepend=-1) != 0)
    most = np.maximum.reduceat(whole, first) if len(first) else np.zeros(0)
    strongest = np.flatnonzero(whole == np.repeat(most, np.diff(np.append(first, len(own)))))
    best = strongest[np.diff(own[strongest], prepend=-1) != 0]  # ties to the smaller instance
    where = own[best]
    best_instance, best_semantic = np.zeros(size, np.int32), np.zeros(size, np.uint8)
    best_share = np.zeros(size, np.float32)
    best_instance[where] = instance[starts][best]
    best_semantic[where] = semantic_of[row][starts][best]
    best_share[where] = whole[best]
    ghost_share = np.bincount(cell, weights=share * ghost, minlength=size).astype(np.float32)
    return CellLabels(
        instance=best_instance.reshape(shape),
        semantic=best_semantic.reshape(shape),
        share=best_share.reshape(shape),
        ghost_share=ghost_share.reshape(shape),
        power=total.astype(np.float32).reshape(shape),
        cell=cell,
        entry_instance=instance,
        entry_semantic=semantic_of[row],
        entry_is_ghost=ghost,
        entry_share=share,
    )


def label_points(
    points: RadarPoints,
    paths: RadarPaths,
    radar: RadarSpec,
    state: WorldState | None = None,
    window: str | None = "hann",
    doppler_window: str | None = None,
) -> PointLabels:
    r"""Return which instance made each detection, and whether it is a ghost.

    Parameters
    ----------
    points : RadarPoints
        From :func:`scarl_sionna.signal.detection.detect`.
    paths : RadarPaths
        That the raw data was made of.
    radar : RadarSpec
    state : WorldState, optional
        See :func:`label_paths`.
    window, doppler_window : str, optional
        As given to :func:`scarl_sionna.signal.angle.range_doppler_angle`.

    Returns
    -------
    PointLabels

    Warns
    -----
    ScarlWarning
        If paths are beyond the unambiguous velocity of stepped bursts: the points that they make are elsewhere.

    Notes
    -----
    The field of a group at a point is that of :func:`label_cells` at the point's own range and velocity, summed over
    the channels with the beam's weights towards the point's direction. So a ghost that leaves in one direction and
    arrives from another counts as the virtual array sees it, and paths in another direction count by the beam's
    sidelobe there. Points of one cell have beams that are 0 towards each other.
    """
    labels = label_paths(paths, state)
    groups = _groups(labels)
    beyond = (0.5 * np.abs(paths.length_rate) > radar.unambiguous_velocity) & (radar.waveform.burst > 1)
    if beyond.any():
        warnings.warn(
            f"{int(beyond.sum())} of {paths.num_paths} paths are faster than bursts tell apart, "
            f"{radar.unambiguous_velocity:.3g} m/s, and stand beside their place: their points may have no label; "
            "label_cells has them",
            ScarlWarning,
            stacklevel=2,
        )
    radar = radar.one_sided
    cells = PathCells.of(paths, radar, window, doppler_window)
    beam = _beams(points, radar)
    count = points.num_points
    instance, mirror = np.zeros(count, np.int32), np.full(count, -1, np.int32)
    semantic, is_ghost = np.zeros(count, np.uint8), np.zeros(count, bool)
    share, ghost_share, explained = np.zeros(count), np.zeros(count), np.zeros(count)
    for row in range(count):
        distance, velocity = float(points.range[row]), float(points.radial_velocity[row])
        near, weight = cells.near(distance, velocity)
        if not len(near):
            continue
        field = weight * (cells.fields(near, distance, _doppler_of(radar, velocity)) @ beam[row])
        total = _group_power(field, groups.member[near], len(groups.key))
        if not total.sum() > 0.0:
            continue
        part = total / total.sum()
        owner, inverse = np.unique(groups.key[:, 0], return_inverse=True)
        whole = np.bincount(inverse.reshape(-1), weights=part)
        best = int(whole.argmax())
        instance[row], share[row] = owner[best], whole[best]
        mine = groups.key[:, 0] == owner[best]
        ghost = groups.key[:, 1] == 1
        ghost_share[row] = part[ghost].sum()
        is_ghost[row] = part[mine & ghost].sum() > part[mine & ~ghost].sum()
        explained[row] = abs(field.sum()) ** 2 / points.power[row]
        own = (labels.instance[near] == instance[row]) & (labels.is_ghost[near] == is_ghost[row])
        strongest = near[own][np.abs(field[own]).argmax()]
        semantic[row] = labels.semantic[strongest]
        mirror[row] = labels.mirror[strongest, 0] if is_ghost[row] else -1
    return PointLabels(instance, semantic, share, is_ghost, ghost_share, mirror, explained)


def _beams(points: RadarPoints, radar: RadarSpec) -> npt.NDArray[np.complex128]:
    """Return the weights of the channels towards points, shape (num_points, num_virtual)."""
    phasors = near_steering(radar, directions(points.azimuth, points.elevation), points.range)
    beam = (np.conj(phasors) / radar.num_virtual).astype(np.complex128)
    own = np.arange(points.num_points) if points.cell is None else points.cell
    _, cell, count = np.unique(own, return_inverse=True, return_counts=True)
    for number in np.flatnonzero(count > 1):
        rows = np.flatnonzero(cell == number)
        beam[rows] = separating_weights(phasors[None, rows])[0]
    return beam


def _doppler_of(radar: RadarSpec, radial_velocity: float) -> float:
    """Return the Doppler frequency of a velocity [Hz], as the axis of the map has it."""
    return 2.0 * radial_velocity * radar.center_frequency / SPEED_OF_LIGHT


def _group_power(field: npt.NDArray[np.complex128], member: npt.NDArray[np.int64], num_groups: int) -> Array:
    """Return the power of the sums of fields within groups."""
    real = np.bincount(member, weights=field.real, minlength=num_groups)
    return np.asarray(real**2 + np.bincount(member, weights=field.imag, minlength=num_groups) ** 2)
