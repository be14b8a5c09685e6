"""The model of a problem: from parameters to weighted residuals and their exact derivatives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.scene.materials.table import MaterialTable, RadioMaterial, load_materials

from .body_model import mesh_field
from .physics import MATERIAL_FIELDS, TrialMaterial, derivative, slab_field, slab_sigma0, target_field
from .scene_model import map_data, map_model, path_powers
from .spec import (
    CalibrationProblem,
    FreeParameter,
    Lobe,
    Measurement,
    MeshRcs,
    RadarMap,
    RcsPattern,
    ScenePowers,
    SlabMeasurement,
)

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

TINY = 1e-300
"""Keeps the logarithm of a field that vanishes finite."""
FIELD_RANGES = {
    "relative_permittivity": (1.0, np.inf),
    "conductivity": (0.0, np.inf),
    "thickness": (0.0, np.inf),
    "roughness_rms": (0.0, np.inf),
    "scattering_coefficient": (0.0, 1.0),
    "xpd_coefficient": (0.0, 1.0),
}


@dataclass(frozen=True, eq=False)
class Trial:
    """Numbers of one evaluation, sorted by what they belong to.

    `targets` are in the units of the fields of a target; `gains` [dB], by measurement.
    """

    materials: Mapping[str, TrialMaterial]
    targets: Mapping[str, dict[str, complex]]
    gains: Mapping[str, complex]


@dataclass(frozen=True, eq=False)
class Channel:
    """One measurement, compiled: its data as real numbers, and the field that the model gives for it.

    `data` and their noise `sigma` have the shape (num_values,), in the unit of the measurement. Where `is_power`, what
    `field` gives is the square of a field without a phase of its own, such as that of a rough surface.
    """

    spec: Measurement
    form: str
    data: Array
    sigma: Array
    field: Callable[[Trial], Complex]
    is_power: bool = False


class ForwardModel:
    """A problem ready to be evaluated.

    Raises
    ------
    UnknownMaterialError, UnknownNameError
        If a measurement or a parameter names what is not there; both list what is.
    ParameterRangeError
        If bounds reach outside what a material can be, or data do not fit.
    MaterialRangeError
        If a material has no data at a measurement's frequency.
    """

    def __init__(self, problem: CalibrationProblem) -> None:
        self.problem = problem
        self.table: MaterialTable = load_materials(problem.materials)
        self.free = problem.parameters
        self.lower = np.array([item.lower for item in self.free])
        self.upper = np.array([item.upper for item in self.free])
        for item in self.free:
            self._check(item)
        self.start = np.array([self._start(item) for item in self.free])
        self.channels = [self._compile(item) for item in problem.measurements]

    @property
    def names(self) -> list[str]:
        """Names of the free parameters."""
        return [item.name for item in self.free]

    @property
    def span(self) -> Array:
        """Upper minus lower bound, shape (num_parameters,).

        In the units of the parameters.
        """
        return np.asarray(self.upper - self.lower)

    def _check(self, item: FreeParameter) -> None:
        """Raise if a parameter is unknown or its bounds are out of what it can be."""
        measured = [spec.name for spec in self.problem.measurements]
        if item.owner in self.problem.targets:
            target = self.problem.targets[item.owner]
            known = ["floor_dbsm"] + [f"{lobe}.{name}" for lobe in target.lobes for name in Lobe.model_fields]
            if item.field not in known:
                raise UnknownNameError(f"parameter of target '{item.owner}'", item.field, known)
            return
        if item.owner in measured:
            if item.field != "gain_db":
                raise UnknownNameError(f"parameter of measurement '{item.owner}'", item.field, ["gain_db"])
            return
        if item.owner not in self.table and item.field in MATERIAL_FIELDS:
            self.table[item.owner]  # UnknownMaterialError with the known names
        if item.owner not in self.table:
            known = [*self.problem.targets, *measured, *self.table]
            raise UnknownNameError("material, target or measurement", item.owner, known)
        if item.field not in MATERIAL_FIELDS:
            raise UnknownNameError("material parameter", item.field, MATERIAL_FIELDS)
        least, most = FIELD_RANGES.get(item.field, (-np.inf, np.inf))
        if item.lower < least or item.upper > most:
            raise ParameterRangeError(
                f"bounds of {item.name}",
                f"{item.lower:g} to {item.upper:g}",
                f"within {least:g} to {most:g}",
                "no material is outside",
            )

    def _start(self, item: FreeParameter) -> float:
        """Return where the search begins."""
        given = item.start if item.start is not None else item.prior_mean
        if given is None and item.owner in self.table and item.owner not in self.problem.targets:
            given = getattr(self.table[item.owner], item.field, None)
        middle = 0.5 * (item.lower + item.upper)
        return middle if given is None or not item.lower <= given <= item.upper else float(given)

    def _compile(self, spec: Measurement) -> Channel:
        """Return a measurement with its model."""
        field: Callable[[Trial], Complex]
        form, data = getattr(spec, "form", "complex"), spec.data
        if isinstance(spec, SlabMeasurement):
            slab, base = spec, self.table[spec.material]
            quantity = slab_sigma0 if spec.is_backscatter else slab_field

            def field(trial: Trial) -> Complex:
                return quantity(slab, trial.materials.get(slab.material) or TrialMaterial.of(base, {}))

        elif isinstance(spec, RcsPattern):
            pattern = spec
            if spec.target not in self.problem.targets:
                raise UnknownNameError("target", spec.target, self.problem.targets)
            target = self.problem.targets[spec.target]

            def field(trial: Trial) -> Complex:
                return target_field(target, trial.targets.get(pattern.target, {}), pattern.aspect_deg)

        else:
            data = map_data(spec) if isinstance(spec, RadarMap) else data  # first: it costs less than to trace
            if isinstance(spec, MeshRcs):
                model = mesh_field(spec, self.table)
            else:
                model = path_powers(spec, self.table) if isinstance(spec, ScenePowers) else map_model(spec, self.table)

            def field(trial: Trial) -> Complex:
                return model(trial.materials)

        noise = np.broadcast_to(np.asarray(spec.noise, dtype=np.float64), data.shape)
        flat = np.concatenate([data.real, data.imag]) if form == "complex" else data.real
        sigma = np.concatenate([noise, noise]) if form == "complex" else noise
        is_power = isinstance(spec, SlabMeasurement) and spec.is_backscatter
        return Channel(spec, form, flat, sigma, field, is_power)

    def trial(self, parameters: npt.NDArray[np.complexfloating] | Array) -> Trial:
        """Return parameters sorted by owner.

        `parameters` have the shape (num_parameters,) and their own units.
        """
        changes: dict[str, dict[str, complex]] = {}
        for item, value in zip(self.free, parameters, strict=True):
            changes.setdefault(item.owner, {})[item.field] = complex(value)
        targets = {name: value for name, value in changes.items() if name in self.problem.targets}
        measured = {spec.name for spec in self.problem.measurements}
        gains = {name: value["gain_db"] for name, value in changes.items() if name in measured and name not in targets}
        rest = {name: value for name, value in changes.items() if name not in targets and name not in gains}
        return Trial({name: TrialMaterial.of(self.base(name), value) for name, value in rest.items()}, targets, gains)

    def base(self, material: str) -> RadioMaterial:
        """Return the entry of which a material's free numbers take the place.

        An albedo that it states gives way to what scatters by them: a free `scattering_coefficient`, or a free
        `roughness_rms` whose backscatter is among what is measured.
        """
        free = {item.field for item in self.free if item.owner == material}
        bench = [spec for spec in self.problem.measurements if isinstance(spec, SlabMeasurement) and not spec.held_out]
        seen = any(spec.material == material and spec.is_backscatter for spec in bench)
        entry = self.table[material]
        if "scattering_coefficient" in free or ("roughness_rms" in free and seen):
            return entry.with_(diffuse_albedo=None, volume_albedo=None)
        return entry

    def _response(self, channel: Channel, parameters: Complex) -> Complex:
        """Return what `channel.field` gives, with the measurement's gain."""
        trial = self.trial(parameters)
        gain = trial.gains.get(channel.spec.name, complex(channel.spec.gain_db))
        return channel.field(trial) * np.exp(np.log(10.0) / (10.0 if channel.is_power else 20.0) * gain)

    def predict(self, channel: Channel, parameters: Array) -> Array:
        """Return what the model says a measurement shows, in the unit of its values.

        `parameters` have the shape (num_parameters,) and their own units; the prediction has the shape (num_values,).
        """
        return _observed(channel, self._response(channel, parameters.astype(np.complex128)))

    def predict_with_jacobian(self, channel: Channel, parameters: Array) -> tuple[Array, Array]:
        """Return the prediction and its derivatives, shapes (num_values,) and (num_values, num_parameters).

        In the unit of the values, and that over the units of the parameters.
        """
        value, jacobian = derivative(lambda point: self._response(channel, point), parameters, self.span)
        return _observed(channel, value), _observed_slope(channel, value, jacobian)

    def residuals(self, parameters: Array) -> Array:
        """Return (prediction - data) / noise of all measurements that are used, then the priors.

        `parameters` have the shape (num_parameters,) and their own units. The residuals, shape (num_residuals,), are
        dimensionless.
        """
        parts = [
            (self.predict(item, parameters) - item.data) / item.sigma
            for item in self.channels
            if not item.spec.held_out
        ]
        return np.concatenate([*parts, self._prior(parameters)])

    def jacobian(self, parameters: Array, with_prior: bool = True) -> Array:
        """Return the derivatives of :meth:`residuals`."""
        parts = [
            self.predict_with_jacobian(item, parameters)[1] / item.sigma[:, None]
            for item in self.channels
            if not item.spec.held_out
        ]
        if with_prior:
            rows = [column for column, item in enumerate(self.free) if item.prior_std is not None]
            prior = np.zeros((len(rows), len(self.free)))
            for row, column in enumerate(rows):
                prior[row, column] = 1.0 / float(self.free[column].prior_std or 1.0)
            parts.append(prior)
        return np.concatenate(parts)

    def _prior(self, parameters: Array) -> Array:
        return np.array(
            [
                (value - item.prior_mean) / item.prior_std
                for item, value in zip(self.free, parameters, strict=True)
                if item.prior_std is not None and item.prior_mean is not None
            ]
        )


def _observed(channel: Channel, response: Complex) -> Array:
    if channel.form == "complex":
        return np.concatenate([response.real, response.imag])
    power = np.abs(response) if channel.is_power else np.abs(response) ** 2
    if channel.form == "amplitude":
        return np.sqrt(power)
    return power if channel.form == "power" else 10.0 * np.log10(power + TINY)


def _observed_slope(channel: Channel, response: Complex, slope: Complex) -> Array:
    if channel.form == "complex":
        return np.concatenate([slope.real, slope.imag])
    power = np.abs(response)
    of_power = (np.conj(response)[:, None] * slope).real
    if channel.is_power:
        lost = np.abs(slope) if channel.form == "power" else 0.0  # a power can only rise from nothing
        of_power = np.where(power[:, None] > 0.0, of_power / (power + TINY)[:, None], lost)
    else:
        power, of_power = power**2, 2.0 * of_power
    if channel.form == "power":
        return of_power
    if channel.form == "amplitude":
        return np.asarray(of_power / (2.0 * np.sqrt(power + TINY))[:, None])
    return np.asarray(10.0 / np.log(10.0) * of_power / (power + TINY)[:, None])
