"""The ray tubes of a body kept, so that its scattering matrix for other materials costs no tracing."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.settings.sbr import DEFAULT_SBR, SbrSettings

from .body.mesh import Body
from .far_field import both_senses, footprints_seen, phase_weights
from .fields import HOST, Wave, radiating_vector
from .plane_waves import Looks, Plan, bounces, plan_of
from .surfaces import PartSurfaces

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.int64]
Columns: TypeAlias = "dict[str, npt.NDArray[Any]]"


class _Numbering(PartSurfaces):
    """Surfaces that write each tube's number in place of its field: the next bounce knows where it came from."""

    def __init__(self) -> None:
        super().__init__()
        object.__setattr__(self, "count", 0)

    def reflect(self, part: Index, field: Complex, direction: Array, normal: Array) -> tuple[Complex, Array]:
        """Return the numbers of the tubes and the directions in which they go on."""
        first: int = self.__dict__["count"]
        object.__setattr__(self, "count", first + len(part))
        numbers = np.arange(first, first + len(part), dtype=np.complex128)
        cosine = -np.einsum("ij,ij->i", direction, normal)
        onward = direction + 2.0 * cosine[:, None] * normal
        return np.broadcast_to(numbers[:, None, None], field.shape).copy(), onward


@dataclass(frozen=True, eq=False)
class FixedTubes:
    """Ray tubes of a body under some looks at one frequency; made by :meth:`trace`.

    Attributes
    ----------
    plan : Plan
    first : ndarray of int64, shape (max_depth + 1,)
        Tubes of bounce d are rows first[d - 1] to first[d]; all with the same way over the same planes are one row.
    source : ndarray of int64, shape (num_tubes,)
        Wave of a tube of the first bounce, else the tube that it is the reflection of.
    part : ndarray of int64, shape (num_tubes,)
    direction, normal : ndarray of float64, shape (num_tubes, 3)
    tube, view, look : ndarray of int64, shape (num_seen,)
        Tubes that observers see.
    weight : ndarray of complex128, shape (num_seen,)
        Sum of the phase integrals of what is seen.
    """

    plan: Plan
    first: Index
    source: Index
    part: Index
    direction: Array
    normal: Array
    tube: Index
    view: Index
    look: Index
    weight: Complex

    @classmethod
    def trace(
        cls, body: Body, looks: Looks, settings: SbrSettings = DEFAULT_SBR, rounded: Collection[int] = ()
    ) -> FixedTubes:
        """Trace the tubes; which way they go depends on no material but for the parts that are `rounded`.

        These are :attr:`.PartSurfaces.rounded`, whose faces stand for a body that is curved everywhere.

        Raises
        ------
        ParameterRangeError
            If the looks have more than one frequency.
        """
        if len(np.unique(looks.frequency)) != 1:
            raise ParameterRangeError("frequency", "several", "one: a material is valid at one frequency", "trace each")
        plan = plan_of(looks)
        body = body.with_curves(settings, float(plan.wavenumber.max()), rounded)
        settings = settings.for_size(body.size / float(plan.waves.wavelength.min()))
        count = len(plan.waves.direction)
        numbers = replace(plan.waves, field=np.broadcast_to(np.arange(count)[:, None, None], (count, 3, 1)))
        surfaces = _Numbering()
        columns: dict[str, list[npt.NDArray[Any]]] = {}
        for bounce in bounces(body, surfaces, numbers, settings):
            own = bounce.reflected[:, 0, 0].real.astype(np.int64)
            _append(
                columns,
                own=own,
                depth=np.full(len(own), bounce.depth),
                part=bounce.tubes.part,
                source=bounce.tubes.incident[:, 0, 0].real.astype(np.int64),
                direction=bounce.tubes.direction,
                normal=bounce.tubes.normal,
            )
            for tube, view, corners in footprints_seen(body, bounce, plan, settings):
                if not len(tube):
                    continue
                look, pair, factor = phase_weights(body.curved, bounce, plan, (tube, view, corners))
                _append(columns, tube=own[tube[pair]], view=view[pair], look=look, weight=factor)
        table = {name: np.concatenate(pieces) for name, pieces in columns.items()}
        return cls._merged(plan, table)

    @classmethod
    def _merged(cls, plan: Plan, table: Columns) -> FixedTubes:
        """Return the tubes in the order of their bounces.

        Those with the same way over the same planes carry one field and become one.
        """
        if "own" not in table:
            raise ParameterRangeError("looks", "none that lights the body", "at least one")
        kept: list[Columns] = []
        group = np.empty(len(table["own"]), dtype=np.int64)
        first = [0]
        for depth in range(1, int(table["depth"].max()) + 1):
            rows = np.flatnonzero(table["depth"] == depth)
            source = table["source"][rows] if depth == 1 else group[table["source"][rows]]
            order, number = _grouped([source, table["part"][rows], *table["normal"][rows].T])
            group[table["own"][rows]] = first[-1] + number
            one = rows[order]
            kept.append(
                {"source": source[order], **{name: table[name][one] for name in ("part", "direction", "normal")}}
            )
            first.append(first[-1] + len(order))
        seen = {name: table.get(name, np.zeros(0, np.int64)) for name in ("tube", "view", "look", "weight")}
        tube = group[seen["tube"]]
        order, number = _grouped([tube, seen["view"], seen["look"]])
        weight = np.bincount(number, seen["weight"].real, len(order)) + 1j * np.bincount(
            number, seen["weight"].imag, len(order)
        )
        joined = {name: np.concatenate([one[name] for one in kept]) for name in kept[0]}
        return cls(
            plan,
            np.array(first),
            **joined,
            tube=tube[order],
            view=seen["view"][order],
            look=seen["look"][order],
            weight=weight,
        )

    def matrices(self, surfaces: PartSurfaces) -> Complex:
        """Return the scattering matrices, shape (num_looks, 2, 2) [m], as :func:`.scattering_matrices` up to rounding.

        The permittivities of `surfaces` may be any complex numbers: the result is holomorphic in them.
        """
        incident = np.empty((len(self.source), 3, 2), dtype=np.complex128)
        reflected, onward = np.empty_like(incident), np.empty_like(self.direction)
        for depth in range(1, len(self.first)):
            rows = slice(self.first[depth - 1], self.first[depth])
            source = self.source[rows]
            incident[rows] = self.plan.waves.field[source] if depth == 1 else reflected[source]
            reflected[rows], onward[rows] = surfaces.reflect(
                self.part[rows], incident[rows], self.direction[rows], self.normal[rows]
            )
        tube, view = self.tube, self.view
        vector = radiating_vector(
            HOST,
            Wave(incident[tube], self.direction[tube]),
            Wave(reflected[tube], onward[tube]),
            self.normal[tube],
            self.plan.observer[view],
        )
        fields = self.weight[:, None] * np.einsum("nri,nit->nrt", self.plan.receive[view], vector).reshape(-1, 4)
        count = len(self.plan.look)
        columns = [np.bincount(self.look, c.real, count) + 1j * np.bincount(self.look, c.imag, count) for c in fields.T]
        return both_senses(np.stack(columns, axis=1).reshape(-1, 2, 2), self.plan.looks.is_backward)


def _append(columns: dict[str, list[npt.NDArray[Any]]], **values: npt.NDArray[Any]) -> None:
    for name, value in values.items():
        columns.setdefault(name, []).append(value)


def _grouped(keys: Sequence[npt.NDArray[Any]]) -> tuple[Index, Index]:
    """Return a row of each group of equal rows, and the group of every row."""
    order = np.lexsort(keys[::-1])
    starts = np.zeros(len(order), dtype=bool)
    starts[:1] = True
    for key in keys:
        starts[1:] |= np.diff(key[order]) != 0
    number = np.empty(len(order), dtype=np.int64)
    number[order] = np.cumsum(starts) - 1
    return order[starts], number
