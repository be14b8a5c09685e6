"""What a real front end adds to an ideal one, a part an effect. A field left out is ideal."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

from pydantic import Field, model_validator

from scarl_sionna.core.errors import SpecError
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import DecibelMilliwatts, Decibels, Degrees, Hertz, Metres, Seconds, Unit

MaskPoint = tuple[Hertz, Annotated[float, Unit("dBc/Hz")]]
Complex = tuple[float, float]
"""Real and imaginary part."""


class PhaseNoise(Spec):
    """Phase noise of the oscillators by its mask.

    Raises
    ------
    ParameterRangeError
        If the mask's offsets do not rise.
    """

    mask: tuple[MaskPoint, ...] = Field(
        min_length=1,
        description="offset [Hz] and single-sideband level [dBc/Hz]; linear over log(offset), held outside",
    )
    tx_oscillator: tuple[int, ...] = Field(
        (), description="number of each transmitter's oscillator; empty: all share 0"
    )
    rx_oscillator: tuple[int, ...] = Field((), description="number of each receiver's oscillator; empty: all share 0")

    @model_validator(mode="after")
    def _check(self) -> PhaseNoise:
        offsets = [offset for offset, _ in self.mask]
        if offsets[0] <= 0.0 or any(b <= a for a, b in pairwise(offsets)):
            raise ValueError(f"mask with offsets that rise from above 0 Hz: {offsets}")
        return self

    def check(self, num_tx: int, num_rx: int) -> None:
        """Raise if there are not as many oscillators as antennas.

        Raises
        ------
        ParameterRangeError
            If there are not.
        """
        for name, count in (("tx_oscillator", num_tx), ("rx_oscillator", num_rx)):
            value = getattr(self, name)
            if value and len(value) != count:
                place = ("front_end", "phase_noise", name)
                raise SpecError(type(self), place, f"{len(value)} values", f"{count} values, or none")


class ChirpErrors(Spec):
    """What is wrong with the ramps: a ripple of frequency over each ramp, and starts that jitter."""

    ripple_frequency_error: Hertz = Field(0.0, ge=0.0, description="peak of a sinusoidal frequency error [Hz]")
    ripple_periods: float = Field(1.0, gt=0.0, description="periods of the ripple in the samples of a chirp")
    start_jitter: Seconds = Field(0.0, ge=0.0, description="standard deviation of a ramp's start, sampling held [s]")


class Leakage(Spec):
    """A way from the transmitters to the receivers within the sensor: coupling, or a bumper's reflection."""

    length: Metres = Field(ge=0.0, description="of the way, there and back [m]")
    level_db: Decibels = Field(le=0.0, description="received over transmitted power [dB]")
    phase_deg: Degrees = Field(0.0, description="[deg]")


class ChannelErrors(Spec):
    """Differences between channels, and the coupling of antennas. Empty: none."""

    tx_gain_db: tuple[Decibels, ...] = Field((), description="of each transmitter [dB]")
    tx_phase_deg: tuple[Degrees, ...] = Field((), description="of each transmitter [deg]")
    rx_gain_db: tuple[Decibels, ...] = Field((), description="of each receiver [dB]")
    rx_phase_deg: tuple[Degrees, ...] = Field((), description="of each receiver [deg]")
    tx_coupling: tuple[tuple[Complex, ...], ...] = Field(
        (), description="(num_tx, num_tx): field that antenna i sends when transmitter j is fed; real, imaginary part"
    )
    rx_coupling: tuple[tuple[Complex, ...], ...] = Field(
        (), description="(num_rx, num_rx): field in receiver i of what reaches antenna j; real, imaginary part"
    )

    def check(self, num_tx: int, num_rx: int) -> None:
        """Raise if a field is not as long as there are antennas.

        Raises
        ------
        ParameterRangeError
            If it is not.
        """
        for name in type(self).model_fields:
            value, count = getattr(self, name), num_tx if name.startswith("tx") else num_rx
            square = name.endswith("coupling")
            if value and (len(value) != count or (square and any(len(row) != count for row in value))):
                allowed = f"{count} x {count} values" if square else f"{count} values"
                raise SpecError(type(self), ("front_end", "channels", name), f"{len(value)} values", allowed)


class Mixer(Spec):
    """Imbalance of I and Q: image of a tone at the opposite frequency."""

    iq_gain_db: Decibels = Field(0.0, description="of Q over I [dB]")
    iq_phase_deg: Degrees = Field(0.0, description="of Q beyond 90 deg [deg]")


class IfFilter(Spec):
    """Filters between mixer and converter."""

    high_pass: tuple[Hertz, ...] = Field((), description="corners of first-order high passes in series [Hz]")
    low_pass: Hertz | None = Field(None, gt=0.0, description="corner of a Butterworth low pass against aliases [Hz]")
    low_pass_order: int = Field(4, ge=1, le=12, description="of the low pass")

    @model_validator(mode="after")
    def _check(self) -> IfFilter:
        if any(corner <= 0.0 for corner in self.high_pass):
            raise ValueError(f"high_pass with corners above 0 Hz: {self.high_pass}")
        return self


class Amplifier(Spec):
    """Compression of the receiver's first amplifier, of third order."""

    p1db_dbm: DecibelMilliwatts = Field(description="input power at which a tone's gain is 1 dB down [dBm]")
