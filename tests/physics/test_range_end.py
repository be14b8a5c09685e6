"""What passes the end of the range goes out smoothly, straight and over mirrors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.radar.channel.band_mean import band_power
from scarl_sionna.radar.channel.compose.expected_error import owners
from scarl_sionna.radar.channel.range_end import LONGEST_FADE, fade_of, within_reach
from scarl_sionna.radar.point_scatterers import PointScatterers
from scarl_sionna.radar.points import solve_points
from scarl_sionna.radar.scatterers.model import ScattererModel
from tests.scenes import Thing, ball, box, write_scene

RADAR = ss.RadarSpec(azimuth_fov_deg=140.0)


@pytest.mark.parametrize("reach", [9.9, 12.6])
def test_a_body_passes_the_end_of_the_range_without_a_jump(tmp_path, reach):
    """A ball of 0.3 m at 10 m, straight, and its ghost over a wall at 6 m with one straight leg, 12.6 m.

    With a sharp end the echo of a ball is cut through at the end; it changed by 1 dB in 1 mm there, 75 dB at the first.
    """
    things = [
        Thing("ball", ball(0.3, (10.0, 0.0, 0.6), 4), "Static", "steel"),
        Thing("wall", box((40.0, 0.2, 8.0), (12.0, 6.0, 0.0)), "Wall", "steel"),
    ]
    state = ss.load_scene(write_scene(tmp_path, things)).at(0.0)
    number = next(key for key, info in state.world.instances.items() if info.name == "ball")
    plan = ss.ChannelPlan((ss.Share("sbr", ("ball",), {"max_depth": 1}, True),), ("wall",), echoes=False)

    def level_db(x: float) -> float:
        paths = ss.solve_paths(state, RADAR, ss.Pose([x, 0.0, 0.6]), "hybrid", plan=plan, max_distance=reach)
        rows = np.flatnonzero(owners(paths, [number]) == number)
        power = band_power(paths, RADAR, rows, np.zeros(len(rows), dtype=np.int64), 1, 32)
        return float(10.0 * np.log10(power[0] + 1e-30))

    inside = level_db(0.3)
    places = np.arange(-0.19, 0.06, 0.02)
    before, after = (np.array([level_db(x + step) for x in places]) for step in (0.0, 1e-3))
    counts = after > inside - 35.0
    # sin^2 rises by pi / d cot(pi x / 2 d) of its field a metre: at -35 dB, x = 0.085 d, by 0.8 dB in 1 mm
    slope = np.pi / LONGEST_FADE / np.tan(0.085 * np.pi / 2.0)
    assert np.abs(after - before)[counts].max() < 20.0 / np.log(10.0) * slope * 1e-3
    assert counts.sum() >= 8
    assert np.all(np.diff(before) > 0.0)  # it rises all along: nothing radiates at the end


FEW = ss.SionnaSettings(num_samples=20_000, max_depth=1)
ASIDE = ss.Pose([0.0, 1.0, 0.0])
MODEL = ScattererModel(
    np.zeros((1, 3)), np.array([-np.pi, 0.0]), np.zeros(1), np.ones((1, 2, 1, 2, 2), complex), 77e9, 0.1, 0.0, np.pi
)


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """A plate of 1 m, 10 m ahead."""
    things = [Thing("plate", box((0.1, 1.0, 1.0), (10.05, 0.0, 0.0)), "Static", "steel")]
    return ss.load_scene(write_scene(tmp_path_factory.mktemp("plate"), things)).at(0.0)


def solved(method, receiver=None, pose=None, **fields):
    def solve(state, reach):
        place = ss.Pose() if pose is None else pose
        return ss.solve_paths(state, RADAR, place, method, receiver=receiver, max_distance=reach, **fields)

    return solve


def points(state, reach):
    some = PointScatterers([[10.0, 0.0, 2.0], [10.05, 0.0, 2.0]], [[0.0] * 3] * 2, [1.0, 2.0])
    return solve_points(state, RADAR, ss.Pose(), some, sionna=FEW, max_distance=reach)


def one_way(state, reach):
    settings = ss.RadarSettings(sionna=FEW, max_distance=reach)
    return ss.one_way_paths(RADAR, ss.Pose(), ss.Pose([0.0, 15.0, 0.0]), state, settings)


SOLVES = {
    "raycast": solved("raycast", num_rays=20_000, raycast={"hits_per_cell": None}),
    "sbr": solved("sbr", instances=["plate"], floor_db=None),
    "sbr, a pair": solved("sbr", ASIDE, instances=["plate"], floor_db=None),
    "sionna": solved("sionna", sionna=FEW),
    "sionna, a pair": solved("sionna", ASIDE, sionna=FEW),
    "scatterers": solved("scatterers", models={"plate": MODEL}, placements={"plate": ss.Pose([10.0, 0.0, 0.0])}),
    "images": solved("hybrid", plan=ss.ChannelPlan((), ("plate",), chains="images")),
    "hybrid": solved("hybrid", plan=ss.ChannelPlan((ss.Share("sbr", ("plate",)),), (), echoes=False)),
    "auto": solved("auto"),
    "points": points,
    "one way": one_way,
}


@pytest.mark.parametrize("solve", SOLVES.values(), ids=SOLVES)
def test_every_solver_ends_alike_and_once(plate, solve):
    whole = solve(plate, 40.0)
    reach = float(whole.length[whole.length > 10.0].min()) / 2.0 + 0.1  # a pair has its straight path, too
    found = solve(plate, reach)
    before = reach - whole.length / 2.0
    weight = np.sin(np.pi / 2.0 * np.clip(before / LONGEST_FADE, 0.0, 1.0)) ** 2
    assert 0.0 < weight[whole.length > 10.0].max() < 0.4
    faded = whole.scaled(weight).select(before > 0.0)
    # rounding: lengths to 1e-14 of 20 m, of 0.25 m
    assert np.allclose(found.a, faded.a, rtol=1e-10, atol=1e-12 * np.abs(whole.a).max())


def test_without_a_distance_the_range_of_the_radar_ends_so(plate):
    pose = ss.Pose([10.1 - RADAR.max_range, 0.0, 0.0])
    whole, found = (
        solved("sbr", pose=pose, instances=["plate"])(plate, reach) for reach in (2 * RADAR.max_range, None)
    )
    nearest = whole.length.argmin()
    # 0.4 of the depth before the end; the centre of the nearest patch is less than 1 mm behind the plate's middle
    assert abs(found.a[nearest, 0, 0] / whole.a[nearest, 0, 0]) == pytest.approx(np.sin(0.2 * np.pi) ** 2, rel=0.02)


@pytest.mark.parametrize(("distance", "reach"), [(0.4, 0.5), (0.1, 0.15)])
def test_short_ranges_end_shortly(tmp_path, distance, reach):
    """A hand at 0.4 m was 9 dB too weak with a range of 0.5 m, without a word."""
    hand = ball(0.02, (distance + 0.02, 0.0, 0.0), 3)
    state = ss.load_scene(write_scene(tmp_path, [Thing("hand", hand, "Static", "steel")])).at(0.0)
    assert reach - fade_of(reach) > distance + 0.02
    short, long = (solved("sbr", instances=["hand"])(state, one) for one in (reach, 5.0))
    assert np.array_equal(short.a, long.a) and short.num_paths > 0


def test_auto_judges_echoes_as_they_are_returned(tmp_path):
    """A ball that goes out at the end of the range is below the noise: it was judged by its whole echo."""
    thing = Thing("ball", ball(0.1, (20.1, 0.0, 0.6), 4), "Static", "steel")
    state = ss.load_scene(write_scene(tmp_path, [thing])).at(0.0)
    counted = []
    for reach in (30.0, 20.01):
        paths = ss.solve_paths(state, RADAR, ss.Pose([0.0, 0.0, 0.6]), "auto", max_distance=reach)
        counted.append(paths.diagnostics["num_counted"])
    assert counted == [1, 0]


def test_a_path_and_its_reverse_go_out_alike(plate):
    """To the last bit: what is the copy of a path is known by that."""
    pair = SOLVES["sbr, a pair"](plate, 40.0)
    between = replace(pair, inner_length=np.random.default_rng(0).uniform(0.1, 5.0, pair.num_paths))
    ended, back = within_reach(between, 12.0), within_reach(between.reversed(), 12.0).reversed()
    assert 0 < ended.num_paths < pair.num_paths
    assert np.array_equal(ended.a, back.a)
