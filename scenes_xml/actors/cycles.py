"""Two-wheelers with their riders: a bicycle whose rider pedals, an electric kick scooter and a motorcycle."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ..generators.geometry.mesh import Mesh
from ..generators.people import clothing, pedestrian
from ..generators.people.pedestrian import FOOT, LOWER_LEG, UPPER_LEG, BodyShape
from ..generators.people.posture import Posture, head_frame, posed, set_at, torso_frame
from ..generators.vehicles.cycles import bicycle, cargo_bike, kick_scooter, motorcycle
from ..generators.vehicles.cycles.bicycle import BicycleShape
from ..generators.vehicles.cycles.cargo_bike import CargoBikeShape
from ..generators.vehicles.cycles.kick_scooter import KickScooterShape
from ..generators.vehicles.cycles.motorcycle import MotorcycleShape
from ..generators.xml import Bsdf
from .materials import ROLES, VEHICLE, paint
from .model import Color, Model, Part, bounds
from .people import CREASE, bag, bare, cloth, hair, shoes, tinted

RIDER = BodyShape(1.75, 1.0, 1.0, arm_inset=0.014)
BODY: dict[str, Bsdf] = {
    "top": cloth((0.55, 0.16, 0.02)),
    "trousers": cloth((0.035, 0.045, 0.08), 0.45),
    "shoes": shoes((0.03, 0.022, 0.018)),
    "skin": bare((0.50, 0.31, 0.22)),
    "hair": hair((0.045, 0.028, 0.018)),
    "bag": bag((0.05, 0.06, 0.08)),
    "board": Bsdf(
        "principled",
        "plywood",
        0.5,
        "estimate, lacquered plywood",
        color=(0.30, 0.19, 0.10),
        floats={"roughness": 0.5, "specular": 0.4},
    ),
    "helmet": Bsdf(
        "principled",
        "plastic",
        0.5,
        "estimate, moulded polycarbonate",
        color=(0.7, 0.7, 0.7),
        floats={"roughness": 0.25, "specular": 0.5},
    ),
    "frame_steel": Bsdf(
        "principled",
        "metal",
        0.2,
        "estimate, powder-coated steel",
        color=(0.03, 0.03, 0.032),
        floats={"roughness": 0.4, "specular": 0.5},
    ),
    "visor": Bsdf(
        "principled",
        "plastic",
        0.06,
        "estimate, smoked polycarbonate",
        color=(0.01, 0.011, 0.013),
        floats={"roughness": 0.06, "specular": 0.6},
    ),
    "paint": paint((0.02, 0.10, 0.28)),
}
LEGS = ("upper_leg", "lower_leg", "foot")


def _model(
    head: Mapping[str, object],
    levels: Callable[[bool], dict[str, tuple[Mesh, str]]],
    variants: Mapping[str, Mapping[str, Color]],
    joints: list[Mapping[str, object]],
    moving: tuple[str, ...] = (),
) -> Model:
    """Return a model whose outer measures are those of the parts that are in its own frame."""
    first = next(iter(variants.values()))
    bsdfs = {key: tinted(bsdf, first.get(key)) for key, bsdf in (VEHICLE | BODY).items()}
    detailed, light = (
        {
            name: Part(mesh, ROLES.get(role, role), 40.0 if role in ROLES and role not in ("skin", "hair") else CREASE)
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
    parts = _with_rider(bicycle.build(BICYCLE, light), light)
    if not light:
        parts["rider_backpack"] = (set_at(clothing.backpack(RIDER), *torso_frame(SEAT)), "bag")
    return parts


def _with_rider(cycle: Mapping[str, tuple[Mesh, str]], light: bool) -> dict[str, tuple[Mesh, str]]:
    """Return the parts of a bicycle and of who rides it."""
    parts = dict(cycle)
    parts |= {f"rider_{name}": part for name, part in posed(RIDER, SEAT, light).items()}
    loose = pedestrian.body(RIDER, light)
    parts |= {f"{side}_{part}": loose[f"{side}_{part}"] for side in ("left", "right") for part in LEGS}
    del parts["rider_head_hair"]
    parts["rider_helmet"] = (set_at(clothing.bicycle_helmet(RIDER, light), *head_frame(RIDER, SEAT)), "helmet")
    return parts


def cyclist() -> Model:
    """Return a city bicycle of 28 inch wheels and a rider of 1.75 m who pedals 2.3 turns of the wheel at a time.

    5 m a turn.
    """
    head = {
        "name": "bicycle",
        "title": "Bicycle with a rider who pedals",
        "class": "Bicycle",
        "motion": "cycle",
        "wheelbase": BICYCLE.wheelbase,
        "rear_axle": -BICYCLE.wheelbase / 2.0,
    }
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
    joints = [*_wheels(tuple(BICYCLE.front), tuple(BICYCLE.rear), BICYCLE.wheel_radius), _legs()]
    return _model(head, _cyclist, variants, joints, MOVING)


MOVING = ("cranks", *(f"{side}_{part}" for side in ("left", "right") for part in ("pedal", *LEGS)))
"""Shapes in frames of their own."""


def _legs(shift: float = 0.0) -> Mapping[str, object]:
    """Return the joint of the rider's legs on a bicycle that stands `shift` behind the city bicycle [m]."""
    return {
        "kind": "pedal",
        "axle": [round(BICYCLE.axle[0] - shift, 6), BICYCLE.axle[1]],
        "crank": BICYCLE.crank,
        "hip": [round(SEAT.hip[0] - shift, 6), SEAT.hip[2]],
        "foot_y": BICYCLE.foot_y,
        "upper_leg": round(UPPER_LEG * RIDER.height, 6),
        "lower_leg": round(LOWER_LEG * RIDER.height, 6),
        "pedal_from_ankle": list(PEDAL_FROM_ANKLE),
        "foot_pitch_deg": 14.0,
        "foot_swing_deg": 13.0,
        "foot_lag_deg": 190.0,
        "wheel_radius": BICYCLE.wheel_radius,
        "gear": BICYCLE.gear,
        "cadence_limit": 95.0,
    }


CARGO_BIKE = CargoBikeShape()


def _carrier(light: bool) -> dict[str, tuple[Mesh, str]]:
    back = (-CARGO_BIKE.shift, 0.0, 0.0)
    parts = _with_rider(cargo_bike.build(CARGO_BIKE, light), light)
    return {name: (mesh if name in MOVING else mesh.moved(back), role) for name, (mesh, role) in parts.items()}


def carrier() -> Model:
    """Return a cargo bike with a box before a rider of 1.75 m, who pedals as the cyclist does."""
    rear, shift, radius = -BICYCLE.wheelbase / 2.0, CARGO_BIKE.shift, CARGO_BIKE.front_radius
    front = CARGO_BIKE.front_x - shift
    head = {
        "name": "cargo_bike",
        "title": "Cargo bike with its box before the rider",
        "class": "Bicycle",
        "motion": "cycle",
        "wheelbase": round(CARGO_BIKE.front_x - rear, 6),
        "rear_axle": round(rear - shift, 6),
    }
    variants = {
        "plywood": {
            "paint": (0.02, 0.02, 0.022),
            "top": (0.02, 0.17, 0.18),
            "helmet": (0.60, 0.60, 0.58),
            "board": (0.30, 0.19, 0.10),
        },
        "white": {
            "paint": (0.45, 0.05, 0.03),
            "top": (0.03, 0.06, 0.16),
            "helmet": (0.03, 0.03, 0.03),
            "board": (0.60, 0.60, 0.58),
        },
        "green": {
            "paint": (0.03, 0.13, 0.06),
            "top": (0.40, 0.24, 0.11),
            "helmet": (0.40, 0.05, 0.04),
            "board": (0.03, 0.13, 0.06),
        },
    }
    wheels = [
        *_wheels((round(front, 6), 0.0, radius), (0.0, 0.0, 0.0), radius)[:1],
        *_wheels((0.0, 0.0, 0.0), (round(rear - shift, 6), 0.0, BICYCLE.wheel_radius), BICYCLE.wheel_radius)[1:],
    ]
    return _model(head, _carrier, variants, [*wheels, _legs(shift)], MOVING)


SCOOTER = KickScooterShape()
_SOLE = SCOOTER.deck_top + 0.25 * FOOT * RIDER.height
UPRIGHT = Posture(
    hip=(-0.075, 0.0, 1.035),
    lean_deg=5.0,
    grip=SCOOTER.grip,
    foot=(0.075, 0.045, _SOLE),
    other_foot=(-0.20, -0.045, _SOLE),
    gaze_deg=4.0,
    toe_out_deg=8.0,
    hip_width=0.07,
    elbow=(-0.5, 0.4, -0.7),
)


def _scooter_rider(light: bool) -> dict[str, tuple[Mesh, str]]:
    parts = dict(kick_scooter.build(SCOOTER, light))
    parts |= {f"rider_{name}": part for name, part in posed(RIDER, UPRIGHT, light).items()}
    parts["rider_jacket"] = (clothing.jacket_hem(RIDER, light).moved(UPRIGHT.hip), "top")
    if light:
        del parts["rider_pelvis"], parts["rider_head_hair"]
    else:
        parts["rider_collar"] = (set_at(clothing.collar(RIDER), *torso_frame(UPRIGHT)), "top")
        parts["rider_backpack"] = (set_at(clothing.backpack(RIDER), *torso_frame(UPRIGHT)), "bag")
    return parts


def scooter() -> Model:
    """Return an electric kick scooter with a rider of 1.75 m who stands on it."""
    half, radius = SCOOTER.wheelbase / 2.0, SCOOTER.wheel_radius
    head = {
        "name": "scooter",
        "title": "Electric kick scooter with a rider",
        "class": "Bicycle",
        "motion": "cycle",
        "wheelbase": SCOOTER.wheelbase,
        "rear_axle": -half,
    }
    variants = {
        "black": {
            "paint": (0.02, 0.02, 0.022),
            "top": (0.16, 0.165, 0.175),
            "trousers": (0.05, 0.08, 0.17),
            "bag": (0.02, 0.02, 0.022),
        },
        "turquoise": {
            "paint": (0.02, 0.42, 0.38),
            "top": (0.30, 0.03, 0.05),
            "trousers": (0.03, 0.03, 0.035),
            "bag": (0.10, 0.10, 0.11),
        },
        "orange": {
            "paint": (0.70, 0.15, 0.02),
            "top": (0.02, 0.06, 0.14),
            "trousers": (0.20, 0.16, 0.10),
            "bag": (0.22, 0.15, 0.07),
        },
    }
    return _model(head, _scooter_rider, variants, _wheels((half, 0.0, radius), (-half, 0.0, radius), radius))


MOTORCYCLE = MotorcycleShape()
BIKER = BodyShape(1.78, 1.08, 1.0, arm_inset=0.012)
ASTRIDE = Posture(
    hip=(-0.27, 0.0, 0.925),
    lean_deg=20.0,
    grip=MOTORCYCLE.grip,
    foot=(MOTORCYCLE.peg[0] - 0.11, MOTORCYCLE.peg[1], MOTORCYCLE.peg[2] + 0.075),
    gaze_deg=2.0,
    toe_out_deg=4.0,
    foot_pitch_deg=6.0,
    hip_width=0.10,
    elbow=(-0.3, 0.6, -0.6),
    knee=(1.0, 0.25, 0.4),
)


def _biker(light: bool) -> dict[str, tuple[Mesh, str]]:
    parts = dict(motorcycle.build(MOTORCYCLE, light))
    parts |= {f"rider_{name}": part for name, part in posed(BIKER, ASTRIDE, light).items()}
    shell, visor = (set_at(part, *head_frame(BIKER, ASTRIDE)) for part in clothing.motorcycle_helmet(BIKER, light))
    parts |= {"rider_helmet": (shell, "helmet"), "rider_visor": (visor, "visor")}
    del parts["rider_head"], parts["rider_head_hair"]  # inside the helmet
    for side in () if light else ("left", "right"):
        parts[f"rider_{side}_glove"] = (parts.pop(f"rider_{side}_lower_arm_hand")[0], "shoes")
    return parts


def biker() -> Model:
    """Return a motorcycle without fairing and a rider of 1.78 m."""
    half, radius = MOTORCYCLE.wheelbase / 2.0, MOTORCYCLE.wheel_radius
    head = {
        "name": "motorcycle",
        "title": "Motorcycle with a rider",
        "class": "Motorcycle",
        "motion": "cycle",
        "wheelbase": MOTORCYCLE.wheelbase,
        "rear_axle": -half,
    }
    black = {"top": (0.02, 0.02, 0.022), "trousers": (0.022, 0.022, 0.024), "shoes": (0.015, 0.015, 0.015)}
    variants = {
        "red": {"paint": (0.40, 0.015, 0.015), "helmet": (0.60, 0.60, 0.60), **black},
        "blue": {"paint": (0.015, 0.05, 0.28), "helmet": (0.015, 0.015, 0.017), **black},
        "yellow": {"paint": (0.65, 0.42, 0.01), "helmet": (0.50, 0.04, 0.03), **black, "top": (0.14, 0.07, 0.03)},
    }
    return _model(head, _biker, variants, _wheels((half, 0.0, radius), (-half, 0.0, radius), radius))


MODELS: dict[str, Callable[[], Model]] = {
    "bicycle": cyclist,
    "cargo_bike": carrier,
    "scooter": scooter,
    "motorcycle": biker,
}
"""Name of each model -> the function that makes it."""
