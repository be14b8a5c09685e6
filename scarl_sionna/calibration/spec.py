"""What a calibration is: measurements with their noise, and the parameters that are free.

Plain data, from YAML or Python.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator, model_validator

from scarl_sionna.core.errors import InputFileError, ParameterRangeError, SceneError
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.version_0_1 import read_radar
from scarl_sionna.core.units import Decibels, Degrees, Hertz, Metres, Unit
from scarl_sionna.core.untrusted.checked import Table, Text, checked, plain
from scarl_sionna.core.untrusted.files import MEGABYTE, read_text
from scarl_sionna.core.untrusted.yaml_text import read_yaml

Array = npt.NDArray[np.float64]
Numbers = float | tuple[float, ...]
Point = tuple[Metres, Metres, Metres]
_MOST_BYTES = 256 * MEGABYTE
Form = Literal["complex", "amplitude", "power", "power_db"]

_NOISE = (
    "the standard deviation of each value in the unit of the values (of each of real and "
    "imaginary part for complex ones): "
    "without it there are no intervals"
)


class FreeParameter(Spec):
    """One unknown: ``material.field``, ``target.field`` or ``measurement.gain_db``."""

    name: str = Field(
        pattern=r"^[^.]+\..+$", description="asphalt.relative_permittivity, car.left.peak_dbsm, bench.gain_db"
    )
    lower: float
    upper: float
    start: float | None = Field(
        None, description="None: the material's value, if that is within the bounds, else the middle"
    )
    prior_mean: float | None = None
    prior_std: float | None = Field(None, gt=0.0, description="standard deviation of a normal prior")

    @model_validator(mode="after")
    def _check(self) -> FreeParameter:
        if not self.lower < self.upper:
            raise ValueError(
                f"lower < upper: the bounds of '{self.name}' are {self.lower:g} and {self.upper:g}; swap or widen them"
            )
        if self.start is not None and not self.lower <= self.start <= self.upper:
            raise ValueError(f"start within the bounds {self.lower:g} to {self.upper:g}")
        if (self.prior_mean is None) != (self.prior_std is None):
            raise ValueError("prior_mean and prior_std together, or neither")
        return self

    @property
    def owner(self) -> str:
        """The material, target or measurement."""
        return self.name.partition(".")[0]

    @property
    def field(self) -> str:
        """What of it is free."""
        return self.name.partition(".")[2]


class Lobe(Spec):
    """One lobe of a target's RCS against aspect, ``peak - 12 (angle / width)^2`` dB as in TR 38.901, clause 7.9.2."""

    center_deg: float
    width_deg: Degrees = Field(gt=0.0, description="between the points 3 dB below the peak [deg]")
    peak_dbsm: float


class LobedTarget(Spec):
    """RCS of an object against aspect: a floor and lobes, added in power."""

    floor_dbsm: float
    lobes: dict[str, Lobe] = Field(default_factory=dict)


class MeasurementBase(Spec):
    """What all measurements share. Values are flattened; `noise` is one number or one for each value."""

    name: str = Field(min_length=1, pattern=r"^[^.]+$")
    values: tuple[float, ...] = ()
    values_imag: tuple[float, ...] = ()
    noise: Numbers | None = None
    gain_db: Decibels = Field(0.0, description="of the instrument, added to what the model predicts [dB]")
    held_out: bool = Field(False, description="not used for the estimate, only to judge it")

    @field_validator("values", "values_imag")
    @classmethod
    def _finite(cls, values: tuple[float, ...]) -> tuple[float, ...]:
        if not np.isfinite(values).all():
            raise ValueError("finite values, no NaN: leave out what was not measured")
        return values

    @model_validator(mode="after")
    def _check_noise(self) -> MeasurementBase:
        if self.noise is None:
            raise ValueError(f"noise: {_NOISE}")
        if not np.all(np.asarray(self.noise) > 0.0):
            raise ValueError(f"noise > 0: {_NOISE}")
        if self.values_imag and len(self.values_imag) != len(self.values):
            raise ValueError(f"as many values_imag as values ({len(self.values_imag)} and {len(self.values)})")
        return self

    @property
    def data(self) -> npt.NDArray[np.complex128]:
        """The measured values, shape (num_values,)."""
        real = np.asarray(self.values, dtype=np.complex128)
        return real + 1j * np.asarray(self.values_imag) if self.values_imag else real


class SlabMeasurement(MeasurementBase):
    """Reflection, transmission or backscatter of one surface against frequency and angle."""

    kind: Literal["slab"] = "slab"
    material: str
    quantity: Literal["reflection", "transmission", "backscatter", "cross_backscatter"] = "reflection"
    polarization: Literal["TE", "TM"] = "TE"
    frequency: Annotated[Numbers, Unit("Hz")] = Field(77e9, description="[Hz]")
    angle_deg: Annotated[Numbers, Unit("deg")] = Field(0.0, description="from the normal [deg]")
    form: Form = "power_db"

    @model_validator(mode="after")
    def _check_grid(self) -> SlabMeasurement:
        angle = np.asarray(self.angle_deg)
        if not np.all((angle >= 0.0) & (angle < 90.0)):
            raise ValueError("angle_deg 0 to below 90, from the surface's normal")
        for name, given in (("frequency", self.frequency), ("angle_deg", self.angle_deg), ("noise", self.noise or 0.0)):
            if np.size(given) not in (1, len(self.values)):
                raise ValueError(f"{name}: one number or one for each of the {len(self.values)} values")
        _form_fits(self.form, self.values_imag)
        if self.is_backscatter and self.form == "complex":
            raise ValueError("form 'power_db', 'power' or 'amplitude' of backscatter, which has no phase of its own")
        return self

    @property
    def is_backscatter(self) -> bool:
        """Whether it is what a rough surface scatters back, a power without a phase."""
        return self.quantity in ("backscatter", "cross_backscatter")


class RcsPattern(MeasurementBase):
    """RCS of a target against aspect."""

    kind: Literal["rcs"] = "rcs"
    target: str
    aspect_deg: tuple[float, ...]
    form: Literal["power", "power_db"] = Field("power_db", description="[m2] or [dBsm]")

    @model_validator(mode="after")
    def _check_grid(self) -> RcsPattern:
        if len(self.aspect_deg) != len(self.values):
            raise ValueError(f"as many aspect_deg as values ({len(self.aspect_deg)} and {len(self.values)})")
        return self


class MeshRcs(MeasurementBase):
    """RCS of a mesh of one material by shooting and bouncing rays, as :func:`scarl_sionna.rcs`.

    Geometry is traced once.
    """

    kind: Literal["mesh_rcs"] = "mesh_rcs"
    mesh: str = Field(description="path of a PLY, OBJ, STL or glTF file [m]")
    material: str
    theta_deg: Annotated[Numbers, Unit("deg")] = Field(90.0, description="direction to the radar, from +z [deg]")
    phi_deg: Annotated[Numbers, Unit("deg")] = Field(0.0, description="and from +x [deg]")
    polarization: Literal["VV", "HH", "VH", "HV"] = "VV"
    frequency: Hertz = Field(77e9, gt=0.0, description="[Hz]")
    form: Form = Field(
        "power_db", description="complex and amplitude are roots of the RCS [m], power is [m2], power_db [dBsm]"
    )

    @model_validator(mode="after")
    def _check_grid(self) -> MeshRcs:
        for name, given in (("theta_deg", self.theta_deg), ("phi_deg", self.phi_deg), ("noise", self.noise or 0.0)):
            if np.size(given) not in (1, len(self.values)):
                raise ValueError(f"{name}: one number or one for each of the {len(self.values)} values")
        _form_fits(self.form, self.values_imag)
        return self


class PointTarget(Spec):
    """A reflector of known RCS in the scene."""

    position: Point
    rcs: Annotated[float, Unit("m2")] = Field(1.0, gt=0.0, description="[m2]")
    velocity: Point = (0.0, 0.0, 0.0)


class SceneGeometry(MeasurementBase):
    """What the measurements in a scene share.

    The scene, the ends of the links and what the solver `sionna` looks for.
    """

    scene: str = Field(description="name of a built-in scene, or path of its XML")
    position: Point = Field(description="of the radar [m, world]")
    yaw_deg: Degrees = Field(0.0, description="of its boresight from x towards y [deg]")
    pitch_deg: Degrees = Field(0.0, description="of its boresight, up [deg]")
    targets: tuple[PointTarget, ...] = Field(min_length=1)
    max_depth: int = Field(2, ge=0, le=8)
    num_samples: int = Field(200_000, ge=1, le=100_000_000)
    refraction: bool = False


class ScenePowers(SceneGeometry):
    """Powers of single paths: received over transmitted, isotropic antennas.

    `lengths` [m, whole way] says which path a value is of; paths closer to it than `resolution` add coherently.
    """

    kind: Literal["scene_powers"] = "scene_powers"
    lengths: tuple[float, ...]
    resolution: Metres = Field(0.1, gt=0.0, description="[m]")
    polarization: Literal["V", "H"] = "V"
    frequency: float = Field(77e9, gt=0.0)
    form: Form = "power_db"

    @model_validator(mode="after")
    def _check_grid(self) -> ScenePowers:
        if len(self.lengths) != len(self.values):
            raise ValueError(f"as many lengths as values ({len(self.lengths)} and {len(self.values)})")
        _form_fits(self.form, self.values_imag)
        return self


class RadarMap(SceneGeometry):
    """A complex range-Doppler map of every channel (one chirp: range profiles), rectangular windows, in sqrt(W).

    `file` is an ``.npy`` of shape (num_virtual, num_chirps, num_samples) as :func:`scarl_sionna.range_doppler` returns
    it; cells from `first_bin` up to `stop_bin` in range are used. `noise` is the standard deviation of each of the real
    and the imaginary part of a cell.
    """

    kind: Literal["map"] = "map"
    radar: RadarSpec
    file: str | None = None
    first_bin: int = Field(0, ge=0)
    stop_bin: int | None = Field(None, ge=1)

    @field_validator("radar", mode="before")
    @classmethod
    def _read_radar(cls, value: object) -> object:
        return read_radar(value) if isinstance(value, Mapping) else value

    @field_validator("radar")
    @classmethod
    def _is_linear(cls, radar: RadarSpec) -> RadarSpec:
        kind = radar.multiplexing.kind
        if radar.multiplexing.code_period(radar.num_tx) is not None:
            raise ValueError(f"a radar whose map is linear in its signal: images of '{kind}' are removed cell by cell")
        if not radar.front_end.is_ideal:
            raise ValueError("a radar with an ideal front end: calibrate maps that its errors are removed from")
        if radar.adc.is_real:
            raise ValueError("a radar that samples I and Q")
        if not radar.array.is_uniform:
            raise ValueError("a radar whose antennas are all alike: leave tx_elements, rx_elements and radome out")
        return radar


def _form_fits(form: str, imaginary: tuple[float, ...]) -> None:
    if (form == "complex") != bool(imaginary):
        raise ValueError("values_imag with form 'complex', and only with it")


Measurement = Annotated[SlabMeasurement | RcsPattern | MeshRcs | ScenePowers | RadarMap, Field(discriminator="kind")]


class CalibrationProblem(Spec):
    """Measurements, free parameters, and how to look for the minimum."""

    title: str = "calibration"
    source: str = Field("calibration", min_length=1, description="of the measurements; goes into the material entries")
    parameters: tuple[FreeParameter, ...] = Field(min_length=1)
    measurements: tuple[Measurement, ...] = Field(min_length=1)
    materials: tuple[str, ...] = Field((), description="TOML files with further material entries, later ones win")
    targets: dict[str, LobedTarget] = Field(default_factory=dict)
    num_starts: int = Field(
        4, ge=1, le=1000, description="the given start and others over the bounds; further rounds if in doubt"
    )
    max_evaluations: int = Field(200, ge=1, description="of the model, for each start")
    optimizer: Literal["least_squares", "adam"] = Field(
        "least_squares", description="trust region with Levenberg-Marquardt steps, or Adam: gradients only"
    )
    seed: int = Field(0, ge=0)

    @model_validator(mode="after")
    def _check(self) -> CalibrationProblem:
        for what, names in (
            ("parameters", [item.name for item in self.parameters]),
            ("measurements", [item.name for item in self.measurements]),
        ):
            if len(set(names)) != len(names):
                raise ValueError(f"{what} with different names; '{max(names, key=names.count)}' is there twice")
        if all(item.held_out for item in self.measurements):
            raise ValueError("at least one measurement that is not held out")
        return self

    @classmethod
    def load(cls, path: str | Path) -> CalibrationProblem:
        """Return the problem of a YAML file; files that it names are looked for beside it.

        A measurement may take its columns from a CSV file: ``table: file.csv`` and
        ``columns: {values: s11, noise: u_s11, frequency: [frequency_mhz, 1e6]}``; a list is a column and its factor.
        ``rows: [first, stop]`` takes a part.

        Raises
        ------
        SceneError
            If the file or a table cannot be read.
        ParameterRangeError
            If a value is not usable.
        """
        path = Path(path)
        try:
            content = read_yaml(path)
        except InputFileError as error:
            raise SceneError(str(error.strerror), path) from error
        except OSError as error:
            raise SceneError(
                f"cannot be read ({error.strerror})", path, "check the path and its permissions"
            ) from error
        if not isinstance(content, dict):
            raise SceneError("holds no calibration problem", path, "see docs/calibration.md")
        try:
            content = plain(checked(_ProblemForm, content))
        except ValueError as error:
            raise SceneError(f"holds no calibration problem ({error})", path, "see docs/calibration.md") from error
        beside = path.parent
        content["materials"] = [str(beside / name) for name in content.get("materials", ())]
        content["measurements"] = [_read_measurement(item, beside) for item in content.get("measurements", ())]
        return cls(**content)


class _MeasurementForm(Table):
    """Types of what names files in an entry of `measurements`."""

    table: Text | None = None
    columns: dict[str, Text | Annotated[tuple[Text, float], Field(strict=False)]] = Field(default_factory=dict)
    rows: Annotated[list[Annotated[int, Field(ge=-(10**9), le=10**9)]], Field(min_length=2, max_length=3)] | None = None


class _ProblemForm(Table):
    """Types of what names files in a calibration problem."""

    materials: list[Text] = Field(default_factory=list)
    measurements: list[_MeasurementForm] = Field(default_factory=list)


def _read_measurement(item: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return a measurement with its table's columns in place and paths relative to the problem's folder."""
    item = dict(item)
    table, columns, rows = item.pop("table", None), item.pop("columns", {}), item.pop("rows", None)
    if table is not None:
        item |= _columns(folder / table, columns, rows)
    for key in ("file", "scene", "mesh"):
        if isinstance(item.get(key), str) and (folder / item[key]).exists():
            item[key] = str(folder / item[key])
    return item


def _columns(path: Path, columns: dict[str, Any], rows: list[int] | None) -> dict[str, list[float]]:
    """Return columns of a CSV file with a header; lines that start with # are comments."""
    try:
        lines = [line for line in read_text(path, _MOST_BYTES).splitlines() if line and not line.startswith("#")]
    except OSError as error:
        raise SceneError(f"cannot be read ({error.strerror})", path, "check the path and its permissions") from error
    header = [name.strip() for name in lines[0].split(",")] if lines else []
    try:
        body = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]]).reshape(-1, len(header))
    except ValueError as error:
        raise SceneError(
            f"not a table of numbers ({error})", path, "one header line, then numbers with commas"
        ) from error
    if rows and rows[2:] == [0]:
        raise ParameterRangeError("rows", rows, "[first, stop] or [first, stop, step] with a step")
    body = body[slice(*rows)] if rows else body
    out = {}
    for key, column in columns.items():
        name, factor = (column[0], float(column[1])) if isinstance(column, tuple) else (column, 1.0)
        if name not in header:
            raise ParameterRangeError(
                f"columns.{key}", repr(name), f"one of {', '.join(header)}", f"the header of {path}"
            )
        out[key] = (body[:, header.index(name)] * factor).tolist()
    return out
