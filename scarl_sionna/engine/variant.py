"""The only place that switches Mitsuba's variant, which is global to the process.

Radio paths need the polarized variant, images the RGB one. Objects belong to the variant that made them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from types import CodeType, FunctionType, ModuleType

from .backend import bootstrap as engine

_SUFFIX = {"optical": "ad_rgb", "radio": "ad_mono_polarized"}


def mitsuba() -> ModuleType:
    """Return the module mitsuba, imported after the engine has been checked."""
    engine.ensure_engine()
    import mitsuba as mi

    return mi


class _Blocks:
    """Which variant the blocks below left behind, so that a switch back is made only where somebody notices.

    A switch takes time, since Mitsuba reloads its Python modules. A variant that the caller chose is given back at the
    end of the outermost block; one that an earlier block of ours left is not.
    """

    depth = 0
    left: str | None = None


_rewritten: dict[tuple[str, CodeType], CodeType] = {}
"""By its file and its code: what ``drjit.syntax`` made of each function."""


@contextmanager
def _syntax_once() -> Iterator[None]:
    """Let ``drjit.syntax`` rewrite each function once: parsing all again was most of what a switch took."""
    import drjit

    rewrite = drjit.syntax

    def remembered(function: object = None, **options: bool) -> object:
        if not isinstance(function, FunctionType) or options:
            return rewrite(function, **options)
        key = function.__code__.co_filename, function.__code__
        if key not in _rewritten:
            _rewritten[key] = rewrite(function).__code__
        again = FunctionType(_rewritten[key], function.__globals__)
        again.__defaults__ = function.__defaults__
        return again

    drjit.syntax = remembered
    try:
        yield
    finally:
        drjit.syntax = rewrite


def _switch(mi: ModuleType, name: str) -> None:
    with _syntax_once():
        mi.set_variant(name)


@contextmanager
def _variant(name: str) -> Iterator[ModuleType]:
    """Switch to a variant for a block; give back what the caller, or an enclosing block, had chosen."""
    mi = mitsuba()
    previous = mi.variant()
    give_back = previous is not None and (_Blocks.depth > 0 or previous != _Blocks.left)
    if previous != name:
        _switch(mi, name)
    _Blocks.depth += 1
    try:
        yield mi
    finally:
        _Blocks.depth -= 1
        if give_back and previous != name:
            _switch(mi, previous)
        elif _Blocks.depth == 0 and not give_back:
            _Blocks.left = name


def use(twin: str) -> AbstractContextManager[ModuleType]:
    """Return the context manager of a twin: ``"optical"`` or ``"radio"``; it yields the module mitsuba."""
    backend = engine.ensure_engine()
    return _variant(f"{backend}_{_SUFFIX[twin]}")


def optical() -> AbstractContextManager[ModuleType]:
    """Return a context manager in which Mitsuba runs in the RGB variant."""
    return use("optical")


def radio() -> AbstractContextManager[ModuleType]:
    """Return a context manager in which Mitsuba runs in the polarized variant of Sionna RT."""
    return use("radio")
