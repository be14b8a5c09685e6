"""Antennas of a radar: where they are, their pattern and polarisation."""

from __future__ import annotations

from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import SPEED_OF_LIGHT, Metres

from .antennas.element import AntennaElement
from .antennas.grid import GridPattern
from .antennas.radome import Radome
from .pattern import AntennaPattern, CosinePattern

Array = npt.NDArray[np.float64]
Position = tuple[Metres, Metres, Metres]

HALF_WAVE = SPEED_OF_LIGHT / 77e9 / 2.0
"""Half a wavelength at 77 GHz [m]."""


def uniform_line(count: int, spacing: float) -> tuple[Position, ...]:
    """Return `count` positions along y (left), centred [m]."""
    return tuple((0.0, float((index - (count - 1) / 2) * spacing), 0.0) for index in range(count))


class AntennaArray(Spec):
    """Transmit and receive antennas, all alike unless elements are given.

    Positions are in the radar frame: x boresight, y left, z up.

    The default is Table 1 of SCaRL: 3 transmitters and 4 receivers that make a line of 12 virtual elements half a
    wavelength apart at 77 GHz, half-power beam width +-45 deg in azimuth. The paper gives none in elevation; +-15 deg
    are this project's.

    Raises
    ------
    ParameterRangeError
        If a value is outside its range, or an antenna is farther than `max_array_extent` from the origin.

    References
    ----------
    .. [1] Nittur Ramesh et al., *SCaRL*, 2024, Table 1.
    """

    _quiet = ("tx_elements", "rx_elements", "radome")

    tx_positions: tuple[Position, ...] = Field(uniform_line(3, 4 * HALF_WAVE), min_length=1, description="[m]")
    rx_positions: tuple[Position, ...] = Field(uniform_line(4, HALF_WAVE), min_length=1, description="[m]")
    pattern: AntennaPattern = Field(
        CosinePattern(half_power_azimuth_deg=45.0, half_power_elevation_deg=15.0), description="of every antenna"
    )
    polarization: Literal["V", "H"] = Field("V", description="of every antenna: V along z, H along y at boresight")
    tx_elements: tuple[AntennaElement, ...] = Field(
        (), description="of each transmitter; one: of every one; empty: `pattern` and `polarization`"
    )
    rx_elements: tuple[AntennaElement, ...] = Field(
        (), description="of each receiver; one: of every one; empty: `pattern` and `polarization`"
    )
    radome: Radome | None = Field(None, description="radome or bumper in front of all antennas; None: none")
    max_array_extent: Metres = Field(
        1.0, gt=0.0, description="an antenna farther than this from the origin is refused [m]"
    )

    @model_validator(mode="after")
    def _check(self) -> AntennaArray:
        for name, positions in (("tx_positions", self.tx_positions), ("rx_positions", self.rx_positions)):
            for index, position in enumerate(positions):
                if np.linalg.norm(position) > self.max_array_extent:
                    raise ValueError(
                        f"{name}[{index}] = {position} m within {self.max_array_extent} m of the radar's origin; "
                        "positions are metres in the radar frame (raise max_array_extent for a larger array)"
                    )
        for name, own, count in (
            ("tx_elements", self.tx_elements, self.num_tx),
            ("rx_elements", self.rx_elements, self.num_rx),
        ):
            if len(own) not in (0, 1, count):
                raise ValueError(f"{name} of {count} antennas, of one that stands for all, or none; not of {len(own)}")
        if self.radome is not None:
            ahead = np.array([1.0, 0.0, 0.0])
            if float(ahead @ self.radome.frame[0]) <= 0.1:
                raise ValueError("a radome that the radar looks through: less tilt_deg and yaw_deg")
            places = np.concatenate([self.tx_positions, self.rx_positions])
            beyond = float(self.radome.heights(places).max())
            if beyond > -1e-4:
                raise ValueError(f"a radome in front of every antenna: one is {1e3 * beyond:.1f} mm beyond its face")
        return self

    @model_serializer(mode="wrap")
    def _without_elements(self, inner: SerializerFunctionWrapHandler) -> dict[str, object]:
        """Leave out what is not described, as files of the first versions have it."""
        return {
            name: value for name, value in inner(self).items() if name not in self._quiet or value not in ((), [], None)
        }

    @property
    def is_uniform(self) -> bool:
        """Whether every antenna has the array's pattern and polarisation, no phase over direction, and no radome."""
        phased = isinstance(self.pattern, GridPattern) and self.pattern.has_phase
        return not (self.tx_elements or self.rx_elements or phased or self.radome)

    @property
    def is_of_one_polarization(self) -> bool:
        """Whether all antennas send and hear V alone, or all H alone, so that no cross-polar echo is heard.

        What a radome turns aside.
        """
        kinds = {one.polarization for one in (*self.tx, *self.rx)}
        return kinds in ({"V"}, {"H"}) and not any(one.is_slanted for one in (*self.tx_elements, *self.rx_elements))

    @property
    def has_echo(self) -> bool:
        """Whether the radome's echo is in the raw data."""
        return self.radome is not None and self.radome.echo

    def without_echo(self) -> AntennaArray:
        """Return the array with a radome that sends nothing back, by definition of :class:`Radome`."""
        return self if self.radome is None else self.with_(radome=self.radome.with_(echo=False))

    @cached_property
    def tx(self) -> tuple[AntennaElement, ...]:
        """The transmit antennas, each with its pattern and polarisation."""
        return self._whole(self.tx_elements, self.num_tx)

    @cached_property
    def rx(self) -> tuple[AntennaElement, ...]:
        """The receive antennas, each with its pattern and polarisation."""
        return self._whole(self.rx_elements, self.num_rx)

    def _whole(self, elements: tuple[AntennaElement, ...], count: int) -> tuple[AntennaElement, ...]:
        given = elements or (AntennaElement(),)
        filled = tuple(
            one.with_(pattern=one.pattern or self.pattern, polarization=one.polarization or self.polarization)
            for one in given
        )
        return filled if len(filled) == count else filled * count

    @property
    def num_tx(self) -> int:
        """Number of transmit antennas."""
        return len(self.tx_positions)

    @property
    def num_rx(self) -> int:
        """Number of receive antennas."""
        return len(self.rx_positions)

    @property
    def num_virtual(self) -> int:
        """Number of transmit-receive pairs; pair (i, j) is channel ``i * num_rx + j``."""
        return self.num_tx * self.num_rx

    @cached_property
    def tx_array(self) -> Array:
        """Transmit positions, shape (num_tx, 3) [m, radar frame]."""
        return _frozen(self.tx_positions)

    @cached_property
    def rx_array(self) -> Array:
        """Receive positions, shape (num_rx, 3) [m, radar frame]."""
        return _frozen(self.rx_positions)


def _frozen(positions: tuple[Position, ...]) -> Array:
    """Return positions as an array that refuses to be written to: it is kept with the specification."""
    out = np.array(positions, dtype=np.float64)
    out.setflags(write=False)
    return out
