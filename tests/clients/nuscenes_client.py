"""Runs in an environment of its own: opens a folder with nuscenes-devkit, renders it, and prints what it found as JSON.

Usage: python nuscenes_client.py DATAROOT VERSION PICTURES
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import numpy as np
from nuscenes.nuscenes import NuScenes
from nuscenes.utils.data_classes import LidarPointCloud, RadarPointCloud
from nuscenes.utils.geometry_utils import BoxVisibility, points_in_box, view_points
from pyquaternion import Quaternion


def main(root: str, version: str, pictures: str) -> dict:
    """Return counts, points and projected boxes of every sample, and write the pictures of the first one."""
    nusc = NuScenes(version=version, dataroot=root, verbose=False)
    nusc.list_scenes()
    samples = [describe(nusc, sample) for sample in nusc.sample]
    out = {
        "tables": {name: len(getattr(nusc, name)) for name in nusc.table_names},
        "samples": samples,
        "chains": {s["token"]: chain(nusc, "sample", s["first_sample_token"]) for s in nusc.scene},
        "instances": {
            i["token"]: [chain(nusc, "sample_annotation", i["first_annotation_token"]), i["nbr_annotations"]]
            for i in nusc.instance
        },
    }
    folder = Path(pictures)
    folder.mkdir(parents=True, exist_ok=True)
    for channel, token in nusc.sample[0]["data"].items():
        nusc.render_sample_data(token, out_path=str(folder / f"{channel}.png"), verbose=False)
    data = nusc.sample[0]["data"]
    if "LIDAR_TOP" in data:
        if hasattr(nusc, "lidarseg"):
            nusc.render_sample_data(
                data["LIDAR_TOP"], show_lidarseg=True, out_path=str(folder / "lidarseg.png"), verbose=False
            )
        for channel in data:
            if channel.startswith("CAM"):
                nusc.render_pointcloud_in_image(
                    nusc.sample[0]["token"], camera_channel=channel, out_path=str(folder / f"{channel}_lidar.png")
                )
    return out


def chain(nusc: NuScenes, table: str, token: str) -> int:
    """Return the length of the list of records that begins with a token."""
    count = 0
    while token:
        count, token = count + 1, nusc.get(table, token)["next"]
    return count


def describe(nusc: NuScenes, sample: dict) -> dict:
    """Return what the devkit reads of a sample."""
    out: dict = {"token": sample["token"], "timestamp": sample["timestamp"], "data": {}, "boxes": []}
    for channel, token in sample["data"].items():
        record = nusc.get("sample_data", token)
        path, boxes, matrix = nusc.get_sample_data(token, box_vis_level=BoxVisibility.ANY)
        entry = {"modality": record["sensor_modality"], "boxes": {}}
        if record["sensor_modality"] == "camera":
            for box in boxes:
                corners = view_points(box.corners(), matrix, normalize=True)[:2]
                entry["boxes"][nusc.get("sample_annotation", box.token)["instance_token"]] = corners.T.tolist()
        elif record["sensor_modality"] == "lidar":
            cloud = LidarPointCloud.from_file(path)
            entry["points"], entry["low"] = cloud.nbr_points(), cloud.points.min(axis=1).tolist()
            entry["high"] = cloud.points.max(axis=1).tolist()
            entry["inside"] = {b.token: int(points_in_box(b, cloud.points[:3]).sum()) for b in boxes}
            entry["global"] = to_global(nusc, record, cloud.points[:3]).mean(axis=1).tolist()
        else:
            cloud = RadarPointCloud.from_file(path)
            RadarPointCloud.disable_filters()
            everything = RadarPointCloud.from_file(path)
            RadarPointCloud.default_filters()
            entry["points"], entry["unfiltered"] = cloud.nbr_points(), everything.nbr_points()
            entry["rows"] = cloud.points.T.tolist()
        out["data"][channel] = entry
    for token in sample["anns"]:
        record = nusc.get("sample_annotation", token)
        out["boxes"].append(
            {
                "token": token,
                "instance": record["instance_token"],
                "category": record["category_name"],
                "num_lidar_pts": record["num_lidar_pts"],
                "visibility": nusc.get("visibility", record["visibility_token"])["level"],
                "attributes": [nusc.get("attribute", t)["name"] for t in record["attribute_tokens"]],
                "velocity": nusc.box_velocity(token).tolist(),
            }
        )
    return out


def to_global(nusc: NuScenes, record: dict, points: np.ndarray) -> np.ndarray:
    """Return points (3, N) of a sensor in global coordinates, through its calibration and the ego pose."""
    for table, key in (("calibrated_sensor", "calibrated_sensor_token"), ("ego_pose", "ego_pose_token")):
        pose = nusc.get(table, record[key])
        points = Quaternion(pose["rotation"]).rotation_matrix @ points + np.array(pose["translation"])[:, None]
    return points


if __name__ == "__main__":
    result = main(*sys.argv[1:4])
    Path(sys.argv[3], "result.json").write_text(json.dumps(result))
