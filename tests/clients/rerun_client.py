"""Runs in an environment of its own.

Writes a drive as an .rrd file, reads it with Rerun, and prints what it holds as JSON.

Usage: python rerun_client.py REPOSITORY FILE
"""

from __future__ import annotations

import json
import sys

sys.path.insert(0, sys.argv[1])

from rerun.chunk import RrdReader

from scarl_sionna.dataset.formats import convert
from tests.drive import drive

LIDAR = "/street/vehicle/front_center/lidar/points"


def main(path: str) -> dict:
    """Return the entities, the frames, the number of lidar points in each, and the first box's centre."""
    convert(drive(2, ends=("front",)), "rerun", path)
    entities, frames, counts, center = set(), set(), {}, None
    for chunk in RrdReader(path).stream():
        entities.add(str(chunk.entity_path))
        table = chunk.to_record_batch()
        names = table.schema.names
        if chunk.is_static or "frame" not in names:
            continue
        index = table.column("frame").to_pylist()
        frames.update(index)
        if str(chunk.entity_path) == LIDAR:
            column = next(n for n in names if n.endswith("positions"))
            counts.update(zip(index, (len(row) for row in table.column(column).to_pylist()), strict=True))
        if str(chunk.entity_path) == "/street/objects" and 0 in index:
            column = next((n for n in names if n.endswith("centers")), None)
            if column:
                center = table.column(column).to_pylist()[index.index(0)][0]
    return {
        "entities": sorted(entities),
        "frames": sorted(frames),
        "lidar_rows": [counts[k] for k in sorted(counts)],
        "center": center,
    }


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[2])))
