"""Pedestrians: an adult man, an adult woman and a child who walk, and an adult who stands."""

from __future__ import annotations

from collections.abc import Mapping

from ..generators.geometry.mesh import Mesh, merge
from ..generators.people import clothing, pedestrian
from ..generators.people.pedestrian import BodyShape
from ..generators.people.posture import Posture, posed
from ..generators.xml import Bsdf
from .model import Color, Model, Part

CREASE = 70.0
CLOTH = {"roughness": 0.9, "specular": 0.15, "sheen": 0.4}
DRESSED = "estimate; for the radar the mean of garments on skin"
SKIN = "estimate, skin at 1550 nm: water absorbs"


def cloth(color: Color, lidar: float = 0.5) -> Bsdf:
    """Return the look of clothes on a body."""
    return Bsdf("principled", "clothed_skin", lidar, DRESSED, color=color, floats=CLOTH)


def bare(color: Color) -> Bsdf:
    """Return the look of skin."""
    return Bsdf("principled", "skin", 0.12, SKIN, color=color, floats={"roughness": 0.55, "specular": 0.35})


def hair(color: Color) -> Bsdf:
    """Return the look of hair, through which a radar sees the skin."""
    return Bsdf(
        "principled", "skin", 0.30, "estimate, dark hair", color=color, floats={"roughness": 0.6, "specular": 0.3}
    )


def shoes(color: Color) -> Bsdf:
    """Return the look of shoes."""
    return Bsdf(
        "principled",
        "rubber",
        0.25,
        "estimate, rubber and leather",
        color=color,
        floats={"roughness": 0.5, "specular": 0.4},
    )


def bag(color: Color) -> Bsdf:
    """Return the look of a bag of fabric."""
    return Bsdf(
        "principled",
        "clothing",
        0.45,
        "estimate, woven fabric; for the radar without what is in it",
        color=color,
        floats=CLOTH,
    )


MAN = BodyShape(1.78, 1.03, 1.0, shoulders=1.04, hips=0.98, leg_inset=0.034, arm_inset=0.016)
WOMAN = BodyShape(1.66, 0.94, 1.0, shoulders=0.92, hips=1.06, leg_inset=0.036, arm_inset=0.026)
CHILD = BodyShape(1.24, 0.96, 1.18, shoulders=0.96, hips=0.98, leg_inset=0.034, arm_inset=0.020)

MATERIALS: dict[str, Bsdf] = {
    "top": cloth((0.03, 0.06, 0.16)),
    "trousers": cloth((0.035, 0.045, 0.08), 0.45),
    "shoes": shoes((0.03, 0.022, 0.018)),
    "skin": bare((0.50, 0.31, 0.22)),
    "hair": hair((0.045, 0.028, 0.018)),
    "bag": bag((0.16, 0.03, 0.03)),
}


def _parts(shape: BodyShape, light: bool, worn: Mapping[str, tuple[Mesh, str]]) -> dict[str, Part]:
    """Return the shapes of a walker, each in the frame of its segment; `worn` replaces and adds."""
    whole = {**pedestrian.body(shape, light), **worn}
    return {name: Part(body, role, CREASE) for name, (body, role) in whole.items()}


def _walker(
    name: str,
    title: str,
    shape: BodyShape,
    measures: tuple[float, float, float],
    worn: Mapping[str, tuple[Mesh, str]],
    worn_light: Mapping[str, tuple[Mesh, str]],
    variants: Mapping[str, Mapping[str, Color]],
) -> Model:
    length, width, height = measures
    head = {
        "name": name,
        "title": title,
        "class": "Pedestrian",
        "motion": "walk",
        "length": length,
        "width": width,
        "height": height,
    }
    first = next(iter(variants.values()))
    bsdfs = {key: tinted(bsdf, first.get(key)) for key, bsdf in MATERIALS.items()}
    joints = [{"kind": "walk", "height": shape.height}]
    return Model(head, _parts(shape, False, worn), _parts(shape, True, worn_light), bsdfs, variants, joints)


def tinted(bsdf: Bsdf, color: Color | None) -> Bsdf:
    """Return a material in another colour, or itself."""
    return bsdf if color is None else Bsdf(**{**vars(bsdf), "color": color})


def adult_man() -> Model:
    """Return a man of 1.78 m in a jacket."""
    variants = {
        "blue": {"top": (0.03, 0.06, 0.16), "trousers": (0.05, 0.05, 0.055), "shoes": (0.03, 0.022, 0.018)},
        "red": {"top": (0.36, 0.03, 0.035), "trousers": (0.035, 0.055, 0.11), "shoes": (0.60, 0.60, 0.58)},
        "olive": {"top": (0.10, 0.11, 0.045), "trousers": (0.22, 0.17, 0.10), "shoes": (0.10, 0.05, 0.025)},
        "grey": {"top": (0.16, 0.165, 0.175), "trousers": (0.02, 0.02, 0.023), "shoes": (0.02, 0.02, 0.02)},
    }
    worn = {
        "pelvis_jacket": (clothing.jacket_hem(MAN), "top"),
        "torso_collar": (clothing.collar(MAN), "top"),
    }
    light = {"pelvis": (clothing.jacket_hem(MAN, True), "top")}
    return _walker("adult_man", "Man who walks", MAN, (1.00, 0.52, 1.70), worn, light, variants)


def adult_woman() -> Model:
    """Return a woman of 1.66 m in a coat, with a bag."""
    variants = {
        "camel": {
            "top": (0.40, 0.24, 0.11),
            "trousers": (0.03, 0.03, 0.035),
            "shoes": (0.05, 0.025, 0.015),
            "bag": (0.12, 0.03, 0.02),
        },
        "teal": {
            "top": (0.02, 0.17, 0.18),
            "trousers": (0.035, 0.055, 0.11),
            "shoes": (0.60, 0.60, 0.58),
            "bag": (0.30, 0.20, 0.10),
        },
        "plum": {
            "top": (0.17, 0.03, 0.11),
            "trousers": (0.02, 0.02, 0.023),
            "shoes": (0.02, 0.02, 0.02),
            "bag": (0.02, 0.02, 0.022),
        },
        "white": {
            "top": (0.60, 0.58, 0.54),
            "trousers": (0.05, 0.08, 0.17),
            "shoes": (0.20, 0.11, 0.05),
            "bag": (0.20, 0.03, 0.03),
        },
    }
    worn = {
        "head_hair": (clothing.long_hair(WOMAN), "hair"),
        "pelvis_coat": (clothing.coat_hem(WOMAN), "top"),
        "torso_collar": (clothing.collar(WOMAN), "top"),
        "torso_bag": (clothing.shoulder_bag(WOMAN), "bag"),
    }
    light = {"head_hair": (clothing.long_hair(WOMAN, True), "hair"), "pelvis": (clothing.coat_hem(WOMAN, True), "top")}
    return _walker("adult_woman", "Woman who walks", WOMAN, (0.94, 0.47, 1.59), worn, light, variants)


def child() -> Model:
    """Return a child of 1.24 m with a backpack."""
    variants = {
        "yellow": {
            "top": (0.70, 0.42, 0.03),
            "trousers": (0.05, 0.08, 0.17),
            "shoes": (0.60, 0.60, 0.58),
            "bag": (0.03, 0.10, 0.30),
        },
        "pink": {
            "top": (0.55, 0.10, 0.25),
            "trousers": (0.10, 0.10, 0.12),
            "shoes": (0.55, 0.12, 0.22),
            "bag": (0.20, 0.05, 0.28),
        },
        "green": {
            "top": (0.06, 0.25, 0.09),
            "trousers": (0.22, 0.17, 0.10),
            "shoes": (0.03, 0.03, 0.03),
            "bag": (0.42, 0.035, 0.04),
        },
    }
    worn = {
        "pelvis_jacket": (clothing.jacket_hem(CHILD), "top"),
        "torso_collar": (clothing.collar(CHILD), "top"),
        "torso_backpack": (clothing.backpack(CHILD), "bag"),
    }
    light = {
        "pelvis": (clothing.jacket_hem(CHILD, True), "top"),
        "torso_backpack": (clothing.backpack(CHILD, True), "bag"),
    }
    return _walker("child", "Child who walks to school", CHILD, (0.72, 0.35, 1.22), worn, light, variants)


STANDING = Posture(
    hip=(0.0, 0.0, 0.905), lean_deg=-1.0, grip=(0.06, 0.245, 0.80), other_grip=(0.255, -0.06, 1.22), foot=(0.03, 0.145,
    0.0635),
    other_foot=(-0.05, -0.130, 0.0635), gaze_deg=24.0, toe_out_deg=12.0, hip_width=0.075,
)  # fmt: skip # a table
"""The weight on both legs, one hand with a telephone before the chest."""


def standing_adult() -> Model:
    """Return an adult of 1.78 m who stands and looks at a telephone; one rigid body, a shape for each material."""
    variants = {
        "green": {"top": (0.05, 0.16, 0.08), "trousers": (0.035, 0.055, 0.11)},
        "black": {"top": (0.022, 0.022, 0.025), "trousers": (0.16, 0.13, 0.09)},
        "orange": {"top": (0.55, 0.16, 0.02), "trousers": (0.03, 0.03, 0.035)},
    }
    levels = []
    for light in (False, True):
        parts = posed(MAN, STANDING, light)
        parts["jacket"] = (clothing.jacket_hem(MAN, light).moved(STANDING.hip), "top")
        if light:
            del parts["pelvis"]  # below the jacket
        levels.append(
            {
                f"body_{role}": Part(merge([body for body, own in parts.values() if own == role]), role, CREASE)
                for role in sorted({own for _, own in parts.values()})
            }
        )
    head = {
        "name": "standing_adult", "title": "Adult who stands", "class": "Pedestrian", "motion": "stand",
        "length": 0.48, "width": 0.67,
        "height": 1.66,
    }  # fmt: skip # a table
    bsdfs = {key: tinted(bsdf, variants["green"].get(key)) for key, bsdf in MATERIALS.items()}
    return Model(head, levels[0], levels[1], bsdfs, variants)


MODELS = {model.__name__: model for model in (adult_man, adult_woman, child, standing_adult)}
"""Name of each model -> the function that makes it."""
