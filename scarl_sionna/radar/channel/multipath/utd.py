"""Uniform theory of diffraction at a straight wedge: the dyadic coefficient, for conductors and for other materials.

Time dependence e^{+j 2 pi f t}.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import wofz

from scarl_sionna.engine.rays.edges import Wedge

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Reflection = Callable[[float], tuple[complex, complex]]
"""Cosine of incidence -> reflection coefficients TE and TM of the faces."""


def transition(x: npt.ArrayLike) -> Complex:
    r"""Return the transition function of the uniform theory.

    .. math:: F(x) = 2 j \sqrt{x}\, e^{jx} \int_{\sqrt{x}}^\infty e^{-j t^2}\,dt

    Parameters
    ----------
    x : array_like of float
        >= 0.

    References
    ----------
    .. [1] R. Kouyoumjian, P. Pathak, *A uniform geometrical theory of diffraction for an edge in a perfectly conducting
       surface*, Proc. IEEE 62(11), 1974, Eq. (28).
    """
    root = np.sqrt(np.asarray(x, dtype=np.float64))
    return root * _transition_over_root(root)


def _transition_over_root(root: npt.ArrayLike) -> Complex:
    """Return F(x) / sqrt(x), smooth down to x = 0, by the scaled complementary error function."""
    rotated = np.exp(0.75j * np.pi) * np.asarray(root, dtype=np.float64)
    return np.asarray(np.sqrt(np.pi) * np.exp(0.25j * np.pi) * wofz(rotated))


def _cotangent_times_transition(angle: float, n: float, distance: float) -> complex:
    """Return cot(angle) F(k L a) with its finite limits at the boundaries; `distance` is k L."""
    delta = angle - np.pi * np.round(angle / np.pi)
    away = np.abs(np.sin(n * delta))
    sine = np.sin(delta)
    ratio = n if abs(sine) < 1e-12 else away / abs(sine)
    sign = 1.0 if sine >= 0.0 else -1.0
    root = np.sqrt(2.0 * distance)
    return complex(sign * np.cos(delta) * ratio * root * _transition_over_root(root * away))


@dataclass(frozen=True, eq=False)
class EdgeRay:
    """A ray that an edge bends.

    Attributes
    ----------
    incident, diffracted : ndarray of float64, shape (3,)
        Unit directions of travel; both make the same angle with the edge.
    before, behind : float
        Lengths from the source to the edge and from there on [m].
    """

    incident: Array
    diffracted: Array
    before: float
    behind: float


def edge_transfer(wedge: Wedge, ray: EdgeRay, wavenumber: float, reflection: Reflection) -> Complex:
    r"""Return what turns the field of the incident ray into that of the diffracted ray, shape (3, 3), world axes.

    Parameters
    ----------
    wedge : Wedge
        With its 0-face lit.
    ray : EdgeRay
    wavenumber : float
        [1/m].
    reflection : callable
        Coefficients of the faces.

    Returns
    -------
    ndarray of complex128
        So that the field at the end is this times the transmitted polarisation over the whole length
        ``before + behind``, as for a mirror.

    Notes
    -----
    In the bases of the edge (beta, phi) at both rays

    .. math:: E_d = [(D_1 + D_2) C_i + D_3 C_n + D_4 C_0] E_i \sqrt{\frac{s'}{s (s + s')}}

    with the four terms D of [1]_; C_i takes over the components of a ray that goes on, C_0 and C_n those of a ray that
    the 0-face and the n-face reflect, by their Fresnel coefficients. For a conductor these are -1 and +1 and the
    coefficient is exactly that of [1]_. For other materials it is the heuristic one [2]_: continuous at all boundaries,
    with the n-face's coefficient at the angle of the diffracted ray.

    References
    ----------
    .. [1] R. Kouyoumjian, P. Pathak, Proc. IEEE 62(11), 1974, Eqs. (25) to (30).
    .. [2] R. Luebbers, *Finite conductivity uniform GTD versus knife edge diffraction in prediction of propagation path
           loss*, IEEE Trans. Antennas Propag. 32(1), 1984.
    """
    edge, incident, diffracted, before, behind = wedge.direction, ray.incident, ray.diffracted, ray.before, ray.behind
    n = wedge.exterior / np.pi
    sine = float(np.linalg.norm(np.cross(edge, incident)))
    source, end = _angle(wedge, -incident), _angle(wedge, diffracted)
    distance = wavenumber * before * behind / (before + behind) * sine**2
    factor = -np.exp(-0.25j * np.pi) / (2.0 * n * np.sqrt(2.0 * np.pi * wavenumber) * sine)
    less, more = end - source, end + source
    d1, d2, d3, d4 = (
        factor * _cotangent_times_transition((np.pi + sign * beta) / (2.0 * n), n, distance)
        for beta, sign in ((less, 1.0), (less, -1.0), (more, 1.0), (more, -1.0))
    )
    basis_in, basis_out = _arriving(edge, incident), _leaving(edge, diffracted)
    near = _mirror_components(edge, incident, wedge.normal, reflection)
    turned = np.diag([-1.0, 1.0])
    far = turned @ _mirror_components(edge, -diffracted, _far_normal(wedge), reflection).T @ turned
    dyadic = -(d1 + d2) * np.eye(2) + d4 * near + d3 * far
    spreading = np.sqrt((before + behind) / (before * behind))
    return np.asarray(basis_out.T @ dyadic @ basis_in * spreading, dtype=np.complex128)


def _angle(wedge: Wedge, direction: Array) -> float:
    return float(np.arctan2(direction @ wedge.normal, direction @ wedge.tangent) % (2.0 * np.pi))


def _far_normal(wedge: Wedge) -> Array:
    """Return the outward normal of the n-face."""
    return np.asarray(np.sin(wedge.exterior) * wedge.tangent - np.cos(wedge.exterior) * wedge.normal)


def _arriving(edge: Array, direction: Array) -> Array:
    """Return beta-hat and phi-hat of a ray that comes to the edge, shape (2, 3)."""
    phi = -np.cross(edge, direction)
    phi = phi / np.linalg.norm(phi)
    return np.stack([np.cross(phi, direction), phi])


def _leaving(edge: Array, direction: Array) -> Array:
    """Return beta-hat and phi-hat of a ray that leaves the edge, shape (2, 3)."""
    phi = np.cross(edge, direction)
    phi = phi / np.linalg.norm(phi)
    return np.stack([np.cross(phi, direction), phi])


def _mirror_components(edge: Array, direction: Array, normal: Array, reflection: Reflection) -> Complex:
    """Return what a face makes of the components at arrival: those of its mirrored ray, shape (2, 2)."""
    cosine = float(direction @ normal)
    mirrored = direction - 2.0 * cosine * normal
    te_axis = np.cross(direction, normal)
    length = float(np.linalg.norm(te_axis))
    te_axis = te_axis / length if length > 1e-9 else np.asarray(edge)
    te, tm = reflection(min(abs(cosine), 1.0))
    basis_in, basis_out = _arriving(edge, direction), _leaving(edge, mirrored)
    matrix = te * np.outer(te_axis, te_axis) + tm * np.outer(np.cross(te_axis, mirrored), np.cross(te_axis, direction))
    return np.asarray(basis_out @ matrix @ basis_in.T, dtype=np.complex128)
