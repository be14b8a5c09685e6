"""The traffic of a scenario as members of its cast: simulated here, by SUMO, or read from a file."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scarl_sionna.core.errors import (
    InputFileError,
    ParameterRangeError,
    ScarlWarning,
    ScenarioError,
    ScenarioFileError,
    ScenarioTimeError,
    ScenarioValueError,
    TrajectoryFileError,
    UnknownNameError,
)
from scarl_sionna.scene.actors.model import Color, read_actor_model
from scarl_sionna.scene.document.model import SceneDocument
from scarl_sionna.scene.document.staging import StagedActor
from scarl_sionna.scene.motion.trajectory import Trajectory

from .cast import EGO, Member
from .checks.collisions import find_collisions
from .checks.spec import PATH_OF_TRAFFIC, STEP, body_of_entry, moving_of
from .motion.bodies import BodyLike
from .motion.motions import MARGIN, Setting
from .randomize import draw_look
from .spec.actors import TrafficSpec
from .spec.light import name_error
from .spec.motion import TableSpec
from .spec.scenario import ScenarioSpec
from .traffic.crowd import crowd, is_close
from .traffic.planned import BETWEEN, DEPTH, Conversion, PlannedActor, PresentTrajectory
from .traffic.recorded.commonroad import read_commonroad
from .traffic.recorded.fcd import read_fcd
from .traffic.recorded.nuscenes import about_scene, read_nuscenes
from .traffic.recorded.osi import HOST, about_trace, read_osi
from .traffic.simulated import simulate_traffic
from .traffic.sumo import run_sumo

if TYPE_CHECKING:
    from .openscenario.drive import Drive

SIGHT = 300.0
"""Distance from the ego vehicle [m] within which nobody comes or goes: radars and lidars do not reach so far, and in a
camera of 60 deg and 1,280 columns a car is 6 pixels high."""


def traffic_seed(spec: ScenarioSpec) -> int:
    """Return the seed of a scenario's traffic."""
    if spec.traffic is not None and spec.traffic.seed is not None:
        return spec.traffic.seed
    return spec.seed if spec.randomization.traffic else 0


def traffic_of(
    spec: ScenarioSpec, own: Sequence[Member], document: SceneDocument, setting: Setting
) -> tuple[Member, ...]:
    """Return the traffic of a scenario.

    Parameters
    ----------
    spec : ScenarioSpec
    own : sequence of Member
        The ego vehicle and the actors: traffic follows them and gives way.
    document : SceneDocument
        The scene, with those of its own actors that stay.
    setting : Setting

    Raises
    ------
    ScenarioError
        If the scene has no lanes, a model is unknown, or the file cannot be used; at the line of the traffic.
    """
    if spec.traffic is None:
        return ()
    try:
        planned = _planned(spec, spec.traffic, own, document, setting)
        present = [actor for actor in planned if actor.active[0] < actor.active[1]]
        if spec.traffic.source in ("built_in", "sumo") and not spec.traffic.open_ends:
            present = _without_gaps(present, _looker(own, document), setting)
        ego = _looker(own, document) if spec.traffic.actors is not None else None
        return tuple(_member(spec, actor, number, ego, setting) for number, actor in enumerate(present))
    except UnknownNameError as error:
        where = ("sequence",) if error.kind == "sequence" else ("mix", error.name)
        raise name_error(error, spec.place(*PATH_OF_TRAFFIC, *where)) from error
    except ScenarioError:
        raise
    except (InputFileError, TrajectoryFileError) as error:
        raise ScenarioFileError(str(error), spec.place(*PATH_OF_TRAFFIC, "file"), value=spec.traffic.file) from error
    except ParameterRangeError as error:
        raise ScenarioValueError(str(error), spec.place(*PATH_OF_TRAFFIC), value=error.value) from error


def with_signals_of(spec: ScenarioSpec, document: SceneDocument, setting: Setting) -> SceneDocument:
    """Return the scene with lights that follow the storyboard, where the traffic is that of one."""
    if spec.traffic is None or spec.traffic.source != "openscenario":
        return document
    from .openscenario.drive import read_drive
    from .openscenario.lights import with_signals

    return with_signals(document, read_drive(_file(spec, spec.traffic), setting.street).run.signals)


def _planned(
    spec: ScenarioSpec, traffic: TrafficSpec, own: Sequence[Member], document: SceneDocument, setting: Setting
) -> list[PlannedActor]:
    source, start = traffic.source, setting.first
    if setting.network is None and (source == "built_in" or traffic.file is None):
        raise ScenarioValueError(
            f"needs lanes, and scene '{spec.scene}' has none", spec.place(*PATH_OF_TRAFFIC), "choose a scene with lanes"
        )
    given: list[tuple[Trajectory, BodyLike]] = [(member.actor.trajectory, member.body) for member in own]
    given += [(trajectory, body_of_entry(entry)) for entry, trajectory in moving_of(document)]
    traffic, span = traffic.with_(seed=traffic_seed(spec)), (start, setting.last + MARGIN)
    if source == "built_in":
        assert setting.network is not None
        if traffic.actors is not None:
            return crowd(setting.network, traffic, span, given, _looker(own, document))
        return simulate_traffic(setting.network, traffic, span, others=given)
    if source == "sumo":
        lanes = setting.network if traffic.file is None else _file(spec, traffic)
        assert lanes is not None
        return _apart(run_sumo(lanes, span, traffic, conversion=Conversion(setting.network)), given, setting)
    file = _file(spec, traffic)
    taken = _driven_by(spec, file)
    if source == "openscenario":
        from .openscenario.actors import actor_name, planned_actors
        from .openscenario.drive import read_drive

        drive = read_drive(file, setting.street)
        _check_overlap(spec, traffic, (0.0, drive.run.stop), setting)
        found = planned_actors(drive, span)
        taken = {None if one is None else actor_name(one) for one in taken | ({drive.hero} if HOST in taken else set())}
        found += _swarms(spec, drive, found, setting)
    elif source == "osi":
        start, stop, host = about_trace(file)
        _check_overlap(spec, traffic, (start, stop), setting)
        found = read_osi(file, span=span, conversion=Conversion(setting.network))
        taken |= {host} if HOST in taken else set()
    elif source == "nuscenes":
        start, stop, names = about_scene(file, traffic.sequence)
        _check_overlap(spec, traffic, (start, stop), setting)
        found = read_nuscenes(file, traffic.sequence, span=span, conversion=Conversion(setting.network))
        still = {entry.name for entry in document.instances}  # what the scene has, a run of ours in it recorded, too
        taken |= {name for name, own in names.items() if own is not None and own in still}
    else:
        reader = read_fcd if source == "fcd" else read_commonroad
        found = reader(file, span=span, ground=setting.network)
    return [actor for actor in found if actor.name not in taken]


def _swarms(
    spec: ScenarioSpec,
    drive: Drive,
    entities: Sequence[PlannedActor],
    setting: Setting,
) -> list[PlannedActor]:
    """Return the vehicles of the swarms of a storyboard, which follow its entities and each other."""
    from .openscenario.actors import actor_name
    from .openscenario.swarm import swarm_actors

    found: list[PlannedActor] = []
    known: dict[str, tuple[Trajectory, BodyLike]] = {one.name: (one.trajectory, one.body) for one in entities}
    for number, swarm in enumerate(drive.run.swarms):
        if setting.network is None or actor_name(swarm.central) not in known:
            raise swarm.node.error("needs a map with lanes, and a central entity that has a model")
        others = {**known, **{one.name: (one.trajectory, one.body) for one in found}}
        span, seed = (setting.first, setting.last + MARGIN), traffic_seed(spec) + number
        central = replace(swarm, central=actor_name(swarm.central))
        found += swarm_actors(central, setting.network, span, others, seed, f"swarm{number or ''}")
    return found


def _driven_by(spec: ScenarioSpec, file: Path) -> set[str | None]:
    """Return who of a file is the ego vehicle or an actor already, by a `table` of the same file."""
    stated = [(EGO, spec.ego.trajectory)] if spec.ego is not None else []
    stated += [(actor.name, actor.trajectory) for actor in spec.actors]
    return {
        motion.id or name
        for name, motion in stated
        if isinstance(motion, TableSpec) and spec.find(motion.file).resolve() == file.resolve()
    }


def _check_overlap(spec: ScenarioSpec, traffic: TrafficSpec, known: tuple[float, float], setting: Setting) -> None:
    """Raise if a file is of none of the frames' times: its clock is another one."""
    start, stop = known
    if start <= setting.last and setting.first <= stop:
        return
    raise ScenarioTimeError(
        f"'{traffic.file}' is of {start:.12g} to {stop:.12g} s, the frames are at {setting.first:.12g} to "
        f"{setting.last:.12g} s",
        spec.place(*PATH_OF_TRAFFIC, "file"),
        f"set start_time: {start:.12g}",
        value=traffic.file,
        time=setting.first,
        start=start,
        stop=stop,
    )


def _looker(own: Sequence[Member], document: SceneDocument) -> Trajectory | None:
    """Return the motion of the ego vehicle, the scenario's or the scene's."""
    motions = {entry.name: trajectory for entry, trajectory in moving_of(document)}
    motions |= {member.actor.name: member.actor.trajectory for member in own}
    return motions.get(EGO) or motions.get(document.ego or EGO)


def _without_gaps(planned: list[PlannedActor], ego: Trajectory | None, setting: Setting) -> list[PlannedActor]:
    """Return the traffic without those that come or go where the ego vehicle may see it."""
    if ego is None:
        return planned
    first, last = setting.first, setting.last + MARGIN

    def is_seen(actor: PlannedActor, time: float) -> bool:
        if not first < time < last:
            return False
        way = actor.trajectory.pose(time).position - ego.pose(min(max(time, ego.start), ego.stop)).position
        return float(np.linalg.norm(way)) < SIGHT

    kept = [actor for actor in planned if not any(is_seen(actor, time) for time in actor.active)]
    if len(kept) < 2.0 * len(planned) / 3.0:
        warnings.warn(
            f"{len(planned) - len(kept)} of {len(planned)} in the traffic come or go at ends of streets within "
            f"{SIGHT:g} m of the ego vehicle and are left out; a shorter scenario keeps more of them, and "
            "`open_ends: true` lets them appear and vanish",
            ScarlWarning,
            stacklevel=2,
        )
    return kept


def _file(spec: ScenarioSpec, traffic: TrafficSpec) -> Path:
    path = spec.find(str(traffic.file))
    if not (path.is_dir() if traffic.source == "nuscenes" else path.is_file()):
        raise ScenarioFileError(
            f"'{traffic.file}' is not there", spec.place(*PATH_OF_TRAFFIC, "file"), value=traffic.file
        )
    return path


def _apart(
    planned: list[PlannedActor], given: Sequence[tuple[Trajectory, BodyLike]], setting: Setting
) -> list[PlannedActor]:
    """Return the traffic without those that meet the ego vehicle or an actor: SUMO does not know of these."""
    times = np.arange(setting.first, setting.last + STEP / 2.0, STEP)
    bodies = [(f"given {number}", trajectory, body) for number, (trajectory, body) in enumerate(given)]
    hits = find_collisions([*bodies, *((one.name, one.trajectory, one.body) for one in planned)], times)
    fixed = {name for name, _, _ in bodies}
    met = {hit.second for hit in hits if hit.first in fixed and hit.second not in fixed}
    if met:
        warnings.warn(
            f"{len(met)} of {len(planned)} vehicles of SUMO meet an actor of the "
            f"scenario and are left out: {', '.join(sorted(met)[:5])}",
            ScarlWarning,
            stacklevel=2,
        )
    return [one for one in planned if one.name not in met]


def _member(spec: ScenarioSpec, planned: PlannedActor, number: int, ego: Trajectory | None, setting: Setting) -> Member:
    """Return one of the traffic; with an ego vehicle, one that stays far from it has the light level of geometry."""
    model = read_actor_model(planned.model)
    variant = planned.variant
    colors: dict[str, Color] = {}
    if spec.randomization.colors:
        variant, colors = draw_look(spec.seed, planned.name, model.variants, model.motion)
    trajectory: Trajectory = planned.trajectory
    if planned.active[0] > trajectory.start or planned.active[1] < trajectory.stop:
        trajectory = PresentTrajectory(trajectory, planned.active, DEPTH + BETWEEN * number)
    actor = StagedActor(
        planned.name,
        model,
        trajectory,
        detail=spec.detail if is_close(trajectory, ego, (setting.first, setting.last), model.motion) else "light",
        variant=variant,
        colors=colors or None,
        phase=planned.phase,
    )
    return Member(PATH_OF_TRAFFIC, actor)
