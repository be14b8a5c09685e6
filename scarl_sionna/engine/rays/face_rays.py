"""Rays against the triangles of a state inside Dr.Jit kernels: which face is met first, and whether anything is met."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from scarl_sionna.engine.device import Device

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

MISS = -1
"""Face of a ray that meets nothing."""


class FaceRays(Device):
    """Rays of one state on the engine's device. Make and use it inside ``variant.use(twin)``.

    Geometry is float64 up to the ray itself, which the engine takes in float32.

    Parameters
    ----------
    mi : module
        Mitsuba in the variant of the twin.
    state : WorldState
    twin : {"optical", "radio"}
    """

    def __init__(self, mi: Any, state: WorldState, twin: str = "optical") -> None:
        super().__init__(mi)
        engine = state._applied(twin)
        self._scene = engine.mi_scene
        part = engine.part_of_number(np.arange(len(engine._part_of_registry)))
        first = state._triangles.first
        self._first = mi.Int32(np.where(part >= 0, first[np.maximum(part, 0)], MISS).astype(np.int32))

    def _ray(self, origin: Any, direction: Any) -> Any:
        return self.mi.Ray3f(self.mi.Point3f(origin), self.mi.Vector3f(direction))

    def first(self, origin: Any, direction: Any) -> Any:
        """Return the face (a row of :class:`~.face_tracing.FaceTable`) that each ray meets first, or `MISS`.

        Parameters
        ----------
        origin, direction : Dr.Jit Array3f64
            [m, world] and unit vectors.
        """
        dr, mi = self.dr, self.mi
        found = self._scene.ray_intersect_preliminary(self._ray(origin, direction), coherent=False)
        number = dr.reinterpret_array(mi.UInt32, found.shape)
        valid = found.is_valid()
        first = dr.gather(mi.Int32, self._first, number, valid)
        return dr.select(valid & (first >= 0), first + mi.Int32(found.prim_index), MISS)

    def blocked(self, origin: Any, direction: Any, distance: Any) -> Any:
        """Return whether each ray meets anything before a distance [m]."""
        ray = self._ray(origin, direction)
        ray.maxt = self.mi.Float(distance)
        return self._scene.ray_test(ray, coherent=False)
