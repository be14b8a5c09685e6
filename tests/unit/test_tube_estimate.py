"""The estimate of the tubes of an object, which the budget counts in, against the tubes that are traced."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import trimesh

from scarl_sionna import load_scene, plan_channel, solve_paths
from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.settings.auto import AutoSettings, CostEstimate
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.channel.compose.budget import sbr_settings
from scarl_sionna.radar.channel.compose.choose import View, choose, num_tubes_of
from scarl_sionna.radar.channel.sbr.bodies import Bodies
from scarl_sionna.radar.channel.sbr.solve import stations_of
from scarl_sionna.radar.channel.sbr.tracing import first_faces, tracer_between
from tests.scenes import Thing, ball, box, plane, write_scene

RADAR, POSE = RadarSpec(), Pose([0.0, 0.0, 0.8])

pytestmark = pytest.mark.own_process(shared=True)  # six scenes


def corner() -> trimesh.Trimesh:
    """Three triangles at right angles, open towards the radar."""
    points = 0.2 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
    mesh = trimesh.Trimesh(points, [(0, 1, 2), (0, 2, 3), (0, 3, 1)], process=False)
    mesh.apply_transform(trimesh.geometry.align_vectors(np.ones(3) / np.sqrt(3.0), [-1.0, 0.1, 0.0]))
    return mesh.apply_translation([15.0, 0.0, 0.8])


def finer(mesh: trimesh.Trimesh, times: int) -> trimesh.Trimesh:
    return mesh if times == 0 else finer(mesh.subdivide(), times - 1)


def open_box() -> trimesh.Trimesh:
    """A box of 160 faces without its front: waves bounce about in it."""
    mesh = finer(box((4.0, 1.8, 1.4)), 2)
    mesh.update_faces(mesh.triangles_center[:, 0] > -1.99)
    return mesh.apply_translation([14.0, 8.0, 0.9])


def car() -> trimesh.Trimesh:
    """A bonnet and a cabin of 1536 faces, of which next to none is seen in another."""
    mesh = finer(trimesh.util.concatenate([box((4.2, 1.8, 0.6)), box((2.2, 1.6, 0.6), (0.0, 0.0, 0.6))]), 3)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.4, (0.0, 0.0, 1.0)))
    return mesh.apply_translation([16.0, -8.0, 0.6])


BODIES = {
    "fine ball": (ball(0.4, (25.0, 3.0, 0.5), 5), 1.3),
    "near box": (box((4.0, 2.0, 2.0), (8.0, 2.0, 1.1)), 2.5),
    "corner": (corner(), 2.0),
    "open box": (open_box(), 5.0),  # seams of its walls give slivers that bounce on and cost little
    "car": (car(), 4.0),
}
"""Bodies, and the factor within which the estimate is."""


@pytest.mark.parametrize("name", BODIES)
def test_tubes_are_estimated_whatever_the_mesh(tmp_path, name: str) -> None:
    """Alone, with few and many faces and bounces, at all levels but the finest.

    Counted by faces, with the size of the box and a growth of each level, they were up to 22, 15, 2.5, 16 and 10 off.
    """
    mesh, most_off = BODIES[name]
    state = load_scene(write_scene(tmp_path, [Thing("body", mesh, "Car", "steel")])).at(0.0)
    mount, settings = state.as_mount(POSE), RadarSettings(method="auto", accuracy=Accuracy(tube_budget=10**9))
    view = View(state, RADAR, mount, settings, {})
    (choice,), stations = choose(view).choices, stations_of(RADAR, mount)
    for level in AutoSettings().levels[:3]:
        bodies = Bodies(state, RADAR, settings.with_(sbr=sbr_settings(level)), [choice.item.number])
        with bodies.active():
            tracer = tracer_between(bodies, stations)
            for _ in tracer.bounces(first_faces(bodies, stations)):
                pass
        ratio = num_tubes_of(view, choice, level) / tracer.count.total()
        assert 1.0 / most_off < ratio < most_off, level


def test_rules_that_count_by_faces_are_read_as_those_of_today() -> None:
    """As datasets of their time state them; what has nothing to do with it stays."""
    levels = [level.model_dump() | {"growth": 3.0} for level in AutoSettings().levels]
    tubes = {"least": 100.0, "per_face": 2.8, "per_patch": 0.3, "per_edge": 0.1, "seconds": 2e-5}
    assert AutoSettings.model_validate({"levels": levels, "tubes": tubes, "num_probes": 99}) == AutoSettings(
        num_probes=99
    )


def test_a_fine_ball_keeps_its_ground_bounce_within_the_default_budget(tmp_path) -> None:
    """20,480 faces count as about as many tubes for each of two ways, not as 460,000."""
    things = [
        Thing("road", plane(64.0, 16.0, (30.0, 0.0, 0.0)), "Roads", "steel", is_object=False),
        Thing("ball", ball(0.4, (20.0, 2.0, 0.8), 5), "Static", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*without reflections.*", category=ScarlWarning)
        warnings.filterwarnings("ignore", message=".*is expected to be within.*", category=ScarlWarning)
        paths = solve_paths(
            state, RADAR, POSE, channel_tolerance_db=1.0, auto={"look_share": 0.0, "refine_share": 0.0}, num_rays=2_000
        )
    found = paths.diagnostics
    assert found["level_db"] == 1.0
    (row,) = (row for row in found["choices"] if row["instance"] == "ball")
    assert (row["method"], row["mirrors"], row["without_reflection_db"]) == ("sbr", ["road"], None)
    (straight,) = (
        sum(row["detail"]["num_tubes"].values()) for row in found["solvers"] if "settings" in row.get("detail", ())
    )
    assert 0.5 < found["predicted"]["tubes"] / (2 * straight) < 2.0


def test_processor_time_is_predicted_of_all_that_a_solve_does(tmp_path) -> None:
    """Each term by itself: rays, instances, a solve by `sbr`, pairs of ways, tubes that start and tubes that go on."""
    things = [
        Thing("road", plane(64.0, 16.0, (30.0, 0.0, 0.0)), "Roads", "steel", is_object=False),
        Thing("side", plane(1.0, 2.0, (20.0, 2.0, 1.1), (-1, -1, 0)), "Static", "steel"),
        Thing("back", plane(1.0, 2.0, (20.0, 1.0, 1.1), (-1, 1, 0)), "Static", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    nothing = dict.fromkeys(CostEstimate.model_fields, 0.0) | {"most_further": 1e12}

    def seconds(tolerance: float = 3.0, budget: int = 10**9, **terms: float) -> float:
        rules = AutoSettings(cost=CostEstimate(**(nothing | terms)))
        options = {"tube_budget": budget, "channel_tolerance_db": tolerance, "num_rays": 5_000, "cpu_budget": None}
        return plan_channel(state, RADAR, POSE, auto=rules, **options).predicted["cpu_seconds"]

    plan = plan_channel(state, RADAR, POSE, channel_tolerance_db=3.0, tube_budget=10**9, cpu_budget=None)
    assert seconds(least=1.5, ray=1e-3, instance=2.0) == pytest.approx(1.5 + 5.0 + 3 * 2.0)
    assert seconds(pair=1.0) == 2.0  # one way over the road, and both
    assert 0.0 < seconds(first=1.0) < plan.predicted["tubes"] and seconds(further=1.0) > 0.0
    tubes = seconds(first=1.0) + seconds(further=1.0)
    assert tubes == pytest.approx(plan.predicted["tubes"] - 2 * 2 * AutoSettings().tubes.least, abs=12.0)  # rounded
    started, went_on = seconds(first=1.0), seconds(further=1.0)
    at_most = 0.5 * started
    fewer = seconds(further=1.0, most_further=0.5)
    assert fewer == pytest.approx(1.0 / (1.0 / went_on + 1.0 / at_most), rel=1e-3)
    one = seconds(tolerance=1.0, first=1.0)
    both = seconds(tolerance=0.3, first=1.0, again=1.0)  # first at 1 dB, then what counts at 0.3 dB
    assert started < one == seconds(tolerance=0.3, first=1.0) < both - one
    assert seconds(tolerance=0.3, first=1.0, again=0.5) == pytest.approx((one + both) / 2.0)
    assert seconds(least=2.0, budget=0, first=1.0, further=1.0, pair=1.0) == 0.0  # nothing by `sbr`
