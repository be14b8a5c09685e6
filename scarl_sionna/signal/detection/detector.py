"""The detector: cells above a constant false-alarm rate, then the angle of every peak."""

from __future__ import annotations

from typing import Unpack, cast

import numpy as np
import numpy.typing as npt
import scipy.ndimage
from scipy.special import gammaincinv

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.prompt.arguments import HOW_TO_RADAR, expect
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import dbm_to_watt, power_to_db

from ..angle import RangeDopplerAngle, directions
from ..antenna import field_gain
from ..direction.manifold import Manifold
from ..direction.several import pursue
from ..link import radar_gain
from ..peaks import tone_offset
from ..processing import RangeDoppler
from ..windows import window_values
from .leakage import leaked_over_the_ends
from .points import RadarPoints
from .threshold import Options, Widths, cfar, fitting_window

Array = npt.NDArray[np.float64]


class PointOptions(Options, total=False):
    """Keywords of :func:`detect`."""

    peaks_only: bool
    most_directions: int


def detect(
    rda: RangeDopplerAngle,
    radar: RadarSpec | None = None,
    pfa: float = 1e-6,
    guard: Widths | None = None,
    training: Widths | None = None,
    **options: Unpack[PointOptions],
) -> RadarPoints:
    r"""Return the points above the noise and clutter around them.

    Parameters
    ----------
    rda : RangeDopplerAngle
    radar : RadarSpec, optional
        Default: that of the map.
    pfa : float
        Probability of false alarm of a cell in white noise, 0 < pfa < 1.
    guard, training : tuple of int, optional
        Half-widths in cells (Doppler, range): of the neighbours left out, and of the training cells beyond them. Left
        out: (3, 3) and (6, 8), or what fits into a smaller map.
    **options
        `peaks_only` (True): keep one point a local maximum over Doppler and range, and none that may be the leakage of
        a stronger cell over an end of the range axis. `most_directions` (3): points of one cell at most, 1 takes its
        strongest direction only. `kind`, `along` and `rank` of the threshold, see :func:`cfar`.

    Returns
    -------
    RadarPoints

    Raises
    ------
    ParameterRangeError
        If `pfa`, a half-width, `most_directions` or `rank` is out of range.

    Notes
    -----
    The threshold is over the power summed over channels (:func:`cfar`). The direction of a cell is the maximum of the
    beamformer (of spherical waves for what is closer than the Fraunhofer distance of the array); where more than noise
    is left, matching pursuit finds further ones (:func:`~scarl_sionna.signal.direction.several.pursue`), and each is a
    point of its own. Range and velocity are interpolated exactly for a tone in the map's window.

    What a radar cannot measure is 0: azimuth or elevation along which its array has no extent, the velocity in a frame
    of one chirp, a range that noise would put before the radar.

    References
    ----------
    .. [1] M. A. Richards, *Fundamentals of Radar Signal Processing*, 2nd ed., 2014, ch. 6.5.
    """
    expect("rda", rda, RangeDopplerAngle, "give ss.range_doppler_angle(cube, radar)")
    radar = rda.radar if radar is None else radar
    expect("radar", radar, RadarSpec, HOW_TO_RADAR)
    rd, power = rda.range_doppler, rda.range_doppler.power
    fitting = fitting_window((rd.data.shape[1], rd.data.shape[2]))
    peaks_only, most = options.pop("peaks_only", True), options.pop("most_directions", 3)
    if most < 1:
        raise ParameterRangeError("most_directions", most, ">= 1")
    found = cfar(rd, pfa, guard or fitting[0], training or fitting[1], **cast(Options, options))
    peaks = found
    if peaks_only:
        peaks = found & (power == scipy.ndimage.maximum_filter(power, size=3, mode=("wrap", "nearest")))
    row, column = np.nonzero(peaks)
    if peaks_only:
        own = ~leaked_over_the_ends(rd, found, row, column)
        row, column = row[own], column[own]
    return _points(rda, radar, power, (row, column), most)


def _points(
    rda: RangeDopplerAngle,
    radar: RadarSpec,
    power: npt.NDArray[np.float32],
    cells: tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]],
    most: int,
) -> RadarPoints:
    """Return the table of detected cells (Doppler, range), one row a direction."""
    doppler_index, range_index = cells
    rd = rda.range_doppler
    num_doppler, num_range = power.shape
    near = np.clip([range_index - 1, range_index, range_index + 1], 0, num_range - 1)
    below, here, above = power[doppler_index, near]
    range_offset = tone_offset(below, here, above, rd.window[0], radar.num_range_bins, num_range)
    around = np.array([doppler_index - 1, doppler_index, doppler_index + 1]) % num_doppler
    below, here, above = power[around, range_index]
    doppler_offset = tone_offset(below, here, above, rd.window[1], radar.num_doppler_bins, num_doppler)
    if num_doppler == 1:
        doppler_offset = np.zeros_like(doppler_offset)
    step = rd.range[1] - rd.range[0] if num_range > 1 else radar.max_range
    distance = np.maximum((range_index + range_offset) * step, 0.0)
    velocity = rd.radial_velocity[0] + (doppler_index + doppler_offset) * (
        2.0 * radar.unambiguous_velocity / num_doppler
    )
    snapshot = rd.data[:, doppler_index, range_index].T.astype(np.complex128)
    found = pursue(Manifold.of(radar, rda.azimuth, rda.elevation), snapshot, distance, noise_floor(rd, power), most)
    azimuth, elevation = np.arcsin(np.clip(found.sines, -1.0, 1.0)).T
    unit = directions(azimuth, elevation)
    straddle = _straddle_gain(rd, range_offset, doppler_offset, radar)[found.cell]
    distance, velocity = distance[found.cell], velocity[found.cell]
    received = np.abs(found.amplitude) ** 2 / straddle
    gain = field_gain(radar.array.pattern, unit) ** 4
    of_square_metre = (
        dbm_to_watt(radar.front_end.tx_power_dbm)
        * np.maximum(gain, 1e-30)
        * radar_gain(radar.wavelength, np.maximum(distance, 1e-3))
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


def noise_floor(rd: RangeDoppler, power: npt.NDArray[np.float32]) -> float:
    """Return the noise of a cell of one channel [W]: by the map's median power, at least the thermal noise."""
    channels = len(rd.data)
    return max(rd.noise_power, float(np.median(power)) * channels / float(gammaincinv(channels, 0.5)))


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
