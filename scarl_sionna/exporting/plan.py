"""What an export is to make: scenarios with names, their content as plain data, and the plan of the dataset."""

from __future__ import annotations

import hashlib
import math
import platform
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scarl_sionna.core.errors import ParameterRangeError, TimeRangeError
from scarl_sionna.export.encoding import StoreOptions, foreign_fields
from scarl_sionna.export.manifest import DatasetPlan, ScenePlan, differences
from scarl_sionna.export.schema import RESULT_TYPES, check_schema
from scarl_sionna.fusion.rig import Rig
from scarl_sionna.generate import resolve_rig
from scarl_sionna.scenario.spec import ScenarioSpec

if TYPE_CHECKING:
    from scarl_sionna.world.document import SceneDocument

PROVENANCE_PACKAGES = ("scarl-sionna", "sionna-rt", "mitsuba", "drjit", "numpy")
"""Packages whose version can change a frame's bytes."""


@dataclass(frozen=True)
class ExportPlan:
    """Scenarios by the name of their scene in the dataset, the rig, and the plan of the dataset."""

    scenarios: dict[str, ScenarioSpec]
    rig: Rig
    dataset: DatasetPlan

    @property
    def num_frames(self) -> int:
        """Frames of all scenarios."""
        return sum(scenario.num_frames for scenario in self.scenarios.values())


def plan_export(
    scenarios: Iterable[ScenarioSpec], options: StoreOptions, licence: str = "not stated", description: str = ""
) -> ExportPlan:
    """Return the plan of an export; nothing is simulated and nothing written.

    Raises
    ------
    ParameterRangeError
        If two scenarios have the same name, the rigs differ, or a sensor kind cannot be stored.
    UnknownNameError, SceneError
        If a scene or rig is unknown or its files are missing.
    TimeRangeError
        If a frame's time lies outside of a scene's motion.
    """
    check_schema()
    named: dict[str, ScenarioSpec] = {}
    for scenario in scenarios:
        name = scenario.scene_name
        if name in named:
            raise ParameterRangeError(
                "scenarios", f"two of the name '{name}'", "one name each", "give one of them another `name`"
            )
        named[name] = scenario
    if not named:
        raise ParameterRangeError("scenarios", "none", "at least one")
    rig = _common_rig(named)
    for mount in rig.sensors:
        check_storable(mount.name, mount.kind)
    software = {"python": platform.python_version(), **{name: _version(name) for name in PROVENANCE_PACKAGES}}
    named = {name: scenario.with_(scene=_findable(scenario.scene)) for name, scenario in named.items()}
    scenes = tuple(
        ScenePlan(name, scenario.num_frames, scene_configuration(scenario), scenario.split)
        for name, scenario in named.items()
    )
    return ExportPlan(named, rig, DatasetPlan(rig.to_dict(), scenes, options, software, licence, description))


def scene_configuration(scenario: ScenarioSpec) -> dict[str, Any]:
    """Return all that decides the frames of a scenario but the rig, as plain data: without paths and without their number.

    Raises
    ------
    TimeRangeError
        If a frame's time lies outside of the scene's motion.
    """
    from scarl_sionna.world.scene import find_scene
    from scarl_sionna.world.scene_file import read_document

    document = read_document(find_scene(scenario.scene))
    motions = [item.trajectory for item in document.instances if item.trajectory is not None]
    start, stop = max((m.start for m in motions), default=-math.inf), min((m.stop for m in motions), default=math.inf)
    for time in (scenario.times[0], scenario.times[-1]):
        if not start <= time <= stop:
            raise TimeRangeError(time, start, stop, f"scene '{scenario.scene}'")
    return {
        "scene": Path(scenario.scene).stem,
        "scene_files": _checksum(document),
        "start_time": scenario.start_time,
        "frame_rate": scenario.frame_rate,
        "seed": scenario.seed,
    }


def _checksum(document: SceneDocument) -> str:
    """Return the SHA-256 of a scene's files: XML, ``scene.toml``, and every file that the XML names."""
    path = document.path
    named = {Path(item.get("value", "")) for item in document.root.iter("string") if item.get("name") == "filename"}
    digest = hashlib.sha256()
    contents = [file.read_bytes() for file in (path, path.parent / "scene.toml") if file.is_file()]
    for content in (*contents, *(file.read_bytes() for file in sorted(named) if file.is_file())):
        digest.update(hashlib.sha256(content).digest())
    return digest.hexdigest()


def _findable(scene: str) -> str:
    """Return a scene's name, or its path so that it means the same in another process."""
    return str(Path(scene).resolve()) if Path(scene).exists() and (Path(scene).suffix or "/" in scene) else scene


def check_storable(name: str, kind: str) -> None:
    """Raise if the dataset does not know what a sensor kind gives.

    Raises
    ------
    ParameterRangeError
        If it is neither built in nor declares what is to be stored.
    """
    if kind not in RESULT_TYPES.values() and foreign_fields(kind) is None:
        raise ParameterRangeError(
            f"sensor '{name}'", f"of kind '{kind}'", ", ".join(sorted(RESULT_TYPES.values())),
            "declare `stored_fields` and `result_type` on its class (docs/dataset.md)",
        )  # fmt: skip


def shards_of_part(keys: Sequence[tuple[str, int]], part: tuple[int, int] | None) -> list[tuple[str, int]]:
    """Return the shards of part i of n: every n-th, beginning with the i-th; all for None."""
    if part is None:
        return list(keys)
    index, count = part
    if not 0 <= index < count:
        raise ParameterRangeError("shard", f"{index}/{count}", "i/n with 0 <= i < n")
    return [key for position, key in enumerate(keys) if position % count == index]


def _common_rig(scenarios: dict[str, ScenarioSpec]) -> Rig:
    (first, scenario), *others = scenarios.items()
    rig = resolve_rig(scenario)
    for name, other in others:
        found = differences(rig.to_dict(), resolve_rig(other).to_dict())
        if found:
            raise ParameterRangeError(
                "scenarios", f"rigs of '{first}' and '{name}' differ ({'; '.join(found[:3])})", "one rig for a dataset",
                "export them into two folders",
            )  # fmt: skip
    return rig


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
