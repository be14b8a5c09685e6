"""Mirror multipath of the solver `sionna` against closed forms.

Two-ray ground, ghosts, double bounce, bistatic pair.
"""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine import variant
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.point_scatterers import PointScatterers
from scarl_sionna.radar.points import point_targets, solve_points
from scarl_sionna.scene.materials.table import MaterialTable, RadioMaterial, builtin_materials
from tests.oracles import multipath as oracle
from tests.scenes import Material, Thing, plane, write_scene

RADAR = RadarSpec().with_(pattern=IsotropicPattern(), bandwidth=150e6)
FEW = {"num_samples": 20_000}
LOOKS = {"asphalt": Material(radio="smooth_asphalt"), "concrete": Material(radio="smooth_concrete")}


@pytest.fixture(autouse=True, scope="module")
def radio_variant():
    """Stay in one variant: each switch takes longer than a solve."""
    with variant.radio():
        yield


def smooth(name: str) -> RadioMaterial:
    return builtin_materials()[name].with_(name=f"smooth_{name}", scattering_coefficient=0.0, roughness_rms=0.0)


TABLE = MaterialTable([*builtin_materials().values(), smooth("asphalt"), smooth("concrete")])


def scene(folder, *things, **others):
    return load_scene(write_scene(folder, things, materials=LOOKS, **others), TABLE)


def ground(material: str) -> Thing:
    return Thing("ground", plane(400.0, 400.0), "Roads", material)


def wall(y: float, material: str) -> Thing:
    return Thing("wall", plane(32.0, 256.0, (64, y, 0), (0, -1, 0)), "Wall", material)


def lengths(paths) -> np.ndarray:
    return PathGeometry.of(paths, RADAR).center_length()


def two_ray_db(state, x, height: float) -> dict[str, np.ndarray]:
    """Return two-way power over free space [dB] of points at ground ranges x, by polarisation."""
    count = len(x)
    points = PointScatterers(np.stack([x, np.zeros(count), np.full(count, height)], axis=1), np.zeros((count, 3)), 1.0)
    pose = Pose([0, 0, oracle.RADAR_HEIGHT])
    paths = solve_points(state, RADAR, pose, points, max_depth=1, **FEW)
    assert paths.num_paths == 4 * count  # direct, ground there, ground back, ground both ways
    phase = np.exp(-1j * oracle.WAVENUMBER * lengths(paths))
    out = {}
    for index, polarization in enumerate("VH"):
        total = np.abs((paths.a[:, index, index] * phase).reshape(count, 4).sum(axis=1))
        out[polarization] = 20.0 * np.log10(total / np.abs(paths.a[::4, index, index]))
    return out


@pytest.fixture(scope="module")
def asphalt(tmp_path_factory):
    return scene(tmp_path_factory.mktemp("asphalt"), ground("asphalt")).at(0.0)


@pytest.mark.some(2)
@pytest.mark.parametrize("height", [0.3, 0.5, 1.0, 1.5])
def test_two_ray_ground(asphalt, height: float) -> None:
    found = two_ray_db(asphalt, np.array(oracle.GROUND_RANGES), height)
    for polarization in "VH":
        # The bar is 0.1 dB; the geometry is exact and the material the oracle's to 1e-6: 0.01 dB is left for the nulls.
        assert np.abs(found[polarization] - oracle.TWO_RAY_DB[polarization, height]).max() < 0.01


def test_two_ray_nulls_of_metal(tmp_path) -> None:
    state = scene(tmp_path, ground("steel")).at(0.0)
    expected = np.array(oracle.NULL_GROUND_RANGES)[::3]
    steps = np.linspace(-0.002, 0.002, 41)
    x = (expected[:, None] * (1.0 + steps)).ravel()
    level = two_ray_db(state, x, 0.5)["H"].reshape(len(expected), -1)
    nulls = expected * (1.0 + steps[level.argmin(axis=1)])
    assert np.abs(nulls / expected - 1.0).max() < 1e-3  # the bar; the grid's step is a tenth of it
    assert (
        level.min(axis=1).max() < -40.0
    )  # half a step aside: 2 pi n 5e-5 = 4e-3 for n = 12, to the fourth power -96 dB


@pytest.mark.slow
def test_two_ray_extrema_of_asphalt(asphalt) -> None:
    steps = np.linspace(-0.002, 0.002, 21)
    columns = [(pol, name) for pol in "HV" for name in ("min_x_m", "max_x_m")]
    x = np.array([oracle.ASPHALT_EXTREMA[pol][name] for pol, name in columns])
    level = two_ray_db(asphalt, (x[..., None] * (1.0 + steps)).ravel(), 0.5)
    for row, (pol, name) in enumerate(columns):
        found = level[pol].reshape(*x.shape, len(steps))[row]
        if name == "min_x_m":
            assert np.abs(steps[found.argmin(axis=1)]).max() <= 1e-3  # the bar
        else:  # a maximum is flat: its level says more than its place
            assert np.abs(found.max(axis=1) - oracle.ASPHALT_EXTREMA[pol]["max_dB"]).max() < 0.01  # bar 0.1 dB


def ghosts(state, position, velocity):
    paths = point_targets([[*position, 0.0]], [[*velocity, 0.0]], 1.0, RADAR, Pose(), state=state, **FEW)
    assert paths.num_paths == 4 and paths.depth.tolist() == [1, 2, 2, 3]
    return paths


GHOSTS = [
    (4.0, "steel", (30.0, -1.0), (-10.0, 0.5), oracle.WALL_GHOST),
    (3.0, "concrete", (15.0, 0.0), (-5.0, 0.0), oracle.CONCRETE_GHOST),
]


@pytest.mark.some(1)
@pytest.mark.parametrize(("y", "material", "position", "velocity", "expected"), GHOSTS)
def test_ghosts_behind_a_wall(tmp_path, y, material, position, velocity, expected) -> None:
    paths = ghosts(scene(tmp_path, wall(y, material)).at(0.0), position, velocity)
    order = ("direct", "type1", "type1", "type2")
    ranges = [expected["R_direct_m"], *[expected["apparent_range_type1_m"]] * 2, expected["apparent_range_type2_m"]]
    assert np.abs(lengths(paths) / 2.0 - ranges).max() < 1e-9  # bar 1 mm; exact up to the oracle's printed digits
    rates = [expected[f"v_{name}_mps"] for name in order]
    assert np.abs(paths.length_rate / 2.0 - rates).max() < 1e-9  # bar 1e-3 m/s
    direct, image = expected["az_direct_deg"], expected["az_image_deg"]
    for points, azimuth in (
        (paths.tx_point, [direct, direct, image, image]),  # direction of departure
        (paths.rx_point, [direct, image, direct, image]),  # and of arrival: a ghost of type 1 has both
    ):
        found = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
        assert np.abs(found - azimuth).max() < 1e-9  # bar 0.01 deg
    level = 20.0 * np.log10(np.abs(paths.a[:, 0, 0]) / np.abs(paths.a[0, 0, 0]))
    relative = [0.0, *[expected["amp_type1_each_rel_dB"]] * 2, expected["amp_type2_rel_dB"]]
    # Bar 0.05 dB. Concrete is the oracle's; steel of 1e7 S/m reflects 0.0023 dB less than a perfect conductor (TE, 73
    # deg).
    assert np.abs(level - relative).max() < (0.006 if material == "steel" else 1e-6)
    turn = np.angle(paths.a[1, 0, 0] / paths.a[0, 0, 0]) - oracle.WAVENUMBER * (lengths(paths)[1] - lengths(paths)[0])
    # The oracle states the phase in [0, 2 pi), and 1e4 rad of path phase with 11 digits: 1e-7 m is 2e-4 rad, metal
    # 3e-4.
    assert abs(np.exp(1j * (turn - expected["phase_type1_minus_direct_rad"])) - 1.0) < 1e-3


def test_a_wall_that_is_too_short_has_no_ghost(tmp_path) -> None:
    # The reflection point would be at x = 13.333 m; this wall ends at x = 13.25 m.
    short = Thing("wall", plane(32.0, 9.25, (13.25 - 4.625, 4, 0), (0, -1, 0)), "Wall", "steel")
    state = scene(tmp_path, short).at(0.0)
    paths = point_targets([[30, -1, 0]], [[0, 0, 0]], 1.0, RADAR, Pose(), state=state, **FEW)
    assert paths.num_paths == 1


def test_a_hidden_target_is_seen_by_the_mirror_only(tmp_path) -> None:
    screen = Thing("screen", plane(1.0, 1.0, (15, -0.5, 0), (-1, 0, 0)), "Wall", "steel")
    state = scene(tmp_path, wall(4.0, "steel"), screen).at(0.0)
    paths = point_targets([[30, -1, 0]], [[-10, 0.5, 0]], 1.0, RADAR, Pose(), state=state, **FEW)
    assert paths.num_paths == 1 and paths.depth.tolist() == [3]
    assert abs(lengths(paths)[0] / 2 - oracle.WALL_GHOST["apparent_range_type2_m"]) < 1e-9
    assert abs(paths.length_rate[0] / 2 - oracle.WALL_GHOST["v_type2_mps"]) < 1e-9


def test_rough_surface_reflects_its_coherent_part(tmp_path) -> None:
    smooth_wall = scene(tmp_path / "smooth", wall(3.0, "concrete")).at(0.0)
    rough_wall = scene(tmp_path / "rough", wall(3.0, "grey")).at(0.0)  # concrete of the table
    scattering, height = TABLE["concrete"].scattering_coefficient, TABLE["concrete"].roughness_rms
    ratio = ghosts(rough_wall, (15, 0), (0, 0)).a[:, 0, 0] / ghosts(smooth_wall, (15, 0), (0, 0)).a[:, 0, 0]
    assert scattering > 0.1 and height > 1e-4
    # Ament: the image stands 6 m to the side of the radar and 15 m on, so the sine of the grazing angle is 6 / hypot.
    phase = 2.0 * np.pi * RADAR.center_frequency / 299792458.0 * height * 6.0 / np.hypot(15.0, 6.0)
    kept = np.sqrt(1 - scattering**2) * np.exp(-2.0 * phase**2)
    assert np.allclose(ratio, kept ** np.array([0, 1, 1, 2]), rtol=1e-9)


def test_ego_double_bounce(tmp_path) -> None:
    distance, velocity, setback = 12.0, -4.0, 0.25
    front = Thing("ego_front", plane(8.0, 8.0, (-setback, 0, 0), (1, 0, 0)), "Car", "steel")
    target = Thing(
        "target",
        plane(8.0, 8.0, (0, 0, 0), (-1, 0, 0)),
        "Car",
        "steel",
        {"kind": "constant_twist", "position": [distance, 0, 0], "velocity": [velocity, 0, 0]},
    )
    state = scene(tmp_path, front, actors=[target]).at(0.0)
    paths = solve_paths(state, RADAR, Pose(), "sionna", max_depth=3, **FEW)
    bounce = paths.select([paths.instance.tolist().index([2, 1, 2])])
    expected_range, expected_velocity = oracle.ego_double_bounce(distance, velocity, setback)
    length = lengths(bounce)[0]
    assert abs(length / 2 - expected_range) < 1e-9  # bar 1 mm
    assert abs(bounce.length_rate[0] / 2 - expected_velocity) < 1e-9  # bar 1e-3 m/s
    # three reflections of metal at normal incidence, -1 but for 0.008 dB each
    q = np.sqrt(TABLE["metal"].at(RADAR.center_frequency))
    expected = ((1 - q) / (1 + q)) ** 3 * RADAR.wavelength / (4 * np.pi * length)
    assert abs(20 * np.log10(abs(expected) * 4 * np.pi * length / RADAR.wavelength)) < 0.05  # the bar, to a perfect one
    assert np.allclose(bounce.a[0], expected * np.eye(2), rtol=1e-12, atol=abs(expected) * 1e-12)


def test_ego_double_bounce_of_a_point(tmp_path) -> None:
    """The same off a point scatterer: it scatters twice, with the own front as a mirror between."""
    distance, velocity, setback, rcs = 12.0, -4.0, 0.25, 3.0
    front = Thing("ego_front", plane(8.0, 8.0, (-setback, 0, 0), (1, 0, 0)), "Car", "steel")
    state = scene(tmp_path, front).at(0.0)
    points = PointScatterers([[distance, 0, 0]], [[velocity, 0, 0]], rcs)
    options = {"max_depth": 1, **FEW}
    once = solve_points(state, RADAR, Pose(), points, **options)
    paths = solve_points(state, RADAR, Pose(), points, double_bounce=True, **options)
    assert paths.num_paths == 2 * once.num_paths == 8  # each way there and back, by the front or not
    bounce = paths.select([paths.interaction.tolist().index([0, 1, 0, -1, -1])])
    expected_range, expected_velocity = oracle.ego_double_bounce(distance, velocity, setback)
    assert abs(lengths(bounce)[0] / 2 - expected_range) < 1e-9  # bar 1 mm
    assert abs(bounce.length_rate[0] / 2 - expected_velocity) < 1e-9  # bar 1e-3 m/s
    # Radar equation of the first scattering, and spherical spreading from its field over the way to the front and back
    expected = np.sqrt(rcs / (4 * np.pi)) / (2 * (distance + setback))
    ratio = bounce.a[0] / once.a[0, 0, 0]
    assert abs(20 * np.log10(abs(ratio[0, 0]) / expected)) < 0.009  # bar 0.05 dB; metal reflects 0.008 dB less than all
    assert np.allclose(ratio, -abs(ratio[0, 0]) * np.eye(2), rtol=2e-3, atol=1e-12)  # turned by the mirror, for V and H


def test_bistatic_pair_over_ground(tmp_path) -> None:
    state = scene(tmp_path, ground("asphalt")).at(0.0)
    pose, rx_pose = Pose([0, 0, 0.5]), Pose.from_euler([30, 8, 1.25], yaw=np.pi)
    velocity, rx_velocity = np.array([3.0, 1.0, 0.0]), np.array([-7.0, 0.0, 0.5])
    paths = solve_paths(
        state, RADAR, Mount(pose, Twist(velocity)), "sionna", receiver=Mount(rx_pose, Twist(rx_velocity)), **FEW
    )
    assert paths.depth.tolist() == [0, 1]
    offset = np.stack([rx_pose.position, oracle.mirrored(rx_pose.position, (0, 0, 1), 0.0)]) - pose.position
    expected = np.linalg.norm(offset, axis=1)
    assert np.abs(lengths(paths) - expected).max() < 1e-12  # rounding of 30 m
    relative = np.stack([rx_velocity, rx_velocity * [1, 1, -1]]) - velocity
    assert np.abs(paths.length_rate - np.sum(offset * relative, axis=1) / expected).max() < 1e-12
    friis = RADAR.wavelength / (4 * np.pi * expected)
    grazing = np.arcsin(1.75 / expected[1])
    q = np.sqrt(3.18 - 0.1j - np.cos(grazing) ** 2)
    tm = ((3.18 - 0.1j) * np.sin(grazing) - q) / ((3.18 - 0.1j) * np.sin(grazing) + q)
    te = (np.sin(grazing) - q) / (np.sin(grazing) + q)
    # V (theta) goes on along itself; H (phi) looks the other way from the other end. 1e-6: the loss in the table's
    # digits.
    assert np.allclose(paths.a[0], friis[0] * np.diag([1.0, -1.0]), atol=friis[0] * 1e-12)
    assert np.allclose(paths.a[1], friis[1] * np.diag([tm, -te]), atol=friis[1] * 1e-5)


def test_a_turned_radar_swaps_polarisations(tmp_path) -> None:
    state = scene(tmp_path, wall(3.0, "concrete")).at(0.0)
    upright = point_targets([[15, 0, 0.0]], [[0, 0, 0]], 1.0, RADAR, Pose(), state=state, **FEW)
    turned = point_targets(
        [[15, 0, 0.0]], [[0, 0, 0]], 1.0, RADAR, Pose.from_euler([0, 0, 0], roll=np.pi / 2), state=state, **FEW
    )
    assert np.allclose(turned.a[:, 0, 0], upright.a[:, 1, 1], rtol=1e-12)
    assert np.allclose(turned.a[:, 1, 1], upright.a[:, 0, 0], rtol=1e-12)
    assert abs(upright.a[1, 0, 0] / upright.a[1, 1, 1]) > 1.5  # V and H do differ here


def test_rate_and_acceleration_are_the_derivatives_of_the_length(tmp_path) -> None:
    """Moving target, moving and turning mirrors, moving radar."""
    truck = Thing(
        "truck",
        plane(32.0, 128.0, (0, 0, 0), (0, -1, 0)),
        "Truck",
        "steel",
        {"kind": "constant_twist", "position": [20, 6, 0], "velocity": [3, -2, 0], "angular_velocity_z": 0.05},
    )
    world = scene(tmp_path, ground("steel"), actors=[truck])
    velocity, target, motion = np.array([9.0, 1.0, 0.0]), np.array([30.0, -1.0, 1.5]), np.array([-10.0, 0.5, 0.0])

    def solve(time: float):
        points = PointScatterers([target + motion * time], [motion], 1.0)
        return solve_points(
            world.at(1.0 + time),
            RADAR,
            Mount(Pose(np.array([0, 0, 0.5]) + velocity * time), Twist(velocity)),
            points,
            environment=True,
            max_depth=2,
            **FEW,
        )

    step = 1e-4
    before, now, after = solve(-step), solve(0.0), solve(step)
    assert np.array_equal(before.instance, after.instance) and now.num_paths > 16
    numeric = (lengths(after) - lengths(before)) / (2 * step)
    # rounding: 1e-14 m / 1e-4 s; third derivative: v^3 / R^2 * h^2 / 6 = 1e-9 m/s
    assert np.abs(now.length_rate - numeric).max() < 1e-7


def test_acceleration_of_ghosts_of_a_wall_at_rest(tmp_path) -> None:
    state = scene(tmp_path, wall(4.0, "steel")).at(0.0)
    step = 1e-3
    ahead, now, behind = (
        lengths(ghosts(state, (30 - 10 * time, -1 + 0.5 * time), (-10, 0.5))) for time in (step, 0.0, -step)
    )
    numeric = (ahead - 2 * now + behind) / step**2
    exact = ghosts(state, (30, -1), (-10, 0.5)).length_acceleration
    # rounding: 4 * 7e-15 m / 1e-6 s2 = 3e-8 m/s2; fourth derivative v^4 / R^3 * h^2 / 12: 3e-8
    assert np.abs(numeric - exact).max() < 1e-6 and exact.min() > 1e-3


def test_right_angled_corners_return_once(tmp_path) -> None:
    """Into a large corner and back: one path, turned about the edge (two faces) or mirrored in the apex (three)."""
    faces = [
        Thing("ground", plane(64.0, 64.0), "Roads", "steel"),
        Thing("front", plane(64.0, 64.0, (20, 0, 0), (-1, 0, 0)), "Wall", "steel"),
        Thing("side", plane(64.0, 64.0, (0, 8, 0), (0, -1, 0)), "Wall", "steel"),
    ]
    state = scene(tmp_path, *faces).at(0.0)
    start = np.array([0.1, 0.2, 0.5])
    corner = np.array([20.0, 8.0, 0.0]) - start
    paths = solve_paths(state, RADAR, Pose(start), "sionna", max_depth=3, **FEW)
    expected = {(1,): [2], (2,): [0], (3,): [1], (1, 2): [0, 2], (1, 3): [1, 2], (2, 3): [0, 1], (1, 2, 3): [0, 1, 2]}
    found = {
        tuple(sorted(row[row > 0].tolist())): length for row, length in zip(paths.instance, lengths(paths), strict=True)
    }
    assert paths.num_paths == len(expected) and found.keys() == expected.keys()
    for surfaces, axes in expected.items():
        assert abs(found[surfaces] - 2 * np.linalg.norm(corner[axes])) < 1e-12  # rounding of 40 m
    # Metal dihedral with its edge along H: the echo of V has the opposite sign to that of H. Head-on it would be exact;
    # at 1.4 deg grazing to the ground, V loses some dB by the metal's finite conductivity (pseudo-Brewster angle of
    # 89.8 deg).
    level = paths.a[[tuple(sorted(row[row > 0].tolist())) == (1, 2) for row in paths.instance]][0]
    assert np.isclose(level[0, 0] / level[1, 1], -1.0, atol=0.1)
