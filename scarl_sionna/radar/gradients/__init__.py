"""Derivatives of the raw data of linear FMCW, forward and reverse. See docs/gradients.md."""

from __future__ import annotations

from .bodies import Body, BodyMotion
from .columns import Columns
from .frameworks import tensorflow_function, torch_function
from .operator import BeatOperator
from .path_model import PathModel, PathParameters
from .point_model import PointModel, PointParameters

__all__ = [
    "BeatOperator",
    "Body",
    "BodyMotion",
    "Columns",
    "PathModel",
    "PathParameters",
    "PointModel",
    "PointParameters",
    "tensorflow_function",
    "torch_function",
]
