"""Derivatives of the raw data of linear FMCW, forward and reverse. See docs/gradients.md."""

from __future__ import annotations

from .columns import Columns
from .operator import BeatOperator
from .path_model import PathModel, PathParameters

__all__ = ["BeatOperator", "Columns", "PathModel", "PathParameters"]
