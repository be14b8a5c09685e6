"""Several solvers at once, each for its mechanism or its objects, with nothing counted twice.

The rule of ownership stands in docs/accuracy.md; :mod:`scarl_sionna.radar.channel.compose.plan` checks it.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from scarl_sionna.core.arrays.rows import row_any
from scarl_sionna.core.errors import ParameterRangeError, ScarlError, SmallMirrorWarning
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.mirrors import MirrorSettings
from scarl_sionna.core.settings.plan import OBJECT_SOLVERS, ChannelPlan, Share
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import watt_to_dbm
from scarl_sionna.radar.channel.antennas import check_antennas, refuse_receiver
from scarl_sionna.radar.channel.multipath.solve import solve_sionna
from scarl_sionna.radar.channel.range_end import within_reach
from scarl_sionna.radar.channel.raycast.solve import solve_raycast
from scarl_sionna.radar.channel.sbr.bodies import Bodies
from scarl_sionna.radar.channel.sbr.cost import Work, affordable
from scarl_sionna.radar.channel.sbr.solve import solve_between, stations_of, straight
from scarl_sionna.radar.channel.sbr.tracing import Pair
from scarl_sionna.radar.channel.scatterers import PlacedModel, solve_scatterers
from scarl_sionna.radar.link import received_power
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.scatterers.model import loaded_models

from .budget import estimate
from .ghosts import STRAIGHT, Faces, Images, Meshes, image_pairs, of_models, paths_through_mirrors, weighted
from .mirror_chains import mirror_chains, most_mirrors
from .mirror_legs import MirrorView
from .mirrors import Mirror, find_mirrors
from .plan import ResolvedPlan, Seen, resolve
from .spend import num_pairs, num_ways

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState


class DoubleCountError(ScarlError):
    """Two solvers gave paths with the same chain over the same mirror faces: a defect of a solver."""


def solve_hybrid(
    state: WorldState, radar: RadarSpec, mount: Mount, settings: RadarSettings, receiver: Mount | None = None
) -> RadarPaths:
    """Return the paths of all solvers of a plan.

    Parameters
    ----------
    state : WorldState
    radar : RadarSpec
    mount : Mount
        Pose and velocity of the radar.
    settings : RadarSettings
        Its `plan`, `max_distance` (the unambiguous range if None), and the settings of each solver where a share has
        none.
    receiver : Mount, optional
        Refused: this solver is monostatic.

    Returns
    -------
    RadarPaths
        Objects (`sbr`, `scatterers`, `raycast`), then chains of mirrors, then objects through mirrors, each in the
        order of its solver. ``diagnostics["solvers"]`` has a row for each of them: what it computed, its paths and
        power, and what it reports itself; ``diagnostics["seconds"]`` the time of each (tubes of `sbr` over mirrors are
        traced with the straight ones), ``diagnostics["left_out"]`` what no solver computes.

    Raises
    ------
    ParameterRangeError
        If there is no plan, or a receiver is given.
    OwnershipError
        If the plan would count something twice.
    UnknownNameError
        If the plan names what is not in the scene.
    PlacementError
        If the radar or one of its antennas is inside a mesh.
    BudgetError
        If the shares of `sbr` are expected to take more processor time or memory than the budgets of `accuracy`.
    """
    refuse_receiver("hybrid", receiver)
    plan, pose = settings.plan, mount.pose
    if plan is None:
        raise ParameterRangeError(
            "plan", None, "a ChannelPlan", "plan_channel(state, radar, mount) makes one that fits"
        )
    resolved = resolve(plan, state.world)
    reach = radar.max_range if settings.max_distance is None else settings.max_distance
    check_antennas(state, radar, pose)
    settings, estimate = settings.with_(max_distance=reach, instances=None), None
    if settings.method == "hybrid":  # 'auto' has spent its budget on the plan already
        plan, estimate = _affordable(state, radar, mount, settings, resolved)
        resolved = replace(resolved, plan=plan)
    work = _Work(state, radar, mount, settings, resolved)
    rank = {name: number for number, name in enumerate(OBJECT_SOLVERS)}
    order = sorted(range(len(plan.shares)), key=lambda index: (rank[plan.shares[index].solver], index))
    ghosts = {index: work.ghosts(index) for index in order} if any(resolved.reflections) else {}
    for index in order:
        work.objects(index, ghosts.get(index, []))
    if resolved.mirrors and plan.echoes:
        work.echoes()
    for index in order:
        for one in ghosts.get(index, []):
            work.through_mirrors(index, one)
    found = work.result()
    return found if estimate is None else replace(found, diagnostics={**found.diagnostics, "estimate": estimate})


def _affordable(
    state: WorldState, radar: RadarSpec, mount: Mount, settings: RadarSettings, resolved: ResolvedPlan
) -> tuple[ChannelPlan, dict[str, Any]]:
    """Return the plan with knobs of `sbr` that are within the budgets, and what that is expected to cost.

    What is seen over mirrors counts as often as there are ways, and its patches as often as there are pairs of a way
    there and a way back, by the share of the objects that it is asked for.
    """
    plan, work = resolved.plan, {}
    for index, (share, owned) in enumerate(zip(plan.shares, resolved.owned, strict=True)):
        if share.solver == "sbr" and owned:
            own = settings if share.settings is None else settings.with_(sbr=share.settings)
            over = resolved.reflections[index]
            ways, pairs = (
                1.0 + sum(len(seen.objects) * (count(len(seen.mirrors)) - 1) for seen in over) / len(owned)
                for count in (num_ways, num_pairs)
            )
            bodies = Bodies(state, radar, own, owned, mount.pose.position)
            work[index] = Work(bodies, stations_of(radar, mount), ways, pairs)
    knobs, cost = affordable(list(work.values()), settings.accuracy, settings.auto.levels)
    shares = list(plan.shares)
    for index, chosen in zip(work, knobs, strict=True):
        if chosen != work[index].bodies.knobs:
            shares[index] = replace(shares[index], settings=chosen)
    return replace(plan, shares=tuple(shares)), cost.report()


@dataclass(frozen=True, eq=False)
class _Contribution:
    """What one solver adds to a solve: blocks of paths of a mechanism, and its row of the diagnostics."""

    solver: str
    mechanism: str
    instances: Sequence[int]
    blocks: Sequence[RadarPaths]
    seconds: float
    report: Mapping[str, Any]
    faces: Sequence[Faces] | None = None


@dataclass(eq=False)
class _Ghosts:
    """Objects of a share that are seen over some mirrors, between which images, and what is found between them."""

    seen: Seen
    view: MirrorView
    num_mirrors: int
    images: Sequence[Images]
    found: Sequence[RadarPaths] = ()


class _Work:
    """One solve: blocks of paths, and what each solver reports."""

    def __init__(
        self, state: WorldState, radar: RadarSpec, mount: Mount, settings: RadarSettings, plan: ResolvedPlan
    ) -> None:
        self.state, self.radar, self.mount, self.settings, self.plan = state, radar, mount, settings, plan
        self.reach = float(settings.max_distance or radar.max_range)
        self.blocks: list[RadarPaths] = []
        self.faces: list[Faces] = []
        self.rows: list[dict[str, Any]] = []
        self.clock: dict[str, float] = {}
        self._meshes: dict[tuple[int, ...], Meshes] = {}  # by what a share owns

    def _add(self, new: _Contribution) -> None:
        self.blocks.extend(new.blocks)
        self.faces.extend([STRAIGHT] * len(new.blocks) if new.faces is None else new.faces)
        power = sum(float(received_power(paths, self.radar).sum()) for paths in new.blocks)
        self.rows.append(
            {
                "solver": new.solver,
                "mechanism": new.mechanism,
                "instances": [self.state.world.instances[number].name for number in new.instances],
                "num_paths": sum(paths.num_paths for paths in new.blocks),
                "power_dbm": float(watt_to_dbm(power)) if power > 0.0 else None,
                **new.report,
            }
        )
        key = f"{new.solver}: {new.mechanism}"
        self.clock[key] = self.clock.get(key, 0.0) + new.seconds

    def objects(self, index: int, ghosts: Sequence[_Ghosts]) -> None:
        """Compute what the lit objects of a share scatter straight back to the radar, by `sbr` over mirrors as well."""
        start = time.perf_counter()
        share, owned, lit = self.plan.plan.shares[index], self.plan.owned[index], self.plan.lit[index]
        if not owned:
            return
        settings = self._settings(share, owned)
        if share.solver == "sbr":
            meshes = self._bodies(settings, owned)
            pairs = [Pair(*stations_of(self.radar, self.mount), lit)]
            for one in ghosts:
                pairs += meshes.pairs(one.view, one.images)
            traced = iter(solve_between(meshes.bodies, pairs))  # all together: each alone has few tubes
            found = straight(meshes.bodies, next(traced), self.mount)
            for one in ghosts:
                one.found = list(islice(traced, len(one.images)))
        elif share.solver == "scatterers":
            found = solve_scatterers(self.state, self.radar, self.mount, settings)
        else:
            found = solve_raycast(self.state, self.radar, self.mount, settings, by_material=share.by_material)
        detail = {
            name: value for name, value in found.diagnostics.items() if name not in ("method", "left_out", "seconds")
        }
        self._add(
            _Contribution(
                solver=share.solver,
                mechanism="objects",
                instances=lit,
                blocks=[found],
                seconds=time.perf_counter() - start,
                report={"reason": share.reason, "detail": detail},
            )
        )

    def _bodies(self, settings: RadarSettings, owned: Sequence[int]) -> Meshes:
        """Return the meshes of a share, made ready once."""
        key = tuple(owned)
        if key not in self._meshes:
            self._meshes[key] = Meshes(Bodies(self.state, self.radar, settings, key, self.mount.pose.position))
        return self._meshes[key]

    def _settings(self, share: Share, owned: Sequence[int]) -> RadarSettings:
        """Return the settings of a share's solver: its own, or those of the solve, for the instances that it owns."""
        settings = self.settings.with_(instances=tuple(owned))
        if share.settings is not None:
            settings = settings.with_(**{share.solver: share.settings})
        if share.solver == "scatterers":
            knobs = settings.scatterers
            settings = settings.with_(scatterers=knobs.with_(models=self._models(knobs.models, owned)))
        return settings

    def _models(self, models: Mapping[str, Any], owned: Sequence[int]) -> dict[str, Any]:
        names = [self.state.world.instances[number].name for number in owned]
        if missing := [name for name in names if name not in models]:
            raise ParameterRangeError(
                "models",
                f"none for '{missing[0]}'",
                "a ScattererModel for every instance of the share",
                "name only instances with a model, or give the others to another solver",
            )
        return {name: models[name] for name in names}

    def echoes(self) -> None:
        """Compute the chains of mirror reflections from the radar back to itself."""
        start = time.perf_counter()
        knobs = self.plan.plan.sionna
        settings = self.settings if knobs is None else self.settings.with_(sionna=knobs)
        solver = self.plan.plan.chains
        found, report = (self._traced if solver == "sionna" else self._imaged)(settings)
        self._add(
            _Contribution(
                solver=solver,
                mechanism="mirror chains",
                instances=self.plan.mirrors,
                blocks=[found],
                seconds=time.perf_counter() - start,
                report=report,
            )
        )

    def _traced(self, settings: RadarSettings) -> tuple[RadarPaths, dict[str, Any]]:
        with warnings.catch_warnings():  # whether a mirror is large enough is decided here
            warnings.simplefilter("ignore", SmallMirrorWarning)
            found = solve_sionna(self.state, self.radar, self.mount, settings)
        allowed = np.isin(found.instance, [*self.plan.mirrors, -1]).all(axis=1)
        return found.select(allowed), {"num_foreign_chains": int((~allowed).sum())}

    def _imaged(self, settings: RadarSettings) -> tuple[RadarPaths, dict[str, Any]]:
        depth = settings.sionna.max_depth
        mirrors = self.mirrors_of(settings.mirrors.with_(max_mirrors=most_mirrors(depth)))
        view = MirrorView(self.state, self.radar, self.mount, (), mirrors, settings.mirrors)
        found = mirror_chains(view, depth, self.reach, settings.warn_at.wide_arm)
        return found, dict(found.diagnostics)

    def mirrors_of(self, knobs: MirrorSettings) -> list[Mirror]:
        """Return the flat faces of the plan's mirrors."""
        faces, place = self.plan.plan.mirror_faces, self.mount.pose.position
        return find_mirrors(self.state, self.plan.mirrors, place, self.radar.wavelength, knobs, faces)

    def ghosts(self, index: int) -> list[_Ghosts]:
        """Return which of a share's lit objects are seen over which mirrors."""
        share, owned, lit = self.plan.plan.shares[index], self.plan.owned[index], self.plan.lit[index]
        depth, found = self.plan.plan.mirror_depth, []
        for seen in self.plan.reflections[index]:
            objects = tuple(number for number in seen.objects if number in lit)
            if not objects:
                continue
            view = MirrorView(self.state, self.radar, self.mount, objects, self._mirrors, self.settings.mirrors)
            if share.solver == "sbr":
                view = replace(view, thin=self._bodies(self._settings(share, owned), owned).bodies.thin)
            over = [mirror for mirror in self._mirrors if self._instance(mirror) in seen.mirrors]
            images = image_pairs(view, over, depth, self.reach)
            found.append(_Ghosts(seen._replace(objects=objects), view, len(over), images))
        return found

    @cached_property
    def _mirrors(self) -> list[Mirror]:
        start = time.perf_counter()
        found = self.mirrors_of(self.settings.mirrors)
        self.clock["mirrors"] = time.perf_counter() - start
        return found

    def _instance(self, mirror: Mirror) -> int:
        return int(self.state.world.parts.instance[mirror.part])

    def through_mirrors(self, index: int, ghosts: _Ghosts) -> None:
        """Compute objects of a share as they are seen over some of all mirrors of the solve."""
        start, seen = time.perf_counter(), ghosts.seen
        share = self.plan.plan.shares[index]
        if share.solver == "scatterers":
            knobs = self._settings(share, seen.objects).scatterers
            frames, models = knobs.placements, loaded_models(knobs.models)
            names = {self.state.world.instances[number].name: number for number in seen.objects}
            placed = [PlacedModel(name, names[name], model, frames.get(name, Pose())) for name, model in models.items()]
            ghosts.found = [of_models(self.state, self.radar, placed, images) for images in ghosts.images]
        found = paths_through_mirrors(ghosts.view, ghosts.images, ghosts.found, share.solver == "sbr")
        if seen.weights:
            instance = {mirror.number: self._instance(mirror) for mirror in self._mirrors}
            found = [(weighted(paths, faces, seen, instance), faces) for paths, faces in found]
        self._add(
            _Contribution(
                solver=share.solver,
                mechanism="objects through mirrors",
                instances=seen.objects,
                blocks=[within_reach(paths, self.reach) for paths, _ in found],
                faces=[faces for _, faces in found],
                seconds=time.perf_counter() - start,
                report={"num_mirrors": ghosts.num_mirrors},
            )
        )

    def _only_hides(self, number: int) -> dict[str, Any]:
        """Return the entry of an instance without an echo of its own, with what that can be straight."""
        found = estimate(self.state, self.radar, self.mount.pose, number, self.reach, self.settings.auto)
        return {
            "kind": "object",
            "instance": found.name,
            "reason": "in no share of the plan: only hides" + ("" if found.in_view else "; out of view or of range"),
            "bound_to_noise_db": round(found.bound_db, 1),
            "expected_to_noise_db": round(found.expected_db, 1),
        }

    def result(self) -> RadarPaths:
        """Return the paths of all blocks."""
        _check_chains(self.blocks, self.faces)
        table = self.state.world.instances
        owned = {number for numbers in self.plan.owned for number in numbers} | set(self.plan.mirrors)
        stated = [dict(entry) for entry in self.plan.plan.left_out]
        named = {entry.get("instance") for entry in stated}
        silent = [number for number, info in table.items() if number not in owned and info.name not in named]
        diagnostics = {
            "method": "hybrid",
            "plan": self.plan.plan.to_dict("python"),
            "solvers": self.rows,
            "left_out": stated + [self._only_hides(number) for number in silent],
            "max_distance": self.reach,
            "seconds": self.clock,
        }
        return RadarPaths.concatenate([RadarPaths.empty(self.mount.pose), *self.blocks], diagnostics)


def chains_of(paths: RadarPaths) -> set[tuple[int, ...]]:
    """Return the chains of paths: instances and kinds of interaction in their order, each chain once."""
    if not paths.num_paths:
        return set()
    both = np.stack([paths.instance, paths.interaction], axis=2).reshape(paths.num_paths, -1)
    rows = np.column_stack([2 * paths.depth, both])
    new = np.ones(len(rows), dtype=np.bool_)  # solvers give equal chains one after the other
    new[1:] = row_any(rows[1:] != rows[:-1])
    rows = np.unique(rows[new], axis=0)
    return {tuple(int(value) for value in row[1 : 1 + row[0]]) for row in rows}


def _check_chains(blocks: Sequence[RadarPaths], faces: Sequence[Faces] | None = None) -> None:
    """Raise if two blocks have a chain over the same faces in common; `STRAIGHT` may be any faces."""
    seen: dict[tuple[int, ...], set[Faces]] = {}
    for paths, own in zip(blocks, faces or [STRAIGHT] * len(blocks), strict=True):
        for chain in sorted(chains_of(paths)):
            before = seen.setdefault(chain, set())
            if own in before or STRAIGHT in before or (before and own == STRAIGHT):
                raise DoubleCountError(
                    f"the chain {chain} (instance, interaction, ...) over the mirror faces {own} (there, back) was "
                    "computed twice"
                )
            before.add(own)
