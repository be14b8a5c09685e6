"""Weather of a scene, one description for all sensors: rain, fog, snow, spray, and how wet the surfaces are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Metres, MetresPerSecond, MillimetresPerHour, Seconds, Unit

from .atmosphere import CONTRAST, REFERENCE_WAVELENGTH, Atmosphere
from .drop_sizes import DropSizes
from .lighting import Lighting

KUNKEL = (144.7, 0.88)
"""Extinction [1/km] of fog is the first times its liquid water [g/m3] to the power of the second (Kunkel 1984)."""

FULL_FILM = 0.5e-3
"""Depth of the water on a surface of wetness 1 [m]: of the order of what Gallaway's rule gives for a lane of asphalt in
moderate rain (0.4 mm at 5 mm/h, 1.5 mm at 50 mm/h, with the part that stands in the texture)."""

WETTING_RATE = 2.0
"""Rain that wets a surface to 1 - 1/e [mm/h] (engineering estimate): damp in a drizzle, closed from moderate rain
on."""

FOG_RANGE = 1000.0
"""Haze with a shorter range is called fog [m] (WMO-No. 8); it hides the sun."""


GAS_PRESSURE = 1013.0
"""Of the air near the ground [hPa]."""
REFERENCE_VAPOUR = 7.5
"""Water vapour near the ground in a moderate climate [g/m3]."""


class Spray(Spec):
    """Water that the tyres of moving vehicles throw up from a wet road.

    The defaults are engineering estimates from the mass of water that tyres meet; no measurement of water content
    behind cars was at hand. Use it to see what spray can do, not for an absolute level.
    """

    airborne_share: float = Field(
        0.05, gt=0.0, le=1.0, description="of the water in the tyres' tracks, what stays in the air"
    )
    drop_diameter: Metres = Field(0.3e-3, gt=1e-5, lt=3e-3, description="median volume diameter of the drops [m]")
    lifetime: Seconds = Field(0.4, gt=0.0, le=10.0, description="time in which the cloud thins out by 1/e [s]")
    track_width: Metres = Field(0.45, gt=0.0, le=3.0, description="of both tracks of tyres together [m]")
    height: Metres = Field(1.5, gt=0.0, le=6.0, description="of the cloud [m]")
    min_speed: MetresPerSecond = Field(8.0, ge=0.0, description="a slower vehicle throws none up [m/s]")

    def water_content(self, wetness: float, width: float) -> float:
        r"""Return the liquid water right behind a vehicle [g/m3].

        .. math:: M = \rho_w \, s \, h b / (w H)

        with the share s in the air, the film's depth h, the width b of the tracks, and the cloud's cross-section w H.
        The speed cancels: a faster vehicle throws up more in a second and leaves it over a longer way.

        Parameters
        ----------
        wetness : float
            Of the road, 0 to 1.
        width : float
            Of the vehicle [m].
        """
        return 1e6 * self.airborne_share * wetness * FULL_FILM * self.track_width / (width * self.height)


class Weather(Spec):
    """What falls and floats in the air of a scene, the same everywhere in it. The default is clear: it changes nothing.

    One of `visibility` and `fog_water` states the fog; they are tied by Kunkel's law, see :func:`fog_water_of`.
    """

    rain_rate: MillimetresPerHour = Field(0.0, ge=0.0, le=200.0, description="[mm/h]")
    drop_sizes: DropSizes = Field(
        "p838", description="distribution of the rain's drops, for what they take from a radar and send back to it"
    )
    visibility: Metres | None = Field(
        None, gt=10.0, description="meteorological range in the fog alone, 5 % contrast [m]; None: no fog"
    )
    fog_water: Annotated[float, Unit("g/m3")] | None = Field(
        None, gt=0.0, le=2.0, description="liquid water of the fog [g/m3], instead of a visibility"
    )
    snow_rate: MillimetresPerHour = Field(0.0, ge=0.0, le=20.0, description="as melted water [mm/h]")
    snow: Literal["dry", "wet"] = Field(
        "dry", description="wet: flakes with 10 % of liquid water by volume, near 0 degrees"
    )
    spray: Spray | None = Field(None, description="behind moving vehicles on wet roads; None: not modelled")
    wind: tuple[MetresPerSecond, MetresPerSecond] = Field(
        (0.0, 0.0), description="velocity of the air along the world's x and y [m/s]"
    )
    turbulence: MetresPerSecond = Field(
        0.5, ge=0.0, le=5.0, description="standard deviation of the air's velocity, each axis [m/s]"
    )
    temperature_celsius: Annotated[float, Unit("degrees Celsius")] = Field(
        10.0, ge=-20.0, le=40.0, description="of air and drops [degrees Celsius]"
    )
    humidity: float = Field(0.6, ge=0.0, le=1.0, description="relative, of the air; for the gases")
    gases: bool = Field(False, description="oxygen and water vapour take their part of the radar's power (P.676)")
    wetness: float | None = Field(
        None, ge=0.0, le=1.0, description="of the surfaces; None: what the rain makes of them"
    )

    lying_snow: Literal["none", "beside_roads", "everywhere"] = Field(
        "none", description="closed cover on ground and roofs that are open to the sky; beside_roads: roads are cleared"
    )

    @model_validator(mode="after")
    def _check(self) -> Weather:
        if self.visibility is not None and self.fog_water is not None:
            raise ValueError("either visibility or fog_water, not both; set the other to None")
        if max(abs(value) for value in self.wind) > 60.0:
            raise ValueError("a wind of at most 60 m/s along each axis")
        if self.rain_rate > 0.0 and self.temperature_celsius < -5.0:
            raise ValueError(
                f"rain at -5 degrees Celsius or above, not at {self.temperature_celsius:g}; give a snow_rate"
            )
        if self.lying_snow != "none" and self.temperature_celsius > 5.0:
            raise ValueError(f"lying snow at 5 degrees Celsius or below, not at {self.temperature_celsius:g}")
        if self.snow_rate > 0.0 and self.temperature_celsius > 5.0:
            raise ValueError(
                f"snow at 5 degrees Celsius or below, not at {self.temperature_celsius:g}; give a rain_rate"
            )
        return self

    @classmethod
    def preset(cls, name: str) -> Weather:
        """Return a named weather: one of `WEATHER_PRESETS`.

        Raises
        ------
        UnknownNameError
            If there is no such preset.
        """
        if name not in WEATHER_PRESETS:
            raise UnknownNameError("weather", name, WEATHER_PRESETS)
        return cls(**WEATHER_PRESETS[name])

    @property
    def is_clear(self) -> bool:
        """Whether nothing of it reaches any sensor: no rain, fog, snow, gases, and dry surfaces without snow."""
        fog = self.visibility is not None or self.fog_water is not None
        if self.lying_snow != "none":
            return False
        return not (self.rain_rate > 0.0 or self.snow_rate > 0.0 or fog or self.gases or self.surface_wetness > 0.0)

    @property
    def surface_wetness(self) -> float:
        """Wetness of the surfaces, 0 to 1: the one given, else 1 - exp(-rain_rate / `WETTING_RATE`)."""
        if self.wetness is not None:
            return self.wetness
        return 1.0 - math.exp(-self.rain_rate / WETTING_RATE)

    @property
    def vapour_density(self) -> float:
        """Density of the water vapour [g/m3], of `humidity` at `temperature_celsius`."""
        return saturation_density(self.temperature_celsius) * self.humidity

    @property
    def film_thickness(self) -> float:
        """Depth of water on a surface that takes all the wetness [m]."""
        return self.surface_wetness * FULL_FILM

    @property
    def fog_visibility(self) -> float | None:
        """Meteorological range in the fog alone [m]; None: no fog."""
        return self.visibility if self.fog_water is None else visibility_of(self.fog_water)

    @property
    def fog_liquid_water(self) -> float:
        """Liquid water of the fog [g/m3]."""
        if self.fog_water is not None:
            return self.fog_water
        return 0.0 if self.visibility is None else fog_water_of(self.visibility)

    @property
    def atmosphere(self) -> Atmosphere:
        """Fog, rain and snow as a lidar meets them."""
        return Atmosphere(
            visibility=self.fog_visibility, rain_rate=self.rain_rate, snow_rate=self.snow_rate, snow=self.snow
        )

    @property
    def meteorological_range(self) -> float:
        """Range at which a black target has a contrast of 5 % through fog, rain and snow together [m].

        Infinite in clear air.
        """
        extinction = self.atmosphere.weather_extinction(REFERENCE_WAVELENGTH)
        return -math.log(CONTRAST) / extinction if extinction > 0.0 else math.inf

    def over(self, lighting: Lighting | None, indoors: bool = False) -> Lighting | None:
        """Return a lighting as it is in this weather; in clear and dry weather the given one.

        Haze adds up, the ground is as wet as the wetter of the two says, and where it rains, snows or a fog is denser
        than `FOG_RANGE` the sky is overcast, with the exposure raised as cameras do. Without a lighting, that of the
        preset ``"overcast"`` is taken. `indoors`, in a tunnel or a car park, the exposure stays.
        """
        hazy, wet = math.isfinite(self.meteorological_range), self.surface_wetness > 0.0
        if not hazy and not wet:
            return lighting
        base = Lighting.preset("overcast") if lighting is None else lighting
        changes: dict[str, Any] = {"wetness": max(base.wetness, self.surface_wetness)}
        if hazy:
            own = 0.0 if base.visibility is None else 1.0 / base.visibility
            changes["visibility"] = 1.0 / (own + 1.0 / self.meteorological_range)
        hides_sun = self.rain_rate > 0.0 or self.snow_rate > 0.0 or self.meteorological_range < FOG_RANGE
        covered = 1.0 if hides_sun else base.cloud_cover
        if covered > base.cloud_cover and base.sun_elevation_deg > 0.0 and not indoors:
            clear, dull = (Lighting.preset(name).exposure for name in ("day", "overcast"))
            share = min((covered - base.cloud_cover) / (1.0 - Lighting.preset("day").cloud_cover), 1.0)
            changes["exposure"] = base.exposure * (dull / clear) ** share
        return base.with_(cloud_cover=covered, **changes)


def saturation_density(celsius: float) -> float:
    r"""Return the density of saturated water vapour over water at a temperature [g/m3].

    .. math:: e_s = F \, 6.1121 \, e^{(18.678 - t / 234.5) t / (t + 257.14)} \text{ hPa}, \quad
        \rho = 216.7 \, e_s / T

    Parameters
    ----------
    celsius : float
        [degrees Celsius], -40 to 50.

    References
    ----------
    .. [1] Recommendation ITU-R P.453-14, "The radio refractive index: its formula and refractivity data", 2019.
    """
    more = 1.0 + 1e-4 * (7.2 + GAS_PRESSURE * (0.0320 + 5.9e-6 * celsius**2))
    pressure = more * 6.1121 * math.exp((18.678 - celsius / 234.5) * celsius / (celsius + 257.14))
    return 216.7 * pressure / (celsius + 273.15)


def fog_water_of(visibility: float) -> float:
    r"""Return the liquid water content of fog [g/m3] of a visibility (5 % contrast) [m].

    .. math:: M = \left(\frac{\ln 20}{144.7 \, V}\right)^{1 / 0.88}, \quad V \text{ in km}

    Measured fogs of one visibility differ by a factor of about 2.

    Raises
    ------
    ParameterRangeError
        If it is not > 0.

    References
    ----------
    .. [1] B. A. Kunkel, "Parameterization of droplet terminal velocity and extinction coefficient in fog models",
       J. Climate Appl. Meteorol. 23, 1984.
    """
    if not visibility > 0.0:
        raise ParameterRangeError("visibility", f"{visibility} m", "> 0 m")
    factor, power = KUNKEL
    return float((-math.log(CONTRAST) / (visibility / 1e3) / factor) ** (1.0 / power))


def visibility_of(fog_water: float) -> float:
    """Return the visibility [m] of a fog's liquid water content [g/m3], the inverse of :func:`fog_water_of`.

    By Kunkel's law, source as there; by definition its inverse.

    Raises
    ------
    ParameterRangeError
        If the water content is not positive.
    """
    if not fog_water > 0.0:
        raise ParameterRangeError("fog_water", f"{fog_water} g/m3", "> 0 g/m3")
    factor, power = KUNKEL
    return float(-math.log(CONTRAST) / (factor * fog_water**power) * 1e3)


WEATHER_PRESETS: Mapping[str, Mapping[str, Any]] = {
    "clear": {},
    "drizzle": {"rain_rate": 1.0, "visibility": 6e3, "gases": True},
    "rain": {"rain_rate": 10.0, "gases": True},
    "heavy_rain": {"rain_rate": 50.0, "gases": True},
    "fog": {"visibility": 200.0, "temperature_celsius": 5.0, "gases": True},
    "dense_fog": {"visibility": 50.0, "temperature_celsius": 5.0, "gases": True},
    "snow": {"snow_rate": 2.0, "temperature_celsius": -3.0, "gases": True},
    "winter": {"lying_snow": "beside_roads", "temperature_celsius": -3.0, "gases": True},
}
"""Weathers by name. Rates: drizzle below 1 to 2 mm/h, heavy above 10, violent above 50 mm/h (WMO-No. 8, in showers)."""
