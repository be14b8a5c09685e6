"""Samples as Texas Instruments' devices send them over their lanes, and as a DCA1000 keeps them.

References
----------
.. [1] Texas Instruments, *Mmwave Radar Device ADC Raw Data Capture*, SWRA581B, 2018: order of I, Q, samples and
   receivers with two and four lanes; sign of 12 and 14 bits by its readDCA1000.m.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError


class Order(NamedTuple):
    """In which order the values of a chirp stand in a file.

    Attributes
    ----------
    num_lanes : int
        So many values of I follow each other, then as many of Q.
    is_interleaved : bool
        Whether the receivers alternate from sample to sample; else all samples of one follow each other.
    q_first : bool
        Whether Q stands before I.
    is_real : bool
        Whether there is no Q.
    """

    num_lanes: int = 2
    is_interleaved: bool = False
    q_first: bool = False
    is_real: bool = False


ORDER = Order()
"""Of two lanes."""


def decode(
    raw: npt.NDArray[np.int16], shape: tuple[int, int, int], order: Order = ORDER, bits: int = 16
) -> npt.NDArray[np.int16]:
    """Return one frame of a capture as I and Q.

    Parameters
    ----------
    raw : ndarray of int16, shape (num_values,)
        In the order of the file.
    shape : tuple of int
        (num_rx, num_chirps_total, num_samples).
    order : Order
        Left out: that of two lanes.
    bits : int
        Of a sample. Fewer than 16 may stand in the file with their sign or, as devices send them, without it.

    Returns
    -------
    ndarray of int16, shape (num_rx, num_chirps_total, num_samples, 2)
        I and Q; a Q that is not there is 0.

    Raises
    ------
    ParameterRangeError
        If the length is not that of a frame, or does not fill the lanes, or a number has more bits.
    """
    raw = signed(raw, bits)
    num_rx, num_chirps, num_samples = shape
    num_lanes, is_interleaved, q_first, is_real = order
    count = num_rx * num_chirps * num_samples * (1 if is_real else 2)
    if raw.shape != (count,):
        raise ParameterRangeError(
            "capture", f"{raw.size} numbers", f"{count}: one frame of {'real' if is_real else 'complex'} samples"
        )
    per_chirp = num_samples * (num_rx if is_interleaved else 1)
    if not is_real and per_chirp % num_lanes:
        raise ParameterRangeError(
            "num_samples", num_samples, f"a multiple of {num_lanes}", f"{num_lanes} lanes carry so many at a time"
        )
    if is_real:
        pairs = np.zeros((count, 2), dtype=np.int16)
        pairs[:, 0] = raw
    else:
        blocks = raw.reshape(-1, 2, num_lanes)[:, :: -1 if q_first else 1]
        pairs = blocks.transpose(0, 2, 1).reshape(-1, 2)
    if is_interleaved:
        ordered = pairs.reshape(num_chirps, num_samples, num_rx, 2).transpose(2, 0, 1, 3)
    else:
        ordered = pairs.reshape(num_chirps, num_rx, num_samples, 2).transpose(1, 0, 2, 3)
    return np.ascontiguousarray(ordered)


def signed(raw: npt.NDArray[np.int16], bits: int) -> npt.NDArray[np.int16]:
    """Return numbers of fewer than 16 bits with their sign: what is above ``2**(bits-1) - 1`` is below zero.

    Numbers that have their sign stay as they are.

    Raises
    ------
    ParameterRangeError
        If one is not from ``-2**(bits-1)`` to ``2**bits - 1``.
    """
    if bits >= 16 or not raw.size:
        return raw
    least, most = int(raw.min()), int(raw.max())
    if least < -(2 ** (bits - 1)) or most >= 2**bits:
        raise ParameterRangeError(
            "samples", f"{least} to {most}", f"numbers of {bits} bits", "correct the bits in the description (adcCfg)"
        )
    unused = 16 - bits
    return (raw << unused) >> unused
