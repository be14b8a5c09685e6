"""Bicycles without riders, parked on their stands."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ..geometry.mesh import Mesh, merge, tube
from ..kit import SceneKit
from ..surfaces import interior
from ..vehicles.cycles import bicycle

LEAN = np.radians(5.0)
FRAMES = ("paint_green", "paint_red", "paint_blue", "black_plastic", "white_plastic")
"""Colours of frames."""
LOOKS = {"paint": "paint_green", "trim": "black_plastic", "tyre": "tyre_rubber", "headlamp": "white_plastic",
         "taillamp": "black_plastic"}  # fmt: skip # a table
"""Material of each role of a bicycle's parts; the others are ``grey_steel``."""


def parked_bicycle(is_light: bool = False) -> dict[str, Mesh]:
    """Return a bicycle on its stand, which leans a little to the left, x along it: a mesh for each material."""
    shape = bicycle.BicycleShape()
    at = {"cranks": (shape.axle[0], 0.0, shape.axle[1])}
    at |= {
        f"{side}_pedal": (shape.axle[0] + sign * shape.crank, sign * shape.foot_y, shape.axle[1])
        for side, sign in (("left", 1.0), ("right", -1.0))
    }
    parts: dict[str, list[Mesh]] = {"grey_steel": []}
    stand = tube(np.array([[-0.1, 0.05, 0.28], [-0.18, 0.22, 0.022]]), 0.008, 6)
    for name, (mesh, look) in bicycle.build(shape, is_light).items():
        moved = mesh.moved(at.get(name, (0.0, 0.0, 0.0)))
        parts.setdefault(LOOKS.get(look, "grey_steel"), []).append(Mesh(moved.vertices, moved.faces))
    parts["grey_steel"].append(Mesh(stand.vertices, stand.faces))
    cos, sin = np.cos(LEAN), np.sin(LEAN)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]])
    meshes = {name: merge(own) for name, own in parts.items()}
    return {name: Mesh(mesh.vertices @ turn, mesh.faces) for name, mesh in meshes.items()}


def place_bicycles(
    kit: SceneKit, places: Iterable[tuple[Sequence[float], float]], generator: np.random.Generator
) -> None:
    """Park bicycles at places: foot (3,) [m] and heading [deg]; frames have several colours.

    None at the light level.
    """
    if kit.is_light:
        return
    kit.materials = interior.MATERIALS | kit.materials
    parts = parked_bicycle(is_light=True)
    thing = kit.prefab("parked_bicycle", parts, {name: name for name in parts})
    for number, (where, yaw) in enumerate(places):
        frame = {"paint_green": str(generator.choice(FRAMES))}
        kit.place(thing, f"parked_bicycle_{number}", "Bicycle", where, yaw, **frame)
