"""The rays of a :class:`CameraSpec`, whatever its lens, and how many samples one launch takes."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.engine.light.ray_table import RayTable

from .projection import pixel_rays

LAUNCHES = (1024, 256, 64, 16, 8, 4, 2, 1)
"""Samples a pixel of one launch: full grids of the multi-jittered sampler that divide the blocks of pixels which
threads share out. With another number a pixel at the seam of two blocks would be summed in the order in which threads
finish: last bits would differ."""


def launch_samples(samples_per_pixel: int, most: int | None = None) -> list[int]:
    """Return how many samples each launch takes, largest first; together `samples_per_pixel`, none above `most`."""
    counts = []
    rest = samples_per_pixel
    for size in LAUNCHES:
        if most is None or size <= max(most, 1):
            times, rest = divmod(rest, size)
            counts += [size] * times
    return counts


@lru_cache(maxsize=2)
def _table_of(key: tuple[Any, ...]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_]]:
    """Return directions on a grid with one pixel of margin, (h + 2, w + 2, 3), and which pixels are seen, (h, w)."""
    width, height, lens, focal, centre = key
    spec = CameraSpec(width=width, height=height, lens=lens, focal_length_px=focal, principal_point=centre)
    rays = pixel_rays(spec).reshape(height, width, 3)
    seen = np.isfinite(rays[..., 0])
    if not seen.all():
        from scipy.ndimage import distance_transform_edt

        nearest = distance_transform_edt(~seen, return_distances=False, return_indices=True)
        rays = rays[tuple(nearest)]
    if lens.model != "kannala_brandt":
        rays = rays / rays[..., :1]  # on the image plane, where a pinhole's directions are linear in the pixel
    table = np.pad(rays, ((1, 1), (1, 1), (0, 0)), mode="edge")
    if height > 1:
        table[0], table[-1] = 2.0 * table[1] - table[2], 2.0 * table[-2] - table[-3]
    if width > 1:
        table[:, 0], table[:, -1] = 2.0 * table[:, 1] - table[:, 2], 2.0 * table[:, -2] - table[:, -3]
    return table, seen


def pixel_table(spec: CameraSpec) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_]]:
    """Return directions on a grid with one pixel of margin, shape (h + 2, w + 2, 3), and which pixels are seen, (h, w).

    Sensor axes, of any length: linear between the pixels' centres.
    """
    return _table_of(spec.projection_key)


def ray_table(spec: CameraSpec, world_from_sensor: Pose) -> RayTable:
    """Return the rays of a camera at a pose, for :func:`.recording.launch`.

    With a number of samples of `LAUNCHES` the sum over the samples of a pixel does not depend on the threads: same
    seed, same bytes.
    """
    directions, seen = pixel_table(spec)
    return RayTable(world_from_sensor.position, world_from_sensor.rotate(directions), seen)
