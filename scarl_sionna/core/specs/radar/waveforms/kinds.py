"""Stepped ramps, and the waveforms that a radar can have, told apart by `kind`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from scarl_sionna.core.specs.radar.waveform import Fmcw

from .coded import Ofdm, Pmcw
from .phase_coded import PcFmcw


class SteppedFmcw(Fmcw):
    """Bursts of ramps with rising carriers, which the receiver puts together to one wide band.

    Each of a burst's `num_steps` ramps is `frequency_step` above the one before; a burst is one sample of slow time. A
    range bin is as narrow as the whole band makes it, and range is unambiguous as for a single ramp, at the cost of a
    velocity that is unambiguous over as much less. Ramps that fall have falling carriers.

    Raises
    ------
    ParameterRangeError
        As for :class:`Fmcw`; or if bursts are not whole, or carriers are given otherwise.

    References
    ----------
    .. [1] M. A. Richards, *Fundamentals of Radar Signal Processing*, 2nd ed., 2014, chapter 4 (stepped frequency).
    """

    kind: Literal["stepped_fmcw"] = "stepped_fmcw"  # type: ignore[assignment]
    num_steps: int = Field(4, ge=2, description="ramps of a burst; num_chirps counts those of all bursts")

    @model_validator(mode="after")
    def _check_bursts(self) -> SteppedFmcw:
        if self.num_chirps % self.num_steps:
            raise ValueError(f"num_chirps: a multiple of num_steps = {self.num_steps}; it is {self.num_chirps}")
        if self.frequency_offsets is not None or self.chirp_delays is not None:
            raise ValueError("frequency_offsets, chirp_offsets and chirp_jitter are of plain ramps: kind = 'fmcw'")
        if not 0.0 <= self.frequency_step <= self.ramp_bandwidth * (1 + 1e-9):
            raise ValueError(
                f"frequency_step: 0, or up to what is sampled of a ramp, {self.ramp_bandwidth / 1e6:g} MHz: wider "
                f"steps leave gaps; it is {self.frequency_step / 1e6:g} MHz"
            )
        return self

    @property
    def ramp_bandwidth(self) -> float:
        """Bandwidth that the samples of one ramp cover [Hz]."""
        return super().sampled_bandwidth

    @property
    def step(self) -> float:
        """From carrier to carrier of a burst [Hz], negative for falling ramps; as wide as a ramp if not given."""
        return math.copysign(self.frequency_step or self.ramp_bandwidth, self.chirp_slope)

    @property
    def _offsets(self) -> tuple[float, ...]:
        return tuple((self.step * (np.arange(self.num_chirps) % self.num_steps)).tolist())

    @property
    def burst(self) -> int:
        """Ramps of a burst."""
        return self.num_steps

    @property
    def num_range_bins(self) -> int:
        """Range bins without zero padding: as many as the whole band has of a ramp's sampling intervals."""
        spacing = self.ramp_bandwidth / self.num_samples
        return self.num_samples + math.ceil((self.num_steps - 1) * abs(self.step) / spacing - 1e-6)

    @property
    def sampled_bandwidth(self) -> float:
        """Bandwidth that the samples of a burst cover [Hz]."""
        return self.ramp_bandwidth / self.num_samples * self.num_range_bins

    def chirps(self, first: int, count: int) -> Fmcw:
        """Return ramps with the carriers of some of its chirps."""
        own = {name: getattr(self, name) for name in self.model_fields_set - {"kind", "num_steps", "frequency_step"}}
        offsets = self._offsets[first : first + count]
        return Fmcw(**{**own, "num_chirps": count, "frequency_offsets": offsets})


def _ramps_by_default(value: object) -> object:
    """Return the fields of a waveform; those without a kind are of ramps."""
    return {"kind": "fmcw", **value} if isinstance(value, Mapping) else value


AnyWaveform = Annotated[
    Fmcw | SteppedFmcw | PcFmcw | Ofdm | Pmcw, Field(discriminator="kind"), BeforeValidator(_ramps_by_default)
]
"""The waveforms that a radar can have, told apart by `kind`; without one it is ``"fmcw"``."""
