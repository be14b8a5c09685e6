"""A closed radar that a known one would be, and maps of points by both."""

from __future__ import annotations

import numpy as np

import scarl_sionna as ss
from scarl_sionna.signal.angle import RangeDopplerAngle

RADAR = ss.RadarSpec().with_(num_samples=128, num_chirps=32)
"""The default radar, fewer samples: cells of 0.5 m and 1.6 m/s, twelve elements in a line."""


def points(distance: object, azimuth_deg: object, velocity: object = 0.0, rcs: object = 1.0) -> ss.RadarPaths:
    """Return the paths of points that move radially."""
    far, angle, speed = np.broadcast_arrays(np.atleast_1d(distance), np.radians(azimuth_deg), velocity)
    unit = np.stack([np.cos(angle), np.sin(angle), np.zeros(far.shape)], axis=-1)
    strength = np.broadcast_to(np.asarray(rcs, dtype=np.float64), far.shape)
    return ss.point_targets(far[:, None] * unit, speed[:, None] * unit, strength, RADAR, ss.Pose())


def processed(
    paths: ss.RadarPaths, window: str = "hann", compensate_motion: bool = False, rng: np.random.Generator | None = None
) -> RangeDopplerAngle:
    """Return the map of the whole chain: raw data, range-Doppler, beams."""
    adc = ss.synthesize(paths, RADAR, rng=rng, method="direct")
    return ss.range_doppler_angle(ss.virtual_cube(adc, RADAR), RADAR, window, compensate_motion=compensate_motion)


def apart_db(one: RangeDopplerAngle, other: RangeDopplerAngle) -> float:
    """Return the largest difference of amplitude over the largest amplitude [dB]."""
    first, second = (np.sqrt(item.data.astype(np.float64)) for item in (one, other))
    return float(20.0 * np.log10(np.abs(first - second).max() / first.max()))
