"""Radar: from propagation paths to raw data, maps and points. Nothing in the signal chain imports the engine."""

from __future__ import annotations

from .adc import quantize
from .angle import RangeDopplerAngle, range_doppler_angle
from .detection import RadarPoints, detect
from .labels import CellLabels, PathLabels, PointLabels, label_cells, label_paths, label_points
from .noise import add_noise
from .paths import RadarPaths
from .points import point_targets
from .processing import RangeDoppler, range_doppler, virtual_cube
from .synthesis import synthesize
from .weather import attenuate_paths

__all__ = [
    "CellLabels",
    "PathLabels",
    "PointLabels",
    "RadarPaths",
    "RadarPoints",
    "RangeDoppler",
    "RangeDopplerAngle",
    "add_noise",
    "attenuate_paths",
    "detect",
    "label_cells",
    "label_paths",
    "label_points",
    "point_targets",
    "quantize",
    "range_doppler",
    "range_doppler_angle",
    "synthesize",
    "virtual_cube",
]
