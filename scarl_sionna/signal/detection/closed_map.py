"""The map of a radar without raw data with its axes in units."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.prompt.arguments import expect
from scarl_sionna.core.results import ClosedRadarFrame
from scarl_sionna.core.specs.radar.closed.device import ClosedRadarSpec

from ..angle import RangeDopplerAngle


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
