"""Sunlight on what a pulsed lidar sees follows the lighting of the world."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from camera_lidar.lidar import Lidar
from camera_lidar.lidar.photons import sun_irradiance
from scarl_sionna.engine.light.sky import daylight_share

SPEC = ss.LidarSpec.preset("hdl32e")


@pytest.fixture(scope="module")
def world() -> ss.World:
    return ss.load_scene("highway_guardrail", detail="light")


def scan(world: ss.World, **receiver: object) -> ss.LidarScan:
    spec = SPEC.with_(receiver=SPEC.receiver.with_(**receiver))
    found = Lidar(spec).observe(world.at(0.0), ss.Pose([0.0, 0.0, 2.0]), np.random.default_rng(0))
    assert found.spec == spec
    return found


def same(one: ss.LidarScan, other: ss.LidarScan) -> bool:
    return np.array_equal(one.distance, other.distance)


def test_share_of_daylight() -> None:
    """All but the air's part under a clear high sun, a tenth under clouds, less as the sun sets, none at night."""
    zenith = ss.Lighting(sun_elevation_deg=90.0)
    assert daylight_share(zenith) == pytest.approx(np.exp(-0.21) + 16.3 / 127.5, rel=1e-3)
    assert daylight_share(zenith.with_(cloud_cover=1.0)) == pytest.approx(21.3 / 127.5, rel=1e-3)
    height = np.linspace(-18.0, 90.0, 217)
    share = [daylight_share(ss.Lighting(sun_elevation_deg=float(one))) for one in height]
    assert np.all(np.diff(share) >= 0.0) and share[0] == 0.0
    assert daylight_share(ss.Lighting.preset("night")) == 0.0
    assert 0.0 < daylight_share(ss.Lighting.preset("dusk")) < 0.1 < daylight_share(ss.Lighting.preset("day")) < 0.7


def test_scans_follow_the_lighting(world: ss.World) -> None:
    night = scan(world.with_lighting("night"))
    assert same(night, scan(world, solar_irradiance=0.0)) and not same(night, scan(world.with_lighting("day")))
    numbers = [scan(world.with_lighting(name)).num_points for name in ("day", "dusk", "night")]
    assert numbers[0] < numbers[1] < numbers[2]
    share = daylight_share(ss.Lighting.preset("dusk")) * sun_irradiance(SPEC.wavelength)
    assert same(scan(world.with_lighting("dusk")), scan(world, solar_irradiance=share))


def test_what_the_receiver_states_holds_in_any_light(world: ss.World) -> None:
    assert same(scan(world, solar_irradiance=0.5), scan(world.with_lighting("night"), solar_irradiance=0.5))
    full = sun_irradiance(SPEC.wavelength)
    assert same(scan(world.with_lighting(None)), scan(world, solar_irradiance=full))


def test_there_is_no_sun_indoors() -> None:
    garage = ss.load_scene("parking_garage", detail="light")
    assert garage.is_indoors and same(scan(garage), scan(garage, solar_irradiance=0.0))
