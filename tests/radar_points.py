"""Radar points at planned places, as a detector would report them."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import numpy.typing as npt

from scarl_sionna.signal.detection import RadarPoints


def planted(xy: npt.ArrayLike, radial_velocity: npt.ArrayLike, power: npt.ArrayLike | None = None) -> RadarPoints:
    """Return points in the plane of the radar, of no map; powers of 1 W where none are given."""
    place = np.column_stack([np.asarray(xy, dtype=np.float64), np.zeros(len(np.asarray(xy)))])
    count = len(place)
    level = np.ones(count) if power is None else np.asarray(power, dtype=np.float64)
    known = {
        "position": place,
        "range": np.linalg.norm(place, axis=1),
        "azimuth": np.arctan2(place[:, 1], place[:, 0]),
        "radial_velocity": np.asarray(radial_velocity, dtype=np.float64),
        "power": level,
        "rcs": level,
        "velocity_interval": None,
    }
    return RadarPoints(**{item.name: known.get(item.name, np.zeros(count)) for item in fields(RadarPoints)})
