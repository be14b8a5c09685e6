"""``method="auto"``: chooses for each object who computes it and how finely, by the rules of docs/accuracy.md."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.core.settings.plan import ChannelPlan, Share
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.sbr import SMALLEST_SIZE, SbrSettings
from scarl_sionna.core.settings.scatterers import ScattererSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.channel.antennas import refuse_receiver
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.scatterers.model import ScattererModel, loaded_models

from .budget import LONG, Estimate, estimate, num_tubes, own_bounces
from .hybrid import solve_hybrid
from .mirrors import Mirror, find_mirrors

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

TOO_NEAR = 1.0
"""What stands nearer than this [m] is the carrier of the radar, or fills its view: left to `raycast`."""
MIRROR_CLASSES = ("Roads", "SideWalks", "Ground", "Water", "Wall", "Building", "Bridge")
"""Classes whose large flat faces act as mirrors."""
SMALLEST_MIRROR = 1.0
"""Narrower faces [m] are no mirrors for `auto`."""
VEHICLES = ("Car", "Truck", "Bus", "Train", "Motorcycle", "Bicycle")
"""Classes whose further bounces are weak, by the chart of the car: the tolerance limits their number."""
KNOBS = ((2.0, 2.0, 0.1, 2), (1.0, 1.0, 0.05, 2), (0.2, 0.4, 0.02, 3), (0.0, 0.2, 0.01, 3))
"""Tolerance from which it holds [dB], max_phase [rad], integration_phase [rad], bounces of `sbr` on a vehicle at most."""


@dataclass
class _Choice:
    """What becomes of one instance."""

    item: Estimate
    method: str
    reason: str
    settings: SbrSettings | None = None
    tubes: int = 0
    through_mirrors: bool = False


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
        Its `accuracy` (tolerance, floor and budget), `max_distance` (the unambiguous range if None), `scatterers` (models of
        objects that have them) and `raycast` (for what falls to it).
    receiver : Mount, optional
        Refused: this solver is monostatic.

    Returns
    -------
    RadarPaths
        ``diagnostics["choices"]`` says for every instance in view who computes it and why, ``diagnostics["left_out"]`` what is
        not computed and how much power it can hold.

    Raises
    ------
    PlacementError
        If the radar or one of its antennas is inside a mesh.
    MaterialRangeError
        If a material that is met has no data at the carrier frequency.
    ParameterRangeError
        If a receiver is given.
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
    state: WorldState, radar: RadarSpec, mount: Mount | Pose, *, settings: RadarSettings | None = None, **fields: Any
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
        asked = self.settings.max_distance
        return self.radar.max_range if asked is None else asked


def _choose(view: _View) -> tuple[list[_Choice], tuple[int, ...], bool]:
    """Return what becomes of each instance, the mirrors, and whether one of them faces the radar."""
    state, radar, pose, reach = view.state, view.radar, view.pose, view.reach
    items = [estimate(state, radar, pose, number, reach) for number in state.world.instances]
    items.sort(key=lambda item: (item.info.actor is None, -item.expected_db, item.number))
    budget = view.settings.accuracy.tube_budget
    mirrors = _mirrors(state, radar, pose, items)
    flat = {int(state.world.parts.instance[mirror.part]) for mirror in mirrors}
    seen = [item.number for item in items if item.in_view and item.is_coherent and item.info.is_object]
    bounces = own_bounces(state, pose, [number for number in seen if number not in flat])
    choices = []
    for item in items:
        choice = _one(view, item, flat, bounces)
        if choice.method == "sbr":
            choice = _within(choice, radar, budget)
            budget -= choice.tubes
        choices.append(choice)
    pairs = (len(mirrors) + 1) * (len(mirrors) + 2) // 2 - 1  # of a way there and a way back, but for the straight one
    for choice in choices if mirrors else ():
        if choice.method == "scatterers" or (choice.method == "sbr" and pairs * choice.tubes <= budget):
            choice.through_mirrors = True
            budget -= pairs * choice.tubes
    echoes = _faces_radar(mirrors, radar, pose, reach)
    needed = echoes or any(choice.through_mirrors for choice in choices)
    return choices, tuple(sorted(flat)) if needed else (), echoes


def _within(choice: _Choice, radar: RadarSpec, budget: int) -> _Choice:
    """Return the choice, a vehicle's with one bounce only, or given to `raycast`, where it would cost more than is left."""
    if choice.tubes <= budget or choice.settings is None:
        return choice
    tubes = choice.tubes
    if choice.item.info.actor is not None:
        single = choice.settings.with_(max_depth=1)
        tubes = num_tubes(choice.item, radar, single)
        if tubes <= budget:
            return _Choice(choice.item, "sbr", "one bounce only, for the budget", single, tubes)
    return _Choice(choice.item, "raycast", f"{tubes} tubes are over the budget of {budget} that is left: RCS by class")


def _one(view: _View, item: Estimate, flat: set[int], bounces: Mapping[int, int]) -> _Choice:
    """Return what becomes of an instance before the budget is asked; `flat` are the mirrors, `bounces` those on itself."""
    accuracy = view.settings.accuracy
    semantic = SEMANTIC_CLASSES[item.info.semantic]
    if not item.in_view:
        return _Choice(item, "out of view", "out of the field of view or of range")
    if item.bound_db < accuracy.channel_floor_db:
        return _Choice(item, "left out", f"at most {item.bound_db:.0f} dB from the noise of a cell")
    if item.distance < TOO_NEAR:
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
    if item.size < SMALLEST_SIZE * view.radar.wavelength:
        return _Choice(item, "raycast", f"smaller than {SMALLEST_SIZE:g} wavelengths: RCS by class")
    settings = sbr_settings(accuracy.channel_tolerance_db)
    depth = bounces[item.number]
    if semantic in VEHICLES:
        depth = min(depth, settings.max_depth)
    elif item.size > LONG:  # probes are too far apart there, and it sees itself along its length
        depth = settings.max_depth
    settings = settings.with_(max_depth=depth)
    return _Choice(item, "sbr", "coherent body", settings, num_tubes(item, view.radar, settings))


def sbr_settings(tolerance_db: float) -> SbrSettings:
    """Return the knobs of `sbr` for a tolerance, by the charts of docs/accuracy.md."""
    _, max_phase, integration_phase, depth = next(row for row in KNOBS if tolerance_db >= row[0])
    return SbrSettings(max_phase=max_phase, integration_phase=integration_phase, max_depth=depth)


def _toward(state: WorldState, item: Estimate, pose: Pose) -> np.ndarray:
    """Return the direction from an object to the radar, in its own frame."""
    info = item.info
    body = Pose() if info.actor is None else state.actor_pose(info.actor)
    offset = body.inverse().apply(pose.position) - info.frame_from_box.position
    return np.asarray(offset / max(float(np.linalg.norm(offset)), 1e-9))


def _mirrors(state: WorldState, radar: RadarSpec, pose: Pose, items: list[Estimate]) -> list[Mirror]:
    chosen = [
        item.number for item in items
        if item.in_view and item.info.actor is None and SEMANTIC_CLASSES[item.info.semantic] in MIRROR_CLASSES
        and float(np.sort(item.info.size)[1]) > SMALLEST_MIRROR
    ]  # fmt: skip
    if not chosen:
        return []
    found = find_mirrors(state, chosen, pose.position, radar.wavelength)
    return [mirror for mirror in found if mirror.extent > SMALLEST_MIRROR]


def _faces_radar(mirrors: list[Mirror], radar: RadarSpec, pose: Pose, reach: float) -> bool:
    """Return whether the foot of the perpendicular from the radar is on a mirror and in view, so that it echoes."""
    for mirror in mirrors:
        height = float(mirror.height(pose.position))
        x, y, z = (-height * mirror.normal) @ pose.rotation
        inside = abs(np.degrees(np.arctan2(y, x))) <= radar.azimuth_fov_deg / 2.0
        inside &= abs(np.degrees(np.arctan2(z, np.hypot(x, y)))) <= radar.elevation_fov_deg / 2.0
        if inside and abs(height) < reach and mirror.near(pose.position - height * mirror.normal, 0.1 * mirror.extent):
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
        "instance": item.name, "method": choice.method, "reason": choice.reason, "distance": round(item.distance, 3),
        "bound_to_noise_db": round(item.bound_db, 1), "expected_to_noise_db": round(item.expected_db, 1),
        "tubes": choice.tubes,
    }  # fmt: skip
