"""What lit patches radiate to the receiver: one kernel for all patches of one depth."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose
from scarl_sionna.engine.rays.face_rays import StateRays
from scarl_sionna.engine.types import DeviceArray

from .faces.curved import DeviceCurves
from .faces.oblique import Ends, edge_terms, is_oblique, steady_slope
from .faces.panes import through_panes
from .fields import Field, OnDevice, Wave, radiating_vector, reflected_field
from .phase import spherical_wave_integral
from .spherical_waves import ImageTubes, Viewpoint
from .surfaces import FaceSurfaces

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class NearField:
    """Two stations and the surfaces of a scene: what is the same for all patches of a solve.

    Attributes
    ----------
    rays : StateRays
    surfaces : FaceSurfaces
    tx, rx : Viewpoint
    wavenumber : float
        At which the phase is integrated over a patch [rad/m].
    integration_phase : float
        See :func:`.phase.spherical_wave_integral` [rad].
    curves : DeviceCurves or None
        The curved surfaces behind faces.
    duration : float
        Of a frame [s].
    max_turn : float or None
        As in SbrSettings [rad].
    """

    rays: StateRays
    surfaces: FaceSurfaces
    tx: Viewpoint
    rx: Viewpoint
    wavenumber: float
    integration_phase: float
    curves: DeviceCurves | None = None
    duration: float = 0.0
    max_turn: float | None = None

    def kinds(self, tubes: ImageTubes) -> list[ImageTubes]:
        """Return the patches on flat faces, and those on curved ones."""
        if self.curves is None:
            return [tubes]
        bent = self.curves.curved.is_curved[tubes.face[:, -1]]
        return [tubes.take(np.flatnonzero(rows)) for rows in (~bent, bent) if rows.any()]


def radiated(near: NearField, tubes: ImageTubes, diffuse: bool) -> dict[str, npt.NDArray[Any]]:
    r"""Return the columns of patches: end points, transfer, lengths, rate and what diffuse scattering needs.

    Parameters
    ----------
    near : NearField
    tubes : ImageTubes
        Patches over each of which the phase is all but linear: one of :meth:`NearField.kinds`.
    diffuse : bool
        Whether to return what a rough surface scatters, column ``scattered``: the transfer of a patch of 1 m2.

    Returns
    -------
    dict
        Of patches on flat faces also ``oblique``, (n,) bool: of these `a` is that for an integral of 1 m2, and
        ``edges``, (n, 6) complex128 [m2], has the integral in parts, see :func:`.oblique.edge_terms`.

    Notes
    -----
    With the image source at L, the receiver at R from the patch's centre and the directions k, s of arrival and return,

    .. math:: a = -\frac{j}{8 \pi L R}\, \hat p_r \cdot (\eta J - \hat s \times M) \int e^{-j k (l(r) - l(r_0))} dA

    with the length l of the path over r, and the currents of physical optics

    .. math:: J = n \times (H_i + H_r), \quad M = -n \times (E_i + E_r), \quad \eta H = k \times E

    It does not depend on the frequency but through the integral. A rough surface keeps sqrt(1 - S^2) of the reflected
    field. What it scatters has the power

    .. math:: |a|^2 = \frac{\lambda^2}{(4 \pi)^2 L^2 R^2} \rho \cos\theta_i f_s A, \quad
              f_s = \frac{\cos\theta_s}{\pi}

    for the area A, with Lambert's pattern and the albedo of :func:`.rough.diffuse_albedo`, and K of it is cross-polar.

    References
    ----------
    .. [1] C. A. Balanis, *Advanced Engineering Electromagnetics*, 2nd ed., section 6.8 (far field) and 7.10 (physical
           optics).
    .. [2] V. Degli-Esposti et al., "Measurement and Modelling of Scattering From Buildings", IEEE Trans. Antennas
           Propag. 55(1), 2007, Eqs. (2), (5).
    """
    rays, surfaces, wavenumber = near.rays, near.surfaces, near.wavenumber
    dr, mi, Vector, on = rays.dr, rays.mi, rays.Vector, OnDevice(rays.dr)
    count, depth = tubes.face.shape
    tube = dr.arange(mi.UInt32, count)
    corner = rays.corners(tubes.corners)
    center = (corner[0] + corner[1] + corner[2]) / 3.0
    faces = rays.index(tubes.face)
    face = [dr.gather(mi.UInt32, faces, depth * tube + k) for k in range(depth)]
    images = rays.reals(tubes.image)
    image = [dr.gather(Vector, images, depth * tube + k) for k in range(depth)]
    plane = [surfaces.plane(number) for number in face]
    point = _reflection_points(dr, center, image, plane)
    receiver = rays.vector(near.rx.pose.position)
    line = [rays.vector(near.tx.pose.position), *point, receiver]
    travel = [dr.normalize(stop - start) for start, stop in pairwise(line)]
    moving = [surfaces.velocity(face[k], point[k]) for k in range(depth)]
    rate = dr.dot(travel[-1], rays.vector(near.rx.velocity)) - dr.dot(travel[0], rays.vector(near.tx.velocity))
    reflected = [(axis, dr.zeros(Vector, count)) for axis in _spherical_basis(rays, near.tx.pose, travel[0])]
    reflected, _ = through_panes(rays, surfaces, tubes.way_in, reflected, travel[0])
    onward = travel[0]
    for k in range(depth):
        field, arriving = reflected, travel[k]
        normal = plane[k][0]
        normal = normal * -dr.sign(dr.dot(normal, arriving))
        smooth, onward = reflected_field(on, partial(surfaces.coefficients, face[k]), field, arriving, normal)
        kept, strayed, *turn = surfaces.roughness(face[k])
        reflected = [(kept * re, kept * im) for re, im in smooth]
        rate += dr.dot(moving[k], arriving - travel[k + 1])
    back = travel[-1]
    oblique, edges = None, []
    out, home = dr.norm(center - image[-1]), dr.norm(receiver - center)
    if near.curves is not None and near.curves.curved.is_curved[tubes.face[0, -1]]:
        ends = image[-1], receiver
        integral = near.curves.spherical_wave_integral(
            face[-1], corner, ends, normal, wavenumber, near.integration_phase
        )
    else:
        unfolded = _unfolded_velocity(dr, moving, plane[:-1])
        passing = [
            (near.duration * (unfolded - rays.vector(near.tx.drift)), travel[0], out),
            (near.duration * (moving[-1] - rays.vector(near.rx.drift)), travel[-1], home),
        ]
        flat = Ends(corner, image[-1], receiver, wavenumber, steady_slope(dr, wavenumber, passing, near.max_turn))
        oblique = is_oblique(dr, flat)
        ends = image[-1], receiver
        parts = spherical_wave_integral(rays, corner, ends, wavenumber, near.integration_phase, ~oblique)
        integral = dr.select(oblique, 1.0, parts[0]), dr.select(oblique, 0.0, parts[1])
        edges = edge_terms(rays, flat)
    scale = 0.125 / np.pi / (out * home)
    factor = (integral[1] * scale, -integral[0] * scale)  # -j times the integral
    columns: dict[str, Any] = {
        "tx_point": _unfolded(dr, center, plane[:-1]),
        "rx_point": center,
        "tx_velocity": _unfolded_velocity(dr, moving, plane[:-1]) - rays.vector(near.tx.velocity),
        "rx_velocity": moving[-1] - rays.vector(near.rx.velocity),
        "length_rate": rate,
        "length": out + home,
        "cosine": dr.abs(dr.dot(normal, back)),
    }
    for number, (re, im) in enumerate(edges):
        columns |= {f"edge{number}": dr.select(oblique, re, 0.0), f"edge{number}j": dr.select(oblique, im, 0.0)}
    if oblique is not None:
        columns["oblique"] = oblique
    receive = _spherical_basis(rays, near.rx.pose, -back)
    vector = radiating_vector(on, Wave(field, arriving), Wave(reflected, onward), normal, back)
    vector, kept_out = through_panes(rays, surfaces, tubes.way_out, vector, back)
    for r in range(2):
        for t, (re, im) in enumerate(on.component(receive[r], vector)):
            columns[f"re{r}{t}"] = re * factor[0] - im * factor[1]
            columns[f"im{r}{t}"] = re * factor[1] + im * factor[0]
    if diffuse:
        cosines = dr.abs(dr.dot(normal, arriving)) * columns["cosine"] / np.pi
        level = 0.5 / wavenumber / (out * home) * kept_out * strayed * dr.sqrt(cosines)  # lambda / (4 pi) = 1 / (2 k)
        columns |= _scattered(dr, _spherical_basis(rays, near.tx.pose, arriving), field, level, turn)
    dr.eval(*columns.values())
    found = {name: rays.on_host(column) for name, column in columns.items()}
    found["a"] = _matrices(found, "re", "im")
    if edges:
        found["edges"] = np.stack([found.pop(f"edge{k}") + 1j * found.pop(f"edge{k}j") for k in range(6)], axis=1)
    if diffuse:
        found["scattered"] = _matrices(found, "sre", "sim")
    return found


def _matrices(found: dict[str, npt.NDArray[Any]], real: str, imaginary: str) -> npt.NDArray[np.complex128]:
    """Take the entries of 2 x 2 matrices out of columns."""
    parts = [
        np.stack([found.pop(f"{part}{r}{t}") for r in range(2) for t in range(2)], axis=1) for part in (real, imaginary)
    ]
    return (parts[0] + 1j * parts[1]).reshape(-1, 2, 2)


def _scattered(
    dr: ModuleType,
    basis: tuple[DeviceArray, DeviceArray],
    field: Field,
    level: DeviceArray,
    turn: list[DeviceArray],
) -> dict[str, DeviceArray]:
    """Return the entries of the transfer by diffuse scattering of 1 m2; the polarisation is turned as in Sionna RT."""
    found: dict[str, DeviceArray] = {}
    for t in range(2):
        for name, part in zip(("sre", "sim"), field[t], strict=True):
            vertical, horizontal = dr.dot(basis[0], part), dr.dot(basis[1], part)
            found[f"{name}0{t}"] = level * (turn[0] * vertical - turn[1] * horizontal)
            found[f"{name}1{t}"] = level * (turn[1] * vertical + turn[0] * horizontal)
    return found


def _reflection_points(
    dr: ModuleType, center: DeviceArray, image: list[DeviceArray], plane: list[tuple[DeviceArray, DeviceArray]]
) -> list[DeviceArray]:
    """Return where the rays to the patches' centres meet the faces of their chains."""
    points = [center]
    for k in range(len(image) - 2, -1, -1):
        (normal, offset), source = plane[k], image[k + 1]
        ray = points[0] - source
        share = (offset - dr.dot(normal, source)) / dr.dot(normal, ray)
        points.insert(0, source + share * ray)
    return points


def _unfolded(dr: ModuleType, center: DeviceArray, mirrors: list[tuple[DeviceArray, DeviceArray]]) -> DeviceArray:
    """Return the images of the patches' centres that the transmitter sees."""
    seen = center
    for normal, offset in reversed(mirrors):
        seen = seen - 2.0 * (dr.dot(normal, seen) - offset) * normal
    return seen


def _unfolded_velocity(
    dr: ModuleType, moving: list[DeviceArray], mirrors: list[tuple[DeviceArray, DeviceArray]]
) -> DeviceArray:
    """Return the velocity of these images, by the velocities of the faces where they reflect."""
    seen = moving[-1]
    for (normal, _), mirror in zip(reversed(mirrors), reversed(moving[:-1]), strict=True):
        seen = seen - 2.0 * dr.dot(normal, seen - mirror) * normal
    return seen


def _spherical_basis(rays: StateRays, pose: Pose, direction: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
    """Return theta-hat and phi-hat of unit directions in world axes; phi = 0 along the frame's z axis."""
    dr = rays.dr
    x, y, z = (rays.vector(axis) for axis in pose.rotation.T)
    along_x, along_y = dr.dot(x, direction), dr.dot(y, direction)
    flat = dr.sqrt(along_x**2 + along_y**2)
    upright = flat <= 1e-12
    cosine, sine = dr.select(upright, 1.0, along_x / flat), dr.select(upright, 0.0, along_y / flat)
    outward = cosine * x + sine * y
    return dr.dot(z, direction) * outward - flat * z, cosine * y - sine * x
