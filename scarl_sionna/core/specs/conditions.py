"""Light and weather that begin at a time of a drive."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

from pydantic import Field, model_validator

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Seconds

from .lighting import Lighting
from .weather import Weather


class Conditions(Spec):
    """Light and weather from a time on, whole specifications; what is None stays as it was before."""

    time: Seconds = Field(description="from which on they hold [s]")
    lighting: Lighting | None = None
    weather: Weather | None = None

    @model_validator(mode="after")
    def _states_something(self) -> Conditions:
        if self.lighting is None and self.weather is None:
            raise ValueError("a lighting, a weather or both")
        return self


def in_order(changes: Iterable[Conditions]) -> tuple[Conditions, ...]:
    """Return changes as they are.

    Raises
    ------
    ParameterRangeError
        If their times do not rise.
    """
    found = tuple(changes)
    for before, after in pairwise(found):
        if not after.time > before.time:
            raise ParameterRangeError("changes", f"{after.time:g} s after {before.time:g} s", "times that rise [s]")
    return found
