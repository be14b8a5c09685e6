"""What a radar receives by its paths: transfer, antennas and transmitted power together."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import dbm_to_watt
from scarl_sionna.signal.antenna import boresights, field_gain, largest_field_gain
from scarl_sionna.signal.noise import angle_cell_noise_power

from .pair_fields import PairFields, strongest
from .paths import RadarPaths

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


def received_amplitude(
    a: Complex, tx_vector: Array, rx_vector: Array, radar: RadarSpec, receiver: RadarSpec | None = None
) -> Complex:
    """Return the amplitude of the field that one antenna pair receives by each path, without the phase over the length.

    Where antennas are described one by one, the root mean square of all pairs.

    Parameters
    ----------
    a : ndarray of complex128, shape (num_paths, 2, 2)
        Polarimetric transfer, as in :class:`RadarPaths`.
    tx_vector, rx_vector : ndarray of float64, shape (num_paths, 3)
        Where each path leaves and from where it arrives, of any length (the direction counts), in the frames of the
        transmitter and of the receiver.
    radar : RadarSpec
        Its polarisation, pattern and transmitted power.
    receiver : RadarSpec, optional
        Another radar that receives: its polarisation and pattern count at that end.

    Returns
    -------
    ndarray of complex128, shape (num_paths,)
        [sqrt(W)].

    References
    ----------
    .. [1] M. I. Skolnik, *Introduction to Radar Systems*, 3rd ed., 2001, Eq. (1.6).
    """
    sent, heard = radar.array, (receiver or radar).array
    if not (sent.is_uniform and heard.is_uniform):
        return PairFields.of(a, tx_vector, rx_vector, radar, receiver).root_mean_square()
    gain = field_gain(sent.pattern, tx_vector)
    alike = rx_vector is tx_vector and heard.pattern is sent.pattern
    gain = gain * (gain if alike else field_gain(heard.pattern, rx_vector))
    entry = "VH".index(heard.polarization), "VH".index(sent.polarization)
    return np.asarray(a[:, entry[0], entry[1]] * (gain * np.sqrt(dbm_to_watt(radar.front_end.tx_power_dbm))))


def strongest_amplitude(
    a: Complex, tx_vector: Array, rx_vector: Array, radar: RadarSpec, free: tuple[bool, bool]
) -> Array:
    """Return the largest amplitude that one antenna pair can receive by each path, where mirrors turn polarisations.

    Parameters
    ----------
    a, tx_vector, rx_vector, radar
        As for :func:`received_amplitude`.
    free : tuple of two bools
        Whether the polarisation that the transmitter sends and the receiver hears may be any, see
        :func:`.pair_fields.strongest`; else it is the radar's.

    Returns
    -------
    ndarray of float64, shape (num_paths,)
        [sqrt(W)].

    Notes
    -----
    The bilinear form of the fields sent and heard, at its largest over those that are free; see
    :func:`.pair_fields.strongest`.

    References
    ----------
    .. [1] G. H. Golub, C. F. Van Loan, *Matrix Computations*, 4th ed., 2013, section 2.4.
    """
    array = radar.array
    if not array.is_uniform:
        return PairFields.of(a, tx_vector, rx_vector, radar).largest(free)
    gain = field_gain(array.pattern, tx_vector)
    gain = gain * (gain if rx_vector is tx_vector else field_gain(array.pattern, rx_vector))
    one = np.eye(2)["VH".index(array.polarization)]
    fields = np.broadcast_to(one, (len(a), 2))
    return np.asarray(strongest(a, fields, fields, free) * (gain * np.sqrt(dbm_to_watt(radar.front_end.tx_power_dbm))))


def path_amplitude(paths: RadarPaths, radar: RadarSpec) -> Complex:
    """Return the amplitude of each path for an antenna pair at the array centres [sqrt(W)], shape (num_paths,).

    By definition, :func:`received_amplitude` with the vectors of the array centres.
    """
    tx_vector, rx_vector = paths.end_vectors()
    local = tx_vector @ paths.world_from_tx.rotation, rx_vector @ paths.world_from_rx.rotation
    return received_amplitude(paths.a, *local, radar)


def received_power(paths: RadarPaths, radar: RadarSpec) -> Array:
    """Return the power that one antenna pair at the array centres receives by each path [W], shape (num_paths,).

    By definition, the square of the magnitude of :func:`path_amplitude`.
    """
    return np.asarray(np.abs(path_amplitude(paths, radar)) ** 2)


def path_unit(radar: RadarSpec) -> float:
    """Return the power over the noise of a cell of a path that loses nothing, at the antennas' largest gain."""
    gain = float(largest_field_gain(radar.array, boresights(radar.array)).max())
    return dbm_to_watt(radar.front_end.tx_power_dbm) / angle_cell_noise_power(radar) * gain**4
