"""Traffic lights of a map that show what the signals of a storyboard show."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

from scarl_sionna.scene.document.model import SceneDocument
from scarl_sionna.scene.lanes import SIGNAL_COLORS

_WORDS: Mapping[str, tuple[str, ...]] = {
    "green": ("green",), "go": ("green",), "yellow": ("amber",), "amber": ("amber",), "caution": ("amber",),
    "red": ("red",), "stop": ("red",), "redyellow": ("red", "amber"), "redamber": ("red", "amber"), "off": (),
    "none": (),
}  # fmt: skip # a table
Shown = tuple[tuple[float, frozenset[str]], ...]
_LIT, _DARK = ("on", "flashing", "blinking"), ("off",)


def colors_of(state: str) -> frozenset[str] | None:
    """Return which of `SIGNAL_COLORS` a state lights; None where it cannot be told.

    A state is a word (``green``, ``red``, ``yellow``, ``off``), several of them, or what each lamp of a head of three
    does, from above (``off;off;on``), or of one of two (red and green).
    """
    parts = [part.strip().lower().replace("-", "").replace("_", "") for part in state.replace(",", ";").split(";")]
    if all(part in (*_LIT, *_DARK) for part in parts) and len(parts) in (2, 3):
        lamps = SIGNAL_COLORS if len(parts) == 3 else (SIGNAL_COLORS[0], SIGNAL_COLORS[-1])
        return frozenset(lamp for lamp, part in zip(lamps, parts, strict=True) if part in _LIT)
    if all(part in _WORDS for part in parts):
        return frozenset(color for part in parts for color in _WORDS[part])
    return None


def not_shown(signals: Mapping[str, list[tuple[float, str]]], known: Collection[str]) -> list[str]:
    """Return what no light of a map can show, as sentences: signals that it has not, and states that are no colours."""
    away = [name for name in signals if name not in known]
    odd = sorted({state for name in signals for _, state in signals[name] if colors_of(state) is None})
    found = [f"the map has no light '{name}': it decides conditions alone" for name in away]
    return found + [f"state '{state[:40]}' is none that lamps show: they stay as before" for state in odd]


def with_signals(document: SceneDocument, signals: Mapping[str, list[tuple[float, str]]]) -> SceneDocument:
    """Return a map's scene whose lights show what a storyboard says, each from its first time on.

    Before, and where it says nothing of a light, that shows what the first one of its group does of which it says
    something, and so do those who drive there; groups of which it says nothing keep the map's plan.

    Parameters
    ----------
    document : SceneDocument
        Its information lists lights by their ids, each with its head (``heads``).
    signals : mapping
        What signals show, by id: times [s] and the state from then on.
    """
    lanes = document.lanes
    plan = None if lanes is None else lanes.signals
    heads: dict[str, str] = dict(document.info.get("heads", ()))
    groups = {entry.name: entry.signal for entry in document.instances if entry.signal is not None}
    found: dict[str, tuple[str, Shown]] = {}
    for name, states in signals.items():
        group = groups.get(heads.get(name, ""))
        shown = tuple((time, colors) for time, state in states if (colors := colors_of(state)) is not None)
        if group is not None and shown:
            found[name] = (group, shown)
    if lanes is None or plan is None or not found:
        return document
    own: dict[str, str] = {}
    green, stated = dict(plan.green), dict(plan.stated)
    for group, shown in sorted(found.values(), key=lambda one: one[1][0][0]):
        stated.setdefault(group, shown)
    for name, (group, shown) in found.items():
        own[heads[name]] = mine = f"storyboard_{name}"
        green[mine] = green[group]
        stated[mine] = tuple(one for one in stated[group] if one[0] < shown[0][0]) + shown
    return replace(
        document,
        instances=tuple(
            replace(entry, signal=own[entry.name]) if entry.name in own else entry for entry in document.instances
        ),
        lanes=replace(lanes, signals=replace(plan, green=green, stated=stated)),
    )
