"""Antennas of an array described one by one, against short antennas in space and the field equations."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.pattern import CosinePattern, DipolePattern, IsotropicPattern
from scarl_sionna.core.units import dbm_to_watt
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.gradients import PathModel
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.signal.antenna import element_field, spherical_basis
from tests.oracles import antennas as oracle

RNG = np.random.default_rng(5)
DIPOLE = DipolePattern()
TURNS = [(0.0, 0.0, 0.0), (35.0, -20.0, 60.0), (-110.0, 70.0, -155.0), (180.0, 5.0, 90.0)]


def element(turn=(0.0, 0.0, 0.0), **fields):
    azimuth, elevation, roll = turn
    return ss.AntennaElement(boresight_azimuth_deg=azimuth, boresight_elevation_deg=elevation, roll_deg=roll, **fields)


def cartesian(one, directions):
    """The field of an antenna as vectors."""
    return np.einsum("pk,pki->pi", element_field(one, directions), spherical_basis(directions))


def random_paths(count=40):
    """Paths in all directions with any polarimetric transfer."""
    places = RNG.normal(size=(count, 3)) * 20.0
    a = (RNG.normal(size=(count, 2, 2)) + 1j * RNG.normal(size=(count, 2, 2))) * 1e-6
    base = ss.point_targets(places, np.zeros((count, 3)), 1.0, ss.RadarSpec(), Pose())
    return RadarPaths(**{**{name: getattr(base, name) for name in base.__dataclass_fields__}, "a": a})


@pytest.mark.parametrize("turn", TURNS)
def test_dipoles_and_loops_turned_in_space_have_their_closed_form(turn):
    directions = RNG.normal(size=(500, 3))
    axis = oracle.turned(*turn)[:, 2]
    sent = cartesian(element(turn, pattern=DIPOLE, polarization="V"), directions)
    assert np.allclose(sent, oracle.dipole(-axis, directions), rtol=0.0, atol=1e-12)  # V is along theta-hat
    sent = cartesian(element(turn, pattern=DIPOLE, polarization="H"), directions)
    assert np.allclose(sent, oracle.loop(axis, directions), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("turn", TURNS)
def test_a_huygens_source_is_co_polar_by_ludwigs_third_definition(turn):
    """Dipole and loop crossed: (1 + cos)^2 pattern, purely H of that definition."""
    directions = RNG.normal(size=(500, 3))
    rotation = oracle.turned(*turn)
    cosine = oracle.unit(directions) @ rotation[:, 0]
    field = cartesian(element(turn, pattern=IsotropicPattern(), polarization="H", basis="ludwig3"), directions)
    exact = oracle.huygens(rotation, directions)
    assert np.allclose(np.sqrt(0.75) * (1.0 + cosine)[:, None] * field, exact, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("polarization", ["V", "H", "+45", "-45", "RHC", "LHC"])
@pytest.mark.parametrize("basis", ["spherical", "ludwig3"])
def test_power_gain_is_the_patterns_whatever_the_polarisation(polarization, basis):
    directions = RNG.normal(size=(200, 3))
    field = element_field(element(TURNS[1], pattern=DIPOLE, polarization=polarization, basis=basis), directions)
    along = oracle.unit(directions) @ oracle.turned(*TURNS[1])[:, 2]
    assert np.allclose(np.sum(np.abs(field) ** 2, axis=1), 1.5 * (1.0 - along**2), atol=1e-12)


def test_circular_polarisation_turns_as_ieee_has_it_and_a_mirror_changes_its_sense():
    """At boresight the field of RHC turns from V to H a quarter later, e^{+j w t}; one bounce brings nothing back."""
    ahead = np.array([[1.0, 0.0, 0.0]])
    right, left = (
        element_field(element(pattern=IsotropicPattern(), polarization=name), ahead)[0] for name in ("RHC", "LHC")
    )
    v, h = (np.real(right * np.exp(0.5j * np.pi * turn)) for turn in (0, 1))
    assert np.allclose(v, [np.sqrt(0.5), 0.0]) and np.allclose(h, [0.0, np.sqrt(0.5)])  # theta-hat, then phi-hat
    assert abs(right @ right) < 1e-15 and abs(right @ left - 1.0) < 1e-15  # a sphere: S = 1
    assert abs(right @ np.diag([1.0, -1.0]) @ right - 1.0) < 1e-15  # a dihedral


@pytest.mark.parametrize("level", [-60.0, -20.0, -10.0])
def test_the_cross_polar_level_is_in_the_fields(level):
    """Power across over power along, and its phase; a rotated dihedral brings what the equations say."""
    directions, phase = RNG.normal(size=(100, 3)), 70.0
    one = element(pattern=CosinePattern(), polarization="V", cross_polar_db=level, cross_polar_phase_deg=phase)
    plain = element_field(element(pattern=CosinePattern(), polarization="V"), directions)
    field = element_field(one, directions)
    x = 10.0 ** (level / 20.0) * np.exp(1j * np.radians(phase))
    assert np.allclose(field[:, 0], plain[:, 0]) and np.allclose(field[:, 1], x * plain[:, 0])
    by_pattern = element(
        pattern=IsotropicPattern(),
        polarization="V",
        cross_polar_pattern=IsotropicPattern(gain_dbi=level),
        cross_polar_phase_deg=phase,
    )
    ahead = np.array([[1.0, 0.0, 0.0]])
    field = element_field(by_pattern, ahead)[0]
    assert field @ np.array([[0.0, 1.0], [1.0, 0.0]]) @ field == pytest.approx(2.0 * x, abs=1e-12)


def test_every_pair_receives_what_its_two_antennas_and_the_path_say():
    """Each antenna its own: E_rx . S E_tx of Cartesian vectors, to the last digits."""
    paths = random_paths()
    kinds = [("V", oracle.dipole, -1.0), ("H", oracle.loop, 1.0)]
    make = [(TURNS[k % 4], kinds[k % 2]) for k in range(7)]
    own = [element(turn, pattern=DIPOLE, polarization=kind[0]) for turn, kind in make]
    radar = ss.RadarSpec().with_(tx_elements=own[:3], rx_elements=own[3:], tx_power_dbm=20.0)
    u = paths.tx_point
    fields = [kind[1](kind[2] * oracle.turned(*turn)[:, 2], u) for turn, kind in make]
    between = oracle.transfer(paths.a, u, u)
    geometry = PathGeometry.of(paths, radar)
    for tx in range(3):
        for rx in range(4):
            exact = np.sqrt(dbm_to_watt(20.0)) * np.einsum("pi,pij,pj->p", fields[3 + rx], between, fields[tx])
            found = geometry.at_centers(tx, rx)
            assert np.abs(found - np.conj(exact)).max() < 1e-9 * np.abs(exact).max()
    mean = sum(np.abs(geometry.at_centers(tx, rx)) ** 2 for tx in range(3) for rx in range(4)) / 12
    assert np.allclose(geometry.mean_power(), mean, rtol=1e-12)


@pytest.mark.parametrize("velocity", [0.0, 30.0])
@pytest.mark.parametrize("waveform", ["fmcw", "ofdm"])
def test_raw_data_hold_each_pairs_own_amplitude(velocity, waveform):
    """Whatever the motion's method: channels of different antennas are those of equal ones, times factors."""
    own = [element(TURNS[k % 4], pattern=DIPOLE, polarization="VH"[k % 2], cross_polar_db=-15.0) for k in range(7)]
    plain = ss.RadarSpec().with_(num_chirps=32, num_samples=64, pattern=IsotropicPattern(), bandwidth=150e6)
    if waveform == "ofdm":
        shape = ss.Ofdm(num_subcarriers=64, num_chirps=32, subcarrier_spacing=2e6, cyclic_prefix=4e-7)
        plain = ss.RadarSpec(waveform=shape).with_(pattern=IsotropicPattern())
    radar = plain.with_(tx_elements=own[:3], rx_elements=own[3:])
    place = np.array([[14.0, 6.0, 1.0]])
    paths = ss.point_targets(place, [[velocity, -velocity, 0.0]], 10.0, plain, Pose())
    seen, alike = (ss.virtual_cube(ss.synthesize(paths, some), some) for some in (radar, plain))
    fields = [element_field(one, place)[0] for one in own]
    for tx in range(3):
        for rx in range(4):
            factor = np.conj(fields[3 + rx] @ fields[tx])
            channel = 4 * tx + rx
            assert np.abs(seen[channel] - factor * alike[channel]).max() < 3e-4 * np.abs(alike).max()


def test_antennas_that_are_all_the_arrays_own_change_nothing():
    plain = ss.RadarSpec().with_(num_chirps=16, num_samples=64)
    radar = plain.with_(tx_elements=(ss.AntennaElement(),), rx_elements=(ss.AntennaElement(),) * 4)
    paths = ss.point_targets([[30.0, 5.0, 2.0], [9.0, -4.0, 0.0]], np.zeros((2, 3)), [3.0, 1.0], plain, Pose())
    one, other = (ss.synthesize(paths, some, method="direct") for some in (plain, radar))
    assert np.abs(one - other).max() < 1e-6 * np.abs(one).max()  # complex64
    assert plain.array.is_uniform and not radar.array.is_uniform


@pytest.mark.parametrize("case", ["turned", "slanted", "crossed", "mixed"])
def test_points_have_their_cross_section_and_direction(case):
    """RCS and direction of a point by antennas that are turned, slanted, crossed, or differ in gain and phase."""
    both = {
        "turned": [element((25.0, 0.0, 0.0))] * 2,
        "slanted": [element(polarization="+45")] * 2,
        "crossed": [element(polarization="V"), element(polarization="H")],
        "mixed": [element((20.0, 0.0, 0.0), polarization="V"), element((-15.0, 0.0, 20.0), polarization="RHC")],
    }[case]
    radar = ss.RadarSpec().with_(num_chirps=32, num_samples=128, bandwidth=150e6, tx_power_dbm=20.0)
    rx = [element(), both[1], element((0.0, 0.0, 35.0), polarization="V"), both[1]] if case == "mixed" else (both[1],)
    radar = radar.with_(tx_elements=(both[0],), rx_elements=rx)
    paths = ss.point_targets([[30.0 * np.cos(0.3), 30.0 * np.sin(0.3), 0.0]], np.zeros((1, 3)), 10.0, radar, Pose())
    if case == "crossed":  # what sends back the other polarisation only
        paths = RadarPaths(
            **{name: getattr(paths, name) for name in paths.__dataclass_fields__ if name != "a"},
            a=paths.a[:, ::-1],
        )
    adc = ss.synthesize(paths, radar, np.random.default_rng(1))
    point = ss.detect(ss.range_doppler_angle(ss.virtual_cube(adc, radar), radar), radar)
    assert np.degrees(point.azimuth[0]) == pytest.approx(np.degrees(0.3), abs=0.2)
    assert 10.0 * np.log10(point.rcs[0] / 10.0) == pytest.approx(0.0, abs=0.3)  # noise at 40 dB and more


def test_derivatives_refuse_antennas_described_one_by_one():
    radar = ss.RadarSpec().with_(tx_elements=(ss.AntennaElement(roll_deg=5.0),))
    paths = ss.point_targets([[30.0, 0.0, 0.0]], np.zeros((1, 3)), 1.0, radar, Pose())
    with pytest.raises(ParameterRangeError, match="leave tx_elements, rx_elements and radome out"):
        PathModel(radar, paths)


def test_a_wrong_number_of_antennas_is_refused():
    with pytest.raises(ParameterRangeError, match="tx_elements of 3 antennas"):
        ss.RadarSpec().with_(tx_elements=(ss.AntennaElement(),) * 2)
    with pytest.raises(ParameterRangeError, match="not both"):
        ss.AntennaElement(cross_polar_db=-20.0, cross_polar_pattern=IsotropicPattern())
