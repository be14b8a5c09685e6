"""The raycast solver against exact geometry, the radar equation and analytic integrals of its own model."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import dblquad

from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.semantics import semantic_id
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.channel.raycast.class_rcs import class_reflectivity
from scarl_sionna.radar.channel.raycast.grid import RayGrid
from scarl_sionna.radar.tuned import tuned_to
from tests.oracles import fresnel as oracle
from tests.scenes import Material, Thing, box, plane, write_scene

MATERIALS = {
    "concrete": Material(radio="concrete"),
    "asphalt": Material(radio="asphalt"),
    "steel": Material(radio="metal"),
    "pane": Material(radio="glass"),
}
# Coordinates of the planes are sums of few powers of two, so the float32 meshes hold them exactly.
WALL_X = 20.5

NUM_RAYS = 10_000


def _radar(**changes: object) -> RadarSpec:
    return RadarSpec().with_(**{"azimuth_fov_deg": 20.0, "elevation_fov_deg": 10.0, **changes})


def _world(folder, *things: Thing, actors: tuple[Thing, ...] = ()):
    return load_scene(write_scene(folder, things, actors, MATERIALS))


def _wall(material: str = "concrete", semantic: str = "Wall") -> Thing:
    return Thing("wall", plane(32.0, 32.0, (WALL_X, 0, 0), (-1, 0, 0)), semantic, material)


def _rcs(paths, radar: RadarSpec, column: int = 0):
    """Return the RCS [m2] behind each path's transfer and its distance [m], by the radar equation."""
    distance = np.linalg.norm(paths.tx_point - paths.world_from_tx.position, axis=1)
    power = np.abs(paths.a[:, column, column]) ** 2
    return power * (4 * np.pi) ** 3 * distance**4 / radar.wavelength**2, distance


def test_hits_lie_on_the_wall_along_the_rays(tmp_path) -> None:
    state, radar = _world(tmp_path, _wall()).at(0.0), _radar()
    pose = Pose.from_euler([0.25, -0.5, 0.125], yaw=0.1, pitch=-0.05)
    paths = solve_paths(state, radar, pose, "raycast", hits_per_cell=None, num_rays=NUM_RAYS)
    grid = RayGrid.over(np.radians(20.0), np.radians(10.0), NUM_RAYS)
    assert paths.num_paths == grid.num_rays
    # Exact intersection of a line with the plane x = WALL_X, in float64.
    direction = pose.rotate(grid.directions(0, grid.num_rays))
    distance = (WALL_X - 0.25) / direction[:, 0]
    exact = pose.position + distance[:, None] * direction
    # Rounding of a few float64 operations on coordinates of 20 m: a relative 1e-9 is 20 nm, 0.06 deg of carrier phase.
    assert np.abs(paths.tx_point - exact).max() < 1e-9 * WALL_X
    assert np.array_equal(paths.tx_point, paths.rx_point) and not paths.inner_length.any()


def test_opening_wall_and_approaching_radar_give_the_exact_length_rate(tmp_path) -> None:
    velocity, radar_velocity = np.array([3.0, -1.0, 0.5]), np.array([12.0, 2.0, 0.0])
    actor = Thing(
        "truck",
        box((4, 32, 32), (2, 0, 0)),
        "Truck",
        "steel",
        {"kind": "constant_twist", "position": [WALL_X, 0, 0], "velocity": velocity},
    )
    state, radar = _world(tmp_path, actors=(actor,)).at(0.0), _radar()
    paths = solve_paths(state, radar, Mount(Pose(), Twist(linear=radar_velocity)), "raycast", num_rays=NUM_RAYS)
    unit = paths.tx_point / np.linalg.norm(paths.tx_point, axis=1, keepdims=True)
    exact = 2.0 * unit @ (velocity - radar_velocity)
    # Both are a few float64 operations on velocities of about 12 m/s.
    assert np.abs(paths.length_rate - exact).max() < 1e-12 * 24
    assert not paths.length_acceleration.any()


def test_turning_actor_gives_each_point_its_own_velocity(tmp_path) -> None:
    actor = Thing(
        "truck",
        box((4, 32, 32), (2, 0, 0)),
        "Truck",
        "steel",
        {"kind": "constant_twist", "position": [WALL_X, 0, 0], "velocity": [0, 0, 0], "angular_velocity_z": 0.5},
    )
    paths = solve_paths(_world(tmp_path, actors=(actor,)).at(0.0), _radar(), Pose(), "raycast", num_rays=NUM_RAYS)
    arm = paths.tx_point - np.array([WALL_X, 0, 0])
    unit = paths.tx_point / np.linalg.norm(paths.tx_point, axis=1, keepdims=True)
    exact = 2.0 * np.einsum("ij,ij->i", unit, np.cross([0, 0, 0.5], arm))
    # The trajectory's twist at an instant may come from a rotation matrix: a few 1e-16 on 5 m/s.
    assert np.abs(paths.length_rate - exact).max() < 1e-12


@pytest.mark.parametrize(
    ("material", "permittivity", "thickness"),
    [
        ("concrete", oracle.ITU_CONCRETE, None),
        ("asphalt", 3.18 - 0.1j, None),
        ("pane", oracle.ITU_GLASS, 4e-3),
    ],
)
def test_every_hit_of_a_wall_has_the_reflectance_of_its_angle_and_polarisation(
    tmp_path, material: str, permittivity: complex, thickness: float | None
) -> None:
    radar = tuned_to(_radar(azimuth_fov_deg=120.0, elevation_fov_deg=60.0), oracle.FREQUENCY)
    paths = solve_paths(
        _world(tmp_path, _wall(material)).at(0.0),
        radar,
        Pose(),
        "raycast",
        class_rcs={"Wall": 1.0},
        hits_per_cell=None,
        num_rays=2_000,
    )
    unit = paths.tx_point / np.linalg.norm(paths.tx_point, axis=1, keepdims=True)
    perpendicular = np.cross(unit, [-1.0, 0.0, 0.0])
    perpendicular /= np.linalg.norm(perpendicular, axis=1, keepdims=True)
    phi_hat = np.cross([0, 0, 1.0], unit)
    phi_hat /= np.linalg.norm(phi_hat, axis=1, keepdims=True)
    te, tm = np.array(
        [[abs(value) ** 2 for value in oracle.reflection(permittivity, np.arccos(x), thickness)] for x in unit[:, 0]]
    ).T
    te_of_h = np.einsum("ij,ij->i", perpendicular, phi_hat) ** 2
    solid_angle = paths.diagnostics["solid_angle"]
    for column, fraction in ((0, 1.0 - te_of_h), (1, te_of_h)):
        rcs, distance = _rcs(paths, radar, column)
        found = rcs / (distance**2 * solid_angle)
        # The table's permittivity agrees with the oracle's to 1e-7 (conductivity of asphalt given to 5 digits).
        assert found == pytest.approx(fraction * te + (1.0 - fraction) * tm, rel=1e-5, abs=1e-9)
    assert not paths.a[:, 0, 1].any() and not paths.a[:, 1, 0].any()


@pytest.mark.parametrize(("grid", "tolerance"), [("regular", 1e-5), ("staggered", 1e-4)])
def test_power_of_a_wall_is_the_integral_of_the_radar_equation(tmp_path, grid: str, tolerance: float) -> None:
    radar = _radar(azimuth_fov_deg=60.0, elevation_fov_deg=30.0)
    paths = solve_paths(
        _world(tmp_path, _wall()).at(0.0), radar, Pose(), "raycast", hits_per_cell=None, grid=grid, num_rays=40_000
    )
    gamma = class_reflectivity()[semantic_id("Wall")]

    def density(sine_elevation: float, azimuth: float) -> float:
        # |a|^2 of a solid angle: gamma lambda^2 R_V / ((4 pi)^3 d^2), with d and R_V from plane geometry.
        cosine = np.sqrt(1 - sine_elevation**2)
        unit = np.array([cosine * np.cos(azimuth), cosine * np.sin(azimuth), sine_elevation])
        te, tm = (abs(value) ** 2 for value in oracle.reflection(oracle.ITU_CONCRETE, np.arccos(unit[0])))
        perpendicular = np.array([0.0, -unit[2], unit[1]]) / max(np.hypot(unit[1], unit[2]), 1e-12)
        te_of_h = (perpendicular @ np.array([-unit[1], unit[0], 0.0]) / cosine) ** 2
        reflectance = te_of_h * tm + (1 - te_of_h) * te
        return gamma * radar.wavelength**2 * reflectance / ((4 * np.pi) ** 3 * (WALL_X / unit[0]) ** 2)

    edge = np.sin(np.radians(15.0))
    exact, _ = dblquad(density, -np.radians(30.0), np.radians(30.0), -edge, edge, epsabs=0, epsrel=1e-7)
    # Midpoint rule with cells h = 3.7e-3 rad: relative error about h^2 / 24 f''/f with f''/f of order 4: 2e-6.
    # Staggered rays leave the mean of a slope over a cell (1 in 270) times the discrepancy of 283 columns (about 3 /
    # 283): 4e-5.
    assert (np.abs(paths.a[:, 0, 0]) ** 2).sum() == pytest.approx(exact, rel=tolerance)


def test_ground_clutter_of_a_range_cell_is_gamma_times_its_area(tmp_path) -> None:
    # Constant-gamma clutter: a ring of depth dR has gamma sin(psi) R dphi dR / cos(psi) on its ground area, which is
    # gamma h dphi dR exactly. h = 0.5 m, 3 deg, gamma = -15 dB: -37.9127 dBsm for a cell of 0.1953 m at any range.
    ground = Thing("ground", plane(128.0, 128.0, (0, 0, 0), (0, 0, 1)), "Roads", "steel")
    radar = RadarSpec(azimuth_fov_deg=3.0, elevation_fov_deg=0.6)
    pose = Pose.from_euler([0, 0, 0.5], pitch=np.radians(1.0))
    paths = solve_paths(
        _world(tmp_path, ground).at(0.0), radar, pose, "raycast", class_rcs={"Roads": 10**-1.5}, num_rays=400_000
    )
    rcs, distance = _rcs(paths, radar, column=1)  # horizontal: metal reflects all of it even at grazing incidence
    near, far = 25.0, 35.0
    mean_cell = rcs[(distance > near) & (distance < far)].sum() * 0.1953 / (far - near)
    # A ring's edges cut single rows of rays: 1 row of the 210 in the ring (4.8e-3); metal's loss is below 1e-4.
    assert 10 * np.log10(mean_cell) == pytest.approx(-37.9127, abs=10 * np.log10(1 + 1 / 200))


def test_a_car_sized_plate_has_the_class_rcs(tmp_path) -> None:
    # gamma of a car times 1.5 x 1.375 m of metal across the rays: 10.9 dBsm.
    plate = Thing("car", plane(1.5, 1.375, (20, 0, 0), (-1, 0, 0)), "Car", "steel")
    radar = _radar(azimuth_fov_deg=10.0, elevation_fov_deg=10.0)
    rcs, _ = _rcs(solve_paths(_world(tmp_path, plate).at(0.0), radar, Pose(), "raycast", num_rays=1_000_000), radar)
    expected = 6.0 * 1.5 * 1.375
    # Edges: half a cell (3.5 mm of 1.5 m) on each side at most, 0.5 %; loss of metal 0.2 %; obliquity 4e-4.
    assert rcs.sum() == pytest.approx(expected, rel=0.008)
    assert 10 * np.log10(expected) == pytest.approx(10.9, abs=0.1)


def test_labels_name_instance_and_class(tmp_path) -> None:
    left = Thing("left", plane(8.0, 8.0, (16, 4, 0), (-1, 0, 0)), "Building", "concrete")
    right = Thing("right", plane(8.0, 8.0, (16, -4, 0), (-1, 0, 0)), "GuardRail", "steel")
    world = _world(tmp_path, left, right)
    paths = solve_paths(
        world.at(0.0), _radar(), Pose.from_euler([0, 0, 0], yaw=0.003), "raycast", num_rays=NUM_RAYS
    )  # no ray on the common edge
    on_left = paths.tx_point[:, 1] > 0
    names = {number: info.name for number, info in world.instances.items()}
    assert {names[number] for number in paths.instance[on_left, 0]} == {"left"}
    assert {names[number] for number in paths.instance[~on_left, 0]} == {"right"}
    assert set(paths.semantic[on_left]) == {semantic_id("Building")}
    assert set(paths.semantic[~on_left]) == {semantic_id("GuardRail")}
    assert (paths.depth == 1).all() and paths.instance.shape == paths.interaction.shape == (paths.num_paths, 1)


def test_nothing_beyond_the_unambiguous_range_comes_back(tmp_path) -> None:
    # Table 1 reaches 255.82 m; the wall stands at 256 m.
    far = Thing("far", plane(256.0, 256.0, (256.0, 0, 0), (-1, 0, 0)), "Wall", "steel")
    state = _world(tmp_path, far).at(0.0)
    assert solve_paths(state, _radar(), Pose(), "raycast", num_rays=NUM_RAYS).num_paths == 0
    assert solve_paths(state, _radar(), Pose(), "raycast", max_distance=300.0, num_rays=NUM_RAYS).num_paths > 0


def test_constant_rcs_per_hit_does_not_depend_on_distance(tmp_path) -> None:
    radar = _radar()
    paths = solve_paths(
        _world(tmp_path, _wall("steel")).at(0.0),
        radar,
        Pose(),
        "raycast",
        rcs_model="per_hit",
        hits_per_cell=None,
        num_rays=NUM_RAYS,
    )
    rcs, _ = _rcs(paths, radar, column=1)
    # gamma times the reference footprint of 4.34 cm2; metal takes less than 0.3 % at these angles.
    assert rcs == pytest.approx(np.full(len(rcs), 0.3 * 4.34e-4), rel=3e-3)


def test_scattered_rays_stay_in_their_cells_and_hit_a_wall_along_the_line_of_sight_everywhere() -> None:
    """Rays of one column meet a wall at one place; turned row by row they meet it at as many as there are rows."""
    fov, width = np.radians(90.0), np.radians(90.0) / 100
    rays = {
        kind: RayGrid(fov, np.radians(20.0), 100, 40, kind).directions(0, 4000) for kind in ("staggered", "scattered")
    }
    azimuth = {kind: np.arctan2(ray[:, 1], ray[:, 0]) for kind, ray in rays.items()}
    assert np.abs(azimuth["scattered"] - azimuth["staggered"]).max() <= 0.5 * width + 1e-12
    np.testing.assert_allclose(rays["scattered"][:, 2], rays["staggered"][:, 2], rtol=0.0, atol=0.0)
    # a wall 8 m aside: where along it rays arrive, between 20 and 60 m
    gaps = {}
    for kind, angle in azimuth.items():
        along = np.unique(np.round(8.0 / np.tan(angle[angle > 0.05]), 9))
        gaps[kind] = np.diff(along[(along > 20.0) & (along < 60.0)]).max()
    assert gaps["scattered"] < 0.1 * gaps["staggered"]
