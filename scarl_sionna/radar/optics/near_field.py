"""What lit patches radiate to their receivers: one kernel for all patches of one depth, whatever their stations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.seeds import uniform_hash
from scarl_sionna.engine.rays.face_rays import StateRays
from scarl_sionna.engine.threads import many_threads
from scarl_sionna.engine.types import DeviceArray
from scarl_sionna.scene.materials.depolarization import turns

from .faces.curved import DeviceCurves
from .faces.oblique import STEADY, Ends, edge_terms, is_oblique, steady_slope
from .faces.panes import through_panes
from .fields import Field, OnDevice, Wave, radiating_vector, reflected_field
from .phase import spherical_wave_integral
from .spherical_waves import ImageTubes
from .surfaces import FaceSurfaces
from .viewpoint import Viewpoint

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
    arm : float
        Distance of the outermost antenna from the centre of an array so wide that antennas have transfers of their own
        [m]; 0: all have that of the centre.
    seed : int
        Of the cross-polar phases of rough patches.
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
    arm: float = 0.0
    seed: int = 0

    def kinds(self, tubes: ImageTubes) -> list[tuple[bool, ImageTubes]]:
        """Return the patches on flat faces, and those on curved ones, each with whether they are."""
        if self.curves is None:
            return [(False, tubes)] if len(tubes) else []
        bent = self.curves.curved.is_curved[tubes.face[:, -1]]
        kinds = ((False, ~bent), (True, bent))
        return [(is_curved, tubes.take(np.flatnonzero(rows))) for is_curved, rows in kinds if rows.any()]


class Elsewhere(NamedTuple):
    """Other places from which the stations of every patch see it.

    Attributes
    ----------
    tx, rx : ndarray of float64, shape (num_patches, 3)
        From where the stations are [m]. Of what is heard the same way only `tx` counts.
    image : ndarray of float64, shape (num_patches, depth, 3)
        The same of the transmitter's images [m].
    oblique : ndarray of bool, shape (num_patches,)
        Patches whose transfer is that for an integral of 1 m2.
    """

    tx: Array
    rx: Array
    image: Array
    oblique: npt.NDArray[np.bool_]


def radiated(
    near: Sequence[NearField], tubes: Sequence[ImageTubes], same_way: bool = False
) -> list[dict[str, npt.NDArray[Any]]]:
    r"""Return the columns of patches: end points, transfer, lengths, rate and what diffuse scattering needs.

    One kernel serves patches of any number of bounces and all stations; there is one more for those on curved faces.

    Parameters
    ----------
    near : sequence of NearField
        Of one solve: they differ in their stations.
    tubes : sequence of ImageTubes
        The patches of each, over each of which the phase is all but linear, all of one number of bounces and one of
        :meth:`NearField.kinds`.
    same_way : bool
        Heard by the transmitter over the mirrors on the way there: all ends of such patches are their images.

    Returns
    -------
    list of dict
        For each; ``a`` is the transfer, ``scattered`` what a rough surface scatters, the transfer of a patch of 1 m2;
        both (n, 2, 2) complex128. Of patches on flat faces also ``oblique``, (n,) bool: of these `a` is that for an
        integral of 1 m2, and ``edges``, (n, 6) complex128 [m2], has the integral in parts, see
        :func:`.oblique.edge_terms`.

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

    for the area A, with Lambert's pattern and the albedo of :func:`.rough.directional_albedo`, and K of it is
    cross-polar; the matrix is that of :func:`.depolarization.rough_matrix`, along theta-hat and phi-hat of the
    direction of arrival.

    References
    ----------
    .. [1] C. A. Balanis, *Advanced Engineering Electromagnetics*, 2nd ed., section 6.8 (far field) and 7.10 (physical
           optics).
    .. [2] V. Degli-Esposti et al., "Measurement and Modelling of Scattering From Buildings", IEEE Trans. Antennas
           Propag. 55(1), 2007, Eqs. (2), (5).
    """
    ends = np.cumsum([len(some) for some in tubes])
    pair = np.repeat(np.arange(len(near)), [len(some) for some in tubes])
    found = _of_two(near, tubes[0].joined(list(tubes)), pair, same_way)
    columns = {name: np.split(column, ends[:-1]) for name, column in found.items()}
    return [{name: pieces[number] for name, pieces in columns.items()} for number in range(len(near))]


def radiated_elsewhere(
    near: Sequence[NearField], tubes: ImageTubes, pair: npt.NDArray[np.int64], same_way: bool, elsewhere: Elsewhere
) -> npt.NDArray[np.complex128]:
    """Return the transfers of patches as of :func:`radiated` with their stations elsewhere, shape (n, 2, 2).

    By the same definitions; `pair` has the number of each patch's field in `near`.
    """
    return np.asarray(_of_two(near, tubes, pair, same_way, elsewhere)["a"])


def _of_two(
    near: Sequence[NearField],
    tubes: ImageTubes,
    pair: npt.NDArray[np.int64],
    same_way: bool,
    elsewhere: Elsewhere | None = None,
) -> dict[str, npt.NDArray[Any]]:
    """Return the columns of patches; a single one is computed twice: Dr.Jit has other kernels for arrays of one."""
    if len(tubes) != 1:
        return _radiated(near, tubes, pair, same_way, elsewhere)
    twice = np.zeros(2, dtype=np.int64)
    other = None
    if elsewhere is not None:
        tx, rx, image, oblique = elsewhere
        other = Elsewhere(tx[twice], rx[twice], image[twice], oblique[twice])
    found = _radiated(near, tubes.take(twice), pair[twice], same_way, other)
    return {name: column[:1] for name, column in found.items()}


class _Ends:
    """One end of every patch: a station's place, axes and motion, each of shape (num_patches, 3) on the device."""

    def __init__(self, rays: StateRays, stations: Sequence[Viewpoint], pair: npt.NDArray[np.int64]) -> None:
        number = rays.index(pair)

        def at(values: list[Array]) -> DeviceArray:
            return rays.dr.gather(rays.Vector, rays.reals(values), number)

        self.position = at([station.pose.position for station in stations])
        self.axes = [at([station.pose.rotation[:, k] for station in stations]) for k in range(3)]
        self.velocity = at([station.velocity for station in stations])
        self.drift = at([station.drift for station in stations])

    def move(self, rays: StateRays, shift: Array) -> None:
        """Put the stations elsewhere, by shifts of shape (num_patches, 3) [m]."""
        rows = rays.dr.arange(rays.mi.UInt32, len(shift))
        self.position += rays.dr.gather(rays.Vector, rays.reals(shift), rows)


class _WayBack(NamedTuple):
    """Of the waves from patches to where they are heard.

    Attributes
    ----------
    receiver : Dr.Jit Array3f64
        Place of the receiver, or of its image, seen from the patch [m].
    point : Dr.Jit Array3f64
        The patch, or its image, seen from the receiver [m].
    velocity : Dr.Jit Array3f64
        Of this point against the receiver [m/s].
    passed : Dr.Jit Array3f64
        The same as far as the size of patches goes [m/s].
    ray : Dr.Jit Array3f64
        Unit direction from the receiver to the point.
    """

    receiver: DeviceArray
    point: DeviceArray
    velocity: DeviceArray
    passed: DeviceArray
    ray: DeviceArray


def _radiated(
    nears: Sequence[NearField],
    tubes: ImageTubes,
    pair: npt.NDArray[np.int64],
    same_way: bool,
    elsewhere: Elsewhere | None = None,
) -> dict[str, npt.NDArray[Any]]:
    """Return the columns of at least two patches, each between the stations of the field that `pair` names.

    Of stations elsewhere the transfer alone.
    """
    near, count = nears[0], len(tubes)
    rays, surfaces = near.rays, near.surfaces
    dr, on = rays.dr, OnDevice(rays.dr)
    tx, rx = (_Ends(rays, [getattr(one, end) for one in nears], pair) for end in ("tx", "rx"))
    wavenumber, integration_phase = rays.real(near.wavenumber), rays.real(near.integration_phase)
    if elsewhere is not None:
        tx.move(rays, elsewhere.tx)
        rx.move(rays, elsewhere.rx)
        tubes = replace(tubes, image=tubes.image + elsewhere.image)
    chain = _Chain(near, tubes)
    corner = rays.corners(tubes.corners)
    center = (corner[0] + corner[1] + corner[2]) / 3.0
    face, image, (normal, _) = chain.face(chain.last), chain.image(chain.last), chain.plane(chain.last)
    moving = surfaces.velocity(face, center)
    seen, seen_velocity = chain.unfolded(center, moving)
    first = dr.normalize(seen - tx.position)
    sent = [(axis, dr.zeros(rays.Vector, count)) for axis in _spherical_basis(rays, tx.axes, first)]
    sent, _ = through_panes(rays, surfaces, tubes.way_in, sent, first)
    field = chain.reflected(seen, sent)
    arriving = dr.normalize(center - image)
    normal = normal * -dr.sign(dr.dot(normal, arriving))
    reflected, onward = _bounced(on, surfaces, face, field, arriving, normal)
    tx_velocity = seen_velocity - tx.velocity
    if same_way:  # the receiver is the image in which the transmitter is seen from the patch
        way = _WayBack(image, seen, tx_velocity, seen_velocity - tx.drift, first)
    else:
        way = _WayBack(rx.position, center, moving - rx.velocity, moving - rx.drift, dr.normalize(center - rx.position))
    back = dr.normalize(way.receiver - center)
    oblique, edges = None, []
    out, home = dr.norm(center - image), dr.norm(way.receiver - center)
    ends = image, way.receiver
    if near.curves is not None and near.curves.curved.is_curved[tubes.face[0, -1]]:
        integral = near.curves.spherical_wave_integral(face, corner, ends, normal, wavenumber, integration_phase)
    else:
        duration = rays.real(near.duration)
        passing = [
            (duration * (seen_velocity - tx.drift), first, out),
            (duration * way.passed, way.ray, home),
        ]
        most, arm = rays.real(near.max_turn or STEADY), rays.real(near.arm)
        flat = Ends(corner, *ends, wavenumber, steady_slope(dr, wavenumber, passing, most, arm))
        oblique = is_oblique(dr, flat) if elsewhere is None else rays.index(elsewhere.oblique.astype(np.int64)) == 1
        parts = spherical_wave_integral(rays, corner, ends, wavenumber, integration_phase, ~oblique)
        integral = dr.select(oblique, 1.0, parts[0]), dr.select(oblique, 0.0, parts[1])
        edges = edge_terms(rays, flat) if elsewhere is None else []
    scale = 0.125 / np.pi / (out * home)
    factor = (integral[1] * scale, -integral[0] * scale)  # -j times the integral
    vector = radiating_vector(on, Wave(field, arriving), Wave(reflected, onward), normal, back)
    if same_way:  # reciprocity: what the way there makes of a polarisation sent is what is heard of it
        kept_out, receive = 1.0, field
    else:
        vector, kept_out = through_panes(rays, surfaces, tubes.way_out, vector, back)
        receive = [(axis, dr.zeros(rays.Vector, count)) for axis in _spherical_basis(rays, rx.axes, -back)]
    columns: dict[str, Any] = {}
    for r, (real, imaginary) in enumerate(receive):
        parts = on.component(real, vector), on.component(imaginary, vector)
        for t, ((re, im), (turned, gone)) in enumerate(zip(*parts, strict=True)):
            columns[f"re{r}{t}"] = (re - gone) * factor[0] - (im + turned) * factor[1]
            columns[f"im{r}{t}"] = (re - gone) * factor[1] + (im + turned) * factor[0]
    if elsewhere is not None:
        with many_threads(count):
            dr.eval(*columns.values())
        return {"a": _matrices({name: rays.on_host(column) for name, column in columns.items()}, "re", "im")}
    columns |= {
        "tx_point": seen,
        "rx_point": way.point,
        "tx_velocity": tx_velocity,
        "rx_velocity": way.velocity,
        "length_rate": dr.dot(first, tx_velocity) + dr.dot(way.ray, way.velocity),
        "length": out + home,
        "cosine": dr.abs(dr.dot(normal, back)),
    }
    for number, (re, im) in enumerate(edges):
        columns |= {f"edge{number}": dr.select(oblique, re, 0.0), f"edge{number}j": dr.select(oblique, im, 0.0)}
    if oblique is not None:
        columns["oblique"] = oblique
    incidence = dr.abs(dr.dot(normal, arriving))
    strayed, *shares = surfaces.scattered(face, incidence, columns["cosine"])
    cosines = incidence * columns["cosine"] / np.pi
    level = 0.5 / wavenumber / (out * home) * kept_out * strayed * dr.sqrt(cosines)  # lambda / (4 pi) = 1 / (2 k)
    basis = _spherical_basis(rays, tx.axes, arriving)
    drawn = uniform_hash(np.column_stack([tubes.origin, tubes.face, np.ones(count, np.int64)]), near.seed)
    sign, phasor = turns(drawn)
    random = rays.vectors(np.stack([sign, phasor.real, phasor.imag], axis=1))
    matrix = _rough_matrix(shares, random)
    columns |= _scattered(on, basis, field, level, matrix, field if same_way else None)
    with many_threads(count):
        dr.eval(*columns.values())
    found = {name: rays.on_host(column) for name, column in columns.items()}
    found["a"], found["scattered"] = _matrices(found, "re", "im"), _matrices(found, "sre", "sim")
    if edges:
        found["edges"] = np.stack([found.pop(f"edge{k}") + 1j * found.pop(f"edge{k}j") for k in range(6)], axis=1)
    return found


class _Chain:
    """The mirrors before patches, on the device, as loops: else each number of bounces has a kernel of its own.

    Parameters
    ----------
    near : NearField
    tubes : ImageTubes
        Patches, all behind the same number of mirrors.
    """

    def __init__(self, near: NearField, tubes: ImageTubes) -> None:
        self._rays, self._surfaces = near.rays, near.surfaces
        dr, mi = near.rays.dr, near.rays.mi
        self._count, depth = tubes.face.shape
        self.last = dr.opaque(mi.UInt32, depth - 1)
        """Number of the patch itself in a chain, whose mirrors are 0 to this."""
        self._first = dr.arange(mi.UInt32, self._count) * dr.opaque(mi.UInt32, depth)
        self._faces, self._images = near.rays.index(tubes.face), near.rays.reals(tubes.image)

    def face(self, number: DeviceArray) -> DeviceArray:
        """Return the faces of the chains at a number."""
        return self._rays.dr.gather(self._rays.mi.UInt32, self._faces, self._first + number)

    def image(self, number: DeviceArray) -> DeviceArray:
        """Return the images of the transmitter from which the rays come to the faces at a number."""
        return self._rays.dr.gather(self._rays.Vector, self._images, self._first + number)

    def plane(self, number: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
        """Return normals and offsets of these faces."""
        return self._surfaces.plane(self.face(number))

    def unfolded(self, center: DeviceArray, velocity: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
        """Return the images of the patches' centres that the transmitter sees, and their velocities.

        A mirror moves as it does where the ray to the centre meets it.
        """
        dr, mi = self._rays.dr, self._rays.mi

        def behind(
            left: DeviceArray, seen: DeviceArray, moved: DeviceArray
        ) -> tuple[DeviceArray, DeviceArray, DeviceArray]:
            number = left - 1
            normal, offset = self.plane(number)
            source = self.image(number)
            seen = seen - 2.0 * (dr.dot(normal, seen) - offset) * normal
            ray = seen - source
            point = source + (offset - dr.dot(normal, source)) / dr.dot(normal, ray) * ray
            mirror = self._surfaces.velocity(self.face(number), point)
            return number, seen, moved - 2.0 * dr.dot(normal, moved - mirror) * normal

        state = dr.zeros(mi.UInt32, self._count) + self.last, center, velocity
        _, seen, moved = dr.while_loop(state, lambda left, *_: left > 0, behind, label="images of patches")
        return seen, moved

    def reflected(self, seen: DeviceArray, field: Field) -> Field:
        """Return what the mirrors make of fields on the way to `seen`, the images of the patches' centres."""
        dr, mi, on = self._rays.dr, self._rays.mi, OnDevice(self._rays.dr)

        def onward(number: DeviceArray, seen: DeviceArray, field: Field) -> tuple[DeviceArray, DeviceArray, Field]:
            (normal, offset), arriving = self.plane(number), dr.normalize(seen - self.image(number))
            lit = normal * -dr.sign(dr.dot(normal, arriving))
            field, _ = _bounced(on, self._surfaces, self.face(number), field, arriving, lit)
            return number + 1, seen - 2.0 * (dr.dot(normal, seen) - offset) * normal, field

        state = dr.zeros(mi.UInt32, self._count), seen, field
        _, _, field = dr.while_loop(state, lambda number, *_: number < self.last, onward, label="mirrors")
        return field


def _bounced(
    on: OnDevice,
    surfaces: FaceSurfaces,
    face: DeviceArray,
    field: Field,
    arriving: DeviceArray,
    normal: DeviceArray,
) -> tuple[Field, DeviceArray]:
    """Return the field that faces reflect, and its direction."""
    smooth, onward = reflected_field(on, partial(surfaces.coefficients, face), field, arriving, normal)
    kept = surfaces.kept(face)
    return [(kept * re, kept * im) for re, im in smooth], onward


def _matrices(found: dict[str, npt.NDArray[Any]], real: str, imaginary: str) -> npt.NDArray[np.complex128]:
    """Take the entries of 2 x 2 matrices out of columns."""
    parts = [
        np.stack([found.pop(f"{part}{r}{t}") for r in range(2) for t in range(2)], axis=1) for part in (real, imaginary)
    ]
    return (parts[0] + 1j * parts[1]).reshape(-1, 2, 2)


def _rough_matrix(shares: list[DeviceArray], random: DeviceArray) -> list[list[tuple[DeviceArray, DeviceArray]]]:
    """Return :func:`.depolarization.rough_matrix` on the device.

    `shares` are those of :meth:`.FaceSurfaces.scattered`, `random` the numbers of :func:`.depolarization.turns`.
    """
    in_phase, opposite, across = shares
    crossed = across * random.y, across * random.z
    return [[(in_phase, opposite * random.x), crossed], [crossed, (in_phase, -opposite * random.x)]]


def _scattered(
    on: OnDevice,
    basis: tuple[DeviceArray, DeviceArray],
    field: Field,
    level: DeviceArray,
    matrix: list[list[tuple[DeviceArray, DeviceArray]]],
    heard: Field | None,
) -> dict[str, DeviceArray]:
    """Return the entries of the transfer by diffuse scattering of 1 m2, whose `matrix` is along the basis.

    `heard` are the fields here of what the receiver would send; it is along the basis if left out.
    """
    sent = [on.component(axis, field) for axis in basis]
    back = None if heard is None else [on.component(axis, heard) for axis in basis]
    found: dict[str, DeviceArray] = {}
    for t, pair in enumerate(zip(*sent, strict=True)):
        strayed = []
        for row in matrix:
            (re, im), (other_re, other_im) = (on.times(one, [part])[0] for one, part in zip(row, pair, strict=True))
            strayed.append((re + other_re, im + other_im))
        for r, entry in enumerate(strayed):
            if back is not None:
                along = [on.times(back[axis][r], [strayed[axis]])[0] for axis in range(2)]
                entry = along[0][0] + along[1][0], along[0][1] + along[1][1]
            found[f"sre{r}{t}"], found[f"sim{r}{t}"] = level * entry[0], level * entry[1]
    return found


def _spherical_basis(
    rays: StateRays, axes: Sequence[DeviceArray], direction: DeviceArray
) -> tuple[DeviceArray, DeviceArray]:
    """Return theta-hat and phi-hat of unit directions in world axes; phi = 0 along the frame's z axis."""
    dr, (x, y, z) = rays.dr, axes
    along_x, along_y = dr.dot(x, direction), dr.dot(y, direction)
    flat = dr.sqrt(along_x**2 + along_y**2)
    upright = flat <= 1e-12
    cosine, sine = dr.select(upright, 1.0, along_x / flat), dr.select(upright, 0.0, along_y / flat)
    outward = cosine * x + sine * y
    return dr.dot(z, direction) * outward - flat * z, cosine * y - sine * x
