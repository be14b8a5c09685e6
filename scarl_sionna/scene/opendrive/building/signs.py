"""Signs and traffic lights of a map: masts, heads that show what their group shows at time 0, plates by number."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from PIL import Image

from scenes_xml.generators.geometry.mesh import Mesh, merge
from scenes_xml.generators.kit import Prefab, SceneKit
from scenes_xml.generators.roadside import furniture, traffic_light
from scenes_xml.generators.surfaces.interior import limit

from ..geometry.road import RoadShape
from ..model import Finding, MapSignal, StreetMap
from ..network.lights import Lights

HEAD = 2.3
"""Height of a head's lower edge and, about, of a sign's middle where the file states none [m]."""
_CASE = {"case": "black_plastic", "red": "signal_red_off", "amber": "signal_amber_off", "green": "signal_green_off"}
_METAL = {"back": "sign_back", "pole": "galvanized_steel"}
_SIGNS = {
    "205": ("triangle", "sign_yield"), "215": ("round", "sign_roundabout"), "350": ("square", "sign_walkers"),
    "293": ("square", "sign_crossing"), "222": ("round", "sign_keep_right"), "103": ("triangle", "sign_bend"),
}  # fmt: skip # a table
"""Number of a sign in the German catalogue -> its form and face."""
_SPEED = ("274", "274.1", "speedLimit", "maximumSpeed")


def add_signals(
    kit: SceneKit, street: StreetMap, shapes: Mapping[str, RoadShape], lights: Lights, findings: list[Finding]
) -> None:
    """Add all signs and traffic lights to a scene."""
    ready: dict[str, Prefab] = {}
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
                _add_light(kit, ready, name, signal, foot, yaw, _shown(lights, group))
            else:
                _add_sign(kit, ready, name, signal, foot, yaw, findings)


def _shown(lights: Lights, group: str | None) -> dict[str, str]:
    """Return the lit lens of a group at time 0."""
    if group is None or lights.signals is None:
        return {}
    if lights.signals.is_green(group, 0.0):
        return {"green": "signal_green_on"}
    return {"red": "signal_red_on"}


def _add_light(
    kit: SceneKit,
    ready: dict[str, Prefab],
    name: str,
    signal: MapSignal,
    foot: np.ndarray,
    yaw: float,
    shown: dict[str, str],
) -> None:
    if "head" not in ready:
        ready["head"] = kit.prefab("signal_head", traffic_light.head(kit.is_light), _CASE)
        pole = merge([Mesh(m.vertices, m.faces) for m in traffic_light.mast().values()])
        ready["post"] = kit.prefab("signal_post", {"pole": pole}, {"pole": "grey_steel"})
    up = signal.z if signal.z > 0.5 else HEAD
    back = np.array([np.cos(np.radians(yaw)), np.sin(np.radians(yaw)), 0.0])
    kit.place(
        ready["head"], f"{name}_head", "TrafficLight", foot + [0.0, 0.0, up] - 0.12 * back, yaw, 1.0, True, **shown
    )
    if up < 4.0:
        kit.place(ready["post"], f"{name}_post", "Pole", foot, yaw, scale=(up + 1.1) / 3.4)


def _add_sign(
    kit: SceneKit,
    ready: dict[str, Prefab],
    name: str,
    signal: MapSignal,
    foot: np.ndarray,
    yaw: float,
    findings: list[Finding],
) -> None:
    form, face = _face(kit, signal)
    if not face:
        findings.append(Finding(signal.line, f"sign of type '{signal.kind}' has a blank face"))
        face = "white_plastic"
    up = signal.z if signal.z > 0.8 else HEAD
    key = f"sign_{form}_{face}_{up:.2f}".replace(".", "_")
    if key not in ready:
        ready[key] = kit.prefab(key, kit.slim(furniture.sign(form, up), "back", "pole"), {"face": face, **_METAL})
    kit.place(ready[key], name, "TrafficSign", foot, yaw)


def _face(kit: SceneKit, signal: MapSignal) -> tuple[str, str]:
    """Return form and material of a sign; the material is empty where no picture is known."""
    value = signal.value if signal.value is not None else _number(signal.subkind)
    if signal.kind in _SPEED and value is not None and 0.0 < value < 200.0:
        text = f"{value:.0f}"
        name = f"sign_limit_{text}"
        kit.materials.setdefault(name, replace(kit.materials["sign_50"], texture=f"{name}.png"))
        kit.textures.setdefault(f"{name}.png", partial(_limit_sign, text))
        return "round", name
    return _SIGNS.get(signal.kind, ("square", ""))


def _limit_sign(text: str, seed: int) -> Image.Image:
    return limit(text)


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
