"""Bodies of meshes, and how finely tubes are probed for them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from scarl_sionna.core.pose import Pose
from scarl_sionna.engine.device import device
from scarl_sionna.engine.smooth.creases import connected_faces
from scarl_sionna.radar.optics.tubes.narrow import MOST_BODIES, SHARE, NarrowBodies
from scarl_sionna.radar.optics.tubes.spacings import NearBodies, Spacings
from scarl_sionna.radar.optics.tubes.tube_shape import halved
from tests.scenes import box

BAR = box((0.03, 0.03, 2.5), (0.0, 0.0, 0.0))


def _widths(bodies: NarrowBodies) -> list[float]:
    single = bodies.behind == np.arange(len(bodies.behind)) + 1
    return np.unique(bodies.width[single].round(6)).tolist()


def _spacing(bodies: NarrowBodies, x: float, y: float, is_way_in: bool) -> float:
    """Return the distance of probes of a footprint 0.2 m wide, lit from the origin, a metre apart unless said."""
    footprint = np.array([[[x, y, 0.0], [x, y + 0.2, 0.0], [x, y, 0.2]]])
    source = np.zeros(3) if is_way_in else np.array([2.0 * x, 0.0, 0.0])
    with device("radio") as on:
        return float(bodies.spacing(on, footprint, source, (np.ones(1), np.zeros(1)), is_way_in)[0])


def test_what_hangs_together_is_a_body() -> None:
    mesh = trimesh.util.concatenate([BAR, box((1.0, 1.0, 1.0), (2.0, 0.0, 0.0))])
    label = connected_faces(np.asarray(mesh.triangles))
    assert len(set(label[:12])) == len(set(label[12:])) == 1
    assert label[0] != label[12]


@pytest.mark.parametrize("axis", [(1, 0, 0), (1, 1, 0)])
def test_a_bar_is_as_wide_as_it_is_however_it_is_turned(axis: tuple[int, int, int]) -> None:
    mesh = BAR.copy()
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.7, axis))
    mesh = trimesh.util.concatenate([mesh, box((1.0, 1.5, 2.0), (5.0, 0.0, 0.0))])
    bar, other = _widths(NarrowBodies.of_mesh(np.asarray(mesh.triangles)))
    assert 0.03 <= bar <= 0.03 * np.sqrt(2.0)  # a square has no principal axes: up to its diagonal
    assert other == pytest.approx(1.5)


def test_a_gap_between_bars_is_as_narrow_as_it_is() -> None:
    """So that a gap has a probe; one through which hardly anything is seen needs none."""
    for pitch, width in ((0.2, 0.03), (0.04, 0.01), (0.031, 0.03)):
        bars = [box((0.03, 0.03, 2.5), (0.0, pitch * number, 0.01 * number)) for number in range(3)]
        mesh = trimesh.util.concatenate(bars)
        for found in _widths(NarrowBodies.of_mesh(np.asarray(mesh.triangles))):
            assert found == pytest.approx(width, abs=0.003), pitch


def test_balls_hold_what_is_in_them() -> None:
    places = np.random.default_rng(1).uniform(-5.0, 5.0, (40, 3))
    mesh = trimesh.util.concatenate([box((0.1, 0.2, 0.5), place) for place in places])
    pose = Pose.from_euler([3.0, 2.0, 1.0], yaw=0.4)
    others = [NarrowBodies.of_mesh(np.asarray(mesh.triangles[: 12 * number])) for number in (1, 3)]
    many = NarrowBodies.of_mesh(np.asarray(mesh.triangles))
    bodies = NarrowBodies.of_parts([(many, pose), *((other, Pose()) for other in others), (many, Pose())])
    single = np.flatnonzero(bodies.behind == np.arange(len(bodies.behind)) + 1)
    for number, behind in enumerate(bodies.behind):
        held = single[(single >= number) & (single < behind)]
        away = np.linalg.norm(bodies.center[held] - bodies.center[number], axis=1)
        assert (away + bodies.radius[held] <= bodies.radius[number] * (1.0 + 1e-12)).all()
        assert bodies.width[number] == bodies.width[held].min()
    points = pose.apply(np.asarray(mesh.vertices))
    away = np.linalg.norm(points[:, None] - bodies.center[single], axis=2)
    assert (away <= bodies.radius[single] * (1.0 + 1e-9)).any(axis=1).all()


def test_probes_are_as_fine_as_the_shadow_of_a_bar() -> None:
    bar = NarrowBodies.of_parts([(NarrowBodies.of_mesh(np.asarray(BAR.triangles)), Pose([5.0, 0.1, 0.0]))])
    assert _spacing(bar, 20.0, 0.3, is_way_in=True) == pytest.approx(SHARE * 0.03 * 4.0, rel=0.01)
    assert _spacing(bar, 20.0, 3.0, is_way_in=True) == 1.0  # beside it
    assert _spacing(bar, 4.0, 0.0, is_way_in=True) == 1.0  # before it
    assert _spacing(bar, 4.0, 0.0, is_way_in=False) == 1.0  # behind the face that reflects
    assert _spacing(bar, 8.0, 0.0, is_way_in=False) == pytest.approx(SHARE * 0.03 * 8.0 / 11.0, rel=0.01)


def test_pieces_of_a_footprint_are_probed_finely_only_before_the_bar() -> None:
    """A footprint of 8 m at 20 m, a bar before its left end: the half at the right is as coarse as it would be."""
    bar = NarrowBodies.of_parts([(NarrowBodies.of_mesh(np.asarray(BAR.triangles)), Pose([15.0, -2.8, 0.0]))])
    whole = np.array([[[20.0, -4.0, -0.1], [20.0, 4.0, -0.1], [20.0, 0.0, 0.2]]])
    one = np.ones(1)
    with device("radio") as on:
        near = NearBodies(on, bar, True, np.zeros((1, 3)), one, one / 12.0)
        spacings = Spacings.beside(near, whole, 0.5 * one)
        halves = halved(whole)
        rows = np.zeros(2, dtype=np.int64)
        wide = spacings.of_pieces(halves, rows, np.tile(spacings.wide, 2))
        again = spacings.of_pieces(halves, rows, wide)
    left = halves.mean(axis=1)[:, 1].argmin()
    assert spacings.wide[0] == pytest.approx(1.0 / 12.0)  # 0.7 * 0.03 * 20 / 15 is less
    assert wide[left] == pytest.approx(1.0 / 12.0)
    assert wide[1 - left] == 1.0
    assert np.array_equal(spacings.are_near(rows, wide), [left])
    assert np.array_equal(again, wide)
    assert spacings.fine == 0.5
    assert spacings.plain == one


def test_leaves_count_as_one_body() -> None:
    leaf = np.array([[[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]]])
    leaves = np.concatenate([leaf + [0.0, 0.0, 0.2 * k] for k in range(MOST_BODIES + 1)])
    assert len(NarrowBodies.of_mesh(leaves).radius) <= 1
    assert len(_widths(NarrowBodies.of_mesh(leaves[:50]))) == 1


def test_no_bodies() -> None:
    nothing = NarrowBodies.of_parts([])
    assert _spacing(nothing, 20.0, 0.0, is_way_in=True) == 1.0
    assert not len(NarrowBodies.of_mesh(np.zeros((0, 3, 3))).radius)
