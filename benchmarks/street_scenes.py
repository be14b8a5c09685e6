"""Random problems of the whole-street chart: fields of bodies on a ground, and frames of the ready scenes."""

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
    """Make the problem of a seed: ``"field"`` or ``"street"``."""
    if kind == "street":
        yield street(seed)
        return
    with tempfile.TemporaryDirectory() as folder:
        yield bodies(seed, Path(folder))


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
