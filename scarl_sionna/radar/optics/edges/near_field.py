"""What the edges of a scene's bodies scatter between two stations beyond physical optics: one row a piece of edge."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.rays.face_planes import FaceTable
from scarl_sionna.engine.rays.face_rays import StateRays
from scarl_sionna.engine.world import WorldState
from scarl_sionna.scene.materials.fresnel import reflection

from ..patches import PatchSize, too_many_patches
from ..tubes.probes import SAME_DISTANCE
from ..viewpoint import Viewpoint
from .wedges import Wedges, blocked, edge_current, free_standing, wedges_of

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.int64]
Columns = dict[str, npt.NDArray[Any]]

_LIFTS = 4.0
"""Ends of rays to edges stand so many times as far off as starts of rays on faces."""


@dataclass(frozen=True, eq=False)
class EdgeView:
    """Two stations that see a state of the world: what the edges of a solve have in common.

    Attributes
    ----------
    state : WorldState
    faces : FaceTable
    rays : StateRays
    tx, rx : Viewpoint
        The same object for a monostatic radar.
    reach : float
        Paths longer than twice this are dropped [m].
    size : PatchSize
    max_pieces : int
    """

    state: WorldState
    faces: FaceTable
    rays: StateRays
    tx: Viewpoint
    rx: Viewpoint
    reach: float
    size: PatchSize
    max_pieces: int

    def pieces(self, instances: Iterable[int], crease_angle: float) -> Wedges:
        """Return the pieces of the instances' edges that both stations see, each with a phase that is all but linear.

        Parameters
        ----------
        instances : iterable of int
        crease_angle : float
            [rad].

        Raises
        ------
        ParameterRangeError
            If there are more than `max_pieces`.
        """
        of_face = self.state.world.parts.instance[self.faces.part]
        corners = self.faces.triangles.corners
        found = []
        for number in instances:
            rows = np.flatnonzero(of_face == number)
            if len(rows):
                found.append(self._in_view(wedges_of(corners[rows], rows, crease_angle)))
        if not found:
            return wedges_of(corners[:0], np.zeros(0, dtype=np.int64), crease_angle)
        whole = Wedges(
            *(np.concatenate(columns) for columns in zip(*(vars(one).values() for one in found), strict=True))
        )
        small = self._in_view(self._cut(whole))
        seen = small.take(self._is_seen(small))
        return free_standing(self.rays, seen, 2.0 * np.pi / self.size.wavenumber)

    def _in_view(self, wedges: Wedges) -> Wedges:
        """Return those whose outside holds both stations, as far as their middles tell."""
        kept = np.ones(len(wedges), dtype=np.bool_)
        for station in (self.tx, self.rx):
            kept &= wedges.outside(station.pose.position - wedges.center)
        return wedges.take(kept)

    def _cut(self, wedges: Wedges) -> Wedges:
        """Return them in pieces that are as long as patches may be."""
        if not len(wedges):
            return wedges
        line = np.stack([wedges.start, wedges.stop, wedges.center], axis=1)
        source = self.tx.pose.position[None]
        excess = self.size.excess(line, source, np.zeros(len(wedges), dtype=np.int64), self.rx.pose.position)
        count = np.maximum(np.ceil(excess.max(axis=1)), 1.0)
        if count.sum() > self.max_pieces:
            too_many_patches(self.max_pieces)
        return wedges.cut(count.astype(np.int64))

    def _is_seen(self, wedges: Wedges) -> npt.NDArray[np.bool_]:
        """Return which middles are in the view of both stations, with nothing in between."""
        point = wedges.center
        lift = _LIFTS * self.rays.lift_of(point)
        off = point + lift[:, None] * wedges.middle()
        length = sum(np.linalg.norm(point - station.pose.position, axis=1) for station in (self.tx, self.rx))
        seen = np.asarray(length < 2.0 * self.reach)
        for station in (self.tx,) if self.rx is self.tx else (self.tx, self.rx):
            rows = np.flatnonzero(seen & station.sees(point))
            start = np.broadcast_to(station.pose.position, (len(rows), 3))
            before = start + (1.0 - SAME_DISTANCE) * (off[rows] - start)
            clear = rows[~blocked(self.rays, start, before)] if len(rows) else rows
            seen = np.zeros(len(wedges), dtype=np.bool_)
            seen[clear] = True
        return seen

    def conduction(self, face: Index) -> Complex:
        """Return by what the fringe currents of a perfect conductor are scaled, for faces (n, 2): -reflection."""
        table, part = self.state.world.parts, self.faces.part[face]
        frequency = self.size.wavenumber * SPEED_OF_LIGHT / (2.0 * np.pi)
        level = np.zeros(len(table.name), dtype=np.complex128)
        for number in np.unique(part).tolist():
            material = self.state.world.materials[table.material[number]]
            level[number] = -material.coherence * reflection(material, frequency, np.ones(1))[0][0]
        return level[part]


def edge_rows(view: EdgeView, wedges: Wedges) -> Columns:
    r"""Return the columns of pieces of edges, as of patches of one bounce.

    Parameters
    ----------
    view : EdgeView
    wedges : Wedges
        Of :meth:`EdgeView.pieces`.

    Notes
    -----
    With the distances L and R of the stations, the fringe current K (:func:`.fringe.fringe_current`) and the length of
    the path l over the piece,

    .. math:: a = -\frac{j}{8 \pi k L R}\, \hat p_r \cdot K \int e^{-j k (l(r) - l(r_0))} dr

    The wave is a plane one for the wedge: right where k L and k R are large.

    References
    ----------
    .. [1] A. Michaeli, "Elimination of infinities in equivalent edge currents, part I: Fringe current components", IEEE
           Trans. Antennas Propag. 34(7), 1986.
    """
    k, point = view.size.wavenumber, wedges.center
    arriving, out = _unit(point - view.tx.pose.position)
    leaving, home = _unit(view.rx.pose.position - point)
    field = _basis(view.tx.pose, arriving).transpose(0, 2, 1).astype(np.complex128)
    current = edge_current(wedges, view.conduction(wedges.face), arriving, field, leaving)
    along = wedges.stop - wedges.start
    length = np.linalg.norm(along, axis=1)
    slope = np.einsum("ij,ij->i", along, arriving - leaving)
    bend = sum(
        (length**2 - np.einsum("ij,ij->i", along, ray) ** 2) / distance
        for ray, distance in ((arriving, out), (leaving, home))
    )
    integral = length * np.sinc(k * slope / (2.0 * np.pi)) * np.exp(-1j * k * bend / 24.0)
    transfer = np.einsum("nri,nit->nrt", _basis(view.rx.pose, -leaving), current)
    transfer = -0.125j / (np.pi * k) * (integral / (out * home))[:, None, None] * transfer
    part = view.faces.part[wedges.face[:, 0]]
    moving = view.state.point_velocity(part, point)
    rate = np.einsum("ij,ij->i", moving, arriving - leaving)
    rate += leaving @ view.rx.velocity - arriving @ view.tx.velocity
    parts, count = view.state.world.parts, len(wedges)
    return {
        "tx_point": point,
        "rx_point": point,
        "tx_velocity": moving - view.tx.velocity,
        "rx_velocity": moving - view.rx.velocity,
        "length_rate": rate,
        "length": out + home,
        "cosine": np.ones(count),
        "a": transfer,
        "instance": parts.instance[part][:, None],
        "semantic": parts.semantic[part],
        "depth": np.ones(count, dtype=np.int32),
        "kind": np.zeros(count, dtype=np.int8),
    }


def _unit(arm: Array) -> tuple[Array, Array]:
    length = np.sqrt(np.einsum("ij,ij->i", arm, arm))
    return arm / length[:, None], length


def _basis(pose: Pose, direction: Array) -> Array:
    """Return theta-hat and phi-hat in world axes, shape (n, 2, 3); phi = 0 along the frame's z axis."""
    local = direction @ pose.rotation
    flat = np.hypot(local[:, 0], local[:, 1])
    upright = flat <= 1e-12
    safe = np.where(upright, 1.0, flat)
    cosine, sine = np.where(upright, 1.0, local[:, 0] / safe), np.where(upright, 0.0, local[:, 1] / safe)
    theta = np.stack([local[:, 2] * cosine, local[:, 2] * sine, -flat], axis=1)
    phi = np.stack([-sine, cosine, np.zeros_like(sine)], axis=1)
    return np.stack([theta, phi], axis=1) @ pose.rotation.T
