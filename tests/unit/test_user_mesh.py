"""Meshes of a user's own as actors.

Read, turned upright, put on the ground, and refused with a remedy where they cannot be right.
"""

from __future__ import annotations

import multiprocessing
import pickle
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

import scarl_sionna as ss
from camera_lidar import Camera
from scarl_sionna.core.errors import MaterialError, MeshError, ParameterRangeError, ScarlWarning, UnknownNameError
from scarl_sionna.scene.actors.mesh_checks import open_edges
from scarl_sionna.scene.motion.trajectory import StaticTrajectory
from tests.scenes import Thing, plane, write_scene

pytestmark = pytest.mark.own_process(shared=True)  # beside what a worker has already, it would pass the bound of memory


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SCARL_CACHE_DIR", str(tmp_path / "cache"))


def body() -> trimesh.Trimesh:
    """A wedge 4.4 x 1.8 x 1.4 m, higher at its rear end, with x forward and z up, away from the origin."""
    outline = np.array([(-2.2, 0.0), (2.2, 0.0), (2.2, 0.6), (-2.2, 1.4)])
    corners = np.array([(x, y, z) for y in (-0.9, 0.9) for x, z in outline])
    wedge = trimesh.convex.convex_hull(corners)
    wedge.apply_translation((10.0, 5.0, 3.0))
    return wedge


def car() -> trimesh.Scene:
    cabin = trimesh.creation.box((1.0, 1.2, 0.3))
    cabin.apply_translation((9.0, 5.0, 4.4))
    return trimesh.Scene({"hull": body(), "cabin": cabin})


def points(model) -> np.ndarray:
    """Return all vertices of a model on disk."""
    level = model.level("detailed")
    files = [next(e.get("value") for e in shape.iter("string")) for shape in level.shapes.values()]
    return np.concatenate([np.asarray(trimesh.load(file, process=False).vertices) for file in files])


@pytest.mark.parametrize("suffix", ["glb", "gltf", "obj", "ply", "stl"])
def test_every_format_stands_upright_on_the_ground(tmp_path, suffix):
    """The nose is low and points to +x, whatever the axes of the file."""
    mesh = body()
    if suffix in ("glb", "gltf"):  # y up, z forward, x left
        mesh.apply_transform(np.array([[0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]]))
    file = tmp_path / f"my wedge.{suffix}"
    mesh.export(file)
    model = ss.actor_from_mesh(file)
    found = points(model)
    np.testing.assert_allclose(
        [found.min(0), found.max(0)], [[-2.2, -0.9, 0.0], [2.2, 0.9, 1.4]], atol=1e-5
    )  # float32 at 10 m
    assert found[found[:, 0] > 2.1, 2].max() == pytest.approx(0.6, abs=1e-5)
    assert (model.length, model.width, model.height) == pytest.approx((4.4, 1.8, 1.4), abs=1e-4)
    assert model.name == "my_wedge"


@pytest.mark.parametrize(("up", "forward"), [("z", "x"), ("y", "x"), ("-z", "x"), ("x", "-y"), ("y", "-z")])
def test_all_axes_lead_to_the_same_body(up, forward):
    axes = {
        sign + name: (1.0 if not sign else -1.0) * row
        for name, row in zip("xyz", np.eye(3), strict=True)
        for sign in ("", "-")
    }
    turn = np.eye(4)  # from forward, left, up to the file's axes
    turn[:3, :3] = np.stack([axes[forward], np.cross(axes[up], axes[forward]), axes[up]], axis=1)
    mesh = body()
    mesh.apply_transform(turn)
    found = points(ss.actor_from_mesh(mesh, "wedge", up=up, forward=forward))
    expected = points(ss.actor_from_mesh(body(), "wedge"))
    np.testing.assert_allclose(
        found[np.lexsort(found.round(4).T)], expected[np.lexsort(expected.round(4).T)], atol=1e-5
    )


def test_units_are_asked_for():
    mesh = body()
    mesh.apply_scale(1000.0)
    with pytest.raises(ParameterRangeError, match=r"4400 x 1800 x 1400 m .*in millimetres \(scale=0.001\)"):
        ss.actor_from_mesh(mesh, "wedge")
    assert ss.actor_from_mesh(mesh, "wedge", scale=0.001).length == pytest.approx(4.4, abs=1e-4)
    mesh.apply_scale(1.0 / 25.4)
    with pytest.raises(ParameterRangeError, match=r"centimetres \(scale=0.01\) or inches \(scale=0.0254\)\?"):
        ss.actor_from_mesh(mesh, "wedge")


def test_a_body_that_lies_is_told():
    person = trimesh.creation.box((0.4, 1.8, 0.5))  # y up
    with pytest.raises(ParameterRangeError, match="give another `up`, for instance up='y'"):
        ss.actor_from_mesh(person, "person", "Pedestrian", "clothed_skin")
    assert ss.actor_from_mesh(person, "person", "Pedestrian", "clothed_skin", up="y").height == pytest.approx(1.8)
    with pytest.raises(ParameterRangeError, match="the longest side must point forward"):
        ss.actor_from_mesh(body(), "wedge", forward="y")
    with pytest.warns(ScarlWarning, match="higher .* than wide .* give another `up`"):
        ss.actor_from_mesh(body(), "wedge", up="y")


def test_open_surfaces_are_told_with_the_number_of_edges():
    closed = trimesh.creation.box((4.0, 1.8, 1.4))
    assert open_edges(closed) == 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ss.actor_from_mesh(closed, "box")
    closed.update_faces(np.arange(12) != 3)
    with pytest.warns(ScarlWarning, match=r"not closed: 3 open edges \('box' 3\).*Radar"):
        ss.actor_from_mesh(closed, "box")


def test_triangles_that_are_none():
    mesh = body()
    bad = trimesh.Trimesh(mesh.vertices, np.concatenate([mesh.faces, [[0, 0, 1]]]), process=False)
    with pytest.warns(ScarlWarning, match=f"1 of {len(mesh.faces) + 1} triangles have no area"):
        assert len(points(ss.actor_from_mesh(bad, "wedge"))) > 0
    with pytest.raises(MeshError, match="only triangles without area"):
        ss.actor_from_mesh(trimesh.Trimesh(np.zeros((3, 3)), [[0, 1, 2]], process=False), "flat")
    with pytest.raises(MeshError, match="no triangles"):
        ss.actor_from_mesh(trimesh.Trimesh(np.zeros((3, 3)), np.zeros((0, 3), int), process=False), "none")
    broken = trimesh.Trimesh(np.where(mesh.vertices > 12.0, np.nan, mesh.vertices), mesh.faces, process=False)
    with pytest.raises(MeshError, match="vertices that are not finite"):
        ss.actor_from_mesh(broken, "wedge")


def test_files_that_are_none(tmp_path):
    with pytest.raises(MeshError, match="not found"):
        ss.actor_from_mesh(tmp_path / "no.glb")
    with pytest.raises(MeshError, match="give one of .glb"):
        ss.actor_from_mesh(tmp_path / "car.blend")
    (tmp_path / "bad.glb").write_bytes(b"nothing")
    with pytest.raises(MeshError, match="cannot be read"):
        ss.actor_from_mesh(tmp_path / "bad.glb")
    with pytest.raises(MeshError, match="no triangles"):
        ss.actor_from_mesh(
            trimesh.Scene({"cloud": trimesh.PointCloud(np.random.default_rng(0).random((9, 3)))}), "cloud"
        )


def test_materials_by_part_by_material_and_for_the_rest(tmp_path):
    glass = {"radio": "car_glass", "lidar_reflectance": 0.04, "color": [0.02, 0.03, 0.04]}
    model = ss.actor_from_mesh(car(), "wedge", materials={"cabin": glass, "*": "metal"})
    level = model.level("detailed")
    radio = {shape: model.materials[bsdf].radio for shape, bsdf in level.bsdf_of_shape.items()}
    assert radio == {"hull": "metal", "cabin": "car_glass"}
    assert model.materials[level.bsdf_of_shape["cabin"]].lidar_reflectance == 0.04
    assert level.bsdfs[level.bsdf_of_shape["cabin"]].find(".//rgb").get("value") == "0.02 0.03 0.04"
    with pytest.raises(MaterialError, match="parts of mesh 'wedge' have no material: 'hull'"):
        ss.actor_from_mesh(car(), "wedge", materials={"cabin": glass})
    with pytest.raises(UnknownNameError, match="did you mean 'cabin'"):
        ss.actor_from_mesh(car(), "wedge", materials={"cabine": glass, "*": "metal"})
    with pytest.raises(UnknownNameError, match="key of the material"):
        ss.actor_from_mesh(car(), "wedge", materials={**glass, "colour": [1, 1, 1]})
    painted = body()
    painted.visual = trimesh.visual.TextureVisuals(
        material=trimesh.visual.material.PBRMaterial(name="lacquer", baseColorFactor=[0.2, 0.4, 0.6, 1.0])
    )
    file = tmp_path / "painted.glb"
    painted.apply_transform(np.array([[0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]]))
    painted.export(file)
    colored = ss.actor_from_mesh(file, materials={"lacquer": "car_paint"}).level("detailed")
    value = next(iter(colored.bsdfs.values())).find(".//rgb").get("value")
    np.testing.assert_allclose(
        [float(v) for v in value.split()], [0.2, 0.4, 0.6], atol=1.0 / 255.0
    )  # trimesh keeps 8 bits


def _size_in_a_process(model, path: Path, queue) -> None:
    world = ss.stage(path, [ss.StagedActor("mine", model, StaticTrajectory(ss.Pose((0.0, 4.0, 0.0))))])
    queue.put(world.at(0.0).boxes()[-1].size.tolist())


def test_a_mesh_stands_in_a_scene_with_wheels_and_in_another_process(tmp_path):
    scene = trimesh.Scene({"hull": body()})
    wheel = trimesh.creation.cylinder(0.3, 0.2)
    wheel.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2.0, (1, 0, 0)))
    wheel.apply_translation((11.2, 5.8, 3.0))
    scene.add_geometry(wheel, node_name="wheel", geom_name="wheel")
    joint = {"kind": "wheel", "shapes": ["wheel"], "center": [1.2, 0.8, 0.3], "radius": 0.3}
    model = ss.actor_from_mesh(
        scene, "wedge", materials={"wheel": "rubber", "*": "car_paint"}, joints=[joint], wheelbase=2.4, rear_axle=-1.2
    )
    path = write_scene(tmp_path / "scene", instances=[Thing("ground", plane(50.0, 50.0), "Roads")])
    world = ss.stage(path, [ss.StagedActor("mine", model, StaticTrajectory(ss.Pose((0.0, 4.0, 0.0))))])
    state = world.at(0.0)
    np.testing.assert_allclose(
        state.boxes()[-1].size, [4.4, 1.8, 1.7], atol=1e-4
    )  # the wheel stands 0.3 m below the hull
    hits = state.cast([0.0, 4.0, 10.0], np.array([[0.0, 0.0, -1.0]]))
    assert hits.distance[0] == pytest.approx(10.0 - 0.3 - 1.0, abs=1e-5)  # half-way up the slope from 1.4 m to 0.6 m
    assert world.actor("mine").joints[0].radius == 0.3
    assert pickle.loads(pickle.dumps(model)).wheelbase == 2.4
    context = multiprocessing.get_context("spawn")
    queue = context.Queue()
    process = context.Process(target=_size_in_a_process, args=(model, path, queue))
    process.start()
    size = queue.get(timeout=120)
    process.join()
    np.testing.assert_array_equal(size, state.boxes()[-1].size)


def test_a_kept_folder_can_be_named_in_a_scene(tmp_path):
    ss.actor_from_mesh(body(), "wedge", materials="metal", folder=tmp_path / "scene" / "models" / "wedge")
    path = write_scene(tmp_path / "scene", instances=[Thing("ground", plane(50.0, 50.0), "Roads")])
    toml = path.parent / "scene.toml"
    toml.write_text(
        toml.read_text()
        + '\n[[actors]]\nname = "mine"\nmodel = "models/wedge"\n[actors.trajectory]\nkind = "static"\nposition = '
        "[0.0, 0.0, 0.0]\n"
    )
    assert ss.load_scene(path).at(0.0).boxes()[-1].name == "mine"


def test_the_same_mesh_gives_the_same_folder():
    first, second = ss.actor_from_mesh(body(), "wedge"), ss.actor_from_mesh(body(), "wedge")
    assert first.path == second.path
    assert ss.actor_from_mesh(body(), "wedge", materials="metal").path != first.path


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"name": "two words"}, ParameterRangeError, "letters"),
        ({"semantic": "Spaceship"}, UnknownNameError, "class"),
        ({"motion": "fly"}, UnknownNameError, "motion"),
        ({"scale": 0.0}, ParameterRangeError, "scale"),
        ({"up": "w"}, UnknownNameError, "axis `up`"),
        ({"up": "z", "forward": "-z"}, ParameterRangeError, "across"),
        (
            {"joints": [{"kind": "wheel", "shapes": ["weel"], "center": [0, 0, 0], "radius": 1}]},
            UnknownNameError,
            "part in the joints",
        ),
    ],
)
def test_wrong_options_are_told(options, error, words):
    with pytest.raises(error, match=words):
        ss.actor_from_mesh(body(), **{"name": "wedge", **options})


def panel(tmp_path, factor=None) -> str:
    """Write a glTF of an upright panel of 2 m that faces -x, with an image of four colours; return its path."""
    image = np.zeros((64, 64, 3), np.uint8)
    image[:32, :32], image[:32, 32:], image[32:, :32], image[32:, 32:] = RED, GREEN, BLUE, WHITE
    front = np.array([(0.0, 1.0, 2.0), (0.0, -1.0, 2.0), (0.0, -1.0, 0.0), (0.0, 1.0, 0.0)])
    uv = np.array([(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)] * 2)  # trimesh counts v from below
    faces = np.array([(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7)])
    look = trimesh.visual.material.PBRMaterial(
        name="print", baseColorTexture=Image.fromarray(image), baseColorFactor=factor
    )
    visual = trimesh.visual.TextureVisuals(uv=uv, material=look)
    body = trimesh.Trimesh(np.vstack([front, front + [0.02, 0.0, 0.0]]), faces, visual=visual, process=False)
    path = tmp_path / "panel.glb"
    trimesh.Scene({"panel": body}).export(path)
    return str(path)


RED, GREEN, BLUE, WHITE = (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)
AXES = {"up": "z", "forward": "x", "semantic": "TrafficSign", "motion": "stand"}


@pytest.mark.parametrize("make", [ss.actor_from_mesh, ss.actor_from_body])
def test_textures_of_a_gltf_stay_the_right_way_round(tmp_path, make):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)  # the panel is open
        model = make(panel(tmp_path), materials="metal", **AXES)
    ground = write_scene(tmp_path / "scene", [Thing("ground", plane(60.0, 60.0), "Roads")])
    actor = ss.StagedActor("mine", model, StaticTrajectory(ss.Pose((30.0, 0.0, 0.0))))
    world = ss.stage(ground, [actor]).with_lighting(ss.Lighting.preset("day"))
    spec = ss.CameraSpec(width=32, height=32, horizontal_fov_deg=30.0, samples_per_pixel=16, images=("rgb", "instance"))
    image = Camera(spec).observe(world.at(0.0), ss.Pose((25.0, 0.0, 1.0)), np.random.default_rng(0))
    number = next(n for n, one in world.instances.items() if one.name == "mine")
    assert (image.instance[10:22, 10:22] == number).all()
    strongest = image.rgb.astype(float)
    assert strongest[11, 11].argmax() == 0 and strongest[11, 20].argmax() == 1 and strongest[20, 11].argmax() == 2
    assert np.ptp(strongest[20, 20]) < 0.35 * strongest[20, 20].max()


def test_a_colour_that_is_stated_goes_before_the_texture_and_a_factor_darkens_it(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)
        plain = ss.actor_from_mesh(panel(tmp_path), materials={"radio": "metal", "color": (0.1, 0.2, 0.3)}, **AXES)
        dark = ss.actor_from_mesh(panel(tmp_path, [128, 128, 128, 255]), materials="metal", **AXES)
    assert "bitmap" not in (plain.path.parent / "panel.xml").read_text()
    file = next((dark.path.parent / "textures").glob("*.png"))
    linear = 128 / 255
    expected = 255 * (1.055 * linear ** (1 / 2.4) - 0.055)
    assert np.asarray(Image.open(file))[40, 40] == pytest.approx([expected] * 3, abs=1.0)


@pytest.mark.parametrize("make", [ss.actor_from_mesh, ss.actor_from_body])
def test_a_damaged_texture_is_told(tmp_path, make):
    path = Path(panel(tmp_path))
    data = path.read_bytes()
    inside = data.index(b"\x89PNG") + 60
    path.write_bytes(data[:inside] + b"\0" * 30 + data[inside + 30 :])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)
        with pytest.raises(MeshError, match="part 'panel'.* has a damaged texture.*export it again"):
            make(str(path), materials="metal", **AXES)
