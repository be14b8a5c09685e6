"""Radar cross section of a mesh by shooting and bouncing rays with physical optics, monostatic and bistatic.

How right it is, against what, and where it breaks stands in docs/rcs.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.prompt.arguments import check_frequency, check_radians
from scarl_sionna.core.prompt.describe import Described
from scarl_sionna.core.settings.sbr import DEFAULT_SBR, SbrSettings
from scarl_sionna.core.units import SPEED_OF_LIGHT, power_to_db
from scarl_sionna.scene.materials.table import MaterialTable

from .optics.body.parts import Material, Mesh, actor_parts, check_size, load_body, surfaces_of
from .optics.far_field import scattering_matrices
from .optics.plane_waves import Looks

__all__ = ["POLARIZATIONS", "RcsCut", "actor_parts", "load_body", "rcs", "rcs_cut", "scattering_matrix"]

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

POLARIZATIONS = ("VV", "HH", "VH", "HV")
"""Receive letter first; V is along theta_hat, H along phi_hat."""
ANGLES_AT_ONCE = 8
"""Angles of a cut between two reports of progress."""


def rcs(
    mesh: Mesh,
    frequency: npt.ArrayLike,
    theta: npt.ArrayLike,
    phi: npt.ArrayLike,
    polarization: str = "VV",
    material: Material = "metal",
    theta_s: npt.ArrayLike | None = None,
    phi_s: npt.ArrayLike | None = None,
    *,
    materials: MaterialTable | None = None,
    settings: SbrSettings | None = None,
) -> Real:
    r"""Return the far-field radar cross section of a mesh.

    Parameters
    ----------
    mesh : trimesh.Trimesh, path, Body, sequence of (mesh, material) or mapping of material to mesh
        Triangle mesh [m]; a `Body` is a mesh that has been made ready once. Parts of several materials stand in one
        frame and shadow and light each other; those of a scene's actor come from :func:`actor_parts`.
    frequency : array_like of float, any shape
        [Hz]. It is broadcast with the angles, and so are they with each other.
    theta, phi : array_like of float, any shape
        Direction from the target to the transmitter: from +z, and from +x in the xy plane [rad].
    polarization : {"VV", "HH", "VH", "HV"}
        Receive letter first; V is along theta_hat, H along phi_hat.
    material : str, complex or RadioMaterial
        "metal" (or "pec") is a perfect conductor; another name is one of `materials`; a number is the relative
        permittivity of a half space, with an imaginary part <= 0. A material with a thickness is a layer with air
        behind. Left out where the parts have materials of their own.
    theta_s, phi_s : array_like of float, any shape, optional
        Direction from the target to the receiver [rad]; one that is not given is the transmitter's.
    materials : MaterialTable, optional
        Where a name is looked up; by default the built-in table.
    settings : SbrSettings, optional
        Bounces, and how densely rays probe the mesh; what is left out fits the size of the mesh
        (`SbrSettings.for_size`).

    Returns
    -------
    ndarray of float64
        [m2], of the shape to which frequency and angles broadcast.

    Raises
    ------
    MeshError
        If the mesh cannot be read, has no faces, or has vertices that are not finite.
    ParameterRangeError
        If a frequency is not positive or an angle or permittivity is not usable.
    UnknownNameError
        If the polarisation is unknown, or (as `UnknownMaterialError`) the material.
    MaterialRangeError
        If the material has no data at a frequency.

    Warns
    -----
    ScarlWarning
        If the target is smaller than 3 wavelengths or larger than 50 m, or faces without area were left out.

    Notes
    -----
    .. math:: \sigma = 4 \pi |S|^2

    *Validity*: targets above 3 wavelengths, within some 20 dB of their peaks, with ``SbrSettings(edge_diffraction=
    True)`` some 30 dB. *Not modelled*: creeping waves, what passes through a dielectric, rough surfaces. *Convergence*:
    docs/rcs.md.

    References
    ----------
    .. [1] H. Ling, R.-C. Chou, S.-W. Lee, "Shooting and Bouncing Rays", IEEE Trans. Antennas Propag. 37(2), 1989.
    """
    receive, transmit = _polarization(polarization)
    matrix = scattering_matrix(
        mesh, frequency, theta, phi, material, theta_s, phi_s, materials=materials, settings=settings
    )
    return np.asarray(4.0 * np.pi * np.abs(matrix[..., receive, transmit]) ** 2)


def scattering_matrix(
    mesh: Mesh,
    frequency: npt.ArrayLike,
    theta: npt.ArrayLike,
    phi: npt.ArrayLike,
    material: Material = "metal",
    theta_s: npt.ArrayLike | None = None,
    phi_s: npt.ArrayLike | None = None,
    *,
    materials: MaterialTable | None = None,
    settings: SbrSettings | None = None,
) -> Complex:
    r"""Return the far-field scattering matrix of a mesh; parameters, errors and warnings as of :func:`rcs`.

    Returns
    -------
    ndarray of complex128, shape (..., 2, 2)
        S [m], receive polarisation (V, H) before transmit. The scattered field is :math:`S e^{-jkr} / r` for an
        incident field of 1 V/m whose phase is zero at the origin of the mesh's frame (time dependence e^{+jwt}). Both
        directions of a bistatic pair use theta_hat and phi_hat of their own direction.

    References
    ----------
    .. [1] H. Ling, R.-C. Chou, S.-W. Lee, "Shooting and Bouncing Rays", IEEE Trans. Antennas Propag. 37(2), 1989.
    """
    arrays = [np.asarray(a, dtype=np.float64) for a in (frequency, theta, phi)]
    arrays.append(arrays[1] if theta_s is None else np.asarray(theta_s, dtype=np.float64))
    arrays.append(arrays[2] if phi_s is None else np.asarray(phi_s, dtype=np.float64))
    _check_values(arrays)
    wide = np.broadcast_arrays(*arrays)
    columns = [a.reshape(-1) for a in wide]
    body = load_body(mesh)
    parts = list(surfaces_of(body, material, columns[0], materials))
    result = np.zeros((len(columns[0]), 2, 2), dtype=np.complex128)
    if len(result):
        check_size(body, float(columns[0].min()))
        knobs = (settings or DEFAULT_SBR).for_size(body.size * float(columns[0].max()) / SPEED_OF_LIGHT)
        for surfaces, rows in parts:
            result[rows] = scattering_matrices(body, surfaces, Looks(*(column[rows] for column in columns)), knobs)
    return result.reshape((*wide[0].shape, 2, 2))


def _polarization(name: str) -> tuple[int, int]:
    if name not in POLARIZATIONS:
        raise UnknownNameError("polarization", str(name), POLARIZATIONS, "the receive letter stands first")
    return "VH".index(name[0]), "VH".index(name[1])


def _check_values(arrays: Sequence[Real]) -> None:
    frequency = arrays[0]
    check_frequency("frequency", frequency)
    for name, angle in zip(("theta", "phi", "theta_s", "phi_s"), arrays[1:], strict=True):
        check_radians(name, angle)


@dataclass(frozen=True, eq=False, repr=False)
class RcsCut(Described, units={"angle_deg": "deg", "rcs": "m2", "frequency": "Hz"}):
    """Monostatic RCS over one angle.

    Attributes
    ----------
    angle_deg : ndarray of float64, shape (num_angles,)
        phi of an azimuth cut, theta of an elevation cut [deg].
    rcs : ndarray of float64, shape (num_polarizations, num_angles)
        [m2].
    polarizations : tuple of str
    cut : {"azimuth", "elevation"}
    frequency : float
        [Hz].
    """

    angle_deg: Real
    rcs: Real
    polarizations: tuple[str, ...]
    cut: str
    frequency: float

    @property
    def rcs_dbsm(self) -> Real:
        """RCS [dBsm]; -200 dBsm stands for nothing."""
        return power_to_db(self.rcs, -200.0)

    def table(self) -> str:
        """Return the cut as text with comma-separated columns."""
        head = ("phi_deg" if self.cut == "azimuth" else "theta_deg", *(f"{p}_dbsm" for p in self.polarizations))
        rows = np.column_stack([self.angle_deg, *self.rcs_dbsm])
        return "\n".join([",".join(head), *(",".join([f"{r[0]:g}", *(f"{v:.3f}" for v in r[1:])]) for r in rows)])

    def plot(self, path: str | Path) -> None:
        """Draw the cut into an image file (PNG, PDF or SVG by its name)."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8.0, 4.5), layout="constrained")
        axes = figure.add_subplot()
        levels = self.rcs_dbsm
        for name, level in zip(self.polarizations, levels, strict=True):
            axes.plot(self.angle_deg, level, label=name, linewidth=1.0)
        axes.set_ylim(max(levels.max() - 60.0, levels.min()) - 2.0, levels.max() + 3.0)
        axes.set_xlabel("azimuth phi [deg]" if self.cut == "azimuth" else "polar angle theta [deg]")
        axes.set_ylabel("RCS [dBsm]")
        axes.set_title(f"{self.cut} cut at {self.frequency / 1e9:g} GHz")
        axes.grid(alpha=0.3)
        axes.legend()
        figure.savefig(path)


def rcs_cut(
    mesh: Mesh,
    frequency: float,
    cut: Literal["azimuth", "elevation"] = "azimuth",
    polarizations: Sequence[str] = ("VV", "HH"),
    material: Material = "metal",
    *,
    step_deg: float = 1.0,
    fixed_angle_deg: float | None = None,
    materials: MaterialTable | None = None,
    settings: SbrSettings | None = None,
    on_progress: Callable[[int, int], None] | None = None,
) -> RcsCut:
    """Return the monostatic RCS over a full turn of phi, or over theta from 0 to 180 deg.

    Method and source as of :func:`rcs` (Ling, Chou and Lee, 1989).

    Parameters
    ----------
    mesh, frequency, material, materials, settings
        As of :func:`rcs`.
    cut : {"azimuth", "elevation"}
        Turns phi from -180 to 180 deg at a fixed theta (90 deg), or theta at a fixed phi (0 deg).
    polarizations : sequence of str
    step_deg : float
        [deg], above 0 and at most 180.
    fixed_angle_deg : float, optional
        The angle that does not turn [deg].
    on_progress : callable, optional
        Called with the number of angles done and of all, after every few angles.

    Raises
    ------
    UnknownNameError
        If there is no such cut or polarisation.
    ParameterRangeError
        If the step is out of its range.
    """
    if cut not in ("azimuth", "elevation"):
        raise UnknownNameError("cut", str(cut), ("azimuth", "elevation"))
    if not 0.0 < step_deg <= 180.0:
        raise ParameterRangeError("step_deg", f"{step_deg} deg", "above 0 and at most 180 deg")
    pairs = [_polarization(name) for name in polarizations]
    start = -180.0 if cut == "azimuth" else 0.0
    count = int(np.floor((180.0 - start) / step_deg + 1e-9)) + 1
    angle = start + step_deg * np.arange(count, dtype=np.float64)
    other = fixed_angle_deg if fixed_angle_deg is not None else (90.0 if cut == "azimuth" else 0.0)
    turned, fixed = np.deg2rad(angle), np.deg2rad([other])
    theta, phi = (fixed, turned) if cut == "azimuth" else (turned, fixed)
    body = load_body(mesh)
    pieces = []
    for first in range(0, count, ANGLES_AT_ONCE):
        rows = slice(first, first + ANGLES_AT_ONCE)
        some = (theta, phi[rows]) if cut == "azimuth" else (theta[rows], phi)
        pieces.append(scattering_matrix(body, frequency, *some, material, materials=materials, settings=settings))
        if on_progress is not None:
            on_progress(min(first + ANGLES_AT_ONCE, count), count)
    matrix = np.concatenate(pieces)
    sigma = np.stack([np.asarray(4.0 * np.pi * np.abs(matrix[:, r, t]) ** 2, dtype=np.float64) for r, t in pairs])
    return RcsCut(angle, sigma, tuple(polarizations), cut, float(frequency))
