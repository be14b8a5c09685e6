"""Runs in an environment with Vicomtech's vcd: checks an OpenLABEL file by its schema and carries boxes into sensors.

Usage: python openlabel_client.py FILE SENSOR RESULT
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from vcd import core, scl, utils


def main(path: str, sensor: str) -> dict:
    """Return for each frame the boxes' corners in a sensor's coordinates, by object."""
    labels = core.OpenLABEL()
    labels.load_from_file(path, validation=True)
    scene = scl.Scene(labels)
    root = labels.get_root()
    out = {}
    for number in root["frames"]:
        boxes = out[str(number)] = {}
        for uid, item in root["objects"].items():
            found = labels.get_object_data(uid, "box", frame_num=number) or labels.get_object_data(uid, "box")
            if not found:
                continue
            x, y, z, qx, qy, qz, qw, *size = found["val"]
            signs = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]) / 2.0
            corners = signs * size @ utils.q2R(qx, qy, qz, qw).T + [x, y, z]
            whole = np.vstack([corners.T, np.ones(8)])
            moved = scene.transform_points3d_4xN(whole, found["coordinate_system"], sensor, frame_num=number)
            boxes[item["name"]] = {"type": item["type"], "corners": moved[:3].T.tolist()}
    return out


if __name__ == "__main__":
    Path(sys.argv[3]).write_text(json.dumps(main(sys.argv[1], sys.argv[2])))
