"""The two twins of a scene: one Mitsuba scene in the RGB variant, one Sionna RT scene in the polarized variant.

Both are made from one :class:`SceneDocument`. Actors are loaded in their own frame and moved by writing vertex
positions, all at once, before one update of the acceleration structure.
"""

from __future__ import annotations

import copy
import re
import weakref
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import MeshError, SceneError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.prompt.describe import Described
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.core.temporary import temporary_folder
from scarl_sionna.scene.bodies.bending import vertex_normals
from scarl_sionna.scene.document.model import SceneDocument, actor_shapes, twin_xml
from scarl_sionna.scene.materials.table import MaterialTable

from . import variant
from .device import Device
from .joined import JoinedMeshes, PartPlace, can_be_joined, loaded_objects, number_of, scene_of
from .light.lamps import Lamps, Moment, lamp_elements
from .light.look import airlight, sky_elements, wet_bsdfs
from .threads import many_threads
from .types import DeviceArray, MitsubaObject

Array = npt.NDArray[np.float64]

ENGINE_THICKNESS = 0.1
"""Of what is a half space here, in the engine, which knows layers only [m]."""
RADIO_FREQUENCY = 77e9
"""Frequency at which the radio twin's materials are evaluated [Hz]; the materials' table is flat over 76-81 GHz."""
_DEFAULT_COLOR = "0.45, 0.45, 0.45"
_RADIO_BSDFS = ("itu-radio-material", "radio-material", "itu-radio-material-no-scattering")


_LAMPS = re.compile(r".*\.emitter\.radiance\.value$|beam-.*\.to_world$")
"""Parameters of the engine's scene that are written by their names."""
_OF_MESH = ("vertex_positions", "vertex_normals", "faces")
"""Those of every mesh, read and written without Mitsuba's table of names: that looks at each of them in each update."""
MISS = -1
"""Face of a ray that meets nothing."""


@dataclass(frozen=True, eq=False, repr=False)
class MeshData(Described, units={"vertices": "m"}):
    """Vertices as the engine holds them (float32 values as float64) and faces of one part."""

    vertices: Array
    faces: npt.NDArray[np.int64]


class Twin:
    """One loaded scene, moved to one state at a time.

    Parameters
    ----------
    kind : str
        ``"optical"`` or ``"radio"``.
    document : SceneDocument
    materials : MaterialTable
        Radio materials; used by the radio twin only.
    part_names : tuple of str
        Shape ids in the order of the parts.
    lighting : Lighting, optional
        Of the optical twin; None: the emitters of the scene's own XML.

    Attributes
    ----------
    origin : None
        Its frame is the world's.
    places : dict of str to PartPlace
        Where the engine has the faces of each part: in the optical twin those that shine are meshes of their own, all
        others are joined by BSDF (:class:`.joined.JoinedMeshes`).
    """

    origin: Array | None = None

    def __init__(
        self,
        kind: str,
        document: SceneDocument,
        materials: MaterialTable,
        part_names: tuple[str, ...],
        lighting: Lighting | None = None,
    ) -> None:
        self.kind = kind
        self.part_names = part_names
        self.sionna_scene: MitsubaObject = None
        self._joined: JoinedMeshes | None = None
        with variant.use(kind) as mi:
            try:
                if kind == "radio":
                    self._load_radio(document, materials)
                else:
                    self._load_optical(mi, document, lighting)
            except (RuntimeError, TypeError, ValueError) as error:
                raise _load_error(str(error), document) from error
            self._shapes = {shape.id(): shape for shape in self.mi_scene.shapes()}
            joined: Mapping[str, PartPlace] = {} if self._joined is None else self._joined.places
            if absent := [name for name in part_names if name not in self._shapes and name not in joined]:
                raise SceneError(f"the engine did not load shape '{absent[0]}'", document.path)
            own = {name: self._shapes[name] for name in part_names if name not in joined}
            apart = {name: PartPlace(number_of(mi, shape), 0, shape.face_count()) for name, shape in own.items()}
            self.places = {**joined, **apart}
            self._count_faces(mi)
            self._params = mi.traverse(self.mi_scene)
            found = self._params.properties
            self._fields = {key: found[key] for name in own for key in _keys(name) if key in found}
            self._params.properties = {key: value for key, value in found.items() if _LAMPS.match(key)}
        self._applied: weakref.ref[object] | None = None  # a state holds its world, which holds this twin
        self._pose_of: dict[str, Pose] = {}
        self._velocity_of: dict[str, tuple[float, ...]] = {}
        self._local_normals: dict[str, Array] = {}
        self._lamps: Lamps | None = None
        if kind == "optical" and lighting is not None:
            with variant.use(kind):
                meshes = dict(zip(part_names, self.mesh_data(), strict=True))
                self._lamps = Lamps(self._params, document, lighting, meshes)
                self._params.update()

    def _load_optical(self, mi: ModuleType, document: SceneDocument, lighting: Lighting | None) -> None:
        self.airlight = np.zeros(3)
        with temporary_folder() as folder:
            loaded = loaded_objects(mi, optical_xml(document, lighting, folder, mi))
        alike, apart = [], []
        for item in loaded:
            if isinstance(item, mi.Shape) and can_be_joined(item):
                alike.append(item)
            elif not isinstance(item, mi.BSDF):
                apart.append(item)
        if alike:
            self._joined = JoinedMeshes(mi, alike, actor_shapes(document))
            apart = [*self._joined.objects, *apart]
        self.mi_scene = scene_of(mi, apart)
        if lighting is not None and lighting.visibility is not None:
            self.airlight = airlight(mi, self.mi_scene)

    def _load_radio(self, document: SceneDocument, materials: MaterialTable) -> None:
        import sionna.rt as rt

        self.sionna_scene = rt.load_scene_from_string(radio_xml(document, materials), merge_shapes=False)
        self.sionna_scene.frequency = RADIO_FREQUENCY
        self.mi_scene = self.sionna_scene.mi_scene

    def _count_faces(self, mi: ModuleType) -> None:
        """Make the tables by which the engine's faces, mesh by mesh, are those of a state, part by part."""
        on, places = Device(mi), [self.places[name] for name in self.part_names]
        counts = np.array([place.size for place in places])
        first_face = np.cumsum(counts) - counts
        numbers, mesh = np.unique([place.number for place in places], return_inverse=True)
        sizes = np.bincount(mesh, weights=counts).astype(np.int64)
        first_of_mesh = np.cumsum(sizes) - sizes
        rows = first_of_mesh[mesh] + np.array([place.first for place in places])
        faces = np.arange(counts.sum(), dtype=np.int32)
        face_of_row = np.empty_like(faces)
        face_of_row[np.repeat(rows - first_face, counts) + faces] = faces
        self._face_of_row = on.label(face_of_row)
        first_of_number = np.full(numbers.max() + 1, MISS, dtype=np.int32)
        first_of_number[numbers] = first_of_mesh
        self._first_of_number = on.label(first_of_number)
        children = (0,) if self._joined is None else self._joined.numbers
        self._first_of_child = on.label(first_of_number[list(children)])
        self._part_of_number = np.full(len(first_of_number), -1, dtype=np.int64)
        for part, place in enumerate(places):
            self._part_of_number[place.number] = part

    def faces(self, found: MitsubaObject) -> DeviceArray:
        """Return the face of each of the engine's intersections, `MISS` for none; inside of the twin's variant.

        A row of the state's :class:`~.face_planes.FaceTable`, as Dr.Jit array.
        """
        import drjit as dr
        import mitsuba as mi

        number, valid = dr.reinterpret_array(mi.UInt32, found.shape), found.is_valid()
        first = dr.gather(mi.Int32, self._first_of_number, number, valid)
        if self._joined is not None:  # on a processor the engine tells which of the group's meshes, and no shape
            child = valid & (number == 0)
            first = dr.select(child, dr.gather(mi.Int32, self._first_of_child, found.shape_index, child), first)
        valid &= first >= 0
        row = mi.UInt32(first) + found.prim_index
        return dr.select(valid, dr.gather(mi.Int32, self._face_of_row, row, valid), MISS)

    def mesh_data(self) -> tuple[MeshData, ...]:
        """Return the mesh of every part: static ones in the world frame, actors' in their own.

        Raises
        ------
        MeshError
            If a mesh has no faces or vertices that are not finite.
        """
        meshes = []
        with variant.use(self.kind) as mi:
            joined = {} if self._joined is None else self._joined.read(mi)
            for name in self.part_names:
                if name in joined:
                    vertices, faces = joined[name]
                else:
                    vertices = np.array(self._read(f"{name}.vertex_positions"), dtype=np.float64).reshape(-1, 3)
                    faces = np.array(self._read(f"{name}.faces"), dtype=np.int64).reshape(-1, 3)
                if faces.shape[0] == 0:
                    raise MeshError(f"mesh of shape '{name}' has no faces")
                if not np.isfinite(vertices).all():
                    bad = int(np.count_nonzero(~np.isfinite(vertices).all(axis=1)))
                    raise MeshError(f"mesh of shape '{name}' has {bad} vertices that are not finite (NaN or inf)")
                meshes.append(MeshData(vertices, faces))
        return tuple(meshes)

    def _read(self, key: str) -> MitsubaObject:
        """Return what a mesh holds; inside of the twin's variant."""
        import mitsuba as mi

        pointer, kind, node, _ = self._fields[key]
        return mi.get_property(pointer, kind, node)

    def stands_in(self, state: object) -> bool:
        """Return whether a state is applied."""
        return self._applied is not None and self._applied() is state

    def apply(
        self,
        state: object,
        moment: Moment,
        world_from_part: Mapping[str, Pose],
        meshes: Mapping[str, MeshData],
        bent: Mapping[str, MeshData],
    ) -> None:
        """Move the actors' parts to a state at a moment, and switch its lights.

        Parts in `bent` have that mesh in place of their own.
        """
        with variant.use(self.kind) as mi:
            moved = False
            for name, pose in world_from_part.items():
                own = bent.get(name)
                if own is None and _is_same(self._pose_of.get(name), pose):
                    continue
                self._pose_of[name], moved = pose, True
                vertices, normals = pose.apply((own or meshes[name]).vertices), self._normals(mi, name, pose, own)
                if self._joined is not None and name in self._joined.places:
                    self._joined.move(mi, name, vertices, normals)
                else:
                    self._move(mi, name, vertices, normals)
                if self._lamps is not None and name in self._lamps.shapes:
                    self._lamps.move(self._params, name, pose)
            if self._joined is not None:
                self._joined.update(mi)
            if self._lamps is not None:
                self._lamps.switch(self._params, moment)
            with many_threads():
                if not self._params.update() and moved:  # an update of anything tells the scene, too
                    self.mi_scene.parameters_changed()
        self._applied = weakref.ref(state)

    def _move(self, mi: ModuleType, name: str, vertices: Array, normals: Array | None) -> None:
        """Write vertices [m] and shading normals of a part, each (num_vertices, 3), in the world."""
        written = []
        for field, values in zip(_OF_MESH, (vertices, normals), strict=False):
            if values is not None:
                (pointer, kind, *_), on = self._fields[f"{name}.{field}"], Device(mi)
                mi.set_property(pointer, kind, on.own(on.single(values)))
                written.append(field)
        self._shapes[name].parameters_changed(written)

    def _normals(self, mi: ModuleType, name: str, pose: Pose, bent: MeshData | None) -> Array | None:
        """Return the shading normals of a part, turned with it; None for a mesh without any."""
        if name not in self._local_normals:
            key = f"{name}.vertex_normals"
            if self._joined is not None and name in self._joined.places:
                held = self._joined.normals(mi, name)
            else:
                read = self._read(key) if key in self._fields else ()
                held = np.array(read, dtype=np.float64).reshape(-1, 3)
            self._local_normals[name] = held
        local = self._local_normals[name]
        if not local.size:
            return None
        return pose.rotate(local if bent is None else vertex_normals(bent.vertices, bent.faces))

    def set_velocities(self, twist_of_part: Mapping[str, Twist]) -> None:
        """Tell Sionna RT how fast the actors' parts move, for its own Doppler shifts."""
        with variant.use(self.kind) as mi:
            for name, twist in twist_of_part.items():
                velocity = tuple(twist.linear.tolist())
                if self._velocity_of.get(name) != velocity:
                    self._velocity_of[name] = velocity
                    self._object(name).velocity = mi.Vector3f(*velocity)

    def part_of_number(self, number: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Return the part of each of the engine's shape numbers, -1 for none, where each part is a shape: radio."""
        known = (number >= 0) & (number < len(self._part_of_number))
        return np.where(known, self._part_of_number[np.where(known, number, 0)], -1).astype(np.int64)

    def _object(self, name: str) -> MitsubaObject:
        import sionna.rt as rt

        return self.sionna_scene.objects[rt.SceneObject.shape_id_to_name(name)]


def optical_xml(document: SceneDocument, lighting: Lighting | None, folder: Path, mi: ModuleType) -> str:
    """Return the XML of the RGB twin.

    Without a lighting: the document's own BSDFs and emitters, and a sky where there is no light. With one: its sun, sky
    and lamps in place of the document's emitters outside of shapes, and wet BSDFs. Textures made for that go into
    `folder`.
    """
    bsdfs = {}
    for element in document.root.iter("bsdf"):
        bsdf_id = element.get("id")
        if bsdf_id in document.materials:
            bsdfs[str(bsdf_id)] = _plain_look(element) if _is_radio(element) else copy.deepcopy(element)
    _require(document, bsdfs)
    if lighting is None:
        emitters = [copy.deepcopy(element) for element in document.root.findall("emitter")]
        if not emitters and document.root.find("./shape/emitter") is None:
            emitters = [ET.Element("emitter", {"type": "sunsky"})]
        return twin_xml(document, bsdfs, emitters)
    if lighting.wetness > 0.0:
        bsdfs = wet_bsdfs(bsdfs, document, lighting, folder)
    glowing, beams = lamp_elements(document, lighting, folder, mi)
    return twin_xml(document, bsdfs, [*sky_elements(lighting, folder, mi), *beams], glowing)


def radio_xml(document: SceneDocument, materials: MaterialTable) -> str:
    """Return the XML of the radio twin: radio materials from our table.

    Their ids get a prefix, since Sionna takes ids such as ``itu_brick`` for its own materials.
    """
    bsdfs = {}
    for bsdf_id, entry in document.materials.items():
        material = materials[entry.radio]
        permittivity, conductivity = (
            material.permittivity_at(RADIO_FREQUENCY),
            material.conductivity_at(RADIO_FREQUENCY),
        )
        element = ET.Element("bsdf", {"type": "radio-material", "id": f"radio-{bsdf_id}"})
        for name, value in (
            ("relative_permittivity", permittivity),
            ("conductivity", conductivity),
            ("thickness", material.thickness or ENGINE_THICKNESS),
            ("scattering_coefficient", material.scattering_coefficient),
            ("xpd_coefficient", material.xpd_coefficient),
        ):
            ET.SubElement(element, "float", {"name": name, "value": repr(float(value))})
        bsdfs[bsdf_id] = element
    _require(document, bsdfs)
    return twin_xml(document, bsdfs)


def _load_error(message: str, document: SceneDocument) -> SceneError:
    """Return the error that tells what the engine found wrong."""
    reason = message.strip().splitlines()[-1].split("failed to instantiate", 1)[-1].strip()
    if "shape plugin" in reason:
        return MeshError(f"cannot be loaded: {reason}", document.path, "export the mesh again with finite vertices")
    return SceneError(f"cannot be loaded: {reason}", document.path)


def _is_radio(element: ET.Element) -> bool:
    return element.get("type") in _RADIO_BSDFS


def _plain_look(element: ET.Element) -> ET.Element:
    """Return a matt BSDF, in the material's own colour where it states one, for a radio material in an image."""
    color = next((str(child.get("value")) for child in element.findall("rgb")), _DEFAULT_COLOR)
    outer = ET.Element("bsdf", {"type": "twosided", "id": str(element.get("id"))})
    inner = ET.SubElement(outer, "bsdf", {"type": "diffuse"})
    ET.SubElement(inner, "rgb", {"name": "reflectance", "value": color})
    return outer


def _is_same(known: Pose | None, pose: Pose) -> bool:
    """Return whether a part stands where it stood."""
    if known is None or known is pose:
        return known is pose
    return bool((known.position == pose.position).all() and (known.quaternion == pose.quaternion).all())


def _keys(name: str) -> list[str]:
    """Return the names of a shape's fields in the engine's scene."""
    return [f"{name}.{field}" for field in _OF_MESH]


def _require(document: SceneDocument, bsdfs: Mapping[str, ET.Element]) -> None:
    used = set(document.bsdf_of_shape.values())
    if absent := sorted(used - set(bsdfs)):
        raise SceneError(f"BSDF '{absent[0]}' is referred to but not defined", document.path)
