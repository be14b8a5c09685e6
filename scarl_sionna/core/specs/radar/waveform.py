"""Waveforms: what a radar sends in a frame, and where the receiver samples it.

A receiver's raw data is a matrix of slow time (chirps: ramps, code periods or symbols) by fast time (complex samples of
a chirp). :class:`Waveform` is what the rest of the program needs to know of any of them; what only one of them has, the
slope of a ramp for instance, is read from the waveform itself (``radar.waveform.chirp_slope``).
"""

from __future__ import annotations

from typing import ClassVar, Literal, NamedTuple, Protocol

import numpy as np
from pydantic import Field, model_validator

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Hertz, Seconds


class Sweep(NamedTuple):
    """The line of the frequency over the time of a chirp.

    Attributes
    ----------
    start_frequency : float
        At the chirp's start [Hz].
    slope : float
        [Hz/s], negative of a ramp that falls.
    first : float
        Time of the first sample after the chirp's start [s].
    duration : float
        Of the chirp [s].
    video : float
        1 if the receiver mixes with the ramp itself, which leaves the residual video phase; 0 if it does not.
    wait : float
        From the chirp's start to the start of the line [s].
    """

    start_frequency: float
    slope: float
    first: float
    duration: float
    video: float
    wait: float = 0.0


class Waveform(Protocol):
    """What every waveform answers, whatever it sends."""

    @property
    def kind(self) -> str:
        """Name in files."""

    @property
    def carrier_frequency(self) -> float:
        """Frequency of the radar equation and of array spacings [Hz]."""

    @property
    def center_frequency(self) -> float:
        """Frequency of materials, of Doppler and angles after a range transform: middle of what is sampled [Hz]."""

    @property
    def num_chirps(self) -> int:
        """Chirps of each transmitter in a frame, the length of slow time."""

    @property
    def num_samples(self) -> int:
        """Complex samples of a chirp, the length of fast time."""

    @property
    def sample_rate(self) -> float:
        """Complex samples a second [Hz]."""

    @property
    def noise_bandwidth(self) -> float:
        """Bandwidth of the receiver's noise in a sample [Hz]."""

    @property
    def num_range_bins(self) -> int:
        """Bins of range without zero padding; as many range resolutions are unambiguous."""

    @property
    def sampled_bandwidth(self) -> float:
        """Bandwidth that the samples of a chirp cover [Hz]; the width of a range bin is c / (2 sampled_bandwidth)."""

    @property
    def chirp_interval(self) -> float:
        """Time from the start of a chirp to the start of the next one, of any transmitter [s]."""

    @property
    def burst(self) -> int:
        """Chirps of a transmitter that together make one sample of slow time."""

    @property
    def top_frequency(self) -> float:
        """Highest frequency that is sent [Hz]."""

    @property
    def sweep(self) -> Sweep:
        """How the frequency that the receiver looks at goes over the samples of a chirp."""

    @property
    def chirp_delays(self) -> tuple[float, ...] | None:
        """Start of each chirp after its place in the regular grid [s]; None if all are in it."""

    @property
    def chirp_frequencies(self) -> tuple[float, ...] | None:
        """Carrier of each chirp above that of `sweep` [Hz]; None if all have one."""

    def chirps(self, first: int, count: int) -> Waveform:
        """Return the waveform with some of its chirps only."""


class RegularChirps(Spec):
    """A waveform whose chirps follow each other regularly, all at one carrier, each a sample of slow time."""

    @property
    def burst(self) -> int:
        """1: every chirp is a sample of slow time."""
        return 1

    @property
    def chirp_delays(self) -> None:
        """None: chirps follow each other regularly."""
        return None

    @property
    def chirp_frequencies(self) -> None:
        """None: all chirps have one carrier."""
        return None


class Fmcw(Spec):
    """Linear frequency modulation.

    Ramps that rise or fall by `bandwidth` in `ramp_time`, de-chirped and sampled from `adc_start_time` on. Chirps may
    have carriers of their own, and start later than the regular grid has it: `chirp_offsets` or, drawn from a seed,
    `chirp_jitter`. The receiver knows them.

    The defaults are Table 1 of SCaRL, at 77 GHz.

    Raises
    ------
    ParameterRangeError
        If a value is outside its range, the samples take longer than the ramp, or chirps overlap.

    References
    ----------
    .. [1] Nittur Ramesh et al., *SCaRL*, 2024, Table 1: 300 MHz, 30 us and 8 us, 256 chirps, 512 samples.
    """

    kind: Literal["fmcw"] = "fmcw"
    start_frequency: Hertz = Field(77e9, ge=1e6, description="carrier frequency at the start of the ramp [Hz]")
    bandwidth: Hertz = Field(300e6, gt=0.0, description="swept over ramp_time [Hz]")
    direction: Literal["up", "down"] = Field("up", description="of the frequency over the ramp")
    ramp_time: Seconds = Field(30e-6, gt=0.0, le=1.0, description="duration of a ramp [s]")
    idle_time: Seconds = Field(8e-6, ge=0.0, description="pause between ramps [s]")
    num_chirps: int = Field(256, ge=1, description="chirps of each transmitter in a frame")
    num_samples: int = Field(512, ge=1, description="complex samples a chirp")
    sampling_frequency: Hertz | None = Field(
        None, gt=0.0, description="[Hz]; None: num_samples over what is left of the ramp after adc_start_time"
    )
    adc_start_time: Seconds = Field(0.0, ge=0.0, description="first sample after the ramp's start [s]")
    frequency_step: Hertz = Field(0.0, description="carrier of each chirp above that of the one before [Hz]")
    frequency_offsets: tuple[Hertz, ...] | None = Field(
        None, description="carrier of each chirp above start_frequency [Hz]; one a chirp"
    )
    chirp_offsets: tuple[Seconds, ...] | None = Field(
        None, description="start of each chirp after its place in the regular grid [s]; one a chirp"
    )
    chirp_jitter: Seconds = Field(0.0, ge=0.0, description="chirps start up to that later, drawn uniformly [s]")
    jitter_seed: int = Field(0, ge=0, description="of the drawn starts")

    _quiet: ClassVar[tuple[str, ...]] = ("direction", "adc_start_time", "frequency_step", "chirp_jitter", "jitter_seed")

    @model_validator(mode="after")
    def _check(self) -> Fmcw:
        sampled = self.adc_start_time + self.num_samples / self.sample_rate
        if self.adc_start_time >= self.ramp_time:
            raise ValueError(
                f"adc_start_time < ramp_time: {self.adc_start_time * 1e6:g} us, the ramp {self.ramp_time * 1e6:g} us"
            )
        if self.sampling_frequency is not None and sampled > self.ramp_time * (1 + 1e-9):
            start = f" from {self.adc_start_time * 1e6:g} us on" if self.adc_start_time else ""
            raise ValueError(
                f"num_samples / sampling_frequency <= ramp_time: {self.num_samples} samples at "
                f"{self.sampling_frequency / 1e6:g} MHz take {self.num_samples / self.sampling_frequency * 1e6:g} us"
                f"{start}, the ramp {self.ramp_time * 1e6:g} us; take fewer samples or sample faster"
            )
        for name in ("frequency_offsets", "chirp_offsets"):
            values = getattr(self, name)
            if values is not None and len(values) != self.num_chirps:
                raise ValueError(f"{name}: one a chirp, {self.num_chirps}; there are {len(values)}")
        if self.frequency_offsets is not None and self.frequency_step:
            raise ValueError("frequency_step = 0 where frequency_offsets say each chirp's carrier; give one of both")
        if self.chirp_offsets is not None and self.chirp_jitter:
            raise ValueError("chirp_jitter = 0 where chirp_offsets say each chirp's start; give one of both")
        if self.start_frequency + min(self._offsets or (0.0,)) + min(self._change, 0.0) < 1e6:
            raise ValueError("every chirp's frequencies >= 1 MHz; raise start_frequency")
        self._check_overlap()
        return self

    def _check_overlap(self) -> None:
        late = np.asarray(self.chirp_offsets or (0.0,))
        if self.chirp_jitter > self.idle_time * (1 + 1e-9):
            raise ValueError(
                f"chirp_jitter <= idle_time: {self.chirp_jitter * 1e6:g} us, the pause {self.idle_time * 1e6:g} us"
            )
        if np.any(-np.diff(late) > self.idle_time * (1 + 1e-9)):
            worst = int(np.argmin(np.diff(late)))
            raise ValueError(
                f"chirp_offsets of at most idle_time = {self.idle_time * 1e6:g} us less than those "
                f"before: chirp {worst + 1} would start {-np.diff(late)[worst] * 1e6:g} us earlier than the regular "
                "grid has it after the one before; a longer idle_time makes room"
            )

    @property
    def _change(self) -> float:
        """Change of the frequency over a ramp [Hz]."""
        return self.bandwidth if self.direction == "up" else -self.bandwidth

    @property
    def chirp_slope(self) -> float:
        """Frequency slope S [Hz/s], negative of a ramp that falls."""
        return self._change / self.ramp_time

    @property
    def sample_rate(self) -> float:
        """Complex sampling frequency [Hz]."""
        return self.sampling_frequency or self.num_samples / (self.ramp_time - self.adc_start_time)

    @property
    def noise_bandwidth(self) -> float:
        """Of the noise in a sample [Hz]."""
        return self.sample_rate

    @property
    def num_range_bins(self) -> int:
        """Range bins without zero padding, one a sample."""
        return self.num_samples

    @property
    def burst(self) -> int:
        """1: every chirp is a sample of slow time."""
        return 1

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
        """Frequency in the middle of the sampled ramp, of the mean chirp [Hz]."""
        middle = self.adc_start_time + (self.num_samples - 1) / (2.0 * self.sample_rate)
        return self.sweep.start_frequency + self.chirp_slope * middle

    @property
    def sampled_bandwidth(self) -> float:
        """Bandwidth that the samples of a chirp cover [Hz]."""
        return abs(self.chirp_slope) * self.num_samples / self.sample_rate

    @property
    def top_frequency(self) -> float:
        """Highest frequency that is sent [Hz]."""
        return self.start_frequency + max(self._change, 0.0) + max(self._offsets or (0.0,))

    @property
    def sweep(self) -> Sweep:
        """The ramp, of the mean chirp."""
        offsets = self._offsets
        start = self.start_frequency if offsets is None else self.start_frequency + float(np.mean(offsets))
        return Sweep(start, self.chirp_slope, self.adc_start_time, self.ramp_time, 1.0)

    @property
    def chirp_delays(self) -> tuple[float, ...] | None:
        """Start of each chirp after its place in the regular grid [s]; None if all are in it."""
        if self.chirp_jitter:
            drawn = np.random.default_rng(self.jitter_seed).uniform(0.0, self.chirp_jitter, self.num_chirps)
            return tuple(drawn.tolist())
        return self.chirp_offsets

    @property
    def _offsets(self) -> tuple[float, ...] | None:
        """Carrier of each chirp above start_frequency [Hz]; None if all have that."""
        if self.frequency_step:
            return tuple((self.frequency_step * np.arange(self.num_chirps)).tolist())
        return self.frequency_offsets

    @property
    def chirp_frequencies(self) -> tuple[float, ...] | None:
        """Carrier of each chirp above the mean one [Hz]; None if all have one."""
        offsets = self._offsets
        return None if offsets is None else tuple((np.asarray(offsets) - np.mean(offsets)).tolist())

    def chirps(self, first: int, count: int) -> Fmcw:
        """Return the waveform with some of its chirps only; what each has of its own stays."""
        changes: dict[str, object] = {"num_chirps": count}
        late, steps = self.chirp_delays, self._offsets
        if late is not None:
            changes |= {"chirp_offsets": late[first : first + count], "chirp_jitter": 0.0}
        if steps is not None:
            changes |= {"frequency_offsets": steps[first : first + count], "frequency_step": 0.0}
        return self.with_(**changes)
