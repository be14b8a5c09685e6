"""How many drops and flakes of each size fall, and how fast: the same for every sensor."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

DropSizes = Literal["p838", "marshall_palmer", "drizzle", "widespread", "thunderstorm"]

RAIN_SIZES = {
    "marshall_palmer": (8.0e6, 4.1e3),
    "drizzle": (30.0e6, 5.7e3),
    "widespread": (7.0e6, 4.1e3),
    "thunderstorm": (1.4e6, 3.0e3),
}
"""N_0 [1/m4] and Lambda at 1 mm/h [1/m] of exponential distributions of drops: J. S. Marshall, W. M. Palmer, J. Meteor.
5, 1948; the other three J. Joss, J. C. Thams, A. Waldvogel, Proc. Int. Conf. Cloud Physics, Toronto, 1968."""
P838_SLOPE = 4.1e3
"""Lambda at 1 mm/h [1/m] of the distribution "p838": that of Marshall and Palmer. Its N_0 follows from the attenuation
that Recommendation ITU-R P.838 states."""
RAIN_POWER = -0.21
"""Power of the rain rate with which Lambda goes."""
SNOW_SIZES = (2.50e6, -0.94, 2.29e3, -0.45)
"""N_0 [1/m4] and Lambda [1/m] at 1 mm/h, each with its power of the rate, over the melted diameter: R. S. Sekhon, R. C.
Srivastava, J. Atmos. Sci. 27(2), 1970."""
SNOW_SOLID = {"dry": 0.2, "wet": 0.4}
"""Share of a flake's volume that is ice and water; the diameter of the sphere follows from its mass."""
SNOW_FALL_SPEED = 1.0
"""Of flakes [m/s]; measured aggregates fall with 0.7 to 1.5 m/s (J. D. Locatelli, P. V. Hobbs, J. Geophys. Res. 79(15),
1974)."""


def terminal_speed(diameter: npt.ArrayLike) -> npt.NDArray[np.float64]:
    r"""Return the speed of fall of drops of water in still air near the ground [m/s].

    .. math:: v = 9.65 - 10.3 \, e^{-0.6 D}, \quad D \text{ in mm}

    0 for drops below 0.109 mm, where the fit ends.

    Parameters
    ----------
    diameter : array_like of float, any shape
        Of a sphere of the same volume [m].

    Returns
    -------
    ndarray of float64, shape of `diameter`
        [m/s].

    References
    ----------
    .. [1] D. Atlas, R. C. Srivastava, R. S. Sekhon, "Doppler radar characteristics of precipitation at vertical
       incidence", Rev. Geophys. 11(1), 1973.
    """
    return np.maximum(9.65 - 10.3 * np.exp(-0.6e3 * np.asarray(diameter, dtype=np.float64)), 0.0)
