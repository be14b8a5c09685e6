"""How many points stand for the rain, the snow and the spray in a radar's view.

Their error and time stand in docs/weather.md.
"""

from __future__ import annotations

from pydantic import Field, model_validator

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Metres


class WeatherEchoSettings(Spec):
    """Points of random amplitude that stand for drops and flakes. Their mean power is exact for any number of them."""

    num_points: int = Field(
        100_000,
        ge=1,
        le=10_000_000,
        description="points that stand for rain and snow, at most: one a range-Doppler-angle cell above "
        "`Accuracy.channel_floor_db`; where there are more cells the weakest are thinned, and their power is no longer "
        "exponential; docs/weather.md, points",
    )
    points_per_cloud: int = Field(
        4_000, ge=1, le=1_000_000, description="points of the spray behind one vehicle; docs/weather.md, points"
    )
    nearest: Metres = Field(
        0.25,
        gt=0.0,
        description="drops nearer than this are left out [m]: there the radome's own water counts, which is not "
        "modelled; not charted",
    )

    @model_validator(mode="before")
    @classmethod
    def _without_random_points(cls, values: object) -> object:
        """Leave out `least_per_bin`, which datasets of schema 2 state: points stood at random then."""
        if isinstance(values, dict) and "least_per_bin" in values:
            return {name: value for name, value in values.items() if name != "least_per_bin"}
        return values


DEFAULT_WEATHER_ECHOES = WeatherEchoSettings()
