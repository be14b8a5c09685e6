"""Scanning coherent lidar: raster, return equations, receiver effects and 2D maps."""

from __future__ import annotations

from .maps import LidarMaps, camera_maps, range_view
from .receiver import receive
from .scan import radial_velocity, raster_angles, return_intensity, shot_directions
from .sensor import Lidar

__all__ = [
    "Lidar",
    "LidarMaps",
    "camera_maps",
    "radial_velocity",
    "range_view",
    "raster_angles",
    "receive",
    "return_intensity",
    "shot_directions",
]
