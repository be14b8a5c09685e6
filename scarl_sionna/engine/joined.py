"""The meshes of the optical twin, joined: those of one BSDF are one mesh, and all of them stand in one group.

Mitsuba records what a ray may meet anew for each image, mesh by mesh, and builds the tree over a group without split
triangles: of a crossing with 100 actors, 2,421 meshes that are some 150 joined ones, a tenth of the one and half of the
other (docs/performance.md). Which triangles there are, and where, stays the same to the last bit.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from functools import lru_cache
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from .device import Device
from .types import MitsubaObject

Array = npt.NDArray[np.float64]
Single = npt.NDArray[np.float32]

PARALLEL = False
"""Mitsuba 3.9 with several loader threads loses the memory of a texture at each load (12 MB for one of 1024 x 1024),
which Dr.Jit counts as allocated and never frees; with one thread it does not, and a scene loads as fast."""

_PLUGIN = "scarl_loaded_objects"
_POSITIONS, _NORMALS, _FACES = "vertex_positions", "vertex_normals", "faces"
_FIELDS = {_POSITIONS: np.float32, _NORMALS: np.float32, "vertex_texcoords": np.float32, _FACES: np.uint32}
"""What a mesh has, by its name in the engine."""


class PartPlace(NamedTuple):
    """Where the engine has the faces of a part."""

    number: int
    """Of their mesh, as intersections report it."""
    first: int
    """Of them in that mesh."""
    size: int
    """How many they are."""


class _Rows(NamedTuple):
    """Of a part, in the mesh that it is joined to."""

    mesh: int
    vertices: slice
    faces: slice


@lru_cache(maxsize=4)
def _plugin(mi: ModuleType, variant_name: str) -> None:
    """Define and register, for the variant that runs, an object that only holds what an XML has in it."""

    class LoadedObjects(mi.SamplingIntegrator):  # type: ignore[misc, name-defined]
        """Of all kinds of plugins that may hold others the one that Python can define; it renders nothing."""

        def __init__(self, props: MitsubaObject) -> None:
            super().__init__(props)
            self.held = [held for _, held in props.objects()]

    mi.register_integrator(_PLUGIN, LoadedObjects)


def loaded_objects(mi: ModuleType, xml: str) -> list[MitsubaObject]:
    """Return the objects in a scene's XML, in its order, without a scene around them and so without a tree.

    Parameters
    ----------
    mi : module
        In the variant for which they are loaded.
    xml : str
        With ``<scene>`` as its root.
    """
    _plugin(mi, mi.variant())
    root = ET.fromstring(xml)
    root.tag = "integrator"
    root.set("type", _PLUGIN)
    holder: Any = mi.load_string(ET.tostring(root, encoding="unicode"), optimize=False, parallel=PARALLEL)
    held, holder.held = holder.held, []
    return list(held)


def scene_of(mi: ModuleType, objects: Sequence[MitsubaObject]) -> MitsubaObject:
    """Return a scene of loaded objects, which keep their ids: some, with dots in them, are no keys of a dictionary."""
    names = [item.id() for item in objects]
    scene = mi.load_dict({"type": "scene", **{f"{row:06d}": item for row, item in enumerate(objects)}})
    for item, name in zip(objects, names, strict=True):
        item.set_id(name)
    return scene


def can_be_joined(shape: MitsubaObject) -> bool:
    """Return whether a mesh may stand in a group with others: it shines not and has no attributes of its own."""
    return shape.emitter() is None and not shape.has_mesh_attributes()


class JoinedMeshes:
    """Meshes joined by BSDF, those that may move apart from those that stand; inside the variant they are made in.

    Parameters
    ----------
    mi : module
    shapes : sequence of mitsuba.Mesh
        At least one, all of which :func:`can_be_joined`.
    moving : set of str
        The ids of those that may move.

    Attributes
    ----------
    objects : tuple of mitsuba.Object
        For a scene: the group and the one place where it stands.
    numbers : tuple of int
        Of the meshes, in the order of the group.
    places : dict of str to PartPlace
    """

    def __init__(self, mi: ModuleType, shapes: Sequence[MitsubaObject], moving: AbstractSet[str]) -> None:
        self._rows: dict[str, _Rows] = {}
        self._held: dict[int, dict[str, Single]] = {}
        self._changed: set[int] = set()
        kinds: dict[tuple[object, ...], list[MitsubaObject]] = {}
        for shape in shapes:
            kinds.setdefault((*_look(shape), shape.id() in moving), []).append(shape)
        self._meshes = [self._join(mi, number, own) for number, own in enumerate(kinds.values())]
        meshes = [each.mesh for each in self._meshes]
        self._group = mi.load_dict(
            {"type": "shapegroup", **{f"joined-{row:06d}": mesh for row, mesh in enumerate(meshes)}}
        )
        self.objects = self._group, mi.load_dict({"type": "instance", "group": self._group})
        self.numbers = tuple(number_of(mi, mesh) for mesh in meshes)
        self.places = {
            name: PartPlace(self.numbers[rows.mesh], rows.faces.start, rows.faces.stop - rows.faces.start)
            for name, rows in self._rows.items()
        }

    def _join(self, mi: ModuleType, number: int, shapes: Sequence[MitsubaObject]) -> _Mesh:
        """Return one mesh of several that look alike."""
        look = shapes[0]
        fields: dict[str, list[npt.NDArray[Any]]] = {}
        num_vertices = num_faces = 0
        for shape in shapes:
            read = _Mesh(mi, shape)
            own = {name: read.read(mi, name) for name in _FIELDS}
            vertices = slice(num_vertices, num_vertices + len(own[_POSITIONS]) // 3)
            faces = slice(num_faces, num_faces + len(own[_FACES]) // 3)
            self._rows[shape.id()] = _Rows(number, vertices, faces)
            own[_FACES] = own[_FACES] + np.uint32(num_vertices)
            num_vertices, num_faces = vertices.stop, faces.stop
            for name, values in own.items():
                fields.setdefault(name, []).append(values)
        given = mi.Properties()
        given["mesh_bsdf"] = look.bsdf()
        given["face_normals"], given["flip_normals"] = look.has_face_normals(), look.has_flipped_normals()
        mesh = mi.Mesh(
            f"joined-{number:06d}",
            num_vertices,
            num_faces,
            props=given,
            has_vertex_normals=look.has_vertex_normals(),
            has_vertex_texcoords=look.has_vertex_texcoords(),
        )
        joined = _Mesh(mi, mesh)
        joined.write(mi, {name: np.concatenate(values) for name, values in fields.items()})
        return joined

    def read(self, mi: ModuleType) -> dict[str, tuple[Array, npt.NDArray[np.int64]]]:
        """Return vertices (n, 3) [m] and faces (m, 3) of every part, where it stands now."""
        held = [[mesh.read(mi, name).reshape(-1, 3) for name in (_POSITIONS, _FACES)] for mesh in self._meshes]
        found = {}
        for name, rows in self._rows.items():
            vertices, faces = held[rows.mesh][0][rows.vertices], held[rows.mesh][1][rows.faces]
            found[name] = vertices.astype(np.float64), faces.astype(np.int64) - rows.vertices.start
        return found

    def normals(self, mi: ModuleType, name: str) -> Array:
        """Return the shading normals of a part as it stands now, (n, 3), without rows for a mesh that has none."""
        rows = self._rows[name]
        return self._fields_of(mi, rows.mesh)[_NORMALS][rows.vertices].astype(np.float64)

    def _fields_of(self, mi: ModuleType, mesh: int) -> dict[str, Single]:
        """Return positions and normals of a mesh that moves, each (n, 3), kept from frame to frame."""
        if mesh not in self._held:
            read = self._meshes[mesh].read
            self._held[mesh] = {name: read(mi, name).reshape(-1, 3) for name in (_POSITIONS, _NORMALS)}
        return self._held[mesh]

    def move(self, mi: ModuleType, name: str, vertices: Array, normals: Array | None) -> None:
        """Take vertices [m] and shading normals of a part, each (n, 3), in the world, for :meth:`update`."""
        rows = self._rows[name]
        own = self._fields_of(mi, rows.mesh)
        own[_POSITIONS][rows.vertices] = vertices
        if normals is not None:
            own[_NORMALS][rows.vertices] = normals
        self._changed.add(rows.mesh)

    def update(self, mi: ModuleType) -> None:
        """Write what has moved; the scene has to be told that something has."""
        for mesh in sorted(self._changed):
            self._meshes[mesh].write(mi, self._held[mesh])
        if self._changed:
            self._group.parameters_changed()
        self._changed.clear()


def _look(shape: MitsubaObject) -> tuple[object, ...]:
    """Return all by which meshes differ beside their triangles."""
    return (
        shape.bsdf().id(),
        shape.has_vertex_normals(),
        shape.has_vertex_texcoords(),
        shape.has_face_normals(),
        shape.has_flipped_normals(),
    )


def number_of(mi: ModuleType, shape: MitsubaObject) -> int:
    """Return the number of a shape that intersections report."""
    import drjit as dr

    return int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0])


@lru_cache(maxsize=4)
def _own_values(mi: ModuleType, variant_name: str) -> type:
    """Define what lists the values of one object and leaves those that it holds alone, unlike `mitsuba.traverse`."""

    class OwnValues(mi.TraversalCallback):  # type: ignore[misc, name-defined]
        def __init__(self) -> None:
            super().__init__()
            self.found: dict[str, tuple[MitsubaObject, object]] = {}

        def put(self, name: str, value: MitsubaObject, flags: int, kind: object = None) -> None:
            if not isinstance(value, mi.Object):
                self.found[name] = value, kind

    return OwnValues


class _Mesh:
    """A mesh of the engine, its vertices and faces as flat arrays by their names there."""

    def __init__(self, mi: ModuleType, mesh: MitsubaObject) -> None:
        listed = _own_values(mi, mi.variant())()
        mesh.traverse(listed)
        self.mesh = mesh
        self._pointers = {name: listed.found[name] for name in _FIELDS if name in listed.found}

    def read(self, mi: ModuleType, name: str) -> npt.NDArray[Any]:
        """Return an array; empty for what the mesh has none of."""
        if name not in self._pointers:
            return np.zeros(0, dtype=_FIELDS[name])
        pointer, kind = self._pointers[name]
        return np.array(mi.get_property(pointer, kind, self.mesh), dtype=_FIELDS[name]).ravel()

    def write(self, mi: ModuleType, fields: Mapping[str, npt.NDArray[Any]]) -> None:
        """Write arrays of any shape, empty ones not."""
        on, written = Device(mi), [name for name, values in fields.items() if values.size]
        for name in written:
            pointer, kind = self._pointers[name]
            values = (on.index if name == _FACES else on.single)(fields[name])
            mi.set_property(pointer, kind, on.own(values))
        self.mesh.parameters_changed(written)
