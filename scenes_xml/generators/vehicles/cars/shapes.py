"""Measures of the cars of `highway_guardrail` and `urban_crossing`, and the materials of a car's parts."""

from __future__ import annotations

from .measures import CarShape

CARS: dict[str, CarShape] = {
    "ego": CarShape(
        length=4.6, width=1.82, height=1.46, front_axle=1.38, rear_axle=-1.36,
        deck=((-2.3, 0.93), (-2.15, 0.985), (-1.7, 0.985), (-1.0, 0.955), (0.0, 0.935), (0.95, 0.915), (1.5, 0.85),
        (2.0, 0.76), (2.3, 0.69)),
        cabin_base=(-1.85, 1.10), cabin_top=(-0.95, 0.28), cabin_base_width=0.82, cabin_top_width=0.60,
        glazing=((0.06, 0.44), (0.475, 0.82)),
        rear_bow=0.18, tail_lamp=(0.74, 0.90), extra={"plate_z": 0.62, "mirror_z": 0.98},
    ),
    "car_ahead": CarShape(
        length=4.30, width=1.84, height=1.62, front_axle=1.30, rear_axle=-1.28,
        deck=((-2.15, 1.02), (-2.0, 1.05), (-1.2, 1.05), (0.0, 1.02), (0.9, 1.0), (1.4, 0.95), (1.9, 0.86), (2.15,
        0.79)),
        cabin_base=(-2.07, 1.10), cabin_top=(-1.80, 0.34), cabin_base_width=0.845, cabin_top_width=0.68,
        glazing=((0.05, 0.36), (0.39, 0.68), (0.72, 0.92)),
        wheel_radius=0.345, floor=0.22, spokes=6, rear_bow=0.17, tail_slope=0.0, lamp_height=0.75, tail_lamp=(0.70,
        0.985), cladding=True,
        extra={"plate_z": 0.72, "tail_lamp_inner": 0.76, "mirror_z": 1.07, "handle_z": 0.87, "roof_sag": 0.05},
    ),
    "oncoming": CarShape(
        length=4.72, width=1.84, height=1.47, front_axle=1.44, rear_axle=-1.40,
        deck=((-2.36, 0.94), (-2.2, 0.98), (-1.4, 0.98), (0.0, 0.94), (0.95, 0.92), (1.5, 0.86), (2.05, 0.77), (2.36,
        0.70)),
        cabin_base=(-2.26, 1.12), cabin_top=(-1.80, 0.28), cabin_base_width=0.82, cabin_top_width=0.61,
        glazing=((0.05, 0.34), (0.365, 0.64), (0.68, 0.91)),
        spokes=7, rear_bow=0.17, tail_slope=0.03, tail_lamp=(0.76, 0.93),
        extra={"plate_z": 0.64, "mirror_z": 0.99, "roof_sag": 0.05},
    ),
}  # fmt: skip # a table
"""Saloon, compact SUV and estate; widths without the mirrors, which reach |y| = 0.95 m."""

ROLES = {
    "glass": "car_glass", "trim": "car_trim", "tyre": "tyre_rubber", "rim": "wheel_rim", "headlamp": "headlamp",
    "taillamp": "taillamp", "chrome": "chrome", "plate": "number_plate",
}  # fmt: skip # a table
"""Role of a part of a car -> its material; `paint` is chosen for each car."""
