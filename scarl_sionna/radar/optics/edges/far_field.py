"""What the edges of a body scatter into the far field beyond physical optics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.settings.sbr import SbrSettings

from ..body.mesh import Body
from ..plane_waves import Plan
from ..surfaces import PartSurfaces
from .across import Crossed, Crossings, crossed, crossings
from .wedges import Wedges, edge_current, free_standing, hidden, wedges_of

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.int64]

FEWEST_PIECES = 8
"""Into which an edge is cut, so that what hides a part of it is found; the phase is integrated exactly over any."""

_known: WeakKeyDictionary[object, dict[tuple[float, float, float], Wedges]] = WeakKeyDictionary()
"""By the rays of a body, crease angle, spacing and wavelength."""


def body_wedges(body: Body, settings: SbrSettings, wavelength: float) -> Wedges:
    """Return the edges of a body in pieces.

    Parameters
    ----------
    body : Body
    settings : SbrSettings
        Those of :meth:`.SbrSettings.for_size`.
    wavelength : float
        [m].
    """
    crease, spacing = float(np.radians(settings.crease_angle_deg)), float(settings.spacings(wavelength)[0])
    known = _known.setdefault(body.rays, {})
    key = (crease, spacing, wavelength)
    if key not in known:
        corners = body.triangles.corners
        whole = wedges_of(corners, np.arange(len(corners)), crease)
        length = np.linalg.norm(whole.stop - whole.start, axis=1)
        pieces = whole.cut(np.maximum(np.ceil(length / spacing), FEWEST_PIECES).astype(np.int64))
        known[key] = free_standing(body.rays, pieces, wavelength)
    return known[key]


def add_edges(result: Complex, body: Body, surfaces: PartSurfaces, plan: Plan, settings: SbrSettings) -> None:
    """Add the far fields of edges to scattering matrices (num_looks, 4), in place; parameters as of the tubes'."""
    waves = plan.waves
    wedges = body_wedges(body, settings, float(waves.wavelength.min()))
    if not len(wedges):
        return
    level, plane = surfaces.conduction(body.part[wedges.face]), body.plane[wedges.face]
    for wave in range(len(waves.direction)):
        towards = np.broadcast_to(-waves.direction[wave], (len(wedges), 3))
        lit = np.flatnonzero(wedges.outside(towards) & level.any(axis=1))
        lit = lit[~hidden(body.rays, wedges.take(lit), towards[lit])]
        if not len(lit):
            continue
        ways = crossings(wedges, plane, lit, -towards[lit])
        for view in range(int(plan.first_view[wave]), int(plan.first_view[wave + 1])):
            target = _Target(result, body, plan, wave, view)
            target.add_single(wedges.take(lit), level[lit])
            target.add_double(wedges, level, ways)


@dataclass(frozen=True, eq=False)
class _Target:
    """Where fields towards one observer are added: the matrices of all frequencies of a view."""

    result: Complex
    body: Body
    plan: Plan
    wave: int
    view: int

    def add_single(self, wedges: Wedges, level: Complex) -> None:
        """Add what pieces of edges that the wave meets radiate."""
        observer = np.broadcast_to(self.plan.observer[self.view], (len(wedges), 3))
        if not self.plan.backward[self.view]:
            seen = ~wedges.outside(observer)
            tested = np.flatnonzero(~seen)
            seen[tested] = ~hidden(self.body.rays, wedges.take(tested), observer[tested])
            wedges, level, observer = wedges.take(seen), level[seen], observer[seen]
        current = edge_current(wedges, level, *self._incident(len(wedges)), observer)
        self._add(current, wedges.start, wedges.stop, np.zeros((len(wedges), 2)), _alone)

    def add_double(self, wedges: Wedges, level: Complex, ways: Crossings) -> None:
        """Add what comes over faces to further pieces and is radiated there."""
        observer = np.broadcast_to(self.plan.observer[self.view], (len(ways), 3))
        second = wedges.take(ways.second)
        seen = second.outside(observer) & ~hidden(self.body.rays, second, observer)
        if seen.any():
            ways, observer = ways.take(seen), observer[seen]
            found = crossed(wedges, level, ways, *self._incident(len(ways)), observer)
            # where the phase of the first edge is that of the second, less the way across
            first = found.length + np.einsum(
                "nei,i->ne",
                np.stack([wedges.start[ways.first], wedges.stop[ways.first]], axis=1)
                - np.stack([found.start, found.stop], axis=1),
                self.plan.waves.direction[self.wave],
            )
            for number, current in enumerate((found.end, found.fringe)):
                self._add(current, found.start, found.stop, first, partial(_part, found, number))

    def _incident(self, count: int) -> tuple[Array, Complex]:
        waves = self.plan.waves
        field = np.broadcast_to(waves.field[self.wave], (count, 3, 2)).astype(np.complex128)
        return np.broadcast_to(waves.direction[self.wave], (count, 3)), field

    def _add(
        self, current: Complex, start: Array, stop: Array, extra: Array, strength: Callable[[Array], npt.NDArray[Any]]
    ) -> None:
        """Add the fields of lines with a linear phase; `extra` (n, 2) is further path at both ends [m]."""
        plan = self.plan
        amplitude = np.einsum("ri,nit->nrt", plan.receive[self.view], current).reshape(-1, 4)
        difference = plan.observer[self.view] - plan.waves.direction[self.wave]
        path = np.stack([start @ difference, stop @ difference], axis=1) - extra
        length = np.linalg.norm(stop - start, axis=1)
        looks = slice(int(plan.first_look[self.view]), int(plan.first_look[self.view + 1]))
        k = plan.wavenumber[looks][:, None]
        factor = -0.25j / np.pi * length * strength(k)
        factor = factor * np.sinc(k * (path[:, 1] - path[:, 0]) / (2.0 * np.pi)) * np.exp(1j * k * path.mean(axis=1))
        self.result[plan.look[looks]] += factor @ amplitude


def _alone(wavenumber: Array) -> Array:
    return np.ones((1, 1))


def _part(found: Crossed, number: int, wavenumber: Array) -> Complex:
    return found.strength(wavenumber)[number]
