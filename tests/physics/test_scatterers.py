"""Compiled scattering centres against physical optics of the same mesh, and TR 38.901 targets against the standard."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.radar.rcs import scattering_matrix
from scarl_sionna.radar.scatterers.compile import WEAKEST, compile_scatterers, range_profile
from scarl_sionna.radar.scatterers.model import ScattererModel
from scarl_sionna.radar.scatterers.table import direction_of
from scenes_xml import scene_path
from tests.scenes import Thing, write_scene

COARSE = SbrSettings(max_depth=3, ray_spacing=2.0, edge_spacing=1.0)
FREQUENCY = 77e9


def plate() -> trimesh.Trimesh:
    corners = [[0, -0.1, -0.1], [0, 0.1, -0.1], [0, 0.1, 0.1], [0, -0.1, 0.1]]
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def corner() -> trimesh.Trimesh:
    points = [[0, 0, 0], [0.05, 0, 0], [0, 0.05, 0], [0, 0, 0.05]]
    return trimesh.Trimesh(points, [[0, 1, 2], [0, 2, 3], [0, 3, 1]], process=False)


BODIES = {
    "plate": (plate(), (-4.0, 4.0), 0.0),
    "trihedral": (corner(), (43.0, 47.0), 35.264),
    "sphere": (trimesh.creation.icosphere(4, radius=0.1), (-2.0, 2.0), 0.0),
}


@pytest.mark.parametrize("name", BODIES)
def test_compiled_aspects_are_the_sum_of_all_footprints(name):
    mesh, ends, elevation = BODIES[name]
    model = compile_scatterers(
        mesh,
        FREQUENCY,
        azimuths_deg=ends,
        azimuth_step_deg=1.0,
        elevations_deg=[elevation],
        voxel=0.03,
        trace_step_deg=0.01,
        settings=COARSE,
        progress=False,
        num_checks=0,
    )
    theta = np.pi / 2.0 - model.elevation[0]
    got = model.scattering_matrix(theta, model.azimuth)
    wanted = scattering_matrix(mesh, FREQUENCY, theta, model.azimuth, settings=COARSE)
    # each centre left out is below sqrt(WEAKEST) of its aspect's incoherent sum; some ten of them may add in phase
    assert np.abs(got - wanted).max() < 10.0 * np.sqrt(WEAKEST) * np.abs(wanted).max()


def test_between_aspects_the_error_is_that_of_cubic_interpolation():
    model = compile_scatterers(
        plate(), FREQUENCY, azimuths_deg=(-4, 4), azimuth_step_deg=0.25, voxel=0.03, settings=COARSE, progress=False
    )
    phi = (model.azimuth[:-1] + model.azimuth[1:]) / 2.0
    got = model.scattering_matrix(np.pi / 2.0, phi)
    wanted = scattering_matrix(plate(), FREQUENCY, np.pi / 2.0, phi, settings=COARSE)
    # half a step turns the phase at a voxel's corner by k voxel sqrt(2) step / 2 = 0.15 rad, so every piece is short of
    # the arc by at most 1 - cos(0.15) = 0.011; the pieces together reach at most the flash
    assert np.abs(got - wanted).max() < 0.011 * np.abs(wanted).max()
    # in decibels the nulls beside the flash count as much as the flash, so the stated error is larger, but it is there
    assert model.error["num_aspects"] == 4
    assert 0.0 < model.error["median_db"] <= model.error["p95_db"]


def test_one_trace_serves_the_aspects_beside_it():
    mesh, ends, elevation = BODIES["trihedral"]
    model = compile_scatterers(
        mesh,
        FREQUENCY,
        azimuths_deg=ends,
        azimuth_step_deg=1.0,
        elevations_deg=[elevation],
        voxel=0.03,
        trace_step_deg=10.0,
        settings=COARSE,
        progress=False,
        num_checks=0,
    )
    theta = np.pi / 2.0 - model.elevation[0]
    got = model.scattering_matrix(theta, model.azimuth)[:, 0, 0]
    wanted = scattering_matrix(mesh, FREQUENCY, theta, model.azimuth, settings=COARSE)[:, 0, 0]
    # 2 deg from the traced aspect the edge of what is lit has moved by 0.035 of the size (5 cm), so 7 % of the lit
    # area: 0.6 dB
    assert np.abs(20.0 * np.log10(np.abs(got / wanted))).max() < 0.6
    # three bounces in a corner have the length of its apex; the phase of the apex is zero whatever the aspect
    assert np.abs(np.angle(got / wanted)).max() < 0.07


def test_corners_tell_how_near_their_mirrors_are_one_centre(tmp_path):
    """A dihedral of half width a acts at its edge, where its waves pass up to a beside it: their paths are longer by
    q = h^2 / R, h from 0 to a, which is a Fresnel integral over the aperture. The distance that its centres tell is
    where that costs 0.5 dB, with the standard deviation of h^2 of sqrt(4 / 45) a^2, and nearer they warn.
    """
    side, half = 0.2, 0.2 / np.sqrt(2.0)
    ends = np.array([[0.0, 0.0], [-half, half], [-half, -half]])
    points = np.concatenate([np.column_stack([ends, np.full(3, z)]) for z in (-side / 2.0, side / 2.0)])
    mesh = trimesh.Trimesh(points, [[0, 1, 4], [0, 4, 3], [0, 3, 5], [0, 5, 2]], process=False)
    model = compile_scatterers(
        mesh, FREQUENCY, azimuths_deg=(178, 182), elevations_deg=(-1, 0, 1), voxel=0.1, num_checks=0, progress=False
    )
    k = 2.0 * np.pi * FREQUENCY / 299792458.0
    needed = model.nearest(model.matrices(np.array([-1.0, 0.0, 0.0])))
    assert needed == pytest.approx(3.0 * k * np.sqrt(4.0 / 45.0) * half**2, rel=0.1)
    assert needed > 5.0 * model.nearest_distance
    h = half * (np.arange(4000) + 0.5) / 4000
    for distance, lost in ((needed, 0.5), (needed / 2.0, 2.0)):
        field = np.mean(np.exp(-1j * k * h**2 / distance))
        assert -20.0 * np.log10(np.abs(field)) == pytest.approx(lost, rel=0.25)
    state = ss.load_scene(write_scene(tmp_path, [Thing("target", mesh.copy(), "Static", "steel")])).at(0.0)
    radar = ss.RadarSpec()

    def solve(distance):
        ss.solve_paths(state, radar, ss.Pose([-distance, 0.0, 0.0]), method="scatterers", models={"target": model})

    with pytest.warns(ss.ScarlWarning, match=r"'target': .* nearer than the .* the corners .* 2\.. dB too strong"):
        solve(needed / 2.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error", ss.ScarlWarning)
        solve(1.1 * needed)


def test_single_reflections_have_no_aperture_beyond_their_voxel():
    model = compile_scatterers(plate(), FREQUENCY, azimuths_deg=(-2, 2), voxel=0.05, num_checks=0, progress=False)
    assert model.aperture_distance.max() == 0.0
    assert model.nearest(model.matrices(np.array([1.0, 0.0, 0.0]))) == model.nearest_distance


def test_near_field_of_a_plate_from_its_centres():
    """At 5 m the phase over 20 cm is far from plane (3 rad).

    The centres, each in its far field, give the exact integral.
    """
    model = compile_scatterers(
        plate(),
        FREQUENCY,
        azimuths_deg=(-3, 3),
        azimuth_step_deg=0.25,
        elevations_deg=np.arange(-3, 3.1, 0.25),
        voxel=0.02,
        trace_step_deg=0.5,
        progress=False,
        num_checks=0,
    )
    k = 2.0 * np.pi * FREQUENCY / 299792458.0
    radar = np.array([5.0, 0.02, 0.01])
    offset = radar - model.centers
    distance = np.linalg.norm(offset, axis=1)
    scattered = model.matrices(offset / distance[:, None])[:, 0, 0] * np.exp(-2j * k * distance) / distance**2
    step = 2e-4  # a twentieth of a wavelength, so the midpoint rule is exact to 1e-3 for the slopes of this plate
    grid = np.arange(-0.1 + step / 2, 0.1, step)
    y, z = np.meshgrid(grid, grid)
    way = np.sqrt(radar[0] ** 2 + (radar[1] - y) ** 2 + (radar[2] - z) ** 2)
    # PEC physical optics, VV: S = +-(j k / 2 pi) int cos(theta) exp(-2 j k R) / R^2
    exact = k / (2.0 * np.pi) * np.abs(np.sum(radar[0] / way**3 * np.exp(-2j * k * way)) * step**2)
    # 2 cm pieces bend by k 0.01^2 / 5 = 0.03 rad, interpolation by k voxel step = 0.14 rad, 0.3 % each: 0.1 dB
    assert 20.0 * np.log10(np.abs(scattered.sum()) / exact) == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize(
    ("target", "phi_deg", "theta_deg", "number", "sigma_db"),
    [
        # single point: G_max - min(12 ((theta - theta_c) / theta_3dB)^2 + 12 ((phi - phi_c) / phi_3dB)^2, sigma_max)
        ("vehicle-single-sp", 0.0, 90.0, 0, 15.52 - 12 * (18.25 / 29.13) ** 2),
        ("vehicle-single-sp", 90.0, 80.0, 0, 20.75 - 12 * (0.30 / 44.42) ** 2),
        ("vehicle-single-sp", 180.0, 80.0, 0, 14.56 - 12 * (0.35 / 36.73) ** 2),
        ("vehicle-single-sp", 200.0, 80.0, 0, 14.56 - 12 * (0.35 / 36.73) ** 2 - 12 * (20.0 / 36.32) ** 2),
        ("car", 90.0, 80.0, 0, 20.60 - 12 * (0.30 / 44.42) ** 2),
        ("car", 180.0, 80.0, 1, 13.90 - 12 * (0.35 / 36.73) ** 2),
        ("car", 0.0, 72.0, 3, 14.99 - 12 * (0.25 / 29.13) ** 2),
        ("pedestrian", 0.0, 90.0, 0, 2.14),
    ],
)
def test_tr38901_targets_follow_the_standards_formula(target, phi_deg, theta_deg, number, sigma_db):
    model = ScattererModel.tr38901(target)
    toward = direction_of(np.radians(phi_deg), np.radians(90.0 - theta_deg))
    matrix = model.matrices(toward)[number]
    # float32 of the engine's angles: 1e-5 relative of a slope below 2 dB per degree
    assert 10.0 * np.log10(4.0 * np.pi * abs(matrix[0, 0]) ** 2) == pytest.approx(sigma_db, abs=0.01)
    xpr = {"vehicle-single-sp": 21.12, "car": 21.12, "pedestrian": 19.81}[target]
    assert 20.0 * np.log10(abs(matrix[0, 0] / matrix[0, 1])) == pytest.approx(xpr, abs=1e-4)


@pytest.mark.slow
def test_the_highways_car_agrees_with_the_solver_sbr_and_is_faster(tmp_path):
    folder = scene_path("highway_guardrail").parent / "meshes"
    mesh = trimesh.util.concatenate(
        [trimesh.load(path, process=False) for path in sorted(folder.glob("car_ahead_*.ply"))]
    )
    car = Thing("car", mesh, "Car", "steel", trajectory={"kind": "static", "position": [0.0, 0.0, 0.0]})
    state = ss.load_scene(write_scene(tmp_path, actors=[car])).at(0.0)
    radar = ss.RadarSpec.preset("awr1843boost")
    model = compile_scatterers(
        mesh,
        radar.center_frequency,
        azimuths_deg=(177.5, 180.1),
        azimuth_step_deg=0.25,
        elevations_deg=np.arange(-1.25, 1.0, 0.25),
        voxel=0.15,
        trace_step_deg=2.0,
        settings=SbrSettings(max_depth=2, ray_spacing=32.0, edge_spacing=16.0),
        progress=False,
        num_checks=0,
    )
    errors = []
    for distance in (50.0, 80.0, 120.0, 200.0):
        pose = ss.Pose([-distance - 2.15, 0.9, 0.6], [1.0, 0.0, 0.0, 0.0])
        reach = distance + 20.0
        truth = ss.solve_paths(state, radar, pose, method="sbr", instances=["car"], max_distance=reach)
        fast = ss.solve_paths(state, radar, pose, method="scatterers", models={"car": model}, max_distance=reach)
        assert (
            truth.diagnostics["seconds"] > 10.0 * fast.diagnostics["seconds"]
        )  # measured: > 100, on a machine at rest
        profiles = []
        for paths in (truth, fast):
            length = np.linalg.norm(paths.tx_point - pose.position, axis=1) + paths.inner_length
            length += np.linalg.norm(paths.rx_point - pose.position, axis=1)
            frequency = radar.center_frequency + np.arange(-32, 32) * (radar.sampled_bandwidth / 64)
            turn = np.exp(-2j * np.pi * frequency[:, None] * (length - 2.0 * distance)[None] / 299792458.0)
            profiles.append(range_profile(turn @ paths.a[:, 0, 0]))
        strong = profiles[0] > 0.01 * profiles[0].max()
        errors.append(np.abs(10.0 * np.log10(profiles[1][strong] / profiles[0][strong])))
    assert np.median(np.concatenate(errors)) < 2.0  # the bar of the design: median within 2 dB a range cell


@pytest.mark.parametrize("along", [1.2, -1.2])
def test_a_spinning_body_bends_the_range_of_its_centres(tmp_path, along):
    """L(t) = 2 sqrt(D^2 + r^2 + 2 D r cos(w t)) of a centre at r on the line of sight.

    L' = 0, L'' = -2 D r w^2 / (D + r).
    """
    distance, spin = 15.0, 4.0
    motion = {
        "kind": "constant_twist",
        "position": [distance, 0.0, 0.0],
        "velocity": [0.0, 0.0, 0.0],
        "angular_velocity_z": spin,
    }
    body = Thing("turntable", trimesh.creation.box((3.0, 0.4, 0.4)), "Car", "steel", trajectory=motion)
    state = ss.load_scene(write_scene(tmp_path, actors=[body])).at(0.0)
    half_turn = np.array([0.0, np.pi])
    amplitude = np.broadcast_to(np.eye(2, dtype=np.complex64), (1, 2, 1, 2, 2))
    model = ScattererModel(np.array([[along, 0.0, 0.0]]), half_turn, np.zeros(1), amplitude, FREQUENCY, 0.1, 0.0, np.pi)
    paths = ss.solve_paths(state, ss.RadarSpec(), ss.Pose(), method="scatterers", models={"turntable": model})
    assert paths.length_rate == pytest.approx([0.0], abs=1e-12)
    # rounding of float64: the speed across, r w, and the acceleration to the centre, r w^2, are summed
    assert paths.length_acceleration == pytest.approx([-2 * distance * along * spin**2 / (distance + along)], rel=1e-12)


def test_waves_bend_over_the_voxels_of_a_curved_panel(tmp_path):
    """A part of a ball of 4 m makes its echo within 0.09 m at 14 m, less than a voxel of 0.15 m.

    Far away it is rho / 2, from a point it is weaker by the factor R / (R + rho), 2.2 dB: waves that are plane over a
    voxel do not have it.
    """
    radius, distance, steps = 4.0, 14.0, 16
    side = np.linspace(-0.4, 0.4, steps + 1)
    y, z = (grid.reshape(-1) for grid in np.meshgrid(side, 0.9 * side))
    points = np.column_stack([np.sqrt(radius**2 - y**2 - z**2) - radius, y, z])
    first = (np.arange(steps)[:, None] * (steps + 1) + np.arange(steps)).reshape(-1)
    a, b, c, d = first, first + 1, first + steps + 2, first + steps + 1
    mesh = trimesh.Trimesh(points, np.concatenate([np.c_[a, b, c], np.c_[a, c, d]]), process=False)
    state = ss.load_scene(write_scene(tmp_path, [Thing("panel", mesh.copy(), "Static", "steel")])).at(0.0)
    radar = ss.RadarSpec()
    model = compile_scatterers(
        mesh,
        radar.center_frequency,
        azimuths_deg=(-3.0, 3.0),
        elevations_deg=np.arange(-3.0, 3.1, 0.25),
        voxel=0.15,
        num_checks=0,
        progress=False,
    )
    assert model.nearest_distance < distance - 0.5
    exact = radar.wavelength / (4.0 * np.pi * distance**2) * radius / 2.0 / (1.0 + radius / distance)
    for place in ([distance, 0.02, 0.03], [distance, 0.12, 0.15]):
        pose, fields = ss.Pose(place, [0.0, 0.0, 0.0, 1.0]), []
        for options in ({"method": "sbr"}, {"method": "scatterers", "models": {"panel": model}}):
            paths = ss.solve_paths(state, radar, pose, **options)
            length = np.linalg.norm(paths.tx_point - pose.position, axis=1) + paths.inner_length
            length += np.linalg.norm(paths.rx_point - pose.position, axis=1)
            fields.append(np.sum(paths.a[:, 0, 0] * np.exp(-2j * np.pi * length / radar.wavelength)))
        assert np.abs(fields[0]) == pytest.approx(exact, rel=0.25)  # its ends
        # waves bend by k 0.075^2 / 14 = 0.65 rad at the sides of a voxel, so the third order, which is left out, is
        # 0.65^3 / 6 = 0.05 there along each of two axes and less inside. With waves that are plane over a voxel 0.6
        assert np.abs(fields[1] / fields[0] - 1.0) < 0.1


@pytest.mark.parametrize("elevation_deg", [0.0, 60.0, 80.0])
@pytest.mark.parametrize("aside", [(1.0, 0.0), (0.0, 1.0), (0.8, 0.6)])
def test_waves_bend_at_all_elevations(elevation_deg, aside):
    """A point 5 cm beside its centre, along azimuth and elevation, at 14 m: exactly known.

    The circles of azimuth are narrow high up, where the bend was cut off: 0.16 of the field at 60 deg, 0.27 at 80.
    """
    distance, azimuth_deg = 14.0, 0.03
    azimuth = np.radians(np.arange(-12.0, 12.01, 0.25))
    elevation = np.radians(elevation_deg + np.arange(-3.1, 3.1, 0.25))
    toward = direction_of(np.radians(azimuth_deg), np.radians(elevation_deg))
    along = direction_of(np.radians(azimuth_deg + 90.0), 0.0)
    point = 0.05 * (aside[0] * along + aside[1] * np.cross(toward, along))
    k = 2.0 * np.pi * FREQUENCY / 299792458.0
    seen = np.array([[direction_of(one, up) for one in azimuth] for up in elevation])
    table = np.exp(2j * k * (seen @ point))[:, :, None, None, None] * np.eye(2)
    model = ScattererModel(np.zeros((1, 3)), azimuth, elevation, table, FREQUENCY, 0.15, 0.0)
    exact = np.exp(-2j * k * (np.linalg.norm(distance * toward - point) - distance))
    # k r^2 / R = 0.29 rad: the third order, which is left out, is 0.29^3 / 6 = 0.004, of six nodes there is 0.001
    assert abs(model.matrices(toward, distance)[0, 0, 0] - exact) < 0.006
    # far away it bends by k r^2 / 1e9 m = 4e-9 rad
    assert abs(model.matrices(toward, 1e9) - model.matrices(toward)).max() < 1e-8
