"""Thin layers that let waves through on their way from the transmitter to the first face, and from the last one back.

A ray that meets a pane goes straight on; what it loses there, for each polarisation, is the layer's coherent
transmission at the angle at which it is met. The pane reflects as any other face. Between two bounces a pane ends a
tube.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import MaterialRangeError
from scarl_sionna.engine.rays.face_planes import FaceTable
from scarl_sionna.engine.rays.face_rays import MISS, FaceRays
from scarl_sionna.engine.types import DeviceArray
from scarl_sionna.radar.optics.fields import Field, OnDevice
from scarl_sionna.radar.optics.surfaces import FaceSurfaces
from scarl_sionna.scene.materials.rough import coherent_transmission

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

MOST_PANES = 4
"""On one leg; what lies behind more is hidden. Four are the windows of a car that is looked through, or two boxes."""
STEP_ON = 4e-6
"""A ray goes on this far behind a pane, relative to 1 m + the distance: some float32 steps, so that it does not meet
the pane again; a second side of a sheet drawn at the same place counts once for it."""
DARK = 1
"""Label of a point behind something that lets nothing through; 0 is in the open, more is behind panes."""
_MIX, _MASK = 1009, (1 << 28) - 1


def pane_parts(state: WorldState, frequency: float, largest_loss_db: float | None) -> Index:
    """Return the rows of the part table that are layers with no more than a loss there and back, at normal incidence.

    Parameters
    ----------
    state : WorldState
    frequency : float
        [Hz]. A layer whose material has no data there lets nothing through.
    largest_loss_db : float or None
        [dB]; None: nothing lets waves through.
    """
    world, thin = state.world, set()
    for name in set(world.parts.material) if largest_loss_db is not None else ():
        material = world.materials[name]
        if material.thickness is None:
            continue
        try:
            through = float(np.abs(coherent_transmission(material, frequency, 1.0)[0]))
        except MaterialRangeError:
            continue
        if largest_loss_db is not None and -40.0 * np.log10(max(through, 1e-30)) <= largest_loss_db:
            thin.add(name)
    return np.array([part for part, name in enumerate(world.parts.material) if name in thin], dtype=np.int64)


class Panes:
    """The panes of a state; make and use it inside the variant of its rays.

    Parameters
    ----------
    rays : FaceRays
    faces : FaceTable
    parts : ndarray of int64
        Rows of the part table that are panes.
    instance : ndarray of int64, shape (num_faces,)
        Of every face: a pane hides what is of its own instance. Zeros where it does not.
    """

    def __init__(self, rays: FaceRays, faces: FaceTable, parts: Index, instance: Index) -> None:
        self.rays = rays
        self._instance = rays.label(instance)
        self._part = rays.label(np.where(np.isin(faces.part, parts), faces.part, MISS))

    def label(
        self, station: DeviceArray, ray: DeviceArray, before: DeviceArray, face: DeviceArray, active: DeviceArray = True
    ) -> DeviceArray:
        """Return labels of points of faces in some unit directions from a station, up to a distance; see `DARK`.

        Those that are not active count as in the open.
        """
        dr, mi, rays = self.rays.dr, self.rays.mi, self.rays
        own = dr.gather(mi.Int32, self._instance, face)

        def behind(
            step: DeviceArray, active: DeviceArray, far: DeviceArray, code: DeviceArray, dark: DeviceArray
        ) -> tuple[DeviceArray, ...]:
            met, hit, part, far = self._next((station, ray, before), step, active, far)
            other = dr.gather(mi.Int32, self._instance, mi.UInt32(met), hit)
            pane = hit & (part != MISS) & ((other != own) | (own == 0))
            code = dr.select(pane, ((code * _MIX + mi.UInt32(part)) & _MASK) + 2, code)
            return step + 1, pane, far, code, dark | (hit & ~pane)

        # a loop, which ends where rays meet nothing more: most meet nothing at all
        blocked = rays.blocked(station, ray, before, active)
        state = mi.UInt32(0), blocked, dr.zeros(mi.Float, dr.width(ray)), mi.UInt32(0), mi.Bool(False)
        _, _, _, code, dark = dr.while_loop(
            state, lambda step, active, far, code, dark: active, behind, label="panes in the way"
        )
        return dr.select(dark, mi.Int32(DARK), mi.Int32(code))

    def _next(
        self,
        way: tuple[DeviceArray, DeviceArray, DeviceArray],
        step: DeviceArray,
        active: DeviceArray,
        far: DeviceArray,
    ) -> tuple[DeviceArray, DeviceArray, DeviceArray, DeviceArray]:
        """Return the faces that active rays meet next, whether there is one, its part, and how far they go on behind.

        A way is a station, a direction and a distance before which faces count, `far` how far the rays have come. What
        is no pane ends it, as more than `MOST_PANES` do: its part is `MISS`.
        """
        dr, mi, rays = self.rays.dr, self.rays.mi, self.rays
        station, ray, before = way
        face, distance = rays.first_within(station + far * ray, ray, before - far, active)
        hit = active & (face != MISS)
        part = dr.gather(mi.Int32, self._part, mi.UInt32(face), hit)
        part = dr.select(step < MOST_PANES, part, MISS)
        return face, hit, part, dr.select(hit & (part != MISS), far + distance + STEP_ON * (1.0 + far + distance), far)

    def _met(
        self, station: DeviceArray, ray: DeviceArray, before: DeviceArray
    ) -> Iterator[tuple[DeviceArray, DeviceArray, DeviceArray]]:
        """Yield the faces met one after the other, whether there is one, and its part; all but panes end the way."""
        active, far = self.rays.blocked(station, ray, before), 0.0
        for step in range(MOST_PANES + 1):
            face, hit, part, far = self._next((station, ray, before), step, active, far)
            yield face, hit, part
            active = hit & (part != MISS)

    def crossed(self, station: Array, points: Array, before: float) -> Index:
        """Return the faces of the panes between a station and points, shape (num_points, MOST_PANES), `MISS` for none.

        `station` has the shape (3,), or that of the points; `before` is the part of the distance up to which faces
        count, 1 - 1e-6.
        """
        if not len(points):
            return np.zeros((0, MOST_PANES), dtype=np.int64)
        rays, dr = self.rays, self.rays.dr
        with rays.active():
            start = rays.vector(station) if station.ndim == 1 else rays.vectors(station)
            ray = rays.vectors(points) - start
            distance = dr.norm(ray)
            met = self._met(start, ray / distance, distance - (1.0 - before) * (1.0 + distance))
            found = [dr.select(hit & (part != MISS), face, MISS) for face, hit, part in met][:MOST_PANES]
            dr.eval(*found)
            return np.stack([column.numpy() for column in found], axis=1).astype(np.int64)


def through_panes(
    rays: FaceRays, surfaces: FaceSurfaces, way: Index, field: Field, direction: DeviceArray
) -> tuple[Field, DeviceArray]:
    """Return fields behind the panes on their way, and the mean share of amplitude that both polarisations keep.

    Parameters
    ----------
    rays : FaceRays
    surfaces : FaceSurfaces
    way : ndarray of int64, shape (num_tubes, MOST_PANES)
        Faces of panes in the order in which they are met, `MISS` behind the last.
    field : field
        See :mod:`scarl_sionna.radar.optics.fields`.
    direction : Dr.Jit Array3f64
        Unit direction of travel.
    """
    dr, mi, on = rays.dr, rays.mi, OnDevice(rays.dr)
    ways, first = rays.label(way), MOST_PANES * dr.arange(mi.UInt32, len(way))

    def there(number: DeviceArray, kept: DeviceArray, field: Field) -> DeviceArray:
        inside = number < MOST_PANES
        return inside & (dr.gather(mi.Int32, ways, first + number, inside) != MISS)

    def behind(number: DeviceArray, kept: DeviceArray, field: Field) -> tuple[DeviceArray, DeviceArray, Field]:
        face = mi.UInt32(dr.gather(mi.Int32, ways, first + number))
        normal = surfaces.plane(face)[0]
        te, tm = surfaces.transmission(face, dr.abs(dr.dot(normal, direction)))
        axis = on.across(direction, normal)
        other = on.cross(direction, axis)
        passed = on.add(
            on.along(axis, on.times(te, on.component(axis, field))),
            on.along(other, on.times(tm, on.component(other, field))),
        )
        power = 0.5 * sum(part**2 for coefficient in (te, tm) for part in coefficient)
        return number + 1, kept * dr.sqrt(power), passed

    # a loop, not one step after the other: else each number of panes, there and back, has a kernel of its own
    state = dr.zeros(mi.UInt32, len(way)), dr.ones(rays.Real, len(way)), field
    _, kept, field = dr.while_loop(state, there, behind, label="panes on the way")
    return field, kept
