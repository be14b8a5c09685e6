"""Tunnel, car park, crossing with traffic lights and motorway.

Mirror images in walls, floor and ceiling, lamps, signals, clearances.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

import scarl_sionna as ss
from camera_lidar import Camera
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.light.lamps import ALWAYS_ON, is_on, lenses
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.points import point_targets
from scarl_sionna.scene.document.find import find_scene
from scarl_sionna.scene.document.material_entries import LAMP_KINDS
from scarl_sionna.scene.document.scene_file import read_document
from scenes_xml.motorway import layout as motorway
from scenes_xml.parking_garage import layout as garage
from scenes_xml.signalised_crossing import layout as crossing
from scenes_xml.tunnel import layout as tunnel
from tests.oracles.multipath import mirrored

pytestmark = pytest.mark.own_process(
    shared=True
)  # what it leaves behind would stay in the worker for the files after it

RADAR = RadarSpec().with_(pattern=IsotropicPattern(), bandwidth=150e6)
NIGHT = Lighting(sun_elevation_deg=-40.0, night_sky_luminance=0.0)


@cache
def world_of(name: str) -> ss.World:
    return ss.load_scene(name)


def image_paths(name: str, radar_at, target, velocity, normal, offset):
    """Return all paths to a point target and its mirror image, and which paths go there and back by that mirror."""
    pose = Pose(radar_at)
    paths = point_targets([target], [velocity], 1.0, RADAR, pose, state=world_of(name).at(0.0), num_samples=20_000)
    image = mirrored(target, normal, offset)
    there = np.linalg.norm(paths.tx_point - image, axis=1) < 1e-4
    back = np.linalg.norm(paths.rx_point - image, axis=1) < 1e-4
    return paths, image, there & back


@pytest.mark.filterwarnings(
    "ignore:.*smaller than the first Fresnel zone"
)  # kerbs and lamps beside the walls looked at
@pytest.mark.parametrize(
    ("name", "radar_at", "target", "normal", "offset"),
    [
        ("tunnel", (-23.6, -1.75, 0.6), (-9.0, -1.2, 0.7), (0.0, -1.0, 0.0), 4.9),  # the right wall
        pytest.param(
            "tunnel", (-23.6, -1.75, 0.6), (-9.0, -1.2, 0.7), (0.0, 1.0, 0.0), 4.9, marks=pytest.mark.slow
        ),  # the left wall
        pytest.param(
            "parking_garage", (-14.6, -6.7, 0.6), (-8.9, -6.5, 0.8), (0.0, 0.0, 1.0), 2.9, marks=pytest.mark.slow
        ),  # the ceiling, between two beams
        pytest.param(
            "parking_garage", (-14.6, -6.7, 0.6), (-8.9, -6.5, 0.8), (0.0, 0.0, 1.0), 0.0, marks=pytest.mark.slow
        ),  # the floor
    ],
)
def test_a_target_has_its_image_where_the_mirror_puts_it(name, radar_at, target, normal, offset):
    velocity = np.array([-3.0, 0.4, 0.2])
    paths, image, ghost = image_paths(name, radar_at, target, velocity, np.array(normal), offset)
    assert ghost.sum() == 1 and paths.depth[ghost] == 3
    distance = np.linalg.norm(image - radar_at)
    length = PathGeometry.of(paths, RADAR).center_length()[ghost]
    # planes of the scene's meshes are float32 numbers of a few metres, rounded to 1e-5 m: twice 5e-6 m for each of two
    # mirrors
    assert length == pytest.approx(2.0 * distance, abs=5e-5)
    moved = velocity - 2.0 * (velocity @ normal) * np.array(normal)
    # 1e-5 rad of the plane over some metres
    assert paths.length_rate[ghost] == pytest.approx(2.0 * moved @ (image - radar_at) / distance, abs=1e-3)
    direct = (paths.depth == 1).nonzero()[0]
    assert len(direct) == 1
    # Fresnel takes some, and spreading goes with the squares of both lengths: a ghost is weaker than (R / R')^2
    ratio = np.linalg.norm(paths.a[ghost]) / np.linalg.norm(paths.a[direct])
    straight = np.linalg.norm(np.subtract(target, radar_at))
    assert 1e-4 < ratio < (straight / distance) ** 2


@pytest.mark.parametrize("name", ["tunnel", "parking_garage"])
def test_nobody_stands_inside_a_body_in_an_enclosed_scene(name):
    """Floor, walls and ceiling are surfaces with open ends, so that no flag `room` is needed."""
    state = world_of(name).at(1.0)
    for mount in ((2.4, 0.0, 0.6), (-2.4, 0.3, 0.6), (0.3, 0.0, 1.7)):
        assert state.inside(state.actor_pose("ego").apply(np.array(mount))) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "time"), [("tunnel", 2.0), pytest.param("parking_garage", 1.0, marks=pytest.mark.slow)]
)
def test_lamps_of_enclosed_scenes_shine_at_any_time_of_day(name, time):
    world = world_of(name)
    assert world.document.info["enclosed"] is True
    spec = CameraSpec(width=64, height=36, horizontal_fov_deg=75.0, images=("rgb",), samples_per_pixel=16)
    means = []
    for light in (NIGHT, Lighting.preset("overcast")):
        state = world.with_lighting(light).at(time)
        mount = state.actor_pose("ego").compose(Pose.from_euler([0.3, 0.0, 1.62], pitch=np.radians(4.0)))
        rgb = Camera(spec).observe(state, mount, np.random.default_rng(0)).rgb
        means.append(np.median(rgb))
    assert 60.0 < min(means) < 200.0
    assert means[1] / means[0] == pytest.approx(1.0, abs=0.15)  # daylight comes in at the ends only; the rest is noise


def test_signals_and_indoor_lamps_are_on_under_every_lighting():
    assert set(ALWAYS_ON) < set(LAMP_KINDS)
    for kind in LAMP_KINDS:
        assert is_on(kind, NIGHT) == (kind in ALWAYS_ON)
        assert not is_on(kind, None)


def test_every_tunnel_clears_a_lorry():
    seen = set()
    for variant in range(12):
        plan = tunnel.layout(variant)
        seen.add((plan.start, plan.stop, plan.bore.half, plan.bore.is_arch, plan.lamps))
        assert 120.0 <= plan.stop - plan.start <= 200.0
        assert plan.bore.ceiling(tunnel.EDGE) > 4.5  # clear height of roads in tunnels
        assert plan.bore.half - tunnel.EDGE >= 0.8  # a walkway
        inside = [o for o in plan.openings if plan.start < o.start and o.stop < plan.stop]
        assert len(inside) == len(plan.openings) >= 2
        for door in plan.doors:
            assert all(abs(door - 0.5 * (o.start + o.stop)) > 2.6 for o in plan.openings)
    assert len(seen) == 12


def test_every_car_park_keeps_its_aisles_free():
    for variant in range(8):
        plan = garage.layout(variant)
        parked = [(bay.x, bay.y) for bay, *_ in plan.parked]
        free = {(bay.x, bay.y) for bay in plan.free}
        assert parked and free and not free & set(parked) and len(set(parked)) == len(parked)
        for x, y in [*parked, *free]:
            assert abs(abs(y) - garage.AISLE) >= 2.5 and abs(x) < plan.half  # bays begin 3 m from the aisle's middle
            away = np.abs(plan.column_x - x).min()
            assert away >= 0.15 + 0.5 * garage.BAY - 1e-9  # no column within a bay
        assert plan.ceiling - plan.beam > 2.1


def test_conflicting_streets_are_never_green_together():
    (a0, a1), (b0, b1) = crossing.GREEN["main"], crossing.GREEN["side"]
    assert 0.0 <= a0 < a1 < b0 < b1 < crossing.CYCLE
    network = read_document(find_scene("signalised_crossing")).lanes
    incoming = [lane for lane in network.lanes if "_in_" in lane.name]
    assert {lane.signal for lane in incoming} == {"main", "side"} and len(incoming) == 6
    turns = {name for lane in incoming for name in lane.next}
    assert len(turns) == 4 * 2 + 2 * 3  # each main lane goes ahead and to its side, each side lane everywhere


def test_lit_lenses_show_the_signals_at_the_start():
    document = read_document(find_scene("signalised_crossing"))
    signals = document.lanes.signals
    assert signals.is_green("main", 0.0) and not signals.is_green("side", 0.0)
    switched = lenses(document)
    for arm in ("west", "east"):
        assert switched[f"signal_{arm}_low_green"].is_lit(signals, 0.0)
        assert not switched[f"signal_{arm}_low_red"].is_lit(signals, 0.0)
    for arm in ("south", "north"):
        assert switched[f"signal_{arm}_low_red"].is_lit(signals, 0.0)


def test_turns_are_smooth():
    lanes = read_document(find_scene("signalised_crossing")).lanes.lanes
    for lane in (lane for lane in lanes if lane.kind != "walk"):
        step = np.diff(lane.points[:, :2], axis=0)
        heading = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
        length = np.linalg.norm(step, axis=1)
        for (h0, h1), (l0, l1) in zip(pairwise(heading), pairwise(length), strict=True):
            assert abs(h1 - h0) / (0.5 * (l0 + l1)) < 1.0 / 2.5  # no car turns tighter than 2.5 m


def test_the_bridge_spans_every_lane_at_its_clearance():
    world = world_of("motorway")
    plan = motorway.layout(0)
    state = world.at(0.0)
    for lane in range(-plan.lanes, plan.lanes):
        point = plan.curve.point(np.array(plan.bridge + 3.0), plan.offset(lane), 0.5)
        hit = state.cast(point, np.array([[0.0, 0.0, 1.0]]))
        assert hit.num_hits == 1
        part = int(hit.part[0])
        assert SEMANTIC_CLASSES[world.parts.semantic[part]] == "Bridge"
        assert (
            plan.clearance - 0.5 - 1e-3 <= hit.distance[0] <= plan.clearance - 0.5 + 1.3
        )  # girder or slab between girders
    names = {info.name: SEMANTIC_CLASSES[info.semantic] for info in world.instances.values()}
    assert names["guardrail_right"] == names["guardrail_left"] == "GuardRail" and names["noise_wall"] == "Wall"
