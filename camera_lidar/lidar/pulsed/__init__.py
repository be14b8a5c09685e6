"""The pulsed (time-of-flight) receiver: link budget, detection, what fills the air, its two forms."""

from __future__ import annotations

from .air import spray_cells
from .detection import detection_probability, filtered, noise_deviation, range_deviation, threshold_ratio
from .link import (
    background_rate,
    density_of_shots,
    excess_noise_factor,
    noise_density,
    photoelectrons,
    pulse_spread,
    speckle_cells,
)
from .statistical import receive_pulsed
from .waveform import estimate_waveforms, synthesize_waveforms

__all__ = [
    "background_rate",
    "density_of_shots",
    "detection_probability",
    "estimate_waveforms",
    "excess_noise_factor",
    "filtered",
    "noise_density",
    "noise_deviation",
    "photoelectrons",
    "pulse_spread",
    "range_deviation",
    "receive_pulsed",
    "spray_cells",
    "speckle_cells",
    "synthesize_waveforms",
    "threshold_ratio",
]
