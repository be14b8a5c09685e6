"""What a radar's receiver has after it has undone the waveform: a frame of tones that each take no time."""

from __future__ import annotations

from typing import Literal, cast

from pydantic import Field

from scarl_sionna.core.units import Hertz, Seconds

from .spec import RadarSpec
from .waveform import RegularChirps, Sweep
from .waveforms.coded import AT_ONCE, Coded, is_coded, sweep_of
from .waveforms.kinds import SteppedFmcw


class Tones(RegularChirps):
    """The propagation channel at equally spaced frequencies, once a chirp."""

    kind: Literal["tones"] = "tones"
    lowest: Hertz = Field(description="frequency of the first tone [Hz]")
    step: Hertz = Field(description="from tone to tone [Hz]")
    wait: Seconds = Field(description="from a chirp's start to the time of its tones [s]")
    carrier_frequency: Hertz = Field(description="of the radar [Hz]")
    num_chirps: int
    num_samples: int
    chirp_interval: Seconds
    tx_interval: Seconds = Field(description="from a transmitter's chirp to the next one's, where they take turns [s]")
    tx_step: Hertz = Field(0.0, description="from a transmitter's tones to the next one's [Hz]")

    @property
    def center_frequency(self) -> float:
        """Middle of the tones [Hz]."""
        return self.lowest + 0.5 * self.step * (self.num_samples - 1)

    @property
    def sample_rate(self) -> float:
        """Tones a second [Hz]."""
        return AT_ONCE

    @property
    def noise_bandwidth(self) -> float:
        """Tones have no noise of their own [Hz]."""
        return 0.0

    @property
    def num_range_bins(self) -> int:
        """Range bins without zero padding."""
        return self.num_samples

    @property
    def sampled_bandwidth(self) -> float:
        """Width of all tones [Hz]."""
        return self.step * self.num_samples

    @property
    def top_frequency(self) -> float:
        """Highest tone [Hz]."""
        return self.lowest + self.step * self.num_samples

    @property
    def sweep(self) -> Sweep:
        """The tones."""
        return Sweep(self.lowest, self.step * AT_ONCE, 0.0, 0.0, 0.0, self.wait)

    def chirps(self, first: int, count: int) -> Tones:
        """Return the frame with some of its chirps only."""
        return self.with_(num_chirps=count)


class TonesRadar(RadarSpec):
    """A radar that samples tones."""

    waveform: Tones  # type: ignore[assignment]

    def tx_delay(self, tx: int) -> float:
        """Return the start of a transmitter's chirps after the first transmitter's [s]."""
        return self.multiplexing.tx_delay(tx, self.waveform.tx_interval)

    def tx_frequency(self, tx: int) -> float:
        """Return how much higher than the first transmitter another sends [Hz]."""
        return tx * self.waveform.tx_step

    def waveform_of(self, tx: int) -> Tones:
        """Return the tones; those of another transmitter are `tx_frequency` higher."""
        return self.waveform


def seen_by(radar: RadarSpec, wait: float | None = None, every: bool = False) -> RadarSpec:
    """Return the radar as it is after its receiver has undone the waveform; one with ramps is that already.

    In frequency division the tones are those of the first transmitter.

    Parameters
    ----------
    radar : RadarSpec
    wait : float, optional
        Time of the tones after the chirp's start [s]; default: the middle of what is sampled.
    every : bool
        All tones that are sent, or those that the receiver uses.
    """
    waveform = radar.waveform
    if isinstance(waveform, SteppedFmcw):
        return _tones_radar(radar, _of_bursts(radar, waveform))
    if not is_coded(waveform):
        return radar
    own = cast(Coded, radar.waveform_of(0))
    indices = own.sent if every else own.used
    tones = Tones(
        lowest=_frequency(waveform, float(indices[0])),
        step=waveform.spacing * float(indices[1] - indices[0] if len(indices) > 1 else 1),
        wait=sweep_of(own, wait).wait,
        carrier_frequency=waveform.carrier_frequency,
        num_chirps=waveform.num_chirps,
        num_samples=len(indices),
        chirp_interval=waveform.chirp_interval,
        tx_interval=waveform.chirp_interval,
        tx_step=0.0 if radar.num_tx == 1 else radar.tx_frequency(1),
    )
    return _tones_radar(radar, tones)


def _of_bursts(radar: RadarSpec, waveform: SteppedFmcw) -> Tones:
    """Return the tones of a burst of stepped ramps in its middle."""
    count, spacing = waveform.num_range_bins, waveform.ramp_bandwidth / waveform.num_samples
    in_ramp = waveform.sweep.first + 0.5 * (waveform.num_samples - 1) / waveform.sample_rate
    return Tones(
        lowest=waveform.center_frequency - 0.5 * spacing * (count - 1),
        step=spacing,
        wait=0.5 * (waveform.burst - 1) * radar.doppler_interval + in_ramp,
        carrier_frequency=waveform.carrier_frequency,
        num_chirps=radar.num_doppler_bins,
        num_samples=count,
        chirp_interval=waveform.chirp_interval * waveform.burst,
        tx_interval=waveform.chirp_interval,
    )


def _tones_radar(radar: RadarSpec, tones: Tones) -> TonesRadar:
    names = (name for name in RadarSpec.model_fields if name != "waveform")
    return TonesRadar(waveform=tones, **{name: getattr(radar, name) for name in names})


def _frequency(waveform: Coded, tone: float) -> float:
    return waveform.carrier_frequency + waveform.spacing * (tone - waveform.num_samples // 2)
