"""Models of people and two-wheelers.

What the files say agrees with their geometry, feet and wheels stand on the ground.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from scarl_sionna.engine.world import World
from scarl_sionna.scene.materials.table import load_materials
from scarl_sionna.scene.motion.gait import SEGMENTS
from scarl_sionna.scene.motion.pedalling import PEDALLING_SEGMENTS
from scenes_xml import actor_path
from scenes_xml.actors.bodies import family
from scenes_xml.actors.build import build
from tests.actor_scenes import NAMES, actor_table, actor_world

SPEED = {
    "adult_man": 1.4,
    "adult_woman": 1.3,
    "child": 1.1,
    "standing_adult": 0.0,
    "bicycle": 5.0,
    "scooter": 5.0,
    "motorcycle": 12.0,
}


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """A world of a model at a level of detail, loaded once."""
    worlds: dict[tuple[str, str], World] = {}

    def get(model: str, detail: str) -> World:
        if (model, detail) not in worlds:
            worlds[model, detail] = drive(tmp_path_factory.mktemp(f"{model}_{detail}"), model, detail)
        return worlds[model, detail]

    return get


def drive(folder, model: str, detail: str) -> World:
    """Write and load a world in which a model moves along x."""
    motion = {"kind": "constant_twist", "position": [0.0, 0.0, 0.0], "velocity": [SPEED[model], 0.0, 0.0]}
    return actor_world(folder, model, motion, detail)


def corners(world: World, time: float) -> np.ndarray:
    """All vertices of the actor at a time, in its own frame, shape (n, 3)."""
    state = world.at(time)
    points = [state.part_pose(part).apply(world.mesh(part).vertices) for part in range(len(world.parts.name))]
    return np.concatenate(points) - [state.actor_pose("it").position[0], 0.0, 0.0]


@pytest.mark.parametrize("model", NAMES)
def test_files_are_small_and_name_known_materials(model):
    folder = actor_path(model).parent
    assert sum(file.stat().st_size for file in folder.rglob("*") if file.is_file()) < 700_000
    table, radio = actor_table(model), load_materials()
    for name, material in table["materials"].items():
        assert material["radio"] in radio, name
        assert 0.0 < material["lidar_reflectance"] < 1.0
    assert len(table["variants"]) >= 3
    for colors in table["variants"].values():
        assert set(colors) <= set(table["materials"])
        assert all(0.0 <= value <= 1.0 for rgb in colors.values() for value in rgb)
    counts = {}
    for suffix in ("", "_light"):
        root = ET.parse(folder / f"{model}{suffix}.xml").getroot()
        ids = [shape.get("id") for shape in root.findall("shape")] + [bsdf.get("id") for bsdf in root.findall("bsdf")]
        assert len(set(ids)) == len(ids)
        counts[suffix] = len(root.findall("shape"))
    assert counts["_light"] <= counts[""]


@pytest.mark.some(5)
@pytest.mark.parametrize("model", NAMES)
@pytest.mark.parametrize("detail", ["detailed", "light"])
def test_measures_and_ground(driven, model, detail):
    """Nothing is below the ground by more than 2 mm, something stands on it, and the box is as stated."""
    world = driven(model, detail)
    table = actor_table(model)["actor"]
    boxes = [corners(world, time) for time in (np.linspace(0.0, 1.1, 24) if table["motion"] != "stand" else (0.0,))]
    lowest, highest = min(box[:, 2].min() for box in boxes), max(box[:, 2].max() for box in boxes)
    assert -2e-3 < lowest < 8e-3
    assert highest == pytest.approx(table["height"], abs=0.05)
    size = np.max([box.max(axis=0) - box.min(axis=0) for box in boxes], axis=0)
    assert size[0] == pytest.approx(table["length"], abs=0.08)
    assert size[1] == pytest.approx(table["width"], abs=0.08)


@pytest.mark.parametrize("model", ["adult_man", "child", "bicycle"])
@pytest.mark.parametrize("detail", ["detailed", "light"])
def test_every_segment_has_a_shape(driven, model, detail):
    world = driven(model, detail)
    segments = PEDALLING_SEGMENTS if model == "bicycle" else SEGMENTS
    for segment in segments:
        assert any(name == f"it_{segment}" or name.startswith(f"it_{segment}_") for name in world.parts.name), segment
    assert sum(isinstance(joint.shapes, dict) for joint in world.actor("it").joints) == 1


def test_the_soles_stay_on_the_pedals(driven):
    """All around, the lowest points of a shoe near the ball of the foot lie on the pedal's upper side within 3 mm."""
    world = driven("bicycle", "detailed")
    names = list(world.parts.name)
    for time in np.linspace(0.0, 1.0, 9):
        state = world.at(time)
        for side in ("left", "right"):
            pedal, foot = names.index(f"it_{side}_pedal"), names.index(f"it_{side}_foot")
            sole = state.part_pose(pedal).inverse().compose(state.part_pose(foot)).apply(world.mesh(foot).vertices)
            under = sole[np.abs(sole[:, 0]) < 0.06]
            assert under[:, 2].min() == pytest.approx(world.mesh(pedal).vertices[:, 2].max(), abs=3e-3)
            assert np.abs(under[:, 1]).max() < 0.06  # above the pedal, not beside it


def test_a_second_run_gives_the_same_bytes(tmp_path):
    for model, write in (("adult_woman", family.build), ("bicycle", build)):
        write(model, tmp_path / model)
        for file in sorted((tmp_path / model).rglob("*.*")):
            assert file.read_bytes() == (actor_path(model).parent / file.relative_to(tmp_path / model)).read_bytes(), (
                file.name
            )
