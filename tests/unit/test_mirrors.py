"""Mirrors of a scene: which flat regions there are, the ways over them, and where those may lead."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel.compose.mirrors import (
    Mirror,
    _Planes,
    faces_towards,
    find_mirrors,
    mirrored,
    reaches,
    ways,
)
from tests.scenes import Thing, plane, write_scene

WAVELENGTH = 0.004


def level(number: int, z: float, normal: float = 1.0) -> Mirror:
    """Return a level mirror over x from 0 to 10 and y from -1 to 1, 2 m wide."""
    corners = np.array([(0.0, -1.0, z), (10.0, -1.0, z), (10.0, 1.0, z), (0.0, 1.0, z)])[[0, 1, 2, 0, 2, 3]]
    return Mirror(number, 0, np.arange(2), np.array([0.0, 0.0, normal]), normal * z, corners, 2.0)


FLOOR, CEILING = level(0, 0.0), level(1, 3.0, -1.0)
HERE = np.array([1.0, 0.0, 1.0])


def test_ways_are_all_orders_without_the_same_mirror_twice_in_a_row() -> None:
    found = [tuple(mirror.number for mirror in way) for way in ways([FLOOR, CEILING], 3)]
    assert found == [(), (0,), (1,), (0, 1), (1, 0), (0, 1, 0), (1, 0, 1)]
    assert list(ways([FLOOR, CEILING], 0)) == [()] == list(ways([], 2))
    assert len(list(ways([FLOOR, CEILING, level(2, 5.0)], 2))) == 1 + 3 + 6


def test_the_image_of_the_radar_goes_through_one_mirror_after_the_other() -> None:
    assert mirrored((), HERE).tolist() == [1.0, 0.0, 1.0]
    assert mirrored((FLOOR,), HERE).tolist() == [1.0, 0.0, -1.0]
    assert mirrored((CEILING,), HERE).tolist() == [1.0, 0.0, 5.0]
    assert mirrored((FLOOR, CEILING), HERE).tolist() == [1.0, 0.0, 7.0]  # -1, then 3 + (3 + 1)
    assert mirrored((CEILING, FLOOR), HERE).tolist() == [1.0, 0.0, -5.0]


@pytest.mark.parametrize(
    ("way", "point", "reached"),
    [
        ((FLOOR,), (9.0, 0.0, 1.0), True),  # it meets the floor at x = 5
        ((FLOOR,), (19.0, 0.0, 1.0), True),  # at 10, its end
        ((FLOOR,), (19.3, 0.0, 1.0), True),  # at 10.15: boxes are widened by a tenth of 2 m
        ((FLOOR,), (20.0, 0.0, 1.0), False),  # at 10.5
        ((FLOOR,), (5.0, 2.3, 1.0), True),  # at y = 1.15
        ((FLOOR,), (5.0, 3.0, 1.0), False),  # at y = 1.5
        ((FLOOR,), (9.0, 0.0, -1.0), False),  # behind the mirror
        ((CEILING,), (9.0, 0.0, 1.0), True),
        ((CEILING,), (9.0, 0.0, 5.0), False),
        ((FLOOR, CEILING), (9.0, 0.0, 1.0), True),  # floor after 1/6, ceiling after 2/3 of 8 m
        ((FLOOR, CEILING), (25.0, 0.0, 1.0), False),  # ceiling at x = 17
        ((), (9.0, 9.0, 9.0), True),
    ],
)
def test_a_way_reaches_what_lies_before_its_mirrors_and_over_them(way, point, reached) -> None:
    assert reaches(way, HERE, np.array([point])).tolist() == [reached]
    aside = (1.0, 500.0, 1.5) if way else point
    assert reaches(way, HERE, np.array([aside, point])).tolist() == [not way and reached, reached]


def test_flat_regions_wider_than_their_fresnel_zone_are_mirrors_the_largest_first(tmp_path) -> None:
    corners = np.array([[4.0, 5.0, -1.0], [8.0, 5.0, -1.0], [4.0, 5.0, 3.0]])
    things = [
        Thing("one_face", trimesh.Trimesh(corners, [(0, 1, 2)], process=False), "Wall"),
        Thing("road", plane(20.0, 6.0, (10, 0, -1)), "Roads", is_object=False),
        # their nearest corners are 2.83 m away, where the zone is sqrt(2 * 0.004 * 2.83) = 0.1504 m
        Thing("narrow", plane(0.148, 4.0, (-2, 0, 0), (1, 0, 0)), "Wall"),
        Thing("wide", plane(0.153, 4.0, (0, -2, 0), (0, 1, 0)), "Wall"),
        Thing("not_asked_for", plane(9.0, 9.0, (0, 0, 9), (0, 0, -1)), "Wall"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    number = {item.name: key for key, item in state.world.instances.items()}
    asked = [number[name] for name in ("one_face", "road", "narrow", "wide")]
    found = find_mirrors(state, asked, np.zeros(3), WAVELENGTH)
    names = [state.world.instances[int(state.world.parts.instance[mirror.part])].name for mirror in found]
    assert names == ["road", "one_face", "wide"] and [mirror.number for mirror in found] == [0, 1, 2]
    assert [len(mirror.faces) for mirror in found] == [2, 1, 2]
    extents = [6.0, 4.0 / 2.0**0.5, 0.153]  # of the right-angled triangle: its height
    assert [mirror.extent for mirror in found] == pytest.approx(extents, rel=1e-5)
    for mirror, axis, place in zip(found, (2, 1, 1), (-1.0, 5.0, -2.0), strict=True):
        assert abs(mirror.normal[axis]) == pytest.approx(1.0) and mirror.offset == pytest.approx(
            place * mirror.normal[axis]
        )
        assert np.abs(mirror.height(mirror.corners)).max() < 1e-6


def facets(seed: int, count: int = 300) -> trimesh.Trimesh:
    """Return triangles of many sizes, each in a plane of its own, around a place that is not the radar's."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-1.5, 1.0, (count, 1, 1))
    corners = rng.uniform(-30.0, 30.0, (count, 1, 3)) + [35.0, 0.0, 0.0] + size * rng.normal(size=(count, 3, 3))
    return trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), process=False)


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    """One body of facets that stands still, one that an actor carries."""
    moving = Thing("moving", facets(1), "Car", trajectory={"kind": "static", "position": [1.0, 2.0, 0.0]})
    path = write_scene(tmp_path_factory.mktemp("many"), [Thing("still", facets(0), "Wall")], [moving])
    return load_scene(path).at(0.0)


@pytest.mark.parametrize("asked", [[1], [2], [1, 2]])
def test_planes_are_sorted_out_by_their_boxes_alone_where_they_are_too_small(many, asked) -> None:
    planes, rows = _Planes.of(many, asked)
    corners = many._triangles.of_parts([part for number in asked for part in many.world.instances[number].parts])
    assert len(rows) == len(corners) and np.all(np.diff(planes.area[rows]) <= 0.0)
    found, zone = planes.larger_than_zone(rows, many._triangles, HERE, WAVELENGTH)
    nearest = np.linalg.norm(corners - HERE, axis=2).min(axis=1)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2.0
    large = area >= 2.0 * WAVELENGTH * nearest
    assert 0.1 < large.mean() < 0.9
    expected = np.flatnonzero(large)[np.argsort(-area[large], kind="stable")]
    np.testing.assert_allclose(planes.area[found], area[expected], rtol=1e-12)
    np.testing.assert_allclose(zone, np.sqrt(2.0 * WAVELENGTH * nearest[expected]), rtol=1e-12)


def test_the_largest_planes_towards_boxes_are_the_first_of_all(many, monkeypatch) -> None:
    boxes = [np.array([[20.0, 5.0, 1.0]]) + np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])]
    every = faces_towards(many, [1], HERE, boxes, 0.1, 1000)
    assert 8 < len(every) < 300
    monkeypatch.setattr("scarl_sionna.radar.channel.compose.mirrors._COMPARED", 7)
    for most in (1, 5, len(every) + 1):
        np.testing.assert_array_equal(faces_towards(many, [1], HERE, boxes, 0.1, most), every[:most])
    assert not len(faces_towards(many, [1], HERE, [], 0.1, 5))
