"""Radar points of this project's datasets and frames in the table of published ones."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.units import power_to_db
from scarl_sionna.dataset.derived.boxes import nearest_footprint, other_objects
from scarl_sionna.dataset.derived.radar_points import sensed_points
from scarl_sionna.dataset.formats.source import Convertible, as_source
from scarl_sionna.dataset.statistics.groups import GROUP_OF_SEMANTIC, NO_GROUP

from .table import NO_OBJECT, PointTable, table_of


def point_table(data: Convertible, radars: Sequence[str] = (), *, pfa: float = 1e-6, margin: float = 0.5) -> PointTable:
    """Return the radar detections of all frames of a dataset.

    Parameters
    ----------
    data : FrameSource, dataset or path
        See `as_source`.
    radars : sequence of str
        Names of the radars; none given: all.
    pfa : float
        Probability of false alarm of a cell, see `detect`.
    margin : float
        A point this far from a road user's box, seen from above, is still its own [m].

    Returns
    -------
    PointTable
        Tracks are those of a scene; elevation is nan where a radar's array has no height.

    Raises
    ------
    UnknownNameError
        If there is no radar of a name.
    ParameterRangeError
        If a parameter is out of range, or there is no radar.
    """
    source = as_source(data)
    known = [name for name, mount in source.mounts.items() if mount["kind"] == "radar"]
    for name in radars:
        if name not in known:
            raise UnknownNameError("radar", name, known)
    chosen = list(radars) or known
    if not chosen:
        raise ParameterRangeError("data", "no radar", "a dataset with radars")
    parts: dict[str, list[Any]] = defaultdict(list)
    interval, scan, tracks = [np.inf] * len(chosen), 0, 0
    for scene in source.scenes:
        numbers: dict[int, int] = {}
        for index in range(len(scene)):
            frame = scene.without_pictures(index)
            users = [item for item in other_objects(frame) if GROUP_OF_SEMANTIC[item.semantic] != NO_GROUP]
            for item in users:
                numbers.setdefault(item.instance, tracks + len(numbers))
            group = np.array([*(GROUP_OF_SEMANTIC[item.semantic] for item in users), NO_GROUP])
            track = np.array([*(numbers[item.instance] for item in users), NO_OBJECT])
            for sensor, name in enumerate(chosen):
                if name not in frame.radars:
                    continue
                radar = frame.radars[name]
                sensed = sensed_points(frame, radar, pfa)
                points = sensed.points
                owner = nearest_footprint(users, radar.world_from_sensor.apply(points.position), margin)
                has_height = np.ptp(radar.spec.array.tx_array[:, 2]) + np.ptp(radar.spec.array.rx_array[:, 2]) > 0.0
                interval[sensor] = min(interval[sensor], points.known_modulo(radar.spec).min(initial=np.inf))
                columns = {
                    "scan": np.full(points.num_points, scan),
                    "sensor": np.full(points.num_points, sensor),
                    "time": np.full(points.num_points, frame.timestamp_ns * 1e-9),
                    "position": points.position,
                    "range": points.range,
                    "azimuth": points.azimuth,
                    "elevation": points.elevation if has_height else np.full(points.num_points, np.nan),
                    "radial_velocity": points.radial_velocity,
                    "velocity_over_ground": sensed.compensated_velocity,
                    "rcs_dbsm": power_to_db(points.rcs),
                    "snr_db": points.snr_db,
                    "group": group[owner],
                    "track": track[owner],
                }
                for column, values in columns.items():
                    parts[column].append(values)
                scan += 1
        tracks += len(numbers)
    if not scan:
        raise ParameterRangeError("data", "no frame of a radar", "at least one")
    columns = {name: np.concatenate(values) for name, values in parts.items()}
    times = columns["time"]
    columns["time"] = times - (times.min() if times.size else 0.0)
    notes = ("times of all scenes are on one clock", f"false alarm {pfa:g}, within {margin:g} m of a box")
    told = [width if np.isfinite(width) else np.nan for width in interval]
    return table_of("scarl-sionna", chosen, notes, scan, columns, told)
