"""Which object ``method="auto"`` gives to whom: what is seen, how strong it is, what it costs (docs/accuracy.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.core.settings.auto import DEFAULT_AUTO, AutoSettings, SbrLevel
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.channel.raycast.class_rcs import is_smoother_than_class
from scarl_sionna.radar.channel.sbr.cost import patches_in
from scarl_sionna.radar.optics.faces.panes import pane_parts
from scarl_sionna.radar.optics.patches import PatchSize
from scarl_sionna.radar.optics.viewpoint import Viewpoint
from scarl_sionna.radar.scatterers.model import ScattererModel
from scarl_sionna.signal.antenna import is_crossed

from .budget import (
    Estimate,
    Estimates,
    Surface,
    SurfaceView,
    affordable_tubes,
    box_points,
    num_tubes,
    sbr_settings,
    surface_distance,
)
from .expected_error import error_db
from .left_out.reach import Boxes, Looker, MirrorWays, Reach
from .mirror_legs import MirrorView
from .mirrors import Mirror, faces_towards, find_mirrors, flat_parts
from .reflections import changes, sights
from .spend import Choice, num_pairs, num_ways, spend

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState


ENOUGH = 0.9
"""Share of the objects that must be within the tolerance for a solve to have met it: by definition of the tolerance."""
AT_RADAR = "at the radar"
"""Why `raycast` has what carries the radar or fills its view."""
_LEAST_DB = 1e-6
"""Of changes that count [dB]: a guard against a limit of nothing."""


@dataclass(frozen=True, eq=False)
class View:
    """A radar in a scene, with what its user asks for: all that the choices depend on."""

    state: WorldState
    radar: RadarSpec
    mount: Mount
    settings: RadarSettings
    models: Mapping[str, ScattererModel]

    @property
    def pose(self) -> Pose:
        """world_from_radar."""
        return self.mount.pose

    @cached_property
    def rules(self) -> AutoSettings:
        """The numbers that decide, of a class the error of what the radar hears."""
        rules = self.settings.auto
        if not is_crossed(self.radar.array):
            return rules
        return rules.with_(errors=rules.errors.with_(by_class_db=rules.errors.by_class_crossed_db))

    @property
    def reach(self) -> float:
        """Half of the longest length [m]."""
        limit = self.settings.max_distance
        return self.radar.max_range if limit is None else limit

    @property
    def least_change_db(self) -> float:
        """Change of an echo from which on a reflection counts [dB]."""
        return max(min(self.settings.accuracy.channel_tolerance_db, self.rules.smallest_change_db), _LEAST_DB)

    @cached_property
    def items(self) -> list[Estimate]:
        """All instances, road users first, then the strongest by class."""
        estimates = Estimates(self.state, self.radar, self.pose, self.reach, self.rules)
        found = [estimates.of(number) for number in self.state.world.instances]
        return sorted(found, key=lambda item: (item.info.actor is None, -item.expected_db, item.number))

    @cached_property
    def candidates(self) -> list[Mirror]:
        """Large flat static faces: the largest, and the largest of those over which a way leads to something."""
        rules = self.rules
        chosen = [
            item.number
            for item in self.items
            if item.distance < self.reach
            and item.info.actor is None
            and SEMANTIC_CLASSES[item.info.semantic] in rules.mirror_classes
            and float(np.sort(item.info.size)[1]) > rules.smallest_mirror
        ]
        if not chosen:
            return []
        knobs, place = self.settings.mirrors.with_(max_mirrors=rules.mirror_candidates), self.pose.position
        largest = find_mirrors(self.state, chosen, place, self.radar.wavelength, knobs)
        found = largest
        if len(largest) == rules.mirror_candidates:
            flat = {self.instance(mirror) for mirror in largest}  # what has none of these is a body, not a mirror
            served = [item for item in self.items if self._is_body(item) and item.number not in flat]
            boxes = [box_points(self.state, item.number) for item in served if item.distance < self.reach]
            grounds = flat | {item.number for item in self.items if item.number in chosen and not self._is_body(item)}
            more = faces_towards(self.state, sorted(grounds), place, boxes, self.tail, rules.mirror_candidates)
            found = find_mirrors(self.state, chosen, place, self.radar.wavelength, knobs, more)
        wide = [mirror for mirror in found if mirror.extent > rules.smallest_mirror]
        return [replace(mirror, number=place) for place, mirror in enumerate(wide)]

    def _is_body(self, item: Estimate) -> bool:
        """Return whether an item has an outline, so that mirrors show it."""
        return item.is_coherent and item.info.is_object

    @cached_property
    def _seen(self) -> dict[int, SurfaceView]:
        return {}

    @cached_property
    def _first_tubes(self) -> dict[tuple[int, float], float]:
        return {}

    def first_tubes(self, number: int, level: SbrLevel) -> float:
        """Return about how many tubes start on an instance at a level."""
        key = number, level.max_phase
        if key not in self._first_tubes:
            if number not in self._seen:
                station = Viewpoint.of(self.radar, self.pose, np.zeros(3))
                self._seen[number] = Surface.of(self.state, number).seen_from(station, self.reach)
            self._first_tubes[key] = self._seen[number].first_tubes(PatchSize.of(self.radar, self.knobs(level)))
        return self._first_tubes[key]

    def knobs(self, level: SbrLevel) -> SbrSettings:
        """Return the knobs of `sbr` at a level, with the floor of the accuracy, and `reciprocal` where it is set."""
        knobs, reciprocal = sbr_settings(level, self.settings.accuracy.channel_floor_db), self.settings.sbr.reciprocal
        return knobs if reciprocal is None else knobs.with_(reciprocal=reciprocal)

    def instance(self, mirror: Mirror) -> int:
        """Return the instance of a mirror."""
        return int(self.state.world.parts.instance[mirror.part])

    @property
    def tail(self) -> float:
        """How far beyond mirrors' ends reflections go on, in the unit of :func:`~.mirrors.beyond_ends`."""
        return self.settings.mirrors.end_reach * float(np.sqrt(self.radar.wavelength))

    @cached_property
    def looker(self) -> Looker:
        """What tells the most that objects can send back by ways over mirrors."""
        return Looker(self.state, self.radar, self.pose, self.reach, self.rules)

    @cached_property
    def boxes(self) -> Boxes:
        """Of the items, in their order."""
        return Boxes.of(self.state, self.items)

    @cached_property
    def straight(self) -> Reach:
        """The most of the items straight, in their order."""
        near = np.array([self.nearest(item) for item in self.items])
        return self.looker.straight(self.items, near)

    @cached_property
    def over_mirrors(self) -> Reach:
        """The most of the items over each candidate, in their order."""
        ways = MirrorWays.over_one(self.candidates, self.pose.position)
        return self.looker.over(ways, self.items, self.boxes, self.tail)

    @cached_property
    def _row(self) -> dict[int, int]:
        return {item.number: row for row, item in enumerate(self.items)}

    def bound_db(self, item: Estimate) -> float:
        """Return the largest power of an item over the noise of a cell [dB], of a coherent one also over mirrors."""
        if not item.is_coherent:  # `raycast` has none
            return item.bound_db
        row = self._row[item.number]
        most = float(self.straight.most[row, 0] + self.over_mirrors.most[row].sum())
        return 40.0 * float(np.log10(max(most, 1e-10)))

    @cached_property
    def _nearest(self) -> dict[int, float]:
        return {}

    def nearest(self, item: Estimate) -> float:
        """Return the distance of an item: of its box, where that is near or holds the radar of its surface [m]."""
        if item.distance >= self.too_near(item):
            return item.distance
        if item.number not in self._nearest:
            self._nearest[item.number] = surface_distance(self.state, item.number, self.pose.position)
        return max(self._nearest[item.number], item.distance)

    def too_near(self, item: Estimate) -> float:
        """Return how near an item is left to `raycast` [m]."""
        is_carrier = item.info.actor is not None and item.info.actor == self.mount.actor
        return self.rules.carrier_near if is_carrier else self.rules.too_near


def level_of(tolerance_db: float, rules: AutoSettings = DEFAULT_AUTO) -> SbrLevel:
    """Return the level of `sbr` for a tolerance [dB], by definition of the rules, which cite docs/accuracy.md.

    Raises
    ------
    ParameterRangeError
        If the tolerance is below that of the finest level: no chart says what it would take.
    """
    finest = rules.levels[-1].tolerance_db
    if tolerance_db < finest:
        raise ParameterRangeError(
            "accuracy.channel_tolerance_db",
            f"{tolerance_db:g} dB",
            f"at least {finest:g} dB, the finest that is tested",
            "method='sbr' with settings of your own has no such limit",
        )
    return next(level for level in rules.levels if tolerance_db >= level.tolerance_db)


@dataclass(frozen=True, eq=False)
class Chosen:
    """What becomes of all instances.

    Attributes
    ----------
    choices : list of Choice
    mirrors : list of Mirror
        That serve them.
    level : SbrLevel
        How finely coherent bodies are computed: that of the tolerance, or a coarser one where the budget then leaves
        less to class and without reflections.
    by_material : tuple of int
        Parts that are flat mirrors, whose rough part is that of their material.
    """

    choices: list[Choice]
    mirrors: list[Mirror]
    level: SbrLevel
    by_material: tuple[int, ...]


def choose(view: View) -> Chosen:
    """Return what becomes of each instance, the mirrors that serve it, and how finely it is computed."""
    choices = {item.number: _one(view, item) for item in view.items}
    flat = {view.instance(mirror) for mirror in view.candidates}
    for choice in choices.values():
        if choice.method == "sbr" and choice.item.number in flat:
            choice.method, choice.reason = "raycast", "large flat faces: a mirror; its rough part by class"
    by_material = _by_material(view, [choice for choice in choices.values() if choice.item.number in flat])
    coherent = [
        choice
        for choice in choices.values()
        if choice.method in ("sbr", "scatterers")
        or (
            choice.method == "out of view"
            and choice.item.is_coherent
            and choice.item.info.is_object
            and choice.item.number not in flat
        )
    ]
    mirrors = _look(view, [choice for choice in coherent if choice.item.distance < view.reach])
    for choice in coherent:
        _settle(view, choice)
    own = [choice for choice in choices.values() if choice.method in ("sbr", "scatterers")]
    finest = level_of(view.settings.accuracy.channel_tolerance_db, view.rules)
    coarser = [level for level in view.rules.levels if level.tolerance_db > finest.tolerance_db]
    level = _level_to_take(view, own, mirrors, (finest, *reversed(coarser)))
    for choice in own:
        if choice.over_budget:
            budget, _ = affordable_tubes(view.settings.accuracy, view.rules)
            text = f"{choice.tubes} tubes are more than is left of the budget of {budget}: RCS by class"
            choice.method, choice.reason, choice.tubes = "raycast", text, 0
    return Chosen(list(choices.values()), mirrors, level, by_material)


def _by_material(view: View, flat: Sequence[Choice]) -> tuple[int, ...]:
    """Return parts of mirrors with an outline whose material scatters less than their class: smooth walls of steel.

    Only of what is smooth all over, and of its parts only those that are flat: a class also stands for reveals, frames
    and gutters.
    """
    world, frequency, found = view.state.world, view.radar.center_frequency, []
    parts = flat_parts(view.state, view.candidates, view.pose.position) if flat else []
    for choice in flat:
        own, semantic = choice.item.info.parts, choice.item.info.semantic
        materials = {world.materials[world.parts.material[part]] for part in own}
        if choice.method != "raycast" or not choice.item.info.is_object or not (here := sorted(set(parts) & set(own))):
            continue
        if all(is_smoother_than_class(material, semantic, frequency) for material in materials):
            choice.reason = "large flat faces: a mirror; its rough part by its material"
            found += here
    return tuple(found)


def _level_to_take(view: View, own: list[Choice], mirrors: list[Mirror], levels: Sequence[SbrLevel]) -> SbrLevel:
    """Return the level with which the budget keeps the smallest error, the finest of equal ones; spend it so.

    Where the error that 90 % of the objects keep is the same, as of a class, the number of road users that are left to
    their class decides, then the mean error.
    """
    rules = view.rules
    accuracy = view.settings.accuracy
    budget, _ = affordable_tubes(accuracy, rules)
    patches = np.inf if accuracy.memory_budget is None else patches_in(accuracy.memory_budget)

    def error(level: SbrLevel) -> tuple[float, int, float]:
        cost = {choice.item.number: num_tubes_of(view, choice, level) for choice in own}
        spend(own, cost, {mirror.number for mirror in mirrors}, budget, patches)
        counted = [choice for choice in own if counts(choice, rules)]
        if not counted:
            return computed_error(level, rules), 0, 0.0
        typical = [_planned_error(choice, rules.errors.median * level.tolerance_db, rules) for choice in counted]
        users = sum(choice.over_budget and choice.item.info.actor is not None for choice in counted)
        return planned_error(counted, level, rules), users, float(np.mean(typical))

    best, least = levels[0], error(levels[0])
    for level in levels[1:]:
        if least[0] <= levels[0].tolerance_db or computed_error(level, rules) >= least[0]:
            break
        if (found := error(level)) < least:
            best, least = level, found
    error(best)
    return best


def counts(choice: Choice, rules: AutoSettings) -> bool:
    """Return whether an object is one of those whose error a tolerance is about; by definition."""
    item = choice.item
    return item.expected_db >= rules.counts_from_db and item.is_coherent and item.info.is_object


def planned_error(counted: Sequence[Choice], level: SbrLevel, rules: AutoSettings) -> float:
    """Return the error that enough of some objects keep by what the budget pays for [dB], at least one object."""
    errors = sorted(
        _planned_error(choice, computed_error(level, rules, choice.sight.onward), rules) for choice in counted
    )
    return errors[int(np.ceil(ENOUGH * len(errors))) - 1]


def expected_error(chosen: Chosen, rules: AutoSettings) -> float:
    """Return the error that enough of the objects that count keep by what the budget pays for [dB], 0 of none."""
    own = [choice for choice in chosen.choices if choice.method in ("sbr", "scatterers") or choice.over_budget]
    counted = [choice for choice in own if counts(choice, rules)]
    return planned_error(counted, chosen.level, rules) if counted else 0.0


def computed_error(level: SbrLevel, rules: AutoSettings, onward: float = 0.0) -> float:
    """Return the expected error of an object that is computed at a level [dB], before its paths are known.

    By the formula of the paths, patches and chains of which neither add up nor cancel, with the part `onward` of the
    power in bounces between bodies. The level's tolerance would be two to five times as much: a finer level would be
    taken that leaves out more.
    """
    return float(error_db(level, rules.errors, apart=1.0, last=0.0, ways=1.0 - onward, bounces=onward))


def _planned_error(choice: Choice, computed_db: float, rules: AutoSettings) -> float:
    """Return the error of an object by what the budget pays for [dB], from that of objects that are computed.

    A reflection that alone shows an object has no number of decibels: each counts as the class's error at most, which
    holds for objects with all their reflections.
    """
    by_class = rules.errors.by_class_db
    if choice.over_budget:
        return by_class
    return max(computed_db, 0.0 if choice.without is None else min(choice.without.change_db, by_class))


def num_tubes_of(view: View, choice: Choice, level: SbrLevel) -> int:
    """Return what a coherent object costs by one way at a level; nothing if no way leads to it."""
    item = choice.item
    if choice.method != "sbr" or (item.in_view and choice.sight.share == 0.0 and not choice.changes):
        return 0
    return num_tubes(view.first_tubes(item.number, level), choice.sight.turning, level, view.rules)


def expected_seconds(view: View, chosen: Chosen, first_level: SbrLevel) -> float:
    """Return the processor time that a solve is expected to take, planning and second look included [s].

    By :class:`.CostEstimate`; how right it is stands in docs/accuracy.md, budget. `first_level` is that of the first
    solve, which may be coarser than the one chosen.
    """
    cost = view.rules.cost
    own = [choice for choice in chosen.choices if choice.method == "sbr" and choice.cost]
    optics = cost.least * bool(own) + _seconds_at(view, own, first_level)
    if chosen.level != first_level:
        optics += cost.again * _seconds_at(view, own, chosen.level)
    cast = any(choice.method == "raycast" and choice.item.in_view for choice in chosen.choices)
    rays = view.settings.raycast.num_rays if cast else 0
    return cost.ray * rays + cost.instance * len(view.items) + optics


def _seconds_at(view: View, own: Sequence[Choice], level: SbrLevel) -> float:
    """Return what the tubes of objects are expected to take at a level, over all of their ways [s]."""
    cost = view.rules.cost
    over = {frozenset(mirror.number for mirror in choice.mirrors) for choice in own}
    pairs = sum(num_pairs(len(mirrors)) - 1 for mirrors in over)
    first = further = 0.0
    for choice in own:
        start, times = view.first_tubes(choice.item.number, level), num_ways(len(choice.mirrors))
        first += times * start
        further += times * max(num_tubes_of(view, choice, level) - start - view.rules.tubes.least, 0.0)
    further /= 1.0 + further / max(cost.most_further * first, 1.0)
    return cost.pair * pairs + cost.first * first + cost.further * further


def _one(view: View, item: Estimate) -> Choice:
    """Return what becomes of an instance before it is looked at and before the budget counts."""
    rules, floor = view.rules, view.settings.accuracy.channel_floor_db
    if not item.in_view:
        return Choice(item, "out of view", "out of the field of view or of range")
    if item.bound_db < floor and (most := view.bound_db(item)) < floor:
        return Choice(item, "left out", f"at most {most:.0f} dB from the noise of a cell")
    if view.nearest(item) < view.too_near(item):
        return Choice(item, "raycast", AT_RADAR)
    if item.name in view.models:
        model, toward = view.models[item.name], _toward(view.state, item, view.pose)
        if bool(model.inside(toward[None])[0]) and item.distance >= model.nearest(model.matrices(toward)):
            return Choice(item, "scatterers", "has a model that holds at this distance and aspect")
    if not item.is_coherent or not item.info.is_object:
        return Choice(item, "raycast", "rough or without an outline: clutter by class")
    if item.size < rules.smallest_body * view.radar.wavelength:
        return Choice(item, "raycast", f"smaller than {rules.smallest_body:g} wavelengths: RCS by class")
    return Choice(item, "sbr", "coherent body")


def _toward(state: WorldState, item: Estimate, pose: Pose) -> np.ndarray:
    """Return the direction from an object to the radar, in its own frame."""
    info = item.info
    body = Pose() if info.actor is None else state.actor_pose(info.actor)
    offset = body.inverse().apply(pose.position) - info.frame_from_box.position
    return np.asarray(offset / max(float(np.linalg.norm(offset)), 1e-9))


def _look(view: View, coherent: list[Choice]) -> list[Mirror]:
    """Find out what the radar sees of objects, straight and over mirrors; return the mirrors that change most."""
    accuracy = view.settings.accuracy
    tolerance, floor = accuracy.channel_tolerance_db, accuracy.channel_floor_db
    candidates = view.candidates
    thin = pane_parts(view.state, view.radar.center_frequency, SbrSettings().pane_loss_db)
    mirror_view = MirrorView(view.state, view.radar, view.mount, (), candidates, view.settings.mirrors, thin)
    surfaces = {choice.item.number: Surface.of(view.state, choice.item.number) for choice in coherent}
    seen = sights(mirror_view, surfaces, view.rules)
    gain: dict[int, float] = {}
    for choice in coherent:
        own = seen[choice.item.number]
        choice.sight = own[0]
        choice.shown = frozenset(
            mirror.number for sight, mirror in zip(own[1:], candidates, strict=True) if sight.share > 0.0
        )
        is_faint = (
            choice.item.in_view and choice.item.bound_db < floor
        )  # there for what mirrors bring, whatever its class
        for change in changes(own, candidates, view.reach, view.least_change_db, tolerance):
            mixed = np.sqrt(max(change.field, own[0].field) * change.field)  # one of two ways goes over the mirror
            level = choice.item.level_db(float(mixed)) - floor
            if is_faint or level > 0.0:
                choice.changes.append(change)
                gain[change.mirror.number] = gain.get(change.mirror.number, 0.0) + max(level, 0.0)
    best = sorted(gain, key=lambda number: (-gain[number], number))[: view.settings.mirrors.max_mirrors]
    return [candidates[number] for number in sorted(best)]


def _settle(view: View, choice: Choice) -> None:
    """Say which coherent object is not lit at all, and which only by mirrors."""
    item = choice.item
    if choice.method == "out of view":
        if choice.changes and item.size >= view.rules.smallest_body * view.radar.wavelength:
            choice.method, choice.reason = "sbr", "out of view, its ghosts are not"
    elif choice.method == "sbr" and choice.sight.share == 0.0 and not choice.changes:
        choice.reason = "hidden: only bounces of others reach it"
