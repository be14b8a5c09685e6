"""Weather for the lidar and the camera: whose air counts, spray, streaks; and the specification itself."""

from __future__ import annotations

import numpy as np
import pytest

from camera_lidar.camera.falling import add_falling
from camera_lidar.lidar import Lidar
from camera_lidar.lidar.spray import extinction_of
from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.atmosphere import Atmosphere, snow_extinction
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.receiver import HeterodyneReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.specs.weather import WEATHER_PRESETS, Spray, Weather, fog_water_of, visibility_of
from scarl_sionna.engine.spray import spray_clouds
from tests.weather_street import street

HETERODYNE = LidarSpec(receiver=HeterodyneReceiver(), num_azimuth=80, num_elevation=30, max_returns=2)


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    return street(tmp_path_factory.mktemp("street"))


def scan(world, weather, spec=HETERODYNE, time=1.0, x=2.4):
    state = world.with_weather(weather).at(time)
    pose = state.actor_pose("ego").compose(Pose([x, 0.0, 1.2]))
    return Lidar(spec).observe(state, pose, np.random.default_rng(3))


def test_presets_and_errors() -> None:
    assert Weather.preset("clear") == Weather()
    assert Weather().is_clear
    assert not any(Weather.preset(name).is_clear for name in WEATHER_PRESETS if name != "clear")
    with pytest.raises(UnknownNameError, match="heavy_rain"):
        Weather.preset("heavyrain")
    for bad in (
        {"rain_rate": -1.0},
        {"visibility": 100.0, "fog_water": 0.1},
        {"snow_rate": 1.0, "temperature_celsius": 20.0},
        {"rain_rate": 5.0, "temperature_celsius": -10.0},
        {"wind": (100.0, 0.0)},
    ):
        with pytest.raises(ParameterRangeError):
            Weather(**bad)


def test_fog_by_visibility_and_by_water_is_one_law() -> None:
    for visibility in (50.0, 200.0, 1000.0):
        assert visibility_of(fog_water_of(visibility)) == pytest.approx(visibility)
    assert Weather(fog_water=fog_water_of(200.0)).atmosphere.visibility == pytest.approx(200.0)


def test_snow_at_1550_nm_is_p1814s() -> None:
    """5.58 dB/km at 1 mm/h of dry snow, 3.94 of wet snow; the rate's power is 1.38 and 0.72."""
    db_per_km = np.log(10.0) / 1e4
    assert snow_extinction(1.0, 1550e-9, "dry") / db_per_km == pytest.approx(5.5799, abs=1e-3)
    assert snow_extinction(1.0, 1550e-9, "wet") / db_per_km == pytest.approx(3.9441, abs=1e-3)
    assert snow_extinction(4.0, 1550e-9) / snow_extinction(1.0, 1550e-9) == pytest.approx(4.0**1.38)
    with pytest.raises(ParameterRangeError):
        snow_extinction(-1.0, 1550e-9)


def test_clear_weather_changes_no_byte_of_a_scan(world) -> None:
    state = world.at(1.0)
    pose = state.actor_pose("ego").compose(Pose([2.4, 0.0, 1.2]))
    own = Lidar(HETERODYNE).observe(state, pose, np.random.default_rng(3))
    clear = scan(world, "clear")
    assert own.position.tobytes() == clear.position.tobytes()
    assert own.intensity.tobytes() == clear.intensity.tobytes()


def test_a_lidar_ratio_alone_leaves_the_worlds_air(world) -> None:
    """It says how air scatters, not that there is any: the world's fog stays, and takes the ratio."""
    ratio = HETERODYNE.with_(atmosphere=Atmosphere(lidar_ratio=18.0))
    stated = HETERODYNE.with_(atmosphere=Atmosphere(visibility=60.0, lidar_ratio=18.0))
    foggy, same = scan(world, Weather(visibility=60.0), ratio), scan(world, "clear", stated)
    assert foggy.intensity.tolist() == same.intensity.tolist()
    assert foggy.distance.tolist() == same.distance.tolist()
    assert Atmosphere(lidar_ratio=18.0, snow="wet").is_clear and not Atmosphere(snow_rate=1.0).is_clear


def test_air_of_the_spec_wins_over_the_worlds(world) -> None:
    """A spec with air of its own sees the same with and without the world's fog; one without sees the world's."""
    hazy = HETERODYNE.with_(atmosphere=Atmosphere(visibility=5000.0))
    assert scan(world, "dense_fog", hazy).position.tobytes() == scan(world, "clear", hazy).position.tobytes()
    fog = scan(world, Weather(visibility=50.0))
    assert fog.spec == HETERODYNE
    same = scan(world, "clear", HETERODYNE.with_(atmosphere=Atmosphere(visibility=50.0)))
    assert fog.position.tobytes() == same.position.tobytes()
    assert (fog.instance == 0).mean() > 0.3  # returns of the fog itself


def test_spray_behind_a_car_is_seen_and_dims(world) -> None:
    """From behind the car ahead: returns without a surface within the cloud, and fewer and weaker ones of the car."""
    wet = Weather(wetness=1.0)
    thick = Weather(wetness=1.0, spray=Spray(airborne_share=0.2))
    state = world.with_weather(thick).at(1.0)
    cloud = next(item for item in spray_clouds(state) if item.actor == "car_ahead")
    ahead = state.world.actor("car_ahead").instance
    assert 0.1 < extinction_of(cloud) < 0.4
    without, within = scan(world, wet), scan(world, thick)
    strength = [float(item.intensity[item.instance == ahead].sum()) for item in (without, within)]
    assert 0.0 < strength[1] < 0.7 * strength[0]
    free = within.instance == 0
    assert free.sum() > (without.instance == 0).sum() + 20
    pose = state.actor_pose("ego").compose(Pose([2.4, 0.0, 1.2]))
    inside = np.zeros(int(free.sum()), dtype=bool)
    for item in spray_clouds(state):
        place = item.world_from_cloud.inverse().apply(pose.apply(within.position[free].astype(float)))
        lower, upper = (
            np.array([-item.length, -item.width / 2, 0.0]) - 0.2,
            np.array([0.0, item.width / 2, item.height]) + 0.2,
        )
        inside |= np.all((place > lower) & (place < upper), axis=1)
    assert inside.mean() > 0.9


def test_optical_depth_of_spray_is_the_integral(world) -> None:
    state = world.with_weather(Weather(wetness=1.0, spray=Spray())).at(1.0)
    cloud = next(item for item in spray_clouds(state) if item.actor == "car_ahead")
    start = cloud.world_from_cloud.apply(np.array([[-cloud.length - 5.0, 0.2, 0.5]]))
    direction = cloud.world_from_cloud.rotate(np.array([[0.99, 0.02, 0.03]]))
    direction /= np.linalg.norm(direction)
    enter, leave = cloud.chord(start, direction, np.array([np.inf]))
    place = np.linspace(enter[0], leave[0], 20001)
    x = cloud.world_from_cloud.inverse().apply(start + place[:, None] * direction)[:, 0]
    mean = np.trapezoid(np.exp(x / cloud.decay_length), place) / (leave[0] - enter[0])
    assert cloud.mean_density(start, direction, enter, leave)[0] == pytest.approx(mean, rel=1e-6)
    missed = cloud.chord(start, -direction, np.array([np.inf]))
    assert missed[0] == missed[1]


def test_streaks_are_there_in_rain_and_only_then(world) -> None:
    spec = CameraSpec(width=160, height=90, images=("rgb",))
    dark = np.zeros((90, 160, 3), dtype=np.float32)
    lit = world.with_lighting("day")
    clear, snow = (lit.with_weather(name).at(1.0) for name in ("clear", "snow"))
    pose = clear.actor_pose("ego").compose(Pose([1.2, 0.0, 1.5]))

    def streaks(state, seed, twist=None):
        return add_falling(dark, state, spec, pose, twist or Twist(), np.random.default_rng(seed))

    assert streaks(clear, 0) is dark
    first = streaks(snow, 0)
    assert first.max() > 0.01 * float(np.max(snow.airlight))
    assert first.max() <= float(np.max(snow.airlight)) * (1 + 1e-6)
    assert np.array_equal(first, streaks(snow, 0))
    assert not np.array_equal(first, streaks(snow, 1))
    fast = streaks(snow, 0, Twist([25.0, 0.0, 0.0], np.zeros(3)))
    assert (fast > 0).sum() > 1.2 * (first > 0).sum() or fast.max() < first.max()  # longer streaks, fainter
