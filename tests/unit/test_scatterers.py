"""Scatterer models: table, file, errors and warnings."""

from __future__ import annotations

import hashlib
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError, SceneError, UnknownNameError
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.scatterers.compile import compile_scatterers
from scarl_sionna.radar.scatterers.model import ScattererModel
from scarl_sionna.radar.scatterers.table import direction_of
from scarl_sionna.radar.scatterers.tr38901 import tr38901_fields
from tests.scenes import Thing, write_scene

REPO = Path(__file__).resolve().parents[2]
RADAR = ss.RadarSpec.preset("awr1843boost")


def plate(size: float = 0.2) -> trimesh.Trimesh:
    half = size / 2.0
    corners = [[0, -half, -half], [0, half, -half], [0, half, half], [0, -half, half]]
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def one_point(**changes: object) -> ScattererModel:
    azimuth = np.radians(np.arange(-180.0, 180.0, 10.0))
    values: dict[str, object] = {
        "centers": np.array([[0.5, 0.2, 0.1]]),
        "azimuth": azimuth,
        "elevation": np.radians([-20.0, 20.0]),
        "amplitude": np.broadcast_to(np.eye(2, dtype=np.complex64), (2, len(azimuth), 1, 2, 2)),
        "frequency": RADAR.center_frequency,
        "cell": 0.1,
        "nearest_distance": 5.0,
    }
    return ScattererModel(**{**values, **changes})  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def compiled() -> ScattererModel:
    return compile_scatterers(plate(), azimuths_deg=(-5, 5), azimuth_step_deg=0.5, voxel=0.05, progress=False)


def test_save_and_load_keep_every_value(compiled, tmp_path):
    compiled = replace(compiled, aperture_distance=np.linspace(0.0, 30.0, compiled.num_centers))
    compiled.save(tmp_path / "plate.npz")
    back = ScattererModel.load(tmp_path / "plate.npz")
    for name in ("centers", "azimuth", "elevation", "aperture_distance"):
        np.testing.assert_array_equal(getattr(back, name), getattr(compiled, name))
    assert back.amplitude.tobytes() == compiled.amplitude.tobytes()
    assert back.frequency == compiled.frequency
    assert back.cell == compiled.cell
    assert back.nearest_distance == compiled.nearest_distance
    assert back.elevation_reach == compiled.elevation_reach
    assert back.error == compiled.error
    assert back.provenance == compiled.provenance


def test_compiling_twice_gives_the_same_bytes(compiled):
    again = compile_scatterers(plate(), azimuths_deg=(-5, 5), azimuth_step_deg=0.5, voxel=0.05, progress=False)
    assert again.amplitude.tobytes() == compiled.amplitude.tobytes()
    assert again.centers.tobytes() == compiled.centers.tobytes()


def digest_of_a_model_and_its_paths(folder: str) -> str:
    """Return the hash of a compiled model of two materials and of the paths of a scene with it."""
    parts = [(plate(), "metal"), (plate(0.1).apply_translation([0.1, 0.0, 0.0]), "plastic")]
    options = {"azimuths_deg": (170, 190), "azimuth_step_deg": 0.5, "elevations_deg": (-1.0, 0.0, 1.0), "voxel": 0.05}
    model = compile_scatterers(parts, progress=False, **options)
    target = Thing("target", plate(), "Car", trajectory={"kind": "static", "position": [20.0, 0.0, 0.0]})
    world = ss.load_scene(write_scene(Path(folder), actors=[target]))
    paths = solve(world, {"target": model})
    assert paths.num_paths > 0
    arrays = [model.centers.tobytes(), model.amplitude.tobytes(), repr(sorted(model.error.items())).encode()]
    arrays += [getattr(paths, name).tobytes() for name in ("a", "tx_point", "length_rate", "instance")]
    return hashlib.sha256(b"".join(arrays)).hexdigest()


@pytest.mark.slow  # tests/stability/test_methods.py has the same of paths
def test_same_bytes_in_another_process(tmp_path):
    code = (
        f"import tests.unit.test_scatterers as t; print(t.digest_of_a_model_and_its_paths({str(tmp_path / 'other')!r}))"
    )
    (tmp_path / "other").mkdir()
    (tmp_path / "here").mkdir()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=REPO, check=True)
    assert done.stdout.split()[-1] == digest_of_a_model_and_its_paths(str(tmp_path / "here"))


def test_the_table_takes_memory_only_where_a_centre_is_strong():
    """A box of metal seen from all sides.

    Each side's centres are held in the quarter from which they are lit, and nothing is lost.
    """
    box = trimesh.creation.box((0.3, 0.3, 0.3))
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", ss.ScarlWarning
        )  # 2 deg is too wide to interpolate; here only the nodes are compared
        model = compile_scatterers(
            box, azimuth_step_deg=2.0, voxel=0.1, trace_step_deg=2.0, progress=False, num_checks=0
        )
    whole = model.amplitude.to_dense()
    assert whole.shape == model.amplitude.shape
    assert model.amplitude.share < 0.7
    assert model.amplitude.nbytes < 0.75 * whole.nbytes
    phi = model.azimuth[10]
    got = model.scattering_matrix(np.pi / 2.0, phi)
    direct = np.einsum(
        "n,nij->ij", np.exp(2j * 2 * np.pi * 77e9 / 299792458.0 * model.centers @ direction_of(phi, 0.0)), whole[0, 10]
    )
    assert np.abs(got - direct).max() < 1e-5 * np.abs(whole[0, 10]).sum()  # single precision of the table


def test_a_file_of_the_first_version_still_loads(tmp_path):
    model = one_point(elevation=np.zeros(1), amplitude=np.ones((1, 36, 1, 2, 2), np.complex64))
    numbers = np.array([model.frequency, model.cell, model.nearest_distance, model.elevation_reach])
    np.savez(
        tmp_path / "old.npz",
        version=1,
        centers=model.centers,
        azimuth=model.azimuth,
        elevation=model.elevation,
        amplitude=model.amplitude.to_dense(),
        numbers=numbers,
        error="{}",
        provenance="{}",
    )
    back = ScattererModel.load(tmp_path / "old.npz")
    assert back.amplitude.tobytes() == model.amplitude.tobytes()


def test_a_mesh_in_millimetres_is_told():
    with pytest.warns(ss.ScarlWarning, match="millimetres"):
        compile_scatterers(plate(400.0), 1e6 * 300, azimuths_deg=(0, 0), voxel=200.0, progress=False, num_checks=0)


def test_a_file_that_is_no_model_is_refused(tmp_path):
    (tmp_path / "x.npz").write_bytes(b"nothing")
    with pytest.raises(SceneError, match="no scatterer model"):
        ScattererModel.load(tmp_path / "x.npz")


def test_a_target_of_the_standard_has_its_lobes_unless_asked_for_the_plain_one():
    fields, model = tr38901_fields("human", 77e9), ScattererModel.tr38901("human")
    lobes, plain = tr38901_fields("human", 77e9, 2), tr38901_fields("human", 77e9, 1)
    assert fields["provenance"] == lobes["provenance"] == model.provenance
    for direction in ((np.pi / 2, 0.0), (np.pi / 2, 1.5), (1.0, -2.5)):
        shown = [ScattererModel(**some).scattering_matrix(*direction) for some in (fields, lobes, plain)]
        assert np.array_equal(shown[0], shown[1]) and np.array_equal(shown[0], model.scattering_matrix(*direction))
        # TR 38.901 table 7.9.2.1-1: -1.37 dBsm from all sides
        assert 4.0 * np.pi * abs(shown[2][0, 0]) ** 2 == pytest.approx(10.0**-0.137, rel=1e-3)
    side = [abs(ScattererModel(**lobes).scattering_matrix(np.pi / 2, phi)[0, 0]) for phi in (0.0, np.pi / 2)]
    assert side[0] > 1.2 * side[1]  # chest and back are wider than the shoulders


def test_interpolation_is_a_polynomial_and_wraps_around():
    """Half-way between even steps the polynomial through six values weights them by 3, -25, 150, ... of 256."""
    azimuth = np.radians(np.arange(-180.0, 180.0, 90.0))
    values = np.zeros((1, 4, 1, 2, 2), np.complex64)
    values[0, :, 0, 0, 0] = [4.0, 1.0, 2.0, 3.0]
    model = one_point(azimuth=azimuth, elevation=np.zeros(1), amplitude=values)
    for angle, wanted in ((-180.0, 4.0), (-135.0, 2.5), (45.0, 2.5), (135.0, 3.84375), (180.0, 4.0)):
        got = model.matrices(direction_of(np.radians(angle), 0.0))[0, 0, 0]
        assert got == pytest.approx(wanted, abs=1e-6)  # complex64 holds the table


def test_an_aspect_outside_of_the_table_is_refused_in_the_far_field(compiled):
    with pytest.raises(ParameterRangeError, match="azimuth -5 to 5 deg"):
        compiled.scattering_matrix(np.pi / 2, np.radians(6.0))


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"frequency": 0.0}, "frequency"),
        ({"voxel": 0.0}, "voxel"),
        ({"azimuth_step_deg": -1.0}, "azimuth_step_deg"),
        ({"trace_step_deg": 0.0}, "trace_step_deg"),
        ({"elevations_deg": [89.0]}, "elevations_deg"),
        ({"elevations_deg": [2.0, 1.0]}, "elevations_deg"),
        ({"azimuths_deg": (5.0, -5.0)}, "azimuths_deg"),
    ],
)
def test_bad_numbers_are_refused(options, text):
    with pytest.raises(ParameterRangeError, match=text):
        compile_scatterers(plate(), progress=False, **options)


def test_a_step_too_wide_for_the_voxel_is_told():
    with pytest.warns(ss.ScarlWarning, match=r"azimuth step of 5 deg .* only mean powers are right"):
        compile_scatterers(
            plate(), azimuths_deg=(-5, 5), azimuth_step_deg=5.0, voxel=0.25, progress=False, num_checks=0
        )


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    box = trimesh.creation.box((0.4, 0.4, 0.4))
    wall = trimesh.creation.box((0.1, 4.0, 4.0))
    wall.apply_translation((60.0, 0.0, 0.0))
    moving = {
        "kind": "constant_twist",
        "position": [20.0, 0.0, 0.0],
        "velocity": [3.0, 1.0, 0.0],
        "angular_velocity_z": 0.5,
    }
    behind = {"kind": "static", "position": [80.0, 0.0, 0.0]}
    actors = [Thing("target", box, "Car", trajectory=moving), Thing("behind", box, "Car", trajectory=behind)]
    path = write_scene(tmp_path_factory.mktemp("scatterers"), [Thing("wall", wall, "Wall")], actors=actors)
    return ss.load_scene(path)


def solve(world, models, **options):
    return solve_paths(world.at(0.0), RADAR, ss.Pose(), method="scatterers", models=models, **options)


def test_paths_stand_where_the_body_is_and_move_with_it(world):
    paths = solve(world, {"target": one_point()})
    point = np.array([20.5, 0.2, 0.1])
    np.testing.assert_allclose(paths.tx_point[0], point, atol=1e-12)  # rounding of float64 at 20 m
    velocity = np.array([3.0, 1.0, 0.0]) + np.cross([0.0, 0.0, 0.5], [0.5, 0.2, 0.1])
    distance = np.linalg.norm(point)
    assert paths.length_rate[0] == pytest.approx(2.0 * velocity @ point / distance, abs=1e-12)
    power = RADAR.wavelength**2 * 4.0 * np.pi / ((4.0 * np.pi) ** 3 * distance**4)  # radar equation, S = 1 m: 4 pi m2
    assert abs(paths.a[0, 0, 0]) ** 2 == pytest.approx(power, rel=1e-6)  # complex64 table
    assert paths.instance[0, 0] == next(n for n, i in world.instances.items() if i.name == "target")


def test_an_object_behind_a_wall_gives_no_path_and_its_own_body_hides_nothing(world):
    inside = one_point(centers=np.array([[0.0, 0.0, 0.0]]))  # within its own mesh
    paths = solve(world, {"target": inside, "behind": inside}, max_distance=100.0)
    assert paths.num_paths == 1
    assert paths.diagnostics["num_hidden"] == 1


def test_leaving_the_models_range_is_told(world):
    low = one_point(elevation=np.radians([10.0, 20.0]))
    with pytest.warns(ss.ScarlWarning, match=r"'target'.*outside of the model's aspects.*method='sbr'"):
        solve(world, {"target": low})
    with pytest.warns(ss.ScarlWarning, match=r"'target'.*nearer than the 50 m.*method='sbr'"):
        solve(world, {"target": one_point(nearest_distance=50.0)})
    with pytest.warns(ss.ScarlWarning, match=r"'target'.*24 GHz"):
        solve(world, {"target": one_point(frequency=24e9)})
    with warnings.catch_warnings():
        warnings.simplefilter("error", ss.ScarlWarning)
        solve(world, {"target": one_point()})


def test_wrong_models_are_refused(world):
    with pytest.raises(ParameterRangeError, match="compile_scatterers"):
        solve(world, None)
    with pytest.raises(UnknownNameError, match="tarqet"):
        solve(world, {"tarqet": one_point()})


def test_same_bytes_twice(world):
    first, second = (solve(world, {"target": one_point(), "behind": one_point()}) for _ in range(2))
    assert first.a.tobytes() == second.a.tobytes()
    assert first.tx_point.tobytes() == second.tx_point.tobytes()


def test_the_peak_of_the_range_doppler_map_is_where_the_scene_says(world):
    paths = solve(world, {"target": one_point()})
    rd = ss.range_doppler(ss.virtual_cube(ss.synthesize(paths, RADAR), RADAR), RADAR)
    power = np.sum(np.abs(rd.data) ** 2, axis=0)
    row, column = np.unravel_index(power.argmax(), power.shape)
    # the peak of one target is at the bin nearest to it; range and velocity couple by much less than a bin here
    assert abs(rd.range[column] - np.linalg.norm([20.5, 0.2, 0.1])) <= np.diff(rd.range)[0]
    span = np.ptp(rd.radial_velocity) + np.diff(rd.radial_velocity)[0]
    apart = (rd.radial_velocity[row] - paths.length_rate[0] / 2.0 + span / 2.0) % span - span / 2.0
    assert abs(apart) <= np.diff(rd.radial_velocity)[0]
