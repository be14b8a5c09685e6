"""The files of the scene `highway_guardrail`: complete, sound meshes, closed cars, the right view, reproducible."""

from __future__ import annotations

import fnmatch
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.interpolate import CubicSpline

from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.core.untrusted.toml_text import read_toml
from scenes_xml import scene_names, scene_path

XML = scene_path("highway_guardrail")
FOLDER = XML.parent
ROOT = ET.parse(XML).getroot()
SHAPES = {shape.get("id"): shape for shape in ROOT.findall("shape")}
TOML = read_toml(FOLDER / "scene.toml")
CARS = ("ego", "car_ahead", "oncoming")
MESHES = sorted(path.name for path in (FOLDER / "meshes").glob("*.ply"))
RADIO = set(
    [
        "asphalt",
        "concrete",
        "metal",
        "car_paint",
        "car_glass",
        "glass",
        "rubber",
        "plastic",
        "wood",
        "foliage",
        "grass",
        "soil",
        "brick",
        "road_paint",
        "gravel",
    ]
)


def _file(shape: ET.Element) -> str:
    value = shape.find("string[@name='filename']").get("value")
    return value.removeprefix("meshes/")


@cache
def _read(name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices, normals and faces of a mesh file, parsed here so that nothing is repaired on the way."""
    data = (FOLDER / "meshes" / name).read_bytes()
    head, _, body = data.partition(b"end_header\n")
    lines = head.decode("ascii").splitlines()
    count = {line.split()[1]: int(line.split()[2]) for line in lines if line.startswith("element")}
    columns = sum(line.startswith("property float") for line in lines)
    table = np.frombuffer(body, "<f4", count["vertex"] * columns).reshape(-1, columns).astype(float)
    faces = np.frombuffer(
        body[count["vertex"] * columns * 4 :], np.dtype([("n", "u1"), ("i", "<i4", 3)]), count["face"]
    )
    assert (faces["n"] == 3).all()
    return table[:, :3], table[:, 3:6], faces["i"].astype(np.int64)


def _placed(shape: ET.Element) -> tuple[np.ndarray, np.ndarray]:
    vertices, _, faces = _read(_file(shape))
    out = vertices
    for step in shape.findall("transform/*"):
        if step.tag == "scale":
            out = out * float(step.get("value"))
        elif step.tag == "rotate":
            a = np.radians(float(step.get("angle")))
            out = out @ np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]]).T
        else:
            assert step.tag == "translate"
            out = out + [float(step.get(k)) for k in "xyz"]
    return out, faces


def _car(name: str) -> trimesh.Trimesh:
    parts = [_read(_file(s))[::2] for key, s in SHAPES.items() if key.startswith(f"{name}_")]
    return trimesh.util.concatenate([trimesh.Trimesh(v, f, process=False) for v, f in parts])


def test_the_scene_is_listed_and_an_unknown_name_is_refused():
    assert "highway_guardrail" in scene_names()
    with pytest.raises(KeyError, match="highway_guardrail"):
        scene_path("no_such_scene")


def test_every_file_that_the_xml_names_exists_and_no_mesh_is_left_over():
    for element in ROOT.iter("string"):
        if element.get("name") == "filename":
            assert (FOLDER / element.get("value")).is_file(), element.get("value")
    assert {_file(shape) for shape in SHAPES.values()} == set(MESHES)


def test_every_bsdf_has_a_material_and_the_reverse():
    bsdfs = {b.get("id") for b in ROOT.findall("bsdf")}
    assert bsdfs == set(TOML["materials"]) == {s.find("ref").get("id") for s in SHAPES.values()}
    for name, material in TOML["materials"].items():
        assert material["radio"] in RADIO, name
        assert 0.0 < material["lidar_reflectance"] < 1.0, name
        assert material["source"], name


def test_shapes_are_ply_with_unique_ids():
    assert len(SHAPES) == len(ROOT.findall("shape"))
    assert {shape.get("type") for shape in SHAPES.values()} == {"ply"}


def test_every_shape_belongs_to_exactly_one_instance_or_actor():
    owners = TOML["instances"] + TOML["actors"]
    assert len({o["name"] for o in owners}) == len(owners)
    for shape in SHAPES:
        found = [o["name"] for o in owners if any(fnmatch.fnmatchcase(shape, p) for p in o["shapes"])]
        assert len(found) == 1, (shape, found)
    for owner in owners:
        assert owner["class"] in SEMANTIC_CLASSES
        assert any(fnmatch.fnmatchcase(s, p) for s in SHAPES for p in owner["shapes"]), owner["name"]


@pytest.mark.parametrize("name", MESHES)
def test_meshes_are_finite_and_sound(name):
    vertices, normals, faces = _read(name)
    assert np.isfinite(vertices).all() and np.isfinite(normals).all()
    # normals are stored rounded to 1e-4 a component: |n| is within sqrt(3) * 0.5e-4 < 1e-4 of 1
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-4)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    # the builder drops triangles below 2e-9 m2; float32 rounds coordinates up to 2.5 km, but small parts stay within
    # 500 m (step 3e-5 m), where leaf cards of 1 m and tufts of 3 mm x 5 cm keep well above 1e-10 m2
    assert (np.linalg.norm(cross, axis=1) / 2 > 1e-10).all()
    _, index = np.unique(np.round(vertices / 1e-5).astype(np.int64), axis=0, return_inverse=True)
    corners = np.sort(index.reshape(-1)[faces], axis=1)
    assert len(np.unique(corners, axis=0)) == len(faces), "duplicate faces"


@pytest.mark.parametrize(
    "name", ["guardrail_beam.ply", "house_walls.ply", "terrain_left.ply", "road_asphalt.ply", "ego_body.ply"]
)
def test_shading_normals_agree_with_the_winding(name):
    vertices, normals, faces = _read(name)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    cross /= np.linalg.norm(cross, axis=1)[:, None]
    # normals are averaged over neighbours within a crease of at most 60 deg, so none turns its back on its own face
    assert (np.einsum("ij,ikj->ik", cross, normals[faces]) > 0.0).all()


def test_the_ground_faces_up():
    for name in ("road_asphalt", "terrain_left", "terrain_right", "terrain_far", "gravel_left", "marking_centre"):
        vertices, faces = _placed(SHAPES[name])
        a, b, c = (vertices[faces[:, k]] for k in range(3))
        z = np.cross(b - a, c - a)[:, 2]
        # only the pavement's vertical edges have no upward part; they are exactly vertical up to rounding of 1e-5 m in
        # 2 m
        assert (z > -1e-4).all() and (z > 1e-3).mean() > 0.7, name


def test_markings_lie_3_to_5_mm_above_the_pavement():
    heights = np.concatenate([_placed(s)[0][:, 2] for key, s in SHAPES.items() if key.startswith("marking_")])
    assert heights.min() >= 0.003 and heights.max() <= 0.005


@pytest.mark.parametrize(
    ("name", "size"), [("ego", (4.60, 1.90, 1.46)), ("car_ahead", (4.30, 1.90, 1.62)), ("oncoming", (4.72, 1.90, 1.47))]
)
def test_cars_have_their_measures(name, size):
    car = _car(name)
    # 5 mm: the roof and the plates are sampled surfaces; widths include the mirrors, |y| <= 0.95 m
    np.testing.assert_allclose(np.ptp(car.vertices, axis=0), size, atol=0.005)
    assert abs(car.vertices[:, 2].min()) < 1e-4, "the tyres stand on the ground"
    assert np.abs(car.vertices[:, 1]).max() <= 0.95 + 1e-5
    assert 3000 <= len(car.faces) <= 12000


@pytest.mark.parametrize("name", CARS)
def test_no_ray_passes_through_the_middle_of_a_car(name):
    """Rays from all around aimed at points of the central volume: each must hit before it gets there."""
    car = _car(name)
    rng = np.random.default_rng(1)
    count = 300
    targets = rng.uniform([-1.6, -0.45, 0.32], [1.6, 0.45, 0.62], (count, 3))
    azimuth, height = rng.uniform(0, 2 * np.pi, count), rng.uniform(-0.2, 0.9, count)
    away = np.column_stack([np.cos(azimuth), np.sin(azimuth), height])
    away /= np.linalg.norm(away, axis=1)[:, None]
    a, b, c = (car.vertices[car.faces[:, k]] for k in range(3))
    e1, e2 = b - a, c - a
    for target, direction in zip(targets, away, strict=True):
        p = np.cross(direction, e2)
        det = np.einsum("ij,ij->i", e1, p)
        det = np.where(np.abs(det) < 1e-14, np.inf, det)
        t = target - a
        u = np.einsum("ij,ij->i", t, p) / det
        q = np.cross(t, e1)
        v = q @ direction / det
        distance = np.einsum("ij,ij->i", q, e2) / det
        # from inside to outside: the body's wall lies on the way; its last crossing must be an outward face
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0)
        assert hit.any(), (target, direction)
        last = np.flatnonzero(hit)[np.argmax(distance[hit])]
        assert det[last] < 0 or np.dot(np.cross(e1[last], e2[last]), direction) > 0


def test_the_guardrail_spans_the_azimuths_of_the_paper():
    """Figure 2: -10 to 50 deg counted to the right; here left is positive, seen from the ego's front at t = 0."""
    parts = [_placed(s)[0] for key, s in SHAPES.items() if key.startswith("guardrail_")]
    points = np.concatenate(parts) - [2.3, 0.0, 0.0]
    azimuth = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
    # 1.5 deg: the width of the rounded end pieces (0.1 m at 6 m: 1 deg at the near end) and the choice of whole posts
    assert azimuth.min() == pytest.approx(-50.0, abs=1.5)
    assert azimuth.max() == pytest.approx(10.0, abs=1.5)


def test_poses_in_the_xml_are_the_trajectories_at_time_zero():
    for actor in TOML["actors"]:
        trajectory = actor["trajectory"]
        spline = CubicSpline(trajectory["times"], trajectory["positions"])
        assert trajectory["times"][0] == 0.0 and trajectory["times"][-1] >= 6.0
        velocity = spline(0.0, 1)
        shape = SHAPES[f"{actor['name']}_body"]
        move, turn = shape.find("transform/translate"), shape.find("transform/rotate")
        place = np.zeros(3) if move is None else np.array([float(move.get(k)) for k in "xyz"])
        np.testing.assert_allclose(place, spline(0.0), atol=2e-6)  # both are written with 6 decimals
        yaw = 0.0 if turn is None else float(turn.get("angle"))
        error = (yaw - np.degrees(np.arctan2(velocity[1], velocity[0])) + 180.0) % 360.0 - 180.0
        # end slope of a not-a-knot cubic: error ~ h^3 f''''/4 of the 0.25 s waypoints, below 0.05 deg here
        assert abs(error) < 0.05


def test_cars_keep_their_lane_and_speed_and_stay_apart():
    from scenes_xml.highway_guardrail.layout import ACTORS, CURVE

    s = np.arange(-120.0, 300.0, 0.01)
    fine = np.linspace(0.0, 6.0, 241)
    tracks = {}
    for plan in ACTORS:
        trajectory = next(a for a in TOML["actors"] if a["name"] == plan.name)["trajectory"]
        spline = CubicSpline(trajectory["times"], trajectory["positions"])
        tracks[plan.name] = spline(fine)
        lane = CURVE.point(s, plan.offset)[:, :2]
        gap = [np.min(np.hypot(*(lane - p[:2]).T)) for p in tracks[plan.name][::3]]
        # 1 mm for the spline and 5 mm half a step of the sampled lane, in quadrature at most 5.1 mm
        assert max(gap) < 0.0051
        # speed: cubic of 0.25 s waypoints through curvature ramps, relative error ~ (h kappa')^2 << 1e-3
        np.testing.assert_allclose(np.linalg.norm(spline(fine, 1), axis=1), abs(plan.speed), rtol=2e-3)
    ego, ahead, oncoming = (tracks[name] for name in CARS)
    assert np.linalg.norm(ahead - ego, axis=1).min() > 15.0
    # lanes are 3.5 m apart and the cars at most 1.9 m wide
    assert np.linalg.norm(oncoming - ego, axis=1).min() > 3.3
    assert np.linalg.norm(oncoming - ahead, axis=1).min() > 3.3
    assert 18.0 <= np.linalg.norm(ahead[0]) <= 25.0 and 30.0 <= np.linalg.norm(oncoming[0]) <= 45.0


def test_the_scene_stays_small():
    triangles = sum(len(_read(_file(shape))[2]) for shape in SHAPES.values())
    assert triangles < 250_000
    assert sum(f.stat().st_size for f in FOLDER.rglob("*") if f.suffix in (".ply", ".png", ".xml", ".toml")) < 12e6


def test_paths_are_plain():
    assert not any(Path(e.get("value")).is_absolute() for e in ROOT.iter("string") if e.get("name") == "filename")
