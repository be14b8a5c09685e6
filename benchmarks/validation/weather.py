"""What rain, snow and fog take and send back.

python benchmarks/validation/weather.py
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import scarl_sionna as ss
from benchmarks.validation.rows import Row, run
from scarl_sionna.core.specs.drop_sizes import RAIN_SIZES, terminal_speed
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.weather.attenuation import weather_attenuation
from scarl_sionna.radar.weather.hydrometeors import rain, snow
from scarl_sionna.radar.weather.itu_rain import rain_attenuation

FREQUENCY = 77e9
TEMPERATURE = 283.15
FALL_SPEEDS = {1e-3: 4.03, 2e-3: 6.49, 4e-3: 8.83}
"""Of drops by diameter [m, m/s], Gunn and Kinzer 1949."""


def eta_db(rate: float, sizes: str) -> float:
    """Return the reflectivity of rain [dB over 1 m2/m3]."""
    return float(10.0 * np.log10(rain(rate, FREQUENCY, TEMPERATURE, sizes).reflectivity))


def attenuation() -> list[Row]:
    """Return the rows of what the air takes."""
    rows = []
    for rate in (5.0, 25.0, 50.0):
        found = [rain(rate, FREQUENCY, TEMPERATURE, name).attenuation_db_per_km for name in RAIN_SIZES]
        ours = round(0.5 * sum(rain_attenuation(rate, FREQUENCY, which) for which in ("V", "H")), 2)
        rows.append(
            Row(f"rain_{rate:g}", f"loss in rain of {rate:g} mm/h, 77 GHz", "joss", "dB/km", round(min(found), 2),
                round(max(found), 2), "between", "held out", ours,
                "ours ITU-R P.838-3; the range is Mie's series over the four distributions")
        )  # fmt: skip # a table
    heavy = weather_attenuation(ss.Weather.preset("heavy_rain"), FREQUENCY, "V")
    flakes = weather_attenuation(ss.Weather.preset("snow"), FREQUENCY, "V")
    rows += [
        Row("heavy_rain", "loss in heavy rain, 77 GHz, preset `heavy_rain` (50 mm/h)", "birmingham", "dB/km", None,
            20.0,
            "stated", "bound", round(heavy, 2)),
        Row("snowfall", "loss in snowfall, 77 GHz, preset `snow` (2 mm/h)", "birmingham", "dB/km", None, 15.0, "stated",
            "bound", round(flakes, 2)),
    ]  # fmt: skip # a table
    return rows


def echo() -> list[Row]:
    """Return the rows of what the air sends back."""
    rows = []
    for rate in (5.0, 25.0, 50.0):
        found = [eta_db(rate, name) for name in RAIN_SIZES]
        rows.append(
            Row(f"rain_echo_{rate:g}", f"reflectivity of rain of {rate:g} mm/h, 77 GHz", "joss", "dB(m2/m3)",
                round(min(found), 2), round(max(found), 2), "between", "fitted", round(eta_db(rate, "p838"), 2),
                "the slope is Marshall and Palmer's; how many drops follows from P.838")
        )  # fmt: skip # a table
    frequency = 94e9
    for rate in (0.3, 1.0, 2.0):
        eta = snow(rate, frequency, "dry", 270.0).reflectivity
        z = 10.0 * np.log10(eta * (SPEED_OF_LIGHT / frequency) ** 4 / np.pi**5 / 0.93 * 1e18)
        law = 10.0 * np.log10(10.0 * rate**0.8)
        rows.append(
            Row(f"snow_echo_{rate:g}", f"equivalent Z of dry snow of {rate:g} mm/h, 94 GHz", "matrosov", "dBZ",
                round(law - 5.0, 2), round(law + 5.0, 2), "stated", "held out", round(float(z), 2))
        )  # fmt: skip # a table
    for diameter, speed in FALL_SPEEDS.items():
        rows.append(
            Row(f"fall_{1e3 * diameter:g}mm", f"speed of fall of drops of {1e3 * diameter:g} mm", "gunn", "m/s",
                round(0.97 * speed, 3), round(1.03 * speed, 3), "assumed", "fitted",
                round(float(terminal_speed([diameter])[0]), 3), "+-3 %; the law is a fit to these")
        )  # fmt: skip # a table
    return rows


def rows() -> list[Row]:
    """Return all rows of the theme."""
    return [*attenuation(), *echo()]


if __name__ == "__main__":
    run("weather", rows)
