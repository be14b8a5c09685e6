"""The beam of a reflector or horn: narrow over azimuth, over elevation a lobe that may be filled in below."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Decibels, DecibelsIsotropic, Degrees

Array = npt.NDArray[np.float64]

_HALF_POWER_DB = 10.0 * math.log10(2.0)
_FALL_DB = 40.0
"""Sidelobes fall by so much a decade of the angle, 12 dB an octave."""
_STEPS = 200
"""Steps of the integral over half a beamwidth: the radiated share is then right to 1e-4."""


class FanPattern(Spec):
    r"""Gaussian main lobe over azimuth and elevation, the envelope of its sidelobes, and a cosec-squared fill below.

    Both cuts add in dB. Sidelobes are their envelope, without the nulls between them: from `sidelobe_db` where the main
    lobe meets it they fall by 12 dB an octave of the angle, as those of an aperture lit by a cosine. A peak gain with
    which the antenna would radiate more power than it gets is refused.

    Raises
    ------
    ParameterRangeError
        If the fill ends above the lower half-power angle, or the peak gain is too high for the beam.

    Notes
    -----
    With the angle x from the lobe's middle and the half-power beamwidth w, the main lobe is :math:`2^{-(2 x / w)^2}`.
    Below its lower half-power angle :math:`d_0 = w / 2` the fill is :math:`\tfrac12 \sin^2 d_0 / \sin^2 d` down to
    `cosecant_deg`: what lies on level ground is then seen equally well near and far.

    References
    ----------
    .. [1] M. I. Skolnik, *Introduction to Radar Systems*, 3rd ed., 2001, sections 9.3 (Table 9.1) and 9.11.
    """

    kind: Literal["fan"] = "fan"
    peak_gain_dbi: DecibelsIsotropic = Field(36.0, description="[dBi]")
    azimuth_beamwidth_deg: Degrees = Field(1.8, gt=0.0, le=90.0, description="full width at half power [deg]")
    elevation_beamwidth_deg: Degrees = Field(1.8, gt=0.0, le=90.0, description="full height at half power [deg]")
    sidelobe_db: Decibels = Field(
        -23.0, ge=-100.0, le=-6.0, description="envelope of the sidelobes beside the main lobe, over the peak [dB]"
    )
    cosecant_deg: Degrees | None = Field(
        None, gt=0.0, le=90.0, description="the fill below reaches down to this depression [deg]; None: none"
    )

    @model_validator(mode="after")
    def _check(self) -> FanPattern:
        if self.cosecant_deg is not None and self.cosecant_deg <= 0.5 * self.elevation_beamwidth_deg:
            raise ValueError(
                f"cosecant_deg beyond half of the elevation_beamwidth_deg of {self.elevation_beamwidth_deg:g} deg, "
                "or None for no fill"
            )
        if self.radiated_share > 1.0:
            most = np.floor(10.0 * (self.peak_gain_dbi - 10.0 * np.log10(self.radiated_share))) / 10.0
            raise ValueError(
                f"a peak_gain_dbi of at most {most:g} dBi with this beam: with {self.peak_gain_dbi:g} dBi the antenna "
                f"would radiate {100.0 * self.radiated_share:.0f} % of its power"
            )
        return self

    @cached_property
    def radiated_share(self) -> float:
        """Part of the antenna's power that it radiates, by the trapezoidal rule: 1 for an antenna without loss."""
        over_azimuth, over_elevation = (
            _angles(width, limit)
            for width, limit in ((self.azimuth_beamwidth_deg, 180.0), (self.elevation_beamwidth_deg, 90.0))
        )
        across = np.trapezoid(10.0 ** (_lobe(over_azimuth, *self._azimuth) / 10.0), np.radians(over_azimuth))
        up = 10.0 ** (self._elevation_db(over_elevation) / 10.0) * np.cos(np.radians(over_elevation))
        peak = 10.0 ** (self.peak_gain_dbi / 10.0)
        return float(peak / (4.0 * np.pi) * across * np.trapezoid(up, np.radians(over_elevation)))

    def gain_db(self, azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> Array:
        """Return the gain [dBi] at azimuth (left positive) and elevation [rad], broadcast."""
        across = _lobe(np.degrees(azimuth), *self._azimuth)
        return np.asarray(self.peak_gain_dbi + across + self._elevation_db(np.degrees(elevation)))

    def slopes_db(self, azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> tuple[Array, Array]:
        """Return the derivatives of the gain to azimuth and elevation [dB/rad]; at a corner those outside of it."""
        up = np.degrees(elevation)
        upward = _lobe_slope(up, *self._elevation)
        if self.cosecant_deg is not None:
            down = -np.asarray(up)
            filled = (down >= 0.5 * self.elevation_beamwidth_deg) & (down < self.cosecant_deg)
            below = down >= self.cosecant_deg
            with np.errstate(divide="ignore"):
                fill = 20.0 / np.log(10.0) * np.radians(1.0) / np.tan(np.radians(np.maximum(down, 1e-9)))
            upward = np.where(filled, fill, upward)
            upward = np.where(below, -_lobe_slope(down - self.cosecant_deg, *self._elevation), upward)
        across = _lobe_slope(np.degrees(azimuth), *self._azimuth)
        return tuple(np.degrees(1.0) * np.asarray(one) for one in np.broadcast_arrays(across, upward))  # type: ignore[return-value]

    @property
    def _azimuth(self) -> tuple[float, float]:
        return self.azimuth_beamwidth_deg, self.sidelobe_db

    @property
    def _elevation(self) -> tuple[float, float]:
        return self.elevation_beamwidth_deg, self.sidelobe_db

    def _elevation_db(self, up: npt.ArrayLike) -> Array:
        """Return the cut over elevation relative to its peak [dB], at elevations [deg]."""
        plain = _lobe(up, *self._elevation)
        if self.cosecant_deg is None:
            return plain
        down = -np.asarray(up)
        first = 0.5 * self.elevation_beamwidth_deg
        held = np.radians(np.clip(down, first, self.cosecant_deg))
        fill = 20.0 * np.log10(np.sin(np.radians(first)) / np.sin(held)) - _HALF_POWER_DB
        fill = fill + _lobe(np.maximum(down - self.cosecant_deg, 0.0), *self._elevation)
        return np.where(down >= first, fill, plain)


def _lobe(angle: npt.ArrayLike, width: float, sidelobe_db: float) -> Array:
    """Return a main lobe and the envelope of its sidelobes, relative to the peak [dB], at angles [deg]."""
    edge = _edge(width, sidelobe_db)
    away = np.abs(np.asarray(angle, dtype=np.float64))
    beside = sidelobe_db - _FALL_DB * np.log10(np.maximum(away, edge) / edge)
    return np.where(away <= edge, -_HALF_POWER_DB * (2.0 * away / width) ** 2, beside)


def _lobe_slope(angle: npt.ArrayLike, width: float, sidelobe_db: float) -> Array:
    """Return the derivative of :func:`_lobe` [dB/deg]."""
    edge = _edge(width, sidelobe_db)
    place = np.asarray(angle, dtype=np.float64)
    beside = -_FALL_DB / np.log(10.0) / np.where(place == 0.0, 1.0, place)
    return np.where(np.abs(place) < edge, -8.0 * _HALF_POWER_DB * place / width**2, beside)


def _edge(width: float, sidelobe_db: float) -> float:
    """Return where the main lobe meets its sidelobes [deg]."""
    return 0.5 * width * math.sqrt(-sidelobe_db / _HALF_POWER_DB)


def _angles(width: float, limit: float) -> Array:
    """Return angles from -limit to limit [deg], close to each other in the main lobe."""
    near = min(limit, 4.0 * width)
    inner = np.linspace(0.0, near, 8 * _STEPS + 1)
    outer = np.geomspace(near, limit, 4 * _STEPS)[1:] if near < limit else np.zeros(0)
    half = np.concatenate([inner, outer])
    return np.concatenate([-half[:0:-1], half])
