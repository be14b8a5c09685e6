"""Skinned glTF and BVH as bodies: places and velocities against closed forms, and files that are no such thing."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from examples.breathing_person import BREATH, BREATHS, ELBOW, WAVE, WAVES, Gltf, write_person
from scarl_sionna.core.untrusted.gltf_file import read_gltf
from scarl_sionna.scene.bodies.bvh import driven, read_bvh, read_bvh_body
from scarl_sionna.scene.bodies.curves import Curve
from scarl_sionna.scene.bodies.gltf import read_gltf_body

VERTICES = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.5, 0.2), (0.0, 0.5, -0.3)])
"""Exact in float32 but for 0.2 and 0.3, which are read as what they were rounded to."""


def bar(folder: Path, weights: np.ndarray, kind: str = "LINEAR", keys: int = 3) -> Path:
    """Two joints, the second one turning about z at 1 m from the first, and moving along y."""
    file = Gltf()
    times = np.linspace(0.0, 0.5 * (keys - 1), keys)
    angle = 1.25 * times
    turn = np.stack([0.0 * angle, 0.0 * angle, np.sin(angle / 2.0), np.cos(angle / 2.0)], axis=1)
    bind = np.repeat(np.eye(4)[None], 2, axis=0)
    bind[1, 0, 3] = -1.0
    attributes = {
        "POSITION": file.add(VERTICES, "VEC3"),
        "JOINTS_0": file.add([(0, 1, 0, 0)] * 4, "VEC4", "<u2"),
        "WEIGHTS_0": file.add(weights, "VEC4"),
    }
    faces = file.add([(0, 1, 2), (0, 2, 3), (0, 2, 1), (0, 3, 2)], "SCALAR", "<u2")
    file.tables |= {
        "meshes": [{"primitives": [{"attributes": attributes, "indices": faces}]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": file.add(bind.transpose(0, 2, 1), "MAT4")}],
        "nodes": [
            {
                "name": "bar",
                "mesh": 0,
                "skin": 0,
                "translation": [7.0, 7.0, 7.0],
            },  # of no account where there is a skin
            {"name": "root", "children": [2], "translation": [0.0, 0.0, 0.25]},
            {"name": "tip", "translation": [1.0, 0.0, 0.0]},
        ],
    }
    if kind == "CUBICSPLINE":
        rate = 0.625 * np.stack([0.0 * angle, 0.0 * angle, np.cos(angle / 2.0), -np.sin(angle / 2.0)], axis=1)
        file.channel(2, "rotation", times, np.stack([rate, turn, rate], axis=1), kind)
    else:
        file.channel(2, "rotation", times, turn, kind)
    file.channel(1, "translation", times, np.stack([0.0 * times, 0.5 * times, 0.0 * times + 0.25], axis=1))
    return file.write(folder / "bar.glb")


def test_a_bone_that_turns_carries_its_vertices_exactly(tmp_path):
    """Weights of 1: r = c + R(w t)(x - c) + v t and its derivative; 1.25 rad/s of float32 quaternions: 1e-6 m/s."""
    body = read_gltf_body(bar(tmp_path, np.tile([0.0, 1.0, 0.0, 0.0], (4, 1))))
    for time in (0.0, 0.1, 0.4999, 0.5, 0.83):
        place, speed = body.at(time)["bar"]
        pivot = np.array([1.0, 0.0, 0.0])
        arm = Rotation.from_rotvec([0.0, 0.0, 1.25 * time]).apply(VERTICES - pivot)
        np.testing.assert_allclose(place, pivot + arm + [0.0, 0.5 * time, 0.25], atol=2e-7)
        np.testing.assert_allclose(speed, np.cross([0.0, 0.0, 1.25], arm) + [0.0, 0.5, 0.0], atol=1e-6)
    assert (body.start, body.stop) == (0.0, 1.0)
    np.testing.assert_array_equal(body.at(2.0)["bar"][1], 0.0)  # it stays where it stopped


@pytest.mark.parametrize("kind", ["LINEAR", "CUBICSPLINE", "SMOOTH"])
def test_velocities_of_blended_vertices_are_the_derivative(tmp_path, kind):
    """Central difference in float64: error h^2 f''' / 6 = 4e-10 and 1e-16 / h = 1e-11 for h = 1e-5."""
    shares = np.array([(0.5, 0.5, 0.0, 0.0), (0.25, 0.75, 0.0, 0.0), (0.9, 0.1, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)])
    file = bar(tmp_path, shares, "LINEAR" if kind == "SMOOTH" else kind, keys=6)
    body = read_gltf_body(file, smooth=kind == "SMOOTH")
    step = 1e-5
    for time in (0.3, 0.77, 1.9):
        speed = body.at(time)["bar"][1]
        ends = [body.at(time + sign * step)["bar"][0] for sign in (-1.0, 1.0)]
        np.testing.assert_allclose(speed, (ends[1] - ends[0]) / (2.0 * step), atol=1e-8)
        assert np.abs(speed).max() > 0.3


def test_kinks_of_linear_keys_and_none_of_smooth_ones():
    times, values = np.array([0.0, 1.0, 2.0, 3.0]), np.array([[0.0], [1.0], [0.0], [1.0]])
    steps = [
        [Curve(times, values, kind).at(1.0 + sign * 1e-9)[1][0] for sign in (-1.0, 1.0)]
        for kind in ("LINEAR", "SMOOTH")
    ]
    np.testing.assert_allclose(steps[0], [1.0, -1.0])
    assert abs(steps[1][1] - steps[1][0]) < 1e-7
    held = Curve(times, values, "STEP")
    again = pickle.loads(pickle.dumps(Curve(times, values, "SMOOTH")))
    assert again.at(1.5) == Curve(times, values, "SMOOTH").at(1.5)
    assert held.at(1.5) == (1.0, 0.0) and held.at(-1.0)[0] == 0.0 and held.at(9.0)[0] == 1.0


def test_a_person_breathes_and_waves(tmp_path):
    body = read_gltf_body(write_person(tmp_path / "person.glb"), smooth=True)
    assert body.stop == 4.0 and set(body.skins) == {"person"}
    skin = body.skins["person"]
    front = skin.targets[0, :, 2] > 0.0
    hand = skin.weights[:, 1] == 1.0
    for time in (0.3, 1.1, 2.7):
        place, speed = body.at(time)["person"]
        phase = 2.0 * np.pi * BREATHS * time
        np.testing.assert_allclose(place[front, 2] - skin.vertices[front, 2], BREATH * np.sin(phase), atol=1e-8)
        np.testing.assert_allclose(speed[front, 2], BREATH * 2.0 * np.pi * BREATHS * np.cos(phase), atol=1e-6)
        rate = WAVE * 2.0 * np.pi * WAVES * np.cos(2.0 * np.pi * WAVES * time)
        swing = np.cross([0.0, 0.0, rate], place[hand] - ELBOW)
        np.testing.assert_allclose(speed[hand], swing, atol=1e-3 * abs(rate))  # a spline through 40 keys a swing


BVH = """HIERARCHY
ROOT hip
{
  OFFSET 0 1 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT knee
  {
    OFFSET 0 -0.5 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 -0.4 0
    }
  }
}
MOTION
Frames: 5
Frame Time: 0.25
0 0 0 0 0 0 0 0 0
0.1 0 0 10 20 30 5 10 0
0.2 0 0 20 40 60 10 20 0
0.3 0 0 30 60 90 15 30 0
0.4 0 0 40 80 120 20 40 0
"""


def test_bones_of_a_bvh_turn_in_the_order_of_their_channels(tmp_path):
    (tmp_path / "leg.bvh").write_text(BVH)
    skeleton = read_bvh(tmp_path / "leg.bvh")
    whole, _ = skeleton.at(0.5)
    hip = Rotation.from_euler("ZXY", [20.0, 40.0, 60.0], degrees=True)
    np.testing.assert_allclose(whole[0, :, :3], hip.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(whole[0, :, 3], [0.2, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(whole[1, :, 3], [0.2, 1.0, 0.0] + hip.apply([0.0, -0.5, 0.0]), atol=1e-12)
    body = read_bvh_body(tmp_path / "leg.bvh")
    vertices, speed = body.at(0.6)["body"]
    ends = [body.at(0.6 + sign * 1e-5)["body"][0] for sign in (-1.0, 1.0)]
    np.testing.assert_allclose(speed, (ends[1] - ends[0]) / 2e-5, atol=1e-7)
    assert body.stop == 1.0 and vertices.shape == speed.shape
    rest = body.at(0.0)["body"][0]  # from the hip at 1 m to the toe at 0.1 m, with the ends of the capsules
    np.testing.assert_allclose([rest[:, 1].min(), rest[:, 1].max()], [0.1 - 0.15 * 0.4, 1.0 + 0.15 * 0.5], atol=1e-9)


def test_a_skinned_mesh_takes_the_motion_of_bones_of_its_names(tmp_path):
    """Nodes whose axes are turned at rest: each turns in space as its bone does."""
    (tmp_path / "leg.bvh").write_text(BVH)
    file = Gltf()
    quarter = [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
    attributes = {
        "POSITION": file.add(VERTICES, "VEC3"),
        "JOINTS_0": file.add([(1, 0, 0, 0)] * 4, "VEC4", "<u2"),
        "WEIGHTS_0": file.add([(1, 0, 0, 0)] * 4, "VEC4"),
    }
    rest = Rotation.from_quat(quarter)
    bind = np.repeat(np.eye(4)[None], 2, axis=0)
    for k, place in enumerate(([0.0, 1.0, 0.0], [0.0, 0.5, 0.0])):
        bind[k, :3, :3] = rest.inv().as_matrix()
        bind[k, :3, 3] = -rest.inv().apply(place)
    file.tables |= {
        "meshes": [{"primitives": [{"attributes": attributes, "indices": file.add([0, 1, 2], "SCALAR", "<u2")}]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": file.add(bind.transpose(0, 2, 1), "MAT4")}],
        "nodes": [
            {"name": "leg", "mesh": 0, "skin": 0},
            {"name": "hip", "children": [2], "translation": [0.0, 1.0, 0.0], "rotation": quarter},
            {"name": "knee", "translation": rest.inv().apply([0.0, -0.5, 0.0]).tolist()},
        ],
    }
    motion = read_bvh(tmp_path / "leg.bvh")
    body = driven(read_gltf_body(file.write(tmp_path / "leg.glb")), motion)
    bones, _ = motion.at(0.6)
    place, _ = body.at(0.6)["leg"]
    expected = (VERTICES - [0.0, 0.5, 0.0]) @ bones[1, :, :3].T + bones[1, :, 3]
    np.testing.assert_allclose(place, expected, atol=1e-6)
    with pytest.raises(ValueError, match="'knee' of the motion is no node"):
        driven(read_gltf_body(bar(tmp_path, np.tile([1.0, 0.0, 0.0, 0.0], (4, 1)))), _renamed(motion, "hip", "root"))


def _renamed(skeleton, old, new):
    from dataclasses import replace

    return replace(skeleton, names=tuple(new if name == old else name for name in skeleton.names))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t["nodes"][1].update(children=[1]), "their own parents"),
        (lambda t: t["nodes"][1].update(children=[9]), "node 9"),
        (lambda t: t["skins"][0].update(joints=[1]), "joints beyond the 1"),
        (lambda t: t["accessors"][0].update(count=10**6), "beyond its bytes"),
        (lambda t: t["accessors"][0].update(type="VEC9"), "VEC9"),
        (lambda t: t["bufferViews"][0].update(buffer=3), "buffer"),
        (lambda t: t["meshes"][0]["primitives"][0].update(mode=5), "mode 5"),
        (lambda t: t["meshes"][0]["primitives"][0]["attributes"].pop("JOINTS_0"), "JOINTS_0"),
        (lambda t: t["animations"][0]["samplers"][0].update(interpolation="WAVY"), "WAVY"),
        (lambda t: t["animations"][0]["samplers"][0].update(output=0), "VEC3"),
        (lambda t: t.update(extensionsRequired=["KHR_draco_mesh_compression"]), "draco"),
        (lambda t: t.update(buffers=[{"byteLength": 4, "uri": "../../etc/passwd"}]), "not beside"),
        (lambda t: t["nodes"][1].update(translation=["a", 0, 0]), "translation"),
    ],
)
def test_a_contradiction_in_a_gltf_is_told(tmp_path, change, message):
    file = read_gltf(bar(tmp_path, np.tile([1.0, 0.0, 0.0, 0.0], (4, 1))))
    tables = json.loads(json.dumps(file.text))
    (tmp_path / "data.bin").write_bytes(file.buffers[0])
    tables["buffers"] = [{"byteLength": len(file.buffers[0]), "uri": "data.bin"}]
    path = tmp_path / "changed.gltf"
    path.write_text(json.dumps(tables))
    assert read_gltf_body(path).at(0.2)["bar"][0].shape == (4, 3)  # unchanged it is read
    change(tables)
    path.write_text(json.dumps(tables))
    with pytest.raises(ValueError, match=message):
        read_gltf_body(path)


def test_a_packed_file_is_the_same_body(tmp_path):
    whole = bar(tmp_path, np.tile([0.5, 0.5, 0.0, 0.0], (4, 1)))
    (tmp_path / "again.glb").write_bytes(read_gltf(whole).packed())
    for one, other in zip(
        read_gltf_body(whole).at(0.3)["bar"], read_gltf_body(tmp_path / "again.glb").at(0.3)["bar"], strict=True
    ):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("seed", range(40))
def test_damaged_bytes_give_no_other_error(tmp_path, seed):
    generator = np.random.default_rng(seed)
    for name, read in (("bar.glb", read_gltf_body), ("leg.bvh", read_bvh_body)):
        path = bar(tmp_path, np.tile([1.0, 0.0, 0.0, 0.0], (4, 1))) if name == "bar.glb" else tmp_path / name
        if name == "leg.bvh":
            path.write_text(BVH)
        data = bytearray(path.read_bytes())
        for place in generator.integers(0, len(data), 3):
            data[place] = generator.integers(32, 127)
        path.write_bytes(data[: int(generator.integers(len(data) // 2, len(data) + 1))])
        try:
            read(path).at(0.1)
        except (ValueError, OSError):
            continue


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("HIERARCHY", "H", "HIERARCHY"),
        ("Zrotation Xrotation Yrotation\n    End", "Zrotation Xrotation Wrotation\n    End", "knee"),
        ("Frames: 5", "Frames: 6", "45 numbers for 6 frames"),
        ("0.25", "0", "no motion"),
        ("JOINT knee", "ROOT knee", "ROOT"),
        ("0.4 0 0 40", "nan 0 0 40", "not finite"),
        ("MOTION", "", "cut|expected"),
    ],
)
def test_a_contradiction_in_a_bvh_is_told(tmp_path, old, new, message):
    (tmp_path / "leg.bvh").write_text(BVH.replace(old, new, 1))
    with pytest.raises(ValueError, match=message):
        read_bvh_body(tmp_path / "leg.bvh")
