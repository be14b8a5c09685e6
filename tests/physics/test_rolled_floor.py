"""A rolled radar hears a ball over asphalt as one that stands upright: the floor drops nothing that it would hear."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import scarl_sionna as ss
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from tests.scenes import Material, Thing, ball, plane, write_scene


def field_of_ball(state: ss.WorldState, radar: ss.RadarSpec, roll_deg: float) -> np.ndarray:
    """Return the sum of the matrices of the ways by the ball with their phases, (2, 2)."""
    pose = ss.Pose.from_euler([0.0, 0.0, 0.2], roll=np.radians(roll_deg))
    paths = ss.solve_paths(state, radar, pose, "auto", max_distance=25.0, channel_tolerance_db=3.0)
    number = next(n for n, one in state.world.instances.items() if one.name == "ball")
    paths = paths.select((paths.instance == number).any(axis=1))
    return np.einsum("n,nij->ij", np.exp(-2j * np.pi / radar.wavelength * paths.length), paths.a)


def test_a_rolled_radar_hears_ground_bounces_as_an_upright_one(tmp_path: Path) -> None:
    """At 45 deg the ways by the asphalt come back in a polarisation that a perfect mirror would make the crossed one.

    The ball is dead ahead: what the rolled radar hears is the mean of both polarisations of the upright one.
    """
    things = [
        Thing("ground", plane(40, 10, (15, 0, 0)), "Roads", "asphalt_here"),
        Thing("ball", ball(0.15, (14.0, 0.0, 0.8), 5), "Static", "steel", is_object=True),
    ]
    place = write_scene(tmp_path, things, materials={"asphalt_here": Material(radio="asphalt")})
    state = ss.load_scene(place).at(0.0)
    array = ss.AntennaArray(tx_positions=[(0, 0, 0)], rx_positions=[(0, 0, 0)], pattern=IsotropicPattern())
    radar = ss.RadarSpec(array=array, azimuth_fov_deg=170, elevation_fov_deg=120).with_(bandwidth=150e6)
    upright, rolled = (field_of_ball(state, radar, roll) for roll in (0.0, 45.0))
    expected = (upright[0, 0] + upright[1, 1]) / 2.0
    assert abs(rolled[0, 0] - expected) < 0.04 * abs(expected)
    assert abs(rolled[1, 1] - expected) < 0.04 * abs(expected)
