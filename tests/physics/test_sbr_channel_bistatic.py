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
