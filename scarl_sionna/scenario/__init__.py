"""What to simulate: scene, rig, instants and seed."""

from .spec import ScenarioSpec, scenario_names

__all__ = ["ScenarioSpec", "scenario_names"]
