"""Analogue-to-digital converter of a radar."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from scarl_sionna.core.spec import WithoutNone
from scarl_sionna.core.units import DecibelMilliwatts, Decibels, Unit

ResponsePoint = tuple[float, Decibels]
"""Share of the sample rate, and gain."""


class Adc(WithoutNone):
    """Converter of I and Q, or of I alone. The defaults are this project's: Table 1 of SCaRL gives none.

    Raises
    ------
    ParameterRangeError
        If the shares of `response` do not rise from 0 to below 1.
    """

    _quiet = ("sampling", "response")

    bits: int = Field(16, ge=2, le=16, description="bits of each of I and Q")
    full_scale_dbm: DecibelMilliwatts = Field(-30.0, description="input-referred power of a full-scale tone [dBm]")
    enob: float | None = Field(None, gt=0.0, le=16.0, description="effective bits with noise; None: those of `bits`")
    inl_lsb: Annotated[float, Unit("LSB")] | None = Field(
        None, ge=0.0, description="peak of a cubic nonlinearity, end-point fit [LSB]; None: none"
    )
    sampling: Literal["complex", "real"] = Field(
        "complex", description="real: one converter a receiver, of I; half as many range bins from as many samples"
    )

    response: tuple[ResponsePoint, ...] = Field(
        (),
        description="what its decimation leaves of the band, noise and echoes: share of the sample rate, 0 to 1, and "
        "gain [dB]; linear between, periodic; none: all of it",
    )

    @model_validator(mode="after")
    def _check(self) -> Adc:
        shares = [share for share, _ in self.response]
        if shares and (shares[0] < 0.0 or shares[-1] >= 1.0 or any(b <= a for a, b in pairwise(shares))):
            raise ValueError(f"response with shares that rise from 0 to below 1: {shares}")
        return self

    @property
    def is_real(self) -> bool:
        """Whether there is no Q."""
        return self.sampling == "real"

    @model_serializer(mode="wrap")
    def _without_none(self, inner: SerializerFunctionWrapHandler) -> dict[str, object]:
        """Leave out what is not given, and that I and Q are sampled, as files of the first versions have it."""
        quiet = () if self.is_real else ("sampling",)
        return {name: value for name, value in inner(self).items() if value not in (None, (), []) and name not in quiet}
