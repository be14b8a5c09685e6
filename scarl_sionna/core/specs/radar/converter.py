"""Analogue-to-digital converter of a radar."""

from __future__ import annotations

from pydantic import Field

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import DecibelMilliwatts


class Adc(Spec):
    """Converter of I and Q. The defaults are this project's: Table 1 of SCaRL gives none."""

    bits: int = Field(16, ge=2, le=16, description="bits of each of I and Q")
    full_scale_dbm: DecibelMilliwatts = Field(-30.0, description="input-referred power of a full-scale tone [dBm]")
