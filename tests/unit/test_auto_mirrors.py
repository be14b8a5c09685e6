"""What method="auto" sees over mirrors, and which of them it takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import ChannelPlan, Share, plan_channel, solve_paths
from scarl_sionna.radar.channel.compose.budget import Surface
from scarl_sionna.radar.channel.compose.expected_error import levels_db
from scarl_sionna.radar.channel.compose.mirror_legs import MirrorView
from scarl_sionna.radar.channel.compose.mirrors import find_mirrors
from scarl_sionna.radar.channel.compose.reflections import WHOLE_SHARE, Sight, changes, sights
from scarl_sionna.radar.link import path_unit
from tests.scenes import Material, Thing, ball, box, plane, write_scene

RADAR = RadarSpec()
COARSEST = Accuracy(channel_tolerance_db=6.0)
"""No level of `sbr` is coarser: what the budget does not pay for is left out."""
POSE = Pose([0.0, 0.0, 0.6])
RADIO = {name: Material(radio=name) for name in ("metal", "glass", "brick")}


def choices(paths) -> dict[str, dict]:
    return {entry["instance"]: entry for entry in paths.diagnostics["choices"]}


def test_echoes_through_mirrors_are_paid_from_what_is_left(tmp_path) -> None:
    """Two bodies over a mirror, which is one more tracing of each, whichever way back."""
    cars = [
        Thing(name, box((4, 2, 1.25)), "Car", "steel", {"kind": "static", "position": [distance, side, 0.75]})
        for name, distance, side in (("near", 15.0, 0.0), ("far", 30.0, 5.0))
    ]
    wall = Thing("wall", box((64.0, 0.2, 16.0), (30, 10, 0)), "Wall", "steel")
    state = load_scene(write_scene(tmp_path, [wall], cars)).at(0.0)
    wide = RADAR.with_(azimuth_fov_deg=140.0)
    number = {info.name: key for key, info in state.world.instances.items()}

    def through(budget: float) -> dict[str, bool]:
        plan = plan_channel(state, wide, POSE, accuracy=COARSEST.with_(tube_budget=int(budget)))
        (share,) = (share for share in plan.shares if share.solver == "sbr")
        assert {number["near"], number["far"]} <= set(share.instances) and plan.predicted["tubes"] <= budget
        seen = {item for reflection in share.reflections for item in reflection.instances}
        return {name: number[name] in seen for name in ("near", "far")}

    # both ways of each
    whole = {name: entry["tubes"] for name, entry in choices(solve_paths(state, wide, POSE, accuracy=COARSEST)).items()}
    tubes = {name: whole[name] // 2 for name in ("near", "far")}
    assert through(tubes["near"] + tubes["far"] + 1) == {"near": False, "far": False}
    # the wall changes the far one for fewer tubes, so it comes first (tests/unit/test_spend.py), whatever else is left
    assert tubes["far"] < tubes["near"]
    assert through(tubes["near"] + 2 * tubes["far"] + 1) == {"near": False, "far": True}
    assert through(2 * tubes["near"] + tubes["far"] + 1) == {"near": False, "far": True}
    assert through(2 * (tubes["near"] + tubes["far"]) + 1) == {"near": True, "far": True}


def view_of(state, mirrors) -> MirrorView:
    radar = RADAR.with_(pattern=IsotropicPattern())
    return MirrorView(state, radar, state.as_mount(POSE), (), mirrors, RadarSettings().mirrors)


def seen_by(view: MirrorView, numbers: list[int]) -> Mapping[int, list[Sight]]:
    return sights(view, {number: Surface.of(view.state, number) for number in numbers})


@pytest.mark.parametrize("height", [0.3, 1.0, 4.0])
def test_change_by_the_ground_is_that_of_image_theory(tmp_path, height: float) -> None:
    """A perfect conductor and an antenna alike in all directions: only the lengths decide."""
    things = [
        Thing("ground", plane(100.0, 100.0, (50, 0, 0)), "Ground", "steel", is_object=False),
        Thing("plate", plane(0.1, 0.1, (30, 2, height), (-1, 0, 0)), "TrafficSign", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    mirrors = find_mirrors(state, [1], POSE.position, RADAR.wavelength)
    (change,) = changes(seen_by(view_of(state, mirrors), [2])[2], mirrors, 100.0)
    straight, bent = (np.sqrt(30.0**2 + 2.0**2 + (height - sign * 0.6) ** 2) for sign in (1.0, -1.0))
    assert change.change_db == pytest.approx(40.0 * np.log10(1.0 + straight / bent), abs=0.03)  # metal loses 0.2 %
    assert not changes(seen_by(view_of(state, mirrors), [2])[2], mirrors, 29.0)  # too far


def test_a_mirror_comes_and_goes_smoothly() -> None:
    """With what it shows of an object, and with what its field is: steps of a hundredth change the weight by little."""

    def weight(part: float, field: float) -> float:
        seen = [Sight(0.4, 0.3, 8.0), Sight(part * WHOLE_SHARE, field * 0.3, 8.1)]
        found = changes(seen, [SimpleNamespace(number=0)], 100.0, 0.5, 3.0)  # type: ignore[list-item]
        return found[0].weight if found else 0.0

    steps = np.linspace(0.0, 1.2, 121)
    for some in ([weight(part, 0.8) for part in steps], [weight(25.6, field) for field in steps / 40.0]):
        assert (some[0], some[-1]) == (0.0, 1.0)
        rises = np.diff(some)
        assert rises.min() >= 0.0 and rises.max() < 0.07


def test_ways_looked_at_together_show_what_each_shows_alone(tmp_path) -> None:
    """The ground, two walls and a ceiling, one behind the other; a sign, a box half hidden by it, a box behind all."""
    things = [
        Thing("ground", plane(100.0, 100.0, (50, 0, 0)), "Ground", "grey", is_object=False),
        Thing("wall", box((60, 0.2, 6), (20, 6.1, 3.1)), "Wall", "steel"),
        Thing("other", box((60, 0.2, 6), (20, -4.1, 3.1)), "Wall", "white"),
        Thing("sign", plane(1.0, 1.0, (10, 0.5, 1), (-1, 1, 0)), "TrafficSign", "steel"),
        Thing("half", box((0.5, 2.0, 1.5), (15, 1, 1)), "Static", "steel"),
        Thing("last", box((0.5, 1.0, 0.5), (30, 1, 0.4)), "Static", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    mirrors = find_mirrors(state, [1, 2, 3], POSE.position, RADAR.wavelength)
    together = seen_by(view_of(state, mirrors), [4, 5, 6])
    alone = [seen_by(view_of(state, [replace(mirror, number=0)]), [4, 5, 6]) for mirror in mirrors]
    assert len(mirrors) >= 5  # both sides of the walls
    for number in (4, 5, 6):
        assert together[number] == [alone[0][number][0], *(one[number][1] for one in alone)]
    assert sum(0.0 < sight.share < 0.6 for seen in together.values() for sight in seen) >= 6


def test_what_is_hidden_costs_nothing_and_what_only_a_mirror_shows_is_seen(tmp_path) -> None:
    """A van hides two signs; a wall shows one of them, so it is computed over the wall alone."""
    things = [
        Thing("van", box((2, 4, 3), (12, 0, 1.6)), "Car", "steel"),
        Thing("shown", plane(1.0, 1.0, (20, 2.5, 1), (-1, 1, 0)), "TrafficSign", "steel"),
        Thing("hidden", box((0.5, 0.5, 0.5), (15, 0, 1)), "Static", "steel"),
        Thing("wall", box((60, 0.2, 6), (20, 6.1, 3.1)), "Wall", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    paths = solve_paths(state, RADAR, POSE, num_rays=20_000, tube_budget=10**7)
    found = choices(paths)
    assert found["hidden"]["tubes"] == 0 and found["hidden"]["reason"].startswith("hidden")
    assert found["shown"]["visible_share"] == 0.0 and found["shown"]["mirrors"] == ["wall"]
    assert found["van"]["visible_share"] > 0.2 and found["shown"]["tubes"] > 0
    over = paths.select((paths.instance == 2).any(axis=1))
    assert over.num_paths and (over.instance[:, 0] == 4).all()  # there over the wall, and back
    length = np.linalg.norm(np.array([20.0, 9.5, 1.0]) - POSE.position)  # the sign's image
    assert over.length.max() / 2.0 == pytest.approx(length, abs=0.7)


def test_a_corner_of_two_walls_echoes(tmp_path) -> None:
    """A building's corner at 45 deg sends the radar back to itself over both walls, neither of which faces it."""
    things = [
        Thing("left", plane(8.0, 8.0, (30 - 2.83, 2.83, 4), (-1, -1, 0)), "Building"),
        Thing("right", plane(8.0, 8.0, (30 - 2.83, -2.83, 4), (-1, 1, 0)), "Building"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    plan = plan_channel(state, RADAR, POSE, tube_budget=0)
    assert plan.echoes and plan.mirrors == (1, 2)
    paths = solve_paths(state, RADAR, POSE, tube_budget=0, num_rays=20_000)
    both = paths.is_mirror_chain & (paths.depth == 2)
    assert both.any() and paths.length[both] / 2.0 == pytest.approx(30.0, abs=1e-3)


def test_a_wall_behind_the_radar_whose_ghost_is_in_view_is_a_mirror_and_no_body(tmp_path) -> None:
    """From a wall ahead past the radar to a wall behind it and back: the sum of both distances, there and back."""
    things = [
        Thing("ahead", plane(8.0, 8.0, (12, 0, 4), (-1, 0, 0)), "Building"),
        Thing("behind", box((2, 8, 8), (-6, 0, 4.1)), "Building"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    paths = solve_paths(state, RADAR, POSE, num_rays=20_000, max_distance=30.0)
    both = paths.is_mirror_chain & (paths.depth == 2)
    assert both.any() and paths.length[both] / 2.0 == pytest.approx(12.0 + 5.0, abs=1e-3)


def test_a_body_behind_the_radar_whose_ghost_in_a_wall_is_in_view_is_computed(tmp_path) -> None:
    """There over the wall and back over the wall: twice the way to its image."""
    things = [
        Thing("wall", box((0.2, 20, 6), (10.1, 0, 3)), "Wall", "steel"),
        Thing("ball", ball(0.3, (-3.0, 1.5, 0.6), 5), "Static", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    paths = solve_paths(state, RADAR, POSE, num_rays=20_000)
    found = choices(paths)["ball"]
    assert (found["method"], found["reason"]) == ("sbr", "out of view, its ghosts are not")
    assert found["mirrors"] == ["wall"] and found["visible_share"] == 0.0
    ghost = paths.select((paths.instance == 2).any(axis=1))
    assert np.unique(ghost.instance[:, :3], axis=0).tolist() == [[1, 2, 1]]
    image = np.hypot(2 * 10.0 + 3.0, 1.5)
    assert ghost.length.min() / 2.0 == pytest.approx(image - 0.3, abs=1e-3)
    theory = -20.0 * np.log10(image**2) + 10.0 * np.log10(np.pi * 0.3**2 * RADAR.wavelength**2 / (4.0 * np.pi) ** 3)
    assert levels_db(ghost, RADAR, [2])[2] == pytest.approx(theory, abs=0.3)


def test_a_wall_that_comes_into_range_changes_an_object_without_a_step(tmp_path) -> None:
    """Its ghost over a wall across the way is hardly farther than the wall: both come into range."""
    things = [
        Thing("wall", box((0.2, 60, 8), (256.2, 0, 4)), "Wall", "steel"),
        Thing("ball", ball(0.5, (200.0, 6.0, 1.0), 5), "Static", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    levels: list[float] = []
    over: list[tuple[bool, int]] = []
    for place in (0.095, 0.099, 0.101, 0.103, 0.15, 0.2, 0.25, 0.3, 0.35):
        pose = Pose([float(place), 0.0, 0.8])
        paths = solve_paths(state, RADAR, pose, num_rays=2_000, max_distance=256.0)
        levels.append(levels_db(paths, RADAR, [2])[2])
        over.append((choices(paths)["ball"]["mirrors"] == ["wall"], int((paths.depth > 1).sum())))
    assert over[1] == (False, 0) and over[2][0] and over[-1][0] and over[-1][1] > 0
    assert np.abs(np.diff(levels)).max() < 0.5


SIDE = ((12.0, 0.1, 3.0), (8.0, 4.05, 2.0))
"""Size and place of a wall along the way, whose mirror point is not on it [m]."""


def wall_alone(folder, mesh, material: str, semantic: str = "Wall"):
    """Return the paths by `auto` of a wall alone, and what `raycast` makes of it."""
    state = load_scene(write_scene(folder, [Thing("wall", mesh, semantic, material)], materials=RADIO)).at(0.0)
    pose = Pose([0.0, 0.0, 0.8])
    return solve_paths(state, RADAR, pose, num_rays=200_000), solve_paths(
        state, RADAR, pose, "raycast", num_rays=200_000
    )


def mean_db(paths) -> float:
    return 10.0 * float(np.log10(np.sum(np.abs(paths.a[:, 0, 0]) ** 2)))


@pytest.mark.parametrize("semantic", ["Wall", "Building"])
def test_a_smooth_wall_has_no_rough_part_by_class(tmp_path, semantic: str) -> None:
    """Steel scatters nothing, glass (S = 0.05, no heights) 4 S^2 R(0) cos against gamma R(theta) of its class."""
    steel, _ = wall_alone(tmp_path / "steel", box(*SIDE), "metal", semantic)
    assert steel.num_paths == 0 and choices(steel)["wall"]["reason"].endswith("by its material")
    (edges,) = (entry for entry in steel.diagnostics["left_out"] if entry["kind"] == "edges")
    state = load_scene(write_scene(tmp_path / "edges", [Thing("wall", box(*SIDE), semantic, "metal")], materials=RADIO))
    traced = solve_paths(state.at(0.0), RADAR, Pose([0.0, 0.0, 0.8]), "sbr")
    level = levels_db(traced, RADAR, [1])[1] + 10.0 * np.log10(path_unit(RADAR))  # over the noise of a cell
    assert edges["strongest"] == ["wall"] and abs(edges["expected_to_noise_db"] - level) < 6.0
    glass, by_class = wall_alone(tmp_path / "glass", box(*SIDE), "glass", semantic)
    gamma = {"Wall": 0.3, "Building": 1.0}[semantic]
    assert glass.num_paths > 0 and mean_db(glass) < mean_db(by_class) + 10.0 * np.log10(4.0 * 0.05**2 / gamma)
    brick, rough = wall_alone(tmp_path / "brick", box(*SIDE), "brick", semantic)
    assert np.array_equal(brick.a, rough.a) and choices(brick)["wall"]["reason"].endswith("by class")


def test_it_still_flashes_where_it_faces_the_radar(tmp_path) -> None:
    """A wall of steel across the way is the image of the radar at twice its distance, exactly."""
    wall, _ = wall_alone(tmp_path, box((0.2, 12.0, 6.0), (10.1, 0.0, 1.0)), "metal")
    (flash,) = np.flatnonzero(np.abs(wall.a[:, 0, 0]) > 0.0)
    assert wall.length[flash] == pytest.approx(20.0, abs=1e-6)
    reflectance = float(np.abs(wall.a[flash, 0, 0])) / (RADAR.wavelength / (4.0 * np.pi * 20.0))
    assert 0.98 < reflectance <= 1.0


def test_a_wall_with_structure_keeps_the_rough_part_by_class(tmp_path) -> None:
    """Ribs of steel on a third of a wall, or frames of a rough material: a class stands for them."""
    ribs = [box((0.2, 0.3, 3.0), (x, 3.85, 2.0)) for x in np.arange(2.5, 14.0, 0.5)]
    ribbed, by_class = wall_alone(tmp_path / "ribs", trimesh.util.concatenate([box(*SIDE), *ribs]), "metal")
    assert np.array_equal(ribbed.a, by_class.a) and ribbed.num_paths > 0
    assert choices(ribbed)["wall"]["reason"].endswith("by class")


def test_plans_say_which_parts_go_by_their_material(tmp_path) -> None:
    state = load_scene(write_scene(tmp_path, [Thing("wall", box(*SIDE), "Wall", "metal")], materials=RADIO)).at(0.0)
    plan = plan_channel(state, RADAR, Pose([0.0, 0.0, 0.8]))
    (share,) = plan.shares
    assert share.by_material == (0,) and ChannelPlan(**plan.to_dict()).shares == plan.shares
    with pytest.raises(ParameterRangeError, match="by_material = given for 'sbr'"):
        Share("sbr", by_material=(0,))
    assert "by_material" not in Share("raycast").to_dict()
