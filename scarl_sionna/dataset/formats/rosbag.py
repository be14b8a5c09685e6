"""Writes frames as a ROS 2 bag with the standard messages: plays with `ros2 bag play`, opens in RViz and Foxglove.

References
----------
.. [1] ROS 2 common_interfaces (sensor_msgs, nav_msgs, visualization_msgs, tf2_msgs), radar_msgs 0.2.2, Humble; REP 103
       and 105: axes.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.packages import require
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.results import Frame, ImageFrame, RadarFrame
from scarl_sionna.core.semantics import SEMANTIC_COLORS
from scarl_sionna.dataset.derived.boxes import other_objects

from .output import whole_folder
from .pictures import centred_intrinsics, encode_image
from .recording import (
    BOX_ALPHA,
    SCENE_GAP,
    TAKES,
    VEHICLE,
    WORLD,
    Columns,
    about_image,
    detection_columns,
    lidar_columns,
    packed,
    peak_columns,
    scan_columns,
    timed_frames,
    transforms,
)
from .source import Convertible, FrameSource, OnProgress, as_source, no_progress

if TYPE_CHECKING:
    from rosbags.rosbag2 import Writer

FORMAT = "rosbag"
ROS = "humble"
"""Release of ROS 2 whose messages are written; later ones read them."""
BAG_VERSION: Literal[8] = 8
"""Version of rosbag2's metadata that Humble and later releases read."""
_TYPES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}  # of sensor_msgs/PointField
_LENSES = {"brown_conrady": "rational_polynomial", "kannala_brandt": "equidistant"}  # as image_geometry calls them
_ENCODINGS = {"depth": "32FC1", "semantic": "mono8", "instance": "mono16"}
_IMAGE = "sensor_msgs/msg/Image"
_SCAN, _RETURN = "radar_msgs/msg/RadarScan", "radar_msgs/msg/RadarReturn"
_RADAR_MSGS = {
    _RETURN: "float32 range\nfloat32 azimuth\nfloat32 elevation\nfloat32 doppler_velocity\nfloat32 amplitude\n",
    _SCAN: "std_msgs/Header header\nradar_msgs/RadarReturn[] returns\n",
}
LIVE = "live"
"""Name of the scene of a session's frames."""
Content: TypeAlias = Any
"""A message; its class is made by the package."""
Message = tuple[str, str, Content]
"""Topic, type and content."""


def export_rosbag(
    data: Convertible,
    out: str | Path,
    *,
    raw_radar: bool = False,
    pfa: float = 1e-6,
    overwrite: bool = False,
    on_progress: OnProgress = no_progress,
) -> Path:
    """Write frames as one ROS 2 bag (SQLite).

    Parameters
    ----------
    data : FrameSource, dataset or path
        See `as_source`. Scenes follow each other; the first begins at 1 s, since 0 means "latest" to tf2.
    out : path
        Folder of the bag.
    raw_radar : bool
        Also the raw radar data, as ``std_msgs/Int16MultiArray``; scale and axes stand in ``/<radar>/adc_info``.
    pfa : float
        Probability of false alarm of the radar detections.
    overwrite : bool
    on_progress : callable

    Raises
    ------
    MissingPackageError
        If rosbags is not installed.
    ParameterRangeError
        If there are no frames, or two sensors have the same topic.
    OutputError
        If the folder is there or cannot be written.
    """
    source = as_source(data, "a ROS bag", TAKES)
    source.not_empty()
    scenes = tuple(scene.name for scene in source.scenes)
    with _bag_of(source, out, scenes, pfa=pfa, raw_radar=raw_radar, overwrite=overwrite) as bag:
        for done, (scene, frame, time_ns) in enumerate(timed_frames(source, SCENE_GAP), 1):
            bag.add(scene.name, frame, time_ns)
            on_progress(done, source.num_frames)
    return Path(out)


@contextmanager
def record_rosbag(
    rig: Mapping[str, Any], out: str | Path, *, raw_radar: bool = False, pfa: float = 1e-6, overwrite: bool = False
) -> Iterator[Callable[[Frame], None]]:
    """Write a bag frame by frame while a session is stepped; no frame is kept.

    Parameters
    ----------
    rig : mapping
        `Rig.to_dict()`.
    out, raw_radar, pfa, overwrite
        As of :func:`export_rosbag`.

    Yields
    ------
    callable
        Takes the frames in the order of time; the first stands at 1 s.

    Raises
    ------
    MissingPackageError, ParameterRangeError, OutputError
        As :func:`export_rosbag`. An error within leaves no bag.
    """
    first: list[int] = []
    source = as_source(FrameSource(rig, []), "a ROS bag", TAKES)
    with _bag_of(source, out, (LIVE,), pfa=pfa, raw_radar=raw_radar, overwrite=overwrite) as bag:

        def record(frame: Frame) -> None:
            first.append(frame.timestamp_ns)
            del first[1:]
            bag.add(LIVE, frame, SCENE_GAP + frame.timestamp_ns - first[0])

        yield record


@contextmanager
def _bag_of(
    source: FrameSource, out: str | Path, scenes: tuple[str, ...], *, pfa: float, raw_radar: bool, overwrite: bool
) -> Iterator[_Bag]:
    """Open a bag for frames of a source, whole or not at all."""
    require("rosbags", "ros")
    from rosbags.rosbag2 import Writer

    topics = _topics(source)
    with whole_folder(out, {"format": FORMAT, "scenes": list(scenes)}, overwrite) as folder:
        below = folder / "bag"  # the writer wants to make its folder itself
        with Writer(below, version=BAG_VERSION) as writer:
            yield _Bag(writer, topics, source, pfa, raw_radar)
        for path in below.iterdir():
            path.rename(folder / path.name)
        below.rmdir()


def _topics(source: FrameSource) -> dict[str, str]:
    """Return the beginning of every sensor's topics: ROS allows letters, digits and underscores only."""
    found: dict[str, str] = {}
    for name in source.mounts:
        topic = "/" + "/".join(re.sub(r"^(?=\d)", "_", re.sub(r"\W", "_", part)) for part in name.split("/"))
        if topic in found.values():
            raise ParameterRangeError("sensor name", f"'{name}'", f"another topic than {topic}", "rename a sensor")
        found[name] = topic
    return found


class _Bag:
    """Makes messages and writes them; a topic is made known when it is first used."""

    def __init__(
        self, writer: Writer, topics: Mapping[str, str], source: FrameSource, pfa: float, raw_radar: bool
    ) -> None:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self.writer, self.topics = writer, topics
        self.source, self.pfa, self.raw_radar = source, pfa, raw_radar
        self.types = get_typestore(getattr(Stores, f"ROS2_{ROS.upper()}"))
        for kind, definition in _RADAR_MSGS.items():
            self.types.register(get_types_from_msg(definition, kind))
        self.connections: dict[str, Any] = {}

    def add(self, scene: str, frame: Frame, time_ns: int) -> None:
        """Write all messages of a frame."""
        about = {"scene": scene, "frame": frame.index, "seed": frame.seed, "time_ns": frame.timestamp_ns}
        self.write(time_ns, self.text("/scene", about))
        for message in self.messages(frame, time_ns):
            self.write(time_ns, message)
        if self.raw_radar:
            for name, radar in frame.radars.items():
                for message in self.raw(name, radar):
                    self.write(time_ns, message)

    def make(self, kind: str, *fields: Content) -> Content:
        """Return a message of a type, its fields in the order of its definition."""
        return self.types.types[kind](*fields)

    def write(self, time_ns: int, message: Message) -> None:
        """Write a message."""
        topic, kind, content = message
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.types)
        self.writer.write(self.connections[topic], time_ns, self.types.serialize_cdr(content, kind))

    def messages(self, frame: Frame, time_ns: int) -> Iterator[Message]:
        """Yield the messages of a frame, without the raw radar data."""
        yield "/tf", "tf2_msgs/msg/TFMessage", self._transforms(frame, time_ns)
        yield "/odom", "nav_msgs/msg/Odometry", self._odometry(frame, time_ns)
        yield "/objects", "visualization_msgs/msg/MarkerArray", self._boxes(frame, time_ns)
        for name, image in frame.images.items():
            yield from self._images(name, image, time_ns)
        cloud = "sensor_msgs/msg/PointCloud2"
        for name, scan in frame.lidars.items():
            rows = packed(lidar_columns(frame, scan))
            yield f"{self.topics[name]}/points", cloud, self._cloud(name, rows, time_ns)
        for name, radar in frame.radars.items():
            columns = detection_columns(frame, radar, self.pfa)
            yield f"{self.topics[name]}/detections", cloud, self._cloud(name, packed(columns), time_ns)
            yield f"{self.topics[name]}/scan", _SCAN, self._scan(name, columns, time_ns)
        for name, turn in frame.radar_scans.items():
            topic = self.topics[name]
            yield f"{topic}/polar_image", _IMAGE, self._image(self._header(time_ns, name), turn.image, "mono8")
            yield self.text(f"{topic}/polar_image_info", about_image(turn))
        for name, closed in frame.closed_radars.items():
            rows = packed(peak_columns(closed))
            yield f"{self.topics[name]}/peaks", cloud, self._cloud(name, rows, time_ns)

    def raw(self, name: str, radar: RadarFrame) -> Iterator[Message]:
        """Yield the raw data of a radar."""
        axes = ("receiver", "chirp * num_tx + transmitter", "sample", "I/Q")
        shape = radar.adc_int.shape
        strides = [int(np.prod(shape[axis:])) for axis in range(len(shape))]
        dimension = "std_msgs/msg/MultiArrayDimension"
        sizes = zip(axes, shape, strides, strict=True)
        layout = self.make("std_msgs/msg/MultiArrayLayout", [self.make(dimension, *row) for row in sizes], 0)
        kind = "std_msgs/msg/Int16MultiArray"
        yield f"{self.topics[name]}/adc", kind, self.make(kind, layout, radar.adc_int.ravel())
        about = {"scale": float(radar.adc_scale), "unit": "sqrt(W)", "axes": axes}
        yield self.text(f"{self.topics[name]}/adc_info", about)

    def text(self, topic: str, about: Mapping[str, Any]) -> Message:
        """Return a message of plain data as JSON."""
        return topic, "std_msgs/msg/String", self.make("std_msgs/msg/String", json.dumps(about))

    def _header(self, time_ns: int, frame_id: str) -> Content:
        stamp = self.make("builtin_interfaces/msg/Time", time_ns // 10**9, time_ns % 10**9)
        return self.make("std_msgs/msg/Header", stamp, frame_id)

    def _vector(self, values: npt.ArrayLike) -> Content:
        return self.make("geometry_msgs/msg/Vector3", *map(float, np.asarray(values)))

    def _quaternion(self, pose: Pose) -> Content:
        w, x, y, z = pose.quaternion.tolist()
        return self.make("geometry_msgs/msg/Quaternion", x, y, z, w)

    def _pose(self, pose: Pose) -> Content:
        point = self.make("geometry_msgs/msg/Point", *pose.position.tolist())
        return self.make("geometry_msgs/msg/Pose", point, self._quaternion(pose))

    def _transforms(self, frame: Frame, time_ns: int) -> Content:
        found = []
        for parent, child, pose in transforms(self.source, frame):
            place = self.make("geometry_msgs/msg/Transform", self._vector(pose.position), self._quaternion(pose))
            header = self._header(time_ns, parent)
            found.append(self.make("geometry_msgs/msg/TransformStamped", header, child, place))
        return self.make("tf2_msgs/msg/TFMessage", found)

    def _odometry(self, frame: Frame, time_ns: int) -> Content:
        """Return the vehicle's pose in the world, and its velocity in its own axes."""
        own = frame.world_from_vehicle.inverse()
        linear, angular = (own.rotate(part) for part in (frame.vehicle_twist.linear, frame.vehicle_twist.angular))
        twist = self.make("geometry_msgs/msg/Twist", self._vector(linear), self._vector(angular))
        exact = np.zeros(36)
        return self.make(
            "nav_msgs/msg/Odometry",
            self._header(time_ns, WORLD),
            VEHICLE,
            self.make("geometry_msgs/msg/PoseWithCovariance", self._pose(frame.world_from_vehicle), exact),
            self.make("geometry_msgs/msg/TwistWithCovariance", twist, exact),
        )

    def _boxes(self, frame: Frame, time_ns: int) -> Content:
        """Return boxes as cubes; what is no longer there goes with the first marker."""
        header = self._header(time_ns, WORLD)
        nothing = (np.zeros(3), (0.0, 0.0, 0.0, 0.0))
        markers = [self._marker(header, ("", 0), 3, Pose(), *nothing)]
        for item in other_objects(frame):
            colour = (*(SEMANTIC_COLORS[item.semantic] / 255.0).tolist(), BOX_ALPHA)
            markers.append(self._marker(header, (item.name, item.instance), 0, item.world_from_box, item.size, colour))
        return self.make("visualization_msgs/msg/MarkerArray", markers)

    def _marker(
        self,
        header: Content,
        name: tuple[str, int],
        action: int,
        pose: Pose,
        size: npt.NDArray[np.float64],
        colour: tuple[float, ...],
    ) -> Content:
        cube = 1
        return self.make(
            "visualization_msgs/msg/Marker", header, *name, cube, action, self._pose(pose), self._vector(size),
            self.make("std_msgs/msg/ColorRGBA", *colour), self.make("builtin_interfaces/msg/Duration", 0, 0), False,
            [], [], "", self.make("sensor_msgs/msg/CompressedImage", header, "", np.zeros(0, np.uint8)), [], "", "",
            self.make("visualization_msgs/msg/MeshFile", "", np.zeros(0, np.uint8)), False,
        )  # fmt: skip # a table

    def _images(self, name: str, image: ImageFrame, time_ns: int) -> Iterator[Message]:
        """Yield the images of a camera, and its calibration."""
        topic, header = self.topics[name], self._header(time_ns, f"{name}/optical")
        if image.rgb is not None:
            kind = "sensor_msgs/msg/CompressedImage"
            pixels = np.frombuffer(encode_image(image.rgb, "jpg"), np.uint8)
            yield f"{topic}/rgb/compressed", kind, self.make(kind, header, "jpeg", pixels)
        for field, encoding in _ENCODINGS.items():
            values = getattr(image, field)
            if values is not None:
                yield f"{topic}/{field}", _IMAGE, self._image(header, values, encoding)
        spec, matrix = image.spec, centred_intrinsics(image)
        kind = "sensor_msgs/msg/CameraInfo"
        whole = self.make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
        model = _LENSES.get(spec.lens.model, "plumb_bob")
        lens = np.array(spec.distortion_coefficients or [0.0] * 5, np.float64)
        flat_matrices = (matrix.ravel(), np.eye(3).ravel(), np.hstack([matrix, np.zeros((3, 1))]).ravel())
        content = self.make(kind, header, spec.height, spec.width, model, lens, *flat_matrices, 0, 0, whole)
        yield f"{topic}/camera_info", kind, content

    def _image(self, header: Content, pixels: npt.NDArray[Any], encoding: str) -> Content:
        """Return an image of one value a pixel."""
        data = np.ascontiguousarray(pixels)
        flat = data.view(np.uint8).ravel()
        return self.make(_IMAGE, header, *data.shape, encoding, 0, data.strides[0], flat)

    def _scan(self, frame_id: str, columns: Columns, time_ns: int) -> Content:
        """Return detections as a scan."""
        rows = np.stack(list(scan_columns(columns).values()), axis=1).astype(float).tolist()
        return self.make(_SCAN, self._header(time_ns, frame_id), [self.make(_RETURN, *row) for row in rows])

    def _cloud(self, frame_id: str, rows: npt.NDArray[np.void], time_ns: int) -> Content:
        """Return a cloud; it is dense if every number is finite."""
        columns: Mapping[str, Any] = rows.dtype.fields or {}
        described = [
            self.make("sensor_msgs/msg/PointField", name, offset, _TYPES[kind.str[1:]], 1)
            for name, (kind, offset) in columns.items()
        ]
        size, count = rows.dtype.itemsize, len(rows)
        dense = all(bool(np.isfinite(rows[name]).all()) for name in columns)
        flat = np.frombuffer(rows.tobytes(), np.uint8)
        header = self._header(time_ns, frame_id)
        return self.make(
            "sensor_msgs/msg/PointCloud2", header, 1, count, described, False, size, size * count, flat, dense
        )
