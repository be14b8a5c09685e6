"""Directions of one point by arrays of many wavelengths in height: one point, in the true direction."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.units import SPEED_OF_LIGHT

WAVELENGTH = SPEED_OF_LIGHT / 77.3e9
Places = list[tuple[float, float, float]]


def scattered(seed: int) -> tuple[Places, Places]:
    """4 transmitters within 12 wavelengths, 8 receivers within 6."""
    rng = np.random.default_rng(seed)
    tx, rx = (rng.uniform(-size, size, (count, 2)) * WAVELENGTH for size, count in ((6.0, 4), (3.0, 8)))
    return [(0.0, *map(float, place)) for place in tx], [(0.0, *map(float, place)) for place in rx]


def cross() -> tuple[Places, Places]:
    """16 elements across, 40 up, by two transmitters."""
    half = WAVELENGTH / 2.0
    arms = [(0.0, half * number, 0.0) for number in range(16)] + [(0.0, 0.0, half * number) for number in range(1, 20)]
    return [(0.0, 0.0, 0.0), (0.0, 0.0, 20.0 * half)], arms


def upright(elements: int) -> tuple[Places, Places]:
    """One line up."""
    place = (np.arange(elements) - (elements - 1) / 2.0) * WAVELENGTH / 2.0
    return [(0.0, 0.0, 0.0)], [(0.0, 0.0, float(height)) for height in place]


ARRAYS = {"scattered": scattered(5), "scattered, other": scattered(8), "cross": cross(), "64 upright": upright(64)}


def points_of(array: str, elevation: float, view_deg: float, **options: int) -> tuple[ss.RadarPoints, float]:
    """Return the points of 3 m2 at 13.4 m, and the azimuth where they should be [rad]."""
    tx, rx = ARRAYS[array]
    azimuth = 0.0 if "upright" in array else 0.2
    radar = ss.RadarSpec(
        waveform=ss.Fmcw(num_chirps=16, num_samples=64, bandwidth=300e6, start_frequency=77.15e9),
        array=ss.AntennaArray(tx_positions=tx, rx_positions=rx, pattern=IsotropicPattern()),
        elevation_fov_deg=view_deg,
    )
    cosine = np.cos(elevation)
    way = np.array([cosine * np.cos(azimuth), cosine * np.sin(azimuth), np.sin(elevation)])
    paths = ss.point_targets([13.4 * way], [0.5 * way], [3.0], radar, ss.Pose())
    adc = ss.synthesize(paths, radar, rng=np.random.default_rng(1))
    rda = ss.range_doppler_angle(ss.virtual_cube(adc, radar), radar, **options)
    return ss.detect(rda, pfa=1e-6), azimuth


def check(points: ss.RadarPoints, azimuth: float, elevation: float) -> None:
    """The strongest is the target, and what else there is are sidelobes of the beam 15 dB below it."""
    assert points.azimuth[0] == pytest.approx(azimuth, abs=np.radians(0.5))
    assert points.elevation[0] == pytest.approx(elevation, abs=np.radians(0.4))
    assert points.rcs[0] == pytest.approx(3.0, rel=0.15)
    assert np.all(points.snr_db[1:] < points.snr_db[0] - 15.0)


@pytest.mark.parametrize("elevation", [-0.17, 0.05, 0.11, 0.2])
@pytest.mark.parametrize("array", ARRAYS)
def test_arrays_of_large_height_find_the_direction(array: str, elevation: float) -> None:
    points, azimuth = points_of(array, elevation, 30.0)
    check(points, azimuth, elevation)


@pytest.mark.parametrize("array", ["scattered", "cross"])
def test_so_do_they_over_a_high_view(array: str) -> None:
    points, azimuth = points_of(array, 0.3, 100.0)
    check(points, azimuth, 0.3)


def test_the_direction_does_not_hang_on_the_directions_of_the_map() -> None:
    points, azimuth = points_of("scattered", 0.05, 30.0, num_azimuth=16, num_elevation=5)
    check(points, azimuth, 0.05)
