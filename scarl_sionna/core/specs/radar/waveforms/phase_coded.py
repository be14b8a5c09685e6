"""Ramps with a phase code on them, from chirp to chirp or within each."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from scarl_sionna.core.specs.radar.waveform import Fmcw
from scarl_sionna.core.units import Degrees

from .codes import chips_of

Complex = npt.NDArray[np.complex128]


class PcFmcw(Fmcw):
    """Phase-coded FMCW: ramps whose phase follows a code, mixed with the ramp without it.

    ``coding="across"`` gives each chirp a chip. ``coding="within"`` sends the whole code in every ramp, in the band of
    its chips (ideal Nyquist pulses, periodic over the ramp); the receiver aligns the codes of all echoes by a filter
    whose group delay falls with the beat frequency, and takes the code off.

    Raises
    ------
    ParameterRangeError
        As for :class:`Fmcw`; or if there is no such code of that length, or its band exceeds that of the samples.

    References
    ----------
    .. [1] U. Kumbul, N. Petrov, C. S. Vaucher, A. Yarovoy, "Phase-coded FMCW for coherent MIMO radar", IEEE Trans.
       Microw. Theory Techn. 71(6), 2023.
    """

    kind: Literal["pc_fmcw"] = "pc_fmcw"  # type: ignore[assignment]
    coding: Literal["across", "within"] = Field("within", description="a chip a chirp, or the whole code in each ramp")
    code: Literal["m_sequence", "apas", "gold", "zadoff_chu", "own"] = Field(
        "m_sequence", description="phases of the chips"
    )
    code_length: int = Field(31, ge=2, le=65536, description="chips of the code")
    code_index: int = Field(1, ge=0, description="which Gold code; root of a Zadoff-Chu sequence")
    code_phases_deg: tuple[Degrees, ...] | None = Field(None, description="of the chips of an own code [deg]")
    first_chip: int = Field(0, ge=0, description="chip of the first chirp, where each has one")

    _quiet = (*Fmcw._quiet, "code_index", "first_chip")

    @model_validator(mode="after")
    def _check_code(self) -> PcFmcw:
        _ = self.chips  # refuses lengths that the code does not have
        band = self.code_length / self.ramp_time
        if self.coding == "within" and band > self.sample_rate:
            raise ValueError(
                f"code_length <= sample rate * ramp_time = {self.sample_rate * self.ramp_time:g} chips within a ramp; "
                f"it is {self.code_length}: take fewer chips or sample faster"
            )
        return self

    @property
    def chips(self) -> Complex:
        """Chips of magnitude 1, shape (code_length,)."""
        return chips_of(self.code, self.code_length, self.code_index, self.code_phases_deg)[0]

    @property
    def by_chirp(self) -> Complex:
        """What each chirp is multiplied with, shape (num_chirps,); 1 if the code is within ramps."""
        if self.coding == "within":
            return np.ones(self.num_chirps, dtype=np.complex128)
        return np.asarray(self.chips[(self.first_chip + np.arange(self.num_chirps)) % self.code_length])

    @property
    def lines(self) -> tuple[npt.NDArray[np.float64], Complex]:
        """Frequencies of the code's lines within a ramp [Hz], and their strengths, power 1 in all."""
        order = np.arange(self.code_length) - self.code_length // 2
        strengths = np.fft.fftshift(np.fft.fft(self.chips)) / self.code_length
        return order / self.ramp_time, strengths

    @property
    def aligned(self) -> Complex:
        """The conjugate code at the samples after the receiver's filter, which disperses it, shape (num_samples,)."""
        frequency, strength = self.lines
        ts = self.adc_start_time + np.arange(self.num_samples) / self.sample_rate
        dispersed = np.conj(strength) * np.exp(1j * np.pi * frequency**2 / self.chirp_slope)
        return np.asarray(np.exp(-2j * np.pi * np.outer(ts, frequency)) @ dispersed)

    def ramps(self, higher: float = 0.0) -> Fmcw:
        """Return the ramps without the code, their carriers some frequency higher [Hz]."""
        own = {name: getattr(self, name) for name in self.model_fields_set & set(Fmcw.model_fields) - {"kind"}}
        return Fmcw(**{**own, "start_frequency": self.start_frequency + higher})

    def chirps(self, first: int, count: int) -> Fmcw:
        """Return the waveform with some of its chirps only; each keeps its chip."""
        part = super().chirps(first, count)
        return part.with_(first_chip=self.first_chip + first) if self.coding == "across" else part
