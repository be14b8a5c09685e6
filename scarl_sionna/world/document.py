"""Reads a Mitsuba XML and its scene.toml into a checked description of instances, actors and materials.

Nothing here loads geometry; :mod:`scarl_sionna.world.twins` does, from the XML texts that are made here.
"""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from scarl_sionna.core.errors import MaterialError, MeshError, SceneError, UnknownNameError
from scarl_sionna.core.lighting import Lighting
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.core.toml_file import read_toml

from .articulation import Joint, joints_from_tables
from .lanes import LaneNetwork, lanes_from_tables
from .motion import Trajectory, trajectory_from_table

MESH_PLUGINS = ("ply", "obj", "cube")
"""Shape plugins that a scene may use: the ones that are triangle meshes."""

_TABLES = {"scene", "lighting", "materials", "instances", "actors", "lanes", "parking", "signals"}

LAMP_KINDS = ("headlamp", "taillamp", "street_lamp", "indoor", "signal_red", "signal_amber", "signal_green")
"""What a material's `lamp` may be."""

_CLASS_HINTS = {
    "building": "Building", "house": "Building", "church": "Building", "roof": "Building", "road": "Roads",
    "street": "Roads", "sidewalk": "SideWalks", "car": "Car", "truck": "Truck", "bus": "Bus", "tree": "Vegetation",
    "wall": "Wall", "fence": "Fence", "pole": "Pole", "sign": "TrafficSign", "guard": "GuardRail", "bridge": "Bridge",
    "water": "Water", "ground": "Ground", "floor": "Ground", "terrain": "Terrain", "plane": "Ground",
}  # fmt: skip
"""Word in a shape's id -> class, for scenes without a scene.toml."""


@dataclass(frozen=True)
class MaterialEntry:
    """Radio material and lidar reflectance that stand behind a BSDF id; None: what the radio material's entry says.

    `lamp` is the kind of lamp that surfaces of this material are (:mod:`scarl_sionna.world.lamps`), `wets` how much of the
    lighting's wetness they take, and `puddles` a texture of where the water stands.
    """

    radio: str
    lidar_reflectance: float | None = None
    lidar_transmittance: float | None = None
    lamp: str | None = None
    wets: float = 0.0
    puddles: Path | None = None


@dataclass(frozen=True)
class InstanceEntry:
    """One instance of the scene: static, or an actor when it has a trajectory."""

    name: str
    semantic: str
    shapes: tuple[str, ...]
    is_object: bool
    trajectory: Trajectory | None = None
    is_room: bool = False
    joints: tuple[Joint, ...] = ()


@dataclass(frozen=True)
class SceneDocument:
    """A scene's description.

    `root` is the parsed XML, with file names made absolute; `is_foreign` is true where no scene.toml states the classes.
    `lanes` are the lanes, parking places and signals; None where the scene.toml has none.
    """

    name: str
    path: Path
    root: ET.Element
    instances: tuple[InstanceEntry, ...]
    materials: dict[str, MaterialEntry]
    bsdf_of_shape: dict[str, str]
    ego: str | None = None
    info: dict[str, Any] = field(default_factory=dict)
    is_foreign: bool = False
    lighting: Lighting | None = None
    lanes: LaneNetwork | None = None


def read_document(path: Path) -> SceneDocument:
    """Read and check a scene.

    Parameters
    ----------
    path : Path
        The XML file; a ``scene.toml`` beside it is read when there is one.

    Raises
    ------
    SceneError
        If a file is missing or broken, a shape is not a mesh, or XML and TOML contradict each other.
    MaterialError
        If a BSDF has no radio material.
    """
    root = _parse_xml(path)
    shapes = _check_shapes(root, path)
    bsdf_of_shape = {shape_id: _bsdf_of(shape, path) for shape_id, shape in shapes.items()}
    toml_path = path.parent / "scene.toml"
    table: dict[str, Any] = {}
    if toml_path.is_file():
        table = read_toml(toml_path)
        if unknown := set(table) - _TABLES:
            raise UnknownNameError(f"table of {toml_path.parent.name}/scene.toml", sorted(unknown)[0], _TABLES)
    info = table.get("scene", {})
    if table:
        instances = _instances_from_table(table, tuple(shapes), toml_path)
    else:
        instances = tuple(InstanceEntry(name, _guess_class(name), (name,), is_object=True) for name in shapes)
    ego = info.get("ego")
    actors = [entry.name for entry in instances if entry.trajectory is not None]
    if ego is not None and ego not in actors:
        raise UnknownNameError("actor in scene.ego", str(ego), actors)
    return SceneDocument(
        name=info.get("name", path.stem),
        path=path,
        root=root,
        instances=instances,
        materials=_materials(root, table.get("materials", {}), set(bsdf_of_shape.values()), path),
        bsdf_of_shape=bsdf_of_shape,
        ego=ego,
        info=info,
        is_foreign=not table,
        lighting=_lighting(table.get("lighting", {})),
        lanes=_lanes(table),
    )


def _lanes(table: Mapping[str, Any]) -> LaneNetwork | None:
    """Return the lanes, parking places and signals of a scene.toml; None where it has none."""
    if not table.keys() & {"lanes", "parking", "signals"}:
        return None
    return lanes_from_tables(table.get("lanes", []), table.get("parking", []), table.get("signals"))


def _parse_xml(path: Path) -> ET.Element:
    if not path.is_file():
        raise SceneError("scene file not found", path, "give the name of a scene or the path of a Mitsuba XML")
    try:
        root = ET.fromstring(path.read_text(encoding="utf-8"))
    except (ET.ParseError, UnicodeDecodeError) as error:
        raise SceneError(f"is not valid XML ({error})", path) from error
    if root.tag != "scene":
        raise SceneError(f"the root element is <{root.tag}>, not <scene>", path, "give a Mitsuba 3 scene")
    _substitute_defaults(root)
    for element in root.iter("string"):
        if element.get("name") == "filename":
            file = path.parent / str(element.get("value"))
            if not file.is_file():
                raise SceneError(f"file '{element.get('value')}' is missing", path, f"expected it at {file}")
            element.set("value", str(file.resolve()))
    return root


def _substitute_defaults(root: ET.Element) -> None:
    """Replace ``$name`` by the values of ``<default name= value=>`` and drop those elements."""
    defaults = {str(element.get("name")): str(element.get("value")) for element in root.findall("default")}
    for element in root.findall("default"):
        root.remove(element)
    for element in root.iter():
        for key, value in element.attrib.items():
            for name in sorted(defaults, key=len, reverse=True):
                value = value.replace(f"${name}", defaults[name])
            element.set(key, value)


def _check_shapes(root: ET.Element, path: Path) -> dict[str, ET.Element]:
    """Return the shapes by id, in file order."""
    shapes: dict[str, ET.Element] = {}
    for shape in root.findall("shape"):
        shape_id, kind = shape.get("id"), shape.get("type")
        if kind not in MESH_PLUGINS:
            raise SceneError(
                f"shape '{shape_id}' is a '{kind}'; only meshes ({', '.join(MESH_PLUGINS)}) can carry radio paths",
                path,
                "convert it to a mesh, for instance with trimesh",
            )
        if not shape_id:
            raise SceneError(f"a shape of type '{kind}' has no id", path, 'add id="..." to every shape')
        if shape_id in shapes:
            raise SceneError(f"two shapes have the id '{shape_id}'", path)
        if kind == "ply":
            _check_ply_header(shape_id, Path(_property(shape, "filename")))
        shapes[shape_id] = shape
    if not shapes:
        raise SceneError("the scene has no shapes", path)
    return shapes


def _property(element: ET.Element, name: str) -> str:
    for child in element:
        if child.get("name") == name:
            return str(child.get("value"))
    return ""


def _check_ply_header(shape_id: str, file: Path) -> None:
    """Refuse what the engine would not survive: no PLY, or no faces."""
    with file.open("rb") as stream:
        header = stream.read(4096).split(b"end_header")[0]
    if not header.startswith(b"ply"):
        raise MeshError(f"mesh of shape '{shape_id}' is not a PLY file", file)
    counts = {
        words[1].decode(): int(words[2])
        for line in header.splitlines()
        if (words := line.split()) and words[0] == b"element" and len(words) == 3
    }
    if counts.get("face", 0) < 1 or counts.get("vertex", 0) < 3:
        raise MeshError(f"mesh of shape '{shape_id}' has no faces", file, "export it again with triangles")


def _bsdf_of(shape: ET.Element, path: Path) -> str:
    """Return the id of a shape's BSDF; a nested one without id gets the shape's."""
    for child in shape:
        if child.tag == "ref" and child.get("id"):
            return str(child.get("id"))
        if child.tag == "bsdf":
            if not child.get("id"):
                child.set("id", f"bsdf-{shape.get('id')}")
            return str(child.get("id"))
    raise SceneError(f"shape '{shape.get('id')}' has no BSDF", path, "refer to one with <ref id=...>")


def _guess_class(shape_id: str) -> str:
    lower = shape_id.lower()
    return next((semantic for word, semantic in _CLASS_HINTS.items() if word in lower), "Other")


def _instances_from_table(table: dict[str, Any], shapes: tuple[str, ...], path: Path) -> tuple[InstanceEntry, ...]:
    owner: dict[str, str] = {}
    entries = []
    for kind, own_keys in (("instances", {"object", "room"}), ("actors", set())):
        for row in table.get(kind, []):
            entries.append(_instance(row, kind, own_keys | {"name", "class", "shapes"}, shapes, owner, path))
    names = [entry.name for entry in entries]
    if repeated := {name for name in names if names.count(name) > 1}:
        raise SceneError(f"two instances have the name '{sorted(repeated)[0]}'", path)
    if missing := [shape for shape in shapes if shape not in owner]:
        raise SceneError(
            f"shapes belong to no instance: {', '.join(missing[:5])}{' ...' if len(missing) > 5 else ''}",
            path,
            "add them to the `shapes` of an [[instances]] or [[actors]] entry",
        )
    return tuple(entries)


def _instance(
    row: dict[str, Any], kind: str, keys: set[str], shapes: tuple[str, ...], owner: dict[str, str], path: Path
) -> InstanceEntry:
    allowed = keys | ({"trajectory", "joints"} if kind == "actors" else set())
    name = str(row.get("name", "?"))
    if unknown := set(row) - allowed:
        raise UnknownNameError(f"key of [[{kind}]] '{name}' in {path.name}", sorted(unknown)[0], allowed)
    if lacking := {"name", "class", "shapes"} - set(row):
        raise SceneError(f"[[{kind}]] '{name}' lacks '{sorted(lacking)[0]}'", path)
    if row["class"] not in SEMANTIC_CLASSES:
        raise UnknownNameError(f"semantic class of '{name}'", str(row["class"]), SEMANTIC_CLASSES)
    members = [shape for shape in shapes if any(fnmatchcase(shape, pattern) for pattern in row["shapes"])]
    if not members:
        raise SceneError(f"[[{kind}]] '{name}': no shape of the XML matches {row['shapes']}", path)
    for shape in members:
        if shape in owner:
            raise SceneError(f"shape '{shape}' belongs to both '{owner[shape]}' and '{name}'", path)
        owner[shape] = name
    if kind == "instances":
        is_room = bool(row.get("room", False))
        return InstanceEntry(name, row["class"], tuple(members), bool(row.get("object", True)), is_room=is_room)
    trajectory = trajectory_from_table(row.get("trajectory", {}), name)
    joints = joints_from_tables(row.get("joints", []), name, members, trajectory)
    return InstanceEntry(name, row["class"], tuple(members), True, trajectory, joints=joints)


def _materials(
    root: ET.Element, table: dict[str, Any], used: Iterable[str], path: Path
) -> dict[str, MaterialEntry]:
    """Return the entry of every BSDF in use: from scene.toml, or from Sionna's naming of ITU materials."""
    types = {
        str(bsdf.get("id")): _property(bsdf, "type")
        for bsdf in root.iter("bsdf")
        if bsdf.get("type") == "itu-radio-material"
    }
    entries = {}
    for bsdf_id in sorted(used):
        if bsdf_id in table:
            row = table[bsdf_id]
            if "radio" not in row:
                raise MaterialError(f"[materials.{bsdf_id}] in {path.parent.name}/scene.toml lacks 'radio'")
            optical = {key: float(row[key]) for key in ("lidar_reflectance", "lidar_transmittance") if key in row}
            for key, value in optical.items():
                if not 0.0 <= value <= 1.0:
                    raise MaterialError(f"[materials.{bsdf_id}] {key} = {value} is not within 0 to 1")
            if sum(optical.values()) > 1.0:
                raise MaterialError(f"[materials.{bsdf_id}] lidar_reflectance + lidar_transmittance = {sum(optical.values()):g} > 1")
            entries[bsdf_id] = MaterialEntry(row["radio"], **{**optical, **_look(bsdf_id, row, path)})
        else:
            plain = bsdf_id.removeprefix("mat-").removeprefix("itu_").removeprefix("itu-")
            entries[bsdf_id] = MaterialEntry(types.get(bsdf_id) or plain)
    return entries


def _look(bsdf_id: str, row: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return what a material's table says about lamps and water."""
    lamp, wets = row.get("lamp"), float(row.get("wets", 0.0))
    if lamp is not None and lamp not in LAMP_KINDS:
        raise UnknownNameError(f"lamp of [materials.{bsdf_id}]", str(lamp), LAMP_KINDS)
    if not 0.0 <= wets <= 1.0:
        raise MaterialError(f"[materials.{bsdf_id}] wets = {wets} is not within 0 to 1")
    puddles = path.parent / row["puddles"] if "puddles" in row else None
    if puddles is not None and not puddles.is_file():
        raise SceneError(f"texture '{row['puddles']}' of [materials.{bsdf_id}] is missing", path)
    return {"lamp": lamp, "wets": wets, "puddles": puddles}


def _lighting(table: dict[str, Any]) -> Lighting | None:
    """Return the lighting of a [lighting] table: a `preset`, and values that differ from it; None where there is no table."""
    if not table:
        return None
    base = Lighting.preset(str(table["preset"])) if "preset" in table else Lighting()
    return base.with_(**{key: value for key, value in table.items() if key != "preset"})


def twin_xml(
    document: SceneDocument,
    bsdfs: dict[str, ET.Element],
    extra: Iterable[ET.Element] = (),
    inside: Mapping[str, ET.Element] | None = None,
) -> str:
    """Return the XML of a twin: given BSDFs in place of the document's, actors in their own frame, no sensor.

    Parameters
    ----------
    document : SceneDocument
    bsdfs : dict
        The elements by the document's BSDF ids; every BSDF in use must be there.
    extra : iterable of Element
        Further elements (emitters).
    inside : mapping, optional
        An element to put into a shape, by shape id (its emitter).
    """
    root = ET.Element("scene", {"version": document.root.get("version", "3.0.0")})
    root.extend(bsdfs.values())
    actor_shapes = {
        shape for entry in document.instances if entry.trajectory is not None for shape in entry.shapes
    }
    for shape in document.root.findall("shape"):
        twin = copy.deepcopy(shape)
        shape_id = str(twin.get("id"))
        for child in list(twin):
            is_material = child.tag == "bsdf" or (child.tag == "ref" and child.get("id") in bsdfs)
            if is_material or (child.get("name") == "to_world" and shape_id in actor_shapes):
                twin.remove(child)
        bsdf = bsdfs[document.bsdf_of_shape[shape_id]]
        ET.SubElement(twin, "ref", {"id": str(bsdf.get("id")), "name": "bsdf"})
        if inside and shape_id in inside:
            twin.append(inside[shape_id])
        root.append(twin)
    root.extend(extra)
    return ET.tostring(root, encoding="unicode")
