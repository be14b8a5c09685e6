"""Parts that lie in one plane: touching is fine, overlapping is reported."""

from __future__ import annotations

import warnings

import pytest

import scarl_sionna as ss
from scarl_sionna.engine.rays.overlap import overlapping_parts, seen_overlaps
from tests.scenes import Thing, plane, write_scene

NORMAL = (-1, 0, 0)


def _world(folder, *things):
    return ss.load_scene(write_scene(folder, instances=[Thing(name, mesh, material="steel") for name, mesh in things]))


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        ((5.0, 0.0, 0.0), True),  # a sticker within the plate
        ((5.0, 0.6, 0.0), True),  # over its edge
        ((5.0, 0.65, 0.0), False),  # beside it, edge to edge
        ((5.0, 3.0, 0.0), False),
        ((4.9999, 0.0, 0.0), False),  # 0.1 mm in front
    ],
)
def test_overlapping_parts(tmp_path, place, expected) -> None:
    world = _world(tmp_path, ("plate", plane(1.0, 1.0, (5, 0, 0), NORMAL)), ("sticker", plane(0.3, 0.3, place, NORMAL)))
    assert [(o.first, o.second) for o in overlapping_parts(world)] == ([(0, 1)] if expected else [])
    assert len(seen_overlaps(world.at(0.0), (0.0, 0.0, 0.0))) == expected
    assert not seen_overlaps(world.at(0.0), (10.0, 5.0, 0.0)) or expected


def test_the_same_body_twice_is_no_overlap(tmp_path) -> None:
    """Faces with the corners of another scatter once."""
    assert not overlapping_parts(_world(tmp_path, ("one", plane(1.0, 1.0)), ("other", plane(1.0, 1.0))))


def test_two_sides_of_a_sheet_are_no_overlap(tmp_path) -> None:
    front, back = plane(1.0, 1.0, (5, 0, 0), NORMAL), plane(1.0, 1.0, (5, 0, 0), NORMAL)
    back.invert()
    assert overlapping_parts(_world(tmp_path, ("front", front), ("back", back))) == ()


def test_sbr_tells_of_it_once(tmp_path) -> None:
    world = _world(
        tmp_path, ("plate", plane(1.0, 1.0, (5, 0, 0), NORMAL)), ("sticker", plane(0.3, 0.3, (5, 0, 0), NORMAL))
    )
    radar = ss.RadarSpec.preset("awr1843boost")
    with pytest.warns(
        ss.ScarlWarning, match="overlap in one plane, such as 'shape-plate' and 'shape-sticker'"
    ) as reported:
        ss.solve_paths(world.at(0.0), radar, ss.Pose(), method="sbr")
    assert sum("overlap in one plane" in str(one.message) for one in reported) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ss.solve_paths(world.at(0.0), radar, ss.Pose(), method="sbr", instances=["plate"])


@pytest.mark.some(1)
@pytest.mark.parametrize("name", ["highway_guardrail", "urban_crossing"])
def test_no_overlap_is_seen_in_the_scenes_of_the_package(name) -> None:
    world = ss.load_scene(name)
    state, parts = world.at(1.0), world.parts
    objects = {info.instance for info in world.instances.values() if info.is_object}
    for ahead, left in ((3.0, 0.0), (-3.5, 0.0), (10.0, 2.5), (0.0, 4.0)):
        where = state.actor_pose("ego").apply([ahead, left, 1.0])
        seen = [
            (parts.name[o.first], parts.name[o.second])
            for o in seen_overlaps(state, where)
            if {int(parts.instance[o.first]), int(parts.instance[o.second])} <= objects
        ]
        assert not seen
