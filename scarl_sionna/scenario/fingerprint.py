"""What decides the frames of a scenario beside its scene and its instants, as plain data: contents instead of paths."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from scarl_sionna.core.untrusted.files import Stamps, stamps

from .compose import Composition
from .openscenario import SUFFIX
from .randomize import RANGES_FILE
from .spec.actors import RandomizationSpec
from .spec.scenario import ScenarioSpec

_SIMPLE = ("variant", "detail", "lighting", "weather", "changes", "springs")


def fingerprint(composition: Composition) -> dict[str, Any]:
    """Return what a scenario states beyond scene, instants and seed; what it leaves at its default is left out.

    Files stand there by the SHA-256 of their content: a scenario that was moved to another folder is the same, and one
    whose table or mesh was changed is another.
    """
    spec = composition.spec
    plain, defaults = spec.to_dict(), ScenarioSpec().to_dict()
    stated = {key: plain[key] for key in _SIMPLE if plain.get(key) != defaults.get(key)}
    if not spec.keeps_actors:
        stated["default_actors"] = False
    if spec.ego is not None:
        stated["ego"] = _contents(spec, plain["ego"])
    if spec.actors:
        stated["actors"] = [_contents(spec, actor) for actor in plain["actors"]]
    if spec.traffic is not None:
        stated["traffic"] = _contents(spec, plain["traffic"])
        if spec.traffic.source == "sumo":
            stated["sumo"] = _version("eclipse-sumo")
    models = {member.actor.model.path for member in composition.members}
    if models:
        stated["models"] = sorted({f"{path.parent.name} {_checksum_of(path)}" for path in models})
    if composition.drawn:
        stated["drawn"] = dict(composition.drawn)
    if spec.randomization != RandomizationSpec():
        stated["randomization"] = plain["randomization"]
        if spec.randomization.materials:
            stated["material_ranges"] = _sha256(RANGES_FILE)
    return stated


def _contents(spec: ScenarioSpec, plain: dict[str, Any]) -> dict[str, Any]:
    """Return a table with the content of files in place of their paths."""
    out: dict[str, Any] = {}
    for key, value in plain.items():
        if isinstance(value, dict):
            out[key] = _contents(spec, value)
        elif (key in ("file", "moved_by") and value is not None) or (key == "model" and "/" in str(value)):
            out[key] = _checksum_of(spec.find(str(value)))
        else:
            out[key] = value
    return out


def _checksum_of(path: Path) -> str:
    """Return the checksum of a file, or of all files of an actor model by its folder or ``actor.toml``.

    An OpenSCENARIO file's is that of its catalogs, too.
    """
    if path.suffix == SUFFIX:
        from .openscenario.drive import files_of

        return hashlib.sha256(" ".join(_sha256(one) for one in files_of(path)).encode()).hexdigest()
    folder = path.parent if path.name == "actor.toml" else path
    if not folder.is_dir():
        return _sha256(path)
    digest = hashlib.sha256()
    for file in sorted(file for file in folder.rglob("*") if file.is_file() and file.suffix not in (".py", ".pyc")):
        digest.update(file.relative_to(folder).as_posix().encode() + b"\0" + bytes.fromhex(_sha256(file)))
    return digest.hexdigest()


def _sha256(path: Path) -> str:
    return _sha256_of(path.resolve(), stamps(path))


@lru_cache(maxsize=4096)
def _sha256_of(path: Path, changed: Stamps) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
