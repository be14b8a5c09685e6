"""Reads an OpenSCENARIO file and runs it: once for a file and a map."""

from __future__ import annotations

import warnings
from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from scarl_sionna.core.errors import MapError, ScarlWarning, ScenarioFileError
from scarl_sionna.core.untrusted.files import Stamps, stamps

from .lights import not_shown
from .reading.catalogs import Catalogs
from .reading.entities import Entity, read_entities
from .reading.source import Node, Problems, parameter_name, read_root
from .roads.network import Roads, read_roads
from .running.actions import Action
from .running.registry import read_global, read_private
from .running.signals import read_signals
from .running.simulation import Run, Simulation
from .running.storyboard import Storyboard

_HEROES = ("ego", "hero", "egovehicle", "ego_vehicle")


@dataclass(frozen=True, eq=False)
class Drive:
    """A scenario that has run.

    Attributes
    ----------
    path : Path
    map_file : Path or None
        The OpenDRIVE file of its roads.
    roads : Roads or None
    entities : dict
        By name.
    hero : str or None
        Who is the ego vehicle: called so, else the first vehicle.
    run : Run
    surroundings : dict
        `lighting`, `weather` and `changes` as a scenario file states them, where it says something of them.
    lines : dict
        Lines of the parts that a scenario file has keys for.
    findings : tuple of str
        What has no effect, with its lines.
    """

    path: Path
    map_file: Path | None
    roads: Roads | None
    entities: dict[str, Entity]
    hero: str | None
    run: Run
    surroundings: dict[str, Any]
    lines: dict[str, int]
    findings: tuple[str, ...]


def read_drive(path: str | Path, map_file: str | Path | None = None) -> Drive:
    """Return a scenario that has run, from the cache where file, catalogs and map are the same.

    Parameters
    ----------
    path : str or Path
        OpenSCENARIO XML, 1.0 to 1.3.
    map_file : str, Path or None
        Another OpenDRIVE file than the one that it names.

    Raises
    ------
    ScenarioError
        If the file cannot be read, holds what would decide motion and is not read, or a value of it cannot be; it names
        file and line, and all that was found when reading.

    Warns
    -----
    ScarlWarning
        If something has no effect.
    """
    path = Path(path)
    chosen = None if map_file is None else Path(map_file)
    catalogs, named = _named(path, stamps(path))
    files = (path, *catalogs.files(), named if chosen is None else chosen)
    return _cached(path, chosen, files, stamps(*files))


def files_of(path: Path) -> list[Path]:
    """Return an OpenSCENARIO file with those of its catalogs.

    Raises
    ------
    ScenarioError
        If the file cannot be read.
    """
    return [path, *_named(path, stamps(path))[0].files()]


@lru_cache(maxsize=8)
def _named(path: Path, stamp: Stamps) -> tuple[Catalogs, Path | None]:
    """Return the catalogs and the map that a file names."""
    root = read_root(path, Problems()).declared()
    network = root.child("RoadNetwork")
    logic = None if network is None else network.child("LogicFile")
    return Catalogs(root), None if logic is None else path.parent / logic.text("filepath")


@lru_cache(maxsize=8)
def _cached(path: Path, map_file: Path | None, files: tuple[Path | None, ...], stamp: Stamps) -> Drive:
    problems = Problems()
    root = read_root(path, problems).declared()
    if root.child("Catalog") is not None:
        raise root.need("Catalog").unsupported("give the scenario that refers to it", "is a catalog, no scenario")
    catalogs = Catalogs(root)
    found_map, roads = _roads(root, map_file)
    entities = read_entities(root, catalogs)
    board = root.need("Storyboard")
    init = _init(board, catalogs, entities)
    storyboard = Storyboard(board, catalogs, entities)
    signals = read_signals(root.need("RoadNetwork"))
    problems.check()
    hero = _hero(entities)
    values = dict(root.scope) | _variables(root)
    simulation = Simulation(roads, entities, values, storyboard, hero)
    simulation.signals = signals
    simulation.start(init)
    run = simulation.simulate()
    if not run.reason.startswith("StopTrigger"):
        board.note(f"ends at {run.stop:.4g} s: {run.reason}")
    for name, entity in entities.items():
        if not run.tracks[name]:
            entity.node.note(f"'{name}' is never given a place and is not there")
    lights = (
        set()
        if roads is None
        else {one.id for road in roads.street.roads.values() for one in road.signals if one.is_dynamic}
    )
    for sentence in not_shown(run.signals, lights):
        root.need("RoadNetwork").note(sentence)
    if problems.findings:
        more = f" and {len(problems.findings) - 1} more" if len(problems.findings) > 1 else ""
        warnings.warn(f"{problems.findings[0]}{more}", ScarlWarning, stacklevel=4)
    lines = {"scene": root.need("RoadNetwork").line, "traffic": root.need("Entities").line}
    if hero is not None:
        lines["ego"] = entities[hero].node.line
    return Drive(path, found_map, roads, entities, hero, run, _surroundings(run), lines, tuple(problems.findings))


def _variables(root: Node) -> dict[str, str]:
    """Return the values of a file's VariableDeclarations at the start (1.2), by name."""
    holder = root.child("VariableDeclarations")
    declared = [] if holder is None else holder.children("VariableDeclaration")
    return {parameter_name(one): one.text("value", "") for one in declared}


def _surroundings(run: Run) -> dict[str, Any]:
    """Return `lighting` and `weather` at the start of a run, and its `changes` until its end."""
    found: dict[str, Any] = {}
    changes = [(time, stated) for time, stated in run.surroundings if time < run.stop]
    if changes and changes[0][0] <= 0.0:
        found |= changes.pop(0)[1]
    if changes:
        found["changes"] = [{"time": round(time, 5), **stated} for time, stated in changes]
    return found


def _roads(root: Node, map_file: Path | None) -> tuple[Path | None, Roads | None]:
    network = root.need("RoadNetwork")
    logic = network.child("LogicFile")
    place = network.place
    if map_file is None:
        if logic is None:
            return None, None
        place = logic.place
        map_file = root.file.parent / logic.text("filepath")
        if map_file.suffix != ".xodr":
            raise logic.unsupported("give an OpenDRIVE map (.xodr)", f"filepath = '{map_file.name[:60]}' is not read")
    try:
        return map_file, read_roads(map_file)
    except MapError as error:
        remedy = "" if error.line else "correct it, or name another map as `scene` of a scenario file"
        raise ScenarioFileError(str(error), place, remedy, value=map_file) from error


def _init(board: Node, catalogs: Catalogs, known: Collection[str]) -> list[tuple[Action, str]]:
    """Return the actions of <Init> with their actors."""
    found: list[tuple[Action, str]] = []
    init = board.child("Init")
    holder = None if init is None else init.child("Actions")
    for node in [] if holder is None else holder.children():
        with node.problems.collected():
            if node.tag == "GlobalAction":
                found += [(action, "") for action in read_global(node, catalogs)]
            elif node.tag == "Private":
                actor = node.text("entityRef")
                if actor not in known:
                    raise node.error(f"'{actor}' is no entity", f"known: {', '.join(known)}")
                for one in node.children("PrivateAction"):
                    with node.problems.collected():
                        found += [(action, actor) for action in read_private(one, catalogs)]
            else:
                raise node.unsupported("GlobalAction and Private are read here")
    return found


def _hero(entities: dict[str, Entity]) -> str | None:
    vehicles = [name for name, one in entities.items() if one.kind == "vehicle" and one.category != "trailer"]
    named = [name for name in vehicles if name.lower() in _HEROES]
    return next(iter(named or vehicles), None)
