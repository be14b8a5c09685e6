"""Waveforms whose chirps are symbols: sums of equally spaced tones, sampled as they arrive (OFDM and phase codes).

What is sent over a chirp is ``sum_k X_k exp(2j pi f_k t)`` with the tones of its period, and the receiver samples at
the rate of all tones. :class:`Coded` is what synthesis and receivers need to know of them.
"""

from __future__ import annotations

import math
from typing import Literal, Protocol, TypeGuard

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.radar.waveform import RegularChirps, Sweep, Waveform
from scarl_sionna.core.units import Degrees, Hertz, Seconds

from . import codes

Complex = npt.NDArray[np.complex128]


class Coded(Waveform, Protocol):
    """What synthesis and receivers ask of a waveform made of symbols."""

    @property
    def spacing(self) -> float:
        """From tone to tone of all that the samples tell apart [Hz]."""

    @property
    def used(self) -> npt.NDArray[np.intp]:
        """Tones that the receiver uses, equally spaced; 0 is the lowest of the samples."""

    @property
    def sent(self) -> npt.NDArray[np.intp]:
        """Tones that are sent, equally spaced."""

    @property
    def spectrum(self) -> Complex:
        """Strengths of the sent tones, power 1 in all, shape (num_chirps or 1, num_sent)."""

    @property
    def prefix_time(self) -> float:
        """How long the symbol is sent before the receiver samples it [s]; infinite if it never changes."""

    @property
    def repetitions(self) -> int:
        """Periods that the receiver averages into one chirp's samples."""

    @property
    def divides(self) -> bool:
        """Whether the receiver divides by the tones' strengths; else it correlates with them."""


def is_coded(waveform: Waveform) -> TypeGuard[Coded]:
    """Return whether a waveform is made of symbols."""
    return waveform.kind in ("ofdm", "pmcw")


class _Symbols(RegularChirps):
    """What OFDM and phase codes have in common."""

    carrier_frequency: Hertz = Field(77e9, ge=1e6, description="middle of the band [Hz]")
    num_chirps: int = Field(256, ge=1, description="symbols of each transmitter in a frame")

    @property
    def center_frequency(self) -> float:
        """Middle of the band [Hz]."""
        return self.carrier_frequency


class Ofdm(_Symbols):
    """Orthogonal frequency division: each chirp is a symbol of equally spaced subcarriers after its cyclic prefix.

    Subcarriers have equal magnitudes and the phases of QPSK drawn from a seed, or own ones; with a `comb` only every
    second, third, ... is sent. The receiver divides by what was sent, or with `pilot_spacing` by every so many of those
    alone, where it does not know the rest.

    Raises
    ------
    ParameterRangeError
        If a value is outside its range.

    References
    ----------
    .. [1] C. Sturm, W. Wiesbeck, "Waveform design and signal processing aspects for fusion of wireless communications
       and radar sensing", Proc. IEEE 99(7), 2011.
    """

    kind: Literal["ofdm"] = "ofdm"
    num_subcarriers: int = Field(512, ge=1, le=65536, description="of the sampled band")
    subcarrier_spacing: Hertz = Field(600e3, gt=0.0, description="from one subcarrier to the next [Hz]")
    cyclic_prefix: Seconds = Field(
        1.7e-6, ge=0.0, description="sent before each symbol [s]; as long as the delay of the farthest echo"
    )
    idle_time: Seconds = Field(35e-6, ge=0.0, description="pause between symbols [s]")
    comb: int = Field(1, ge=1, description="every so many subcarriers are sent")
    comb_offset: int = Field(0, ge=0, description="first subcarrier of the comb")
    pilot_spacing: int = Field(1, ge=1, description="every so many of the sent subcarriers are known to the receiver")
    data_seed: int = Field(0, ge=0, description="of the QPSK data")
    data_phases_deg: tuple[tuple[Degrees, ...], ...] | None = Field(
        None, description="own phases of the sent subcarriers [deg]; one row for all symbols, or one a symbol"
    )
    first_symbol: int = Field(0, ge=0, description="symbols of the data before the frame's first")

    _quiet = ("comb", "comb_offset", "pilot_spacing", "data_seed", "first_symbol")

    @model_validator(mode="after")
    def _check(self) -> Ofdm:
        if self.comb_offset >= self.comb:
            raise ValueError(f"comb_offset < comb = {self.comb}; it is {self.comb_offset}")
        if self.num_subcarriers % (self.comb * self.pilot_spacing):
            raise ValueError(
                f"num_subcarriers a multiple of comb * pilot_spacing = {self.comb * self.pilot_spacing}; there are "
                f"{self.num_subcarriers}"
            )
        if self.data_phases_deg is not None:
            shape = {len(row) for row in self.data_phases_deg}
            rows = {1, self.first_symbol + self.num_chirps}
            if shape != {len(self.sent)} or len(self.data_phases_deg) not in rows:
                raise ValueError(
                    f"data_phases_deg: one row, or {max(rows)}, of {len(self.sent)} phases; there are "
                    f"{len(self.data_phases_deg)} of {sorted(shape)}"
                )
        return self

    @property
    def num_samples(self) -> int:
        """Complex samples of a symbol without its prefix."""
        return self.num_subcarriers

    @property
    def num_range_bins(self) -> int:
        """Range bins without zero padding: tones that the receiver uses."""
        return len(self.used)

    @property
    def sample_rate(self) -> float:
        """Complex sampling frequency [Hz]: the width of all subcarriers."""
        return self.num_subcarriers * self.subcarrier_spacing

    @property
    def noise_bandwidth(self) -> float:
        """Of the noise in a sample [Hz]."""
        return self.sample_rate

    @property
    def spacing(self) -> float:
        """From subcarrier to subcarrier [Hz]."""
        return self.subcarrier_spacing

    @property
    def sent(self) -> npt.NDArray[np.intp]:
        """Subcarriers that are sent, from 0, the lowest."""
        return np.arange(self.comb_offset, self.num_subcarriers, self.comb)

    @property
    def used(self) -> npt.NDArray[np.intp]:
        """Subcarriers that the receiver divides by what was sent."""
        return self.sent[:: self.pilot_spacing]

    @property
    def spectrum(self) -> Complex:
        """Strengths of the sent subcarriers, power 1 in all, shape (num_chirps or 1, num_sent)."""
        scale = 1.0 / math.sqrt(len(self.sent))
        if self.data_phases_deg is not None:
            own = np.asarray(self.data_phases_deg)
            phases = np.deg2rad(own if len(own) == 1 else own[self.first_symbol :])
            return np.asarray(scale * np.exp(1j * phases))
        shape = self.first_symbol + self.num_chirps, len(self.sent)
        quarter = np.random.default_rng(self.data_seed).integers(0, 4, shape)[self.first_symbol :]
        return np.asarray(scale * np.exp(0.5j * np.pi * (quarter + 0.5)))

    @property
    def prefix_time(self) -> float:
        """Duration of the cyclic prefix [s]."""
        return self.cyclic_prefix

    @property
    def repetitions(self) -> int:
        """1: every symbol is sampled once."""
        return 1

    @property
    def divides(self) -> bool:
        """True: the receiver divides."""
        return True

    @property
    def sampled_bandwidth(self) -> float:
        """Bandwidth that the tones which the receiver uses cover [Hz]."""
        return self.sample_rate

    @property
    def chirp_interval(self) -> float:
        """Time from symbol to symbol [s]."""
        return self.cyclic_prefix + 1.0 / self.subcarrier_spacing + self.idle_time

    @property
    def top_frequency(self) -> float:
        """Highest frequency that is sent [Hz]."""
        return self.carrier_frequency + 0.5 * self.sample_rate

    @property
    def sweep(self) -> Sweep:
        """The band at once, in the middle of a symbol."""
        return sweep_of(self)

    def interleaved(self, turn: int, count: int) -> Ofdm:
        """Return the waveform with every so many of its sent subcarriers, from a turn on, with data of their own.

        Data drawn from a seed is that of a seed that `data_seed` and the turn make together.
        """
        changes: dict[str, object] = {"comb": self.comb * count, "comb_offset": self.comb_offset + turn * self.comb}
        if self.data_phases_deg is not None:
            changes["data_phases_deg"] = tuple(row[turn::count] for row in self.data_phases_deg)
        else:
            changes["data_seed"] = int(np.random.SeedSequence((self.data_seed, turn)).generate_state(1)[0])
        return self.with_(**changes)

    def chirps(self, first: int, count: int) -> Ofdm:
        """Return the waveform with some of its symbols only; they keep their data."""
        changes: dict[str, object] = {"num_chirps": count, "first_symbol": self.first_symbol + first}
        if self.data_phases_deg is not None:
            own = self.data_phases_deg
            changes |= {
                "first_symbol": 0,
                "data_phases_deg": own if len(own) == 1 else own[self.first_symbol :][first:][:count],
            }
        return self.with_(**changes)


class Pmcw(_Symbols):
    """Phase-modulated continuous wave: each chirp is a phase code, repeated and averaged.

    One sample a chip, in the band of the chip rate (ideal Nyquist pulses). Without a prefix the code is sent all the
    time, so that echoes of one period fall into the next: range is ambiguous by the code's length, and nothing else
    happens. A pair of codes that alternates (``"golay"``) needs a prefix.

    Raises
    ------
    ParameterRangeError
        If a value is outside its range, or there is no such code of that length.

    References
    ----------
    .. [1] V. Giannini et al., "A 79 GHz phase-modulated 4 GHz-BW CW radar transmitter in 28 nm CMOS", IEEE J.
       Solid-State Circuits 49(12), 2014.
    """

    kind: Literal["pmcw"] = "pmcw"
    chip_rate: Hertz = Field(300e6, gt=0.0, le=2e9, description="chips a second, and complex samples a second [Hz]")
    code: Literal["m_sequence", "apas", "gold", "zadoff_chu", "golay", "own"] = Field(
        "m_sequence", description="phases of the chips; apas: almost perfect autocorrelation sequence"
    )
    code_length: int = Field(511, ge=2, le=65536, description="chips of a period")
    code_index: int = Field(1, ge=0, description="which Gold code; root of a Zadoff-Chu sequence")
    code_phases_deg: tuple[Degrees, ...] | None = Field(None, description="of the chips of an own code [deg]")
    repetitions: int = Field(20, ge=1, description="periods of the code that the receiver averages into a chirp")
    prefix_chips: int = Field(
        0, ge=0, description="chips at the end of the code that are sent before the first period of a chirp"
    )

    _quiet = ("code_index", "prefix_chips")

    @model_validator(mode="after")
    def _check(self) -> Pmcw:
        if self.code == "golay" and not 0 < self.prefix_chips <= self.code_length:
            raise ValueError(
                f"prefix_chips of 1 to {self.code_length} where two codes take turns; it is {self.prefix_chips}: take "
                "as many as the delay of the farthest echo has chips"
            )
        _ = self.chips  # refuses lengths that the code does not have
        return self

    @property
    def chips(self) -> Complex:
        """Chips of magnitude 1, shape (num_codes, code_length); two codes take turns."""
        return codes.chips_of(self.code, self.code_length, self.code_index, self.code_phases_deg)

    @property
    def num_samples(self) -> int:
        """Complex samples of a chirp, one a chip."""
        return self.code_length

    @property
    def num_range_bins(self) -> int:
        """Range bins without zero padding, one a chip."""
        return self.code_length

    @property
    def sample_rate(self) -> float:
        """Complex sampling frequency [Hz]."""
        return self.chip_rate

    @property
    def noise_bandwidth(self) -> float:
        """Of the noise in a sample, which is a mean over `repetitions` [Hz]."""
        return self.chip_rate / self.repetitions

    @property
    def spacing(self) -> float:
        """From line to line of the code's spectrum [Hz]."""
        return self.chip_rate / self.code_length

    @property
    def sent(self) -> npt.NDArray[np.intp]:
        """All lines of the code's spectrum."""
        return np.arange(self.code_length)

    @property
    def used(self) -> npt.NDArray[np.intp]:
        """All lines of the code's spectrum."""
        return self.sent

    @property
    def spectrum(self) -> Complex:
        """Strengths of the lines of the code's spectrum, power 1 in all, shape (num_chirps or 1, code_length)."""
        chips = self.chips
        lines = np.fft.fftshift(np.fft.fft(chips, axis=1), axes=1) / self.code_length
        return lines if len(chips) == 1 else lines[np.arange(self.num_chirps) % len(chips)]

    @property
    def prefix_time(self) -> float:
        """Duration of what is sent of the same code before it is sampled [s]; infinite for a code sent all the time."""
        return self.prefix_chips / self.chip_rate if self.prefix_chips else math.inf

    @property
    def divides(self) -> bool:
        """False: the receiver correlates."""
        return False

    @property
    def sampled_bandwidth(self) -> float:
        """Bandwidth of the chips [Hz]."""
        return self.chip_rate

    @property
    def chirp_interval(self) -> float:
        """Time from chirp to chirp [s]: all repetitions and the prefix."""
        return (self.prefix_chips + self.repetitions * self.code_length) / self.chip_rate

    @property
    def top_frequency(self) -> float:
        """Highest frequency that is sent [Hz]."""
        return self.carrier_frequency + 0.5 * self.chip_rate

    @property
    def sweep(self) -> Sweep:
        """The band at once, in the middle of a chirp."""
        return sweep_of(self)

    def chirps(self, first: int, count: int) -> Pmcw:
        """Return the waveform with some of its chirps only; those of a pair of codes come in pairs."""
        if self.code == "golay" and first % 2:
            raise ParameterRangeError(
                "first chirp of a block", first, "an even number where two codes take turns", "an even chirps_per_block"
            )
        return self.with_(num_chirps=count)


AT_ONCE = 1e15
"""Samples a second of a sweep that takes no time: all tones of a symbol are at one time."""


def sweep_of(waveform: Coded, wait: float | None = None) -> Sweep:
    """Return the tones that a receiver uses as a sweep that takes no time, some time after the chirp's start [s].

    The default is the middle of what is sampled.
    """
    used, period = waveform.used, 1.0 / waveform.spacing
    step = waveform.spacing * float(used[1] - used[0] if len(used) > 1 else 1)
    lowest = waveform.carrier_frequency + waveform.spacing * (float(used[0]) - waveform.num_samples // 2)
    if wait is None:
        wait = window_start(waveform) + 0.5 * (waveform.repetitions * period - 1.0 / waveform.sample_rate)
    return Sweep(lowest, step * AT_ONCE, 0.0, 0.0, 0.0, wait)


def window_start(waveform: Coded) -> float:
    """Return when the receiver's first sample of a chirp is taken after its start [s]."""
    return waveform.prefix_time if math.isfinite(waveform.prefix_time) else 0.0
