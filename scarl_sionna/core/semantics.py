"""Semantic classes: the CARLA 0.9.14+ list, which follows Cityscapes.

References
----------
.. [1] CARLA documentation, "Semantic segmentation camera": tags 0 to 28 and their colours.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .errors import UnknownNameError

SEMANTIC_CLASSES: tuple[str, ...] = (
    "Unlabeled", "Roads", "SideWalks", "Building", "Wall", "Fence", "Pole", "TrafficLight", "TrafficSign",
    "Vegetation", "Terrain", "Sky", "Pedestrian", "Rider", "Car", "Truck", "Bus", "Train", "Motorcycle", "Bicycle",
    "Static", "Dynamic", "Other", "Water", "RoadLine", "Ground", "Bridge", "RailTrack", "GuardRail",
)  # fmt: skip # a table
"""Class names; the index is the semantic id."""

SEMANTIC_COLORS: npt.NDArray[np.uint8] = np.array(
    [
        (0, 0, 0), (128, 64, 128), (244, 35, 232), (70, 70, 70), (102, 102, 156), (190, 153, 153), (153, 153, 153),
        (250, 170, 30), (220, 220, 0), (107, 142, 35), (152, 251, 152), (70, 130, 180), (220, 20, 60), (255, 0, 0),
        (0, 0, 142), (0, 0, 70), (0, 60, 100), (0, 80, 100), (0, 0, 230), (119, 11, 32), (110, 190, 160),
        (170, 120, 50), (55, 90, 80), (45, 60, 150), (157, 234, 50), (81, 0, 81), (150, 100, 100), (230, 150, 140),
        (180, 165, 180),
    ],
    dtype=np.uint8,
)  # fmt: skip # a table
"""Display colour of each class, shape (num_classes, 3), uint8 sRGB."""

SKY = SEMANTIC_CLASSES.index("Sky")


def semantic_id(name: str) -> int:
    """Return the semantic id of a class name."""
    try:
        return SEMANTIC_CLASSES.index(name)
    except ValueError:
        raise UnknownNameError("semantic class", name, SEMANTIC_CLASSES) from None
