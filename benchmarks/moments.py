"""Full-wave reference: a perfectly conducting cube by the method of moments, written to a table of scattering matrices.

Combined field integral equation with the basis functions of Rao, Wilton and Glisson, Galerkin, dense solution. It makes
tests/data/rcs/mom_cube3lam.csv; lengths are in wavelengths, time dependence e^{+jwt}.

Run: ``python benchmarks/moments.py [cells to a wavelength] [side]``; 8 cells and a side of 3 take three minutes and
3 GiB.

Sources: S. M. Rao, D. R. Wilton, A. W. Glisson, "Electromagnetic scattering by surfaces of arbitrary shape", IEEE
Trans. Antennas Propag. 30(3), 1982; D. R. Wilton et al., "Potential integrals for uniform and linear source
distributions on polygonal and polyhedral domains", IEEE Trans. Antennas Propag. 32(3), 1984.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from scipy.linalg import lu_factor, lu_solve
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

K = 2.0 * np.pi
TABLE = Path(__file__).resolve().parents[1] / "tests" / "data" / "rcs" / "mom_cube3lam.csv"
BARYCENTRIC = np.array([[2 / 3, 1 / 6, 1 / 6], [1 / 6, 2 / 3, 1 / 6], [1 / 6, 1 / 6, 2 / 3]])
BLOCK = 192
ELECTRIC = 0.9
"""Weight of the electric equation; the rest is that of the magnetic one, which is less right at edges."""


def cube(side: float, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Return corners (n, 3, 3) of a cube's triangles and their vertices' numbers (n, 3), normals outside."""
    line = np.linspace(-0.5, 0.5, cells + 1) * side
    corners = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            a, b = (axis + 1) % 3, (axis + 2) % 3
            u, v = np.meshgrid(line, line, indexing="ij")
            points = np.empty((*u.shape, 3))
            points[..., axis], points[..., a], points[..., b] = sign * side / 2, u, v
            p, q, r, s = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
            both = np.concatenate([np.stack([p, q, r], axis=2), np.stack([p, r, s], axis=2)]).reshape(-1, 3, 3)
            corners.append(both if sign > 0 else both[:, ::-1])
    found = np.concatenate(corners)
    number = np.unique(np.round(found.reshape(-1, 3) / side * 1e6), axis=0, return_inverse=True)[1]
    return found, number.reshape(-1, 3)


class Basis:
    """Functions of edges at three points of each triangle, as sparse matrices (points, edges)."""

    def __init__(self, corners: np.ndarray, number: np.ndarray) -> None:
        count = len(corners)
        a, b = np.roll(number, -1, axis=1).ravel(), np.roll(number, -2, axis=1).ravel()  # the edge opposite to a corner
        key = np.minimum(a, b) * (number.max() + 1) + np.maximum(a, b)
        order = np.argsort(key, kind="stable")
        self.edge = np.empty(3 * count, dtype=int)
        self.edge[order] = np.arange(3 * count) // 2
        sign = np.empty(3 * count)
        sign[order] = np.tile([1.0, -1.0], 3 * count // 2)
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        twice = np.linalg.norm(normal, axis=1)
        self.area, self.normal = twice / 2, normal / twice[:, None]
        opposite = np.linalg.norm(np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1), axis=2)
        self.scale = sign.reshape(-1, 3) * opposite / (2 * self.area[:, None])
        self.edge = self.edge.reshape(-1, 3)
        self.corners, self.size = corners, 3 * count // 2
        self.points = np.einsum("qc,tci->tqi", BARYCENTRIC, corners).reshape(-1, 3)
        self.weight = np.repeat(self.area / 3, 3)
        self.triangle = np.repeat(np.arange(count), 3)
        values = self.scale[self.triangle][:, :, None] * (self.points[:, None] - corners[self.triangle])  # (P, 3, xyz)
        values = values * self.weight[:, None, None]
        self.vector = [self._sparse(values[..., i]) for i in range(3)]
        self.charge = self._sparse(2 * self.scale[self.triangle] * self.weight[:, None])
        turned = np.cross(values, self.normal[self.triangle][:, None])
        self.turned = [self._sparse(turned[..., i]) for i in range(3)]

    def _sparse(self, values: np.ndarray) -> csr_array:
        rows = np.repeat(np.arange(len(values)), 3)
        edges = self.edge[self.triangle].ravel()
        return csr_array((values.ravel().astype(np.float32), (rows, edges)), shape=(len(values), self.size))


def system(basis: Basis) -> np.ndarray:
    """Return the matrix of the combined equation, over eta and half of each."""
    matrix = np.zeros((basis.size, basis.size), dtype=np.complex64)
    x = basis.points.astype(np.float32)
    transposed = [[m[first : first + BLOCK].T.tocsr() for m in (*basis.vector, basis.charge, *basis.turned)]
                  for first in range(0, len(x), BLOCK)]  # fmt: skip # one table
    for block, parts in enumerate(transposed):
        first = block * BLOCK
        rows = slice(first, min(first + BLOCK, len(x)))
        away = x[rows, None] - x[None]
        distance = np.sqrt(np.einsum("pqi,pqi->pq", away, away))
        own = distance < 1e-6
        distance[own] = 1.0
        wave = np.exp(np.complex64(-1j * K) * distance)
        green = np.where(own, np.complex64(-1j * K), wave / distance).astype(np.complex64) / np.float32(4 * np.pi)
        slope = np.where(own, 0, -(1 + 1j * K * distance) * wave / distance**3).astype(np.complex64)
        slope /= np.float32(4 * np.pi)
        # the electric equation over eta: j k (A - phi'' / k^2); the magnetic one: J / 2 - n x H(J)
        for i in range(3):
            _add(matrix, parts[i], 1j * ELECTRIC * K * (green @ basis.vector[i]))
        _add(matrix, parts[3], -1j * ELECTRIC / K * (green @ basis.charge))
        for a, b, c, sign in ((0, 1, 2, 1), (1, 2, 0, 1), (2, 0, 1, 1), (0, 2, 1, -1), (2, 1, 0, -1), (1, 0, 2, -1)):
            _add(matrix, parts[4 + a], -(1 - ELECTRIC) * sign * ((slope * away[..., b]) @ basis.vector[c]))
    _add_near(matrix, basis)
    overlap = sum(v.T @ csr_array((1 / basis.weight, (np.arange(len(x)),) * 2)) @ v for v in basis.vector)
    matrix += np.asarray(0.5 * (1 - ELECTRIC) * overlap.toarray(), dtype=np.complex64)
    return matrix


def _add(matrix: np.ndarray, left: csr_array, right: np.ndarray) -> None:
    used = np.flatnonzero(np.diff(left.indptr))
    matrix[used] += left[used] @ right.astype(np.complex64)


def _add_near(matrix: np.ndarray, basis: Basis) -> None:
    """Replace 1 / R between near triangles by its exact integral."""
    center = basis.corners.mean(axis=1)
    reach = 2.0 * np.sqrt(4 * basis.area.max())
    near = cKDTree(center).query_pairs(reach, output_type="ndarray")
    pairs = np.concatenate([near, near[:, ::-1], np.column_stack([np.arange(len(center))] * 2)])
    for first in range(0, len(pairs), 50_000):
        test, source = pairs[first : first + 50_000].T
        for q in range(3):
            point = basis.points[3 * test + q]
            plain, linear = potentials(point, basis.corners[source], basis.normal[source])
            nodes = basis.points.reshape(-1, 3, 3)[source]
            distance = np.linalg.norm(point[:, None] - nodes, axis=2)
            inverse = (
                np.where(distance < 1e-9, 0.0, 1.0 / np.maximum(distance, 1e-9)) * (basis.area[source] / 3)[:, None]
            )
            plain = plain - inverse.sum(axis=1)
            shift = np.einsum("nq,nqi->ni", inverse, nodes - point[:, None])
            linear = linear - shift  # of (r' - r) / R
            weight = basis.area[test] / 3 / (4 * np.pi)
            for m in range(3):
                own = basis.scale[test, m][:, None] * (point - basis.corners[test, m])
                for n in range(3):
                    far = linear + (point - basis.corners[source, n]) * plain[:, None]
                    vector = basis.scale[source, n] * np.einsum("ni,ni->n", own, far)
                    charge = 4 * basis.scale[test, m] * basis.scale[source, n] * plain
                    value = 1j * ELECTRIC * weight * (K * vector - charge / K)
                    np.add.at(matrix, (basis.edge[test, m], basis.edge[source, n]), value.astype(np.complex64))


def potentials(point: np.ndarray, corners: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the integrals of 1 / R and of (r' - r) / R over triangles, each seen from a point."""
    height = np.einsum("ni,ni->n", point - corners[:, 0], normal)
    foot = point - height[:, None] * normal
    plain, linear = np.zeros(len(point)), np.zeros((len(point), 3))
    for i in range(3):
        start, stop = corners[:, i], corners[:, (i + 1) % 3]
        along = (stop - start) / np.linalg.norm(stop - start, axis=1)[:, None]
        outward = np.cross(along, normal)
        across = np.einsum("ni,ni->n", start - foot, outward)
        low, high = (np.einsum("ni,ni->n", end - foot, along) for end in (start, stop))
        square = across**2 + height**2
        near, far = np.sqrt(square + low**2), np.sqrt(square + high**2)
        log = np.where(square < 1e-20, 0.0, np.log(np.maximum(far + high, 1e-30) / np.maximum(near + low, 1e-30)))
        plain += across * log
        tall = np.abs(height)
        plain -= tall * (
            np.arctan2(across * high, square + tall * far) - np.arctan2(across * low, square + tall * near)
        )
        linear += 0.5 * outward * (square * log + high * far - low * near)[:, None]
    return plain, linear - (height * plain)[:, None] * normal


def scattering(basis: Basis, factor, theta, phi, theta_s, phi_s) -> np.ndarray:
    """Return S over wavelengths, shape (n, 2, 2): receive polarisation (V, H) before transmit."""

    def vectors(t, p):
        st, ct, sp, cp = np.sin(t), np.cos(t), np.sin(p), np.cos(p)
        zero = np.zeros_like(t)
        return (np.stack(v, axis=1) for v in ((st * cp, st * sp, ct), (ct * cp, ct * sp, -st), (-sp, cp, zero)))

    r, v, h = vectors(theta, phi)
    r_s, v_s, h_s = vectors(theta_s, phi_s)
    phase = np.exp(1j * K * basis.points @ r.T)
    right = []
    for polarisation in (v, h):
        magnetic = np.cross(-r, polarisation)  # times eta
        electric = sum(basis.vector[i].T @ (phase * polarisation[:, i]) for i in range(3))
        turned = sum(basis.turned[i].T @ (phase * magnetic[:, i]) for i in range(3))
        right.append(ELECTRIC * electric + (1 - ELECTRIC) * turned)
    current = lu_solve(factor, np.concatenate(right, axis=1).astype(np.complex64))
    away = np.exp(1j * K * basis.points @ r_s.T)
    field = np.stack([(basis.vector[i] @ current) for i in range(3)]).reshape(3, len(basis.points), 2, -1)
    total = np.einsum("ipta,pa->ait", field, away)
    return -1j * K / (4 * np.pi) * np.einsum("rai,ait->art", np.stack([v_s, h_s]), total)


def main() -> None:
    cells, side = float((sys.argv[1:2] or [8])[0]), float((sys.argv[2:3] or [3])[0])
    clock = time.perf_counter()
    basis = Basis(*cube(side, round(cells * side)))
    print(f"{basis.size} unknowns", flush=True)
    matrix = system(basis)
    print(f"matrix {time.perf_counter() - clock:.0f} s", flush=True)
    factor = lu_factor(matrix, overwrite_a=True, check_finite=False)
    print(f"solved {time.perf_counter() - clock:.0f} s", flush=True)
    rows = [(90.0, a, 90.0, a) for a in np.arange(0.0, 46.0)]
    rows += [(t, 30.0, t, 30.0) for t in np.arange(40.0, 91.0)]
    rows += [(90.0, a, 90.0, a + 10.0) for a in np.arange(0.0, 46.0)]
    rows += [(90.0, a + 10.0, 90.0, a) for a in np.arange(0.0, 46.0)]
    angle = np.array(rows)
    found = scattering(basis, factor, *np.deg2rad(angle).T)
    with (TABLE if side == 3.0 and cells >= 8 else Path("mom_cube.csv")).open("w", encoding="utf-8") as file:
        what = f"cube of {side:g} wavelengths, {cells:g} cells to a wavelength"
        file.write(f"# benchmarks/moments.py: {what}; S over wavelengths, sigma = 4 pi abs(S)^2\n")
        file.write("theta_deg,phi_deg,theta_s_deg,phi_s_deg,Svv_re,Svv_im,Shh_re,Shh_im\n")
        for where, s in zip(angle, found, strict=True):
            values = (s[0, 0].real, s[0, 0].imag, s[1, 1].real, s[1, 1].imag)
            file.write(",".join([*(f"{w:g}" for w in where), *(f"{value:.5g}" for value in values)]) + "\n")
    print(f"done {time.perf_counter() - clock:.0f} s")


if __name__ == "__main__":
    main()
