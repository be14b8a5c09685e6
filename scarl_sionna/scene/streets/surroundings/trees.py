"""Trees of many kinds: along streets of towns where there is room, in groups and alleys of the country."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenes_xml.generators.kit import Prefab, SceneKit
from scenes_xml.generators.plants import planting, species

from ..model import Array
from .room import disc
from .site import Site, Stand

_TOWN_STEP, _COUNTRY_STEP, _FAR = 11.0, 9.0, 34.0
_STEM = 0.45
_SEEN = 20.0
"""Trees farther behind the front have few triangles [m]."""
_EACH = 2
"""How many trees of a kind differ."""


@dataclass(frozen=True)
class _Tree:
    """A tree: its kind, which of the kind, its turn [rad], size and level."""

    kind: str
    which: int
    turn: float
    scale: float
    detail: str

    @property
    def name(self) -> str:
        return f"{self.kind}_{self.which}_{self.detail}"

    @property
    def reach(self) -> float:
        """How far its crown reaches [m]."""
        return species.KINDS[self.kind].reach * self.scale


def add_trees(site: Site) -> None:
    """Add trees and bushes whose crowns keep away from every carriageway."""
    for number, side in enumerate(site.sides):
        generator = site.generator(8, number)
        is_town = side.character == "town"
        kinds = generator.choice(species.TOWN if is_town else species.COUNTRY, 3, replace=False)
        nearest = 6.0 if side.character == "motorway" else 1.6
        for way in np.arange(4.0, side.length, _TOWN_STEP if is_town else _COUNTRY_STEP):
            place = side.at(way + generator.uniform(-2.0, 2.0))
            kind, which = str(generator.choice(kinds)), int(generator.integers(_EACH))
            scale, turn = float(np.round(generator.uniform(0.75, 1.15), 2)), float(generator.uniform(0.0, 2.0 * np.pi))
            chance, share = float(generator.uniform()), float(generator.uniform())
            group = generator.uniform(-1.0, 1.0, (4, 2))
            if not side.is_open[place] or chance > 0.75:
                continue
            reach = species.KINDS[kind].reach * scale
            away = nearest + reach + (share * 3.0 if is_town else share**2 * (_FAR - reach - nearest))
            foot = side.front[place, :2] + away * side.out[place]
            tree = _Tree(kind, which, turn, scale, "light" if away > _SEEN else site.kit.detail)
            if _plant(site, tree, foot) and not is_town and chance < 0.12:
                for k, shift in enumerate(group):
                    other = replace(tree, which=(which + k) % _EACH, turn=turn + k, scale=0.85 * scale)
                    _plant(site, other, foot + 3.5 * reach * shift)
            elif chance > 0.6:
                _bush(site, side.front[place, :2] + (0.9 + 3.0 * share) * side.out[place], turn, scale)


def _plant(site: Site, tree: _Tree, foot: Array) -> bool:
    """Add a tree unless its stem or its crown has no room."""
    if not site.room.is_off_roads(disc(foot, tree.reach)) or not site.room.is_free(disc(foot, 0.55 * tree.reach)):
        return False
    site.room.take(disc(foot, _STEM + 0.5))
    stand = Stand(site.on_ground(foot) - [0.0, 0.0, 0.05], tree.turn, tree.scale)
    site.put(f"tree_{tree.name}", lambda: _grown(site.kit, tree), "Vegetation", stand)
    return True


def _grown(kit: SceneKit, tree: _Tree) -> Prefab:
    parts, bsdfs = species.tree(tree.kind, tree.which, tree.detail == "light")
    return kit.prefab(f"beside_tree_{tree.name}", parts, bsdfs, 60.0)


def _bush(site: Site, foot: Array, turn: float, scale: float) -> None:
    if site.room.taken(disc(foot, 0.85 * scale)):
        make = lambda: site.kit.prefab("beside_bush", {"bush": planting.shrub(0.7, 0.9, 5)}, {"bush": "hedge"}, 70.0)  # noqa: E731
        site.put("bush", make, "Vegetation", Stand(site.on_ground(foot), turn, scale))
