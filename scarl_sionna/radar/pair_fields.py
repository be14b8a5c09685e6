"""What each pair of antennas receives by each path, where antennas are described one by one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
        return np.asarray(self._mean(lambda tx, rx: np.abs(self.pair(tx, rx))), dtype=np.complex128)

    def largest(self, free: tuple[bool, bool]) -> Array:
        """Return the root of the mean over all pairs of :func:`strongest` without `slopes` [sqrt(W)], (num_paths,)."""
        return self._mean(lambda tx, rx: self.scale * strongest(self.a, self.tx[tx], self.rx[rx], free))

    def _mean(self, heard_by: Callable[[int, int], Array]) -> Array:
        power = np.zeros(len(self.a))
        known: dict[tuple[int, int], Array] = {}
        for tx, sent in enumerate(self.tx):
            for rx, heard in enumerate(self.rx):
                key = id(sent), id(heard)
                if key not in known:
                    known[key] = heard_by(tx, rx) ** 2
                power += known[key]
        return np.asarray(np.sqrt(power / (len(self.tx) * len(self.rx))))


def strongest(a: Complex, sent: Complex | Array, heard: Complex | Array, free: tuple[bool, bool]) -> Array:
    r"""Return the largest amplitude that antennas can receive whose polarisation is free at some ends.

    Parameters
    ----------
    a : ndarray of complex128, shape (num_paths, 2, 2)
    sent, heard : ndarray of float64 or complex128, shape (num_paths, 2)
        Far fields.
    free : tuple of two bools
        Whether the field sent, and the one heard, may be any of the same size.

    Returns
    -------
    ndarray of float64, shape (num_paths,)

    Notes
    -----
    .. math:: |h^T A s|,\quad |h|\,\|A s\|,\quad |s|\,\|A^T h\|,\quad |h|\,|s|\,\sigma_{max}(A)

    with none of them free, h, s, and both.

    References
    ----------
    .. [1] G. H. Golub, C. F. Van Loan, *Matrix Computations*, 4th ed., 2013, section 2.4.
    """
    if all(free):
        squares = np.sum(np.abs(a) ** 2, axis=(1, 2))
        determinant = np.abs(a[:, 0, 0] * a[:, 1, 1] - a[:, 0, 1] * a[:, 1, 0])
        largest = np.sqrt(0.5 * (squares + np.sqrt(np.maximum(squares**2 - 4.0 * determinant**2, 0.0))))
        return np.asarray(largest * _size(sent) * _size(heard))
    if free[1]:
        return np.asarray(_size(np.einsum("pij,pj->pi", a, sent)) * _size(heard))
    if free[0]:
        return np.asarray(_size(np.einsum("pi,pij->pj", heard, a)) * _size(sent))
    return np.abs(np.einsum("pi,pij,pj->p", heard, a, sent))


def _size(field: Complex | Array) -> Array:
    return np.asarray(np.linalg.norm(field, axis=-1))


def _of_antennas(elements: Sequence[AntennaElement], arms: Array, vector: Array) -> list[Complex]:
    """Return the far field of each antenna along its own directions; `vector` are those of the centre [m]."""
    return [element_field(one, vector - arm) for one, arm in zip(elements, arms, strict=True)]
