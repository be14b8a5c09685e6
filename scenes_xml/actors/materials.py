"""Optical, radio and lidar properties of the parts of vehicles; plain colours, no textures."""

from __future__ import annotations

from dataclasses import replace

from ..generators.xml import Bsdf

Color = tuple[float, float, float]
TYPICAL = "estimate, typical of this surface at 1550 nm"
PAINT = {"roughness": 0.07, "specular": 0.5}
"""Solid paint: the sharp mirror image of its clear coat over a diffuse base."""


def _bsdf(
    radio: str, lidar: float, color: Color, source: str = TYPICAL, lamp: str | None = None, **floats: float
) -> Bsdf:
    return Bsdf("principled", radio, lidar, source, color=color, floats=floats, lamp=lamp)


def paint(color: Color) -> Bsdf:
    """Return car paint of a linear RGB colour."""
    return _bsdf("car_paint", 0.45, color, "estimate, clear coat; 0.3 (dark) to 0.65 (white) over colours", **PAINT)


VEHICLE: dict[str, Bsdf] = {
    "window_glass": Bsdf(
        "thindielectric",
        "car_glass",
        0.04,
        "estimate, dust and scratches on clear glass",
        color=(0.80, 0.83, 0.82),
        floats={"int_ior": 1.52},
    ),
    "car_glass": _bsdf(
        "car_glass",
        0.04,
        (0.012, 0.015, 0.016),
        "estimate, tinted glass: nearly all light is mirrored or absorbed",
        roughness=0.07,
        specular=0.6,
    ),
    "cabin_trim": _bsdf(
        "plastic", 0.30, (0.055, 0.055, 0.058), "estimate, grained dark plastic", roughness=0.6, specular=0.4
    ),
    "seat_fabric": _bsdf(
        "plastic", 0.45, (0.10, 0.10, 0.105), "estimate, dark fabric over foam", roughness=0.9, specular=0.2
    ),
    "black_plastic": _bsdf(
        "plastic", 0.08, (0.014, 0.014, 0.015), "estimate, black plastic", roughness=0.45, specular=0.5
    ),
    "tyre_rubber": _bsdf(
        "rubber", 0.05, (0.018, 0.018, 0.018), "estimate, rubber with carbon black", roughness=0.8, specular=0.3
    ),
    "wheel_rim": _bsdf(
        "metal", 0.50, (0.55, 0.56, 0.58), "estimate, lacquered aluminium", roughness=0.28, metallic=0.9
    ),
    "wheel_mean": _bsdf(
        "metal",
        0.15,
        (0.05, 0.05, 0.052),
        "estimate, mean of tyre and rim; for the radar its rim",
        roughness=0.6,
        specular=0.4,
    ),
    "headlamp": _bsdf(
        "plastic",
        0.35,
        (0.40, 0.42, 0.45),
        "estimate, clear polycarbonate over reflectors",
        lamp="headlamp",
        roughness=0.06,
        specular=0.6,
    ),
    "taillamp": _bsdf(
        "plastic",
        0.40,
        (0.42, 0.010, 0.014),
        "estimate, red acrylic over reflectors",
        lamp="taillamp",
        roughness=0.06,
        specular=0.6,
    ),
    "indicator": _bsdf(
        "plastic", 0.45, (0.70, 0.22, 0.02), "estimate, amber acrylic", lamp="indicator", roughness=0.1, specular=0.6
    ),
    "bright_metal": _bsdf("metal", 0.50, (0.72, 0.73, 0.74), roughness=0.25, metallic=1.0),
    "number_plate": replace(
        _bsdf(
            "metal",
            0.60,
            (0.72, 0.72, 0.68),
            "estimate, aluminium with a retroreflective sheet, ISO 7591",
            roughness=0.4,
            specular=0.4,
        ),
        retroreflection=45.0,
    ),
    "plate_letters": _bsdf(
        "metal", 0.08, (0.014, 0.014, 0.015), "estimate, black paint on the plate", roughness=0.45, specular=0.5
    ),
    "underbody_steel": _bsdf(
        "metal", 0.15, (0.035, 0.034, 0.033), "estimate, dirty steel with underseal", roughness=0.8, specular=0.3
    ),
    "mirror_silver": _bsdf("metal", 0.30, (0.80, 0.81, 0.82), "estimate, silvered glass", roughness=0.05, metallic=1.0),
}
"""What all vehicles share, by BSDF id. Panes are `window_glass`, which lets 0.74 of the light through once (UN
Regulation 43 wants 0.70 of wind screens and front windows), where there is an inside to see, and `car_glass`, dark and
opaque to the eye, where there is none; the paint and what is special is added by each. Ids of BSDFs and shapes must
differ in a file."""

ROLES = {
    "paint": "paint", "glass": "car_glass", "pane": "window_glass", "interior": "cabin_trim", "seat": "seat_fabric",
    "clothes": "top", "skin": "skin", "hair": "hair",
    "trim": "black_plastic", "tyre": "tyre_rubber", "rim": "wheel_rim",
    "wheel": "wheel_mean",
    "headlamp": "headlamp", "taillamp": "taillamp", "chrome": "bright_metal", "plate": "number_plate",
    "plate_text": "plate_letters",
    "indicator": "indicator", "mirror_glass": "mirror_silver", "underbody": "underbody_steel",
    "chassis": "chassis_steel",
}  # fmt: skip # a table
"""Role of a part of a generator -> its BSDF."""
