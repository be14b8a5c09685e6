"""Clusters: which points of a frame belong to one object."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol, TypedDict, Unpack

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.packages import require
from scarl_sionna.core.prompt.arguments import HOW_TO_RADAR, expect, number
from scarl_sionna.core.prompt.describe import Described, Row, field_rows
from scarl_sionna.core.specs.radar.spec import RadarSpec

from ..detection import RadarPoints

Array = npt.NDArray[np.float64]
Ids = npt.NDArray[np.int64]

HOW_TO_POINTS = "give ss.detect(cube)"


class Labels(Protocol):
    """What labels of points hold, one row a point: :func:`ss.label_points` returns them."""

    @property
    def instance(self) -> npt.NDArray[np.int32]:
        """Instance id, 0 where nothing is known."""

    @property
    def semantic(self) -> npt.NDArray[np.uint8]:
        """Index into `core.semantics.SEMANTIC_CLASSES`."""


class Reach(TypedDict, total=False):
    """Keywords of :func:`cluster`."""

    distance: float
    angle: float
    velocity: float
    min_points: int


@dataclass(frozen=True, eq=False, repr=False)
class RadarClusters(
    Described,
    units={"position": "m", "extent": "m", "radial_velocity": "m/s", "power": "W", "rcs": "m2"},
):
    """Objects of one frame as groups of points, strongest first; every array but `member` has one row a cluster.

    Attributes
    ----------
    position : ndarray of float64, shape (num_clusters, 3)
        Mean of the points, radar frame [m].
    extent : ndarray of float64, shape (num_clusters, 3)
        Largest less smallest coordinate of the points along the axes of the radar frame [m].
    radial_velocity : ndarray of float64, shape (num_clusters,)
        Mean of the points, positive when opening [m/s].
    power : ndarray of float64, shape (num_clusters,)
        Sum over the points [W].
    rcs : ndarray of float64, shape (num_clusters,)
        Sum over the points whose RCS is known [m2]; NaN where that of none is.
    num_points : ndarray of int64, shape (num_clusters,)
    instance : ndarray of int32, shape (num_clusters,)
        Of most points; of as many, of the strongest. 0 without labels.
    semantic : ndarray of uint8, shape (num_clusters,)
        Class of that instance; 0 without labels.
    share : ndarray of float64, shape (num_clusters,)
        Part of the points that have that instance; 0 without labels.
    member : ndarray of int64, shape (num_points_of_frame,)
        Cluster of each point of the frame, -1 for a point of none.
    """

    position: Array
    extent: Array
    radial_velocity: Array
    power: Array
    rcs: Array
    num_points: Ids
    instance: npt.NDArray[np.int32]
    semantic: npt.NDArray[np.uint8]
    share: Array
    member: Ids

    def _facts(self) -> Iterable[Row]:
        yield "num_clusters", f"{self.num_clusters}, strongest first; {int((self.member < 0).sum())} points of none"
        yield from field_rows(self)

    @property
    def num_clusters(self) -> int:
        """Number of clusters."""
        return int(self.num_points.shape[0])


def cluster(
    points: RadarPoints, radar: RadarSpec | None = None, labels: Labels | None = None, **reach: Unpack[Reach]
) -> RadarClusters:
    r"""Return the objects of one frame: groups of points near each other in place and radial velocity.

    Parameters
    ----------
    points : RadarPoints
    radar : RadarSpec, optional
        Given, velocities are compared modulo the interval that both points tell (`RadarPoints.velocity_interval`; of
        points that tell none the radar's unambiguous one): what is split by the interval's end stays whole.
    labels : PointLabels, optional
        Of the points, from :func:`ss.label_points`: clusters then have an instance and a class.
    **reach
        `distance` (2 m), `angle` (0.05 rad) and `velocity` (1.5 m/s): how far apart neighbours may be along the line of
        sight or across it, more across it by uncertain angles, and in radial velocity. `min_points` (2): neighbours,
        itself included, that make a point the core of a cluster; 1 leaves no point without cluster.

    Returns
    -------
    RadarClusters

    Raises
    ------
    InputTypeError
        If `points` are no points or `radar` is no radar.
    ParameterRangeError
        If a reach is not above 0 (`angle`: below 0), `min_points` below 1, or labels are not one a point.
    MissingPackageError
        If scikit-learn is not installed (``pip install 'scarl-sionna[tracking]'``).

    Notes
    -----
    DBSCAN [1]_ by scikit-learn, with reach 1 in the distance

    .. math:: d^2 = \left(\frac{\Delta_\parallel}{D}\right)^2 + \frac{\Delta_\perp^2}{D^2 + (\alpha r)^2}
              + \left(\frac{\Delta v}{V}\right)^2

    of differences along and across the line of sight to the middle of two points at distance r. How far points may lie
    apart is not charted.

    References
    ----------
    .. [1] M. Ester, H.-P. Kriegel, J. Sander, X. Xu, "A density-based algorithm for discovering clusters in large
       spatial databases with noise", Proc. KDD, 1996.
    """
    expect("points", points, RadarPoints, HOW_TO_POINTS)
    if radar is not None:
        expect("radar", radar, RadarSpec, HOW_TO_RADAR)
    for name in ("instance", "semantic"):
        if labels is not None and np.shape(getattr(labels, name)) != (points.num_points,):
            shape = np.shape(getattr(labels, name))
            raise ParameterRangeError(
                f"labels.{name}", f"an array of shape {shape}", f"({points.num_points},), one row a point"
            )
    for name in reach:
        if name not in Reach.__annotations__:
            raise UnknownNameError("option of cluster", name, tuple(Reach.__annotations__))
    min_points = reach.get("min_points", 2)
    if min_points < 1:
        raise ParameterRangeError("min_points", min_points, ">= 1")
    scale = (_reach("distance", reach, 2.0), _reach("angle", reach, 0.05), _reach("velocity", reach, 1.5))
    interval = np.full(points.num_points, np.inf) if radar is None else points.known_modulo(radar)
    scan = require("sklearn.cluster", "tracking").DBSCAN
    found = np.zeros(0, dtype=np.int64)
    if points.num_points:
        near = _distances(points, scale, interval)
        found = scan(eps=1.0, min_samples=min_points, metric="precomputed").fit(near).labels_.astype(np.int64)
    return _table(points, found, labels, interval)


def _reach(name: str, reach: Reach, default: float) -> float:
    """Return one of the lengths of neighbourhood."""
    value = number(name, reach.get(name, default), "give one number")
    if not np.isfinite(value) or value < 0.0 or (value == 0.0 and name != "angle"):
        unit = {"distance": "m", "angle": "rad", "velocity": "m/s"}[name]
        raise ParameterRangeError(name, f"{value:g} {unit}", ">= 0 rad" if name == "angle" else f"> 0 {unit}")
    return value


def _distances(points: RadarPoints, scale: tuple[float, float, float], interval: Array) -> csr_matrix:
    """Return the scaled distances of all pairs that may be neighbours, shape (num_points, num_points), sparse."""
    distance, angle, velocity = scale
    farthest = float(np.linalg.norm(points.position, axis=1).max())
    pairs = cKDTree(points.position).query_pairs(np.hypot(distance, angle * farthest), output_type="ndarray")
    first, second = pairs.T
    apart = points.position[first] - points.position[second]
    middle = (points.position[first] + points.position[second]) / 2.0
    range_ = np.linalg.norm(middle, axis=1)
    along = (apart * middle).sum(axis=1) / np.maximum(range_, 1e-9)
    across = np.maximum((apart**2).sum(axis=1) - along**2, 0.0)
    both = np.minimum(interval[first], interval[second])
    faster = _folded(points.radial_velocity[first] - points.radial_velocity[second], both)
    squared = (along / distance) ** 2 + across / (distance**2 + (angle * range_) ** 2) + (faster / velocity) ** 2
    near = squared <= 1.0
    first, second, value = first[near], second[near], np.maximum(np.sqrt(squared[near]), 1e-12)
    count = points.num_points
    rows, columns = np.concatenate([first, second]), np.concatenate([second, first])
    return csr_matrix((np.concatenate([value, value]), (rows, columns)), shape=(count, count))


def _folded(velocity: Array, interval: Array) -> Array:
    """Return differences of velocity modulo intervals [m/s], in their middle; inf: as they are."""
    folds = np.rint(velocity / interval)
    return velocity - np.where(folds == 0.0, 0.0, interval) * folds


def _table(points: RadarPoints, found: Ids, labels: Labels | None, interval: Array) -> RadarClusters:
    """Return the table of clusters; `found` is the number of each point's, -1 for none."""
    members = [np.flatnonzero(found == number) for number in range(int(found.max(initial=-1)) + 1)]
    members.sort(key=lambda rows: -float(points.power[rows].sum()))
    member = np.full(points.num_points, -1, dtype=np.int64)
    count = len(members)
    position, extent, velocity = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count)
    instance, semantic, share = np.zeros(count, np.int32), np.zeros(count, np.uint8), np.zeros(count)
    for row, rows in enumerate(members):
        member[rows] = row
        position[row] = points.position[rows].mean(axis=0)
        extent[row] = np.ptp(points.position[rows], axis=0)
        strongest = rows[np.argmax(points.power[rows])]
        start = points.radial_velocity[strongest]
        common = interval[rows].min()
        mean = start + _folded(points.radial_velocity[rows] - start, common).mean()
        velocity[row] = mean if np.isinf(common) else (mean + common / 2.0) % common - common / 2.0
        if labels is not None:
            votes = [(np.sum(labels.instance[rows] == labels.instance[one]), points.power[one], one) for one in rows]
            winner = int(max(votes)[2])
            instance[row], semantic[row] = labels.instance[winner], labels.semantic[winner]
            share[row] = np.mean(labels.instance[rows] == labels.instance[winner])
    return RadarClusters(
        position=position,
        extent=extent,
        radial_velocity=velocity,
        power=np.array([points.power[rows].sum() for rows in members]),
        rcs=np.array([_known_sum(points.rcs[rows]) for rows in members]),
        num_points=np.array([len(rows) for rows in members], dtype=np.int64),
        instance=instance,
        semantic=semantic,
        share=share,
        member=member,
    )


def _known_sum(values: Array) -> float:
    """Return the sum of the values that are not NaN; NaN of none."""
    known = values[~np.isnan(values)]
    return float(known.sum()) if len(known) else float("nan")
