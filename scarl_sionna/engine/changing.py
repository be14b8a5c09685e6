"""Light and weather that change during a drive: in steps, each of which is a world of its own while it holds."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping
from typing import Generic, Protocol, Self, TypeVar

from scarl_sionna.core.specs.conditions import Conditions, in_order
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.scene.motion.trajectory import Trajectory


class Lit(Protocol):
    """A world in one light and weather."""

    @property
    def stated(self) -> tuple[Lighting | None, Weather]:
        """The lighting as it was chosen, and the weather."""

    def under(self, lighting: Lighting | None, weather: Weather) -> Self:
        """Return it under another lighting and in another weather."""

    def release(self, kind: str) -> None:
        """Let go of a twin."""

    def with_motion(self, trajectories: Mapping[str, Trajectory]) -> Self:
        """Return it with other trajectories."""


World = TypeVar("World", bound=Lit)


class Changes(Generic[World]):
    """The changes of a world, and the world that held last.

    A step shares all with the world before but the optical twin, of which there is one at a time: of a town it is
    hundreds of megabytes.

    Raises
    ------
    ParameterRangeError
        If their times do not rise.
    """

    def __init__(self, steps: Iterable[Conditions] = (), now: tuple[int, World] | None = None) -> None:
        self.steps = in_order(steps)
        self._now = now

    def world_at(self, start: World, time: float) -> World:
        """Return the world that holds at a time [s]: `start` before the first change."""
        if not self.steps:
            return start
        number = bisect_right([one.time for one in self.steps], time)
        before = self._now or (0, start)
        if before[0] == number:
            return before[1]
        found = start
        if number:
            lighting, weather = start.stated
            for one in self.steps[:number]:
                lighting, weather = one.lighting or lighting, one.weather or weather
            found = before[1].under(lighting, weather)
        self._now = number, found
        before[1].release("optical")
        return found

    def moved(self, trajectories: Mapping[str, Trajectory]) -> Changes[World]:
        """Return the same changes of a world with other trajectories."""
        now = self._now
        return Changes(self.steps, (now[0], now[1].with_motion(trajectories)) if now and now[0] else None)

    def without(self, key: str) -> Changes[World]:
        """Return the changes that are left where the lighting, or the weather, is the same all the time."""
        return Changes(one.with_(**{key: None}) for one in self.steps if _says_more(one, key))


def _says_more(step: Conditions, key: str) -> bool:
    return any(getattr(step, other) is not None for other in ("lighting", "weather") if other != key)
