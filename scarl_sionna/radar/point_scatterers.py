"""Ideal isotropic point scatterers, as plain data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, PlacementError

POINT_INTERACTION = 0
"""Kind of interaction written for a point target."""
MIN_DISTANCE = 1e-6
"""A target nearer than this to the radar's origin has no direction [m]."""


@dataclass(frozen=True, eq=False)
class PointScatterers:
    """Ideal isotropic point scatterers.

    Parameters
    ----------
    positions : array_like of float, shape (num_points, 3)
        At the start of the frame [m, world].
    velocities : array_like of float, shape (num_points, 3)
        Constant over the frame [m/s, world].
    rcs : array_like of float, shape (num_points,)
        Radar cross-section [m2], >= 0, the same for V and H; nothing is cross-polarised. A scalar holds for all.
    instance : array_like of int, shape (num_points,), optional
        Instance ids, for points that belong to an instance of a scene; if left out, the index + 1 in free space and new
        ids behind the scene's own in a scene.

    Raises
    ------
    ParameterRangeError
        If a shape is wrong, a value is not finite or an RCS is negative.
    """

    positions: npt.NDArray[np.float64]
    velocities: npt.NDArray[np.float64]
    rcs: npt.NDArray[np.float64]
    instance: npt.NDArray[np.int32] | None = None

    def __post_init__(self) -> None:
        points, motion = _rows(self.positions, "positions"), _rows(self.velocities, "velocities")
        if len(points) != len(motion):
            raise ParameterRangeError("velocities", f"{len(motion)} rows", f"{len(points)} rows, one for each position")
        try:
            sigma = np.broadcast_to(np.asarray(self.rcs, dtype=np.float64), (len(points),))
        except ValueError:
            shape = f"a scalar or shape ({len(points)},)"
            raise ParameterRangeError("rcs", f"shape {np.shape(self.rcs)}", shape) from None
        if not (np.isfinite(sigma).all() and (sigma >= 0).all()):
            raise ParameterRangeError(
                "rcs", f"{np.min(sigma)} m2", "finite and >= 0 m2", "give square metres, not dBsm"
            )
        if self.instance is not None:
            label = np.asarray(self.instance)
            if label.shape != (len(points),):
                raise ParameterRangeError("instance", f"shape {label.shape}", f"shape ({len(points)},)")
            object.__setattr__(self, "instance", label.astype(np.int32))
        for name, value in (("positions", points), ("velocities", motion), ("rcs", sigma)):
            object.__setattr__(self, name, value)

    def require_apart(self, origin: npt.ArrayLike) -> None:
        """Raise :class:`PlacementError` if a point stands at a radar's origin [m, world]."""
        distance = np.linalg.norm(self.positions - np.asarray(origin), axis=1)
        if len(distance) and distance.min() < MIN_DISTANCE:
            index = int(distance.argmin())
            raise PlacementError(
                f"target {index} stands at the radar's origin ({self.positions[index]} m); "
                f"move it at least {MIN_DISTANCE} m away"
            )


def _rows(values: npt.ArrayLike, name: str) -> npt.NDArray[np.float64]:
    """Return finite rows of three, or raise."""
    try:
        rows = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ParameterRangeError(name, repr(values)[:60], "numbers of shape (num_targets, 3)") from None
    if rows.size == 0:
        return np.zeros((0, 3))
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise ParameterRangeError(
            name, f"shape {rows.shape}", "shape (num_targets, 3)", "wrap a single target in a list"
        )
    if not np.isfinite(rows).all():
        raise ParameterRangeError(name, "NaN or infinity", "finite numbers")
    return rows
