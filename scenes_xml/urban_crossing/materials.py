"""Materials of this scene that `highway_guardrail` does not have; the rest is its."""

from __future__ import annotations

from ..generators.xml import Bsdf
from ..highway_guardrail.materials import MATERIALS as SHARED
from ..highway_guardrail.materials import PAINT, ROUGH, TYPICAL

CLOTH = {"roughness": 0.9, "specular": 0.15, "sheen": 0.4}
BODY = "estimate; thin dry fabric hardly weakens a radar wave, so a clothed body counts as skin for the radar"


def _cloth(lidar: float, *color: float) -> Bsdf:
    return Bsdf("principled", "skin", lidar, BODY, color=(color[0], color[1], color[2]), floats=CLOTH)


def _paint(lidar: float, *color: float) -> Bsdf:
    return Bsdf("principled", "car_paint", lidar, "estimate, clear coat", color=(color[0], color[1], color[2]), floats=PAINT)


def _plaster(texture: str) -> Bsdf:
    return Bsdf("principled", "brick", 0.50, "estimate, light plaster on brick", texture=texture, floats=ROUGH)


MATERIALS: dict[str, Bsdf] = {
    **SHARED,
    "asphalt_street": Bsdf(
        "principled", "asphalt", 0.20, "estimate, aged asphalt concrete", texture="asphalt.png",
        floats={"roughness": 0.75, "specular": 0.35}, wets=1.0, puddles="puddles.png",
    ),
    "paving": Bsdf("principled", "concrete", 0.38, TYPICAL, texture="paving.png", floats=ROUGH, wets=1.0),
    "plaster_yellow": _plaster("plaster_yellow.png"),
    "plaster_red": _plaster("plaster_red.png"),
    "plaster_grey": _plaster("plaster_grey.png"),
    "car_paint_white": _paint(0.65, 0.74, 0.74, 0.72),
    "car_paint_green": _paint(0.35, 0.02, 0.11, 0.07),
    "skin": Bsdf("principled", "skin", 0.35, "estimate, skin at 1550 nm: water absorbs", color=(0.50, 0.31, 0.22), floats={"roughness": 0.55, "specular": 0.35}),
    "hair": Bsdf("principled", "skin", 0.30, BODY, color=(0.045, 0.028, 0.018), floats={"roughness": 0.6, "specular": 0.3}),
    "top_red": _cloth(0.55, 0.42, 0.035, 0.04),
    "top_yellow": _cloth(0.60, 0.70, 0.42, 0.03),
    "top_grey": _cloth(0.50, 0.22, 0.23, 0.25),
    "top_green": _cloth(0.50, 0.05, 0.16, 0.08),
    "top_blue": _cloth(0.50, 0.03, 0.09, 0.30),
    "trousers_blue": _cloth(0.45, 0.035, 0.055, 0.11),
    "trousers_dark": _cloth(0.35, 0.025, 0.025, 0.028),
    "trousers_khaki": _cloth(0.50, 0.27, 0.21, 0.13),
    "shoes_dark": Bsdf("principled", "rubber", 0.20, TYPICAL, color=(0.03, 0.025, 0.022), floats={"roughness": 0.5, "specular": 0.4}),
    "shoes_white": Bsdf("principled", "rubber", 0.55, TYPICAL, color=(0.68, 0.68, 0.66), floats={"roughness": 0.5, "specular": 0.4}),
    "sign_crossing": Bsdf("principled", "metal", 0.60, "estimate, retroreflective sheet, diffuse share only", texture="sign_crossing.png", floats={"roughness": 0.4}),
}  # fmt: skip
