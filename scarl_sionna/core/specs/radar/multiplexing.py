"""Multiplexing: how the chirps of several transmitters share a frame.

Raw data has one row a chirp. Where the transmitters take turns in order, or are told apart perfectly, chirp m of
transmitter i is row ``m * num_tx + i``. Coded kinds number the rows as chirps follow in time: every row is the sum of
all transmitters, each with its code, which is that of the beat signal. Only this module knows one kind from another;
the others ask :class:`Multiplexing`.
"""

from __future__ import annotations

from typing import Annotated, Literal, Protocol

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator, Field

from scarl_sionna.core.errors import ParameterRangeError, SpecError, did_you_mean
from scarl_sionna.core.spec import Spec, WithoutNone
from scarl_sionna.core.units import Degrees

from .waveform import Waveform
from .waveforms.coded import Ofdm

Codes = npt.NDArray[np.complex128]


class Multiplexing(Protocol):
    """What every multiplexing answers."""

    @property
    def kind(self) -> str:
        """Name in files."""

    @property
    def is_coded(self) -> bool:
        """Whether rows are chirps in time, each the sum of the transmitters by :meth:`codes`."""

    def num_rows(self, num_chirps: int, num_tx: int) -> int:
        """Return the rows of a receiver's raw data in a frame of `num_chirps` chirps a transmitter."""

    def doppler_interval(self, chirp_interval: float, num_tx: int) -> float:
        """Return the time between two rows of a channel's slow time [s]; `chirp_interval` is from chirp to chirp."""

    def tx_delay(self, tx: int, chirp_interval: float) -> float:
        """Return the start of a transmitter's chirps after the first transmitter's [s]."""

    def codes(self, num_chirps: int, num_tx: int) -> Codes:
        """Return each transmitter's factor in each row of the raw data, shape (num_rows, num_tx)."""

    def code_period(self, num_tx: int) -> int | None:
        """Return after how many chirps the codes repeat; None if they do not, or there are none."""

    def unused_codes(self, num_tx: int) -> Codes:
        """Return the codes of a period that no transmitter sends, shape (code_period, num_unused)."""

    def check(self, num_chirps: int, num_tx: int) -> None:
        """Raise if a frame of so many chirps and transmitters cannot be coded."""

    @property
    def shares_band(self) -> bool:
        """Whether all transmitters send the same frequencies."""

    def waveform_of(self, waveform: Waveform, tx: int, num_tx: int) -> Waveform:
        """Return what one transmitter sends of the radar's waveform."""

    def tx_frequency(self, waveform: Waveform, tx: int) -> float:
        """Return how much higher than the first transmitter another sends [Hz]."""


class _OneBand(Spec):
    """What is common to the kinds whose transmitters all send the same frequencies."""

    @property
    def shares_band(self) -> bool:
        """Whether all transmitters send the same frequencies."""
        return True

    def waveform_of(self, waveform: Waveform, tx: int, num_tx: int) -> Waveform:
        """Return what one transmitter sends of the radar's waveform: all of it."""
        return waveform

    def tx_frequency(self, waveform: Waveform, tx: int) -> float:
        """Return how much higher than the first transmitter another sends [Hz]: 0."""
        return 0.0


class _Plain(_OneBand):
    """What is common to the kinds whose rows hold one transmitter each, in order."""

    @property
    def is_coded(self) -> bool:
        """Whether rows are chirps in time, each the sum of the transmitters by :meth:`codes`."""
        return False

    def num_rows(self, num_chirps: int, num_tx: int) -> int:
        """Return the rows of a receiver's raw data in a frame of `num_chirps` chirps a transmitter."""
        return num_chirps * num_tx

    def codes(self, num_chirps: int, num_tx: int) -> Codes:
        """Return 1 where a row is the transmitter's, shape (num_rows, num_tx)."""
        return np.tile(np.eye(num_tx, dtype=np.complex128), (num_chirps, 1))

    def code_period(self, num_tx: int) -> int | None:
        """Return None: there is no code that repeats."""
        return None

    def unused_codes(self, num_tx: int) -> Codes:
        """Return no code, shape (0, 0)."""
        return np.zeros((0, 0), dtype=np.complex128)

    def check(self, num_chirps: int, num_tx: int) -> None:
        """Every frame can be sent."""


class IdealMimo(_Plain):
    """All transmitters send at once and are told apart perfectly, as in SCaRL: rows of one chirp share their time."""

    kind: Literal["ideal"] = "ideal"

    def doppler_interval(self, chirp_interval: float, num_tx: int) -> float:
        """Return the time between two chirps of the same transmitter [s]: from chirp to chirp."""
        return chirp_interval

    def tx_delay(self, tx: int, chirp_interval: float) -> float:
        """Return the start of a transmitter's chirps after the first transmitter's [s]: 0."""
        return 0.0


class Tdm(_Plain, WithoutNone):
    """Time division: the transmitters follow each other, one chirp interval apart.

    In order, the velocity is unambiguous within ``wavelength / (4 num_tx chirp_interval)``. In random order every turn
    of all transmitters is shuffled: a transmitter's chirps are at irregular times, its velocity is unambiguous within
    ``wavelength / (4 chirp_interval)``, and each target has a noise-like floor over all other velocities, ``(num_tx -
    1) / (num_tx num_chirps)`` of its power.

    References
    ----------
    .. [1] J. Li, P. Stoica, *MIMO Radar Signal Processing*, Wiley, 2009.
    """

    kind: Literal["tdm"] = "tdm"
    order_seed: int | None = Field(None, ge=0, description="of a random order in each turn; None: in order")

    @property
    def is_coded(self) -> bool:
        """Whether rows are chirps in time, each the sum of the transmitters by :meth:`codes`."""
        return self.order_seed is not None

    def doppler_interval(self, chirp_interval: float, num_tx: int) -> float:
        """Return the time between two rows of a channel's slow time [s].

        In order a turn of all transmitters; in random order a chirp: a channel's rows without its transmitter are zero.
        """
        return chirp_interval if self.is_coded else chirp_interval * num_tx

    def tx_delay(self, tx: int, chirp_interval: float) -> float:
        """Return the start of a transmitter's chirps after the first transmitter's [s]; 0 in random order."""
        return 0.0 if self.is_coded else tx * chirp_interval

    def codes(self, num_chirps: int, num_tx: int) -> Codes:
        """Return 1 where a row is the transmitter's, shape (num_rows, num_tx)."""
        out = np.tile(np.eye(num_tx, dtype=np.complex128), (num_chirps, 1))
        if self.is_coded:
            rng = np.random.default_rng(self.order_seed)
            turns = [rng.permutation(num_tx) + turn * num_tx for turn in range(num_chirps)]
            out = out[np.concatenate(turns)]
        return out


class _Coded(_OneBand):
    """What is common to the kinds whose transmitters send in every chirp, each with its code over slow time."""

    @property
    def is_coded(self) -> bool:
        """Whether rows are chirps in time, each the sum of the transmitters by :meth:`codes`."""
        return True

    def num_rows(self, num_chirps: int, num_tx: int) -> int:
        """Return the rows of a receiver's raw data: all transmitters send in every chirp."""
        return num_chirps

    def doppler_interval(self, chirp_interval: float, num_tx: int) -> float:
        """Return the time between two chirps of the same transmitter [s]: from chirp to chirp."""
        return chirp_interval

    def tx_delay(self, tx: int, chirp_interval: float) -> float:
        """Return the start of a transmitter's chirps after the first transmitter's [s]: 0."""
        return 0.0


class _Periodic(_Coded):
    """Codes that are columns of an orthogonal matrix, repeated over the frame; some columns stay unused."""

    def matrix(self, num_tx: int) -> Codes:
        """Return the orthogonal matrix of one period, shape (code_period, code_period), of unit entries."""
        raise NotImplementedError

    def code_period(self, num_tx: int) -> int | None:
        """Return after how many chirps the codes repeat."""
        return len(self.matrix(num_tx))

    def codes(self, num_chirps: int, num_tx: int) -> Codes:
        """Return each transmitter's factor in each row of the raw data, shape (num_chirps, num_tx)."""
        matrix = self.matrix(num_tx)
        return np.tile(matrix[:, :num_tx], (num_chirps // len(matrix), 1))

    def unused_codes(self, num_tx: int) -> Codes:
        """Return the codes of a period that no transmitter sends, shape (code_period, num_unused)."""
        return self.matrix(num_tx)[:, num_tx:]

    def check(self, num_chirps: int, num_tx: int) -> None:
        """Raise if the frame does not hold whole periods.

        Raises
        ------
        ParameterRangeError
            If `num_chirps` is no multiple of the code's length.
        """
        period = len(self.matrix(num_tx))
        if num_chirps % period:
            raise SpecError(
                type(self),
                ("waveform", "num_chirps"),
                num_chirps,
                f"a multiple of {period}, the period of {type(self).__name__} with {num_tx} transmitters",
                f"take {max(1, round(num_chirps / period)) * period}, or another multiplexing",
            )


class Ddm(_Periodic, WithoutNone):
    """Doppler division: transmitter i turns its phase by ``i / num_bands`` of a cycle from chirp to chirp.

    With `bands` it is ``bands[i] / num_bands`` of a cycle. The Doppler spectrum falls into ``num_bands = num_tx +
    num_empty_bands`` bands; a target shows once in each used band (one line a transmitter) and in none of the empty
    ones. Which bands are empty tells its velocity, within ``wavelength / (4 chirp_interval)``. Two targets at one range
    whose Doppler frequencies differ by a multiple of a band lie on each other: the stronger one is found.

    References
    ----------
    .. [1] F. Xu, S. A. Vorobyov, F. Yang, "Transmit beamspace DDMA based automotive MIMO radar", IEEE Trans. Veh.
       Technol. 71(2), 2022.
    """

    kind: Literal["ddm"] = "ddm"
    num_empty_bands: int = Field(1, ge=1, le=64, description="bands of the Doppler spectrum without a transmitter")
    bands: tuple[int, ...] | None = Field(
        None, description="band of each transmitter, from 0; None: one after the other"
    )

    def matrix(self, num_tx: int) -> Codes:
        """Return the phase progressions of all bands, those sent first, shape (num_bands, num_bands)."""
        bands = np.arange(num_tx + self.num_empty_bands)
        sent = bands[:num_tx] if self.bands is None else np.array(self.bands, dtype=np.int64)
        order = np.concatenate([sent, np.setdiff1d(bands, sent)])
        return np.exp(2j * np.pi * np.outer(bands, order) / len(bands))

    def check(self, num_chirps: int, num_tx: int) -> None:
        """Raise if the frame does not hold whole periods, or `bands` are not one of each transmitter.

        Raises
        ------
        ParameterRangeError
            If `num_chirps` is no multiple of the bands' number, or two transmitters have one band.
        """
        count = num_tx + self.num_empty_bands
        if self.bands is not None and not (
            len(self.bands) == num_tx == len(set(self.bands)) and min(self.bands) >= 0 and max(self.bands) < count
        ):
            raise SpecError(
                type(self),
                ("multiplexing", "bands"),
                self.bands,
                f"{num_tx} different bands of 0 to {count - 1}, one of each transmitter",
            )
        super().check(num_chirps, num_tx)


class Bpm(_Periodic):
    """Binary phases: the transmitters' signs follow the columns of a Hadamard matrix over blocks of chirps.

    A moving target leaves images at other velocities, a multiple of ``wavelength / (2 block_length chirp_interval)``
    away; the columns that no transmitter sends tell them from the target, as the empty bands of :class:`Ddm` do.
    Transmitters take first the columns whose number has an even count of binary ones. A velocity that is half of the
    interval off turns column i into i XOR 1: columns 0 and 1 would become each other, and nothing would tell the two
    velocities apart. So at least half of an image's power is in columns that nobody sends, as long as they are as many.

    References
    ----------
    .. [1] K. J. Horadam, *Hadamard Matrices and Their Applications*, Princeton University Press, 2007.
    """

    kind: Literal["bpm"] = "bpm"
    block_length: int | None = Field(
        None, ge=2, le=1024, description="chirps of a block, a power of 2 above num_tx; None: the smallest"
    )

    def matrix(self, num_tx: int) -> Codes:
        """Return the Hadamard matrix, its columns in the order of transmitters, shape (block_length, block_length)."""
        from scipy.linalg import hadamard  # 0.1 s, which a command line need not wait for

        natural = hadamard(self.block_length or 2 ** int(num_tx).bit_length()).astype(np.complex128)
        ones = [column.bit_count() % 2 for column in range(len(natural))]
        return np.asarray(natural[:, np.argsort(ones, kind="stable")])

    def check(self, num_chirps: int, num_tx: int) -> None:
        """Raise if there is no such code, or the frame does not hold whole periods.

        Raises
        ------
        ParameterRangeError
            If the code's length is no power of 2 above `num_tx`, or `num_chirps` no multiple of it.
        """
        length = self.block_length
        if length is not None and (length & (length - 1) or length <= num_tx):
            raise SpecError(
                type(self),
                ("multiplexing", "block_length"),
                length,
                f"a power of 2 above num_tx = {num_tx}: a column that nobody sends tells the velocity",
                f"take {2 ** int(num_tx).bit_length()}, or None",
            )
        super().check(num_chirps, num_tx)


class Cdm(_Coded):
    """Code division over slow time: each transmitter's phases follow a code as long as the frame.

    Seeded codes are orthogonal tones whose chirps are shuffled, the same way for all transmitters: in the cell of a
    target on a Doppler bin the others cancel (rectangular window); at every other velocity each leaves a noise-like
    floor of ``1 / num_chirps`` of its power. The velocity is unambiguous within ``wavelength / (4 chirp_interval)``.

    References
    ----------
    .. [1] J. Li, P. Stoica, *MIMO Radar Signal Processing*, Wiley, 2009.
    """

    kind: Literal["cdm"] = "cdm"
    code_seed: int = Field(0, ge=0, description="of the codes, where `phases_deg` gives none")
    phases_deg: tuple[tuple[Degrees, ...], ...] | None = Field(
        None, description="[deg] of each transmitter, in it of each chirp of the frame; None: seeded codes"
    )

    def codes(self, num_chirps: int, num_tx: int) -> Codes:
        """Return each transmitter's factor in each row of the raw data, shape (num_chirps, num_tx)."""
        if self.phases_deg is not None:
            return np.exp(1j * np.radians(np.array(self.phases_deg, dtype=np.float64).T))
        rng = np.random.default_rng(self.code_seed)
        shuffled, tones = rng.permutation(num_chirps), rng.permutation(num_chirps)[:num_tx]
        return np.exp(2j * np.pi * np.outer(shuffled, tones) / num_chirps)

    def code_period(self, num_tx: int) -> int | None:
        """Return None: the code is as long as the frame."""
        return None

    def unused_codes(self, num_tx: int) -> Codes:
        """Return no code, shape (0, 0)."""
        return np.zeros((0, 0), dtype=np.complex128)

    def check(self, num_chirps: int, num_tx: int) -> None:
        """Raise if the codes do not fit.

        Raises
        ------
        ParameterRangeError
            If there are fewer chirps than transmitters, or `phases_deg` has another shape.
        """
        if num_chirps < num_tx:
            allowed = f">= num_tx = {num_tx}, for orthogonal codes"
            raise SpecError(type(self), ("waveform", "num_chirps"), num_chirps, allowed)
        if self.phases_deg is None:
            return
        lengths = {len(row) for row in self.phases_deg}
        if len(self.phases_deg) != num_tx or lengths != {num_chirps}:
            shown = f"{len(self.phases_deg)} codes of {sorted(lengths)} chirps"
            allowed = f"{num_tx} codes of {num_chirps} chirps"
            raise SpecError(type(self), ("multiplexing", "phases_deg"), shown, allowed)


class Fdm(WithoutNone):
    """Frequency division of OFDM: the transmitters take turns over the subcarriers, all in every symbol.

    Transmitter i sends the subcarriers i, ``i + interleaving``, ..., with its whole power, and data of its own. At rest
    they are told apart perfectly; Doppler lets a subcarrier leak into others by its part of the spacing. Range is
    unambiguous over ``1 / interleaving`` as much, velocity as with one transmitter. What lies beyond is seen that much
    nearer, in a wrong direction: carriers differ, so that the phase between transmitters depends on range.

    References
    ----------
    .. [1] C. Sturm, Y. L. Sit, M. Braun, T. Zwick, "Spectrally interleaved multi-carrier signals for radar network
       applications and multi-input multi-output radar", IET Radar Sonar Navig. 7(3), 2013.
    """

    kind: Literal["fdm"] = "fdm"
    interleaving: int | None = Field(
        None, ge=1, description="every so many subcarriers are a transmitter's; None: as many as transmitters"
    )
    is_summed: bool = Field(True, description="False: receivers get each transmitter in rows of its own, for reference")

    _quiet = ("is_summed",)

    @property
    def is_coded(self) -> bool:
        """Whether rows are chirps in time, each the sum of the transmitters by :meth:`codes`."""
        return self.is_summed

    @property
    def shares_band(self) -> bool:
        """Whether all transmitters send the same frequencies: they do not."""
        return False

    def num_rows(self, num_chirps: int, num_tx: int) -> int:
        """Return the rows of a receiver's raw data: all transmitters send in every symbol."""
        return num_chirps if self.is_summed else num_chirps * num_tx

    def doppler_interval(self, chirp_interval: float, num_tx: int) -> float:
        """Return the time between two symbols of the same transmitter [s]: from symbol to symbol."""
        return chirp_interval

    def tx_delay(self, tx: int, chirp_interval: float) -> float:
        """Return the start of a transmitter's symbols after the first transmitter's [s]: 0."""
        return 0.0

    def codes(self, num_chirps: int, num_tx: int) -> Codes:
        """Return 1 for each transmitter that sends in a row, shape (num_rows, num_tx)."""
        if self.is_summed:
            return np.ones((num_chirps, num_tx), dtype=np.complex128)
        return np.tile(np.eye(num_tx, dtype=np.complex128), (num_chirps, 1))

    def code_period(self, num_tx: int) -> int | None:
        """Return None: there is no code that repeats."""
        return None

    def unused_codes(self, num_tx: int) -> Codes:
        """Return no code, shape (0, 0)."""
        return np.zeros((0, 0), dtype=np.complex128)

    def check(self, num_chirps: int, num_tx: int) -> None:
        """Raise if there are more transmitters than turns.

        Raises
        ------
        ParameterRangeError
            If `interleaving` is below `num_tx`.
        """
        if self.interleaving is not None and self.interleaving < num_tx:
            allowed = f">= num_tx = {num_tx}: subcarriers of its own for each transmitter"
            raise SpecError(type(self), ("multiplexing", "interleaving"), self.interleaving, allowed, "or None")

    def waveform_of(self, waveform: Waveform, tx: int, num_tx: int) -> Waveform:
        """Return what one transmitter sends: its subcarriers."""
        assert isinstance(waveform, Ofdm)  # checked with the radar
        return waveform.interleaved(tx, self.interleaving or num_tx)

    def tx_frequency(self, waveform: Waveform, tx: int) -> float:
        """Return how much higher than the first transmitter another sends [Hz]."""
        assert isinstance(waveform, Ofdm)  # checked with the radar
        return tx * waveform.comb * waveform.subcarrier_spacing


KINDS: tuple[str, ...] = tuple(item.model_fields["kind"].default for item in (IdealMimo, Tdm, Ddm, Bpm, Cdm, Fdm))
"""Names of all kinds."""


def _by_name(value: object) -> object:
    """Return the fields of a multiplexing that was given by its name alone."""
    if not isinstance(value, str):
        return value
    if value not in KINDS:
        raise ParameterRangeError(
            "multiplexing", repr(value), " or ".join(map(repr, KINDS)), did_you_mean(value, KINDS)
        )
    return {"kind": value}


AnyMultiplexing = Annotated[
    IdealMimo | Tdm | Ddm | Bpm | Cdm | Fdm, Field(discriminator="kind"), BeforeValidator(_by_name)
]
"""The kinds that a radar can have, told apart by `kind`; the name alone, ``"tdm"``, is a short form."""
