"""Values as files hold them: depth as a 16-bit code, plain data for JSON, JSON texts with their own checksum."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

JsonValue: TypeAlias = "dict[str, JsonValue] | list[JsonValue] | str | int | float | bool | None"
"""What JSON can hold."""

DEPTH_RATIO = 20_000.0
"""Largest over smallest depth of the 16-bit code; half a step is ln(DEPTH_RATIO) / 65534 / 2 = 7.6e-5 of the depth."""
DEPTH_FORMULA = (
    "code 0: nothing hit (infinite); code 1 to 65535: "
    f"depth [m] = max_distance * {DEPTH_RATIO:g} ** ((code - 65535) / 65534), max_distance from the sensor's spec"
)
_LAST_CODE = 65535
_CHECKSUM = ',\n "checksum": "'


def encode_depth(depth: npt.NDArray[np.float32], max_distance: float) -> npt.NDArray[np.uint16]:
    """Return depth [m] as a logarithmic 16-bit code.

    Parameters
    ----------
    depth : ndarray of float32, any shape
        [m]; inf where nothing is hit. Of a camera that the code does for, see `schema.camera_table`.
    max_distance : float
        Depth of the last code [m]. Smaller depths than ``max_distance / DEPTH_RATIO`` become that depth.

    Notes
    -----
    *Error*: at most 7.6e-5 of the depth (7.6 mm at 100 m) from ``max_distance / DEPTH_RATIO`` on.
    """
    values = np.asarray(depth, dtype=np.float64)
    hit = np.isfinite(values)
    ratio = np.where(hit, np.maximum(values, max_distance / DEPTH_RATIO), max_distance) / max_distance
    code = _LAST_CODE + np.log(ratio) / np.log(DEPTH_RATIO) * (_LAST_CODE - 1)
    return np.where(hit, np.clip(np.rint(code), 1, _LAST_CODE), 0).astype(np.uint16)


def decode_depth(code: npt.NDArray[np.uint16], max_distance: float) -> npt.NDArray[np.float32]:
    """Return the depth [m] of a 16-bit code; inf for code 0."""
    exponent = (code.astype(np.float64) - _LAST_CODE) / (_LAST_CODE - 1)
    return np.where(code == 0, np.inf, max_distance * DEPTH_RATIO**exponent).astype(np.float32)


def plain(value: object) -> JsonValue:
    """Return a value as data that JSON can hold: mappings, lists, numbers, texts."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in (sorted(value) if isinstance(value, set | frozenset) else value)]
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return str(value)


def with_checksum(text: str) -> str:
    """Return the text of a JSON table with the SHA-256 of all before it as the table's last entry, ``"checksum"``."""
    body = text[: text.rindex("\n}")]
    return f'{body}{_CHECKSUM}{hashlib.sha256(body.encode()).hexdigest()}"\n}}\n'


def checksum_of(text: bytes) -> str:
    """Return what the last entry of a text of `with_checksum` should be."""
    return hashlib.sha256(text[: max(text.rfind(_CHECKSUM.encode()), 0)]).hexdigest()
