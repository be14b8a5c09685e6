"""One antenna of an array: its pattern, how it is turned, and how it is polarised."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Decibels, Degrees

from ..pattern import AntennaPattern

Polarization = Literal["V", "H", "+45", "-45", "RHC", "LHC"]

_HALF = np.sqrt(0.5)
COMPONENTS: dict[str, tuple[complex, complex]] = {
    "V": (1.0, 0.0),
    "H": (0.0, 1.0),
    "+45": (_HALF, _HALF),
    "-45": (_HALF, -_HALF),
    "RHC": (_HALF, -1j * _HALF),
    "LHC": (_HALF, 1j * _HALF),
}
"""V and H parts of the field that an antenna sends, time dependence e^{+j 2 pi f t} (IEEE's sense of circular)."""
CROSSED = {"V": "H", "H": "V", "+45": "-45", "-45": "+45", "RHC": "LHC", "LHC": "RHC"}
"""What is cross-polar to each polarisation."""


class AntennaElement(Spec):
    """One antenna of an array.

    Its own frame has x along its boresight, y left and z up: `boresight_azimuth_deg` and `boresight_elevation_deg` say
    where x points in the radar frame, `roll_deg` turns the antenna about x (y towards z: clockwise seen from behind).
    Pattern and polarisation are of that frame. V is along theta-hat (against z at boresight), H along phi-hat (y at
    boresight); the others are made of both.

    Raises
    ------
    ParameterRangeError
        If there are both a cross-polar level and a cross-polar pattern.
    """

    pattern: AntennaPattern | None = Field(None, description="co-polar gain; None: that of the array")
    polarization: Polarization | None = Field(None, description="in the antenna's frame; None: that of the array")
    boresight_azimuth_deg: Degrees = Field(0.0, ge=-180.0, le=180.0, description="left positive [deg]")
    boresight_elevation_deg: Degrees = Field(0.0, ge=-90.0, le=90.0, description="up positive [deg]")
    roll_deg: Degrees = Field(0.0, ge=-360.0, le=360.0, description="about the boresight, y towards z [deg]")
    basis: Literal["spherical", "ludwig3"] = Field(
        "spherical",
        description="directions of V and H off boresight: theta-hat and phi-hat of the antenna's z (a dipole's), or "
        "Ludwig's third definition (as measured, of a patch or horn)",
    )
    cross_polar_db: Decibels | None = Field(
        None, le=0.0, description="cross-polar over co-polar level in every direction [dB]; None: none"
    )
    cross_polar_pattern: AntennaPattern | None = Field(None, description="cross-polar gain by direction; None: none")
    cross_polar_phase_deg: Degrees = Field(0.0, description="of the cross-polar field beyond the co-polar [deg]")

    @model_validator(mode="after")
    def _check(self) -> AntennaElement:
        if self.cross_polar_db is not None and self.cross_polar_pattern is not None:
            raise ValueError("cross_polar_db or cross_polar_pattern, not both")
        return self

    @property
    def is_slanted(self) -> bool:
        """Whether the field of an antenna of V or H has parts along both in the radar frame, in some direction."""
        turned = self.roll_deg != 0.0 or self.boresight_elevation_deg != 0.0 or self.basis != "spherical"
        return turned or self.cross_polar_db is not None or self.cross_polar_pattern is not None

    @property
    def radar_from_antenna(self) -> npt.NDArray[np.float64]:
        """Rotation from the antenna's frame to the radar's, shape (3, 3): azimuth about z, elevation, roll about x."""
        azimuth, elevation, roll = np.radians([self.boresight_azimuth_deg, self.boresight_elevation_deg, self.roll_deg])
        (ca, ce, cr), (sa, se, sr) = np.cos([azimuth, elevation, roll]), np.sin([azimuth, elevation, roll])
        turn = np.array([[ca, -sa, 0.0], [sa, ca, 0.0], [0.0, 0.0, 1.0]])
        lift = np.array([[ce, 0.0, -se], [0.0, 1.0, 0.0], [se, 0.0, ce]])
        return np.asarray(turn @ lift @ np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]]))
