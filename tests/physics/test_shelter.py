"""No rain or snow below a roof: for drops in a picture, echoes of a radar, the air of a lidar, and in a car park."""

from __future__ import annotations

import numpy as np
import pytest

from camera_lidar.camera.falling import add_falling
from camera_lidar.lidar import Lidar
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.receiver import HeterodyneReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.rays.shelter import is_sheltered, is_under_cover
from scarl_sionna.engine.world import WorldState
from scarl_sionna.radar.link import received_power
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.weather.attenuation import weather_attenuation
from scarl_sionna.radar.weather.clutter import VolumeSampling, through_weather, volume_clutter
from tests.scenes import Thing, box, plane, write_scene

pytestmark = pytest.mark.own_process(shared=True)  # beside what a worker has, too much memory

PLACE = Pose([0.0, 0.0, 1.5])
STORM = Weather(rain_rate=50.0)
RADAR = RadarSpec.preset("awr1843boost").with_(num_chirps=32, num_samples=128)


def street(folder, *things: Thing, weather: Weather = STORM) -> WorldState:
    """Return a road of 200 m with what stands over it, in rain, by day."""
    road = Thing("road", plane(200.0, 200.0), "Roads", is_object=False)
    return load_scene(write_scene(folder, [road, *things])).with_lighting("day").with_weather(weather).at(0.0)


def slab(name: str, size: tuple[float, float], middle: tuple[float, float], semantic: str = "Bridge") -> Thing:
    """Return a slab 5 m over the road."""
    return Thing(name, box((*size, 0.3), (*middle, 5.0)), semantic)


@pytest.fixture(scope="module")
def states(tmp_path_factory) -> dict[str, WorldState]:
    """Return the road free, all of it below a roof, its left half, and below a bridge of 12 m."""
    folder = tmp_path_factory.mktemp("shelter")
    return {
        "free": street(folder / "free"),
        "roof": street(folder / "roof", slab("roof", (200.0, 200.0), (0.0, 0.0))),
        "left": street(folder / "left", slab("roof", (200.0, 100.0), (0.0, 50.001))),
        "bridge": street(folder / "bridge", slab("deck", (12.0, 200.0), (0.0, 0.0))),
        "crown": street(folder / "crown", slab("crown", (200.0, 200.0), (0.0, 0.0), "Vegetation")),
    }


def test_places_below_a_surface(states) -> None:
    places = [[0.0, 0.0, 1.0], [0.0, 0.0, 6.0], [7.0, 3.0, 1.0], [-5.0, -3.0, 4.0]]
    assert is_sheltered(states["free"], places).tolist() == [False] * 4
    assert is_sheltered(states["roof"], places).tolist() == [True, False, True, True]
    assert is_sheltered(states["bridge"], places).tolist() == [True, False, False, True]
    assert is_sheltered(states["crown"], places).tolist() == [False] * 4  # leaves let it through
    assert is_sheltered(states["free"], np.zeros((0, 3))).shape == (0,)


def test_a_bridge_is_no_cover_and_a_hall_is(states) -> None:
    found = {name: is_under_cover(state, PLACE.position) for name, state in states.items()}
    assert found == {"free": False, "roof": True, "left": False, "bridge": False, "crown": False}


def test_streaks_of_a_picture(states) -> None:
    spec = CameraSpec(width=160, height=90, images=("rgb",))
    dark = np.zeros((90, 160, 3), dtype=np.float32)

    def streaks(name: str) -> np.ndarray:
        calm = states[name].world.with_weather(STORM.with_(turbulence=0.0)).at(0.0)  # streaks go straight down
        return add_falling(dark, calm, spec, PLACE, Twist(), np.random.default_rng(0))[..., 0]

    free, left = streaks("free"), streaks("left")
    assert not streaks("roof").any()
    assert free[:, :80].any() and free[:, 80:].any()
    assert not left[:, :78].any() and np.array_equal(left[:, 82:], free[:, 82:])  # a drop near the middle is 1 px wide


def test_echoes_of_a_radar(states) -> None:
    """What one antenna pair receives; 3 % is one standard error of the ratio of two means over 12 seeds."""

    def echoes(name: str, seed: int) -> RadarPaths:
        sampling = VolumeSampling(reach=20.0, num_points=20_000)
        return volume_clutter(STORM, RADAR, PLACE, np.random.default_rng(seed), states[name], sampling)

    far, sides = {"free": 0.0, "left": 0.0}, np.zeros(2)
    for name in far:
        for seed in range(12):
            paths = echoes(name, seed)
            assert paths.num_paths > 1000
            power, right = received_power(paths, RADAR), paths.tx_point[:, 1] < 1e-3
            sides += [power[right].sum(), power[~right].sum()] if name == "left" else [0.0, 0.0]
            far[name] += power[right & (np.linalg.norm(paths.tx_point - PLACE.position, axis=1) > 6.0)].sum()
    assert echoes("roof", 1).num_paths == 0
    assert sides[1] < 1e-4 * sides[0]  # over the roof, in cells of directions that pass its edge
    assert far["left"] == pytest.approx(far["free"], rel=0.15)


def test_attenuation_of_a_radar(states) -> None:
    for name, weather in (("free", STORM), ("bridge", STORM), ("roof", STORM.with_(rain_rate=0.0))):
        paths = through_weather(RadarPaths.empty(PLACE), states[name], RADAR, None)
        report = paths.diagnostics["weather"]
        expected = weather_attenuation(weather, RADAR.center_frequency, "V")
        assert report["attenuation_db_per_km"]["V"] == pytest.approx(expected, rel=1e-12)
        assert report["under_cover"] == (name == "roof")


def test_air_of_a_lidar(states) -> None:
    spec = LidarSpec(receiver=HeterodyneReceiver(), num_azimuth=60, num_elevation=20, max_returns=2)

    def mean_cnr(state: WorldState) -> float:
        return float(Lidar(spec).observe(state, PLACE, np.random.default_rng(3)).cnr.mean())

    def loss(name: str) -> float:
        dry = states[name].world.with_weather(Weather(wetness=STORM.surface_wetness)).at(0.0)
        return mean_cnr(states[name]) / mean_cnr(dry)

    assert loss("roof") == 1.0
    assert loss("free") < 0.98 and loss("bridge") < 0.98  # some 10 dB/km


def test_a_car_park_stays_dry_and_as_bright() -> None:
    """The floor keeps its material, the camera its exposure; a wetness that is asked for counts."""
    world = load_scene("parking_garage", detail="light")
    rainy = world.with_weather("heavy_rain")
    assert world.is_indoors and rainy.weather.rain_rate > 0.0
    assert rainy.weather.surface_wetness == 0.0 and rainy.parts.material == world.parts.material
    assert rainy.lighting.exposure == world.lighting.exposure and rainy.lighting.cloud_cover == 1.0
    wet = world.with_weather(Weather(rain_rate=10.0, wetness=1.0))
    assert wet.parts.material != world.parts.material
    outside = load_scene("signalised_crossing", detail="light")
    assert not outside.is_indoors and outside.with_weather("heavy_rain").weather.surface_wetness > 0.0
