"""Models behind entries of materials.toml: water, ice, snow, skin, and mixtures, as complex relative permittivities.

Time dependence e^{+j 2 pi f t}: losses are a negative imaginary part. The table holds numbers; these functions are
where those numbers come from, and make entries for another temperature, density or wetness. Nothing here imports an
engine.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.units import VACUUM_PERMITTIVITY

CELSIUS = 273.15
"""0 degrees Celsius [K]."""
ICE_DENSITY = 916.7
"""Density of ice without bubbles [kg/m3]."""

_DRY_SKIN_LIMIT, _DRY_SKIN_CONDUCTIVITY = 4.0, 2.0e-4
_DRY_SKIN_TERMS = ((32.0, 7.23e-12, 0.0), (1100.0, 32.48e-9, 0.20))
"""Size, relaxation time [s] and width of the dispersions of dry skin; the third and fourth have no size."""


def water_permittivity(frequency: float, temperature: float = CELSIUS + 20.0) -> complex:
    r"""Return the complex relative permittivity of liquid water without salt.

    Parameters
    ----------
    frequency : float
        1e9 to 1e12 [Hz].
    temperature : float
        250 to 330 [K].

    Raises
    ------
    ParameterRangeError
        If a value is outside its range.

    Notes
    -----
    Double-Debye model with :math:`\theta = 300/T - 1`:

    .. math:: \varepsilon = \varepsilon_2 + \frac{\varepsilon_0 - \varepsilon_1}{1 + j f/f_1}
              + \frac{\varepsilon_1 - \varepsilon_2}{1 + j f/f_2}

    It is the only model of liquid water here: films on surfaces, drops, fog and melting snow all take it. An earlier
    form, with :math:`\varepsilon_2` falling with the temperature [2]_, differs by 0.1 % at 20 degrees C and 0.9 % at 0.
    *Not modelled*: salt (de-icing brine).

    References
    ----------
    .. [1] Recommendation ITU-R P.840-8, "Attenuation due to clouds and fog", 2019, Annex 1, Eqs. (4) to (11).
    .. [2] H. Liebe, G. Hufford, T. Manabe, *A model for the complex permittivity of water at frequencies below 1 THz*,
       Int. J. Infrared Millimeter Waves 12(7), 1991.
    """
    _within("frequency", frequency, 1e9, 1e12, "Hz")
    _within("temperature", temperature, 250.0, 330.0, "K")
    theta = 300.0 / temperature - 1.0
    static = 77.66 + 103.3 * theta
    middle, high = 0.0671 * static, 3.52
    first = (20.20 - 146.0 * theta + 316.0 * theta**2) * 1e9
    second = 39.8 * first
    return high + (static - middle) / (1.0 + 1j * frequency / first) + (middle - high) / (1.0 + 1j * frequency / second)


def ice_permittivity(frequency: float, temperature: float = CELSIUS - 5.0) -> complex:
    r"""Return the complex relative permittivity of pure fresh-water ice.

    Parameters
    ----------
    frequency : float
        1e7 to 3e12 [Hz].
    temperature : float
        240 to 273.15 [K].

    Raises
    ------
    ParameterRangeError
        If a value is outside its range.

    References
    ----------
    .. [1] C. Maetzler (ed.), *Thermal Microwave Radiation: Applications for Remote Sensing*, IET, 2006, section 5.3.
    """
    _within("frequency", frequency, 1e7, 3e12, "Hz")
    _within("temperature", temperature, 240.0, CELSIUS, "K")
    ghz, celsius, theta = frequency / 1e9, temperature - CELSIUS, 300.0 / temperature - 1.0
    alpha = (0.00504 + 0.0062 * theta) * math.exp(-22.1 * theta)
    growth = math.exp(335.0 / temperature)
    beta = 0.0207 / temperature * growth / (growth - 1.0) ** 2 + 1.16e-11 * ghz**2 + math.exp(-9.963 + 0.0372 * celsius)
    return complex(3.1884 + 9.1e-4 * celsius, -(alpha / ghz + beta * ghz))


def snow_permittivity(
    frequency: float, density: float, wetness: float = 0.0, temperature: float | None = None
) -> complex:
    r"""Return the effective complex relative permittivity of snow.

    Parameters
    ----------
    frequency : float
        [Hz].
    density : float
        Of the dry snow (ice and air) [kg/m3], 0 to 400.
    wetness : float
        Share of the volume that is liquid water, 0 to 0.2.
    temperature : float, optional
        [K]; -5 degrees Celsius for dry, 0 for wet snow if not given.

    Raises
    ------
    ParameterRangeError
        If a value is outside its range.

    Notes
    -----
    Dry snow with the share v of ice in its volume (Maetzler), and its absorption (Tiuri et al., density in g/cm3):

    .. math:: \varepsilon' = 1 + 1.4667 v + 1.435 v^3, \quad \varepsilon'' = \varepsilon''_{ice} (0.52\rho + 0.62\rho^2)

    Liquid water joins by refractive mixing. *Not modelled*: scattering by the grains, which takes more than absorption
    from a wave in dry snow at these frequencies.

    References
    ----------
    .. [1] C. Maetzler (ed.), *Thermal Microwave Radiation: Applications for Remote Sensing*, IET, 2006, section 5.4.
    .. [2] M. Tiuri et al., *The complex dielectric constant of snow at microwave frequencies*, IEEE J. Oceanic Eng.
       9(5), 1984.
    """
    _within("density", density, 0.0, 400.0, "kg/m3")
    _within("wetness", wetness, 0.0, 0.2, "")
    kelvin = temperature if temperature is not None else CELSIUS - (0.0 if wetness else 5.0)
    share, grams = density / ICE_DENSITY, density / 1000.0
    loss = -ice_permittivity(frequency, min(kelvin, CELSIUS)).imag * (0.52 * grams + 0.62 * grams**2)
    dry = complex(1.0 + 1.4667 * share + 1.435 * share**3, -loss)
    if wetness == 0.0:
        return dry
    return refractive_mixture([(1.0 - wetness, dry), (wetness, water_permittivity(frequency, kelvin))])


def skin_permittivity(frequency: float) -> complex:
    r"""Return the complex relative permittivity of dry human skin.

    Parameters
    ----------
    frequency : float
        1e7 to 1e11 [Hz].

    Raises
    ------
    ParameterRangeError
        If it is outside its range.

    Notes
    -----
    Sum of Cole-Cole dispersions; only the first, that of water in tissue, counts at millimetre waves:

    .. math:: \varepsilon = \varepsilon_\infty + \sum_n \frac{\Delta_n}{1 + (j 2\pi f \tau_n)^{1-\alpha_n}}
              + \frac{\sigma}{j 2\pi f \varepsilon_0}

    References
    ----------
    .. [1] S. Gabriel, R. W. Lau, C. Gabriel, *The dielectric properties of biological tissues: III*, Phys. Med. Biol.
       41, 1996, Table 1.
    """
    _within("frequency", frequency, 1e7, 1e11, "Hz")
    omega = 2.0 * math.pi * frequency
    value = _DRY_SKIN_LIMIT + _DRY_SKIN_CONDUCTIVITY / (1j * omega * VACUUM_PERMITTIVITY)
    for size, tau, width in _DRY_SKIN_TERMS:
        value += size / (1.0 + (1j * omega * tau) ** (1.0 - width))
    return value


def refractive_mixture(shares: Iterable[tuple[float, complex]]) -> complex:
    r"""Return the permittivity of a mixture by the mean of the refractive indices.

    Parameters
    ----------
    shares : iterable of (float, complex)
        Share of the volume and complex relative permittivity of each part; what is missing to a whole is air.

    Raises
    ------
    ParameterRangeError
        If a share is negative or they add up to more than one.

    Notes
    -----
    .. math:: \sqrt{\varepsilon} = \sum_i v_i \sqrt{\varepsilon_i}

    References
    ----------
    .. [1] J. R. Birchak et al., *High dielectric constant microwave probes for sensing soil moisture*, Proc. IEEE
       62(1), 1974.
    """
    parts = list(shares)
    total = sum(share for share, _ in parts)
    if any(share < 0.0 for share, _ in parts) or total > 1.0 + 1e-12:
        raise ParameterRangeError("shares", [share for share, _ in parts], "each >= 0, at most 1 in all")
    return (sum(share * cmath.sqrt(permittivity) for share, permittivity in parts) + (1.0 - total)) ** 2


def _within(name: str, value: float, low: float, high: float, unit: str) -> None:
    if not low <= value <= high:
        raise ParameterRangeError(name, f"{value:g} {unit}".strip(), f"{low:g} to {high:g} {unit}".strip())
