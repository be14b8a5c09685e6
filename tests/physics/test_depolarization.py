"""Matrices of rough patches: one law in three solvers, reciprocal, the same under any roll of the radar."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.semantics import semantic_id
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.radar.channel.raycast.class_rcs import class_crossed
from scarl_sionna.radar.link import received_amplitude
from scarl_sionna.scene.materials.depolarization import rough_matrix
from tests.scenes import Material, Thing, ball, plane, write_scene

HALF = np.sqrt(0.5)
FIELDS = {
    "V": np.array([1.0, 0.0]),
    "H": np.array([0.0, 1.0]),
    "+45": np.array([HALF, HALF]),
    "-45": np.array([HALF, -HALF]),
    "one sense": np.array([HALF, 1j * HALF]),
    "other sense": np.array([HALF, -1j * HALF]),
}


def powers(a: np.ndarray) -> dict[tuple[str, str], float]:
    """Return the sum over the paths of the powers of all pairs of polarisations."""
    return {
        (sent, heard): float(np.sum(np.abs(np.einsum("i,nij,j->n", FIELDS[heard], a, FIELDS[sent])) ** 2))
        for sent in FIELDS
        for heard in FIELDS
    }


def closed(sent: str, heard: str, share: float) -> float:
    """Return the mean power of a pair for a power of 1 in V and H together, `share` of it cross-polar.

    By the second moments of a medium without a direction: VV + HH, VV - HH and 2 VH are uncorrelated and have the
    powers 4 (v^2 - x^2), 4 x^2 and 4 x^2.
    """
    t, h = FIELDS[sent], FIELDS[heard]
    alike, across = 1.0 - share, share
    parts = h @ t, h @ np.diag([1.0, -1.0]) @ t, h @ np.array([[0.0, 1.0], [1.0, 0.0]]) @ t
    return float((alike - across) * abs(parts[0]) ** 2 + across * (abs(parts[1]) ** 2 + abs(parts[2]) ** 2))


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3, 0.5])
def test_moments_of_the_law_are_those_of_a_medium_without_a_direction(share: float) -> None:
    count = 100_000
    draw = np.random.default_rng(1).random(count)
    size, across = np.full(count, np.sqrt(1.0 - share)), np.full(count, np.sqrt(share))
    a = rough_matrix(size, size, across, draw)
    np.testing.assert_allclose(a, a.transpose(0, 2, 1))
    np.testing.assert_allclose(np.abs(a[:, 0, 0]), size, rtol=1e-12)
    np.testing.assert_allclose(np.abs(a[:, 1, 1]), size, rtol=1e-12)
    np.testing.assert_allclose(np.abs(a[:, 0, 1]), across, rtol=1e-12)
    entries = np.stack([a[:, 0, 0], a[:, 1, 1], np.sqrt(2.0) * a[:, 0, 1]])
    covariance = entries @ entries.conj().T / count
    together = 1.0 - 3.0 * share
    expected = [[1.0 - share, together, 0.0], [together, 1.0 - share, 0.0], [0.0, 0.0, 2.0 * share]]
    np.testing.assert_allclose(covariance, expected, atol=0.01)
    for roll in np.radians([20.0, 45.0, 77.0]):
        turn = np.array([[np.cos(roll), np.sin(roll)], [-np.sin(roll), np.cos(roll)]])
        rolled = turn @ a @ turn.T
        seen = np.stack([rolled[:, 0, 0], rolled[:, 1, 1], np.sqrt(2.0) * rolled[:, 0, 1]])
        np.testing.assert_allclose(seen @ seen.conj().T / count, expected, atol=0.01)
    for (sent, heard), power in powers(a).items():
        assert power / count == pytest.approx(closed(sent, heard, share), abs=0.01)


def test_more_than_half_crossed_keeps_its_powers() -> None:
    one = np.ones(2)
    a = rough_matrix(0.5 * one, 0.5 * one, 0.8 * one, np.array([0.2, 0.7]))
    np.testing.assert_allclose(np.abs(a), np.broadcast_to([[0.5, 0.8], [0.8, 0.5]], (2, 2, 2)))
    plain = rough_matrix(0.5 * one, 0.3 * one, 0.0 * one, np.array([0.2, 0.7]))
    np.testing.assert_allclose(plain, np.broadcast_to(np.diag([0.5, 0.3]), (2, 2, 2)))


SOLVERS = {
    "raycast": {"hits_per_cell": None},
    "sbr": {"settings": SbrSettings(floor_db=None, max_depth=1), "instances": ("ground",)},
    "sionna": {"diffuse": True, "specular": False, "max_depth": 1, "num_samples": 1_000_000},
}


@pytest.mark.parametrize("roll_deg", [0.0, 45.0])
@pytest.mark.parametrize("method", SOLVERS)
@pytest.mark.parametrize("material", ["asphalt", "grass"])
def test_all_pairs_of_polarisations_by_all_solvers(tmp_path: Path, material: str, method: str, roll_deg: float) -> None:
    """A patch of ground from 1 m up: the powers over its paths, to a radar that stands upright or is rolled."""
    ground = Thing("ground", plane(6, 6, (11, 0, 0)), "Roads", "here")
    state = ss.load_scene(write_scene(tmp_path, [ground], materials={"here": Material(radio=material)})).at(0.0)
    array = ss.AntennaArray(tx_positions=[(0, 0, 0)], rx_positions=[(0, 0, 0)], pattern=IsotropicPattern())
    radar = ss.RadarSpec(array=array, azimuth_fov_deg=170, elevation_fov_deg=120).with_(bandwidth=150e6)
    pose = ss.Pose.from_euler([0.0, 0.0, 1.0], roll=np.radians(roll_deg))
    paths = ss.solve_paths(state, radar, pose, method, **SOLVERS[method])
    a = paths.a
    if method == "sbr":  # what is scattered comes after all that is reflected
        smooth = {**SOLVERS[method], "settings": SOLVERS[method]["settings"].with_(diffuse=False)}
        a = a[ss.solve_paths(state, radar, pose, method, **smooth).num_paths :]
    assert len(a) > 400
    np.testing.assert_allclose(a[:, 0, 1], a[:, 1, 0], atol=1e-6 * np.abs(a).max())
    whole = np.sum(np.abs(a) ** 2) / 2.0
    share = state.world.materials[material].xpd_coefficient
    spread = np.sqrt(np.sum(np.sum(np.abs(a) ** 2, axis=(1, 2)) ** 2)) / (2.0 * whole)
    for (sent, heard), power in powers(a).items():
        assert power / whole == pytest.approx(closed(sent, heard, share), abs=5.0 * spread)
    # no phase is common to co- and cross-polar parts
    assert abs(np.sum(a[:, 0, 0] * a[:, 0, 1].conj())) / whole < 5.0 * spread


def test_what_goes_by_class_has_the_cross_polar_part_of_its_class(tmp_path: Path) -> None:
    """A steel ball called a pedestrian, which reflects V and H alike, heard by crossed antennas at any roll."""
    ball_of = [Thing("ball", ball(0.5, (10.0, 0.0, 1.0)), "Pedestrian", "steel")]
    state = ss.load_scene(write_scene(tmp_path, ball_of)).at(0.0)
    own = ss.AntennaArray(tx_positions=[(0, 0, 0)], rx_positions=[(0, 0, 0)], pattern=IsotropicPattern())
    one = ss.RadarSpec(array=own, azimuth_fov_deg=8.0, elevation_fov_deg=8.0)
    ratio = class_crossed()[semantic_id("Pedestrian")]
    assert 0.01 < ratio < 0.03
    plain = ss.solve_paths(state, one, ss.Pose([0.0, 0.0, 1.0]), "raycast", num_rays=20_000, hits_per_cell=None)
    assert not plain.a[:, 0, 1].any() and not plain.a[:, 1, 0].any()  # antennas of one polarisation do not hear it
    radar = one.with_(rx_elements=(ss.AntennaElement(polarization="H"),))
    for roll_deg in (0.0, 30.0, 45.0):
        pose = ss.Pose.from_euler([0.0, 0.0, 1.0], roll=np.radians(roll_deg))
        found = ss.solve_paths(state, radar, pose, "raycast", num_rays=20_000, hits_per_cell=None)
        a = found.a
        assert len(a) > 2_000 and np.array_equal(a, a.transpose(0, 2, 1))
        whole = np.sum(np.abs(a[:, 0, 0]) ** 2)
        assert whole == pytest.approx(np.sum(np.abs(plain.a[:, 0, 0]) ** 2), rel=0.02)  # the edge cuts other rays
        spread = 5.0 / np.sqrt(len(a))
        assert abs(np.sum(a[:, 0, 0] * a[:, 0, 1].conj())) / whole < spread * np.sqrt(ratio)
        for (sent, heard), power in powers(a).items():
            expected = (1.0 + ratio) * closed(sent, heard, ratio / (1.0 + ratio))
            assert power / whole == pytest.approx(expected, abs=spread * np.sqrt(ratio)), (sent, heard)
        heard = np.abs(received_amplitude(a, found.tx_point - pose.position, found.tx_point - pose.position, radar))
        gain = whole * ratio * 1e-3 * 10.0 ** (radar.front_end.tx_power_dbm / 10.0)
        assert np.sum(heard**2) == pytest.approx(gain, rel=1e-3)
