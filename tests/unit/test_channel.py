"""Choice of the channel solver, its options, errors and limits."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.errors import (
    MaterialRangeError,
    ParameterRangeError,
    PlacementError,
    ScarlWarning,
    UnknownNameError,
)
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.semantics import SEMANTIC_CLASSES, SKY, semantic_id
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.raycast import GridKind
from scarl_sionna.core.specs.radar.antennas.element import AntennaElement
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.channel.raycast.class_rcs import class_crossed, class_reflectivity, heard_share
from scarl_sionna.radar.channel.raycast.grid import RayGrid
from scarl_sionna.radar.sensor import Radar
from scarl_sionna.signal.antenna import is_crossed
from tests.scenes import Material, Thing, box, plane, write_scene

RADAR = RadarSpec().with_(num_chirps=8, num_samples=32)
NUM_RAYS = 5_000


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    things = (
        Thing("wall", plane(16.0, 8.0, (10, 0, 0), (-1, 0, 0)), "Wall", "grey"),
        Thing("road", plane(8.0, 8.0, (8, 0, -2), (0, 0, 1)), "Roads", "road"),
        Thing("hut", box((2, 2, 2), (-10, 0, 0)), "Building", "grey"),
    )
    path = write_scene(tmp_path_factory.mktemp("scene"), things, materials={"road": Material(radio="asphalt")})
    return load_scene(path).at(0.0)


def _bytes(paths) -> bytes:
    return b"".join(
        np.ascontiguousarray(value).tobytes() for value in vars(paths).values() if isinstance(value, np.ndarray)
    )


@pytest.mark.parametrize("method", ["raycats", "", "Raycast"])
def test_an_unknown_solver_is_named(state, method: str) -> None:
    with pytest.raises(UnknownNameError, match="channel solver"):
        solve_paths(state, RADAR, Pose(), method)


def test_two_runs_give_the_same_bytes(state) -> None:
    assert _bytes(solve_paths(state, RADAR, Pose(), "raycast", num_rays=NUM_RAYS)) == _bytes(
        solve_paths(state, RADAR, Pose(), "raycast", num_rays=NUM_RAYS)
    )


def test_shapes_types_and_order(state) -> None:
    paths = solve_paths(state, RADAR, Pose(), "raycast", num_rays=NUM_RAYS)
    count = paths.num_paths
    assert 0 < count <= NUM_RAYS
    assert paths.a.shape == (count, 2, 2) and paths.a.dtype == np.complex128
    assert paths.tx_point.shape == (count, 3) and paths.tx_point.dtype == np.float64
    for name in ("inner_length", "length_rate", "length_acceleration"):
        assert getattr(paths, name).shape == (count,) and getattr(paths, name).dtype == np.float64
    for name in ("instance", "interaction"):
        assert getattr(paths, name).shape == (count, 1) and getattr(paths, name).dtype == np.int32
    assert paths.depth.dtype == np.int32 and paths.semantic.dtype == np.uint8 and paths.rx_image is None
    grid = RayGrid.over(np.radians(RADAR.azimuth_fov_deg), np.radians(RADAR.elevation_fov_deg), NUM_RAYS)
    sine = paths.tx_point[:, 2] / np.linalg.norm(paths.tx_point, axis=1)
    row = np.floor((sine / (2 * np.sin(np.radians(RADAR.elevation_fov_deg) / 2)) + 0.5) * grid.num_elevation + 1e-9)
    assert (np.diff(row) >= 0).all()  # ray order: rows from the bottom


def test_nothing_in_view_gives_no_paths_and_a_silent_frame(state) -> None:
    behind = Pose.from_euler([0, 0, 50.0], pitch=-1.2)
    assert solve_paths(state, RADAR, behind, "raycast", num_rays=NUM_RAYS).num_paths == 0
    frame = Radar(RADAR, RadarSettings(noise=False, raycast={"num_rays": NUM_RAYS})).observe(
        state, behind, np.random.default_rng(0)
    )
    assert frame.num_paths == 0 and not frame.adc_int.any()


@pytest.mark.parametrize(("position", "what"), [((-10, 0, 0), "radar at"), ((-10.98, 0.0, 1.1), "tx antenna 1")])
def test_inside_a_mesh_is_refused(state, position: tuple[float, float, float], what: str) -> None:
    # The second radar stands 10 cm above the hut's roof and its second antenna hangs 20 cm below.
    radar = RADAR.with_(tx_positions=((0, 0, 0), (0, 0, -0.2)))
    with pytest.raises(PlacementError, match=f"{what}.* inside 'hut'.*move it outside"):
        solve_paths(state, radar, Pose(position), "raycast", num_rays=NUM_RAYS)


def test_an_object_between_the_rays_is_warned_of(tmp_path) -> None:
    pole = Thing("thin_pole", box((0.0625, 0.0625, 2.0), (40, 1, 0)), "Pole", "steel")
    state = load_scene(write_scene(tmp_path, [pole])).at(0.0)
    with pytest.warns(ScarlWarning, match=r"'thin_pole' \(0.06 m at 40 m.*num_rays >= "):
        coarse = solve_paths(state, RadarSpec(), Pose(), "raycast", num_rays=100)
    assert coarse.num_paths == 0  # missed, as the warning says
    assert solve_paths(state, RadarSpec(), Pose(), "raycast", num_rays=1_000_000).num_paths > 0


@pytest.mark.filterwarnings("error")
def test_no_warning_where_objects_are_large_or_out_of_view(state) -> None:
    solve_paths(state, RADAR, Pose(), "raycast", num_rays=NUM_RAYS)


def test_a_radar_outside_the_materials_range_is_refused(state) -> None:
    with pytest.raises(MaterialRangeError, match="'asphalt' has no data at 24.15 GHz"):
        solve_paths(
            state,
            RADAR.with_(start_frequency=24e9),
            Pose.from_euler([0, 0, 0], pitch=0.3),
            "raycast",
            num_rays=NUM_RAYS,
        )


@pytest.mark.parametrize(
    "options", [{"num_rays": 0}, {"num_rays": 2.5}, {"max_distance": 0.0}, {"max_distance": np.nan}]
)
def test_bad_numbers_are_refused(state, options: dict[str, float]) -> None:
    with pytest.raises(ParameterRangeError, match=next(iter(options))):
        solve_paths(state, RADAR, Pose(), "raycast", **{"num_rays": NUM_RAYS, **options})


@pytest.mark.parametrize("options", [{"rcs_model": "lambert"}, {"hit_phase": "smooth"}, {"grid": "random"}])
def test_unknown_options_are_refused(state, options: dict[str, str]) -> None:
    with pytest.raises(ParameterRangeError, match=next(iter(options))):
        solve_paths(state, RADAR, Pose(), "raycast", **{"num_rays": NUM_RAYS, **options})


def test_every_class_has_a_reflectivity() -> None:
    gamma = class_reflectivity()
    for index, name in enumerate(SEMANTIC_CLASSES):
        assert (gamma[index] > 0) == (index != SKY), name


def test_class_rcs_can_be_changed_by_mapping_and_file(tmp_path, state) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("[Wall]\ngamma = 1.2\nsource = 'mine'\n")
    base = solve_paths(state, RADAR, Pose(), "raycast", num_rays=NUM_RAYS)
    wall = base.semantic == semantic_id("Wall")
    for changes in ({"Wall": 1.2}, path):
        other = solve_paths(state, RADAR, Pose(), "raycast", class_rcs=changes, num_rays=NUM_RAYS)
        # Built-in 0.3: four times the RCS is twice the amplitude; elsewhere nothing changes.
        assert np.abs(other.a[wall]) == pytest.approx(2.0 * np.abs(base.a[wall]), rel=1e-12)
        assert np.array_equal(other.a[~wall], base.a[~wall])


@pytest.mark.parametrize("value", [-1.0, np.inf, np.nan, "much", True])
def test_bad_class_rcs_is_refused(value: object) -> None:
    with pytest.raises(ParameterRangeError, match="gamma of class 'Car'"):
        class_reflectivity({"Car": value})  # type: ignore[dict-item]


def test_unknown_class_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'Car'"):
        class_reflectivity({"Cart": 1.0})


def test_a_class_without_reflectivity_gives_no_paths(state) -> None:
    assert (
        solve_paths(state, RADAR, Pose(), "raycast", class_rcs={"Wall": 0.0, "Roads": 0.0}, num_rays=NUM_RAYS).num_paths
        == 0
    )


@pytest.mark.parametrize(
    ("fov_deg", "num_rays"), [((120, 30), 1_000_000), ((3, 90), 1000), ((180, 180), 777), ((60, 20), 1)]
)
def test_grid_covers_the_field_of_view_with_equal_cells(fov_deg: tuple[int, int], num_rays: int) -> None:
    azimuth_fov, elevation_fov = np.radians(fov_deg)
    grid = RayGrid.over(azimuth_fov, elevation_fov, num_rays)
    assert grid.num_rays <= num_rays and grid.num_rays > num_rays - grid.num_elevation
    # Solid angle of a field of view: azimuth times the difference of the sines of elevation.
    assert grid.solid_angle * grid.num_rays == pytest.approx(azimuth_fov * 2 * np.sin(elevation_fov / 2), rel=1e-14)
    rays = grid.directions(0, grid.num_rays)
    assert np.abs(np.linalg.norm(rays, axis=1) - 1.0).max() < 1e-15 * 4
    assert np.abs(np.arctan2(rays[:, 1], rays[:, 0])).max() <= azimuth_fov / 2 + 1e-12
    assert np.abs(rays[:, 2]).max() <= np.sin(elevation_fov / 2) + 1e-15
    if num_rays > 900:
        assert 0.8 < (azimuth_fov / grid.num_azimuth) / (2 * np.sin(elevation_fov / 2) / grid.num_elevation) < 1.25


@pytest.mark.parametrize(
    ("azimuth_fov", "elevation_fov", "num_rays", "message"),
    [
        (0.0, 0.5, 10, "azimuth_fov = 0.0 rad"),
        (4.0, 0.5, 10, "azimuth_fov = 4.0 rad"),
        (1.0, -0.5, 10, "elevation_fov = -0.5 rad"),
        (1.0, 0.5, 0, "num_rays = 0"),
        (1.0, 0.5, 2.5, "num_rays = 2.5"),
    ],
)
def test_a_grid_of_no_rays_or_no_field_of_view(azimuth_fov, elevation_fov, num_rays, message) -> None:
    with pytest.raises(ParameterRangeError, match=message):
        RayGrid.over(azimuth_fov, elevation_fov, num_rays)


@pytest.mark.parametrize("kind", ["staggered", "scattered", "regular"])
def test_each_cell_has_one_ray(kind: GridKind) -> None:
    grid = RayGrid.over(2.0, 0.5, 5_000, kind)
    rays = grid.directions(0, grid.num_rays)
    column = (np.arctan2(rays[:, 1], rays[:, 0]) / 2.0 + 0.5) * grid.num_azimuth
    row = (rays[:, 2] / (2 * np.sin(0.25)) + 0.5) * grid.num_elevation
    cells = np.floor(row + 1e-9) * grid.num_azimuth + np.floor(column + 1e-9)
    assert np.array_equal(cells, np.arange(grid.num_rays))
    centred = np.abs(row % 1.0 - 0.5) < 1e-9
    assert centred.all() if kind == "regular" else centred.mean() < 0.02
    beside = np.abs(column % 1.0 - 0.5) > 1e-9
    assert beside.mean() > 0.98 if kind == "scattered" else not beside.any()


def test_batches_of_rays_join_to_the_whole_grid() -> None:
    grid = RayGrid.over(1.0, 0.5, 1000)
    joined = np.concatenate([grid.directions(0, 333), grid.directions(333, 900), grid.directions(900, grid.num_rays)])
    assert np.array_equal(joined, grid.directions(0, grid.num_rays))


def test_batches_of_paths_join_to_the_whole(state, monkeypatch) -> None:
    whole = solve_paths(state, RADAR, Pose(), "raycast", num_rays=NUM_RAYS)
    monkeypatch.setattr("scarl_sionna.radar.channel.raycast.solve.RAYS_PER_BATCH", 700)
    assert _bytes(solve_paths(state, RADAR, Pose(), "raycast", num_rays=NUM_RAYS)) == _bytes(whole)


def test_phase_of_hits_is_random_when_rough_and_zero_when_geometric(state) -> None:
    rough = solve_paths(state, RADAR, Pose(), "raycast", hits_per_cell=None, num_rays=NUM_RAYS)
    geometric = solve_paths(state, RADAR, Pose(), "raycast", hit_phase="geometric", num_rays=NUM_RAYS)
    crossed = np.abs(geometric.a[:, 0, 1]) > 0.0  # of the road: their cross-polar part has a random phase in any case
    assert crossed.any() and not crossed.all()
    assert np.array_equal(geometric.a[~crossed].imag, np.zeros_like(geometric.a[~crossed].imag))
    assert (geometric.a[:, 0, 0].real >= 0).all() and (geometric.a[:, 1, 1].real >= 0).all()
    np.testing.assert_allclose(geometric.a[:, 0, 0].imag, -geometric.a[:, 1, 1].imag)
    # A unit phase factor: the magnitude is kept to rounding.
    assert np.abs(rough.a) == pytest.approx(np.abs(geometric.a), rel=1e-14)
    factor = rough.a[:, 0, 0] / geometric.a[:, 0, 0]
    # Mean of N uniform phase factors: standard deviation 1 / sqrt(N); 5 sigma.
    assert abs(factor.mean()) < 5 / np.sqrt(len(factor))


def test_same_seed_same_frame_and_noise_can_be_left_out(state) -> None:
    def observe(seed: int, noise: bool = True):
        return Radar(RADAR, RadarSettings.of("raycast", noise=noise, num_rays=NUM_RAYS)).observe(
            state, Pose(), np.random.default_rng(seed)
        )

    one, two, other, ideal = observe(1), observe(1), observe(2), observe(1, noise=False)
    assert one.adc_int.tobytes() == two.adc_int.tobytes() != other.adc_int.tobytes()
    assert ideal.adc_int.tobytes() == observe(5, noise=False).adc_int.tobytes() != one.adc_int.tobytes()
    assert one.adc_int.shape == (4, 24, 32, 2) and one.num_paths > 0 and one.num_saturated == 0
    assert set(one.diagnostics["seconds"]) == {"cast", "amplitude", "thin", "synthesize", "quantize", "label"}


def test_classes_have_a_cross_polar_ratio_that_a_file_can_change(tmp_path) -> None:
    ratio = class_crossed()
    for index, name in enumerate(SEMANTIC_CLASSES):
        assert (0.0 < ratio[index] < 0.5) == (index != SKY), name
    path = tmp_path / "mine.toml"
    path.write_text("[Car]\ngamma = 1.2\ncrossed = 0.2\n\n[Bus]\ngamma = 2.0\n")
    expected = np.where(np.arange(len(ratio)) == semantic_id("Car"), 0.2, ratio)
    assert np.array_equal(class_crossed(path), expected)
    assert np.array_equal(class_crossed({"Car": 1.2}), ratio)
    for bad in ("-0.1", "1.1", "true", "'much'"):
        path.write_text(f"[Car]\ngamma = 1.2\ncrossed = {bad}\n")
        with pytest.raises(ParameterRangeError, match="crossed of class 'Car'"):
            class_crossed(path)


def test_what_antennas_hear_of_a_class() -> None:
    """V and V all, V and H the ratio r, slanted at right angles as well; opposite circular ones 1 - r."""
    array, ratio = RADAR.array, class_crossed()
    one = np.ones_like(ratio)
    kinds = {("V", "V"): one, ("V", "H"): ratio, ("+45", "-45"): ratio, ("RHC", "LHC"): one - ratio}
    for (sent, heard), expected in {**kinds, ("+45", "V"): (one + ratio) / 2.0}.items():
        tx, rx = (AntennaElement(polarization=name) for name in (sent, heard))
        some = array.with_(tx_elements=(tx,), rx_elements=(rx,))
        assert heard_share(some) == pytest.approx(expected, abs=1e-9), (sent, heard)
        assert some.is_of_one_polarization == ((sent, heard) == ("V", "V"))
        assert is_crossed(some) == ((sent, heard) in (("V", "H"), ("+45", "-45")))
    leaking = array.with_(rx_elements=(AntennaElement(cross_polar_db=-20.0),))
    assert array.is_of_one_polarization and not leaking.is_of_one_polarization and not is_crossed(leaking)
