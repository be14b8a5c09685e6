"""Longitude and latitude as metres: the transverse Mercator projection with its meridian through the middle of a map.

Krüger's series in the third flattening to the sixth order (C. F. F. Karney, Transverse Mercator with an accuracy of a
few nanometers, Journal of Geodesy 85, 2011), on the ellipsoid WGS 84. The scale is 1 on the meridian and grows by
1.2e-6 within 10 km.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..model import Array

AXIS, FLATTENING = 6378137.0, 1.0 / 298.257223563
_N = FLATTENING / (2.0 - FLATTENING)
_ECCENTRICITY = float(np.sqrt(FLATTENING * (2.0 - FLATTENING)))
_RADIUS = AXIS / (1.0 + _N) * (1.0 + _N**2 / 4.0 + _N**4 / 64.0 + _N**6 / 256.0)
_SERIES = (
    np.array([
        [1 / 2, -2 / 3, 5 / 16, 41 / 180, -127 / 288, 7891 / 37800],
        [0, 13 / 48, -3 / 5, 557 / 1440, 281 / 630, -1983433 / 1935360],
        [0, 0, 61 / 240, -103 / 140, 15061 / 26880, 167603 / 181440],
        [0, 0, 0, 49561 / 161280, -179 / 168, 6601661 / 7257600],
        [0, 0, 0, 0, 34729 / 80640, -3418889 / 1995840],
        [0, 0, 0, 0, 0, 212378941 / 319334400],
    ])
    @ _N ** np.arange(1, 7)
)  # fmt: skip # Karney, Eq. (35)


@dataclass(frozen=True)
class Projection:
    """East and north of a place [m], whose longitude and latitude are given [deg]."""

    longitude: float
    latitude: float

    def __call__(self, longitude: npt.ArrayLike, latitude: npt.ArrayLike) -> Array:
        """Return x to the east and y to the north, shape (..., 2) [m]."""
        plane = _plane(np.asarray(longitude, float) - self.longitude, np.asarray(latitude, float))
        return plane - _plane(np.zeros(()), np.asarray(self.latitude))

    @property
    def definition(self) -> str:
        """Return the projection in the words of PROJ."""
        return (
            f"+proj=tmerc +lat_0={self.latitude!r} +lon_0={self.longitude!r} +k=1 +x_0=0 +y_0=0 +ellps=WGS84 "
            "+units=m +no_defs"
        )


def _plane(longitude: Array, latitude: Array) -> Array:
    """Return x, and y from the equator on [m]."""
    lam, phi = np.radians(longitude), np.radians(latitude)
    sine = np.sin(phi)
    conformal = np.sinh(np.arctanh(sine) - _ECCENTRICITY * np.arctanh(_ECCENTRICITY * sine))  # tan of the latitude
    xi = np.arctan2(conformal, np.cos(lam))
    eta = np.arcsinh(np.sin(lam) / np.hypot(conformal, np.cos(lam)))
    k = 2.0 * np.arange(1, 7)
    x = eta + (_SERIES * np.cos(k * xi[..., None]) * np.sinh(k * eta[..., None])).sum(-1)
    y = xi + (_SERIES * np.sin(k * xi[..., None]) * np.cosh(k * eta[..., None])).sum(-1)
    return _RADIUS * np.stack([x, y], -1)
