"""Scanning coherent lidar: scan and motion, returns through glass and at edges, receivers, weather, 2D maps."""

from __future__ import annotations

from .beam import beam_radius
from .detections import Detections
from .heterodyne import (
    detection_probability,
    estimate_beats,
    frequency_deviation,
    mean_cnr,
    noise_factor,
    range_deviation,
    receive_heterodyne,
    received_power,
    synthesize_beats,
    threshold,
    unambiguous_distance,
    velocity_deviation,
)
from .maps import LidarMaps, camera_maps, range_view
from .motion import deskew
from .pattern import shot_directions, shot_times
from .receiver import receive
from .scan import pane_transmittance, radial_velocity, return_intensity
from .sensor import Lidar

__all__ = [
    "Detections",
    "Lidar",
    "LidarMaps",
    "beam_radius",
    "camera_maps",
    "deskew",
    "detection_probability",
    "estimate_beats",
    "frequency_deviation",
    "mean_cnr",
    "noise_factor",
    "pane_transmittance",
    "radial_velocity",
    "range_deviation",
    "range_view",
    "receive",
    "receive_heterodyne",
    "received_power",
    "return_intensity",
    "shot_directions",
    "shot_times",
    "synthesize_beats",
    "threshold",
    "unambiguous_distance",
    "velocity_deviation",
]
