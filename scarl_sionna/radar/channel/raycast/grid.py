"""A fixed grid of rays over a radar's field of view, all of the same solid angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.settings.raycast import GridKind

Array = npt.NDArray[np.float64]

GOLDEN_FRACTION = (np.sqrt(5.0) - 1.0) / 2.0
"""Fractional parts of its multiples fill 0 to 1 as evenly as any sequence (Weyl, three-gap theorem)."""
OTHER_FRACTION = np.sqrt(2.0) - 1.0
"""The same for rows, apart from that of columns."""


@dataclass(frozen=True)
class RayGrid:
    """One direction in each of equal cells in azimuth and sine of elevation.

    Every cell has the solid angle d(azimuth) * d(sin(elevation)), so the area across a ray at distance d is
    ``d**2 * solid_angle``. Ray ``row * num_azimuth + column`` counts columns from the right (negative azimuth), rows
    from the bottom. Rays of a staggered grid are shifted up or down within their cells, column by column, so that a
    level road is hit at all distances and not in circles only; of a scattered one to the sides, too, row by row, so
    that a wall along the line of sight is; those of a regular grid go through the centres. Made by :meth:`over`.
    """

    azimuth_fov: float
    elevation_fov: float
    num_azimuth: int
    num_elevation: int
    kind: GridKind = "staggered"

    @classmethod
    def over(cls, azimuth_fov: float, elevation_fov: float, num_rays: int, kind: GridKind = "staggered") -> RayGrid:
        """Return the grid with nearly square cells and at most `num_rays` rays.

        Parameters
        ----------
        azimuth_fov, elevation_fov : float
            Full width and height around the boresight [rad], 0 to pi.
        num_rays : int
            >= 1.
        kind : {"staggered", "scattered", "regular"}
        """
        if isinstance(num_rays, bool) or int(num_rays) != num_rays or num_rays < 1:
            raise ParameterRangeError("num_rays", num_rays, "an integer >= 1")
        for name, value in (("azimuth_fov", azimuth_fov), ("elevation_fov", elevation_fov)):
            if not 0.0 < value <= np.pi + 1e-12:
                raise ParameterRangeError(name, f"{value} rad", "0 < value <= pi rad")
        height = 2.0 * np.sin(elevation_fov / 2.0)
        num_elevation = int(np.clip(np.round(np.sqrt(num_rays * height / azimuth_fov)), 1, num_rays))
        return cls(azimuth_fov, elevation_fov, num_rays // num_elevation, num_elevation, kind)

    @property
    def num_rays(self) -> int:
        """Number of rays."""
        return self.num_azimuth * self.num_elevation

    @property
    def solid_angle(self) -> float:
        """Solid angle of a cell [sr]."""
        return self.azimuth_fov * self.height / self.num_rays

    @property
    def spacing(self) -> float:
        """Angle between neighbouring rays at the boresight, the larger of the two [rad]."""
        return max(self.azimuth_fov / self.num_azimuth, self.height / self.num_elevation)

    @property
    def height(self) -> float:
        """Difference of the sines of the elevations of the upper and the lower edge."""
        return float(2.0 * np.sin(self.elevation_fov / 2.0))

    def columns(self) -> tuple[Array, Array, Array]:
        """Return cosine and sine of the azimuth of every column, and its place in the cells' height, 0 to 1."""
        columns = np.arange(self.num_azimuth)
        azimuths = self.azimuth_fov * ((columns + 0.5) / self.num_azimuth - 0.5)
        shifted = self.kind != "regular"
        place = (columns * GOLDEN_FRACTION + 0.5) % 1.0 if shifted else np.full(self.num_azimuth, 0.5)
        return np.cos(azimuths), np.sin(azimuths), place

    def row_turns(self) -> Array | None:
        """Return by how much the rays of each row are turned to the left within their cells [rad]; None: not at all."""
        if self.kind != "scattered":
            return None
        rows = np.arange(self.num_elevation)
        return np.asarray((rows * OTHER_FRACTION % 1.0 - 0.5) * (self.azimuth_fov / self.num_azimuth))

    def directions(self, first: int, stop: int) -> Array:
        """Return the unit directions of rays `first` to `stop` in the radar frame, shape (stop - first, 3)."""
        row, column = np.divmod(np.arange(first, stop), self.num_azimuth)
        cosine, sine, place = self.columns()
        up = self.height * ((row + place[column]) / self.num_elevation - 0.5)
        level = np.sqrt(1.0 - up**2)
        x, y, turns = cosine[column], sine[column], self.row_turns()
        if turns is not None:
            own, other = np.cos(turns[row]), np.sin(turns[row])
            x, y = x * own - y * other, x * other + y * own
        return np.stack([level * x, level * y, up], axis=1)
