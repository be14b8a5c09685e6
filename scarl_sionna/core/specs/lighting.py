"""Light and weather of a scene as cameras see them: sun, sky, clouds, lamps, wet ground, haze."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from scarl_sionna.core.errors import UnknownNameError
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Degrees, Metres, Unit


class Lighting(Spec):
    """Light of a scene. It changes images of the optical twin and sunlight on what lidars see, never geometry."""

    sun_elevation_deg: Degrees = Field(
        38.0, ge=-90.0, le=90.0, description="above the horizon; below -18 it is night [deg]"
    )
    sun_azimuth_deg: Degrees = Field(121.0, ge=-360.0, le=360.0, description="from the world's +x towards +y [deg]")
    turbidity: float = Field(3.0, ge=1.0, le=10.0, description="haze of the clear sky, 2: very clear, 6: hazy")
    cloud_cover: float = Field(0.0, ge=0.0, le=1.0, description="share of the sky with clouds; 1: overcast, no sun")
    night_sky_luminance: Annotated[float, Unit("cd/m2")] = Field(
        0.01, ge=0.0, description="sky glow that is left without sun [cd/m2]"
    )
    headlamps: bool = Field(False, description="head and tail lamps of the vehicles")
    street_lamps: bool = False
    lit_windows: float = Field(
        0.0, ge=0.0, le=1.0, description="share of the rooms of buildings in which light burns; seen where lamps are on"
    )
    wetness: float = Field(0.0, ge=0.0, le=1.0, description="of the ground; 1: puddles in the wheel tracks")
    visibility: Metres | None = Field(
        None, gt=0.0, description="meteorological range at 5 % contrast [m]; None: no haze"
    )
    glow: bool = Field(True, description="haze scatters the light of lamps towards the camera")
    exposure: float = Field(
        1.0, gt=0.0, description="factor on the exposure of every camera, so that it suits this light"
    )

    @classmethod
    def preset(cls, name: str) -> Lighting:
        """Return a named lighting: one of `LIGHTING_PRESETS`.

        Raises
        ------
        UnknownNameError
            If there is no such preset.
        """
        if name not in LIGHTING_PRESETS:
            raise UnknownNameError("lighting", name, LIGHTING_PRESETS)
        return cls(**LIGHTING_PRESETS[name])


LIGHTING_PRESETS: Mapping[str, Mapping[str, Any]] = {
    "day": {"cloud_cover": 0.3, "visibility": 25e3, "exposure": 1.5},
    "dusk": {
        "sun_elevation_deg": 3.5, "sun_azimuth_deg": 62.0, "turbidity": 2.5, "cloud_cover": 0.35, "visibility": 15e3,
        "headlamps": True, "street_lamps": True, "lit_windows": 0.3, "exposure": 4.0,
    },
    "night": {
        "sun_elevation_deg": -30.0, "headlamps": True, "street_lamps": True, "lit_windows": 0.35, "exposure": 700.0,
    },
    "overcast": {"cloud_cover": 1.0, "visibility": 15e3, "exposure": 4.5},
    "rain": {
        "cloud_cover": 1.0, "sun_elevation_deg": 25.0, "visibility": 2500.0, "wetness": 1.0, "headlamps": True,
        "exposure": 6.0,
    },
}  # fmt: skip # a table
"""Lightings by name."""
