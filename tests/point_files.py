"""Radar points as nuScenes, View-of-Delft and RadarScenes have them, written value by value from their documents."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import h5py
import numpy as np

PCD_FIELDS = (
    "x y z dyn_prop id rcs vx vy vx_comp vy_comp is_quality_valid ambig_state x_rms y_rms invalid_state pdh0 "
    "vx_rms vy_rms"
)
PCD_SIZES = "4 4 4 1 2 4 4 4 4 4 1 1 1 1 1 1 1 1"
PCD_KINDS = "F F F I I F F F F F I I I I I I I I"


def write_pcd(path: Path, points: list[dict]) -> None:
    """Write a radar sweep of nuScenes; keys left out are 0, or 3 for ``ambig_state``."""
    head = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
        f"FIELDS {PCD_FIELDS}\nSIZE {PCD_SIZES}\nTYPE {PCD_KINDS}\nCOUNT {' '.join(['1'] * 18)}\n"
        f"WIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA binary\n"
    )
    kinds, sizes = PCD_KINDS.split(), PCD_SIZES.split()
    codes = [{"F4": "f", "I1": "b", "I2": "h"}[kind + size] for kind, size in zip(kinds, sizes, strict=True)]
    body = b""
    for point in points:
        values = [point.get(name, 3 if name == "ambig_state" else 0) for name in PCD_FIELDS.split()]
        body += struct.pack("<" + "".join(codes), *values)
    path.write_bytes(head.encode() + body + b"\0")


def write_vod(path: Path, rows: list[tuple[float, ...]]) -> None:
    """Write a frame of View-of-Delft: x, y, z, RCS, radial velocity, over ground, scan."""
    path.write_bytes(b"".join(struct.pack("<7f", *row) for row in rows))


SCENES_ROW = np.dtype(
    [
        ("timestamp", "i8"), ("sensor_id", "u1"), ("range_sc", "f4"), ("azimuth_sc", "f4"), ("rcs", "f4"), ("vr", "f4"),
        ("vr_compensated", "f4"), ("x_cc", "f4"), ("y_cc", "f4"), ("x_seq", "f4"), ("y_seq", "f4"), ("uuid", "S32"),
        ("track_id", "S32"), ("label_id", "u1"),
    ]
)  # fmt: skip # a table


def write_radar_scenes(folder: Path, scans: list[tuple[int, int, list[dict]]]) -> None:
    """Write a sequence of scans: time [us], sensor from 1, points with the table's names."""
    rows, scenes = [], {}
    for stamp, sensor, points in scans:
        scenes[str(stamp)] = {
            "sensor_id": sensor,
            "radar_indices": [len(rows), len(rows) + len(points)],
            "odometry_index": 0,
            "odometry_timestamp": stamp,
            "image_name": "0.jpg",
        }
        for point in points:
            whole = {"timestamp": stamp, "sensor_id": sensor, "uuid": b"u", "track_id": b"", "label_id": 11, **point}
            rows.append(tuple(whole.get(name, 0.0) for name in SCENES_ROW.names))
    with h5py.File(folder / "radar_data.h5", "w") as file:
        file["radar_data"] = np.array(rows, dtype=SCENES_ROW)
        file["odometry"] = np.zeros(1, dtype=[("timestamp", "i8"), ("x_seq", "f4")])
    text = {"sequence_name": "sequence_1", "category": "train", "scenes": scenes}
    (folder / "scenes.json").write_text(json.dumps(text))
