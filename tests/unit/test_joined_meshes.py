"""The optical twin, its meshes joined by BSDF in one group, against Mitsuba's own scene of the same XML."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scarl_sionna.engine import variant
from scarl_sionna.engine.light.windows import LitWindows, WindowTable
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.twins import optical_xml
from scarl_sionna.engine.world import World, WorldState
from tests.scenes import Material, Thing, ball, box, plane, write_scene

WAY = {"kind": "constant_twist", "position": [8, -2, 0], "velocity": [3, 1, 0], "angular_velocity_z": 0.7}
STAND = {"kind": "static", "position": [12, 3, 0]}
EYE = [-4.0, 0.5, 2.5]


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    path = write_scene(
        tmp_path_factory.mktemp("scene"),
        instances=[
            Thing("ground", plane(60, 60), "Roads", is_object=False),
            Thing("lamp", plane(1.0, 1.0, (6, 4, 5), (-1, 0, -1)), "Pole", emission=9.0),
            Thing("left", box((2, 2, 3), (10, 6, 1.5)), "Building", "steel"),
            Thing("house", plane(4.0, 3.0, (20, 0, 2), (-1, 0, 0)), "Building", "pane"),
            Thing("shelter", plane(3.0, 3.0, (15, -6, 2), (-1, 0, 0)), "Static", "pane"),
            Thing("front", plane(2.0, 3.0, (18, 7, 2), (-1, 0, 0)), "Building", "pane"),
        ],
        actors=[
            Thing("round", ball(1.0, (0, 0, 1), 2), "Car", "steel", WAY),
            Thing("block", box((1, 2, 1), (0, 0, 0.5)), "Car", "steel", WAY),
            Thing("other", box((1, 1, 1), (0, 0, 0.5)), "Car", "white", STAND),
        ],
        materials={"pane": Material((0.1, 0.2, 0.1), "glass", 0.05)},
    )
    text = path.read_text()  # this one is shaded smoothly
    smooth = 'value="round.ply" /><boolean name="face_normals" value="'
    assert smooth + "true" in text
    path.write_text(text.replace(smooth + "true", smooth + "false"))
    return load_scene(path)


def plain_scene(state: WorldState, folder: Path) -> Any:
    """Return the scene that Mitsuba makes of the twin's XML, its actors moved one by one."""
    world = state.world
    with variant.optical() as mi:
        scene = mi.load_string(optical_xml(world.document, None, folder, mi), optimize=False, parallel=False)
        params = mi.traverse(scene)
        for part, name in enumerate(world.parts.name):
            pose, normals = state.part_pose(part), np.array(params[f"{name}.vertex_normals"], dtype=np.float64)
            corners = pose.apply(world.mesh(part).vertices).astype(np.float32)
            params[f"{name}.vertex_positions"] = mi.Float(corners.ravel())
            if normals.size:
                params[f"{name}.vertex_normals"] = mi.Float(
                    pose.rotate(normals.reshape(-1, 3)).astype(np.float32).ravel()
                )
        params.update()
    return scene


def rays(count: int) -> np.ndarray:
    direction = np.random.default_rng(3).normal([2.0, 0.0, -0.3], 1.0, (count, 3))
    return direction / np.linalg.norm(direction, axis=1, keepdims=True)


def test_one_mesh_a_bsdf_in_one_group_and_lamps_apart(world: World) -> None:
    places = world.twin("optical").places
    number = {name.removeprefix("shape-"): place.number for name, place in places.items()}
    assert number["house"] == number["shelter"] == number["front"]
    # steel stands, moves with flat faces, and moves shaded smoothly
    assert len({number[name] for name in ("left", "block", "round")}) == 3
    assert len(set(number.values())) == len(number) - 2
    with variant.optical():
        shapes = world.at(0.0).optical_scene().shapes()
    assert {shape.id() for shape in shapes if shape.is_emitter()} == {"shape-lamp"} and len(shapes) == 2


def test_rays_meet_the_same_faces_after_every_move(world: World, tmp_path: Path) -> None:
    directions = rays(20_000)
    for time in (0.0, 1.1, 0.4):
        state = world.at(time)
        ours = state.cast(EYE, directions)
        scene = plain_scene(state, tmp_path)
        with variant.optical() as mi:
            import drjit as dr

            ids = {int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(s))[0]): s.id() for s in scene.shapes()}
            ray = mi.Ray3f(mi.Point3f(*EYE), mi.Vector3f(*(mi.Float(c) for c in directions.T.astype(np.float32))))
            found = scene.ray_intersect_preliminary(ray)
            number = dr.reinterpret_array(mi.UInt32, found.shape).numpy()[ours.ray]
            face, valid = found.prim_index.numpy()[ours.ray], found.is_valid().numpy()
        assert np.array_equal(np.flatnonzero(valid), ours.ray) and len(ours.ray) > 10_000
        assert [ids[n] for n in number] == [world.parts.name[part] for part in ours.part]
        assert np.array_equal(face, ours.face - state._triangles.first[ours.part])
        assert len(np.unique(ours.part)) == len(world.parts.name)  # each was met


def test_images_are_those_of_the_plain_scene(world: World, tmp_path: Path) -> None:
    state = world.at(1.1)
    plain = plain_scene(state, tmp_path)
    with variant.optical() as mi:
        to_world = mi.ScalarTransform4f().look_at(EYE, [10.0, 0.5, 1.0], [0, 0, 1])
        film = {"type": "hdrfilm", "width": 48, "height": 32}
        camera = mi.load_dict({"type": "perspective", "fov": 60, "to_world": to_world, "film": film})
        integrator = mi.load_dict({"type": "path", "max_depth": 4})
        joined, one_by_one = (
            np.array(mi.render(scene, sensor=camera, integrator=integrator, spp=16, seed=1))
            for scene in (state.optical_scene(), plain)
        )
    change = np.abs(joined - one_by_one).max(axis=-1) / one_by_one.max()
    assert one_by_one.std() > 0.1 * one_by_one.mean()  # a picture of something
    assert np.quantile(change, 0.98) < 1e-4 and change.mean() < 1e-3  # a ray in float32 may pass an edge on either side


def test_windows_of_joined_panes_are_found_by_their_faces(world: World) -> None:
    meshes = {name: world.mesh(part) for part, name in enumerate(world.parts.name)}
    windows = LitWindows.of(world.parts, meshes, 1.0)
    assert set(windows.faces) == {"shape-house", "shape-front"}
    state, directions = world.at(0.0), rays(20_000)
    hits = state.cast(EYE, directions)
    expected = np.full(len(directions), -1)
    for name, own in windows.faces.items():
        part = world.parts.name.index(name)
        met = hits.part == part
        expected[hits.ray[met]] = own[hits.face[met] - state._triangles.first[part]]
    with variant.optical() as mi:
        table = WindowTable(mi, world.twin("optical").places, windows)
        ray = mi.Ray3f(mi.Point3f(*EYE), mi.Vector3f(*(mi.Float(c) for c in directions.T.astype(np.float32))))
        si = state.optical_scene().ray_intersect(ray)
        assert np.array_equal(table.pane(si, si.is_valid()).numpy(), expected)
    assert {0, 1} <= set(expected.tolist())
