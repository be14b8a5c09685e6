"""Scanning coherent lidar: raster, return equations, receiver effects and 2D maps."""

from __future__ import annotations

from .maps import LidarMaps, camera_maps, range_view
from .pattern import shot_directions, shot_times
from .receiver import receive
from .scan import radial_velocity, return_intensity
from .sensor import Lidar

__all__ = [
    "Lidar",
    "LidarMaps",
    "camera_maps",
    "radial_velocity",
    "range_view",
    "receive",
    "return_intensity",
    "shot_directions",
    "shot_times",
]
