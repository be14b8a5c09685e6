"""A session: another simulator says where everything is, and gets what the sensors see, step by step."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from scarl_sionna.core.errors import (
    InputTypeError,
    ParameterRangeError,
    PlacementError,
    ScarlWarning,
    SessionError,
    UnknownNameError,
)
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.prompt.arguments import HOW_TO_RIG, HOW_TO_WORLD, expect, number
from scarl_sionna.core.prompt.describe import Described, Row, listed, quantity
from scarl_sionna.core.results import Frame
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radio import RadioSpec
from scarl_sionna.fusion.rig import Rig
from scarl_sionna.scenario.traffic.planned import BETWEEN, DEPTH
from scarl_sionna.scene.document.staging import StagedActor
from scarl_sionna.simulation import observe

from .motion import REMEMBERED, ActorPose, ToldTrajectory, twist_between
from .settings import SessionSettings

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World

_HOW_TO_POSES = "give {'ego': ss.Pose([x, y, z])} or {'7': ss.ActorPose(pose, twist, body='saloon')}"
_REST = Twist()


class Session(Described):
    """Sensors that are stepped by another simulator.

    Parameters
    ----------
    world : World, str or Path
        A loaded scene, or what :func:`scarl_sionna.load_scene` takes. Its actors are driven, by their names.
    rig : Rig
    settings : SessionSettings, optional
    vehicle : str, Pose or Mount, optional
        Name of the actor that carries the rig, or a place of the rig that does not move; default: the ego of the scene.

    Raises
    ------
    InputTypeError
        If an argument is of another type.
    UnknownNameError
        If a model, a sensor pattern or an actor to keep is not known.
    PlacementError
        If nothing carries the rig.

    Notes
    -----
    The scene is loaded once, with a body for every actor that can be there; a step moves bodies, and an actor that
    comes takes one of its model that is free. Who is not among the poses of a step is away from then on: 500 m below
    the scene, without a box. A frame is that of :func:`scarl_sionna.observe` at the same time, seed and world; a
    recorded session gives the same bytes again.
    """

    def __init__(
        self,
        world: World | str | Path,
        rig: Rig,
        settings: SessionSettings | None = None,
        *,
        vehicle: str | Pose | Mount | None = None,
    ) -> None:
        from scarl_sionna.engine.load import load_scene
        from scarl_sionna.engine.world import World

        expect("world", world, (World, str, Path), HOW_TO_WORLD)
        expect("rig", rig, Rig, HOW_TO_RIG)
        settings = SessionSettings() if settings is None else settings
        expect("settings", settings, SessionSettings, "give ss.SessionSettings(seed=1)")
        self.settings = settings
        self.rig = rig if settings.radar is None else rig.with_radar(settings.radar)
        self._rates = _rates(rig, settings.rates)
        loaded = world if isinstance(world, World) else load_scene(world)
        for name in settings.keep:
            loaded.actor(name)
        self._free: dict[str, list[str]] = {model: [] for model in settings.bodies}
        self._motion: dict[str, ToldTrajectory] = {}
        staged: list[StagedActor] = []
        for model, count in settings.bodies.items():
            for _ in range(count):
                name = f"body-{len(staged) + 1}"
                staged.append(StagedActor(name, model, self._told(name), detail=settings.detail))  # type: ignore[arg-type]
                self._free[model].append(name)
        self._names: dict[str, str | None] = {}  # whom interferers and stations of the rig may name, and the bodies
        self._own = tuple(actor.name for actor in loaded.actors if actor.name not in settings.keep)
        if staged:
            loaded = loaded.with_actors(staged)
        self._world: World | None = loaded.with_motion(
            {name: self._motion.get(name) or self._told(name) for name in (*self._own, *self._motion)}
        ).with_names(self._names)
        self.vehicle = loaded.ego if vehicle is None else vehicle
        if self.vehicle is None:
            raise PlacementError(
                f"scene '{loaded.name}' has no ego vehicle: give Session(..., vehicle='ego'), or a pose"
            )
        self._bodies = {model: tuple(names) for model, names in self._free.items()}
        self._begin()

    def _begin(self) -> None:
        """Set everything to before the first step."""
        self._free = {model: list(names) for model, names in self._bodies.items()}
        self._names.clear()
        self._body: dict[str, str] = {name: name for name in self._own}
        self._model: dict[str, str] = {}
        self._last: dict[str, Pose] = {}
        self._last_ns: int | None = None
        self._num_looks: dict[str, int] = {}
        self._num_steps = 0
        self.seconds: dict[str, float] = {}

    def restart(self, seed: int | None = None) -> None:
        """Go back to before the first step, in the same scene, which is not loaded again.

        Parameters
        ----------
        seed : int, optional
            Root of the random numbers from now on, >= 0; None: as before.

        Raises
        ------
        SessionError
            If the session is closed.
        SpecError
            If the seed is not allowed.
        """
        world = self.world
        if seed is not None:
            self.settings = SessionSettings(**{**dict(self.settings), "seed": seed})
        names, self._motion = list(self._motion), {}
        self._world = world.with_motion({name: self._told(name) for name in names})
        self._begin()

    def _told(self, name: str) -> ToldTrajectory:
        away = Pose(np.array([0.0, 0.0, -DEPTH - BETWEEN * len(self._motion)]))
        self._motion[name] = ToldTrajectory(self.settings.start, away)
        return self._motion[name]

    def _facts(self) -> Iterable[Row]:
        yield "world", "closed" if self._world is None else self._world.name
        yield "time", "before the first step" if self.time is None else quantity(self.time, "s")
        yield "steps", str(self._num_steps)
        yield "vehicle", str(self.vehicle)
        yield "actors", f"{len(self._last)}: {listed(self._last)}"
        yield "free bodies", listed(f"{len(names)} {model}" for model, names in self._free.items())
        for mount in self.rig.sensors:
            rate = self._rates[mount.name]
            yield mount.name, "every step" if rate is None else quantity(rate, "Hz")
        yield "seconds", listed(f"{stage} {quantity(taken, 's')}" for stage, taken in self.seconds.items())

    @property
    def world(self) -> World:
        """The world with its bodies, as the last step left it.

        Raises
        ------
        SessionError
            If the session is closed.
        """
        if self._world is None:
            raise SessionError("the session is closed; make another one")
        return self._world

    @property
    def time(self) -> float | None:
        """Time of the last step [s]; None before the first."""
        return None if self._last_ns is None else self._last_ns / 1e9

    @property
    def actors(self) -> dict[str, str]:
        """Who is there, and the name in `world` of the body that each has."""
        return {name: self._body[name] for name in self._last}

    def step(self, time: float, poses: Mapping[str, Pose | ActorPose]) -> Frame:
        """Move everything to a time and return what the sensors see that are due.

        Parameters
        ----------
        time : float
            [s], later than that of the step before; rounded to whole nanoseconds.
        poses : mapping of str to Pose or ActorPose
            Everybody who is there, by name. An actor that comes is one of the scene, or states its `body`; who is left
            out leaves.

        Returns
        -------
        Frame
            Its results are those of the sensors that are due, none at some steps; its objects have the names of
            `poses`.

        Raises
        ------
        ParameterRangeError
            If time does not go on, or a pose or velocity is not finite.
        InputTypeError
            If a value is of another type.
        UnknownNameError
            If an actor is not known, or its body is not among those of the settings.
        SessionError
            If all bodies of a model are taken, an actor changes its body, or the session is closed.
        PlacementError
            If the vehicle that carries the rig is not among the poses.

        Notes
        -----
        A step that raises one of these leaves the session as it was. What bodies and sensors refuse (a person who walks
        faster than people can, a radar inside a body) is found when they look: then the step has been made, without a
        frame.

        Warns
        -----
        ScarlWarning
            If an actor comes without its velocity: it is taken to be at rest in this step.
        """
        world, started = self.world, perf_counter()
        now_ns = self._checked_time(time)
        told = {name: _as_actor_pose(name, value) for name, value in _pairs(poses)}
        body, model, free = self._assigned(told)
        self._check_vehicle(told)
        twists = {name: self._twist(name, value, now_ns) for name, value in told.items()}
        self._body, self._model, self._free = body, model, free
        self._last = {name: value.pose for name, value in told.items()}
        of_body = {body[name]: name for name in told}
        self._call(of_body)
        for name, motion in self._motion.items():
            who = of_body.get(name)
            motion.tell(now_ns / 1e9, None if who is None else told[who].pose, _REST if who is None else twists[who])
        self._last_ns = now_ns
        due = self._due(now_ns)
        self._count("move", perf_counter() - started)
        frame = self._look(world, now_ns, due, of_body)
        if due and not self.settings.record:
            for motion in self._motion.values():
                motion.forget(now_ns / 1e9 - REMEMBERED)
        self._num_steps += 1
        self._count("step", perf_counter() - started)
        return frame

    def _call(self, of_body: Mapping[str, str]) -> None:
        """Let the world know everybody who is there by name, and who is not, but is named in the rig, as away."""
        for name, body in tuple(self._names.items()):
            if body in of_body:
                del self._names[name]
        self._names.update((name, body) for body, name in of_body.items())
        if self.settings.bodies:  # else nobody comes whom the scene does not know
            for name in _named(self.rig):
                self._names.setdefault(name, None)  # names in the scene go before

    def _look(self, world: World, now_ns: int, due: list[str], of_body: Mapping[str, str]) -> Frame:
        carrier: Mount | Pose
        if isinstance(self.vehicle, str):
            carrier = world.at(now_ns / 1e9).mount(self._body.get(self.vehicle, self.vehicle))
        else:
            carrier = self.vehicle  # type: ignore[assignment]
        frame = observe(
            world, self.rig, now_ns / 1e9, self.settings.seed, vehicle=carrier, index=self._num_steps, only=due
        )
        for name, taken in frame.timings.items():
            self._count(name, taken)
        objects = tuple(replace(item, name=of_body.get(item.name, item.name)) for item in frame.objects)
        return replace(frame, objects=objects)

    def _count(self, stage: str, taken: float) -> None:
        self.seconds[stage] = self.seconds.get(stage, 0.0) + taken

    def _checked_time(self, time: float) -> int:
        when = number("time", time, "give seconds: session.step(0.05, poses)")
        if not np.isfinite(when) or when < self.settings.start:
            allowed = f"a finite time from the start, {self.settings.start:.9g} s"
            raise ParameterRangeError("time", f"{when:.9g} s", allowed, "SessionSettings(start=...) sets it")
        now_ns = round(when * 1e9)
        if self._last_ns is not None and now_ns <= self._last_ns:
            allowed = f"later than the last step, {self._last_ns / 1e9:.9g} s"
            raise ParameterRangeError("time", f"{when:.9g} s", allowed, "time only goes on; make another session")
        return now_ns

    def _assigned(self, told: Mapping[str, ActorPose]) -> tuple[dict[str, str], dict[str, str], dict[str, list[str]]]:
        """Return the bodies of all actors, the models of those that have one of the settings, and who is free then."""
        body = {name: name for name in self._own}
        model = {name: self._model[name] for name in told if name in self._model}
        free = {kind: list(names) for kind, names in self._free.items()}
        for name, kind in self._model.items():
            if name in told:
                body[name] = self._body[name]
            else:
                free[kind].append(self._body[name])
        for names in free.values():
            names.sort(key=lambda one: int(one.removeprefix("body-")))
        for name, value in told.items():
            if name in self._own or name in model:
                if value.body not in (None, model.get(name)):
                    have = model.get(name, "one of the scene")
                    raise SessionError(f"actor '{name}' has the body {have} and cannot change it to '{value.body}'")
                continue
            if value.body is None:
                raise UnknownNameError(
                    "actor",
                    name,
                    {*self._own, *self._model},
                    f"if it comes now: ActorPose(pose, body=...), {_HOW_TO_POSES}",
                )
            if value.body not in free:
                raise UnknownNameError(
                    "body", value.body, free, "SessionSettings(bodies={'saloon': 8}) says which there are"
                )
            if not free[value.body]:
                count = self.settings.bodies[value.body]
                raise SessionError(
                    f"all {count} bodies '{value.body}' are taken, none is left for '{name}'; "
                    f"make the session with SessionSettings(bodies={{'{value.body}': {2 * count}}})"
                )
            model[name], body[name] = value.body, free[value.body].pop(0)
        return body, model, free

    def _twist(self, name: str, value: ActorPose, now_ns: int) -> Twist:
        """Return the velocity of an actor: what was told, else the mean since the last step."""
        if value.twist is not None:
            return value.twist
        if name in self._last and self._last_ns is not None:
            return twist_between(self._last[name], value.pose, (now_ns - self._last_ns) / 1e9)
        warnings.warn(
            f"actor '{name}' comes without its velocity and is taken to be at rest in this step; "
            "give ActorPose(pose, twist=ss.Twist([vx, vy, vz]))",
            ScarlWarning,
            stacklevel=4,
        )
        return _REST

    def _check_vehicle(self, told: Mapping[str, ActorPose]) -> None:
        if isinstance(self.vehicle, str) and self.vehicle not in told and self.vehicle not in self.settings.keep:
            raise PlacementError(f"'{self.vehicle}' carries the rig and is not among the poses of this step; add it")

    def _due(self, now_ns: int) -> list[str]:
        """Return the sensors whose next time has come, and count them as served.

        Counted from the start in whole nanoseconds. A step is in time that is a millionth of an interval early, or as
        much as its number of seconds is rounded, 0.24 us by the clock of Unix.
        """
        due, since = [], (now_ns - round(self.settings.start * 1e9)) / 1e9
        rounding = float(np.spacing(now_ns / 1e9))
        for name, rate in self._rates.items():
            if rate is None:
                due.append(name)
                continue
            turn = int(np.floor((since * (1.0 + 1e-12) + rounding) * rate + 1e-6))
            if turn > self._num_looks.get(name, -1):
                self._num_looks[name] = turn
                due.append(name)
        return due

    def recorded(self) -> World:
        """Return the world with all motion that it was told, for :func:`scarl_sionna.simulate` and plots.

        Raises
        ------
        SessionError
            If the settings did not say ``record=True``, or the session is closed.
        """
        if not self.settings.record:
            raise SessionError("the session kept no record; make it with SessionSettings(record=True)")
        return self.world.with_motion(self._motion).with_names(dict(self._names))

    def close(self) -> None:
        """Let go of the world; a step after this raises."""
        self._world = None

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _rates(rig: Rig, wanted: Mapping[str, float]) -> dict[str, float | None]:
    """Return the rate of every sensor [Hz], None for those that look at every step."""
    for pattern in wanted:
        rig.subset(pattern)  # raises if it fits no sensor
    return {
        name: next((rate for pattern, rate in wanted.items() if fnmatchcase(name, pattern)), None) for name in rig.names
    }


def _named(rig: Rig) -> set[str]:
    """Return the actors on which other radars and stations of a rig ride."""
    found: set[str | None] = set()
    for mount in rig.sensors:
        if isinstance(mount.settings, RadarSettings):
            found |= {other.actor for other in mount.settings.interferers}
        if isinstance(mount.spec, RadioSpec):
            found |= {station.actor for station in mount.spec.stations}
    return {name for name in found if name is not None}


def _pairs(poses: object) -> Iterable[tuple[str, Any]]:
    if not isinstance(poses, Mapping):
        raise InputTypeError("poses", poses, "a mapping of names to poses", _HOW_TO_POSES)
    for name in poses:
        expect("name of an actor", name, str, _HOW_TO_POSES)
    return poses.items()


def _as_actor_pose(name: str, value: object) -> ActorPose:
    if isinstance(value, Pose):
        return ActorPose(value)
    expect(f"poses['{name}']", value, ActorPose, _HOW_TO_POSES)
    return value  # type: ignore[return-value]
