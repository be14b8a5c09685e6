"""Runs in the environment of nuscenes-devkit: reads a KITTI folder with its KittiDB and prints what it found as JSON.

Usage: python kitti_client.py ROOT RESULT
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from nuscenes.utils.geometry_utils import view_points
from nuscenes.utils.kitti import KittiDB
from pyquaternion import Quaternion


def main(root: str) -> dict:
    """Return for each sample its boxes (velodyne and image), points and where they lie in the image."""
    kitti = KittiDB(root, splits=("training",))
    out = {}
    for token in kitti.tokens:
        cloud = kitti.get_pointcloud(token, root)
        transforms = kitti.get_transforms(token, root)
        boxes, (flat, names) = [], kitti.get_boxes_2d(token)
        for box in kitti.get_boxes(token):
            box.rotate(kitti.kitti_to_nu_lidar_inv)  # back to KITTI's velodyne
            corners = box.corners()
            box.rotate(_quaternion(transforms["velo_to_cam"]["R"]))
            box.translate(transforms["velo_to_cam"]["T"])
            pixels = view_points(box.corners(), transforms["p_combined"], normalize=True)[:2]
            boxes.append({"name": box.name, "corners": corners.T.tolist(), "pixels": pixels.T.tolist()})
        cloud.rotate(transforms["velo_to_cam"]["R"])
        cloud.translate(transforms["velo_to_cam"]["T"])
        projected = view_points(cloud.points[:3], transforms["p_combined"], normalize=True)
        projected[2] = cloud.points[2]
        out[token] = {
            "boxes": boxes,
            "flat": [list(map(float, box)) for box in flat],
            "names": names,
            "points": cloud.points.shape[1],
            "intensity": [float(cloud.points[3].min()), float(cloud.points[3].max())],
            "projected": projected.T[::50].tolist(),
        }
    return out


def _quaternion(matrix: np.ndarray) -> Quaternion:
    return Quaternion(matrix=matrix.astype(np.float64), rtol=1e-5, atol=1e-6)


if __name__ == "__main__":
    result = main(sys.argv[1])
    Path(sys.argv[2]).write_text(json.dumps(result))
