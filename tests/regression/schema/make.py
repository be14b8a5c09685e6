"""Makes the fixture of a schema version, once, when it is released.

``python -m tests.regression.schema.make VERSION``. The layout is the default; version 2 was made with "files".
"""

from __future__ import annotations

import hashlib
import json
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from scarl_sionna.core.results import Frame
from scarl_sionna.dataset import StoreOptions, write_dataset
from tests.frames import RIG, make_frame

HERE = Path(__file__).parent


def digest(frame: Frame) -> dict[str, Any]:
    """Return checksums of all arrays of a frame, and its other values in words."""
    arrays = {}
    for name, result in frame.results.items():
        for field, value in vars(result).items():
            if isinstance(value, np.ndarray):
                text = f"{value.dtype.str} {value.shape} ".encode()
                arrays[f"{name}/{field}"] = hashlib.sha256(text + np.ascontiguousarray(value).tobytes()).hexdigest()
    radar = frame.radars["radar"]
    return {
        "arrays": arrays,
        "timestamp_ns": frame.timestamp_ns,
        "seed": str(frame.seed),
        "vehicle": [*frame.world_from_vehicle.position.tolist(), *frame.world_from_vehicle.quaternion.tolist()],
        "twist": [*frame.vehicle_twist.linear.tolist(), *frame.vehicle_twist.angular.tolist()],
        "radar": [radar.adc_scale, radar.num_saturated, radar.num_paths, dict(radar.diagnostics)],
        "objects": [
            [
                item.name,
                item.instance,
                item.semantic,
                item.size.tolist(),
                item.is_actor,
                item.num_pixels,
                item.num_lidar_points,
            ]
            for item in frame.objects
        ],
    }


def main(version: str) -> None:
    """Write the dataset as a ZIP, and what it holds as JSON."""
    frames = [make_frame(index) for index in range(2)]
    with tempfile.TemporaryDirectory() as folder:
        root = write_dataset(
            Path(folder) / "out", RIG.to_dict(), {"drive": frames}, options=StoreOptions(shard_frames=2)
        )
        with zipfile.ZipFile(HERE / f"v{version}.zip", "w", zipfile.ZIP_DEFLATED) as archive:
            for path in sorted(root.rglob("*")):
                name = path.relative_to(root)
                if path.is_file() and not name.parts[0].startswith("."):
                    archive.writestr(zipfile.ZipInfo(name.as_posix()), path.read_bytes(), zipfile.ZIP_DEFLATED)
    (HERE / f"v{version}.json").write_text(json.dumps([digest(frame) for frame in frames], indent=1) + "\n")


if __name__ == "__main__":
    main(sys.argv[1])
