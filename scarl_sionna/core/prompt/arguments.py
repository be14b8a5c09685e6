"""Checks at the doors: an argument of a wrong type or unit is refused with what to give instead."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputTypeError, ParameterRangeError

from .refusals import scaled

HOW_TO_POSE = "give ss.Pose([x, y, z], quaternion=[w, x, y, z])"
HOW_TO_RADAR = "give ss.RadarSpec(...), or a preset: ss.RadarSpec.preset('awr1843boost')"
HOW_TO_RIG = "give ss.Rig(...), or a preset: ss.Rig.preset('scarl')"
HOW_TO_STATE = "give world.at(time)"
HOW_TO_WORLD = "give ss.load_scene('highway_guardrail'), or another name or path; of a state it is state.world"

MOST_RADIANS = 4.0 * math.pi
"""No angle of a pose or a direction is larger: two turns. Most angles in degrees are."""
LEAST_FREQUENCY = 1e6
"""No carrier is lower [Hz]: 77 is 77 GHz written in another unit."""


def expect(name: str, value: object, kind: type | tuple[type, ...], remedy: str) -> None:
    """Raise if an argument is not of a type.

    Parameters
    ----------
    name : str
        Of the argument.
    value
    kind : type or tuple of type
    remedy : str
        What to give instead, for instance ``"give world.at(time)"``.

    Raises
    ------
    InputTypeError
        If it is not.
    """
    if not isinstance(value, kind):
        kinds = kind if isinstance(kind, tuple) else (kind,)
        raise InputTypeError(name, value, " or ".join(f"a {one.__name__}" for one in kinds), remedy)


def expect_generator(rng: object, needed: bool = True) -> None:
    """Raise if an argument `rng` is no numpy Generator: a seed, say; None is one too where none is `needed`.

    Raises
    ------
    InputTypeError
        If it is not.
    """
    kinds = (np.random.Generator,) if needed else (np.random.Generator, type(None))
    expect("rng", rng, kinds, "give numpy.random.default_rng(seed)" + ("" if needed else ", or None for no noise"))


def number(name: str, value: object, remedy: str) -> float:
    """Return one number, whatever numeric type it has.

    Raises
    ------
    InputTypeError
        If it is a text, a list or no number at all.
    """
    known: Any = value  # NumPy says what it is
    if isinstance(value, bool | str) or np.ndim(known) or not np.isreal(known):
        raise InputTypeError(name, value, "one number", remedy)
    return float(known)


def numbers(name: str, values: object, count: int, what: str, remedy: str = "") -> npt.NDArray[np.float64]:
    """Return `count` finite numbers as a new array.

    Raises
    ------
    ParameterRangeError
        If they are not so many, not finite or no numbers.
    """
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.zeros(0)
    if array.shape != (count,) or not (
        math.isfinite(sum(own := array.tolist())) or all(map(math.isfinite, own))  # the sum first: it is quicker
    ):
        raise ParameterRangeError(name, _shown(values), what, remedy)
    return array


def check_finite(name: str, values: npt.NDArray[np.number]) -> None:
    """Raise if an array has values that are not finite.

    Raises
    ------
    ParameterRangeError
        With their number, and the index of the first.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(values.sum()):  # one is enough to spoil a sum
            return
    wrong = np.argwhere(~np.isfinite(values))
    if len(wrong):
        first = tuple(int(index) for index in wrong[0])
        raise ParameterRangeError(
            name, f"{len(wrong)} of {values.size} values not finite, first {first}", "finite values"
        )


def check_radians(name: str, angle: npt.ArrayLike) -> None:
    """Raise if an angle was most likely written in degrees: it is larger than `MOST_RADIANS`.

    Raises
    ------
    ParameterRangeError
        If it is, or is not finite.
    """
    values = np.asarray(angle, dtype=np.float64)
    if not (np.abs(values) <= MOST_RADIANS).all():
        worst = float(values.flat[int(np.argmax(~(np.abs(values) <= MOST_RADIANS)))])
        remedy = f"angles are in radians: np.radians({worst:g})" if math.isfinite(worst) else ""
        raise ParameterRangeError(name, f"{worst:g} rad", "finite and within two turns, +-12.57 rad", remedy)


def check_frequency(name: str, frequency: npt.ArrayLike) -> None:
    """Raise if a carrier frequency is below `LEAST_FREQUENCY`, not positive or not finite.

    Raises
    ------
    ParameterRangeError
        If it is.
    """
    values = np.asarray(frequency, dtype=np.float64)
    bad = values[~((values >= LEAST_FREQUENCY) & np.isfinite(values))]
    if bad.size:
        value = float(bad.flat[0])
        remedy = scaled(value, "Hz", {"ge": LEAST_FREQUENCY})
        raise ParameterRangeError(name, f"{value} Hz", f">= {LEAST_FREQUENCY:g} Hz and finite", remedy)


def _shown(values: object) -> str:
    text = repr(values.tolist() if isinstance(values, np.ndarray) else values)
    return text if len(text) <= 60 else text[:57] + "..."
