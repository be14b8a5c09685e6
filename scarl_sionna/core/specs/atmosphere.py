"""The air between a sensor and what it sees: fog, rain and snow at optical wavelengths."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Metres, MillimetresPerHour, Unit

from .lidar_ratio import FOG_LIDAR_RATIO, SNOW_LIDAR_RATIO, rain_lidar_ratio

CONTRAST = 0.05
"""Contrast to which a black target has faded at the visibility (meteorological optical range, WMO-No. 8)."""
KRUSE_CONTRAST = 0.02
"""The same for the visual range that Kruse's and Kim's exponents are given for."""
REFERENCE_WAVELENGTH = 550e-9
"""Wavelength at which visibility is defined [m]."""
_DB_PER_KM = math.log(10.0) / 10.0 / 1e3
"""Extinction coefficient [1/m] of 1 dB/km."""
_OPTICAL_BAND = (400e-9, 2000e-9)


class Atmosphere(Spec):
    """Fog, rain and snow, homogeneous along every ray.

    Extinction over backscatter, the lidar ratio, is that of each kind of drop, see
    :mod:`scarl_sionna.core.specs.lidar_ratio`; `lidar_ratio` replaces them all.
    """

    visibility: Metres | None = Field(
        None, gt=0.0, description="meteorological optical range, 5 % contrast [m]; None: no fog"
    )
    rain_rate: MillimetresPerHour = Field(0.0, ge=0.0, le=500.0, description="[mm/h]")
    snow_rate: MillimetresPerHour = Field(0.0, ge=0.0, le=50.0, description="as melted water [mm/h]")
    snow: Literal["dry", "wet"] = "dry"
    lidar_ratio: Annotated[float, Unit("sr")] | None = Field(
        None, gt=0.0, description="extinction over backscatter coefficient [sr]; None: each its own"
    )

    @property
    def is_clear(self) -> bool:
        """Whether it holds no fog, rain or snow: `lidar_ratio` and the kind of snow alone put nothing into the air."""
        return self.visibility is None and self.rain_rate == 0.0 and self.snow_rate == 0.0

    def weather_extinction(self, wavelength: float) -> float:
        """Return the one-way power extinction coefficient of fog, rain and snow [1/m] at an optical wavelength [m]."""
        return sum(self._extinctions(wavelength))

    def weather_backscatter(self, wavelength: float) -> float:
        """Return the backscatter coefficient of fog, rain and snow [1/(m sr)] at an optical wavelength [m]."""
        fog, rain, snow = self._extinctions(wavelength)
        if self.lidar_ratio is not None:
            return (fog + rain + snow) / self.lidar_ratio
        of_rain = rain / rain_lidar_ratio(self.rain_rate, wavelength) if rain > 0.0 else 0.0
        return fog / FOG_LIDAR_RATIO + of_rain + snow / SNOW_LIDAR_RATIO

    def _extinctions(self, wavelength: float) -> tuple[float, float, float]:
        fog = 0.0 if self.visibility is None else fog_extinction(self.visibility, wavelength)
        snow = 0.0 if self.snow_rate == 0.0 else snow_extinction(self.snow_rate, wavelength, self.snow)
        return fog, rain_extinction(self.rain_rate), snow


def fog_extinction(visibility: float, wavelength: float) -> float:
    r"""Return the one-way power extinction coefficient of fog or haze [1/m].

    Parameters
    ----------
    visibility : float
        Meteorological optical range, at which a black target has a contrast of 5 % [m], > 0.
    wavelength : float
        [m], 0.4e-6 to 2e-6.

    Raises
    ------
    ParameterRangeError
        If a value is outside the range above.

    Notes
    -----
    .. math:: \alpha = \frac{\ln 20}{V} \left(\frac{\lambda}{550\,\text{nm}}\right)^{-q(V')}

    with Kim's exponent q: 1.6 above 50 km, 1.3 from 6 to 50 km, 0.16 V' + 0.34 from 1 to 6 km, V' - 0.5 from 0.5 to 1
    km and 0 below: dense fog takes all wavelengths alike. V' [km] is the range for a contrast of 2 % that these are
    given for, ``V' = V ln 50 / ln 20``. *Validity*: haze and fog; the exponent is empirical, measured fog
    scatters around it by a factor of about 2.

    References
    ----------
    .. [1] I. I. Kim, B. McArthur, E. Korevaar, "Comparison of laser beam propagation at 785 nm and 1550 nm in fog and
       haze for optical wireless communications", Proc. SPIE 4214, 2001.
    .. [2] P. W. Kruse et al., *Elements of Infrared Technology*, Wiley, 1962.
    """
    if not visibility > 0.0:
        raise ParameterRangeError("visibility", f"{visibility} m", "> 0 m")
    if not _OPTICAL_BAND[0] <= wavelength <= _OPTICAL_BAND[1]:
        raise ParameterRangeError("wavelength", f"{wavelength} m", "0.4e-6 to 2e-6 m, where the fog model was fitted")
    visual_range_km = visibility / 1e3 * math.log(KRUSE_CONTRAST) / math.log(CONTRAST)
    return -math.log(CONTRAST) / visibility * (wavelength / REFERENCE_WAVELENGTH) ** -_kim_exponent(visual_range_km)


def _kim_exponent(visibility_km: float) -> float:
    if visibility_km > 50.0:
        return 1.6
    if visibility_km > 6.0:
        return 1.3
    if visibility_km > 1.0:
        return 0.16 * visibility_km + 0.34
    return max(visibility_km - 0.5, 0.0)


def rain_extinction(rain_rate: float) -> float:
    r"""Return the one-way power extinction coefficient of rain at optical wavelengths [1/m].

    Parameters
    ----------
    rain_rate : float
        [mm/h], >= 0.

    Raises
    ------
    ParameterRangeError
        If the rain rate is negative.

    Notes
    -----
    .. math:: \gamma = 1.076 \, R^{0.67} \ \text{dB/km}

    Drops are far larger than the wavelength, so that it does not matter which. *Validity*: fitted to European rain; the
    Japanese set of Recommendation ITU-R P.1814 (1.58, 0.63) is 1.2 to 1.5 times as large.

    References
    ----------
    .. [1] T. H. Carbonneau, D. R. Wisely, "Opportunities and challenges for optical wireless", Proc. SPIE 3232, 1998;
       the same law in Recommendations ITU-R P.1814 and P.1817.
    """
    if not rain_rate >= 0.0:
        raise ParameterRangeError("rain_rate", f"{rain_rate} mm/h", ">= 0 mm/h")
    return 1.076 * rain_rate**0.67 * _DB_PER_KM


def snow_extinction(snow_rate: float, wavelength: float, snow: Literal["dry", "wet"] = "dry") -> float:
    r"""Return the one-way power extinction coefficient of falling snow at optical wavelengths [1/m].

    Parameters
    ----------
    snow_rate : float
        As melted water [mm/h], >= 0.
    wavelength : float
        [m], 0.4e-6 to 2e-6.
    snow : {"dry", "wet"}

    Raises
    ------
    ParameterRangeError
        If a value is outside the range above.

    Notes
    -----
    .. math:: \gamma = a S^b \ \text{dB/km}, \quad
        a, b = \begin{cases} 5.42 \cdot 10^{-5} \lambda + 5.4958776, \ 1.38 & \text{dry} \\
        1.023 \cdot 10^{-4} \lambda + 3.7855466, \ 0.72 & \text{wet} \end{cases}

    with the wavelength in nm. *Validity*: an empirical fit; measured snowfalls scatter by a factor of about 3 around
    it.

    References
    ----------
    .. [1] Recommendation ITU-R P.1814, "Prediction methods required for the design of terrestrial free-space optical
       links", 2007, section 5.
    """
    if not snow_rate >= 0.0:
        raise ParameterRangeError("snow_rate", f"{snow_rate} mm/h", ">= 0 mm/h")
    if snow not in ("dry", "wet"):
        raise ParameterRangeError("snow", repr(snow), "'dry' or 'wet'")
    if not _OPTICAL_BAND[0] <= wavelength <= _OPTICAL_BAND[1]:
        raise ParameterRangeError("wavelength", f"{wavelength} m", "0.4e-6 to 2e-6 m")
    slope, constant, power = (5.42e-5, 5.4958776, 1.38) if snow == "dry" else (1.023e-4, 3.7855466, 0.72)
    return (slope * wavelength * 1e9 + constant) * snow_rate**power * _DB_PER_KM
