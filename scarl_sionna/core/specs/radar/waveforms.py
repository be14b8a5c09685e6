"""The waveforms that a radar can have, told apart by `kind`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import BeforeValidator, Field

from .coded import Ofdm, Pmcw
from .waveform import Fmcw


def _ramps_by_default(value: object) -> object:
    """Return the fields of a waveform; those without a kind are of ramps."""
    return {"kind": "fmcw", **value} if isinstance(value, Mapping) else value


AnyWaveform = Annotated[Fmcw | Ofdm | Pmcw, Field(discriminator="kind"), BeforeValidator(_ramps_by_default)]
"""The waveforms that a radar can have, told apart by `kind`; without one it is ``"fmcw"``."""
