"""Analogue front end of a radar: power sent, noise received."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import DecibelMilliwatts, Decibels, Unit


class FrontEnd(Spec):
    """Link budget of every transmitter and receiver. The defaults are this project's: Table 1 of SCaRL gives none.

    Amplitudes are referred to the receiver's input: the beat signal is in sqrt(W), so abs(sample)**2 is received power.
    """

    tx_power_dbm: DecibelMilliwatts = Field(12.0, description="of each transmitter [dBm]")
    noise_figure_db: Decibels = Field(12.0, ge=0.0, description="[dB]")
    source_temperature: Annotated[float, Unit("K")] = Field(
        290.0, ge=0.0, description="noise temperature at the antenna [K]"
    )
