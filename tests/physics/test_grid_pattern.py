"""Measured tables of gain and phase: sampled from closed forms, read from files, and through rigs and datasets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.pattern import CosinePattern, DipolePattern
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.signal.antenna import element_field, field_gain, field_gain_slope

COSINE = CosinePattern(half_power_azimuth_deg=45.0, half_power_elevation_deg=15.0)
DELAY = 0.6
"""Cycles of phase over the sine of the azimuth: a phase centre aside of the antenna's place."""


def phase_of(azimuth, elevation):
    return 2.0 * np.pi * DELAY * np.sin(azimuth) * np.cos(elevation)


def table(pattern, step, interpolation="linear", phased=False, reach=(70.0, 60.0)):
    azimuth, elevation = (np.arange(-r, r + 1e-9, step) for r in reach)
    grid = np.meshgrid(np.radians(azimuth), np.radians(elevation), indexing="ij")
    phase = np.degrees(phase_of(*grid)) if phased else ()
    return ss.GridPattern(
        azimuth_deg=azimuth,
        elevation_deg=elevation,
        gain_dbi=pattern.gain_db(*grid),
        phase_deg=phase,
        interpolation=interpolation,
    )


def worst(pattern, grid, reach=(69.0, 40.0)):
    """Largest departure of a table from its closed form [dB]."""
    rng = np.random.default_rng(2)
    azimuth, elevation = (np.radians(rng.uniform(-r, r, 4000)) for r in reach)
    return np.abs(grid.gain_db(azimuth, elevation) - pattern.gain_db(azimuth, elevation)).max()


def test_a_table_of_a_cosine_departs_as_its_second_derivative_says():
    """Linear: step^2 / 8 times the curvature, in both angles; at the entries nothing."""
    azimuth, elevation = np.radians(69.0), np.radians(40.0)
    n, m = np.log(0.5) / np.log(np.cos(np.radians([45.0, 15.0])))
    curvature = 10.0 / np.log(10.0) * (n / np.cos(azimuth) ** 2 + m / np.cos(elevation) ** 2)
    for step in (1.0, 2.0):
        bound = np.radians(step) ** 2 / 8.0 * curvature
        assert 0.3 * bound < worst(COSINE, table(COSINE, step)) < 1.05 * bound
    grid = table(COSINE, 2.0)
    assert grid.gain_db(np.radians(12.0), np.radians(-8.0)) == pytest.approx(
        COSINE.gain_db(np.radians(12.0), np.radians(-8.0)), abs=1e-9
    )


def test_cubic_splines_converge_with_the_fourth_power_of_the_step():
    errors = [worst(COSINE, table(COSINE, step, "cubic"), (50.0, 35.0)) for step in (2.0, 1.0)]
    assert 10.0 < errors[0] / errors[1] < 22.0  # 16
    assert errors[1] < 1e-5


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_phases_are_interpolated_without_unwrapping(interpolation):
    """A phase centre 0.6 wavelengths aside: 1.2 turns over the table; second order in the step, or fourth."""
    rng = np.random.default_rng(3)
    azimuth, elevation = np.radians(rng.uniform(-60, 60, 2000)), np.radians(rng.uniform(-40, 40, 2000))
    found = []
    for step in (2.0, 1.0):
        grid = table(COSINE, step, interpolation, phased=True)
        turned = np.exp(1j * (grid.phase(azimuth, elevation) - phase_of(azimuth, elevation)))
        found.append(np.abs(np.angle(turned)).max())
    assert found[1] < (1e-3 if interpolation == "linear" else 1e-6)
    assert found[0] / found[1] == pytest.approx(4.0 if interpolation == "linear" else 16.0, rel=0.4)


def test_a_phase_centre_aside_moves_the_antenna():
    """A table whose phase is that of a place aside gives the raw data of the antenna at that place."""
    grid = table(COSINE, 0.5, "cubic", phased=True)
    radar = ss.RadarSpec().with_(num_chirps=4, num_samples=64, bandwidth=1e6, ramp_time=8e-6, pattern=COSINE)
    aside = DELAY * radar.wavelength  # the length to the target shrinks by y sin(azimuth): phase + k y sin
    there = tuple((x, y + aside, z) for x, y, z in radar.array.rx_positions)
    moved = radar.with_(rx_positions=there)
    own = radar.with_(rx_elements=(ss.AntennaElement(pattern=grid),))
    paths = ss.point_targets([[4000.0, 2500.0, 200.0]], np.zeros((1, 3)), 10.0, radar, Pose())
    one, other = (ss.synthesize(paths, some, method="direct") for some in (own, moved))
    # bandwidth over carrier and wavefronts: the offset's delay over 1 MHz, and its square over 4.7 km
    assert np.abs(one - other).max() < 2e-4 * np.abs(other).max()


def test_slopes_are_the_derivatives_and_gradients_take_a_table():
    rng = np.random.default_rng(4)
    vectors = np.stack([np.ones(50), *rng.uniform(-0.7, 0.7, (2, 50))], axis=1)
    step = 1e-6 * rng.normal(size=vectors.shape)
    for interpolation in ("linear", "cubic"):
        grid = table(COSINE, 1.0, interpolation)
        numeric = np.log(field_gain(grid, vectors + step) / field_gain(grid, vectors - step))
        exact = 2.0 * np.einsum("pi,pi->p", step, field_gain_slope(grid, vectors))
        assert np.allclose(numeric, exact, rtol=1e-4, atol=1e-9)
    edge = grid.slopes_db(np.radians([75.0, -75.0, 10.0]), np.radians([0.0, 5.0, 65.0]))
    assert np.array_equal(edge[0] == 0.0, [True, True, False]) and edge[1][2] == 0.0


def test_a_table_all_the_way_round_is_closed():
    azimuth, elevation = np.arange(-180.0, 180.0, 5.0), np.arange(-90.0, 91.0, 5.0)
    grid = np.meshgrid(np.radians(azimuth), np.radians(elevation), indexing="ij")
    lobes = -3.0 + np.cos(grid[0] - 2.9) * np.cos(grid[1])
    for interpolation, allowed in (("linear", 1.5e-3), ("cubic", 5e-6)):  # 5 deg squared over 8, its fourth power
        closed = ss.GridPattern(
            azimuth_deg=azimuth, elevation_deg=elevation, gain_dbi=lobes, interpolation=interpolation
        )
        where = np.radians(np.array([-182.0, 177.6, 179.99, -179.99, 537.6]))
        assert closed.closed
        assert np.allclose(closed.gain_db(where, 0.0), -3.0 + np.cos(where - 2.9), atol=allowed)
    behind = table(COSINE, 2.0).with_(outside_dbi=-60.0)
    assert behind.gain_db(np.pi, 0.0) == -60.0 and table(COSINE, 2.0).gain_db(np.pi, 0.0) == COSINE.gain_db(
        np.radians(70.0), 0.0
    )


def test_a_dipole_radiates_its_power_and_a_table_that_radiates_more_is_refused():
    azimuth, elevation = np.arange(-180.0, 181.0, 4.0), np.linspace(-90.0, 90.0, 91)
    grid = np.meshgrid(np.radians(azimuth), np.radians(elevation), indexing="ij")
    gain = np.maximum(DipolePattern().gain_db(*grid), -100.0)
    dipole = ss.GridPattern(azimuth_deg=azimuth, elevation_deg=elevation, gain_dbi=gain)
    assert dipole.radiated_share == pytest.approx(1.0, abs=1e-3)  # trapezoids of 2 deg
    with pytest.raises(ParameterRangeError, match=r"lower by 3\.0 dB"):
        dipole.with_(gain_dbi=gain + 3.0)


GOOD = "azimuth_deg, elevation_deg, gain_dbi\n-10,-5,1\n-10,5,2\n# a remark\n10,5,4\n10,-5,3\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no line of numbers"),
        ("azimuth_deg,gain_dbi\n1,2\n", "line 1 has no column elevation_deg"),
        (GOOD.replace("10,5,4\n", ""), r"azimuth 10 deg, elevation 5 deg is missing"),
        (GOOD + "10,5,4\n", r"azimuth 10 deg, elevation 5 deg is there 2 times"),
        (GOOD.replace(",2\n", ",two\n"), r"line 3 holds 'two'"),
        (GOOD.replace(",2\n", ",nan\n"), "line 3 holds a value that is not finite"),
        (GOOD.replace(",2\n", "\n"), "line 3 has 2 values, the head line 3"),
        (GOOD.replace("-5,", "-95,"), "elevation_deg within -90 to 90"),
    ],
)
def test_bad_tables_are_refused_with_the_place(tmp_path: Path, text: str, message: str):
    path = tmp_path / "pattern.csv"
    path.write_text(text)
    with pytest.raises(ParameterRangeError, match=message):
        ss.GridPattern.read(path)


def test_lines_of_a_table_stand_in_any_order(tmp_path: Path):
    path = tmp_path / "pattern.csv"
    path.write_text(GOOD)
    assert ss.GridPattern.read(path).gain_dbi == ((1.0, 2.0), (3.0, 4.0))
    with pytest.raises(ParameterRangeError, match="azimuth_deg strictly rising"):
        ss.GridPattern.read(path).with_(azimuth_deg=(3.0, 3.0))
    with pytest.raises(ParameterRangeError, match="pattern table"):
        ss.GridPattern.read(tmp_path / "none.csv")


def test_rig_files_hold_antennas_and_tables(tmp_path: Path):
    grid = table(COSINE, 20.0, phased=True, reach=(60.0, 40.0))
    own = ss.AntennaElement(
        pattern=grid, polarization="+45", boresight_azimuth_deg=10.0, roll_deg=-5.0, cross_polar_db=-22.0
    )
    radar = ss.RadarSpec().with_(tx_elements=(own,), rx_elements=(own, own, ss.AntennaElement(basis="ludwig3"), own))
    rig = Rig("one", (SensorMount("radar", "radar", radar, Pose()),))
    for name in ("rig.yaml", "rig.json"):
        rig.save(tmp_path / name)
        assert Rig.load(tmp_path / name).sensors[0].spec == radar
    assert "elements" not in ss.RadarSpec().model_dump_json()


def test_a_table_for_all_antennas_with_phases_counts_twice():
    """The array's own pattern with phases: both ways."""
    grid = table(COSINE, 0.5, "cubic", phased=True)
    plain = ss.RadarSpec().with_(num_chirps=4, num_samples=64, pattern=COSINE)
    paths = ss.point_targets([[20.0, 8.0, 1.0]], np.zeros((1, 3)), 1.0, plain, Pose())
    one, other = (ss.synthesize(paths, radar, method="direct") for radar in (plain.with_(pattern=grid), plain))
    turn = 2.0 * phase_of(np.arctan2(8.0, 20.0), np.arctan2(1.0, np.hypot(20.0, 8.0)))
    assert np.abs(one - other * np.exp(-1j * turn)).max() < 1e-4 * np.abs(other).max()
    assert abs(element_field(ss.AntennaElement(pattern=grid), [1.0, 0.0, 0.0])[0]) == pytest.approx(np.sqrt(10.0))
