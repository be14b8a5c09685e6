"""A closed radar's point spread from maps of reflectors: aligned between the cells, averaged, cut where noise is."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline
from scipy.special import gammaincinv

from scarl_sionna.calibration.errors import CalibrationError
from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.prompt.describe import Described, Row
from scarl_sionna.core.specs.radar.closed.table import PointSpread, pairs
from scarl_sionna.signal.peaks import parabola_offset

from .point_map import PointMap

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

LEAST_SNR_DB = 20.0
"""A peak over the noise below which a map shows no more than itself."""
MAIN_LOBE = 0.1
"""Cells beside the peak along the other axes take part from this part of the peak on."""
SIGNIFICANT = 3.0
"""Standard deviations below which a value of the table is taken for noise."""
FINE = 3.0
"""Cells in a response's width at half the power from which on its place is found by a fit; else by its centroid."""
VALUES_A_WIDTH = 6.0
"""Of the table: cubic splines through them are within -60 dB of a transform's response."""
LEAST_STRAY = 6.0
"""Times the noise beyond the largest to be expected of all cells that one must stand above the table."""
MISFIT = 0.05
"""Part of the table's value that a map may differ by there: 0.2 dB."""
_SMOOTHNESS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-5, 1e-5, 1e-5, 1e-5)
"""Weight of the splines' bends in each round: first those of all maps together, then what their places tell."""
_DEGREE = 3
_LEAST_LOBE, _NONE = 1e-4, 1e-12


@dataclass(frozen=True, eq=False, repr=False)
class PointSpreadFit(Described):
    """A point spread as maps of reflectors show it.

    Attributes
    ----------
    spread : PointSpread
        A factor for each axis, 0 where the maps show noise only.
    places : ndarray of float64, shape (num_maps, num_axes)
        Of the peaks, between the cells: [m], [m/s], and of azimuth in the scale of the spread.
    levels_db : ndarray of float64, shape (num_maps,)
        Of the peaks in the map's unit [dB].
    noise_power : float
        Mean noise of a cell in the map's unit.
    floor_db : tuple of float
        For each axis the standard deviation of the table's values by noise below the peak [dB].
    stray_db : ndarray of float64, shape (num_maps,)
        Largest difference of each map from the table, beyond noise and 5 % of what the table has there, over the map's
        peak [dB].
    """

    spread: PointSpread
    places: Array
    levels_db: Array
    noise_power: float
    floor_db: tuple[float, ...]
    stray_db: Array

    def _facts(self) -> Iterable[Row]:
        yield "maps", str(len(self.places))
        for axis, count, floor in zip(self.spread.axes, self.spread.shape, self.floor_db, strict=True):
            yield axis, f"{count} offsets, noise {floor:.1f} dB"
        yield "levels_db", f"{self.levels_db.min():.1f} to {self.levels_db.max():.1f} dB"
        yield "stray_db", f"at most {self.stray_db.max():.1f} dB"


def fit_point_spread(
    maps: Sequence[PointMap],
    oversampling: int | None = None,
    reach: int = 32,
    num_looks: int = 1,
    max_stray_db: float = -30.0,
    velocity_period: float | None = None,
) -> PointSpreadFit:
    r"""Return what a point looks like in a radar's maps, from maps of one or several reflectors, each alone in its map.

    Parameters
    ----------
    maps : sequence of PointMap
        Powers, or complex amplitudes; all of one grid's steps. Several with places between the cells tell the response
        more finely than the cells, and tell sidelobes from what stands behind the reflector.
    oversampling : int, optional
        Values of the table a cell; left out: one for two maps, up to four.
    reach : int
        Cells on each side to which the table goes over range and velocity; over azimuth it goes all the way.
    num_looks : int
        Independent values that a cell's power is the mean of.
    max_stray_db : float
        How much of its peak a map may differ from the table in any cell [dB], beyond noise and 5 % of what the table
        has there.
    velocity_period : float, optional
        Velocities repeat after so much [m/s].

    Returns
    -------
    PointSpreadFit

    Raises
    ------
    ParameterRangeError
        If there is no map, maps differ in their axes or kind, or a number is out of range.
    CalibrationError
        If a peak does not stand out, is saturated or at an end of the map; if a map has something that the table does
        not explain: another target, or a response that depends on the place.

    Warns
    -----
    ScarlWarning
        If there is one map only.

    Notes
    -----
    The table is a product of cubic splines, one for each axis. Each in turn is the least-squares solution for the maps
    projected on the others within their main lobes, then level and place of each map are. What a level and a place for
    each map leave open where cells are as wide as the response (a factor, and a warp, that repeat from cell to cell)
    is told by the correlation theorem: over the cells of a transform a point's power has the same sum and the same
    centroid beside it, wherever it is between them. Of powers the mean noise is subtracted. Of amplitudes a phase that
    is linear over the cells is taken off: it is that of the transform's origin.

    .. math:: \min \sum_i \| m_i - g_i\, f_r(r - r_i) f_v(v - v_i) f_a(a - a_i) \|^2

    References
    ----------
    .. [1] J. D. Carroll, J.-J. Chang, "Analysis of individual differences in multidimensional scaling via an N-way
       generalization of Eckart-Young decomposition", Psychometrika 35(3), 1970: alternating least squares.
    """
    if not maps:
        raise ParameterRangeError("maps", "none", "at least one")
    if len(maps) == 1:
        warnings.warn("one map cannot tell sidelobes from echoes behind the reflector; give several", ScarlWarning, 2)
    oversampling = oversampling or int(np.clip(len(maps) // 2, 1, 4))
    for name, number in (("oversampling", oversampling), ("reach", reach), ("num_looks", num_looks)):
        if number < 1:
            raise ParameterRangeError(name, number, ">= 1")
    for number, item in enumerate(maps):
        item.check(maps[0], f"maps[{number}]")
    fit = _Fit(list(maps), oversampling, reach, num_looks, velocity_period)
    for smoothness in _SMOOTHNESS:
        fit.improve(smoothness)
    return fit.result(max_stray_db)


class _Fit:
    """Factors of the axes, and level and place of each map."""

    def __init__(
        self, maps: list[PointMap], oversampling: int, reach: int, num_looks: int, velocity_period: float | None
    ) -> None:
        self.maps, self.looks, self.first = maps, num_looks, maps[0]
        self.is_power = not np.iscomplexobj(self.first.data)
        self.names, self.periods = self.first.axes, {"velocity": velocity_period}
        half = gammaincinv(num_looks, 0.5) / num_looks
        self.noise = [float(np.median(item.power)) / half for item in maps]
        peaks = [_peak(item, noise, k) for k, (item, noise) in enumerate(zip(maps, self.noise, strict=True))]
        self.data = self._prepared(peaks)
        found = [_places(item, peak) for item, peak in zip(maps, peaks, strict=True)]
        self.place = np.array([place for place, _ in found])
        self.level = np.array(
            [values[peak] * gain for values, peak, (_, gain) in zip(self.data, peaks, found, strict=True)]
        )
        self.grids: list[Array] = []
        self.factors: list[Complex] = []
        self.std: list[Array] = []
        self.steps = [float(np.median(np.diff(cells))) for cells in self.first.cells]
        cuts = [
            [_cut(item.power, k, peak) for item, peak in zip(maps, peaks, strict=True)] for k in range(len(self.names))
        ]
        self.widths = [float(np.median([np.sum(row > 0.5) for row in rows])) for rows in cuts]
        for number, cells in enumerate(self.first.cells):
            most = int(np.clip(np.ceil(VALUES_A_WIDTH / self.widths[number]), 1, oversampling))
            step, parts = self.steps[number], self._parts(number, most)
            count = min(reach, len(cells) // 2) * parts
            if self.names[number] == "azimuth":  # few cells, and sidelobes that do not end
                widest = 1.0 if self.first.azimuth_scale == "sine" else 0.5 * np.pi
                count = int(min(len(cells) - 1, np.floor(widest / step)) * parts)
            self.grids.append(np.arange(-count, count + 1, dtype=np.float64) * (step / parts))
            self.factors.append(np.zeros(2 * count + 1, dtype=np.complex128))
            self.std.append(np.zeros(2 * count + 1))
            rows = [_cut(values, number, peak) for values, peak in zip(self.data, peaks, strict=True)]
            straddle = [values[peak] / level for values, peak, level in zip(self.data, peaks, self.level, strict=True)]
            self._solve(number, [(row * part, 1.0) for row, part in zip(rows, straddle, strict=True)], _SMOOTHNESS[0])

    def _parts(self, number: int, most: int) -> int:
        """Return into how many parts a cell is divided, so that no part is without a place."""
        cells, place = self.first.cells[number], self.place[:, number]
        phase = np.sort(np.mod((cells[0] - place) / float(np.median(np.diff(cells))), 1.0))
        widest = float(np.diff(phase, append=phase[0] + 1.0).max())
        return int(np.clip(np.floor(1.0 / widest), 1, most))

    def _prepared(self, peaks: list[tuple[int, ...]]) -> list[Complex]:
        """Return the maps, axes in the order of the spread, without mean noise or without a phase over the cells."""
        if self.is_power:
            return [
                item.values.astype(np.complex128) - noise for item, noise in zip(self.maps, self.noise, strict=True)
            ]
        out = [item.values.astype(np.complex128) for item in self.maps]
        for number in range(len(self.names)):
            cuts = [_cut(values, number, peak) for values, peak in zip(out, peaks, strict=True)]
            near = [cut[max(peak[number] - 1, 0) : peak[number] + 2] for cut, peak in zip(cuts, peaks, strict=True)]
            slope = np.angle(sum(np.sum(row[1:] * row[:-1].conj()) / np.sum(np.abs(row) ** 2) for row in near))
            for k, (values, peak) in enumerate(zip(out, peaks, strict=True)):
                turn = np.exp(-1j * slope * (np.arange(values.shape[number]) - peak[number]))
                out[k] = values * turn.reshape([-1 if axis == number else 1 for axis in range(values.ndim)])
        return out

    def offsets(self, number: int, which: int) -> Array:
        """Return how far the cells along an axis are from the place of a map."""
        out = self.maps[which].cells[number] - self.place[which, number]
        period = self.periods.get(self.names[number])
        return out if period is None else out - period * np.round(out / period)

    def _at(self, number: int, offset: Array, slope: int = 0) -> Complex:
        """Return a factor, or its derivative, at offsets; 0 beyond the table."""
        grid = self.grids[number]
        inside = (offset >= grid[0]) & (offset <= grid[-1])
        out = np.zeros(len(offset), dtype=np.complex128)
        spline = BSpline(_knots(grid), self.factors[number], _DEGREE)
        out[inside] = (spline.derivative() if slope else spline)(offset[inside])
        return out

    def _projected(self, number: int, which: int) -> tuple[Complex, float]:
        """Return a map along an axis, projected on the other factors over its level, and the sum of their squares."""
        values, weight = self.data[which] / self.level[which], 1.0
        for axis in reversed(range(len(self.names))):
            if axis == number:
                continue
            factor = self._at(axis, self.offsets(axis, which))
            factor = np.where(np.abs(factor) >= MAIN_LOBE * np.abs(factor).max(), factor, 0.0)
            size = float(np.sum(np.abs(factor) ** 2))
            values = np.tensordot(values, factor.conj() / size, axes=([axis], [0]))
            weight *= size
        return np.asarray(values), weight

    def improve(self, smoothness: float) -> None:
        """Solve for every factor, then for levels and places."""
        for number in range(len(self.names)):
            self._solve(number, [self._projected(number, which) for which in range(len(self.maps))], smoothness)
        for which in range(len(self.maps)):
            for number in range(len(self.names)):
                self._place(number, which)

    def _solve(self, number: int, rows: list[tuple[Complex, float]], smoothness: float) -> None:
        """Set a factor to the spline that fits projected maps best, its peak at 0 and 1."""
        grid, knots = self.grids[number], _knots(self.grids[number])
        matrix, right = np.zeros((len(grid), len(grid))), np.zeros(len(grid), dtype=np.complex128)
        energy = np.array([self._energy(number, which, row) for which, (row, _) in enumerate(rows)])
        even = energy.mean() / energy if energy.min() > 0.0 else np.ones(len(rows))
        even = even if self.is_power else np.sqrt(even)
        for which, (row, weight) in enumerate(rows):
            offset = self.offsets(number, which)
            inside = (offset >= grid[0]) & (offset <= grid[-1])
            basis = BSpline.design_matrix(offset[inside], knots, _DEGREE).toarray()
            size = weight * abs(self.level[which]) ** 2 / self._variance(which)
            matrix += size * basis.T @ basis
            right += size * basis.T @ (row[inside] * even[which])
        bend = np.diff(np.eye(len(grid)), 2, axis=0)
        inverse = np.linalg.inv(matrix + smoothness * np.trace(matrix) / len(grid) * bend.T @ bend)
        self.factors[number], self.std[number] = inverse @ right, np.sqrt(np.maximum(np.diag(inverse), 0.0))
        fine = np.linspace(-2.0, 2.0, 801) * (self.maps[0].cells[number][1] - self.maps[0].cells[number][0])
        size = np.abs(self._at(number, fine))
        best = int(size.argmax())
        shift = fine[best]
        if 0 < best < len(fine) - 1:
            shift += float(parabola_offset(*size[best - 1 : best + 2])) * (fine[1] - fine[0])
        if self.widths[number] >= FINE:
            self.place[:, number] += shift
        else:
            shift = 0.0
        self.factors[number] = _resampled(grid, self._at(number, grid + shift))
        peak = self._at(number, np.zeros(1))[0]
        self.factors[number], self.std[number] = self.factors[number] / peak, self.std[number] / abs(peak)
        self.level = self.level * peak

    def _energy(self, number: int, which: int, row: Complex) -> float:
        """Return the sum of a row's power over the table: of a transform it is the same wherever the point is."""
        grid, offset = self.grids[number], self.offsets(number, which)
        near = row[(offset >= grid[0]) & (offset <= grid[-1])]
        return float(near.real.sum()) if self.is_power else float(np.sum(np.abs(near) ** 2))

    def _variance(self, which: int) -> float:
        """Return the variance of a cell without signal."""
        return self.noise[which] ** 2 / self.looks if self.is_power else self.noise[which]

    def _place(self, number: int, which: int) -> None:
        """Move a map along an axis to where its row's centroid is, or, of fine cells, where its main lobe fits best."""
        row, _ = self._projected(number, which)
        offset = self.offsets(number, which)
        value, slope = self._at(number, offset), self._at(number, offset, 1)
        near = np.abs(value) > MAIN_LOBE
        gain = np.vdot(value[near], row[near]) / np.sum(np.abs(value[near]) ** 2)
        if self.widths[number] >= FINE:
            matrix = np.stack([value[near], -slope[near]], axis=1)
            gain, moved = np.linalg.lstsq(matrix, row[near], rcond=None)[0]
            shift = float((moved / gain).real)
        else:
            size = row.real if self.is_power else np.abs(row) ** 2
            weak = np.abs(offset)[size < max(_LEAST_LOBE * size.max(), 10.0 * size[np.abs(offset).argmax()])]
            far = float(weak.min(initial=np.abs(offset).max()))
            lobe = np.abs(offset) <= far
            shift = float(np.sum(size[lobe] * offset[lobe]) / np.sum(size[lobe]))
        self.place[which, number] += float(np.clip(shift, -0.5 * self.steps[number], 0.5 * self.steps[number]))
        self.level[which] *= gain

    def result(self, max_stray_db: float) -> PointSpreadFit:
        """Return the table without noise, after a check that nothing else is in the maps."""
        left = [self._stray(which) for which in range(len(self.maps))]
        stray, worst = np.array([found for found, _ in left]), int(np.argmax([found for found, _ in left]))
        if stray[worst] > max_stray_db:
            name = f" ({self.maps[worst].name})" if self.maps[worst].name else ""
            raise CalibrationError(
                f"maps[{worst}]{name} has {stray[worst]:.1f} dB of its peak at {left[worst][1]} "
                f"that the table does not explain (allowed: {max_stray_db} dB): another target, a saturated peak, or a "
                "response that depends on the place; leave the map out, or raise max_stray_db"
            )
        columns: dict[str, object] = {}
        for number, name in enumerate(self.names):
            grid = self.grids[number]
            values = self._at(number, grid)
            values = values.real.clip(0.0) + 0j if self.is_power else values
            kept = np.abs(values) > SIGNIFICANT * self.std[number]
            kept[len(grid) // 2] = True
            values, used = np.where(kept, values, 0.0), np.flatnonzero(kept)
            last = min(int(np.abs(used - len(grid) // 2).max()) + 1, len(grid) // 2)
            rows = slice(len(grid) // 2 - last, len(grid) // 2 + last + 1)
            shown = np.degrees(np.arcsin(np.clip(grid, -1.0, 1.0))) if name == "azimuth" else grid
            if name == "azimuth" and self.first.azimuth_scale == "angle":
                shown = np.degrees(grid)
            columns[f"{name}_offset" + ("_deg" if name == "azimuth" else "")] = shown[rows].tolist()
            columns[f"{name}_response"] = pairs(values[rows])
        kind = "power" if self.is_power else "amplitude"
        spread = PointSpread(kind=kind, azimuth_scale=self.first.azimuth_scale, **columns)
        size = np.abs(self.level) if self.is_power else np.abs(self.level) ** 2
        scale = 10.0 if self.is_power else 20.0
        floor = tuple(float(scale * np.log10(np.median(std))) for std in self.std)
        return PointSpreadFit(spread, self.place, 10.0 * np.log10(size), float(np.mean(self.noise)), floor, stray)

    def _stray(self, which: int) -> tuple[float, str]:
        """Return the largest difference of a map from the table over its peak [dB], and where it is."""
        model = np.ones((), dtype=np.complex128)
        for number in range(len(self.names)):
            model = model[..., None] * self._at(number, self.offsets(number, which))
        model, noise = self.level[which] * model, self.noise[which]
        left, power = np.abs(self.data[which] - model), np.abs(model)
        if not self.is_power:
            left, power = left**2, power**2
        most = noise * (np.log(left.size) + LEAST_STRAY) + LEAST_STRAY * np.sqrt(2.0 * power * noise)
        left = np.maximum(left - most - MISFIT * power, 0.0)
        peak = abs(self.level[which]) ** (1 if self.is_power else 2)
        if "azimuth" in self.names:  # beyond the table there is no saying what is a sidelobe
            number = self.names.index("azimuth")
            left[..., np.abs(self.offsets(number, which)) > self.grids[number][-1]] = 0.0
        cell = np.unravel_index(int(left.argmax()), left.shape)
        found = 10.0 * np.log10(max(left[cell] / peak, _NONE))
        units = {"range": " m", "velocity": " m/s", "azimuth": "" if self.first.azimuth_scale == "sine" else " rad"}
        where = (f"{name} {self.maps[which].cells[k][cell[k]]:.4g}{units[name]}" for k, name in enumerate(self.names))
        return float(found), ", ".join(where)


def _knots(grid: Array) -> Array:
    """Return the knots of a cubic spline with as many coefficients as a grid has values."""
    return np.concatenate([np.full(4, grid[0]), grid[2:-2], np.full(4, grid[-1])])


def _resampled(grid: Array, values: Complex) -> Complex:
    """Return the coefficients of the spline through values on a grid."""
    basis = BSpline.design_matrix(grid, _knots(grid), _DEGREE).toarray()
    return np.asarray(np.linalg.lstsq(basis, values, rcond=None)[0])


def _cut(values: npt.NDArray[Any], number: int, peak: tuple[int, ...]) -> npt.NDArray[Any]:
    """Return the row of a map along an axis through its peak, over the peak."""
    row = np.moveaxis(values, number, -1)[tuple(np.delete(peak, number))]
    return np.asarray(row / values[peak])


def _peak(item: PointMap, noise: float, number: int) -> tuple[int, ...]:
    """Return the cell of a map's peak, or raise if it is none."""
    power = np.abs(item.values) ** (1 if not np.iscomplexobj(item.data) else 2)
    cell = tuple(int(k) for k in np.unravel_index(int(power.argmax()), power.shape))
    label = f"maps[{number}]" + (f" ({item.name})" if item.name else "")
    snr = 10.0 * np.log10(max(float(power[cell]), 1e-300) / max(noise, 1e-300))
    if snr < LEAST_SNR_DB:
        raise CalibrationError(f"{label}: its peak is {snr:.1f} dB over the noise (needed: {LEAST_SNR_DB:.0f} dB)")
    if np.count_nonzero(power == power[cell]) > 1:
        count = int(np.count_nonzero(power == power[cell]))
        raise CalibrationError(
            f"{label}: {count} cells share the highest value: it is saturated; use a weaker reflector"
        )
    for axis, (place, count) in enumerate(zip(cell, power.shape, strict=True)):
        if item.axes[axis] != "velocity" and not 1 <= place < count - 1:
            raise CalibrationError(
                f"{label}: its peak is at an end of the axis over {item.axes[axis]}; move the reflector"
            )
    return cell


def _places(item: PointMap, peak: tuple[int, ...]) -> tuple[list[float], float]:
    """Return where a map's peak is by parabolas through logarithms of three cells, and how far above its cell."""
    out, rise = [], 0.0
    values = np.abs(item.values)
    for number, cells in enumerate(item.cells):
        row = np.log(np.maximum(np.moveaxis(values, number, -1)[tuple(np.delete(peak, number))], 1e-300))
        place = int(np.clip(peak[number], 1, len(cells) - 2))
        left, middle, right = row[place - 1 : place + 2]
        offset = float(parabola_offset(left, middle, right))
        rise += 0.25 * (right - left) * offset
        out.append(float(cells[place] + offset * (cells[place + 1] - cells[place])))
    return out, float(np.exp(rise))
