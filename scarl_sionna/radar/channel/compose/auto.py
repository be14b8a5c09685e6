"""``method="auto"``: chooses for each object who computes it and how finely, by the rules of docs/accuracy.md."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.auto import SbrLevel
from scarl_sionna.core.settings.plan import ChannelPlan, Reflection, Share
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.reads import refuse_unread
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.channel.antennas import refuse_receiver
from scarl_sionna.radar.channel.sbr.cost import SolveCost
from scarl_sionna.radar.optics.viewpoint import Viewpoint
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.scatterers.model import loaded_models

from .budget import affordable_tubes
from .choose import Chosen, View, choose, expected_error, expected_seconds, level_of
from .hybrid import solve_hybrid
from .left_out.entries import beyond_last_bounce, left_out
from .mirror_chains import possible_chains
from .mirrors import Mirror, mirrored
from .reflections import as_found
from .spend import Choice
from .verify import Verified, first_level, met, verified

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState


def solve_auto(
    state: WorldState, radar: RadarSpec, mount: Mount, settings: RadarSettings, receiver: Mount | None = None
) -> RadarPaths:
    """Return the paths by the method that suits each object.

    Parameters
    ----------
    state : WorldState
    radar : RadarSpec
    mount : Mount
        Pose and velocity of the radar.
    settings : RadarSettings
        Its `accuracy` (tolerance, floor and budget), `auto` (the rules), `max_distance` (the unambiguous range if
        None), `mirrors`, `scatterers` (models of objects that have them) and `raycast` (for what falls to it).
    receiver : Mount, optional
        Refused: this solver is monostatic.

    Returns
    -------
    RadarPaths
        ``diagnostics["choices"]`` says for every instance in view who computes it and why, over which mirrors, what
        error is expected, and by how much a reflection that is left out can change it [dB]; ``diagnostics["met"]``
        whether 90 % of the objects that can be detected are expected to keep the tolerance, and
        ``diagnostics["expected_error_db"]`` what they keep; ``diagnostics["num_by_class"]`` how many of the
        ``"num_counted"`` have the RCS of their class, since the budget does not pay for them;
        ``diagnostics["level_db"]`` the tolerance of the level that was taken, a coarser one where the budget does not
        pay for that asked for, ``["first_level_db"]`` that of the first solve; ``diagnostics["num_refined"]`` how many
        objects were then computed at a finer level (their paths come last), ``["num_looked_at"]`` the same number;
        ``diagnostics["left_out"]`` what is not computed, why, and how much power it can hold: a bound or an estimate
        over the noise of a cell [dB], docs/accuracy.md.

    Raises
    ------
    PlacementError
        If the radar or one of its antennas is inside a mesh.
    MaterialRangeError
        If a material that is met has no data in the middle of the band.
    ParameterRangeError
        If a receiver is given, or the tolerance is finer than the finest level of `auto`.

    Warns
    -----
    ScarlWarning
        If the tolerance is not expected to be kept, or objects are computed without reflections that can change their
        echo by more than it.
    """
    refuse_receiver("auto", receiver)
    start = time.perf_counter()
    view, chosen, plan = _planned(state, radar, mount, settings)
    choices = chosen.choices
    planned = time.perf_counter() - start
    level = first_level(view, chosen)
    first = replace(plan, shares=tuple(_at_level(view, share, level) for share in plan.shares))
    paths = solve_hybrid(state, radar, mount, settings.with_(plan=first))
    plan, paths = as_found(plan, paths, radar, view.least_change_db)
    again = verified(view, chosen, plan, paths)
    paths = again.paths
    kept = met(choices, again.errors, view, again.levels)
    _warn([_missed(kept, chosen, view), _without_reflections(choices, view)])
    diagnostics = dict(paths.diagnostics)
    diagnostics |= {
        "method": "auto",
        "plan": replace(first, shares=tuple(_at_level(view, share, level) for share in plan.shares)).to_dict("python"),
        "tolerance_db": settings.accuracy.channel_tolerance_db,
        "level_db": chosen.level.tolerance_db,
        "first_level_db": level.tolerance_db,
        **kept,
        **again.diagnostics,
        "predicted": dict(plan.predicted),
        "left_out": [*diagnostics["left_out"], *beyond_last_bounce(view, paths, _by_sbr(choices), chosen.level)],
        "choices": [_row(choice, view, again) for choice in choices if choice.method != "out of view"],
        "num_out_of_view": sum(choice.method == "out of view" for choice in choices),
        "seconds": {"plan": planned, **diagnostics["seconds"], "second look": again.seconds},
    }
    return replace(paths, diagnostics=diagnostics)


def plan_channel(
    state: WorldState, radar: RadarSpec, mount: Mount | Pose, *, settings: RadarSettings | None = None, **fields: object
) -> ChannelPlan:
    """Return the plan that ``method="auto"`` follows, to look at or to change before ``method="hybrid"``.

    Parameters
    ----------
    state : WorldState
    radar : RadarSpec
    mount : Mount or Pose
    settings : RadarSettings, optional
    **fields
        Fields of the settings, as in :func:`scarl_sionna.solve_paths`.

    Raises
    ------
    ParameterRangeError
        If a field has no effect with ``method="auto"``.
    """
    refuse_unread("auto", fields)
    view, chosen, plan = _planned(
        state, radar, Mount.of(mount), (settings or RadarSettings()).changed("auto", **fields)
    )
    _warn([_without_reflections(chosen.choices, view)])
    return plan


def _planned(
    state: WorldState, radar: RadarSpec, mount: Mount, settings: RadarSettings
) -> tuple[View, Chosen, ChannelPlan]:
    """Return what is planned for, what becomes of each instance, and the plan of it."""
    level_of(settings.accuracy.channel_tolerance_db, settings.auto)  # refuses a tolerance that is too fine
    view = View(state, radar, mount, settings, loaded_models(settings.scatterers.models))
    chosen = choose(view)
    return view, chosen, _plan(view, chosen)


def _warn(texts: Sequence[str]) -> None:
    """Warn once of all that a budget does not pay for, if there is anything; a remedy is not said twice."""
    if any(texts):
        said = dict.fromkeys("; ".join(text for text in texts if text).split("; "))
        warnings.warn(f"{'; '.join(said)}; diagnostics['choices'] has each object", ScarlWarning, stacklevel=3)


def _without_reflections(choices: list[Choice], view: View) -> str:
    """Return what is to be said of coherent objects whose ground bounce, or reflection elsewhere, is not computed."""
    coherent = [choice for choice in choices if choice.method in ("sbr", "scatterers") and choice.item.in_view]
    tolerance = view.settings.accuracy.channel_tolerance_db
    without = [
        (choice.without, choice.item.name)
        for choice in coherent
        if choice.without is not None and choice.without.change_db > tolerance
    ]
    if not without:
        return ""
    change, name = max(without, key=lambda pair: pair[0].change_db)
    mirror = view.state.world.instances[view.instance(change.mirror)].name
    most = f"by up to {change.change_db:.1f} dB" if np.isfinite(change.change_db) else "which alone shows it"
    return (
        f"{len(without)} of {len(coherent)} objects are computed without reflections (ground bounce, walls) that can "
        f"change their echo by more than the tolerance of {tolerance:g} dB, most of "
        f"all '{name}' over '{mirror}', {most}: the tube budget does not pay for them; raise "
        f"Accuracy.{affordable_tubes(view.settings.accuracy, view.rules)[1]}"
    )


def _missed(kept: Mapping[str, Any], chosen: Chosen, view: View) -> str:
    """Return what is to be said of a tolerance that is not expected to be kept, and what the budget does not pay."""
    if kept["met"]:
        return ""
    accuracy, rules = view.settings.accuracy, view.rules
    tolerance, level = accuracy.channel_tolerance_db, chosen.level.tolerance_db
    tubes, budget = affordable_tubes(accuracy, rules)
    short = []
    if kept["num_by_class"]:
        short.append(f"{kept['num_by_class']} of them have the RCS of their class, {rules.errors.by_class_db:g} dB")
    if level > tolerance and kept["num_by_class"] < kept["num_counted"]:
        short.append(f"the others are computed at the level of {level:g} dB")
    reason = f"a budget of {tubes} tubes pays for no more: {', '.join(short)}; " if short else ""
    if short:
        remedy = f"raise Accuracy.{budget}"
    elif chosen.level == rules.levels[-1]:
        remedy = "no finer level is tested: give those with the largest expected error to 'sbr' with your own settings"
    else:
        remedy = "ask for a finer one"
    return (
        f"the echo of 90 % of the {kept['num_counted']} objects that can be detected is expected to be within "
        f"{_above(kept['expected_error_db'], tolerance)} dB, the tolerance is {tolerance:g} dB; {reason}{remedy}"
    )


def _above(value: float, limit: float) -> str:
    """Return a number that is over a limit with as many decimals as show it, at least one, at most two."""
    short = f"{value:.1f}"
    return short if float(short) > limit else f"{value:.2f}"


def _plan(view: View, chosen: Chosen) -> ChannelPlan:
    choices, echoing = chosen.choices, _echoing(view)
    shares = []
    for solver, reason in (("sbr", "coherent bodies within the budget"), ("scatterers", "objects with a model")):
        own = [choice for choice in choices if choice.method == solver]
        if not own:
            continue
        settings: Spec = view.knobs(chosen.level)
        if solver == "scatterers":
            models = {choice.item.name: view.models[choice.item.name] for choice in own}
            settings = view.settings.scatterers.with_(models=models)
        numbers = tuple(sorted(choice.item.number for choice in own))
        shares.append(Share(solver, numbers, settings, reason=reason, reflections=_reflections(view, own)))
    rest = tuple(sorted(choice.item.number for choice in choices if choice.method in ("raycast", "out of view")))
    reason = "clutter, and what is over the budget"
    shares.append(Share("raycast", rest, reason=reason, by_material=chosen.by_material))
    used = {view.instance(mirror) for choice in choices for mirror in choice.mirrors}
    used |= {view.instance(mirror) for mirror in echoing}
    tubes = sum(choice.cost for choice in choices)
    seconds = round(expected_seconds(view, chosen, first_level(view, chosen)), 2)
    memory = round(SolveCost(patches=sum(choice.patches for choice in choices)).memory_gib, 2)
    level = chosen.level.tolerance_db
    error = round(expected_error(chosen, view.rules), 2)
    predicted = {"tubes": float(tubes), "cpu_seconds": seconds, "memory_gib": memory, "tolerance_db": level}
    predicted["expected_error_db"] = error
    knobs = view.settings.sionna
    only_mirrors = knobs.specular and not (knobs.diffuse or knobs.refraction or knobs.diffraction)
    return ChannelPlan(
        tuple(shares),
        tuple(sorted(used)),
        bool(echoing),
        chains="images" if only_mirrors else "sionna",
        left_out=left_out(view, chosen, echoing),
        predicted=predicted,
        mirror_faces=tuple(sorted({int(mirror.faces[0]) for choice in choices for mirror in choice.mirrors})),
    )


def _at_level(view: View, share: Share, level: SbrLevel) -> Share:
    return replace(share, settings=view.knobs(level)) if share.solver == "sbr" else share


def _reflections(view: View, own: list[Choice]) -> tuple[Reflection, ...]:
    """Return objects that are seen over the same mirrors together."""
    groups: dict[tuple[int, ...], dict[int, tuple[float, ...]]] = {}
    for choice in own:
        if choice.mirrors:
            over = tuple(sorted({view.instance(mirror) for mirror in choice.mirrors}))
            weight: dict[int, float] = {}
            for change in choice.changes:
                at = view.instance(change.mirror)
                weight[at] = max(weight.get(at, 0.0), change.weight)
            groups.setdefault(over, {})[choice.item.number] = tuple(weight[at] for at in over)
    return tuple(
        Reflection(tuple(sorted(found)), over, tuple(found[number] for number in sorted(found)))
        for over, found in sorted(groups.items(), key=lambda one: min(one[1]))
    )


def _echoing(view: View) -> list[Mirror]:
    """Return mirrors from which the radar sees itself: one that faces it, or two in a corner."""
    position, station = view.pose.position, Viewpoint.of(view.radar, view.pose, np.zeros(3))
    found: dict[int, Mirror] = {}
    for way in possible_chains(view.candidates, position, 2, view.reach, view.tail):
        if bool(station.sees(mirrored(way[::-1], position)[None])[0]):
            found |= {mirror.number: mirror for mirror in way}
    return [found[number] for number in sorted(found)]


def _by_sbr(choices: list[Choice]) -> list[int]:
    return [choice.item.number for choice in choices if choice.method == "sbr"]


def _row(choice: Choice, view: View, again: Verified) -> dict[str, Any]:
    item, without, world = choice.item, choice.without, view.state.world
    error_db, difference = again.errors.get(item.number), again.differences.get(item.number)
    names = {world.instances[int(world.parts.instance[mirror.part])].name for mirror in choice.mirrors}
    at = None if without is None else world.instances[int(world.parts.instance[without.mirror.part])].name
    return {
        "instance": item.name,
        "method": choice.method,
        "reason": choice.reason,
        "distance": round(item.distance, 3),
        "visible_share": round(choice.sight.share, 3),
        "bound_to_noise_db": round(view.bound_db(item), 1),
        "expected_to_noise_db": round(item.expected_db, 1),
        "tubes": choice.cost,
        "mirrors": sorted(names),
        "without_reflection_db": None if without is None else round(min(float(without.change_db), 99.0), 1),
        "without_reflection_at": at,
        "expected_error_db": None if error_db is None else round(error_db, 2),
        "second_look_db": None if difference is None else round(difference, 2),
        "doubt_db": None if item.number not in again.doubts else round(again.doubts[item.number], 2),
        "refined": item.number in again.refined,
    }
