"""The only part that touches Mitsuba, Sionna RT and Dr.Jit: bootstrap, variants, worlds, light, rays, paths."""

from .world import World, WorldState, load_scene, stage

__all__ = ["World", "WorldState", "load_scene", "stage"]
