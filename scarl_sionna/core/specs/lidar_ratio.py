"""What water in the air sends back of the light that it takes: the lidar ratio of drops and flakes."""

from __future__ import annotations

import math

import numpy as np

from scarl_sionna.core.errors import ParameterRangeError

FOG_LIDAR_RATIO = 19.0
"""Of the droplets of fog and clouds [sr]: 18 to 20 sr, whatever their size (O'Connor, Illingworth and Hogan, J. Atmos.
Ocean. Technol. 21, 2004)."""
SNOW_LIDAR_RATIO = 32.0
"""Of ice at 532 nm [sr] (Young et al., Atmos. Meas. Tech. 11, 2018, CALIPSO version 4). Ice absorbs at 1.5 um, so that
snow sends less back there; no measurement of it was found."""
_REAR_PASSES = 2.0
"""Way in the drop of the ray through its middle that its rear reflects, in diameters."""
_GLORY_PASSES = 7.5
"""Way in the drop of the light of the glory, in diameters: fitted to the Mie series from 1310 to 1600 nm."""
_WATER = np.array(
    [  # wavelength [um], refractive index, absorption index (Hale and Querry 1973; 1.2 to 1.6 um: Segelstein 1981)
        [0.40, 1.339, 1.86e-9],
        [0.50, 1.335, 1.00e-9],
        [0.60, 1.332, 1.09e-8],
        [0.70, 1.331, 3.35e-8],
        [0.80, 1.329, 1.25e-7],
        [0.90, 1.328, 4.86e-7],
        [0.95, 1.327, 2.93e-6],
        [1.00, 1.327, 2.89e-6],
        [1.064, 1.326, 1.28e-6],
        [1.12, 1.325, 2.65e-6],
        [1.16, 1.325, 1.07e-5],
        [1.20, 1.324, 1.20e-5],
        [1.25, 1.323, 1.10e-5],
        [1.31, 1.322, 1.66e-5],
        [1.35, 1.322, 4.05e-5],
        [1.38, 1.321, 7.80e-5],
        [1.40, 1.321, 1.53e-4],
        [1.42, 1.321, 3.20e-4],
        [1.45, 1.320, 3.63e-4],
        [1.48, 1.320, 3.02e-4],
        [1.50, 1.319, 2.25e-4],
        [1.55, 1.318, 1.34e-4],
        [1.60, 1.317, 9.35e-5],
        [1.66, 1.316, 7.40e-5],
        [1.75, 1.313, 1.00e-4],
        [1.80, 1.312, 1.36e-4],
        [1.85, 1.311, 1.86e-4],
        [1.88, 1.310, 9.20e-4],
        [1.93, 1.308, 1.92e-3],
        [2.00, 1.306, 1.10e-3],
    ]
)


def water_index(wavelength: float) -> tuple[float, float]:
    """Return the refractive and the absorption index of liquid water at 25 degC.

    Parameters
    ----------
    wavelength : float
        [m], 0.4e-6 to 2e-6.

    Raises
    ------
    ParameterRangeError
        If the wavelength is outside the table.

    Notes
    -----
    Linear in the wavelength, the absorption index in its logarithm.

    References
    ----------
    .. [1] G. M. Hale, M. R. Querry, "Optical constants of water in the 200-nm to 200-um wavelength region", Appl. Opt.
       12(3), 1973.
    .. [2] D. J. Segelstein, "The complex refractive index of water", University of Missouri-Kansas City, 1981.
    """
    micrometres = wavelength * 1e6
    if not _WATER[0, 0] - 1e-9 <= micrometres <= _WATER[-1, 0] + 1e-9:
        raise ParameterRangeError("wavelength", f"{wavelength} m", "0.4e-6 to 2e-6 m, where water is tabulated")
    refraction = np.interp(micrometres, _WATER[:, 0], _WATER[:, 1])
    absorption = np.exp(np.interp(micrometres, _WATER[:, 0], np.log(_WATER[:, 2])))
    return float(refraction), float(absorption)


def drops_lidar_ratio(wavelength: float, scale_diameter: float) -> float:
    r"""Return extinction over backscatter of drops that are far larger than the wavelength [sr].

    Parameters
    ----------
    wavelength : float
        [m], 0.4e-6 to 2e-6.
    scale_diameter : float
        Of an exponential distribution of sizes, ``exp(-D / scale_diameter)`` [m], >= 0; the median volume diameter is
        3.67 times as large.

    Raises
    ------
    ParameterRangeError
        If a value is outside the range above.

    Notes
    -----
    .. math:: \frac{1}{S} = \frac{R_0}{8 \pi} \left[ 1 + (1 - R_0)^2 \Big(\frac{n}{2 - n}\Big)^2 \langle e^{-2 \alpha_w
        D} \rangle + G \langle e^{-7.5 \alpha_w D} \rangle \right], \quad
        \langle e^{-c \alpha_w D} \rangle = (1 + c \, \alpha_w D_s)^{-3}

    in brackets: the front of the drop with Fresnel's :math:`R_0`, its rear that the front focuses on, and the glory.
    :math:`\alpha_w = 4 \pi k / \lambda` is the absorption of water; means are over the drops' areas. G makes 19 sr of
    drops without absorption, those of fog; the way of its light in the drop, 7.5 diameters, is fitted.
    *Validity*: within 30 % of the Mie series at 1310 nm and from 1530 to 1600 nm for drops of rain and spray, a factor
    of two high in the absorption band at 1450 nm. Below 1.2 um, where water is clear, spheres give 5 to 26 sr at
    1064 nm, by the third digit of n; drops above 1 mm are flat and lose that glory.

    References
    ----------
    .. [1] H. C. van de Hulst, *Light Scattering by Small Particles*, Wiley, 1957, chapters 12 and 13.
    """
    if not scale_diameter >= 0.0:
        raise ParameterRangeError("scale_diameter", f"{scale_diameter} m", ">= 0 m")
    refraction, absorption = water_index(wavelength)
    depth = 4.0 * math.pi * absorption / wavelength * scale_diameter
    front = ((refraction - 1.0) / (refraction + 1.0)) ** 2
    rear = (1.0 - front) ** 2 * (refraction / (2.0 - refraction)) ** 2
    of_front = 8.0 * math.pi / front
    glory = of_front / FOG_LIDAR_RATIO - 1.0 - rear
    lit = 1.0 + rear * (1.0 + _REAR_PASSES * depth) ** -3 + glory * (1.0 + _GLORY_PASSES * depth) ** -3
    return of_front / lit


def rain_lidar_ratio(rain_rate: float, wavelength: float) -> float:
    r"""Return extinction over backscatter of rain [sr]: about 450 at 5 mm/h and 1550 nm, 19 where water is clear.

    Parameters
    ----------
    rain_rate : float
        [mm/h], >= 0.
    wavelength : float
        [m], 0.4e-6 to 2e-6.

    Raises
    ------
    ParameterRangeError
        If a value is outside the range above.

    Notes
    -----
    :func:`drops_lidar_ratio` of the distribution of Marshall and Palmer, :math:`1 / D_s = 4100 R^{-0.21}` per metre.

    References
    ----------
    .. [1] J. S. Marshall, W. M. Palmer, "The distribution of raindrops with size", J. Meteorol. 5, 1948.
    """
    if not rain_rate >= 0.0:
        raise ParameterRangeError("rain_rate", f"{rain_rate} mm/h", ">= 0 mm/h")
    return drops_lidar_ratio(wavelength, rain_rate**0.21 / 4.1e3)
