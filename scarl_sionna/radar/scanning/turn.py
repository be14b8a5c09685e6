"""From the beat signals of a turn to its image; and the turn of paths that are known for its start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.prompt.arguments import expect, expect_generator
from scarl_sionna.core.scans.radar import RadarScan
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.scanning.spec import ScanningRadarSpec
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.synthesis.blocks import straight_on
from scarl_sionna.signal.noise import add_noise
from scarl_sionna.signal.polar import image_codes, image_floor_dbm, polar_power

from .beats import Block, block_beats

Array = npt.NDArray[np.float64]


def scan_paths(
    paths: RadarPaths,
    radar: ScanningRadarSpec,
    rng: np.random.Generator | None = None,
    settings: RadarSettings | None = None,
) -> RadarScan:
    """Return the image of a turn of paths that are known for its start, as :func:`scarl_sionna.point_targets` gives.

    Parameters
    ----------
    paths : RadarPaths
        In the sensor frame (x forward, y left, z up) at the turn's start, of all directions. Everything moves straight
        on from there; the sensor turns about its own origin.
    radar : ScanningRadarSpec
    rng : numpy.random.Generator, optional
        Adds the receiver's thermal noise; left out: none.
    settings : RadarSettings, optional
        Its `scanning` without `num_blocks`, and of its `accuracy` the tolerance of the synthesis.

    Returns
    -------
    RadarScan

    Raises
    ------
    InputTypeError
        If an argument has another type.
    ParameterRangeError
        If the paths are of a separate receiver.

    Examples
    --------
    >>> radar = ScanningRadarSpec.preset("cts350x")
    >>> paths = point_targets([[50.0, 10.0, 0.0]], [[0.0, 0.0, 0.0]], 10.0, radar.ramp(), Pose())
    >>> scan = scan_paths(paths, radar)
    """
    expect("paths", paths, RadarPaths, "give ss.point_targets(..., radar.ramp(), pose), or ss.solve_paths(...)")
    expect("radar", radar, ScanningRadarSpec, "for instance ss.ScanningRadarSpec.preset('cts350x')")
    expect_generator(rng, needed=False)
    settings = settings or RadarSettings()
    start = Mount(paths.world_from_tx, paths.tx_twist)
    if not np.allclose(paths.world_from_tx.matrix, paths.world_from_rx.matrix, rtol=0.0, atol=1e-9):
        raise ParameterRangeError("paths", "of a separate receiver", "of one radar that sends and receives")
    block = Block(paths, 0.0, 0.0, np.arange(radar.num_azimuths))
    beats = block_beats(block, radar, settings.scanning, settings.accuracy)
    places = [straight_on(start, float(after)) for after in radar.time]
    return image_of(beats, radar, (start, places), rng, settings, (paths.num_paths, paths.diagnostics))


def image_of(
    beats: npt.NDArray[np.complexfloating],
    radar: ScanningRadarSpec,
    motion: tuple[Mount, Sequence[Mount]],
    rng: np.random.Generator | None,
    settings: RadarSettings,
    solved: tuple[int, Mapping[str, Any]],
) -> RadarScan:
    """Return the image of a turn's beat signals.

    Parameters
    ----------
    beats : ndarray of complex, shape (num_azimuths, num_samples)
        [sqrt(W)]
    radar : ScanningRadarSpec
    motion : tuple of Mount and sequence of Mount
        Of the sensor at the turn's start and at every azimuth.
    rng : numpy.random.Generator or None
        Of the thermal noise; None: none.
    settings : RadarSettings
    solved : tuple of int and mapping
        How many paths there are, and what the solver says of them.

    References
    ----------
    .. [1] A. G. Stove, "Linear FMCW radar techniques", IEE Proc. F 139(5), 1992.
    """
    start, places = motion
    power, floor = polar_power(add_noise(beats, radar.ramp(), rng), radar), image_floor_dbm(radar)
    image, num_saturated = image_codes(power, floor, radar.image_step_db)
    return RadarScan(
        spec=radar,
        world_from_sensor=start.pose,
        azimuth=radar.azimuth,
        time=radar.time,
        azimuth_pose=np.array([[*place.pose.position, *place.pose.quaternion] for place in places]),
        azimuth_twist=np.array([[*place.twist.linear, *place.twist.angular] for place in places]),
        image=image,
        floor_dbm=floor,
        num_saturated=num_saturated,
        power=power if settings.scanning.keep_power else None,
        num_paths=solved[0],
        diagnostics=solved[1],
    )
