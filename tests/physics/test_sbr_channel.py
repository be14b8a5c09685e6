"""Physical optics on a scene, seen from the radar with spherical waves, against exact integrals and closed forms."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.channel.sbr.last_bounce import MOST_DB, further_db
from scarl_sionna.radar.link import received_power
from scarl_sionna.scene.materials.fresnel import reflection
from tests.oracles import link
from tests.oracles import rcs as oracle
from tests.oracles.near_field_po import rectangle_transfer
from tests.scenes import Material, Thing, plane, write_scene

pytestmark = pytest.mark.own_process(shared=True)  # beside what a worker has, too much memory

RADAR = RadarSpec(elevation_fov_deg=120.0)
FREQUENCY = RADAR.center_frequency
WAVELENGTH = SPEED_OF_LIGHT / FREQUENCY
ALL = SbrSettings(floor_db=None)
METAL_LOSS_DB = 0.009  # of 1e7 S/m at 77 GHz and normal incidence: 2 * 20 log10(1 + sqrt(2 w eps0 / sigma)) / 2


def _state(folder, mesh, material="steel", **options):
    return load_scene(write_scene(folder, [Thing("target", mesh, "Static", material)], **options)).at(0.0)


def _signal(paths, frequency=FREQUENCY, receive=0, transmit=0):
    center = paths.world_from_tx.position
    length = sum(np.linalg.norm(point - center, axis=1) for point in (paths.tx_point, paths.rx_point))
    return np.sum(paths.a[:, receive, transmit] * np.exp(-2j * np.pi * frequency / SPEED_OF_LIGHT * length))


def _dbsm(signal, distance, wavelength=WAVELENGTH):
    return 10 * np.log10(np.abs(signal) ** 2 * (4 * np.pi) ** 3 * distance**4 / wavelength**2)


def _looking_back(direction, distance):
    x, y, z = direction / np.linalg.norm(direction)
    return Pose.from_euler(np.array([x, y, z]) * distance, yaw=np.pi + np.arctan2(y, x), pitch=np.arcsin(z))


@pytest.mark.parametrize("size", [0.1, 1.0])
def test_plate_in_the_near_field_is_the_exact_integral(tmp_path, size) -> None:
    state = _state(tmp_path, plane(size, size, normal=(1, 0, 0)))
    corner = np.array([0, -size / 2, -size / 2])
    for angle in np.radians([0.0, 0.5, 1.0, 2.0, 3.5, 5.0]):
        pose = _looking_back(np.array([np.cos(angle), np.sin(angle), 0.0]), 10.0)
        found = _signal(solve_paths(state, RADAR, pose, method="sbr", settings=ALL))
        sides, up, nodes = ([0, size, 0], [0, 0, size]), np.array([0, 0, 1.0]), int(100 + 300 * size)
        exact = rectangle_transfer(corner, *sides, pose.position, WAVELENGTH, up, nodes)
        # The bar of the project. A remainder of integration_phase = 0.01 rad, in quadrature over many parts, is 0.01
        # rad of the strongest ones: 0.09 dB where they cancel by 20 dB at random, below 0.1 dB here; metal loses 0.009
        # dB.
        assert abs(20 * np.log10(abs(found / exact))) < 0.1, angle
        assert abs(np.angle(found / exact)) < 0.05, angle


@pytest.mark.some(2)
@pytest.mark.parametrize(("distance", "dbsm"), [(2, -5.017), (5, -1.363), (10, 1.960), (20, 4.419), (50, 9.037)])
def test_pole_in_the_near_field(tmp_path, distance, dbsm) -> None:
    """k a R / (R + a) |integral along the pole|^2 (stationary phase around it); radius 5 cm, height 2 m, 77 GHz."""
    whole = trimesh.creation.cylinder(0.05, 2.0, sections=360)
    side = np.abs(whole.face_normals[:, 2]) < 0.5
    mesh = trimesh.Trimesh(whole.vertices, whole.faces[side], process=False)
    pose = Pose.from_euler([distance + 0.05, 0, 0], yaw=np.pi)
    paths = solve_paths(_state(tmp_path, mesh), RADAR, pose, method="sbr", settings=ALL)
    found = _dbsm(_signal(paths, 77e9), distance, RADAR.wavelength)
    # Physical optics ends at the silhouette, which adds a ripple of 1/sqrt(ka) = 0.11 times the obliquity there, 0 to
    # first order: some 0.05 dB; 1 deg facets leave 0.012 rad of phase.
    assert found == pytest.approx(dbsm, abs=0.1)


def _trihedral(leg):
    vertices, faces = oracle.TRIHEDRAL_MESH
    return trimesh.Trimesh(np.array(vertices) * leg, faces, process=False)


def test_trihedral_through_synthesis_and_range_doppler(tmp_path) -> None:
    radar = RADAR.with_(num_chirps=8, num_samples=1024)
    state = _state(tmp_path, _trihedral(0.1))
    pose = _looking_back(np.ones(3), 50.0)
    paths = solve_paths(state, radar, pose, method="sbr", settings=ALL)
    strongest = paths.depth == 3
    assert set(paths.interaction[strongest].ravel()) == {1, 2}
    spectrum = []
    for chosen in (
        paths,
        ss.point_targets(np.zeros((1, 3)), np.zeros((1, 3)), [oracle.trihedral(0.1, WAVELENGTH)], radar, pose),
    ):
        rd = ss.range_doppler(ss.virtual_cube(ss.synthesize(chosen, radar), radar), radar)
        power = (np.abs(rd.data) ** 2).mean(axis=0)
        spectrum.append(power.max())
        peak = rd.range[np.unravel_index(power.argmax(), power.shape)[1]]
        assert abs(peak - 50.0) <= RADAR.range_resolution
    # Closed form without the single bounces at the edges, -36 dB: up to 20 log10(1 + 0.016) = 0.14 dB; bar of the
    # project.
    assert 10 * np.log10(spectrum[0] / spectrum[1]) == pytest.approx(0.0, abs=0.3)
    # Far-field solver of the same theory; 50 m is 25 times the distance k leg^2 / 4 at which the corner is flat to 1
    # rad.
    far = ss.rcs(_trihedral(0.1), FREQUENCY, np.arccos(1 / 3**0.5), np.pi / 4)
    assert _dbsm(_signal(paths), 50.0) == pytest.approx(10 * np.log10(far), abs=0.05)


@pytest.mark.parametrize("roll_deg", [0.0, 22.5, 45.0])
def test_dihedral_turns_polarisation(tmp_path, roll_deg) -> None:
    vertices, faces = oracle.DIHEDRAL_MESH
    mesh = trimesh.Trimesh(np.array(vertices) * 0.1, faces, process=False)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 4, (0, 0, 1)))  # boresight to +x
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(roll_deg), (1, 0, 0)))
    paths = solve_paths(
        _state(tmp_path, mesh), RADAR, Pose.from_euler([100.0, 0, 0], yaw=np.pi), method="sbr", settings=ALL
    )
    level = oracle.dihedral(0.1, 0.1, WAVELENGTH) * WAVELENGTH**2 / ((4 * np.pi) ** 3 * 100.0**4)
    co, cross = (abs(_signal(paths, transmit=t)) ** 2 / level for t in (0, 1))
    # cos^2 and sin^2 of twice the roll. Single bounces at the edges and 0.009 dB a bounce: 0.1 dB; nulls below -40 dB.
    assert co == pytest.approx(np.cos(2 * np.radians(roll_deg)) ** 2, rel=0.023, abs=1e-4)
    assert cross == pytest.approx(np.sin(2 * np.radians(roll_deg)) ** 2, rel=0.023, abs=1e-4)


def test_glass_plate_reflects_by_fresnel_and_roughness_takes_the_incoherent_part(tmp_path) -> None:
    pose = Pose.from_euler([20.0, 0, 0], yaw=np.pi)
    levels = {}
    for name in ("metal", "glass", "asphalt"):
        materials = {"own": Material(radio=name)}
        state = _state(tmp_path / name, plane(0.2, 0.2, normal=(1, 0, 0)), "own", materials=materials)
        smooth = ALL.with_(diffuse=False)
        levels[name] = abs(_signal(solve_paths(state, RADAR, pose, method="sbr", settings=smooth)))
        material = state.world.materials[name]
        coherent = np.sqrt(1 - material.scattering_coefficient**2)
        coherent *= np.exp(-2 * (2 * np.pi * material.roughness_rms / WAVELENGTH) ** 2)  # Ament, along the normal
        expected = coherent * abs(reflection(material, FREQUENCY, 1.0)[0])
        # Incidence over the plate is within 0.3 deg of normal: the coefficients differ by less than 1e-4.
        assert levels[name] / levels["metal"] == pytest.approx(
            expected / abs(reflection(state.world.materials["metal"], FREQUENCY, 1.0)[0]), rel=2e-4
        )
    assert levels["asphalt"] < levels["glass"] < levels["metal"]


def test_rates_are_the_change_of_the_lengths(tmp_path) -> None:
    """A corner that moves and turns, and a radar that moves.

    The rate is that of the path over the same surface points.
    """
    vertices, faces = oracle.DIHEDRAL_MESH
    mesh = trimesh.Trimesh(np.array(vertices) * 0.5, faces, process=False)
    velocity, own = np.array([-8.0, 3.0, 1.0]), np.array([5.0, -1.0, 0.5])
    actor = Thing(
        "corner",
        mesh,
        "Static",
        "steel",
        {"kind": "constant_twist", "position": [0, 0, 0], "velocity": velocity, "angular_velocity_z": 0.4},
    )
    world = load_scene(write_scene(tmp_path, actors=[actor]))
    pose = _looking_back(np.array([1.0, 0.8, 0.1]), 12.0)
    paths = solve_paths(world.at(0.0), RADAR, Mount(pose, Twist(own)), method="sbr", settings=ALL)
    double = np.flatnonzero(paths.depth == 2)[::25]
    assert len(double) > 5
    step = 1e-6

    def length(path, time):
        """Length over the image of the radar in the first plane, to the second's material point."""
        there = world.at(time).actor_pose("corner")
        here = pose.position + own * time
        point = there.apply(paths.rx_point[path])
        # The patch is on one unit square, the mirror is the other: local y = 0 (normal y) or x = 0 (normal x).
        normal = np.array([0.0, 1.0, 0.0]) if abs(paths.rx_point[path][0]) < 1e-9 else np.array([1.0, 0.0, 0.0])
        local = there.inverse().apply(point)
        image = there.apply(local - 2 * (normal @ local) * normal)
        return np.linalg.norm(image - here) + np.linalg.norm(point - here)

    for path in double:
        change = (length(path, step) - length(path, -step)) / (2 * step)
        # Central difference: rounding 1e-15 * 24 m / 2e-6 s = 1e-8 m/s, third derivative below 1e-10 m/s.
        assert paths.length_rate[path] == pytest.approx(change, abs=1e-7)


def test_what_the_floor_drops_is_below_the_noise_even_in_phase(tmp_path) -> None:
    """Of each range bin the weakest patches go, as many as their fields in phase stay under the floor.

    One more would pass it.
    """
    radar = RADAR.with_(tx_power_dbm=-30.0)
    ball = trimesh.creation.icosphere(3, radius=0.4)
    state = _state(tmp_path, ball)
    pose = _looking_back(np.array([1.0, 0.0, 0.0]), 10.0)
    whole = solve_paths(state, radar, pose, method="sbr", settings=ALL)
    bins = np.floor(np.linalg.norm(whole.tx_point - pose.position, axis=1) / radar.range_resolution)
    amplitude = np.sqrt(received_power(whole, radar))
    noise = link.noise_power(radar.sample_rate, 10 ** (radar.front_end.noise_figure_db / 10))
    noise /= radar.num_samples * radar.num_chirps * radar.num_virtual
    for floor_db in (-10.0, 10.0):
        found = solve_paths(state, radar, pose, method="sbr", settings=SbrSettings(floor_db=floor_db))
        reported = found.diagnostics["floor"]
        kept = {row.tobytes() for row in found.tx_point}
        gone = np.array([row.tobytes() not in kept for row in whole.tx_point])
        assert gone.sum() == reported["num_dropped"] == whole.num_paths - found.num_paths
        assert 0 < gone.sum() < whole.num_paths
        assert reported["dropped_power"] == pytest.approx(np.sum(amplitude[gone] ** 2), rel=1e-9)
        limit = noise * 10 ** (floor_db / 10)
        for number in np.unique(bins):
            here = bins == number
            assert amplitude[here & gone].sum() ** 2 <= limit * (1 + 1e-9)
            if (here & ~gone).any():
                weakest = amplitude[here & ~gone].min()
                assert weakest >= amplitude[here & gone].max(initial=0.0)
                assert (amplitude[here & gone].sum() + weakest) ** 2 > limit * (1 - 1e-9)


def test_what_comes_after_the_last_bounce_is_told(tmp_path) -> None:
    """A corner is its third bounce: with two of them a look finds it, with three no wave goes on."""
    turn = trimesh.geometry.align_vectors(np.ones(3) / np.sqrt(3.0), [-1.0, 0.3, 0.2])[:3, :3]
    mesh = trimesh.Trimesh(0.1 * np.array(oracle.TRIHEDRAL_MESH[0]) @ turn.T, oracle.TRIHEDRAL_MESH[1], process=False)
    mesh.apply_translation([10.0, 0.0, 0.0])
    state = _state(tmp_path, mesh)
    with pytest.warns(ScarlWarning, match="waves go on after the 2 bounces.*'target'"):
        two = solve_paths(state, RADAR, Pose(), "sbr", max_depth=2)
    with warnings.catch_warnings():
        warnings.simplefilter("error", ScarlWarning)
        three = solve_paths(state, RADAR, Pose(), "sbr", max_depth=3)
        one = solve_paths(state, RADAR, Pose(), "sbr", max_depth=1)
    gain = 20.0 * np.log10(abs(_signal(three)) / abs(_signal(two)))
    assert two.diagnostics["further_db"][1] == pytest.approx(gain, abs=3.0)
    assert three.diagnostics["last_bounce_db"][1] == pytest.approx(0.0, abs=1.0)
    assert three.diagnostics["further_db"].get(1, -60.0) < -20.0
    assert not one.diagnostics["last_bounce_db"] and not one.diagnostics["further_db"]
    nothing = two.select(np.zeros(two.num_paths, dtype=bool))  # as where all rows are below the floor
    assert further_db(nothing, three, RADAR, 2) == {1: MOST_DB}
