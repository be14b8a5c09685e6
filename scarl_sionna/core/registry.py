"""Finds sensor classes: this package's by their names, others by the entry points ``scarl.sensors``.

So nothing here imports a sensor.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Protocol, TypeVar

import numpy as np

from .errors import UnknownNameError
from .mount import Mount
from .settings.radar import RadarSettings
from .settings.radio import RadioSettings
from .spec import FieldValue, Spec
from .specs.camera import CameraSpec
from .specs.lidar.spec import LidarSpec
from .specs.radar.closed.device import ClosedRadarSpec
from .specs.radar.scanning.spec import ScanningRadarSpec
from .specs.radar.spec import RadarSpec
from .specs.radar.version_0_1 import lift_version_0_1
from .specs.radio import RadioSpec

StateT = TypeVar("StateT", contravariant=True)
"""What a sensor looks at: for the built-in ones a state of the world, which stands above this package."""

ENTRY_POINT_GROUP = "scarl.sensors"
OWN: Mapping[str, str] = {
    "radar": "scarl_sionna.radar.sensor:Radar",
    "scanning_radar": "scarl_sionna.radar.scanning.sensor:ScanningRadar",
    "closed_radar": "scarl_sionna.radar.closed.sensor:ClosedRadar",
    "radio": "scarl_sionna.radio.sensor:Radio",
}
"""Sensors of this package: an installation from before there was one of them needs no new entry points for it."""

SPEC_TYPES: Mapping[str, type[Spec]] = {
    "camera": CameraSpec,
    "lidar": LidarSpec,
    "radar": RadarSpec,
    "scanning_radar": ScanningRadarSpec,
    "closed_radar": ClosedRadarSpec,
    "radio": RadioSpec,
}
"""Specification of each built-in sensor kind. The class of another kind names its own as ``spec_type``."""


class Sensor(Protocol[StateT]):
    """A sensor looks at a state of the world from a mount and returns a result; it keeps no state of its own.

    A kind that can be simulated in several ways takes its settings as second argument of the constructor.
    """

    def __init__(self, spec: Spec) -> None: ...

    def observe(self, state: StateT, mount: Mount, rng: np.random.Generator) -> object:
        """Return the sensor's result at the state's time.

        Parameters
        ----------
        state : scarl_sionna.engine.world.WorldState
        mount : Mount
            Pose (x forward, y left, z up) and velocity of the sensor.
        rng : numpy.random.Generator
            The only source of randomness.
        """


@cache
def sensor_class(kind: str) -> type[Sensor[Any]]:
    """Return the sensor class registered under a kind, for instance ``"radar"``."""
    found = {entry.name: entry for entry in entry_points(group=ENTRY_POINT_GROUP)}
    found |= {name: EntryPoint(name, place, ENTRY_POINT_GROUP) for name, place in OWN.items()}
    if kind not in found:
        raise UnknownNameError("sensor kind", kind, found, "install the package that registers it under scarl.sensors")
    return found[kind].load()


def spec_type(kind: str) -> type[Spec]:
    """Return the specification class of a sensor kind.

    Raises
    ------
    UnknownNameError
        If the kind is neither built in nor registered under the entry points ``scarl.sensors``.
    """
    if kind in SPEC_TYPES:
        return SPEC_TYPES[kind]
    try:
        return sensor_class(kind).spec_type  # type: ignore[attr-defined, no-any-return]
    except UnknownNameError as error:
        raise UnknownNameError("sensor kind", kind, {*SPEC_TYPES, *error.known}, error.remedy) from None


SETTINGS_TYPES: Mapping[str, type[Spec]] = {
    "radar": RadarSettings,
    "scanning_radar": RadarSettings,
    "closed_radar": RadarSettings,
    "radio": RadioSettings,
}
"""Settings of each built-in sensor kind that has some. The class of another kind names its own as ``settings_type``."""


def settings_type(kind: str) -> type[Spec] | None:
    """Return the class of the settings with which a sensor kind is simulated, None for a kind that has none."""
    if kind in SPEC_TYPES:
        return SETTINGS_TYPES.get(kind)
    return getattr(sensor_class(kind), "settings_type", None)


def lifted(kind: str, spec: Mapping[str, Any], settings: FieldValue = None) -> tuple[Mapping[str, Any], FieldValue]:
    """Return the fields of a specification and of settings in a rig file or a dataset as this version has them.

    Parameters
    ----------
    kind : str
        Sensor kind.
    spec : mapping
        Fields of the specification, of this version or an earlier one.
    settings : mapping, optional
        Fields of the settings.

    Raises
    ------
    ParameterRangeError
        If fields of different versions stand beside each other.
    """
    return lift_version_0_1(spec, settings) if kind == "radar" else (spec, settings)
