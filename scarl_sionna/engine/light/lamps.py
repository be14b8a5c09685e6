"""Lamps of vehicles and streets as emitters: glowing surfaces, and the low beams of head lamps.

A surface of a material with ``lamp = "headlamp" | "taillamp" | "street_lamp"`` in scene.toml glows when the lighting
says so, those of `ALWAYS_ON` (rooms and tunnels, traffic lights) under every lighting. In front
of each half (left, right) of a head lamp's surface hangs a projector with the light distribution of a low beam.
Tail lamps shine brighter while their vehicle brakes, and ``indicator`` ones blink on the side to which it goes, by day
too; all lamps of a parked vehicle are off. What they tell follows from the trajectory (`scene.motion.signalling`).
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.engine.types import MitsubaObject
from scarl_sionna.scene.document.model import InstanceEntry, SceneDocument
from scarl_sionna.scene.lanes import Signals
from scarl_sionna.scene.motion import signalling
from scarl_sionna.scene.motion.trajectory import Trajectory

from .sky import LUMINANCE_WEIGHTS, UNIT_LUMINANCE

Array = npt.NDArray[np.float64]

STREET_LAMP_FLUX = 9000.0
"""Of one luminaire [lm]: an LED of 75 W."""
_COLORS = {
    "headlamp": (1.0, 0.93, 0.82), "taillamp": (1.0, 0.0, 0.0), "street_lamp": (1.0, 0.86, 0.66),
    "indoor": (1.0, 0.93, 0.82), "signal_red": (1.0, 0.02, 0.01), "signal_amber": (1.0, 0.36, 0.0),
    "signal_green": (0.0, 1.0, 0.32),
    "lane_red": (1.0, 0.02, 0.01), "lane_green": (0.0, 1.0, 0.32), "indicator": (1.0, 0.36, 0.0),
    "room_2700": (1.0, 0.55, 0.22), "room_3000": (1.0, 0.65, 0.35), "screen": (0.6, 0.8, 1.0),
}  # fmt: skip # a table
"""Linear RGB: LED of 5000 K, red, LED of 4000 K, LED of 5000 K, signals, rooms (LED of
2700 and 3000 K, a screen), before they are scaled to luminance 1."""
ALWAYS_ON = {
    "indoor": 8000.0,
    "signal_red": 6400.0,
    "signal_amber": 6400.0,
    "signal_green": 6400.0,
    "lane_red": 300.0,
    "lane_green": 300.0,
}
"""Luminance of lamps that shine by day, too [cd/m2]: a fluorescent tube or LED panel; a signal of 200 cd (EN 12368,
class 2) over its lens of 200 mm; a lane signal dimmed for a tunnel (engineering estimate)."""
_GLOW_INTENSITY = {"headlamp": 450.0, "taillamp": 8.0}
"""Intensity of a lamp's surface seen from the front [cd]: a low beam above its cut-off stays below 625 cd, and a rear
position lamp gives 4 to 17 cd (UN Regulations 149 and 148)."""
BRAKE_INTENSITY = 100.0
"""Of a tail lamp while the brakes work [cd]: 60 to 260 cd (UN Regulation 148, S1)."""
INDICATOR_INTENSITY = 200.0
"""Of the indicators of one side [cd], all of them: 175 to 1000 cd in front, 50 to 500 cd behind (the same)."""
_WEIGHTS = {"headlamp": 0.3, "taillamp": 0.3, "street_lamp": 2.0, "indoor": 3.0}
VEHICLES = frozenset({"Car", "Truck", "Bus", "Train", "Motorcycle", "Bicycle"})
_SIGNAL_WEIGHT = 0.05
"""How often a light path asks a surface for light; beams ask at weight 1. Signals are bright to look at and light
little."""
_SIGNAL = "signal_"
"""How the lamps of traffic lights begin; the colour follows."""

BEAM_FOV_DEG = 100.0
_BEAM_SIZE = (256, 768)


def is_on(lamp: str | None, lighting: Lighting | None, in_tunnel: bool = False) -> bool:
    """Return whether a kind of lamp is switched on; vehicles that drive in tunnels have theirs on."""
    if lamp is None or lighting is None:
        return False
    if lamp in ALWAYS_ON:
        return True
    if lamp == "indicator":
        return False
    return lighting.street_lamps if lamp == "street_lamp" else lighting.headlamps or in_tunnel


def low_beam(azimuth_deg: Array, elevation_deg: Array) -> Array:
    """Return the intensity [cd] of a low beam for traffic on the right; azimuth to the right, elevation up [deg].

    Parameters
    ----------
    azimuth_deg, elevation_deg : ndarray of float64, any shape

    Returns
    -------
    ndarray of float64, same shape
        [cd].

    Notes
    -----
    A hot spot of 18,000 cd below a cut-off at -0.57 deg that rises by 15 deg to the right, a wide foreground, and 250
    cd of scattered light above. It keeps within UN Regulation 112's limits for passing beams: B50L below 350 cd, 75R
    above 10,100 cd (class B), 50L below 13,200 cd. A smooth model, not a measured lamp.
    """
    cutoff = -0.57 + np.where(azimuth_deg > 0.0, np.minimum(azimuth_deg * np.tan(np.radians(15.0)), 1.6), 0.0)
    below = 1.0 / (1.0 + np.exp(np.clip((elevation_deg - cutoff) / 0.12, -60.0, 60.0)))
    depth = np.maximum(cutoff - elevation_deg, 0.0)
    spot = 18_000.0 * np.exp(-(((azimuth_deg - 2.0) / 5.5) ** 2)) * np.exp(-((depth / 2.3) ** 2))
    wide = 5_500.0 * np.exp(-((azimuth_deg / 21.0) ** 2)) * np.exp(-((depth / 5.5) ** 2))
    return (spot + wide) * below + 250.0 * np.exp(-((azimuth_deg / 30.0) ** 2 + (elevation_deg / 12.0) ** 2))


def _beam_texture(path: Path, mi: ModuleType) -> None:
    """Write the irradiance of the beam on the plane at 1 m, in the scenes' units."""
    rows, columns = _BEAM_SIZE
    half = np.tan(np.radians(BEAM_FOV_DEG / 2.0))
    right = ((np.arange(columns) + 0.5) / columns * 2.0 - 1.0) * half
    up = (1.0 - (np.arange(rows) + 0.5) / rows * 2.0) * half * rows / columns
    x, y = np.meshgrid(right, up)
    cosine = 1.0 / np.sqrt(1.0 + x * x + y * y)
    intensity = low_beam(np.degrees(np.arctan(x)), np.degrees(np.arctan(y / np.sqrt(1.0 + x * x))))
    # pi: the projector takes the radiance of a white diffuser on that plane for its irradiance (tested against E = I /
    # d^2)
    light = (intensity * cosine**3 / (np.pi * UNIT_LUMINANCE))[..., None] * unit_color("headlamp")
    mi.Bitmap(light.astype(np.float32)).write(str(path))


def unit_color(lamp: str) -> Array:
    """Return the linear RGB of a kind of lamp, shape (3,), of luminance 1 by the weights of ITU-R BT.709."""
    color = np.array(_COLORS[lamp])
    return color / (LUMINANCE_WEIGHTS @ color)


def lamp_elements(
    document: SceneDocument, lighting: Lighting | None, folder: Path, mi: ModuleType
) -> tuple[dict[str, ET.Element], list[ET.Element]]:
    """Return the emitters of glowing shapes by shape id, and the beams; their strength and place are set after loading.

    Files are written into `folder`, which must live until the scene is loaded.
    """
    glowing: dict[str, ET.Element] = {}
    beams: list[ET.Element] = []
    parked, signalling_shapes = parked_shapes(document), set(signals_of_vehicles(document, lighting))
    for shape, bsdf in document.bsdf_of_shape.items():
        lamp = document.materials[bsdf].lamp
        if lamp is None or shape in parked:
            continue
        lit = is_on(lamp, lighting, _is_tunnel(document))
        if not (lit or shape in signalling_shapes):
            continue
        weight = _WEIGHTS.get(lamp, _SIGNAL_WEIGHT) if lit else 0.0  # is seen, and lights nothing of note
        emitter = ET.Element("emitter", {"type": "area"})
        ET.SubElement(emitter, "rgb", {"name": "radiance", "value": "1, 1, 1"})
        ET.SubElement(emitter, "float", {"name": "sampling_weight", "value": repr(weight)})
        glowing[shape] = emitter
        if lamp == "headlamp":
            beams += [_beam(f"beam-{shape}-{side}", folder / "low_beam.exr") for side in ("left", "right")]
    if beams:
        _beam_texture(folder / "low_beam.exr", mi)
    return glowing, beams


def _beam(name: str, file: Path) -> ET.Element:
    element = ET.Element("emitter", {"type": "projector", "id": name})
    ET.SubElement(element, "float", {"name": "fov", "value": repr(BEAM_FOV_DEG)})
    texture = ET.SubElement(element, "texture", {"type": "bitmap", "name": "irradiance"})
    ET.SubElement(texture, "string", {"name": "filename", "value": str(file)})
    ET.SubElement(texture, "boolean", {"name": "raw", "value": "true"})
    return element


class Lens(NamedTuple):
    """A lens that a group of lights switches: the group, its colour, and whether its head has an amber one."""

    group: str
    color: str
    has_amber: bool

    def is_lit(self, signals: Signals, time: float) -> bool:
        """Return whether it shines at a time [s]; a head without amber shows red instead."""
        shown = signals.shown(self.group, time)
        return self.color in shown or (self.color == "red" and not self.has_amber and "green" not in shown)


def lenses(document: SceneDocument) -> dict[str, Lens]:
    """Return the lenses that groups of lights switch, by shape id."""
    found = {}
    for entry in document.instances:
        if entry.signal is None:
            continue
        lamps = {shape: document.materials[document.bsdf_of_shape[shape]].lamp or "" for shape in entry.shapes}
        has_amber = "signal_amber" in lamps.values()
        for shape, lamp in lamps.items():
            if lamp.startswith(_SIGNAL):
                found[shape] = Lens(entry.signal, lamp.removeprefix(_SIGNAL), has_amber)
    return found


def _is_tunnel(document: SceneDocument) -> bool:
    return document.is_enclosed and not _is_car_park(document)


def _is_car_park(document: SceneDocument) -> bool:
    """Return whether a scene is enclosed and has parking bays.

    Its lamps are dim and its surfaces near, so the few light paths that meet a lamp of a vehicle would be specks of its
    colour all over the picture: brake lamps and indicators stay off, head and tail lamps follow the lighting.
    """
    return document.is_enclosed and document.lanes is not None and len(document.lanes.parking) > 0


def parked_shapes(document: SceneDocument) -> frozenset[str]:
    """Return the shapes of actors that never move, and of vehicles that are objects of the place itself."""
    return frozenset(shape for entry in document.instances if _is_parked(entry) for shape in entry.shapes)


def _is_parked(entry: InstanceEntry) -> bool:
    if entry.trajectory is None:
        return entry.is_object and entry.semantic in VEHICLES
    return signalling.is_parked(entry.trajectory)


class Moment(NamedTuple):
    """A time [s], and the trajectories of the actors by name."""

    time: float
    ways: Mapping[str, Trajectory]


class VehicleLamp(NamedTuple):
    """A lamp by which a vehicle tells what it does: the vehicle's name, and ``brake``, ``left`` or ``right``."""

    actor: str
    tells: str

    def is_lit(self, trajectory: Trajectory, time: float) -> bool:
        """Return whether it shines at a time [s]."""
        if self.tells == "brake":
            return signalling.is_braking(trajectory, time)
        return signalling.is_flash(time) and signalling.indicated(trajectory, time) == self.tells


def signals_of_vehicles(document: SceneDocument, lighting: Lighting | None) -> dict[str, VehicleLamp]:
    """Return the lamps of vehicles that ever brake or indicate, by shape id; none in a car park.

    Indicators are shapes whose id ends in ``_left`` or ``_right``.
    """
    found: dict[str, VehicleLamp] = {}
    for entry in document.instances if lighting is not None and not _is_car_park(document) else ():
        kinds = {shape: document.materials[document.bsdf_of_shape[shape]].lamp for shape in entry.shapes}
        told = {shape: lamp for shape, lamp in kinds.items() if lamp in ("taillamp", "indicator")}
        if (
            not told
            or entry.semantic == "Bicycle"
            or entry.trajectory is None
            or not signalling.ever_signals(entry.trajectory)
        ):
            continue
        for shape, lamp in told.items():
            side = shape.rsplit("_", 1)[-1]
            if lamp == "taillamp":
                found[shape] = VehicleLamp(entry.name, "brake")
            elif side in ("left", "right"):
                found[shape] = VehicleLamp(entry.name, side)
    return found


class Lamps:
    """The lamps of a loaded optical scene: sets their strength, moves beams with their vehicles, switches signals.

    Parameters
    ----------
    params : mitsuba.SceneParameters
    document : SceneDocument
    lighting : Lighting or None
    meshes : mapping
        Shape id -> vertices and faces in the frame of the shape's actor.
    """

    def __init__(
        self, params: MitsubaObject, document: SceneDocument, lighting: Lighting | None, meshes: Mapping[str, Any]
    ) -> None:
        self._mounts: dict[str, dict[str, Pose]] = {}
        self._signals = None if document.lanes is None else document.lanes.signals
        self._lenses = {} if lighting is None else lenses(document)
        self._told = signals_of_vehicles(document, lighting)
        self._radiance: dict[str, Array] = {}
        self._rest: dict[str, Array] = {}
        self._lit: dict[str, bool] = {}
        parked = parked_shapes(document)
        for shape, bsdf in document.bsdf_of_shape.items():
            lamp = document.materials[bsdf].lamp
            shines = is_on(lamp, lighting, _is_tunnel(document))
            if lamp is None or shape in parked or not (shines or shape in self._told):
                continue
            vertices, faces = meshes[shape].vertices, meshes[shape].faces
            key = f"{shape}.emitter.radiance.value"
            glow = _glow(lamp, vertices, faces) * unit_color(lamp)
            radiance = glow if shines else np.zeros(3)
            if shape in self._told:
                more = 1.0 if lamp == "indicator" else BRAKE_INTENSITY / _GLOW_INTENSITY[lamp]
                self._rest[shape], self._radiance[shape], self._lit[shape] = radiance, more * glow, False
            params[key] = type(params[key])(*radiance.tolist())
            if shape in self._lenses:
                self._radiance[shape], self._lit[shape] = radiance, True
            if lamp == "headlamp":
                self._mounts[shape] = _mounts(vertices)
                self.move(params, shape, Pose())

    @property
    def shapes(self) -> tuple[str, ...]:
        """Shapes that carry beams."""
        return tuple(self._mounts)

    def switch(self, params: MitsubaObject, moment: Moment) -> None:
        """Show what traffic lights and vehicles show at a moment; a lens that is off stays and gives no light."""
        time = moment.time
        known: dict[VehicleLamp, bool] = {}
        for shape, radiance in self._radiance.items():
            told = self._told.get(shape)
            if told is not None:
                if told not in known:
                    known[told] = told.is_lit(moment.ways[told.actor], time)
                lit = known[told]
            elif self._signals is not None:
                lit = self._lenses[shape].is_lit(self._signals, time)
            else:
                continue
            if lit != self._lit[shape]:
                key, self._lit[shape] = f"{shape}.emitter.radiance.value", lit
                shown = radiance if lit else self._rest.get(shape, 0.0 * radiance)
                params[key] = type(params[key])(*shown.tolist())

    def move(self, params: MitsubaObject, shape: str, world_from_part: Pose) -> None:
        """Put the beams of a shape where it is now."""
        for side, mount in self._mounts[shape].items():
            pose = world_from_part.compose(mount)
            matrix = np.eye(4)
            matrix[:3, :3] = pose.rotation @ _SENSOR_FROM_PROJECTOR
            matrix[:3, 3] = pose.position
            key = f"beam-{shape}-{side}.to_world"
            params[key] = type(params[key])(matrix.astype(np.float32))


_SENSOR_FROM_PROJECTOR = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Columns: the projector's axes (x left, y up, z forward) in a frame with x forward, y left, z up."""


def _glow(lamp: str, vertices: Array, faces: npt.NDArray[np.int64]) -> float:
    """Return the radiance of a lamp's surface in the scenes' unit."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area_vectors = np.cross(b - a, c - a) / 2.0
    if lamp in ALWAYS_ON:
        luminance = ALWAYS_ON[lamp]
    elif lamp == "street_lamp":
        luminance = STREET_LAMP_FLUX / (np.pi * np.linalg.norm(area_vectors, axis=1).sum())
    elif lamp == "indicator":  # where its faces look most
        luminance = INDICATOR_INTENSITY / (np.abs(area_vectors).sum(axis=0).max() / 2.0)
    else:  # two lamps, seen from along x
        luminance = _GLOW_INTENSITY[lamp] / (np.abs(area_vectors[:, 0]).sum() / 2.0 / 2.0)
    return luminance / UNIT_LUMINANCE


def _mounts(vertices: Array) -> dict[str, Pose]:
    """Return the poses of the left and the right beam: just before the lamp's surface, looking along +x."""
    mounts = {}
    for side, chosen in (("left", vertices[:, 1] > 0.0), ("right", vertices[:, 1] <= 0.0)):
        half = vertices[chosen] if chosen.any() else vertices
        centre = 0.5 * (half.min(axis=0) + half.max(axis=0))
        mounts[side] = Pose(np.array([half[:, 0].max() + 0.02, centre[1], centre[2]]))
    return mounts
