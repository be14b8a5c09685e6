"""What an export is to make: scenarios with names, their content as plain data, and the plan of the dataset."""

from __future__ import annotations

import hashlib
import platform
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.scatterers import TR38901
from scarl_sionna.dataset.encoding import StoreOptions, foreign_fields
from scarl_sionna.dataset.schema import RESULT_TYPES, check_schema
from scarl_sionna.dataset.store.manifest import DatasetPlan, ScenePlan, differences
from scarl_sionna.dataset.store.writer import first_few
from scarl_sionna.fusion.rig import Rig
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.simulation import resolve_rig

from .plan_file import shared_plan

if TYPE_CHECKING:
    from scarl_sionna.scene.document.model import SceneDocument

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
    scenarios: Iterable[ScenarioSpec],
    options: StoreOptions,
    licence: str = "not stated",
    description: str = "",
    plan_file: str | Path | None = None,
) -> ExportPlan:
    """Return the plan of an export; nothing is simulated, and nothing written but the plan file.

    `plan_file`: what of the scenarios stands in it is not computed again, and the rest is added; see `shared_plan`.

    Warns
    -----
    ScarlWarning
        If drives of one seed have the same noise without `noise_of`: they were read from files of the same name.

    Raises
    ------
    ParameterRangeError
        If two scenarios have the same name, the rigs differ, or a sensor kind cannot be stored.
    UnknownNameError, SceneError
        If a rig is unknown, or files of a scene or rig are missing.
    ScenarioError
        If a scenario cannot be; see `scene_configuration`.
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
    _tell_common_noise(named)
    rig = _common_rig(named)
    for mount in rig.sensors:
        check_storable(mount.name, mount.kind)
    software = {"python": platform.python_version(), **{name: _version(name) for name in PROVENANCE_PACKAGES}}
    named = {name: scenario.resolved() for name, scenario in named.items()}
    files = settings_files(rig)
    stated = {"settings_files": files} if files else {}
    with shared_plan(plan_file, software, scene_configuration) as configuration_of:
        scenes = tuple(
            ScenePlan(name, scenario.num_frames, {**configuration_of(scenario), **stated}, scenario.split)
            for name, scenario in named.items()
        )
    return ExportPlan(named, rig, DatasetPlan(rig.to_dict(), scenes, options, software, licence, description))


def scene_configuration(scenario: ScenarioSpec) -> dict[str, Any]:
    """Return all that decides the frames of a scenario but the rig, as plain data.

    Without paths and without their number.

    Raises
    ------
    ScenarioError
        If the scenario cannot be: an unknown name, a motion that ends too early, bodies that overlap.
    """
    from scarl_sionna.scenario.compose import compose
    from scarl_sionna.scenario.fingerprint import fingerprint

    composition = compose(scenario)
    return {
        "scene": Path(scenario.scene).stem,
        "scene_files": _checksum(composition.scene),
        **({"map_licence": str(licence)} if (licence := composition.scene.info.get("licence")) else {}),
        "start_time": scenario.start_time,
        "frame_rate": scenario.frame_rate,
        "seed": scenario.seed,
        "noise_of": scenario.noise_name,
        **fingerprint(composition),
    }


def settings_files(rig: Rig) -> dict[str, str]:
    """Return the SHA-256 of each file that the settings of a rig's radars name, by sensor and setting.

    The rig holds their paths only, and another table of reflectivities or another scatterer model makes other frames.

    Raises
    ------
    ParameterRangeError
        If there is no such file.
    """
    named: dict[str, Path] = {}
    for mount in rig.sensors:
        settings = mount.settings
        if not isinstance(settings, RadarSettings):
            continue
        if isinstance(settings.raycast.class_rcs, Path):
            named[f"{mount.name}.raycast.class_rcs"] = settings.raycast.class_rcs
        for name, model in settings.scatterers.models.items():
            if isinstance(model, Path) or (isinstance(model, str) and not model.startswith(TR38901)):
                named[f"{mount.name}.scatterers.models.{name}"] = Path(model)
    for where, file in named.items():
        if not file.is_file():
            raise ParameterRangeError(where, f"'{file}'", "a file that is there", "check the path of the rig's setting")
    return {where: hashlib.sha256(file.read_bytes()).hexdigest() for where, file in named.items()}


def _checksum(document: SceneDocument) -> str:
    """Return the SHA-256 of a scene's files.

    XML, ``scene.toml``, those of its actors' models, and every file that the XML names.
    """
    path = document.path
    named = {Path(item.get("value", "")) for item in document.root.iter("string") if item.get("name") == "filename"}
    files = {path, path.parent / "scene.toml", *document.files, *named}
    digests = sorted(bytes.fromhex(_recorded(file)) for file in files if file.is_file())
    return hashlib.sha256(b"".join(digests)).hexdigest()


def _recorded(file: Path) -> str:
    """Return the SHA-256 of a file.

    Of a texture of the package, the one that does not depend on this machine's Pillow.
    """
    from scenes_xml.packing import recorded_digest

    return recorded_digest(file, hashlib.sha256(file.read_bytes()).hexdigest())


def check_storable(name: str, kind: str) -> None:
    """Raise if the dataset does not know what a sensor kind gives.

    Raises
    ------
    ParameterRangeError
        If it is neither built in nor declares what is to be stored.
    """
    if kind not in RESULT_TYPES.values() and foreign_fields(kind) is None:
        raise ParameterRangeError(
            f"sensor '{name}'",
            f"of kind '{kind}'",
            ", ".join(sorted(RESULT_TYPES.values())),
            "declare `stored_fields` and `result_type` on its class (docs/dataset.md)",
        )


def shards_of_part(keys: Sequence[tuple[str, int]], part: tuple[int, int] | None) -> list[tuple[str, int]]:
    """Return the shards of part i of n: every n-th, beginning with the i-th; all for None."""
    if part is None:
        return list(keys)
    index, count = part
    if not 0 <= index < count:
        raise ParameterRangeError("shard", f"{index}/{count}", "i/n with 0 <= i < n")
    return [key for position, key in enumerate(keys) if position % count == index]


def _tell_common_noise(scenarios: dict[str, ScenarioSpec]) -> None:
    """Warn of drives that share their noise though none of them states so."""
    sharing: dict[tuple[int, str], list[str]] = {}
    for name, scenario in scenarios.items():
        if scenario.noise_of is None:
            sharing.setdefault((scenario.seed, scenario.noise_name), []).append(f"'{name}'")
    for (seed, noise), names in sharing.items():
        if len(names) > 1:
            warnings.warn(
                f"{first_few(names)} have the same noise: all of seed {seed}, and drawn by the name '{noise}'; give "
                f"each a `name`, or state `noise_of: {noise}` in all of them if it is meant",
                ScarlWarning,
                stacklevel=3,
            )


def _common_rig(scenarios: dict[str, ScenarioSpec]) -> Rig:
    (first, scenario), *others = scenarios.items()
    rig = resolve_rig(scenario)
    for name, other in others:
        found = differences(rig.to_dict(), resolve_rig(other).to_dict())
        if found:
            raise ParameterRangeError(
                "scenarios",
                f"rigs of '{first}' and '{name}' differ ({'; '.join(found[:3])})",
                "one rig for a dataset",
                "export them into two folders",
            )
    return rig


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
