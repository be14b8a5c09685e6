"""What each pair of antennas receives by each path, where antennas are described one by one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import dbm_to_watt
from scarl_sionna.signal.antenna import antenna_fields

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
    """

    a: Complex
    tx: list[Complex]
    rx: list[Complex]
    scale: float

    @classmethod
    def of(
        cls, a: Complex, tx_vector: Array, rx_vector: Array, radar: RadarSpec, receiver: RadarSpec | None = None
    ) -> PairFields:
        """Return the fields of a radar's antennas, or from the transmitters of one to the receivers of another.

        `tx_vector` and `rx_vector`, shape (num_paths, 3), are where each path leaves and from where it arrives, in the
        frames of the transmitter and of the receiver. Directions are those of the array centres.
        """
        heard = receiver or radar
        tx = through_radome(antenna_fields(radar.array.tx, tx_vector), radar, radar.tx_array, tx_vector)
        rx = through_radome(antenna_fields(heard.array.rx, rx_vector), heard, heard.rx_array, rx_vector)
        return cls(a, tx, rx, float(np.sqrt(dbm_to_watt(radar.front_end.tx_power_dbm))))

    def pair(self, tx: int, rx: int) -> Complex:
        """Return the amplitude of the field that a pair receives by each path [sqrt(W)], shape (num_paths,)."""
        return np.asarray(self.scale * np.einsum("pi,pij,pj->p", self.rx[rx], self.a, self.tx[tx]))

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
