"""A tree of nodes with places that change over time, and the meshes that follow them, with exact velocities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .curves import Curve, rotation_with_rate

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

PATHS = ("translation", "rotation", "scale")
"""What of a node may change."""


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Nodes, parents before their children.

    Attributes
    ----------
    names : tuple of str
    parents : ndarray of int64, shape (num_nodes,)
        -1 for a root.
    rest : ndarray of float64, shape (num_nodes, 3, 4)
        parent_from_node without animation.
    parts : sequence of tuple
        Translation (3,), rotation [w, x, y, z] and scale (3,) of each node without animation.
    curves : mapping of (node, path) to Curve
    """

    names: tuple[str, ...]
    parents: Index
    rest: Array
    parts: Sequence[tuple[Array, Array, Array]]
    curves: Mapping[tuple[int, str], Curve]

    def at(self, time: float) -> tuple[Array, Array]:
        """Return body_from_node and its derivative [1/s] at a time [s], each of shape (num_nodes, 3, 4)."""
        local, rate = self.rest.copy(), np.zeros_like(self.rest)
        for node in sorted({node for node, _ in self.curves}):
            local[node], rate[node] = self._local(node, time)
        return joined(self.parents, local, rate)

    def _local(self, node: int, time: float) -> tuple[Array, Array]:
        values = []
        for path, rest in zip(PATHS, self.parts[node], strict=True):
            curve = self.curves.get((node, path))
            values.append((rest, np.zeros_like(rest)) if curve is None else curve.at(time))
        (place, speed), turn, (scale, growth) = values
        rotation, spin = rotation_with_rate(*turn)
        matrix = np.concatenate([rotation * scale, place[:, None]], axis=1)
        return matrix, np.concatenate([spin * scale + rotation * growth, speed[:, None]], axis=1)


def joined(parents: Index, local: Array, rate: Array) -> tuple[Array, Array]:
    """Return body_from_node and its derivative, from each node's own in its parent, all of shape (num_nodes, 3, 4)."""
    whole, moving = local.copy(), rate.copy()
    for node, parent in enumerate(parents.tolist()):
        if parent >= 0:
            up, rising = whole[parent], moving[parent]
            whole[node] = up[:, :3] @ local[node]
            moving[node] = rising[:, :3] @ local[node] + up[:, :3] @ rate[node]
            whole[node, :, 3] += up[:, 3]
            moving[node, :, 3] += rising[:, 3]
    return whole, moving


@dataclass(frozen=True, eq=False)
class Skin:
    """A mesh whose vertices follow nodes, each several by weights.

    Attributes
    ----------
    vertices : ndarray of float64, shape (num_vertices, 3)
        As the file has them.
    faces : ndarray of int64, shape (num_faces, 3)
    nodes : ndarray of int64, shape (num_joints,)
        Node of each joint.
    inverse_bind : ndarray of float64, shape (num_joints, 3, 4)
        node_from_mesh of each joint when the mesh was bound.
    joints : ndarray of int64, shape (num_vertices, num_influences)
    weights : ndarray of float64, shape (num_vertices, num_influences)
        Adding up to 1.
    targets : ndarray of float64, shape (num_targets, num_vertices, 3)
        What a morph target adds to the vertices.
    target_weights : Curve
        Of width num_targets.
    material : str
        Name in the file, "" for none.
    color : tuple of float or None
        Linear RGB, 0 to 1.
    uv : ndarray of float64, shape (num_vertices, 2), or None
        Texture coordinates, v from the image's top.
    texture : int or None
        Number of the base colour's texture in the file.
    """

    vertices: Array
    faces: Index
    nodes: Index
    inverse_bind: Array
    joints: Index
    weights: Array
    targets: Array
    target_weights: Curve | None = None
    material: str = ""
    color: tuple[float, ...] | None = None
    uv: Array | None = None
    texture: int | None = None

    def at(self, time: float, body_from_node: Array, rate: Array) -> tuple[Array, Array]:
        r"""Return the vertices and their velocities [1/s] at a time [s], each (num_vertices, 3), in the body's axes.

        Notes
        -----
        Linear blend skinning and its derivative, with the morphed vertex :math:`x(t)`:

        .. math:: y = \sum_k w_k G_k B_k x, \quad \dot y = \sum_k w_k (\dot G_k B_k x + G_k B_k \dot x)
        """
        vertices, moving = self.vertices, None
        if self.target_weights is not None:
            weights, growth = self.target_weights.at(time)
            vertices = vertices + np.einsum("t,tni->ni", weights, self.targets)
            moving = np.einsum("t,tni->ni", growth, self.targets)
        blend, turning = (self._blended(matrices) for matrices in (body_from_node, rate))
        place = np.einsum("nij,nj->ni", blend[:, :, :3], vertices) + blend[:, :, 3]
        speed = np.einsum("nij,nj->ni", turning[:, :, :3], vertices) + turning[:, :, 3]
        if moving is not None:
            speed += np.einsum("nij,nj->ni", blend[:, :, :3], moving)
        return place, speed

    def _blended(self, matrices: Array) -> Array:
        own = matrices[self.nodes]
        palette = own[:, :, :3] @ self.inverse_bind
        palette[:, :, 3] += own[:, :, 3]
        return np.asarray(np.einsum("nk,nkij->nij", self.weights, palette[self.joints]))


@dataclass(frozen=True, eq=False)
class Body:
    """A skeleton, the skins around it by the names of the parts, and when its motion starts and stops [s]."""

    skeleton: Skeleton
    skins: Mapping[str, Skin]
    start: float
    stop: float

    def at(self, time: float) -> dict[str, tuple[Array, Array]]:
        """Return vertices and their rates [1/s] of all parts at a time [s], in the file's axes and unit."""
        nodes = self.skeleton.at(time)
        return {name: skin.at(time, *nodes) for name, skin in self.skins.items()}
