"""The traffic of a scenario as members of its cast: simulated here, by SUMO, or read from a file."""

from __future__ import annotations

from collections.abc import Sequence

from scarl_sionna.core.errors import ParameterRangeError, ScenarioValueError, UnknownNameError
from scarl_sionna.world.actor_model import Color, read_actor_model
from scarl_sionna.world.document import SceneDocument
from scarl_sionna.world.motion import Trajectory
from scarl_sionna.world.staging import StagedActor

from .bodies import BodyLike
from .cast import Member
from .checks import body_of_entry, moving_of
from .motions import MARGIN, Setting
from .randomize import draw_look
from .spec import ScenarioSpec
from .spec_actors import TrafficSpec
from .spec_light import name_error
from .traffic import PlannedActor, simulate_traffic

PATH = ("traffic",)


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
        return tuple(_member(spec, actor) for actor in planned if actor.active[0] < actor.active[1])
    except UnknownNameError as error:
        raise name_error(error, spec.place(*PATH, "mix", error.name)) from error
    except ParameterRangeError as error:
        raise ScenarioValueError(str(error), spec.place(*PATH), value=error.value) from error


def _planned(
    spec: ScenarioSpec, traffic: TrafficSpec, own: Sequence[Member], document: SceneDocument, setting: Setting
) -> list[PlannedActor]:
    if setting.network is None:
        raise ScenarioValueError(
            f"needs lanes, and scene '{spec.scene}' has none", spec.place(*PATH), "choose a scene with lanes"
        )
    others: list[tuple[Trajectory, BodyLike]] = [(member.actor.trajectory, member.body) for member in own]
    others += [(trajectory, body_of_entry(entry)) for entry, trajectory in moving_of(document)]
    start = setting.start
    return simulate_traffic(
        setting.network, traffic.density, traffic.mix, setting.last + MARGIN - start, traffic_seed(spec),
        pedestrians=traffic.pedestrians, cyclists=traffic.cyclists, parked=traffic.parked, others=others, start_time=start,
    )  # fmt: skip


def _member(spec: ScenarioSpec, planned: PlannedActor) -> Member:
    model = read_actor_model(planned.model)
    variant = planned.variant
    colors: dict[str, Color] = {}
    if spec.randomization.colors:
        variant, colors = draw_look(spec.seed, planned.name, model.variants, model.motion)
    actor = StagedActor(
        planned.name,
        model,
        planned.trajectory,
        detail=spec.detail,
        variant=variant,
        colors=colors or None,
        phase=planned.phase,
    )
    return Member(PATH, actor)
