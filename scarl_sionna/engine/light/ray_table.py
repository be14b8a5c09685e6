"""A Mitsuba sensor that shoots the rays of a table, one direction a pixel."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from types import ModuleType

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.device import Device
from scarl_sionna.engine.types import DeviceArray, MitsubaObject

PLUGIN = "scarl_ray_table"
SAMPLER = "multijitter"
"""Of Mitsuba's the one with the least error for the same samples (docs/camera.md)."""


@dataclass(frozen=True, eq=False)
class RayTable:
    """Rays of an image.

    Attributes
    ----------
    origin : ndarray of float64, shape (3,)
        Where all rays start [m, world].
    directions : ndarray of float64, shape (height + 2, width + 2, 3)
        World axes, at the pixels' centres, with one pixel of margin; linear between them.
    seen : ndarray of bool, shape (height, width)
        Pixels that take part.
    """

    origin: npt.NDArray[np.float64]
    directions: npt.NDArray[np.float64]
    seen: npt.NDArray[np.bool_]


@lru_cache(maxsize=4)
def _plugin(mi: ModuleType, variant_name: str) -> type:
    """Define and register the sensor for the variant that runs; an object belongs to the variant that made it."""
    import drjit as dr

    class RayTableSensor(mi.Sensor):  # type: ignore[misc, name-defined]
        """Directions from a table at pixel centres, bilinear between them; no near and no far limit."""

        def place(self, table: RayTable) -> None:
            """Take the rays. All numbers are variables, so that no pose or lens costs a compilation."""
            self.take(*ray_numbers(mi, table))

        def take(
            self,
            directions: DeviceArray,
            seen: DeviceArray,
            size: DeviceArray,
            columns: DeviceArray,
            origin: DeviceArray,
        ) -> None:
            """Take the rays as :func:`ray_numbers` has them."""
            self._directions, self._seen, self._size = directions, seen, size
            self._columns, self._origin = columns, origin

        def sample_ray(
            self,
            time: DeviceArray,
            sample1: DeviceArray,
            sample2: DeviceArray,
            sample3: DeviceArray,
            active: DeviceArray = True,
        ) -> tuple[MitsubaObject, DeviceArray]:
            """Return the ray through a point of the film (`sample2`, 0 to 1) and its weight."""
            position = mi.Point2f(sample2) * self._size
            last = mi.Point2u(self._size) - 1
            pixel = dr.minimum(mi.Point2u(position), last)
            corner = mi.Point2u(position + 0.5)  # the table begins half a pixel outside of the image
            part = position + 0.5 - mi.Point2f(corner)
            stride = self._columns + 2
            first = corner.y * stride + corner.x

            def direction(index: DeviceArray) -> DeviceArray:
                return dr.gather(mi.Vector3f, self._directions, index)

            upper = dr.lerp(direction(first), direction(first + 1), part.x)
            lower = dr.lerp(direction(first + stride), direction(first + stride + 1), part.x)
            ray = mi.Ray3f(self._origin, dr.normalize(dr.lerp(upper, lower, part.y)))
            ray.time = time
            return ray, mi.Color3f(dr.gather(mi.Float, self._seen, pixel.y * self._columns + pixel.x))

        def sample_ray_differential(
            self,
            time: DeviceArray,
            sample1: DeviceArray,
            sample2: DeviceArray,
            sample3: DeviceArray,
            active: DeviceArray = True,
        ) -> tuple[MitsubaObject, DeviceArray]:
            """Return :meth:`sample_ray` without differentials."""
            ray, weight = self.sample_ray(time, sample1, sample2, sample3, active)
            return mi.RayDifferential3f(ray), weight

        def bbox(self) -> MitsubaObject:
            """Return an empty box: a camera takes no room."""
            return mi.ScalarBoundingBox3f()

    mi.register_sensor(PLUGIN, RayTableSensor)
    return RayTableSensor


def ray_numbers(mi: ModuleType, table: RayTable) -> tuple[DeviceArray, ...]:
    """Return directions, which pixels are seen, size, columns and origin as the sensor takes them."""
    import drjit as dr

    (height, width), on = table.seen.shape, Device(mi)
    size = mi.Vector2f(dr.opaque(mi.Float, float(width)), dr.opaque(mi.Float, float(height)))
    origin = mi.Point3f(*(dr.opaque(mi.Float, float(value)) for value in table.origin))
    return on.single(table.directions), on.single(table.seen), size, dr.opaque(mi.UInt32, width), origin


def ray_table_sensor(mi: ModuleType, table: RayTable, samples_per_pixel: int) -> MitsubaObject:
    """Return the Mitsuba sensor of a table of rays; inside ``variant.optical()``.

    The box filter keeps every sample in its own pixel, so that a pixel of the image and of the labels mean the same
    square.
    """
    _plugin(mi, mi.variant())
    height, width = table.seen.shape
    film = {
        "type": "hdrfilm",
        "width": width,
        "height": height,
        "pixel_format": "rgb",
        "component_format": "float32",
        "rfilter": {"type": "box"},
    }
    sensor = mi.load_dict(
        {"type": PLUGIN, "film": film, "sampler": {"type": SAMPLER, "sample_count": samples_per_pixel}}
    )
    sensor.place(table)
    return sensor
