"""A Mitsuba sensor that shoots exactly the rays of a :class:`CameraSpec`, whatever its lens."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.camera_spec import CameraSpec
from scarl_sionna.core.pose import Pose

from .projection import pixel_rays, projection_key

PLUGIN = "scarl_ray_table"


LAUNCHES = (1024, 256, 64, 16, 8, 4, 2, 1)
"""Samples a pixel of one launch: full grids of the multi-jittered sampler that divide the blocks of pixels which threads share out. With
another number a pixel at the seam of two blocks would be summed in the order in which threads finish: last bits would differ."""


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
    """Return directions on a grid with one pixel of margin, shape (h + 2, w + 2, 3), and which pixels are seen, (h, w)."""
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


@lru_cache(maxsize=4)
def _plugin(mi: Any, variant_name: str) -> type:
    """Define and register the sensor for the variant that runs; an object belongs to the variant that made it."""
    import drjit as dr

    class RayTableSensor(mi.Sensor):  # type: ignore[misc, name-defined]
        """Directions from a table at pixel centres, bilinear between them; no near and no far limit."""

        def place(self, spec: CameraSpec, world_from_sensor: Pose) -> None:
            """Take the rays of a camera at a pose. All numbers are variables, so that no pose or lens costs a compilation."""
            table, seen = _table_of(projection_key(spec))
            world = world_from_sensor.rotate(table).astype(np.float32)
            self._directions = mi.Float(world.ravel())
            self._seen = mi.Float(seen.astype(np.float32).ravel())
            self._size = mi.Vector2f(dr.opaque(mi.Float, float(spec.width)), dr.opaque(mi.Float, float(spec.height)))
            self._columns = dr.opaque(mi.UInt32, spec.width)
            self._origin = mi.Point3f(*(dr.opaque(mi.Float, float(value)) for value in world_from_sensor.position))

        def sample_ray(self, time: Any, sample1: Any, sample2: Any, sample3: Any, active: Any = True) -> Any:
            """Return the ray through a point of the film (`sample2`, 0 to 1) and its weight."""
            position = mi.Point2f(sample2) * self._size
            last = mi.Point2u(self._size) - 1
            pixel = dr.minimum(mi.Point2u(position), last)
            corner = mi.Point2u(position + 0.5)  # the table begins half a pixel outside of the image
            part = position + 0.5 - mi.Point2f(corner)
            stride = self._columns + 2
            first = corner.y * stride + corner.x

            def direction(index: Any) -> Any:
                return dr.gather(mi.Vector3f, self._directions, index)

            upper = dr.lerp(direction(first), direction(first + 1), part.x)
            lower = dr.lerp(direction(first + stride), direction(first + stride + 1), part.x)
            ray = mi.Ray3f(self._origin, dr.normalize(dr.lerp(upper, lower, part.y)))
            ray.time = time
            return ray, mi.Color3f(dr.gather(mi.Float, self._seen, pixel.y * self._columns + pixel.x))

        def sample_ray_differential(
            self, time: Any, sample1: Any, sample2: Any, sample3: Any, active: Any = True
        ) -> Any:
            """Return :meth:`sample_ray` without differentials."""
            ray, weight = self.sample_ray(time, sample1, sample2, sample3, active)
            return mi.RayDifferential3f(ray), weight

        def bbox(self) -> Any:
            """Return an empty box: a camera takes no room."""
            return mi.ScalarBoundingBox3f()

    mi.register_sensor(PLUGIN, RayTableSensor)
    return RayTableSensor


def ray_sensor(mi: Any, spec: CameraSpec, world_from_sensor: Pose, samples_per_pixel: int) -> Any:
    """Return the Mitsuba sensor of a camera at a pose; inside ``variant.optical()``.

    The box filter keeps every sample in its own pixel, so that a pixel of the image and of the labels mean the same square,
    and, with a number of samples of `LAUNCHES`, makes the sum over samples independent of the threads: same seed, same bytes.
    """
    _plugin(mi, mi.variant())
    sensor = mi.load_dict(
        {
            "type": PLUGIN,
            "film": {
                "type": "hdrfilm",
                "width": spec.width,
                "height": spec.height,
                "pixel_format": "rgb",
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "multijitter", "sample_count": samples_per_pixel},
        }
    )
    sensor.place(spec, world_from_sensor)
    return sensor
