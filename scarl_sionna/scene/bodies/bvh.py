"""Recorded motion in BVH: the tree of bones, and their angles frame by frame."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from scarl_sionna.core.untrusted.files import MEGABYTE, read_text

from .curves import Curve
from .skeleton import Body, Skeleton, Skin, joined

Array = npt.NDArray[np.float64]

MOST_BYTES = 200 * MEGABYTE
SLIMNESS = 0.15
"""Radius of the capsule around a bone over its length; no measure of a body."""
_MOST_BONES = 2000
_CHANNELS = {f"{axis}{kind}": (kind, "XYZ".index(axis)) for axis in "XYZ" for kind in ("position", "rotation")}


@dataclass
class _Bone:
    name: str
    parent: int
    offset: Array = field(default_factory=lambda: np.zeros(3))
    channels: tuple[str, ...] = ()
    end: Array | None = None


def read_bvh(path: Path, smooth: bool = True) -> Skeleton:
    """Return the skeleton of a BVH file, with its motion from time 0 on, in the unit and the axes of the file.

    Parameters
    ----------
    path : Path
    smooth : bool
        Cubic splines through the frames; else straight lines, and for rotations great circles.

    Raises
    ------
    ValueError
        If it is cut or damaged.
    InputFileError, OSError
        If it is no file of text, too large, or cannot be opened.

    Notes
    -----
    A bone turns by its channels in the order in which they stand: Z, X, Y is R = Rz Rx Ry. Positions of the root add to
    its offset, those of another bone stand in place of it.
    """
    return _parsed(path, smooth)[0]


def read_bvh_body(path: Path, smooth: bool = True) -> Body:
    """Return a body of capsules around the bones of a BVH file; parameters and errors of :func:`read_bvh`."""
    import trimesh  # half a second, which other bodies need not wait for

    skeleton, bones = _parsed(path, smooth)
    whole, _ = joined(skeleton.parents, skeleton.rest, np.zeros_like(skeleton.rest))
    meshes, owners = [], []
    for number, bone in enumerate(bones):
        tips = [other.offset for other in bones if other.parent == number]
        for tip in (*tips, *(() if bone.end is None else (bone.end,))):
            length = float(np.linalg.norm(tip))
            if length > 0.0:
                capsule = trimesh.creation.capsule(length, SLIMNESS * length, count=(12, 8))
                turn = trimesh.geometry.align_vectors((0.0, 0.0, 1.0), tip / length)
                middle = whole[number, :, 3] + tip / 2.0
                meshes.append(
                    ((capsule.vertices - capsule.bounds.mean(axis=0)) @ turn[:3, :3].T + middle, capsule.faces)
                )
                owners.append(np.full(len(capsule.vertices), number))
    if not meshes:
        raise ValueError("it has no bone of any length")
    first = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    owner = np.concatenate(owners)[:, None]
    inverse_bind = np.repeat(np.eye(4)[None, :3], len(bones), axis=0)
    inverse_bind[:, :, 3] = -whole[:, :, 3]  # bones do not turn at rest
    skin = Skin(
        np.concatenate([vertices for vertices, _ in meshes]),
        np.concatenate([faces + start for (_, faces), start in zip(meshes, first[:-1], strict=True)]),
        np.arange(len(bones)),
        inverse_bind,
        owner,
        np.ones(owner.shape),
        np.zeros((0, len(owner), 3)),
    )
    return Body(skeleton, {"body": skin}, *_span(skeleton))


def driven(body: Body, motion: Skeleton, unit: float = 1.0) -> Body:
    """Return a body that moves as the bones of a BVH skeleton of the same names, both at rest in the same posture.

    Parameters
    ----------
    body : Body
        Its own animation is left out.
    motion : Skeleton
    unit : float
        Units of the body's file in a unit of the motion's.

    Raises
    ------
    ValueError
        If a bone that moves has no node of its name.

    Notes
    -----
    A bone's rotation b(t) in its parent, none at rest, becomes P^-1 b(t) N of its node, with the rotations of parent
    and node at rest in the body: so each node turns in space as its bone does. Only the root is moved, not the lengths
    of others.
    """
    own = body.skeleton
    whole, _ = joined(own.parents, own.rest, np.zeros_like(own.rest))
    turned = [Rotation.from_matrix(_unscaled(matrix[:, :3])) for matrix in whole]
    curves: dict[tuple[int, str], Curve] = {}
    for (bone, path), curve in motion.curves.items():
        name = motion.names[bone]
        if name not in own.names:
            raise ValueError(f"bone '{name}' of the motion is no node of the body")
        node = own.names.index(name)
        parent = int(own.parents[node])
        up = Rotation.identity() if parent < 0 else turned[parent]
        if path == "rotation":
            moved = (up.inv() * Rotation.from_quat(np.roll(curve.values, -1, axis=1)) * turned[node]).as_quat()
            curves[node, path] = replace(curve, values=np.roll(moved, 1, axis=1))
        elif motion.parents[bone] < 0:
            scale = np.eye(3) if parent < 0 else whole[parent][:, :3]
            gone = unit * (curve.values - motion.parts[bone][0]) @ np.linalg.inv(scale).T
            curves[node, path] = replace(curve, values=own.parts[node][0] + gone)
    skeleton = replace(own, curves=curves)
    return replace(body, skeleton=skeleton, start=_span(skeleton)[0], stop=_span(skeleton)[1])


def _unscaled(matrix: Array) -> Array:
    lengths = np.linalg.norm(matrix, axis=0)
    if not lengths.all():
        raise ValueError("a node of the body has the scale 0")
    return matrix / lengths


def _span(skeleton: Skeleton) -> tuple[float, float]:
    times = [curve.times for curve in skeleton.curves.values()]
    return (
        min((float(time[0]) for time in times), default=0.0),
        max((float(time[-1]) for time in times), default=0.0),
    )


def _parsed(path: Path, smooth: bool) -> tuple[Skeleton, list[_Bone]]:
    words = read_text(path, MOST_BYTES).split()
    try:
        bones, at = _hierarchy(words)
        frames, step = _frames(words, at, sum(len(bone.channels) for bone in bones))
    except IndexError as error:
        raise ValueError("it is cut") from error
    times = step * np.arange(len(frames), dtype=np.float64)
    curves: dict[tuple[int, str], Curve] = {}
    kind, first = "SMOOTH" if smooth else "LINEAR", 0
    for number, bone in enumerate(bones):
        rows = frames[:, first : first + len(bone.channels)]
        first += len(bone.channels)
        position = np.tile(bone.offset, (len(frames), 1))
        turn = []
        for name, row in zip(bone.channels, rows.T, strict=True):
            what, index = _CHANNELS[name]
            if what == "rotation":
                turn.append((index, row))
            else:
                position[:, index] = row + (bone.offset[index] if bone.parent < 0 else 0.0)
        if len(turn) < len(bone.channels):
            curves[number, "translation"] = Curve(times, position, kind)
        if turn:
            order = "".join("XYZ"[index] for index, _ in turn)
            rotation = Rotation.from_euler(order, np.stack([row for _, row in turn], axis=1), degrees=True)
            curves[number, "rotation"] = Curve(times, np.roll(rotation.as_quat().reshape(-1, 4), 1, axis=1), kind, True)
    rest = np.repeat(np.eye(4)[None, :3], len(bones), axis=0)
    rest[:, :, 3] = [bone.offset for bone in bones]
    parts = [(bone.offset, np.array([1.0, 0.0, 0.0, 0.0]), np.ones(3)) for bone in bones]
    parents = np.array([bone.parent for bone in bones], dtype=np.int64)
    return Skeleton(tuple(bone.name for bone in bones), parents, rest, parts, curves), bones


def _hierarchy(words: list[str]) -> tuple[list[_Bone], int]:
    """Return the bones, and the place of the word behind them."""
    if words[0] != "HIERARCHY":
        raise ValueError("it does not begin with HIERARCHY")
    bones, open_ones, at = list[_Bone](), list[int](), 1
    while words[at] != "MOTION":
        word = words[at]
        if word in ("ROOT", "JOINT"):
            if (word == "ROOT") != (not open_ones) or len(bones) >= _MOST_BONES:
                raise ValueError(f"'{words[at + 1][:40]}' stands where no {word} may, or there are too many")
            bones.append(_Bone(words[at + 1], open_ones[-1] if open_ones else -1))
            if words[at + 2] != "{":
                raise ValueError(f"'{words[at + 1][:40]}' has no {{")
            open_ones.append(len(bones) - 1)
            at += 3
        elif word == "End" and words[at + 2 : at + 4] == ["{", "OFFSET"] and words[at + 7] == "}" and open_ones:
            bones[open_ones[-1]].end = _numbers(words[at + 4 : at + 7])
            at += 8
        elif word == "OFFSET" and open_ones:
            bones[open_ones[-1]].offset = _numbers(words[at + 1 : at + 4])
            at += 4
        elif word == "CHANNELS" and open_ones:
            count = int(words[at + 1])
            names = tuple(words[at + 2 : at + 2 + count])
            if not 0 <= count <= 6 or len(set(names)) != count or any(name not in _CHANNELS for name in names):
                raise ValueError(f"bone '{bones[open_ones[-1]].name[:40]}' has channels that are not known")
            bones[open_ones[-1]].channels = names
            at += 2 + count
        elif word == "}" and open_ones:
            open_ones.pop()
            at += 1
        else:
            raise ValueError(f"'{word[:40]}' is not expected")
    if open_ones or not bones:
        raise ValueError("a bone is not closed, or there is none")
    return bones, at + 1


def _frames(words: list[str], at: int, width: int) -> tuple[Array, float]:
    if words[at] != "Frames:" or words[at + 2 : at + 4] != ["Frame", "Time:"]:
        raise ValueError("MOTION states no Frames: and Frame Time:")
    count, step = int(words[at + 1]), float(words[at + 4])
    if count < 1 or width < 1 or not (np.isfinite(step) and step > 0.0):
        raise ValueError(f"{count} frames of {width} channels every {step} s are no motion")
    values = words[at + 5 :]
    if len(values) != count * width:
        raise ValueError(f"{len(values)} numbers for {count} frames of {width} channels: it is cut, or has more")
    return _numbers(values).reshape(count, width), step


def _numbers(words: list[str]) -> Array:
    values = np.array(words, dtype=np.float64)
    if not np.isfinite(values).all():
        raise ValueError("a number is not finite")
    return values
