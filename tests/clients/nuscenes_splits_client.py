"""Runs in the environment of nuscenes-devkit: splits, ground truth, evaluation and CAN bus; prints them as JSON.

Usage: python nuscenes_splits_client.py DATAROOT VERSION SPLIT RESULT
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

from nuscenes.can_bus.can_bus_api import NuScenesCanBus
from nuscenes.eval.common.config import config_factory
from nuscenes.eval.common.loaders import load_gt
from nuscenes.eval.detection.data_classes import DetectionBox
from nuscenes.eval.detection.evaluate import DetectionEval
from nuscenes.nuscenes import NuScenes
from nuscenes.utils.splits import create_splits_scenes, get_scenes_of_split

MESSAGES = ("pose", "ms_imu", "vehicle_monitor", "route", "meta")


def main(root: str, version: str, split: str, work: Path) -> dict:
    """Return what the devkit finds under a predefined split."""
    nusc = NuScenes(version=version, dataroot=root, verbose=False)
    truth = load_gt(nusc, split, DetectionBox)
    can = NuScenesCanBus(dataroot=root)
    mine = [scene["name"] for scene in nusc.scene if scene["name"] in get_scenes_of_split(split, nusc)]
    results = {token: [_perfect(box) for box in truth[token]] for token in truth.sample_tokens}
    submission = work / "submission.json"
    use = {f"use_{kind}": False for kind in ("camera", "lidar", "radar", "map", "external")}
    submission.write_text(json.dumps({"meta": use, "results": results}))
    run = DetectionEval(nusc, config_factory("detection_cvpr_2019"), str(submission), split, str(work), verbose=False)
    metrics = run.evaluate()[0].serialize()
    return {
        "scenes": mine,
        "custom": {name: get_scenes_of_split(name, nusc) for name in ("scarl_train", "scarl_val")},
        "samples": len(truth.sample_tokens),
        "names": sorted({box.detection_name for token in truth.sample_tokens for box in truth[token]}),
        "average_precision": metrics["mean_dist_aps"],
        "can": {name: {kind: can.get_messages(name, kind) for kind in MESSAGES} for name in mine},
        "ego": {
            scene["name"]: [
                nusc.get("ego_pose", nusc.get("sample_data", sample["data"]["LIDAR_TOP"])["ego_pose_token"])
                for sample in nusc.sample
                if sample["scene_token"] == scene["token"]
            ]
            for scene in nusc.scene
        },
        "official": {
            name: scenes for name, scenes in create_splits_scenes().items() if "_" not in name or "mini" in name
        },
    }


def _perfect(box: DetectionBox) -> dict:
    return {**box.serialize(), "detection_score": 0.9, "velocity": list(box.velocity)}


if __name__ == "__main__":
    place = Path(sys.argv[4])
    place.write_text(json.dumps(main(*sys.argv[1:4], place.parent)))
