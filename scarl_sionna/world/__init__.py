"""The only part that touches Mitsuba's and Sionna's state: scenes, materials, motion and ray casting."""

from .scene import World, WorldState, load_scene, scene_names
from .tables import Actor, InstanceInfo, PartTable, RayHits

__all__ = ["Actor", "InstanceInfo", "PartTable", "RayHits", "World", "WorldState", "load_scene", "scene_names"]
