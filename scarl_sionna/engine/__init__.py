"""The only part that touches Mitsuba, Sionna RT and Dr.Jit: bootstrap, variants, worlds, light, rays, paths.

Names are imported when they are first used: the bootstrap, and what asks for memory, need no world.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .load import load_scene, stage
    from .world import World, WorldState

__all__ = ["World", "WorldState", "load_scene", "stage"]


def __getattr__(name: str) -> object:
    """Import a public name on first use (PEP 562)."""
    if name not in __all__:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(".world" if name.startswith("World") else ".load", __name__), name)
