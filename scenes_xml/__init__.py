"""Mitsuba scenes of the project: data files, and the scripts that build them.

Each folder that holds ``<name>/<name>.xml`` and ``<name>/scene.toml`` is a scene.  Reading a scene needs nothing of this
package but the path.  Variants and light levels are built on first use into a cache folder.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import shutil
import tempfile
from pathlib import Path

_ROOT = Path(__file__).resolve().parent
_DETAILS = ("detailed", "light")

__all__ = ["actor_names", "cache_folder", "scene_names", "scene_path"]


def scene_names() -> tuple[str, ...]:
    """Return the names of the scenes in this package, sorted."""
    return tuple(
        sorted(p.parent.name for p in _ROOT.glob("*/scene.toml") if (p.parent / f"{p.parent.name}.xml").exists())
    )


def actor_names() -> tuple[str, ...]:
    """Return the names of the actor models in this package, sorted: folders of ``actors`` with an ``actor.toml``."""
    return tuple(sorted(p.parent.name for p in _ROOT.glob("actors/*/actor.toml")))


def scene_path(name: str, variant: int = 0, detail: str = "detailed") -> Path:
    """Return the path of a scene's Mitsuba XML; what does not come with the package is built first.

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
        ``<name>.xml``; ``scene.toml`` lies beside it.

    Raises
    ------
    KeyError
        If there is no such scene; the message lists those that exist.
    ValueError
        If `variant` is no whole number from 0, or `detail` is unknown.
    OSError
        If the cache folder cannot be written; the message says how to choose another.
    """
    if name not in scene_names():
        raise KeyError(f"no scene {name!r} in scenes_xml; choose one of {', '.join(scene_names())}")
    if isinstance(variant, bool) or not isinstance(variant, int) or variant < 0:
        raise ValueError(f"variant of scene {name!r} is {variant!r}; allowed are whole numbers from 0")
    if detail not in _DETAILS:
        raise ValueError(f"detail of scene {name!r} is {detail!r}; allowed are {' and '.join(_DETAILS)}")
    if variant == 0 and detail == "detailed":
        return _ROOT / name / f"{name}.xml"
    folder = cache_folder() / "scenes" / f"{name}-v{variant}-{detail}-{_source_hash()}"
    if not (folder / f"{name}.xml").is_file():
        _build(name, variant, detail, folder)
    return folder / f"{name}.xml"


def cache_folder() -> Path:
    """Return where built scenes are kept: ``SCARL_CACHE_DIR``, else ``scarl-sionna`` in the user's cache folder."""
    if chosen := os.environ.get("SCARL_CACHE_DIR"):
        return Path(chosen).expanduser().absolute()
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "scarl-sionna"


def _source_hash() -> str:
    """Return a hash of all sources that may shape a scene, so that a changed builder never meets an old cache."""
    digest = hashlib.sha256()
    for file in sorted(file for file in _ROOT.glob("*/*.py") if file.parent.name != "actors"):
        digest.update(file.relative_to(_ROOT).as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:12]


def _build(name: str, variant: int, detail: str, folder: Path) -> None:
    """Build beside the target and rename: another process sees all of a scene or nothing, and the first to finish wins."""
    builder = importlib.import_module(f"scenes_xml.{name}.build")
    temporary = None
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
        temporary.chmod(0o755)
        builder.build(temporary, variant, detail)
        try:
            temporary.rename(folder)
        except OSError:
            if not (folder / f"{name}.xml").is_file():  # else another process was first, with the same bytes
                raise
    except OSError as error:
        raise OSError(
            error.errno,
            f"cannot build variant {variant} ({detail}) of scene {name!r} in {folder.parent}: {error.strerror or error}; "
            "free space there, or set SCARL_CACHE_DIR to a folder that can be written",
        ) from error
    finally:
        if temporary is not None:
            shutil.rmtree(temporary, ignore_errors=True)
