"""The effects of a front end in physical order, from the transmitters each alone to the converter's input."""

from __future__ import annotations

import copy

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.front_end import FrontEnd
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveforms.coded import is_coded
from scarl_sionna.signal.multiplexing import multiplex
from scarl_sionna.signal.noise import add_noise

from .amplifier import compress
from .channels import apply_rx, apply_tx
from .filters import Before, apply_filters
from .mixer import add_offset, in_phase, unbalance


def receive(
    alone: npt.NDArray[np.complexfloating], radar: RadarSpec, rng: np.random.Generator | None
) -> npt.NDArray[np.complex64]:
    """Return what the converter gets: coupling, sum of the transmitters, noise, amplifier, mixer, filters, constant, I.

    By definition of the order.

    Parameters
    ----------
    alone : ndarray of complex, shape (num_rx, num_rows * num_tx, num_samples)
        Raw data of ``radar.separated``, with the errors of oscillators and ramps and with leakage [sqrt(W)].
    radar : RadarSpec
    rng : numpy.random.Generator or None
        Of the thermal noise; None: none.

    Returns
    -------
    ndarray of complex64, shape (num_rx, num_chirps_total, num_samples)
        [sqrt(W)]
    """
    front, adc = radar.front_end, np.asarray(alone, dtype=np.complex64)
    is_beat = not is_coded(radar.waveform)
    if front.channels is not None:
        adc = apply_tx(adc, front.channels, radar.num_tx, is_beat)
    if radar.multiplexing.is_coded:
        adc = multiplex(adc, radar)
    if front.channels is not None:
        adc = apply_rx(adc, front.channels, is_beat)
    first = adc[:, :, :1].copy()
    # of its own, so that what `rng` gives others does not depend on the filters
    earlier = None if rng is None else np.random.default_rng(copy.deepcopy(rng).integers(2**63, size=2))

    def before(index: int, count: int) -> Before:
        """Return what the filters had before the rows of a receiver: the first echoes held, and noise."""
        held = first[index]
        lead = None if earlier is None else add_noise(np.broadcast_to(held, (len(held), count)), radar, earlier)
        return Before(_amplified(held, front), None if lead is None else _amplified(lead, front))

    adc = _amplified(add_noise(adc, radar, rng), front)
    if front.filters is not None:
        adc = apply_filters(adc, radar, before)
    if front.dc_offset_dbm is not None:
        adc = add_offset(adc, front.dc_offset_dbm)
    return in_phase(adc) if radar.adc.is_real else adc


def _amplified(adc: npt.NDArray[np.complex64], front: FrontEnd) -> npt.NDArray[np.complex64]:
    """Return the signal behind amplifier and mixer, any shape [sqrt(W)]."""
    if front.amplifier is not None:
        adc = compress(adc, front.amplifier)
    return adc if front.mixer is None else unbalance(adc, front.mixer)
