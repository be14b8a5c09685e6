"""What ties sensors together: the rig, and labels counted over all sensors of a frame."""

from .labels import count_labels
from .rig import RIG_PRESETS, Rig, SensorMount

__all__ = ["RIG_PRESETS", "Rig", "SensorMount", "count_labels"]
