"""Published figures of nuScenes, View-of-Delft and RadarScenes, each with what this project counts in its place.

What can only be read off RadarScenes' own charts is not here, since the licence of that dataset was not checked for it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from .counted import Counted, Rows
from .groups import GROUP_NAMES

Count = Callable[[Counted], float]
EXPLORED = "evaluation of the training split, github.com/brunopinto900/radar-ml-autonomous-driving (EDA.md)"
AUDIT = "audit of the validation boxes, README of reiyah-measure (second hand)"
MINI = "evaluation of nuScenes mini, 404 keyframes, www.e-com-net.com/article/1610132498308694016.htm (second hand)"
DELFT = "github.com/callmetechnophile/radar, vod_radar_statistics.json (second hand)"
DELFT_PAGE = "page of the dataset, repository.tudelft.nl"
CLASS_RANGE = np.array([50.0, 50.0, 40.0, 40.0])
"""Ranges within which nuScenes scores cars, large vehicles, two-wheelers and pedestrians [m]."""
RANGE_STEP = 10.0
"""Width of the classes of range in which medians are compared [m]."""
FEWEST = 10
"""Points of each side from which a median is told."""


@dataclass(frozen=True)
class Published:
    """A figure of another dataset; `low` and `high` are bounds where it is a span.

    `count` gives the same of this one.
    """

    dataset: str
    quantity: str
    unit: str
    value: float | None
    condition: str
    source: str
    count: Count
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Comparison:
    """A published figure and the same of a dataset; nan where the dataset does not tell it."""

    published: Published
    here: float


def compare(statistics: Counted) -> list[Comparison]:
    """Return every published figure beside that of a dataset."""
    return [Comparison(figure, figure.count(statistics)) for figure in FIGURES]


def _moving_seen(found: Counted, group: str | None = None) -> Rows:
    """Return the looks of a radar at moving road users with at least one point, as RadarScenes labels them."""
    scans = found.scans
    kept = scans["moving"] & (scans["points"] > 0)
    return scans[kept if group is None else kept & (scans["group"] == GROUP_NAMES.index(group))]


def _mean(values: np.ndarray) -> float:
    return float(np.mean(values)) if len(values) else math.nan


def _points_per_scan(found: Counted) -> float:
    return _mean(_moving_seen(found)["points"])


def _share_up_to(group: str, most: int) -> Count:
    return lambda found: 100.0 * _mean(_moving_seen(found, group)["points"] <= most)


def _mean_range(group: str) -> Count:
    def count(found: Counted) -> float:
        points = found.points
        return _mean(points["range"][points["moving"] & (points["group"] == GROUP_NAMES.index(group))])

    return count


def _velocity_spread(group: str) -> Count:
    def count(found: Counted) -> float:
        spread = _moving_seen(found, group)["velocity_spread"]
        spread = spread[np.isfinite(spread)]
        return float(np.median(spread)) if len(spread) else math.nan

    return count


def _rcs_by_range(found: Counted, groups: tuple[str, ...]) -> Iterator[tuple[int, float]]:
    """Yield class of range and median RCS [dBsm] of the points of moving road users, where there are enough."""
    points = found.points
    numbers = [GROUP_NAMES.index(group) for group in groups]
    points = points[points["moving"] & np.isin(points["group"], numbers)]
    step = (points["range"] / RANGE_STEP).astype(int)
    for bin_number in np.unique(step):
        values = points["rcs_dbsm"][step == bin_number]
        values = values[~np.isnan(values)]
        if len(values) >= FEWEST:
            yield int(bin_number), float(np.median(values))


def _rcs_gap(strong: str, *weak: str) -> Count:
    """Return what gives the mean difference of the medians at equal range [dB]."""

    def count(found: Counted) -> float:
        above, below = dict(_rcs_by_range(found, (strong,))), dict(_rcs_by_range(found, weak))
        return _mean(np.array([above[step] - below[step] for step in above.keys() & below.keys()]))

    return count


def _rcs_rise(found: Counted) -> float:
    """Return how much the median RCS rises from the class of 5 m to that of 85 m [dB]."""
    medians = dict(_rcs_by_range(found, GROUP_NAMES))
    return medians.get(8, math.nan) - medians.get(0, math.nan)


def _boxes(found: Counted) -> Rows:
    """Return the road users within nuScenes' class ranges that some sensor sees something of."""
    rows = found.objects[found.objects["group"] >= 0]
    rows = rows[rows["range"] <= CLASS_RANGE[rows["group"]]]
    return rows[(rows["pixels"] > 0) | (rows["lidar_points"] > 0) | (rows["radar_points"] > 0)]


def _without(*columns: str, nearest: float = 0.0, farthest: float = math.inf) -> Count:
    """Return what gives the share of boxes between two ranges [m] for which no sensor of some kinds has a point [%].

    A dataset in which a kind has no point at all, since it has no such sensor, does not tell it.
    """

    def count(found: Counted) -> float:
        if not all(found.objects[column].any() for column in columns):
            return math.nan
        rows = _boxes(found)
        rows = rows[(rows["range"] >= nearest) & (rows["range"] < farthest)]
        return 100.0 * _mean(np.all([rows[column] == 0 for column in columns], axis=0))

    return count


def _label_share(group: str) -> Count:
    def count(found: Counted) -> float:
        return 100.0 * _mean(found.objects["group"][found.objects["group"] >= 0] == GROUP_NAMES.index(group))

    return count


_SEEN = "moving road users, looks with a point"
_BOXES = "boxes in the benchmark's class ranges; here: those that some sensor sees"
_BOTH = ("radar_points", "lidar_points")
_EQUAL = "moving road users, medians at equal range"

FIGURES: tuple[Published, ...] = (
    Published("RadarScenes", "points of an object in a scan, mean", "", 2.9, _SEEN, EXPLORED, _points_per_scan),
    Published(
        "RadarScenes", "pedestrian scans with one point", "%", 54.4, _SEEN, EXPLORED, _share_up_to("pedestrian", 1)
    ),
    Published(
        "RadarScenes", "pedestrian scans with at most two", "%", 81.6, _SEEN, EXPLORED, _share_up_to("pedestrian", 2)
    ),
    *(
        Published("RadarScenes", f"range of points, {group}, mean", "m", value, "moving", EXPLORED, _mean_range(group))
        for group, value in (("car", 41.3), ("large vehicle", 47.3), ("two-wheeler", 20.7), ("pedestrian", 29.9))
    ),
    *(
        Published(
            "RadarScenes",
            f"spread of radial velocity in an object, {group}",
            "m/s",
            value,
            "median of standard deviations, scans with 3 points or more",
            EXPLORED,
            _velocity_spread(group),
        )
        for group, value in (("car", 0.08), ("large vehicle", 0.082), ("two-wheeler", 0.381), ("pedestrian", 0.518))
    ),
    Published(
        "RadarScenes",
        "RCS, large vehicle over car",
        "dB",
        None,
        _EQUAL,
        EXPLORED,
        _rcs_gap("large vehicle", "car"),
        3,
        5,
    ),
    Published(
        "RadarScenes",
        "RCS, car over pedestrian and two-wheeler",
        "dB",
        None,
        _EQUAL,
        EXPLORED,
        _rcs_gap("car", "pedestrian", "two-wheeler"),
        5,
        8,
    ),
    Published(
        "RadarScenes",
        "rise of the median RCS of detections with range",
        "dB",
        None,
        "5 to 90 m there, 5 to 85 m here; what is weak and far is not detected",
        EXPLORED,
        _rcs_rise,
        15,
        18,
    ),
    Published(
        "nuScenes",
        "radar points a keyframe, all radars, mean",
        "",
        196.8,
        "5 radars, devkit's default filters; span: least and most",
        MINI,
        lambda found: _mean(found.points_per_frame),
        97,
        323,
    ),
    Published("nuScenes", "boxes without a radar point", "%", 61.19, _BOXES, AUDIT, _without("radar_points")),
    Published("nuScenes", "boxes without a lidar point", "%", 12.01, _BOXES, AUDIT, _without("lidar_points")),
    Published("nuScenes", "boxes without both", "%", 9.43, _BOXES, AUDIT, _without(*_BOTH)),
    *(
        Published(
            "nuScenes",
            f"boxes without both, {near} to {far} m",
            "%",
            value,
            _BOXES,
            AUDIT,
            _without(*_BOTH, nearest=near, farthest=far),
        )
        for near, far, value in ((0, 20, 4.04), (20, 30, 9.99), (30, 40, 13.8), (40, 50, 19.75))
    ),
    Published(
        "View-of-Delft",
        "radar points a scan, mean",
        "",
        311.3,
        "25 frames of one sequence; span: least and most",
        DELFT,
        lambda found: _mean(found.points_per_scan),
        264,
        403,
    ),
    *(
        Published(
            "View-of-Delft",
            f"share of labels, {group}",
            "%",
            100.0 * count / 123106,
            f"{count} of 123106 boxes of all classes; here: of road users",
            DELFT_PAGE,
            _label_share(group),
        )
        for group, count in (("pedestrian", 26587), ("two-wheeler", 10800), ("car", 26949))
    ),
)
"""All published figures."""
