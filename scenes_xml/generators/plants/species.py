"""Trees by kind: measures, form of the crown, and materials of bark and leaves; ten kinds and a bare one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..geometry.mesh import Array, Mesh, merge, tube
from ..kit import Prefab, SceneKit
from ..surfaces import leaves
from . import planting, vegetation
from .vegetation import LIGHT_LEAVES, LIGHT_SIZE, Crown, TreeShape, blob


@dataclass(frozen=True)
class Species:
    """A kind of tree.

    Attributes
    ----------
    shape : TreeShape
        Of a tree that is grown.
    form : str
        ``round``, ``column`` (slim blobs above each other), ``cone`` (wide below), ``vase`` (wide above), ``umbrella``
        (a flat crown on a bare stem), ``weeping`` (hanging leaves), ``conifer`` (drooping tiers), ``bare``.
    bark, core, leaves : str
        Materials.
    """

    shape: TreeShape
    form: str = "round"
    bark: str = "bark_furrowed"
    core: str = "leaves_crown"
    leaves: str = "leaf_cards"

    @property
    def reach(self) -> float:
        """Return how far the crown reaches from the stem at most [m]."""
        return 1.35 * self.shape.crown_radius + 0.2


KINDS: dict[str, Species] = {
    "oak": Species(TreeShape(11.0, 4.4, 2.6, 0.30, 18, 2200, 0.30), core="leaves_dark", leaves="leaf_cards_dark"),
    "lime": Species(TreeShape(10.0, 2.9, 2.6, 0.20, 15, 1900, 0.26), "cone"),
    "maple": Species(TreeShape(8.5, 3.0, 2.3, 0.17, 14, 1800, 0.28), core="leaves_copper", leaves="leaf_cards_copper"),
    "plane": Species(TreeShape(12.0, 4.2, 3.6, 0.28, 16, 2000, 0.32), "vase", "bark_pale"),
    "birch": Species(TreeShape(9.5, 1.9, 2.6, 0.11, 12, 1500, 0.18), "column", "bark_birch", "leaves_pale",
                     "leaf_cards_pale"),
    "poplar": Species(TreeShape(14.0, 1.3, 1.2, 0.18, 16, 1900, 0.22), "column"),
    "willow": Species(TreeShape(8.0, 3.4, 2.8, 0.26, 14, 2300, 0.26), "weeping", core="leaves_pale",
                      leaves="leaf_cards_pale"),
    "cherry": Species(TreeShape(5.2, 2.1, 1.7, 0.12, 12, 1700, 0.16), "vase", core="petals_pale", leaves="petal_cards"),
    "pine": Species(TreeShape(11.5, 2.8, 7.0, 0.20, 10, 1600, 0.24), "umbrella", "bark_red", "needles",
                    "leaf_cards_dark"),
    "spruce": Species(TreeShape(11.0, 2.5, 1.3), "conifer", core="needles"),
    "bare": Species(TreeShape(8.5, 3.2, 2.2, 0.17), "bare"),
}  # fmt: skip # a table
"""Name of a kind -> what it is."""
TOWN = ("lime", "plane", "maple", "poplar", "cherry")
COUNTRY = ("oak", "lime", "maple", "birch", "poplar", "willow", "cherry", "pine", "spruce")
GARDEN = ("cherry", "maple", "birch", "spruce")
"""Kinds of streets in towns, of the country, and of gardens."""


def pruned(kind: str, height: float, radius: float, base: float) -> TreeShape:
    """Return the measures of a kind as a street tree: crown and height cut, its lower boughs taken off [m]."""
    own = KINDS[kind].shape
    size = min(own.height, height), min(own.crown_radius, radius), max(own.crown_base, base)
    return replace(own, height=max(size[0], size[2] + 2.0), crown_radius=size[1], crown_base=size[2])


def tree(
    kind: str, seed: int, is_light: bool = False, shape: TreeShape | None = None
) -> tuple[dict[str, Mesh], dict[str, str]]:
    """Return the parts of a tree, foot at the origin, and the material of each.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    seed : int
        Trees of one kind differ by it.
    is_light : bool
        Few triangles: fewer blobs, and large cards in place of leaves.
    shape : TreeShape, optional
        Measures in place of the kind's own, as from `pruned`.
    """
    species = KINDS[kind]
    shape, generator = shape or species.shape, np.random.default_rng([seed, sorted(KINDS).index(kind)])
    materials = {"trunk": species.bark, "core": species.core, "leaves": species.leaves}
    if species.form == "conifer":
        parts = planting.conifer(shape.height, shape.crown_radius, seed, is_light=is_light)
    elif species.form == "bare":
        parts = {"trunk": _bare(shape, generator, 2 if is_light else 3)}
    else:
        crown = _crown(shape, species.form, generator, 5 if is_light else shape.blobs)
        rings, segments = (4, 7) if is_light else (7, 10)
        core = [blob(c, 0.8 * r, 101 * seed + k, rings, segments) for k, (c, r) in enumerate(_blobs(crown))]
        count, size = (LIGHT_LEAVES, LIGHT_SIZE) if is_light else (shape.leaves, shape.leaf_size)
        droop = 2.2 if species.form == "weeping" else 0.0
        parts = {
            "trunk": vegetation.trunk(shape, crown.centres[: 2 if is_light else 6], generator),
            "core": merge(core),
            "leaves": vegetation.foliage(crown, count, size * min(1.0, shape.crown_radius / 2.0), generator, droop),
        }
    return parts, {part: materials[part] for part in parts}


def prefab(kit: SceneKit, kind: str, seed: int, shape: TreeShape | None = None, name: str = "") -> Prefab:
    """Return a kind of tree to be placed in a scene, `tree` with the scene's level of detail, by a name of its own."""
    kit.materials |= leaves.MATERIALS
    kit.textures |= leaves.IMAGES
    return kit.prefab(name or f"tree_{kind}", *tree(kind, seed, kit.is_light, shape), 60.0)


def _blobs(crown: Crown) -> list[tuple[Array, Array]]:
    return list(zip(crown.centres, crown.radii, strict=True))


def _crown(shape: TreeShape, form: str, generator: np.random.Generator, count: int) -> Crown:
    """Return the blobs of a crown of a form."""
    base, tall, wide = shape.crown_base, shape.height - shape.crown_base, shape.crown_radius
    share = (np.arange(count) + generator.uniform(0.2, 0.8, count)) / count  # of the height
    angle = 2.4 * np.arange(count) + generator.uniform(-0.5, 0.5, count)  # golden angle: no side is bare
    profile = {
        "cone": 0.30 + 0.75 * (1.0 - share),
        "vase": 0.30 + 0.75 * share,
        "umbrella": np.full(count, 0.85),
        "column": 0.55 + 0.45 * np.sin(np.pi * share),
    }.get(form, 0.35 + 0.65 * np.sin(np.pi * np.clip(share, 0.08, 0.92)))
    size = np.clip(0.44 * np.sqrt(14.0 / count), 0.40, 0.62) * generator.uniform(0.85, 1.15, count)
    radii = np.stack([wide * profile * size, wide * profile * size, 0.5 * tall * size], 1)
    if form == "column":
        radii = np.stack([0.8 * wide * profile, 0.8 * wide * profile, np.full(count, 1.3 * tall / count)], 1)
    away = np.maximum(wide * profile - radii[:, 0], 0.0) * np.sqrt(generator.uniform(0.35, 1.0, count))
    z = base + radii[:, 2] + share * np.maximum(tall - 2.0 * radii[:, 2], 0.0)
    centres = np.column_stack([away * np.cos(angle), away * np.sin(angle), z])
    middle = np.array([0.0, 0.0, base + 0.5 * tall])
    return Crown(centres, radii, middle, np.array([wide, wide, 0.5 * tall]))


def _bare(shape: TreeShape, generator: np.random.Generator, levels: int) -> Mesh:
    """Return a tree without leaves: boughs that fork `levels` times."""
    top = np.array([0.0, 0.0, shape.crown_base])
    stem = np.array([(0.0, 0.0, -0.3), (0.0, 0.0, 0.3), top])
    parts = [tube(stem, shape.trunk_radius * np.array([1.4, 1.1, 0.85]), 10)]
    first = (0.62 if levels == 2 else 0.5) * (shape.height - shape.crown_base)
    ends = [(top, np.array([0.0, 0.0, 1.0]), first, 0.7 * shape.trunk_radius)]
    for level in range(levels):
        following = []
        for foot, way, length, radius in ends:
            for k in range(4 if level == 0 else 3):
                turn = 2 * np.pi * (k + generator.uniform(-0.2, 0.2)) / (4 if level == 0 else 3)
                bend = generator.uniform(0.4, 0.65)
                side = np.array([np.cos(turn), np.sin(turn), 0.15])
                ahead = way * np.cos(bend) + side * np.sin(bend)
                ahead /= np.linalg.norm(ahead)
                tip = foot + length * generator.uniform(0.8, 1.1) * ahead
                elbow = 0.5 * (foot + tip) + 0.08 * length * side
                parts.append(tube(np.stack([foot, elbow, tip]), radius * np.array([1.0, 0.7, 0.4]), 5))
                following.append((tip, ahead, 0.62 * length, 0.42 * radius))
        ends = following
    return merge([Mesh(part.vertices, part.faces, part.uv) for part in parts])
