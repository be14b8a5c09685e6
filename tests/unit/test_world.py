"""Loading of scenes, states over time, both twins, ray casting, and bad scenes."""

from __future__ import annotations

import gc
import weakref
from pathlib import Path

import numpy as np
import pytest
import trimesh

from scarl_sionna.core.errors import (
    InputTypeError,
    MaterialError,
    MeshError,
    SceneError,
    TimeRangeError,
    UnknownNameError,
)
from scarl_sionna.engine import variant
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.variant import mitsuba, optical, radio
from scarl_sionna.engine.world import World
from tests.scenes import Thing, box, plane, write_scene

WAY = {"kind": "waypoints", "times": [0.0, 1.0, 2.0], "positions": [[10, 0, 0], [12, 0, 0], [14, 0, 0]]}
TURN = {"kind": "constant_twist", "position": [30, 0, 0], "velocity": [1, 2, 0], "angular_velocity_z": 0.5}
BOX_XML = (
    '<scene version="3.0.0"><bsdf type="{bsdf}" id="{material}"/><shape type="{plugin}" id="box">'
    '<string name="filename" value="{file}"/><ref id="{material}"/></shape></scene>'
)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    path = write_scene(
        tmp_path_factory.mktemp("scene"),
        instances=[
            Thing("ground", plane(400, 400), "Roads", is_object=False),
            Thing("house", box((10, 6, 8), (50, 20, 4)), "Building"),
        ],
        actors=[
            Thing("car", box((4, 2, 1.5), (0, 0, 0.95)), "Car", "steel", WAY),
            Thing("top", box((2, 2, 2), (0, 0, 1.2)), "Other", "steel", TURN),
        ],
    )
    return load_scene(path)


def test_a_world_that_nobody_holds_is_gone_at_once(tmp_path: Path) -> None:
    """Dr.Jit's kernels hold how many shapes of all worlds there are: one that lingers makes the next compile anew."""

    def used() -> weakref.ref[World]:
        path = write_scene(tmp_path, [Thing("car", box((4, 2, 1.5), (0, 0, 0.95)), "Car", "steel", WAY)])
        lost = load_scene(path)
        state = lost.at(0.5)
        state.optical_scene()
        state.radio_scene()
        assert lost.twin("optical").stands_in(state)
        assert not lost.twin("optical").stands_in(lost.at(0.5))
        return weakref.ref(lost)

    used()  # what is imported on first use may hold the frames of its caller
    gc.collect()
    gc.disable()
    try:
        assert used()() is None
    finally:
        gc.enable()


def test_parts_instances_and_actors(world: World) -> None:
    assert world.parts.name == ("shape-ground", "shape-house", "shape-car", "shape-top")
    assert world.parts.instance.tolist() == [1, 2, 3, 4]
    assert world.parts.actor.tolist() == [-1, -1, 0, 1]
    assert world.parts.material == ("concrete", "concrete", "metal", "metal")
    assert [actor.name for actor in world.actors] == ["car", "top"]
    assert world.time_range == (0.0, 2.0)
    with pytest.raises(UnknownNameError, match="did you mean 'car'"):
        world.actor("cat")
    assert world.ego is None
    with pytest.raises(InputTypeError, match="without an ego vehicle.*the actors of this scene: car, top"):
        world.at(0.0).mount(world.ego)


def test_actor_moves_and_its_hits_carry_its_velocity(world: World) -> None:
    for time in (0.0, 0.7, 2.0, 0.0):  # back again too: the twin must follow
        hits = world.at(time).cast([0, 0, 1.0], [[1, 0, 0]])
        # box from -2 to 2 m about the actor's origin at 10 + 2 t; float64 plane: only the mesh's float32 corners round
        np.testing.assert_allclose(hits.distance, [10 + 2 * time - 2], atol=1e-9)
        np.testing.assert_allclose(hits.velocity, [[2, 0, 0]], atol=1e-9)
        np.testing.assert_allclose(hits.normal, [[-1, 0, 0]], atol=1e-12)


def test_rotating_actor_has_the_velocity_of_its_surface(world: World) -> None:
    state = world.at(0.0)
    hits = state.cast([30, -50, 1.0], [[0, 1, 0]])
    offset = hits.point[0] - [30, 0, 0]
    np.testing.assert_allclose(hits.velocity[0], np.array([1, 2, 0]) + np.cross([0, 0, 0.5], offset), atol=1e-12)
    assert np.linalg.norm(hits.velocity[0] - [1, 2, 0]) == pytest.approx(0.5, abs=1e-6)


def test_velocities_of_all_faces_are_those_of_their_centroids(world: World) -> None:
    state = world.at(1.0)
    triangles, count = state._triangles, np.diff(state._triangles.first)
    part = np.repeat(np.arange(len(count)), count)
    expected = state.point_velocity(part, triangles.corners.mean(axis=1))
    assert expected.any() and not expected.any(axis=1).all()  # some move, some do not
    np.testing.assert_array_equal(state._face_velocity, expected)


def test_both_twins_hit_the_same(world: World) -> None:
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(5000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    state = world.at(1.3)
    seen = [state.cast([0, 3, 2.0], directions, twin=kind) for kind in ("optical", "radio")]
    np.testing.assert_array_equal(seen[0].part, seen[1].part)
    np.testing.assert_allclose(seen[0].distance, seen[1].distance, rtol=1e-12)


def test_state_is_applied_to_the_images_and_to_sionna(world: World) -> None:
    state = world.at(2.0)
    with optical() as mi:
        ray = mi.Ray3f(mi.Point3f(0.0, 0.0, 1.0), mi.Vector3f(1.0, 0.0, 0.0))
        assert float(state.optical_scene().ray_intersect(ray).p.x[0]) == pytest.approx(12.0, abs=1e-5)
    with radio():
        item = next(item for name, item in state.radio_scene().objects.items() if "car" in name)
        assert float(item.velocity.x[0]) == pytest.approx(2.0)
        assert float(item.mi_mesh.bbox().min[0]) == pytest.approx(12.0, abs=1e-5)


def test_variant_is_given_back(world: World) -> None:
    mi = mitsuba()
    with optical():
        with radio():
            assert mi.variant().endswith("mono_polarized")
        assert mi.variant().endswith("ad_rgb")


def test_variant_of_the_caller_is_given_back_and_ours_is_left(world: World) -> None:
    mi = mitsuba()
    mi.set_variant("scalar_rgb")  # the caller's own choice
    with radio():
        pass
    assert mi.variant() == "scalar_rgb"
    with optical():
        pass
    assert mi.variant() == "scalar_rgb"
    with radio():
        mine = mi.variant()
    mi.set_variant(mine)  # as if nobody but us had ever chosen one
    with radio():
        with optical():
            pass
        assert mi.variant() == mine  # an enclosing block gets its own back
    variant._Blocks.left = mine  # no caller's choice for the tests that follow
    with optical():
        pass
    assert mi.variant().endswith("ad_rgb")  # left: nobody chose the other one


def test_a_switch_rewrites_no_function_again() -> None:
    """Integrators of a variant are classes of their own, with the code that Dr.Jit made of them the first time."""
    import drjit
    from mitsuba.python.ad.integrators import prb

    rewrite, made = drjit.syntax, []
    for _ in range(2):
        with optical():
            with radio():
                pass
            made.append(prb.PRBIntegrator.sample)
    assert made[0] is not made[1] and made[0].__code__ is made[1].__code__
    assert "while_loop" in made[0].__code__.co_names or "_drjit_ast" in made[0].__code__.co_names
    assert drjit.syntax is rewrite


def test_boxes_of_instances_hold_their_parts(world: World) -> None:
    state = world.at(1.0)
    lower, upper = state._instance_bounds
    for row, info in enumerate(world.instances.values()):
        points = state._triangles.of_parts(info.parts).reshape(-1, 3)
        np.testing.assert_array_equal([lower[row], upper[row]], [points.min(axis=0), points.max(axis=0)])


def test_boxes(world: World) -> None:
    boxes = {item.name: item for item in world.at(1.0).boxes()}
    assert set(boxes) == {"house", "car", "top"}
    np.testing.assert_allclose(boxes["car"].world_from_box.position, [12, 0, 0.95], atol=1e-6)
    np.testing.assert_allclose(boxes["car"].size, [4, 2, 1.5], atol=1e-6)
    np.testing.assert_allclose(boxes["car"].twist.linear, [2, 0, 0], atol=1e-9)
    np.testing.assert_allclose(boxes["house"].world_from_box.position, [50, 20, 4], atol=1e-5)
    assert sorted(boxes["house"].size) == pytest.approx([6, 8, 10], abs=1e-5)


def test_inside(world: World) -> None:
    state = world.at(0.0)
    for _ in range(2):  # by solid angles, and again with the scene of the rays at hand
        assert state.inside([10, 0, 1.0]) == "car"
        assert state.inside([50, 20, 4]) == "house"
        assert state.inside([0, 0, 1.0]) is None
        assert state.inside([0, 0, 1e-3]) is None  # just above a large open plane
        world.twin("optical")
    assert world.at(2.0).inside([10, 0, 1.0]) is None  # the car has left


def test_cabin_behind_separate_panes_is_inside() -> None:
    highway = load_scene("highway_guardrail")
    state = highway.at(0.0)
    assert state.inside([0.0, 0.0, 1.0]) == "ego"
    assert state.inside([2.36, 0.0, 0.8]) is None  # where the rig's front sensors stand
    assert state.inside([0.0, 0.0, 0.05]) is None  # under the car


def test_room_may_be_stood_in(tmp_path: Path) -> None:
    assert load_scene("box").at(0.0).inside([0, 0, 1.0]) is None  # Sionna's room of 10 x 10 x 5 m, no scene.toml
    path = write_scene(tmp_path, [Thing("hall", box((8, 8, 4)), "Building")])
    assert load_scene(path).at(0.0).inside([0, 0, 0]) == "hall"
    toml = tmp_path / "scene.toml"
    toml.write_text(toml.read_text().replace("object = true", "object = true\nroom = true"))
    assert load_scene(path).at(0.0).inside([0, 0, 0]) is None


def test_time_outside(world: World) -> None:
    with pytest.raises(TimeRangeError, match="'car'"):
        world.at(2.5)
    with pytest.raises(TimeRangeError):
        world.at(float("nan"))


def test_max_distance_and_no_rays(world: World) -> None:
    state = world.at(0.0)
    assert state.cast([0, 0, 1.0], [[1, 0, 0]], max_distance=7.9).num_hits == 0
    assert state.cast([0, 0, 1.0], np.zeros((0, 3))).num_hits == 0


def test_batches_join(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    angle = np.linspace(-1.0, 1.0, 1000)
    directions = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    state = world.at(0.0)
    whole = state.cast([0, 0, 1.0], directions)
    monkeypatch.setattr("scarl_sionna.engine.rays.cast.RAYS_PER_BATCH", 99)
    pieces = state.cast([0, 0, 1.0], directions)
    for name in vars(whole):
        np.testing.assert_array_equal(getattr(whole, name), getattr(pieces, name))


def test_sionna_scene_loads_at_77_ghz() -> None:
    street = load_scene("simple_street_canyon_with_cars")  # brick and marble have no ITU data at 77 GHz
    state = street.at(0.0)
    with radio():
        assert len(state.radio_scene().objects) == len(street.parts.name)
    assert {"Car", "Building"} <= {info.name and _class(info.semantic) for info in street.instances.values()}


def _class(semantic: int) -> str:
    from scarl_sionna.core.semantics import SEMANTIC_CLASSES

    return SEMANTIC_CLASSES[semantic]


def test_unknown_scene() -> None:
    with pytest.raises(UnknownNameError, match="munich"):
        load_scene("munchen")


def _write(
    folder: Path, bsdf: str = "diffuse", material: str = "concrete", plugin: str = "ply", file: str = "box.ply"
) -> Path:
    box((2, 2, 2)).export(folder / "box.ply")
    path = folder / "one.xml"
    path.write_text(BOX_XML.format(bsdf=bsdf, material=material, plugin=plugin, file=file))
    return path


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"file": "lost.ply"}, SceneError, "'lost.ply' is missing"),
        ({"bsdf": "difuse"}, SceneError, "difuse"),
        ({"plugin": "heightfield"}, SceneError, "only meshes"),
        ({"material": "kryptonite"}, MaterialError, "kryptonite"),
    ],
)
def test_bad_scene(tmp_path: Path, change: dict[str, str], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        load_scene(_write(tmp_path, **change))


@pytest.mark.parametrize("text", ["<scene", "<html/>", ""])
def test_broken_xml(tmp_path: Path, text: str) -> None:
    path = tmp_path / "broken.xml"
    path.write_text(text)
    with pytest.raises(SceneError, match=r"broken\.xml"):
        load_scene(path)


def test_bad_meshes(tmp_path: Path) -> None:
    path = _write(tmp_path)
    file = tmp_path / "box.ply"
    whole = file.read_bytes()
    vertices = box((2, 2, 2)).vertices.copy()
    vertices[0] = np.nan
    trimesh.Trimesh(vertices, box((2, 2, 2)).faces, process=False).export(file)
    with pytest.raises(MeshError, match="invalid vertex position"):
        load_scene(path)
    file.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(MeshError, match="bytes"):
        load_scene(path)
    file.write_bytes(whole.replace(b"element face 12", b"element face 0"))
    with pytest.raises(MeshError, match="no faces"):
        load_scene(path)
    file.write_bytes(b"not a mesh")
    with pytest.raises(MeshError, match="not a PLY"):
        load_scene(path)


@pytest.mark.parametrize(
    ("toml", "error", "message"),
    [
        ("[[instances", SceneError, "TOML"),
        ('[[instances]]\nname="x"\nclass="Car"\nshapes=["wheel*"]', SceneError, "no shape of the XML matches"),
        ('[[instances]]\nname="x"\nclass="Caar"\nshapes=["box"]', UnknownNameError, "did you mean 'Car'"),
        ('[[instances]]\nname="x"\nshapes=["box"]', SceneError, "lacks 'class'"),
        ('[[instances]]\nname="x"\nclass="Car"\nshapes=["box"]\ncolour="red"', UnknownNameError, "colour"),
        ('[scene]\nego="x"\n[[instances]]\nname="x"\nclass="Car"\nshapes=["box"]', UnknownNameError, "ego"),
        ('[scene]\negoo="x"', UnknownNameError, "did you mean 'ego'"),
        ('[materials.concrete]\nradio="concrete"\nlidar_reflectence=0.4', UnknownNameError, "'lidar_reflectance'"),
        ('[materials.concrete]\nradio="concrete"\nroughness_rms=0.004', UnknownNameError, "roughness_rms"),
        ('[materials.concret]\nradio="concrete"', UnknownNameError, "did you mean 'concrete'"),
        ('instances = []\n[scene]\nname="n"', SceneError, "belong to no instance: box"),
        (
            '[[instances]]\nname="x"\nclass="Car"\nshapes=["box"]\n[materials.concrete]\nradio="concrete"\n'
            "lidar_reflectance=1.5",
            MaterialError,
            "1.5",
        ),
    ],
)
def test_bad_toml(tmp_path: Path, toml: str, error: type[Exception], message: str) -> None:
    path = _write(tmp_path)
    (tmp_path / "scene.toml").write_text(toml)
    with pytest.raises(error, match=message):
        load_scene(path)
