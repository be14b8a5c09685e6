"""Sum of what all footprints radiate: the far-field scattering matrix of a mesh."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.settings.sbr import DEFAULT_SBR, SbrSettings

from .body.mesh import Body
from .edges.far_field import add_edges
from .faces.curved import CurvedFaces
from .fields import HOST, Wave, radiating_vector
from .phase import plane_wave_integral
from .plane_waves import Bounce, Looks, Plan, bounces, plan_of, unhidden
from .surfaces import PartSurfaces

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.int64]


def scattering_matrices(
    body: Body, surfaces: PartSurfaces, looks: Looks, settings: SbrSettings = DEFAULT_SBR
) -> npt.NDArray[np.complex128]:
    r"""Return the far-field scattering matrix of a mesh for every look.

    Parameters
    ----------
    body : Body
    surfaces : PartSurfaces
        One for each part of the body. A dielectric is valid at its own frequency only.
    looks : Looks
    settings : SbrSettings
        What is None follows the size of the body.

    Returns
    -------
    ndarray of complex128, shape (num_looks, 2, 2)
        S [m], receive polarisation (V, H) first, then transmit: the scattered field is S exp(-jkr) / r for a unit wave
        whose phase is zero at the origin of the mesh's frame; the RCS is 4 pi abs(S)^2.

    Notes
    -----
    .. math:: S = -\frac{j k}{4 \pi} \sum_{tubes} \hat p_r \cdot (\eta J - \hat s \times M)
              e^{-j k L} \int e^{j k (\hat s - \hat k) \cdot r} dA

    The currents of the first bounce radiate in all directions (behind the surface they make the shadow); those of later
    bounces only in front of their surface. Where something stands between a footprint and the observer, it is left out.

    What comes back to the source is the mean of both senses, (S + S^T) / 2, see :func:`both_senses`. With
    `edge_diffraction` the fringe currents of edges are added (:mod:`.edges.far_field`), and what a bistatic pair
    receives is the mean of both senses, too: exactly reciprocal, which physical optics is not.

    References
    ----------
    .. [1] H. Ling, R.-C. Chou, S.-W. Lee, "Shooting and Bouncing Rays", IEEE Trans. Antennas Propag. 37(2), 1989.
    .. [2] C. A. Balanis, *Advanced Engineering Electromagnetics*, 2nd ed., sections 6.8 and 7.10.
    """
    found = _one_way(body, surfaces, looks, settings)
    if settings.edge_diffraction and len(looks):
        apart = np.flatnonzero(~looks.is_backward)
        if len(apart):
            reverse = _one_way(body, surfaces, looks.take(apart).reversed(), settings)
            found[apart] = 0.5 * (found[apart] + reverse.transpose(0, 2, 1))
    return both_senses(found, looks.is_backward)


def both_senses(matrices: Complex, backward: npt.NDArray[np.bool_]) -> Complex:
    r"""Return matrices with the mean of both senses, (S + S^T) / 2, where the observer is at the source.

    Parameters
    ----------
    matrices : ndarray of complex128, shape (num_looks, 2, 2)
        By the currents that the transmitter makes.
    backward : ndarray of bool, shape (num_looks,)
        Where the observer is at the source.

    Notes
    -----
    A wave that comes back has met each chain of bounces in both senses, and the matrix of one is the transposed of that
    of the other (reciprocity): HV = VH. The currents of physical optics at the last bounce of a chain are not those at
    the last bounce of its reverse, so that HV and VH of two plates at 75 deg differ by 6.6 dB (VV and HH cannot tell).

    References
    ----------
    .. [1] C. A. Balanis, *Advanced Engineering Electromagnetics*, 2nd ed., 2012, section 7.5 (reciprocity).
    """
    return np.where(backward[:, None, None], 0.5 * (matrices + matrices.transpose(0, 2, 1)), matrices)


def _one_way(body: Body, surfaces: PartSurfaces, looks: Looks, settings: SbrSettings) -> npt.NDArray[np.complex128]:
    """Return the matrices by the currents that the transmitter makes."""
    result = np.zeros((len(looks), 4), dtype=np.complex128)
    if len(looks):
        plan = plan_of(looks)
        body = body.with_curves(settings, float(plan.wavenumber.max()), surfaces.rounded)
        settings = settings.for_size(body.size / float(plan.waves.wavelength.min()))
        for bounce in bounces(body, surfaces, plan.waves, settings):
            for seen in footprints_seen(body, bounce, plan, settings):
                _radiate(result, body.curved, bounce, plan, seen)
        if settings.edge_diffraction:
            add_edges(result, body, surfaces, plan, settings)
    return result.reshape(len(looks), 2, 2)


def _expand(first: Index, member: Index) -> tuple[Index, Index]:
    """Return for each entry of `member` all rows of its group: (position in `member`, row)."""
    count = first[member + 1] - first[member]
    position = np.repeat(np.arange(len(member)), count)
    within = np.arange(len(position)) - np.repeat(np.cumsum(count) - count, count)
    return position, first[member][position] + within


def footprints_seen(
    body: Body, bounce: Bounce, plan: Plan, settings: SbrSettings
) -> Iterator[tuple[Index, Index, Array]]:
    """Yield tubes, views and corners of what observers see of a bounce's footprints, in bounded batches."""
    tubes = bounce.tubes
    looks_of_wave = plan.first_look[plan.first_view[1:]] - plan.first_look[plan.first_view[:-1]]
    work = np.cumsum(looks_of_wave[tubes.wave])
    batch = work // settings.max_tubes
    for number in range(int(batch[-1]) + 1):
        rows = np.flatnonzero(batch == number)
        if not len(rows):
            continue
        position, view = _expand(plan.first_view, tubes.wave[rows])
        tube = rows[position]
        front = np.einsum("ij,ij->i", tubes.normal[tube], plan.observer[view]) > 0.0
        if bounce.depth == 1:
            seen = plan.backward[view] | ~front | tubes.free[tube]
        else:
            seen = front & tubes.free[tube]
        yield tube[seen], view[seen], tubes.corners[tube[seen]]
        tested = front & ~seen
        tube, view = tube[tested], view[tested]
        wavelength = plan.waves.wavelength[tubes.wave[tube]]
        for corners, entry in unhidden(body, tubes, tube, plan.observer[view], wavelength, settings):
            yield tube[entry], view[entry], corners


def phase_weights(
    curved: CurvedFaces | None, bounce: Bounce, plan: Plan, seen: tuple[Index, Index, Array]
) -> tuple[Index, Index, Complex]:
    """Return what turns the currents of footprints into far fields.

    That is: looks, positions among them, and -jk/4pi times the phase integral. `seen` is what :func:`footprints_seen`
    yields.
    """
    tubes, (tube, view, corners) = bounce.tubes, seen
    difference = plan.observer[view] - tubes.direction[tube]
    pair, entry = _expand(plan.first_look, view)
    k = plan.wavenumber[entry]
    q = k[:, None] * difference[pair]
    if curved is None:
        integral = plane_wave_integral(corners[pair], q)
    else:
        face, normal = tubes.face[tube], tubes.normal[tube]
        integral = curved.plane_wave_integral(face[pair], corners[pair], q, normal[pair])
    return plan.look[entry], pair, -0.25j * k / np.pi * integral * np.exp(-1j * k * tubes.path[tube[pair]])


def _radiate(
    result: Complex, curved: CurvedFaces | None, bounce: Bounce, plan: Plan, seen: tuple[Index, Index, Array]
) -> None:
    """Add the field of footprints to the looks of their views."""
    tubes, (tube, view, _) = bounce.tubes, seen
    if not len(tube):
        return
    vector = radiating_vector(
        HOST,
        Wave(tubes.incident[tube], tubes.direction[tube]),
        Wave(bounce.reflected[tube], bounce.onward[tube]),
        tubes.normal[tube],
        plan.observer[view],
    )
    amplitude = np.einsum("nri,nit->nrt", plan.receive[view], vector).reshape(-1, 4)
    look, pair, factor = phase_weights(curved, bounce, plan, seen)
    for column in range(4):
        part = factor * amplitude[pair, column]
        result[:, column] += np.bincount(look, part.real, len(result)) + 1j * np.bincount(look, part.imag, len(result))
