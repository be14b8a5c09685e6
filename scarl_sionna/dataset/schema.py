"""The dataset's schema as code: every stored field with its type, axes, unit and meaning.

The writer, the reader, `verify` and ``docs/dataset.md`` all follow this table. A field of a result that stands in no
table is an error, never left out silently.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any, Literal

import numpy as np

from scarl_sionna.core.channels import RadioChannels
from scarl_sionna.core.errors import OutputError
from scarl_sionna.core.results import ClosedRadarFrame, Frame, ImageFrame, LidarScan, ObjectState, RadarFrame
from scarl_sionna.core.scans.radar import RadarScan
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.spec import LidarSpec

SCHEMA_VERSION = 3
"""Raised when a reader of the version before could not read, or would misread, what is written.

1: radars of the rig are flat. 2: they are in parts (`RadarSpec`). 3: a shard is one ZIP file (layout "packed"). A
reader of today reads all.
"""
FILES_VERSION = 2
"""Version of a dataset with a file for each image and array (layout "files"): readers of that version read it."""

POINT, OBJECT = "point", "object"
"""Axes whose length differs from frame to frame: stored up to a capacity, the valid length stands in a count field."""


@dataclass(frozen=True)
class Field:
    """One stored field of a sensor, of the objects or of the frame.

    Attributes
    ----------
    name : str
    dtype : str
        NumPy type as stored; for a PNG the type of its pixels.
    axes : tuple of str
        After the first axis, which is the frame.
    unit : str
        "" where there is none.
    description : str
    storage : {"array", "png", "json"}
        Zarr array, one PNG file a frame, or an entry of the shard's JSON.
    """

    name: str
    dtype: str
    axes: tuple[str, ...]
    unit: str
    description: str
    storage: Literal["array", "png", "json"] = "array"


POSE_AXES, TWIST_AXES = ("pose",), ("twist",)

POSE = Field(
    "world_from_sensor",
    "float64",
    POSE_AXES,
    "m, 1",
    "position x, y, z and quaternion w, x, y, z of the sensor in the world",
)

FRAME: tuple[Field, ...] = (
    Field("timestamp_ns", "int64", (), "ns", "time of the frame: every sensor's instant"),
    Field(
        "world_from_vehicle", "float64", POSE_AXES, "m, 1", "position x, y, z and quaternion w, x, y, z of the vehicle"
    ),
    Field(
        "vehicle_twist", "float64", TWIST_AXES, "m/s, rad/s", "linear and angular velocity of the vehicle, world axes"
    ),
    Field("index", "", (), "", "number of the frame in its scene", "json"),
    Field("seed", "", (), "", "root of the frame's random numbers", "json"),
)

OBJECTS: tuple[Field, ...] = (
    Field("num_objects", "int32", (), "", "valid entries of the axis object"),
    Field("instance", "int32", (OBJECT,), "", "instance id, the same in images, lidar and radar paths"),
    Field("semantic", "uint8", (OBJECT,), "", "index into semantic_classes"),
    Field("is_actor", "bool", (OBJECT,), "", "moves along a trajectory"),
    Field(
        "world_from_box",
        "float64",
        (OBJECT, "pose"),
        "m, 1",
        "centre x, y, z and quaternion w, x, y, z of the oriented box",
    ),
    Field("size", "float64", (OBJECT, "xyz"), "m", "length, width, height of the box"),
    Field("twist", "float64", (OBJECT, "twist"), "m/s, rad/s", "linear and angular velocity, world axes"),
    Field("num_pixels", "int64", (OBJECT,), "", "pixels of the frame's instance images, summed over sensors"),
    Field("num_lidar_points", "int64", (OBJECT,), "", "returns of the frame's lidars, summed over sensors"),
    Field(
        "tight_center",
        "float64",
        (OBJECT, "xyz"),
        "m",
        "centre of the box around the object at this instant, limbs and all: from the other centre, in axes of the box",
    ),
    Field("tight_size", "float64", (OBJECT, "xyz"), "m", "length, width, height of the box at this instant"),
    Field("name", "", (OBJECT,), "", "name of the object in its scene", "json"),
)

LATER: Mapping[str, frozenset[str]] = {
    "objects": frozenset({"tight_center", "tight_size"}),
    "lidar": frozenset({"waveform"}),
    "radio": frozenset({"small_mirror"}),
}
"""Fields, by table, that datasets of the same schema version lack which were written before there were these."""

CAMERA: tuple[Field, ...] = (
    POSE,
    Field("rgb", "uint8", ("row", "column", "rgb"), "", "sRGB image", "png"),
    Field(
        "depth", "uint16", ("row", "column"), "", "code of the depth along the optical axis, see depth_formula", "png"
    ),
    Field(
        "semantic",
        "uint8",
        ("row", "column"),
        "",
        "index into semantic_classes; the palette holds their colours",
        "png",
    ),
    Field("instance", "uint16", ("row", "column"), "", "instance id, 0 where nothing is hit", "png"),
    Field(
        "normal",
        "float16",
        ("row", "column", "xyz"),
        "",
        "unit surface normal towards the camera, sensor axes, zeros where nothing is hit (error up to 2.5e-4)",
    ),
    Field(
        "flow",
        "float32",
        ("row", "column", "column_row"),
        "px",
        "forward optical flow of the surface point in each pixel, nan where nothing is hit",
    ),
    Field("object_pixels", "int32", (OBJECT,), "", "pixels of the instance image"),
    Field(
        "object_box",
        "float32",
        (OBJECT, "ltrb"),
        "px",
        "rectangle around all of the object that the image would show if nothing hid it; nan: none",
    ),
    Field(
        "object_visible_box",
        "float32",
        (OBJECT, "ltrb"),
        "px",
        "rectangle around what the image shows of the object; nan: nothing",
    ),
    Field(
        "object_occlusion",
        "float32",
        (OBJECT,),
        "",
        "share of the silhouette in the image that something nearer hides; nan: not in the image",
    ),
    Field(
        "object_truncation", "float32", (OBJECT,), "", "share of the silhouette outside of the image; nan: out of sight"
    ),
)

LIDAR: tuple[Field, ...] = (
    POSE,
    Field("num_points", "int32", (), "", "valid entries of the axis point"),
    Field("shot", "int32", (POINT,), "", "number of the shot in the order of the specification's scan"),
    Field("position", "float32", (POINT, "xyz"), "m", "place of the return, sensor axes"),
    Field("distance", "float32", (POINT,), "m", "length along the ray"),
    Field(
        "radial_velocity",
        "float32",
        (POINT,),
        "m/s",
        "positive when the distance opens; nan where one chirp cannot tell",
    ),
    Field("intensity", "float32", (POINT,), "", "received power relative to a normally hit white diffuser at 1 m"),
    Field("cos_incidence", "float32", (POINT,), "", "cosine of the angle between ray and surface normal"),
    Field("normal", "float32", (POINT, "xyz"), "", "unit surface normal towards the sensor, sensor axes"),
    Field("semantic", "uint8", (POINT,), "", "index into semantic_classes"),
    Field("instance", "uint16", (POINT,), "", "instance id"),
    Field("time", "float32", (POINT,), "s", "time of the shot after the frame's timestamp"),
    Field("return_index", "uint8", (POINT,), "", "number of the return in its shot, 0 is the first"),
    Field("reflectance", "float32", (POINT,), "", "diffuse reflectance of the surface at the lidar's wavelength"),
    Field("cnr", "float32", (POINT,), "", "carrier-to-noise ratio, linear; nan without a receiver model"),
    Field(
        "beat_signal",
        "complex64",
        ("shot", "ramp", "sample"),
        "",
        "up and down chirp of every shot, in units of the noise's standard deviation",
    ),
    Field("waveform", "float32", ("shot", "sample"), "", "filtered output of a pulsed receiver, photoelectrons"),
    Field("object_points", "int32", (OBJECT,), "", "returns of the object"),
)

RADAR: tuple[Field, ...] = (
    POSE,
    Field(
        "adc",
        "int16",
        ("receiver", "chirp", "sample", "iq"),
        "",
        "codes of I and Q; times adc_scale it is the beat signal [sqrt(W)]; chirp = chirp index * num_tx + transmitter",
    ),
    Field("adc_scale", "float64", (), "sqrt(W)", "value of one step of the converter"),
    Field("num_saturated", "int64", (), "", "samples at the converter's limit"),
    Field("num_paths", "int64", (), "", "propagation paths that the signal was made of"),
    Field("diagnostics", "", (), "", "what the channel solver chose and left out", "json"),
    Field(
        "cell_instance",
        "uint16",
        ("doppler", "range"),
        "",
        "instance with most power in a cell of the range-Doppler map (Hann windows); 0: none",
    ),
    Field("cell_share", "uint8", ("doppler", "range"), "1/255", "that instance's share of the cell's power"),
    Field(
        "cell_ghost_share", "uint8", ("doppler", "range"), "1/255", "share of the cell's power that came by multipath"
    ),
    Field("cell_power", "float32", ("doppler", "range"), "W", "power of all paths in the cell, without noise"),
    Field("object_power", "float64", (OBJECT,), "W", "power of the object over all cells, direct"),
    Field("object_ghost_power", "float64", (OBJECT,), "W", "power of the object over all cells, by multipath"),
    Field(
        "interference_hit",
        "bool",
        ("chirp", "sample"),
        "",
        "more power of other radars than of thermal noise; only with interferers",
    ),
    Field(
        "interference_power",
        "float32",
        ("doppler", "range"),
        "W",
        "power of other radars in the cell; only with interferers",
    ),
)

SCANNING_RADAR: tuple[Field, ...] = (
    POSE,
    Field(
        "azimuth",
        "float64",
        ("azimuth",),
        "rad",
        "where the antenna points in the middle of each ramp, sensor axes, left positive, not wrapped",
    ),
    Field("time", "float64", ("azimuth",), "s", "of that instant after the frame's timestamp"),
    Field(
        "azimuth_pose",
        "float64",
        ("azimuth", "pose"),
        "m, 1",
        "position x, y, z and quaternion w, x, y, z of the sensor in the world at that instant",
    ),
    Field(
        "azimuth_twist",
        "float64",
        ("azimuth", "twist"),
        "m/s, rad/s",
        "linear and angular velocity of the sensor at that instant, world axes",
    ),
    Field(
        "image",
        "uint8",
        ("azimuth", "range"),
        "",
        "power, in steps of the specification's image_step_db [dB] from floor_dbm on",
    ),
    Field("floor_dbm", "float64", (), "dBm", "power of the image's code 0"),
    Field("num_saturated", "int64", (), "", "cells above the image's highest code"),
    Field("num_paths", "int64", (), "", "propagation paths that were solved, over all azimuths"),
    Field("diagnostics", "", (), "", "what the channel solver chose and left out", "json"),
    Field("power", "float32", ("azimuth", "range"), "W", "power before it is coded; only with keep_power"),
)

CLOSED_RADAR: tuple[Field, ...] = (
    POSE,
    Field(
        "power", "float32", ("velocity", "range", "azimuth"), "W", "map in the device's unit: received power times gain"
    ),
    Field("num_paths", "int32", (), "", "paths that the map was made of"),
    Field("diagnostics", "", (), "", "what the channel solver chose and left out", "json"),
)

_PATH, _STEP = ("station", "path"), ("station", "path", "interaction")

RADIO: tuple[Field, ...] = (
    POSE,
    Field(
        "world_from_station",
        "float64",
        ("station", "pose"),
        "m, 1",
        "position x, y, z and quaternion w, x, y, z of the stations, in the order of the specification; "
        "NaN of absent ones",
    ),
    Field(
        "station_velocity",
        "float64",
        ("station", "xyz"),
        "m/s",
        "velocity of the stations, world axes; NaN of absent ones",
    ),
    Field(
        "a",
        "complex64",
        ("station", "station_antenna", "antenna", "path"),
        "",
        "coefficient of the impulse response at the carrier, the phase exp(-2j pi f tau) in it; strongest path first",
    ),
    Field("tau", "float64", _PATH, "s", "delay"),
    Field("doppler", "float64", _PATH, "Hz", "Doppler shift, positive where the way becomes shorter"),
    Field("theta_t", "float32", _PATH, "rad", "zenith angle in which the path leaves the radio, world axes"),
    Field("phi_t", "float32", _PATH, "rad", "azimuth in which the path leaves the radio, world axes"),
    Field("theta_r", "float32", _PATH, "rad", "zenith angle from which the station sees the path come, world axes"),
    Field("phi_r", "float32", _PATH, "rad", "azimuth from which the station sees the path come, world axes"),
    Field("valid", "bool", _PATH, "", "whether there is such a path; all else is zero where there is none"),
    Field(
        "interaction",
        "uint8",
        _STEP,
        "",
        "from the radio on: 1 mirrored, 2 scattered, 4 refracted, 8 diffracted; 0 beyond the last",
    ),
    Field("instance", "uint16", _STEP, "", "instance id of what it happened at; 0 beyond the last"),
    Field(
        "small_mirror",
        "bool",
        _PATH,
        "",
        "whether a mirror on the way is a flat face smaller than its first Fresnel zone: the coefficient is that of an "
        "endless one",
    ),
    Field(
        "cfr",
        "complex64",
        ("station", "station_antenna", "antenna", "subcarrier"),
        "",
        "frequency response at the specification's subcarriers",
    ),
    Field("num_paths", "int32", ("station",), "", "paths that were found, with those that are not kept"),
    Field("gain_left_out", "float64", ("station",), "", "sum of abs(a)**2 of the paths that are not kept"),
    Field(
        "diagnostics",
        "",
        (),
        "",
        "candidates, materials with values of another frequency, absent stations, share of small mirrors",
        "json",
    ),
)

DEPTH_EXACT = Field(
    "depth",
    "float32",
    ("row", "column"),
    "m",
    "depth along the optical axis, negative behind the camera's plane, inf where nothing is hit (cameras that the code "
    "does not do for: they see 80 deg and more off the axis, or beyond 1000 m)",
)
_WIDEST_CODE = np.radians(80.0)
"""A camera that sees farther off its axis has depths of any size, also below 0, on surfaces that are not near [rad]."""
_FARTHEST_CODE = 1000.0
"""The smallest depth of the code is at most 5 cm with this `max_distance` [m]."""

ADC_COMPLEX = Field(
    "adc",
    "complex64",
    ("receiver", "chirp", "sample"),
    "sqrt(W)",
    "beat signal; chirp = chirp index * num_tx + transmitter (radar_format = complex64)",
)

TABLES: Mapping[str, tuple[Field, ...]] = {
    "frame": FRAME,
    "objects": OBJECTS,
    "camera": CAMERA,
    "lidar": LIDAR,
    "radar": RADAR,
    "scanning_radar": SCANNING_RADAR,
    "radio": RADIO,
    "closed_radar": CLOSED_RADAR,
}

_OF_SOME_RIGS = frozenset({"radio", "scanning_radar", "closed_radar"})
"""Tables that only a rig with such a sensor has."""
_OF_INTERFERERS = frozenset({"interference_hit", "interference_power"})
"""Fields of the radar that only a rig with interferers has."""

RESULT_TYPES: Mapping[type, str] = {
    ImageFrame: "camera",
    LidarScan: "lidar",
    RadarFrame: "radar",
    RadarScan: "scanning_radar",
    RadioChannels: "radio",
    ClosedRadarFrame: "closed_radar",
}
"""Table of each built-in result type."""

_STORED_AS = {"adc_int": "adc"}
_NOT_STORED = frozenset({"spec", "timings", "results", "objects"})
"""Fields of results that are stored elsewhere: the specification in the manifest, results and objects in their own
groups; `timings` are no data: the same seed gives the same bytes."""


def check_fields(result_type: type, table: Iterable[Field]) -> None:
    """Raise if a result type has a field that its table does not name.

    Raises
    ------
    OutputError
        With the names of the fields.
    """
    known = {item.name for item in table}
    unknown = [
        item.name
        for item in fields(result_type)
        if item.name not in _NOT_STORED and _STORED_AS.get(item.name, item.name) not in known
    ]
    if unknown:
        raise OutputError(
            f"the dataset's schema does not know the field {', '.join(unknown)} of {result_type.__name__}; "
            "add it to scarl_sionna/dataset/schema.py with its type, axes, unit and description"
        )


def tables_of(rig: Mapping[str, Any]) -> dict[str, tuple[Field, ...]]:
    """Return the tables that a dataset of a rig states.

    What only interferers bring stands there with them alone, and the tables of radios, scanning radars and radars
    without raw data with one alone: datasets without them have the same bytes as before there were any.
    """
    mounts = rig["sensors"]
    heard = any((mount.get("settings") or {}).get("interferers") for mount in mounts)
    there = {mount["kind"] for mount in mounts}
    left_out = frozenset() if heard else _OF_INTERFERERS
    return {
        name: tuple(item for item in items if item.name not in left_out)
        for name, items in TABLES.items()
        if name not in _OF_SOME_RIGS or name in there
    }


def camera_table(spec: CameraSpec) -> tuple[Field, ...]:
    """Return the fields that are stored of a camera: depth as a code, or as it is where the code does not do for it."""
    if not _is_depth_exact(spec):
        return CAMERA
    return tuple(DEPTH_EXACT if item.name == "depth" else item for item in CAMERA)


@lru_cache(maxsize=256)
def _is_depth_exact(spec: CameraSpec) -> bool:
    return spec.max_distance > _FARTHEST_CODE or spec.widest_angle >= _WIDEST_CODE


def mount_table(mount: Mapping[str, Any]) -> tuple[Field, ...] | None:
    """Return the fields that are stored of a sensor by its entry in a rig; None for a kind that is not built in."""
    kind = mount["kind"]
    return camera_table(CameraSpec(**mount["spec"])) if kind == "camera" else TABLES.get(kind)


def check_schema() -> None:
    """Raise if any built-in result has a field that the schema does not know."""
    for result_type, kind in {**RESULT_TYPES, Frame: "frame", ObjectState: "objects"}.items():
        check_fields(result_type, TABLES[kind])


def lidar_capacity(spec: Spec) -> int:
    """Return the largest number of returns of one scan: the length of the axis ``point``.

    Raises
    ------
    OutputError
        If the specification is of a lidar that is not built in.
    """
    if not isinstance(spec, LidarSpec):
        raise OutputError(
            f"cannot tell how many returns a {type(spec).__name__} gives at most; a sensor kind of your own declares "
            "`stored_fields` and `result_type` on its class (see docs/dataset.md)"
        )
    return int(spec.num_shots * spec.max_returns)


def attributes(item: Field) -> dict[str, Any]:
    """Return the attributes of a field's Zarr array, in the names of the CF conventions."""
    return {"long_name": item.description, **({"units": item.unit} if item.unit else {})}
