"""The closed radar that a known one would be: its point spread from the waveform, to hold the table against."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.prompt.arguments import expect
from scarl_sionna.core.specs.radar.closed.device import ClosedRadarSpec, MapAxes
from scarl_sionna.core.specs.radar.closed.table import PointSpread
from scarl_sionna.core.specs.radar.tones import seen_by
from scarl_sionna.core.specs.radar.waveform import Fmcw
from scarl_sionna.core.units import SPEED_OF_LIGHT, watt_to_dbm
from scarl_sionna.signal.angle import RangeDopplerAngle, uniform_line
from scarl_sionna.signal.antenna import virtual_positions
from scarl_sionna.signal.processing import coupling
from scarl_sionna.signal.receivers import response_weights
from scarl_sionna.signal.windows import window_values

Array = npt.NDArray[np.float64]

MOST_OFFSETS = 1 << 17
"""Values of a factor."""
_AT_ONCE = 1 << 22


def closed_radar_of(
    rda: RangeDopplerAngle, oversampling: int = 16, reach: int = 32, angle_window: str | None = None, **fields: object
) -> ClosedRadarSpec:
    """Return the closed radar whose maps are those that a known radar's processing makes.

    Parameters
    ----------
    rda : RangeDopplerAngle
        A map of the radar, with the channels that it was made of: its grid, windows and noise are taken.
    oversampling : int
        Values of the table in a cell without zero padding, and in what the array resolves.
    reach : int
        Cells on each side to which the table goes, at most half of all.
    angle_window : str, optional
        With which the map was made.
    **fields
        Others of the specification.

    Returns
    -------
    ClosedRadarSpec
        With a factor for each axis; of a map whose motion is compensated that over range is sheared, since each row of
        velocity then has a range of its own.

    Raises
    ------
    InputTypeError
        If `rda` is no map.
    ParameterRangeError
        If the radar has no linear ramps of I and Q or no uniform line of antennas, a number is out of range, or a
        factor would have more than 131,072 values.
    SpecError
        If the radar's front end is not ideal, or its radome sends something back.

    Notes
    -----
    Exact at the table's values: transforms of the windows about the middle of the frame. What the map has beyond is
    the migration over range within a frame, and what is between the values.
    """
    example = "give ss.range_doppler_angle(ss.virtual_cube(adc, radar), radar): the map is needed, not the radar alone"
    expect("rda", rda, RangeDopplerAngle, example)
    rd, radar = rda.channels, rda.channels.radar
    line = uniform_line(radar)
    if not isinstance(radar.waveform, Fmcw) or radar.adc.is_real or radar.multiplexing.is_coded or line is None:
        what = f"{type(radar.waveform).__name__}, {radar.multiplexing.kind}"
        raise ParameterRangeError("rda", what, "even linear ramps of I and Q, a uniform line of antennas")
    for name, number in (("oversampling", oversampling), ("reach", reach)):
        if number < 1:
            raise ParameterRangeError(name, number, ">= 1")
    weights = response_weights(radar, rd.window[0]), window_values(rd.window[1], radar.num_chirps)
    cells = [_offsets(len(row), oversampling, reach) for row in weights]
    sizes = radar.range_resolution, 2.0 * radar.unambiguous_velocity / radar.num_chirps
    distance, velocity = (cell * size for cell, size in zip(cells, sizes, strict=True))
    place = virtual_positions(radar)[line.order, 1] * radar.center_frequency / SPEED_OF_LIGHT
    spacing = float(np.diff(place).mean())  # wavelengths
    sine = _offsets(len(place), oversampling, reach) / (len(place) * spacing)
    sine = sine[np.abs(sine) <= 1.0]
    over_azimuth = np.exp(2j * np.pi * np.outer(sine, place)) @ window_values(angle_window, len(place))
    over_velocity = _transform(weights[1], cells[1])
    degrees = np.degrees(np.arcsin(sine))
    over_range = _transform(weights[0], cells[0])
    skew = coupling(seen_by(radar)) * radar.center_frequency / radar.waveform.sweep.slope
    spread = PointSpread.of_arrays(
        distance,
        over_range,
        (velocity, over_velocity),
        (degrees, over_azimuth),
        range_per_velocity=skew if rd.is_compensated else 0.0,
    )
    given: dict[str, object] = {
        "noise_power_dbm": float(watt_to_dbm(rda.noise_power)),
        "compensates_motion": rd.is_compensated,
        "range_period": radar.max_range,
        "sine_period": 1.0 / spacing,
        "period_phase_deg": (*(180.0 * ((len(row) - 1) % 2) for row in weights), 360.0 * place[0] / spacing % 360.0),
    }
    axes = MapAxes.of_arrays(rda.range, rda.radial_velocity, rda.azimuth)
    return ClosedRadarSpec(radar=radar, spread=spread, axes=axes, **{**given, **fields})


def _offsets(count: int, oversampling: int, reach: int) -> Array:
    """Return the offsets of a table [cells], 0 among them."""
    most = int(np.floor(min(reach, 0.5 * count) * oversampling))
    if 2 * most + 1 > MOST_OFFSETS:
        what = f"{2 * most + 1} values of a factor over {count}"
        raise ParameterRangeError("oversampling", oversampling, f"a factor of at most {MOST_OFFSETS} values", what)
    return np.arange(-most, most + 1) / oversampling


def _transform(weights: Array, offset: Array) -> Array:
    """Return the transform of weights about their middle at offsets [cells]."""
    position = (np.arange(len(weights)) - (len(weights) - 1) / 2.0) / len(weights)
    count = max(1, _AT_ONCE // len(weights))
    blocks = (offset[first : first + count] for first in range(0, len(offset), count))
    return np.concatenate([np.cos(2.0 * np.pi * np.outer(block, position)) @ weights for block in blocks])
