"""Sheets, prisms and beads that send light back to its lamp: how it fades with the angle between lamp and camera."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import ModuleType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.joined import PartPlace
from scarl_sionna.engine.types import DeviceArray
from scarl_sionna.scene.tables import PartTable

SHEET_EXPONENT, SHEET_SCALE = 0.88, 0.409
"""Of the law of sheets: the stretched exponential through 250, 180 and 5 cd/(lx m2) at 0.2, 0.33 and 2 deg (EN 12899-1,
class RA2, white, 5 deg of incidence), within 1 %."""
SHEET_ANGLE_DEG = 0.2
"""Between lamp and eye, at which R_A is stated."""
BEADS_ANGLE_DEG = 1.05
"""The same for the R_L of markings (EN 1436)."""
BEADS_WIDTH_DEG = 5.0
"""Within which beads send light back, an estimate: what is measured at 1.05 deg holds nearly as far as a car's lamps
reach."""
WHITE_SHEET = 0.8
"""Albedo of a white sheet in our textures; other colours send back as much less as they are darker."""


class Retroreflectors(NamedTuple):
    """What sends light back, by shape id: R_A at normal incidence and R_L [cd/(lx m2)]."""

    sheets: dict[str, float]
    beads: dict[str, float]

    @classmethod
    def of(cls, parts: PartTable) -> Retroreflectors:
        """Return those of a world's parts."""
        return cls(
            *(
                {name: float(value) for name, value in zip(parts.name, column, strict=True) if value > 0.0}
                for column in (parts.retroreflection, parts.retroreflected_luminance)
            )
        )

    def columns(self, places: Mapping[str, PartPlace]) -> tuple[npt.NDArray[np.float32], ...]:
        """Return both coefficients by the number of a mesh in the engine, each of float32, shape (highest + 1,).

        A mesh has parts of one material.
        """
        columns = []
        for table in self:
            column = np.zeros(max((place.number for place in places.values()), default=0) + 1, dtype=np.float32)
            for name, value in table.items():
                column[places[name].number] = value
            columns.append(column)
        return tuple(columns)


def sheet_law(mi: ModuleType, angle_deg: DeviceArray) -> DeviceArray:
    """Return R_A over that at 0.2 deg for an angle between lamp and eye [deg]."""
    import drjit as dr

    def exponent(angle: DeviceArray) -> DeviceArray:
        return dr.power(dr.maximum(angle, 1e-4), SHEET_EXPONENT) / SHEET_SCALE

    return dr.exp(exponent(mi.Float(SHEET_ANGLE_DEG)) - exponent(angle_deg))


def beads_law(mi: ModuleType, angle_deg: DeviceArray) -> DeviceArray:
    """Return R_L over that at 1.05 deg for an angle between lamp and eye [deg]."""
    import drjit as dr

    return dr.exp((BEADS_ANGLE_DEG**2 - dr.square(mi.Float(angle_deg))) / BEADS_WIDTH_DEG**2)


def observation_angle(mi: ModuleType, to_lamp: DeviceArray, to_eye: DeviceArray) -> DeviceArray:
    """Return the angle between two unit vectors [deg], exact for small ones in single precision, too."""
    import drjit as dr

    return mi.Float(math.degrees(2.0)) * dr.asin(dr.minimum(0.5 * dr.norm(to_lamp - to_eye), 1.0))
