"""Counts of a table of radar points, whichever dataset it is from: rows that the charts of datasets draw."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scarl_sionna.core.prompt.describe import Described, Row
from scarl_sionna.dataset.derived.boxes import MOVING_SPEED

from .counted import POINT_ROW, SCAN_ROW, Rows, velocity_spread
from .groups import GROUP_NAMES, NO_GROUP

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.figure import Figure

    from scarl_sionna.dataset.point_clouds.table import PointTable


@dataclass(frozen=True, eq=False, repr=False)
class PointStatistics(Described):
    """Points of objects and of all, of one table.

    Attributes
    ----------
    scans : structured ndarray, shape (num_looks,)
        A row an object in a scan that has a point of it: ``group``, ``moving`` (a point above 0.5 m/s over ground),
        ``range`` of the points' mean [m], ``points``, ``velocity_spread`` [m/s] (nan below 3 points). Objects without a
        point are in no table of points.
    points : structured ndarray, shape (num_points,)
        ``group`` (-1: of none), ``moving``, ``range`` [m], ``snr_db``, ``rcs_dbsm``.
    """

    scans: Rows
    points: Rows

    def _facts(self) -> Iterable[Row]:
        yield "points", str(len(self.points))
        for number, name in enumerate(GROUP_NAMES):
            seen = self.scans[self.scans["group"] == number]
            if len(seen):
                own = self.points[self.points["group"] == number]
                yield (
                    name,
                    f"{len(seen)} times seen, {seen['points'].mean():.1f} points, RCS of a point "
                    f"{np.nanmedian(own['rcs_dbsm']):.1f} dBsm (median)",
                )

    def charts(self) -> Figure:
        """Return points of objects against range, and the distribution of RCS, as one figure."""
        from .charts import point_charts

        return point_charts(self)


def count_points(table: PointTable) -> PointStatistics:
    """Count the points of objects and of all in a table.

    Parameters
    ----------
    table : PointTable
        Of :func:`~scarl_sionna.dataset.point_clouds.read_points` or
        :func:`~scarl_sionna.dataset.point_clouds.own.point_table`.

    Returns
    -------
    PointStatistics
        Without groups in the table no object is counted.
    """
    moving = np.abs(np.nan_to_num(table.velocity_over_ground)) > MOVING_SPEED
    points = np.empty(table.num_points, dtype=POINT_ROW)
    for name, values in (
        ("group", table.group),
        ("moving", moving),
        ("range", table.range),
        ("snr_db", table.snr_db),
        ("rcs_dbsm", table.rcs_dbsm),
    ):
        points[name] = values
    own = np.flatnonzero(table.group != NO_GROUP)
    order = own[np.lexsort((table.track[own], table.scan[own]))]
    keys = np.stack([table.scan[order], table.track[order]])
    starts = np.flatnonzero(np.any(np.diff(keys, axis=1, prepend=-2) != 0, axis=0))
    rows = []
    for part in np.split(order, starts[1:]) if len(order) else []:
        spread = velocity_spread(table.radial_velocity[part], float(table.velocity_interval[table.sensor[part[0]]]))
        rows.append((table.group[part[0]], bool(moving[part].any()), table.range[part].mean(), len(part), spread))
    return PointStatistics(np.array(rows, dtype=SCAN_ROW), points)
