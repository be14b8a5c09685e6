"""Mitsuba scenes and actor models of the project.

Descriptions, packed meshes and textures, and the scripts that build them.

Each folder that holds ``<name>/<name>.xml`` and ``<name>/scene.toml`` is a scene, each ``actors/<name>/actor.toml`` an
actor model. Their meshes and textures lie beside them in one packed file, and are unpacked into a cache folder on first
use; variants and light levels of scenes are built there. Nothing is fetched, and this package needs nothing of the
simulator.
"""

from __future__ import annotations

import hashlib
import importlib
from functools import lru_cache
from pathlib import Path
from types import ModuleType

from . import packing
from .cache import cache_folder, kept_folder

_ROOT = Path(__file__).resolve().parent
DETAILS = ("detailed", "light")
"""Levels of geometry, of scenes and actor models."""

__all__ = [
    "DETAILS", "actor_names", "actor_path", "cache_folder", "person_ages", "scene_names", "scene_path", "source_hash",
]  # fmt: skip # a list


def scene_names() -> tuple[str, ...]:
    """Return the names of the scenes in this package, sorted."""
    return tuple(
        sorted(p.parent.name for p in _ROOT.glob("*/scene.toml") if (p.parent / f"{p.parent.name}.xml").exists())
    )


def actor_names() -> tuple[str, ...]:
    """Return the names of the actor models in this package, sorted.

    Folders of ``actors`` with an ``actor.toml``, the people of ``actors/bodies``, who share one packed file, and
    what ``actors/made.py`` makes.
    """
    packed = (p.parent.name for p in _ROOT.glob("actors/*/actor.toml"))
    return tuple(sorted([*packed, *_people().names(), *_made().NAMES]))


def person_ages() -> dict[str, int]:
    """Return the ages [years] of the people of all ages, by name; the youngest first."""
    return _people().ages()  # type: ignore[no-any-return]


def _people() -> ModuleType:
    return importlib.import_module("scenes_xml.actors.bodies.family")


def _made() -> ModuleType:
    return importlib.import_module("scenes_xml.actors.made")


def scene_path(name: str, variant: int = 0, detail: str = "detailed") -> Path:
    """Return the path of a scene's Mitsuba XML, in a cache folder into which it is unpacked or built first.

    Parameters
    ----------
    name : str
        One of `scene_names`.
    variant : int
        0 is the scene of the package; every other number is a seed from which another place of the same kind is built.
    detail : str
        ``detailed``, or ``light``: fewer shapes and triangles at the same places.

    Returns
    -------
    pathlib.Path
        ``<name>.xml``; ``scene.toml``, ``meshes`` and ``textures`` lie beside it.

    Raises
    ------
    KeyError
        If there is no such scene; the message lists those that exist.
    ValueError
        If `variant` is no whole number from 0, or `detail` is unknown.
    OSError
        If no cache folder can be written; the message says how to choose another. Or if a file of the package is
        damaged.

    Warns
    -----
    UserWarning
        If the user's cache folder cannot be written and one for temporary files is used instead.
    """
    if name not in scene_names():
        raise KeyError(f"no scene {name!r} in scenes_xml; choose one of {', '.join(scene_names())}")
    if isinstance(variant, bool) or not isinstance(variant, int) or variant < 0:
        raise ValueError(f"variant of scene {name!r} is {variant!r}; allowed are whole numbers from 0")
    if detail not in DETAILS:
        raise ValueError(f"detail of scene {name!r} is {detail!r}; allowed are {' and '.join(DETAILS)}")
    is_packed = variant == 0 and detail == "detailed"
    stem = f"{name}-v{variant}-{detail}"
    main = [f"{name}.xml", "scene.toml"]
    if is_packed:
        source = _ROOT / name
        files = [*main, *_packed_files(source)]
        folder = kept_folder(
            "scenes", f"{stem}-{packing.content_key(source)}", files, lambda place: packing.unpack_into(source, place)
        )
    else:
        folder = kept_folder(
            "scenes", f"{stem}-{source_hash()}", main, lambda place: _build(name, variant, detail, place)
        )
    return folder / f"{name}.xml"


def actor_path(name: str) -> Path:
    """Return the path of an actor model's ``actor.toml``, in a cache folder into which the model is unpacked first.

    Parameters
    ----------
    name : str
        One of `actor_names`.

    Returns
    -------
    pathlib.Path
        ``actor.toml``; ``<name>.xml``, ``<name>_light.xml`` and ``meshes`` lie beside it.

    Raises
    ------
    KeyError
        If there is no such model; the message lists those that exist.
    OSError, UserWarning
        As `scene_path`.
    """
    if name not in actor_names():
        raise KeyError(f"no actor model {name!r} in scenes_xml; choose one of {', '.join(actor_names())}")
    for maker, names in ((_people(), _people().names()), (_made(), _made().NAMES)):
        if name in names:
            return _made_path(name, maker)
    source = _ROOT / "actors" / name
    files = [f"{name}/{file}" for file in ("actor.toml", f"{name}.xml", f"{name}_light.xml", *_packed_files(source))]

    def fill(place: Path) -> None:
        (place / name).mkdir()
        packing.unpack_into(source, place / name)

    return kept_folder("models", f"{name}-{packing.content_key(source)}", files, fill) / name / "actor.toml"


def _made_path(name: str, maker: ModuleType) -> Path:
    """Return the path of the ``actor.toml`` of a model that a module makes."""

    def fill(place: Path) -> None:
        maker.build(name, place / name)

    files = [f"{name}/{file}" for file in ("actor.toml", f"{name}.xml", f"{name}_light.xml")]
    return kept_folder("models", f"{name}-{maker.key()}", files, fill) / name / "actor.toml"


def _packed_files(source: Path) -> tuple[str, ...]:
    return tuple(file for file in packing.checksums(source) if not file.endswith((".xml", ".toml")))


@lru_cache(maxsize=1)
def source_hash() -> str:
    """Return a hash of all sources that may shape a scene, so that a changed builder never meets an old cache."""
    digest = hashlib.sha256()
    for file in sorted(_ROOT.glob("*/**/*.py"), key=lambda file: file.relative_to(_ROOT).as_posix()):
        place = file.relative_to(_ROOT)
        if place.parts[0] != "actors":
            digest.update(place.as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:12]


def _build(name: str, variant: int, detail: str, folder: Path) -> None:
    importlib.import_module(f"scenes_xml.{name}.build").build(folder, variant, detail)
