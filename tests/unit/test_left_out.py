"""What `auto` leaves out has a reason and a number, and the number holds what is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.auto import AutoSettings
from scarl_sionna.core.settings.mirrors import MirrorSettings
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT, dbm_to_watt
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import ChannelPlan, Share, plan_channel, solve_paths
from scarl_sionna.radar.channel.compose.budget import estimate
from scarl_sionna.radar.channel.compose.left_out.reach import Boxes, MirrorWays
from scarl_sionna.radar.channel.compose.mirrors import find_mirrors, mirrored, reaches
from scarl_sionna.radar.channel.raycast.class_rcs import class_reflectivity
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.signal.noise import angle_cell_noise_power
from tests.scenes import Material, Thing, box, plane, write_scene

pytestmark = pytest.mark.own_process(shared=True)

RADAR = RadarSpec().with_(pattern=IsotropicPattern())
POSE = Pose([0.0, 0.0, 0.6])
MUCH = {"tube_budget": 10**8, "cpu_budget": None, "memory_budget": None}
HEIGHT = 0.584
"""At which all ways of the first plate are nearly in phase [m]."""
NOISE = angle_cell_noise_power(RADAR)
UNIT = dbm_to_watt(RADAR.front_end.tx_power_dbm) * RADAR.wavelength**2 / (4.0 * np.pi) ** 3 / NOISE


def power_db(paths: RadarPaths) -> float:
    """Return the power of paths in phase over the noise of a cell [dB]."""
    field = np.sum(paths.a[:, 0, 0] * np.exp(-2j * np.pi * RADAR.center_frequency / SPEED_OF_LIGHT * paths.length))
    return float(20.0 * np.log10(max(abs(field), 1e-20)) + 10.0 * np.log10(sent()))


def sent() -> float:
    """Return the transmitted power over the noise of a cell."""
    return float(dbm_to_watt(RADAR.front_end.tx_power_dbm) / NOISE)


def entries(found: Any, kind: str, reason: str = "") -> list[Mapping[str, Any]]:
    return [entry for entry in found if entry.get("kind") == kind and reason in entry["reason"]]


@pytest.fixture(scope="module")
def road(tmp_path_factory):
    """Return a plate, seen from the front, over a road of metal."""
    things = [
        Thing("road", plane(100.0, 40.0, (45, 0, 0)), "Roads", "steel", is_object=False),
        Thing("plate", plane(0.03, 0.03, (30, 0, HEIGHT), (-1, 0, 0)), "TrafficSign", "steel"),
    ]
    return load_scene(write_scene(tmp_path_factory.mktemp("road"), things)).at(0.0)


def test_a_plate_that_only_the_ground_bounce_brings_over_the_floor_is_computed_with_it(road) -> None:
    """All four pairs of ways in phase: 40 log10(1 + d/d') more than straight, by image theory."""
    straight = estimate(road, RADAR, POSE, 2, 250.0).bound_db
    near, far = (np.sqrt(30.0**2 + (HEIGHT - sign * 0.6) ** 2) for sign in (1.0, -1.0))
    more = 40.0 * np.log10(1.0 + near / far)
    below = solve_paths(road, RADAR, POSE, channel_floor_db=straight + more - 0.5, num_rays=20_000, **MUCH)
    row = next(row for row in below.diagnostics["choices"] if row["instance"] == "plate")
    assert (row["method"], row["mirrors"]) == ("sbr", ["road"])
    assert row["bound_to_noise_db"] == pytest.approx(straight + more, abs=0.1)
    echo = below.select((below.instance == 2).any(axis=1))
    assert straight + 9.0 < power_db(echo) < row["bound_to_noise_db"]
    above = plan_channel(road, RADAR, POSE, channel_floor_db=straight + more + 0.5)
    (entry,) = entries(above.left_out, "object")
    assert entry["instance"] == "plate" and entry["bound_to_noise_db"] == row["bound_to_noise_db"]


def test_a_bound_without_mirrors_is_that_of_the_flat_plate(tmp_path) -> None:
    things = [
        Thing("plate", plane(0.1, 0.1, (30, 2, 1), (-1, 0, 0)), "TrafficSign", "steel"),
        Thing("far", plane(0.3, 0.3, (120, 0, 0.6), (-1, 0, 0)), "TrafficSign", "steel"),
        Thing("beside", plane(0.15, 0.15, (0, 20, 0.6), (0, -1, 0)), "TrafficSign", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    plan = plan_channel(state, RADAR, POSE, channel_floor_db=200.0, max_distance=50.0)
    flat = {name: 4.0 * np.pi * area**2 / RADAR.wavelength**2 for name, area in (("far", 0.09), ("beside", 0.0225))}
    for kind, name, distance in (("out of range", "far", 120.0), ("out of view", "beside", 20.0)):
        (entry,) = entries(plan.left_out, kind)
        assert entry["strongest"] == [name] and entry["number"] == 0  # the floor is higher still
        want = 10.0 * np.log10(UNIT * flat[name] / distance**4)
        assert entry["bound_to_noise_db"] == pytest.approx(want, abs=0.06)
        assert entry["expected_to_noise_db"] < entry["bound_to_noise_db"]
    (entry,) = entries(plan.left_out, "object")
    assert entry["instance"] == "plate"


def corner(folder, second: str) -> Any:
    """Return two plates of metal at a right angle, open to the radar, the second of a class."""
    things = [
        Thing("left", plane(0.1, 0.1, (30.0, 0.03535, 0.6), (-1, -1, 0)), "Static", "steel"),
        Thing("right", plane(0.1, 0.1, (30.0, -0.03535, 0.6), (-1, 1, 0)), second, "steel"),
    ]
    return load_scene(write_scene(folder, things)).at(0.0)


def test_the_bound_of_a_corner_of_which_one_side_is_by_class_holds_the_dihedral(tmp_path) -> None:
    """Two bounces in either order, sigma = 8 pi (a b / lambda)^2: what two equal plates can do at most, and do."""
    state = corner(tmp_path, "Static")
    cost = plan_channel(state, RADAR, POSE, channel_tolerance_db=6.0, **MUCH).predicted["tubes"]
    plan = plan_channel(state, RADAR, POSE, channel_tolerance_db=6.0, tube_budget=int(0.8 * cost))
    assert sum(len(share.instances) for share in plan.shares if share.solver == "sbr") == 1
    (entry,) = entries(plan.left_out, "bounces")
    assert set(entry["strongest"]) == {"left", "right"} and entry["number"] == 1
    both = solve_paths(state, RADAR, POSE, "sbr")
    bound = entry["bound_to_noise_db"]
    exact = 10.0 * np.log10(UNIT * 8.0 * np.pi * (0.01 / RADAR.wavelength) ** 2 / 30.035**4)
    assert bound - 0.2 < exact < bound and bound - 0.6 < power_db(both) < bound
    assert not entries(plan_channel(state, RADAR, POSE, **MUCH).left_out, "bounces")


def test_a_rough_class_does_not_lower_the_bound_of_smooth_faces(tmp_path) -> None:
    """Pavements are rough by class, but the kerb of smooth metal makes a corner."""
    state = corner(tmp_path, "SideWalks")
    plan = plan_channel(state, RADAR, POSE, mirrors=MirrorSettings(), **MUCH)
    (entry,) = entries(plan.left_out, "bounces")
    assert power_db(solve_paths(state, RADAR, POSE, "sbr")) < entry["bound_to_noise_db"]


@pytest.fixture(scope="module")
def walled(tmp_path_factory):
    """Return a plate and a bush between a wall and a road of metal."""
    things = [
        Thing("road", plane(100.0, 40.0, (45, 0, 0)), "Roads", "steel", is_object=False),
        Thing("wall", box((60.0, 0.2, 8.0), (32, 8.1, 4.1)), "Wall", "steel"),
        Thing("plate", plane(0.5, 0.5, (30, 2, 1.5), (-1, 0.15, 0)), "TrafficSign", "steel"),
        Thing("bush", box((1, 1, 1), (25, -2, 1)), "Vegetation", "leaf"),
    ]
    materials = {"leaf": Material(radio="foliage")}
    return load_scene(write_scene(tmp_path_factory.mktemp("walled"), things, materials=materials)).at(0.0)


def test_ghosts_that_a_budget_or_a_limit_takes_are_told_apart(walled) -> None:
    whole = plan_channel(walled, RADAR, POSE, channel_tolerance_db=6.0, **MUCH)
    assert not entries(whole.left_out, "reflections", "budget") and not entries(
        whole.left_out, "reflections", "max_mirrors"
    )
    one = plan_channel(walled, RADAR, POSE, channel_tolerance_db=6.0, mirrors=MirrorSettings(max_mirrors=1), **MUCH)
    (limit,) = entries(one.left_out, "reflections", "max_mirrors = 1")
    few = plan_channel(walled, RADAR, POSE, channel_tolerance_db=6.0, tube_budget=int(whole.predicted["tubes"]) - 1)
    (budget,) = entries(few.left_out, "reflections", "budget")
    for plan in (whole, one, few):
        assert entries(plan.left_out, "reflections", "'raycast'")[0]["number"] == 2  # the bush, the wall over the road
    for entry, plan in ((limit, one), (budget, few)):
        assert entry["strongest"] == ["plate"] and entry["number"] == 1
        own = [solve_paths(walled, RADAR, POSE, "hybrid", plan=item, num_rays=20_000) for item in (whole, plan)]
        full, less = (paths.select((paths.instance == 3).any(axis=1)) for paths in own)
        lacking = full.select(np.arange(full.num_paths)[~np.isin(full.length, less.length)])
        assert lacking.num_paths and power_db(lacking) < entry["bound_to_noise_db"]


def test_a_ghost_of_what_is_behind_the_radar_is_told_by_image_theory(tmp_path) -> None:
    """A diffuse body over a wall ahead: mean reflectivity times its box as seen from the image, there and back."""
    things = [
        Thing("wall", box((0.2, 30.0, 8.0), (45.1, 0, 4.1)), "Wall", "steel"),
        Thing("bush", box((0.5, 0.5, 0.5), (-3.0, 1.0, 0.6)), "Vegetation", "leaf"),
    ]
    state = load_scene(write_scene(tmp_path, things, materials={"leaf": Material(radio="foliage")})).at(0.0)
    plan = plan_channel(state, RADAR, POSE, tube_budget=0)
    (ghost,) = entries(plan.left_out, "ghosts", "out of view")
    assert ghost["strongest"] == ["bush"]
    away = np.array([90.0, 0.0, 0.6]) - [-3.0, 1.0, 0.6]  # from the image of the radar in the wall at x = 45
    nearest = np.linalg.norm(np.maximum(np.abs(away) - 0.25, 0.0))
    area = 0.25 * np.abs(away).sum() / np.linalg.norm(away)
    mean = UNIT * class_reflectivity()[state.world.instances[2].semantic] * area / nearest**4
    assert ghost["expected_to_noise_db"] == pytest.approx(10.0 * np.log10(mean), abs=0.06)
    assert ghost["bound_to_noise_db"] == pytest.approx(10.0 * np.log10(mean) + AutoSettings().speckle_db, abs=0.1)
    near = plan_channel(state, RADAR, POSE, tube_budget=0, max_distance=90.0)
    assert not entries(near.left_out, "ghosts", "out of view")  # 92.8 m


def test_two_mirrors_on_one_way_are_bounded(walled) -> None:
    plan = plan_channel(walled, RADAR, POSE, channel_tolerance_db=3.0, **MUCH)
    (entry,) = entries(plan.left_out, "ghosts", "two mirrors")
    shares = tuple(
        Share("sbr", share.instances, share.settings, True) for share in plan.shares if share.solver == "sbr"
    )
    deep = ChannelPlan(shares, plan.mirrors, False, 2, "images")
    paths = solve_paths(walled, RADAR, POSE, "hybrid", plan=deep, **{"cpu_budget": None, "memory_budget": None})
    before = (np.cumsum(paths.instance == 3, axis=1) == 0) & (paths.instance > 0)
    after = (np.cumsum((paths.instance == 3)[:, ::-1], axis=1)[:, ::-1] == 0) & (paths.instance > 0)
    twice = paths.select((before.sum(axis=1) == 2) | (after.sum(axis=1) == 2))
    assert twice.num_paths and power_db(twice) < entry["bound_to_noise_db"]


def test_boxes_that_single_rays_reach_are_reached(walled) -> None:
    """Every way that leads to one of many points of a box leads to the box: over one mirror and over two."""
    every = find_mirrors(walled, [1, 2], POSE.position, RADAR.wavelength)
    mirrors = [mirror for mirror in every if not np.allclose(mirror.corners[:, 1], 8.2)]
    assert len(mirrors) == len(every) - 1  # the back of the wall, which its front hides
    ways = MirrorWays.over_one(mirrors, POSE.position)
    rng = np.random.default_rng(3)
    center = rng.uniform([-20.0, -6.0, 0.3], [110.0, 7.5, 5.0], (40, 3))
    boxes = Boxes(center, np.tile(np.eye(3), (40, 1, 1)), np.full((40, 3), 0.3))
    found = ways.reaches(boxes, 0.0)
    assert MirrorWays.over_one(every, POSE.position).reaches(boxes, 0.0).any(axis=0).sum() == len(mirrors)
    pairs = ways.and_another(0.0)
    twice = pairs.reaches(boxes, 0.0)
    points = (center[:, None] + rng.uniform(-0.3, 0.3, (40, 50, 3))).reshape(-1, 3)
    checked = 0
    for number, mirror in enumerate(mirrors):
        by_rays = reaches((mirror,), POSE.position, points).reshape(40, 50).any(axis=1)
        assert (found[:, number] | ~by_rays).all()
        assert ways.image[number] == pytest.approx(mirrored((mirror,), POSE.position))
        for other in mirrors:
            if other is mirror:
                continue
            by_rays = reaches((mirror, other), POSE.position, points).reshape(40, 50).any(axis=1)
            checked += int(by_rays.sum())
            image = mirrored((mirror, other), POSE.position)
            same = [k for k in range(len(pairs.last)) if np.allclose(pairs.image[k], image)]
            assert not by_rays.any() or (twice[:, same].any(axis=1) | ~by_rays).all()
    assert checked and found.any() and not found.all()


def test_bounces_beyond_the_last_are_estimated_by_it(tmp_path) -> None:
    """With one bounce a corner's second is what is missing: 0.3 of the field of the first, of each plate."""
    state = corner(tmp_path, "Static")
    levels = tuple(level.with_(max_depth=1) for level in AutoSettings().levels)
    rules = AutoSettings(levels=levels, look_share=0.0, refine_share=0.0)
    paths = solve_paths(state, RADAR, POSE, auto=rules, channel_tolerance_db=6.0, **MUCH)
    (entry,) = entries(paths.diagnostics["left_out"], "depth")
    powers = [np.mean(_over_band(paths.select(paths.instance[:, 0] == number))) for number in (1, 2)]
    want = 10.0 * np.log10(0.3**2 * max(powers) * sent())
    assert entry["expected_to_noise_db"] == pytest.approx(want, abs=0.5) and entry["bound_to_noise_db"] is None
    assert not entries(solve_paths(state, RADAR, POSE, **MUCH).diagnostics["left_out"], "depth")


def _over_band(paths: RadarPaths) -> np.ndarray:
    """Return |sum a|^2 at frequencies over the band, weighted as by a Hann window."""
    share = (np.arange(64) + 0.5) / 64
    frequency = RADAR.center_frequency + (share - 0.5) * RADAR.sampled_bandwidth
    weight = np.sin(np.pi * share) ** 4
    field = np.exp(-2j * np.pi / SPEED_OF_LIGHT * frequency[:, None] * paths.length) @ paths.a[:, 0, 0]
    return np.asarray(np.abs(field) ** 2 * weight / weight.mean())


def test_a_chain_of_more_mirrors_than_are_followed_is_bounded(tmp_path) -> None:
    """A corner of two walls and a floor: three reflections send all back, over the way to its point and back."""
    things = [
        Thing("floor", plane(8.0, 8.0, (16, 0, -1)), "Ground", "steel", is_object=False),
        Thing("left", plane(8.0, 8.0, (20 - 2.83, 2.83, 3), (-1, -1, 0)), "Building", "steel"),
        Thing("right", plane(8.0, 8.0, (20 - 2.83, -2.83, 3), (-1, 1, 0)), "Building", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    plan = plan_channel(state, RADAR, POSE, tube_budget=0)
    (entry,) = entries(plan.left_out, "mirror chains")
    assert set(entry["strongest"]) == {"floor", "left", "right"} and "max_depth = 2" in entry["reason"]
    length = 2.0 * np.linalg.norm(np.array([20.0, 0.0, -1.0]) - POSE.position)
    exact = 10.0 * np.log10(sent() * (RADAR.wavelength / (4.0 * np.pi * length)) ** 2)
    assert entry["bound_to_noise_db"] == pytest.approx(exact, abs=0.06)
    deeper = plan_channel(state, RADAR, POSE, tube_budget=0, sionna={"max_depth": 3})
    assert not [one for one in entries(deeper.left_out, "mirror chains") if "chains of 3" in one["reason"]]


def test_what_only_hides_in_a_plan_by_hand_has_its_bound(road) -> None:
    plan = ChannelPlan((Share("raycast", ("road",)),))
    paths = solve_paths(road, RADAR, POSE, "hybrid", plan=plan, num_rays=5_000)
    (entry,) = entries(paths.diagnostics["left_out"], "object")
    item = estimate(road, RADAR, POSE, 2, 250.0)
    assert entry["instance"] == "plate" and "only hides" in entry["reason"]
    assert entry["bound_to_noise_db"] == round(item.bound_db, 1)
    alone = solve_paths(road, RADAR, POSE, "sbr", instances=["plate"], sbr=SbrSettings())
    assert power_db(alone) == pytest.approx(entry["bound_to_noise_db"], abs=0.1)
