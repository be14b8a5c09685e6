"""What of a device is fitted, and what is known of it beforehand."""

from __future__ import annotations

from pydantic import Field

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Decibels, Metres


class DeviceFitSettings(Spec):
    """What :func:`fit_device` fits, and what is known beforehand, as standard deviations.

    Raises
    ------
    ParameterRangeError
        If a value is outside its range.
    """

    antenna_std: Metres = Field(
        0.0, ge=0.0, description="of each antenna's y and z about its stated place [m]; 0: places are not fitted"
    )
    coupling_std: float = Field(
        0.0,
        ge=0.0,
        le=1.0,
        description="of the real and the imaginary part of what couples from one antenna into another, over what "
        "reaches that one directly; 0: coupling is not fitted",
    )
    pattern_std_db: Decibels = Field(
        0.5, ge=0.0, description="of the stated two-way pattern in a capture's direction [dB]"
    )
    mixer: bool = Field(True, description="whether imbalance of I and Q is fitted")
    leakage: bool = Field(True, description="whether a way within the sensor is looked for")
    dc_offset: bool = Field(True, description="whether a constant at the converter is fitted")
    max_range_bias: Metres = Field(1.0, gt=0.0, le=20.0, description="largest range bias that is looked for [m]")
    max_leakage_length: Metres = Field(1.0, gt=0.0, le=20.0, description="longest leakage, there and back [m]")
    max_evaluations: int = Field(200, ge=1, le=1000, description="evaluations of the search")
