"""Whether a user's mesh can be what it is said to be: triangles, holes, and measures that fit its class."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
import trimesh

from scarl_sionna.core.errors import MeshError, ParameterRangeError, ScarlWarning
from scarl_sionna.scene.document.mesh_files import check_triangles

Array = npt.NDArray[np.float64]

LONGEST_SIDE = {
    "Car": (1.5, 8.0), "Truck": (3.0, 30.0), "Bus": (4.0, 30.0), "Train": (5.0, 400.0), "Motorcycle": (1.0, 4.0),
    "Bicycle": (0.7, 3.0),
    "Pedestrian": (0.4, 2.6), "Rider": (0.4, 2.6),
}  # fmt: skip # a table
"""Shortest and longest that the longest side of a class may be [m]."""
_ANY = (0.02, 500.0)
_UNITS = {0.001: "millimetres", 0.01: "centimetres", 0.0254: "inches", 0.3048: "feet", 1000.0: "kilometres"}
_UPRIGHT = ("Pedestrian", "Rider")
_LONG = ("Car", "Truck", "Bus", "Train", "Motorcycle", "Bicycle")


def checked_part(body: trimesh.Trimesh, what: str) -> trimesh.Trimesh:
    """Return a copy of a mesh without triangles that have no area.

    Raises
    ------
    MeshError
        If it has no triangles, or vertices that are not finite.
    """
    vertices, faces = np.asarray(body.vertices, dtype=np.float64), np.asarray(body.faces, dtype=np.int64)
    if len(faces) == 0:
        raise MeshError(f"{what} has no triangles", remedy="leave the part out, or export it with its surface")
    bad = int(np.count_nonzero(~np.isfinite(vertices).all(axis=-1)))
    if bad:
        raise MeshError(f"{what} has {bad} vertices that are not finite (NaN or inf)", remedy="export it again")
    try:
        check_triangles(vertices, faces)
    except MeshError as error:
        raise MeshError(f"{what} {error}") from None
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    twice_area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([np.linalg.norm(side, axis=1) for side in (b - a, c - b, a - c)], axis=0)
    sound = twice_area > 1e-7 * longest**2
    if not sound.any():
        raise MeshError(f"{what} has only triangles without area", remedy="export it again")
    if not sound.all():
        warnings.warn(
            f"{what}: {int((~sound).sum())} of {len(faces)} triangles have no area and are left out",
            ScarlWarning,
            stacklevel=4,
        )
    return trimesh.Trimesh(vertices, faces[sound], process=False)


def open_edges(body: trimesh.Trimesh) -> int:
    """Return how many edges belong to one triangle only, after vertices at the same place are joined."""
    _, joined = np.unique(
        np.round(body.vertices / max(1e-7 * float(np.ptp(body.vertices)), 1e-12)), axis=0, return_inverse=True
    )
    faces = joined.reshape(-1)[body.faces]
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    _, count = np.unique(edges, axis=0, return_counts=True)
    return int((count == 1).sum())


def warn_if_open(model: str, parts: Mapping[str, trimesh.Trimesh]) -> None:
    """Warn of the edges of parts that belong to one triangle only."""
    counts = {part: number for part, body in parts.items() if (number := open_edges(body))}
    if counts:
        listed = ", ".join(
            f"'{part}' {number}" for part, number in sorted(counts.items(), key=lambda item: -item[1])[:5]
        )
        warnings.warn(
            f"mesh '{model}' is not closed: {sum(counts.values())} open edges "
            f"({listed}{' ...' if len(counts) > 5 else ''}). Radar rays "
            "that enter through the gaps are mirrored inside of the body and come back later than they should, "
            "and a sensor that stands "
            "inside is not always found; close the holes, or make panes and openings parts of materials of their own",
            ScarlWarning,
            stacklevel=3,
        )


def check_measures(model: str, semantic: str, size: Array, scale: float, up: str, forward: str) -> None:
    """Raise where a mesh is too large or too small for its class, or stands or lies as nothing of that class does.

    Parameters
    ----------
    model, semantic : str
    size : ndarray of float64, shape (3,)
        Length, width and height after scale and turn [m].
    scale : float
    up, forward : str
        The axes as they were taken.
    """
    low, high = LONGEST_SIDE.get(semantic, _ANY)
    longest = float(size.max())
    measures = " x ".join(f"{side:.4g}" for side in size)
    if not low <= longest <= high:
        fitting = [f"{name} (scale={scale * unit:g})" for unit, name in _UNITS.items() if low <= longest * unit <= high]
        remedy = f"give the scale that makes it {low:g} to {high:g} m long"
        if fitting:
            remedy = f"is the file in {' or '.join(fitting)}?"
        raise ParameterRangeError(
            f"size of mesh '{model}'",
            f"{measures} m",
            f"{low:g} to {high:g} m along the longest side of a {semantic}",
            remedy,
        )
    length, width, height = size.tolist()
    axes = f"taken with up='{up}', forward='{forward}'"
    if semantic in _UPRIGHT and height < max(length, width):
        raise ParameterRangeError(
            f"height of mesh '{model}'",
            f"{height:.3g} m ({measures} m, {axes})",
            "the largest measure of a body that stands",
            f"give another `up`, for instance up='{'y' if up != 'y' else 'z'}'",
        )
    if semantic in _LONG and length < max(width, height):
        problem = "up" if height > max(length, width) else "forward"
        raise ParameterRangeError(
            f"length of mesh '{model}'",
            f"{length:.3g} m ({measures} m, {axes})",
            f"the largest measure of a {semantic}",
            f"give another `{problem}`: the longest side must point forward",
        )
    if semantic == "Car" and height > 1.1 * width:
        warnings.warn(
            f"mesh '{model}' is higher ({height:.3g} m) than wide ({width:.3g} m), which few cars are ({axes}); "
            f"if it lies on its side, give another `up`, for instance up='{'y' if up != 'y' else 'z'}'",
            ScarlWarning,
            stacklevel=3,
        )
