"""Sensors on a vehicle: where each one sits and what it is."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from scarl_sionna.core.errors import (
    InputTypeError,
    OutputError,
    ParameterRangeError,
    ScarlError,
    SpecError,
    UnknownNameError,
    put_in_front,
)
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.arguments import HOW_TO_POSE, expect
from scarl_sionna.core.prompt.describe import Described, Row, vector
from scarl_sionna.core.registry import lifted, settings_type, spec_type
from scarl_sionna.core.settings.radar import QUALITIES, RadarSettings
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.pattern import RasterScan
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.untrusted.checked import Table, Text, checked
from scarl_sionna.core.untrusted.yaml_text import read_yaml

_NAME = re.compile(r"[A-Za-z0-9_\-]+(/[A-Za-z0-9_\-]+)*")
_FACING_BACK = (0.0, 0.0, 0.0, 1.0)
_FACING_FRONT = (1.0, 0.0, 0.0, 0.0)


class _MountForm(Table):
    """Types of a rig's entry of a sensor; what is in it is for the specification to check."""

    name: Text
    kind: Text
    spec: dict[str, Any] | None = None
    settings: dict[str, Any] | None = None


@dataclass(frozen=True, repr=False)
class SensorMount(Described):
    """One sensor of a rig.

    Parameters
    ----------
    name : str
        Unique in the rig; letters, digits, ``_``, ``-``, and ``/`` between groups, for instance ``"front_left/radar"``.
        It is also the sensor's folder in an export.
    kind : str
        ``"radar"``, ``"camera"``, ``"lidar"``, ``"radio"``, or a kind registered under the entry points
        ``scarl.sensors``.
    spec : RadarSpec, CameraSpec, LidarSpec or RadioSpec
        What the sensor is.
    vehicle_from_sensor : Pose
        Sensor frame (x forward, y left, z up) in the vehicle frame (origin on the ground below the middle of the car).
    settings : RadarSettings or RadioSettings, optional
        How the sensor is simulated, for kinds that have settings: their defaults if left out.

    Raises
    ------
    ParameterRangeError
        If the name has other characters, or the specification or the settings are not of this kind.
    UnknownNameError
        If the kind is unknown.
    """

    name: str
    kind: str
    spec: Spec
    vehicle_from_sensor: Pose
    settings: Spec | None = None

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            raise ParameterRangeError(
                "SensorMount.name", repr(self.name), "letters, digits, '_', '-', with '/' between groups"
            )
        expect("vehicle_from_sensor", self.vehicle_from_sensor, Pose, HOW_TO_POSE)
        expected = spec_type(self.kind)
        if not isinstance(self.spec, expected):
            raise ParameterRangeError(
                "SensorMount.spec", type(self.spec).__name__, f"a {expected.__name__} for the sensor kind '{self.kind}'"
            )
        kind = settings_type(self.kind)
        if self.settings is None and kind is not None:
            object.__setattr__(self, "settings", kind())
        elif self.settings is not None and (kind is None or not isinstance(self.settings, kind)):
            allowed = "none" if kind is None else f"a {kind.__name__}"
            raise ParameterRangeError(
                "SensorMount.settings", type(self.settings).__name__, f"{allowed} for the sensor kind '{self.kind}'"
            )

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for a file."""
        data = {
            "name": self.name,
            "kind": self.kind,
            "vehicle_from_sensor": self.vehicle_from_sensor.to_dict(),
            "spec": self.spec.model_dump(mode="json"),
        }
        return data if self.settings is None else {**data, "settings": self.settings.model_dump(mode="json")}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> SensorMount:
        """Return the mount of :meth:`to_dict`; `spec` and `settings` may leave out what keeps its default.

        ``preset`` in `spec` names a sensor whose values the other fields then replace: ``{preset: hdl32e}``; in the
        `settings` of a radar it names a quality: ``{preset: draft}``.

        Raises
        ------
        ParameterRangeError
            If a key is missing or unknown, or a value is not allowed.
        UnknownNameError
            If there is no such kind of sensor, or no such preset.
        """
        what = f"sensor '{data.get('name', '?')}'" if isinstance(data, Mapping) else "sensor"
        _check_keys(what, data, required={"name", "kind", "vehicle_from_sensor"}, optional={"spec", "settings"})
        pose = data["vehicle_from_sensor"]
        _check_keys(f"{what} vehicle_from_sensor", pose, required={"position"}, optional={"quaternion"})
        try:
            form = checked(_MountForm, dict(data))
        except ValueError as error:
            raise ParameterRangeError(what, repr(dict(data))[:80], "the form of Rig.to_dict()", str(error)) from error
        kind = form.kind
        fields = dict(form.spec or {})
        named = _named(spec_type(kind), f"{what} spec", fields) if "preset" in fields else None
        values, settings = lifted(kind, fields if named is None else {}, form.settings)
        try:
            place = Pose(pose["position"], pose.get("quaternion", _FACING_FRONT))
        except ParameterRangeError as error:
            where = f"{what} vehicle_from_sensor.{error.name}"
            raise ParameterRangeError(where, error.value, error.allowed, "keep to the form of Rig.to_dict()") from error
        try:
            spec = spec_type(kind)(**values) if named is None else named
            return cls(form.name, kind, spec, place, _settings_of(kind, what, settings))
        except SpecError as error:
            put_in_front(error, what)
            raise


@dataclass(frozen=True, repr=False)
class Rig(Described):
    """All sensors of one vehicle.

    Parameters
    ----------
    name : str
    sensors : iterable of SensorMount
        Names are unique; kept as a tuple.

    Raises
    ------
    ParameterRangeError
        If the rig has no sensor or two of the same name.
    """

    name: str
    sensors: tuple[SensorMount, ...]

    if TYPE_CHECKING:

        def __init__(self, name: str, sensors: Iterable[SensorMount]) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "sensors", tuple(self.sensors))
        if not self.sensors:
            raise ParameterRangeError("Rig.sensors", "()", "at least one sensor", "add a SensorMount")
        names = [mount.name for mount in self.sensors]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise ParameterRangeError(
                "Rig.sensors",
                f"names {', '.join(repeated)} more than once",
                "unique sensor names",
                "rename one of them",
            )

    def _facts(self) -> Iterable[Row]:
        yield "name", self.name
        for mount in self.sensors:
            yield (
                mount.name,
                f"{mount.kind} at {vector(mount.vehicle_from_sensor.position, 'm')}, yaw "
                f"{np.degrees(mount.vehicle_from_sensor.yaw):.4g} deg",
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Sensor names in the rig's order."""
        return tuple(mount.name for mount in self.sensors)

    def __getitem__(self, name: str) -> SensorMount:
        """Return the sensor of a name, for instance ``rig["front_center/radar"]``."""
        expect("name", name, str, f"sensors go by their names, for instance '{self.names[0]}'")
        for mount in self.sensors:
            if mount.name == name:
                return mount
        raise UnknownNameError("sensor", name, self.names)

    def subset(self, *patterns: str, name: str | None = None) -> Rig:
        """Return the rig of the sensors whose name matches a shell pattern, for instance ``"front_*/radar"``.

        Raises
        ------
        UnknownNameError
            If a pattern matches no sensor.
        """
        for pattern in patterns:
            if not any(fnmatchcase(sensor, pattern) for sensor in self.names):
                raise UnknownNameError("sensor pattern", pattern, self.names)
        chosen = tuple(m for m in self.sensors if any(fnmatchcase(m.name, pattern) for pattern in patterns))
        return Rig(name or self.name, chosen)

    def with_radar(self, settings: RadarSettings) -> Rig:
        """Return the rig with the fields that are set in `settings` replaced for every radar; the others stay.

        Raises
        ------
        InputTypeError
            If `settings` is no RadarSettings.
        """
        if not isinstance(settings, RadarSettings):
            raise InputTypeError(
                "settings", settings, "a RadarSettings", "for instance RadarSettings(method='raycast')"
            )
        return self._with_settings(lambda own: own.merged(settings))

    def in_quality(self, quality: str) -> Rig:
        """Return the rig with the settings of a quality wherever a radar does not state its own.

        Raises
        ------
        UnknownNameError
            If there is no such quality.
        """
        preset = RadarSettings.preset(quality)
        return self._with_settings(preset.merged)

    def _with_settings(self, change: Callable[[RadarSettings], RadarSettings]) -> Rig:
        sensors = (
            replace(mount, settings=change(mount.settings)) if isinstance(mount.settings, RadarSettings) else mount
            for mount in self.sensors
        )
        return replace(self, sensors=tuple(sensors))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for a file."""
        return {"name": self.name, "sensors": [mount.to_dict() for mount in self.sensors]}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Rig:
        """Return the rig of :meth:`to_dict`.

        Raises
        ------
        ParameterRangeError, UnknownNameError
            If a key is missing or unknown, or a value is not allowed.
        """
        _check_keys("rig", data, required={"name", "sensors"})
        try:
            return cls(str(data["name"]), tuple(SensorMount.from_dict(item) for item in data["sensors"]))
        except ScarlError:
            raise
        except (TypeError, ValueError) as error:  # a number where a list belongs, a text where a number belongs, ...
            raise ParameterRangeError("rig", repr(dict(data))[:80], "the form of Rig.to_dict()", str(error)) from error

    def save(self, path: str | Path) -> None:
        """Write the rig to a YAML file (``.yaml``, ``.yml``) or a JSON file.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        path = Path(path)
        is_yaml = path.suffix in (".yaml", ".yml")
        text = yaml.safe_dump(self.to_dict(), sort_keys=False) if is_yaml else json.dumps(self.to_dict(), indent=2)
        try:
            path.write_text(text + ("" if is_yaml else "\n"), encoding="utf-8")
        except OSError as error:
            raise OutputError(f"cannot write the rig to {path}: {error.strerror}; choose a writable folder") from error

    @classmethod
    def load(cls, path: str | Path) -> Rig:
        """Return the rig of a YAML or JSON file.

        Raises
        ------
        ParameterRangeError
            If the file cannot be read, or holds no rig.
        """
        path = Path(path)
        try:
            data = read_yaml(path)
        except OSError as error:
            raise ParameterRangeError("rig file", path, "a readable YAML or JSON file", str(error)) from error
        try:
            return cls.from_dict(data)
        except ScarlError as error:
            put_in_front(error, str(path))
            raise

    @classmethod
    def scarl(cls, quality: str = "full", radar: RadarSpec | None = None) -> Rig:
        """Return SCaRL's rig: six suites of five synchronized sensors around the car.

        Suites ``front_left``, ``front_center``, ``front_right`` look forward from x = 2.36 m, ``back_left``,
        ``back_center``, ``back_right`` look backward from x = -2.36 m; y = 0.4, 0, -0.4 m (left is the vehicle's left),
        z = 0.8 m: just outside a car body of |x| <= 2.3 m. Sensors of a suite: ``rgb``, ``semantic`` (with instances),
        ``depth``, ``lidar``, ``radar``.

        Parameters
        ----------
        quality : str
            ``"full"``: the default of every specification. ``"draft"``: smaller images with fewer samples, a coarser
            lidar raster and fewer radar rays and tubes.
        radar : RadarSpec, optional
            Radar of every suite; default ``RadarSpec.preset("awr1843boost")``.

        References
        ----------
        .. [1] Nittur Ramesh et al., *SCaRL*, 2024, section 2.4 and Fig. 1: suites 0.4 m apart along a horizontal, in
           the front and back. The paper prints no heights or distances along the car; those are this project's.
        """
        specs = _suite_specs(quality, radar)
        mounts = []
        for end, x, quaternion in (("front", 2.36, _FACING_FRONT), ("back", -2.36, _FACING_BACK)):
            for side, y in (("left", 0.4), ("center", 0.0), ("right", -0.4)):
                pose = Pose(np.array([x, y, 0.8]), np.array(quaternion))
                mounts += [SensorMount(f"{end}_{side}/{name}", kind, spec, pose) for name, kind, spec in specs]
        return cls("scarl", tuple(mounts)).with_radar(RadarSettings.preset(quality))

    @classmethod
    def front(cls, quality: str = "full", radar: RadarSpec | None = None) -> Rig:
        """Return the ``front_center`` suite of :meth:`scarl` alone."""
        return cls.scarl(quality, radar).subset("front_center/*", name="front")

    @classmethod
    def preset(cls, name: str, quality: str = "full") -> Rig:
        """Return a named rig: one of `RIG_PRESETS`.

        Raises
        ------
        UnknownNameError
            If there is no such rig.
        """
        if name not in RIG_PRESETS:
            raise UnknownNameError("rig", name, RIG_PRESETS, "or give the path of a rig file (.yaml or .json)")
        return RIG_PRESETS[name](quality)


RIG_PRESETS: Mapping[str, Callable[[str], Rig]] = {"scarl": Rig.scarl, "front": Rig.front}
"""Rigs by name, made for a quality."""


def _suite_specs(quality: str, radar: RadarSpec | None) -> list[tuple[str, str, Spec]]:
    """Return name, kind and specification of a suite's five sensors."""
    if quality not in QUALITIES:
        raise UnknownNameError("quality", quality, QUALITIES)
    draft = quality == "draft"
    camera = CameraSpec(width=480, height=270, samples_per_pixel=8) if draft else CameraSpec()
    lidar = LidarSpec(scan=RasterScan(num_azimuth=480)) if draft else LidarSpec()
    if radar is None:
        radar = RadarSpec.preset("awr1843boost")
    return [
        ("rgb", "camera", camera.with_(images=("rgb",))),
        ("semantic", "camera", camera.with_(images=("semantic", "instance"))),
        ("depth", "camera", camera.with_(images=("depth",))),
        ("lidar", "lidar", lidar),
        ("radar", "radar", radar),
    ]


def _named(kind: type[Spec], what: str, fields: Mapping[str, Any]) -> Spec:
    """Return the specification or the settings that a preset names, with the other fields in place of its own."""
    preset, name = getattr(kind, "preset", None), fields["preset"]
    if preset is None or not isinstance(name, str):
        allowed = f"the name of a preset as text; a {kind.__name__} has {'none' if preset is None else 'some'}"
        raise ParameterRangeError(f"{what}.preset", repr(name), allowed, f"give the fields of the {kind.__name__}")
    return _changed(preset(name), {name: value for name, value in fields.items() if name != "preset"})


def _changed(spec: Spec, fields: Mapping[str, Any]) -> Spec:
    """Return a specification with other values of some fields; a part of the same kind changes field by field."""
    values = {}
    for name, value in fields.items():
        old = getattr(spec, name, None)
        kind = getattr(old, "kind", None)
        if isinstance(old, Spec) and isinstance(value, Mapping) and value.get("kind", kind) == kind:
            value = _changed(old, {key: item for key, item in value.items() if key != "kind"})
        values[name] = value
    return spec.with_(**values) if values else spec


def _settings_of(kind: str, what: str, data: object) -> Spec | None:
    """Return the settings of a sensor from plain data."""
    if data is None:
        return None
    cls = settings_type(kind)
    allowed = (
        f"none: the sensor kind '{kind}' has no settings" if cls is None else f"a mapping with fields of {cls.__name__}"
    )
    if cls is None or not isinstance(data, Mapping):
        raise ParameterRangeError(f"{what} settings", repr(data)[:80], allowed)
    return _named(cls, f"{what} settings", data) if "preset" in data else cls(**data)


def _check_keys(what: str, data: object, required: set[str], optional: set[str] = frozenset()) -> None:  # type: ignore[assignment]
    """Raise if `data` is not a mapping with the required and no other than the optional keys."""
    if not isinstance(data, Mapping):
        raise ParameterRangeError(what, repr(data)[:80], "a mapping with the keys " + ", ".join(sorted(required)))
    missing, unknown = required - data.keys(), data.keys() - required - optional
    if missing:
        raise ParameterRangeError(what, f"without {', '.join(sorted(missing))}", "keys " + ", ".join(sorted(required)))
    if unknown:
        raise UnknownNameError(f"key of {what}", sorted(unknown)[0], required | optional)
