"""What a radio is that talks to stations: carrier, subcarriers, antenna arrays, and where the stations are."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.spec import FieldValue, Spec
from scarl_sionna.core.units import SPEED_OF_LIGHT, Hertz, Metres, MetresPerSecond, Unit

from .place import fields_of_pose

Wavelengths = Annotated[float, Unit("wavelengths")]


class RadioArray(Spec):
    """Antennas of a radio or a station: a planar array of Sionna RT, in the y-z plane of its frame, x forward.

    References
    ----------
    .. [1] Sionna RT, ``sionna.rt.PlanarArray``: patterns, polarisations and the order of the antennas are its.
    """

    num_rows: int = Field(1, ge=1, le=64, description="antennas along z")
    num_columns: int = Field(1, ge=1, le=64, description="antennas along y")
    vertical_spacing: Wavelengths = Field(0.5, gt=0.0, description="from row to row [wavelengths]")
    horizontal_spacing: Wavelengths = Field(0.5, gt=0.0, description="from column to column [wavelengths]")
    pattern: Literal["iso", "dipole", "hw_dipole", "tr38901"] = Field(
        "iso", description="of each antenna: isotropic, short or half-wave dipole along z, sector of 3GPP TR 38.901"
    )
    polarization: Literal["V", "H", "VH", "cross"] = Field(
        "V", description="'VH' and 'cross' (slanted by -45 and 45 deg) are two antennas at each place"
    )

    @property
    def num_antennas(self) -> int:
        """Number of antennas, those of both polarisations."""
        return self.num_rows * self.num_columns * (2 if self.polarization in ("VH", "cross") else 1)


class RadioStation(Spec):
    """The other end of a link: a base station that stands in the world, or an antenna on an actor.

    The short form ``pose=ss.Pose(...)`` stands for `position` and `quaternion`.

    Raises
    ------
    ParameterRangeError
        If a velocity stands beside an actor, or the quaternion is zero.

    Examples
    --------
    >>> mast = RadioStation(name="mast", position=(30.0, 8.0, 6.0))
    >>> car = RadioStation(name="car ahead", actor="lead", position=(0.0, 0.0, 1.6))
    """

    name: str = Field(min_length=1, max_length=80, description="unique among the stations of a radio")
    actor: str | None = Field(None, description="that it rides on; None: it has a place in the world")
    position: tuple[Metres, Metres, Metres] = Field(
        (0.0, 0.0, 0.0), description="on the actor, or in the world at time 0 [m]"
    )
    quaternion: tuple[float, float, float, float] = Field(
        (1.0, 0.0, 0.0, 0.0), description="of its axes on the actor, or in the world: w, x, y, z"
    )
    velocity: tuple[MetresPerSecond, MetresPerSecond, MetresPerSecond] = Field(
        (0.0, 0.0, 0.0),
        description="of one that rides on no actor, world axes [m/s]; straight on from its position at time 0",
    )

    @model_validator(mode="before")
    @classmethod
    def _of_pose(cls, data: FieldValue) -> FieldValue:
        return fields_of_pose(data)

    @model_validator(mode="after")
    def _check(self) -> RadioStation:
        if self.actor is not None and any(self.velocity):
            raise ValueError("no velocity beside actor: the station moves with it")
        if sum(value * value for value in self.quaternion) < 1e-12:
            raise ValueError("quaternion that is not all zero")
        return self

    @property
    def pose(self) -> Pose:
        """Where it is: actor_from_station, or world_from_station."""
        return Pose(np.array(self.position), np.array(self.quaternion))


class RadioSpec(Spec):
    """A radio on the vehicle and the stations that it talks to at one carrier.

    What is computed is the channel between its antennas and those of every station; power, noise and waveform are not.

    Raises
    ------
    ParameterRangeError
        If two stations have one name, or the band reaches down to zero frequency.

    Examples
    --------
    >>> radio = RadioSpec(frequency=5.9e9, stations=(RadioStation(name="mast", position=(30.0, 8.0, 6.0)),))
    """

    frequency: Hertz = Field(5.9e9, ge=1e8, le=1e12, description="carrier, the middle of the band [Hz]")
    num_subcarriers: int = Field(64, ge=1, le=65_536, description="frequencies of the frequency response")
    subcarrier_spacing: Hertz = Field(156.25e3, gt=0.0, description="from one of them to the next [Hz]")
    array: RadioArray = Field(RadioArray(), description="antennas of the radio itself")
    station_array: RadioArray = Field(RadioArray(), description="antennas of every station")
    stations: tuple[RadioStation, ...] = Field(min_length=1, max_length=1024, description="the other ends")

    _derived = (("wavelength", "m"), ("bandwidth", "Hz"))

    @model_validator(mode="after")
    def _check(self) -> RadioSpec:
        names = [station.name for station in self.stations]
        if repeated := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"stations of different names; '{repeated[0]}' stands there more than once")
        if self.bandwidth >= 2.0 * self.frequency:
            raise ValueError("a band above zero frequency; take fewer or closer subcarriers")
        return self

    @property
    def wavelength(self) -> float:
        """Of the carrier [m]."""
        return SPEED_OF_LIGHT / self.frequency

    @property
    def bandwidth(self) -> float:
        """Number of subcarriers times their spacing [Hz]."""
        return self.num_subcarriers * self.subcarrier_spacing

    @property
    def subcarrier_frequencies(self) -> npt.NDArray[np.float64]:
        """Frequencies of the subcarriers from the carrier, shape (num_subcarriers,) [Hz].

        For an even number they reach from ``-num_subcarriers / 2`` to ``num_subcarriers / 2 - 1`` spacings.
        """
        return (
            np.asarray(np.arange(self.num_subcarriers) - self.num_subcarriers // 2, dtype=np.float64)
            * self.subcarrier_spacing
        )
