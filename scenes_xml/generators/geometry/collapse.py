"""Fewer triangles for a mesh, by collapsing edges onto one of their ends.

Vertices that are left are vertices of the mesh before, so that one choice serves all shapes of one topology.

References
----------
.. [1] M. Garland, P. S. Heckbert, "Surface simplification using quadric error metrics", SIGGRAPH 1997.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from .mesh import Array, Faces

_SIDE = 10.0
"""How much more than the surface its borders weigh."""
_LENGTH = 1e-3
"""How much a long edge costs beside what it moves the surface: triangles stay alike."""


class _Collapse:
    """Triangles around each vertex, and the quadric of each."""

    def __init__(self, points: Array, faces: Faces, labels: npt.NDArray[np.int64]) -> None:
        self.points = points
        self.faces: list[list[int]] = faces.tolist()
        self.labels: list[int] = labels.tolist()
        self.around: list[set[int]] = [set() for _ in points]
        self.alive = len(faces)
        self.quadrics = np.zeros((len(points), 4, 4))
        sides: dict[tuple[int, int], list[int]] = {}
        for number, face in enumerate(self.faces):
            for corner in range(3):
                self.around[face[corner]].add(number)
                edge = face[corner], face[corner - 1]
                sides.setdefault((min(edge), max(edge)), []).append(number)
        for number, face in enumerate(self.faces):
            self._add(face, self._normal(number), self._area(number))
        self.features: list[set[int]] = [set() for _ in points]
        for (first, second), beside in sides.items():
            if len(beside) != 2 or len({self.labels[number] for number in beside}) > 1:
                self.features[first].add(second)
                self.features[second].add(first)
                along = points[second] - points[first]
                across = np.cross(along, self._normal(beside[0]))
                length = float(np.linalg.norm(across))
                if length > 0.0:
                    self._add([first, second], across / length, _SIDE * float(along @ along))

    def _add(self, corners: Sequence[int], normal: Array, weight: float) -> None:
        plane = np.append(normal, -normal @ self.points[corners[0]])
        for corner in corners:
            self.quadrics[corner] += weight * np.outer(plane, plane)

    def _cross(self, corners: Sequence[int]) -> Array:
        first, second, third = self.points[list(corners)]
        (ax, ay, az), (bx, by, bz) = second - first, third - first
        return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])

    def _normal(self, number: int) -> Array:
        cross = self._cross(self.faces[number])
        return cross / max(float(np.linalg.norm(cross)), 1e-30)

    def _area(self, number: int) -> float:
        return 0.5 * float(np.linalg.norm(self._cross(self.faces[number])))

    def neighbours(self, vertex: int) -> set[int]:
        """Return the vertices that share an edge with one."""
        return {corner for number in self.around[vertex] for corner in self.faces[number]} - {vertex}

    def cost(self, gone: int, kept: int) -> float:
        """Return what it costs to move a vertex onto another."""
        place = np.append(self.points[kept], 1.0)
        way = self.points[kept] - self.points[gone]
        area = sum(self._area(number) for number in self.around[gone])
        return float(place @ (self.quadrics[gone] + self.quadrics[kept]) @ place) + _LENGTH * float(way @ way) * area

    def may(self, gone: int, kept: int) -> bool:
        """Return whether a vertex may move onto another: borders stay, nothing folds, no face is left twice."""
        if self.features[gone] and (len(self.features[gone]) != 2 or kept not in self.features[gone]):
            return False
        shared = self.around[gone] & self.around[kept]
        thirds = {corner for number in shared for corner in self.faces[number]} - {gone, kept}
        if not shared or self.neighbours(gone) & self.neighbours(kept) != thirds or len(thirds) != len(shared):
            return False
        for number in self.around[gone] - shared:
            before = self._cross(self.faces[number])
            after = self._cross([kept if corner == gone else corner for corner in self.faces[number]])
            lengths = float(np.linalg.norm(before) * np.linalg.norm(after))
            if float(before @ after) < 0.4 * lengths:
                return False
        return True

    def collapse(self, gone: int, kept: int) -> None:
        """Move a vertex onto another."""
        for number in self.around[gone] & self.around[kept]:
            for corner in self.faces[number]:
                if corner != gone:
                    self.around[corner].discard(number)
            self.around[gone].discard(number)
            self.faces[number] = []
            self.alive -= 1
        for number in self.around[gone]:
            self.faces[number] = [kept if corner == gone else corner for corner in self.faces[number]]
            self.around[kept].add(number)
        self.around[gone] = set()
        self.quadrics[kept] += self.quadrics[gone]
        for other in self.features[gone]:
            self.features[other].discard(gone)
            if other != kept:
                self.features[other].add(kept)
                self.features[kept].add(other)
        self.features[gone] = set()


def collapsed(
    points: Array, faces: Faces, labels: npt.NDArray[np.int64], counts: Sequence[int]
) -> Iterator[tuple[Faces, npt.NDArray[np.int64]]]:
    """Yield faces with at most as many triangles as each of `counts`, as far as borders allow, and their labels.

    Parameters
    ----------
    points : ndarray, shape (num_vertices, 3)
    faces : ndarray of int, shape (num_faces, 3)
    labels : ndarray of int, shape (num_faces,)
        Borders between labels stay where they are.
    counts : sequence of int
        Falling.
    """
    mesh = _Collapse(points, faces, labels)
    heap: list[tuple[float, int, int]] = []

    def push(vertex: int) -> None:
        for other in mesh.neighbours(vertex):
            heapq.heappush(heap, (mesh.cost(vertex, other), vertex, other))

    for vertex in range(len(points)):
        push(vertex)
    for count in counts:
        while mesh.alive > count and heap:
            cost, gone, kept = heapq.heappop(heap)
            if not mesh.around[gone] or kept not in mesh.neighbours(gone):
                continue
            now = mesh.cost(gone, kept)
            if now > cost * 1.01 + 1e-18:
                heapq.heappush(heap, (now, gone, kept))
                continue
            if not mesh.may(gone, kept):
                continue
            mesh.collapse(gone, kept)
            push(kept)
            for other in mesh.neighbours(kept):
                heapq.heappush(heap, (mesh.cost(other, kept), other, kept))
        left = [number for number, face in enumerate(mesh.faces) if face]
        yield np.array([mesh.faces[number] for number in left], np.int64), labels[left]
