"""Writes frames as a nuScenes folder that `nuscenes-devkit` opens unchanged.

References
----------
.. [1] H. Caesar et al., "nuScenes: A multimodal dataset for autonomous driving", CVPR 2020; schema of nuscenes-devkit
   1.2.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose, Twist
from scarl_sionna.core.results import Frame, ImageFrame, LidarScan, ObjectState, RadarFrame
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.dataset.derived.boxes import other_objects, points_inside, visible_fraction
from scarl_sionna.dataset.derived.radar_points import sensed_points

from .nuscenes_parts import files, lane_map, panoptic, splits, tables
from .nuscenes_parts.can_bus import FOLDER, write_can_bus
from .nuscenes_parts.tables import token
from .output import whole_folder
from .pictures import centred_intrinsics, encode_image, undistorted
from .source import Convertible, FrameSource, OnProgress, SceneFrames, as_source, no_progress

LIDAR_CHANNEL = "LIDAR_TOP"
FORMAT = "nuscenes"
SCENE_GAP_US = 1_000_000
"""A scene begins at least this long after the one before it ends [us]."""


def export_nuscenes(
    data: Convertible,
    out: str | Path,
    *,
    version: str = "v1.0-mini",
    keyframe_every: int = 1,
    image_format: Literal["jpg", "png"] = "jpg",
    raw_radar: bool = True,
    all_objects: bool = False,
    official_names: bool = False,
    panoptic_labels: bool = True,
    lane_maps: bool | str = False,
    pfa: float = 1e-6,
    overwrite: bool = False,
    on_progress: OnProgress = no_progress,
) -> Path:
    """Write frames as a nuScenes folder.

    Parameters
    ----------
    data : FrameSource, dataset or path
        See `as_source`.
    out : path
        Folder to make: the reader's `dataroot`.
    version : str
        Folder of the tables and the reader's `version`.
    keyframe_every : int
        Every how many frames one is a sample with labels; those between are sweeps.
    image_format : str
        ``"jpg"`` or, without loss, ``"png"``.
    raw_radar : bool
        Also write the raw radar data as NPY files and the table ``scarl_radar``, which the reader passes over.
    all_objects : bool
        Also label buildings, signs, trees and the like, which nuScenes knows as classes of points but gives no boxes.
    official_names : bool
        Scenes get the names of nuScenes' own scenes of the same split, so that tools which know these splits alone
        (`load_gt`, `NuScenesCanBus`) take them; ``version`` ends with ``trainval``, ``test`` or ``mini`` then.
    panoptic_labels : bool
        Also write panoptic labels of the lidar points: class and number of the object.
    lane_maps : bool or str
        Also write each scene's lanes as a map expansion. True: of the place that the dataset names; or a place's name
        or XML file, for all scenes.
    pfa : float
        Probability of false alarm of the detector that makes the radar points.
    overwrite : bool
    on_progress : callable

    Returns
    -------
    Path
        `out`.

    Raises
    ------
    ParameterRangeError
        If a parameter is out of range, or there are no frames or no sensors of nuScenes' kinds.
    OutputError
        If the folder is there or cannot be written.
    """
    source = as_source(data, "nuScenes", ("camera", "lidar", "radar"))
    options = _Options(version, keyframe_every, image_format, raw_radar, all_objects, pfa, panoptic_labels, lane_maps)
    source.not_empty()
    mark = {"format": FORMAT, "version": version, "rig": source.rig["name"], "scenes": [s.name for s in source.scenes]}
    names = splits.official_names(source, version) if official_names else {}
    source = splits.renamed(source, names) if names else source
    with whole_folder(out, mark, overwrite) as folder:
        writer = _Writer(folder, source, options, {official: own for own, official in names.items()})
        done = 0
        for scene in source.scenes:
            for position, frame in enumerate(scene):
                writer.add(scene, position, frame)
                done += 1
                on_progress(done, source.num_frames)
            writer.finish(scene)
        writer.save(source.splits)
    return Path(out)


@dataclass(frozen=True)
class _Options:
    """What is written, and how; the parameters of :func:`export_nuscenes`."""

    version: str
    keyframe_every: int
    image_format: Literal["jpg", "png"]
    raw_radar: bool
    all_objects: bool
    pfa: float
    panoptic_labels: bool
    lane_maps: bool | str

    def __post_init__(self) -> None:
        if self.keyframe_every < 1:
            raise ParameterRangeError("keyframe_every", self.keyframe_every, ">= 1")
        if self.image_format not in ("jpg", "png"):
            raise ParameterRangeError("image_format", repr(self.image_format), "'jpg' or 'png'")
        taken = (".", "..", "samples", "sweeps", "maps", "lidarseg", panoptic.FOLDER, FOLDER)
        if not self.version or set(self.version) & set("/\\") or self.version in taken:
            raise ParameterRangeError("version", repr(self.version), "a plain folder name such as 'v1.0-mini'")


@dataclass(frozen=True, eq=False)
class _Stream:
    """Where a file belongs: its channel, of which kind, `mount` (vehicle_from_sensor), how its name ends.

    Of a camera also intrinsics and size [px].
    """

    channel: str
    modality: str
    mount: Pose
    suffix: str
    intrinsics: npt.NDArray[np.float64] | None = None
    size: tuple[int, int] = (0, 0)


class _Writer:
    """Gathers records and writes files of one folder."""

    def __init__(self, root: Path, source: FrameSource, options: _Options, own_names: Mapping[str, str]) -> None:
        self.root, self.source, self.options, self.own_names = root, source, options, own_names
        self.table: dict[str, list[dict[str, Any]]] = {name: [] for name in tables.TABLES}
        self.lidarseg: list[dict[str, Any]] = []
        self.panoptic: list[dict[str, Any]] = []
        self.raw_radar: list[dict[str, Any]] = []
        self.table["category"] = tables.category_table()
        self.table["attribute"] = tables.attribute_table()
        self.table["visibility"] = tables.visibility_table()
        self._sensors: dict[str, str] = {}
        self._channels: dict[str, str] = {}
        self._last_time: int | None = None
        self._begin_scene()

    def _begin_scene(self) -> None:
        self.map = files.DrivableMap()
        self.numbers = panoptic.PanopticNumbers()
        self.poses: list[dict[str, Any]] = []
        self.motion: list[tuple[Pose, Twist]] = []
        self.annotations: dict[int, list[dict[str, Any]]] = defaultdict(list)
        self.chains: dict[str, list[dict[str, Any]]] = defaultdict(list)
        self.samples: list[dict[str, Any]] = []
        self.instances: dict[int, ObjectState] = {}
        self.delay = 0

    # -- frames ------------------------------------------------------------------------------------------------------

    def add(self, scene: SceneFrames, position: int, frame: Frame) -> None:
        """Write the files of a frame and gather its records; positions are still those of the world."""
        is_key = position % self.options.keyframe_every == 0
        pose_token = token("ego_pose", scene.name, frame.index)
        pose = frame.world_from_vehicle
        timestamp = round(frame.timestamp_ns / 1000)
        if not self.poses and self._last_time is not None:  # the reader wants scenes that begin at different times
            self.delay = max(0, self._last_time + SCENE_GAP_US - timestamp)
        timestamp += self.delay
        self.poses.append(
            {
                "token": pose_token,
                "timestamp": timestamp,
                "rotation": pose.quaternion.tolist(),
                "translation": pose.position.tolist(),
            }
        )
        self.motion.append((pose, frame.vehicle_twist))
        self.map.add(frame)
        if is_key:
            self.samples.append(
                {
                    "token": token("sample", scene.name, frame.index),
                    "timestamp": timestamp,
                    "scene_token": token("scene", scene.name),
                }
            )
        base = {"ego_pose_token": pose_token, "timestamp": timestamp, "is_key_frame": is_key}
        cloud = self._lidar(scene, frame, base)
        echoes = self._radars(scene, frame, base)
        self._cameras(scene, frame, base)
        if is_key:
            self._annotate(scene, frame, cloud, echoes)

    def _record(self, scene: SceneFrames, base: dict[str, Any], stream: _Stream) -> dict[str, Any]:
        """Return a new record of a file of a channel; its sample follows in `finish`."""
        channel, mount = stream.channel, stream.mount
        if channel not in self._sensors:
            self._sensors[channel] = token("sensor", channel)
            self.table["sensor"].append(
                {"token": self._sensors[channel], "channel": channel, "modality": stream.modality}
            )
            self.table["calibrated_sensor"].append(
                {
                    "token": token("calibrated_sensor", channel),
                    "sensor_token": self._sensors[channel],
                    "translation": mount.position.tolist(),
                    "rotation": mount.quaternion.tolist(),
                    "camera_intrinsic": [] if stream.intrinsics is None else stream.intrinsics.tolist(),
                }
            )
        kind = "samples" if base["is_key_frame"] else "sweeps"
        name = f"{kind}/{channel}/{scene.name}__{channel}__{base['timestamp']:016d}.{stream.suffix}"
        (self.root / name).parent.mkdir(parents=True, exist_ok=True)
        record = {
            "token": token("sample_data", scene.name, channel, base["timestamp"]),
            **base,
            "calibrated_sensor_token": token("calibrated_sensor", channel),
            "fileformat": stream.suffix.rpartition(".")[0] or stream.suffix,
            "height": stream.size[0],
            "width": stream.size[1],
            "filename": name,
        }
        self.chains[channel].append(record)
        return record

    def _channel(self, prefix: str, sensor: str) -> str:
        """Return the channel of a sensor; where two would share one, the later is named in full."""
        if sensor not in self._channels:
            taken = set(self._channels.values())
            short, full = tables.channel(prefix, sensor), tables.full_channel(prefix, sensor)
            names = [short, full, *(f"{full}_{number}" for number in range(2, len(taken) + 3))]
            self._channels[sensor] = next(name for name in names if name not in taken)
        return self._channels[sensor]

    def _lidar(self, scene: SceneFrames, frame: Frame, base: dict[str, Any]) -> npt.NDArray[np.float64]:
        """Write all lidars as one cloud and return its points (N, 3) [m, world]."""
        scans: dict[str, LidarScan] = frame.lidars
        if not scans:
            return np.zeros((0, 3))
        places = [self.source.vehicle_from_sensor(name).position for name in scans]
        mount = Pose.from_rotation(np.mean(places, axis=0), files.LIDAR_FROM_VEHICLE_AXES.T)
        world_from_lidar = frame.world_from_vehicle.compose(mount)
        rows, semantic, instance = files.lidar_rows(frame, list(scans.values()), world_from_lidar)
        record = self._record(scene, base, _Stream(LIDAR_CHANNEL, "lidar", mount, "pcd.bin"))
        rows.tofile(self.root / record["filename"])
        if base["is_key_frame"]:
            label_file = f"lidarseg/{self.options.version}/{record['token']}_lidarseg.bin"
            (self.root / label_file).parent.mkdir(parents=True, exist_ok=True)
            models = tables.models_of(scene.configuration)
            labels = tables.lidarseg_labels(semantic, instance, frame.objects, models)
            labels.tofile(self.root / label_file)
            entry = {"token": record["token"], "sample_data_token": record["token"]}
            self.lidarseg.append({**entry, "filename": label_file})
            if self.options.panoptic_labels:
                label_file = f"{panoptic.FOLDER}/{self.options.version}/{record['token']}_panoptic.npz"
                panoptic.write_labels(self.root / label_file, self.numbers.labels(labels, instance))
                self.panoptic.append({**entry, "filename": label_file})
        return world_from_lidar.apply(rows[:, :3])

    def _radars(self, scene: SceneFrames, frame: Frame, base: dict[str, Any]) -> npt.NDArray[np.float64]:
        """Write the points and the raw data of all radars and return the points (N, 3) [m, world]."""
        places = [np.zeros((0, 3))]
        radar: RadarFrame
        for name, radar in frame.radars.items():
            sensed = sensed_points(frame, radar, self.options.pfa)
            stream = _Stream(self._channel("RADAR", name), "radar", self.source.vehicle_from_sensor(name), "pcd")
            record = self._record(scene, base, stream)
            (self.root / record["filename"]).write_bytes(files.radar_file(sensed, radar.spec))
            record["height"], record["width"] = (1, sensed.points.num_points) if sensed.points.num_points else (0, 0)
            places.append(radar.world_from_sensor.apply(sensed.points.position))
            if self.options.raw_radar:
                self._write_raw(record, name, radar)
        return np.concatenate(places)

    def _write_raw(self, record: dict[str, Any], name: str, radar: RadarFrame) -> None:
        path = "scarl_radar/" + record["filename"].partition("/")[2].removesuffix(".pcd") + ".npy"
        (self.root / path).parent.mkdir(parents=True, exist_ok=True)
        np.save(self.root / path, radar.adc_int)
        self.raw_radar.append(
            {
                "token": token("scarl_radar", record["token"]),
                "sample_data_token": record["token"],
                "filename": path,
                "sensor": name,
                "scale": float(radar.adc_scale),
                "unit": "sqrt(W)",
                "axes": ["receiver", "chirp * num_tx + transmitter", "sample", "I/Q"],
            }
        )

    def _cameras(self, scene: SceneFrames, frame: Frame, base: dict[str, Any]) -> None:
        image: ImageFrame
        for name, image in frame.images.items():
            if image.rgb is None:
                continue
            mount = self.source.vehicle_from_sensor(name)
            optical = mount.compose(Pose.from_rotation(np.zeros(3), CAMERA_OPTICAL_FROM_SENSOR.T))
            matrix = centred_intrinsics(image)
            form, size = self.options.image_format, (image.spec.height, image.spec.width)
            stream = _Stream(self._channel("CAM", name), "camera", optical, form, matrix, size)
            record = self._record(scene, base, stream)
            (self.root / record["filename"]).write_bytes(encode_image(undistorted(image), form))

    def _annotate(
        self, scene: SceneFrames, frame: Frame, cloud: npt.NDArray[np.float64], echoes: npt.NDArray[np.float64]
    ) -> None:
        """Gather the boxes that a camera, a lidar or a radar sees something of."""
        cameras = list(frame.images.values())
        with_depth = [image for image in cameras if image.depth is not None]
        cameras = with_depth or cameras
        models = tables.models_of(scene.configuration)
        for item in other_objects(frame):
            category = tables.category_of(item, models)
            if not (self.options.all_objects or tables.has_boxes(category)):
                continue
            num_lidar = int(np.count_nonzero(points_inside(item, cloud)))
            num_radar = int(np.count_nonzero(points_inside(item, echoes)))
            if not (num_lidar or num_radar or item.num_pixels):
                continue
            fraction = max((visible_fraction(item, image) for image in cameras), default=0.0)
            speed = float(np.linalg.norm(item.twist.linear))
            length, width, height = item.size.tolist()
            self.instances.setdefault(item.instance, item)
            self.annotations[item.instance].append(
                {
                    "token": token("sample_annotation", scene.name, frame.index, item.instance),
                    "sample_token": self.samples[-1]["token"],
                    "instance_token": token("instance", scene.name, item.instance),
                    "visibility_token": tables.visibility_token(fraction),
                    "attribute_tokens": tables.attribute_tokens(category, item, speed, models),
                    "translation": item.world_from_box.position.tolist(),
                    "size": [width, length, height],
                    "rotation": item.world_from_box.quaternion.tolist(),
                    "num_lidar_pts": num_lidar,
                    "num_radar_pts": num_radar,
                }
            )

    # -- scenes ------------------------------------------------------------------------------------------------------

    def finish(self, scene: SceneFrames) -> None:
        """Link the records of a scene, move it so that its map begins at (0, 0), and begin the next scene."""
        if not self.samples:
            return self._begin_scene()
        origin = self.map.origin()
        scene_token, log_token = token("scene", scene.name), token("log", scene.name)
        map_file = f"maps/{token('map', scene.name)}.png"
        (self.root / "maps").mkdir(exist_ok=True)
        size = self.map.save(self.root / map_file)
        if self.options.lane_maps:
            place = scene.configuration.get("scene") if self.options.lane_maps is True else self.options.lane_maps
            driven = np.array([pose.position[:2] for pose, _ in self.motion])
            file = self.root / f"maps/{lane_map.FOLDER}/{scene.name}.json"
            lane_map.write_lane_map(file, lane_map.lanes_of(place, scene.name), driven, origin[:2], size)
        for record in [*self.poses, *(row for rows in self.annotations.values() for row in rows)]:
            record["translation"] = (np.array(record["translation"]) - origin).tolist()
        on_map = [(Pose(pose.position - origin, pose.quaternion), twist) for pose, twist in self.motion]
        write_can_bus(self.root, scene.name, [row["timestamp"] for row in self.poses], on_map)
        _link(self.samples)
        times = np.array([sample["timestamp"] for sample in self.samples])
        for chain in self.chains.values():
            _link(chain)
            for record in chain:  # a sweep belongs to the nearest sample
                record["sample_token"] = self.samples[int(np.argmin(np.abs(times - record["timestamp"])))]["token"]
            self.table["sample_data"] += chain
        for instance, rows in self.annotations.items():
            _link(rows)
            item = self.instances[instance]
            category = tables.category_of(item, tables.models_of(scene.configuration))
            self.table["instance"].append(
                {
                    "token": rows[0]["instance_token"],
                    "category_token": token("category", category),
                    "nbr_annotations": len(rows),
                    "first_annotation_token": rows[0]["token"],
                    "last_annotation_token": rows[-1]["token"],
                    "scarl_name": item.name,
                    "scarl_instance": int(instance),
                    "scarl_class": SEMANTIC_CLASSES[item.semantic],
                }
            )
            self.table["sample_annotation"] += rows
        self._last_time = self.poses[-1]["timestamp"]
        self.table["ego_pose"] += self.poses
        self.table["sample"] += self.samples
        self.table["scene"].append(
            {
                "token": scene_token,
                "name": scene.name,
                "description": f"simulated by scarl-sionna: {self.own_names.get(scene.name, scene.name)}",
                "log_token": log_token,
                "nbr_samples": len(self.samples),
                "first_sample_token": self.samples[0]["token"],
                "last_sample_token": self.samples[-1]["token"],
                "scarl_world_from_map": origin.tolist(),
                "scarl_delay_us": self.delay,
                **({"scarl_scene": self.own_names[scene.name]} if scene.name in self.own_names else {}),
            }
        )
        self.table["log"].append(
            {
                "token": log_token,
                "logfile": scene.name,
                "vehicle": self.source.rig["name"],
                "date_captured": "1970-01-01",
                "location": scene.name,
            }
        )
        self.table["map"].append(
            {
                "token": token("map", scene.name),
                "log_tokens": [log_token],
                "category": "semantic_prior",
                "filename": map_file,
            }
        )
        return self._begin_scene()

    def save(self, scenes_of_split: Mapping[str, Sequence[str]]) -> None:
        """Write all tables."""
        if not self.table["sample_data"]:
            raise ParameterRangeError(
                "dataset", "without RGB camera, lidar and radar", "at least one of them", "choose another export format"
            )
        place = self.root / self.options.version
        place.mkdir()
        extra: dict[str, Any] = {}
        if self.lidarseg:
            extra["lidarseg"] = self.lidarseg
        if self.panoptic:
            extra["panoptic"] = self.panoptic
        if self.raw_radar:
            extra["scarl_radar"] = self.raw_radar
        if scenes_of_split:
            extra["splits"] = {name: list(scenes) for name, scenes in scenes_of_split.items()}
            if self.own_names:
                extra["splits"] |= {splits.CUSTOM + name: list(scenes) for name, scenes in scenes_of_split.items()}
        for name, rows in {**self.table, **extra}.items():
            (place / f"{name}.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


def _link(rows: Sequence[dict[str, Any]]) -> None:
    """Set the tokens of the record before and after."""
    for index, row in enumerate(rows):
        row["prev"] = rows[index - 1]["token"] if index else ""
        row["next"] = rows[index + 1]["token"] if index + 1 < len(rows) else ""
