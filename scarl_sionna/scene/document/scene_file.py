"""Reads a Mitsuba XML and its scene.toml into a checked description of instances, actors and materials."""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from scarl_sionna.core.errors import SceneError, UnknownNameError
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.core.untrusted.checked import check_keys
from scarl_sionna.scene.actors.model import read_actor_model
from scarl_sionna.scene.lanes import LaneNetwork, lanes_from_tables
from scarl_sionna.scene.motion.articulation import joints_from_tables
from scarl_sionna.scene.motion.trajectory import trajectory_from_table

from .interchange import upright, with_own_parts, with_plain_shapes
from .material_entries import material_entries
from .model import InstanceEntry, SceneDocument
from .staging import StagedActor, stage
from .tables_form import scene_tables
from .xml_file import bsdf_of, check_shapes, parse_xml, property_of

_TABLES = {"scene", "lighting", "materials", "instances", "actors", "lanes", "parking", "signals"}

_SCENE_KEYS = {
    "name", "ego", "up", "enclosed", "exposure", "title", "description", "license", "licence", "source", "seed",
    "variant", "detail", "shift", "heads", "findings",
}  # fmt: skip # a table
"""Of the table ``[scene]``: those with an effect, and what a builder says about its scene."""

_STAGED_KEYS = {"name", "model", "variant", "detail", "colors", "radio", "phase", "trajectory"}

_CLASS_HINTS = {
    "building": "Building", "house": "Building", "church": "Building", "roof": "Building", "road": "Roads",
    "street": "Roads", "sidewalk": "SideWalks", "car": "Car", "truck": "Truck", "bus": "Bus", "tree": "Vegetation",
    "wall": "Wall", "fence": "Fence", "pole": "Pole", "sign": "TrafficSign", "guard": "GuardRail", "bridge": "Bridge",
    "water": "Water", "ground": "Ground", "floor": "Ground", "terrain": "Terrain", "plane": "Ground",
}  # fmt: skip # a table
"""Word in a shape's id or its file's name -> class, for scenes whose classes no scene.toml states."""


def read_document(path: Path, detail: str = "detailed") -> SceneDocument:
    """Read and check a scene, and put the actors into it that name a model.

    Parameters
    ----------
    path : Path
        The XML file; a ``scene.toml`` beside it is read when there is one.
    detail : str
        Level of geometry of the models whose actors state none: ``"detailed"`` or ``"light"``.

    Raises
    ------
    SceneError
        If a file is missing or broken, a shape is not a mesh, or XML and TOML contradict each other.
    MaterialError
        If a BSDF has no radio material.
    UnknownNameError
        If a key, a table or a name in the scene.toml is not known.
    """
    root = parse_xml(path)
    toml_path = path.parent / "scene.toml"
    table: dict[str, Any] = {}
    if toml_path.is_file():
        table = scene_tables(toml_path)
        check_keys(table, f"table of {toml_path.parent.name}/scene.toml", _TABLES)
        check_keys(table.get("scene", {}), f"key of [scene] in {toml_path.parent.name}/scene.toml", _SCENE_KEYS)
    up = table.get("scene", {}).get("up")
    has_own_actors = any("model" not in row for row in table.get("actors", []))
    if up == "y" and has_own_actors:
        raise SceneError(
            'up = "y" does not go with [[actors]] of shapes of the XML',
            toml_path,
            "export with z up, or make models of them (ss.actor_from_mesh, up='y')",
        )
    with_plain_shapes(root, path)
    with_own_parts(root, path)
    upright(root, up, path)
    sources = {str(shape.get("id")): Path(property_of(shape, "filename")).stem for shape in root.findall("shape")}
    shapes = check_shapes(root, path)
    bsdf_of_shape = {shape_id: bsdf_of(shape, path) for shape_id, shape in shapes.items()}
    bsdfs = {*bsdf_of_shape.values(), *(str(bsdf.get("id")) for bsdf in root.iter("bsdf") if bsdf.get("id"))}
    check_keys(table.get("materials", {}), f"BSDF of [materials] in {toml_path.parent.name}/scene.toml", bsdfs)
    info = table.get("scene", {})
    is_stated = "instances" in table or has_own_actors
    if is_stated:
        instances = _instances_from_table(table, tuple(shapes), toml_path)
    else:
        guessed = {name: _guess_class(f"{name} {sources[name]}") for name in shapes}
        instances = tuple(InstanceEntry(name, semantic, (name,), is_object=True) for name, semantic in guessed.items())
    ego = info.get("ego")
    staged = _staged(table, toml_path, detail)
    actors = [entry.name for entry in instances if entry.trajectory is not None] + [actor.name for actor in staged]
    if ego is not None and ego not in actors:
        raise UnknownNameError("actor in scene.ego", str(ego), actors)
    lanes = _lanes(table)
    groups = lanes.signals.green if lanes is not None and lanes.signals is not None else {}
    for entry in instances:
        if entry.signal is not None and entry.signal not in groups:
            raise UnknownNameError(f"signal of [[instances]] '{entry.name}'", entry.signal, groups)
    document = SceneDocument(
        name=info.get("name", path.stem),
        path=path,
        root=root,
        instances=instances,
        materials=material_entries(root, table.get("materials", {}), set(bsdf_of_shape.values()), path),
        bsdf_of_shape=bsdf_of_shape,
        ego=ego,
        info=info,
        is_foreign=not is_stated,
        lighting=_lighting(table.get("lighting", {})),
        lanes=lanes,
    )
    return stage(document, staged) if staged else document


def _staged(table: Mapping[str, Any], path: Path, detail: str) -> tuple[StagedActor, ...]:
    """Return the actors that name a model instead of shapes."""
    actors = []
    for row in table.get("actors", []):
        if "model" not in row:
            continue
        name = str(row.get("name", "?"))
        check_keys(row, f"key of [[actors]] '{name}', which names a model, in {path.name}", _STAGED_KEYS)
        if "name" not in row:
            raise SceneError("an [[actors]] entry lacks 'name'", path)
        given = {key: value for key, value in row.items() if key not in ("name", "model", "trajectory")}
        model = read_actor_model(row["model"], near=path.parent)
        trajectory = trajectory_from_table(row.get("trajectory", {}), name)
        actors.append(StagedActor(name, model, trajectory, **{"detail": detail, **given}))
    return tuple(actors)


def _lanes(table: Mapping[str, Any]) -> LaneNetwork | None:
    """Return the lanes, parking places and signals of a scene.toml; None where it has none."""
    if not table.keys() & {"lanes", "parking", "signals"}:
        return None
    return lanes_from_tables(table.get("lanes", []), table.get("parking", []), table.get("signals"))


def _guess_class(names: str) -> str:
    lower = names.lower()
    return next((semantic for word, semantic in _CLASS_HINTS.items() if word in lower), "Other")


def _instances_from_table(table: dict[str, Any], shapes: tuple[str, ...], path: Path) -> tuple[InstanceEntry, ...]:
    owner: dict[str, str] = {}
    entries = []
    for kind, own_keys in (("instances", {"object", "room", "signal"}), ("actors", set())):
        for row in table.get(kind, []):
            if "model" in row and kind == "actors":
                continue
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
    check_keys(row, f"key of [[{kind}]] '{name}' in {path.name}", allowed)
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
        is_object, is_room = bool(row.get("object", True)), bool(row.get("room", False))
        return InstanceEntry(name, row["class"], tuple(members), is_object, is_room=is_room, signal=row.get("signal"))
    trajectory = trajectory_from_table(row.get("trajectory", {}), name)
    joints = joints_from_tables(row.get("joints", []), name, members, trajectory)
    return InstanceEntry(name, row["class"], tuple(members), True, trajectory, joints=joints)


def _lighting(table: dict[str, Any]) -> Lighting | None:
    """Return the lighting of a [lighting] table: a `preset`, and values that differ from it.

    None where there is no table.
    """
    if not table:
        return None
    base = Lighting.preset(str(table["preset"])) if "preset" in table else Lighting()
    return base.with_(**{key: value for key, value in table.items() if key != "preset"})
