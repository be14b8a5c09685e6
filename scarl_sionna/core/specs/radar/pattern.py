"""Antenna patterns as plain data: gain against azimuth and elevation in the radar frame."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import DecibelsIsotropic, Degrees

from .antennas.fan import FanPattern
from .antennas.grid import GridPattern

Array = npt.NDArray[np.float64]


def _cosine_integral(power: float) -> float:
    """Return the integral of a power of the cosine over half a turn."""
    logarithm = math.lgamma(0.5 * (power + 1.0)) - math.lgamma(0.5 * power + 1.0)
    return math.sqrt(math.pi) * math.exp(logarithm)


class IsotropicPattern(Spec):
    """The same gain in every direction."""

    kind: Literal["isotropic"] = "isotropic"
    gain_dbi: DecibelsIsotropic = Field(0.0, description="[dBi]")

    def gain_db(self, azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> Array:
        """Return the gain [dBi] at azimuth (left positive) and elevation [rad], broadcast."""
        return np.full(np.broadcast(np.asarray(azimuth), np.asarray(elevation)).shape, self.gain_dbi)

    def slopes_db(self, azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> tuple[Array, Array]:
        """Return the derivatives of the gain to azimuth and elevation [dB/rad]: none."""
        none = np.zeros(np.broadcast(np.asarray(azimuth), np.asarray(elevation)).shape)
        return none, none.copy()


class CosinePattern(Spec):
    r"""cos^n(azimuth) * cos^m(elevation) in power, with n and m from the half-power angles; nothing behind.

    A peak gain with which the antenna would radiate more power than it gets is refused.

    Notes
    -----
    The radiated share of the power follows by definition from the gain,

    .. math:: \eta = \frac{G_0}{4 \pi} \int \cos^n \alpha \, d\alpha \int \cos^{m+1} \epsilon \, d\epsilon, \quad
        \int_{-\pi/2}^{\pi/2} \cos^k x \, dx = \sqrt{\pi} \, \Gamma(\tfrac{k+1}{2}) / \Gamma(\tfrac{k}{2} + 1)
    """

    kind: Literal["cosine"] = "cosine"
    peak_gain_dbi: DecibelsIsotropic = Field(10.0, description="[dBi]")
    half_power_azimuth_deg: Degrees = Field(45.0, gt=0.0, lt=90.0, description="-3 dB at +- this azimuth [deg]")
    half_power_elevation_deg: Degrees = Field(15.0, gt=0.0, lt=90.0, description="-3 dB at +- this elevation [deg]")

    @model_validator(mode="after")
    def _radiates_at_most_its_power(self) -> CosinePattern:
        if self.radiated_share > 1.0:
            most = np.floor(10.0 * (self.peak_gain_dbi - 10.0 * np.log10(self.radiated_share))) / 10.0
            raise ValueError(
                f"a peak_gain_dbi of at most {most:g} dBi with these half-power angles: with {self.peak_gain_dbi:g} "
                f"dBi the antenna would radiate {100.0 * self.radiated_share:.0f} % of its power"
            )
        return self

    @property
    def _exponents(self) -> tuple[float, float]:
        """Powers n and m of the cosines of azimuth and elevation."""
        half = np.radians([self.half_power_azimuth_deg, self.half_power_elevation_deg])
        n, m = np.log(0.5) / np.log(np.cos(half))
        return float(n), float(m)

    @property
    def radiated_share(self) -> float:
        """Part of the antenna's power that it radiates: 1 for an antenna without loss."""
        n, m = self._exponents
        peak = 10.0 ** (self.peak_gain_dbi / 10.0)
        return peak / (4.0 * math.pi) * _cosine_integral(n) * _cosine_integral(m + 1.0)

    def gain_db(self, azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> Array:
        """Return the gain [dBi] at azimuth (left positive) and elevation [rad], broadcast; -400 dB behind."""
        cosines = np.cos(azimuth), np.cos(elevation)
        tiny = 1e-40
        total = sum(n * 10.0 * np.log10(np.maximum(c, tiny)) for n, c in zip(self._exponents, cosines, strict=True))
        return np.maximum(self.peak_gain_dbi + total, -400.0)

    def slopes_db(self, azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> tuple[Array, Array]:
        """Return the derivatives of the gain to azimuth and elevation [dB/rad]; none behind."""
        seen = (np.cos(azimuth) > 0.0) & (np.cos(elevation) > 0.0)
        n, m = (-10.0 / np.log(10.0) * power * seen for power in self._exponents)
        return np.asarray(n * np.tan(azimuth)), np.asarray(m * np.tan(elevation))


class Tr38901Pattern(Spec):
    """Element pattern of 3GPP TR 38.901, Table 7.3-1."""

    kind: Literal["tr38901"] = "tr38901"
    peak_gain_dbi: DecibelsIsotropic = Field(8.0, description="[dBi]")

    def gain_db(self, azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> Array:
        """Return the gain [dBi] at azimuth (left positive) and elevation [rad], broadcast."""
        vertical = np.minimum(12.0 * (np.degrees(elevation) / 65.0) ** 2, 30.0)
        horizontal = np.minimum(12.0 * (np.degrees(azimuth) / 65.0) ** 2, 30.0)
        return self.peak_gain_dbi - np.minimum(vertical + horizontal, 30.0)

    def slopes_db(self, azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> tuple[Array, Array]:
        """Return the derivatives of the gain to azimuth and elevation [dB/rad]; none at a limit of 30 dB."""
        cuts = [12.0 * (np.degrees(angle) / 65.0) ** 2 for angle in (azimuth, elevation)]
        inside = np.minimum(cuts[0], 30.0) + np.minimum(cuts[1], 30.0) < 30.0
        over = -24.0 / 65.0**2 * np.degrees(1.0) ** 2 * inside
        return np.asarray(over * np.asarray(azimuth)), np.asarray(over * np.asarray(elevation))


class TablePattern(Spec):
    """A measured pattern: two cuts, added in dB around the peak, linear between the entries.

    Outside the table a cut keeps its last value.
    """

    kind: Literal["table"] = "table"
    azimuth_deg: tuple[Degrees, ...] = Field(min_length=2, description="rising [deg]")
    azimuth_gain_dbi: tuple[DecibelsIsotropic, ...] = Field(
        min_length=2, description="gain over azimuth at elevation 0 [dBi]"
    )
    elevation_deg: tuple[Degrees, ...] = Field(min_length=2, description="rising [deg]")
    elevation_gain_dbi: tuple[DecibelsIsotropic, ...] = Field(
        min_length=2, description="gain over elevation at azimuth 0 [dBi]"
    )

    @model_validator(mode="after")
    def _check(self) -> TablePattern:
        for angle, gain in (("azimuth_deg", "azimuth_gain_dbi"), ("elevation_deg", "elevation_gain_dbi")):
            angles = np.asarray(getattr(self, angle))
            if len(angles) != len(getattr(self, gain)):
                raise ValueError(f"{angle} and {gain} of the same length")
            if np.any(np.diff(angles) <= 0):
                raise ValueError(f"{angle} strictly rising")
        return self

    def gain_db(self, azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> Array:
        """Return the gain [dBi] at azimuth (left positive) and elevation [rad], broadcast."""
        horizontal = np.interp(np.degrees(azimuth), self.azimuth_deg, self.azimuth_gain_dbi)
        vertical = np.interp(np.degrees(elevation), self.elevation_deg, self.elevation_gain_dbi)
        reference = np.interp(0.0, self.elevation_deg, self.elevation_gain_dbi)
        return horizontal + vertical - reference

    def slopes_db(self, azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> tuple[Array, Array]:
        """Return the derivatives of the gain to azimuth and elevation [dB/rad]; at an entry those above it."""
        return (
            _line_slope(azimuth, self.azimuth_deg, self.azimuth_gain_dbi),
            _line_slope(elevation, self.elevation_deg, self.elevation_gain_dbi),
        )


def _line_slope(angle: npt.ArrayLike, angles_deg: tuple[float, ...], gains: tuple[float, ...]) -> Array:
    """Return the slope per radian of what is linear between entries and constant outside."""
    slopes = np.concatenate([[0.0], np.diff(gains) / np.diff(angles_deg), [0.0]])
    return np.asarray(np.degrees(1.0) * slopes[np.searchsorted(angles_deg, np.degrees(angle), side="right")])


class DipolePattern(Spec):
    """A short dipole or a small loop along the antenna's z: 1.5 cos^2(elevation). V is the dipole, H the loop."""

    kind: Literal["dipole"] = "dipole"
    peak_gain_dbi: DecibelsIsotropic = Field(
        10.0 * math.log10(1.5), le=10.0 * math.log10(1.5), description="1.761 dBi without loss [dBi]"
    )

    def gain_db(self, azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> Array:
        """Return the gain [dBi] at azimuth (left positive) and elevation [rad], broadcast; at least -400 dBi."""
        cosine = np.broadcast_arrays(np.cos(elevation), np.asarray(azimuth))[0]
        return np.maximum(self.peak_gain_dbi + 20.0 * np.log10(np.maximum(np.abs(cosine), 1e-25)), -400.0)

    def slopes_db(self, azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> tuple[Array, Array]:
        """Return the derivatives of the gain to azimuth and elevation [dB/rad]."""
        across, up = np.broadcast_arrays(np.asarray(azimuth, dtype=np.float64), np.asarray(elevation))
        return np.zeros(across.shape), np.asarray(-20.0 / np.log(10.0) * np.tan(up))


AntennaPattern = Annotated[
    IsotropicPattern | CosinePattern | Tr38901Pattern | TablePattern | DipolePattern | FanPattern | GridPattern,
    Field(discriminator="kind"),
]
