"""What each pair of antennas receives by each path, where antennas are described one by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.antennas.element import AntennaElement
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import dbm_to_watt
from scarl_sionna.signal.antenna import antenna_fields, element_field

from .radome import through_radome

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class PairFields:
    """Polarimetric transfer of paths, and the far fields of the antennas along them.

    Attributes
    ----------
    a : ndarray of complex128, shape (num_paths, 2, 2)
        As in :class:`RadarPaths`.
    tx, rx : list of ndarray of complex128, shape (num_paths, 2)
        Of every antenna, parts along theta-hat and phi-hat; equal antennas share one array.
    scale : float
        Root of the transmitted power [sqrt(W)].
    slopes : tuple of two ndarray of complex128, shape (num_paths, 3, 2, 2), or None
        Changes of `a` per metre off the arrays' centres, as in :class:`RadarPaths` [1/m].
    arms : tuple of ndarray of float64, shape (num_tx, 3) and (num_rx, 3)
        Antennas as seen from the arrays' centres [m]; used with `slopes`.
    """

    a: Complex
    tx: list[Complex]
    rx: list[Complex]
    scale: float
    slopes: tuple[Complex, Complex] | None = None
    arms: tuple[Array, Array] | None = None

    @classmethod
    def of(
        cls,
        a: Complex,
        tx_vector: Array,
        rx_vector: Array,
        radar: RadarSpec,
        receiver: RadarSpec | None = None,
        slopes: tuple[Complex, Complex] | None = None,
    ) -> PairFields:
        """Return the fields of a radar's antennas, or from the transmitters of one to the receivers of another.

        `tx_vector` and `rx_vector`, shape (num_paths, 3), are where each path leaves and from where it arrives, in the
        frames of the transmitter and of the receiver, [m] with `slopes`. Directions are those of the array centres;
        with `slopes` those of each antenna, but through a radome.
        """
        heard = receiver or radar
        scale = float(np.sqrt(dbm_to_watt(radar.front_end.tx_power_dbm)))
        ends = ((radar, radar.array.tx, radar.tx_array, tx_vector), (heard, heard.array.rx, heard.rx_array, rx_vector))
        sent, arrived = (
            _of_antennas(elements, arms, vector)
            if slopes is not None and spec.array.radome is None
            else through_radome(antenna_fields(elements, vector), spec, arms, vector)
            for spec, elements, arms, vector in ends
        )
        return cls(a, sent, arrived, scale, slopes, (radar.tx_array, heard.rx_array))

    def pair(self, tx: int, rx: int) -> Complex:
        """Return the amplitude of the field that a pair receives by each path [sqrt(W)], shape (num_paths,)."""
        a = self.a
        if self.slopes is not None and self.arms is not None:
            for slope, arm in zip(self.slopes, (self.arms[0][tx], self.arms[1][rx]), strict=True):
                a = a + np.einsum("pkij,k->pij", slope, arm)
        return np.asarray(self.scale * np.einsum("pi,pij,pj->p", self.rx[rx], a, self.tx[tx]))

    def root_mean_square(self) -> Complex:
        """Return the root of the mean power of all pairs [sqrt(W)], shape (num_paths,), real."""
        power = np.zeros(len(self.a))
        known: dict[tuple[int, int], Array] = {}
        for tx, sent in enumerate(self.tx):
            for rx, heard in enumerate(self.rx):
                key = id(sent), id(heard)
                if key not in known:
                    known[key] = np.abs(self.pair(tx, rx)) ** 2
                power += known[key]
        return np.sqrt(power / (len(self.tx) * len(self.rx))) + 0j


def _of_antennas(elements: Sequence[AntennaElement], arms: Array, vector: Array) -> list[Complex]:
    """Return the far field of each antenna along its own directions; `vector` are those of the centre [m]."""
    return [element_field(one, vector - arm) for one, arm in zip(elements, arms, strict=True)]
