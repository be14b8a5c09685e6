"""The polarimetric matrix of a rough patch: one law for all solvers of the radar channel."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def quadrature(vertical: npt.ArrayLike, horizontal: npt.ArrayLike, crossed: npt.ArrayLike) -> Array:
    """Return which part of the co-polar amplitudes of a patch is opposite in V and H, see :func:`rough_matrix`.

    Amplitudes >= 0 of any shape; as much as the cross-polar one, or all where that is more.
    """
    return np.minimum(np.minimum(vertical, horizontal), crossed).astype(np.float64)


def turns(draw: npt.ArrayLike) -> tuple[Array, npt.NDArray[np.complex128]]:
    """Return a sign, and a phasor of uniform phase, of independent numbers of uniform distribution over [0, 1)."""
    twice = 2.0 * np.asarray(draw, dtype=np.float64)
    return np.where(twice < 1.0, -1.0, 1.0), np.exp(2j * np.pi * twice)


def rough_matrix(
    vertical: npt.ArrayLike, horizontal: npt.ArrayLike, crossed: npt.ArrayLike, draw: npt.ArrayLike
) -> npt.NDArray[np.complex128]:
    r"""Return the polarimetric matrices of rough patches, but for a phase of each as a whole.

    Parameters
    ----------
    vertical, horizontal, crossed : array_like of float, shape (n,)
        Amplitudes of VV, HH and VH, >= 0.
    draw : array_like of float, shape (n,)
        Uniform over [0, 1) and independent from patch to patch.

    Returns
    -------
    ndarray of complex128, shape (n, 2, 2)
        For fields along the same two directions there and back, in which a sphere's matrix is the identity.

    Notes
    -----
    .. math::

        \begin{pmatrix} \sqrt{v^2 - b^2} + j \epsilon b & x e^{j \varphi} \\
        x e^{j \varphi} & \sqrt{h^2 - b^2} - j \epsilon b \end{pmatrix}, \quad b = \min(v, h, x)

    with an independent phase :math:`\varphi` and sign :math:`\epsilon` of each patch. It is symmetric (reciprocity),
    and for v = h >= x its second moments are those of a medium without a direction about the ray [1]_: the cross-polar
    power is half of that of VV - HH, so that they stay the same under any roll of the radar,

    .. math:: \langle |VV|^2 \rangle = v^2, \quad \langle |VH|^2 \rangle = x^2, \quad
              \langle VV\,HH^* \rangle = v^2 - 2 x^2

    as of a cloud of thin needles, where the ratio of powers is 1/3 and the correlation of VV and HH 1/3. Circular
    pairs have v^2 - x^2 (opposite) and 2 x^2 (the same sense). Where x > v (more than half of the power crossed), no
    medium has these powers and no direction, and V and H are kept as they are.

    References
    ----------
    .. [1] S. V. Nghiem, S. H. Yueh, R. Kwok, F. K. Li, "Symmetry properties in polarimetric remote sensing", Radio
           Science 27(5), 1992.
    """
    opposite = quadrature(vertical, horizontal, crossed)
    sign, turn = turns(draw)
    out = np.empty((len(opposite), 2, 2), dtype=np.complex128)
    for place, (size, way) in enumerate(((vertical, sign), (horizontal, -sign))):
        out[:, place, place] = np.sqrt(np.maximum(np.square(size) - opposite**2, 0.0)) + 1j * way * opposite
    out[:, 0, 1] = out[:, 1, 0] = np.asarray(crossed, dtype=np.float64) * turn
    return out
