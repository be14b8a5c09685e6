"""Waveforms: what a radar sends in a frame, and where the receiver samples it.

A receiver's raw data is a matrix of slow time (chirps: ramps, code periods or symbols) by fast time (complex samples of
a chirp). :class:`Waveform` is what the rest of the program needs to know of any of them; what only one of them has, the
slope of a ramp for instance, is read from the waveform itself (``radar.waveform.chirp_slope``).
"""

from __future__ import annotations

from typing import Literal, Protocol

from pydantic import Field, model_validator

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Hertz, Seconds


class Waveform(Protocol):
    """What every waveform answers, whatever it sends."""

    @property
    def kind(self) -> str:
        """Name in files."""

    @property
    def carrier_frequency(self) -> float:
        """Frequency of the radar equation, of materials and of array spacings [Hz]."""

    @property
    def center_frequency(self) -> float:
        """Frequency of Doppler and of angles after a range transform: the middle of what is sampled [Hz]."""

    @property
    def num_chirps(self) -> int:
        """Chirps of each transmitter in a frame, the length of slow time."""

    @property
    def num_samples(self) -> int:
        """Complex samples of a chirp, the length of fast time."""

    @property
    def sample_rate(self) -> float:
        """Complex samples a second [Hz]: the bandwidth of the receiver's noise."""

    @property
    def sampled_bandwidth(self) -> float:
        """Bandwidth that the samples of a chirp cover [Hz]; the width of a range bin is c / (2 sampled_bandwidth)."""

    @property
    def chirp_interval(self) -> float:
        """Time from the start of a chirp to the start of the next one, of any transmitter [s]."""


class Fmcw(Spec):
    """Linear frequency modulation.

    Ramps that rise by `bandwidth` in `ramp_time`, de-chirped and sampled from their start.

    The defaults are Table 1 of SCaRL, at 77 GHz.

    Raises
    ------
    ParameterRangeError
        If a value is outside its range, or the samples take longer than the ramp.

    References
    ----------
    .. [1] Nittur Ramesh et al., *SCaRL*, 2024, Table 1: 300 MHz, 30 us and 8 us, 256 chirps, 512 samples.
    """

    kind: Literal["fmcw"] = "fmcw"
    start_frequency: Hertz = Field(77e9, ge=1e6, description="carrier frequency at the start of the ramp [Hz]")
    bandwidth: Hertz = Field(300e6, gt=0.0, description="swept over ramp_time [Hz]")
    ramp_time: Seconds = Field(30e-6, gt=0.0, le=1.0, description="duration of a ramp [s]")
    idle_time: Seconds = Field(8e-6, ge=0.0, description="pause between ramps [s]")
    num_chirps: int = Field(256, ge=1, description="chirps of each transmitter in a frame")
    num_samples: int = Field(512, ge=1, description="complex samples a chirp")
    sampling_frequency: Hertz | None = Field(None, gt=0.0, description="[Hz]; None: num_samples / ramp_time")

    @model_validator(mode="after")
    def _check(self) -> Fmcw:
        if self.sampling_frequency is not None and self.num_samples / self.sampling_frequency > self.ramp_time * (
            1 + 1e-9
        ):
            raise ValueError(
                f"num_samples / sampling_frequency <= ramp_time: {self.num_samples} samples at "
                f"{self.sampling_frequency / 1e6:g} MHz take {self.num_samples / self.sampling_frequency * 1e6:g} us, "
                f"the ramp {self.ramp_time * 1e6:g} us; take fewer samples or sample faster"
            )
        return self

    @property
    def chirp_slope(self) -> float:
        """Frequency slope S [Hz/s]."""
        return self.bandwidth / self.ramp_time

    @property
    def sample_rate(self) -> float:
        """Complex sampling frequency [Hz]."""
        return self.sampling_frequency or self.num_samples / self.ramp_time

    @property
    def chirp_interval(self) -> float:
        """Time from ramp to ramp [s]."""
        return self.ramp_time + self.idle_time

    @property
    def carrier_frequency(self) -> float:
        """Frequency at the start of the ramp [Hz]."""
        return self.start_frequency

    @property
    def center_frequency(self) -> float:
        """Frequency in the middle of the sampled ramp [Hz]."""
        return self.start_frequency + self.chirp_slope * (self.num_samples - 1) / (2.0 * self.sample_rate)

    @property
    def sampled_bandwidth(self) -> float:
        """Bandwidth that the samples cover [Hz]."""
        return self.chirp_slope * self.num_samples / self.sample_rate


AnyWaveform = Fmcw
"""The waveforms that a radar can have, told apart by `kind`: a union as soon as there are several."""
