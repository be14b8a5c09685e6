"""One simulated drive: its specification, the motion and traffic in it, and the composition of its world."""

from .spec.scenario import ScenarioSpec, scenario_names

__all__ = ["ScenarioSpec", "scenario_names"]
