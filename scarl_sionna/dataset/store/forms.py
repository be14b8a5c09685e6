"""Types and bounds of the JSON files of a dataset: what is read of them goes through these models first."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, RootModel, field_validator, model_validator

from scarl_sionna.core.untrusted.checked import Table, Text

MOST_FRAMES = 1_000_000
"""Frames of one scene: a drive of 28 hours at 10 Hz."""
MOST_SHARD_FRAMES = 100_000
MOST_CHUNK_BYTES = 1_000_000_000
"""One array of one frame, uncompressed [bytes]."""
_MOST_BYTES = 2**63
_TYPES = frozenset({"bool", "complex64", "complex128", "float16", "float32", "float64"}) | {
    f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)
}

_Count = Annotated[int, Field(ge=0, le=_MOST_BYTES)]
_Frame = Annotated[int, Field(ge=0, lt=MOST_FRAMES)]
_Digest = Annotated[str, Field(max_length=200)]
_File = Annotated[tuple[_Count, _Digest], Field(strict=False)]
"""Size [bytes] and SHA-256."""
_Member = Annotated[tuple[_Count, _Digest, _Count], Field(strict=False)]
"""The same, and where it begins in the shard's ZIP file [bytes]."""
_Loose = dict[str, Any]


class StorageForm(Table):
    """Types of the storage of a manifest."""

    shard_frames: int = Field(8, ge=1, le=MOST_SHARD_FRAMES)
    radar_format: Literal["int16", "complex64"] = "int16"
    object_capacity: int = Field(1024, ge=1, le=1_000_000)
    layout: Literal["packed", "files"] = "files"


class _Mount(Table):
    name: Text
    kind: Text
    vehicle_from_sensor: _Loose
    spec: _Loose = Field(default_factory=dict)
    settings: _Loose | None = None


class _Rig(Table):
    name: Text
    sensors: list[_Mount] = Field(max_length=10_000)


class _Configuration(Table):
    storage: StorageForm
    software: dict[str, Text]
    rig: _Rig
    scenes: dict[str, _Loose]


class SceneForm(Table):
    """Types of a scene in a manifest."""

    num_frames: int = Field(ge=1, le=MOST_FRAMES)
    split: Text
    seed: int | None = None


_Row = Annotated[tuple[_Digest, _Frame, list[_Frame], _Count], Field(strict=False)]


class ManifestForm(Table):
    """Types of a manifest."""

    schema_version: int
    description: Text
    licence: Text
    configuration: _Configuration
    configuration_hash: _Digest
    scenes: dict[str, SceneForm] = Field(max_length=1_000_000)
    splits: dict[str, list[Text]]
    calibration: dict[str, _Loose]
    shards: dict[str, list[_Row | None]]

    @model_validator(mode="after")
    def _check(self) -> ManifestForm:
        for name, rows in self.shards.items():
            if name not in self.scenes:
                raise ValueError(f"shards of a scene '{name[:40]}' that is not there")
            if len(rows) > -(-self.scenes[name].num_frames // self.configuration.storage.shard_frames):
                raise ValueError(f"{len(rows)} shards of {name}, more than it has frames for")
        if missing := self.scenes.keys() - self.configuration.scenes.keys():
            raise ValueError(f"no configuration of the scene '{min(missing)[:40]}'")
        return self


class _Array(Table):
    dtype: str
    shape: list[Annotated[int, Field(ge=0, le=10**9)]] = Field(max_length=8)
    axes: list[Text] = Field(max_length=8)
    attributes: _Loose

    @field_validator("dtype")
    @classmethod
    def _known(cls, value: str) -> str:
        if value not in _TYPES:
            raise ValueError(f"the type {value!r:.40} is not one of {', '.join(sorted(_TYPES))}")
        return value

    @model_validator(mode="after")
    def _check(self) -> _Array:
        size = np.dtype(self.dtype).itemsize * math.prod(self.shape)
        if size > MOST_CHUNK_BYTES:
            raise ValueError(f"an array of {size} bytes a frame, at most {MOST_CHUNK_BYTES} are read")
        if len(self.axes) != len(self.shape):
            raise ValueError(f"{len(self.axes)} names for {len(self.shape)} axes")
        return self


class RecordForm(Table):
    """Types of the record of a shard."""

    configuration: _Digest
    frames: list[_Frame] = Field(max_length=MOST_SHARD_FRAMES)
    failed: dict[Annotated[str, Field(pattern=r"^\d{1,7}$")], Text]
    arrays: dict[str, _Array] = Field(max_length=100_000)
    files: dict[str, _File | _Member] = Field(max_length=10_000_000)
    bundle: Annotated[tuple[Text, _Count, _Digest], Field(strict=False)] | None = None
    checksum: _Digest | None = None

    @model_validator(mode="after")
    def _check(self) -> RecordForm:
        size = None if self.bundle is None else self.bundle[1]
        for name, item in self.files.items():
            inside = len(item) == 3 and size is not None and item[0] + item[2] <= size
            if not (inside if size is not None else len(item) == 2):
                raise ValueError(f"{name:.80} has no place in the shard's ZIP file, or one without such a file")
        return self


class _SensorMeta(Table):
    type: Text
    diagnostics: _Loose = Field(default_factory=dict)


class FrameMeta(Table):
    """Types of what of a frame stands in JSON."""

    index: _Frame
    seed: int
    objects: list[Text] = Field(max_length=1_000_000)
    sensors: dict[str, _SensorMeta]


class MetasForm(RootModel[list[FrameMeta]]):
    """Types of a shard's ``frames.json``."""
