"""Average precision as nuScenes defines it: detections are matched by the distance between centres.

References
----------
.. [1] H. Caesar et al., "nuScenes: A multimodal dataset for autonomous driving", CVPR 2020, section 3.1: matched within
   0.5, 1, 2 and 4 m over ground, the area of precision over recall where both are above 10 %.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .grid import CLASSES, Objects

DISTANCES = (0.5, 1.0, 2.0, 4.0)
"""Within which a detection counts as right [m]."""
LEAST = 0.1
"""Recall and precision up to here do not count."""
_RECALLS = np.linspace(0.0, 1.0, 101)


@dataclass(frozen=True, eq=False)
class Matched:
    """Detections of one class in one frame beside what is there.

    Attributes
    ----------
    scores : ndarray of float64, shape (N,)
    right : ndarray of bool, shape (num_distances, N)
        Whether a detection is one of an object, by the distance allowed.
    num_objects : int
    """

    scores: npt.NDArray[np.float64]
    right: npt.NDArray[np.bool_]
    num_objects: int


def match(found: Objects, there: Objects, kind: int, near: float = 0.0, far: float = np.inf) -> Matched:
    """Match the detections of a class in a frame, best first, each to the nearest object that is not yet taken.

    Parameters
    ----------
    found, there : Objects
    kind : int
    near, far : float
        Only detections and objects from `near` to below `far` count [m].
    """
    found, there = (
        part.chosen((part.kinds == kind) & (part.distance >= near) & (part.distance < far)) for part in (found, there)
    )
    order = np.argsort(-found.scores, kind="stable")
    away = np.linalg.norm(found.places[order, None] - there.places[None], axis=-1)
    right = np.zeros((len(DISTANCES), len(found)), bool)
    for row, allowed in enumerate(DISTANCES):
        free = np.ones(len(there), bool)
        for number in range(len(found) if len(there) else 0):
            distances = np.where(free, away[number], np.inf)
            nearest = int(np.argmin(distances))
            if distances[nearest] < allowed:
                right[row, number], free[nearest] = True, False
    return Matched(found.scores[order], right, len(there))


def average_precision(frames: Sequence[Matched]) -> npt.NDArray[np.float64]:
    """Return the average precision of one class over frames, by the distance allowed, shape (num_distances,).

    Nan where there is no object. Precision is taken at 101 values of recall, between measured ones linearly and 0
    beyond the last; the mean over recall above 10 % of what precision has above 10 %, as a part of 90 %.
    """
    num_objects = sum(frame.num_objects for frame in frames)
    if not num_objects:
        return np.full(len(DISTANCES), np.nan)
    scores = np.concatenate([frame.scores for frame in frames])
    right = np.concatenate([frame.right for frame in frames], axis=1)[:, np.argsort(-scores, kind="stable")]
    out = np.zeros(len(DISTANCES))
    for row, hits in enumerate(np.cumsum(right, axis=1).astype(np.float64)):
        if not len(hits) or not hits[-1]:
            continue
        precision = np.interp(_RECALLS, hits / num_objects, hits / np.arange(1, len(hits) + 1), right=0.0)
        kept = precision[round(100 * LEAST) + 1 :] - LEAST
        out[row] = np.mean(np.maximum(kept, 0.0)) / (1.0 - LEAST)
    return out


def precision_table(
    found: Sequence[Objects], there: Sequence[Objects], near: float = 0.0, far: float = np.inf
) -> npt.NDArray[np.float64]:
    """Return the average precision of all classes over frames, shape (num_classes, num_distances)."""
    return table_of(matched_frames(found, there, near, far))


def matched_frames(
    found: Sequence[Objects], there: Sequence[Objects], near: float = 0.0, far: float = np.inf
) -> list[list[Matched]]:
    """Return the matches of every frame, by class."""
    return [
        [match(some, true, kind, near, far) for kind in range(len(CLASSES))]
        for some, true in zip(found, there, strict=True)
    ]


def table_of(frames: Sequence[Sequence[Matched]]) -> npt.NDArray[np.float64]:
    """Return the average precision (num_classes, num_distances) of matched frames."""
    return np.stack([average_precision([frame[kind] for frame in frames]) for kind in range(len(CLASSES))])


def mean_precision(table: npt.NDArray[np.float64]) -> float:
    """Return the mean over classes that are there and over distances: nuScenes' mAP."""
    rows = table[~np.isnan(table).any(axis=1)]
    return float(rows.mean()) if len(rows) else float("nan")
