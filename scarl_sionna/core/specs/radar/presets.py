"""Named radars, as the parts in which they differ from the defaults."""

from __future__ import annotations

from collections.abc import Mapping

from scarl_sionna.core.spec import Spec

from .array import HALF_WAVE, AntennaArray, uniform_line
from .multiplexing import Tdm

PRESETS: Mapping[str, Mapping[str, Spec]] = {
    # Table 1 of SCaRL: the defaults of all parts
    "awr1843boost": {},
    # TI AWR1843BOOST user's guide (SPRUIM4): Rx in a row at half a wavelength; Tx1 and Tx3 two wavelengths apart,
    # Tx2 between them and half a wavelength higher
    "awr1843boost_3d": {
        "array": AntennaArray(
            tx_positions=((0.0, -2 * HALF_WAVE, 0.0), (0.0, 0.0, HALF_WAVE), (0.0, 2 * HALF_WAVE, 0.0)),
            rx_positions=uniform_line(4, HALF_WAVE),
        ),
        "multiplexing": Tdm(),
    },
}
