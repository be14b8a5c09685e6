"""Radar points of a stored frame: detections of its cube, with the vehicle's own motion taken out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.results import Frame, RadarFrame
from scarl_sionna.signal.angle import directions, range_doppler_angle
from scarl_sionna.signal.detection import RadarPoints, detect
from scarl_sionna.signal.processing import virtual_cube

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SensedPoints:
    """Detections of one radar frame.

    Attributes
    ----------
    points : RadarPoints
    direction : ndarray of float64, shape (num_points, 3)
        Unit vectors towards the points, radar frame.
    compensated_velocity : ndarray of float64, shape (num_points,)
        Radial velocity over ground: the sensor's own motion taken out, positive when opening [m/s].
    """

    points: RadarPoints
    direction: Array
    compensated_velocity: Array


def radar_points(radar: RadarFrame, pfa: float = 1e-6) -> RadarPoints:
    """Return the detections of a radar frame; a map smaller than the detector's window gets a smaller window."""
    rda = range_doppler_angle(virtual_cube(radar.adc, radar.spec), radar.spec)
    return detect(rda, radar.spec, pfa=pfa)


def sensor_velocity(frame: Frame, world_from_sensor: Pose) -> Array:
    """Return a sensor's velocity over ground in its own axes [m/s], shape (3,)."""
    lever = world_from_sensor.position - frame.world_from_vehicle.position
    twist: Twist = frame.vehicle_twist
    return world_from_sensor.inverse().rotate(twist.velocity_at(lever))


def velocity_over_ground(points: RadarPoints, velocity: Array) -> Array:
    """Return radial velocities with the radar's own motion taken out, shape (num_points,) [m/s].

    Folded about 0 to the interval that each point's velocity is known modulo: what stands still is near 0 also where
    the vehicle is faster than that interval. By definition of `RadarPoints.velocity_interval`.

    Parameters
    ----------
    points : RadarPoints
        Those without `velocity_interval` stay unfolded.
    velocity : ndarray of float64, shape (3,)
        The radar's own, in its axes [m/s].
    """
    over_ground = points.radial_velocity + _direction(points) @ velocity
    if points.velocity_interval is not None:
        over_ground -= points.velocity_interval * np.rint(over_ground / points.velocity_interval)
    return np.asarray(over_ground)


def _direction(points: RadarPoints) -> Array:
    """Return unit vectors towards points, shape (num_points, 3); those at range 0 have a direction, too."""
    return directions(points.azimuth, points.elevation)


def sensed_points(frame: Frame, radar: RadarFrame, pfa: float = 1e-6) -> SensedPoints:
    """Return the detections of a radar of a frame, with velocities by :func:`velocity_over_ground`."""
    points = radar_points(radar, pfa)
    over_ground = velocity_over_ground(points, sensor_velocity(frame, radar.world_from_sensor))
    return SensedPoints(points, _direction(points), over_ground)
