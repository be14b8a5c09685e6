"""From paths to the map of a closed radar: a sum over the paths, each as the table has it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import NdBSpline, make_interp_spline
from scipy.sparse import csr_array

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.prompt.arguments import expect
from scarl_sionna.core.specs.radar.closed.device import ClosedRadarSpec
from scarl_sionna.core.specs.radar.closed.table import AXES, PointSpread
from scarl_sionna.core.specs.radar.tones import seen_by
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.labels.spread import PathCells
from scarl_sionna.radar.link import path_amplitude
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.synthesis.phase import FrameGrid, delay_terms, phasor
from scarl_sionna.signal.angle import RangeDopplerAngle
from scarl_sionna.signal.detection.map_peaks import with_axes

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.int64]

MOST_MIGRATION = 0.5
"""Part of the response's width over range that a point may move by in a frame before the table is none of it."""
_CELLS_A_BLOCK = 2_000_000
_HALF_POWER = 0.5


@dataclass(frozen=True, eq=False)
class PathPlaces:
    """Where paths stand in a closed radar's map, and what they are there.

    Attributes
    ----------
    range, radial_velocity : ndarray of float64, shape (num_paths,)
        [m], [m/s], the velocity within its period.
    azimuth : ndarray of float64, shape (num_paths,)
        In the scale of the point spread: its sine, or [rad].
    field : ndarray of complex128, shape (num_paths,)
        Received by one channel at the frame's middle [sqrt(W)].
    """

    range: Array
    radial_velocity: Array
    azimuth: Array
    field: Complex

    @classmethod
    def of(cls, paths: RadarPaths, device: ClosedRadarSpec) -> PathPlaces:
        """Return the places of paths, without those that the receiver's filter removes.

        Range and velocity are those at the middle of the frame as the waveform of ``device.radar`` has them, by
        :class:`~scarl_sionna.radar.labels.spread.PathCells`; of azimuth the mean of the sines of departure and arrival.
        """
        cells = PathCells.of(paths, device.radar)
        paths, kept = paths.select(cells.kept), np.flatnonzero(cells.kept)
        seen = seen_by(device.radar)
        grid = FrameGrid(seen)
        terms = delay_terms(paths.length, paths.length_rate, paths.length_acceleration)
        cycles, _, doppler, _ = grid.expand(*terms, 0)
        span, scale = device.velocity_span, 0.5 * SPEED_OF_LIGHT / seen.center_frequency
        velocity = doppler * scale
        velocity -= span * np.floor(velocity / span + 0.5)
        removed = velocity / scale if device.compensates_motion else np.zeros(len(velocity))
        place = cells.range_bin(kept, removed) * seen.range_resolution
        ends = zip(paths.end_vectors(), (paths.world_from_tx, paths.world_from_rx), strict=True)
        sine = np.mean([_sine(vector @ frame.rotation, device.spread) for vector, frame in ends], axis=0)
        azimuth = sine if device.spread.azimuth_scale == "sine" else np.arcsin(sine)
        field = np.conj(path_amplitude(paths, device.radar)) * cells.loss[kept] * phasor(cycles)
        return cls(place, velocity, azimuth, np.asarray(field))


def _sine(vector: Array, spread: PointSpread) -> Array:
    """Return the sine of azimuth of vectors (n, 3) in the radar's frame: an array's cone angle, or in the plane."""
    flat = vector[:, :2] if spread.azimuth_scale == "angle" else vector
    return np.asarray(vector[:, 1] / np.maximum(np.linalg.norm(flat, axis=1), 1e-12))


def map_of_paths(
    paths: RadarPaths, device: ClosedRadarSpec, rng: np.random.Generator | None = None
) -> RangeDopplerAngle:
    r"""Return the map that a closed radar makes of paths.

    Parameters
    ----------
    paths : RadarPaths
        Of any solver, for ``device.radar``.
    device : ClosedRadarSpec
    rng : numpy.random.Generator, optional
        Of the noise; left out: none.

    Returns
    -------
    RangeDopplerAngle
        Powers alone, shape (num_velocity, num_range, num_azimuth), in the device's unit: [W] times its gain.

    Raises
    ------
    InputTypeError
        If `paths` or `device` are of another type.

    Warns
    -----
    ScarlWarning
        If points move over range in a frame by more than half the width of the table's response, or stand in front of
        the first or behind the last cell; if cells were cut at the full scale.

    Notes
    -----
    With the place :math:`q_p` of a path, its field :math:`a_p` and the table h,

    .. math:: P(q) = |\sum_p a_p h(q - q_p) + n(q)|^2 \quad \text{(amplitude)}, \qquad
              P(q) = \sum_p |a_p|^2 h(q - q_p) \quad \text{(power)}

    Of a power the phase between echoes in one cell is lost: their powers add up, which is the mean over phases. Noise
    is white over the cells; with L looks a power P becomes a noncentral gamma variable of mean P + N. *Kept*: places
    between cells, folded velocity, sidelobes over the ends of periodic axes, the phases of echoes at mid-frame. *Not
    modelled*: what in the response depends on the place but by the azimuth's scale (migration, near field, elevation),
    or differs between departure and arrival; noise that windows link from cell to cell. Costs a sum over the paths
    times the table's cells.

    References
    ----------
    .. [1] M. A. Richards, *Fundamentals of Radar Signal Processing*, 2nd ed., 2014, ch. 2 (point spread) and 6.
    """
    expect("paths", paths, RadarPaths, "give ss.solve_paths(world.at(time), device.radar, pose)")
    expect("device", device, ClosedRadarSpec, "give a ClosedRadarSpec")
    places = PathPlaces.of(paths, device)
    _warn(places, paths, device)
    field = _summed(places, device)
    power = np.abs(field) ** 2 if device.spread.kind == "amplitude" else np.maximum(field.real, 0.0)
    if rng is not None and device.noise_power > 0.0:
        power = _with_noise(field, power, device, rng)
    if device.full_scale_dbm is not None:
        most = 1e-3 * 10.0 ** (device.full_scale_dbm / 10.0)
        if (power > most).any():
            count, strongest = int((power > most).sum()), 10.0 * np.log10(power.max() / most)
            warnings.warn(f"{count} cells are up to {strongest:.1f} dB above full scale and are cut", ScarlWarning, 2)
            power = np.minimum(power, most)
    return with_axes((power * device.gain).astype(np.float32), device)


def _with_noise(field: Complex, power: Array, device: ClosedRadarSpec, rng: np.random.Generator) -> Array:
    """Return powers with noise, the mean of as many looks as the device takes."""
    looks, noise = device.num_looks, device.noise_power
    if looks == 1 and device.spread.kind == "amplitude":
        parts = rng.normal(0.0, np.sqrt(0.5 * noise), (2, *field.shape))
        return np.asarray(np.abs(field + parts[0] + 1j * parts[1]) ** 2)
    drawn = rng.noncentral_chisquare(2.0 * looks, 2.0 * looks * power / noise)
    return np.asarray(drawn * noise / (2.0 * looks))


def half_power_width(spread: PointSpread, axis: str) -> float:
    """Return how wide the response is along an axis at half the power [m, m/s; sine or rad]; by definition."""
    number = spread.axes.index(axis)
    offset = spread.offsets[number]
    if spread.is_separable:
        row = np.abs(spread.factors[number])
    else:
        values = np.abs(spread.values)
        peak = np.unravel_index(int(values.argmax()), values.shape)
        row = np.moveaxis(values, number, -1)[tuple(np.delete(peak, number))]
    power = row**2 if spread.kind == "amplitude" else row
    above = power >= _HALF_POWER * power.max()
    first = last = int(power.argmax())
    while first > 0 and above[first - 1]:
        first -= 1
    while last < len(above) - 1 and above[last + 1]:
        last += 1
    ends = []
    for inside, outside in ((first, first - 1), (last, last + 1)):
        if 0 <= outside < len(power):
            part = (power[inside] - _HALF_POWER * power.max()) / (power[inside] - power[outside])
            ends.append(offset[inside] + part * (offset[outside] - offset[inside]))
        else:
            ends.append(offset[inside])
    return float(ends[1] - ends[0])


def _warn(places: PathPlaces, paths: RadarPaths, device: ClosedRadarSpec) -> None:
    """Warn of what the table is none of."""
    moved = 0.5 * np.abs(paths.length_rate) * device.radar.frame_time
    width = half_power_width(device.spread, "range")
    if (moved > MOST_MIGRATION * width).any():
        count = int((moved > MOST_MIGRATION * width).sum())
        warnings.warn(
            f"{count} of {paths.num_paths} paths move over range in a frame by up to {moved.max():.3g} m, where a "
            f"point is {width:.3g} m wide: the table of a point at rest is too sharp for them",
            ScarlWarning,
            stacklevel=3,
        )
    if device.range_period is not None:
        return
    axis = np.array(device.axes.range)
    step = axis[1] - axis[0] if len(axis) > 1 else 0.0
    beyond = (places.range < axis[0] - step) | (places.range > axis[-1] + step)
    if beyond.any():
        warnings.warn(
            f"{int(beyond.sum())} of {len(beyond)} paths are outside of the map's ranges, {axis[0]:.3g} to "
            f"{axis[-1]:.3g} m; what reaches into it is the table's sidelobes",
            ScarlWarning,
            stacklevel=3,
        )


def _summed(places: PathPlaces, device: ClosedRadarSpec) -> Complex:
    """Return the sum over the paths in every cell, shape (num_velocity, num_range, num_azimuth) [sqrt(W)] or [W]."""
    spread, shape = device.spread, device.axes.shape
    strength = places.field if spread.kind == "amplitude" else np.abs(places.field) ** 2 + 0j
    grids = [_Axis.of(device, axis) for axis in spread.axes]
    where = [getattr(places, {"velocity": "radial_velocity"}.get(axis, axis)) for axis in spread.axes]
    last = spread.axes.index("azimuth") if spread.is_separable and "azimuth" in spread.axes else len(grids)
    total = np.zeros(
        (shape[0] * shape[1] * (1 if last < len(grids) else shape[2]), shape[2] if last < len(grids) else 1)
    )
    total = total.astype(np.complex128)
    table, width = _table(spread, range(last)), int(np.prod([grid.width for grid in grids[:last]]))
    over_azimuth = _table(spread, range(last, last + 1)) if last < len(grids) else None
    stride = {
        "velocity": shape[1] * (len(total) // (shape[0] * shape[1])),
        "range": len(total) // (shape[0] * shape[1]),
    }
    count = max(1, _CELLS_A_BLOCK // width)
    for start in range(0, len(strength), count):
        rows = slice(start, start + count)
        near = [grid.near(place[rows]) for grid, place in zip(grids, where, strict=True)]
        value = _turned(table, near[:last], grids[:last], spread) * strength[rows].reshape(-1, *(1,) * last)
        cell = np.zeros((len(value), *(1,) * last), dtype=np.int64)
        for number, (index, _, _) in enumerate(near[:last]):
            cell = cell + stride.get(spread.axes[number], 1) * index.reshape(len(value), *_along(number, last))
        wide = np.ones((len(value), 1), dtype=np.complex128)
        if over_azimuth is not None:  # all azimuths of a path at once: a product of matrices
            wide = np.zeros((len(value), shape[2]), dtype=np.complex128)
            path = np.broadcast_to(np.arange(len(value))[:, None], near[last][0].shape)
            np.add.at(wide, (path, near[last][0]), _turned(over_azimuth, near[last:], grids[last:], spread))
        starts = np.arange(len(value) + 1) * width
        spread_out = csr_array((value.ravel(), cell.ravel(), starts), shape=(len(value), len(total)))
        total += spread_out.T @ wide
    return np.asarray(total.reshape(shape))


def _turned(
    table: _Table, near: Sequence[tuple[Index, Array, Array | None]], axes: Sequence[_Axis], spread: PointSpread
) -> Complex:
    """Return the table's values at offsets along each axis, with what amplitudes turn by beyond periods."""
    count = len(near)
    offsets = [offset.reshape(len(offset), *_along(number, count)) for number, (_, offset, _) in enumerate(near)]
    passed = [
        None if periods is None else periods.reshape(len(periods), *_along(number, count))
        for number, (_, _, periods) in enumerate(near)
    ]
    for number, axis in enumerate(axes):
        if axis.shear:  # by how far velocities are apart, periods and all
            apart, periods, span = offsets[number + 1], passed[number + 1], axes[number + 1].period
            if periods is not None and span is not None:
                apart = apart + span * periods
            offsets[number], more = _folded(offsets[number] + axis.shear * apart, axis.period)
            own = passed[number]
            passed[number] = more if own is None or more is None else own + more
    value = table(tuple(offsets))
    for axis, periods in zip(axes, passed, strict=True):
        if axis.turn and periods is not None and spread.kind == "amplitude":
            value = value * phasor(periods * axis.turn)
    return value


def _folded(offset: Array, period: float | None) -> tuple[Array, Array | None]:
    """Return offsets within half a period, and how many periods they were beyond; as they are without a period."""
    if period is None:
        return offset, None
    periods = np.round(offset / period)
    return offset - period * periods, periods


def _along(number: int, count: int) -> tuple[int, ...]:
    return tuple(-1 if k == number else 1 for k in range(count))


@dataclass(frozen=True, eq=False)
class _Axis:
    """Cells along one axis, and how far the table reaches over them."""

    cells: Array
    low: float
    high: float
    period: float | None
    turn: float
    width: int
    shear: float

    @classmethod
    def of(cls, device: ClosedRadarSpec, axis: str) -> _Axis:
        spread = device.spread
        offset = spread.offsets[spread.axes.index(axis)]
        if axis == "azimuth":
            angle = np.radians(device.axes.azimuth_deg)
            cells, period = np.sin(angle) if spread.azimuth_scale == "sine" else angle, device.sine_period
        elif axis == "velocity":
            cells, period = np.array(device.axes.radial_velocity), device.velocity_span
        else:
            cells, period = np.array(device.axes.range), device.range_period
        low, high = float(offset[0]), float(offset[-1])
        shear = spread.range_per_velocity if axis == "range" else 0.0
        aside = abs(shear) * device.velocity_span  # rows of velocity reach to other cells
        low, high = low - aside, high + aside
        step = float(np.diff(cells).min()) if len(cells) > 1 else np.inf
        width = min(int(np.floor((high - low) / step)) + 1, len(cells))
        turn = device.period_phase_deg[AXES.index(axis)] / 360.0
        return cls(cells, low, high, period, turn, width, shear)

    def near(self, place: Array) -> tuple[Index, Array, Array | None]:
        """Return cells around places, their offsets from them, and how many periods they are beyond those.

        Shape (num_paths, width) each; some are beyond the table.
        """
        if self.period is not None:
            offset, periods = _folded(self.cells - place[:, None], self.period)
            assert periods is not None  # with a period
            index = np.argsort(np.abs(offset - 0.5 * (self.low + self.high)), axis=1)[:, : self.width]
            offset, periods = (np.take_along_axis(row, index, axis=1) for row in (offset, periods))
            return index, offset, periods
        first = np.searchsorted(self.cells, place + self.low)
        index = first[:, None] + np.arange(self.width)
        inside = index < len(self.cells)
        index = np.where(inside, index, 0)
        return index, np.where(inside, self.cells[index] - place[:, None], np.inf), None


_Table = Callable[[tuple[Array, ...]], Complex]


def _table(spread: PointSpread, axes: range) -> _Table:
    """Return a function from offsets along some axes, (n, *widths) together, to the table's values of that shape."""
    if spread.is_separable:
        kinds = [spread.factor_at(axis) for axis in axes]

        def product(offsets: tuple[Array, ...]) -> Complex:
            out = np.ones((len(offsets[0]), *(1,) * len(offsets)), dtype=np.complex128)
            for own, offset in zip(kinds, offsets, strict=True):
                out = out * own(offset)
            return out

        return product
    degree = 3 if spread.interpolation == "cubic" else 1
    degrees = tuple(min(degree, len(offset) - 1) for offset in spread.offsets)
    knots, values = [], spread.values
    for number, (offset, own) in enumerate(zip(spread.offsets, degrees, strict=True)):
        spline = make_interp_spline(offset, values, k=own, axis=number)
        knots.append(spline.t)
        values = np.moveaxis(spline.c, 0, number) if number else spline.c
    whole = NdBSpline(tuple(knots), np.ascontiguousarray(values), degrees)

    def over_all(offsets: tuple[Array, ...]) -> Complex:
        ends = [spread.offsets[axis] for axis in axes]
        held = [(offset >= own[0]) & (offset <= own[-1]) for own, offset in zip(ends, offsets, strict=True)]
        places = [np.where(own, offset, 0.0) for own, offset in zip(held, offsets, strict=True)]
        out = np.asarray(whole(np.stack(np.broadcast_arrays(*places), axis=-1)))
        for own in held:
            out = out * own
        return out

    return over_all
