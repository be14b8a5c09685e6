"""Antennas described one by one, through the solvers, another radar's paths, and weather, to raw data."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.pattern import DipolePattern
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.weather.clutter import volume_clutter
from scarl_sionna.signal.antenna import element_field
from tests.oracles import antennas as oracle
from tests.scenes import Thing, box, plane, write_scene

PLAIN = ss.RadarSpec().with_(num_chirps=4, num_samples=64, bandwidth=150e6)
PATTERN = DipolePattern()


def element(turn, polarization, **fields):
    azimuth, elevation, roll = turn
    return ss.AntennaElement(
        pattern=PATTERN,
        polarization=polarization,
        boresight_azimuth_deg=azimuth,
        boresight_elevation_deg=elevation,
        roll_deg=roll,
        **fields,
    )


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    things = (
        Thing("wall", plane(16.0, 8.0, (12, 0, 1), (-1, 0.2, 0)), "Wall", "grey"),
        Thing("road", plane(8.0, 8.0, (8, 0, -2), (0, 0, 1)), "Roads", "grey"),
        Thing("hut", box((1, 1, 1), (7, 2, 0)), "Car", "steel"),
    )
    return ss.load_scene(write_scene(tmp_path_factory.mktemp("scene"), things)).at(0.0)


@pytest.mark.parametrize(
    "method", ["raycast", *(pytest.param(slow, marks=pytest.mark.slow) for slow in ("sbr", "sionna", "auto"))]
)
def test_each_solvers_paths_reach_the_raw_data_through_each_antenna(state, method):
    """E_rx . S E_tx by Cartesian vectors for every path; and an H antenna is a V one, rolled by a quarter turn."""
    own = [element((k * 25.0, 10.0 * k, 40.0 * k), "VH"[k % 2]) for k in range(7)]
    radar = PLAIN.with_(tx_elements=own[:3], rx_elements=own[3:])
    options = {"num_rays": 2000} if method == "raycast" else {}
    paths = ss.solve_paths(state, radar, Pose(), method, **options)
    assert paths.num_paths > 1
    ends = paths.end_vectors()
    moment = [oracle.turned(k * 25.0, 10.0 * k, 40.0 * k)[:, 2] for k in range(7)]
    fields = [
        oracle.loop(moment[k], ends[k > 2]) if k % 2 else oracle.dipole(-moment[k], ends[k > 2]) for k in range(7)
    ]
    between, geometry = oracle.transfer(paths.a, *ends), PathGeometry.of(paths, radar)
    scale = 10.0 ** ((radar.front_end.tx_power_dbm - 30.0) / 20.0)
    for tx, rx in ((0, 0), (1, 0), (2, 3)):
        exact = scale * np.einsum("pi,pij,pj->p", fields[3 + rx], between, fields[tx])
        assert np.abs(geometry.at_centers(tx, rx) - exact.conj()).max() < 1e-9 * np.abs(exact).max()


@pytest.mark.parametrize("method", ["raycast", pytest.param("sbr", marks=pytest.mark.slow)])
def test_an_antenna_rolled_by_a_quarter_turn_is_of_the_other_polarisation(state, method):
    """By Ludwig's third definition that holds in all directions: the same raw data."""
    flat, rolled = (
        PLAIN.with_(pattern={"kind": "isotropic"}, tx_elements=(one,), rx_elements=(one,))
        for one in (
            ss.AntennaElement(polarization="H", basis="ludwig3"),
            ss.AntennaElement(polarization="V", basis="ludwig3", roll_deg=90.0),
        )
    )
    options = {"num_rays": 2000} if method == "raycast" else {}
    one, other = (ss.synthesize(ss.solve_paths(state, r, Pose(), method, **options), r) for r in (flat, rolled))
    assert np.abs(one - other).max() < 1e-5 * np.abs(one).max()  # single precision


def test_another_radars_antennas_count_at_its_end():
    """One way between two dipoles: the cosine of the angle between them, twisted about the line of sight."""
    here, there = ss.Pose([30.0, 0.0, 1.0], (0.0, 0.0, 0.0, 1.0)), ss.Pose([0.0, 0.0, 1.0])
    sender, victim = (
        PLAIN.with_(tx_elements=(element((0.0, 0.0, roll), "V"),), rx_elements=(element((0.0, 0.0, roll), "V"),))
        for roll in (25.0, 0.0)
    )
    levels = []
    for radar in (sender, victim):
        paths = ss.one_way_paths(radar, here, there)
        levels.append(np.abs(PathGeometry.of(paths, radar, victim).pair_amplitude(0, 1)))
    assert levels[0] / levels[1] == pytest.approx(np.cos(np.radians(25.0)), abs=1e-4)  # antennas 6 mm off the line
    burst = [
        ss.synthesize_interference(ss.one_way_paths(radar, here, there), radar.with_(bandwidth=200e6), victim)
        for radar in (sender, victim)
    ]
    assert np.abs(burst[0]).max() / np.abs(burst[1]).max() == pytest.approx(np.cos(np.radians(25.0)), abs=1e-3)


def test_mean_rain_echo_follows_each_antennas_gain():
    """Two-way gain of the elements: slanted 10 deg dipoles seen by upright ones lose cos^2, and nothing else."""
    radar = PLAIN.with_(num_chirps=16, tx_power_dbm=40.0)
    turned = radar.with_(tx_elements=(element((40.0, 0.0, 0.0), "V"),), rx_elements=(element((0.0, 0.0, 0.0), "V"),))
    upright = radar.with_(tx_elements=(element((0.0, 0.0, 0.0), "V"),), rx_elements=(element((0.0, 0.0, 0.0), "V"),))
    powers = []
    for some in (turned, upright):  # turned about z, a dipole along z stays what it is
        paths = volume_clutter(ss.Weather(rain_rate=40.0), some, Pose(), np.random.default_rng(1))
        powers.append(float(np.sum(PathGeometry.of(paths, some).mean_power())))
        field = element_field(some.array.tx[0], paths.tx_point[:1])
        assert np.isfinite(field).all()
    assert powers[0] == pytest.approx(powers[1], rel=1e-9)
    alike = radar.with_(pattern=PATTERN, polarization="V")
    paths = volume_clutter(ss.Weather(rain_rate=40.0), alike, Pose(), np.random.default_rng(1))
    assert powers[1] == pytest.approx(float(np.sum(np.abs(PathGeometry.of(paths, alike).amplitude) ** 2)), rel=1e-6)
