"""A radar whose channel is asked for at one frequency of its band."""

from __future__ import annotations

from pydantic import Field

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import Hertz


class TunedRadar(RadarSpec):
    """A radar that meets materials as they are at one frequency; all else, geometry included, stays."""

    tuned_frequency: Hertz = Field(gt=0.0, description="of materials [Hz]")


def tuned_to(radar: RadarSpec, frequency: float) -> TunedRadar:
    """Return a radar tuned to a frequency [Hz]."""
    parts = {name: getattr(radar, name) for name in RadarSpec.model_fields}
    return TunedRadar(tuned_frequency=frequency, **parts)


def material_frequency(radar: RadarSpec) -> float:
    """Return the frequency at which all solvers meet materials [Hz]: the middle of the band, or what it is tuned to."""
    return radar.tuned_frequency if isinstance(radar, TunedRadar) else radar.center_frequency


def band_of(radar: RadarSpec) -> tuple[float, float]:
    """Return the lowest and the highest frequency that the samples of a radar see [Hz].

    By definition of the waveform: all carriers of chirps included.
    """
    steps = radar.waveform.chirp_frequencies if radar.waveform.burst == 1 else None
    half, middle = 0.5 * radar.sampled_bandwidth, radar.center_frequency
    low, high = (0.0, 0.0) if steps is None else (min(steps), max(steps))
    return middle - half + low, middle + half + high
