"""Whether files that a script builds hold what files built on another machine hold."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from PIL import Image


def hold_the_same(one: Path, other: Path) -> bool:
    """Return whether two files have the same bytes, pixels or surface.

    Bytes of an image depend on the version of zlib. Triangles of a flat region depend on rounding where four corners
    lie on one circle: the corners, the outline and the area do not.
    """
    if one.read_bytes() == other.read_bytes():
        return True
    if one.suffix == ".png":
        return np.array_equal(*(np.asarray(Image.open(file)) for file in (one, other)))
    if one.suffix != ".ply":
        return False
    first, second = (trimesh.load(file, process=False) for file in (one, other))
    return (
        np.array_equal(first.vertices, second.vertices)
        and len(first.faces) == len(second.faces)
        and np.array_equal(_outline(first), _outline(second))
        and np.isclose(first.area, second.area, rtol=1e-9)
    )


def _outline(mesh: trimesh.Trimesh) -> np.ndarray:
    """Return the edges of one triangle only, in order."""
    edges, count = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    return edges[count == 1]
