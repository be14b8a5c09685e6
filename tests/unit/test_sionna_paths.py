"""The solver `sionna`: options, shapes, empty results, labels, layers and diffuse scattering."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.errors import MaterialRangeError, ParameterRangeError, PlacementError, UnknownNameError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.semantics import semantic_id
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine import variant
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.point_scatterers import PointScatterers
from scarl_sionna.radar.points import point_targets, solve_points
from scarl_sionna.radar.sensor import Radar
from scarl_sionna.scene.materials.fresnel import transmission
from scarl_sionna.scene.materials.table import builtin_materials
from tests.oracles.fresnel import ITU_GLASS
from tests.scenes import Material, Thing, box, plane, write_scene

RADAR = RadarSpec().with_(pattern=IsotropicPattern(), num_chirps=8, num_samples=64, bandwidth=150e6)
FEW = {"num_samples": 20_000}
RNG = np.random.default_rng


@pytest.fixture(autouse=True, scope="module")
def radio_variant():
    """Stay in one variant: each switch takes longer than a solve."""
    with variant.radio():
        yield


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    looks = {"pane": Material(radio="glass"), "matt": Material(radio="concrete")}
    things = (
        Thing("wall", plane(16.0, 16.0, (10, 0, 0), (-1, 0, 0)), "Wall", "matt"),
        Thing("pane", plane(4.0, 4.0, (5, 6, 0), (-1, 0, 0)), "Building", "pane"),
        Thing("hut", box((2, 2, 2), (-20, -30, 0)), "Building", "steel"),
    )
    return load_scene(write_scene(tmp_path_factory.mktemp("scene"), things, materials=looks)).at(0.0)


def solve(state, **options):
    if "scatterers" in options:
        return solve_points(state, RADAR, Pose(), options.pop("scatterers"), environment=True, **{**FEW, **options})
    return solve_paths(state, RADAR, Pose(), "sionna", **{**FEW, **options})


def test_shapes_types_and_labels(state) -> None:
    points = PointScatterers([[8.0, 1.0, 0.5]], [[0.0, 0.0, 0.0]], 1.0, instance=[77])
    paths = solve(state, scatterers=points)
    count = paths.num_paths
    assert count == 1 + 4
    assert paths.a.shape == (count, 2, 2) and paths.a.dtype == np.complex128
    for name in ("inner_length", "length_rate", "length_acceleration"):
        assert getattr(paths, name).shape == (count,) and getattr(paths, name).dtype == np.float64
    for name, kind in (("instance", np.int32), ("interaction", np.int32), ("depth", np.int32), ("semantic", np.uint8)):
        assert getattr(paths, name).dtype == kind
    assert paths.instance.tolist() == [
        [1, -1, -1, -1, -1],
        [77, -1, -1, -1, -1],
        [77, 1, -1, -1, -1],
        [1, 77, -1, -1, -1],
        [1, 77, 1, -1, -1],
    ]
    assert paths.interaction[4].tolist() == [1, 0, 1, -1, -1] and paths.depth.tolist() == [1, 1, 2, 2, 3]
    assert np.isfinite(paths.rx_image[0]).all() and np.isnan(paths.rx_image[1:]).all()
    assert set(paths.diagnostics) >= {"method", "num_samples", "max_depth", "overflow", "num_candidates", "seconds"}


def test_points_of_an_instance_carry_its_class(state) -> None:
    points = PointScatterers([[8.0, 1.0, 0.5]] * 2, np.zeros((2, 3)), 1.0, instance=[1, 77])
    paths = solve_points(state, RADAR, Pose(), points, max_depth=0)
    assert paths.semantic.tolist() == [semantic_id("Wall"), 0]


def test_nothing_to_reflect_gives_no_paths_and_a_silent_frame(state) -> None:
    away = Pose([-40.0, 60.0, 30.0])
    for depth in (0, 2):
        paths = solve_paths(state, RADAR, away, "sionna", max_depth=depth, **FEW)
        assert paths.num_paths == 0 and paths.a.shape == (0, 2, 2) and paths.tx_point.shape == (0, 3)
    none = PointScatterers(np.zeros((0, 3)), np.zeros((0, 3)), 1.0)
    assert solve_points(state, RADAR, away, none, **FEW).num_paths == 0
    frame = Radar(RADAR, RadarSettings.of("sionna", noise=False, **FEW)).observe(state, away, RNG(0))
    assert frame.num_paths == 0 and not frame.adc_int.any()


def test_the_sensor_sees_the_wall_at_its_range(state) -> None:
    frame = Radar(RADAR, RadarSettings.of("sionna", noise=False, **FEW)).observe(state, Pose(), RNG(0))
    assert frame.num_paths == 1 and frame.diagnostics["method"] == "sionna"
    spectrum = np.abs(np.fft.fft(frame.adc[0, 0]))
    assert abs(spectrum.argmax() * RADAR.range_resolution - 10.0) <= RADAR.range_resolution / 2


def test_free_space_equals_the_ideal_points(state) -> None:
    points, motion, sigma = [[5.0, -4.0, 1.0], [7.0, 2.0, -1.0]], [[1.0, 2.0, 0.0], [-9.0, 0.0, 0.5]], [1.0, 25.0]
    pose, twist = Pose.from_euler([0.1, 0.2, 0.3], yaw=0.2, pitch=0.1, roll=0.4), Twist([3.0, 0.0, 0.0])
    ideal = point_targets(points, motion, sigma, RADAR, Mount(pose, twist))
    traced = point_targets(points, motion, sigma, RADAR, Mount(pose, twist), state=state, max_depth=0)
    for name in ("tx_point", "rx_point", "length_rate", "length_acceleration", "depth"):
        assert np.allclose(getattr(traced, name), getattr(ideal, name), rtol=1e-12, atol=1e-12), name
    assert ideal.instance.tolist() == [[1], [2]] and traced.instance.tolist() == [[4], [5]]  # the scene has 1 to 3
    assert np.allclose(traced.a, ideal.a, rtol=1e-12, atol=1e-12 * np.abs(ideal.a).max())


def test_far_paths_are_left_out(state) -> None:
    assert solve(state, max_distance=9.9).num_paths == 0
    assert solve(state, max_distance=10.1).num_paths == 1


def test_a_layer_lets_through_when_asked(state) -> None:
    target = [[10.0, 12.0, 0.0]]  # behind the pane, and behind the end of the wall
    blocked = point_targets(target, [[0, 0, 0]], 1.0, RADAR, Pose(), state=state, **FEW)
    assert blocked.num_paths == 0
    through = point_targets(target, [[0, 0, 0]], 1.0, RADAR, Pose(), state=state, refraction=True, **FEW)
    assert through.num_paths == 1 and through.interaction[0].tolist()[:3] == [4, 0, 4]
    free = point_targets(target, [[0, 0, 0]], 1.0, RADAR, Pose())
    assert np.allclose(through.tx_point, free.tx_point)  # straight
    te, tm = transmission(builtin_materials()["glass"], RADAR.center_frequency, 10.0 / np.hypot(10.0, 12.0))
    coherent = 1.0 - builtin_materials()["glass"].scattering_coefficient ** 2
    # Vertical pane and level ray: V is TE, H is TM; there and back.
    assert np.allclose(through.a[0] / free.a[0, 0, 0], np.diag([te**2, tm**2]) * coherent, rtol=1e-9, atol=1e-12)


def test_transmission_of_a_layer() -> None:
    glass = builtin_materials()["glass"]
    te, tm = transmission(glass, 77e9, np.cos(np.radians([0.0, 60.0])))
    # The formula in its other form: (1 - G^2) E / (1 - G^2 E^2), E over the layer, against the air that it replaces.
    for index, angle in enumerate((0.0, np.pi / 3)):
        q = np.sqrt(ITU_GLASS - np.sin(angle) ** 2)
        wave = 2 * np.pi * 77e9 / 299_792_458.0 * glass.thickness
        for found, weight in ((te, 1.0), (tm, ITU_GLASS)):
            gamma = (weight * np.cos(angle) - q) / (weight * np.cos(angle) + q)
            once = np.exp(-1j * wave * q)
            expected = (1 - gamma**2) * once / (1 - gamma**2 * once**2) * np.exp(1j * wave * np.cos(angle))
            assert abs(found[index] - expected) < 1e-9  # rounding; the table's permittivity has 13 digits
    thin = glass.with_(thickness=1e-9)
    assert np.allclose(transmission(thin, 77e9, 0.5), 1.0, atol=1e-4)  # no layer, no effect: k d = 2e-6 times eps
    assert not np.any(transmission(builtin_materials()["asphalt"], 77e9, 0.5))  # a half space lets nothing back


def test_diffuse_scattering_has_lambert_power(tmp_path) -> None:
    """Backscattered power of a large rough wall against the integral over its Lambertian pattern."""
    wall = Thing("wall", plane(16.0, 16.0, (4, 0, 0), (-1, 0, 0)), "Wall", "grey")
    state = load_scene(write_scene(tmp_path, [wall])).at(0.0)
    turned = Pose.from_euler([0, 0, 0], roll=0.3)
    paths = solve_paths(state, RADAR, turned, "sionna", diffuse=True, max_depth=1, num_samples=200_000)
    rough = paths.select(paths.interaction[:, 0] == 2)
    assert paths.num_paths == rough.num_paths + 1 and rough.num_paths > 5_000
    assert np.abs(rough.tx_point[:, 0] - 4.0).max() < 1e-12  # on the plane
    length = PathGeometry.of(rough, RADAR).center_length()
    assert np.allclose(length, 2 * np.linalg.norm(rough.tx_point, axis=1), rtol=1e-12)
    material = builtin_materials()["concrete"]
    grid = (np.arange(800) + 0.5) / 800 * 16.0 - 8.0
    y, z = np.meshgrid(grid, grid)
    distance = np.sqrt(16.0 + y**2 + z**2)
    cosine = 4.0 / distance
    index = np.sqrt(material.at(77e9))
    coherent = (1.0 - material.scattering_coefficient**2) * np.exp(
        -4.0 * (2.0 * np.pi * material.roughness_rms / RADAR.wavelength) ** 2
    )
    albedo = (1.0 - coherent) * np.abs((1.0 - index) / (1.0 + index)) ** 2
    pattern = cosine**2 / np.pi * albedo
    cell = (16.0 / 800) ** 2
    # Mean of both polarisations, all that is received: half of the sum of the squared transfer
    expected = np.sum(pattern / distance**4) * cell * (RADAR.wavelength / (4 * np.pi)) ** 2
    found = 0.5 * np.sum(np.abs(rough.a) ** 2)
    # Rays sample the sphere evenly and the kind of interaction at random. The weights cos / d^2 of the paths vary over
    # the wall, so the relative error is the root of their mean square over their mean, over the root of their number: 5
    # of it.
    weights = np.sum(np.abs(rough.a) ** 2, axis=(1, 2))
    error = np.sqrt(np.mean(weights**2)) / np.mean(weights) / np.sqrt(len(weights))
    assert abs(found / expected - 1.0) < 5 * error < 0.15, found / expected


def test_a_radar_inside_a_mesh_is_refused(state) -> None:
    with pytest.raises(PlacementError, match="radar at .* inside 'hut'"):
        solve_paths(state, RADAR, Pose([-20, -30, 0]), "sionna", **FEW)
    with pytest.raises(PlacementError, match="receiving radar at .* inside 'hut'"):
        solve(state, receiver=Pose([-20, -30, 0]))
    with pytest.raises(PlacementError, match="target 0 stands at the radar's origin"):
        solve(state, scatterers=PointScatterers([[0, 0, 0]], [[0, 0, 0]], 1.0))


def test_bad_options_are_refused(state) -> None:
    with pytest.raises(UnknownNameError, match="setting of method 'sionna' 'num_sample'.*did you mean 'num_samples'"):
        solve(state, num_sample=3)
    for name, value in (
        ("num_samples", 0),
        ("max_depth", -1),
        ("max_num_paths", 0),
        ("max_distance", 0.0),
        ("seed", -1),
        ("on_overflow", "ignore"),
        ("max_depth", 1.5),
    ):
        with pytest.raises(ParameterRangeError, match=name):
            solve(state, **{name: value})
    with pytest.raises(ParameterRangeError, match="max_depth.*give a state"):
        point_targets([[1, 0, 0]], [[0, 0, 0]], 1.0, RADAR, Pose(), max_depth=1)
    with pytest.raises(ParameterRangeError, match="instance"):
        PointScatterers([[1, 0, 0]], [[0, 0, 0]], 1.0, instance=[1, 2])


def test_a_radar_outside_the_materials_range_is_refused(tmp_path) -> None:
    road = Thing("road", plane(64.0, 64.0), "Roads", "road")
    state = load_scene(write_scene(tmp_path, [road], materials={"road": Material(radio="asphalt")})).at(0.0)
    with pytest.raises(MaterialRangeError, match="'asphalt' has no data at 24.07 GHz"):
        solve_paths(state, RADAR.with_(start_frequency=24e9), Pose([0, 0, 1]), "sionna", **FEW)
