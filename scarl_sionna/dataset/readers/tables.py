"""Boxes and radar detections of a dataset as pandas tables, one row an object or a detection of a frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import UnknownNameError
from scarl_sionna.core.packages import require
from scarl_sionna.core.results import Frame, RadarFrame
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.dataset.derived.boxes import is_ego, points_inside
from scarl_sionna.dataset.derived.radar_points import sensed_points
from scarl_sionna.dataset.formats.source import Convertible, as_source

if TYPE_CHECKING:
    import pandas

BOX_UNITS = {
    "timestamp_ns": "ns", "x": "m", "y": "m", "z": "m", "length": "m", "width": "m", "height": "m", "qw": "1",
    "qx": "1",
    "qy": "1", "qz": "1", "vx": "m/s", "vy": "m/s", "vz": "m/s", "vehicle_x": "m", "vehicle_y": "m", "vehicle_z": "m",
    "vehicle_yaw": "rad",
}  # fmt: skip # a table
"""Unit of each column of :func:`box_table` that has one; also in the table's ``attrs["units"]``."""

DETECTION_UNITS = {
    "timestamp_ns": "ns", "range": "m", "azimuth": "rad", "elevation": "rad", "radial_velocity": "m/s",
    "velocity_over_ground": "m/s", "power": "W", "snr_db": "dB", "rcs": "m2", "x": "m", "y": "m", "z": "m",
    "world_x": "m",
    "world_y": "m", "world_z": "m",
}  # fmt: skip # a table
"""Unit of each column of :func:`detection_table` that has one; also in the table's ``attrs["units"]``."""


def box_table(data: Convertible) -> pandas.DataFrame:
    """Return the true boxes of all frames.

    Parameters
    ----------
    data : FrameSource, dataset or path
        See `as_source`. Of a dataset only poses and labels are read.

    Returns
    -------
    pandas.DataFrame
        One row an object of a frame: ``scene``, ``frame``, ``timestamp_ns``, ``name``, ``instance``,
        ``semantic_class``, ``is_actor``, ``is_ego``, centre ``x y z`` and quaternion ``qw qx qy qz`` in the world,
        ``length width height``, velocity ``vx vy vz`` (world), ``vehicle_x vehicle_y vehicle_z vehicle_yaw`` relative
        to the vehicle, ``num_pixels``, ``num_lidar_points``.

    Raises
    ------
    MissingPackageError
        If pandas is not installed.
    """
    pandas = require("pandas", "tables")
    rows = []
    source = as_source(data)
    for scene, frame in ((item.name, frame) for item in source.scenes for frame in item.labels()):
        vehicle_from_world = frame.world_from_vehicle.inverse()
        for item in frame.objects:
            pose = vehicle_from_world.compose(item.world_from_box)
            place, box = item.world_from_box, item.size
            rows.append(
                (
                    scene,
                    frame.index,
                    frame.timestamp_ns,
                    item.name,
                    item.instance,
                    SEMANTIC_CLASSES[item.semantic],
                    item.is_actor,
                    is_ego(frame, item),
                    *place.position,
                    *box,
                    *place.quaternion,
                    *item.twist.linear,
                    *pose.position,
                    pose.yaw,
                    item.num_pixels,
                    item.num_lidar_points,
                )
            )
    names = [
        "scene",
        "frame",
        "timestamp_ns",
        "name",
        "instance",
        "semantic_class",
        "is_actor",
        "is_ego",
        "x",
        "y",
        "z",
        "length",
        "width",
        "height",
        "qw",
        "qx",
        "qy",
        "qz",
        "vx",
        "vy",
        "vz",
        "vehicle_x",
        "vehicle_y",
        "vehicle_z",
        "vehicle_yaw",
        "num_pixels",
        "num_lidar_points",
    ]
    return _table(pandas, rows, names, BOX_UNITS)


def detection_table(data: Convertible, radars: Sequence[str] = (), pfa: float = 1e-6) -> pandas.DataFrame:
    """Return the radar detections of all frames.

    Parameters
    ----------
    data : FrameSource, dataset or path
        See `as_source`.
    radars : sequence of str
        Names of the radars; none given: all.
    pfa : float
        Probability of false alarm of a cell, see `detect`.

    Returns
    -------
    pandas.DataFrame
        One row a detection, strongest first in each frame and radar: ``scene``, ``frame``, ``timestamp_ns``, ``radar``,
        ``range``, ``azimuth``, ``elevation``, ``radial_velocity``, ``velocity_over_ground`` (the radar's own motion
        taken out), ``power``, ``snr_db``, ``rcs`` (NaN where it is not known), ``x y z`` in the radar frame,
        ``world_x world_y world_z``, ``instance`` of the box that holds it (0: none).

    Raises
    ------
    MissingPackageError
        If pandas is not installed.
    UnknownNameError
        If there is no radar of a name.
    """
    pandas = require("pandas", "tables")
    source = as_source(data)
    known = [name for name, mount in source.mounts.items() if mount["kind"] == "radar"]
    for name in radars:
        if name not in known:
            raise UnknownNameError("radar", name, known)
    chosen = set(radars) if radars else None
    rows: list[tuple[Any, ...]] = []
    for scene in source.scenes:
        for frame in scene:
            for name, radar in frame.radars.items():
                if chosen is None or name in chosen:
                    rows += _detections(scene.name, frame, name, radar, pfa)
    names = [
        "scene",
        "frame",
        "timestamp_ns",
        "radar",
        "range",
        "azimuth",
        "elevation",
        "radial_velocity",
        "velocity_over_ground",
        "power",
        "snr_db",
        "rcs",
        "x",
        "y",
        "z",
        "world_x",
        "world_y",
        "world_z",
        "instance",
    ]
    return _table(pandas, rows, names, DETECTION_UNITS)


def _detections(scene: str, frame: Frame, name: str, radar: RadarFrame, pfa: float) -> Iterator[tuple[Any, ...]]:
    sensed = sensed_points(frame, radar, pfa)
    points = sensed.points
    world = radar.world_from_sensor.apply(points.position)
    instance: npt.NDArray[np.int64] = np.zeros(points.num_points, np.int64)
    for item in frame.objects:
        if not is_ego(frame, item):
            instance[points_inside(item, world)] = item.instance
    for row in range(points.num_points):
        yield (
            scene,
            frame.index,
            frame.timestamp_ns,
            name,
            points.range[row],
            points.azimuth[row],
            points.elevation[row],
            points.radial_velocity[row],
            sensed.compensated_velocity[row],
            points.power[row],
            points.snr_db[row],
            points.rcs[row],
            *points.position[row],
            *world[row],
            instance[row],
        )


def _table(
    pandas: ModuleType, rows: list[tuple[Any, ...]], names: Sequence[str], units: dict[str, str]
) -> pandas.DataFrame:
    table = pandas.DataFrame(rows, columns=list(names))
    table.attrs["units"] = dict(units)
    return table
