"""The twin of a device: planted devices are found again from captures of reflectors through the whole front end."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import yaml

import scarl_sionna as ss
from scarl_sionna.calibration.device import DeviceFit, DeviceFitSettings, ReflectorCapture, fit_device
from scarl_sionna.calibration.device.capture import mean_of
from scarl_sionna.calibration.device.model import DeviceModel
from scarl_sionna.calibration.device.noise import MeasuredNoise
from scarl_sionna.calibration.errors import CalibrationError
from scarl_sionna.core.errors import OutputError, ParameterRangeError, ScarlWarning
from scarl_sionna.signal.angle import steering
from scarl_sionna.signal.antenna import field_gain
from scarl_sionna.signal.front_end.channels import rx_matrix, tx_matrix
from tests.device_captures import SETTINGS, STATED, Planted, errors_over_std, planted

SMALL = STATED.with_(num_samples=64, num_chirps=8)


@pytest.fixture(scope="module")
def device() -> Planted:
    return planted(3, stated=SMALL)


@pytest.fixture(scope="module")
def fit(device):
    return fit_device(device.captures, device.stated, SETTINGS)


def at_boresight(radar: ss.RadarSpec, rng: np.random.Generator | None, azimuth_deg: float = 0.0) -> ReflectorCapture:
    place = 5.0 * np.array([np.cos(np.radians(azimuth_deg)), np.sin(np.radians(azimuth_deg)), 0.0])
    paths = ss.point_targets([place], [[0.0, 0.0, 0.0]], 10.0, radar, ss.Pose())
    data = ss.synthesize(paths, radar, rng=rng, method="direct")
    return ReflectorCapture(data, place, 10.0, position_std=1e-3, rcs_std_db=0.1)


def test_every_planted_number_is_found_within_its_uncertainty(fit, device) -> None:
    found = errors_over_std(fit, device)
    assert set(device.truth) - {"tx_gain_db[0]", "tx_phase_deg[0]", "rx_gain_db[0]", "rx_phase_deg[0]"} <= set(found)
    assert max(map(abs, found.values())) < 4.0, found
    assert fit.not_identified == ()
    assert fit.std[fit.names.index("range_bias")] < 0.003
    assert fit.std[fit.names.index("rx_phase_deg[2]")] < 1.0


def test_residuals_are_at_the_noise_held_out_too(fit) -> None:
    assert [item.held_out for item in fit.residuals] == [False] * 10 + [True] * 2
    assert all(0.93 < item.over_noise < 1.07 for item in fit.residuals), fit.residuals


def moved(captures: list[ReflectorCapture], number: int, by: list[float]) -> list[ReflectorCapture]:
    """Return captures of which one says that its reflector stood elsewhere."""
    place = np.asarray(captures[number].position) + by
    return [replace(item, position=place) if k == number else item for k, item in enumerate(captures)]


def test_what_was_stated_rightly_is_pulled_by_a_few_standard_deviations(fit) -> None:
    pulls = fit.all_pulls
    assert {"captures[0].x", "captures[11].level_db", "tx_y[1]", "rx_z[3]"} <= set(pulls)
    assert max(map(abs, pulls.values())) < 4.0 and np.sqrt(np.mean(np.square(list(pulls.values())))) < 1.2
    rows = {row[0]: str(row[1]) for row in fit._facts()}
    assert rows["largest pull, fitted"] == f"{pulls['captures[3].x']:+.3g} (captures[3].x)"
    assert "(captures[11].y)" in rows["largest pull, held out"]


def test_a_survey_that_is_wrong_is_told_and_widens_the_intervals(fit, device) -> None:
    with pytest.warns(
        ScarlWarning, match=r"captures\[2\]\.x \('corner 2'\) is fitted 4\d(\.\d)? of its stated"
    ) as told:
        wrong = fit_device(moved(device.captures, 2, [0.3, 0.0, 0.0]), device.stated, SETTINGS)
    assert len(told) == 1 and told[0].filename == __file__
    assert all(item.over_noise < 1.07 for item in wrong.residuals if not item.held_out)  # the signals do not tell it
    place = wrong.names.index("range_bias")
    assert abs(wrong["range_bias"] - device.range_bias) > 4.0 * fit.std[place]
    assert max(map(abs, errors_over_std(wrong, device).values())) < 2.0
    assert wrong.summary()["residuals"][2]["pulls"]["x"] == pytest.approx(wrong.all_pulls["captures[2].x"])


def test_a_survey_of_a_held_out_capture_that_is_wrong_is_told_and_widens_nothing(fit, device) -> None:
    with pytest.warns(ScarlWarning, match=r"captures\[11\]\.x \('corner 11'\) is fitted"):
        wrong = fit_device(moved(device.captures, 11, [0.1, 0.0, 0.0]), device.stated, SETTINGS)
    assert wrong.std == pytest.approx(fit.std, rel=1e-6) and wrong.values == pytest.approx(fit.values, rel=1e-6)


def test_the_fitted_radar_makes_the_raw_data_of_the_true_one(fit, device) -> None:
    def echo(radar: ss.RadarSpec, bias: float) -> np.ndarray:
        point = ss.point_targets([[6.0, 1.5, 0.2]], [[0.0, 0.0, 0.0]], 10.0, radar, ss.Pose())
        alone = radar.with_(leakage=(), dc_offset_dbm=None)
        return ss.synthesize(replace(point, inner_length=np.array([2.0 * bias])), alone, rng=None)

    true, twin = echo(device.true, device.range_bias), echo(fit.radar, fit["range_bias"])

    def apart(one: np.ndarray) -> float:
        """Return what is left beside the true echo, a common phase aside: no survey fixes the absolute phase."""
        turn = np.exp(1j * np.angle(np.vdot(one, true)))
        return float(np.linalg.norm(true - turn * one) / np.linalg.norm(true))

    assert apart(twin) < 0.05 < 0.5 < apart(echo(device.stated, 0.0))


def test_leakage_and_constant_are_those_planted(fit, device) -> None:
    (found,), (way,) = fit.radar.front_end.leakage, device.true.front_end.leakage
    power = fit.radar.front_end.tx_power_dbm - device.true.front_end.tx_power_dbm
    assert found.level_db + power == pytest.approx(way.level_db, abs=0.05)
    per_metre = 360.0 * device.true.center_frequency / 299792458.0
    middles = [item.phase_deg + per_metre * item.length for item in (found, way)]
    assert (np.subtract(*middles) + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1.0)
    assert fit.radar.front_end.dc_offset_dbm == pytest.approx(device.true.front_end.dc_offset_dbm, abs=0.02)


def test_saved_files_give_the_radar_again(fit, tmp_path) -> None:
    folder = fit.save(tmp_path / "twin")
    text = (folder / "device.yaml").read_text(encoding="utf-8")
    assert ss.RadarSpec(**yaml.safe_load(text)) == fit.radar
    assert (folder / "report.png").stat().st_size > 10_000
    assert "range_bias" in (folder / "estimate.json").read_text(encoding="utf-8")
    (tmp_path / "file").write_text("mine")
    with pytest.raises(OutputError, match="file"):
        fit.save(tmp_path / "file")


def test_what_is_not_there_is_not_found() -> None:
    device = planted(5, count=6, stated=SMALL, has_leakage=False)
    found = fit_device(device.captures, device.stated, SETTINGS)
    assert not any(name.startswith("leakage") for name in found.names)
    assert found.radar.front_end.leakage == ()
    assert max(map(abs, errors_over_std(found, device).values())) < 4.5


def test_time_division_gives_the_same_device() -> None:
    device = planted(6, count=5, stated=SMALL.with_(multiplexing=ss.Tdm()))
    found = fit_device(device.captures, device.stated, SETTINGS)
    assert max(map(abs, errors_over_std(found, device).values())) < 4.5


def test_walls_are_subtracted_with_an_empty_capture() -> None:
    rng, device = np.random.default_rng(0), planted(7, count=8, stated=SMALL)
    wall = ss.synthesize(
        ss.point_targets([[8.0, -2.0, 0.0]], [[0.0, 0.0, 0.0]], 100.0, device.true, ss.Pose()), device.true, rng=rng
    )
    still = ss.synthesize(
        ss.point_targets([[8.0, -2.0, 0.0]], [[0.0, 0.0, 0.0]], 100.0, device.true, ss.Pose()),
        device.true.with_(leakage=(), dc_offset_dbm=None),
        rng=None,
    )
    room = [replace(item, adc=item.adc + still, empty=wall) for item in device.captures]
    found = fit_device(room, device.stated, SETTINGS)
    assert "dc_i" not in found.names and "leakage_length" not in found.names
    assert max(map(abs, errors_over_std(found, device).values())) < 4.5
    assert all(item.over_noise < 1.1 for item in found.residuals)
    without = fit_device([replace(item, empty=None) for item in room], device.stated, SETTINGS)
    assert max(item.over_noise for item in without.residuals) > 3.0  # a wall that nobody told it of is seen


def test_one_direction_does_not_tell_antenna_places() -> None:
    found = fit_device([at_boresight(SMALL, np.random.default_rng(1))], SMALL, SETTINGS)
    assert {"tx_y[0]", "rx_z[3]"} <= set(found.not_identified)
    assert "not identified" in repr(found)


def test_turning_the_radar_gives_the_pattern() -> None:
    rng, angles = np.random.default_rng(2), np.arange(-40.0, 41.0, 10.0)
    pattern = ss.RadarSpec().array.pattern.with_(half_power_azimuth_deg=35.0)
    true = SMALL.with_(array=SMALL.array.with_(pattern=pattern))
    captures = [at_boresight(true, rng, angle) for angle in angles]
    found = fit_device(captures, SMALL, DeviceFitSettings(pattern_std_db=5.0, leakage=False))
    offset = np.stack([np.cos(np.radians(angles)), np.sin(np.radians(angles)), 0.0 * angles], axis=1)
    expected = 40.0 * np.log10(field_gain(pattern, offset) / field_gain(SMALL.array.pattern, offset))  # both ways
    measured = found.levels_db - found.levels_db.mean()
    assert np.allclose(measured, expected - expected.mean(), atol=0.1)
    assert np.allclose(found.directions_deg[:, 0], angles)


COUPLED = DeviceFitSettings(pattern_std_db=0.0, coupling_std=0.1)


@cache
def coupled(seed: int) -> tuple[Planted, DeviceFit]:
    """Return a device whose antennas couple, and its fit."""
    device = planted(seed, stated=SMALL, coupling_std=0.1, antenna_std=0.0)
    return device, fit_device(device.captures, device.stated, COUPLED)


@pytest.mark.some(1)
@pytest.mark.parametrize("seed", [11, 12])
def test_planted_coupling_is_found_and_held_out_captures_are_at_the_noise(seed) -> None:
    device, found = coupled(seed)
    errors = errors_over_std(found, device)
    assert {"rx_coupling_i[0,3]", "rx_coupling_q[2,1]", "tx_coupling_q[1,0]"} <= set(errors)
    assert max(map(abs, errors.values())) < 4.0, errors
    assert found.not_identified == ()
    assert max(found.std[k] for k, name in enumerate(found.names) if "coupling" in name) < 0.02  # of 0.1 before
    # the two that were not fitted lie in directions of their own: what coupling's intervals leave adds to the noise
    assert all(item.over_noise < (1.3 if item.held_out else 1.07) for item in found.residuals), found.residuals
    without = fit_device(device.captures, device.stated, COUPLED.with_(coupling_std=0.0))
    assert max(item.over_noise for item in without.residuals if item.held_out) > 5.0


def test_the_twin_couples_as_the_device_does() -> None:
    device, fitted = coupled(11)
    found = fitted.radar
    point = ss.point_targets([[6.0, -3.0, 0.1]], [[0.0, 0.0, 0.0]], 10.0, found, ss.Pose())
    channels = found.front_end.channels
    bare = found.with_(channels=channels.with_(tx_coupling=(), rx_coupling=()))
    radars = (radar.with_(leakage=(), dc_offset_dbm=None) for radar in (device.true, found, bare))
    true, twin, alone = (ss.synthesize(point, radar, rng=None) for radar in radars)

    def apart(one: np.ndarray) -> float:
        """Return what is left beside the true echo over all pairs, a common factor aside."""
        return 1.0 - float(abs(np.vdot(one, true)) / np.linalg.norm(one) / np.linalg.norm(true))

    assert apart(twin) < 1e-4 < 3e-3 < apart(alone)


def test_the_model_is_the_raw_data_of_the_whole_chain() -> None:
    """Couplings, channels and spreading of every pair against the synthesis, at the nearest and farthest aside."""
    device = planted(15, coupling_std=0.1, antenna_std=0.0, has_leakage=False)
    true = device.true.with_(mixer=None, dc_offset_dbm=None, filters=None)
    place = np.array([1.0, 1.0, 0.2])
    adc = ss.synthesize(
        ss.point_targets([place], [[0.0, 0.0, 0.0]], 10.0, true, ss.Pose()), true, rng=None, method="direct"
    )
    item = ReflectorCapture(adc, place, 10.0)
    stated = device.stated.with_(filters=None)
    model = DeviceModel(stated, [item], COUPLED.with_(mixer=False, leakage=False, dc_offset=False), 1.0)
    values = device.truth | {"range_bias": 0.0}
    found = model.value(np.array([values[name] for name in model.names]), np.zeros((1, 5)))
    data = mean_of(item, stated)[None]
    factor = np.vdot(found, data) / np.vdot(found, found)
    assert np.linalg.norm(data - factor * found) < 2e-6 * np.linalg.norm(data)


def test_coupling_turns_directions_and_raises_sidelobes() -> None:
    """What the page says of couplings of -20 dB: 0.5 deg, and sidelobes 1 dB up."""
    rng, sine = np.random.default_rng(0), np.linspace(-1.0, 1.0, 4001)

    def toward(sines: np.ndarray) -> np.ndarray:
        return steering(STATED, np.stack([np.sqrt(1.0 - sines**2), sines, 0.0 * sines], axis=-1))

    def matrix(count: int) -> tuple[tuple[tuple[float, float], ...], ...]:
        drawn = rng.normal(0.0, 0.1 / np.sqrt(2.0), (count, count, 2))
        drawn[range(count), range(count)] = (1.0, 0.0)
        return tuple(tuple(map(tuple, row)) for row in drawn)

    grid, off, sides = toward(sine), [], []
    for azimuth in np.radians(rng.uniform(-45.0, 45.0, 200)):
        errors = ss.ChannelErrors(tx_coupling=matrix(2), rx_coupling=matrix(4))
        pairs = toward(np.sin(azimuth)).reshape(2, 4)
        seen = tx_matrix(errors, 2).conj().T @ pairs @ rx_matrix(errors, 4).conj().T
        power = np.abs(grid.conj() @ seen.ravel()) ** 2
        peak = int(power.argmax())
        off.append(np.degrees(np.arcsin(sine[peak]) - azimuth))
        beside = (
            np.abs(sine - sine[peak]) > 0.255
        )  # the first null of eight elements half a wavelength apart is at 0.25
        sides.append(10.0 * np.log10(power[beside].max() / power[peak]))
    assert 0.4 < np.sqrt(np.mean(np.square(off))) < 0.6
    assert -12.0 < np.median(sides) < -11.3  # -12.8 without


def test_coupling_needs_as_many_directions_as_antennas() -> None:
    def named(count: int, spread: float) -> tuple[set[str], str]:
        device = planted(14, count=count + 2, stated=SMALL, coupling_std=spread, antenna_std=0.0)
        found = fit_device(device.captures, device.stated, COUPLED.with_(coupling_std=spread))
        assert max(map(abs, errors_over_std(found, device).values())) < 4.5
        return {name for name in found.not_identified if "coupling" in name}, repr(found)

    every = {f"rx_coupling_{part}[{i},{j}]" for part in "iq" for i in range(4) for j in range(4) if i != j}
    lost, text = named(1, 0.02)
    assert lost == every | {f"tx_coupling_{part}[{i},{1 - i}]" for part in "iq" for i in range(2)}
    assert "needs at least 4 directions" in text and "needs at least 2 directions" in text
    assert named(3, 0.1)[0] == every
    assert named(6, 0.1)[0] == set()


def test_bins_of_weighed_noise_are_independent() -> None:
    """Noise through high passes: all directions of the weighed bins have variance one."""
    nothing = ss.point_targets([[9.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 1e-12, STATED, ss.Pose())
    place = np.array([9.0, 0.0, 0.0])
    captures = [
        ReflectorCapture(ss.synthesize(nothing, STATED, rng=np.random.default_rng(seed), method="direct"), place, 0.0)
        for seed in range(75)
    ]
    noise = MeasuredNoise.of(captures, STATED)
    means = np.stack([mean_of(item, STATED) for item in captures])
    looks = noise.whitened(means, captures).reshape(-1, 128)
    variances = np.linalg.eigvalsh(looks.conj().T @ looks / len(looks))
    spread = np.sqrt(128 / len(looks))  # Marchenko and Pastur: of 128 equal variances from so many looks
    assert variances[0] > (1.0 - spread) ** 2 - 0.1 and variances[-1] < (1.0 + spread) ** 2 + 0.1
    without = replace(noise, apart=None)
    looks = without.whitened(means, captures).reshape(-1, 128)
    assert abs(np.mean(looks[:, 0].conj() * looks[:, 1])) > 0.4  # neighbours at zero are alike, which is not weighed


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"adc": np.zeros((4, 8, 64), dtype=np.complex64)}, r"captures\[0\].adc"),
        ({"position": np.array([-5.0, 0.0, 0.0])}, r"captures\[0\].position.*x > 0"),
        ({"position": np.array([5000.0, 0.0, 0.0])}, r"within max_range"),
        ({"position_std": 0.0}, r"position_std = 0.0 m"),
        ({"rcs_std_db": -1.0}, r"rcs_std_db = -1.0 dB"),
        ({"held_out": True}, r"all held out"),
        ({"empty": np.zeros((4, 3, 64), dtype=np.complex64)}, r"captures\[0\].empty"),
    ],
)
def test_bad_captures_are_refused(change, match) -> None:
    item = at_boresight(SMALL, np.random.default_rng(0))
    with pytest.raises(ParameterRangeError, match=match):
        fit_device([replace(item, **change)], SMALL)


def test_no_noise_no_echo_and_other_radars_are_errors() -> None:
    with pytest.raises(CalibrationError, match="do not differ"):
        fit_device([at_boresight(SMALL, None)], SMALL)
    item = at_boresight(SMALL, np.random.default_rng(0))
    with pytest.raises(CalibrationError, match="dB over the noise"):
        fit_device([replace(item, position=np.array([9.0, 0.0, 0.0]))], SMALL)
    with pytest.raises(CalibrationError, match=r"sqrt\(W\)"):
        fit_device([replace(item, adc=0.01 * item.adc)], SMALL)
    with pytest.raises(ParameterRangeError, match="multiplexing"):
        fit_device([item], SMALL.with_(multiplexing=ss.Bpm()))
    with pytest.raises(ParameterRangeError, match="waveform"):
        fit_device([item], SMALL.with_(waveform=ss.Pmcw()))
