"""The manifest: what a dataset holds, how it was made, and a checksum of every shard.

It holds no time of day and no path of the machine, so that the same configuration gives the same bytes.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from scarl_sionna.core.errors import DatasetError, ParameterRangeError
from scarl_sionna.core.semantics import SEMANTIC_CLASSES, SEMANTIC_COLORS
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveform import Fmcw
from scarl_sionna.core.untrusted.checked import checked
from scarl_sionna.core.untrusted.json_text import parse_json
from scarl_sionna.dataset import schema
from scarl_sionna.dataset.codec import DEPTH_FORMULA, checksum_of, plain, with_checksum
from scarl_sionna.dataset.encoding import StoreOptions, spec_of

from .files import Files, check_name, read_small
from .forms import ManifestForm

FORMAT = "scarl-dataset"
MANIFEST = "manifest.json"
BACKUP = "manifest.backup.json"
"""Second copy of the manifest, read where the first one is lost or damaged."""
ARRAYS, IMAGES, SHARDS = "arrays", "images", "shards"
"""Folders of a dataset: a Zarr hierarchy with a group a scene, PNG files, and what was made and its checksums."""
SPLITS = ("train", "val", "test")
FROM_PLAN = ("configuration", "configuration_hash", "scenes", "splits", "shards")
"""Entries of a manifest that follow from the plan and the shards, the same in every schema version."""

_SCENE_NAME = re.compile(r"[A-Za-z0-9_\-]+")
_RESERVED = frozenset({"objects", *(item.name for item in schema.FRAME)})
_RADAR_NUMBERS = (
    "num_tx",
    "num_rx",
    "num_virtual",
    "num_chirps_total",
    "num_samples",
    "sample_rate",
    "doppler_interval",
    "center_frequency",
    "range_resolution",
    "max_range",
    "velocity_resolution",
    "unambiguous_velocity",
)


class ManifestDamage(DatasetError):
    """The manifest cannot be read; it can be made again from the shards and the scenarios."""


class ManifestMissing(DatasetError):
    """There is no manifest."""


class ManifestForeign(DatasetError):
    """What has the manifest's name is no manifest of ours."""


CONVENTIONS = {
    "units": "SI: metres, seconds, radians, watts; another unit stands as suffix of the name",
    "poses": "world_from_sensor maps points of the sensor frame into the world; stored as x, y, z, qw, qx, qy, qz",
    "vehicle, sensor frames": "x forward (boresight, optical axis), y left, z up; vehicle origin on the ground",
    "camera_optical frame": "x right, y down, z forward; pixel ~ intrinsics @ point; "
    "centre of the first pixel (0.5, 0.5)",
    "radial_velocity": "positive when the distance opens",
    "twist": "linear velocity of the frame's origin and angular velocity, world axes",
    "depth": f"distance along the optical axis; {DEPTH_FORMULA}",
    "semantic": "8-bit ids, index into semantic_classes; the PNG palette holds semantic_colors",
    "instance": "16-bit ids, 0 where nothing is hit",
    "adc": "adc * adc_scale = beat signal [sqrt(W)], axes receiver, chirp * num_tx + transmitter, sample, I/Q",
    "lengths that differ": "the axes point and object are filled with zeros; "
    "num_points and num_objects tell the valid length",
}


@dataclass(frozen=True)
class ScenePlan:
    """One scene (sequence) of a dataset.

    Attributes
    ----------
    name : str
        Letters, digits, ``_`` and ``-``; the scene's folder.
    num_frames : int
    configuration : mapping
        Plain data: all that decides its frames' bytes, but their number, which may grow.
    split : str
        ``"train"``, ``"val"`` or ``"test"``.
    """

    name: str
    num_frames: int
    configuration: Mapping[str, Any] = field(default_factory=dict)
    split: str = "train"

    def __post_init__(self) -> None:
        if not _SCENE_NAME.fullmatch(self.name):
            raise ParameterRangeError("scene name", repr(self.name), "letters, digits, '_' and '-'")
        if self.num_frames < 1:
            raise ParameterRangeError("num_frames", self.num_frames, ">= 1")
        if self.split not in SPLITS:
            raise ParameterRangeError("split", repr(self.split), ", ".join(SPLITS))
        object.__setattr__(self, "configuration", json.loads(json.dumps(plain(self.configuration))))

    def num_shards(self, options: StoreOptions) -> int:
        """Return the number of shards."""
        return -(-self.num_frames // options.shard_frames)

    def shard_range(self, shard: int, options: StoreOptions) -> range:
        """Return the frames of a shard."""
        first = shard * options.shard_frames
        return range(first, min(first + options.shard_frames, self.num_frames))


@dataclass(frozen=True)
class DatasetPlan:
    """What a dataset is to hold.

    Attributes
    ----------
    rig : mapping
        `Rig.to_dict()`; one rig for all scenes.
    scenes : tuple of ScenePlan
    options : StoreOptions
        As they are for all its frames (`StoreOptions.for_frames`).
    software : mapping
        Versions of the packages that decide the bytes.
    licence, description : str
        For the dataset card.
    has_free_shards : bool
        No number of frames a shard was asked for: that of a dataset that is there holds (`in_shards_of`).
    """

    rig: Mapping[str, Any]
    scenes: tuple[ScenePlan, ...]
    options: StoreOptions = field(default_factory=StoreOptions)
    software: Mapping[str, str] = field(default_factory=dict)
    licence: str = "not stated"
    description: str = ""
    has_free_shards: bool = field(default=False, compare=False)

    def __post_init__(self) -> None:
        if self.options.shard_frames == 0:
            object.__setattr__(self, "has_free_shards", True)
            num_frames = sum(scene.num_frames for scene in self.scenes)
            object.__setattr__(self, "options", self.options.for_frames(num_frames))
        object.__setattr__(self, "rig", json.loads(json.dumps(plain(self.rig))))
        object.__setattr__(self, "scenes", tuple(sorted(self.scenes, key=lambda scene: scene.name)))
        names = [scene.name for scene in self.scenes]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise ParameterRangeError(
                "scenes", f"{', '.join(repeated)} more than once", "one name each", "rename a scenario"
            )
        sensors = [mount["name"] for mount in self.rig["sensors"]]
        for name in sensors:
            if name.split("/")[0] in _RESERVED or any(other.startswith(f"{name}/") for other in sensors):
                raise ParameterRangeError(
                    "sensor name",
                    f"'{name}'",
                    "a name that is no group of other sensors and none of " + ", ".join(sorted(_RESERVED)),
                )

    def scene(self, name: str) -> ScenePlan:
        """Return a scene by name."""
        return next(scene for scene in self.scenes if scene.name == name)

    def in_shards_of(self, shard_frames: int) -> DatasetPlan:
        """Return this plan with so many frames a shard, where no number was asked for."""
        if not self.has_free_shards:
            return self
        return replace(self, options=replace(self.options, shard_frames=shard_frames))

    @property
    def configuration(self) -> dict[str, Any]:
        """All that decides the bytes of the frames, as plain data."""
        return {
            "storage": self.options.to_dict(),
            "software": dict(self.software),
            "rig": self.rig,
            "scenes": {scene.name: scene.configuration for scene in self.scenes},
        }

    def scene_hash(self, name: str, shard_frames: int | None = None) -> str:
        """Return the SHA-256 of all that decides the bytes of one scene's shards; with so many frames each, if stated.

        Frames are the same in shards of any length, files are not: a record is of shards of one length.
        """
        whole = self.configuration
        options = self.options if shard_frames is None else replace(self.options, shard_frames=shard_frames)
        return hash_of({**whole, "scenes": whole["scenes"][name], "storage": options.to_dict()})

    def merged(self, there: DatasetPlan) -> DatasetPlan:
        """Return this plan with the scenes of another one that it lacks, and the larger number of common frames."""
        old = {scene.name: scene for scene in there.scenes}
        scenes = []
        for scene in self.scenes:
            frames = max(scene.num_frames, old.pop(scene.name).num_frames if scene.name in old else 0)
            scenes.append(ScenePlan(scene.name, frames, scene.configuration, scene.split))
        return DatasetPlan(
            self.rig, (*scenes, *old.values()), self.options, self.software, self.licence, self.description
        )

    def changes(self, there: DatasetPlan) -> list[str]:
        """Return what makes the frames of a dataset differ from this plan's, as texts.

        Scenes of one only do not count.
        """
        old, new = there.configuration, self.configuration
        old["storage"], new["storage"] = asdict(there.options), asdict(self.options)
        common = old["scenes"].keys() & new["scenes"].keys()
        for configuration in (old, new):
            configuration["scenes"] = {name: configuration["scenes"][name] for name in sorted(common)}
        return differences(old, new)


def manifest_data(plan: DatasetPlan, shards: Mapping[str, list[list[Any] | None]]) -> dict[str, Any]:
    """Return the manifest of a plan; `shards` holds for each scene, by shard, checksum, number of frames and bytes."""
    configuration = plan.configuration
    return {
        "format": FORMAT,
        "schema_version": schema.SCHEMA_VERSION if plan.options.layout == "packed" else schema.FILES_VERSION,
        "description": plan.description,
        "licence": plan.licence,
        "configuration": configuration,
        "configuration_hash": hash_of(configuration),
        "scenes": {
            scene.name: {"num_frames": scene.num_frames, "split": scene.split, "seed": scene.configuration.get("seed")}
            for scene in plan.scenes
        },
        "splits": {split: [scene.name for scene in plan.scenes if scene.split == split] for split in SPLITS},
        "calibration": {mount["name"]: _calibration(mount) for mount in plan.rig["sensors"]},
        "conventions": _conventions(plan.rig),
        "depth_formula": DEPTH_FORMULA,
        "semantic_classes": list(SEMANTIC_CLASSES),
        "semantic_colors": SEMANTIC_COLORS.tolist(),
        "schema": {
            table: {item.name: {key: value for key, value in asdict(item).items() if key != "name"} for item in items}
            for table, items in schema.tables_of(plan.rig).items()
        },
        "shards": {name: shards.get(name, []) for name in sorted(shards)},
    }


def _conventions(rig: Mapping[str, Any]) -> dict[str, str]:
    """Return the conventions of a dataset, with the cameras whose depth is no code."""
    exact = [mount["name"] for mount in rig["sensors"] if schema.DEPTH_EXACT in (schema.mount_table(mount) or ())]
    form = f"no code: {schema.DEPTH_EXACT.dtype}, {schema.DEPTH_EXACT.description}"
    return {**CONVENTIONS, **({f"depth of {', '.join(exact)}": form} if exact else {})}


def without_later(data: Mapping[str, Any], written: Mapping[str, Any]) -> dict[str, Any]:
    """Return a manifest without the fields younger than its schema version that one which was `written` lacks."""
    tables = dict(data["schema"])
    for table, names in schema.LATER.items():
        lacking = names - set(written["schema"].get(table, ()))
        if table in tables and lacking:
            tables[table] = {name: item for name, item in tables[table].items() if name not in lacking}
    return {**data, "schema": tables}


def dump_manifest(data: Mapping[str, Any]) -> str:
    """Return the manifest's text; a shard stands on a line, and the SHA-256 of all before it at the end."""
    shards = {name: rows for name, rows in data["shards"].items()}
    head = json.dumps({key: value for key, value in data.items() if key != "shards"}, indent=1)
    lists = [
        f"  {json.dumps(name)}: [\n" + ",\n".join("   " + json.dumps(row) for row in rows) + "\n  ]"
        for name, rows in shards.items()
    ]
    return with_checksum(head[: head.rindex("\n}")] + ',\n "shards": {\n' + ",\n".join(lists) + "\n }\n}\n")


def _is_as_written(text: bytes, data: Mapping[str, Any], checksum: object) -> bool:
    """Return whether a manifest is what was written; one from before there was a checksum has that of a part of it."""
    if checksum is None:
        return bool(hash_of(data["configuration"]) == data["configuration_hash"])
    return checksum == checksum_of(text)


def recover_manifest(files: Files) -> tuple[Manifest, DatasetError | None]:
    """Return a dataset's manifest, or its second copy where it is lost or damaged, and then what is wrong with it.

    Raises
    ------
    DatasetError
        As `read_manifest`; that of the first copy where the second is of no use.
    """
    try:
        return read_manifest(files), None
    except (ManifestMissing, ManifestDamage) as error:
        try:
            return read_manifest(files, BACKUP), error
        except (DatasetError, OSError):
            raise error from None


class Manifest(dict[str, Any]):
    """A dataset's manifest, checked: plain data by its keys, and the same with types as attributes.

    ``manifest["scenes"]["drive"]["num_frames"]`` is ``manifest.scenes["drive"].num_frames``.

    Attributes
    ----------
    schema_version : int
    description, licence, configuration_hash : str
    scenes : dict of str to SceneForm
        Number of frames, split and seed of each scene.
    splits : dict of str to list of str
    storage : StorageForm
        Frames in a shard, format of radar data, room for objects.
    calibration : dict of str to dict
    shards : dict of str to list
        Of each shard of a scene the checksum of its record, number of frames, failed frames and bytes; None: not there.
    """

    def __init__(self, data: Mapping[str, Any], form: ManifestForm) -> None:
        super().__init__(data)
        self.schema_version, self.description, self.licence = form.schema_version, form.description, form.licence
        self.configuration_hash, self.storage = form.configuration_hash, form.configuration.storage
        self.scenes, self.splits, self.shards, self.calibration = (
            form.scenes,
            form.splits,
            form.shards,
            form.calibration,
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return _manifest_of, (dict(self),)


def _manifest_of(data: dict[str, Any]) -> Manifest:
    return Manifest(data, checked(ManifestForm, data))


def read_manifest(files: Files, name: str = MANIFEST) -> Manifest:
    """Return a dataset's manifest.

    Raises
    ------
    DatasetError
        If there is none, it is of a newer schema or damaged, or names that lead out of the dataset stand in it.
    """
    try:
        text = read_small(files, name)
        data = parse_json(text)
    except (FileNotFoundError, NotADirectoryError) as error:
        raise ManifestMissing(
            f"no dataset here (no {name})", files.url, "give the folder that `scarl-sionna export --out` wrote"
        ) from error
    except (OSError, ValueError) as error:
        raise ManifestDamage(
            f"cannot read {name}: {error}", files.url, "run the export again: it writes it anew"
        ) from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise ManifestForeign("this is not a dataset of scarl-sionna", files.url, "give the folder that `export` wrote")
    found = data.get("schema_version")
    if not isinstance(found, int) or found > schema.SCHEMA_VERSION:
        raise DatasetError(
            f"schema version {found} is newer than {schema.SCHEMA_VERSION}, the newest that this program reads",
            files.url,
            "update scarl-sionna",
        )
    checksum = data.pop("checksum", None)
    try:
        manifest = _manifest_of(data)
        for scene in (*data["scenes"], *data["shards"], *data["configuration"]["scenes"]):
            if not _SCENE_NAME.fullmatch(scene):
                check_name(f"../{scene}", "scene name")
        for mount in data["configuration"]["rig"]["sensors"]:
            check_name(mount["name"], "sensor name")
        plan_of(data)
        if not _is_as_written(text, data, checksum):
            raise ValueError("its checksum is wrong")
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise ManifestDamage(
            f"{name} is damaged: {error!s:.200}", files.url, "run the export again: it writes it anew"
        ) from error
    return manifest


def plan_of(data: Mapping[str, Any]) -> DatasetPlan:
    """Return the plan of a manifest."""
    configuration = data["configuration"]
    scenes = [
        ScenePlan(name, item["num_frames"], configuration["scenes"][name], item["split"])
        for name, item in data["scenes"].items()
    ]
    return DatasetPlan(
        configuration["rig"],
        tuple(scenes),
        StoreOptions.from_dict(configuration["storage"]),
        configuration["software"],
        data["licence"],
        data["description"],
    )


def hash_of(data: object) -> str:
    """Return the SHA-256 of plain data, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(data, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def differences(old: object, new: object, name: str = "") -> list[str]:
    """Return the entries in which two plain values differ, as texts."""
    if isinstance(old, dict) and isinstance(new, dict):
        keys = [*old, *(key for key in new if key not in old)]
        return [text for key in keys for text in differences(old.get(key), new.get(key), f"{name}.{key}".lstrip("."))]
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        pairs = enumerate(zip(old, new, strict=True))
        return [text for index, (a, b) in pairs for text in differences(a, b, f"{name}[{index}]")]
    if isinstance(old, list) and isinstance(new, list):
        return [f"{name}: {len(old)} entries there, {len(new)} asked for"]
    return [] if old == new else [f"{name}: {old!r:.60} there, {new!r:.60} asked for"]


def _calibration(mount: Mapping[str, Any]) -> dict[str, Any]:
    """Return where a sensor sits, and the numbers of its specification that a reader would have to compute."""
    return {
        "kind": mount["kind"],
        "vehicle_from_sensor": mount["vehicle_from_sensor"],
        **_derived(spec_of(mount)),
    }


def _derived(spec: Spec) -> dict[str, Any]:
    if isinstance(spec, CameraSpec):
        lens = {"lens": spec.lens.model, "distortion": list(spec.distortion_coefficients)}
        return {"width": spec.width, "height": spec.height, "intrinsics": spec.intrinsics.tolist(), **lens}
    if isinstance(spec, LidarSpec):
        return {"num_azimuth": spec.num_azimuth, "num_elevation": spec.num_elevation}
    if isinstance(spec, RadarSpec):
        ramp = {"chirp_slope": spec.waveform.chirp_slope} if isinstance(spec.waveform, Fmcw) else {}
        return {name: getattr(spec, name) for name in _RADAR_NUMBERS} | ramp
    return {}
