"""Actor models: folders of Mitsuba files and an ``actor.toml`` each, put into scenes any number of times."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from scarl_sionna.core.errors import MaterialError, ParameterRangeError, SceneError, UnknownNameError
from scarl_sionna.core.prompt.describe import Described
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.core.untrusted.checked import check_keys
from scarl_sionna.core.untrusted.files import Stamps, stamps
from scarl_sionna.scene.document.material_entries import material_entries
from scarl_sionna.scene.document.model import MaterialEntry
from scarl_sionna.scene.document.tables_form import model_tables
from scarl_sionna.scene.document.xml_file import bsdf_of, check_shapes, parse_xml
from scenes_xml import DETAILS

Color = tuple[float, float, float]

MOTIONS = ("vehicle", "cycle", "walk", "stand")
"""How a model can move: steered with rolling wheels, the same and leaning on two wheels, on foot, or not at all."""

_TABLES = {"actor", "variants", "materials", "joints", "bending"}
_REQUIRED = {"name", "class", "motion", "length", "width", "height"}
_KEYS = _REQUIRED | {
    "title", "license", "source", "age", "wheelbase", "rear_axle", "ego_mount", "occupants",
}  # fmt: skip # a table


@dataclass(frozen=True, eq=False, repr=False)
class ModelLevel(Described):
    """One level of geometry: elements of shapes and BSDFs by their ids, and the BSDF of each shape."""

    shapes: Mapping[str, ET.Element]
    bsdfs: Mapping[str, ET.Element]
    bsdf_of_shape: Mapping[str, str]


@dataclass(frozen=True, eq=False, repr=False)
class ActorModel(
    Described, units={"length": "m", "width": "m", "height": "m", "wheelbase": "m", "rear_axle": "m", "age": "years"}
):
    """What is known of an actor before it is put into a scene. Make one with `read_actor_model` or `actor_from_mesh`.

    Attributes
    ----------
    name : str
    path : Path
        Its ``actor.toml``.
    semantic : str
        Class, one of `scarl_sionna.core.semantics.SEMANTIC_CLASSES`.
    motion : str
        One of `MOTIONS`.
    length, width, height : float
        Outer measures [m].
    levels : mapping
        Geometry by level of detail; a model with one level has it at every level.
    materials : mapping
        Radio material and lidar reflectance by BSDF id.
    variants : mapping
        Name -> linear RGB colours of BSDFs; the first one is the default.
    joints : tuple of mappings
        Rows of ``[[joints]]``, with shape ids of the model.
    bending : mapping or None
        ``[bending]``: how it bends, see :func:`scarl_sionna.scene.bodies.bending.bending_from_table`.
    wheelbase, rear_axle : float or None
        Distance of the axles and x of the rear one [m]; None for what has no axles.
    age : float or None
        Of a person [years].
    ego_mount : bool
        Whether it may carry a rig of sensors around it.
    occupants : tuple of str
        Shapes of people inside: not there while it is parked.
    """

    name: str
    path: Path
    semantic: str
    motion: str
    length: float
    width: float
    height: float
    levels: Mapping[str, ModelLevel]
    materials: Mapping[str, MaterialEntry]
    variants: Mapping[str, Mapping[str, Color]] = field(default_factory=dict)
    joints: tuple[Mapping[str, Any], ...] = ()
    wheelbase: float | None = None
    rear_axle: float | None = None
    ego_mount: bool = False
    title: str = ""
    occupants: tuple[str, ...] = ()
    bending: Mapping[str, Any] | None = None
    age: float | None = None

    def level(self, detail: str) -> ModelLevel:
        """Return the geometry at a level of detail, ``"detailed"`` or ``"light"``.

        Raises
        ------
        UnknownNameError
            If there is no such level of detail.
        """
        if detail not in DETAILS:
            raise UnknownNameError(f"detail of actor model '{self.name}'", str(detail), DETAILS)
        return self.levels[detail]

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that it was read from: its ``actor.toml``, and those of how it bends."""
        named = (self.bending or {}).get("file"), (self.bending or {}).get("motion")
        return self.path, *(self.path.parent / name for name in named if name is not None)

    @property
    def bsdfs(self) -> tuple[str, ...]:
        """Ids of the BSDFs of all levels, sorted: what colours and radio materials can be given for."""
        return tuple(sorted(self.materials))

    def colors(self, variant: str | None = None) -> Mapping[str, Color]:
        """Return the colours of a variant by BSDF id; None: the first one's.

        Raises
        ------
        UnknownNameError
            If there is no such variant.
        """
        if variant is None:
            return next(iter(self.variants.values()), {})
        if variant not in self.variants:
            raise UnknownNameError(f"variant of actor model '{self.name}'", str(variant), self.variants)
        return self.variants[variant]


def actor_names() -> tuple[str, ...]:
    """Return the names of the actor models that come with the package, sorted."""
    import scenes_xml

    return scenes_xml.actor_names()


def person_ages() -> dict[str, int]:
    """Return the ages [years] of the people that come with the package, by model; the youngest first."""
    import scenes_xml

    return scenes_xml.person_ages()


def read_actor_model(name_or_path: str | Path, near: str | Path | None = None) -> ActorModel:
    """Return an actor model.

    Parameters
    ----------
    name_or_path : str or Path
        A model of ``scenes_xml/actors`` (``"saloon"``), or the path of a model's folder or of its ``actor.toml``.
    near : str or Path, optional
        Folder from which a relative path is looked up before the working directory.

    Raises
    ------
    UnknownNameError
        If there is no such model, or a key, class, variant or BSDF in its files is unknown.
    SceneError, MeshError, MaterialError, ParameterRangeError
        If its files are missing, broken or contradict each other, or no cache folder can be written.
    """
    file = _find(name_or_path, near)
    return _read(file, stamps(file, *sorted(file.parent.glob("*.xml"))))


def _find(name_or_path: str | Path, near: str | Path | None) -> Path:
    path, name = Path(name_or_path), str(name_or_path)
    if name in actor_names():
        return _unpacked(name)
    for folder in (*(() if near is None else (Path(near) / path,)), path):
        file = folder if folder.suffix == ".toml" else folder / "actor.toml"
        if file.is_file():
            return file.resolve()
    if path.is_dir() or len(path.parts) > 1 or path.suffix:
        raise SceneError("no actor model lies here", path, "give the path of a folder with an actor.toml")
    raise UnknownNameError("actor model", name, actor_names(), "or give the path of a folder with an actor.toml")


def _unpacked(name: str) -> Path:
    import scenes_xml

    try:
        return scenes_xml.actor_path(name)
    except OSError as error:
        raise SceneError(str(error.strerror or error)) from error


@lru_cache(maxsize=256)
def _read(file: Path, _changed: Stamps) -> ActorModel:
    table = model_tables(file)
    where = f"{file.parent.name}/actor.toml"
    check_keys(table, f"table of {where}", _TABLES)
    head = table.get("actor", {})
    if missing := _REQUIRED - set(head):
        raise SceneError(f"[actor] lacks '{sorted(missing)[0]}'", file)
    check_keys(head, f"key of [actor] in {where}", _KEYS)
    if head["class"] not in SEMANTIC_CLASSES:
        raise UnknownNameError(f"class in {where}", str(head["class"]), SEMANTIC_CLASSES)
    if head["motion"] not in MOTIONS:
        raise UnknownNameError(f"motion in {where}", str(head["motion"]), MOTIONS)
    levels = _levels(file, str(head["name"]))
    bsdfs = {bsdf for level in levels.values() for bsdf in level.bsdf_of_shape.values()}
    check_keys(table.get("materials", {}), f"BSDF of [materials] in {where}", bsdfs)
    materials: dict[str, MaterialEntry] = {}
    for level in levels.values():
        used = set(level.bsdf_of_shape.values())
        if lacking := sorted(used - set(table.get("materials", {}))):
            raise MaterialError(f"{where} has no [materials.{lacking[0]}], the BSDF of a shape; add one with 'radio'")
        root = ET.Element("scene")
        materials.update(material_entries(root, table["materials"], used, file))
    joints = tuple(table.get("joints", []))
    shapes = {shape for level in levels.values() for shape in level.shapes}
    for number, joint in enumerate(joints):
        for shape in joint.get("shapes", ()):
            if shape not in shapes:
                raise UnknownNameError(f"shape of joints[{number}] in {where}", str(shape), shapes)
    occupants = tuple(str(shape) for shape in head.get("occupants", ()))
    if absent := sorted(set(occupants) - shapes):
        raise UnknownNameError(f"shape of occupants in {where}", absent[0], shapes)
    variants = {
        name: check_colors(colors, materials, f"variants.{name} in {where}")
        for name, colors in table.get("variants", {}).items()
    }
    return ActorModel(
        name=str(head["name"]),
        path=file,
        semantic=head["class"],
        motion=head["motion"],
        levels=levels,
        materials=materials,
        variants=variants,
        joints=joints,
        bending=table.get("bending"),
        ego_mount=bool(head.get("ego_mount", False)),
        title=str(head.get("title", "")),
        occupants=occupants,
        age=float(head["age"]) if "age" in head else None,
        length=_measure(head, "length", where),
        width=_measure(head, "width", where),
        height=_measure(head, "height", where),
        wheelbase=_measure(head, "wheelbase", where) if "wheelbase" in head else None,
        rear_axle=float(head["rear_axle"]) if "rear_axle" in head else None,
    )


def _measure(head: Mapping[str, Any], key: str, where: str) -> float:
    value = float(head[key])
    if not 0.0 < value < 100.0:
        raise ParameterRangeError(f"{key} in {where}", f"{value} m", "above 0 m, below 100 m")
    return value


def _levels(file: Path, name: str) -> dict[str, ModelLevel]:
    detailed = _level(file.parent / f"{name}.xml")
    light = file.parent / f"{name}_light.xml"
    return {"detailed": detailed, "light": _level(light) if light.is_file() else detailed}


def _level(path: Path) -> ModelLevel:
    root = parse_xml(path)
    shapes = check_shapes(root, path)
    bsdf_of_shape = {name: bsdf_of(shape, path) for name, shape in shapes.items()}
    bsdfs = {str(element.get("id")): element for element in root.iter("bsdf") if element.get("id")}
    if absent := sorted(set(bsdf_of_shape.values()) - set(bsdfs)):
        raise SceneError(f"BSDF '{absent[0]}' is referred to but not defined", path)
    used = set(bsdf_of_shape.values())
    return ModelLevel(shapes, {key: value for key, value in bsdfs.items() if key in used}, bsdf_of_shape)


def check_colors(colors: Mapping[str, Any], known: Mapping[str, Any], where: str) -> dict[str, Color]:
    """Return colours of BSDFs as tuples of three floats, linear RGB within 0 to 1.

    Raises where a BSDF or a value is not allowed.
    """
    checked = {}
    for bsdf, color in colors.items():
        if bsdf not in known:
            raise UnknownNameError(f"BSDF of {where}", str(bsdf), known)
        try:
            rgb = np.array(color, dtype=np.float64)
        except (TypeError, ValueError):
            rgb = np.zeros(0)
        if rgb.shape != (3,) or not ((rgb >= 0.0) & (rgb <= 1.0)).all():
            raise ParameterRangeError(f"colour of '{bsdf}' of {where}", color, "three numbers from 0 to 1, linear RGB")
        red, green, blue = rgb.tolist()
        checked[str(bsdf)] = (red, green, blue)
    return checked
