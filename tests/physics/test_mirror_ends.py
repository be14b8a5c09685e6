"""Echoes near the end of a mirror: Fresnel's integral against Kirchhoff's, and no jump as things move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from scarl_sionna.core.arrays.order import side_by_side
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.mirrors import MirrorSettings
from scarl_sionna.core.settings.plan import Reflection
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import ChannelPlan, Share, plan_channel, solve_paths
from scarl_sionna.radar.channel.compose.mirror_legs import MirrorView
from scarl_sionna.radar.channel.compose.mirrors import find_mirrors
from scarl_sionna.radar.channel.multipath import mirror_ends
from scarl_sionna.radar.optics.edges.fresnel_ends import beyond_straight_end
from tests.oracles.kirchhoff import share_of_half_plane
from tests.scenes import Thing, ball, box, plane, write_scene

RADAR = RadarSpec(azimuth_fov_deg=160.0, elevation_fov_deg=60.0)
WALL, END = 3.0, 8.0
"""Plane y = 3 of the wall, and where it ends along x [m]."""
BALL = np.array([14.6, 0.5, 0.0])
KNOBS = SbrSettings(max_phase=2.0, max_depth=1, floor_db=None)
PLAN = ChannelPlan((Share("sbr", ("ball",), KNOBS, through_mirrors=True),), ("wall",), echoes=False)
WAY = 2.0 * WALL - BALL[1]
"""From the radar across the wall to the ball's image [m]."""


def world(tmp_path, end: float = END):
    """Return a wall that ends at x = `end`, and a ball of 5 cm in front of it and farther on."""
    wall = box((end + 6.0, 0.2, 8.0), ((end - 6.0) / 2.0, WALL + 0.1, 0.0))
    things = [Thing("wall", wall, "Wall", "steel"), Thing("ball", ball(0.05, BALL, 4), "Static", "steel")]
    return load_scene(write_scene(tmp_path, things)).at(0.0)


def fields(state, ahead: float, end_reach: float, plan: ChannelPlan = PLAN) -> dict[int, complex]:
    """Return the field of paths by their number of reflections at the wall, from a radar `ahead` metres on."""
    pose = Pose([ahead, 0.0, 0.0])
    paths = solve_paths(state, RADAR, pose, "hybrid", plan=plan, mirrors=MirrorSettings(end_reach=end_reach))
    wave = paths.a[:, 0, 0] * np.exp(-2j * np.pi / RADAR.wavelength * paths.length)
    count = (paths.instance == 1).sum(axis=1)
    return {number: complex(wave[count == number].sum()) for number in range(3)}


@pytest.fixture(scope="module")
def ends(tmp_path_factory):
    """Return the state with the wall that ends, and the same with one that goes on."""
    return world(tmp_path_factory.mktemp("short")), world(tmp_path_factory.mktemp("long"), END + 8.0)


def units_beyond(ahead: float) -> float:
    """Return how far beyond the wall's end the reflection at it is [Fresnel units]."""
    across, length = BALL[0] - ahead, float(np.hypot(BALL[0] - ahead, WAY))
    before = length * WALL / WAY
    unit = np.sqrt(RADAR.wavelength / 2.0 / (1.0 / before + 1.0 / (length - before))) * length / WAY
    return float((ahead + across * WALL / WAY - END) / unit)


@pytest.mark.parametrize("ahead", [-1.2, 0.05, 0.5, 1.1])
def test_an_echo_near_the_end_of_a_wall_is_that_of_kirchhoffs_integral(ends, ahead: float) -> None:
    """From 2.1 Fresnel units on the wall to 2.1 beyond it, one way over it and both; half of the field at its end.

    The ball's own echo is that over the long wall, so only the end is compared. It shines where its normal halves the
    directions: of both ways over the wall within 1 mm of the line to its middle, of one way 2 cm beside it, where the
    field is up to 0.05 another. Both ways differ by 0.02 at most, 0.2 dB of the field of the wall.
    """
    short, long = fields(ends[0], ahead, 4.0), fields(ends[1], ahead, 0.0)
    expected = share_of_half_plane((ahead, WALL), (BALL[0], WALL - BALL[1]), END, RADAR.wavelength)
    assert short[0] == pytest.approx(long[0], rel=1e-9)  # the straight way has no end
    assert abs(short[1] / long[1] - expected) < 0.05
    assert abs(short[2] / long[2] - expected**2) < 0.025


def test_a_weight_counts_once_for_each_leg_over_the_mirror(ends) -> None:
    over = Reflection(("ball",), ("wall",), ((0.25,),))
    plan = replace(PLAN, shares=(replace(PLAN.shares[0], reflections=(over,)),))
    whole, less = (fields(ends[1], 0.0, 4.0, one) for one in (PLAN, plan))
    for legs in range(3):
        assert less[legs] == pytest.approx(0.25**legs * whole[legs], rel=1e-9)


def test_planning_adds_no_jump_where_a_pavement_shows_the_foot_of_a_post(tmp_path) -> None:
    """The radar moves on by 11 m; where the plan has other mirrors than 1 mm before, both give nearly the same echo.

    The foot of the post makes a corner with the pavement, whose edge is 0.5 m before it: what is seen of the post over
    the pavement is little, but it is what shines.
    """
    post = trimesh.creation.cylinder(0.1, 3.0, sections=48)
    post.apply_translation([20.0, 0.0, 1.62])
    things = [
        Thing("road", plane(60.0, 30.0, (15.0, 0.0, 0.0)), "Roads", "steel", is_object=False),
        Thing("pavement", box((10.0, 20.0, 0.12), (24.4, 0.0, 0.06)), "SideWalks", "steel", is_object=False),
        Thing("post", post, "Pole", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    plans: dict[int, ChannelPlan] = {}

    def pose(step: int) -> Pose:
        return Pose([1e-3 * step, 0.0, 0.9])

    def plan(step: int) -> ChannelPlan:
        if step not in plans:
            plans[step] = plan_channel(state, RadarSpec(), pose(step), channel_tolerance_db=3.0, tube_budget=10**9)
        return plans[step]

    def mirrors(step: int) -> set[int]:
        return {number for share in plan(step).shares for item in share.reflections for number in item.mirrors}

    def level_db(step: int, one: ChannelPlan) -> float:
        paths = solve_paths(state, RadarSpec(), pose(step), "hybrid", plan=replace(one, echoes=False))
        paths = paths.select((paths.instance == 3).any(axis=1))
        wave = paths.a[:, 0, 0] * np.exp(-2j * np.pi / RADAR.wavelength * paths.length)
        return float(20.0 * np.log10(abs(wave.sum())))

    changed = 0
    for low in range(5_000, 16_000, 500):
        high = low + 500
        if mirrors(low) == mirrors(high):
            continue
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if mirrors(middle) == mirrors(low) else (low, middle)
        changed += 1
        assert level_db(high, plan(low)) == pytest.approx(level_db(high, plan(high)), abs=0.5)
    assert changed


def test_sharp_ends_are_image_theory(ends) -> None:
    for ahead, seen in ((-0.4, True), (0.5, False)):
        short, long = fields(ends[0], ahead, 0.0), fields(ends[1], ahead, 0.0)
        assert short[2] == (pytest.approx(long[2], rel=1e-6) if seen else 0.0)


@pytest.mark.parametrize("beyond", [0.0, 4.0])
def test_no_jump_where_a_reflection_leaves_the_mirror_or_ends(ends, beyond: float) -> None:
    """The radar moves on by 5 mm over the wall's end, and over where the reflection is no longer followed.

    Kirchhoff's integral changes by 0.3 dB there; without the weight the first one is 20 dB.
    """
    low, high = -1.0, 3.0
    while high - low > 1e-4:  # the radar's place where the reflection is that far beyond the end
        middle = (low + high) / 2.0
        low, high = (middle, high) if units_beyond(middle) < beyond else (low, middle)
    found = [fields(ends[0], low + step, 4.0) for step in (-0.0025, 0.0025)]
    straight = abs(found[0][0])
    levels = [20.0 * np.log10(straight + abs(one[1]) + abs(one[2])) for one in found]
    assert abs(levels[1] - levels[0]) < 0.3
    if beyond:
        assert abs(found[1][1]) < 2e-3 * straight


def test_the_wall_itself_fades_beyond_its_end(ends) -> None:
    """What the radar sees of itself in the wall: half of the field abreast of its end, then less and less."""
    plan = ChannelPlan((Share("raycast", ()),), ("wall",), chains="images")
    for ahead in (7.9, END, 8.15):
        pose = Pose.from_heading([ahead, 0.0, 0.0], np.pi / 2.0)
        short, long = (solve_paths(state, RADAR, pose, "hybrid", plan=plan) for state in ends)
        expected = share_of_half_plane((ahead, WALL), (ahead, WALL), END, RADAR.wavelength)
        assert short.num_paths == long.num_paths == 1
        assert abs(short.a[0, 0, 0] / long.a[0, 0, 0] - expected) < 4e-3


@pytest.mark.parametrize("max_phase", [3.0, 1.0, 0.2])
def test_a_plate_seen_over_the_end_of_a_wall_is_the_integral_over_it(tmp_path, max_phase: float) -> None:
    """A plate stands at a wall that ends before it: a Fresnel unit is some centimetres, a patch half a metre."""
    radar, wall, end = np.array([-17.0, -1.75, 0.5]), -4.9, -1.0
    knobs = SbrSettings(max_phase=max_phase, max_depth=1, floor_db=None)
    plan = ChannelPlan((Share("sbr", ("plate",), knobs, through_mirrors=True),), ("wall",), echoes=False)
    found = []
    for wall_end in (end, 20.0):
        things = [
            Thing("plate", plane(0.6, 0.6, (0.0, -4.55, 3.0), (-1, 0, 0)), "TrafficSign", "steel"),
            Thing("wall", plane(8.0, 60.0, (wall_end - 30.0, wall, 3.5), (0, 1, 0)), "Wall", "steel"),
        ]
        state = load_scene(write_scene(tmp_path / f"{wall_end:g}", things)).at(0.0)
        paths = solve_paths(state, RADAR, Pose(radar), "hybrid", plan=plan)
        wave = paths.a[:, 0, 0] * np.exp(-2j * np.pi / RADAR.wavelength * paths.length)
        number = {state.world.instances[one].name: one for one in state.world.instances}
        way = number["plate"], number["wall"]
        found.append(abs(wave[[tuple(row[row >= 0]) == way for row in paths.instance]].sum()))

    step, image = 5e-4, np.array([radar[0], 2.0 * wall - radar[1], radar[2]])
    middle = np.arange(-0.3 + step / 2.0, 0.3, step)
    y, z = np.meshgrid(middle - 4.55, middle + 3.0, indexing="ij")

    def length(station: np.ndarray) -> np.ndarray:
        return np.sqrt(station[0] ** 2 + (y - station[1]) ** 2 + (z - station[2]) ** 2)

    there, back = length(radar), length(image)
    level = np.hypot(end - radar[0], wall - radar[1]) + np.hypot(end, y - wall)
    longer = np.hypot(level, z - radar[2]) - back  # by the wall's end
    reflected = radar[0] * (y - wall) / (y - image[1])  # x of the point on the wall
    weight = beyond_straight_end(np.sign(reflected - end) * np.sqrt(4.0 * np.maximum(longer, 0.0) / RADAR.wavelength))

    field = np.exp(-2j * np.pi / RADAR.wavelength * (there + back)) / (there**2 * back)
    expected = abs(np.sum(weight * field)) / abs(np.sum(field))
    assert 20.0 * np.log10(found[0] / found[1] / expected) == pytest.approx(0.0, abs=0.7)


@pytest.mark.parametrize("gap", [0.01, 5e-5])
def test_what_stands_before_a_seam_for_a_moment_makes_no_end_of_it(tmp_path, gap: float) -> None:
    """Two walls in one plane, and a plate that passes right before their seam: at no time does the first one end."""
    first, second = (box((8.0, 0.2, 4.0), (middle, WALL + 0.1, 0.0)) for middle in (END - 4.0, END + 4.0))
    track = {"kind": "constant_twist", "position": (0.0, 0.0, 0.0), "velocity": (0.0, -20.0, 0.0)}
    plate = Thing("plate", box((0.6, 0.002, 4.0), (END, WALL - gap - 0.001, 0.0)), "Car", "steel", track)
    walls = [Thing("one", first, "Wall", "steel"), Thing("other", second, "Wall", "steel")]
    street = load_scene(write_scene(tmp_path, walls, [plate]))
    for state in (street.at(0.0), street.at(0.9)):
        mirrors = [one for one in find_mirrors(state, [1], np.zeros(3), RADAR.wavelength) if abs(one.normal[1]) > 0.9]
        view = MirrorView(state, RADAR, state.as_mount(Pose()), (), mirrors[:1], MirrorSettings())
        points = np.array([[END + 2.0, 1.0, 0.0], [END - 9.5, 1.0, 0.0]])
        reflection = view.reflections(np.zeros((2, 1), dtype=np.int64), points)
        at = replace(reflection, point=np.array([[END - 0.01, WALL, 0.0], [END - 8.0 + 0.01, WALL, 0.0]]))
        assert view.ends is not None
        whole, ended = np.abs(view.ends.weight(at))
        assert whole == pytest.approx(1.0, abs=1e-12) and ended == pytest.approx(0.5, abs=0.2)


def test_weights_and_reaches_are_those_of_each_point_alone(ends, monkeypatch: pytest.MonkeyPatch) -> None:
    """Points over 12 m of the wall and of its end, in any order, some dozen compared together."""
    state = ends[0]
    mirrors = find_mirrors(state, [1], np.zeros(3), RADAR.wavelength)
    monkeypatch.setattr(mirror_ends, "_TOGETHER", 24)
    monkeypatch.setattr(mirror_ends, "_COMPARED", 1)
    view = MirrorView(state, RADAR, state.as_mount(Pose()), (), mirrors, MirrorSettings())
    (number,) = (k for k, mirror in enumerate(mirrors) if abs(mirror.offset) == pytest.approx(WALL))
    points = np.random.default_rng(3).uniform([-4.0, 1.0, -1.0], [14.8, 1.6, 1.0], (600, 3))
    at = view.reflections(np.full((600, 1), number), points)
    assert view.ends is not None
    together = view.ends.weight(at)
    alone = np.concatenate([view.ends.weight(at.take(np.array([k]))) for k in range(600)])
    np.testing.assert_allclose(together, alone, rtol=0.0, atol=1e-12)
    beyond = at.point[:, 0] > END + 1.0
    assert beyond.sum() > 15 and abs(together[beyond]).max() < 0.01
    assert abs(together[at.point[:, 0] < END - 1.0]).min() > 0.9
    reaches = view.ends.across(number, at)
    single = [view.ends.across(number, at.take(np.arange(3 * k, 3 * k + 3))) for k in range(200)]
    np.testing.assert_allclose(reaches, np.concatenate(single), rtol=0.0, atol=1e-9)
    order = side_by_side(at.point)
    steps = [np.linalg.norm(np.diff(at.point[some], axis=0), axis=1).mean() for some in (order, np.arange(600))]
    assert sorted(order) == list(range(600)) and steps[0] < 0.2 * steps[1]
