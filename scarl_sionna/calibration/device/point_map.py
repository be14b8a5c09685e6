"""A map of a reflector as a closed radar gives it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.prompt.describe import Described
from scarl_sionna.signal.angle import RangeDopplerAngle

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class PointMap(Described, units={"range": "m", "radial_velocity": "m/s", "azimuth": "rad"}):
    """A map with one reflector in it.

    Attributes
    ----------
    data : ndarray of float or complex, shape (num_velocity, num_range, num_azimuth)
        Powers, or complex amplitudes, in any unit; an axis that the device does not have has one cell.
    range, radial_velocity, azimuth : ndarray of float64, shape (num_cells,)
        Of the cells, rising [m], [m/s], [rad].
    azimuth_scale : {"sine", "angle"}
        What the response has one width in: the sine of azimuth, or azimuth.
    name : str
    """

    data: npt.NDArray[Any]
    range: Array
    radial_velocity: Array
    azimuth: Array
    azimuth_scale: Literal["sine", "angle"] = "sine"
    name: str = ""

    @classmethod
    def of(cls, rda: RangeDopplerAngle, name: str = "") -> PointMap:
        """Return the map of powers of a recording, as :class:`~scarl_sionna.MapCapture` has them.

        Raises
        ------
        ParameterRangeError
            If it has elevations.
        """
        if rda.data.ndim != 3:
            raise ParameterRangeError("rda", "a map with elevations", "one over velocity, range and azimuth")
        return cls(rda.data.astype(np.float64), rda.range, rda.radial_velocity, rda.azimuth, name=name)

    def check(self, other: PointMap, label: str) -> None:
        """Raise if this is no map, or not one of the device of another.

        Raises
        ------
        ParameterRangeError
            If the shape is not that of the axes, an axis does not rise or differs from the other's in its step, a value
            is not finite or a power negative, or one is of powers and the other of amplitudes.
        """
        shape = (len(self.radial_velocity), len(self.range), len(self.azimuth))
        if np.shape(self.data) != shape:
            raise ParameterRangeError(f"{label}.data", f"of shape {np.shape(self.data)}", f"{shape}, that of the axes")
        if not np.isfinite(self.data).all():
            raise ParameterRangeError(f"{label}.data", "NaN or infinity", "finite values")
        if not np.iscomplexobj(self.data) and (self.data < 0.0).any():
            raise ParameterRangeError(f"{label}.data", float(self.data.min()), "powers, at least 0", "is it in dB?")
        if np.iscomplexobj(self.data) != np.iscomplexobj(other.data):
            raise ParameterRangeError(f"{label}.data", self.data.dtype, f"{other.data.dtype}, as the first has it")
        if self.axes != other.axes or self.azimuth_scale != other.azimuth_scale:
            raise ParameterRangeError(f"{label}", f"a map over {', '.join(self.axes)}", ", ".join(other.axes))
        if not self.axes:
            raise ParameterRangeError(f"{label}.data", "one cell", "a map")
        for name, cells, first in zip(self.axes, self.cells, other.cells, strict=True):
            steps = np.diff(cells)
            if len(cells) < 5 or not np.isfinite(cells).all() or not (steps > 0.0).all():
                raise ParameterRangeError(
                    f"{label}: axis of {name}", f"{len(cells)} cells", "at least 5, rising, finite"
                )
            if abs(np.median(steps) / np.median(np.diff(first)) - 1.0) > 1e-3:
                step = f"cells {np.median(steps):.4g} apart"
                raise ParameterRangeError(
                    f"{label}: axis of {name}", step, f"{np.median(np.diff(first)):.4g}, as the first"
                )

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes that the device has, in the order of a point spread."""
        rows = (("range", self.range), ("velocity", self.radial_velocity), ("azimuth", self.azimuth))
        return tuple(name for name, row in rows if len(row) > 1)

    @property
    def cells(self) -> tuple[Array, ...]:
        """Places of the cells along the axes that the device has, azimuth in its scale."""
        sine = np.sin(self.azimuth) if self.azimuth_scale == "sine" else np.asarray(self.azimuth)
        rows = (np.asarray(self.range), np.asarray(self.radial_velocity), sine)
        return tuple(row for row in rows if len(row) > 1)

    @cached_property
    def values(self) -> npt.NDArray[Any]:
        """The map with its axes in the order of a point spread, without those of one cell."""
        turned = np.transpose(self.data, (1, 0, 2))
        return np.asarray(turned.reshape([count for count in turned.shape if count > 1]))

    @property
    def power(self) -> Array:
        """Powers of the cells, the shape of `values`."""
        return np.asarray(np.abs(self.values) ** (2 if np.iscomplexobj(self.data) else 1), dtype=np.float64)
