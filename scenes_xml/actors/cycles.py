"""Two-wheelers with their riders: a bicycle whose rider pedals, an electric kick scooter and a motorcycle."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from ..generators.geometry.mesh import Mesh
from ..generators.people import clothing
from ..generators.people.posture import Posture, Rider
from ..generators.vehicles.cycles import bicycle, cargo_bike, kick_scooter, motorcycle
from ..generators.vehicles.cycles.bicycle import BicycleShape
from ..generators.vehicles.cycles.cargo_bike import CargoBikeShape
from ..generators.vehicles.cycles.kick_scooter import KickScooterShape
from ..generators.vehicles.cycles.motorcycle import MotorcycleShape
from ..generators.xml import Bsdf
from .bodies.family import LICENSE, PLAIN, SOURCE, looks
from .bodies.postures import packed_lengths
from .bodies.riders import Wear, rider, tone
from .materials import ROLES, VEHICLE, paint
from .model import Color, Model, Part, bounds
from .people import CREASE, bag, shoes, tinted

CYCLIST, COURIER, COMMUTER, BIKER = "man_33", "man_33", "woman_28", "man_27"
"""Who rides bicycle, cargo bike, scooter and motorcycle."""
BODY: dict[str, Bsdf] = {
    **looks(
        {"top": (0.55, 0.16, 0.02), "trousers": (0.035, 0.045, 0.08), "shoes": (0.03, 0.022, 0.018), **tone(CYCLIST)}
    ),
    "gloves": shoes((0.015, 0.015, 0.015)),
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
MOVING_LEGS = tuple(f"{side}_{part}" for side in ("left", "right") for part in LEGS)
Parts = dict[str, tuple[Mesh, str]]


def _model(
    head: Mapping[str, object],
    levels: Callable[[bool], Parts],
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
    rights = {"license": LICENSE, "source": SOURCE}
    return Model(
        {**head, "length": length, "width": width, "height": height, **rights}, detailed, light, bsdfs, variants, joints
    )


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
SEAT = Posture(
    hip=(-0.345, 0.0, 1.015),
    lean_deg=33.0,
    grip=BICYCLE.grip,
    foot=(-0.21, BICYCLE.foot_y, 0.36),
    gaze_deg=2.0,
    elbow=(-0.3, 0.45, -0.8),
)
"""Feet as in the middle of a turn: hips bend by it, the legs themselves pedal."""
SLOTS = ("lips", "eyes", "iris", "hair")
SEATED = Wear("shirt", ("hem",))


PEDAL_X = 0.11
"""How far the pedal is before the ankle [m]."""


def _pedal_from_ankle(name: str) -> tuple[float, float]:
    """Return where the pedal is: the ball of the foot stands on it, 22 mm thick."""
    return PEDAL_X, round(-0.25 * packed_lengths(name)["foot"] - 0.011, 4)


def _person(who: Rider, light: bool, apart: tuple[str, ...] = ()) -> Parts:
    """Return the shapes of a rider; legs that move have one shape for each segment, and shafts of shoes."""
    found = who.shapes(apart, PLAIN if light else ())
    own = {f"{segment}_{'shoes' if segment.endswith('foot') else 'trousers'}": segment for segment in apart}
    shafts = {f"{side}_lower_leg_shoes" for side in ("left", "right")} if light else set()
    parts = {own.get(name, name): part for name, part in found.items() if name not in shafts}
    for foot in {"left_foot", "right_foot"} & set(apart):
        mesh, slot = parts[foot]
        ball = mesh.vertices[np.abs(mesh.vertices[:, 0] - PEDAL_X) < 0.06, 1]
        parts[foot] = (mesh.moved((0.0, -0.5 * float(ball.min() + ball.max()), 0.0)), slot)  # in the pedal's middle
    return parts


def _cyclist(light: bool) -> Parts:
    parts = _with_rider(bicycle.build(BICYCLE, light), light)
    if not light:
        who = rider(CYCLIST, SEAT, light, SEATED)
        parts["rider_backpack"] = (who.hung(clothing.backpack(who.surface), "torso"), "bag")
    return parts


def _with_rider(cycle: Parts, light: bool) -> Parts:
    """Return the parts of a bicycle and of who rides it."""
    who = rider(CYCLIST, SEAT, light, SEATED)
    parts = cycle | _person(who, light, MOVING_LEGS)
    parts["rider_helmet"] = (
        who.hung(clothing.bicycle_helmet(rider(CYCLIST, SEAT, False, SEATED).surface, light), "head"),
        "helmet",
    )
    return parts


def cyclist() -> Model:
    """Return a city bicycle of 28 inch wheels and a rider of 1.71 m who pedals 2.3 turns of the wheel at a time.

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
    lengths = packed_lengths(CYCLIST)
    return {
        "kind": "pedal",
        "axle": [round(BICYCLE.axle[0] - shift, 6), BICYCLE.axle[1]],
        "crank": BICYCLE.crank,
        "hip": [round(SEAT.hip[0] - shift, 6), SEAT.hip[2]],
        "foot_y": BICYCLE.foot_y,
        "upper_leg": lengths["upper_leg"],
        "lower_leg": lengths["lower_leg"],
        "pedal_from_ankle": list(_pedal_from_ankle(CYCLIST)),
        "foot_pitch_deg": 14.0,
        "foot_swing_deg": 13.0,
        "foot_lag_deg": 190.0,
        "wheel_radius": BICYCLE.wheel_radius,
        "gear": BICYCLE.gear,
        "cadence_limit": 95.0,
    }


CARGO_BIKE = CargoBikeShape()


def _carrier(light: bool) -> Parts:
    back = (-CARGO_BIKE.shift, 0.0, 0.0)
    parts = _with_rider(cargo_bike.build(CARGO_BIKE, light), light)
    return {name: (mesh if name in MOVING else mesh.moved(back), role) for name, (mesh, role) in parts.items()}


def carrier() -> Model:
    """Return a cargo bike with a box before a rider of 1.71 m, who pedals as the cyclist does."""
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
_SOLE = SCOOTER.deck_top + 0.25 * packed_lengths(COMMUTER)["foot"]
UPRIGHT = Posture(
    hip=(-0.075, 0.0, 1.035),
    lean_deg=5.0,
    grip=SCOOTER.grip,
    foot=(0.075, 0.045, _SOLE),
    other_foot=(-0.20, -0.045, _SOLE),
    gaze_deg=4.0,
    toe_out_deg=8.0,
    elbow=(-0.5, 0.4, -0.7),
)


def _scooter_rider(light: bool) -> Parts:
    who = rider(COMMUTER, UPRIGHT, light)
    parts = kick_scooter.build(SCOOTER, light) | _person(who, light)
    if not light:
        parts["rider_backpack"] = (who.hung(clothing.backpack(who.surface), "torso"), "bag")
    return parts


def scooter() -> Model:
    """Return an electric kick scooter with a rider of 1.72 m who stands on it."""
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
RIDING_JACKET = Wear("jacket", ("hem",), True)
ASTRIDE = Posture(
    hip=(-0.27, 0.0, 0.925),
    lean_deg=20.0,
    grip=MOTORCYCLE.grip,
    foot=(
        MOTORCYCLE.peg[0] - 0.11,
        MOTORCYCLE.peg[1],
        MOTORCYCLE.peg[2] + 0.014 + 0.25 * packed_lengths(BIKER)["foot"],
    ),
    gaze_deg=2.0,
    toe_out_deg=4.0,
    foot_pitch_deg=6.0,
    elbow=(-0.3, 0.6, -0.6),
    knee=(1.0, 0.25, 0.4),
)


def _biker(light: bool) -> Parts:
    detailed, who = (rider(BIKER, ASTRIDE, level, RIDING_JACKET) for level in (False, light))
    inside = {f"rider_{slot}" for slot in SLOTS}
    worn = {name: part for name, part in _person(who, light).items() if name not in inside}
    shell, visor = (who.hung(part, "head") for part in clothing.motorcycle_helmet(detailed.surface, light))
    helmet = {"rider_helmet": (shell, "helmet"), "rider_visor": (visor, "visor")}
    return motorcycle.build(MOTORCYCLE, light) | worn | helmet


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
