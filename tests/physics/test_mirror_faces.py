"""Several mirror faces of one instance.

Each echo over each face is there once, as if the faces were instances of their own. The ends of the faces are sharp
here (`end_reach` 0), as those of image theory.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import trimesh

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.mirrors import MirrorSettings
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import ChannelPlan, Share, solve_paths
from scarl_sionna.radar.channel.compose import hybrid
from scarl_sionna.radar.channel.compose.hybrid import DoubleCountError, received_power
from scarl_sionna.radar.channel.compose.mirrors import find_mirrors
from scarl_sionna.radar.scatterers.model import ScattererModel
from tests.oracles import fresnel
from tests.oracles.multipath import mirrored
from tests.scenes import Thing, ball, plane, write_scene

RADAR = RadarSpec(elevation_fov_deg=120.0, azimuth_fov_deg=180.0)
POSE = Pose([0.0, 0.3, 0.5])
HALF, DROP, LONG = 8.0, 0.15625, 64.0  # a fall of 5/32 m over 8 m: 1.95 %, and exact in the file's float32
RCS = 2.0


def slope(side: int, sign: float, inner: float = 0.0) -> trimesh.Trimesh:
    """Return the left (+1) or right (-1) half of a road that falls (`sign` 1), rises (-1) or is level (0)."""
    y = np.array([inner, HALF, HALF, inner]) * side
    z = -sign * DROP / HALF * np.abs(y)
    corners = np.column_stack([[-16.0, -16.0, LONG, LONG], y, z])
    return trimesh.Trimesh(corners, [(0, 1, 2), (0, 2, 3)] if side < 0 else [(0, 2, 1), (0, 3, 2)], process=False)


def facades() -> list[trimesh.Trimesh]:
    return [plane(32.0, 128.0, (30, 10, 0), (0, -1, 0)), plane(32.0, 128.0, (30, -12, 0), (0, 1, 0))]


def scene(folder, faces, names, target, semantic="Roads", besides=()):
    """Return a state with faces that are one instance, where there is one name, or one each."""
    meshes = faces if len(names) > 1 else [trimesh.util.concatenate(faces)]
    things = [Thing(name, mesh, semantic, "steel", is_object=False) for name, mesh in zip(names, meshes, strict=True)]
    return load_scene(write_scene(folder, [*things, *besides], [target])).at(0.0)


def body(mesh, position=(0.0, 0.0, 0.0)) -> Thing:
    still = {"kind": "constant_twist", "position": list(position), "velocity": [0.0, 0.0, 0.0]}
    return Thing("target", mesh, "Static", "steel", still)


def points(centers) -> Share:
    """Return a share of isotropic centres, of the RCS above each, without cross-polarisation."""
    amplitude = np.zeros((1, 2, len(centers), 2, 2), np.complex64)
    amplitude[..., 0, 0] = amplitude[..., 1, 1] = np.sqrt(RCS / (4 * np.pi))
    model = ScattererModel(
        np.asarray(centers), np.array([0.0, np.pi]), np.zeros(1), amplitude, RADAR.center_frequency, 0.0, 0.0, np.pi
    )
    return Share("scatterers", ("target",), {"models": {"target": model}}, through_mirrors=True)


def solve(state, share, names, **options):
    plan = ChannelPlan((share,), tuple(names), **{"echoes": False, **options})
    return solve_paths(state, RADAR, POSE, "hybrid", plan=plan, mirrors=MirrorSettings(end_reach=0.0))


def lengths(paths):
    there = np.linalg.norm(paths.tx_point - paths.world_from_tx.position, axis=1)
    return there + paths.inner_length + np.linalg.norm(paths.rx_point - paths.world_from_rx.position, axis=1)


def rows(paths) -> np.ndarray:
    """Return one row a path: length, both end points, amplitude in four numbers each, in an order of their own."""
    columns = [lengths(paths), paths.tx_point, paths.rx_point, paths.a.real.reshape(-1, 4), paths.a.imag.reshape(-1, 4)]
    table = np.column_stack(columns)
    return table[np.lexsort(np.round(table[:, :7], 6).T[::-1])]


def check_each_once(paths) -> None:
    """Assert that no two paths have the same chain between the same end points, to the micrometre."""
    key = np.column_stack([paths.instance, paths.interaction, np.round(np.hstack([paths.tx_point, paths.rx_point]), 6)])
    assert len(np.unique(key, axis=0)) == paths.num_paths


def check_same(one, split) -> None:
    """Assert that the paths are those of the scene in which the faces are instances."""
    first, second = rows(one), rows(split)
    assert first.shape == second.shape
    assert np.abs(first[:, :7] - second[:, :7]).max() < 1e-9  # float64 of 100 m
    assert np.abs(first[:, 7:] - second[:, 7:]).max() < 1e-9 * np.abs(first[:, 7:]).max()
    power = [received_power(paths, RADAR).sum() for paths in (one, split)]
    assert power[0] == pytest.approx(power[1], rel=1e-9)


def reflected(material, corner, normal, point) -> tuple[float, float, np.ndarray]:
    """Return length, power share and reflection point of the way over a plane, by the image of the point."""
    normal = np.asarray(normal) / np.linalg.norm(normal)
    offset = normal @ np.asarray(corner)
    image = mirrored(point, normal, offset)
    way = image - POSE.position
    length = np.linalg.norm(way)
    share = (offset - normal @ POSE.position) / (normal @ way)
    cosine = abs(normal @ way) / length
    te, tm = (abs(value) ** 2 for value in fresnel.reflection(material, float(np.arccos(cosine))))
    return length, (te + tm) / 2.0, POSE.position + share * way


def check_points(paths, state, centers, planes, owns) -> None:
    """Assert all lengths, and the powers of ways with at most one mirror, against the image method for each face.

    `owns(number, place)` says whether a reflection point is on the face of that number.
    """
    material = state.world.materials["metal"].at(RADAR.center_frequency)
    wanted, faint = [], []
    for center in np.asarray(centers):
        ways = [(np.linalg.norm(center - POSE.position), 1.0)]
        for number, (corner, normal) in enumerate(planes):
            length, share, place = reflected(material, corner, normal, center)
            if owns(number, place):
                ways.append((length, share))
        for (index, there), (other, back) in product(enumerate(ways), repeat=2):
            scale = RADAR.wavelength / (4 * np.pi * there[0] * back[0])
            level = 2.0 * scale**2 * RCS / (4 * np.pi) * there[1] * back[1]  # all four entries of the matrix together
            wanted.append((there[0] + back[0], level))
            faint.append(bool(index and other))
    assert paths.num_paths == len(wanted)
    order = np.argsort(np.array(wanted)[:, 0], kind="stable")
    wanted, faint = np.array(wanted)[order], np.array(faint)[order]
    sorting = np.argsort(lengths(paths), kind="stable")
    assert np.abs(lengths(paths)[sorting] - wanted[:, 0]).max() < 1e-9  # float64 of 100 m
    found = (np.abs(paths.a[sorting]) ** 2).sum(axis=(1, 2))
    # Single-precision amplitudes of the model: 1e-7. Two mirrors couple V and H, which a product of shares does not
    # hold.
    assert np.abs(found / wanted[:, 1] - 1.0)[~faint].max() < 1e-6


CROWN = [((0, 0, 0), (0.0, DROP, HALF)), ((0, 0, 0), (0.0, -DROP, HALF))]
SAG = [((0, 0, 0), (0.0, -DROP, HALF)), ((0, 0, 0), (0.0, DROP, HALF))]


@pytest.mark.parametrize(("sign", "planes"), [(1.0, CROWN), (-1.0, SAG)], ids=["crown", "sag"])
def test_points_over_a_crowned_road_are_images_in_the_slope_under_them(tmp_path, sign, planes) -> None:
    """Centres on both sides, many of whose reflection points lie where the two planes are a few millimetres apart."""
    centers = [(25.0, y, 0.75) for y in np.arange(-3.0, 3.01, 0.125) + 0.01]
    faces = [slope(1, sign), slope(-1, sign)]
    small = body(ball(0.02, (25, 0, 0.75), subdivisions=1))
    one = scene(tmp_path / "one", faces, ["road"], small)
    split = scene(tmp_path / "split", faces, ["left", "right"], small)
    share = points(centers)
    found, apart = solve(one, share, ["road"]), solve(split, share, ["left", "right"])
    check_points(found, one, centers, planes, lambda number, place: place[1] * (1, -1)[number] > 0.0)
    check_each_once(found)
    check_same(found, apart)
    assert found.num_paths > 3 * len(centers)


def test_points_in_a_canyon_are_images_in_both_facades(tmp_path) -> None:
    centers = [(30.0, y, 0.75) for y in (-4.0, 0.5, 6.0)]
    planes = [((0, 10, 0), (0.0, -1.0, 0.0)), ((0, -12, 0), (0.0, 1.0, 0.0))]
    small = body(ball(0.02, (30, 0, 0.75), subdivisions=1))
    one = scene(tmp_path / "one", facades(), ["building"], small, "Building")
    split = scene(tmp_path / "split", facades(), ["left", "right"], small, "Building")
    share = points(centers)
    found, apart = solve(one, share, ["building"]), solve(split, share, ["left", "right"])
    check_points(found, one, centers, planes, lambda number, place: True)
    check_each_once(found)
    check_same(found, apart)
    deep = {"mirror_depth": 2, "echoes": True, "sionna": {"num_samples": 20_000}}
    found, apart = solve(one, share, ["building"], **deep), solve(split, share, ["left", "right"], **deep)
    # 5 ways (straight, left, right, left-right, right-left) there and back for each point, and the echoes of both
    # facades
    assert np.count_nonzero((found.interaction == 0).any(axis=1)) == 25 * len(centers)
    echoes = lengths(found)[~(found.interaction == 0).any(axis=1)]
    assert {19.4, 24.6} <= set(np.round(echoes, 6))
    check_each_once(found)
    check_same(found, apart)


@pytest.mark.parametrize("shape", ["crown", "canyon"])
def test_a_body_over_two_faces_is_that_of_two_instances(tmp_path, shape) -> None:
    """`sbr` of a plate that sees the radar over both faces."""
    plate = body(plane(6.0, 0.25, (0, 0, 0), (-1, 0, 0)), (25.0, 0.0, 0.75))
    faces = {"crown": [slope(1, 1.0), slope(-1, 1.0)], "canyon": facades()}[shape]
    settings = SbrSettings(max_phase=2.0, max_depth=1, floor_db=None)
    share = Share("sbr", ("target",), settings, through_mirrors=True)
    one = solve(scene(tmp_path / "one", faces, ["road"], plate), share, ["road"])
    split = solve(scene(tmp_path / "split", faces, ["left", "right"], plate), share, ["left", "right"])
    assert {len(set(row) - {-1}) for row in split.instance[split.depth > 1].tolist()} >= {2}
    assert set(split.instance[split.depth > 1].ravel()) == {-1, 1, 2, 3}  # over both faces
    check_each_once(one)
    check_same(one, split)


ACROSS = [(25.0, y, 0.75) for y in np.arange(-3.0, 3.01, 0.25) + 0.01]
LEVEL = [((0, 0, 0), (0.0, 0.0, 1.0))]


def small_target() -> Thing:
    return body(ball(0.02, (25, 0, 0.75), subdivisions=1))


@pytest.mark.parametrize("gap", [0.0, 0.25])
@pytest.mark.parametrize("names", [["road"], ["left", "right"]])
def test_what_lies_in_one_plane_is_one_mirror_at_each_place(tmp_path, names, gap) -> None:
    """Two tiles in one plane, with a seam or a marking between them, of one instance or of two: one image each."""
    marking = Thing("marking", plane(96.0, 0.5, (20, 0, 0)), "RoadLine", "steel", is_object=False)
    faces = [slope(1, 0.0, gap), slope(-1, 0.0, gap)]
    state = scene(tmp_path, faces, names, small_target(), besides=[marking] if gap else [])
    found = solve(state, points(ACROSS), names)
    check_points(found, state, ACROSS, LEVEL, lambda number, place: True)
    check_each_once(found)


def test_a_marking_over_the_crown_belongs_to_the_slope_under_it(tmp_path) -> None:
    """4 mm over the road, it is within 1 cm of both planes.

    Each reflection on it counts for the slope that goes on there.
    """
    marking = Thing("marking", plane(96.0, 0.25, (20, 0, 0.004)), "RoadLine", "steel", is_object=False)
    state = scene(tmp_path, [slope(1, 1.0), slope(-1, 1.0)], ["road"], small_target(), besides=[marking])
    found = solve(state, points(ACROSS), ["road"])
    on_it = [np.abs(reflected(4.0, *face, center)[2][1]) < 0.12 for center in ACROSS for face in CROWN]
    assert sum(on_it) >= 2  # the marking is met
    check_points(found, state, ACROSS, CROWN, lambda number, place: place[1] * (1, -1)[number] > 0.0)


def test_a_road_on_a_plain_is_the_mirror_where_it_is(tmp_path) -> None:
    """The plain goes on 1/256 m under the road, within what counts as on its plane.

    a reflection is on what is on top.
    """
    top = 2.0**-8
    plain = Thing("plain", plane(128.0, 128.0), "Ground", "steel", is_object=False)
    road = slope(1, 0.0)
    road.apply_translation([0.0, 0.0, top])
    state = scene(tmp_path, [road], ["road"], small_target(), besides=[plain])
    found = solve(state, points(ACROSS), ["road", "plain"])
    planes = [((0, 0, top), (0.0, 0.0, 1.0)), ((0, 0, 0), (0.0, 0.0, 1.0))]
    check_points(found, state, ACROSS, planes, lambda number, place: (place[1] > 0.0) == (number == 0))
    check_each_once(found)


def test_mirrors_are_planes_of_their_own(tmp_path) -> None:
    """Triangles of one plane are one mirror, of two planes two, whatever the instance.

    Each triangle is in one mirror.
    """
    for name, sign, count in (("crown", 1.0, 2), ("level", 0.0, 1)):
        state = scene(tmp_path / name, [slope(1, sign), slope(-1, sign)], ["road"], small_target())
        mirrors = find_mirrors(state, [1], POSE.position, RADAR.wavelength)
        assert [mirror.number for mirror in mirrors] == list(range(count))
        assert sorted(np.concatenate([mirror.faces for mirror in mirrors]).tolist()) == [0, 1, 2, 3]


@pytest.mark.parametrize(("step", "count"), [(2.0**-13, 1), (2.0**-7, 2)])
def test_faces_that_differ_by_less_than_a_wave_can_tell_are_one_mirror(tmp_path, step, count) -> None:
    """A step of 0.1 mm in a road does not make two mirrors, one of 8 mm does."""
    higher = slope(-1, 0.0)
    higher.apply_translation([0.0, 0.0, step])
    state = scene(tmp_path, [slope(1, 0.0), higher], ["road"], small_target())
    assert len(find_mirrors(state, [1], POSE.position, RADAR.wavelength)) == count
    assert solve(state, points(ACROSS), ["road"]).num_paths == 4 * len(ACROSS)


def test_a_mirror_that_is_there_twice_counts_once(tmp_path, monkeypatch) -> None:
    state = scene(tmp_path, [slope(1, 1.0), slope(-1, 1.0)], ["road"], small_target())
    share = points(ACROSS)
    once = solve(state, share, ["road"])

    def doubled(*args):
        mirrors = find_mirrors(*args)
        return [replace(mirror, number=number) for number, mirror in enumerate([*mirrors, *mirrors])]

    monkeypatch.setattr(hybrid, "find_mirrors", doubled)
    check_same(solve(state, share, ["road"]), once)


def test_the_same_echo_by_two_mechanisms_is_still_refused(tmp_path) -> None:
    """The rough part of a crowned road by `raycast` and by `sionna`'s diffuse scattering, each over both faces."""
    rough = Thing("verge", plane(64.0, 8.0, (32, -14, 0)), "Roads", "grey", is_object=False)
    state = scene(tmp_path, [slope(1, 1.0), slope(-1, 1.0)], ["road"], small_target(), besides=[rough])
    options = {"num_samples": 20_000, "max_depth": 1}
    for diffuse in (False, True):
        plan = ChannelPlan(
            (points(ACROSS), Share("raycast", ("verge",), {"num_rays": 5_000})),
            ("road", "verge"),
            sionna={**options, "diffuse": diffuse},
        )
        if diffuse:
            with pytest.raises(DoubleCountError, match="computed twice"):
                solve_paths(state, RADAR, POSE, "hybrid", plan=plan)
        else:
            assert solve_paths(state, RADAR, POSE, "hybrid", plan=plan).num_paths > 0
