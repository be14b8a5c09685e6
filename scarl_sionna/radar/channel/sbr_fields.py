"""What lit patches radiate back to the radar: physical optics with spherical waves, one row a patch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose
from scarl_sionna.radar.sbr.phase import triangle_phase_integral
from scarl_sionna.radar.sbr.surface import Surface, radiating_vector

from .images import spherical_basis
from .sbr_trace import Tubes

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Materials of the faces.

    Attributes
    ----------
    surface : tuple of Surface
    coherent : tuple of float
        Part of the reflected field that a rough surface keeps, sqrt(1 - S^2), S its scattering coefficient.
    of_face : ndarray of int64, shape (num_faces,)
    """

    surface: tuple[Surface, ...]
    coherent: tuple[float, ...]
    of_face: Index

    def reflect(self, face: Index, field: Complex, direction: Array, normal: Array) -> tuple[Complex, Array]:
        """Return reflected fields and directions; parameters of :meth:`Surface.reflect` with the face of each row."""
        reflected, onward = np.empty_like(field), np.empty_like(direction)
        number = self.of_face[face]
        for index in np.unique(number):
            rows = np.flatnonzero(number == index)
            part, onward[rows] = self.surface[index].reflect(field[rows], direction[rows], normal[rows])
            reflected[rows] = self.coherent[index] * part
        return reflected, onward


def radiated(
    tubes: Tubes,
    plane: tuple[Array, Array],
    surfaces: Surfaces,
    pose: Pose,
    wavenumber: float,
    integration_phase: float,
    velocity: Callable[[Index, Array], Array],
    radar_velocity: Array,
) -> dict[str, npt.NDArray[np.generic]]:
    r"""Return the columns of patches at their centres: end points, transfer, lengths and rate.

    Parameters
    ----------
    tubes : Tubes
        Patches over each of which the phase is all but linear.
    plane : tuple of ndarray
        Unit normals (num_faces, 3) and offsets (num_faces,) of all faces.
    surfaces : Surfaces
    pose : Pose
        world_from_radar.
    wavenumber : float
        At which the phase is integrated over a patch [rad/m].
    integration_phase : float
        See :func:`phase_integral` [rad].
    velocity : callable
        ``(face, point) -> velocity`` of surface points [m/s].
    radar_velocity : ndarray of float64, shape (3,)

    Notes
    -----
    With the image source at L, the radar at R from the patch's centre and the directions k, s of arrival and return,

    .. math:: a = -\frac{j}{8 \pi L R}\, \hat p_r \cdot (\eta J - \hat s \times M) \int e^{-j k (l(r) - l(r_0))} dA

    with the length l of the path over r. It does not depend on the frequency but through the integral.
    """
    normals, offsets = plane
    center = tubes.corners.mean(axis=1)
    depth, origin = tubes.depth, pose.position
    points = _vertices(tubes, center, normals, offsets)
    line = np.concatenate(
        [np.broadcast_to(origin, (len(tubes), 1, 3)), points, np.broadcast_to(origin, (len(tubes), 1, 3))], 1
    )
    step = np.diff(line, axis=1)
    travel = step / np.linalg.norm(step, axis=2, keepdims=True)
    field = spherical_basis(pose.rotation, travel[:, 0]).transpose(0, 2, 1).astype(np.complex128)
    reflected, onward = field, travel[:, 0]
    rate = radar_velocity @ (travel[:, -1] - travel[:, 0]).T
    for k in range(depth):
        face, arriving = tubes.face[:, k], travel[:, k]
        normal = normals[face]
        normal = -normal * np.sign(np.einsum("ij,ij->i", normal, arriving))[:, None]
        field = reflected
        reflected, onward = surfaces.reflect(face, field, arriving, normal)
        rate += np.einsum("ij,ij->i", velocity(face, points[:, k]), arriving - travel[:, k + 1])
    back = travel[:, -1]
    vector = radiating_vector(field, reflected, travel[:, -2], onward, normal, back)
    receive = spherical_basis(pose.rotation, -back)
    out = np.linalg.norm(center - tubes.image[:, -1], axis=1)
    home = np.linalg.norm(step[:, -1], axis=1)
    integral = phase_integral(tubes.corners, tubes.image[:, -1], origin, wavenumber, integration_phase)
    scale = -0.125j / np.pi * integral / (out * home)
    return {
        "tx_point": _unfolded(tubes, center, normals, offsets),
        "rx_point": center,
        "a": scale[:, None, None] * np.einsum("nri,nit->nrt", receive, vector),
        "length_rate": rate,
        "length": out + home,
        "cosine": np.abs(np.einsum("ij,ij->i", normal, back)),
    }


def phase_integral(corners: Array, source: Array, receiver: Array, wavenumber: float, largest: float) -> Complex:
    r"""Return the integrals over triangles of exp(-jk (length - length at the centre)) from sources to a receiver.

    Parameters
    ----------
    corners : ndarray of float64, shape (num_patches, 3, 3)
        [m].
    source : ndarray of float64, shape (num_patches, 3)
    receiver : ndarray of float64, shape (3,)
    wavenumber : float
        [rad/m].
    largest : float
        A triangle is cut into n^2 equal ones, so that the phase departs from a linear one by less than this at half of
        their sides [rad].

    Returns
    -------
    ndarray of complex128, shape (num_patches,)
        [m2].

    Notes
    -----
    Over each part the linear phase is integrated exactly, and the quadratic one enters by its mean, a 12th of the sum over
    the corners.
    """
    center = corners.mean(axis=1)
    middle = np.linalg.norm(center - source, axis=1) + np.linalg.norm(center - receiver, axis=1)
    side = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    curvature = 1.0 / np.linalg.norm(center - source, axis=1) + 1.0 / np.linalg.norm(center - receiver, axis=1)
    cuts = np.ceil(np.sqrt(wavenumber * side**2 * curvature / 8.0 / largest)).astype(np.int64)
    result = np.zeros(len(corners), dtype=np.complex128)
    for count in np.unique(cuts):
        rows = np.flatnonzero(cuts == count)
        for weights in _parts(int(count)):
            part = np.einsum("ij,njk->nik", weights, corners[rows])
            result[rows] += _linear_integral(part, source[rows], receiver, wavenumber, middle[rows])
    return result


def _linear_integral(corners: Array, source: Array, receiver: Array, wavenumber: float, length: Array) -> Complex:
    center = corners.mean(axis=1)
    offset = corners - center[:, None]
    arriving, leaving = center - source, receiver - center
    out, home = np.linalg.norm(arriving, axis=1), np.linalg.norm(leaving, axis=1)
    arriving, leaving = arriving / out[:, None], leaving / home[:, None]
    spread = _mean_square(offset, arriving) / out + _mean_square(offset, leaving) / home
    phase = wavenumber * (out + home - length + 0.5 * spread)
    integral = triangle_phase_integral(offset, wavenumber * (leaving - arriving))
    return np.asarray(integral * np.exp(-1j * phase))


@cache
def _parts(count: int) -> Array:
    """Return the corners of count^2 equal parts of a triangle in barycentric coordinates, shape (count^2, 3, 3)."""

    def node(i: int, j: int) -> tuple[float, float, float]:
        return i / count, j / count, (count - i - j) / count

    parts = []
    for i in range(count):
        for j in range(count - i):
            parts.append([node(i, j), node(i + 1, j), node(i, j + 1)])
            if i + j < count - 1:
                parts.append([node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)])
    return np.array(parts)


def _vertices(tubes: Tubes, center: Array, normals: Array, offsets: Array) -> Array:
    """Return the reflection points of the rays to the patches' centres, shape (num_patches, depth, 3)."""
    points = np.empty((len(tubes), tubes.depth, 3))
    points[:, -1] = center
    for k in range(tubes.depth - 2, -1, -1):
        normal, offset, image = normals[tubes.face[:, k]], offsets[tubes.face[:, k]], tubes.image[:, k + 1]
        ray = points[:, k + 1] - image
        share = (offset - np.einsum("ij,ij->i", normal, image)) / np.einsum("ij,ij->i", normal, ray)
        points[:, k] = image + share[:, None] * ray
    return points


def _unfolded(tubes: Tubes, center: Array, normals: Array, offsets: Array) -> Array:
    """Return the images of the patches' centres that the radar sees."""
    seen = center.copy()
    for k in range(tubes.depth - 2, -1, -1):
        normal = normals[tubes.face[:, k]]
        seen -= 2.0 * (np.einsum("ij,ij->i", normal, seen) - offsets[tubes.face[:, k]])[:, None] * normal
    return seen


def _mean_square(offset: Array, direction: Array) -> Array:
    """Return the mean over triangles about their centres of the squared distance across a direction [m2]."""
    along = np.einsum("nij,nj->ni", offset, direction)
    return (np.einsum("nij,nij->n", offset, offset) - np.einsum("ni,ni->n", along, along)) / 12.0
