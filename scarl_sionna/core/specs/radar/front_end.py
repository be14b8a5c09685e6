"""Analogue front end of a radar: power sent, noise received, and what is not ideal."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer

from scarl_sionna.core.prompt.describe import Row
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import DecibelMilliwatts, Decibels, Unit

from .impairments import Amplifier, ChannelErrors, ChirpErrors, IfFilter, Leakage, Mixer, PhaseNoise


class FrontEnd(Spec):
    """Link budget of every transmitter and receiver. The defaults are this project's: Table 1 of SCaRL gives none.

    Amplitudes are referred to the receiver's input: the beat signal is in sqrt(W), so abs(sample)**2 is received power.
    Effects that are left out are ideal.
    """

    tx_power_dbm: DecibelMilliwatts = Field(12.0, description="of each transmitter [dBm]")
    noise_figure_db: Decibels = Field(12.0, ge=0.0, description="[dB]")
    source_temperature: Annotated[float, Unit("K")] = Field(
        290.0, ge=0.0, description="noise temperature at the antenna [K]"
    )
    phase_noise: PhaseNoise | None = Field(None, description="of the oscillators")
    chirp_errors: ChirpErrors | None = Field(None, description="of the ramps' frequency and start")
    leakage: tuple[Leakage, ...] = Field((), description="from transmitters to receivers, and from the bumper")
    channels: ChannelErrors | None = Field(None, description="gains, phases and coupling of the antennas")
    amplifier: Amplifier | None = Field(None, description="compression of the receivers")
    mixer: Mixer | None = Field(None, description="imbalance of I and Q")
    filters: IfFilter | None = Field(None, description="high and low passes of the beat signal")
    dc_offset_dbm: DecibelMilliwatts | None = Field(None, description="constant at the converter [dBm]")

    @property
    def is_ideal(self) -> bool:
        """Whether there is nothing but power and noise."""
        return all(_is_none(getattr(self, name)) for name in _EFFECTS)

    def ideal(self) -> FrontEnd:
        """Return the front end with power and noise alone, by definition of the defaults."""
        return self.with_(**{name: type(self).model_fields[name].default for name in _EFFECTS})

    def _facts(self) -> Iterable[Row]:
        return ((name, text) for name, text in super()._facts() if name not in _EFFECTS or getattr(self, name) != ())

    def check(self, num_tx: int, num_rx: int) -> None:
        """Raise if what stands for each antenna does not fit an array.

        Raises
        ------
        ParameterRangeError
            If there are not as many values as antennas.
        """
        if self.channels is not None:
            self.channels.check(num_tx, num_rx)
        if self.phase_noise is not None:
            self.phase_noise.check(num_tx, num_rx)

    @model_serializer(mode="wrap")
    def _without_ideal(self, inner: SerializerFunctionWrapHandler) -> dict[str, object]:
        """Leave out ideal effects, as files of the first versions have it."""
        return {
            name: value for name, value in inner(self).items() if name not in _EFFECTS or value not in (None, (), [])
        }


def _is_none(effect: object) -> bool:
    """Return whether an effect is left out, or has all its values at their ideal defaults."""
    neutral = isinstance(effect, ChannelErrors | ChirpErrors | IfFilter | Mixer) and effect == type(effect)()
    return effect in (None, ()) or neutral


_EFFECTS = tuple(FrontEnd.model_fields)[3:]
