"""Synchronized camera, lidar and MIMO radar data of driving scenes, from Mitsuba and Sionna RT.

Public names are imported when they are first used, so ``import scarl_sionna`` is fast and starts no engine; the stub
beside this file lists them.
"""

from __future__ import annotations

from difflib import get_close_matches
from importlib.metadata import PackageNotFoundError, version

import lazy_loader

_attribute, _names, __all__ = lazy_loader.attach_stub(__name__, __file__)

try:
    __version__ = version("scarl-sionna")
except PackageNotFoundError:  # used from a checkout that is not installed
    __version__ = "0+unknown"


def __getattr__(name: str) -> object:
    """Import a public name on first use (PEP 562)."""
    try:
        return _attribute(name)
    except AttributeError:
        if name in __all__:
            raise  # its module has it no more: not a misspelt name
        near = get_close_matches(name, __all__, n=1)
        hint = f"; did you mean '{near[0]}'?" if near else ""
        raise AttributeError(f"module 'scarl_sionna' has no attribute '{name}'{hint}", name=name) from None


def __dir__() -> list[str]:
    return sorted({*globals(), *_names()})
