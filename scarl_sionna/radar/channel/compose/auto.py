"""``method="auto"``: chooses for each object who computes it and how finely, by the rules of docs/accuracy.md."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.core.settings.auto import DEFAULT_AUTO, AutoSettings
from scarl_sionna.core.settings.plan import ChannelPlan, Share
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.settings.scatterers import ScattererSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.channel.antennas import refuse_receiver
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.scatterers.model import ScattererModel, loaded_models

from .budget import Estimate, estimate, num_tubes, own_bounces, world_from_box
from .hybrid import solve_hybrid
from .mirror_bounds import MirrorChange, largest_mirror_change
from .mirrors import PRESELECTION_MARGIN, Mirror, find_mirrors

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState


@dataclass
class _Choice:
    """What becomes of one instance."""

    item: Estimate
    method: str
    reason: str
    settings: SbrSettings | None = None
    tubes: int = 0
    through_mirrors: bool = False
    without: MirrorChange | None = None
    """The reflection that is left out and can change it most, where that is by more than the tolerance."""


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
        ``diagnostics["choices"]`` says for every instance in view who computes it and why, and by how much a reflection
        that is left out can change it [dB], ``diagnostics["left_out"]``
        what is not computed and how much power it can hold.

    Raises
    ------
    PlacementError
        If the radar or one of its antennas is inside a mesh.
    MaterialRangeError
        If a material that is met has no data at the carrier frequency.
    ParameterRangeError
        If a receiver is given.

    Warns
    -----
    ScarlWarning
        If objects are computed without reflections that can change their echo by more than the tolerance.
    """
    refuse_receiver("auto", receiver)
    start = time.perf_counter()
    choices, plan = _planned(state, radar, mount.pose, settings)
    planned = time.perf_counter() - start
    paths = solve_hybrid(state, radar, mount, settings.with_(plan=plan))
    diagnostics = dict(paths.diagnostics)
    diagnostics |= {
        "method": "auto",
        "tolerance_db": settings.accuracy.channel_tolerance_db,
        "choices": [_row(choice) for choice in choices if choice.method != "out of view"],
        "num_out_of_view": sum(choice.method == "out of view" for choice in choices),
        "seconds": {"plan": planned, **diagnostics["seconds"]},
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
    """
    return _planned(state, radar, Mount.of(mount).pose, (settings or RadarSettings()).changed("auto", **fields))[1]


def _planned(
    state: WorldState, radar: RadarSpec, pose: Pose, settings: RadarSettings
) -> tuple[list[_Choice], ChannelPlan]:
    """Return what becomes of each instance, and the plan of it."""
    view = _View(state, radar, pose, settings, loaded_models(settings.scatterers.models))
    choices, mirrors, echoes = _choose(view)
    _warn_of_reflections(choices, view.settings.accuracy.channel_tolerance_db)
    return choices, _plan(choices, mirrors, echoes, settings.scatterers.with_(models=view.models))


@dataclass(frozen=True, eq=False)
class _View:
    """A radar in a scene, with what its user asks for: all that the choices depend on."""

    state: WorldState
    radar: RadarSpec
    pose: Pose
    settings: RadarSettings
    models: Mapping[str, ScattererModel]

    @property
    def reach(self) -> float:
        """Half of the longest length [m]."""
        limit = self.settings.max_distance
        return self.radar.max_range if limit is None else limit


def _choose(view: _View) -> tuple[list[_Choice], tuple[int, ...], bool]:
    """Return what becomes of each instance, the mirrors, and whether one of them faces the radar."""
    state, radar, pose, reach, rules = view.state, view.radar, view.pose, view.reach, view.settings.auto
    items = [estimate(state, radar, pose, number, reach, rules) for number in state.world.instances]
    items.sort(key=lambda item: (item.info.actor is None, -item.expected_db, item.number))
    budget = view.settings.accuracy.tube_budget
    mirrors = _mirrors(view, items)
    flat = {int(state.world.parts.instance[mirror.part]) for mirror in mirrors}
    seen = [item.number for item in items if item.in_view and item.is_coherent and item.info.is_object]
    bounces = own_bounces(state, pose, [number for number in seen if number not in flat], rules)
    choices = []
    for item in items:
        choice = _one(view, item, flat, bounces)
        if choice.method == "sbr":
            choice = _within(view, choice, budget)
            budget -= choice.tubes
        choices.append(choice)
    pairs = (len(mirrors) + 1) * (len(mirrors) + 2) // 2 - 1  # of a way there and a way back, but for the straight one
    for choice in choices if mirrors else ():
        if choice.method == "scatterers" or (choice.method == "sbr" and pairs * choice.tubes <= budget):
            choice.through_mirrors = True
            budget -= pairs * choice.tubes
    _note_reflections(view, choices, mirrors)
    echoes = _faces_radar(mirrors, radar, pose, reach)
    needed = echoes or any(choice.through_mirrors for choice in choices)
    return choices, tuple(sorted(flat)) if needed else (), echoes


def _note_reflections(view: _View, choices: list[_Choice], mirrors: list[Mirror]) -> None:
    """State for coherent objects that are computed without mirrors which reflection can change them most."""
    accuracy = view.settings.accuracy
    for choice in choices:
        if choice.method != "sbr" or choice.through_mirrors or choice.item.expected_db < accuracy.channel_floor_db:
            continue
        middle = world_from_box(view.state, choice.item.info).position
        change = largest_mirror_change(view.state, view.radar, view.pose, mirrors, middle)
        if change.change_db > accuracy.channel_tolerance_db:
            choice.without = change


def _warn_of_reflections(choices: list[_Choice], tolerance_db: float) -> None:
    """Warn of coherent objects whose ground bounce, or reflection at another mirror, is not computed."""
    coherent = [choice for choice in choices if choice.method == "sbr"]
    without = [(choice.without, choice.item.name) for choice in coherent if choice.without is not None]
    if not without:
        return
    change, name = max(without)
    warnings.warn(
        f"{len(without)} of {len(coherent)} objects are computed without reflections (ground bounce, walls) that can "
        f"change their echo by more than the tolerance of {tolerance_db:g} dB, most of all '{name}' over "
        f"'{change.instance}', by up to {change.change_db:.1f} dB: the tube budget does not pay for them; raise "
        "Accuracy.tube_budget, or see diagnostics['choices'] for each",
        ScarlWarning,
        stacklevel=2,
    )


def _within(view: _View, choice: _Choice, budget: int) -> _Choice:
    """Return the choice, over the budget left a vehicle's with one bounce only, or given to `raycast`."""
    if choice.tubes <= budget or choice.settings is None:
        return choice
    tubes = choice.tubes
    if choice.item.info.actor is not None:
        single = choice.settings.with_(max_depth=1)
        tubes = num_tubes(choice.item, view.radar, single, view.settings.auto)
        if tubes <= budget:
            return _Choice(choice.item, "sbr", "one bounce only, for the budget", single, tubes)
    return _Choice(choice.item, "raycast", f"{tubes} tubes are over the budget of {budget} that is left: RCS by class")


def _one(view: _View, item: Estimate, flat: set[int], bounces: Mapping[int, int]) -> _Choice:
    """Return what becomes of an instance before the budget counts.

    `flat` are the mirrors, `bounces` those on itself.
    """
    accuracy, rules = view.settings.accuracy, view.settings.auto
    semantic = SEMANTIC_CLASSES[item.info.semantic]
    if not item.in_view:
        return _Choice(item, "out of view", "out of the field of view or of range")
    if item.bound_db < accuracy.channel_floor_db:
        return _Choice(item, "left out", f"at most {item.bound_db:.0f} dB from the noise of a cell")
    if item.distance < rules.too_near:
        return _Choice(item, "raycast", "at the radar")
    if item.name in view.models:
        model = view.models[item.name]
        toward = _toward(view.state, item, view.pose)
        if item.distance >= model.nearest_distance and bool(model.inside(toward[None])[0]):
            return _Choice(item, "scatterers", "has a model that holds at this distance and aspect")
    if not item.is_coherent or not item.info.is_object:
        return _Choice(item, "raycast", "rough or without an outline: clutter by class")
    if item.number in flat:
        return _Choice(item, "raycast", "large flat faces: a mirror; its rough part by class")
    if item.size < rules.smallest_body * view.radar.wavelength:
        return _Choice(item, "raycast", f"smaller than {rules.smallest_body:g} wavelengths: RCS by class")
    settings = sbr_settings(accuracy.channel_tolerance_db, rules)
    depth = bounces[item.number]
    if semantic in rules.vehicle_classes:
        depth = min(depth, settings.max_depth)
    elif item.size > rules.long_object:  # probes are too far apart there, and it sees itself along its length
        depth = settings.max_depth
    settings = settings.with_(max_depth=depth)
    return _Choice(item, "sbr", "coherent body", settings, num_tubes(item, view.radar, settings, rules))


def sbr_settings(tolerance_db: float, rules: AutoSettings = DEFAULT_AUTO) -> SbrSettings:
    """Return the knobs of `sbr` for a tolerance [dB].

    By definition of the levels of `rules`, which cite the charts of docs/accuracy.md.
    """
    level = next(level for level in rules.levels if tolerance_db >= level.tolerance_db)
    return SbrSettings(
        max_phase=level.max_phase, integration_phase=level.integration_phase, max_depth=level.vehicle_bounces
    )


def _toward(state: WorldState, item: Estimate, pose: Pose) -> np.ndarray:
    """Return the direction from an object to the radar, in its own frame."""
    info = item.info
    body = Pose() if info.actor is None else state.actor_pose(info.actor)
    offset = body.inverse().apply(pose.position) - info.frame_from_box.position
    return np.asarray(offset / max(float(np.linalg.norm(offset)), 1e-9))


def _mirrors(view: _View, items: list[Estimate]) -> list[Mirror]:
    rules = view.settings.auto
    chosen = [
        item.number
        for item in items
        if item.in_view
        and item.info.actor is None
        and SEMANTIC_CLASSES[item.info.semantic] in rules.mirror_classes
        and float(np.sort(item.info.size)[1]) > rules.smallest_mirror
    ]
    if not chosen:
        return []
    found = find_mirrors(view.state, chosen, view.pose.position, view.radar.wavelength, view.settings.mirrors)
    return [mirror for mirror in found if mirror.extent > rules.smallest_mirror]


def _faces_radar(mirrors: list[Mirror], radar: RadarSpec, pose: Pose, reach: float) -> bool:
    """Return whether the foot of the perpendicular from the radar is on a mirror and in view, so that it echoes."""
    for mirror in mirrors:
        height = float(mirror.height(pose.position))
        x, y, z = (-height * mirror.normal) @ pose.rotation
        inside = abs(np.degrees(np.arctan2(y, x))) <= radar.azimuth_fov_deg / 2.0
        inside &= abs(np.degrees(np.arctan2(z, np.hypot(x, y)))) <= radar.elevation_fov_deg / 2.0
        if (
            inside
            and abs(height) < reach
            and mirror.near(pose.position - height * mirror.normal, PRESELECTION_MARGIN * mirror.extent)
        ):
            return True
    return False


def _plan(choices: list[_Choice], mirrors: tuple[int, ...], echoes: bool, scatterers: ScattererSettings) -> ChannelPlan:
    shares = []
    groups: dict[tuple[bool, SbrSettings], list[int]] = {}
    for choice in choices:
        if choice.settings is not None:
            groups.setdefault((choice.through_mirrors, choice.settings), []).append(choice.item.number)
    for (through, settings), numbers in sorted(groups.items(), key=lambda group: min(group[1])):
        shares.append(Share("sbr", tuple(sorted(numbers)), settings, through, "coherent bodies within the budget"))
    named = [choice.item for choice in choices if choice.method == "scatterers"]
    if named:
        own = scatterers.with_(models={item.name: scatterers.models[item.name] for item in named})
        with_model = tuple(sorted(item.number for item in named))
        shares.append(Share("scatterers", with_model, own, bool(mirrors), "objects with a model"))
    rest = tuple(sorted(choice.item.number for choice in choices if choice.method in ("raycast", "out of view")))
    shares.append(Share("raycast", rest, reason="clutter, and what is over the budget"))
    left_out = tuple(
        {"instance": choice.item.name, "reason": choice.reason, "bound_to_noise_db": round(choice.item.bound_db, 1)}
        for choice in choices
        if choice.method == "left out"
    )
    return ChannelPlan(tuple(shares), mirrors, echoes, left_out=left_out)


def _row(choice: _Choice) -> dict[str, Any]:
    item = choice.item
    return {
        "instance": item.name,
        "method": choice.method,
        "reason": choice.reason,
        "distance": round(item.distance, 3),
        "bound_to_noise_db": round(item.bound_db, 1),
        "expected_to_noise_db": round(item.expected_db, 1),
        "tubes": choice.tubes,
        "without_reflection_db": None if choice.without is None else round(choice.without.change_db, 1),
        "without_reflection_at": None if choice.without is None else choice.without.instance,
    }
