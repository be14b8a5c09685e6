"""Runs in the environment of nuscenes-devkit.

Its own drawings of the first sample, side by side, for the documentation.

Usage: python nuscenes_figure.py DATAROOT VERSION FIGURE
"""

from __future__ import annotations

import sys

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
from nuscenes.nuscenes import NuScenes


def main(root: str, version: str, figure: str) -> None:
    """Draw camera with boxes, lidar with classes and radar of the first sample."""
    nusc = NuScenes(version=version, dataroot=root, verbose=False)
    data = nusc.sample[0]["data"]
    drawing, axes = plt.subplots(1, 3, figsize=(16, 4.6), width_ratios=(1.78, 1, 1))
    nusc.render_sample_data(data["CAM_FRONT"], ax=axes[0], verbose=False)
    nusc.render_sample_data(data["LIDAR_TOP"], ax=axes[1], verbose=False, show_lidarseg=True)
    nusc.render_sample_data(data["RADAR_FRONT"], ax=axes[2], verbose=False)
    drawing.tight_layout()
    drawing.savefig(figure, dpi=90)


if __name__ == "__main__":
    main(*sys.argv[1:4])
