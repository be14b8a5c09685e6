"""From the ramps of a scanning radar to its image: power over azimuth and range, and the codes of 8 bits."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.scanning.spec import ScanningRadarSpec
from scarl_sionna.core.units import watt_to_dbm

from .noise import cell_noise_power
from .uneven import over_range
from .windows import window_values

HIGHEST_CODE = 255
BELOW_NOISE_DB = 10.0
"""The image's code 0 is so far below the mean noise, where the specification leaves it open: one cell of noise in ten
is cut off below it."""


def polar_power(beats: npt.NDArray[np.complexfloating], radar: ScanningRadarSpec) -> npt.NDArray[np.float32]:
    """Return the power over azimuth and range.

    Parameters
    ----------
    beats : ndarray of complex, shape (num_azimuths, num_samples)
        Beat signal of the ramp at every azimuth [sqrt(W)].
    radar : ScanningRadarSpec

    Returns
    -------
    ndarray of float32, shape (num_azimuths, num_cells)
        [W]; the window is divided by its sum, so that a point's peak is its received power.

    References
    ----------
    .. [1] A. G. Stove, "Linear FMCW radar techniques", IEE Proc. F 139(5), 1992.
    """
    bins = radar.waveform.num_samples * radar.cells_per_resolution
    taper = window_values(radar.window, radar.waveform.num_samples).astype(np.float32)
    out = np.empty((len(beats), radar.num_cells), dtype=np.float32)
    for up in (True, False):
        rows = np.flatnonzero(radar.is_up == up)
        if len(rows):
            spectrum = over_range(np.asarray(beats[rows] * taper, dtype=np.complex64), radar.ramp(up), bins)
            out[rows] = np.abs(spectrum[:, : radar.num_cells]) ** 2
    return out


def polar_noise_power(radar: ScanningRadarSpec) -> float:
    """Return the mean thermal noise power of a cell of the image [W].

    By definition, :func:`.noise.cell_noise_power` of one ramp.
    """
    return cell_noise_power(radar.ramp(), radar.window, "rect")


def image_floor_dbm(radar: ScanningRadarSpec) -> float:
    """Return the power of the image's code 0 [dBm]: what the specification says, or 10 dB below the mean noise.

    By definition.
    """
    if radar.image_floor_dbm is not None:
        return radar.image_floor_dbm
    return float(watt_to_dbm(polar_noise_power(radar))) - BELOW_NOISE_DB


def image_codes(power: npt.NDArray[np.floating], floor_dbm: float, step_db: float) -> tuple[npt.NDArray[np.uint8], int]:
    """Return powers [W] as codes of 8 bits, same shape, and how many cells were above the highest code.

    Code k stands for ``floor_dbm + k * step_db``, to the nearest step; below the floor 0, above the highest 255. By
    definition of the scale.
    """
    codes = np.rint((watt_to_dbm(power) - floor_dbm) / step_db)
    return np.clip(codes, 0, HIGHEST_CODE).astype(np.uint8), int(np.count_nonzero(codes > HIGHEST_CODE))
