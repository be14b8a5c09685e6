"""The file of all bodies: triangles that they share, and where the vertices of each are.

A vertex is coded by how much its offset from the mean body differs from that of a neighbour, in steps of `STEP`.
"""

from __future__ import annotations

import errno
import json
import lzma
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ...cache import DamagedError
from ...codecs import compressed
from ...generators.geometry.mesh import Array, Faces

STEP = 2.5e-4
"""Positions are rounded to this [m]."""
_WEIGHT = 200
"""Steps of a weight from 0 to 1."""
PACK = Path(__file__).resolve().parent / "files.xz"


@dataclass(frozen=True)
class Bodies:
    """Halves of bodies that stand, the left ones; the right ones are their mirror images.

    Attributes
    ----------
    names, segments, regions : tuple of str
    points : ndarray, shape (num_bodies, num_vertices, 3)
        In the walker's frame [m]; those of the middle plane come first.
    num_middle : int
    lengths : tuple of dict
        Of the segments of each body [m].
    faces, face_regions : tuple of ndarray of int
        At the two levels of detail, shape (num_faces, 3) and (num_faces,).
    weights : ndarray, shape (num_vertices, num_segments)
        Sums are 1, within 1 %.
    """

    names: tuple[str, ...]
    segments: tuple[str, ...]
    regions: tuple[str, ...]
    points: Array
    num_middle: int
    lengths: tuple[dict[str, float], ...]
    faces: tuple[Faces, ...]
    face_regions: tuple[npt.NDArray[np.int64], ...]
    weights: Array


def _tree(faces: Faces, num_vertices: int) -> tuple[list[int], list[int]]:
    """Return vertices in an order in which each follows the one that foretells it, and that one, -1 for none."""
    beside: list[set[int]] = [set() for _ in range(num_vertices)]
    for first, second, third in faces.tolist():
        beside[first].update((second, third))
        beside[second].update((first, third))
        beside[third].update((first, second))
    order: list[int] = []
    parents, seen = [-1] * num_vertices, [False] * num_vertices
    for start in range(num_vertices):
        waiting = deque([] if seen[start] else [start])
        seen[start] = True
        while waiting:
            vertex = waiting.popleft()
            order.append(vertex)
            for other in sorted(beside[vertex]):
                if not seen[other]:
                    seen[other], parents[other] = True, vertex
                    waiting.append(other)
    return order, [parents[vertex] for vertex in order]


def _bytes(numbers: npt.NDArray[np.int64]) -> bytes:
    """Return whole numbers of 16 bits as their low bytes and then their high ones, small ones of both signs small."""
    folded = np.where(numbers < 0, -2 * numbers - 1, 2 * numbers)
    if folded.size and folded.max() > 0xFFFF:
        raise ValueError("a number is beyond 16 bits")
    return (folded & 255).astype(np.uint8).tobytes() + (folded >> 8).astype(np.uint8).tobytes()


def _numbers(data: bytes, shape: Sequence[int]) -> npt.NDArray[np.int64]:
    half = len(data) // 2
    low, high = (np.frombuffer(part, np.uint8).astype(np.int64) for part in (data[:half], data[half:]))
    folded = low + (high << 8)
    return np.where(folded & 1, -(folded + 1) // 2, folded // 2).reshape(shape)


def encoded(bodies: Bodies) -> bytes:
    """Return all bodies as bytes; the same bodies give the same bytes with the same liblzma."""
    steps = np.round(bodies.points / STEP).astype(np.int64)
    mean = np.round(steps.mean(axis=0)).astype(np.int64)
    order, parents = _tree(bodies.faces[0], steps.shape[1])
    all_steps = np.concatenate([mean[None], steps - mean])
    coded = all_steps[:, order].copy()
    later = np.array(parents) >= 0
    coded[:, later] -= all_steps[:, np.array(parents)[later]]
    arrays = [coded, np.round(bodies.weights * _WEIGHT).astype(np.int64)]
    for faces, regions in zip(bodies.faces, bodies.face_regions, strict=True):
        arrays += [np.diff(faces.reshape(-1), prepend=0), regions]
    head = {
        "names": bodies.names, "segments": bodies.segments, "regions": bodies.regions, "lengths": bodies.lengths,
        "num_middle": bodies.num_middle, "shapes": [array.shape for array in arrays],
    }  # fmt: skip # a table
    text = json.dumps(head, separators=(",", ":")).encode() + b"\n"
    return compressed(text + b"".join(_bytes(array) for array in arrays), "bytes")


def decoded(packed: bytes) -> Bodies:
    """Return the bodies that `encoded` packed."""
    data = lzma.decompress(packed)
    place = data.index(b"\n") + 1
    head, arrays = json.loads(data[:place]), []
    for shape in head["shapes"]:
        size = 2 * int(np.prod(shape))
        arrays.append(_numbers(data[place : place + size], shape))
        place += size
    coded, weights, *rest = arrays
    faces = tuple(np.cumsum(numbers).reshape(-1, 3) for numbers in rest[::2])
    order, parents = _tree(faces[0], coded.shape[1])
    steps = np.zeros_like(coded)
    for row, (vertex, parent) in enumerate(zip(order, parents, strict=True)):
        steps[:, vertex] = coded[:, row] if parent < 0 else coded[:, row] + steps[:, parent]
    return Bodies(
        tuple(head["names"]), tuple(head["segments"]), tuple(head["regions"]), (steps[:1] + steps[1:]) * STEP,
        head["num_middle"], tuple(head["lengths"]), faces, tuple(rest[1::2]), weights / _WEIGHT,
    )  # fmt: skip # a table


def read_bodies() -> Bodies:
    """Return the bodies of this package.

    Raises
    ------
    DamagedError
        If their file is missing or not what was packed.
    """
    try:
        return decoded(PACK.read_bytes())
    except (OSError, lzma.LZMAError, ValueError, KeyError) as error:
        raise DamagedError(errno.EIO, f"{PACK} is damaged ({error}); install the package again") from error
