"""Scenes as the Mitsuba add-on of Blender writes them: names, defaults, nested BSDFs, lights, instances, y up.

``tests/data/blender/street.xml`` has the form of its export with ids; the meshes are made here.
"""

from __future__ import annotations

import math
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

import scarl_sionna as ss
from camera_lidar import Camera, Lidar
from scarl_sionna.core.errors import MaterialError, ParameterRangeError, ScarlWarning, SceneError
from scarl_sionna.scene.document.scene_file import read_document

EXPORT = Path(__file__).parents[1] / "data" / "blender" / "street.xml"
MATERIALS = {"mat-Asphalt": "asphalt", "mat-Wall": "brick", "mat-Glass": "glass", "default-bsdf": "foliage"}
WALL_FRONT, BALL = 15.0, ((7.0, 3.0, 2.0), 1.0)
"""x of the building's front, middle and radius of the instance's sphere [m]."""


def ply(body: trimesh.Trimesh, uv: bool = False, normals: bool = False) -> bytes:
    """Return a PLY as Mitsuba's own writer makes it: faces by ``vertex_index``."""
    columns = [np.asarray(body.vertices)]
    names = ["x", "y", "z"]
    if normals:
        columns, names = [*columns, np.asarray(body.vertex_normals)], [*names, "nx", "ny", "nz"]
    if uv:
        columns, names = [*columns, np.asarray(body.vertices)[:, :2]], [*names, "u", "v"]
    faces = np.zeros(len(body.faces), [("n", "u1"), ("i", "<i4", 3)])
    faces["n"], faces["i"] = 3, body.faces
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(body.vertices)}"]
    head += [f"property float {name}" for name in names]
    head += [f"element face {len(faces)}", "property list uchar int vertex_index", "end_header", ""]
    return "\n".join(head).encode() + np.concatenate(columns, 1).astype("<f4").tobytes() + faces.tobytes()


def exported(folder: Path, materials: dict[str, str] = MATERIALS, is_y_up: bool = False, head: str = "") -> Path:
    """Write the export and its files into a folder; with y up as by the add-on's default axes."""
    turn = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]]) if is_y_up else np.eye(4)

    def box(size, at):
        body = trimesh.creation.box(size)
        return body.apply_translation(at).apply_transform(turn)

    ball = trimesh.creation.icosphere(3, 0.5).apply_translation([1.0, 0.0, 1.0])
    (folder / "meshes").mkdir(parents=True)
    (folder / "textures").mkdir()
    for name, data in (
        ("Plane", ply(box((60.0, 60.0, 0.02), (0.0, 0.0, -0.01)), uv=True)),
        ("Building.001-Wall", ply(box((10.0, 8.0, 9.0), (20.0, -3.0, 4.5)))),
        ("Building.001-Glass", ply(box((0.1, 4.0, 2.0), (14.9, -3.0, 4.5)))),
        ("Sphere", ply(ball.apply_transform(turn), normals=True)),
    ):
        (folder / "meshes" / f"{name}.ply").write_bytes(data)
    Image.fromarray(np.full((8, 8, 3), 90, dtype=np.uint8)).save(folder / "textures" / "Asphalt.png")
    text = EXPORT.read_text()
    if is_y_up:
        steps = '<rotate x="1" angle="63.559295"/>'
        text = text.replace(steps, '<rotate x="1" angle="-26.440705"/>').replace(
            '<rotate z="1" angle="46.691946"/>', '<rotate y="1" angle="46.691946"/>'
        )
        text = re.sub(r"<matrix value=[^>]*>", f'<matrix value="{_row(turn @ _scaled() @ turn.T)}"/>', text)
    path = folder / "street.xml"
    path.write_text(text)
    if materials or head:
        tables = [head] + [f'[materials."{bsdf}"]\nradio = "{radio}"' for bsdf, radio in materials.items()]
        (folder / "scene.toml").write_text("\n".join(tables))
    return path


def _scaled() -> np.ndarray:
    matrix = np.diag([2.0, 2.0, 2.0, 1.0])
    matrix[:3, 3] = 5.0, 3.0, 0.0
    return matrix


def _row(matrix: np.ndarray) -> str:
    return " ".join(f"{value:.6f}" for value in matrix.ravel())


def loaded(path: Path) -> ss.World:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)
        return ss.load_scene(path)


def first_hit(world: ss.World, towards, origin=(0.0, 0.0, 2.0)) -> tuple[float, str]:
    way = np.asarray(towards, dtype=np.float64) - origin
    hits = world.at(0.0).cast(np.asarray(origin), way[None] / np.linalg.norm(way))
    return float(hits.distance[0]), world.parts.name[hits.part[0]]


@pytest.mark.parametrize("is_y_up", [False, True])
def test_an_export_stands_upright_with_its_names_classes_and_instances(tmp_path, is_y_up):
    head = '[scene]\nup = "y"' if is_y_up else ""
    world = loaded(exported(tmp_path / "a", is_y_up=is_y_up, head=head))
    classes = {entry.name: entry.semantic for entry in world.document.instances}
    assert classes == {
        "mesh-Plane": "Ground",
        "mesh-Building.001-Wall": "Building",
        "mesh-Building.001-Glass": "Building",
        "mesh-Tree-1": "Vegetation",
    }
    assert first_hit(world, (20.0, -6.0, 2.0)) == (
        pytest.approx(WALL_FRONT * math.hypot(20.0, 6.0) / 20.0, abs=1e-4),
        "mesh-Building.001-Wall",
    )
    assert first_hit(world, (20.0, -4.0, 4.5))[1] == "mesh-Building.001-Glass"
    assert first_hit(world, (4.0, 0.0, 0.0)) == (pytest.approx(math.hypot(4.0, 2.0), abs=1e-4), "mesh-Plane")
    distance, name = first_hit(world, BALL[0])
    assert name == "mesh-Tree-1"
    assert distance == pytest.approx(np.linalg.norm(np.subtract(BALL[0], (0.0, 0.0, 2.0))) - BALL[1], abs=0.01)


def test_every_sensor_works_in_it_and_its_texture_is_in_the_picture(tmp_path):
    world = loaded(exported(tmp_path / "a"))
    state, pose = world.at(0.0), ss.Pose((0.0, 0.0, 1.5))
    camera = ss.CameraSpec(width=32, height=18, samples_per_pixel=4, images=("rgb", "semantic"))
    image = Camera(camera).observe(state, pose, np.random.default_rng(0))
    assert len(np.unique(image.semantic)) >= 3 and image.rgb.mean() > 10
    scan = Lidar(ss.LidarSpec(num_azimuth=90, num_elevation=16)).observe(state, pose, np.random.default_rng(0))
    assert len(np.unique(scan.instance)) >= 3
    paths = ss.solve_paths(state, ss.RadarSpec(), pose, method="raycast")
    assert paths.length.min() / 2.0 < WALL_FRONT + 1.0


def test_materials_that_are_not_stated_are_listed_together_with_the_remedy(tmp_path):
    path = exported(tmp_path / "a", {})
    with pytest.warns(ScarlWarning, match="emit-Area"), pytest.raises(MaterialError) as caught:
        ss.load_scene(path)
    for bsdf in MATERIALS:
        assert bsdf in str(caught.value)
    assert '[materials."default-bsdf"]' in str(caught.value)


def test_what_only_shines_is_left_out_and_named(tmp_path):
    with pytest.warns(ScarlWarning, match="no surface and are left out with their light: emit-Area"):
        document = read_document(exported(tmp_path / "a"))
    assert "emit-Area" not in document.bsdf_of_shape
    assert {element.get("id") for element in document.root.findall("emitter")} == {"World", "emit-Sun"}


def test_y_up_that_is_not_stated_is_told_by_the_cameras(tmp_path):
    path = exported(tmp_path / "a", is_y_up=True)
    with pytest.warns(ScarlWarning, match=r'\+y up.*state up = "y" below \[scene\]'):
        read_document(path)
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        read_document(exported(tmp_path / "b"))
        read_document(exported(tmp_path / "c", is_y_up=True, head='[scene]\nup = "y"'))
    assert not [one for one in found if "+y up" in str(one.message)]


@pytest.mark.parametrize(
    ("head", "error", "message"),
    [
        ('[scene]\nup = "x"', ParameterRangeError, "up of .scene. = 'x'.*'y' or 'z'"),
        (
            '[scene]\nup = "y"\n[[actors]]\nname = "a"\nclass = "Car"\nshapes = ["mesh-Plane"]',
            SceneError,
            "does not go with .*actor_from_mesh",
        ),
    ],
)
def test_axes_that_cannot_be_are_refused(tmp_path, head, error, message):
    with pytest.raises(error, match=message):
        loaded(exported(tmp_path / "a", {}, head=head))


def test_lights_turn_with_a_scene_of_y_up(tmp_path):
    path = exported(tmp_path / "a", is_y_up=True, head='[scene]\nup = "y"')
    lamp = '<emitter type="point" id="emit-Lamp"><point name="position" x="1" y="5" z="-3"/></emitter>'
    path.write_text(path.read_text().replace("<!-- Shapes -->", lamp))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)
        root = read_document(path).root
    point = root.find("./emitter[@id='emit-Lamp']/point")
    assert [float(point.get(axis)) for axis in "xyz"] == [1.0, 3.0, 5.0]
    assert root.find("./emitter[@id='emit-Sun']/transform")[-1].attrib == {"x": "1", "angle": "90"}


def test_shared_bsdfs_and_textures_are_found(tmp_path):
    path = exported(tmp_path / "a")
    text = path.read_text()
    start = text.index('<bsdf type="twosided" id="mat-Asphalt"')
    end = text.index("</bsdf>", text.index("</bsdf>", start) + 1) + len("</bsdf>")
    shared = (
        '<texture type="bitmap" id="tex"><string name="filename" value="textures/Asphalt.png"/></texture>'
        '<bsdf type="diffuse" id="inner"><ref id="tex" name="reflectance"/></bsdf>'
        '<bsdf type="twosided" id="mat-Asphalt"><ref id="inner"/></bsdf>'
    )
    path.write_text(text[:start] + shared + text[end:])
    world = loaded(path)
    camera = ss.CameraSpec(width=16, height=9, samples_per_pixel=2, images=("rgb",))
    assert Camera(camera).observe(world.at(0.0), ss.Pose((0.0, 0.0, 1.5)), np.random.default_rng(0)).rgb.mean() > 5
    path.write_text((text[:start] + shared + text[end:]).replace('ref id="tex"', 'ref id="gone"'))
    with pytest.raises(SceneError, match="'gone', to which a BSDF refers, is not there"):
        loaded(path)
    loop = shared.replace('<ref id="tex" name="reflectance"/>', '<ref id="inner"/>')
    path.write_text(text[:start] + loop + text[end:])
    with pytest.raises(SceneError, match="refer to each other more than 8 deep"):
        loaded(path)


def test_a_scene_split_into_files_is_the_same(tmp_path):
    path = exported(tmp_path / "a")
    whole = loaded(path)
    text = path.read_text()
    start, end = text.index("<!-- Shapes -->"), text.index("<!-- Volumes -->")
    (tmp_path / "a" / "fragments").mkdir()
    part = tmp_path / "a" / "fragments" / "geometry.xml"
    part.write_text(f'<scene version="3.5.0">{text[start:end]}</scene>')
    path.write_text(f'{text[:start]}<include filename="fragments/geometry.xml"/>{text[end:]}')
    split = loaded(path)
    assert split.parts.name == whole.parts.name and split.parts.material == whole.parts.material
    part.write_text('<scene version="3.5.0"><include filename="fragments/geometry.xml"/></scene>')
    with pytest.raises(SceneError, match="more than 8 deep"):
        loaded(path)
    part.unlink()
    with pytest.raises(SceneError, match="included file 'fragments/geometry.xml' cannot be read"):
        loaded(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<ref id="mesh-Tree" name="shape"/>', '<ref id="mesh-Bush" name="shape"/>', "names the group 'mesh-Bush'"),
        ('type="ply" id="mesh-Plane"', 'type="serialized" id="mesh-Plane"', "'serialized'; only meshes.*PLY or OBJ"),
    ],
)
def test_what_is_not_read_is_named(tmp_path, old, new, message):
    path = exported(tmp_path / "a")
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(SceneError, match=message):
        loaded(path)
