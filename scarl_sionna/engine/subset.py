"""Some instances of a scene alone, for what must be solved without their surroundings."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from .world import World, WorldState

if TYPE_CHECKING:
    from scarl_sionna.scene.document.model import SceneDocument

_kept: WeakKeyDictionary[World, dict[tuple[int, ...], World]] = WeakKeyDictionary()


def alone(state: WorldState, instances: Iterable[int]) -> tuple[WorldState, dict[int, int]]:
    """Return a state of a world that holds some instances and nothing else.

    Parameters
    ----------
    state : WorldState
    instances : iterable of int
        Ids that stay; they stand and move as in `state`.

    Returns
    -------
    state : WorldState
        Its world is made once for each choice and kept with the whole one; its meshes are read again from the scene's
        files.
    original : dict
        Instance id in the whole scene by the id in the new one.
    """
    chosen = tuple(sorted(set(instances)))
    worlds = _kept.setdefault(state.world, {})
    if chosen not in worlds:
        worlds[chosen] = World(_reduced(state.world, chosen), state.world.materials)
    part = WorldState(worlds[chosen], state.time, state._poses, state._twists)
    return part, dict(enumerate(chosen, start=1))  # ids follow the order of the entries, which is kept


def _reduced(world: World, instances: tuple[int, ...]) -> SceneDocument:
    entries = tuple(world._entries[number - 1] for number in instances)
    shapes = {shape for entry in entries for shape in entry.shapes}
    document = world.document
    root = copy.deepcopy(document.root)
    for shape in root.findall("shape"):
        if shape.get("id") not in shapes:
            root.remove(shape)
    return replace(
        document,
        root=root,
        instances=entries,
        bsdf_of_shape={shape: bsdf for shape, bsdf in document.bsdf_of_shape.items() if shape in shapes},
        ego=None,
    )
