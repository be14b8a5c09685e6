"""Types of what stands in a scene.toml and an actor.toml; what the values may be, their own readers check."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import Field

from scarl_sionna.core.errors import SceneError
from scarl_sionna.core.untrusted.checked import Number, Table, Text, checked, plain
from scarl_sionna.core.untrusted.toml_text import read_toml

_Loose = dict[str, Any]
_Value = bool | Number | Text | list[Number] | list[Text] | list[list[Number]] | dict[str, Number | list[Number] | Text]


class _Material(Table):
    radio: Text | None = None
    lidar_reflectance: Number = 0.0
    lidar_transmittance: Number = 0.0
    retroreflection: Number = 0.0
    retroreflected_luminance: Number = 0.0
    wets: Number = 0.0
    lamp: Text | None = None
    puddles: Text | None = None


class _Trajectory(Table):
    kind: Text = "waypoints"
    times: list[Number] = Field(default_factory=list)
    positions: list[list[Number]] = Field(default_factory=list)
    position: list[Number] = Field(default_factory=list)
    velocity: list[Number] = Field(default_factory=list)
    yaw_deg: Number | list[Number] = 0.0
    angular_velocity_z: Number = 0.0


class _Joint(Table):
    __pydantic_extra__: dict[str, _Value]
    kind: Text = "wheel"
    shapes: list[Text] = Field(default_factory=list)
    center: list[Number] = Field(default_factory=list)
    radius: Number = 0.0
    steered: bool = False
    height: Number = 0.0


class _Instance(Table):
    name: Text = ""
    semantic: Text = Field("", alias="class")
    shapes: list[Text] = Field(default_factory=list)
    is_object: bool = Field(True, alias="object")
    room: bool = False
    signal: Text | None = None


class _Actor(Table):
    name: Text = ""
    semantic: Text = Field("", alias="class")
    shapes: list[Text] = Field(default_factory=list)
    model: Text = ""
    variant: Text | None = None
    detail: Text = ""
    colors: dict[str, list[Number]] = Field(default_factory=dict)
    radio: dict[str, Text] = Field(default_factory=dict)
    phase: Number = 0.0
    trajectory: _Trajectory = Field(default_factory=_Trajectory)
    joints: list[_Joint] = Field(default_factory=list)


class _SceneHead(Table):
    name: Text = ""
    ego: Text | None = None
    up: Text | None = None


class _Scene(Table):
    scene: _SceneHead = Field(default_factory=_SceneHead)
    lighting: dict[str, _Value] = Field(default_factory=dict)
    materials: dict[str, _Material] = Field(default_factory=dict)
    instances: list[_Instance] = Field(default_factory=list)
    actors: list[_Actor] = Field(default_factory=list)
    lanes: list[_Loose] = Field(default_factory=list)
    parking: list[_Loose] = Field(default_factory=list)
    signals: _Loose | None = None


class _ModelHead(Table):
    name: Text = ""
    title: Text = ""
    semantic: Text = Field("", alias="class")
    motion: Text = ""
    age: Number = 0.0
    length: Number = 0.0
    width: Number = 0.0
    height: Number = 0.0
    wheelbase: Number = 0.0
    rear_axle: Number = 0.0
    ego_mount: bool = False
    occupants: list[str] = Field(default_factory=list)


class _Bending(Table):
    file: Text
    motion: Text | None = None
    clip: Text | None = None
    smooth: bool | None = None
    unit: Number = 1.0
    loop: bool = True
    speed: Number = 1.0
    placement: list[Number]
    parts: dict[str, Text]


class _Model(Table):
    actor: _ModelHead = Field(default_factory=_ModelHead)
    variants: dict[str, dict[str, list[Number]]] = Field(default_factory=dict)
    materials: dict[str, _Material] = Field(default_factory=dict)
    joints: list[_Joint] = Field(default_factory=list)
    bending: _Bending | None = None


def scene_tables(path: Path) -> dict[str, Any]:
    """Return the tables of a scene.toml, each value of the type that it has to be.

    Raises
    ------
    SceneError
        If it cannot be read, or a value is of another type.
    """
    return _tables(path, _Scene)


def model_tables(path: Path) -> dict[str, Any]:
    """Return the tables of an actor.toml; errors as for :func:`scene_tables`."""
    return _tables(path, _Model)


def _tables(path: Path, form: type[Table]) -> dict[str, Any]:
    try:
        return plain(checked(form, read_toml(path)))
    except ValueError as error:
        raise SceneError(str(error), path, "correct the value") from error
