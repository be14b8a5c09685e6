"""Lidars by name: what of their published figures was fitted, and what was held out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from camera_lidar.lidar import mean_cnr, range_deviation, velocity_deviation
from camera_lidar.lidar.heterodyne import detection_probability as heterodyne_detection
from camera_lidar.lidar.heterodyne import threshold
from camera_lidar.lidar.pulsed import (
    background_rate,
    detection_probability,
    filtered,
    noise_density,
    noise_deviation,
)
from camera_lidar.lidar.pulsed import range_deviation as pulsed_deviation
from scarl_sionna.core.specs.lidar.pattern import SpinningScan
from scarl_sionna.core.specs.lidar.presets import HDL32E_CYCLE
from scarl_sionna.core.specs.lidar.receiver import PulsedReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec


def reach(name: str, reflectance: float, probability: float = 0.9) -> float:
    """Return the distance at which a diffuser is detected with a probability [m]."""
    spec = LidarSpec.preset(name)

    def excess(distance: float) -> float:
        return float(detection_probability(spec, reflectance, distance)) - probability

    return float(brentq(excess, 2.0, 2000.0))


def deviation_at(name: str, ratio: float, reflectance: float, distance: float) -> float:
    """Return the standard deviation of the distance at a ratio of peak to noise [m]."""
    spec = LidarSpec.preset(name)
    assert isinstance(spec.receiver, PulsedReceiver)
    density = noise_density(spec, background_rate(spec, reflectance, distance))
    electrons = np.array([ratio * float(noise_deviation(spec, density))])
    peaks = filtered(spec, electrons, np.array([spec.receiver.pulse_deviation]), np.array([float(density)]))
    return float(pulsed_deviation(spec, peaks)[0])


@pytest.mark.parametrize(
    ("name", "reflectance", "published"), [("hdl32e", 0.8, 100.0), ("os1_64", 0.1, 40.0), ("rs_lidar_m1", 0.1, 150.0)]
)
def test_the_range_that_the_pulse_energy_was_fitted_to(name: str, reflectance: float, published: float) -> None:
    assert reach(name, reflectance) == pytest.approx(published, rel=0.01)


def test_what_was_held_out_of_the_os1() -> None:
    assert reach("os1_64", 0.8) == pytest.approx(120.0, rel=0.12)
    assert deviation_at("os1_64", 12.0, 0.1, 40.0) == pytest.approx(0.10, rel=0.05)  # the pulse width was fitted to it
    assert deviation_at("os1_64", 100.0, 0.1, 40.0) == pytest.approx(0.03, rel=0.3)
    assert deviation_at("os1_64", 250.0, 0.1, 40.0) == pytest.approx(0.015, rel=0.3)


def test_published_accuracy_of_the_others() -> None:
    assert deviation_at("hdl32e", 100.0, 0.8, 30.0) < 0.025  # +-2 cm
    assert deviation_at("rs_lidar_m1", 30.0, 0.1, 50.0) == pytest.approx(0.05, rel=0.3)


def test_scans_have_the_published_rates() -> None:
    hdl32e = LidarSpec.preset("hdl32e").scan
    assert isinstance(hdl32e, SpinningScan)
    assert hdl32e.num_azimuth == int(1.0 / (hdl32e.rotation_rate * HDL32E_CYCLE))
    assert hdl32e.num_shots * hdl32e.rotation_rate == pytest.approx(32.0 / HDL32E_CYCLE, rel=1e-3)  # 694,444 a second
    assert min(hdl32e.elevation_deg) == -30.67 and max(hdl32e.elevation_deg) == 10.67
    os1 = LidarSpec.preset("os1_64").scan
    assert os1.num_shots * 10 == 655_360
    m1 = LidarSpec.preset("rs_lidar_m1")
    assert m1.num_shots == 78_750
    assert m1.view_deg == pytest.approx((60.0, -60.0, -12.5, 12.5))


def test_an_fmcw_lidar_of_published_precision() -> None:
    """2 cm and 3 cm/s hold down to the threshold; a 10 % diffuser is seen in half of the shots at 188 m and more."""
    spec = LidarSpec.preset("aeries_2")
    level = threshold(spec)
    assert range_deviation(spec, level) < 0.02 and velocity_deviation(spec, level) < 0.03
    distance = np.arange(50.0, 400.0, 1.0)
    intensity = 0.1 * np.exp(-2.0 * spec.extinction * distance) / distance**2
    seen = heterodyne_detection(mean_cnr(spec, intensity, distance), level)
    assert distance[seen > 0.5].max() > 150.0


@pytest.mark.parametrize("name", ["hdl32e", "os1_64", "rs_lidar_m1"])
def test_pulses_are_below_the_limit_of_class_1(name: str) -> None:
    """IEC 60825-1: 77 nJ times 10^(0.002 (wavelength - 700 nm)) for one pulse of a point source."""
    spec = LidarSpec.preset(name)
    assert isinstance(spec.receiver, PulsedReceiver)
    assert spec.receiver.pulse_energy < 77e-9 * 10.0 ** (0.002 * (spec.wavelength * 1e9 - 700.0))
