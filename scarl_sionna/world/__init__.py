"""The only part that touches Mitsuba's and Sionna's state: scenes, materials, motion and ray casting."""

from .actor_model import ActorModel, actor_names, read_actor_model
from .scene import World, WorldState, load_scene, scene_names, stage
from .staging import StagedActor
from .tables import Actor, InstanceInfo, PartTable, RayHits

__all__ = [
    "Actor",
    "ActorModel",
    "InstanceInfo",
    "PartTable",
    "RayHits",
    "StagedActor",
    "World",
    "WorldState",
    "actor_names",
    "load_scene",
    "read_actor_model",
    "scene_names",
    "stage",
]
