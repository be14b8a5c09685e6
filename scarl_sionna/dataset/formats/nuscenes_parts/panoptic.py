"""Panoptic labels of lidar points: class and number of the object in one integer.

References
----------
.. [1] W. K. Fong et al., "Panoptic nuScenes: A large-scale benchmark for lidar panoptic segmentation and tracking",
   2021: 1000 times the lidarseg label plus the object's number in its scene, 0 for what has none.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError

from .tables import CATEGORIES

FOLDER = "panoptic"
FIRST_STUFF = CATEGORIES.index("flat.driveable_surface")
"""Labels from here on, and noise, have no objects."""
MOST_OBJECTS = 999
"""Of a class in a scene: what the code has room for."""


class PanopticNumbers:
    """Numbers of the objects of a scene, from 1 on in each class, in the order in which points show them."""

    def __init__(self) -> None:
        self._numbers: dict[int, dict[int, int]] = defaultdict(dict)

    def labels(self, lidarseg: npt.NDArray[np.uint8], instance: npt.NDArray[np.uint16]) -> npt.NDArray[np.uint16]:
        """Return the panoptic labels (n,) of a frame's points.

        Parameters
        ----------
        lidarseg : ndarray of uint8, shape (n,)
        instance : ndarray of uint16, shape (n,)
            Instance ids of this project; 0: of none.

        Raises
        ------
        ParameterRangeError
            If a scene has more than 999 objects of one class.
        """
        out = lidarseg.astype(np.uint16) * 1000
        is_thing = (lidarseg > 0) & (lidarseg < FIRST_STUFF) & (instance > 0)
        pairs, which = np.unique(
            np.stack([lidarseg[is_thing], instance[is_thing]], axis=1), axis=0, return_inverse=True
        )
        numbers = [self._number(int(label), int(identity)) for label, identity in pairs]
        out[is_thing] += np.array(numbers, np.uint16)[which.ravel()]
        return out

    def _number(self, label: int, instance: int) -> int:
        known = self._numbers[label]
        number = known.setdefault(instance, len(known) + 1)
        if number > MOST_OBJECTS:
            raise ParameterRangeError(
                "objects of a scene",
                f"more than {MOST_OBJECTS} of '{CATEGORIES[label]}'",
                f"<= {MOST_OBJECTS} of a class",
                "write panoptic=False",
            )
        return number


def write_labels(path: Path, labels: npt.NDArray[np.uint16]) -> None:
    """Write labels as the NPZ file that the reader expects."""
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path, data=labels)
