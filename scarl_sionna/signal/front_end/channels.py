"""Gains and phases of the channels, and the coupling of antennas."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.impairments import ChannelErrors

Complex = npt.NDArray[np.complexfloating]


def tx_matrix(errors: ChannelErrors, num_tx: int) -> npt.NDArray[np.complex128]:
    """Return the field of antenna i when transmitter j is fed, shape (num_tx, num_tx).

    By definition: coupling times the gain and phase of the transmitter.
    """
    factor = _factors(errors.tx_gain_db, errors.tx_phase_deg, num_tx)
    return _matrix(errors.tx_coupling, num_tx) * factor[None, :]


def rx_matrix(errors: ChannelErrors, num_rx: int) -> npt.NDArray[np.complex128]:
    """Return the field in receiver i of what reaches antenna j, shape (num_rx, num_rx).

    By definition: the gain and phase of the receiver times coupling. The beat signal of ramps is transmit times
    conj(receive), so its matrices are the conjugates of both; symbols are sampled as they arrive.
    """
    factor = _factors(errors.rx_gain_db, errors.rx_phase_deg, num_rx)
    return factor[:, None] * _matrix(errors.rx_coupling, num_rx)


def apply_tx(alone: Complex, errors: ChannelErrors, num_tx: int, is_beat: bool = True) -> npt.NDArray[np.complex64]:
    """Return raw data of transmitters each alone, their rows mixed by the coupling.

    Exact: linear in the fields.

    Parameters
    ----------
    alone : ndarray of complex, shape (num_rx, num_chirps * num_tx, num_samples)
        Row ``m * num_tx + i`` is antenna i alone [sqrt(W)].
    errors : ChannelErrors
    num_tx : int
    is_beat : bool
        Whether the data are a beat signal; False for symbols.
    """
    split, matrix = alone.reshape(len(alone), -1, num_tx, alone.shape[2]), tx_matrix(errors, num_tx)
    matrix = (matrix.conj() if is_beat else matrix).astype(np.complex64)
    mixed = np.einsum("jmin,ik->jmkn", split, matrix, optimize=True)
    return np.ascontiguousarray(mixed, dtype=np.complex64).reshape(alone.shape)


def apply_rx(adc: Complex, errors: ChannelErrors, is_beat: bool = True) -> npt.NDArray[np.complex64]:
    """Return raw data with the receivers mixed by the coupling [sqrt(W)], same shape (num_rx, num_rows, num_samples).

    Exact: linear in the fields. `is_beat` as of :func:`apply_tx`.
    """
    matrix = rx_matrix(errors, len(adc))
    return np.asarray(np.tensordot(matrix.conj() if is_beat else matrix, adc, axes=1), dtype=np.complex64)


def _factors(gain_db: tuple[float, ...], phase_deg: tuple[float, ...], count: int) -> npt.NDArray[np.complex128]:
    gain = 10.0 ** (np.array(gain_db or (0.0,) * count) / 20.0)
    return np.asarray(gain * np.exp(1j * np.radians(phase_deg or (0.0,) * count)))


def _matrix(rows: tuple[tuple[tuple[float, float], ...], ...], count: int) -> npt.NDArray[np.complex128]:
    if not rows:
        return np.eye(count, dtype=np.complex128)
    parts = np.array(rows, dtype=np.float64)
    return np.asarray(parts[..., 0] + 1j * parts[..., 1])
