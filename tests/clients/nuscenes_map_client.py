"""Runs in the environment of nuscenes-devkit: panoptic labels and the map expansion of a folder, as JSON.

Usage: python nuscenes_map_client.py DATAROOT VERSION SCENE RESULT
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import numpy as np
from nuscenes.map_expansion import map_api
from nuscenes.nuscenes import NuScenes
from nuscenes.utils.data_io import load_bin_file, panoptic_to_lidarseg


def main(root: str, version: str, scene: str, work: Path) -> dict:
    """Return what the devkit finds in the panoptic labels and on the map of a scene."""
    nusc = NuScenes(version=version, dataroot=root, verbose=False)
    nusc.list_panoptic_instances()
    nusc.render_sample_data(
        nusc.sample[0]["data"]["LIDAR_TOP"], show_panoptic=True, out_path=str(work / "panoptic.png"), verbose=False
    )
    labels = []
    for panoptic, lidarseg in zip(nusc.panoptic, nusc.lidarseg, strict=True):
        both = [load_bin_file(str(Path(root, panoptic["filename"])), "panoptic")]
        both.append(load_bin_file(str(Path(root, lidarseg["filename"])), "lidarseg"))
        things = both[0][(both[0] % 1000) > 0]
        same = bool((panoptic_to_lidarseg(both[0]) == both[1]).all())
        counts = {int(value): int(np.sum(things == value)) for value in np.unique(things)}
        labels.append({"same": same, "dtype": str(both[0].dtype), "things": counts})

    map_api.locations.append(scene)
    lanes = map_api.NuScenesMap(root, scene)
    by_name = {lane["scarl_name"]: lane["token"] for lane in lanes.lane}
    names = {token: name for name, token in by_name.items()}
    middle = lanes.discretize_lanes(list(names), 1.0)
    ego = nusc.ego_pose[0]["translation"][:2]
    on_point = lanes.layers_on_point(*ego)
    width, height = lanes.canvas_edge
    named = lanes.json_fname.replace(scene, map_api.locations[0])
    shutil.copy(lanes.json_fname, named)  # masks are made for maps of nuScenes' own names only
    box = (width / 2, height / 2, height, width)
    layers = ["drivable_area", "lane", "walkway", "carpark_area"]
    known = map_api.NuScenesMap(root, map_api.locations[0])
    mask = known.get_map_mask(box, 0, layers, (round(10 * height), round(10 * width)))
    return {
        "labels": labels,
        "middle": {names[token]: poses for token, poses in middle.items()},
        "after": {name: [names[one] for one in lanes.get_outgoing_lane_ids(token)] for name, token in by_name.items()},
        "before": {name: [names[one] for one in lanes.get_incoming_lane_ids(token)] for name, token in by_name.items()},
        "at_ego": {layer: names.get(token, token) for layer, token in on_point.items()},
        "closest": names[lanes.get_closest_lane(*ego)],
        "areas": [float(layer.sum()) / 100.0 for layer in mask],
        "stops": sorted(stop["stop_line_type"] for stop in lanes.stop_line),
        "origin": next(one for one in nusc.scene if one["name"] == scene)["scarl_world_from_map"],
    }


if __name__ == "__main__":
    place = Path(sys.argv[4])
    place.write_text(json.dumps(main(*sys.argv[1:4], place.parent)))
