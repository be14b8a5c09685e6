"""A capture of a corner reflector, or of another point of known RCS, and what is known of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.prompt.describe import Described
from scarl_sionna.core.specs.radar.spec import RadarSpec

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class ReflectorCapture(Described):
    """Raw data of one reflector at rest, and what was surveyed.

    Attributes
    ----------
    adc : ndarray of complex, shape (num_rx, num_chirps_total, num_samples)
        Raw data [sqrt(W)], rows as :func:`scarl_sionna.synthesize` has them.
    position : ndarray of float64, shape (3,)
        Of the reflector in the radar's frame [m]: x boresight, y left, z up. Turn the radar, and the position turns.
    rcs_dbsm : float
        Radar cross-section as stated [dBsm].
    position_std : float
        Standard deviation of the survey along each axis [m], above 0.
    rcs_std_db : float
        Standard deviation of the RCS [dB].
    empty : ndarray of complex, shape (num_rx, any number of chirps times num_tx, num_samples), optional
        The same without the reflector [sqrt(W)]: subtracted, with walls and leakage in it.
    held_out : bool
        Not fitted; the fit is held against it.
    name : str
    """

    adc: npt.NDArray[np.complexfloating]
    position: Array
    rcs_dbsm: float
    position_std: float = 0.01
    rcs_std_db: float = 0.5
    empty: npt.NDArray[np.complexfloating] | None = None
    held_out: bool = False
    name: str = ""

    def check(self, radar: RadarSpec, label: str) -> None:
        """Raise if the capture is not one of a radar.

        Raises
        ------
        ParameterRangeError
            If the raw data has another shape than the radar's or fewer than two chirps, the reflector is no point in
            front of the radar, or a value is not finite.
        """
        shape = (radar.num_rx, radar.num_chirps_total, radar.num_samples)
        for name, data in (("adc", self.adc), ("empty", self.empty)):
            if data is None:
                continue
            rows = np.shape(data)[1] if np.ndim(data) == 3 else 0
            wanted = shape if name == "adc" else (shape[0], rows, shape[2])
            if np.shape(data) != wanted or rows % radar.num_tx or rows < 2 * radar.num_tx:
                allowed = f"shape {shape}, at least two chirps of each transmitter"
                raise ParameterRangeError(f"{label}.{name}", f"of shape {np.shape(data)}", allowed)
            if not np.isfinite(data).all():
                raise ParameterRangeError(f"{label}.{name}", "NaN or infinity", "finite samples")
        place = np.asarray(self.position, dtype=np.float64)
        if place.shape != (3,) or not np.isfinite(place).all() or place[0] <= 0.0:
            allowed = "x, y, z in the radar's frame, x > 0"
            raise ParameterRangeError(f"{label}.position", np.round(place, 4).tolist(), allowed)
        if np.linalg.norm(place) >= radar.max_range:
            far = f"{np.linalg.norm(place):.4g} m away"
            raise ParameterRangeError(f"{label}.position", far, f"within max_range = {radar.max_range:.4g} m")
        if not (np.isfinite(self.position_std) and self.position_std > 0.0):
            remedy = "state how well the place was surveyed"
            raise ParameterRangeError(f"{label}.position_std", f"{self.position_std} m", "above 0 m", remedy)
        if not (np.isfinite(self.rcs_dbsm) and np.isfinite(self.rcs_std_db) and self.rcs_std_db >= 0.0):
            raise ParameterRangeError(f"{label}.rcs_std_db", f"{self.rcs_std_db} dB", "finite, at least 0 dB")


def by_pair(adc: npt.NDArray[np.complexfloating], radar: RadarSpec) -> npt.NDArray[np.complex128]:
    """Return raw data as (num_chirps, num_tx, num_rx, num_samples), by definition of its rows."""
    split = np.asarray(adc, dtype=np.complex128).reshape(radar.num_rx, -1, radar.num_tx, radar.num_samples)
    return np.asarray(split.transpose(1, 2, 0, 3))


def mean_of(item: ReflectorCapture, radar: RadarSpec) -> npt.NDArray[np.complex128]:
    """Return the mean over chirps, the empty capture subtracted, shape (num_tx, num_rx, num_samples). By definition."""
    out = by_pair(item.adc, radar).mean(axis=0)
    return np.asarray(out if item.empty is None else out - by_pair(item.empty, radar).mean(axis=0))
