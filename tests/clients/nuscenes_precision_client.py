"""Runs in the environment of nuscenes-devkit: average precision of boxes by its own matching; prints it as JSON.

Usage: python nuscenes_precision_client.py FRAMES RESULT. FRAMES: a list of [found, there], rows of x, y, score.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from nuscenes.eval.common.data_classes import EvalBoxes
from nuscenes.eval.common.utils import center_distance
from nuscenes.eval.detection.algo import accumulate, calc_ap
from nuscenes.eval.detection.data_classes import DetectionBox


def main(frames: list) -> list[float]:
    """Return the average precision of cars within 0.5, 1, 2 and 4 m."""
    sides = [EvalBoxes(), EvalBoxes()]
    for number, frame in enumerate(frames):
        for side, rows in zip(sides, frame, strict=True):
            boxes = [
                DetectionBox(
                    sample_token=str(number),
                    translation=(x, y, 0.0),
                    size=(2.0, 4.0, 1.5),
                    rotation=(1.0, 0.0, 0.0, 0.0),
                    velocity=(0.0, 0.0),
                    detection_name="car",
                    detection_score=score,
                    attribute_name="vehicle.moving",
                )
                for x, y, score in rows
            ]
            side.add_boxes(str(number), boxes)
    found, there = sides
    data = [accumulate(there, found, "car", center_distance, distance) for distance in (0.5, 1.0, 2.0, 4.0)]
    return [float(calc_ap(one, 0.1, 0.1)) for one in data]


if __name__ == "__main__":
    Path(sys.argv[2]).write_text(json.dumps(main(json.loads(Path(sys.argv[1]).read_text()))))
