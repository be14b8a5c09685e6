"""The solver sbr between two radars: against the far-field solver of the same theory, reciprocity, views and rates."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.errors import PlacementError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from tests.oracles import rcs as oracle
from tests.scenes import Thing, box, plane, write_scene

RADAR = RadarSpec(elevation_fov_deg=120.0)
FREQUENCY = RADAR.center_frequency
WAVELENGTH = SPEED_OF_LIGHT / FREQUENCY
ALL = SbrSettings(floor_db=None)


def _looking_back(theta, phi, distance):
    """Pose at a direction from the origin, looking at it, upright: its theta-hat and phi-hat there are the target's."""
    return Pose.from_euler(
        distance * np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]),
        yaw=np.pi + phi,
        pitch=np.pi / 2 - theta,
    )


def _signal(paths):
    tx, rx = paths.world_from_tx.position, paths.world_from_rx.position
    length = np.linalg.norm(paths.tx_point - tx, axis=1) + np.linalg.norm(paths.rx_point - rx, axis=1)
    return np.einsum("nij,n->ij", paths.a, np.exp(-2j * np.pi * FREQUENCY / SPEED_OF_LIGHT * length))


def _trihedral(leg):
    vertices, faces = oracle.TRIHEDRAL_MESH
    return trimesh.Trimesh(np.array(vertices) * leg, faces, process=False)


def _solve(folder, mesh, tx, rx, **options):
    state = load_scene(write_scene(folder, [Thing("target", mesh, "Static", "steel")])).at(0.0)
    return solve_paths(state, RADAR, tx, method="sbr", receiver=rx, settings=ALL, **options)


@pytest.mark.some(2)
@pytest.mark.parametrize("shape", ["plate", "trihedral"])
@pytest.mark.parametrize("receive_deg", [(50.0, 40.0), (60.0, 50.0), (54.7, 52.0)])
def test_far_pair_measures_the_bistatic_rcs(tmp_path, shape, receive_deg) -> None:
    mesh = _trihedral(0.06) if shape == "trihedral" else plane(0.04, 0.03, normal=(1, 1, 1))
    there, back = (np.arccos(1 / 3**0.5), np.pi / 4), tuple(np.radians(receive_deg))
    distance = (120.0, 90.0)
    tx, rx = (_looking_back(*angles, r) for angles, r in zip((there, back), distance, strict=True))
    found = _signal(_solve(tmp_path, mesh, tx, rx))
    scale = (4 * np.pi) ** 3 * distance[0] ** 2 * distance[1] ** 2 / WAVELENGTH**2
    for polarization in ("VV", "HH"):
        sigma = float(
            ss.rcs(mesh, FREQUENCY, *there, polarization=polarization, theta_s=back[0], phi_s=back[1], material="metal")
        )
        entry = "VH".index(polarization[0])
        # The far-field distance 2 D^2 / lambda is below 2 m: spherical waves turn the phase over the target by 0.02
        # rad, 0.1 dB where contributions cancel by 20 dB; both solvers integrate the same currents of the same metal.
        assert 10 * np.log10(abs(found[entry, entry]) ** 2 * scale / sigma) == pytest.approx(0.0, abs=0.1), polarization


@pytest.mark.parametrize("shape", ["mirror", "trihedral"])
def test_reciprocity(tmp_path, shape) -> None:
    """Transmitter and receiver change places: a plate that mirrors one to the other, and a corner within its lobe."""
    corner = np.arccos(1 / 3**0.5)
    mesh = _trihedral(0.1) if shape == "trihedral" else plane(0.3, 0.2, normal=(1, 0, 0))
    ends = ((corner, 0.785), (corner - 0.004, 0.789)) if shape == "trihedral" else ((1.4, -0.5), (1.7416, 0.5))
    tx, rx = (_looking_back(*angles, distance) for angles, distance in zip(ends, (60.0, 40.0), strict=True))
    there, back = _signal(_solve(tmp_path, mesh, tx, rx)), _signal(_solve(tmp_path, mesh, rx, tx))
    # Physical optics is reciprocal where the scattered direction is that of geometrical optics, and departs from it
    # with the angle between them: 0.004 rad here, and those under which the plate is seen from 40 m, 0.004 rad.
    assert np.abs(np.diag(there)) == pytest.approx(np.abs(np.diag(back)), rel=0.01)


def test_receiver_sees_what_is_in_its_view_and_not_hidden(tmp_path) -> None:
    plate = Thing("plate", plane(1.0, 1.0, (10, 0, 0), (-1, 0, 0)), "Static", "steel")
    screen = Thing("screen", plane(0.2, 3.0, (0, 0, 0), (0, 0, 1)), "Static", "steel")
    screen.mesh.vertices = screen.mesh.vertices[:, [0, 1, 2]] @ np.array([[0, 0, 1.0], [0, 1, 0], [1, 0, 0]]) + (
        5,
        2.0,
        0,
    )
    tx, rx = Pose([0, 0, 0]), Pose([0, 4.0, 0])
    free = load_scene(write_scene(tmp_path / "free", [plate])).at(0.0)
    hidden = load_scene(write_scene(tmp_path / "hidden", [plate, Thing("wall", box((0.1, 1.5, 3), (5, 2, 0)))])).at(0.0)
    options = {"method": "sbr", "settings": ALL, "instances": ["plate"]}
    assert solve_paths(free, RADAR, tx, receiver=rx, **options).num_paths > 0
    assert solve_paths(hidden, RADAR, tx, receiver=rx, **options).num_paths == 0
    assert solve_paths(hidden, RADAR, tx, **options).num_paths > 0
    away = Pose.from_euler([0, 4.0, 0], yaw=np.pi)
    behind = Pose.from_euler([20.0, 0, 0], yaw=np.pi)
    assert solve_paths(free, RADAR, tx, receiver=away, **options).num_paths == 0
    assert solve_paths(free, RADAR, tx, receiver=behind, **options).num_paths == 0
    with pytest.raises(PlacementError, match="wall"):
        solve_paths(hidden, RADAR, tx, receiver=Pose([5, 2, 0]), **options)


def test_rate_of_a_bistatic_path(tmp_path) -> None:
    """Both radars and the target move; the length over a point of the plate is known in closed form."""
    velocity = np.array([-7.0, 2.0, 0.5])
    actor = Thing(
        "plate",
        plane(0.5, 0.5, normal=(1, 0, 0)),
        "Static",
        "steel",
        {"kind": "constant_twist", "position": [0, 0, 0], "velocity": velocity},
    )
    state = load_scene(write_scene(tmp_path, actors=[actor])).at(0.0)
    tx, rx = Pose.from_euler([20, 1, 0], yaw=np.pi), Pose.from_euler([15, -3, 1], yaw=np.pi)
    own, other = np.array([4.0, 0, 1]), np.array([0, -5.0, 0])
    paths = solve_paths(
        state, RADAR, Mount(tx, Twist(own)), method="sbr", receiver=Mount(rx, Twist(other)), settings=ALL
    )
    out, home = paths.rx_point - tx.position, paths.rx_point - rx.position
    expected = out @ (velocity - own) / np.linalg.norm(out, axis=1)
    expected += home @ (velocity - other) / np.linalg.norm(home, axis=1)
    assert paths.num_paths > 10
    assert paths.length_rate == pytest.approx(expected, abs=1e-12)  # float64 of numbers near 10


def _pair(degrees: float):
    """Ends of a pair 60 and 40 m away, apart by an angle, seen from the side of a body at the origin."""
    ends = ((1.35, -0.03), (1.35, -0.03 + np.radians(degrees)))
    return tuple(_looking_back(*angles, distance) for angles, distance in zip(ends, (60.0, 40.0), strict=True))


@pytest.mark.parametrize("turn", [-0.2, 0.1, 0.5])
def test_a_pair_10_deg_apart_is_reciprocal_where_it_is_solved_from_either_end(tmp_path, turn: float) -> None:
    """A box in four polarisations, at and beside its flashes; one sense alone is decibels off."""
    mesh = box((0.2, 0.15, 0.1))
    mesh.apply_transform(trimesh.transformations.rotation_matrix(turn, (0, 0, 1)))
    state = load_scene(write_scene(tmp_path, [Thing("target", mesh, "Static", "steel")])).at(0.0)
    tx, rx = _pair(10.0)

    def field(first, second, reciprocal):
        knobs = ALL.with_(reciprocal=reciprocal)
        return _signal(solve_paths(state, RADAR, first, method="sbr", receiver=second, settings=knobs))

    there, back = field(tx, rx, True), field(rx, tx, True)
    largest = np.abs(there).max()
    assert np.abs(there - back.T).max() < 1e-9 * largest
    one, other = field(tx, rx, False), field(rx, tx, False)
    assert np.abs(there - (one + other.T) / 2.0).max() < 1e-9 * largest
    assert np.abs(one - other.T).max() > 1e-3 * largest  # it is there to be mended


def test_the_mean_of_both_senses_of_a_plate_has_the_mean_cosine(tmp_path) -> None:
    """H across the plane of incidence: physical optics has the cosine of incidence, from the other end that of leaving.

    M. I. Skolnik (ed.), Radar Handbook, 3rd ed., 2008, chapter 14: the current is 2 n x H of the incident wave.
    """
    state = load_scene(write_scene(tmp_path, [Thing("target", plane(0.05, 0.04, normal=(1, 0, 0)), "Static", "steel")]))
    tx, rx = (_looking_back(np.pi / 2.0, azimuth, 80.0) for azimuth in np.radians([20.0, 30.0]))
    found = {
        name: _signal(
            solve_paths(state.at(0.0), RADAR, tx, method="sbr", receiver=rx, settings=ALL.with_(reciprocal=name))
        )
        for name in (False, True)
    }
    cosine = np.cos(np.radians([20.0, 30.0]))
    ratio = np.abs(np.diag(found[True]) / np.diag(found[False]))
    either = [cosine.mean() / cosine[0], cosine.mean() / cosine[1]]  # V: E along z keeps to the one, H to the other
    assert sorted(ratio) == pytest.approx(sorted(either), rel=2e-3)


def test_radars_that_change_places_see_the_same_path_the_other_way_round(tmp_path) -> None:
    mesh = _trihedral(0.1)
    state = load_scene(write_scene(tmp_path, [Thing("target", mesh, "Static", "steel")])).at(0.0)
    tx, rx = (_looking_back(0.955, azimuth, 30.0) for azimuth in (0.75, 0.8))
    paths = solve_paths(state, RADAR, Mount(tx, Twist((1.0, 0, 0))), method="sbr", receiver=Mount(rx), settings=ALL)
    turned = paths.reversed()
    assert turned.world_from_tx is paths.world_from_rx and turned.tx_twist == paths.rx_twist
    assert turned.length == pytest.approx(paths.length, abs=1e-12)
    assert np.array_equal(turned.length_rate, paths.length_rate) and np.array_equal(turned.tx_point, paths.rx_point)
    assert np.array_equal(turned.reversed().a, paths.a) and np.array_equal(turned.reversed().instance, paths.instance)
