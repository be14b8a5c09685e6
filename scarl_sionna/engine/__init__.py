"""The only part that touches Mitsuba, Sionna RT and Dr.Jit: bootstrap, variants, worlds, light, rays, paths.

Names are imported when they are first used: the bootstrap, and what asks for memory, need no world.
"""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from .load import load_scene, stage
    from .world import World, WorldState

__all__ = ["World", "WorldState", "load_scene", "stage"]

__getattr__, __dir__, _ = lazy_loader.attach(
    __name__, submod_attrs={"load": ["load_scene", "stage"], "world": ["World", "WorldState"]}
)
