"""Spherical wavefronts over large arrays against closed forms, through point_targets and synthesize."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from tests.oracles import fmcw

HALF_WAVE = fmcw.C / 77e9 / 2.0


def narrow_band(tx, rx):
    """A radar with a ramp of 1 kHz: the phase of a sample is k times the length."""
    return RadarSpec(
        bandwidth=1e3, num_samples=2, num_chirps=2, tx_positions=tx, rx_positions=rx, pattern=IsotropicPattern()
    )


@pytest.mark.parametrize(("distance", "azimuth_deg", "first", "last"), fmcw.ULA192_PHASES)
def test_line_of_192_elements(distance, azimuth_deg, first, last):
    line = tuple((0.0, (index - 95.5) * HALF_WAVE, 0.0) for index in range(192))
    radar = narrow_band(((0.0, 0.0, 0.0),), (*line, (0.0, 0.0, 0.0)))
    azimuth = np.radians(azimuth_deg)
    position = distance * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    world_from_radar = Pose.from_euler([3.0, -2.0, 1.0], yaw=0.7, pitch=0.1)  # the answer must not depend on it
    paths = point_targets([world_from_radar.apply(position)], [[0.0, 0.0, 0.0]], 1.0, radar, world_from_radar)
    sample = synthesize(paths, radar)[:, 0, 0].astype(np.complex128)
    measured = np.angle(sample[[0, 191]] * np.conj(sample[192]))
    # the vector's one-way phase is -k (r - R); the beat signal carries the opposite
    difference = np.angle(np.exp(1j * (measured + np.array([first, last]))))
    assert np.abs(difference).max() < 1e-3  # vector's tolerance; NUFFT 1e-4, complex64 1e-7


def test_lengths_and_phases_of_3_by_4_pairs():
    radar = narrow_band(tuple((0.0, y, 0.0) for y in fmcw.MIMO_TX_Y), tuple((0.0, y, 0.0) for y in fmcw.MIMO_RX_Y))
    azimuth = np.radians(25.0)
    paths = point_targets([[1.5 * np.cos(azimuth), 1.5 * np.sin(azimuth), 0.0]], [[0.0] * 3], 1.0, radar, Pose())
    geometry = PathGeometry.of(paths, radar)
    lengths = np.array([[geometry.length(tx, rx)[0] for rx in range(4)] for tx in range(3)])
    assert np.abs(lengths - fmcw.MIMO_LENGTHS).max() < 1e-7
    first_chirps = synthesize(paths, radar)[:, :3, 0].T  # rows m * num_tx + i: chirp 0 of each transmitter
    error = np.angle(first_chirps * np.exp(1j * fmcw.MIMO_PHASES))  # the beat carries +k L
    assert np.abs(error).max() < 2e-3  # vector's tolerance


def test_mirror_path_has_the_wavefront_of_the_image():
    # a wall at x = 5 m: the path's length is the distance to the receiver's image, not twice the way to the hit point
    line = tuple((0.0, y, 0.0) for y in (-0.05, 0.0, 0.05))
    radar = narrow_band(line, line)
    paths = point_targets([[5.0, 0.0, 0.0]], [[0.0] * 3], 1.0, radar, Pose())
    image = np.array([[[-1.0, 0.0, 0.0, 10.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]])
    mirror = dataclasses.replace(paths, rx_image=image)
    sample = synthesize(mirror, radar)[:, :3, 0].T
    length = np.array([[np.hypot(10.0, tx[1] - rx[1]) for rx in line] for tx in line])
    expected = np.exp(2j * np.pi * 77e9 / fmcw.C * length)
    # narrow band: what the slope adds is 2 pi (1e3 / 3e-5) (6.7e-8)^2 < 1e-6 rad
    assert np.abs(np.angle(sample * np.conj(expected))).max() < 1e-4
    power = np.abs(sample) ** 2
    assert power[0, 2] / power[1, 1] == pytest.approx(100.0 / (100.0 + 0.01), rel=1e-4)  # 1 / length^2


def test_amplitude_of_each_pair_near_the_array():
    radar = narrow_band(((0.0, -0.4, 0.0),), ((0.0, 0.4, 0.0),))
    paths = point_targets([[0.5, 0.2, 0.0]], [[0.0] * 3], 1.0, radar, Pose())
    near, far = np.hypot(0.5, 0.2), np.hypot(0.5, 0.6)
    power = 10 ** (radar.tx_power_dbm / 10 - 3) * radar.wavelength**2 / (4 * np.pi) ** 3 / (near * far) ** 2
    assert np.abs(synthesize(paths, radar)[0, 0, 0]) ** 2 == pytest.approx(power, rel=1e-4)
