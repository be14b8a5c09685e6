"""Mitsuba scenes of the project: data files, and the scripts that build them.

Each folder that holds ``<name>/<name>.xml`` and ``<name>/scene.toml`` is a scene.  Reading a scene needs nothing of this
package but the path.
"""

from __future__ import annotations

from pathlib import Path

_ROOT = Path(__file__).resolve().parent

__all__ = ["scene_names", "scene_path"]


def scene_names() -> tuple[str, ...]:
    """Return the names of the scenes in this package, sorted."""
    return tuple(
        sorted(p.parent.name for p in _ROOT.glob("*/scene.toml") if (p.parent / f"{p.parent.name}.xml").exists())
    )


def scene_path(name: str) -> Path:
    """Return the path of a scene's Mitsuba XML.

    Parameters
    ----------
    name : str
        One of `scene_names`.

    Returns
    -------
    pathlib.Path
        ``<name>/<name>.xml``; ``scene.toml`` lies beside it.

    Raises
    ------
    KeyError
        If there is no such scene; the message lists those that exist.
    """
    if name not in scene_names():
        raise KeyError(f"no scene {name!r} in scenes_xml; choose one of {', '.join(scene_names())}")
    return _ROOT / name / f"{name}.xml"
