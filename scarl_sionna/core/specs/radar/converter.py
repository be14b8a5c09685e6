"""Analogue-to-digital converter of a radar."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from scarl_sionna.core.spec import WithoutNone
from scarl_sionna.core.units import DecibelMilliwatts, Unit


class Adc(WithoutNone):
    """Converter of I and Q. The defaults are this project's: Table 1 of SCaRL gives none."""

    bits: int = Field(16, ge=2, le=16, description="bits of each of I and Q")
    full_scale_dbm: DecibelMilliwatts = Field(-30.0, description="input-referred power of a full-scale tone [dBm]")
    enob: float | None = Field(None, gt=0.0, le=16.0, description="effective bits with noise; None: those of `bits`")
    inl_lsb: Annotated[float, Unit("LSB")] | None = Field(
        None, ge=0.0, description="peak of a cubic nonlinearity, end-point fit [LSB]; None: none"
    )
