"""Optical sensors: an ideal pinhole camera and a scanning coherent lidar, both seeing the same world as the radar."""

from __future__ import annotations

from .camera import Camera
from .lidar import Lidar

__all__ = ["Camera", "Lidar"]
