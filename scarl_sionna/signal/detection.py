"""Detection: constant false-alarm rate over range and Doppler, then the angle of every peak."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import scipy.ndimage
import scipy.stats

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.prompt.arguments import HOW_TO_RADAR, expect
from scarl_sionna.core.prompt.describe import Described, Row, field_rows
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import dbm_to_watt, power_to_db

from .angle import RangeDopplerAngle, directions, steering
from .antenna import field_gain
from .link import radar_gain
from .peaks import parabola_offset, tone_offset
from .processing import RangeDoppler
from .windows import window_values

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class RadarPoints(
    Described,
    units={
        "position": "m",
        "range": "m",
        "azimuth": "rad",
        "elevation": "rad",
        "radial_velocity": "m/s",
        "power": "W",
        "snr_db": "dB",
        "rcs": "m2",
    },
):
    """Detections of one frame, strongest first; every array has one row a point.

    Attributes
    ----------
    position : ndarray of float64, shape (num_points, 3)
        In the radar frame at the start of the first ramp [m].
    range, azimuth, elevation : ndarray of float64, shape (num_points,)
        [m], [rad], [rad]; elevation is 0 where the array has no vertical extent.
    radial_velocity : ndarray of float64, shape (num_points,)
        Positive when opening, modulo the unambiguous interval [m/s].
    power : ndarray of float64, shape (num_points,)
        Received by one channel [W].
    snr_db : ndarray of float64, shape (num_points,)
        Power of the cell after beamforming over its thermal noise [dB].
    rcs : ndarray of float64, shape (num_points,)
        From the radar equation with the antennas' gains [m2].
    """

    position: Array
    range: Array
    azimuth: Array
    elevation: Array
    radial_velocity: Array
    power: Array
    snr_db: Array
    rcs: Array

    def _facts(self) -> Iterable[Row]:
        yield "num_points", f"{self.num_points}, strongest first"
        yield from field_rows(self)

    @property
    def num_points(self) -> int:
        """Number of detections."""
        return int(self.range.shape[0])

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the detections from above, in the radar frame, coloured by radial velocity; larger: higher SNR.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Drawn into; default: those of a new figure.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from .plots import plot_points

        return plot_points(self, ax)


def detect(
    rda: RangeDopplerAngle,
    radar: RadarSpec | None = None,
    pfa: float = 1e-6,
    guard: tuple[int, int] = (3, 3),
    training: tuple[int, int] = (6, 8),
    peaks_only: bool = True,
) -> RadarPoints:
    r"""Return the points above the noise and clutter around them.

    Parameters
    ----------
    rda : RangeDopplerAngle
    radar : RadarSpec, optional
        Default: that of the map.
    pfa : float
        Probability of false alarm of a cell in white noise, 0 < pfa < 1.
    guard, training : tuple of int
        Half-widths in cells (Doppler, range): of the neighbours left out, and of the training cells beyond them.
    peaks_only : bool
        Keep one point a local maximum over Doppler and range.

    Returns
    -------
    RadarPoints

    Raises
    ------
    ParameterRangeError
        If `pfa` or a half-width is out of range.

    Notes
    -----
    Cell averaging over the power summed over channels. In white noise cell and average are gamma-distributed, so their
    ratio follows Fisher's distribution; windows correlate neighbouring training cells, which counts by the effective
    number of independent ones. The angle of a point is the strongest direction of its beam, refined to the maximum
    of the beamformer; range and velocity are interpolated exactly for a tone in the map's window.

    References
    ----------
    .. [1] M. A. Richards, *Fundamentals of Radar Signal Processing*, 2nd ed., 2014, ch. 6.5.
    """
    expect("rda", rda, RangeDopplerAngle, "give ss.range_doppler_angle(cube, radar)")
    radar = rda.radar if radar is None else radar
    expect("radar", radar, RadarSpec, HOW_TO_RADAR)
    found = cfar(rda.range_doppler, pfa, guard, training)
    power = rda.range_doppler.power
    if peaks_only:
        found &= power == scipy.ndimage.maximum_filter(power, size=3, mode=("wrap", "nearest"))
    doppler_index, range_index = np.nonzero(found)
    return _points(rda, radar, power, doppler_index, range_index)


def cfar(
    rd: RangeDoppler, pfa: float = 1e-6, guard: tuple[int, int] = (3, 3), training: tuple[int, int] = (6, 8)
) -> npt.NDArray[np.bool_]:
    """Return which cells exceed the average of the training cells around them, shape (num_doppler, num_range).

    Raises
    ------
    ParameterRangeError
        If the probability is not between 0 and 1, or the window is empty or larger than the map.

    References
    ----------
    .. [1] H. Rohling, "Radar CFAR thresholding in clutter and multiple target situations", IEEE Trans. Aerosp.
       Electron. Syst. 19(4), 1983: cell averaging.
    """
    if not 0.0 < pfa < 1.0:
        raise ParameterRangeError("pfa", pfa, "0 < pfa < 1")
    if min(guard) < 0 or min(training) < 1:
        raise ParameterRangeError("guard, training", f"{guard}, {training}", "guard >= 0 and training >= 1 cells")
    outer = tuple(2 * (g + t) + 1 for g, t in zip(guard, training, strict=True))
    if outer[0] > rd.data.shape[1] or outer[1] > rd.data.shape[2]:
        raise ParameterRangeError(
            "guard + training", f"a window of {outer} cells", f"at most {rd.data.shape[1:]} cells"
        )
    inner = tuple(2 * g + 1 for g in guard)
    power = rd.power.astype(np.float64)
    total = _box_sum(power, outer) - _box_sum(power, inner)
    # Doppler is periodic; beyond the ends of range there is nothing, so a cell there has fewer training cells
    ones = np.ones_like(power)
    count = np.rint(_box_sum(ones, outer) - _box_sum(ones, inner))
    return power * count > total * _threshold_factor(rd, pfa, count, outer, inner)


def _box_sum(values: Array, size: tuple[int, ...]) -> Array:
    """Return the sum over a box around every cell: periodic over Doppler, zero beyond range."""
    mean = scipy.ndimage.uniform_filter(values, size=size, mode=("wrap", "constant"))
    return mean * float(np.prod(size))


def _threshold_factor(
    rd: RangeDoppler, pfa: float, count: Array, outer: tuple[int, ...], inner: tuple[int, ...]
) -> Array:
    """Return the factor on the training average for every cell."""
    channels = len(rd.data)
    values, inverse = np.unique(count, return_inverse=True)
    loss = _correlation_loss(rd, outer, inner)
    freedom = np.maximum(values * loss, 1.0)
    factors = scipy.stats.f.isf(pfa, 2 * channels, 2 * channels * freedom)
    return factors[inverse].reshape(count.shape)


def _correlation_loss(rd: RangeDoppler, outer: tuple[int, ...], inner: tuple[int, ...]) -> float:
    """Return independent training cells over training cells.

    N / (mean over cells of the sum of squared correlations).
    """
    radar = rd.radar
    doppler = _power_correlation(rd.window[1], radar.num_doppler_bins, rd.data.shape[1], outer[0])
    distance = _power_correlation(rd.window[0], radar.num_range_bins, rd.data.shape[2], outer[1])
    mask = np.ones(outer)
    middle = tuple(slice((o - i) // 2, (o + i) // 2) for o, i in zip(outer, inner, strict=True))
    mask[middle] = 0.0
    overlap = scipy.signal.correlate(mask, mask, mode="full", method="fft")
    total = float((overlap * np.outer(doppler, distance)).sum())
    return float(mask.sum() / total)


def _power_correlation(window: str, count: int, num_bins: int, reach: int) -> Array:
    """Return the correlation of the noise powers of two bins at distances -(reach-1) .. reach-1."""
    squared = window_values(window, count) ** 2
    distance = np.arange(-(reach - 1), reach)
    phasors = np.exp(-2j * np.pi * np.outer(distance, np.arange(count)) / num_bins)
    return np.abs(phasors @ squared / squared.sum()) ** 2


def _points(
    rda: RangeDopplerAngle,
    radar: RadarSpec,
    power: npt.NDArray[np.float32],
    doppler_index: npt.NDArray[np.intp],
    range_index: npt.NDArray[np.intp],
) -> RadarPoints:
    """Return the table of detected cells."""
    rd = rda.range_doppler
    num_doppler, num_range = power.shape
    near = np.clip([range_index - 1, range_index, range_index + 1], 0, num_range - 1)
    below, here, above = power[doppler_index, near]
    range_offset = tone_offset(below, here, above, rd.window[0], radar.num_range_bins, num_range)
    around = np.array([doppler_index - 1, doppler_index, doppler_index + 1]) % num_doppler
    below, here, above = power[around, range_index]
    doppler_offset = tone_offset(below, here, above, rd.window[1], radar.num_doppler_bins, num_doppler)
    distance = (range_index + range_offset) * (rd.range[1] - rd.range[0])
    velocity = rd.radial_velocity[0] + (doppler_index + doppler_offset) * (
        rd.radial_velocity[1] - rd.radial_velocity[0]
    )
    snapshot = rd.data[:, doppler_index, range_index].T.astype(np.complex128)
    azimuth, elevation, received = _angles(rda, radar, snapshot, doppler_index, range_index)
    unit = directions(azimuth, elevation)
    straddle = _straddle_gain(rd, range_offset, doppler_offset, radar)
    received = received / straddle
    gain = field_gain(radar.array.pattern, unit) ** 4
    of_square_metre = (
        dbm_to_watt(radar.front_end.tx_power_dbm) * np.maximum(gain, 1e-30) * radar_gain(radar.wavelength, distance)
    )
    order = np.argsort(-received, kind="stable")
    table = {
        "position": unit * distance[:, None],
        "range": distance,
        "azimuth": azimuth,
        "elevation": elevation,
        "radial_velocity": velocity,
        "power": received,
        "snr_db": power_to_db(received * straddle / rda.noise_power),
        "rcs": received / of_square_metre,
    }
    return RadarPoints(**{name: values[order] for name, values in table.items()})


def _straddle_gain(rd: RangeDoppler, range_offset: Array, doppler_offset: Array, radar: RadarSpec) -> Array:
    """Return the power of a tone at an offset from its bin over that on the bin."""
    gain = np.ones_like(range_offset)
    axes = (
        (rd.window[0], radar.num_range_bins, rd.data.shape[2], range_offset),
        (rd.window[1], radar.num_doppler_bins, rd.data.shape[1], doppler_offset),
    )
    for window, count, num_bins, offset in axes:
        position = np.arange(count) - (count - 1) / 2.0
        response = np.cos(2.0 * np.pi * np.outer(offset, position) / num_bins) @ window_values(window, count)
        gain *= np.maximum(response, 1e-6) ** 2
    return gain


def _angles(
    rda: RangeDopplerAngle,
    radar: RadarSpec,
    snapshot: npt.NDArray[np.complex128],
    doppler_index: npt.NDArray[np.intp],
    range_index: npt.NDArray[np.intp],
) -> tuple[Array, Array, Array]:
    """Return azimuth, elevation [rad] and beamformed power [W] of cells: the map's best direction, then refined."""
    shape = rda.data.shape[2:]
    beams = rda.data[doppler_index, range_index].reshape(len(doppler_index), int(np.prod(shape)))
    best = np.unravel_index(beams.argmax(axis=1) if beams.size else np.zeros(0, dtype=int), shape)
    sine = [np.sin(rda.azimuth)[best[0]]]
    step = [float(np.sin(rda.azimuth[1]) - np.sin(rda.azimuth[0]))]
    if rda.elevation is not None:
        sine.append(np.sin(rda.elevation)[best[1]])
        step.append(float(np.sin(rda.elevation[1]) - np.sin(rda.elevation[0])))
    return _refine(radar, snapshot, sine, step)


def _refine(
    radar: RadarSpec, snapshot: npt.NDArray[np.complex128], sine: list[Array], step: list[float], rounds: int = 12
) -> tuple[Array, Array, Array]:
    """Return the angles and the power at the beamformer's maximum near a start, by parabolas of shrinking step."""

    def power(sines: list[Array]) -> Array:
        limited = [np.clip(value, -1.0, 1.0) for value in sines]
        elevation = np.arcsin(limited[1]) if len(limited) > 1 else np.zeros_like(limited[0])
        beam = np.conj(steering(radar, directions(np.arcsin(limited[0]), elevation)))
        return np.abs(np.einsum("pc,pc->p", beam, snapshot) / radar.num_virtual) ** 2

    sine, width = [value.copy() for value in sine], list(step)
    for _ in range(rounds):
        for axis in range(len(sine)):

            def moved(sign: float, axis: int = axis) -> list[Array]:
                return [value + sign * width[axis] * (index == axis) for index, value in enumerate(sine)]

            offset = parabola_offset(power(moved(-1.0)), power(sine), power(moved(1.0)))
            sine[axis] = np.clip(sine[axis] + offset * width[axis], -1.0, 1.0)
            width[axis] *= 0.6
    elevation = np.arcsin(sine[1]) if len(sine) > 1 else np.zeros_like(sine[0])
    return np.arcsin(sine[0]), elevation, power(sine)
