"""Multiplexing: how the chirps of several transmitters share a frame.

Raw data has one row a chirp of any transmitter: chirp m of transmitter i is row ``m * num_tx + i``. Only this module
knows one kind from another; the others ask :class:`Multiplexing` when a transmitter sends.
"""

from __future__ import annotations

from typing import Annotated, Literal, Protocol

from pydantic import BeforeValidator, Field

from scarl_sionna.core.errors import ParameterRangeError, did_you_mean
from scarl_sionna.core.spec import Spec


class Multiplexing(Protocol):
    """What every multiplexing answers."""

    @property
    def kind(self) -> str:
        """Name in files."""

    def num_rows(self, num_chirps: int, num_tx: int) -> int:
        """Return the rows of a receiver's raw data in a frame of `num_chirps` chirps a transmitter."""

    def doppler_interval(self, chirp_interval: float, num_tx: int) -> float:
        """Return the time between two chirps of a transmitter [s]; `chirp_interval` [s] is from chirp to chirp."""

    def tx_delay(self, tx: int, chirp_interval: float) -> float:
        """Return the start of a transmitter's chirps after the first transmitter's [s]."""


class IdealMimo(Spec):
    """All transmitters send at once and are told apart perfectly, as in SCaRL: rows of one chirp share their time."""

    kind: Literal["ideal"] = "ideal"

    def num_rows(self, num_chirps: int, num_tx: int) -> int:
        """Return the rows of a receiver's raw data in a frame of `num_chirps` chirps a transmitter."""
        return num_chirps * num_tx

    def doppler_interval(self, chirp_interval: float, num_tx: int) -> float:
        """Return the time between two chirps of the same transmitter [s]: from chirp to chirp."""
        return chirp_interval

    def tx_delay(self, tx: int, chirp_interval: float) -> float:
        """Return the start of a transmitter's chirps after the first transmitter's [s]: 0."""
        return 0.0


class Tdm(Spec):
    """Time division: the transmitters follow each other in order, one chirp interval apart."""

    kind: Literal["tdm"] = "tdm"

    def num_rows(self, num_chirps: int, num_tx: int) -> int:
        """Return the rows of a receiver's raw data in a frame of `num_chirps` chirps a transmitter."""
        return num_chirps * num_tx

    def doppler_interval(self, chirp_interval: float, num_tx: int) -> float:
        """Return the time between two chirps of the same transmitter [s]: a turn of all transmitters."""
        return chirp_interval * num_tx

    def tx_delay(self, tx: int, chirp_interval: float) -> float:
        """Return the start of a transmitter's chirps after the first transmitter's [s]."""
        return tx * chirp_interval


KINDS: tuple[str, ...] = tuple(item.model_fields["kind"].default for item in (IdealMimo, Tdm))
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


AnyMultiplexing = Annotated[IdealMimo | Tdm, Field(discriminator="kind"), BeforeValidator(_by_name)]
"""The kinds that a radar can have, told apart by `kind`; the name alone, ``"tdm"``, is a short form."""
