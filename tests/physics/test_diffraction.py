"""Diffraction of the solver `sionna`: the wedge's coefficient against exact fields, and paths over edges in a scene."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import trimesh

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine import variant
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.rays.edges import Wedge, wedge_at
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.channel.multipath.utd import EdgeRay, edge_transfer, transition
from scarl_sionna.radar.point_scatterers import PointScatterers
from scarl_sionna.radar.points import solve_points
from tests.oracles import diffraction as oracle
from tests.scenes import Thing, box, plane, write_scene

RADAR = RadarSpec().with_(pattern=IsotropicPattern(), bandwidth=150e6)
WAVENUMBER = 2.0 * np.pi / RADAR.wavelength
FEW = {"num_samples": 20_000, "diffraction": True}
TOP, AHEAD = 2.0, 10.0
"""Height of the screen's edge and its distance [m]."""


@pytest.fixture(autouse=True, scope="module")
def radio_variant():
    """Stay in one variant: each switch takes longer than a solve."""
    with variant.radio():
        yield


def conductor(_cosine: float) -> tuple[complex, complex]:
    return -1.0, 1.0


def plane_wave_total(exterior: float, rho: float, phi: float, phi0: float, kind: str) -> complex:
    """Geometrical optics and diffracted field for a plane wave, from the coefficient under test."""
    edge = Wedge(np.zeros(3), np.array([0, 0, 1.0]), 1.0, np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), exterior)
    incident, out = -np.array([np.cos(phi0), np.sin(phi0), 0.0]), np.array([np.cos(phi), np.sin(phi), 0.0])
    far = 1e9
    ray = EdgeRay(incident, out, far, rho)
    turned = edge_transfer(edge, ray, WAVENUMBER, conductor) * np.exp(-1j * WAVENUMBER * rho)
    z = np.array([0, 0, 1.0])
    ends = (z, z) if kind == "soft" else (np.cross(z, incident), np.cross(z, out))
    total = complex(ends[1] @ turned @ ends[0])
    sign = -1.0 if kind == "soft" else 1.0
    n_face = 2.0 * exterior - np.pi - phi0
    for present, angle, factor in (
        (phi < np.pi + phi0, phi - phi0, 1.0),
        (phi < np.pi - phi0, phi + phi0, sign),
        (exterior - phi0 < np.pi and phi > n_face, 2.0 * exterior - phi - phi0, sign),
    ):
        if present:
            total += factor * np.exp(1j * WAVENUMBER * rho * np.cos(angle))
    return total


@pytest.mark.parametrize("kind", ["soft", "hard"])
@pytest.mark.parametrize("phi0", [0.3, 1.2, 2.5])
def test_half_plane_is_sommerfelds(kind: str, phi0: float) -> None:
    for phi in np.linspace(0.05, 2.0 * np.pi - 0.05, 41):
        expected = oracle.half_plane(WAVENUMBER, 0.5, phi, phi0, kind)
        # For a half plane in a plane wave the uniform theory is exact; left are 1e9 m instead of infinity, k rho^2 /
        # 2e9.
        assert abs(plane_wave_total(2.0 * np.pi, 0.5, phi, phi0, kind) - expected) < 1e-6


@pytest.mark.parametrize("kind", ["soft", "hard"])
@pytest.mark.parametrize(("exterior_deg", "phi0_deg"), [(270.0, 40.0), (270.0, 150.0), (315.0, 60.0), (240.0, 100.0)])
def test_wedge_agrees_with_the_series(kind: str, exterior_deg: float, phi0_deg: float) -> None:
    exterior, phi0 = np.radians([exterior_deg, phi0_deg])
    rho = 100.0 / WAVENUMBER
    for phi in np.radians(np.arange(3.1, exterior_deg, 11.7)):
        expected = oracle.wedge(WAVENUMBER, rho, phi, phi0, exterior, kind)
        # What the uniform theory leaves out is of the order (k rho)^-3/2 = 1e-3, times cotangents of some units.
        assert abs(plane_wave_total(exterior, rho, phi, phi0, kind) - expected) < 8e-3


def test_transition_function_has_its_limits() -> None:
    assert abs(transition(0.0)) == 0.0
    assert transition(1e6) == pytest.approx(1.0, abs=1e-6)
    # Kouyoumjian and Pathak, Eqs. (31), (32): expansions for small and large arguments
    x = 1e-3
    small = (np.sqrt(np.pi * x) - 2.0 * x * np.exp(0.25j * np.pi)) * np.exp(1j * (np.pi / 4.0 + x))
    assert transition(x) == pytest.approx(small, abs=5e-5)  # next term: 2/3 x^2 and sqrt(x) x
    assert transition(20.0) == pytest.approx(1 + 0.5j / 20 - 0.75 / 400 - 1.875j / 8000, abs=1e-4)


def sheet(half_width: float = 100.0, bottom: float = -100.0, x: float = 0.0) -> trimesh.Trimesh:
    corners = [(x, -half_width, bottom), (x, half_width, bottom), (x, half_width, TOP), (x, -half_width, TOP)]
    return trimesh.Trimesh(np.array(corners, dtype=np.float64), [(0, 2, 1), (0, 3, 2)], process=False)


@pytest.fixture(scope="module")
def screen(tmp_path_factory):
    thing = Thing("screen", sheet(x=AHEAD), "Wall", "steel")
    return load_scene(write_scene(tmp_path_factory.mktemp("screen"), [thing])).at(0.0)


def over_top(paths):
    """Return the paths that touch nothing but the upper edge and the target."""
    lower = np.minimum(paths.tx_point[:, 2], paths.rx_point[:, 2])
    return paths.select((lower > -20.0) & (lower < 20.0) & (np.abs(paths.tx_point[:, 1]) < 50.0))


def field(paths, polarization: int = 0) -> complex:
    length = PathGeometry.of(paths, RADAR).center_length()
    return complex(np.sum(paths.a[:, polarization, polarization] * np.exp(-1j * WAVENUMBER * length)))


def two_way(state, target) -> tuple[complex, complex]:
    """Return the two-way field of a point over the screen, over that in free space, V and H."""
    points = PointScatterers([target], np.zeros((1, 3)), 1.0)
    pose = Pose([0, 0, 1.0])
    paths = solve_points(state, RADAR, pose, points, max_depth=1, **FEW)
    free = PointScatterers([target], np.zeros((1, 3)), 1.0)
    alone = field(solve_points(state, RADAR, pose, free, max_depth=0, num_samples=1)) or None
    if alone is None:  # in the shadow
        distance = float(np.linalg.norm(np.asarray(target) - pose.position))
        alone = RADAR.wavelength / (4 * np.pi) ** 1.5 / distance**2 * np.exp(-2j * WAVENUMBER * distance)
    near = paths.select((np.abs(paths.tx_point[:, 2]) < 10.0) & (np.abs(paths.rx_point[:, 2]) < 10.0))
    return field(near, 0) / alone, field(near, 1) / alone


@pytest.mark.some(2)  # at the boundary: test_field_is_smooth_across_the_shadow_boundary
@pytest.mark.parametrize("height", [2.9, 3.45, 3.55, 4.3])
def test_knife_edge(screen, height: float) -> None:
    """A target 25 m away around the shadow boundary at 3.5 m.

    Line of sight and edge together are the knife edge's field.
    """
    found = two_way(screen, (25.0, 0.0, height))
    clearance = 1.0 + (height - 1.0) * AHEAD / 25.0 - TOP
    slant = np.hypot(25.0, height - 1.0) / 25.0
    once = oracle.knife_edge(clearance / slant, AHEAD * slant, 15.0 * slant, RADAR.wavelength)
    for polarization, value in enumerate(found):
        # The knife edge is Kirchhoff's, for small angles: at 3 deg and 20 dB down the two polarisations are 0.25 dB
        # each way.
        bound = 0.15 if abs(clearance) < 0.1 else 0.6
        assert 20 * np.log10(abs(value) / abs(once) ** 2) == pytest.approx(0.0, abs=bound), polarization


def test_field_is_smooth_across_the_shadow_boundary(screen) -> None:
    heights = 3.5 + np.linspace(-0.011, 0.011, 6)
    found = np.array([two_way(screen, (25.0, 0.0, height)) for height in heights])
    # At the boundary half of the field, to the fourth in power: -12.04 dB two-way; a step of 4.4 mm turns it by 0.07 of
    # it.
    middle = 20 * np.log10(np.abs(found[2:4]).mean(axis=0))
    assert middle == pytest.approx([-12.04, -12.04], abs=0.1)
    steps = np.abs(np.diff(found, axis=0)) / np.abs(found[:-1])
    assert steps.max() < 1.3 * np.median(steps) < 0.1


def test_backscatter_of_an_edge_is_kellers(screen) -> None:
    pose = Pose([0.0, 3.0, 7.0])
    paths = solve_paths(screen, RADAR, pose, "sionna", max_depth=1, **FEW)
    edge = over_top(paths.select(paths.interaction[:, 0] == 8))
    assert edge.num_paths == 1
    distance = np.hypot(AHEAD, 7.0 - TOP)
    assert edge.tx_point[0] == pytest.approx([AHEAD, 3.0, TOP], abs=1e-12)
    assert edge.rx_point[0] == pytest.approx([AHEAD, 3.0, TOP], abs=1e-12)
    assert PathGeometry.of(edge, RADAR).center_length()[0] == pytest.approx(2 * distance, abs=1e-12)
    phi = np.pi / 2 + np.arctan2(7.0 - TOP, AHEAD)  # from the screen, which goes down from its edge
    for index, kind in enumerate(["hard", "soft"]):  # V lies across the horizontal edge, H along it
        coefficient = oracle.keller_backscatter(WAVENUMBER, phi, kind)
        expected = RADAR.wavelength / (4 * np.pi) * abs(coefficient) / np.sqrt(2.0 * distance**3)
        # Keller's is the limit far from the boundary, here 1 / (2 k L a) = 1e-4; metal of 1e7 S/m 1e-3.
        assert abs(edge.a[0, index, index]) == pytest.approx(expected, rel=3e-3)


def test_over_a_box_by_the_ground(tmp_path) -> None:
    things = [
        Thing("hut", box((4, 60, 2), (12, 0, 1)), "Building", "steel"),
        Thing("ground", plane(256, 256), "Roads", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    start, target = np.array([0.0, 0.3, 1.0]), np.array([20.0, 1.0, 4.0])
    points = PointScatterers([target], np.zeros((1, 3)), 1.0)
    options = {**FEW, "max_depth": 2}
    paths = solve_points(state, RADAR, Pose(start), points, **options)
    there = paths.select(
        np.all(paths.interaction[:, :4] == [1, 8, 0, -1], axis=1)
    )  # ground, edge, target; straight back
    there = there.select((there.instance[:, 0] == 2) & (there.instance[:, 1] == 1))
    assert there.num_paths == 1
    # Unfolded: the image of the start below the ground, the edge x = 10, z = 2 along y
    legs = np.hypot(10.0, 2.0 + 1.0) + np.hypot(10.0, 2.0)
    expected = np.hypot(legs, 0.7) + np.linalg.norm(target - start)
    assert PathGeometry.of(there, RADAR).center_length()[0] == pytest.approx(expected, abs=1e-12)


@pytest.mark.some(1)
@pytest.mark.parametrize("moving", ["target", "radar", "screen"])
def test_rate_and_acceleration_over_an_edge(tmp_path, moving: str) -> None:
    trajectory = {
        "kind": "constant_twist",
        "position": [AHEAD, 0, 0],
        "velocity": [3.0, 0.5, 2.0] if moving == "screen" else [0, 0, 0],
    }
    world = load_scene(write_scene(tmp_path, actors=[Thing("screen", sheet(), "Wall", "steel", trajectory)]))
    velocity = {name: np.array([4.0, -3.0, 1.5]) * (name == moving) for name in ("target", "radar")}
    start, target = np.array([0, 0, 1.0]), np.array([25.0, 2.0, 2.5])

    def solve(time: float):
        points = PointScatterers([target + velocity["target"] * time], [velocity["target"]], 1.0)
        paths = solve_points(
            world.at(1.0 + time),
            RADAR,
            Mount(Pose(start + velocity["radar"] * time), Twist(velocity["radar"])),
            points,
            max_depth=1,
            max_distance=60.0,
            **FEW,
        )
        return over_top(paths)

    step = 2e-3
    ahead, now, back = solve(-step), solve(0.0), solve(step)
    length = [PathGeometry.of(paths, RADAR).center_length() for paths in (ahead, now, back)]
    assert [paths.num_paths for paths in (ahead, now, back)] == [1, 1, 1]
    assert now.interaction[0, :3].tolist() == [8, 0, 8]
    # third derivatives v^3 / R^2 = 1 m/s3 times h^2 / 6, the fourth v^4 / R^3 times h^2 / 12; rounding 1e-14 / h and /
    # h^2; an edge that moves lies in float32 vertices: 1e-6 m / h
    limit = 1e-3 if moving == "screen" else 2e-6
    assert (length[2] - length[0]) / (2 * step) == pytest.approx(now.length_rate, abs=limit)
    if moving != "screen":
        assert (length[2] - 2 * length[1] + length[0]) / step**2 == pytest.approx(now.length_acceleration, abs=1e-4)
    assert abs(now.length_rate[0]) > 1.0
    # the edge's point, seen from the radar, slides as the geometry does
    slid = (back.tx_point - ahead.tx_point) / (2 * step) - velocity["radar"]
    assert slid == pytest.approx(now.tx_velocity, abs=2 * limit) and np.array_equal(now.tx_velocity, now.rx_velocity)


def test_antennas_behind_an_edge(screen) -> None:
    """A small array is served by one solve; for a wide one the error is reported."""
    points = PointScatterers([[25.0, 1.0, 2.5]], np.zeros((1, 3)), 1.0)
    options = {"max_depth": 1, **FEW}
    radar = RADAR.with_(tx_positions=((0, 0.1, 0),), rx_positions=((0, -0.1, 0.004),))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        paths = over_top(solve_points(screen, radar, Pose([0, 0, 1.0]), points, **options))
    single = RADAR.with_(tx_positions=((0, 0, 0),), rx_positions=((0, 0, 0),))
    ends = [Pose([0, 0.1, 1.0]), Pose([0, -0.1, 1.004])]
    alone = over_top(solve_points(screen, single, ends[0], points, receiver=ends[1], **options))
    found, expected = PathGeometry.of(paths, radar).length(0, 0), PathGeometry.of(alone, single).center_length()
    # The edge lies along y, so along the array the wavefront is the target's: what is left is 0.004 m across it.
    assert np.abs(found - expected).max() < 2.5 * paths.diagnostics["edge_wavefront_error"] < 2e-6
    tall = RADAR.with_(tx_positions=((0, 0.5, 0.5),), rx_positions=((0, 0, 0),))
    with pytest.warns(ScarlWarning, match="wavefront has two radii"):
        wide = solve_points(screen, tall, Pose([0, 0, 1.0]), points, **options)
    assert wide.diagnostics["edge_wavefront_error"] > 1e-3


def test_antennas_of_an_edges_echo(screen) -> None:
    """To the radar itself: the path is an isometry, exact along the edge."""
    tx, rx = (0.0, 0.3, 0.0), (0.0, -0.4, 0.0)
    radar = RADAR.with_(tx_positions=(tx,), rx_positions=(rx,))
    pose = Pose([0.0, 3.0, 7.0])
    paths = over_top(solve_paths(screen, radar, pose, "sionna", max_depth=1, **FEW))
    rho = np.hypot(AHEAD, 7.0 - TOP)
    assert paths.num_paths == 1 and np.isfinite(paths.rx_image).all()
    assert PathGeometry.of(paths, radar).length(0, 0)[0] == pytest.approx(np.hypot(2 * rho, 0.7), abs=1e-12)


def test_short_edges_are_named(tmp_path) -> None:
    post = Thing("post", box((0.2, 0.2, 0.2), (10, 0, 1.0)), "Pole", "steel")
    state = load_scene(write_scene(tmp_path, [post])).at(0.0)
    points = PointScatterers([[20.0, 0.3, 1.0]], np.zeros((1, 3)), 1.0)
    with pytest.warns(ScarlWarning, match="'post': an edge of 0.2 m"):
        solve_points(
            state,
            RADAR,
            Pose([0, 0, 1.0]),
            points,
            environment=True,
            max_depth=1,
            num_samples=1_000_000,
            diffraction=True,
        )


def test_where_no_edge_is(tmp_path) -> None:
    """The diagonal of a rectangle is none; the corner of a room is one from outside only.

    a free border is one from both sides.
    """
    things = [
        Thing("wall", plane(4, 4, (0, 0, 0), (-1, 0, 0)), "Wall", "steel"),
        Thing("room", box((8, 8, 4), (50, 0, 0))),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    assert wedge_at(state, 0, 0, np.zeros(3)) is None
    border = wedge_at(state, 0, 0, np.array([0.0, 0.3, 2.0])) or wedge_at(state, 0, 0, np.array([0.0, 0.3, -2.0]))
    assert border is not None and border.exterior == 2 * np.pi and border.length == pytest.approx(4.0)
    sides = [border.seen_from(np.array([x, 0.0, 0.0])) for x in (-5.0, 5.0)]
    assert all(
        side is not None and side.cylindrical(np.array([x, 0, 0]))[1] < np.pi
        for side, x in zip(sides, (-5, 5), strict=True)
    )
    rows = state._triangles.corners[state._triangles.first[1] : state._triangles.first[2]]
    corner = np.array([46.0, -4.0, 0.5])  # on the vertical edge between the faces that look to -x and -y
    faces = [
        face for face in range(len(rows)) if np.sum(np.abs(rows[face, :, :2] - corner[:2]).max(axis=1) < 1e-6) == 2
    ]
    wedge = wedge_at(state, 1, faces[0], corner)
    assert wedge is not None and wedge.exterior == pytest.approx(1.5 * np.pi)
    assert wedge.seen_from(np.array([50.0, 0.0, 0.0])) is None  # within
    for outside in ([40.0, 0, 0], [50.0, -9.0, 0], [40.0, -9.0, 0]):
        lit = wedge.seen_from(np.array(outside))
        assert lit is not None and lit.cylindrical(np.array(outside))[1] <= np.pi


def test_bistatic_link_over_the_screen(screen) -> None:
    """A second radar in the shadow: one path over the edge, with the knife edge's level, for all antennas of both."""
    pose, rx_pose = Pose([0, 0, 1.0]), Pose.from_euler([25.0, 1.5, 2.6], yaw=np.pi)
    radar = RADAR.with_(tx_positions=((0, 0.1, 0),), rx_positions=((0, -0.2, 0),))
    paths = over_top(solve_paths(screen, radar, pose, "sionna", receiver=rx_pose, max_depth=1, **FEW))
    assert paths.num_paths == 1 and paths.interaction[0, 0] == 8 and paths.instance[0, 0] == 1
    # Unfolded: rho of both ends to the edge x = 10, z = 2, and what they are apart along it
    total = np.hypot(10.0, 1.0) + np.hypot(15.0, 0.6)
    assert PathGeometry.of(paths, radar).center_length()[0] == pytest.approx(np.hypot(total, 1.5), abs=1e-12)
    # transmitter at y = 0.1; the receiver looks back, so its antenna at -0.2 of its own y stands at 1.5 + 0.2
    assert PathGeometry.of(paths, radar).length(0, 0)[0] == pytest.approx(np.hypot(total, 1.6), abs=1e-9)
    free = RADAR.wavelength / (4 * np.pi * np.linalg.norm(rx_pose.position - pose.position))
    clearance = 1.0 + 1.6 * AHEAD / 25.0 - TOP
    once = abs(oracle.knife_edge(clearance, AHEAD, 15.0, RADAR.wavelength))
    for index in range(2):
        assert 20 * np.log10(abs(paths.a[0, index, index]) / free / once) == pytest.approx(0.0, abs=0.4)
