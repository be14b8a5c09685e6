"""When the rows of an image are seen: all at once, one after the other, and over how long."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.engine.world import WorldState

from .motion import shifted_sensor, shifted_state


@dataclass(frozen=True, eq=False)
class Band:
    """Rows of an image that are read at one instant.

    Attributes
    ----------
    rows : slice
        Of the whole image.
    spec : CameraSpec
        A camera that sees these rows alone, by the same rays, with a global shutter.
    state : WorldState
        At the instant of the rows.
    pose : Pose
        World from sensor at it.
    """

    rows: slice
    spec: CameraSpec
    state: WorldState
    pose: Pose


def bands(state: WorldState, spec: CameraSpec, world_from_sensor: Pose, sensor_twist: Twist) -> Iterator[Band]:
    """Yield the bands of an image from its top, one at a time; with a global shutter the whole image.

    Parameters
    ----------
    state : WorldState
        At the frame's time.
    spec : CameraSpec
    world_from_sensor : Pose
        Sensor frame (x forward, y left, z up) at the frame's time.
    sensor_twist : Twist

    Notes
    -----
    The middle of row r of h is read :math:`T ((r + 1/2) / h - 1/2)` after the frame's time, T the readout time; a band
    takes the mean of its rows, at most :math:`T / 2n` off with n bands.
    """
    if spec.readout_time == 0.0:
        yield Band(slice(0, spec.height), spec, state, world_from_sensor)
        return
    (fx, _, cu), (_, fy, cv), _ = spec.intrinsics
    borders = np.linspace(0, spec.height, min(spec.num_readout_bands, spec.height) + 1).round().astype(int).tolist()
    for first, stop in pairwise(borders):
        part = spec.with_(
            height=stop - first,
            readout_time=0.0,
            horizontal_fov_deg=None,
            focal_length_px=(float(fx), float(fy)),
            principal_point=(float(cu), float(cv) - first),
        )
        moment = shifted_state(state, spec.readout_time * ((first + stop) / (2.0 * spec.height) - 0.5))
        pose = shifted_sensor(state, moment, world_from_sensor, sensor_twist)
        yield Band(slice(first, stop), part, moment, pose)


def exposure_moments(
    state: WorldState, spec: CameraSpec, world_from_sensor: Pose, sensor_twist: Twist
) -> list[tuple[WorldState, Pose]]:
    """Return the states and sensor poses at the instants of the exposure, evenly about the state's time."""
    if spec.exposure_time == 0.0 or spec.num_shutter_times == 1:
        return [(state, world_from_sensor)]
    offsets = ((np.arange(spec.num_shutter_times) + 0.5) / spec.num_shutter_times - 0.5) * spec.exposure_time
    moments = []
    for offset in offsets.tolist():
        moment = shifted_state(state, offset)
        moments.append((moment, shifted_sensor(state, moment, world_from_sensor, sensor_twist)))
    return moments
