"""What all pairs of stations of one solve share: the faces of a state, which scatter, and their surfaces."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine import variant
from scarl_sionna.engine.rays.face_planes import FaceTable, face_table, rigid_planes
from scarl_sionna.engine.rays.face_rays import StateRays
from scarl_sionna.engine.rays.nearby import scene_near
from scarl_sionna.engine.smooth.surface import state_sheets, state_surface
from scarl_sionna.radar.optics.body.mesh import MOSTLY_COARSE
from scarl_sionna.radar.optics.faces.curved import CurvedFaces, DeviceCurves
from scarl_sionna.radar.optics.faces.panes import Panes, pane_parts
from scarl_sionna.radar.optics.surfaces import FaceSurfaces
from scarl_sionna.radar.optics.tubes.narrow import NarrowBodies
from scarl_sionna.radar.tuned import material_frequency

from .senses import flat_widths, heard_the_same_way

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World, WorldState

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Bodies:
    """Some instances of a state, made ready once for all pairs of stations between which they scatter.

    Attributes
    ----------
    state : WorldState
    radar : RadarSpec
    settings : RadarSettings
        Those of the solve.
    instances : sequence of int
        What scatters; the rest hides what is behind it.
    place : ndarray of float64, shape (3,), optional
        Where the stations are, about [m, world]; left out: near the world's origin.
    """

    state: WorldState
    radar: RadarSpec
    settings: RadarSettings
    instances: Sequence[int]
    place: Array | None = None
    _warned: set[str] = field(default_factory=set)

    @property
    def knobs(self) -> SbrSettings:
        """Settings of `sbr`."""
        return self.settings.sbr

    @property
    def reach(self) -> float:
        """Half of the longest path [m]."""
        limit = self.settings.max_distance
        return self.radar.max_range if limit is None else limit

    @contextmanager
    def active(self) -> Iterator[None]:
        """Enter the variant of the rays, with the state in the engine's scene."""
        with variant.optical():
            scene_near(self.state, self.place, "optical")
            yield

    def warn_once(self, kind: str, text: str) -> None:
        """Warn the caller of the solve, but of each kind only once in a solve."""
        if kind not in self._warned:
            self._warned.add(kind)
            warnings.warn(text, ScarlWarning, stacklevel=5)

    @cached_property
    def _table(self) -> tuple[FaceTable, CurvedFaces | None, dict[int, int], dict[int, tuple[int, float]]]:
        return _faces(self.state, self.knobs, self.radar.center_frequency, list(self.instances))

    @property
    def faces(self) -> FaceTable:
        """The triangles of the state; those that stand for a curved surface are each in a plane of their own."""
        return self._table[0]

    @property
    def coarse(self) -> dict[int, int]:
        """Number of coarse faces of the instances that mostly consist of them."""
        return self._table[2]

    @property
    def uneven(self) -> dict[int, tuple[int, float]]:
        """Number of uneven faces of the instances that have many, and their expected error [dB]."""
        return self._table[3]

    @cached_property
    def scatters(self) -> Mask:
        """Faces that scatter; the others are obstacles, shape (num_faces,)."""
        return self.of(self.instances)

    def of(self, instances: Sequence[int]) -> Mask:
        """Return the faces of some instances, shape (num_faces,)."""
        return np.asarray(np.isin(self.state.world.parts.instance, instances)[self.faces.part])

    @cached_property
    def owner(self) -> Index:
        """Instance of each face, shape (num_faces,)."""
        return np.asarray(self.state.world.parts.instance[self.faces.part], dtype=np.int64)

    @cached_property
    def narrow(self) -> NarrowBodies:
        """Where bodies that scatter stand, so that none slips between the probes of a tube."""
        return _narrow(self.state, self._parts)

    @cached_property
    def _parts(self) -> Index:
        """Rows of the part table that scatter."""
        count = np.bincount(self.faces.part[self.scatters], minlength=len(self.state.world.parts.name))
        return np.flatnonzero(count)

    @cached_property
    def thin(self) -> Index:
        """Rows of the part table that let waves through."""
        return pane_parts(self.state, self.radar.center_frequency, self.knobs.pane_loss_db)

    @cached_property
    def sheets(self) -> Array:
        """Size of the sheet to which each face belongs [m], shape (num_faces,)."""
        return state_sheets(self.state, self._parts)

    @cached_property
    def widths(self) -> Array:
        """Width of the flat region to which each face belongs [m], shape (num_faces,)."""
        curved = self._table[1]
        return _widths(self.state, self.faces, None if curved is None else curved.is_curved)

    @cached_property
    def _mirror_widths(self) -> Array:
        """The same of flat faces; 0 of those that stand for a curve."""
        curved = self._table[1]
        return self.widths if curved is None else np.where(curved.is_curved, 0.0, self.widths)

    def heard_the_same_way(self, chain: Index) -> Mask:
        """Return after which chains of faces (n, depth) the last one is heard over the others, see :mod:`.senses`."""
        instance = self.state.world.parts.instance[self.faces.part[chain]]
        return heard_the_same_way(self._mirror_widths[chain], self.widths[chain[:, -1]], instance)

    @cached_property
    def velocity(self) -> Array | None:
        """Velocity of the faces' centres [m/s], shape (num_faces, 3); None where patches do not follow from motion."""
        if self.knobs.max_turn is None:
            return None
        return self.state._face_velocity

    @cached_property
    def rays(self) -> StateRays:
        """Rays of the state; use them, and what follows, inside :meth:`active`."""
        with variant.optical() as mi:
            return StateRays(mi, self.state, self.place)

    @cached_property
    def panes(self) -> Panes | None:
        """What lets waves through, None if nothing does."""
        if not len(self.thin):
            return None
        owner = np.where(self.knobs.own_panes, 0, self.state.world.parts.instance[self.faces.part])
        return Panes(self.rays, self.faces, self.thin, owner)

    @cached_property
    def surfaces(self) -> FaceSurfaces:
        """Reflection, transmission and motion of the faces."""
        shown = np.union1d(self._parts, self.thin)
        frequency = material_frequency(self.radar)
        return FaceSurfaces(self.rays, self.state, self.faces, shown, frequency, self.knobs.coefficient_nodes)

    @cached_property
    def curves(self) -> DeviceCurves | None:
        """The curved surfaces behind faces, None if there are none."""
        curved = self._table[1]
        return None if curved is None else DeviceCurves(self.rays, curved)


_balls: WeakKeyDictionary[World, dict[int, NarrowBodies]] = WeakKeyDictionary()
"""By part, in the frames of `World.mesh`."""


def _narrow(state: WorldState, parts: Index) -> NarrowBodies:
    """Return the bodies of parts of a state; those of a part that does not bend are found once for a world."""
    known = _balls.setdefault(state.world, {})
    found = []
    for part in parts.tolist():
        if part in state._bent:
            balls = NarrowBodies.of_mesh(state.part_corners(part))
        elif part in known:
            balls = known[part]
        else:
            balls = known[part] = NarrowBodies.of_mesh(state.part_corners(part))
        found.append((balls, state.part_pose(part)))
    return NarrowBodies.of_parts(found)


@dataclass(frozen=True, eq=False)
class _FlatWidths:
    """Widths of the flat regions of a world [m]: where no face stands for a curve, and of parts of which some do.

    `of_part` has which faces of a part stand for a curve, and the widths of its faces then.
    """

    without_curves: Array
    of_part: dict[int, tuple[Mask, Array]] = field(default_factory=dict)


_flat: WeakKeyDictionary[World, _FlatWidths] = WeakKeyDictionary()


def _widths(state: WorldState, faces: FaceTable, is_curved: Mask | None) -> Array:
    """Return the widths of flat regions; those of parts that do not bend are found once for a world.

    By the world's own corners, so that they are the same numbers in whatever state they are asked for first. Faces of
    parts that bend have a plane each.
    """
    triangles = state.world._triangles
    known = _flat.get(state.world)
    if known is None:
        known = _flat[state.world] = _FlatWidths(flat_widths(triangles.corners, rigid_planes(state.world)))
    found = known.without_curves.copy()
    bends = np.isin(faces.part, list(state._bent))
    found[bends] = flat_widths(faces.triangles.corners[bends], faces.plane[bends])
    if is_curved is None:
        return found
    for part in np.unique(faces.part[~bends & is_curved]).tolist():
        rows = slice(int(triangles.first[part]), int(triangles.first[part + 1]))
        apart, _ = known.of_part.get(part, (None, None))
        if apart is None or not np.array_equal(apart, is_curved[rows]):
            widths = flat_widths(triangles.corners[rows], faces.plane[rows])
            known.of_part[part] = is_curved[rows].copy(), widths
        found[rows] = known.of_part[part][1]
    return found


def _faces(
    state: WorldState, knobs: SbrSettings, frequency: float, chosen: list[int]
) -> tuple[FaceTable, CurvedFaces | None, dict[int, int], dict[int, tuple[int, float]]]:
    """Return the triangles of a state, and those that stand for a curved surface, each in a plane of its own.

    The last two are the number of coarse faces of the instances that mostly consist of them, and the number and the
    expected error [dB] of the uneven ones.
    """
    faces = face_table(state)
    if knobs.crease_angle_deg == 0.0:
        return faces, None, {}, {}
    parts = np.flatnonzero(np.isin(state.world.parts.instance, chosen))
    surface = state_surface(state, float(np.radians(knobs.crease_angle_deg)), parts)
    wavenumber = 2.0 * np.pi * frequency / SPEED_OF_LIGHT
    curved = CurvedFaces.of(surface, faces.triangles, wavenumber, knobs.surface_phase)
    coarse, instance = {}, state.world.parts.instance[faces.part]
    for number in np.unique(instance[surface.coarse]).tolist():
        own = np.flatnonzero(instance == number)
        if surface.take(own).coarse_share(faces.triangles.corners[own]) > MOSTLY_COARSE:
            coarse[number] = int(surface.coarse[own].sum())
    uneven = surface.uneven(faces.triangles.corners, instance.astype(np.int64))
    return faces if curved is None else replace(faces, plane=curved.apart(faces.plane)), curved, coarse, uneven
