"""The detector: cells above a constant false-alarm rate, then the angle of every peak."""

from __future__ import annotations

from typing import NamedTuple, Unpack, cast

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.prompt.arguments import HOW_TO_RADAR, expect
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import power_to_db

from ..angle import RangeDopplerAngle, directions
from ..direction.manifold import Manifold
from ..direction.several import Directions, Method, check_method, pursue
from ..front_end.echoes import beat_frequency, echo_transfer, noise_left
from ..noise import floor_of
from ..processing import RangeDoppler, uncompensated
from .ambiguity import unfolded
from .beams import Beams, beams_above, is_peak, maxima
from .beside import with_those_beside
from .cells import Cells, at_targets, is_regular, straddle_gain
from .cross_section import DEAF_DB, cross_section
from .leakage import leaked_over_the_ends
from .points import RadarPoints
from .stagger import is_staggered, resolved
from .threshold import Options, Widths, cfar, fitting_window

Array = npt.NDArray[np.float64]
Phasors = npt.NDArray[np.complex128]


class PointOptions(Options, total=False):
    """Keywords of :func:`detect`."""

    peaks_only: bool
    unfold: bool
    most_directions: int
    per_beam: bool
    direction: Method


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
        Probability of false alarm of a cell in white noise, 1e-300 <= pfa < 1; of other kinds than ``"ca"`` 1e-18 and
        more.
    guard, training : tuple of int, optional
        Half-widths in cells (Doppler, range): of the neighbours left out, and of the training cells beyond them. Left
        out: (3, 3) and (6, 8), or what fits into a smaller map.
    **options
        `peaks_only` (True): keep one point a local maximum over Doppler and range, and none that may be the leakage of
        a stronger cell over an end of the range axis. `unfold` (True): where transmitters take turns or intervals are
        staggered, look for velocities beyond the unambiguous interval, and leave out images. `most_directions` (3):
        points of one cell at most, 1 takes its strongest direction only. `direction` (``"relax"``): how they are found,
        or ``"omp"``, ``"bartlett"``, ``"music"``, ``"esprit"``, see
        :func:`~scarl_sionna.signal.direction.several.pursue`. `per_beam` (False): compare each beam of the map with its
        own training cells as well, and take the local maxima of the beams; `pfa` is then of a cell of a beam, and
        staggered intervals are not unfolded. `kind`, `along` and `rank` of the threshold, see :func:`cfar`.

    Returns
    -------
    RadarPoints

    Raises
    ------
    ParameterRangeError
        If `pfa`, a half-width, `most_directions` or `rank` is out of range, or there is no such `direction` for the
        array.

    Notes
    -----
    The threshold is over the power summed over channels (:func:`cfar`), with `per_beam` over that of each beam, too
    (:func:`~scarl_sionna.signal.detection.beams.beams_above`): then a target beside a stronger one in another direction
    is found, and of the directions of a cell those stay that are within half a beamwidth of such a beam. The direction
    of a cell is the maximum of the beamformer (of spherical waves; of plane ones, for the search on the grid, from the
    Fraunhofer distance of the array on); where more than noise is left, matching pursuit finds further ones
    (:func:`~scarl_sionna.signal.direction.several.pursue`), and each is a point of its own, unless it turns out more
    than 30 dB under the strongest of its cell. A target on the flank of a stronger one, up to two bins beside it, has
    no maximum of that sum: with `peaks_only` and more than one direction it is looked for in what the stronger one's
    direction leaves (:func:`~scarl_sionna.signal.detection.beside.with_those_beside`; maps of even chirps, a beamwidth
    apart or more). Range and velocity are
    those of the tone that fits the cells around best (:func:`~scarl_sionna.signal.detection.subbin.fit_tones`);
    direction and power are taken there, between the bins.
    Of ramps with different carriers and of uneven chirps they come from the three largest cells. Time division tells
    velocities beyond the unambiguous interval by the phases between transmitters
    (:func:`~scarl_sionna.signal.detection.ambiguity.unfolded`), staggered intervals by tones at the chirps' true times
    (:func:`~scarl_sionna.signal.detection.stagger.resolved`), up to ``radar.unfolded_velocity``; range and direction
    follow.

    `rcs` and `snr_db` take into account what the receiver's filters leave at a point's beat frequency, as its maker
    knows it (:func:`~scarl_sionna.signal.front_end.echoes.echo_transfer`); not the errors of channels, compression, or
    the converter's `response`. Where antennas and filters leave next to nothing (more than 60 dB under the largest
    two-way gain), at range 0, and at +-90 deg, where the beamformer's maximum is outside the real angles, `rcs` is not
    known: NaN
    (:func:`~scarl_sionna.signal.detection.cross_section.cross_section`). Further directions of a cell are never there:
    they are what is left where more targets than directions share a cell.

    What a radar cannot measure is 0: azimuth or elevation along which its array has no extent, the velocity in a frame
    of one chirp, a range that noise would put before the radar.

    References
    ----------
    .. [1] M. A. Richards, *Fundamentals of Radar Signal Processing*, 2nd ed., 2014, ch. 6.5.
    """
    expect("rda", rda, RangeDopplerAngle, "give ss.range_doppler_angle(cube, radar)")
    radar = rda.radar if radar is None else radar
    expect("radar", radar, RadarSpec, HOW_TO_RADAR)
    rd, power = rda.channels, rda.channels.power
    fitting = fitting_window((rd.data.shape[1], rd.data.shape[2]))
    peaks_only, unfold = options.pop("peaks_only", True), options.pop("unfold", True)
    most, per_beam = options.pop("most_directions", 3), options.pop("per_beam", False)
    how = _How(most, unfold, options.pop("direction", "relax"), peaks_only and most > 1)
    check_method(how.method, radar)
    if most < 1:
        raise ParameterRangeError("most_directions", most, ">= 1")
    window = guard or fitting[0], training or fitting[1]
    manifold = Manifold.of(radar, rda.azimuth, rda.elevation)
    found = cfar(rd, pfa, *window, **cast(Options, options))
    if per_beam:
        tried = maxima(rda, manifold.axes, peaks_only)
        above = beams_above(rda, pfa, window, tried, **cast(Options, options))
        above |= tried & found.reshape(*found.shape, *(1,) * (tried.ndim - 2))
        beams = _beams(rda, above, manifold, peaks_only)
        return _points(rda, manifold, beams.cells(rd), beams, noise_floor(rd, power), how)
    row, column = np.nonzero(found & is_peak(power, range(2)) if peaks_only else found)
    if peaks_only:
        own = ~leaked_over_the_ends(rd, row, column)
        row, column = row[own], column[own]
    return _points(rda, manifold, Cells.of(rd, power, row, column), None, noise_floor(rd, power), how)


class _How(NamedTuple):
    """How the points of cells are found, see :func:`detect`."""

    most: int
    unfold: bool
    method: Method
    beside: bool


def _beams(rda: RangeDopplerAngle, above: npt.NDArray[np.bool_], manifold: Manifold, peaks_only: bool) -> Beams:
    """Return the beams that stand out, without what may be leakage over the ends."""
    found = np.asarray(above.reshape(*above.shape[:2], -1).any(axis=2))
    row, column = np.nonzero(found)
    if peaks_only:
        leaked = leaked_over_the_ends(rda.channels, row, column)
        above[row[leaked], column[leaked]] = False
    return Beams.of(rda, above, manifold.axes)


def _points(
    rda: RangeDopplerAngle,
    manifold: Manifold,
    cells: Cells,
    beams: Beams | None,
    noise: float,
    how: _How,
) -> RadarPoints:
    """Return the table of detected cells, one row a direction; `noise` is that of a cell of one channel [W]."""
    rd, radar = rda.channels, manifold.radar
    cells = cells.wrapped()
    if how.unfold:
        find = resolved if is_staggered(rd.radar) and beams is None else unfolded
        cells = find(cells, manifold, noise / radar.num_virtual)
    data = uncompensated(rd) if is_regular(rd.radar) else rd.data
    snapshot, distance = cells.snapshot, cells.distance
    if beams is None:
        sines = manifold.strongest(snapshot, distance)
    else:
        sines = manifold.refine(snapshot, beams.sines[beams.first], distance)
    beam = np.conj(manifold.phasors(sines, distance))
    located, snapshot, deviation = at_targets(cells, data, np.asarray(beam / radar.num_virtual), noise)

    def search(snapshot: Phasors, distance: Array, deviation: Array) -> Directions:
        return pursue(manifold, snapshot, distance, deviation, how.most, how.method)

    found = search(snapshot, located.distance, deviation)
    if beams is None and how.beside and is_regular(rd.radar):
        found, located = with_those_beside(manifold, found, located, data, noise, search)
    else:
        located = located.select(found.cell)
    if beams is not None:
        found, located = beams.own(found, located, manifold)
    located, snapshot, _ = at_targets(located, data, found.weights, noise)
    received = np.abs(np.einsum("pc,pc->p", found.weights, snapshot)) ** 2
    kept = found.is_within_range(received)
    return _table(rda, radar, located.select(kept), found.sines[kept], received[kept])


def _table(rda: RangeDopplerAngle, radar: RadarSpec, cells: Cells, sines: Array, received: Array) -> RadarPoints:
    """Return the points of targets with sines (n, 2) of their directions and powers (n,) [W], strongest first."""
    azimuth, elevation = np.arcsin(np.clip(sines, -1.0, 1.0)).T
    unit, distance = directions(azimuth, elevation), cells.distance
    beat = beat_frequency(radar, distance, cells.radial_velocity)
    left = np.abs(echo_transfer(radar, beat, rda.channels.window[0])) ** 2
    beside = noise_left(radar, beat, rda.channels.window[0])
    noise = rda.noise_power * np.maximum(beside, 10.0 ** (-DEAF_DB / 10.0))
    table = {
        "position": unit * distance[:, None],
        "range": distance,
        "azimuth": azimuth,
        "elevation": elevation,
        "radial_velocity": cells.radial_velocity,
        "power": received,
        "snr_db": power_to_db(received * straddle_gain(cells) / noise),
        "rcs": cross_section(radar, sines, distance, received, left),
        "cell": cells.row * len(rda.range) + cells.column,
        "velocity_interval": cells.period * (2.0 * rda.channels.radar.unambiguous_velocity),
    }
    order = np.argsort(-received, kind="stable")
    return RadarPoints(**{name: values[order] for name, values in table.items()})


def noise_floor(rd: RangeDoppler, power: npt.NDArray[np.float32]) -> float:
    """Return the noise of a cell of one channel [W]: by the map's median power, at least the thermal noise."""
    return floor_of(power, len(rd.data), rd.noise_power)
