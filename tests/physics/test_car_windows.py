"""Panes of cars: light passes as by Fresnel's formula, labels are the car's, the lidar meets who sits behind them."""

from __future__ import annotations

import functools
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from camera_lidar import Lidar
from camera_lidar.camera.labels import render_labels
from camera_lidar.lidar.scan import pane_transmittance
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.pattern import RasterScan
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.engine import variant
from scarl_sionna.scene.actors.model import actor_names, read_actor_model
from scarl_sionna.scene.motion.trajectory import ConstantTwistTrajectory, StaticTrajectory
from scenes_xml.actors.cars import SHAPES

GLAZED = tuple(name for name in actor_names() if "window_glass" in read_actor_model(name).materials)
PEOPLE = ["people_clothes", "people_skin", "people_hair"]
ROLLING = ConstantTwistTrajectory(Pose(), Twist([1e-3, 0.0, 0.0]))


@functools.cache
def meshes(name: str) -> dict[str, trimesh.Trimesh]:
    """Return the detailed meshes by shape id."""
    model = read_actor_model(name)
    found = {}
    for shape, element in model.level("detailed").shapes.items():
        file = next(str(e.get("value")) for e in element.iter("string") if e.get("name") == "filename")
        found[shape] = trimesh.load(model.path.parent / file, process=False)
    return found


def test_there_are_cars_with_windows():
    assert {"small_car", "saloon", "suv"} <= set(GLAZED)


def test_a_pane_lets_through_what_fresnel_and_its_tint_leave():
    """Incoherent sum over both faces: T = tint (1 - R) / (1 + R), R = ((n - 1) / (n + 1))^2; UN R43 wants 0.70."""
    element = read_actor_model("saloon").level("detailed").bsdfs["window_glass"]
    index = next(float(e.get("value")) for e in element.iter("float") if e.get("name") == "int_ior")
    tint = np.array([float(v) for v in next(e.get("value") for e in element.iter("rgb")).split()])
    single = ((index - 1.0) / (index + 1.0)) ** 2
    expected = tint * (1.0 - single) / (1.0 + single)
    assert expected.min() >= 0.70
    scene = f"""<scene version="3.0.0">{ET.tostring(element, encoding="unicode")}
    <shape type="rectangle"><transform name="to_world"><scale value="50"/><translate z="-2"/></transform>
      <emitter type="area"><rgb name="radiance" value="1, 1, 1"/></emitter></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="50"/></transform><ref id="window_glass"/></shape>
    <sensor type="orthographic"><transform name="to_world"><lookat origin="0, 0, 3" target="0, 0, 0" up="0, 1, 0"/>
      <scale x="0.1" y="0.1"/></transform><film type="hdrfilm"><integer name="width" value="8"/>
      <integer name="height" value="8"/><rfilter type="box"/></film><sampler type="independent"/></sensor></scene>"""
    with variant.optical() as mi:
        image = mi.render(
            mi.load_string(scene), integrator=mi.load_dict({"type": "path", "max_depth": 4}), spp=1024, seed=3
        )
        seen = np.array(image, dtype=np.float64)[..., :3].mean(axis=(0, 1))
    # 65,536 paths, each of which passes or not: 5 sigma
    tolerance = 5.0 * np.sqrt(expected * (tint - expected) / 65536.0) + 1e-5
    assert (np.abs(seen - expected) < tolerance).all()


@pytest.mark.parametrize("name", GLAZED)
def test_nothing_of_the_inside_sticks_out(name):
    """From every corner of seats, people, wheel and dashboard rays up, ahead, back and aside meet the body."""
    parts = meshes(name)
    hull = trimesh.util.concatenate(
        [parts[shape] for shape in ("body", "cab", "glass", "trim", "underbody") if shape in parts]
    )
    inside = [shape for shape in parts if shape == "seats" or shape.startswith("people_")]
    assert len(inside) == 4
    points = np.unique(np.concatenate([parts[shape].vertices for shape in inside]).round(4), axis=0)
    for direction in ([0.0, 0.0, 1.0], [1.0, 0.02, 0.0], [-1.0, 0.02, 0.0], [0.02, 1.0, 0.0], [0.02, -1.0, 0.0]):
        hit = hull.ray.intersects_any(points, np.tile(direction, (len(points), 1)))
        assert hit.all(), f"{np.count_nonzero(~hit)} corners outside, towards {direction}: {points[~hit][:3]}"
    top = points[[np.argmax(points[:, 2])]]
    roof = hull.ray.intersects_location(top, [[0.0, 0.0, 1.0]])[0]
    assert 0.03 < roof[:, 2].min() - top[0, 2] < (0.3 if name in SHAPES else 1.2)


def test_people_sit_in_cars_that_drive_and_not_in_parked_ones():
    shapes = {}
    for trajectory in (ROLLING, StaticTrajectory(Pose())):
        world = ss.stage("highway_guardrail", [ss.StagedActor("it", "saloon", trajectory)])
        shapes[type(trajectory)] = {name for name in world.parts.name if name.startswith("it_")}
    assert shapes[ConstantTwistTrajectory] - shapes[StaticTrajectory] == {
        "it_people_clothes", "it_people_skin", "it_people_hair"
    }  # fmt: skip # a table
    assert shapes[StaticTrajectory] < shapes[ConstantTwistTrajectory]


@pytest.fixture(scope="module")
def beside():
    """Return a state with a car, and a pose 6 m to its left that looks at the driver's head."""
    world = ss.stage("highway_guardrail", [ss.StagedActor("it", "saloon", ROLLING)])
    state = world.at(0.0)
    head = meshes("saloon")["people_skin"].vertices
    middle = head[head[:, 2] > head[:, 2].max() - 0.15].mean(axis=0)
    return state, Pose.from_euler(middle + [0.0, 6.0, 0.0], yaw=-np.pi / 2), middle


def test_a_pixel_through_glass_is_the_car_and_as_far_as_the_pane(beside):
    state, pose, _ = beside
    spec = CameraSpec(width=9, height=9, horizontal_fov_deg=1.0)
    labels = render_labels(state, spec, pose)
    instance = next(k for k, info in state.world.instances.items() if info.name == "it")
    assert (labels.instance == instance).all()
    parts = meshes("saloon")
    glass = parts["glass"].ray.intersects_location(pose.position[None], [[0.0, -1.0, 0.0]])[0]
    assert labels.depth[4, 4] == pytest.approx(pose.position[1] - glass[:, 1].max(), abs=0.01)
    assert labels.depth[4, 4] < 6.0 - 0.2  # the pane, not the head behind it


def test_the_lidar_meets_the_pane_and_the_driver_behind_it(beside):
    """What comes back of the driver has passed the pane twice: rho cos / d^2 times T(incidence)^2."""
    state, pose, _ = beside
    scan = RasterScan(azimuth_fov_deg=(-0.2, 0.2), elevation_fov_deg=(-0.2, 0.2), num_azimuth=3, num_elevation=3)
    spec = LidarSpec(
        scan=scan, max_surfaces=2, max_returns=2, sub_rays=1, atmospheric_attenuation=0.0, pane_reflections=False
    )
    found = Lidar(spec).observe(state, pose, np.random.default_rng(0))
    parts = meshes("saloon")
    rho = read_actor_model("saloon").materials
    direction = found.position.astype(float) / found.distance[:, None]
    order = np.argsort(found.distance)
    near, far = order[:9], order[9:]
    assert len(far) == 9 and found.distance[far].min() > found.distance[near].max() + 0.2
    assert len(set(found.instance)) == 1
    ways = pose.rotate(direction)
    starts = np.tile(pose.position, (len(ways), 1))
    for rows, shapes, names in ((near, ["glass"], ["window_glass"]), (far, PEOPLE, ["top", "skin", "hair"])):
        reflectance = [rho[name].lidar_reflectance for name in names]
        mesh = trimesh.util.concatenate([parts[shape] for shape in shapes])
        owner = np.repeat(np.arange(len(shapes)), [len(parts[shape].faces) for shape in shapes])
        place, ray, face = mesh.ray.intersects_location(starts[rows], ways[rows], multiple_hits=False)
        ray = np.argsort(ray)
        distance = np.linalg.norm(place[ray] - pose.position, axis=1)
        np.testing.assert_allclose(found.distance[rows], distance, atol=1e-4)
        cosine = np.abs(np.einsum("ij,ij->i", mesh.face_normals[face[ray]], ways[rows]))
        expected = np.array(reflectance)[owner[face[ray]]] * cosine / distance**2
        if rows is far:
            _, at, front = parts["glass"].ray.intersects_location(starts[rows], ways[rows], multiple_hits=False)
            tilt = np.abs(np.einsum("ij,ij->i", parts["glass"].face_normals[front[np.argsort(at)]], ways[rows]))
            expected *= pane_transmittance(0.65, tilt) ** 2
        np.testing.assert_allclose(found.intensity[rows], expected, rtol=1e-3)
