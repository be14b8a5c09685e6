"""Random problems of the whole-street chart: fields of bodies, crowds of vehicles, and frames of the ready scenes."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

import scarl_sionna as ss
from scarl_sionna.engine.world import WorldState
from tests.scenes import Material, Thing, ball, box, plane, write_scene

PLACES = (
    "highway_guardrail",
    "urban_crossing",
    "roundabout",
    "country_road",
    "suburban_street",
    "signalised_crossing",
    "motorway",
    "tunnel",
    "parking_garage",
)


@dataclass(frozen=True, eq=False)
class Street:
    """A radar in a scene."""

    name: str
    state: WorldState
    mount: ss.Mount
    reach: float


@contextmanager
def problem(kind: str, seed: int) -> Iterator[Street]:
    """Make the problem of a seed: ``"field"``, ``"crowd"`` or ``"street"``."""
    if kind == "street":
        yield street(seed)
        return
    with tempfile.TemporaryDirectory() as folder:
        yield (crowd if kind == "crowd" else bodies)(seed, Path(folder))


def street(seed: int) -> Street:
    """Return a frame of a ready scene: place, time and height of the radar by the seed."""
    rng = np.random.default_rng([2, seed])
    name = PLACES[seed % len(PLACES)]
    time = float(np.round(rng.uniform(0.0, 6.0), 2))
    state = ss.load_scene(name).at(time)
    height = float(np.round(rng.uniform(0.4, 1.0), 2))
    mount = state.mount("ego", ss.Pose([3.8, 0.0, height]))
    return Street(f"{name} at {time:g} s", state, mount, 30.0)


def bodies(seed: int, folder: Path) -> Street:
    """Return 4 to 14 bodies on a ground of asphalt or concrete, in two of three cases beside a wall."""
    rng = np.random.default_rng([1, seed])
    ground = str(rng.choice(["asphalt", "concrete", "steel"], p=[0.5, 0.4, 0.1]))
    things = [Thing("ground", plane(160.0, 60.0, (60, 0, 0)), "Roads", ground, is_object=False)]
    if rng.uniform() < 2.0 / 3.0:
        side = float(rng.choice([-1.0, 1.0]))
        length, start = rng.uniform(15.0, 60.0), rng.uniform(2.0, 20.0)
        wall = box((length, 0.2, 5.0), (start + length / 2.0, 17.0 * side, 2.6))
        things.append(Thing("wall", wall, "Wall", str(rng.choice(["concrete", "steel"]))))
    places: list[np.ndarray] = []
    for number in range(int(rng.integers(4, 15))):
        for _ in range(50):
            place = np.array([rng.uniform(6.0, 60.0), rng.uniform(-13.0, 13.0)])
            if all(np.linalg.norm(place - other) > 5.0 for other in places):
                places.append(place)
                things += list(_body(number, place, rng))
                break
    materials = {name: Material(radio=name) for name in ("asphalt", "concrete")}
    state = ss.load_scene(write_scene(folder, things, materials=materials)).at(0.0)
    pose = ss.Pose([0.0, 0.0, float(rng.uniform(0.4, 1.2))])
    return Street(f"field {seed}", state, state.as_mount(pose), 80.0)


LANES = (-7.0, -3.5, 0.0, 3.5, 7.0)
"""Middles of the lanes of a crowd [m]."""
CROWDED = 45.0
"""Where a crowd ends [m]."""


def crowd(seed: int, folder: Path) -> Street:
    """Return five lanes of dense traffic, 20 to 30 cars, vans and lorries with a recess in the rear, half of it hidden.

    In a third of the problems the outer lanes are parked across the way, in another third there is a wall.
    """
    rng = np.random.default_rng([3, seed])
    ground, kind = str(rng.choice(["asphalt", "concrete"])), int(rng.integers(3))
    things = [Thing("ground", plane(160.0, 60.0, (60, 0, 0)), "Roads", ground, is_object=False)]
    if kind == 2:
        things.append(Thing("wall", box((60.0, 0.2, 5.0), (36.0, 12.0, 2.6)), "Wall", "concrete"))
    for lane in LANES:
        across = kind == 1 and abs(lane) > 5.0
        start = rng.uniform(7.0, 12.0)
        while start < CROWDED:
            what = str(rng.choice(["car", "van", "lorry"], p=[0.75, 0.1, 0.15])) if not across else "car"
            mesh = _VEHICLES[what](rng)
            length = 2.2 if across else float(mesh.extents[0])
            turn = rng.normal(0.0, np.radians(2.0)) + np.pi / 2.0 * (across * np.sign(lane))
            if what == "car" and rng.uniform() < 0.5:
                turn += np.pi
            name = f"{what}_{len(things)}"
            mesh = _turned(mesh, turn, start + length / 2.0, lane + rng.uniform(-0.2, 0.2))
            things.append(Thing(name, mesh, "Truck" if what == "lorry" else "Car", "steel"))
            start += length + (rng.uniform(0.5, 1.5) if across else rng.uniform(1.0, 6.0))
    materials = {name: Material(radio=name) for name in ("asphalt", "concrete")}
    state = ss.load_scene(write_scene(folder, things, materials=materials)).at(0.0)
    pose = ss.Pose([0.0, 0.0, float(rng.uniform(0.4, 1.2))])
    return Street(f"crowd {seed}", state, state.as_mount(pose), 60.0)


def _car(rng: np.random.Generator) -> trimesh.Trimesh:
    """Return a body and a cabin with sloped sides, the nose ahead, the middle of its length at the origin."""
    length, width = rng.uniform([3.8, 1.7], [4.9, 1.9])
    body = box((length, width, 0.6), (0.0, 0.0, 0.55))
    low = [(x * length, y * width, 0.8) for x in (-0.42, 0.25) for y in (-0.48, 0.48)]
    high = [(x * length, y * width, rng.uniform(1.4, 1.6)) for x in (-0.32, 0.08) for y in (-0.38, 0.38)]
    return trimesh.util.concatenate([body, trimesh.Trimesh([*low, *high], process=False).convex_hull])


def _van(rng: np.random.Generator) -> trimesh.Trimesh:
    """Return a box."""
    size = rng.uniform([4.8, 1.9, 1.8], [6.0, 2.1, 2.4])
    return box(size, (0.0, 0.0, size[2] / 2.0 + 0.3))


def _lorry(rng: np.random.Generator) -> trimesh.Trimesh:
    """Return a lorry with a recess at a random place of its rear."""
    width, height, depth = rng.uniform([0.3, 0.3, 0.15], [0.8, 0.8, 0.5])
    left, low = rng.uniform([-1.1, 0.6], [1.1 - width, 3.3 - height])
    mesh = lorry_with_a_recess((left, left + width), (low, low + height), depth)
    mesh.apply_translation([-mesh.extents[0] / 2.0, 0.0, 0.0])
    return mesh


_VEHICLES = {"car": _car, "van": _van, "lorry": _lorry}


def lorry_with_a_recess(across: tuple[float, float], up: tuple[float, float], depth: float) -> trimesh.Trimesh:
    """Return a lorry whose rear, in the plane x = 0 from y = -1.25 to 1.25 and z = 0.5 to 3.5, has a niche.

    Parameters
    ----------
    across, up : tuple of float
        From and to in y and in z [m].
    depth : float
        [m], over 0.05.
    """
    (left, right), (low, high), thick = across, up, 0.05
    back = depth + thick
    corners = [
        ((0.0, -1.25, 0.5), (thick, left, 3.5)),  # the rear wall around the opening
        ((0.0, right, 0.5), (thick, 1.25, 3.5)),
        ((0.0, left, 0.5), (thick, right, low)),
        ((0.0, left, high), (thick, right, 3.5)),
        ((depth, left - thick, low - thick), (back, right + thick, high + thick)),  # the niche
        ((thick, left - thick, low - thick), (depth, left, high + thick)),
        ((thick, right, low - thick), (depth, right + thick, high + thick)),
        ((thick, left, low - thick), (depth, right, low)),
        ((thick, left, high), (depth, right, high + thick)),
        ((depth + 0.1, -1.25, 0.5), (8.0, 1.25, 3.5)),  # the body
    ]
    return trimesh.util.concatenate([box(np.subtract(end, start), np.add(start, end) / 2.0) for start, end in corners])


def _body(number: int, place: np.ndarray, rng: np.random.Generator) -> Iterator[Thing]:
    kind = str(rng.choice(["box", "corner", "post", "ball", "sign", "dihedral"]))
    name, turn = f"{kind}_{number}", rng.uniform(0.0, 2.0 * np.pi)
    x, y = place
    if kind == "box":
        size = rng.uniform([2.0, 1.2, 1.0], [4.0, 2.0, 2.4])
        yield Thing(name, _turned(box(size, (0, 0, size[2] / 2.0 + 0.3)), turn, x, y), "Car", "steel")
    elif kind == "dihedral":
        for part, more in (("a", 0.0), ("b", np.pi / 2.0)):
            wall = box((2.0, 0.2, 2.0), (1.1, 0.0, 1.1))
            yield Thing(f"{name}{part}", _turned(wall, turn + more, x, y), "Static", "steel")
    elif kind == "corner":
        size = rng.uniform(0.05, 0.3)
        points = size * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
        mesh = trimesh.Trimesh(points, [(0, 1, 2), (0, 2, 3), (0, 3, 1)], process=False)
        toward = np.array([-x, -y, 0.0]) / np.hypot(x, y) + 0.3 * rng.normal(size=3)
        mesh.apply_transform(trimesh.geometry.align_vectors(np.ones(3) / np.sqrt(3.0), toward))
        mesh.apply_translation([x, y, rng.uniform(0.5, 1.5)])
        yield Thing(name, mesh, "Static", "steel")
    elif kind == "post":
        height = rng.uniform(1.0, 3.0)
        mesh = trimesh.creation.cylinder(rng.uniform(0.05, 0.2), height, sections=48)
        mesh.apply_translation([x, y, height / 2.0])
        yield Thing(name, mesh, "Pole", "steel")
    elif kind == "ball":
        radius = rng.uniform(0.1, 0.4)
        yield Thing(name, ball(radius, (x, y, radius + rng.uniform(0.0, 1.0)), 5), "Static", "steel")
    else:
        normal = np.array([-x, -y, 0.0]) / np.hypot(x, y) + 0.1 * rng.normal(size=3)
        mesh = plane(*rng.uniform(0.3, 1.0, 2), (x, y, rng.uniform(1.2, 2.5)), normal)
        yield Thing(name, mesh, "TrafficSign", "steel")


def _turned(mesh: trimesh.Trimesh, turn: float, x: float, y: float) -> trimesh.Trimesh:
    mesh.apply_transform(trimesh.transformations.rotation_matrix(turn, (0, 0, 1)))
    mesh.apply_translation([x, y, 0.0])
    return mesh
