"""The array manifold: phasors of the channels towards a direction, plane or spherical, and a grid of directions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec

from ..angle import (
    PER_BEAMWIDTH,
    POSITION_TOLERANCE,
    beamwidths,
    directions,
    fraunhofer_distance,
    near_steering,
)
from ..antenna import virtual_positions
from ..peaks import parabola_offset

Array = npt.NDArray[np.float64]
Phasors = npt.NDArray[np.complex128]

_AT_ONCE = 2**23
"""Powers of spectra that are worked at once."""


@dataclass(frozen=True, eq=False)
class Manifold:
    """A radar's array over a grid of directions, given by the sines of azimuth and elevation.

    Attributes
    ----------
    radar : RadarSpec
    sines : ndarray of float64, shape (num_directions, 2)
        The grid.
    step : ndarray of float64, shape (2,)
        Its steps; 0 on an axis along which the array has no extent, where the sine is 0.
    """

    radar: RadarSpec
    sines: Array
    step: Array

    @classmethod
    def of(cls, radar: RadarSpec, azimuth: Array, elevation: Array | None) -> Manifold:
        """Return the grid of a map's axes [rad]; an axis that the array cannot measure is left at 0.

        Steps of more than a third of the beamwidth are divided, into four and more a beamwidth: what stands between two
        of them would be lost in the sidelobes of sparse arrays.
        """
        extent, widths = np.ptp(virtual_positions(radar), axis=0), beamwidths(radar)
        axes = [
            _divided(np.sin(axis), width)
            if axis is not None and size > POSITION_TOLERANCE * radar.wavelength
            else np.zeros(1)
            for axis, size, width in zip((azimuth, elevation), extent[1:], widths, strict=True)
        ]
        sines = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        return cls(radar, sines, np.array([axis[1] - axis[0] if len(axis) > 1 else 0.0 for axis in axes]))

    @property
    def shape(self) -> tuple[int, int]:
        """Number of the grid's azimuths and elevations."""
        elevations = len(np.unique(self.sines[:, 1]))
        return len(self.sines) // elevations, elevations

    @property
    def positions(self) -> Array:
        """Virtual positions of the channels [m], shape (num_virtual, 3)."""
        return virtual_positions(self.radar)

    @property
    def axes(self) -> tuple[int, ...]:
        """Which of azimuth (0) and elevation (1) the array measures."""
        return tuple(int(axis) for axis in np.flatnonzero(self.step))

    def unit(self, sines: Array) -> Array:
        """Return unit vectors (..., 3) towards sines (..., 2)."""
        return directions(*np.moveaxis(np.arcsin(np.clip(sines, -1.0, 1.0)), -1, 0))

    def phasors(self, sines: Array, distance: npt.ArrayLike) -> Phasors:
        """Return the channels' phasors (..., num_virtual) towards sines (..., 2) at distances [m]."""
        return near_steering(self.radar, self.unit(sines), distance)

    def power(self, snapshot: Phasors, sines: Array, distance: Array) -> Array:
        """Return the beamformed power [W] of snapshots (n, num_virtual) towards sines (n, 2), shape (n,)."""
        beam = np.conj(self.phasors(sines, distance))
        return np.abs(np.einsum("pc,pc->p", beam, snapshot) / self.radar.num_virtual) ** 2

    def spectrum(self, snapshot: Phasors, distance: Array) -> Array:
        """Return the beamformed power [W] of snapshots over the whole grid, shape (n, num_directions)."""
        out = np.empty((len(snapshot), len(self.sines)))
        plane = distance >= fraunhofer_distance(self.radar)
        if plane.any():
            out[plane] = np.abs(snapshot[plane] @ self._far) ** 2
        for row in np.flatnonzero(~plane):
            out[row] = np.abs(np.conj(self.phasors(self.sines, distance[row])) @ snapshot[row]) ** 2
        return np.asarray(out / self.radar.num_virtual**2)

    @cached_property
    def _far(self) -> Phasors:
        """What plane waves of the grid's directions are weighed with, shape (num_virtual, num_directions)."""
        return np.asarray(np.conj(self.phasors(self.sines, np.inf)).T)

    def blocks(self, count: int) -> Iterator[slice]:
        """Yield slices of so many snapshots whose spectra together are of some 64 MB."""
        size = max(_AT_ONCE // len(self.sines), 1)
        yield from (slice(first, first + size) for first in range(0, count, size))

    def peak(self, snapshot: Phasors, distance: Array) -> tuple[npt.NDArray[np.intp], Array]:
        """Return the number of the strongest direction of the grid for snapshots, and its power [W], both (n,)."""
        number, power = np.zeros(len(snapshot), dtype=np.intp), np.zeros(len(snapshot))
        for block in self.blocks(len(snapshot)):
            spectrum = self.spectrum(snapshot[block], distance[block])
            number[block], power[block] = spectrum.argmax(axis=1), spectrum.max(axis=1)
        return number, power

    def strongest(self, snapshot: Phasors, distance: Array) -> Array:
        """Return the sines (n, 2) of the beamformer's maximum: on the grid, then refined."""
        return self.refine(snapshot, self.sines[self.peak(snapshot, distance)[0]], distance)

    def refine(self, snapshot: Phasors, sines: Array, distance: Array, rounds: int = 12, scale: float = 1.0) -> Array:
        """Return the sines (n, 2) at the beamformer's maximum near a start, by parabolas of shrinking step."""
        sines, width = sines.copy(), scale * self.step
        # all three of a parabola at once: few snapshots cost what the calls do
        snapshots, distances = np.tile(snapshot, (3, 1)), np.tile(distance, 3)
        for _ in range(rounds):
            for axis in self.axes:
                places = np.tile(sines, (3, 1, 1))
                places[:, :, axis] += width[axis] * np.array([[-1.0], [0.0], [1.0]])
                power = self.power(snapshots, np.clip(places, -1.0, 1.0).reshape(-1, 2), distances)
                left, here, right = power.reshape(3, -1)
                sines[:, axis] = np.clip(sines[:, axis] + parabola_offset(left, here, right) * width[axis], -1.0, 1.0)
                width[axis] *= 0.6
        return sines


def _divided(sines: Array, width: float) -> Array:
    """Return a uniform axis, whose steps are divided evenly where they are too wide for a beam of this width."""
    step = float(np.ptp(sines)) / max(len(sines) - 1, 1)
    if step <= width / 3.0:
        return sines
    parts = int(np.ceil(PER_BEAMWIDTH * step / width))
    return np.interp(np.arange((len(sines) - 1) * parts + 1) / parts, np.arange(len(sines)), sines)
