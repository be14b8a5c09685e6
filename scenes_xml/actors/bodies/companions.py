"""Who else is on a footway: people who stand, wave and sit, a wheelchair with its user, a pram and a dog."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ...generators.geometry.loft import ellipsoid
from ...generators.geometry.mesh import Array, Mesh, box, merge, tube
from ...generators.vehicles.cycles.bicycle import disc, ring
from ...generators.vehicles.vehicle_parts import bar
from ...generators.xml import Bsdf
from ..materials import VEHICLE
from ..model import Color, Model, Part, bounds
from ..people import bag, tinted
from .family import CREASE, LICENSE, SOURCE, colors, looks, role_colors
from .postures import Pose, frames, packed_lengths, posed, shifted
from .roles import STANDING, Role
from .table import PEOPLE

Parts = dict[str, tuple[Mesh, str]]
THINGS: dict[str, Bsdf] = {
    "frame_steel": Bsdf(
        "principled", "metal", 0.2, "estimate, powder-coated steel", color=(0.03, 0.03, 0.032),
        floats={"roughness": 0.4, "specular": 0.5},
    ),
    "cover": bag((0.03, 0.05, 0.12)),
    "tyre_rubber": VEHICLE["tyre_rubber"],
    "fur": Bsdf(
        "principled", "skin", 0.4, "estimate, fur; for the radar the skin below", color=(0.16, 0.09, 0.045),
        floats={"roughness": 0.9, "specular": 0.1, "sheen": 0.3},
    ),
}  # fmt: skip # a table
STANCE_DEG = 5.0
"""How far the legs of the adult who stands are apart, each from the vertical."""
SEAT = 0.50
"""Height of the wheelchair's seat [m]."""


def _model(
    head: Mapping[str, Any],
    levels: tuple[Parts, Parts],
    variants: Mapping[str, Mapping[str, Color]],
    joints: list[Mapping[str, Any]],
    person: str | None = None,
) -> Model:
    """Return a model with the measures of its shapes, which lie in its own frame."""
    materials = THINGS | (looks(next(iter(colors(*_row(person)).values()))) if person else {})
    first = next(iter(variants.values()))
    materials = {key: tinted(bsdf, first.get(key)) for key, bsdf in materials.items()}
    detailed, light = ({name: Part(mesh, slot, CREASE) for name, (mesh, slot) in parts.items()} for parts in levels)
    used = {part.bsdf for parts in (detailed, light) for part in parts.values()}
    low, high = bounds(detailed)
    measures = {
        "length": round(float(high[0] - low[0]), 2),
        "width": round(float(high[1] - low[1]), 2),
        "height": round(float(high[2]), 2),
    }
    rights = {"license": LICENSE, "source": SOURCE} if person else {}
    kept = {name: {slot: rgb for slot, rgb in row.items() if slot in used} for name, row in variants.items()}
    for row in joints:
        if "shapes" in row:
            assert set(row["shapes"]) <= set(detailed)
    return Model({**head, **measures, **rights}, detailed, light, materials, kept, joints)


def _row(name: str) -> tuple[Any, int]:
    number = next(number for number, person in enumerate(PEOPLE) if person.name == name)
    return PEOPLE[number], number


def _person(
    name: str,
    title: str,
    person: str,
    pose: Pose,
    joints: Callable[[str, Parts], list[Mapping[str, Any]]] | None = None,
    role: Role | None = None,
) -> Model:
    """Return a model of a person of the family in a posture, its box in the middle of its frame.

    Colours are those of `role`, if given.
    """
    levels = tuple(posed(person, pose, light) for light in (False, True))
    points = np.concatenate([mesh.vertices for mesh, _ in levels[0].values()])
    offset = [-0.5 * (points[:, 0].min() + points[:, 0].max()), -0.5 * (points[:, 1].min() + points[:, 1].max()), 0.0]
    moved = tuple(shifted(parts, offset) for parts in levels)
    head = {
        "name": name, "title": title, "class": "Pedestrian", "motion": "stand", "age": _row(person)[0].years,
    }  # fmt: skip # a table
    made = [] if joints is None else joints(person, moved[0])
    for row in made:
        row["center"] = [round(float(value), 4) for value in np.array(row["center"]) + offset]  # type: ignore[index]
    variants = colors(*_row(person)) if role is None else role_colors(role)
    return _model(head, (moved[0], moved[1]), variants, made, person)


def standing_adult() -> Model:
    """Return a man of 27 who stands, feet apart, and looks at a telephone before his chest."""
    turns = {
        "right_upper_arm": (-12.0, -6.0), "right_lower_arm": (-128.0, 24.0), "left_upper_arm": (6.0, 8.0),
        "left_lower_arm": (-14.0, 2.0), "head": (22.0, 0.0), "torso": (-1.0, 0.0),
        **{f"left_{part}": (0.0, STANCE_DEG) for part in ("upper_leg", "lower_leg")},
        **{f"right_{part}": (0.0, -STANCE_DEG) for part in ("upper_leg", "lower_leg")},
    }  # fmt: skip # a table
    lengths = packed_lengths(STANDING.person)
    leg = lengths["upper_leg"] + lengths["lower_leg"]
    pose = Pose(turns, 0.25 * lengths["foot"] + leg * float(np.cos(np.radians(STANCE_DEG))))
    return _person("standing_adult", STANDING.title, STANDING.person, pose, None, STANDING)


def standing_child() -> Model:
    """Return a boy of 8 who stands and looks up."""
    turns = {"head": (-12.0, 0.0), "left_lower_arm": (-25.0, 0.0), "right_lower_arm": (-12.0, 0.0)}
    return _person("standing_child", "Boy of 8 who stands", "boy_8", Pose(turns))


WAVING = Pose(
    {
        "right_upper_arm": (0.0, -78.0), "right_lower_arm": (0.0, -166.0), "left_lower_arm": (-12.0, 0.0),
        "head": (-4.0, 0.0),
    },
    apart=("right_lower_arm",),
)  # fmt: skip # a table


def waving_woman() -> Model:
    """Return a woman of 28 who waves with her right hand, 1.5 times a second."""

    def joints(person: str, parts: Parts) -> list[Mapping[str, Any]]:
        elbow = frames(packed_lengths(person), WAVING)["right_lower_arm"][1]
        shapes = [name for name in parts if name.startswith("right_lower_arm")]
        return [
            {
                "kind": "swing", "shapes": shapes, "center": elbow.tolist(), "axis": [1.0, 0.0, 0.0],
                "amplitude_deg": 24.0, "frequency": 1.5,
            }
        ]  # fmt: skip # a table

    return _person("waving_woman", "Woman of 28 who waves", "woman_28", WAVING, joints)


def _sitting(lengths: Mapping[str, float], hip: float, flexed_deg: float = -86.0, shin_deg: float = 2.0) -> Pose:
    """Return the posture of somebody who sits, hands on the thighs."""
    turns = {
        "torso": (4.0, 0.0), "pelvis": (-6.0, 0.0), "head": (2.0, 0.0),
        **{f"{side}_upper_leg": (flexed_deg, 0.0) for side in ("left", "right")},
        **{f"{side}_lower_leg": (shin_deg, 0.0) for side in ("left", "right")},
        **{f"{side}_upper_arm": (-14.0, 0.0) for side in ("left", "right")},
        **{f"{side}_lower_arm": (-62.0, 0.0) for side in ("left", "right")},
    }  # fmt: skip # a table
    return Pose(turns, hip, bare=("hem",))


def sitting_man() -> Model:
    """Return a man of 66 who sits as on a bench, which the scene has."""
    lengths = packed_lengths("man_66")
    rise = lengths["upper_leg"] * np.cos(np.radians(86.0))
    hip = 0.25 * lengths["foot"] + lengths["lower_leg"] * np.cos(np.radians(2.0)) + rise
    return _person("sitting_man", "Man of 66 who sits", "man_66", _sitting(lengths, float(hip)))


def _wheels(sides: Mapping[str, tuple[float, float, float]], light: bool) -> tuple[Parts, list[dict[str, Any]]]:
    """Return wheels by name -> (x, half track, radius), left and right, and their joints."""
    parts: Parts = {}
    joints: list[dict[str, Any]] = []
    for name, (x, half, radius) in sides.items():
        for side, sign in (("left", 1.0), ("right", -1.0)):
            centre = (x, sign * half, radius)
            shape = f"wheel_{name}_{side}"
            is_large = radius > 0.2
            around, spokes = (12 if is_large else 8, 4 if is_large else 0) if light else (36, 12)
            thick = 0.012 if is_large else 0.016
            tyre = ring(radius - thick, thick, thick, around, 3 if light else 8)
            hub = disc(0.05 if is_large else (0.8 if light else 0.35) * radius, 0.03, 4 if light else 10)
            wires = [
                tube(
                    np.array([[0.0, 0.0, 0.0], [(radius - thick) * np.cos(a), 0.0, (radius - thick) * np.sin(a)]]),
                    0.004,
                    3,
                )
                for a in np.arange(spokes) * 2.0 * np.pi / max(spokes, 1)
            ]
            parts[f"{shape}_tyre"] = (tyre.moved(centre), "tyre_rubber")
            parts[f"{shape}_rim"] = (merge([hub, *wires]).moved(centre), "frame_steel")
            joints.append(
                {"kind": "wheel", "shapes": [f"{shape}_tyre", f"{shape}_rim"], "center": list(centre), "radius": radius}
            )
    return parts, joints


def _chair(light: bool) -> Mesh:
    """Return frame, arm rests, handles and foot plates of a wheelchair."""
    plates, lines, sides = [], [], 3 if light else 8
    for y in (-0.23, 0.23):
        lines += [
            ((-0.24, y, 0.30), (-0.24, y, 0.92), 0.012), ((-0.24, y, 0.92), (-0.36, y, 0.94), 0.014),
            ((-0.24, y, SEAT - 0.04), (0.22, y, SEAT - 0.04), 0.012), ((-0.24, y, 0.30), (0.24, y, 0.30), 0.012),
            ((0.22, y, SEAT - 0.04), (0.36, y * 0.6, 0.13), 0.012), ((-0.22, y, 0.71), (0.12, y, 0.71), 0.018),
        ]  # fmt: skip # a table
        small = [
            ((0.24, y, 0.30), (0.24, y, 0.16), 0.012), ((0.12, y, 0.71), (0.12, y, SEAT - 0.04), 0.012),
            ((-0.2, -y, 0.315 + 0.02 * y), (0.1, y, SEAT - 0.045 + 0.02 * y), 0.01),
        ]  # fmt: skip # a table
        lines += [] if light else small
        plates.append(box((0.20, 0.14, 0.012), (0.43, 0.55 * y, 0.125)))
    return merge([*plates, *(bar(start, stop, thick, sides) for start, stop, thick in lines)])


def wheelchair() -> Model:
    """Return a wheelchair and the man of 79 who sits in it; all its wheels turn."""
    levels = []
    joints: list[dict[str, Any]] = []
    lengths = packed_lengths("man_79")
    for light in (False, True):
        pose = _sitting(lengths, SEAT + 0.10, -86.0, -22.0)
        parts = shifted(posed("man_79", pose, light), [-0.13, 0.0, 0.0])
        parts["chair"] = (_chair(light), "frame_steel")
        fabric = [box((0.44, 0.43, 0.03), (0.0, 0.0, SEAT - 0.02)), box((0.025, 0.43, 0.40), (-0.245, 0.0, 0.70))]
        parts["chair_seat"] = (merge(fabric), "cover")
        wheels, joints = _wheels({"rear": (-0.16, 0.29, 0.305), "front": (0.24, 0.23, 0.09)}, light)
        levels.append(parts | wheels)
    head = {
        "name": "wheelchair", "title": "Wheelchair with a man of 79", "class": "Pedestrian", "motion": "walk",
        "age": 79,
    }  # fmt: skip # a table
    return _model(head, (levels[0], levels[1]), colors(*_row("man_79")), joints, "man_79")


def pram() -> Model:
    """Return a pram with its hood up, to be pushed by somebody; its wheels turn."""
    levels = []
    joints: list[dict[str, Any]] = []
    for light in (False, True):
        rows, around = (5, 10) if light else (9, 20)
        tub = ellipsoid((0.05, 0.0, 0.72), (0.42, 0.20, -0.26), low=0.0, rows=rows, segments=around).flipped()
        hood = ellipsoid((0.25, 0.0, 0.72), (0.24, 0.215, 0.34), low=0.0, rows=rows, segments=around)
        bars = [
            bar((-0.30, y, 0.14), (0.30, y, 0.46), 0.012) for y in (-0.20, 0.20)
        ] + [bar((0.34, y, 0.14), (-0.62, y, 1.02), 0.014) for y in (-0.22, 0.22)]  # fmt: skip # a table
        bars += [
            bar((-0.62, -0.22, 1.02), (-0.62, 0.22, 1.02), 0.016),
            bar((-0.30, -0.24, 0.14), (-0.30, 0.24, 0.14), 0.01),
        ]
        bars.append(bar((0.34, -0.24, 0.14), (0.34, 0.24, 0.14), 0.01))
        parts: Parts = {"tub": (merge([tub, hood]), "cover"), "chassis": (merge(bars), "frame_steel")}
        wheels, joints = _wheels({"rear": (-0.30, 0.27, 0.14), "front": (0.34, 0.27, 0.14)}, light)
        levels.append(parts | wheels)
    head = {"name": "pram", "title": "Pram", "class": "Dynamic", "motion": "walk"}
    variants: dict[str, dict[str, Color]] = {
        "navy": {"cover": (0.03, 0.05, 0.12)},
        "red": {"cover": (0.32, 0.03, 0.03)},
        "grey": {"cover": (0.2, 0.2, 0.21)},
    }
    return _model(head, (levels[0], levels[1]), variants, joints)


STRIDE, LEG = 0.72, 0.40
"""Way of a dog's cycle, and from the ground to where its legs swing [m]."""


def _leg(x: float, y: float, light: bool, hind: bool) -> Mesh:
    """Return a dog's leg, which hangs from a point above (x, y) [m]."""
    bent = 0.05 if hind else -0.02
    path: Array = np.array(
        [[x, y, LEG + 0.06], [x - 0.4 * bent, y, 0.27], [x - bent, y, 0.14], [x - 0.6 * bent, y, 0.03]]
    )
    limb = tube(path, np.array([0.055, 0.04, 0.02, 0.018]), 6 if light else 12)
    paw = ellipsoid((x + 0.015, y, 0.02), (0.038, 0.024, 0.02), rows=4 if light else 7, segments=6 if light else 12)
    return merge([limb, paw])


def dog() -> Model:
    """Return a dog of 0.6 m at the shoulder that walks: its legs swing by the way that it goes."""
    levels = []
    for light in (False, True):
        rows, around = (6, 8) if light else (14, 20)
        neck, tail = (
            [[0.28, 0.0, 0.55], [0.41, 0.0, 0.70]],
            [[-0.37, 0.0, 0.54], [-0.50, 0.0, 0.50], [-0.60, 0.0, 0.55]],
        )
        trunk = [ellipsoid(centre, radii, rows=rows, segments=around) for centre, radii in TRUNK]
        trunk += [
            ellipsoid((0.41, y, 0.775), (0.03, 0.014, 0.05), rows=max(rows // 2, 4), segments=around // 2)
            for y in (-0.055, 0.055)
        ]
        trunk += [
            tube(np.array(neck), np.array([0.085, 0.065]), around // 2),
            tube(np.array(tail), np.array([0.028, 0.022, 0.012]), around // 2),
        ]
        parts: Parts = {"trunk": (merge(trunk), "fur")}
        for name, x, y, _ in LEGS:
            parts[f"leg_{name}"] = (_leg(x, y, light, x < 0.0), "fur")
        levels.append(parts)
    joints = [
        {
            "kind": "swing", "shapes": [f"leg_{name}"], "center": [x, y, LEG], "axis": [0.0, 1.0, 0.0],
            "amplitude_deg": round(float(np.degrees(STRIDE / (2.0 * np.pi * LEG))), 3),
            "stride": STRIDE, "phase": phase,
        }
        for name, x, y, phase in LEGS
    ]  # fmt: skip # a table
    head = {"name": "dog", "title": "Dog that walks", "class": "Dynamic", "motion": "walk"}
    variants: dict[str, dict[str, Color]] = {
        "brown": {"fur": (0.16, 0.09, 0.045)},
        "black": {"fur": (0.018, 0.016, 0.015)},
        "golden": {"fur": (0.42, 0.27, 0.12)},
    }
    return _model(head, (levels[0], levels[1]), variants, joints)


TRUNK = (
    ((0.17, 0.0, 0.49), (0.22, 0.115, 0.15)),
    ((-0.13, 0.0, 0.50), (0.26, 0.10, 0.115)),
    ((0.45, 0.0, 0.73), (0.105, 0.065, 0.07)),
    ((0.56, 0.0, 0.705), (0.075, 0.034, 0.032)),
)
"""Centres and radii of chest, loin, head and muzzle [m]."""
LEGS = (("front_left", 0.24, 0.075, 0.0), ("front_right", 0.24, -0.075, 0.5), ("hind_left", -0.26, 0.07, 0.25),
        ("hind_right", -0.26, -0.07, 0.75))  # fmt: skip # a table
"""Name, place of the hip or shoulder [m] and phase of each leg [cycles]."""
MODELS: dict[str, Callable[[], Model]] = {
    model.__name__: model
    for model in (standing_adult, standing_child, waving_woman, sitting_man, wheelchair, pram, dog)
}
"""Name of each model -> the function that makes it."""
