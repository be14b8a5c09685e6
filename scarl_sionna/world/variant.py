"""The only place that switches Mitsuba's variant, which is global to the process.

Radio paths need the polarized variant, images the RGB one. Objects belong to the variant that made them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from . import engine

_SUFFIX = {"optical": "ad_rgb", "radio": "ad_mono_polarized"}


def mitsuba() -> Any:
    """Return the module mitsuba, imported after the engine has been checked."""
    engine.ensure_engine()
    import mitsuba as mi

    return mi


@contextmanager
def _variant(name: str) -> Iterator[Any]:
    """Switch to a variant for a block and back, also from no variant at all."""
    mi = mitsuba()
    previous = mi.variant()
    if previous != name:
        mi.set_variant(name)
    try:
        yield mi
    finally:
        if previous is not None and previous != name:
            mi.set_variant(previous)


def use(twin: str) -> Any:
    """Return the context manager of a twin: ``"optical"`` or ``"radio"``; it yields the module mitsuba."""
    backend = engine.ensure_engine()
    return _variant(f"{backend}_{_SUFFIX[twin]}")


def optical() -> Any:
    """Return a context manager in which Mitsuba runs in the RGB variant."""
    return use("optical")


def radio() -> Any:
    """Return a context manager in which Mitsuba runs in the polarized variant of Sionna RT."""
    return use("radio")
