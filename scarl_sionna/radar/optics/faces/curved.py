"""Footprints on faces that stand for a curved surface: where their points really are, and phase integrals over them.

Rays see flat faces; what is curved is the phase. A footprint is cut into parts so small that the phase over each one
departs little from a linear one, and their corners are moved onto the surface. The currents are those of the flat face,
weighted with what a part shows to the direction that mirrors the wave into the scattered one: at the points of
stationary phase, which make the echo, the surface is turned that way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.device import Device
from scarl_sionna.engine.rays.geometry import Triangles
from scarl_sionna.engine.smooth.surface import Surface
from scarl_sionna.engine.types import DeviceArray
from scarl_sionna.radar.optics.fields import HOST, OnDevice, second_difference
from scarl_sionna.radar.optics.phase import Pair, over_parts, plane_wave_integral

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

FLAT_ENOUGH = 0.02
"""Faces over which the surface turns the phase there and back by less than this [rad] are taken as flat: 2e-4 of the
amplitude."""
CENTROID = 0.75
"""Mean over a triangle of a quadratic that is zero at its corners, as a part of its value at the centroid."""
ALIGNED = 0.9
"""Length of the sum of a face's lifts, as a part of the sum of their lengths, from which they point to one side."""
THIRD = 9.0 / 8.0
"""Height of a parabola in the middle of its chord, in that at a third of it."""
MOST_SHOWN = 1.25
"""A part of a curved face counts for at most so many times its flat area: more than the 1 / cos^2 by which it can turn
to the mirror direction where the phase is stationary, which only grazing faces exceed."""
_GRAZING = 1e-6


@dataclass(frozen=True, eq=False)
class CurvedFaces:
    """The faces of a mesh or scene that stand for a curved surface, at some wavenumber.

    Attributes
    ----------
    is_curved : ndarray of bool, shape (num_faces,)
    row : ndarray of int64, shape (num_faces,)
        Of a curved face in the other arrays.
    origin : ndarray of float64, shape (num_curved, 3)
        Corner 0 [m].
    gradient : ndarray of float64, shape (num_curved, 2, 3)
        Of the barycentric coordinates of corners 1 and 2 [1/m].
    lift, slant : ndarray of float64, shape (num_curved, 3, 3)
    middle : ndarray of float64, shape (num_curved, 3)
        See :class:`~scarl_sionna.engine.smooth.surface.Surface` [m].
    length : ndarray of float64, shape (num_curved, 3)
        Of the lifts; zeros where they point to different sides [m].
    height, rounding : ndarray of float64, shape (num_curved,)
        See :class:`~scarl_sionna.engine.smooth.surface.Surface` [m].
    largest : float
        The phase departs from a linear one by less than this over the sides of a part [rad].
    """

    is_curved: Mask
    row: Index
    origin: Array
    gradient: Array
    lift: Array
    slant: Array
    middle: Array
    length: Array
    height: Array
    rounding: Array
    largest: float

    @classmethod
    def of(cls, surface: Surface | None, triangles: Triangles, wavenumber: float, largest: float) -> CurvedFaces | None:
        """Return the faces that are not flat enough at a wavenumber [rad/m], None where there are none."""
        if surface is None:
            return None
        is_curved = 2.0 * wavenumber * surface.height > FLAT_ENOUGH
        if not is_curved.any():
            return None
        corners = triangles.corners[is_curved]
        one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        aa, ab, bb = (np.einsum("ij,ij->i", *pair)[:, None] for pair in ((one, one), (one, two), (two, two)))
        gradient = np.stack([bb * one - ab * two, aa * two - ab * one], axis=1) / (aa * bb - ab**2)[:, None]
        row = np.cumsum(is_curved) - 1
        own = surface.take(np.flatnonzero(is_curved))
        length = np.sqrt(np.einsum("nij,nij->ni", own.lift, own.lift))
        total = np.sqrt(np.einsum("ni,ni->n", own.lift.sum(axis=1), own.lift.sum(axis=1)))
        length[total < ALIGNED * length.sum(axis=1)] = 0.0
        shape = own.lift, own.slant, own.middle, length, own.height, own.rounding
        return cls(is_curved, row, corners[:, 0], gradient, *shape, largest)

    def apart(self, plane: Index) -> Index:
        """Return numbers of planes in which every curved face has one of its own."""
        own = int(plane.max(initial=0)) + 1 + self.row
        return np.asarray(np.where(self.is_curved, own, plane))

    def on_surface(self, row: Index, points: Array) -> Array:
        """Return the points of the surface for which points (n, k, 3) of curved faces stand; `row` (n,).

        Beyond the face the surface goes on as far as its lift is no larger than inside: corners of a tube that grazes a
        face can lie many sides away, where a parabola would be hundreds of metres high and cut into millions of parts.
        """
        second, third = np.moveaxis(
            np.einsum("nki,nci->nkc", points - self.origin[row, None], self.gradient[row]), 2, 0
        )[..., None]
        first = 1.0 - second - third
        weight = np.clip(4.0 * np.stack([first * second, second * third, third * first]), -1.0, 1.0)
        towards = np.clip(np.stack([first - second, second - third, third - first]), -1.0, 1.0)
        lift = (weight * np.moveaxis(self.lift[row], 1, 0)[:, :, None]).sum(axis=0)
        length = np.sqrt(np.einsum("nki,nki->nk", lift, lift))
        spread = np.einsum("enk,ne->nk", weight[..., 0], self.length[row]) - length
        factor = 1.0 + np.maximum(spread, 0.0) / np.maximum(length, 1e-300)
        factor *= 1.0 + self.rounding[row, None] * (1.0 - length / self.height[row, None])
        uneven = (0.25 * weight * towards * np.moveaxis(self.slant[row], 1, 0)[:, :, None]).sum(axis=0)
        uneven += np.clip(27.0 * first * second * third, -1.0, 1.0) * self.middle[row][:, None]
        return np.asarray(points + lift * factor[..., None] + uneven)

    def plane_wave_integral(self, face: Index, corners: Array, wave_vector: Array, normal: Array) -> Complex:
        """Return the integral of exp(j q . r) over footprints, shape (n,) [m2], those on flat faces among them.

        Parameters as of :func:`parts_of` and :func:`~scarl_sionna.radar.optics.phase.plane_wave_integral`.
        """
        bent = self.is_curved[face]
        flat = np.flatnonzero(~bent)
        result = np.empty(len(face), dtype=np.complex128)
        result[flat] = plane_wave_integral(corners[flat], wave_vector[flat])
        rows = np.flatnonzero(bent)
        if not len(rows):
            return result
        parts = parts_of(self, face[rows], corners[rows], wave_vector[rows], normal[rows])
        q = wave_vector[rows][parts.footprint]
        phase = np.einsum("nij,nj->in", parts.corners, q)
        mean = (phase[0] + phase[1] + phase[2]) / 3.0
        real, imaginary = second_difference(HOST, *(phase - mean))
        value = 2.0 * parts.area * np.exp(1j * mean) * (real + 1j * imaginary)
        result[rows] = np.bincount(parts.footprint, value.real, len(rows))
        result[rows] += 1j * np.bincount(parts.footprint, value.imag, len(rows))
        return result


@dataclass(frozen=True, eq=False)
class Parts:
    """Parts of footprints on curved faces.

    Attributes
    ----------
    corners : ndarray of float64, shape (num_parts, 3, 3)
        On the surface, but moved by its mean height over the flat triangle between them [m].
    area : ndarray of float64, shape (num_parts,)
        By which currents of the flat face are weighted [m2].
    footprint : ndarray of int64, shape (num_parts,)
    """

    corners: Array
    area: Array
    footprint: Index


def parts_of(curved: CurvedFaces, face: Index, corners: Array, difference: Array, normal: Array) -> Parts:
    """Return footprints on curved faces cut into small parts.

    Parameters
    ----------
    curved : CurvedFaces
    face : ndarray of int64, shape (n,)
    corners : ndarray of float64, shape (n, 3, 3)
        [m].
    difference : ndarray of float64, shape (n, 3)
        Wavenumber times the direction of scattering minus that of arrival [rad/m].
    normal : ndarray of float64, shape (n, 3)
        Unit normals on the lit side.
    """
    row = curved.row[face]
    real = curved.on_surface(row, corners)
    stands = curved.on_surface(row, _between(corners)) - _between(real)
    phase = THIRD * np.abs(np.einsum("nij,nj->ni", stands, difference)).max(axis=1)
    cuts = np.maximum(np.ceil(np.sqrt(phase / curved.largest)), 1.0).astype(np.int64)
    towards = np.einsum("ij,ij->i", difference, normal)
    size = np.linalg.norm(difference, axis=1)
    # behind the surface, where the shadow is formed, the flat area is what counts
    axis = np.where((towards > _GRAZING * size)[:, None], difference, normal)
    scale = 0.5 / np.einsum("ij,ij->i", axis, normal)
    found = []
    for number in np.unique(cuts):
        rows = np.flatnonzero(cuts == number)
        flat = np.einsum("pck,nki->npci", _lattice(int(number)), corners[rows]).reshape(-1, 3, 3)
        footprint = np.repeat(rows, number * number)
        points = np.concatenate([flat, flat.mean(axis=1, keepdims=True)], axis=1)
        points = curved.on_surface(row[footprint], points)
        across = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        before = np.cross(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0])
        flat_area = 0.5 * np.einsum("ij,ij->i", before, normal[footprint])
        shown = np.sign(flat_area) * np.einsum("ij,ij->i", across, axis[footprint]) * scale[footprint]
        area = np.clip(shown, 0.0, MOST_SHOWN * np.abs(flat_area))
        mean = CENTROID * (points[:, 3] - points[:, :3].mean(axis=1))
        found.append(Parts(points[:, :3] + mean[:, None], area, footprint))
    if len(found) == 1:
        return found[0]
    return Parts(*(np.concatenate([getattr(one, name) for one in found]) for name in vars(found[0])))


def _between(corners: Array) -> Array:
    """Return the points at both thirds of the sides of triangles, shape (n, 6, 3).

    At the middle an S stands off by nothing, and an arc and an S that cancel at one third add at the other.
    """
    following = np.roll(corners, -1, axis=1)
    return np.concatenate([2.0 * corners + following, corners + 2.0 * following], axis=1) / 3.0


@cache
def _lattice(cuts: int) -> Array:
    """Return barycentric coordinates of the corners of cuts^2 equal parts, shape (cuts^2, 3, 3)."""
    upright = [(i, j) for i in range(cuts) for j in range(cuts - i)]
    turned = [(i, j) for i in range(cuts - 1) for j in range(cuts - 1 - i)]
    nodes = [[(i, j), (i + 1, j), (i, j + 1)] for i, j in upright]
    nodes += [[(i + 1, j + 1), (i, j + 1), (i + 1, j)] for i, j in turned]
    place = np.array(nodes, dtype=np.float64) / cuts
    return np.concatenate([1.0 - place.sum(axis=2, keepdims=True), place], axis=2)


class DeviceCurves:
    """The curved faces of a scene on the device; make and use it inside the variant of `on`.

    Parameters
    ----------
    on : Device
    curved : CurvedFaces
    """

    def __init__(self, on: Device, curved: CurvedFaces) -> None:
        self.curved = curved
        self._on = on
        self._row = on.index(np.maximum(curved.row, 0))
        columns = [curved.origin, *np.moveaxis(curved.gradient, 1, 0), *np.moveaxis(curved.lift, 1, 0)]
        columns += [*np.moveaxis(curved.slant, 1, 0), curved.middle]
        self._vectors = [on.reals(column) for column in columns]
        self._largest = on.real(curved.largest)
        self._reals = [on.reals(a) for a in (*curved.length.T, curved.height, curved.rounding)]

    def spherical_wave_integral(
        self,
        face: DeviceArray,
        corner: list[DeviceArray],
        ends: tuple[DeviceArray, DeviceArray],
        normal: DeviceArray,
        wavenumber: DeviceArray,
        flat_phase: DeviceArray,
    ) -> Pair:
        """Return the integrals of `phase.spherical_wave_integral` over footprints on curved faces.

        Parameters
        ----------
        face : Dr.Jit UInt32 array
        corner : list of Dr.Jit Array3f64
            The three corners of the flat footprint [m].
        ends : tuple of Dr.Jit Array3f64
            Source and receiver.
        normal : Dr.Jit Array3f64
            Unit normal on the lit side.
        wavenumber : float or Dr.Jit float64 number
            [rad/m].
        flat_phase : float or Dr.Jit float64 number
            As `largest` there, for the curvature of the waves [rad].

        Notes
        -----
        The phase is taken at the corners of a part and at its centroid: linear between, and its quadratic part by its
        mean.
        """
        dr = self._on.dr
        source, receiver = ends
        center = (corner[0] + corner[1] + corner[2]) / 3.0
        arriving, leaving = center - source, receiver - center
        out, home = dr.norm(arriving), dr.norm(leaving)
        axis = leaving / home - arriving / out
        length, scale = out + home, 0.5 / dr.maximum(dr.dot(axis, normal), _GRAZING)
        across = dr.cross(corner[1] - corner[0], corner[2] - corner[0])
        scale *= dr.sign(dr.dot(across, normal))
        surface = self._surface(face)

        def phase(point: DeviceArray) -> DeviceArray:
            return wavenumber * (length - dr.norm(point - source) - dr.norm(receiver - point))

        def of_part(parts: list[DeviceArray]) -> Pair:
            real = [surface(point) for point in parts]
            phases = [phase(point) for point in real]
            mean = (phases[0] + phases[1] + phases[2]) / 3.0
            re, im = second_difference(OnDevice(dr), *(one - mean for one in phases))
            mean += CENTROID * (phase(surface((parts[0] + parts[1] + parts[2]) / 3.0)) - mean)
            sine, cosine = dr.sincos(mean)
            shown = scale * dr.dot(dr.cross(real[1] - real[0], real[2] - real[0]), axis)
            shown = dr.clip(shown, 0.0, most)
            return 2.0 * shown * (re * cosine - im * sine), 2.0 * shown * (re * sine + im * cosine)

        square, stands = 0.0, 0.0
        for k in range(3):
            one, two = corner[k], corner[(k + 1) % 3]
            square = dr.maximum(square, dr.squared_norm(two - one))
            for near, far in ((one, two), (two, one)):
                over = surface((2.0 * near + far) / 3.0) - (2.0 * surface(near) + surface(far)) / 3.0
                stands = dr.maximum(stands, dr.abs(dr.dot(over, axis)))
        parts = wavenumber * square * (1.0 / out + 1.0 / home) / 8.0 / flat_phase
        parts = dr.maximum(parts, THIRD * wavenumber * stands / self._largest)
        cuts = dr.maximum(dr.ceil(dr.sqrt(parts)), 1.0)
        most = 0.5 * MOST_SHOWN * dr.norm(across) / cuts**2
        return over_parts(self._on, corner, cuts, of_part)

    def _surface(self, face: DeviceArray) -> Callable[[DeviceArray], DeviceArray]:
        """Return the function from points of faces to the points of the surface for which they stand."""
        dr, on = self._on.dr, self._on
        row = dr.gather(on.mi.UInt32, self._row, face)
        origin, one, two, *rest = (dr.gather(on.Vector, column, row) for column in self._vectors)
        lift, slant, middle = rest[:3], rest[3:6], rest[6]
        a, b, c, height, rounding = (dr.gather(on.Real, column, row) for column in self._reals)

        def on_surface(point: DeviceArray) -> DeviceArray:
            offset = point - origin
            second, third = dr.dot(offset, one), dr.dot(offset, two)
            first = 1.0 - second - third
            products = first * second, second * third, third * first
            weight = [dr.clip(4.0 * product, -1.0, 1.0) for product in products]
            away = weight[0] * lift[0] + weight[1] * lift[1] + weight[2] * lift[2]
            size = dr.norm(away)
            spread = dr.maximum(weight[0] * a + weight[1] * b + weight[2] * c - size, 0.0)
            factor = (1.0 + spread / dr.maximum(size, 1e-300)) * (1.0 + rounding * (1.0 - size / height))
            uneven = dr.clip(27.0 * first * second * third, -1.0, 1.0) * middle
            for k, towards in enumerate((first - second, second - third, third - first)):
                uneven += 0.25 * weight[k] * dr.clip(towards, -1.0, 1.0) * slant[k]
            return point + factor * away + uneven

        return on_surface
