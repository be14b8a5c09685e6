"""A scanning radar against closed forms, and against the same turn sample by sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import scarl_sionna as ss
from scarl_sionna.core.specs.radar.antennas.fan import FanPattern
from scarl_sionna.radar.scanning.beats import Block, block_beats
from scarl_sionna.signal.polar import polar_noise_power, polar_power
from tests.oracles.link import received_power
from tests.oracles.scanning import gaussian_gain, hann_response, straight, turn

C = 299_792_458.0
BEAM = FanPattern(peak_gain_dbi=36.0)
RADAR = ss.ScanningRadarSpec.preset("cts350x").with_(pattern=BEAM)
"""Without the fill below the horizon, which the closed forms do not have."""
FINE = RADAR.with_(num_azimuths=100, rotation_rate=0.02)
"""So slow that the antenna stands still during a ramp: 0.004 deg."""
EXACT = ss.RadarSettings(scanning={"keep_power": True, "num_pointings": 6, "beam_floor_db": 150.0})


def scan(radar, positions, velocities=0.0, rcs=1.0, mount=None, rng=None, settings=EXACT) -> ss.RadarScan:
    positions = np.atleast_2d(np.asarray(positions, float))
    velocities = np.broadcast_to(velocities, positions.shape)
    paths = ss.point_targets(positions, velocities, rcs, radar.ramp(), mount or ss.Pose())
    return ss.scan_paths(paths, radar, rng, settings)


def at(radar, number: int, distance: float) -> list[float]:
    azimuth = radar.azimuth[number]
    return [distance * np.cos(azimuth), distance * np.sin(azimuth), 0.0]


def on_cell(radar, cell: int) -> float:
    return float(radar.range[cell])


@pytest.mark.parametrize("cell", [200, 1000, 3000])
@pytest.mark.parametrize("rcs", [0.1, 30.0])
def test_peak_is_the_radar_equation_to_a_hundredth_of_a_decibel(cell: int, rcs: float) -> None:
    distance = on_cell(FINE, cell)
    found = scan(FINE, at(FINE, 37, distance), rcs=rcs)
    expected = received_power(1e-2, 10**3.6, FINE.waveform.start_frequency, rcs, distance)
    row, column = np.unravel_index(found.power.argmax(), found.power.shape)
    assert (row, abs(column - cell) <= 1) == (37, True)  # the residual video phase moves it by S tau / 2 f_c
    assert 10.0 * np.log10(found.power.max() / expected) == pytest.approx(0.0, abs=0.01)


def test_range_profile_is_the_windows_response() -> None:
    distance = on_cell(FINE, 1000)
    found = scan(FINE, at(FINE, 10, distance)).power[10]
    shift = (
        0.5 * FINE.waveform.chirp_slope * (2.0 * distance / C) ** 2
    )  # Hz of the residual video phase: none over time
    assert shift > 0.0
    bins = (np.arange(FINE.num_cells) - 1000) / FINE.cells_per_resolution
    expected = hann_response(bins * 942 / 943) ** 2  # of the window with its zeros, one sample longer
    near = np.abs(bins) < 12.0
    ratio = found[near] / found.max()
    assert 10.0 * np.log10(ratio[np.abs(bins[near]) < 1.5]) == pytest.approx(
        10.0 * np.log10(expected[near][np.abs(bins[near]) < 1.5]), abs=0.1
    )
    assert np.abs(ratio - expected[near]).max() < 2e-3


def test_azimuth_profile_is_the_beam_pattern_squared_with_its_sidelobes() -> None:
    radar = FINE.with_(num_azimuths=1200, rotation_rate=1e-4)
    number = 100
    found = scan(radar, at(radar, number, on_cell(radar, 700))).power[:, 700]
    away = radar.azimuth - radar.azimuth[number]
    expected = gaussian_gain(np.angle(np.exp(1j * away)), np.radians(1.8), 10**-2.3) ** 2
    near = np.abs(away) < np.radians(30.0)
    assert 10.0 * np.log10(found[near] / found[number]) == pytest.approx(10.0 * np.log10(expected[near]), abs=2e-3)


def test_elevation_counts_twice_and_the_fill_is_cosec_squared() -> None:
    radar = FINE.with_(pattern=FanPattern(cosecant_deg=25.0))
    height, near, far = 2.0, 6.0, 40.0
    levels = []
    for flat in (near, far):
        place = [*(np.array(at(radar, 50, flat))[:2]), -height]
        levels.append(scan(radar, [place]).power.max() * np.hypot(flat, height) ** 4)
    down = np.arctan2(height, [near, far])
    fill = 40.0 * np.log10(np.sin(down[1]) / np.sin(down[0]))
    assert 10.0 * np.log10(levels[0] / levels[1]) == pytest.approx(fill, abs=0.15)  # both peaks fall between cells


@pytest.mark.parametrize("direction", ["up", "down"])
@pytest.mark.parametrize("speed", [-30.0, 12.0])
def test_doppler_moves_a_target_in_range_by_the_ramp(direction: str, speed: float) -> None:
    radar = FINE.with_(waveform=FINE.waveform.with_(direction=direction), cells_per_resolution=16, num_range_bins=None)
    number, distance = 3, 60.0
    unit = np.array(at(radar, number, 1.0))
    time = radar.time[number]
    found = scan(radar, (distance - speed * time) * unit, speed * unit).power[number]
    sign = 1.0 if direction == "up" else -1.0
    waveform = radar.ramp().waveform if direction == "up" else radar.ramp(False).waveform
    expected = distance + sign * waveform.center_frequency / (893e6 / waveform.ramp_time) * speed
    assert abs(sign * radar.doppler_range_shift * speed) > 0.5
    # a mover spreads by S v T^2 / c = 0.03 to 0.07 bins, symmetric about the middle
    assert radar.range[found.argmax()] == pytest.approx(expected, abs=0.6 * radar.range_bin)


def test_ramps_in_turn_give_the_velocity() -> None:
    radar = RADAR.with_(alternating=True, cells_per_resolution=16, num_range_bins=None)
    speed, distance = 14.0, 80.0
    unit = np.array(at(radar, 100, 1.0))
    power = scan(radar, distance * unit, speed * unit).power
    up, down = (radar.range[power[k].argmax()] for k in (100, 101))
    assert radar.is_up.tolist()[:4] == [True, False, True, False]
    expected = speed * (radar.ramp().waveform.center_frequency / radar.waveform.chirp_slope)
    assert 0.5 * (up - down) == pytest.approx(expected, abs=radar.range_bin)


@pytest.mark.parametrize("rotation", ["clockwise", "counterclockwise"])
def test_a_turn_is_that_of_waves_followed_sample_by_sample(rotation: str) -> None:
    """Ego driving and turning, targets that stand, cross and oncoming; beam, skew, Doppler, strength: all at once."""
    radar = RADAR.with_(rotation=rotation, start_azimuth_deg=40.0, alternating=True, num_azimuths=200)
    places = np.array([[30.0, 4.0, 0.1], [-12.0, 6.0, -0.1], [3.0, -9.0, 0.0], [60.0, -20.0, 0.5], [18.0, 15.0, 0.0]])
    speeds = np.array([[-22.0, 0, 0], [9.0, 1.0, 0], [0, 0, 0], [5.0, 20.0, 0], [0, -12.0, 0]])
    rcs = np.array([10.0, 3.0, 0.5, 100.0, 1.0])
    velocity, spin = np.array([16.0, 2.0, 0.0]), 0.6
    mount = ss.Mount(ss.Pose([1.0, -2.0, 0.0]), ss.Twist(velocity, [0.0, 0.0, spin]))
    paths = ss.point_targets(places, speeds, rcs, radar.ramp(), mount)
    settings = EXACT.scanning.with_(beam_floor_db=200.0)
    found = block_beats(Block(paths, 0.0, 0.0, np.arange(200)), radar, settings, ss.Accuracy(synthesis_tolerance=1e-6))

    ramp = radar.waveform
    inside = np.arange(ramp.num_samples) / ramp.sample_rate
    slope = np.where(radar.is_up, 1.0, -1.0) * ramp.bandwidth / ramp.ramp_time
    start = np.where(radar.is_up, ramp.start_frequency, ramp.start_frequency + ramp.bandwidth)
    middle = radar.middle_time

    def direction(t):
        return radar.azimuth[0] + radar.azimuth_rate * (t - middle) + spin * t

    exact = np.sqrt(1e-2) * turn(
        radar.ramp_start,
        (ramp.start_frequency, start, slope, inside),
        (10**3.6, np.radians(1.8), np.radians(1.8), 10**-2.3, direction),
        straight(mount.pose.position, velocity),
        [(straight(p, v), sigma) for p, v, sigma in zip(places, speeds, rcs, strict=True)],
    )
    size = np.abs(exact).max()
    assert np.abs(found - exact).max() < 1.5e-3 * size  # the strength of what comes nearer grows within a ramp
    assert np.linalg.norm(found - exact) < 1e-3 * np.linalg.norm(exact)
    assert np.linalg.norm(polar_power(found, radar) - polar_power(exact, radar)) < 2e-3 * np.linalg.norm(
        polar_power(exact, radar)
    )


def test_noise_has_the_floor_of_the_receiver_and_is_exponential() -> None:
    radar = RADAR.with_(cells_per_resolution=1, num_range_bins=None, window="rect")
    empty = ss.RadarPaths.empty(ss.Pose())
    settings = ss.RadarSettings(scanning={"keep_power": True})
    power = ss.scan_paths(empty, radar, np.random.default_rng(4), settings).power
    expected = 1.380649e-23 * 290.0 * radar.waveform.sample_rate * 10.0 / radar.waveform.num_samples
    assert polar_noise_power(radar) == pytest.approx(expected, rel=1e-12)
    assert power.mean() == pytest.approx(expected, rel=5.0 / np.sqrt(power.size))
    assert stats.kstest(power[::7, ::5].ravel() / expected, "expon").pvalue > 1e-3
    hann = RADAR.with_(cells_per_resolution=4)
    level = ss.scan_paths(empty, hann, np.random.default_rng(5), settings)
    assert level.power.mean() == pytest.approx(1.5 * expected * 942 / 941, rel=0.01)
    # code 0 lies 10 dB below the mean: a tenth of the noise is cut off there
    below = np.mean(level.power < 10 ** (level.floor_dbm / 10.0 - 3.0))
    assert below == pytest.approx(1.0 - np.exp(-0.1), abs=0.005)


def test_two_targets_apart_by_three_resolutions_are_two_and_add_in_phase_when_together() -> None:
    cell = 1000
    both = [at(FINE, 20, on_cell(FINE, cell)), at(FINE, 20, on_cell(FINE, cell + 12))]
    power = scan(FINE, both).power[20]
    high = np.flatnonzero(power > 0.1 * power.max())
    peaks = [k for k in high.tolist() if power[k] > max(power[k - 1], power[k + 1])]
    assert peaks == pytest.approx([cell, cell + 12], abs=1)
    wave = C / FINE.waveform.start_frequency
    for apart, times in ((0.5 * wave, 4.0), (0.25 * wave, 0.0)):
        pair = [at(FINE, 20, 40.0), at(FINE, 20, 40.0 + apart)]
        one = scan(FINE, pair[0]).power.max()
        assert scan(FINE, pair).power.max() / one == pytest.approx(times, abs=0.01)


def test_beam_goes_on_over_the_start_of_the_turn() -> None:
    found = scan(RADAR, at(RADAR, 0, 50.0)).power.max(axis=1)
    assert found[[1, -1]] == pytest.approx(found[1], rel=0.02)
    assert found[399] > 1e-3 * found[0]


def test_start_azimuth_and_sense_of_rotation() -> None:
    for rotation, sign in (("clockwise", -1), ("counterclockwise", 1)):
        radar = RADAR.with_(rotation=rotation, start_azimuth_deg=90.0)
        found = scan(radar, [0.0, 40.0, 0.0]).power
        assert found.max(axis=1).argmax() == 0
        ahead = scan(radar, [40.0, 0.0, 0.0]).power.max(axis=1).argmax()
        assert ahead == (100 if sign < 0 else 300)


def test_antenna_turns_during_a_ramp() -> None:
    """It sweeps 0.85 deg of a beam of 1.8 deg: the peak falls by 0.16 dB, and what is beside the beam rises."""
    held = EXACT.with_(scanning=EXACT.scanning.with_(num_pointings=1))
    place = at(RADAR, 50, on_cell(RADAR, 1000))
    moving, still = (scan(RADAR, place, settings=one).power[:, 1000] for one in (EXACT, held))
    assert 10.0 * np.log10(moving[50] / still[50]) == pytest.approx(-0.158, abs=0.01)
    assert 10.0 * np.log10(moving[52] / still[52]) > 0.3


@pytest.mark.parametrize(("pointings", "error"), [(1, 0.2), (3, 5e-3), (5, 2e-4)])
def test_pointings_converge(pointings: int, error: float) -> None:
    place = at(RADAR, 50, 30.0)
    few = scan(RADAR, place, settings=EXACT.with_(scanning=EXACT.scanning.with_(num_pointings=pointings))).power
    many = scan(RADAR, place, settings=EXACT.with_(scanning=EXACT.scanning.with_(num_pointings=12))).power
    worst = np.abs(np.sqrt(few) - np.sqrt(many)).max() / np.sqrt(many.max())
    assert error / 20.0 < worst < error


def test_no_target_gives_an_empty_image() -> None:
    found = ss.scan_paths(ss.RadarPaths.empty(ss.Pose()), RADAR, settings=EXACT)
    assert not found.image.any() and not found.power.any() and found.num_paths == 0


def test_moving_ego_skews_the_image_as_its_geometry_says() -> None:
    """Each azimuth is measured from where the car is then: at 20 m/s the last one is 5 m farther on."""
    velocity = np.array([20.0, 0.0, 0.0])
    mount = ss.Mount(ss.Pose(), ss.Twist(velocity))
    places = np.array([[10.0, -30.0, 0.0], [-25.0, 1.0, 0.0], [8.0, 30.0, 0.0]])
    found = scan(RADAR, places, mount=mount)
    for place in places:
        offset = place - found.time[:, None] * velocity
        bearing = np.arctan2(offset[:, 1], offset[:, 0])
        number = np.abs(np.angle(np.exp(1j * (bearing - found.azimuth)))).argmin()
        distance = np.linalg.norm(offset[number])
        rate = -velocity @ offset[number] / distance
        shown = RADAR.range[found.power[number].argmax()]
        assert shown == pytest.approx(distance + RADAR.doppler_range_shift * rate, abs=RADAR.range_bin)
        assert found.azimuth_pose[number, :3] == pytest.approx(found.time[number] * velocity)
    still = scan(RADAR, places)
    assert np.abs(found.power - still.power).max() > 0.5 * still.power.max()


def test_paths_beside_the_beam_are_left_out_where_they_move_to() -> None:
    """The car turns by 8.6 deg within the turn and drives past: who is near the beam is told at each azimuth's time."""
    places = np.array([[30.0, 4.0, 0.0], [-12.0, 6.0, 0.0], [3.0, -9.0, 0.0], [18.0, 15.0, 0.0]])
    mount = ss.Mount(ss.Pose(), ss.Twist([16.0, 2.0, 0.0], [0.0, 0.0, 0.6]))
    paths = ss.point_targets(places, [[0.0, 0.0, 0.0]] * 4, 1.0, RADAR.ramp(), mount)
    block = Block(paths, 0.0, 0.0, np.arange(400))
    near, every = (block_beats(block, RADAR, EXACT.scanning.with_(beam_floor_db=floor)) for floor in (80.0, 200.0))
    assert 0.0 < np.abs(near - every).max() < 3e-4 * np.abs(every).max()  # -80 dB each, and the transform's tolerance


def test_phases_of_paths_are_those_of_the_beat_signal() -> None:
    """Transmit times conj(receive), as `synthesize` has it, here of an antenna that looks ahead and hardly turns."""
    places = np.array([[40.0, 0.0, 0.0], [40.3, 0.2, 0.0], [41.0, -0.3, 0.0]])
    paths = ss.point_targets(places, [[3.0, 0.0, 0.0]] * 3, 1.0, FINE.ramp(), ss.Pose())
    turned = np.exp(1j * np.array([0.3, 2.0, -1.1]))[:, None, None]
    paths = replace(paths, a=paths.a * turned)
    found = block_beats(Block(paths, 0.0, 0.0, np.arange(1)), FINE, EXACT.scanning)[0]
    exact = ss.synthesize(paths, FINE.ramp(), method="direct")[0, 0]
    assert np.abs(found - exact).max() < 1e-3 * np.abs(exact).max()


def test_what_is_linear_over_a_frame_is_not_over_a_turn() -> None:
    """Paths of `raycast` keep to first order within some ms; over 0.2 s that is 0.5 m off at 30 m/s across."""
    number = 320
    time = RADAR.time[number]
    place = np.array(at(RADAR, number, 8.0)) - time * np.array([20.0, 20.0, 0.0])
    paths = ss.point_targets([place], [[20.0, 20.0, 0.0]], 1.0, RADAR.ramp(), ss.Pose())
    flagged = replace(paths, linear_motion=np.array([True]), length_acceleration=np.zeros(1))
    one, other = (ss.scan_paths(some, RADAR, settings=EXACT).power[number] for some in (paths, flagged))
    assert one.argmax() == other.argmax() and np.allclose(one, other, rtol=1e-3, atol=1e-6 * one.max())
