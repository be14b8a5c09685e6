"""Which waveforms, multiplexing and effects of a front end go together."""

from __future__ import annotations

from scarl_sionna.core.errors import SpecError

from .array import AntennaArray
from .converter import Adc
from .front_end import FrontEnd
from .multiplexing import Fdm, Multiplexing, Tdm
from .waveform import Waveform
from .waveforms.coded import Ofdm

_UNEQUAL = ("chirp_jitter", "chirp_offsets", "frequency_step", "frequency_offsets")
"""What makes ramps differ from each other."""
_RAMPS = ("fmcw", "stepped_fmcw", "tones")
"""Waveforms whose ramps can have errors; tones are what a receiver made of some."""


def check_together(
    model: type, waveform: Waveform, multiplexing: Multiplexing, front_end: FrontEnd, array: AntennaArray
) -> None:
    """Raise if parts of a radar do not go together.

    By definition of each: periodic codes are told apart by a regular Doppler transform, a random order is that of
    chirps that are all alike, and errors of ramps need ramps.

    Parameters
    ----------
    model : type
        Class of the specification, for the error.
    waveform : Waveform
    multiplexing : Multiplexing
    front_end : FrontEnd
    array : AntennaArray

    Raises
    ------
    ParameterRangeError
        If they do not; the error names the parts.
    """
    num_tx = array.num_tx
    even = waveform.burst == 1 and waveform.chirp_delays is None and waveform.chirp_frequencies is None
    ramps = even and waveform.kind == "fmcw"
    shown = f"{multiplexing.kind!r} with {waveform.kind!r}"
    if multiplexing.code_period(num_tx) is not None and not even:
        allowed = "chirps of one carrier at regular times: images are found by a regular Doppler transform"
        raise SpecError(model, ("multiplexing",), shown, allowed, "take 'tdm' or 'cdm', or equal chirps")
    if isinstance(multiplexing, Fdm) and waveform.kind != "tones":
        _check_subcarriers(model, waveform, multiplexing.interleaving or num_tx, shown)
    if isinstance(multiplexing, Tdm) and multiplexing.is_coded and not ramps:
        unequal = [name for name in _UNEQUAL if getattr(waveform, name, None)] if waveform.kind == "fmcw" else []
        beside = " and ".join(unequal) or repr(waveform.kind)
        allowed = f"none beside {beside}: a random order, of any number of chirps a channel, is of equal ramps"
        remedy = f"leave order_seed out{''.join(f', or {name}' for name in unequal)}"
        raise SpecError(model, ("multiplexing", "order_seed"), str(multiplexing.order_seed), allowed, remedy)
    if front_end.chirp_errors is not None and waveform.kind not in _RAMPS:
        allowed = "ramps without a code, of which these are errors"
        raise SpecError(model, ("front_end", "chirp_errors"), f"with {waveform.kind!r}", allowed, "leave it out")


def _check_subcarriers(model: type, waveform: Waveform, turns: int, shown: str) -> None:
    """Raise if there are no subcarriers for transmitters to share, or not as many for each."""
    if not isinstance(waveform, Ofdm):
        raise SpecError(model, ("multiplexing",), shown, "subcarriers ('ofdm')", "take 'tdm', 'ddm' or 'cdm'")
    step = waveform.comb * waveform.pilot_spacing * turns
    if waveform.num_subcarriers % step:
        near = max(1, round(waveform.num_subcarriers / step)) * step
        allowed = f"a multiple of {step}: as many subcarriers for each of {turns} turns"
        remedy = f"take {near}, or another interleaving"
        raise SpecError(model, ("waveform", "num_subcarriers"), waveform.num_subcarriers, allowed, remedy)


def check_real(model: type, waveform: Waveform, adc: Adc) -> None:
    """Raise if real samples do not go with a waveform.

    By definition: they are half of an even number of a ramp's beat signal.

    Parameters
    ----------
    model : type
        Class of the specification, for the error.
    waveform : Waveform
    adc : Adc

    Raises
    ------
    ParameterRangeError
        If they do not.
    """
    if not adc.is_real:
        return
    if waveform.kind != "fmcw":
        allowed = "ramps ('fmcw'): real samples are of their beat signal"
        raise SpecError(model, ("adc", "sampling"), f"'real' with {waveform.kind!r}", allowed, "sample I and Q")
    if waveform.num_samples % 2:
        allowed = "an even number where samples are real: half as many are range bins"
        raise SpecError(model, ("waveform", "num_samples"), str(waveform.num_samples), allowed)
