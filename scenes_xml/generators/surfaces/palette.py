"""Palette of the scenes: optical, radio and lidar properties of every material, by the name of its BSDF."""

from __future__ import annotations

from dataclasses import replace

from ..xml import Bsdf

TYPICAL = "estimate, typical of this surface at 1550 nm"
SHEET = "estimate, retroreflective sheet, white of class RA2, EN 12899-1"
ROUGH = {"roughness": 0.85, "specular": 0.25}
PAINT = {"roughness": 0.07, "specular": 0.5}
METALLIC = {"roughness": 0.22, "specular": 0.5, "metallic": 0.55, "clearcoat": 1.0, "clearcoat_gloss": 0.97}
"""Solid paint: the sharp mirror image of its clear coat over a diffuse base. Metallic: flakes below the coat."""


def _principled(
    radio: str, lidar: float, color: tuple[float, float, float], source: str = TYPICAL, **floats: float
) -> Bsdf:
    return Bsdf("principled", radio, lidar, source, color=color, floats=floats)


def _textured(radio: str, lidar: float, texture: str, source: str = TYPICAL, **floats: float) -> Bsdf:
    return Bsdf("principled", radio, lidar, source, texture=texture, floats=floats or ROUGH)


def _paint(lidar: float, *color: float) -> Bsdf:
    return Bsdf(
        "principled", "car_paint", lidar, "estimate, clear coat", color=(color[0], color[1], color[2]), floats=PAINT
    )


def _plaster(texture: str) -> Bsdf:
    return Bsdf("principled", "brick", 0.50, "estimate, light plaster on brick", texture=texture, floats=ROUGH)


PALETTE: dict[str, Bsdf] = {
    "asphalt_worn": _textured(
        "asphalt",
        0.20,
        "asphalt.png",
        "estimate, aged asphalt concrete, rises into the SWIR",
        roughness=0.75,
        specular=0.35,
    ),
    "road_marking": _textured("road_paint", 0.55, "marking.png", "estimate, worn thermoplastic marking"),
    "gravel_verge": _textured("gravel", 0.32, "gravel.png"),
    "grass_meadow": _textured(
        "grass", 0.28, "grass.png", "estimate, green grass: liquid water absorbs at 1450 nm and beyond"
    ),
    "grass_blades": _principled("grass", 0.28, (0.085, 0.14, 0.028), roughness=0.7, specular=0.3),
    "grass_dry": _principled("grass", 0.42, (0.26, 0.21, 0.09), roughness=0.8, specular=0.2),
    "galvanized_steel": _principled(
        "metal", 0.45, (0.56, 0.57, 0.58), "estimate, weathered zinc", roughness=0.38, metallic=0.75
    ),
    "concrete_grey": _textured("concrete", 0.35, "concrete.png"),
    "car_paint_blue": _principled(
        "car_paint", 0.30, (0.012, 0.045, 0.16), "estimate, dark paint with clear coat", **PAINT
    ),
    "car_paint_red": _principled(
        "car_paint", 0.45, (0.36, 0.012, 0.014), "estimate, red paint with clear coat", **PAINT
    ),
    "car_paint_silver": _principled("car_paint", 0.55, (0.62, 0.63, 0.64), "estimate, metallic paint", **METALLIC),
    "car_glass": _principled(
        "car_glass",
        0.04,
        (0.012, 0.015, 0.016),
        "estimate, tinted glass: nearly all light is mirrored or absorbed",
        roughness=0.07,
        specular=0.6,
    ),
    "car_trim": _principled("plastic", 0.08, (0.014, 0.014, 0.015), roughness=0.45, specular=0.5),
    "tyre_rubber": _principled("rubber", 0.05, (0.018, 0.018, 0.018), roughness=0.8, specular=0.3),
    "wheel_rim": _principled("metal", 0.50, (0.55, 0.56, 0.58), roughness=0.28, metallic=0.9),
    "headlamp": _textured("plastic", 0.35, "headlamp.png", roughness=0.06, specular=0.6),
    "taillamp": _textured("plastic", 0.40, "taillamp.png", roughness=0.06, specular=0.6),
    "chrome": _principled("metal", 0.50, (0.72, 0.73, 0.74), roughness=0.25, metallic=1.0),
    "number_plate": _textured("plastic", 0.60, "plate.png", roughness=0.4, specular=0.4),
    "bark": _textured("wood", 0.45, "bark.png", "estimate, dry bark"),
    "leaves": Bsdf(
        "principledthin",
        "foliage",
        0.45,
        "estimate, green leaves between the water bands",
        texture="leaves.png",
        floats={"roughness": 0.5, "diff_trans": 0.9, "eta": 1.4},
    ),
    "leaves_shade": _principled("foliage", 0.40, (0.030, 0.052, 0.013), roughness=0.9, specular=0.1),
    "plaster_wall": _textured("brick", 0.50, "plaster.png", "estimate, light plaster on brick"),
    "brick_wall": _textured("brick", 0.45, "bricks.png"),
    "roof_tile": _textured("brick", 0.40, "roof_tiles.png"),
    "window_pane": _principled(
        "glass", 0.05, (0.02, 0.026, 0.03), "estimate, window pane: mirrors and transmits", roughness=0.03, specular=0.6
    ),
    "painted_wood": _principled("wood", 0.60, (0.68, 0.67, 0.63), roughness=0.5),
    "door_wood": _principled("wood", 0.40, (0.10, 0.055, 0.03), roughness=0.5),
    "sign_speed": _textured("metal", 0.60, "sign_speed.png", SHEET, roughness=0.4),
    "sign_bend": _textured("metal", 0.60, "sign_bend.png", SHEET, roughness=0.4),
    "sign_chevron": _textured("metal", 0.60, "sign_chevron.png", SHEET, roughness=0.4),
    "sign_back": _principled("metal", 0.45, (0.36, 0.37, 0.38), roughness=0.45, metallic=0.4),
    "white_plastic": _principled("plastic", 0.65, (0.74, 0.74, 0.72), roughness=0.5),
    "black_plastic": _principled("plastic", 0.08, (0.02, 0.02, 0.02), roughness=0.5),
    "reflector": _principled(
        "plastic",
        0.70,
        (0.70, 0.55, 0.25),
        "estimate, amber prisms, UN Regulation 3",
        roughness=0.15,
        clearcoat=1.0,
    ),
    "lamp_glass": _principled("plastic", 0.40, (0.75, 0.75, 0.70), roughness=0.1, clearcoat=1.0),
    "asphalt_street": Bsdf(
        "principled",
        "asphalt",
        0.20,
        "estimate, aged asphalt concrete",
        texture="asphalt.png",
        floats={"roughness": 0.75, "specular": 0.35},
    ),
    "paving": Bsdf("principled", "concrete", 0.38, TYPICAL, texture="paving.png", floats=ROUGH),
    "plaster_yellow": _plaster("plaster_yellow.png"),
    "plaster_red": _plaster("plaster_red.png"),
    "plaster_grey": _plaster("plaster_grey.png"),
    "car_paint_white": _paint(0.65, 0.74, 0.74, 0.72),
    "car_paint_green": _paint(0.35, 0.02, 0.11, 0.07),
    "sign_crossing": Bsdf(
        "principled",
        "metal",
        0.60,
        SHEET,
        texture="sign_crossing.png",
        floats={"roughness": 0.4},
    ),
    "asphalt_plain": _textured(
        "asphalt", 0.20, "asphalt_plain.png", "estimate, aged asphalt concrete", roughness=0.75, specular=0.35
    ),
    "asphalt_dark": _textured(
        "asphalt", 0.16, "asphalt_dark.png", "estimate, asphalt concrete of few years", roughness=0.72, specular=0.38
    ),
    "paving_slabs": _textured("concrete", 0.38, "paving_slabs.png"),
    "setts": _textured("concrete", 0.33, "setts.png", "estimate, granite setts"),
    "kerb_stone": _textured("concrete", 0.35, "concrete_plain.png"),
    "marking_worn": _textured("road_paint", 0.55, "marking_worn.png", "estimate, worn thermoplastic marking"),
    "lawn": _textured("grass", 0.28, "lawn.png", "estimate, green grass: liquid water absorbs at 1450 nm and beyond"),
    "soil": _textured("soil", 0.35, "soil.png", "estimate, dry soil"),
    "gravel_fine": _textured("gravel", 0.32, "gravel_fine.png"),
    "hedge": _textured("foliage", 0.42, "hedge.png", "estimate, green leaves between the water bands"),
    "bark_furrowed": _textured("wood", 0.45, "bark_furrowed.png", "estimate, dry bark"),
    "leaf_cards": Bsdf(
        "principledthin",
        "foliage",
        0.45,
        "estimate, green leaves between the water bands",
        texture="leaf_tones.png",
        floats={"roughness": 0.5, "diff_trans": 0.9, "eta": 1.4},
    ),
    "needles": _principled(
        "foliage", 0.40, (0.020, 0.042, 0.018), "estimate, green needles", roughness=0.9, specular=0.1
    ),
    "leaves_crown": _principled(
        "foliage", 0.42, (0.060, 0.105, 0.022), "estimate, green leaves", roughness=0.9, specular=0.1
    ),
    "petals_red": _principled("foliage", 0.50, (0.55, 0.03, 0.05), "estimate, petals", roughness=0.7),
    "petals_yellow": _principled("foliage", 0.55, (0.75, 0.48, 0.03), "estimate, petals", roughness=0.7),
    "petals_violet": _principled("foliage", 0.50, (0.22, 0.07, 0.40), "estimate, petals", roughness=0.7),
    "wall_white": _plaster("plaster_white.png"),
    "wall_ochre": _plaster("plaster_ochre.png"),
    "wall_rose": _plaster("plaster_rose.png"),
    "wall_cool": _plaster("plaster_cool.png"),
    "wall_brick": _textured("brick", 0.45, "brick_bond.png"),
    "tiles_red": _textured("brick", 0.40, "tiles_red.png"),
    "tiles_dark": _textured("brick", 0.30, "tiles_dark.png"),
    "boards": _textured("wood", 0.50, "boards.png", "estimate, weathered timber"),
    "timber_grey": _principled(
        "wood", 0.50, (0.20, 0.175, 0.145), "estimate, weathered timber", roughness=0.85, specular=0.2
    ),
    "fence_white": _principled("wood", 0.62, (0.70, 0.69, 0.66), roughness=0.6),
    "door_green": _principled("wood", 0.40, (0.03, 0.10, 0.06), roughness=0.45),
    "door_red": _principled("wood", 0.42, (0.22, 0.025, 0.02), roughness=0.45),
    "garage_door": _principled("metal", 0.50, (0.45, 0.46, 0.46), "estimate, painted sheet steel", roughness=0.5),
    "manhole": _textured("metal", 0.20, "manhole.png", "estimate, cast iron", roughness=0.5, metallic=0.3),
    "iron_dark": _principled("metal", 0.20, (0.05, 0.048, 0.045), "estimate, cast iron", roughness=0.6, metallic=0.4),
    "corten": _principled("metal", 0.40, (0.24, 0.085, 0.03), "estimate, rusted steel", roughness=0.75, metallic=0.2),
    "bin_black": _principled("plastic", 0.12, (0.03, 0.032, 0.033), roughness=0.5),
    "bin_blue": _principled("plastic", 0.30, (0.02, 0.07, 0.22), roughness=0.5),
    "bin_yellow": _principled("plastic", 0.55, (0.72, 0.48, 0.03), roughness=0.5),
    "bin_green": _principled("plastic", 0.35, (0.025, 0.13, 0.05), roughness=0.5),
    "straw": _principled("grass", 0.50, (0.48, 0.36, 0.13), "estimate, dry straw", roughness=0.9, specular=0.15),
    "crop": _textured("grass", 0.50, "crop.png", "estimate, ripe grain"),
    "sign_walkers": _textured("metal", 0.60, "sign_walkers.png", SHEET, roughness=0.4),
    "sign_yield": _textured("metal", 0.60, "sign_yield.png", SHEET, roughness=0.4),
    "sign_roundabout": _textured("metal", 0.60, "sign_roundabout.png", SHEET, roughness=0.4),
    "sign_keep_right": _textured("metal", 0.60, "sign_keep_right.png", SHEET, roughness=0.4),
    "sign_zone": _textured("metal", 0.60, "sign_zone.png", SHEET, roughness=0.4),
    "sign_bend_left": _textured("metal", 0.60, "sign_bend_left.png", SHEET, roughness=0.4),
    "sign_arrows": _textured("metal", 0.60, "sign_arrows.png", SHEET, roughness=0.4),
    "sign_arrows_right": _textured("metal", 0.60, "sign_arrows_right.png", SHEET, roughness=0.4),
}
"""Name of the bsdf -> its properties."""

_LAMPS = {"headlamp": "headlamp", "taillamp": "taillamp", "lamp_glass": "street_lamp"}
_WETS = {
    "asphalt_worn": 1.0, "road_marking": 1.0, "gravel_verge": 0.7, "grass_meadow": 0.35, "concrete_grey": 0.7,
    "bark": 0.6,
    "asphalt_street": 1.0, "paving": 1.0, "roof_tile": 0.8, "brick_wall": 0.3, "plaster_wall": 0.2,
    "asphalt_plain": 1.0, "asphalt_dark": 1.0, "paving_slabs": 1.0, "setts": 1.0, "kerb_stone": 0.8,
    "marking_worn": 1.0, "lawn": 0.35, "soil": 0.5,
    "gravel_fine": 0.7, "bark_furrowed": 0.6, "wall_brick": 0.3, "tiles_red": 0.8, "tiles_dark": 0.8, "boards": 0.4,
    "manhole": 1.0,
}  # fmt: skip # a table
_SHEETS = {  # R_A [cd/(lx m2)]: EN 12899-1 class RA2; UN Regulation 3, 0.3 cd/lx on 10 cm2; ISO 7591
    **dict.fromkeys((name for name, bsdf in PALETTE.items() if bsdf.source == SHEET), 250.0),
    "reflector": 300.0,
    "number_plate": 45.0,
}
_BEADS = {"road_marking": 0.15, "marking_worn": 0.1}  # R_L [cd/(lx m2)], EN 1436 classes R3 and R2
_PUDDLES = {"asphalt_worn": "puddles.png", "asphalt_street": "puddles.png"}
for _name, _bsdf in PALETTE.items():
    PALETTE[_name] = replace(
        _bsdf,
        retroreflection=_SHEETS.get(_name, 0.0),
        retroreflected_luminance=_BEADS.get(_name, 0.0),
        lamp=_LAMPS.get(_name),
        wets=_WETS.get(_name, 0.0),
        puddles=_PUDDLES.get(_name),
    )
