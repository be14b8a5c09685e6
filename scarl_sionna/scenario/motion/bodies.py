"""Outer measures of what moves, as far as planning needs them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from scarl_sionna.core.errors import ParameterRangeError

STEERING = float(np.radians(32.0))
"""Largest angle of the front wheels of the bicycle that a vehicle is here."""
_STEP_ROUND = 0.5
"""Radius of the narrowest bend that people walk, and all that has no axles takes [m]; an estimate."""


class BodyLike(Protocol):
    """What planning asks of an actor model.

    Measures [m], and how it moves (``vehicle``, ``cycle``, ``walk``, ``stand``).
    """

    @property
    def length(self) -> float:
        """Along x [m]."""

    @property
    def width(self) -> float:
        """Along y [m]."""

    @property
    def height(self) -> float:
        """Along z [m]."""

    @property
    def wheelbase(self) -> float | None:
        """Distance of the axles [m]; None or 0 where there are none."""

    @property
    def rear_axle(self) -> float | None:
        """X of the rear axle in the actor's frame [m]; None or 0 where there is none."""

    @property
    def motion(self) -> str:
        """How it moves."""


class TrailerBody(NamedTuple):
    """A trailer in line behind its vehicle.

    x of the coupling, way from there to its axle, x of its rear and of its front [m].
    """

    hitch: float
    length: float
    rear: float
    front: float


@dataclass(frozen=True)
class ActorBody:
    """Measures of a body: origin on the ground below the middle, x forward.

    Attributes
    ----------
    length, width, height : float
        [m]
    wheelbase : float
        Distance of the axles, 0 for a pedestrian [m].
    rear_axle : float
        X of the rear axle [m]: that of the vehicle that tows, where there is a trailer.
    motion : str
        ``vehicle``, ``cycle``, ``walk`` or ``stand``.
    age : float or None
        Of a person [years].
    trailer : TrailerBody or None
        What it tows; `length` holds both in line.
    """

    length: float = 4.6
    width: float = 1.8
    height: float = 1.45
    wheelbase: float = 2.7
    rear_axle: float = -1.35
    motion: str = "vehicle"
    age: float | None = None
    trailer: TrailerBody | None = None

    def __post_init__(self) -> None:
        for name in ("length", "width", "height"):
            if not 0.0 < getattr(self, name) < 100.0:
                raise ParameterRangeError(f"ActorBody.{name}", getattr(self, name), "above 0 to 100 m")
        if not 0.0 <= self.wheelbase <= self.length:
            raise ParameterRangeError("ActorBody.wheelbase", self.wheelbase, f"0 to the length of {self.length:g} m")
        if not abs(self.rear_axle) <= self.length / 2.0:
            raise ParameterRangeError("ActorBody.rear_axle", self.rear_axle, f"up to {self.length / 2.0:g} m from 0")

    @property
    def sharpest(self) -> float:
        """Curvature of the narrowest bend of the rear axle [1/m]: wheels at `STEERING`, or steps of people."""
        return float(np.tan(STEERING)) / self.wheelbase if self.wheelbase > 0.0 else 1.0 / _STEP_ROUND

    @classmethod
    def of(cls, model: BodyLike) -> ActorBody:
        """Return the measures of an actor model."""
        return cls(
            float(model.length),
            float(model.width),
            float(model.height),
            float(model.wheelbase or 0.0),
            float(model.rear_axle or 0.0),
            str(model.motion),
            getattr(model, "age", None),
            _trailer_of(model),
        )


def _trailer_of(model: BodyLike) -> TrailerBody | None:
    """Return the trailer of an actor model with such a joint, or of a body."""
    for joint in getattr(model, "joints", ()):
        if joint["kind"] == "trailer":
            return TrailerBody(float(joint["hitch"][0]), float(joint["length"]), *map(float, joint["span"]))
    return getattr(model, "trailer", None)


_PACE = ((15.0, 60.0, 70.0, 80.0, 90.0), (1.0, 1.0, 0.9, 0.75, 0.6))
"""Ages [years] and paces over that of adults; estimates."""


def usual_pace(body: ActorBody) -> float:
    """Return at which share of an adult's pace somebody walks.

    The small walk slower by their height, the old by their age.
    """
    return min(0.85 * body.height / 1.22, 1.0) * float(np.interp(body.age or 30.0, *_PACE))


WALKER = ActorBody(0.55, 0.60, 1.75, 0.0, 0.0, "walk")
"""An adult on foot: length includes the step."""


def body_of(model: BodyLike | str | None, bodies: Mapping[str, BodyLike] | None = None) -> ActorBody:
    """Return the body of a model.

    Given, by its name (looked up in `bodies`, then among the actor models), or a saloon for None.

    Raises
    ------
    UnknownNameError
        If no model has that name.
    """
    if model is None:
        return ActorBody()
    if isinstance(model, str):
        if bodies and model in bodies:
            return ActorBody.of(bodies[model])
        from scarl_sionna.scene.actors.model import read_actor_model

        return ActorBody.of(read_actor_model(model))
    return ActorBody.of(model)
