"""How small a patch must be for its phase to be linear over it, for every antenna and over the whole band."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.radar_spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

from .sbr_settings import SbrChannelSettings

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

_FILL = 0.8
"""Bands are this part of the length allowed, so that the diagonals of their pieces are not too long as well."""


@dataclass(frozen=True)
class PatchSize:
    """Largest patches.

    Attributes
    ----------
    wavenumber : float
        At the middle of the band [rad/m].
    half_band : float
        Wavenumber from the middle of the band to its end [rad/m].
    aperture : float
        Distance of the outermost antenna from the array's centre [m].
    max_phase, max_ramp : float
        [rad].
    """

    wavenumber: float
    half_band: float
    aperture: float
    max_phase: float
    max_ramp: float

    @classmethod
    def of(cls, radar: RadarSpec, settings: SbrChannelSettings) -> PatchSize:
        """Return the limits for a radar."""
        arms = np.concatenate([radar.tx_array, radar.rx_array])
        return cls(
            2.0 * np.pi * radar.center_frequency / SPEED_OF_LIGHT,
            np.pi * radar.sampled_bandwidth / SPEED_OF_LIGHT,
            float(np.linalg.norm(arms, axis=1).max()),
            settings.max_phase,
            settings.max_ramp,
        )

    def length(self, distance: Array) -> Array:
        """Return the side that `max_phase` allows across the line of sight, there and back over a distance [m]."""
        return np.sqrt(4.0 * self.max_phase * distance / self.wavenumber)

    def excess(self, corners: Array, source: Array, receiver: Array) -> Array:
        """Return by how much each side is too long, shape (num_patches, 3); 1 is as long as allowed.

        With e the part of a side across a leg of length R, the quadratic phase at its half is k e^2 / (8 R); an antenna
        at a distance D from the centre turns the phase there by k e D / (2 R); at the end of the band it is turned by the
        difference of wavenumbers times half the difference of path length along the side.
        """
        center = corners.mean(axis=1)
        side = np.roll(corners, -1, axis=1) - corners
        curvature = np.zeros(side.shape[:2])
        turn = np.zeros(side.shape[:2])
        along = np.zeros(side.shape[:2])
        for end in (source, receiver):
            leg = center - end
            distance = np.linalg.norm(leg, axis=1, keepdims=True)
            radial = np.einsum("nij,nj->ni", side, leg / distance)
            across = np.maximum(np.einsum("nij,nij->ni", side, side) - radial**2, 0.0)
            curvature += across / distance
            turn += np.sqrt(across) / distance
            along += radial
        phase = np.sqrt(self.wavenumber * curvature / 8.0 / self.max_phase)
        ramp = np.maximum(self.wavenumber * self.aperture * turn, self.half_band * np.abs(along)) / 2.0 / self.max_ramp
        return np.maximum(phase, ramp)


def split(corners: Array, source: Array, receiver: Array, size: PatchSize, max_patches: int) -> tuple[Array, Index]:
    """Cut triangles until no side is too long.

    A triangle is sliced into bands parallel to its least side, so a sliver gives about twice as many pieces as its length
    needs; halving would give that number to the power 1.6.

    Parameters
    ----------
    corners : ndarray of float64, shape (num_triangles, 3, 3)
    source : ndarray of float64, shape (num_triangles, 3)
        Where the wave comes from (the transmitter or an image of it) [m, world].
    receiver : ndarray of float64, shape (3,)
    size : PatchSize
    max_patches : int

    Returns
    -------
    corners : ndarray of float64, shape (num_patches, 3, 3)
    rows : ndarray of int64, shape (num_patches,)
        The triangle that each patch is part of, rising.

    Raises
    ------
    ParameterRangeError
        If there are more than `max_patches` pieces.
    """
    rows = np.arange(len(corners))
    done: list[tuple[Array, Index]] = [(corners[:0], rows[:0])]
    count = 0
    while len(rows):
        excess = size.excess(corners, source[rows], receiver)
        longest = excess.max(axis=1, initial=0.0)
        small = longest <= 1.0
        done.append((corners[small], rows[small]))
        corners, rows, excess = corners[~small], rows[~small], excess[~small]
        bands = np.ceil(longest[~small] / _FILL)
        count += int(small.sum())
        if count + 2.0 * bands.sum() > max_patches:
            raise ParameterRangeError(
                "number of patches", f"above {max_patches}", f"<= {max_patches}",
                "choose fewer `instances`, a larger `max_phase` or a larger `max_patches`",
            )  # fmt: skip
        corners, piece_of = _bands(corners, excess, bands.astype(np.int64))
        rows = rows[piece_of]
    corners, rows = (np.concatenate(column) for column in zip(*done, strict=True))
    order = np.argsort(rows, kind="stable")
    return corners[order], rows[order]


def _bands(corners: Array, excess: Array, bands: Index) -> tuple[Array, Index]:
    """Return triangles cut into bands parallel to their least side, and which triangle each piece is of."""
    apex = (excess.argmin(axis=1)[:, None] + 2 + np.arange(3)) % 3  # side i runs from corner i to i + 1
    a, b, c = np.moveaxis(corners[np.arange(len(bands))[:, None], apex], 1, 0)
    owner = np.repeat(np.arange(len(bands)), bands)
    band = np.arange(len(owner)) - np.repeat(np.cumsum(bands) - bands, bands)
    low, high = (band / bands[owner])[:, None], ((band + 1) / bands[owner])[:, None]
    along_b, along_c = (b - a)[owner], (c - a)[owner]
    start = a[owner]
    upper = np.stack([start + low * along_b, start + high * along_b, start + high * along_c], axis=1)
    lower = np.stack([start + low * along_b, start + high * along_c, start + low * along_c], axis=1)
    inner = band > 0
    return np.concatenate([upper, lower[inner]]), np.concatenate([owner, owner[inner]])
