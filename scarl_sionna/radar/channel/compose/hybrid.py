"""Several solvers at once, each for its mechanism or its objects, with nothing counted twice.

The rule of ownership stands in docs/accuracy.md; :mod:`scarl_sionna.radar.channel.compose.plan` checks it.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, ScarlError, SmallMirrorWarning
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.plan import OBJECT_SOLVERS, Share
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import dbm_to_watt, watt_to_dbm
from scarl_sionna.radar.channel.antennas import check_antennas, refuse_receiver
from scarl_sionna.radar.channel.multipath.solve import solve_sionna
from scarl_sionna.radar.channel.raycast.solve import solve_raycast
from scarl_sionna.radar.channel.sbr import solve_sbr
from scarl_sionna.radar.channel.scatterers import solve_scatterers
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.scatterers.model import loaded_models
from scarl_sionna.signal.antenna import field_gain

from .ghosts import of_meshes, of_models, paths_through_mirrors
from .mirrors import Mirror, find_mirrors
from .plan import ResolvedPlan, resolve

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

SOLVERS_OF_OBJECTS = {"sbr": solve_sbr, "scatterers": solve_scatterers, "raycast": solve_raycast}


class DoubleCountError(ScarlError):
    """Two solvers gave paths with the same chain of instances and interactions: a defect of a solver."""


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
        Its `plan`, `max_distance` (the unambiguous range if None), and the settings of each solver where a share has none.
    receiver : Mount, optional
        Refused: this solver is monostatic.

    Returns
    -------
    RadarPaths
        Objects (`sbr`, `scatterers`, `raycast`), then chains of mirrors, then objects through mirrors, each in the order of its
        solver. ``diagnostics["solvers"]`` has a row for each of them: what it computed, its paths and power, and what it
        reports itself; ``diagnostics["seconds"]`` the time of each, ``diagnostics["left_out"]`` what nobody computes.

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
    work = _Work(state, radar, mount, settings.with_(max_distance=reach, instances=None), resolved)
    rank = {name: number for number, name in enumerate(OBJECT_SOLVERS)}
    order = sorted(range(len(plan.shares)), key=lambda index: (rank[plan.shares[index].solver], index))
    for index in order:
        work.objects(plan.shares[index], resolved.owned[index])
    if resolved.mirrors and plan.echoes:
        work.echoes()
    if resolved.mirrors and any(share.through_mirrors for share in plan.shares):
        start = time.perf_counter()
        mirrors = find_mirrors(state, resolved.mirrors, pose.position, radar.wavelength)
        work.clock["mirrors"] = time.perf_counter() - start
        for index in order:
            if plan.shares[index].through_mirrors:
                work.ghosts(plan.shares[index], resolved.owned[index], mirrors)
    return work.result()


class _Work:
    """One solve: blocks of paths, and what each solver reports."""

    def __init__(
        self, state: WorldState, radar: RadarSpec, mount: Mount, settings: RadarSettings, plan: ResolvedPlan
    ) -> None:
        self.state, self.radar, self.mount, self.settings, self.plan = state, radar, mount, settings, plan
        self.reach = float(settings.max_distance or radar.max_range)
        self.blocks: list[RadarPaths] = []
        self.rows: list[dict[str, Any]] = []
        self.clock: dict[str, float] = {}

    def _add(
        self, solver: str, mechanism: str, instances: Sequence[int], blocks: Sequence[RadarPaths], seconds: float,
        **row: Any,
    ) -> None:  # fmt: skip
        self.blocks.extend(blocks)
        power = sum(float(received_power(paths, self.radar).sum()) for paths in blocks)
        self.rows.append(
            {
                "solver": solver,
                "mechanism": mechanism,
                "instances": [self.state.world.instances[number].name for number in instances],
                "num_paths": sum(paths.num_paths for paths in blocks),
                "power_dbm": float(watt_to_dbm(power)) if power > 0.0 else None,
                **row,
            }
        )
        key = f"{solver}: {mechanism}"
        self.clock[key] = self.clock.get(key, 0.0) + seconds

    def objects(self, share: Share, owned: Sequence[int]) -> None:
        """Compute what objects scatter straight back to the radar."""
        start = time.perf_counter()
        if not owned:
            return
        settings = self._settings(share, owned)
        found = SOLVERS_OF_OBJECTS[share.solver](self.state, self.radar, self.mount, settings)
        detail = {
            name: value for name, value in found.diagnostics.items() if name not in ("method", "left_out", "seconds")
        }
        self._add(
            share.solver, "objects", owned, [found], time.perf_counter() - start, reason=share.reason, detail=detail
        )

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
                "models", f"none for '{missing[0]}'", "a ScattererModel for every instance of the share",
                "name only instances with a model, or give the others to another solver",
            )  # fmt: skip
        return {name: models[name] for name in names}

    def echoes(self) -> None:
        """Compute the chains of mirror reflections from the radar back to itself."""
        start = time.perf_counter()
        knobs = self.plan.plan.sionna
        settings = self.settings if knobs is None else self.settings.with_(sionna=knobs)
        with warnings.catch_warnings():  # whether a mirror is large enough is decided here
            warnings.simplefilter("ignore", SmallMirrorWarning)
            found = solve_sionna(self.state, self.radar, self.mount, settings)
        allowed = np.isin(found.instance, [*self.plan.mirrors, -1]).all(axis=1)
        self._add(
            "sionna", "mirror chains", self.plan.mirrors, [found.select(allowed)], time.perf_counter() - start,
            num_foreign_chains=int((~allowed).sum()),
        )  # fmt: skip

    def ghosts(self, share: Share, owned: Sequence[int], mirrors: Sequence[Mirror]) -> None:
        """Compute the objects of a share as they are seen through the mirrors."""
        start = time.perf_counter()
        if not owned:
            return
        settings = self._settings(share, owned)
        if share.solver == "sbr":
            solve = of_meshes(self.state, self.radar, owned, settings)
        else:
            frames, models = settings.scatterers.placements, loaded_models(settings.scatterers.models)
            names = {self.state.world.instances[number].name: number for number in owned}
            solve = of_models(
                self.state, self.radar,
                {names[name]: (model, frames.get(name, Pose())) for name, model in models.items()},
            )  # fmt: skip
        blocks = paths_through_mirrors(
            self.state,
            self.radar,
            self.mount,
            owned,
            solve,
            mirrors,
            self.plan.plan.mirror_depth,
            self.reach,
        )
        blocks = [paths.select(_length(paths) < 2.0 * self.reach) for paths in blocks]
        self._add(
            share.solver,
            "objects through mirrors",
            owned,
            blocks,
            time.perf_counter() - start,
            num_mirrors=len(mirrors),
        )

    def result(self) -> RadarPaths:
        """Return the paths of all blocks."""
        _check_chains(self.blocks)
        table = self.state.world.instances
        owned = {number for numbers in self.plan.owned for number in numbers} | set(self.plan.mirrors)
        stated = [dict(entry) for entry in self.plan.plan.left_out]
        silent = [info.name for number, info in table.items() if number not in owned]
        named = {entry.get("instance") for entry in stated}
        diagnostics = {
            "method": "hybrid",
            "plan": self.plan.plan.to_dict("python"),
            "solvers": self.rows,
            "left_out": stated
            + [{"instance": name, "reason": "in no share of the plan"} for name in silent if name not in named],
            "max_distance": self.reach,
            "seconds": self.clock,
        }
        return joined(self.blocks, self.mount.pose, diagnostics)


def _length(paths: RadarPaths) -> npt.NDArray[np.float64]:
    there = np.linalg.norm(paths.tx_point - paths.world_from_tx.position, axis=1)
    return np.asarray(
        there + paths.inner_length + np.linalg.norm(paths.rx_point - paths.world_from_rx.position, axis=1)
    )


def received_power(paths: RadarPaths, radar: RadarSpec) -> npt.NDArray[np.float64]:
    """Return the power that one antenna pair receives by each path [W]."""
    entry = "VH".index(radar.array.polarization)
    gain = np.ones(paths.num_paths)
    for point, pose in ((paths.tx_point, paths.world_from_tx), (paths.rx_point, paths.world_from_rx)):
        gain = gain * field_gain(radar.array.pattern, (point - pose.position) @ pose.rotation)
    return np.asarray((np.abs(paths.a[:, entry, entry]) * gain) ** 2 * dbm_to_watt(radar.front_end.tx_power_dbm))


def chains_of(paths: RadarPaths) -> set[tuple[int, ...]]:
    """Return the chains of paths: instances and kinds of interaction in their order, each chain once."""
    if not paths.num_paths:
        return set()
    both = np.stack([paths.instance, paths.interaction], axis=2).reshape(paths.num_paths, -1)
    width = 2 * paths.depth
    rows = np.unique(np.column_stack([width, both]), axis=0)
    return {tuple(int(value) for value in row[1 : 1 + row[0]]) for row in rows}


def _check_chains(blocks: Sequence[RadarPaths]) -> None:
    """Raise if two blocks have a chain in common."""
    seen: set[tuple[int, ...]] = set()
    for paths in blocks:
        chains = chains_of(paths)
        if twice := chains & seen:
            raise DoubleCountError(f"the chain {sorted(twice)[0]} (instance, interaction, ...) was computed twice")
        seen |= chains


def joined(blocks: Sequence[RadarPaths], pose: Pose, diagnostics: Mapping[str, Any]) -> RadarPaths:
    """Return the paths of all blocks in one, labels padded with -1 to the longest chain.

    Parameters
    ----------
    blocks : sequence of RadarPaths
        Of one radar.
    pose : Pose
        Of the radar.
    diagnostics : mapping
        Of the result.
    """
    width = max([1, *(paths.instance.shape[1] for paths in blocks)])
    columns: dict[str, list[npt.NDArray[Any]]] = {
        "tx_point": [np.zeros((0, 3))], "rx_point": [np.zeros((0, 3))], "inner_length": [np.zeros(0)],
        "a": [np.zeros((0, 2, 2), np.complex128)], "length_rate": [np.zeros(0)], "length_acceleration": [np.zeros(0)],
        "instance": [np.zeros((0, width), np.int32)], "interaction": [np.zeros((0, width), np.int32)],
        "depth": [np.zeros(0, np.int32)], "semantic": [np.zeros(0, np.uint8)], "rx_image": [np.zeros((0, 3, 4))],
    }  # fmt: skip
    for paths in blocks:
        for name, column in columns.items():
            value = getattr(paths, name)
            if name in ("instance", "interaction"):
                value = np.pad(value, [(0, 0), (0, width - value.shape[1])], constant_values=-1)
            elif name == "rx_image" and value is None:
                value = np.full((paths.num_paths, 3, 4), np.nan)
            column.append(value)
    images = any(paths.rx_image is not None for paths in blocks)
    merged: dict[str, Any] = {name: np.concatenate(column) for name, column in columns.items()}
    if not images:
        merged["rx_image"] = None
    return RadarPaths(**merged, world_from_tx=pose, world_from_rx=pose, diagnostics=diagnostics)
