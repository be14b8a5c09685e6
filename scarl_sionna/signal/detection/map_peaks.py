"""Maps that have powers alone, as devices without raw data report them: their axes, and the local maxima as points."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.prompt.arguments import expect
from scarl_sionna.core.results import ClosedRadarFrame
from scarl_sionna.core.specs.radar.closed.device import ClosedRadarSpec
from scarl_sionna.core.units import power_to_db

from ..angle import RangeDopplerAngle, directions
from ..peaks import parabola_offset
from .beams import is_peak
from .cross_section import cross_section
from .points import RadarPoints

Array = npt.NDArray[np.float64]


def with_axes(power: npt.NDArray[np.float32], device: ClosedRadarSpec) -> RangeDopplerAngle:
    """Return the powers of a device's cells (num_velocity, num_range, num_azimuth) as a map, by definition of its axes.

    Powers are in the device's unit, [W] times its gain, and so is the noise.
    """
    axes = device.axes
    return RangeDopplerAngle(
        data=power,
        range=np.array(axes.range),
        radial_velocity=np.array(axes.radial_velocity),
        azimuth=np.radians(axes.azimuth_deg),
        elevation=None,
        radar=device.radar,
        range_doppler=None,
        noise_power=device.noise_power * device.gain,
    )


def map_of_frame(frame: ClosedRadarFrame) -> RangeDopplerAngle:
    """Return the map of a frame of a radar without raw data, of powers alone, in the device's unit [W times its gain].

    By definition of its axes.

    Raises
    ------
    InputTypeError
        If it is no such frame (of a stored one: ``to_result()``).
    """
    expect("frame", frame, ClosedRadarFrame, "give frame.closed_radars[name]; of a stored radar: to_result()")
    return with_axes(frame.power, frame.spec)


def peaks_of_map(
    rda: RangeDopplerAngle, threshold_db: float = 13.0, gain_db: float = 0.0, noise_power: float | None = None
) -> RadarPoints:
    """Return the local maxima of a map that are above a threshold over its noise.

    Parameters
    ----------
    rda : RangeDopplerAngle
        Over velocity, range and azimuth, without elevation; channels are not needed. Velocity is taken for periodic.
    threshold_db : float
        Over the mean noise of a cell [dB], above 0.
    gain_db : float
        Map at a point's peak over the power received from it [dB].
    noise_power : float, optional
        Mean noise of a cell in the map's unit; left out: ``rda.noise_power``.

    Returns
    -------
    RadarPoints
        Places between the cells by a parabola through the decibels of three cells along each axis, powers of the
        highest cell.

    Raises
    ------
    ParameterRangeError
        If the threshold is not above 0 dB, no noise is known, or the map has elevations.

    References
    ----------
    .. [1] M. A. Richards, *Fundamentals of Radar Signal Processing*, 2nd ed., 2014, ch. 6.
    """
    expect("rda", rda, RangeDopplerAngle, "give ss.map_of_paths(paths, device), or a map of ss.read_capture(...)")
    noise = rda.noise_power if noise_power is None else noise_power
    if not threshold_db > 0.0:
        raise ParameterRangeError("threshold_db", f"{threshold_db} dB", "above 0 dB")
    if not noise > 0.0:
        raise ParameterRangeError("noise_power", noise, "above 0", "state the noise of a cell")
    if rda.data.ndim != 3:
        raise ParameterRangeError("rda", "a map with elevations", "one over velocity, range and azimuth")
    above = (rda.data > noise * 10.0 ** (threshold_db / 10.0)) & is_peak(rda.data, range(3))
    cell = np.nonzero(above)
    power = rda.data[cell].astype(np.float64)
    places = [
        _place(rda, axis, cell, along)
        for axis, along in enumerate((rda.radial_velocity, rda.range, np.sin(rda.azimuth)))
    ]
    azimuth = np.arcsin(np.clip(places[2], -1.0, 1.0))
    unit = directions(azimuth, np.zeros(len(azimuth)))
    received, distance = power / 10.0 ** (gain_db / 10.0), np.maximum(places[1], 0.0)
    sines = np.stack([places[2], np.zeros(len(azimuth))], axis=1)
    table = {
        "position": unit * distance[:, None],
        "range": distance,
        "azimuth": azimuth,
        "elevation": np.zeros(len(azimuth)),
        "radial_velocity": places[0],
        "power": received,
        "snr_db": power_to_db(power / noise),
        "rcs": cross_section(rda.radar, sines, distance, received),
        "cell": cell[0] * len(rda.range) + cell[1],
    }
    order = np.argsort(-received, kind="stable")
    return RadarPoints(**{name: values[order] for name, values in table.items()})


def _place(rda: RangeDopplerAngle, axis: int, cell: tuple[npt.NDArray[np.intp], ...], along: Array) -> Array:
    """Return where maxima lie on an axis, between its cells; at an end of range or azimuth the cell's own place."""
    count, own = len(along), cell[axis]
    if count < 3:
        return np.asarray(along[own], dtype=np.float64)
    periodic = axis == 0
    sides = []
    for side in (-1, 1):
        beside = (own + side) % count if periodic else np.clip(own + side, 0, count - 1)
        sides.append(power_to_db(rda.data[tuple(beside if k == axis else one for k, one in enumerate(cell))]))
    offset = parabola_offset(sides[0], power_to_db(rda.data[cell]), sides[1])
    if not periodic:
        offset[(own == 0) | (own == count - 1)] = 0.0
    where = own + offset
    step = float(along[1] - along[0]) if periodic else 0.0
    out = np.interp(where, np.arange(count), along)
    out = np.where(where < 0.0, along[0] + where * step, out)
    return np.asarray(np.where(where > count - 1, along[-1] + (where - count + 1) * step, out))
