"""Mitsuba's analytic shapes, and stretched shapes of actors, in a user's own XML."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from camera_lidar import Camera, Lidar
from scarl_sionna.core.errors import SceneError
from scarl_sionna.scene.document.analytic import SAGITTA, linear_part

SHAPES = """
<shape type="rectangle" id="ground"><transform name="to_world"><scale value="50"/></transform>{ref}</shape>
<shape type="sphere" id="ball"><point name="center" x="10" y="0" z="1"/><float name="radius" value="0.7"/>{ref}</shape>
<shape type="cylinder" id="post"><point name="p0" value="12, 3, 0"/><point name="p1" value="12, 3, 2"/>
  <float name="radius" value="0.1"/>{ref}</shape>
<shape type="disk" id="plate"><transform name="to_world"><scale value="0.5"/><rotate y="1" angle="-90"/>
  <translate x="15" y="-3" z="2"/></transform>{ref}</shape>
<shape type="cube" id="crate"><transform name="to_world"><scale x="2" y="1" z="0.75"/><rotate z="1" angle="30"/>
  <translate x="7"/></transform>{ref}</shape>
"""


def scene(tmp_path: Path, shapes: str = SHAPES) -> Path:
    text = (
        '<scene version="3.0.0"><bsdf type="diffuse" id="concrete"/><emitter type="constant"/>'
        f"{shapes.format(ref='<ref id=' + chr(34) + 'concrete' + chr(34) + '/>')}</scene>"
    )
    path = tmp_path / "own.xml"
    path.write_text(text)
    toml = '[scene]\nname = "own"\n[materials.concrete]\nradio = "concrete"\nlidar_reflectance = 0.5\n'
    for shape in (element.get("id") for element in ET.fromstring(text).findall("shape")):
        kind = "actors" if shape == "crate" else "instances"
        toml += f'[[{kind}]]\nname = "{shape}"\nclass = "Static"\nshapes = ["{shape}"]\n'
        if shape == "crate":
            toml += '[actors.trajectory]\nkind = "static"\nposition = [20.0, 0.0, 0.75]\n'
    (tmp_path / "scene.toml").write_text(toml)
    return path


def shot(world: ss.World, towards: np.ndarray, origin: np.ndarray) -> tuple[float, str]:
    state = world.at(0.0)
    hits = state.cast(origin, towards[None] / np.linalg.norm(towards))
    if hits.num_hits == 0:
        return np.inf, ""
    return float(hits.distance[0]), world.parts.name[hits.part[0]]


def test_analytic_shapes_are_where_mitsuba_has_them(tmp_path: Path) -> None:
    world = ss.load_scene(scene(tmp_path))
    eye = np.array([0.0, 0.0, 2.0])
    for target, expected, name in (
        ([10.0, 0.013, 1.0], np.sqrt(101.0 + 0.013**2) - np.sqrt(0.49 - 0.013**2), "ball"),
        ([12.0, 3.0, 1.0], np.linalg.norm([12.0, 3.0, 1.0]) * (1.0 - 0.1 / np.hypot(12.0, 3.0)), "post"),
        ([15.0, -3.0, 2.0], np.linalg.norm([15.0, -3.0, 0.0]), "plate"),
        ([5.0, 1.0, 0.0], np.linalg.norm([5.0, 1.0, -2.0]), "ground"),
    ):
        distance, found = shot(world, np.array(target) - eye, eye)
        assert found == name
        assert expected - 1e-4 <= distance <= expected + 1.1 * SAGITTA + 1e-4
    edge = np.array([15.0, -3.0 + 0.499, 2.0])
    assert shot(world, edge - eye, eye)[1] == "plate"
    assert shot(world, edge + [0.0, 0.003, 0.0] - eye, eye)[1] != "plate"


def test_normals_of_curved_shapes_point_outwards(tmp_path: Path) -> None:
    world = ss.load_scene(scene(tmp_path))
    for name, centre in (("ball", [10.0, 0.0, 1.0]), ("post", [12.0, 3.0, 1.0])):
        mesh = world.mesh(world.parts.name.index(name))
        corners = np.asarray(mesh.vertices, dtype=np.float64)[np.asarray(mesh.faces)]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (np.einsum("ij,ij->i", normal, corners.mean(axis=1) - centre) > 0.0).all()


def test_a_stretched_shape_of_an_actor_keeps_its_size_and_not_its_place(tmp_path: Path) -> None:
    state = ss.load_scene(scene(tmp_path)).at(0.0)
    crate = next(item for item in state.boxes() if item.name == "crate")
    np.testing.assert_allclose(crate.size, [4.0, 2.0, 1.5], atol=1e-5)
    np.testing.assert_allclose(crate.world_from_box.position, [20.0, 0.0, 0.75], atol=1e-5)


def test_every_sensor_sees_them(tmp_path: Path) -> None:
    state = ss.load_scene(scene(tmp_path)).at(0.0)
    pose = ss.Pose([0.0, 0.0, 1.0])
    image = Camera(ss.CameraSpec(width=160, height=90, images=("instance",))).observe(state, pose, _rng())
    assert len(np.unique(image.instance)) >= 5
    scan = Lidar(ss.LidarSpec(num_azimuth=360, num_elevation=32)).observe(state, pose, _rng())
    assert len(np.unique(scan.instance)) == 5
    small = SHAPES.replace('"50"', '"0.5"')  # the ground far from the radar's way
    state = ss.load_scene(scene(tmp_path, small)).at(0.0)
    paths = ss.solve_paths(state, ss.RadarSpec(), pose, method="sbr")
    ball = next(number for number, info in state.world.instances.items() if info.name == "ball")
    mine = (paths.instance == ball).any(axis=1)
    assert mine.any() and paths.length[mine].min() / 2.0 == pytest.approx(9.3, abs=0.01)


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ('<shape type="sphere" id="a"><float name="radius" value="-1"/>{ref}</shape>', "radius .* -1.0 m"),
        ('<shape type="sphere" id="a"><float name="radius" value="much"/>{ref}</shape>', "'much' is no number"),
        ('<shape type="cylinder" id="a"><point name="p1" x="0"/>{ref}</shape>', "one point"),
        ('<shape type="sdfgrid" id="a">{ref}</shape>', "only meshes"),
        (
            '<shape type="cube" id="crate"><transform name="to_world"><scale x="-1"/></transform>{ref}</shape>',
            "mirrors or flattens",
        ),
        (
            '<shape type="disk" id="a"><transform name="to_world"><bend/></transform>{ref}</shape>',
            "<bend> is no step of a transform",
        ),
    ],
)
def test_what_cannot_be_is_named(tmp_path: Path, shape: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        ss.load_scene(scene(tmp_path, shape))


def test_transforms_are_mitsubas() -> None:
    import mitsuba as mi

    text = (
        '<transform name="to_world"><scale x="2" y="1" z="0.5"/><rotate y="0.6" z="0.8" angle="40"/>'
        '<lookat origin="1, 2, 3" target="4, 0, 1" up="0, 0, 1"/><matrix value="1 2 0 0 1 0 0 0 1"/></transform>'
    )
    step = mi.ScalarTransform4f
    whole = (
        step(np.array([[1.0, 2, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]))
        @ step().look_at(origin=[1, 2, 3], target=[4, 0, 1], up=[0, 0, 1])
        @ step().rotate([0.0, 0.6, 0.8], 40.0)
        @ step().scale([2, 1, 0.5])
    )
    np.testing.assert_allclose(linear_part(ET.fromstring(text), Path("x")), np.array(whole.matrix)[:3, :3], atol=1e-6)


def _rng() -> np.random.Generator:
    return np.random.default_rng(0)
