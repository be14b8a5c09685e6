"""Lamps that the camera sees itself: their radiance is known, so only what part of a pixel they fill is sampled."""

from __future__ import annotations

from types import ModuleType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.engine.device import Device
from scarl_sionna.engine.light.haze import Haze
from scarl_sionna.engine.light.lamp_table import SURFACE, lamp_table
from scarl_sionna.engine.threads import many_threads
from scarl_sionna.engine.types import MitsubaObject

from .ray_sensor import pixel_table

Array = npt.NDArray[np.float64]

LAMP_RAYS = 4096
"""Most rays through a pixel in which a lamp may be: lengths are right to 1/64 px."""
_MOST_RAYS = 1 << 20
"""Rays of all such pixels; where lamps fill more of the image, each pixel gets fewer."""


class LampLight(NamedTuple):
    """Pixels in which lamps may be seen, bool of shape (height, width), and what shines in each, shape (count, 3)."""

    pixels: npt.NDArray[np.bool_]
    radiance: Array


def lamp_light(
    mi: ModuleType,
    scene: MitsubaObject,
    spec: CameraSpec,
    world_from_sensor: Pose,
    haze: Haze | None,
    share: float = 1.0,
) -> LampLight | None:
    """Return the radiance of lamps seen directly; inside ``variant.optical()``.

    Parameters
    ----------
    mi : module
    scene : mitsuba.Scene
    spec : CameraSpec
    world_from_sensor : Pose
    haze : Haze or None
        Dims lamps with their distance.
    share : float
        Of `LAMP_RAYS`: less where the image is the mean of several instants.

    Returns
    -------
    LampLight or None
        None where the scene has an emitter of a kind that is not known, or no lamp is in view.

    Notes
    -----
    Rays go through a regular grid in each pixel, so the result is not random. Candidates are the pixels that a ball
    about the lamp touches; lamps that are smaller than a pixel are found, too.
    """
    table = lamp_table(mi, scene)
    if table is None:
        return None
    directions, seen = pixel_table(spec)
    directions = world_from_sensor.rotate(directions)
    lamps = (table.kind == SURFACE) & (table.strength > 0.0)
    pixels = _candidates(directions, table.center[lamps] - world_from_sensor.position, table.radius[lamps]) & seen
    rows, columns = np.nonzero(pixels)
    if len(rows) == 0:
        return None
    side = max(1, int(np.sqrt(min(LAMP_RAYS * share, _MOST_RAYS / len(rows)))))
    steps = (np.arange(side) + 0.5) / side
    down, right = (values.ravel() for values in np.meshgrid(steps, steps, indexing="ij"))
    rays = _between(directions, rows[:, None] + down, columns[:, None] + right).reshape(-1, 3)
    ray = mi.Ray3f(mi.Point3f(*world_from_sensor.position.tolist()), Device(mi).single_vectors(rays))
    hit = scene.ray_intersect(ray)
    emitted = hit.emitter(scene).eval(hit)
    if haze is not None:
        emitted = emitted * haze.transmittance(ray, hit.is_valid(), hit.t)
    with many_threads(rays.shape[0]):
        radiance = np.array(emitted, dtype=np.float64)
    radiance = radiance.reshape(3, len(rows), side * side).mean(axis=2).T
    return LampLight(pixels, radiance)


def _candidates(directions: Array, centers: Array, radii: Array) -> npt.NDArray[np.bool_]:
    """Return the pixels whose square may touch one of the balls, from a table with one pixel of margin."""
    unit = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    diagonal = np.einsum("ijk,ijk->ij", unit[:-1, :-1], unit[1:, 1:])
    margin = float(np.arccos(np.clip(diagonal.min(), -1.0, 1.0)))
    inner = unit[1:-1, 1:-1].astype(np.float32)
    found = np.zeros(inner.shape[:2], dtype=bool)
    for center, radius in zip(centers, radii, strict=True):
        distance = float(np.linalg.norm(center))
        if distance <= radius:
            return np.ones_like(found)
        angle = min(float(np.arcsin(radius / distance)) + margin, np.pi)
        found |= inner @ (center / distance).astype(np.float32) >= np.cos(angle)
    return found


def _between(table: Array, row: Array, column: Array) -> Array:
    """Return the unit directions at places of the image [px], as the ray sensor has them: linear in the table."""
    row, column = row + 0.5, column + 0.5  # the table begins half a pixel outside of the image
    top, left = row.astype(np.int64), column.astype(np.int64)
    down, right = (row - top)[..., None], (column - left)[..., None]
    upper = (1.0 - right) * table[top, left] + right * table[top, left + 1]
    lower = (1.0 - right) * table[top + 1, left] + right * table[top + 1, left + 1]
    direction = (1.0 - down) * upper + down * lower
    return np.asarray(direction / np.linalg.norm(direction, axis=-1, keepdims=True))
