"""Constants, unit conversions and the sign conventions of the whole project.

Conventions, stated once:

- Time dependence e^{+j 2 pi f t}; a wave that has travelled a length L carries the phase -2 pi f L / c.
- The beat signal is transmit times conj(receive): its phase is +2 pi (f0 tau + S tau t - S tau^2 / 2).
- Radial velocity is positive when the distance opens, so doppler = -2 v_r / wavelength.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, TypeVar

import numpy as np
import numpy.typing as npt

SPEED_OF_LIGHT = 299_792_458.0
"""Speed of light in vacuum [m/s] (SI, exact)."""
BOLTZMANN = 1.380_649e-23
"""Boltzmann constant [J/K] (SI, exact)."""
VACUUM_PERMITTIVITY = 8.854_187_8128e-12
"""Vacuum permittivity [F/m] (CODATA 2018)."""
REFERENCE_TEMPERATURE = 290.0
"""Reference temperature of the noise figure [K] (IEEE)."""

FloatOrArray = TypeVar("FloatOrArray", float, npt.NDArray[np.floating])


@dataclass(frozen=True)
class Unit:
    """Unit of a number of a specification, as metadata of its type: ``Annotated[float, Unit("Hz")]``."""

    symbol: str


Hertz = Annotated[float, Unit("Hz")]
Seconds = Annotated[float, Unit("s")]
Metres = Annotated[float, Unit("m")]
MetresPerSecond = Annotated[float, Unit("m/s")]
MetresPerSecond2 = Annotated[float, Unit("m/s2")]
MetresPerSecond3 = Annotated[float, Unit("m/s3")]
Pixels = Annotated[float, Unit("px")]
Degrees = Annotated[float, Unit("deg")]
Decibels = Annotated[float, Unit("dB")]
DecibelsIsotropic = Annotated[float, Unit("dBi")]
DecibelMilliwatts = Annotated[float, Unit("dBm")]
Watts = Annotated[float, Unit("W")]
Gibibytes = Annotated[float, Unit("GiB")]
MillimetresPerHour = Annotated[float, Unit("mm/h")]


def db_to_power(value_db: FloatOrArray) -> FloatOrArray:
    """Return the power ratio of a value in dB.

    By definition of the decibel.
    """
    return 10.0 ** (value_db / 10.0)  # type: ignore[return-value]


def power_to_db(power: npt.ArrayLike, floor_db: float = -400.0) -> npt.NDArray[np.float64]:
    """Return a power ratio in dB; zero gives `floor_db` instead of minus infinity.

    Any shape, kept. By definition of the decibel.
    """
    return 10.0 * np.log10(np.maximum(np.asarray(power, dtype=np.float64), 10.0 ** (floor_db / 10.0)))


def dbm_to_watt(power_dbm: float) -> float:
    """Return a power in dBm as watts.

    By definition of the decibel.
    """
    return float(1e-3 * 10.0 ** (power_dbm / 10.0))


def watt_to_dbm(power: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return powers in watts as dBm, any shape, kept.

    By definition of the decibel.
    """
    return power_to_db(np.asarray(power) / 1e-3)


def doppler_from_radial_velocity(radial_velocity: npt.ArrayLike, wavelength: float) -> npt.NDArray[np.float64]:
    """Return the monostatic Doppler shift [Hz] of a radial velocity [m/s], positive velocity = opening.

    Any shape, kept; the wavelength is in metres. By definition, -2 v / wavelength, to first order in v / c.
    """
    return -2.0 * np.asarray(radial_velocity, dtype=np.float64) / wavelength


def thermal_noise_power(
    bandwidth: float, noise_figure_db: float, source_temperature: float = REFERENCE_TEMPERATURE
) -> float:
    r"""Return the input-referred thermal noise power of a receiver.

    Parameters
    ----------
    bandwidth : float
        Noise-equivalent bandwidth [Hz], > 0. For complex (I/Q) sampling it is the sampling frequency.
    noise_figure_db : float
        Noise figure [dB], >= 0, referred to 290 K.
    source_temperature : float
        Noise temperature that the antenna sees [K], >= 0.

    Returns
    -------
    float
        Noise power [W].

    Raises
    ------
    ParameterRangeError
        If the bandwidth is not positive, or the noise figure negative.

    Notes
    -----
    .. math:: P_n = k_B B [T_s + (F - 1) T_0]

    *Validity*: h f << k_B T; the error of leaving Planck's law out is 0.03 dB at 77 GHz.

    References
    ----------
    .. [1] H. T. Friis, "Noise Figures of Radio Receivers", Proc. IRE 32(7), 1944.
    """
    from .errors import ParameterRangeError

    if not bandwidth > 0:
        raise ParameterRangeError("bandwidth", f"{bandwidth} Hz", "> 0 Hz")
    if noise_figure_db < 0:
        raise ParameterRangeError("noise_figure_db", f"{noise_figure_db} dB", ">= 0 dB")
    factor = db_to_power(noise_figure_db)
    return BOLTZMANN * bandwidth * (source_temperature + (factor - 1.0) * REFERENCE_TEMPERATURE)
