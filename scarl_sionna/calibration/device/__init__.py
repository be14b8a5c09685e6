"""The twin of a device: a radar's specification from captures of corner reflectors. See docs/device_twin.md."""

from __future__ import annotations

from .capture import ReflectorCapture
from .fit import fit_device
from .point_map import PointMap
from .point_spread import PointSpreadFit, fit_point_spread
from .result import CaptureResidual, DeviceFit
from .settings import DeviceFitSettings

__all__ = [
    "CaptureResidual",
    "DeviceFit",
    "DeviceFitSettings",
    "PointMap",
    "PointSpreadFit",
    "ReflectorCapture",
    "fit_device",
    "fit_point_spread",
]
