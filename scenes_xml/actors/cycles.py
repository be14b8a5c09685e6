"""Two-wheelers with their riders: a bicycle whose rider pedals, an electric kick scooter and a motorcycle."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ..generators import bicycle, clothing, pedestrian
from ..generators.bicycle import BicycleShape
from ..generators.mesh import Mesh
from ..generators.pedestrian import FOOT, LOWER_LEG, UPPER_LEG, BodyShape
from ..generators.posture import Posture, head_frame, posed, set_at, torso_frame
from ..generators.xml import Bsdf
from .materials import ROLES, VEHICLE, paint
from .model import Color, Model, Part, bounds
from .people import CREASE, bag, bare, cloth, hair, shoes, tinted

RIDER = BodyShape(1.75, 1.0, 1.0, arm_inset=0.014)
BODY: dict[str, Bsdf] = {
    "top": cloth((0.55, 0.16, 0.02)), "trousers": cloth((0.035, 0.045, 0.08), 0.45), "shoes": shoes((0.03, 0.022, 0.018)),
    "skin": bare((0.50, 0.31, 0.22)), "hair": hair((0.045, 0.028, 0.018)), "bag": bag((0.05, 0.06, 0.08)),
    "helmet": Bsdf("principled", "plastic", 0.5, "estimate, moulded polycarbonate", color=(0.7, 0.7, 0.7), floats={"roughness": 0.25, "specular": 0.5}),
    "visor": Bsdf("principled", "plastic", 0.06, "estimate, smoked polycarbonate", color=(0.01, 0.011, 0.013), floats={"roughness": 0.06, "specular": 0.6}),
    "paint": paint((0.02, 0.10, 0.28)),
}  # fmt: skip
LEGS = ("upper_leg", "lower_leg", "foot")


def _model(
    head: Mapping[str, object], levels: Callable[[bool], dict[str, tuple[Mesh, str]]], variants: Mapping[str, Mapping[str, Color]],
    joints: list[Mapping[str, object]], moving: tuple[str, ...] = (),
) -> Model:  # fmt: skip
    """Return a model whose outer measures are those of the parts that are in its own frame."""
    first = next(iter(variants.values()))
    bsdfs = {key: tinted(bsdf, first.get(key)) for key, bsdf in (VEHICLE | BODY).items()}
    detailed, light = (
        {
            name: Part(mesh, ROLES.get(role, role), 40.0 if role in ROLES else CREASE)
            for name, (mesh, role) in levels(is_light).items()
        }
        for is_light in (False, True)
    )
    low, high = bounds(detailed, moving)
    length, width, height = (round(float(value), 2) for value in (high[0] - low[0], high[1] - low[1], high[2]))
    return Model({**head, "length": length, "width": width, "height": height}, detailed, light, bsdfs, variants, joints)


def _wheels(
    front: tuple[float, float, float], rear: tuple[float, float, float], radius: float
) -> list[Mapping[str, object]]:
    return [
        {
            "kind": "wheel",
            "shapes": [f"wheel_{name}_tyre", f"wheel_{name}_rim"],
            "center": [float(v) for v in center],
            "radius": radius,
        }
        for name, center in (("front", front), ("rear", rear))
    ]


BICYCLE = BicycleShape()
PEDAL_FROM_ANKLE = (0.11, round(-0.25 * FOOT * RIDER.height - 0.011, 4))
"""The ball of the foot stands on the pedal, 22 mm thick."""
SEAT = Posture(hip=(-0.345, 0.0, 1.015), lean_deg=33.0, grip=BICYCLE.grip, gaze_deg=2.0, elbow=(-0.3, 0.45, -0.8))


def _cyclist(light: bool) -> dict[str, tuple[Mesh, str]]:
    parts = {name: part for name, part in bicycle.build(BICYCLE, light).items()}
    parts |= {f"rider_{name}": part for name, part in posed(RIDER, SEAT, light).items()}
    loose = pedestrian.body(RIDER, light)
    parts |= {f"{side}_{part}": loose[f"{side}_{part}"] for side in ("left", "right") for part in LEGS}
    del parts["rider_head_hair"]
    parts["rider_helmet"] = (set_at(clothing.bicycle_helmet(RIDER, light), *head_frame(RIDER, SEAT)), "helmet")
    if not light:
        parts["rider_backpack"] = (set_at(clothing.backpack(RIDER), *torso_frame(SEAT)), "bag")
    return parts


def cyclist() -> Model:
    """Return a city bicycle of 28 inch wheels and a rider of 1.75 m who pedals 2.3 turns of the wheel at a time: 5 m a turn."""
    head = {
        "name": "bicycle", "title": "Bicycle with a rider who pedals", "class": "Bicycle", "motion": "cycle",
        "wheelbase": BICYCLE.wheelbase, "rear_axle": -BICYCLE.wheelbase / 2.0,
    }  # fmt: skip
    variants = {
        "orange": {
            "paint": (0.02, 0.10, 0.28),
            "top": (0.55, 0.16, 0.02),
            "helmet": (0.70, 0.70, 0.70),
            "bag": (0.05, 0.06, 0.08),
        },
        "green": {
            "paint": (0.30, 0.02, 0.02),
            "top": (0.04, 0.17, 0.07),
            "helmet": (0.03, 0.03, 0.03),
            "bag": (0.22, 0.15, 0.07),
        },
        "white": {
            "paint": (0.015, 0.015, 0.016),
            "top": (0.62, 0.62, 0.60),
            "helmet": (0.55, 0.05, 0.04),
            "bag": (0.02, 0.02, 0.022),
        },
        "yellow": {
            "paint": (0.50, 0.50, 0.50),
            "top": (0.65, 0.60, 0.04),
            "helmet": (0.03, 0.12, 0.40),
            "bag": (0.10, 0.10, 0.11),
        },
    }
    legs = {
        "kind": "pedal", "axle": list(BICYCLE.axle), "crank": BICYCLE.crank, "hip": [SEAT.hip[0], SEAT.hip[2]], "foot_y": BICYCLE.foot_y,
        "upper_leg": round(UPPER_LEG * RIDER.height, 6), "lower_leg": round(LOWER_LEG * RIDER.height, 6),
        "pedal_from_ankle": list(PEDAL_FROM_ANKLE), "foot_pitch_deg": 14.0, "foot_swing_deg": 13.0, "foot_lag_deg": 190.0,
        "wheel_radius": BICYCLE.wheel_radius, "gear": BICYCLE.gear, "cadence_limit": 95.0,
    }  # fmt: skip
    joints = [*_wheels(tuple(BICYCLE.front), tuple(BICYCLE.rear), BICYCLE.wheel_radius), legs]
    moving = ("cranks", *(f"{side}_{part}" for side in ("left", "right") for part in ("pedal", *LEGS)))
    return _model(head, _cyclist, variants, joints, moving)


MODELS: dict[str, Callable[[], Model]] = {"bicycle": cyclist}
"""Name of each model -> the function that makes it."""
