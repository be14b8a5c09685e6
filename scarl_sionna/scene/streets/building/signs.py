"""Signs and traffic lights of a map: masts, heads that show what their group shows, plates by number."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from PIL import Image

from scarl_sionna.scene.lanes import SIGNAL_COLORS
from scenes_xml.generators.geometry.mesh import Mesh, merge
from scenes_xml.generators.kit import Prefab, SceneKit
from scenes_xml.generators.roadside import furniture, traffic_light
from scenes_xml.generators.surfaces.interior import limit

from ..geometry.road import RoadShape
from ..model import Array, Finding, MapSignal, StreetMap
from ..network.lights import Lights

HEAD = 2.3
"""Height of a head's lower edge and, about, of a sign's middle where the file states none [m]."""
_OVERHEAD = 4.0
_CASE = {"case": "black_plastic", "red": "signal_red_off", "amber": "signal_amber_off", "green": "signal_green_off"}
_LENSES = {color: f"signal_{color}" for color in SIGNAL_COLORS}
"""Materials of the lenses of a head that stays dark, and of one that a group of lights switches."""
_METAL = {"back": "sign_back", "pole": "galvanized_steel"}
_SIGNS = {
    "205": ("triangle", "sign_yield"), "215": ("round", "sign_roundabout"), "350": ("square", "sign_walkers"),
    "293": ("square", "sign_crossing"), "222": ("round", "sign_keep_right"), "103": ("triangle", "sign_bend"),
}  # fmt: skip # a table
"""Number of a sign in the German catalogue -> its form and face."""
SPEED = ("274", "274.1", "speedLimit", "maximumSpeed")
"""Types of signs that limit the speed."""


def add_signals(
    kit: SceneKit, street: StreetMap, shapes: Mapping[str, RoadShape], lights: Lights, findings: list[Finding]
) -> dict[str, str]:
    """Add all signs and traffic lights to a scene and return the instance of each light's head, by the light's id."""
    stand = _Stand(kit, findings)
    heads: dict[str, str] = {}
    count = 0
    for road in street.roads.values():
        for signal in road.signals:
            shape, name = shapes[road.id], f"signal_{count}"
            count += 1
            yaw = float(np.degrees(float(shape.heading(signal.s)) + signal.heading))
            yaw += 180.0 if signal.orientation == "-" else 0.0
            foot = shape.point(signal.s, signal.t)
            if signal.is_dynamic:
                group = lights.of_signal.get((road.id, signal.id))
                if group is None:
                    findings.append(Finding(signal.line, "a traffic light stops no lane; it stays dark"))
                heads.setdefault(signal.id, stand.light(name, signal, foot, yaw, group))
            else:
                stand.sign(name, signal, foot, yaw)
    return heads


class _Stand:
    """Puts signs and lights up; each kind's meshes are written once."""

    def __init__(self, kit: SceneKit, findings: list[Finding]) -> None:
        self.kit, self.findings = kit, findings
        self._ready: dict[str, Prefab] = {}

    def light(self, name: str, signal: MapSignal, foot: Array, yaw: float, group: str | None) -> str:
        """Add a head, on a post unless it hangs over the road; returns its name."""
        kit = self.kit
        if "head" not in self._ready:
            self._ready["head"] = kit.prefab("signal_head", traffic_light.head(kit.is_light), _CASE)
            pole = merge([Mesh(m.vertices, m.faces) for m in traffic_light.mast().values()])
            self._ready["post"] = kit.prefab("signal_post", {"pole": pole}, {"pole": "grey_steel"})
        up = signal.z if signal.z > 0.5 else HEAD
        back = np.array([np.cos(np.radians(yaw)), np.sin(np.radians(yaw)), 0.0])
        place = foot + [0.0, 0.0, up] - 0.12 * back
        lenses = {} if group is None else _LENSES
        kit.place(self._ready["head"], f"{name}_head", "TrafficLight", place, yaw, 1.0, True, group, **lenses)
        if up < _OVERHEAD:
            kit.place(self._ready["post"], f"{name}_post", "Pole", foot, yaw, scale=(up + 1.1) / 3.4)
        return f"{name}_head"

    def sign(self, name: str, signal: MapSignal, foot: Array, yaw: float) -> None:
        """Add a sign on its pole."""
        form, face = _face(self.kit, signal)
        if not face:
            self.findings.append(Finding(signal.line, f"sign of type '{signal.kind}' has a blank face"))
            face = "white_plastic"
        up = signal.z if signal.z > 0.8 else HEAD
        key = f"sign_{form}_{face}_{up:.2f}".replace(".", "_")
        if key not in self._ready:
            parts = self.kit.slim(furniture.sign(form, up), "back", "pole")
            self._ready[key] = self.kit.prefab(key, parts, {"face": face, **_METAL})
        self.kit.place(self._ready[key], name, "TrafficSign", foot, yaw)


def _face(kit: SceneKit, signal: MapSignal) -> tuple[str, str]:
    """Return form and material of a sign; the material is empty where no picture is known."""
    value = signal.value if signal.value is not None else _number(signal.subkind)
    if signal.kind in SPEED and value is not None and 0.0 < value < 200.0:
        return "round", limit_face(kit, f"{value:.0f}")
    return _SIGNS.get(signal.kind, ("square", ""))


def limit_face(kit: SceneKit, text: str) -> str:
    """Return the material of a limit of speed with a text, which is drawn where it is the first."""
    name = f"sign_limit_{text}"
    kit.materials.setdefault(name, replace(kit.materials["sign_50"], texture=f"{name}.png"))
    kit.textures.setdefault(f"{name}.png", partial(_limit_sign, text))
    return name


def _limit_sign(text: str, seed: int) -> Image.Image:
    return limit(text)


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
