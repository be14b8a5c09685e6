"""Materials and targets with complex parameters, so that the physics is a holomorphic function of them.

All coefficients of :mod:`scarl_sionna.scene.materials.fresnel` are holomorphic in permittivity, conductivity, thickness
and scattering coefficient. So the same code that simulates gives exact derivatives, by Cauchy's integral over a small
circle of complex parameter values.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.units import VACUUM_PERMITTIVITY
from scarl_sionna.scene.materials.fresnel import reflection, transmission
from scarl_sionna.scene.materials.rough import Channel, coherent_share, holomorphic_sigma0
from scarl_sionna.scene.materials.table import RadioMaterial

from .spec import LobedTarget, SlabMeasurement

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

MATERIAL_FIELDS = (
    "relative_permittivity",
    "conductivity",
    "permittivity_exponent",
    "conductivity_exponent",
    "thickness",
    "roughness_rms",
    "scattering_coefficient",
    "xpd_coefficient",
)
NUM_NODES = 4
"""Points of Cauchy's integral; its error falls as (radius over distance to the nearest singularity) to this power."""
RADIUS = 1e-3
"""Of the circle, as a share of the parameter's range."""


@dataclass(frozen=True)
class TrialMaterial:
    """A material under calibration: as :class:`RadioMaterial`, with numbers that may be complex."""

    base: RadioMaterial
    relative_permittivity: complex
    conductivity: complex
    permittivity_exponent: complex
    conductivity_exponent: complex
    thickness: complex | None
    roughness_rms: complex
    scattering_coefficient: complex
    xpd_coefficient: complex

    @classmethod
    def of(cls, base: RadioMaterial, changes: dict[str, complex]) -> TrialMaterial:
        """Return a material with some numbers changed.

        In the units of the fields of :class:`RadioMaterial`.
        """
        return cls(base, **{**{name: getattr(base, name) for name in MATERIAL_FIELDS}, **changes})

    def at(self, frequency: float) -> complex:
        """Return the relative permittivity, as :meth:`RadioMaterial.at`."""
        self.base.at(frequency)  # MaterialRangeError outside the entry's range
        ratio = frequency / self.base.reference_frequency
        loss = self.conductivity * ratio**self.conductivity_exponent / (2.0 * np.pi * frequency * VACUUM_PERMITTIVITY)
        return complex(self.relative_permittivity * ratio**self.permittivity_exponent - 1j * loss)

    @property
    def water_film(self) -> float:
        """Return the depth of water on the material [m]; not a parameter of its own."""
        return self.base.water_film

    @property
    def water_temperature(self) -> float:
        """Return the temperature of that water [K]."""
        return self.base.water_temperature

    @property
    def diffuse_albedo(self) -> float | None:
        """Return the albedo that is stated in place of what scattering and heights make; not a parameter."""
        return self.base.diffuse_albedo

    @property
    def volume_albedo(self) -> float | None:
        """Return the albedo of the scatterers of a deep layer; not a parameter."""
        return self.base.volume_albedo

    @property
    def rounded(self) -> bool:
        """Return whether faces of the material stand for a body that is curved everywhere."""
        return self.base.rounded

    def as_radio(self) -> RadioMaterial:
        """Return this object for the radio code, which reads attributes only."""
        return cast(RadioMaterial, self)


def slab_field(measurement: SlabMeasurement, material: TrialMaterial) -> Complex:
    r"""Return the reflected or transmitted field that a bench measures, over the incident one, shape (num_values,).

    Notes
    -----
    Reflection and transmission of a rough surface keep their coherent part,

    .. math:: \sqrt{1 - S^2}\; e^{-2 (k h \cos\theta)^2} \Gamma

    with S the scattering coefficient and h the rms height; the exponential (Ament) counts for reflection only. All as
    in :mod:`~scarl_sionna.scene.materials.rough`, which frames read.

    References
    ----------
    .. [1] W. S. Ament, "Toward a theory of reflection by a rough surface", Proc. IRE 41(1), 1953.
    """
    frequency, angle = _grid(measurement)
    cosine = np.cos(angle)
    formula = transmission if measurement.quantity == "transmission" else reflection
    out = np.empty(len(frequency), dtype=np.complex128)
    for value in np.unique(frequency):
        rows = np.flatnonzero(frequency == value)
        found = formula(material.as_radio(), float(value), cosine[rows])
        out[rows] = found[("TE", "TM").index(measurement.polarization)]
    if measurement.quantity == "reflection":
        return np.asarray(out * coherent_share(material.as_radio(), frequency, cosine))
    return np.asarray(out * np.sqrt(1.0 - material.scattering_coefficient**2 + 0j))


def slab_sigma0(measurement: SlabMeasurement, material: TrialMaterial) -> Complex:
    """Return the backscatter coefficient that a bench measures, shape (num_values,), up to phases without a meaning.

    By :func:`~scarl_sionna.scene.materials.rough.holomorphic_sigma0`, the law of frames: an albedo that the entry
    states counts as there.
    """
    frequency, angle = _grid(measurement)
    out = np.empty(len(frequency), dtype=np.complex128)
    channel: Channel = "VV" if measurement.quantity == "backscatter" else "HV"
    for value in np.unique(frequency):
        rows = np.flatnonzero(frequency == value)
        out[rows] = holomorphic_sigma0(material.as_radio(), float(value), np.pi / 2.0 - angle[rows], channel)
    return out


def _grid(measurement: SlabMeasurement) -> tuple[Array, Array]:
    """Return frequency [Hz] and angle from the normal [rad] of every value, shape (num_values,)."""
    num = max(len(measurement.values), np.size(measurement.frequency), np.size(measurement.angle_deg))
    frequency = np.broadcast_to(np.asarray(measurement.frequency, dtype=np.float64), (num,))
    return frequency, np.radians(np.broadcast_to(np.asarray(measurement.angle_deg, dtype=np.float64), (num,)))


def target_field(target: LobedTarget, changes: dict[str, complex], aspect_deg: npt.ArrayLike) -> Complex:
    """Return the root of the RCS [m] at some aspects; `changes` are ``floor_dbsm`` and ``<lobe>.<field>``.

    Floor and lobes as of :class:`~scarl_sionna.calibration.spec.LobedTarget`, TR 38.901, clause 7.9.2.
    """
    aspect = np.asarray(aspect_deg, dtype=np.float64)

    def linear(level: npt.NDArray[np.complexfloating] | complex) -> Complex:
        return np.asarray(np.exp(np.log(10.0) / 10.0 * level), dtype=np.complex128)

    rcs: Complex = linear(changes.get("floor_dbsm", complex(target.floor_dbsm))) * np.ones(
        aspect.shape, dtype=np.complex128
    )
    for name, lobe in target.lobes.items():
        center, width, peak = (
            changes.get(f"{name}.{field}", complex(getattr(lobe, field)))
            for field in ("center_deg", "width_deg", "peak_dbsm")
        )
        turns = np.round((aspect - np.real(center)) / 360.0)
        rcs = rcs + linear(peak - 12.0 * ((aspect - 360.0 * turns - center) / width) ** 2)
    return np.asarray(np.sqrt(rcs), dtype=np.complex128)


def derivative(function: Callable[[Complex], Complex], point: Array, scale: Array) -> tuple[Complex, Complex]:
    r"""Return a holomorphic function of real parameters and its derivatives.

    Parameters
    ----------
    function : callable
        From complex parameters, shape (num_parameters,), to complex values, shape (num_values,).
    point : ndarray of float64, shape (num_parameters,)
        In the units of the parameters.
    scale : ndarray of float64, shape (num_parameters,)
        Of each parameter, in its unit; the circle has the radius ``RADIUS * scale``.

    Returns
    -------
    value, jacobian : ndarray of complex128, shape (num_values,) and (num_values, num_parameters)
        In the unit of the values, and that over the units of the parameters.

    Notes
    -----
    .. math:: f'(x) = \frac{1}{N r} \sum_k f(x + r e^{j\phi_k}) e^{-j\phi_k}, \quad \phi_k = 2 \pi k / N

    References
    ----------
    .. [1] J. N. Lyness and C. B. Moler, "Numerical differentiation of analytic functions", SIAM J. Numer. Anal. 4(2),
       1967.
    """
    value = function(point.astype(np.complex128))
    jacobian = np.empty((len(value), len(point)), dtype=np.complex128)
    turns = np.exp(2j * np.pi * (np.arange(NUM_NODES) + 0.5) / NUM_NODES)
    for column in range(len(point)):
        radius = RADIUS * scale[column]
        total = np.zeros(len(value), dtype=np.complex128)
        for turn in turns:
            moved = point.astype(np.complex128)
            moved[column] += radius * turn
            total += function(moved) / turn
        jacobian[:, column] = total / (NUM_NODES * radius)
    return value, jacobian
