"""Analogue front end of a radar: power sent, noise received."""

from __future__ import annotations

from pydantic import Field

from scarl_sionna.core.spec import Spec


class FrontEnd(Spec):
    """Link budget of every transmitter and receiver. The defaults are this project's: Table 1 of SCaRL gives none.

    Amplitudes are referred to the receiver's input: the beat signal is in sqrt(W), so abs(sample)**2 is received power.
    """

    tx_power_dbm: float = Field(12.0, description="of each transmitter [dBm]")
    noise_figure_db: float = Field(12.0, ge=0.0, description="[dB]")
    source_temperature: float = Field(290.0, ge=0.0, description="noise temperature at the antenna [K]")
