"""What a lighter mesh of a car changes of its echo: why far objects keep their meshes.

    pip install fast-simplification
    python benchmarks/light_meshes.py           10 minutes; a line for each share of triangles

The car ahead of `highway_guardrail`, in metal, is simplified by quadric error, part by part, and seen from behind.
Compared is the radar cross section, mean over 1 GHz, two bounces, at five angles.
"""

from __future__ import annotations

import sys
import time
import warnings
from pathlib import Path

import numpy as np
import numpy.typing as npt
import trimesh

sys.path.insert(0, str(Path(__file__).parents[1]))

import scarl_sionna as ss
from benchmarks.harness import machine
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.engine.rays.face_planes import face_table

SHARES = (0.8, 0.6, 0.4)
"""Of the triangles that are left."""
AZIMUTHS = np.radians(180.37 + np.array([-25.0, -6.0, -1.0, 3.0, 12.0]))
ELEVATION = np.radians(91.0)
FREQUENCIES = np.linspace(76e9, 77e9, 17)
SMALLEST = 60
"""Parts of fewer triangles stay as they are."""


def parts_of(scene: str, name: str) -> list[trimesh.Trimesh]:
    """Return the meshes of the parts of an instance, about their middle."""
    state = ss.load_scene(scene).at(1.3)
    table, parts = face_table(state), state.world.parts
    number = next(number for number, info in state.world.instances.items() if info.name == name)
    rows = np.flatnonzero(parts.instance[table.part] == number)
    corners = table.triangles.corners[rows]
    corners = corners - corners.reshape(-1, 3).mean(axis=0)
    found = []
    for part in np.unique(table.part[rows]):
        own = corners[table.part[rows] == part]
        mesh = trimesh.Trimesh(own.reshape(-1, 3), np.arange(3 * len(own)).reshape(-1, 3), process=False)
        mesh.merge_vertices()
        found.append(mesh)
    return found


def lighter(mesh: trimesh.Trimesh, share: float) -> trimesh.Trimesh:
    """Return a mesh with about that share of its triangles."""
    from fast_simplification import simplify

    if len(mesh.faces) < SMALLEST:
        return mesh
    points, faces = np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.int32)
    return trimesh.Trimesh(*simplify(points, faces, target_reduction=1.0 - share, agg=3), process=False)


def echoes_db(mesh: trimesh.Trimesh) -> npt.NDArray[np.float64]:
    """Return the cross section at each angle, mean over the band [dBsm]."""
    settings = SbrSettings(max_depth=2)
    mean = [np.mean(ss.rcs(mesh, FREQUENCIES, ELEVATION, azimuth, settings=settings)) for azimuth in AZIMUTHS]
    return np.asarray(10.0 * np.log10(mean))


def main() -> None:
    """Run from the command line."""
    warnings.simplefilter("ignore")
    parts = parts_of("highway_guardrail", "car_ahead")
    true = None
    print(machine())
    for share in (1.0, *SHARES):
        mesh = trimesh.util.concatenate([lighter(part, share) if share < 1.0 else part for part in parts])
        start = time.process_time()
        found = echoes_db(mesh)
        true = found if true is None else true
        change = np.abs(found - true)
        print(
            f"{len(mesh.faces)} triangles, {time.process_time() - start:.0f} CPU s: median {np.median(change):.2f} dB, "
            f"nine of ten {np.quantile(change, 0.9):.2f} dB",
            flush=True,
        )


if __name__ == "__main__":
    main()
