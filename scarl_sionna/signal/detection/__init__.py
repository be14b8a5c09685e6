"""Detection: which cells stand out of noise and clutter, and the points that they hold."""

from .detector import detect
from .points import RadarPoints
from .threshold import cfar

__all__ = ["RadarPoints", "cfar", "detect"]
