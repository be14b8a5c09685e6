"""Calibration of radio materials against measurements, with uncertainty. See docs/calibration.md."""

from __future__ import annotations

from .errors import CalibrationError, ConvergenceError, UnusedParameterError
from .estimate import CalibrationResult, calibrate
from .forward import ForwardModel
from .material_file import calibrated_materials, save_materials
from .report import write_report
from .spec import (
    CalibrationProblem,
    FreeParameter,
    Lobe,
    LobedTarget,
    MeshRcs,
    PointTarget,
    RadarMap,
    RcsPattern,
    ScenePowers,
    SlabMeasurement,
)

__all__ = [
    "CalibrationError",
    "CalibrationProblem",
    "CalibrationResult",
    "ConvergenceError",
    "ForwardModel",
    "FreeParameter",
    "Lobe",
    "LobedTarget",
    "MeshRcs",
    "PointTarget",
    "RadarMap",
    "RcsPattern",
    "ScenePowers",
    "SlabMeasurement",
    "UnusedParameterError",
    "calibrate",
    "calibrated_materials",
    "save_materials",
    "write_report",
]
