"""Skinned and animated glTF as bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.untrusted.gltf_file import (
    GltfAnimation,
    GltfFile,
    GltfMaterial,
    GltfNode,
    GltfPrimitive,
    read_gltf,
)

from .curves import Curve, rotation_with_rate
from .skeleton import PATHS, Body, Skeleton, Skin

Array = npt.NDArray[np.float64]

_TRIANGLES = 4
_MOST_INFLUENCES = 8
_SMOOTH = {"LINEAR": "SMOOTH"}


def read_gltf_body(path: Path, clip: str | None = None, smooth: bool = False) -> Body:
    """Return the body of a glTF file.

    Parameters
    ----------
    path : Path
    clip : str, optional
        Name of the animation; None: the first.
    smooth : bool
        Cubic splines through the keys in place of LINEAR.

    Raises
    ------
    ValueError
        If something in the file is missing, damaged, contradicts itself or is not read.
    InputFileError, OSError
        If a file is none, too large, or cannot be opened.
    """
    file = read_gltf(path)
    nodes = file.tables.nodes
    order, parents = _order(nodes)
    place = {node: number for number, node in enumerate(order)}
    chosen = _clip(file.tables.animations, clip)
    curves, weights = ({}, {}) if chosen is None else _curves(file, chosen, smooth)
    parts = [_parts(nodes[node]) for node in order]
    skeleton = Skeleton(
        tuple(nodes[node].name for node in order),
        np.array([place.get(parents[node], -1) for node in order], dtype=np.int64),
        np.array([_matrix(nodes[node], part) for node, part in zip(order, parts, strict=True)]).reshape(-1, 3, 4),
        parts,
        {(place[node], path): curve for (node, path), curve in curves.items()},
    )
    for node, _ in curves:
        if nodes[node].matrix is not None:
            raise ValueError(f"node {node} has a matrix and is animated")
    skins: dict[str, Skin] = {}
    for node in order:
        for name, skin in _skins(file, node, place, weights.get(node)).items():
            number, own = 1, name
            while own in skins:
                number += 1
                own = f"{name}_{number}"
            skins[own] = skin
    if not skins:
        raise ValueError("it holds no triangles")
    times = [curve.times for curve in (*curves.values(), *weights.values())]
    start = min((float(time[0]) for time in times), default=0.0)
    return Body(skeleton, skins, start, max((float(time[-1]) for time in times), default=start))


def _order(nodes: Sequence[GltfNode]) -> tuple[list[int], list[int]]:
    """Return all nodes, parents before children, and the parent of each, -1 for none."""
    parents = [-1] * len(nodes)
    for number, node in enumerate(nodes):
        for child in node.children:
            if not 0 <= child < len(nodes) or parents[child] >= 0:
                raise ValueError(f"node {child}, a child of node {number}, is not there or has another parent")
            parents[child] = number
    order = [number for number, parent in enumerate(parents) if parent < 0]
    for number in order:  # grows as it goes
        order.extend(nodes[number].children)
    if len(order) != len(nodes):
        raise ValueError("nodes are their own parents")
    return order, parents


def _parts(node: GltfNode) -> tuple[Array, Array, Array]:
    """Return translation, rotation [w, x, y, z] and scale of a node."""
    rotation = np.roll(np.array(node.rotation, dtype=np.float64), 1)
    if not rotation.any():
        raise ValueError(f"the rotation of node '{node.name}' is zero")
    return np.array(node.translation, dtype=np.float64), rotation, np.array(node.scale, dtype=np.float64)


def _matrix(node: GltfNode, parts: tuple[Array, Array, Array]) -> Array:
    if node.matrix is not None:
        return np.array(node.matrix, dtype=np.float64).reshape(4, 4).T[:3]
    rotation, _ = rotation_with_rate(parts[1], np.zeros(4))
    return np.concatenate([rotation * parts[2], parts[0][:, None]], axis=1)


def _clip(animations: Sequence[GltfAnimation], name: str | None) -> GltfAnimation | None:
    if name is None:
        return animations[0] if animations else None
    found = [animation for animation in animations if animation.name == name]
    if not found:
        listed = ", ".join(f"'{animation.name}'" for animation in animations) or "none"
        raise ValueError(f"it has no animation '{name}'; there are {listed}")
    return found[0]


def _curves(
    file: GltfFile, animation: GltfAnimation, smooth: bool
) -> tuple[dict[tuple[int, str], Curve], dict[int, Curve]]:
    """Return the curves of places by node and path, and of the weights of morph targets by node."""
    places, weights = dict[tuple[int, str], Curve](), dict[int, Curve]()
    for channel in animation.channels:
        node, path = channel.target.node, channel.target.path
        if node is None or path not in (*PATHS, "weights"):
            continue
        if not 0 <= node < len(file.tables.nodes) or not 0 <= channel.sampler < len(animation.samplers):
            raise ValueError(f"a channel of animation '{animation.name}' names a node or sampler that is not there")
        sampler = animation.samplers[channel.sampler]
        times = file.array(sampler.input, "SCALAR")[:, 0]
        if (np.diff(times) <= 0.0).any():
            raise ValueError(f"the times of animation '{animation.name}' do not rise")
        kind = sampler.interpolation
        if kind not in ("LINEAR", "STEP", "CUBICSPLINE"):
            raise ValueError(f"the interpolation '{kind[:40]}' is not known")
        width = {"rotation": "VEC4", "weights": "SCALAR"}.get(path, "VEC3")
        values = file.array(sampler.output, width)
        keys = len(times) * (3 if kind == "CUBICSPLINE" else 1)
        if path == "weights":
            values = values.reshape(keys, -1) if values.size % keys == 0 else values
        if len(values) != keys:
            raise ValueError(f"animation '{animation.name}' has {len(values)} values for {len(times)} times")
        if path == "rotation":
            values = np.roll(values, 1, axis=1)
        if kind == "CUBICSPLINE":
            values = values.reshape(len(times), 3, -1)
        if path == "rotation" and not (values[:, 1] if kind == "CUBICSPLINE" else values).any(axis=1).all():
            raise ValueError(f"a rotation of animation '{animation.name}' is zero")
        curve = Curve(times, values, _SMOOTH.get(kind, kind) if smooth else kind, path == "rotation")
        if path == "weights":
            weights[node] = curve
        else:
            places[node, path] = curve
    return places, weights


def _skins(file: GltfFile, node: int, place: Mapping[int, int], weights: Curve | None) -> dict[str, Skin]:
    """Return the meshes of a node by name."""
    tables, own = file.tables, file.tables.nodes[node]
    if own.mesh is None:
        return {}
    if not 0 <= own.mesh < len(tables.meshes):
        raise ValueError(f"mesh {own.mesh} is not there")
    mesh = tables.meshes[own.mesh]
    nodes, inverse_bind = np.array([place[node]]), np.eye(4)[None, :3]
    if own.skin is not None:
        if not 0 <= own.skin < len(tables.skins):
            raise ValueError(f"skin {own.skin} is not there")
        skin = tables.skins[own.skin]
        if not all(0 <= joint < len(tables.nodes) for joint in skin.joints):
            raise ValueError(f"skin {own.skin} has joints that are not there")
        nodes = np.array([place[joint] for joint in skin.joints])
        inverse_bind = np.broadcast_to(inverse_bind, (len(nodes), 3, 4))
        if skin.inverse_bind is not None:
            inverse_bind = file.array(skin.inverse_bind, "MAT4").reshape(-1, 4, 4).transpose(0, 2, 1)[:, :3]
            if len(inverse_bind) < len(nodes):
                raise ValueError(f"skin {own.skin} has {len(inverse_bind)} bind matrices for {len(nodes)} joints")
            inverse_bind = inverse_bind[: len(nodes)]
    found = {}
    base = own.name or mesh.name or f"node{node}"
    for number, primitive in enumerate(mesh.primitives):
        where = f"primitive {number} of mesh {own.mesh}"
        vertices, faces = _triangles(file, primitive, where)
        joints, shares = _influences(file, primitive, len(vertices), len(nodes), own.skin is not None, where)
        targets = [file.array(one["POSITION"], "VEC3") for one in primitive.targets if "POSITION" in one]
        if targets and (len(targets) != len(primitive.targets) or any(len(one) != len(vertices) for one in targets)):
            raise ValueError(f"the morph targets of {where} do not fit its vertices")
        curve = _target_weights(own.weights or mesh.weights, weights, len(targets), where)
        material = _material(file, primitive.material)
        color = None if material is None or material.pbr.color is None else tuple(material.pbr.color[:3])
        name = base if len(mesh.primitives) == 1 else f"{base}_{number}"
        found[name] = Skin(
            vertices, faces, nodes, inverse_bind, joints, shares, np.array(targets).reshape(-1, len(vertices), 3),
            curve, "" if material is None else material.name, color,
            *_texture(file, primitive, material, len(vertices)),
        )  # fmt: skip # a table
    return found


def _texture(
    file: GltfFile, primitive: GltfPrimitive, material: GltfMaterial | None, count: int
) -> tuple[Array | None, int | None]:
    """Return texture coordinates and the number of the texture of a primitive's base colour; None where it has none."""
    info = None if material is None else material.pbr.texture
    name = "" if info is None else f"TEXCOORD_{info.coordinates}"
    if info is None or name not in primitive.attributes:
        return None, None
    uv = file.array(primitive.attributes[name], "VEC2")
    return (uv, info.index) if len(uv) == count else (None, None)


def _material(file: GltfFile, number: int | None) -> GltfMaterial | None:
    if number is None:
        return None
    if not 0 <= number < len(file.tables.materials):
        raise ValueError(f"material {number} is not there")
    return file.tables.materials[number]


def _triangles(file: GltfFile, primitive: GltfPrimitive, where: str) -> tuple[Array, npt.NDArray[np.int64]]:
    if primitive.mode != _TRIANGLES:
        raise ValueError(f"{where} has mode {primitive.mode}, triangles (4) are read")
    if "POSITION" not in primitive.attributes:
        raise ValueError(f"{where} has no positions")
    vertices = file.array(primitive.attributes["POSITION"], "VEC3")
    if primitive.indices is None:
        faces = np.arange(len(vertices))
    else:
        faces = file.array(primitive.indices, "SCALAR")[:, 0].astype(np.int64)
    if len(faces) % 3 or faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError(f"{where} has indices that are no triangles, or of vertices that are not there")
    return vertices, faces.reshape(-1, 3)


def _influences(
    file: GltfFile, primitive: GltfPrimitive, count: int, num_joints: int, is_skinned: bool, where: str
) -> tuple[npt.NDArray[np.int64], Array]:
    """Return joints and weights of each vertex; a mesh without skin follows its node."""
    if not is_skinned:
        return np.zeros((count, 1), dtype=np.int64), np.ones((count, 1))
    columns = []
    for number in range(_MOST_INFLUENCES // 4):
        names = f"JOINTS_{number}", f"WEIGHTS_{number}"
        if all(name in primitive.attributes for name in names):
            columns.append([file.array(primitive.attributes[name], "VEC4") for name in names])
    if not columns:
        raise ValueError(f"{where} has a skin, but no JOINTS_0 and WEIGHTS_0")
    joints = np.concatenate([column[0] for column in columns if len(column[0]) == count], axis=1).astype(np.int64)
    weights = np.concatenate([column[1] for column in columns if len(column[1]) == count], axis=1)
    total = weights.sum(axis=1, keepdims=True)
    if joints.shape != weights.shape or (weights < 0.0).any() or (total <= 0.0).any():
        raise ValueError(f"{where} has vertices without weights, or negative ones")
    if ((joints < 0) | (joints >= num_joints)).any():
        raise ValueError(f"{where} has joints beyond the {num_joints} of its skin")
    return joints, weights / total


def _target_weights(rest: list[float] | None, curve: Curve | None, count: int, where: str) -> Curve | None:
    if count == 0:
        return None
    if curve is None:
        curve = Curve(np.zeros(1), np.array([rest if rest is not None else [0.0] * count], dtype=np.float64))
    if curve.values.shape[-1] != count:
        raise ValueError(f"{where} has {count} morph targets and {curve.values.shape[-1]} weights")
    return curve
