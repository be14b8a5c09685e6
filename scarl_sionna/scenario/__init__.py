"""What to simulate: scene, rig, instants and seed."""

from .spec import ScenarioSpec

__all__ = ["ScenarioSpec"]
