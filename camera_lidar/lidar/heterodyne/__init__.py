"""The heterodyne receiver: link budget, detection, what fills the air, and its two forms, statistical and raw."""

from __future__ import annotations

from .beat import estimate_beats, synthesize_beats
from .detection import (
    detection_probability,
    frequency_deviation,
    range_deviation,
    threshold,
    unambiguous_distance,
    velocity_deviation,
)
from .link import mean_cnr, noise_factor, received_power
from .statistical import estimate, receive_heterodyne

__all__ = [
    "detection_probability",
    "estimate",
    "estimate_beats",
    "frequency_deviation",
    "mean_cnr",
    "noise_factor",
    "range_deviation",
    "receive_heterodyne",
    "received_power",
    "synthesize_beats",
    "threshold",
    "unambiguous_distance",
    "velocity_deviation",
]
