"""Echoes of rain and spray.

Mean power against the radar equation's integral, speckle, Doppler, what hides them, labels.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import kstest

from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.weather_echoes import DEFAULT_WEATHER_ECHOES
from scarl_sionna.core.specs.radar.array import AntennaArray
from scarl_sionna.core.specs.radar.pattern import CosinePattern, IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.weather import Spray, Weather
from scarl_sionna.engine.spray import spray_clouds
from scarl_sionna.radar.labels.labels import label_cells, label_paths
from scarl_sionna.radar.link import received_power
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.sensor import Radar
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.radar.weather.clutter import (
    VOLUME_INTERACTION,
    VolumeSampling,
    spray_clutter,
    through_weather,
    volume_clutter,
)
from scarl_sionna.radar.weather.hydrometeors import spray
from scarl_sionna.radar.weather.mean_clutter import clutter_budget, falling, mean_clutter_power, two_way_gain_integral
from scarl_sionna.signal.processing import range_doppler, virtual_cube
from tests.weather_street import street

RADAR = RadarSpec().with_(num_chirps=64, num_samples=128, ramp_time=7.5e-6, bandwidth=75e6 * 2)
HEAVY = Weather(rain_rate=50.0)
ETA = falling(HEAVY, RADAR.center_frequency)[0].reflectivity


def test_two_way_gain_is_integrated() -> None:
    """cos^(2n) over azimuth and cos^(2m + 1) over elevation, each between -90 and 90 deg, by quadrature."""
    pattern = CosinePattern(half_power_azimuth_deg=45.0, half_power_elevation_deg=15.0)
    n, m = (np.log(0.5) / np.log(np.cos(np.radians(angle))) for angle in (45.0, 15.0))
    exact = quad(lambda x: np.cos(x) ** (2 * n), -np.pi / 2, np.pi / 2)[0]
    exact *= quad(lambda x: np.cos(x) ** (2 * m + 1), -np.pi / 2, np.pi / 2)[0]
    assert two_way_gain_integral(AntennaArray(pattern=pattern)) == pytest.approx(
        100.0 * exact, rel=1e-3
    )  # 10 dBi, 1 deg cells


def test_attenuated_mean_is_the_integral() -> None:
    rate = 2.0 * 18.0 * np.log(10.0) / 1e4
    integral = quad(lambda r: np.exp(-rate * r) / r**2, 5.0, 40.0)[0]
    ratio = mean_clutter_power(RADAR, ETA, 5.0, 40.0, 18.0) / mean_clutter_power(RADAR, ETA, 5.0, 40.0)
    assert ratio == pytest.approx(integral / (1.0 / 5.0 - 1.0 / 40.0), rel=1e-9)


def test_mean_power_per_range_is_the_radar_equations() -> None:
    """60 realisations; 5 standard errors of the mean in each of four parts of the range, from the spread itself."""
    edges = np.array([DEFAULT_WEATHER_ECHOES.nearest, 4.0, 10.0, 20.0, 40.0])
    found = np.zeros((60, 4))
    for seed in range(60):
        paths = volume_clutter(HEAVY, RADAR, Pose(), np.random.default_rng(seed), sampling=VolumeSampling(40.0, 1500))
        distance = np.linalg.norm(paths.tx_point, axis=1)
        power = received_power(paths, RADAR)
        found[seed] = np.histogram(distance, edges, weights=power)[0]
    exact = mean_clutter_power(RADAR, ETA, edges[:-1], edges[1:])
    error = found.std(axis=0, ddof=1) / np.sqrt(60)
    assert np.all(np.abs(found.mean(axis=0) - exact) < 5.0 * error)
    assert np.all(error < 0.1 * exact)


def test_power_of_a_cell_is_exponential() -> None:
    """A cell without windows, of 150 frames: its power over the mean is exponential (Kolmogorov and Smirnov, 0.1 %)."""
    radar = RADAR.with_(num_chirps=1, tx_positions=((0.0, 0.0, 0.0),), rx_positions=((0.0, 0.0, 0.0),))
    power = []
    for seed in range(150):
        paths = volume_clutter(HEAVY, radar, Pose(), np.random.default_rng(seed), sampling=VolumeSampling(60.0, 1500))
        beat = np.fft.fft(synthesize(paths, radar)[0, 0] * np.hanning(radar.num_samples))
        power.append(np.abs(beat[int(20.0 / radar.range_resolution)]) ** 2)
    assert kstest(np.array(power) / np.mean(power), "expon").pvalue > 1e-3


def test_doppler_is_the_fall_and_the_wind() -> None:
    """Upwards the drops come down with the mean speed of fall; forwards the wind and the radar's own speed are seen."""
    quiet = HEAVY.with_(turbulence=0.0)
    up = Pose([0.0, 0.0, 0.0], [np.cos(np.pi / 4), 0.0, -np.sin(np.pi / 4), 0.0])  # x of the radar looks up
    paths = RadarPaths.concatenate(
        [volume_clutter(quiet, RADAR, up, np.random.default_rng(s), sampling=VolumeSampling(40.0)) for s in range(10)]
    )
    distance = np.linalg.norm(paths.tx_point, axis=1)
    straight = paths.tx_point[:, 2] > 0.999 * distance
    fall = -paths.length_rate[straight] / 2.0
    power = (received_power(paths, RADAR) * distance**2)[straight]  # every range counts the same
    mean = np.average(fall, weights=power)
    error = np.sqrt(np.sum(power**2 * (fall - mean) ** 2)) / power.sum()  # of a mean with weights
    expected = falling(quiet, RADAR.center_frequency)[0]
    assert error < 0.2
    assert mean == pytest.approx(expected.mean_fall_speed, abs=5.0 * error + 0.01)
    windy = quiet.with_(wind=(6.0, 0.0))
    paths = volume_clutter(
        windy,
        RADAR,
        Mount(Pose(), Twist([20.0, 0.0, 0.0], np.zeros(3))),
        np.random.default_rng(0),
        sampling=VolumeSampling(40.0),
    )
    ahead = paths.tx_point[:, 0] > 0.999 * np.linalg.norm(paths.tx_point, axis=1)
    power = received_power(paths, RADAR)[ahead]
    assert np.average(paths.length_rate[ahead] / 2.0, weights=power) == pytest.approx(6.0 - 20.0, abs=0.2)


def test_what_is_left_out_is_below_the_noise() -> None:
    """A light drizzle for a deaf radar is left out, heavy rain for the board of the paper is not.

    Nothing falls, nothing is made.
    """
    deaf = RADAR.with_(tx_power_dbm=-60.0)
    budget = clutter_budget(Weather(rain_rate=0.2), deaf)
    assert budget.reach == 0.0
    assert volume_clutter(Weather(rain_rate=0.2), deaf, Pose(), np.random.default_rng(0)).num_paths == 0
    board = clutter_budget(HEAVY, RadarSpec.preset("awr1843boost"))
    assert board.snr_db[1] > 20.0
    assert board.reach > 100.0
    assert volume_clutter(Weather(visibility=50.0), RADAR, Pose(), np.random.default_rng(0)).num_paths == 0
    assert list(board.snr_db) == sorted(board.snr_db, reverse=True)


def test_labels_of_the_air() -> None:
    """Clutter is instance 0, class 0, direct; a cell with a target says so, and shares sum to 1."""
    target = point_targets([[15.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 10.0, RADAR, Pose())
    drops = volume_clutter(HEAVY, RADAR, Pose(), np.random.default_rng(2), sampling=VolumeSampling(30.0, 2000))
    paths = RadarPaths.concatenate([target, drops])
    assert set(drops.interaction.ravel()) == {VOLUME_INTERACTION}
    labels = label_paths(paths)
    assert labels.instance[0] == 1
    assert not labels.instance[1:].any()
    assert not labels.is_ghost.any()
    rd = range_doppler(virtual_cube(synthesize(paths, RADAR), RADAR), RADAR)
    cells = label_cells(rd, paths)
    own = cells.instance == 1
    assert own.any()
    sums = np.bincount(cells.cell, weights=cells.entry_share)
    assert sums[sums > 0] == pytest.approx(1.0)
    column = int(np.argmin(np.abs(rd.range - 15.0)))
    assert own[:, column].any()
    assert not own[:, int(np.argmin(np.abs(rd.range - 5.0)))].any()


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    return street(tmp_path_factory.mktemp("street"))


def test_surfaces_hide_the_rain_behind_them(world) -> None:
    state = world.with_weather(HEAVY).at(0.0)
    pose = state.actor_pose("ego").compose(Pose([2.4, 0.0, 0.5]))
    free = volume_clutter(HEAVY, RADAR, pose, np.random.default_rng(0), sampling=VolumeSampling(40.0))
    seen = volume_clutter(HEAVY, RADAR, pose, np.random.default_rng(0), state=state, sampling=VolumeSampling(40.0))
    assert 0.2 * free.num_paths < seen.num_paths < free.num_paths
    near, far = (np.linalg.norm(item.tx_point - pose.position, axis=1) for item in (free, seen))
    assert 0.2 < received_power(seen, RADAR)[far > 10.0].sum() / received_power(free, RADAR)[near > 10.0].sum() < 0.8
    assert free.tx_point[:, 2].min() < -1.0
    assert seen.tx_point[:, 2].min() > -0.3  # the verge lies a little lower than the road


def test_clear_weather_changes_no_byte_and_rain_does(world) -> None:
    radar, settings = RADAR, RadarSettings.of("raycast", num_rays=2000)
    pose = world.at(0.0).actor_pose("ego").compose(Pose([2.4, 0.0, 0.5]))
    frames = {}
    for name in ("clear", "rain"):
        state = world.with_weather(name).at(0.0)
        sensor = Radar(radar, settings)
        frames[name] = sensor.observe(state, pose, np.random.default_rng(5))
    own = Radar(radar, settings).observe(world.at(0.0), pose, np.random.default_rng(5))
    assert np.array_equal(own.adc_int, frames["clear"].adc_int)
    assert "weather" not in frames["clear"].diagnostics
    assert frames["rain"].diagnostics["weather"]["clutter_points"] > 1000
    again = Radar(radar, settings).observe(world.with_weather("rain").at(0.0), pose, np.random.default_rng(5))
    assert np.array_equal(again.adc_int, frames["rain"].adc_int)
    assert not np.array_equal(own.adc_int, frames["rain"].adc_int)


def test_spray_is_behind_moving_vehicles_on_wet_roads_only(world) -> None:
    spec = Spray()
    dry = world.with_weather(Weather(spray=spec)).at(1.0)
    wet = world.with_weather(Weather(spray=spec, wetness=1.0)).at(1.0)
    slow = world.with_weather(Weather(spray=spec.with_(min_speed=100.0), wetness=1.0)).at(1.0)
    assert spray_clouds(dry) == spray_clouds(slow) == ()
    clouds = {cloud.actor: cloud for cloud in spray_clouds(wet)}
    assert "car_ahead" in clouds
    cloud = clouds["car_ahead"]
    rear = wet.actor_pose("car_ahead").inverse().apply(cloud.world_from_cloud.position)
    assert rear[0] < -1.5
    assert cloud.decay_length == pytest.approx(
        np.linalg.norm(wet.actor_twist("car_ahead").linear) * spec.lifetime, rel=1e-6
    )


def test_spray_sends_back_its_whole_cross_section(world) -> None:
    """Sum over a cloud's points of |a|^2 over that of 1 m2 at each place.

    Eta times the volume's decay integral, within 5 standard errors.
    """
    state = world.with_weather(Weather(spray=Spray(), wetness=1.0, turbulence=0.0)).at(1.0)
    cloud = next(item for item in spray_clouds(state) if item.actor == "car_ahead")
    pose = cloud.world_from_cloud.compose(Pose([-cloud.length - 8.0, 0.0, 0.7]))  # behind the cloud, looking forward
    paths = spray_clutter(state, RADAR, pose, np.random.default_rng(1), num_points=4000)
    place = cloud.world_from_cloud.inverse().apply(paths.tx_point)
    assert place[:, 0].max() <= 1e-6
    assert np.abs(place[:, 1]).max() < cloud.width / 2.0 + 1e-6
    assert place[:, 2].min() > -1e-6
    assert place[:, 2].max() < cloud.height + 1e-6
    paths = paths.select(place[:, 0] > -18.0)  # farther back that of the ego begins
    unit = point_targets(paths.tx_point, np.zeros((paths.num_paths, 3)), 1.0, RADAR, pose)
    sigma = np.abs(paths.a[:, 0, 0]) ** 2 / np.abs(unit.a[:, 0, 0]) ** 2
    drops = spray(cloud.water_content, cloud.drop_diameter, RADAR.center_frequency, 283.15)
    exact = (
        drops.reflectivity
        * cloud.width
        * cloud.height
        * cloud.decay_length
        * (1.0 - np.exp(-18.0 / cloud.decay_length))
    )
    assert sigma.sum() == pytest.approx(exact, rel=5.0 / np.sqrt(paths.num_paths))


def test_paths_are_attenuated_and_told(world) -> None:
    state = world.with_weather(Weather(rain_rate=25.0)).at(0.0)
    pose = Pose([0.0, 0.0, 200.0])  # above the scene: nothing hides
    far = point_targets([[100.0, 0.0, 200.0]], [[0.0, 0.0, 0.0]], 1.0, RADAR, pose)
    wet = through_weather(far, state, RADAR, None)
    reported = wet.diagnostics["weather"]["attenuation_db_per_km"]
    loss = -20.0 * np.log10(np.abs(wet.a[0, 0, 0] / far.a[0, 0, 0]))
    assert loss == pytest.approx(0.2 * reported["V"], rel=1e-9)
    assert reported["V"] == pytest.approx(10.99, abs=0.1)  # P.838-3 at 77 GHz
    assert through_weather(far, world.at(0.0), RADAR, None) is far


def test_rain_fills_the_sphere_evenly() -> None:
    """An isotropic antenna.

    The echo of a band of elevation is its part of the sphere, and the sum is the radar equation's integral.
    """
    radar = RADAR.with_(pattern=IsotropicPattern())
    assert two_way_gain_integral(radar.array) == pytest.approx(4.0 * np.pi, rel=1e-4)  # 1 deg cells
    paths = volume_clutter(HEAVY, radar, Pose(), np.random.default_rng(3), sampling=VolumeSampling(40.0, 40_000))
    power = received_power(paths, radar)
    exact = float(mean_clutter_power(radar, ETA, DEFAULT_WEATHER_ECHOES.nearest, 40.0))
    # Exponential powers of unequal means: the sum's variance is that of the squares, which are twice the squared means.
    error = np.sqrt(np.sum(power**2) / 2.0)
    assert error < 0.02 * exact
    assert abs(power.sum() - exact) < 5.0 * error
    sine = np.abs(paths.tx_point[:, 2]) / np.linalg.norm(paths.tx_point, axis=1)
    # Half of the sphere is below 30 deg, and half of the power; a third of it would be without the cosine of the solid
    # angle
    assert power[sine < 0.5].sum() / power.sum() == pytest.approx(0.5, abs=5.0 * error / exact)
    assert power[paths.tx_point[:, 0] < 0.0].sum() / power.sum() == pytest.approx(0.5, abs=5.0 * error / exact)
