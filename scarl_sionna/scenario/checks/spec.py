"""Whether what a scenario states can be.

Motions that last, bodies that do not overlap, actors on the scene's ground.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import (
    CollisionError,
    OutsideSceneError,
    ParameterRangeError,
    ScarlWarning,
    ScenarioError,
    ScenarioPlace,
    ScenarioTimeError,
    ScenarioValueError,
)
from scarl_sionna.scenario.cast import Member
from scarl_sionna.scenario.motion.bodies import WALKER, ActorBody
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.scene.document.model import InstanceEntry, SceneDocument
from scarl_sionna.scene.motion.trajectory import Trajectory

from .collisions import Collision, Measures, find_collisions
from .motion import check_ground, check_motion

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World

STEP = 0.05
"""Time between the instants at which bodies are compared [s]: at a closing speed of 60 m/s they move 3 m, less than a
car's length."""
TOUCH = 0.05
"""Overlap of boxes that still counts as passing by [m]: bodies are rounder than their boxes."""
GROUND_STEP = 0.25
"""Time between the instants at which the ground below an actor is looked for [s]."""
SLACK = 0.2
"""Mean height of an actor above or below the ground that is let pass [m]: that of a high kerb. One wheel alone may not
be `checks.motion.WHEEL` off."""
FASTEST, HARDEST = 70.0, 40.0
"""Speed [m/s] and acceleration [m/s^2] that no road user reaches: beyond it a point or a time is wrong."""
PATH_OF_TRAFFIC = ("traffic",)
_LONGEST = 2000
"""Most instants that are compared."""

Moving = tuple[str, Trajectory, Measures]


def body_of_entry(entry: InstanceEntry) -> ActorBody:
    """Return the usual measures of a class, for an actor of the scene whose model is not known."""
    return WALKER if entry.semantic == "Pedestrian" else ActorBody()


def moving_of(document: SceneDocument) -> Iterator[tuple[InstanceEntry, Trajectory]]:
    """Yield the actors of a scene with their motions."""
    for entry in document.instances:
        if entry.trajectory is not None:
            yield entry, entry.trajectory


def check_times(spec: ScenarioSpec, members: Sequence[Member], document: SceneDocument) -> None:
    """Raise if a motion begins after the first frame or ends before the last one.

    Raises
    ------
    ScenarioTimeError
        At the actor's trajectory; for an actor of the scene itself at what makes the scenario longer.
    """
    problems: list[ScenarioError] = []
    for member in members:
        problem = _time_problem(
            spec,
            member.actor.trajectory,
            f"'{member.actor.name}'",
            spec.place(*member.path, "trajectory"),
            "name more lanes, let it drive slower or stop, or make the scenario shorter",
        )
        problems += [problem] if problem is not None else []
    for entry, trajectory in moving_of(document):
        problem = _time_problem(
            spec,
            trajectory,
            f"'{entry.name}' of scene '{spec.scene}'",
            spec.place("num_frames"),
            "make the scenario shorter",
        )
        problems += [problem] if problem is not None else []
    if problems:
        raise ScenarioError.first_of(problems)


def _time_problem(
    spec: ScenarioSpec, trajectory: Trajectory, what: str, place: ScenarioPlace, remedy: str
) -> ScenarioTimeError | None:
    first, last = spec.times[0], spec.times[-1]
    for time, words in ((first, "first"), (last, "last")):
        if not trajectory.start <= time <= trajectory.stop:
            return ScenarioTimeError(
                f"the {words} frame, at {time:.6g} s, "
                f"is outside the motion of {what} ({trajectory.start:.6g} to {trajectory.stop:.6g} s)",
                place,
                remedy,
                value=time,
                time=time,
                start=trajectory.start,
                stop=trajectory.stop,
                what=what,
            )
    return None


def check_gaits(spec: ScenarioSpec, members: Sequence[Member], document: SceneDocument) -> None:
    """Raise if one of a scenario's actors cannot move its limbs as fast as its motion asks for.

    Raises
    ------
    ScenarioValueError
        At the actor's trajectory.
    """
    entries = {entry.name: entry for entry in document.instances}
    problems: list[ScenarioError] = []
    for member in members:
        joints = entries[member.actor.name].joints if member.path[:1] != PATH_OF_TRAFFIC else ()
        limbs = [joint for joint in joints if joint.changes_shape]
        try:
            for time in instants(spec)[::2] if limbs else ():
                for joint in limbs:
                    joint.motions(float(time))
        except ParameterRangeError as error:
            problems.append(
                ScenarioValueError(
                    f"'{member.actor.name}' at {time:.4g} s: {error}",
                    spec.place(*member.path, "trajectory"),
                    "let it move more slowly, or a trailer in wider bends and not backwards",
                    value=error.value,
                )
            )
    if problems:
        raise ScenarioError.first_of(problems)


def check_speeds(spec: ScenarioSpec, members: Sequence[Member]) -> None:
    """Raise if a motion from points, times or a table is faster or changes faster than anything on a road.

    Raises
    ------
    ScenarioValueError
        At the actor's trajectory, with the time.
    """
    problems: list[ScenarioError] = []
    for member in members:
        name, trajectory = member.actor.name, member.actor.trajectory
        times = np.clip(instants(spec), trajectory.start, trajectory.stop)
        faults = check_motion([(name, trajectory, None)], times, FASTEST, HARDEST, np.inf)
        for fault in faults[:1]:
            unit = "m/s" if fault.what == "speed" else "m/s^2"
            problems.append(
                ScenarioValueError(
                    f"the {fault.what} of '{name}' is {fault.value:.3g} {unit} at {fault.time:.4g} s (allowed: "
                    f"up to {fault.limit:g} {unit})",
                    spec.place(*member.path, "trajectory"),
                    "give it more time between the points",
                    value=fault.value,
                )
            )
    if problems:
        raise ScenarioError.first_of(problems)


def instants(spec: ScenarioSpec) -> npt.NDArray[np.float64]:
    """Return the instants at which bodies are compared [s]: from the first to the last frame."""
    first, last = spec.times[0], spec.times[-1]
    count = min(int(np.ceil((last - first) / STEP)) + 1, _LONGEST)
    return np.linspace(first, last, count) if last > first else np.array([first])


def touching(spec: ScenarioSpec, members: Sequence[Member]) -> list[tuple[str, str]]:
    """Return the names of members that overlap, each pair in the order of the members."""
    order = {member.actor.name: index for index, member in enumerate(members)}
    hits = find_collisions(_moving(members), instants(spec), TOUCH)
    pairs = ((hit.first, hit.second) for hit in hits)
    return [(one, other) if order[one] < order[other] else (other, one) for one, other in pairs]


def _moving(members: Sequence[Member]) -> list[Moving]:
    return [(member.actor.name, member.actor.trajectory, member.body) for member in members]


def check_collisions(spec: ScenarioSpec, members: Sequence[Member], document: SceneDocument) -> None:
    """Raise, or warn, if bodies overlap at the start or during the run.

    Parameters
    ----------
    spec : ScenarioSpec
        Its `collisions` says what an overlap does.
    members : sequence of Member
    document : SceneDocument
        With the scene's own actors that stay.

    Raises
    ------
    CollisionError
        At the actor that the scenario names last.
    """
    if spec.collisions == "allow":
        return
    own = [(entry.name, trajectory, body_of_entry(entry)) for entry, trajectory in moving_of(document)]
    names = {member.actor.name: member for member in members}
    problems: list[ScenarioError] = []
    for hit in find_collisions([*_moving(members), *own], instants(spec), TOUCH):
        if hit.first in names or hit.second in names:  # what a scene does on its own is the scene's
            problems.append(_collision(spec, hit, names))
    if not problems:
        return
    if spec.collisions == "error":
        raise ScenarioError.first_of(problems)
    for problem in problems:
        warnings.warn(str(problem), ScarlWarning, stacklevel=3)


def _collision(spec: ScenarioSpec, hit: Collision, names: dict[str, Member]) -> CollisionError:
    involved = [name for name in (hit.first, hit.second) if name in names]
    blamed = max(
        involved, key=lambda name: (names[name].path[:1] != PATH_OF_TRAFFIC and spec.place(*names[name].path).line) or 0
    )
    other = hit.second if blamed == hit.first else hit.first
    at_start = hit.time <= spec.times[0]
    where = ""
    if other in names and (line := spec.place(*names[other].path).line) is not None:
        where = f" (line {line})"
    words = "overlaps with" if at_start else "collides with"
    return CollisionError(
        f"'{blamed}' {words} '{other}'{where} at {hit.time:.4g} s, by up to {hit.depth:.2g} m until {hit.last:.4g} s",
        spec.place(*names[blamed].path),
        "change a start, a speed or an offset, or set `collisions: allow`",
        value=blamed,
        time=hit.time,
        other=other,
        depth=hit.depth,
    )


def check_places(spec: ScenarioSpec, members: Sequence[Member], world: World) -> None:
    """Raise if one of a scenario's actors stands, drives or walks where it is not on the ground of the scene.

    Traffic is not looked at: it comes from beyond the scene and goes there.

    Raises
    ------
    OutsideSceneError
        At the actor's trajectory, with the first place and time.
    """
    own = [member for member in members if member.path[:1] != PATH_OF_TRAFFIC]
    if not own:
        return
    first, last = spec.times[0], spec.times[-1]
    times = np.linspace(first, last, min(2 + int((last - first) / GROUND_STEP), 200))
    faults = check_ground(world, [(one.actor.name, one.actor.trajectory, one.body) for one in own], times, SLACK)
    problems: list[ScenarioError] = []
    for member in own:
        fault = next((fault for fault in faults if fault.name == member.actor.name), None)
        if fault is None:
            continue
        x, y, z = (float(value) for value in member.actor.trajectory.pose(fault.time).position)
        what = f"is {abs(fault.height):.3g} m {'above' if fault.height > 0.0 else 'below'} the ground"
        if not np.isfinite(fault.height):
            what = f"has no ground of scene '{spec.scene}' within 4 m below it"
        problems.append(
            OutsideSceneError(
                f"'{member.actor.name}' {what} at {fault.time:.4g} s: ({x:.4g}, {y:.4g}, {z:.4g}) m",
                spec.place(*member.path, "trajectory"),
                "move it onto the ground of the scene",
                value=(x, y, z),
                time=fault.time,
                height=fault.height,
            )
        )
    if problems:
        raise ScenarioError.first_of(problems)
