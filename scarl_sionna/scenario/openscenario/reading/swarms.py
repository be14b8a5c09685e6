"""Swarms as an OpenSCENARIO file states them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .entities import MODELS
from .source import Node

Array = npt.NDArray[np.float64]
MOST = 500
"""Vehicles of a swarm."""


@dataclass(frozen=True)
class Swarm:
    """A TrafficSwarmAction.

    Attributes
    ----------
    node : Node
    central : str
        The entity that it moves with.
    number : int
        Vehicles within the ellipse.
    inner : float
        Radius about the entity within which none is when it begins [m].
    axes : (float, float)
        Half axes of the ellipse along the entity and across [m].
    offset : float
        How far the middle of the ellipse is ahead of the entity [m].
    mix : mapping of str to float, or None
        Shares of the actor models; None: those of the built-in traffic.
    start : float
        When it begins [s].
    """

    node: Node
    central: str
    number: int
    inner: float
    axes: tuple[float, float]
    offset: float
    mix: Mapping[str, float] | None
    start: float = 0.0

    @classmethod
    def read(cls, node: Node) -> Swarm:
        """Return the swarm of a ``<TrafficSwarmAction>``.

        Raises
        ------
        ScenarioError
            If a value is wrong.
        """
        number = node.whole("numberOfVehicles")
        if not 1 <= number <= MOST:
            raise node.error(f"numberOfVehicles = {number} is outside 1 to {MOST}")
        middle = node.need("CentralObject", "CentralSwarmObject")
        definition = node.child("TrafficDefinition")
        holder = node if definition is None else definition
        node.note("is driven by the built-in traffic: speeds are those of lanes and of who is ahead")
        return cls(
            node,
            middle.text("entityRef"),
            number,
            node.number("innerRadius", low=0.0, high=5000.0, unit="m"),
            tuple(node.number(f"semi{name}Axis", low=1.0, high=5000.0, unit="m") for name in ("Major", "Minor")),  # type: ignore[arg-type] # two
            node.number("offset", 0.0),
            _mix(holder),
        )

    def holds(self, places: Array, middle: Array, heading: Array) -> npt.NDArray[np.bool_]:
        """Return whether places (n, 2) [m] are within the ellipse of the entity at (n, 2) [m] that heads there (n,)."""
        ahead = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
        away = places - middle - self.offset * ahead
        along = (away * ahead).sum(-1)
        across = away[..., 1] * ahead[..., 0] - away[..., 0] * ahead[..., 1]
        return np.asarray((along / self.axes[0]) ** 2 + (across / self.axes[1]) ** 2 <= 1.0)


def _mix(holder: Node) -> dict[str, float] | None:
    found: dict[str, float] = {}
    for spread in holder.children("VehicleCategoryDistribution"):
        for entry in spread.children("VehicleCategoryDistributionEntry"):
            category, weight = entry.text("category"), entry.number("weight", low=0.0)
            models = MODELS.get(category, ())
            if not models:
                raise entry.error(f"no actor model stands for category '{category}'", f"known: {', '.join(MODELS)}")
            for model in models:
                found[model] = found.get(model, 0.0) + weight / len(models)
    return found if sum(found.values()) > 0.0 else None
