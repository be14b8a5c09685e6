"""Image method in float64: lengths, directions, velocities and polarimetric transfer along chains of flat mirrors.

Chains of all paths are worked at once as padded arrays of shape (num_paths, max_depth). An interaction is a mirror
reflection, a passage straight through (refraction in Sionna RT's sense) or nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_norm
from scarl_sionna.scene.materials.fresnel import reflection
from scarl_sionna.scene.materials.rough import coherent_share, coherent_transmission
from scarl_sionna.scene.materials.table import RadioMaterial

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

Coefficients = Callable[[int, Array], tuple[Complex, Complex, Complex, Complex]]
"""``(k, cos_incidence) -> (reflection TE, TM, transmission TE, TM)`` of the k-th interaction of every path."""

SLACK = 0.05
"""Interaction points may be this far out of order along the ray [m]: small against every Fresnel zone at a radar's
range. In the edge of a corner they are one point, and rounding may swap them; a path this near to an edge is as right
with them swapped."""
_HEAD_ON = 1e-9
"""Below this sine of the angle of incidence any tangent serves as the TE direction."""


@dataclass(frozen=True, eq=False)
class Chain:
    """Mirrors and panes between two points, in the order from the first point.

    Attributes
    ----------
    mirror, pane : ndarray of bool, shape (num_paths, max_depth)
    normal, offset : ndarray of float64, shape (num_paths, max_depth, 3) and (num_paths, max_depth)
        Planes: normal . x = offset [m, world].
    """

    mirror: npt.NDArray[np.bool_]
    pane: npt.NDArray[np.bool_]
    normal: Array
    offset: Array

    @property
    def num_paths(self) -> int:
        """Number of paths."""
        return int(self.mirror.shape[0])

    @property
    def max_depth(self) -> int:
        """Columns of the arrays."""
        return int(self.mirror.shape[1])

    def images(self, end: Array) -> Array:
        """Return the images of the end points, shape (num_paths, max_depth + 1, 3) [m].

        Column k is the end as seen after the first k interactions: column 0 from the start, the last one the end
        itself.
        """
        seen = np.empty((self.num_paths, self.max_depth + 1, 3))
        seen[:, -1] = end
        for k in range(self.max_depth - 1, -1, -1):
            height = np.einsum("pi,pi->p", self.normal[:, k], seen[:, k + 1]) - self.offset[:, k]
            shift = np.where(self.mirror[:, k], 2.0 * height, 0.0)
            seen[:, k] = seen[:, k + 1] - shift[:, None] * self.normal[:, k]
        return seen

    def travel(self, start: Array, images: Array) -> Array:
        """Return the unit directions of travel, shape (num_paths, max_depth + 1, 3).

        They come from the images, not from the interaction points: those of a path into a right-angled corner coincide.
        Beyond a path's depth the last direction stands.
        """
        direction = images[:, 0] - start
        direction = direction / row_norm(direction)[:, None]
        out = [direction]
        for k in range(self.max_depth):
            n = np.where(self.mirror[:, k, None], self.normal[:, k], 0.0)
            direction = direction - 2.0 * np.einsum("pi,pi->p", n, direction)[:, None] * n
            out.append(direction)
        return np.stack(out, axis=1)

    def vertices(self, start: Array, images: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
        """Return the interaction points, shape (num_paths, max_depth, 3) [m], and which paths meet all planes in order.

        Beyond a path's depth the end point stands. Points may be `SLACK` out of order: in a right-angled corner they
        are one, up to rounding.
        """
        points = np.empty((self.num_paths, self.max_depth, 3))
        here = np.broadcast_to(start, (self.num_paths, 3)).copy()
        right = np.ones(self.num_paths, dtype=bool)
        for k in range(self.max_depth):
            used = self.mirror[:, k] | self.pane[:, k]
            ahead = images[:, k] - here
            slope = np.einsum("pi,pi->p", self.normal[:, k], ahead)
            height = self.offset[:, k] - np.einsum("pi,pi->p", self.normal[:, k], here)
            share = np.divide(height, slope, out=np.ones_like(slope), where=used & (slope != 0.0))
            slack = SLACK / np.maximum(row_norm(ahead), SLACK)
            right &= ~used | ((share > -slack) & (share < 1.0 + slack))
            here = np.where(used[:, None], here + share[:, None] * ahead, here)
            points[:, k] = np.where(used[:, None], here, images[:, -1])
        return points, right

    def isometry(self) -> Array:
        """Return what maps the end point to its image seen from the start, shape (num_paths, 3, 4)."""
        out = np.zeros((self.num_paths, 3, 4))
        out[:, :, :3] = np.eye(3)
        for k in range(self.max_depth - 1, -1, -1):
            n = np.where(self.mirror[:, k, None], self.normal[:, k], 0.0)
            out -= 2.0 * n[:, :, None] * np.einsum("pi,pij->pj", n, out)[:, None, :]
            out[:, :, 3] += 2.0 * np.where(self.mirror[:, k], self.offset[:, k], 0.0)[:, None] * n
        return out

    def image_velocity(self, end_velocity: Array, surface_velocity: Array) -> Array:
        """Return the velocity of the end's image seen from the start, shape (num_paths, 3) [m/s].

        `surface_velocity`, shape (num_paths, max_depth, 3), is that of the mirrors at the interaction points: exact for
        the rate of the length, rotation of the mirrors included.
        """
        velocity = np.broadcast_to(end_velocity, (self.num_paths, 3)).copy()
        for k in range(self.max_depth - 1, -1, -1):
            n = np.where(self.mirror[:, k, None], self.normal[:, k], 0.0)
            closing = np.einsum("pi,pi->p", n, velocity - surface_velocity[:, k])
            velocity -= 2.0 * closing[:, None] * n
        return velocity


def spherical_basis(rotation: Array, direction: Array) -> Array:
    """Return theta-hat and phi-hat of unit directions, shape (num_paths, 2, 3) in world axes.

    `rotation` holds the frame's axes as columns (world_from_frame). Along the frame's z axis phi = 0 is taken.
    """
    local = direction @ rotation
    flat = np.hypot(local[:, 0], local[:, 1])
    cos_phi = np.divide(local[:, 0], flat, out=np.ones_like(flat), where=flat > 1e-12)
    sin_phi = np.divide(local[:, 1], flat, out=np.zeros_like(flat), where=flat > 1e-12)
    theta = np.stack([local[:, 2] * cos_phi, local[:, 2] * sin_phi, -flat], axis=1)
    phi = np.stack([-sin_phi, cos_phi, np.zeros_like(flat)], axis=1)
    return np.stack([theta, phi], axis=1) @ rotation.T


def transfer(chain: Chain, travel: Array, tx_basis: Array, rx_basis: Array, coefficients: Coefficients) -> Complex:
    """Return the polarimetric transfer of the chains without spreading, shape (num_paths, 2, 2).

    Parameters
    ----------
    chain : Chain
    travel : ndarray of float64, shape (num_paths, max_depth + 1, 3)
        Directions of travel before and after each interaction.
    tx_basis, rx_basis : ndarray of float64, shape (num_paths, 2, 3)
        Polarisations at both ends, world axes.
    coefficients : callable
        ``(k, cos_incidence) -> (reflection TE, TM, transmission TE, TM)`` of the k-th interaction of every path.

    Returns
    -------
    ndarray of complex128
        Rows: received; columns: transmitted.
    """
    field = propagated(chain, travel, tx_basis.astype(np.complex128), coefficients)
    return np.einsum("pri,pti->prt", rx_basis, field)


def propagated(chain: Chain, travel: Array, field: Complex, coefficients: Coefficients) -> Complex:
    """Return fields behind the chains, shape (num_paths, num_fields, 3), from those before.

    The other parameters are those of `transfer`.
    """
    before = travel[:, 0]
    for k in range(chain.max_depth):
        used = chain.mirror[:, k] | chain.pane[:, k]
        after = np.where(used[:, None], travel[:, k + 1], before)
        n = chain.normal[:, k]
        cosine = np.clip(np.abs(np.einsum("pi,pi->p", before, n)), 0.0, 1.0)
        r_te, r_tm, t_te, t_tm = coefficients(k, np.where(used, cosine, 1.0))
        te_axis = _te_axis(before, n)
        te = np.where(chain.mirror[:, k], r_te, t_te)[:, None] * np.einsum("pi,pqi->pq", te_axis, field)
        tm = np.where(chain.mirror[:, k], r_tm, t_tm)[:, None] * np.einsum(
            "pi,pqi->pq", np.cross(te_axis, before), field
        )
        onward = te[:, :, None] * te_axis[:, None] + tm[:, :, None] * np.cross(te_axis, after)[:, None]
        field = np.where(used[:, None, None], onward, field)
        before = after
    return field


def _te_axis(direction: Array, normal: Array) -> Array:
    """Return unit vectors across the planes of incidence."""
    axis = np.cross(direction, normal)
    length = row_norm(axis)
    head_on = length < _HEAD_ON
    if head_on.any():
        helper = np.eye(3)[np.abs(direction[head_on]).argmin(axis=1)]
        axis[head_on] = np.cross(helper, direction[head_on])
        length[head_on] = np.linalg.norm(axis[head_on], axis=1)
    return axis / length[:, None]


def material_coefficients(
    materials: list[RadioMaterial], index: npt.NDArray[np.int64], frequency: float
) -> Coefficients:
    """Return the coefficients of chains for :func:`transfer`.

    Parameters
    ----------
    materials : list of RadioMaterial
    index : ndarray of int64, shape (num_paths, max_depth)
        Row of `materials` for each interaction, -1 for none.
    frequency : float
        [Hz].

    Notes
    -----
    Of a rough surface only the coherent part of the field is reflected, :func:`.rough.coherent_share`, and passes,
    :func:`.rough.coherent_transmission`.
    """

    def coefficients(k: int, cosine: Array) -> tuple[Complex, Complex, Complex, Complex]:
        out = np.zeros((4, len(cosine)), dtype=np.complex128)
        for number in np.unique(index[:, k]):
            if number < 0:
                continue
            rows = np.flatnonzero(index[:, k] == number)
            own, met = materials[number], cosine[rows]
            out[:2, rows] = np.stack(reflection(own, frequency, met)) * coherent_share(own, frequency, met)
            out[2:, rows] = np.stack(coherent_transmission(own, frequency, met))
        return out[0], out[1], out[2], out[3]

    return coefficients
