"""The only part that touches Mitsuba, Sionna RT and Dr.Jit: bootstrap, variants, worlds, light, rays, paths."""

from .load import load_scene, stage
from .world import World, WorldState

__all__ = ["World", "WorldState", "load_scene", "stage"]
