"""A radome, or a bumper, in front of the antennas: layers, where they stand, and how they are bent."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Degrees, Hertz, Metres, Unit

Array = npt.NDArray[np.float64]


class RadomeLayer(Spec):
    """One layer of a radome."""

    thickness: Metres = Field(ge=0.0, le=0.1, description="[m]")
    relative_permittivity: float = Field(ge=1.0, le=200.0, description="real part")
    loss_tangent: float = Field(0.0, ge=0.0, le=10.0, description="imaginary over real part")

    @property
    def permittivity(self) -> complex:
        """Complex relative permittivity, time dependence e^{+j 2 pi f t}: by definition."""
        return complex(self.relative_permittivity * (1.0 - 1j * self.loss_tangent))


class Radome(Spec):
    """A radome or bumper in front of the array, dry or with a film of water on its outer face.

    Its inner face crosses the radar's x axis at `distance`. `yaw_deg` and `tilt_deg` turn its outward normal there to
    the left and upwards. With a `radius` it is bent around the radar: a cylinder whose axis is upright (before the
    tilt) or a sphere; locally it counts as plane.

    Raises
    ------
    ParameterRangeError
        If the radius is so small that the array's origin is not well inside, or the layer is turned so far that the
        radar does not look through it.
    """

    layers: tuple[RadomeLayer, ...] = Field(min_length=1, max_length=16, description="from the radar outwards")
    distance: Metres = Field(0.03, gt=0.0, le=2.0, description="of the inner face along x from the origin [m]")
    tilt_deg: Degrees = Field(0.0, ge=-75.0, le=75.0, description="of the outward normal, up positive [deg]")
    yaw_deg: Degrees = Field(0.0, ge=-75.0, le=75.0, description="of the outward normal, left positive [deg]")
    radius: Metres | None = Field(
        None, gt=0.0, description="of the bend, about a centre on the radar's side [m]; None: plane"
    )
    bend: Literal["cylinder", "sphere"] = Field("cylinder", description="shape where there is a radius")
    water_film: Metres = Field(0.0, ge=0.0, le=0.01, description="depth of water on the outer face [m]; 0: dry")
    water_temperature: Annotated[float, Unit("K")] = Field(283.15, ge=250.0, le=330.0, description="of that water [K]")
    frequency: Hertz | None = Field(
        None, gt=0.0, description="at which the layers act [Hz]; None: the middle of what the radar samples"
    )
    echo: bool = Field(True, description="whether what it sends back into the receivers is in the raw data")

    @model_validator(mode="after")
    def _check(self) -> Radome:
        if self.radius is not None and self.radius < 2.0 * self.distance:
            raise ValueError(f"radius at least twice the distance of {self.distance:g} m: {self.radius:g} m")
        return self

    @property
    def point(self) -> Array:
        """Where the inner face crosses the radar's x axis, shape (3,) [m, radar frame]."""
        return np.array([self.distance, 0.0, 0.0])

    @property
    def frame(self) -> Array:
        """Outward normal there, left and up on the face, as rows, shape (3, 3) [radar frame]: by definition."""
        yaw, tilt = np.radians([self.yaw_deg, self.tilt_deg])
        (cy, ct), (sy, st) = np.cos([yaw, tilt]), np.sin([yaw, tilt])
        return np.array([[cy * ct, sy * ct, st], [-sy, cy, 0.0], [-cy * st, -sy * st, ct]])

    def heights(self, points: Array) -> Array:
        """Return how far points (..., 3) are beyond the inner face [m], negative on the radar's side: exact."""
        normal, _, up = self.frame
        if self.radius is None:
            return np.asarray((points - self.point) @ normal)
        away = points - (self.point - self.radius * normal)
        if self.bend == "cylinder":
            away = away - (away @ up)[..., None] * up
        return np.asarray(np.linalg.norm(away, axis=-1) - self.radius)

    def normals(self, points: Array) -> Array:
        """Return outward normals of the face nearest to points (..., 3): exact geometry."""
        normal, _, up = self.frame
        if self.radius is None:
            return np.broadcast_to(normal, points.shape)
        away = points - (self.point - self.radius * normal)
        if self.bend == "cylinder":
            away = away - (away @ up)[..., None] * up
        return np.asarray(away / np.linalg.norm(away, axis=-1, keepdims=True))

    def crossings(self, start: Array, unit: Array) -> Array:
        """Return how far rays from a point (3,) along unit vectors (..., 3) are on the radar's side [m]: exact.

        Infinite where a ray never gets through.
        """
        normal, _, up = self.frame
        if self.radius is None:
            toward = unit @ normal
            with np.errstate(divide="ignore"):
                return np.where(toward > 0.0, -float(self.heights(start)) / toward, np.inf)
        offset = start - (self.point - self.radius * normal)
        along = unit
        if self.bend == "cylinder":
            offset, along = offset - (offset @ up) * up, unit - (unit @ up)[..., None] * up
        squared, half = np.einsum("...i,...i->...", along, along), along @ offset
        free = squared > 1e-24
        root = np.sqrt(half**2 - squared * (offset @ offset - self.radius**2))
        return np.where(free, (root - half) / np.where(free, squared, 1.0), np.inf)
