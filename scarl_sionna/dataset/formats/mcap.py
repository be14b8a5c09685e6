"""Writes frames as an MCAP file with Foxglove's message types as JSON: opens in Foxglove and its relatives.

References
----------
.. [1] MCAP format specification, mcap.dev; Foxglove schemas, docs.foxglove.dev/docs/visualization/message-schemas.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.packages import require
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.results import Frame, ImageFrame, LidarScan, RadarFrame
from scarl_sionna.core.semantics import SEMANTIC_CLASSES, SEMANTIC_COLORS
from scarl_sionna.dataset.derived.boxes import other_objects

from . import pictures
from .mcap_schemas import NUMBER_TYPES, SCHEMAS
from .output import whole_output_file
from .pictures import centred_intrinsics, encode_image
from .recording import (
    BOX_ALPHA,
    TAKES,
    WORLD,
    about_image,
    detection_columns,
    lidar_columns,
    packed,
    peak_columns,
    timed_frames,
    transforms,
)
from .source import Convertible, FrameSource, OnProgress, as_source, no_progress

if TYPE_CHECKING:
    from mcap.writer import Writer

Message = tuple[str, str, dict[str, Any]]
"""Topic, schema name and content."""

_DELETE_ALL = 1
"""Foxglove's type of a deletion of all that is shown; of those with an earlier timestamp only."""
LIBRARY = "scarl-sionna"
"""Stands in the header of our files."""
_MAGIC = b"\x89MCAP0\r\n"


def is_ours(path: Path) -> bool:
    """Return whether a file is one that `export_mcap` wrote."""
    with open(path, "rb") as file:
        head = file.read(256)
    return head.startswith(_MAGIC) and LIBRARY.encode() in head


def export_mcap(
    data: Convertible,
    out: str | Path,
    *,
    raw_radar: bool = False,
    pfa: float = 1e-6,
    overwrite: bool = False,
    on_progress: OnProgress = no_progress,
) -> Path:
    """Write frames as one MCAP file.

    Parameters
    ----------
    data : FrameSource, dataset or path
        See `as_source`. Scenes follow each other.
    out : path
        File to write, usually with the suffix ``.mcap``.
    raw_radar : bool
        Also the raw radar data, as messages of the type ``scarl.RadarFrame`` (int16 in base64).
    pfa : float
        Probability of false alarm of the radar detections.
    overwrite : bool
    on_progress : callable

    Raises
    ------
    MissingPackageError
        If mcap is not installed.
    ParameterRangeError
        If there are no frames.
    OutputError
        If the file is there or cannot be written.
    """
    require("mcap", "mcap")
    from mcap.writer import Writer

    source = as_source(data, "MCAP", TAKES).not_empty()
    done = 0
    with whole_output_file(out, overwrite, is_ours) as partial, partial.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library=LIBRARY)
        channels = _Channels(writer)
        writer.add_metadata(
            "scarl", {"rig": json.dumps(source.rig), "scenes": json.dumps([s.name for s in source.scenes])}
        )
        for scene, frame, time_ns in timed_frames(source):
            for topic, schema, content in _messages(source, scene.name, frame, time_ns, raw_radar, pfa):
                channels.write(topic, schema, content, time_ns, done)
            done += 1
            on_progress(done, source.num_frames)
        writer.finish()
    return Path(out)


class _Channels:
    """Registers schemas and channels when they are first used."""

    def __init__(self, writer: Writer) -> None:
        self.writer = writer
        self.schemas: dict[str, int] = {}
        self.channels: dict[str, int] = {}

    def write(self, topic: str, schema: str, content: Mapping[str, Any], time: int, sequence: int) -> None:
        if schema not in self.schemas:
            text = json.dumps({"title": schema, **SCHEMAS[schema]}).encode()
            self.schemas[schema] = self.writer.register_schema(schema, "jsonschema", text)
        if topic not in self.channels:
            self.channels[topic] = self.writer.register_channel(topic, "json", self.schemas[schema])
        data = json.dumps(content, allow_nan=False, separators=(",", ":")).encode()
        self.writer.add_message(self.channels[topic], time, data, time, sequence)


def _messages(
    source: FrameSource, scene: str, frame: Frame, time_ns: int, raw_radar: bool, pfa: float
) -> Iterator[Message]:
    time = {"sec": time_ns // 10**9, "nsec": time_ns % 10**9}
    yield "/tf", "foxglove.FrameTransforms", {"transforms": list(_transforms(source, frame, time))}
    yield "/scene", "scarl.Scene", {"timestamp": time, "scene": scene, "frame": frame.index, "seed": frame.seed}
    gone = {"timestamp": time, "type": _DELETE_ALL, "id": ""}
    yield "/objects", "foxglove.SceneUpdate", {"deletions": [gone], "entities": list(_entities(frame, time))}
    image: ImageFrame
    for name, image in frame.images.items():
        yield from _image_messages(name, image, time)
    for name, scan in frame.lidars.items():
        yield f"/{name}/points", "foxglove.PointCloud", _lidar(name, frame, scan, time)
    for name, radar in frame.radars.items():
        yield f"/{name}/detections", "foxglove.PointCloud", _cloud(name, detection_columns(frame, radar, pfa), time)
        png = encode_image(pictures.range_doppler_picture(radar), "png")
        yield f"/{name}/range_doppler", "foxglove.CompressedImage", _compressed(f"{name}/map", png, "png", time)
        if raw_radar:
            yield f"/{name}/adc", "scarl.RadarFrame", _raw(name, radar, time)
    for name, turn in frame.radar_scans.items():
        png = encode_image(turn.image, "png")
        yield f"/{name}/polar_image", "foxglove.CompressedImage", _compressed(f"{name}/polar", png, "png", time)
        yield f"/{name}/polar_image_info", "scarl.PolarImage", {"timestamp": time, **about_image(turn)}
    for name, closed in frame.closed_radars.items():
        yield f"/{name}/peaks", "foxglove.PointCloud", _cloud(name, peak_columns(closed), time)


def _transforms(source: FrameSource, frame: Frame, time: Mapping[str, int]) -> Iterator[dict[str, Any]]:
    def transform(parent: str, child: str, pose: Pose) -> dict[str, Any]:
        place = _pose(pose)
        return {
            "timestamp": time,
            "parent_frame_id": parent,
            "child_frame_id": child,
            "translation": place["position"],
            "rotation": place["orientation"],
        }

    for parent, child, pose in transforms(source, frame):
        yield transform(parent, child, pose)


def _entities(frame: Frame, time: Mapping[str, int]) -> Iterator[dict[str, Any]]:
    for item in other_objects(frame):
        red, green, blue = (SEMANTIC_COLORS[item.semantic] / 255.0).tolist()
        details = {"class": SEMANTIC_CLASSES[item.semantic], "num_pixels": item.num_pixels, "speed": item.twist.linear}
        details["num_lidar_points"], details["speed"] = (
            item.num_lidar_points,
            f"{np.linalg.norm(item.twist.linear):.2f} m/s",
        )
        empty: dict[str, list[Any]] = {
            kind: [] for kind in ("arrows", "spheres", "cylinders", "lines", "triangles", "texts", "models")
        }
        cube = {
            "pose": _pose(item.world_from_box),
            "size": _xyz(item.size),
            "color": {"r": red, "g": green, "b": blue, "a": BOX_ALPHA},
        }
        yield {
            "timestamp": time,
            "frame_id": WORLD,
            "id": item.name,
            "lifetime": {"sec": 0, "nsec": 0},
            "frame_locked": False,
            "metadata": [{"key": key, "value": str(value)} for key, value in details.items()],
            "cubes": [cube],
            **empty,
        }


def _image_messages(name: str, image: ImageFrame, time: Mapping[str, int]) -> Iterator[Message]:
    frame_id, spec = f"{name}/optical", image.spec
    shown = (
        ("rgb", image.rgb, "jpg"),
        ("depth", None if image.depth is None else pictures.depth_picture(image.depth), "png"),
        ("semantic", None if image.semantic is None else pictures.semantic_picture(image.semantic), "png"),
    )
    for kind, pixels, form in shown:
        if pixels is not None:
            data = encode_image(pixels, form)
            yield f"/{name}/{kind}", "foxglove.CompressedImage", _compressed(frame_id, data, form, time)
    matrix = centred_intrinsics(image)
    models = {"brown_conrady": "rational_polynomial", "kannala_brandt": "kannala_brandt"}
    yield (
        f"/{name}/calibration",
        "foxglove.CameraCalibration",
        {
            "timestamp": time,
            "frame_id": frame_id,
            "width": spec.width,
            "height": spec.height,
            "distortion_model": models.get(spec.lens.model, ""),
            "D": list(spec.distortion_coefficients),
            "K": matrix.ravel().tolist(),
            "R": np.eye(3).ravel().tolist(),
            "P": np.hstack([matrix, np.zeros((3, 1))]).ravel().tolist(),
        },
    )


def _lidar(name: str, frame: Frame, scan: LidarScan, time: Mapping[str, int]) -> dict[str, Any]:
    columns = lidar_columns(frame, scan)
    return _cloud(name, {**columns, "radial_velocity": np.nan_to_num(columns["radial_velocity"])}, time)


def _cloud(frame_id: str, columns: Mapping[str, npt.NDArray[Any]], time: Mapping[str, int]) -> dict[str, Any]:
    rows = packed(columns)
    offsets: Mapping[str, Any] = rows.dtype.fields or {}
    fields = [
        {"name": key, "offset": offset, "type": NUMBER_TYPES[kind.str[1:]]} for key, (kind, offset) in offsets.items()
    ]
    return {
        "timestamp": time,
        "frame_id": frame_id,
        "pose": _pose(Pose()),
        "point_stride": rows.dtype.itemsize,
        "fields": fields,
        "data": _base64(rows.tobytes()),
    }


def _compressed(frame_id: str, data: bytes, form: str, time: Mapping[str, int]) -> dict[str, Any]:
    return {"timestamp": time, "frame_id": frame_id, "data": _base64(data), "format": {"jpg": "jpeg"}.get(form, form)}


def _raw(name: str, radar: RadarFrame, time: Mapping[str, int]) -> dict[str, Any]:
    return {
        "timestamp": time,
        "frame_id": name,
        "shape": list(radar.adc_int.shape),
        "dtype": "int16",
        "axes": ["receiver", "chirp * num_tx + transmitter", "sample", "I/Q"],
        "scale": float(radar.adc_scale),
        "unit": "sqrt(W)",
        "data": _base64(radar.adc_int.astype("<i2").tobytes()),
    }


def _pose(pose: Pose) -> dict[str, Any]:
    w, x, y, z = pose.quaternion.tolist()
    return {"position": _xyz(pose.position), "orientation": {"x": x, "y": y, "z": z, "w": w}}


def _xyz(values: npt.NDArray[np.float64]) -> dict[str, float]:
    return dict(zip("xyz", values.tolist(), strict=True))


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")
