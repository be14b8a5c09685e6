"""Radio materials: complex permittivity, layer thickness and roughness at 76-81 GHz, each value with its source.

The table is plain data (``materials.toml`` beside this file); a user adds or replaces entries with a TOML file of the
same form. Nothing here imports Mitsuba or Sionna.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, TypeAlias

from pydantic import Field, model_validator

from scarl_sionna.core.errors import (
    MaterialError,
    MaterialRangeError,
    ParameterRangeError,
    SceneError,
    UnknownNameError,
)
from scarl_sionna.core.prompt.arguments import LEAST_FREQUENCY
from scarl_sionna.core.prompt.describe import Described, Row
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import VACUUM_PERMITTIVITY, Hertz, Metres, Unit
from scarl_sionna.core.untrusted.toml_text import read_toml

BUILTIN_FILE = Path(__file__).with_name("materials.toml")

BandEdge: TypeAlias = Annotated[Hertz, Field(ge=LEAST_FREQUENCY)]


class UnknownMaterialError(MaterialError, UnknownNameError):
    """A material's name is not in the table."""

    def __init__(self, name: str, known: Iterable[str], remedy: str = "") -> None:
        more = remedy or "or add a sourced entry to a materials.toml of your own"
        UnknownNameError.__init__(self, "radio material", name, known, more)

    __str__ = UnknownNameError.__str__


class RadioMaterial(Spec):
    r"""Radio properties of one material.

    Real permittivity and conductivity follow power laws around the reference frequency, as in ITU-R P.2040:

    .. math:: \varepsilon'(f) = \varepsilon_0' (f/f_0)^b, \quad \sigma(f) = \sigma_0 (f/f_0)^d

    A loss tangent that does not depend on frequency is d = 1.

    References
    ----------
    .. [1] Recommendation ITU-R P.2040-3, section 2.1.4 and Table 3.
    """

    name: str = Field(min_length=1)
    relative_permittivity: float = Field(ge=1.0, description="real part at reference_frequency")
    conductivity: Annotated[float, Unit("S/m")] = Field(
        ge=0.0, description="at reference_frequency, all losses in one number [S/m]"
    )
    reference_frequency: Hertz = Field(77e9, ge=LEAST_FREQUENCY, description="[Hz]")
    permittivity_exponent: float = Field(0.0, description="b of the power law")
    conductivity_exponent: float = Field(1.0, description="d of the power law; 1: constant loss tangent")
    thickness: Metres | None = Field(None, gt=0.0, description="of the layer with air behind [m]; None: half space")
    water_film: Metres = Field(0.0, ge=0.0, le=0.1, description="depth of water on its face [m]; 0: dry")
    water_temperature: Annotated[float, Unit("K")] = Field(283.15, ge=250.0, le=330.0, description="of that water [K]")
    roughness_rms: Metres = Field(
        0.0, ge=0.0, description="standard deviation of the surface height [m]; what a mirror loses by it is scattered"
    )
    scattering_coefficient: float = Field(
        0.0, ge=0.0, le=1.0, description="fraction of the reflected field that is scattered diffusely at all angles"
    )
    diffuse_albedo: float | None = Field(
        None,
        ge=0.0,
        le=1.0,
        description="share of the incident power that is scattered diffusely, from measured backscatter; None: from "
        "scattering_coefficient, roughness_rms and the reflectance along the normal",
    )
    volume_albedo: float | None = Field(
        None,
        gt=0.0,
        le=1.0,
        description="of a deep layer of scatterers (grass): share that one blade scatters of what it meets; None: a "
        "rough surface",
    )
    xpd_coefficient: float = Field(0.0, ge=0.0, le=1.0, description="fraction of the diffuse power that is cross-polar")
    rounded: bool = Field(
        False,
        description="whether bodies of it are curved everywhere, as skin and clothes are: edges of their meshes that "
        "bend by less than crease_angle_deg are of the drawing",
    )
    lidar_reflectance: float = Field(0.3, ge=0.0, le=1.0, description="diffuse, at 1550 nm; a scene may state its own")
    lidar_transmittance: float = Field(0.0, ge=0.0, le=1.0, description="of a pane, at 1550 nm and normal incidence")
    frequency_range: tuple[BandEdge, BandEdge] = Field((76e9, 81e9), description="valid between [Hz]")
    source: str = Field(min_length=1, description="where the values come from")
    uncertainty: str = Field(min_length=1, description="how far they may be off")

    @model_validator(mode="after")
    def _check(self) -> RadioMaterial:
        if self.frequency_range[0] > self.frequency_range[1]:
            raise ValueError("frequency_range rising [Hz]")
        if self.lidar_reflectance + self.lidar_transmittance > 1.0:
            raise ValueError("lidar_reflectance + lidar_transmittance <= 1")
        if self.volume_albedo is not None and self.diffuse_albedo is not None:
            raise ValueError("either diffuse_albedo (a rough surface) or volume_albedo (a deep layer), not both")
        return self

    def covers(self, frequency: float) -> bool:
        """Return whether the entry is valid at a frequency [Hz]."""
        return self.frequency_range[0] <= frequency <= self.frequency_range[1]

    def _require(self, frequency: float) -> None:
        if not self.covers(frequency):
            alternatives = builtin_materials().names_at(frequency)
            raise MaterialRangeError(self.name, frequency, self.frequency_range, alternatives)

    @property
    def coherence(self) -> float:
        """What scattering leaves of a field that is reflected or passes, sqrt(1 - S^2); heights take more (`rough`)."""
        return math.sqrt(1.0 - self.scattering_coefficient**2)

    def permittivity_at(self, frequency: float) -> float:
        """Return the real relative permittivity at a frequency [Hz]."""
        self._require(frequency)
        return self.relative_permittivity * (frequency / self.reference_frequency) ** self.permittivity_exponent

    def conductivity_at(self, frequency: float) -> float:
        """Return the conductivity [S/m] at a frequency [Hz]."""
        self._require(frequency)
        return self.conductivity * (frequency / self.reference_frequency) ** self.conductivity_exponent

    def at(self, frequency: float) -> complex:
        r"""Return the complex relative permittivity.

        .. math:: \varepsilon = \varepsilon' - j \sigma / (2 \pi f \varepsilon_0)

        Parameters
        ----------
        frequency : float
            [Hz].

        Returns
        -------
        complex
            Dimensionless; negative imaginary part for losses (time dependence e^{+j 2 pi f t}).

        Raises
        ------
        MaterialRangeError
            If the entry has no data at this frequency.
        """
        loss = self.conductivity_at(frequency) / (2.0 * math.pi * frequency * VACUUM_PERMITTIVITY)
        return complex(self.permittivity_at(frequency), -loss)


class MaterialTable(Described, Mapping[str, RadioMaterial]):
    """Radio materials by name; an unknown name raises :class:`UnknownMaterialError`."""

    def __init__(self, materials: Iterable[RadioMaterial]) -> None:
        self._materials = {material.name: material for material in materials}

    def _facts(self) -> Iterable[Row]:
        yield "materials", str(len(self))
        yield "names", ", ".join(self)

    def __getitem__(self, name: str) -> RadioMaterial:
        """Return the material of a name."""
        try:
            return self._materials[name]
        except KeyError:
            raise UnknownMaterialError(name, self._materials) from None

    def __contains__(self, name: object) -> bool:
        """Return whether the table has a name."""
        return name in self._materials

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self._materials)

    def __len__(self) -> int:
        """Return the number of materials."""
        return len(self._materials)

    def names_at(self, frequency: float) -> list[str]:
        """Return the names of the materials that have data at a frequency [Hz], sorted."""
        return sorted(name for name, material in self._materials.items() if material.covers(frequency))


def _read_materials(path: str | Path) -> list[RadioMaterial]:
    """Return the materials of one file."""
    try:
        content = read_toml(path)
    except SceneError as error:
        raise MaterialError(str(error)) from error
    materials = []
    for name, entry in content.items():
        if not isinstance(entry, dict):
            raise MaterialError(f"{path}: '{name}' is not a table; write [{name}] and its values below")
        try:
            materials.append(RadioMaterial(**{"name": name, **entry}))
        except ParameterRangeError as error:
            raise MaterialError(f"{path}: material '{name}': {error}; see docs/materials.md") from error
    return materials


@cache
def builtin_materials() -> MaterialTable:
    """Return the table that comes with the package."""
    return MaterialTable(_read_materials(BUILTIN_FILE))


def load_materials(extra_paths: Iterable[str | Path] = ()) -> MaterialTable:
    """Return the built-in radio materials together with those of a user's files.

    Parameters
    ----------
    extra_paths : iterable of str or path
        TOML files of the form of ``materials.toml``. A later entry replaces an earlier one of the same name.

    Raises
    ------
    MaterialError
        If a file cannot be read or an entry is not usable.
    """
    materials = dict(builtin_materials())
    for path in extra_paths:
        materials.update({material.name: material for material in _read_materials(path)})
    return MaterialTable(materials.values())
