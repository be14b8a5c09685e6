"""How an actor bends: the body behind its shapes, when its motion plays, and its vertices with their velocities."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import MeshError, ParameterRangeError, ScarlError
from scarl_sionna.core.untrusted.files import Stamps, stamps

from .bvh import driven, read_bvh, read_bvh_body
from .gltf import read_gltf_body
from .skeleton import Body

Array = npt.NDArray[np.float64]

POSTURES = 64
"""Times of a motion at which an actor's box is measured."""
FORMATS = (".glb", ".gltf", ".bvh")
"""Files that are read."""


@dataclass(frozen=True, eq=False)
class BentMesh:
    """Vertices [m] in the actor's frame and their velocity relative to it [m/s], in its axes, each (n, 3)."""

    vertices: Array
    velocity: Array


@dataclass(frozen=True, eq=False)
class Bending:
    """The motion by which an actor bends, in the world's time.

    Attributes
    ----------
    body : Body
    shapes : mapping of str to str
        Part of the body by the id of the shape.
    actor_from_file : ndarray of float64, shape (3, 4)
    loop : bool
        Whether the motion begins again at its end; else the body stays as it was.
    speed : float
        Seconds of the motion in a second of the world.
    phase : float
        Where the motion is at time 0, in parts of its duration.
    """

    body: Body
    shapes: Mapping[str, str]
    actor_from_file: Array
    loop: bool = True
    speed: float = 1.0
    phase: float = 0.0

    def at(self, time: float) -> dict[str, BentMesh]:
        """Return the mesh of each shape at a time of the world [s]."""
        first, duration = self.body.start, self.body.stop - self.body.start
        played = self.speed * time + self.phase * duration
        if self.loop and duration > 0.0:
            played %= duration
        found = self.body.at(first + played)
        turn, origin = self.actor_from_file[:, :3], self.actor_from_file[:, 3]
        return {
            shape: BentMesh(found[part][0] @ turn.T + origin, self.speed * (found[part][1] @ turn.T))
            for shape, part in self.shapes.items()
        }

    def postures(self) -> Iterator[dict[str, BentMesh]]:
        """Yield the meshes of the shapes over the whole motion."""
        duration = (self.body.stop - self.body.start) / self.speed
        for time in np.linspace(0.0, duration, POSTURES, endpoint=False).tolist() if duration > 0.0 else [0.0]:
            yield self.at(time)


def read_body(
    file: Path, motion: Path | None = None, clip: str | None = None, smooth: bool | None = None, unit: float = 1.0
) -> Body:
    """Return the body of a skinned glTF or a BVH file.

    Parameters
    ----------
    file : Path
    motion : Path, optional
        BVH whose bones have the names of the nodes of `file`, which is a glTF then.
    clip : str, optional
        Name of the animation of a glTF; None: the first.
    smooth : bool, optional
        Cubic splines through the keys or frames; None: for BVH.
    unit : float
        Units of `file` in a unit of `motion`.

    Raises
    ------
    MeshError
        If a file is missing, damaged, contradicts itself, or they do not fit each other.
    """
    if file.suffix.lower() not in FORMATS or (motion is not None and file.suffix.lower() == ".bvh"):
        raise MeshError(f"a '{file.suffix}' file is no body", file, f"give one of {', '.join(FORMATS)}")
    return _read(file, motion, stamps(file, motion), clip, smooth, unit)


@lru_cache(maxsize=32)
def _read(file: Path, motion: Path | None, changed: Stamps, clip: str | None, smooth: bool | None, unit: float) -> Body:
    def read(path: Path, how: Callable[[], Any]) -> Any:  # noqa: ANN401
        try:
            return how()
        except OSError as error:
            raise MeshError(f"cannot be read ({error})", path, "check the path") from error
        except ScarlError:
            raise
        except (ValueError, OverflowError) as error:
            raise MeshError(f"is damaged or not read: {error}", path, "export it again") from error

    if file.suffix.lower() == ".bvh":
        return read(file, lambda: read_bvh_body(file, smooth is not False))  # type: ignore[no-any-return]
    body = read(file, lambda: read_gltf_body(file, clip, bool(smooth) and motion is None))
    if motion is None:
        return body  # type: ignore[no-any-return]
    return read(motion, lambda: driven(body, read_bvh(motion, smooth is not False), unit))  # type: ignore[no-any-return]


def bending_from_table(
    table: Mapping[str, Any], folder: Path, members: Mapping[str, str], phase: float = 0.0
) -> Bending:
    """Return how an actor bends.

    Parameters
    ----------
    table : mapping
        ``[bending]`` of an actor.toml: ``file``, ``placement`` (12 numbers, actor_from_file row by row), ``parts``
        (part of the body by shape id) and, optional, ``motion``, ``clip``, ``smooth``, ``unit``, ``loop``, ``speed``.
    folder : Path
        Of the actor.toml.
    members : mapping of str to str
        Ids in the scene by the ids of the model's shapes.
    phase : float
        See :class:`Bending`.

    Raises
    ------
    MeshError, ParameterRangeError
        If a file cannot be read, or a value is not allowed.
    """
    motion = folder / table["motion"] if "motion" in table else None
    body = read_body(
        folder / table["file"], motion, table.get("clip"), table.get("smooth"), float(table.get("unit", 1.0))
    )
    parts = table["parts"]
    if unknown := sorted(set(parts.values()) - set(body.skins)):
        raise MeshError(f"has no part '{unknown[0]}'", folder / table["file"], "write the model again")
    placement, speed = np.array(table["placement"], dtype=np.float64), float(table.get("speed", 1.0))
    if placement.shape != (12,):
        raise ParameterRangeError("bending.placement", table["placement"], "12 numbers")
    if not speed > 0.0:
        raise ParameterRangeError("bending.speed", speed, "> 0")
    shapes = {members[shape]: part for shape, part in parts.items() if shape in members}
    return Bending(body, shapes, placement.reshape(3, 4), bool(table.get("loop", True)), speed, phase)


def vertex_normals(vertices: Array, faces: npt.NDArray[np.int64]) -> Array:
    """Return unit normals of vertices, those of their faces by area, shape (num_vertices, 3)."""
    across = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    total = np.stack(
        [np.bincount(faces.ravel(), np.repeat(across[:, axis], 3), len(vertices)) for axis in range(3)], axis=1
    )
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.tile([0.0, 0.0, 1.0], (len(vertices), 1)), where=length > 0.0)
