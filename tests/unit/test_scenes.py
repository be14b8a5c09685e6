"""Every scene of the package.

Classes, lanes, actors on the ground and apart, variants and light levels, the same bytes again.
"""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.engine.rays.overlap import overlapping_parts
from scenes_xml import cache_folder, scene_names, scene_path
from tests.plan_view import overlap

pytestmark = pytest.mark.own_process(shared=True)  # beside what a worker has already, it would pass the bound of memory

SCENES = scene_names()
FIRST = ("highway_guardrail", "urban_crossing")
"""The two scenes whose variant 0 has cars and people of meshes of its own; those have tests of their own."""
NEW = tuple(name for name in SCENES if name not in FIRST)
ALL = (*NEW, *(pytest.param(name, marks=pytest.mark.slow) for name in FIRST))
"""The default run loads the same three for all tests, none of the first two."""
TIMES = np.linspace(0.0, 8.0, 17)
KINDS = {
    "roundabout": {"Roads", "RoadLine", "SideWalks", "Terrain", "Building", "Vegetation", "Pole", "TrafficSign"},
    "suburban_street": {"Roads", "SideWalks", "Terrain", "Building", "Vegetation", "Pole", "Fence", "TrafficSign"},
    "country_road": {"Roads", "RoadLine", "Terrain", "Vegetation", "Pole", "Fence", "GuardRail", "Building"},
}
"""Classes that make a place what it is."""
HOVER = 0.02
"""Largest distance of an actor's origin from the ground below it [m]."""


@lru_cache(maxsize=1)
def world_of(name: str) -> ss.World:
    return ss.load_scene(name)


def _actors(world: ss.World) -> set[int]:
    """Return the instances that move."""
    names = {actor.name for actor in world.actors}
    return {info.instance for info in world.instances.values() if info.name in names}


def _triangles(path: Path) -> tuple[int, int]:
    """Return the numbers of shapes and of triangles of a scene's own meshes."""
    import xml.etree.ElementTree as ET

    shapes = ET.parse(path).getroot().findall("shape")
    total = 0
    for shape in shapes:
        file = path.parent / shape.find("string").get("value")
        header = file.read_bytes()[:600].split(b"end_header")[0].decode()
        total += int(header.split("element face ")[1].split()[0])
    return len(shapes), total


@pytest.mark.some(3)
@pytest.mark.parametrize("name", NEW, scope="module")
def test_a_scene_has_what_makes_its_kind_of_place(name):
    world = world_of(name)
    found = {SEMANTIC_CLASSES[info.semantic] for info in world.instances.values()}
    assert KINDS.get(name, set()) <= found
    assert world.ego == "ego" and len(world.actors) >= 4
    shapes, _ = _triangles(scene_path(name))
    assert shapes < 350
    size = sum(
        file.stat().st_size
        for file in scene_path(name).parent.rglob("*")
        if file.suffix in (".ply", ".png", ".xml", ".toml")
    )
    assert size < 5e6


@pytest.mark.some(3)
@pytest.mark.parametrize("name", ALL, scope="module")
def test_lanes_are_a_network_and_lie_on_the_ground(name):
    world = world_of(name)
    network = world.document.lanes  # joints (0.1 m, 5 deg) were checked when it was made
    assert network is not None and network.of_kind("drive")
    state = world.at(0.0)
    actors = _actors(world)
    starts = np.concatenate([lane.points[:: max(1, len(lane.points) // 12)] for lane in network.lanes])
    starts = starts + [0.0, 0.0, 0.8]
    gap = _ray_down(state, starts, actors) - 0.8
    assert np.abs(gap[np.isfinite(gap)]).max() < 0.03
    assert np.isfinite(gap).mean() > 0.9  # below a standing or parked actor the ray starts inside a body


def _ray_down(state, starts, actors):
    """Return the distance down to what is no actor [m]; inf where an actor lies in between."""
    hits = state.cast(starts, np.tile([0.0, 0.0, -1.0], (len(starts), 1)))
    gap = np.full(len(starts), np.inf)
    owner = {part: info.instance for info in state.world.instances.values() for part in info.parts}
    keep = np.array([owner[int(part)] not in actors for part in hits.part], bool)
    gap[hits.ray[keep]] = hits.distance[keep]
    return gap


@pytest.mark.some(3)
@pytest.mark.parametrize("name", NEW, scope="module")
def test_actors_stand_on_the_ground(name):
    """A ray down from 5 cm above the origin of each actor, below its bodywork, in a world without its actors."""
    world = world_of(name)
    for time in TIMES[::8]:
        state = world.at(time)
        actors = _actors(world)
        places = np.array([state.actor_pose(actor.name).position for actor in world.actors])
        gap = _ray_down(state, places + [0.0, 0.0, 0.05], actors) - 0.05
        free = np.isfinite(gap)  # a walker's foot may stand between
        names = [actor.name for actor in world.actors]
        assert np.abs(gap[free]).max() < HOVER, (
            time,
            dict(zip(np.array(names)[free], gap[free].round(3), strict=True)),
        )
        assert free.mean() > 0.5


@pytest.mark.some(3)
@pytest.mark.parametrize("name", ALL, scope="module")
def test_nobody_runs_into_anybody_or_into_a_wall(name):
    world = world_of(name)
    for time in TIMES:
        boxes = [box for box in world.at(time).boxes() if box.is_actor or _is_solid(box)]
        for first in (box for box in boxes if box.is_actor):
            for second in boxes:
                assert second.instance == first.instance or not overlap(first, second), (
                    first.name,
                    second.name,
                    float(time),
                )


def _is_solid(box) -> bool:
    """Return whether a thing that stands fills its box and is no longer than a car.

    Not crowns, arms of lamps, or what bends.
    """
    return bool(
        box.size[:2].max() < 6.0
        and SEMANTIC_CLASSES[box.semantic] in ("Car", "Static", "Dynamic", "TrafficSign", "Motorcycle", "Bicycle")
        and box.world_from_box.position[2] - box.size[2] / 2 < 2.0
    )


@pytest.mark.some(3)
@pytest.mark.slow
@pytest.mark.parametrize("name", NEW, scope="module")
def test_no_two_parts_of_the_place_overlap_in_a_plane(name):
    world = world_of(name)
    owner = {part: info for info in world.instances.values() for part in info.parts}
    found = {
        (owner[o.first].name, owner[o.second].name)
        for o in overlapping_parts(world)
        if owner[o.first].instance not in _actors(world)
    }
    assert not found


@pytest.mark.some(3)
@pytest.mark.slow
@pytest.mark.parametrize("name", NEW, scope="module")
def test_a_radar_of_the_ego_car_sees_the_others(name):
    world = world_of(name)
    state = world.at(1.0)
    front = state.actor_pose("ego").compose(ss.Pose([2.36, 0.0, 0.6], [1.0, 0.0, 0.0, 0.0]))
    paths = ss.solve_paths(
        state, ss.RadarSpec.preset("awr1843boost"), front, method="raycast", num_rays=100_000, hits_per_cell=None
    )
    seen = set(np.unique(paths.instance[:, 0]))
    others = _actors(world) - {next(info.instance for info in world.instances.values() if info.name == "ego")}
    assert others & seen


@pytest.mark.some(3)
@pytest.mark.parametrize("name", ALL, scope="module")
def test_motion_is_smooth(name):
    """Accelerations of cars stay within what tyres give (9 m/s2), and nobody jumps."""
    world = world_of(name)
    times = np.linspace(0.0, 8.0, 161)
    for actor in world.actors:
        velocity = np.array([actor.trajectory.twist(time).linear for time in times])
        assert np.linalg.norm(velocity, axis=1).max() < 60.0
        assert np.linalg.norm(np.diff(velocity, axis=0) / np.diff(times)[:, None], axis=1).max() < 9.0, actor.name


def _builder(name: str):
    return importlib.import_module(f"scenes_xml.{name}.build")


@pytest.fixture(scope="module")
def cache_root(tmp_path_factory):
    """A cache folder of this module's own."""
    before = os.environ.get("SCARL_CACHE_DIR")
    os.environ["SCARL_CACHE_DIR"] = str(tmp_path_factory.mktemp("cache"))
    yield cache_folder()
    if before is None:
        del os.environ["SCARL_CACHE_DIR"]
    else:
        os.environ["SCARL_CACHE_DIR"] = before


@pytest.mark.some(3)
@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES, scope="module")
def test_the_light_level_has_fewer_shapes_and_triangles(name, cache_root):
    light, detailed = _triangles(scene_path(name, 0, "light")), _triangles(scene_path(name))
    assert light[0] < (150 if name == "suburban_street" else 120)  # its many trees have leaf cards and a core: 141
    assert light[0] < 0.6 * detailed[0] and light[1] < 0.5 * detailed[1]


@pytest.mark.some(3)
@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES, scope="module")
def test_variants_are_other_places_of_the_same_kind(name, cache_root):
    first, second = scene_path(name, 1), scene_path(name, 2)
    assert first.read_bytes() != second.read_bytes() != scene_path(name).read_bytes()
    lanes = [ss.load_scene(str(path)).document.lanes for path in (first, second)]
    assert not all(
        np.array_equal(a.points, b.points) for a, b in zip(*(network.lanes for network in lanes), strict=False)
    )


@pytest.mark.some(2)
@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES, scope="module")
@pytest.mark.parametrize(("variant", "detail"), [(1, "detailed"), (5, "light")])
def test_a_variant_passes_what_the_scene_passes(name, variant, detail, cache_root, monkeypatch):
    world = ss.load_scene(name, variant=variant, detail=detail)
    monkeypatch.setitem(globals(), "world_of", lambda _: world)
    for check in (
        test_lanes_are_a_network_and_lie_on_the_ground,
        test_actors_stand_on_the_ground,
        test_nobody_runs_into_anybody_or_into_a_wall,
        test_no_two_parts_of_the_place_overlap_in_a_plane,
        test_motion_is_smooth,
    ):
        check(name)


def test_a_variant_is_built_once_and_atomically(cache_root):
    path = scene_path(NEW[0], 3, "light")
    assert path.is_file() and path.is_relative_to(cache_root)
    stamp = path.stat().st_mtime_ns
    assert scene_path(NEW[0], 3, "light") == path and path.stat().st_mtime_ns == stamp
    assert not [folder for folder in path.parent.parent.iterdir() if folder.name.startswith(".")]


@pytest.mark.slow
def test_two_processes_may_build_the_same_variant(tmp_path):
    code = f"from scenes_xml import scene_path; print(scene_path({NEW[0]!r}, 4, 'light'))"
    environment = os.environ | {"SCARL_CACHE_DIR": str(tmp_path)}
    both = [
        subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, env=environment, text=True)
        for _ in range(2)
    ]
    paths = {process.communicate(timeout=120)[0].strip() for process in both}
    assert [process.returncode for process in both] == [0, 0] and len(paths) == 1
    assert len(list((tmp_path / "scenes").iterdir())) == 1


def test_what_cannot_be_built_says_so(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="whole numbers from 0"):
        scene_path(NEW[0], -1)
    with pytest.raises(ValueError, match="detailed and light"):
        scene_path(NEW[0], 0, "coarse")
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    monkeypatch.setenv("SCARL_CACHE_DIR", str(blocked))
    with pytest.raises(OSError, match="SCARL_CACHE_DIR"):
        scene_path(NEW[0], 6, "light")


def test_a_full_disk_leaves_nothing_behind(tmp_path, monkeypatch):
    def full(folder: Path, variant: int, detail: str) -> None:
        (folder / "half").write_text("written before the disk was full")
        raise OSError(28, "No space left on device")

    monkeypatch.setenv("SCARL_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(_builder(NEW[0]), "build", full)
    with pytest.raises(OSError, match="No space left on device; free space there"):
        scene_path(NEW[0], 6, "light")
    assert not list((tmp_path / "scenes").iterdir())
