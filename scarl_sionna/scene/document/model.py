"""A scene's checked description: instances, actors and materials, and the XML texts from which its twins are loaded."""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scarl_sionna.core.prompt.describe import Described, Row, field_rows, listed
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.scene.bodies.bending import Bending
from scarl_sionna.scene.lanes import LaneNetwork
from scarl_sionna.scene.motion.articulation import Joint
from scarl_sionna.scene.motion.trajectory import Trajectory

from .analytic import kept_transform


@dataclass(frozen=True, repr=False)
class MaterialEntry(Described):
    """Radio material and lidar reflectance that stand behind a BSDF id; None: what the radio material's entry says.

    `lamp` is the kind of lamp that surfaces of this material are (:mod:`scarl_sionna.engine.light.lamps`), `wets` how
    much of the lighting's wetness they take, and `puddles` a texture of where the water stands. `retroreflection` is
    that of sheets and prisms at normal incidence, R_A, `retroreflected_luminance` that of beads in a marking, R_L; both
    in cd/(lx m2).
    """

    radio: str
    lidar_reflectance: float | None = None
    lidar_transmittance: float | None = None
    retroreflection: float = 0.0
    retroreflected_luminance: float = 0.0
    lamp: str | None = None
    wets: float = 0.0
    puddles: Path | None = None


@dataclass(frozen=True, repr=False)
class InstanceEntry(Described):
    """One instance of the scene: static, or an actor when it has a trajectory.

    `signal` is the group of lights that switches its lamps.
    """

    name: str
    semantic: str
    shapes: tuple[str, ...]
    is_object: bool
    trajectory: Trajectory | None = None
    is_room: bool = False
    joints: tuple[Joint, ...] = ()
    signal: str | None = None
    bending: Bending | None = None


@dataclass(frozen=True, repr=False)
class SceneDocument(Described):
    """A scene's description.

    `root` is the parsed XML, with file names made absolute; `is_foreign` is true where no scene.toml states the
    classes. `lanes` are the lanes, parking places and signals; None where the scene.toml has none.
    `files` are further files that the description was read from.
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
    files: tuple[Path, ...] = ()

    @property
    def is_enclosed(self) -> bool:
        """Whether it is a tunnel or a car park (``enclosed = true`` in scene.toml)."""
        return bool(self.info.get("enclosed", False))

    def _facts(self) -> Iterable[Row]:
        yield "instances", f"{len(self.instances)}: {listed(entry.name for entry in self.instances)}"
        yield "materials", f"{len(self.materials)}: {listed(self.materials)}"
        yield from field_rows(self, without=("root", "instances", "materials", "bsdf_of_shape", "info", "files"))


def actor_shapes(document: SceneDocument) -> frozenset[str]:
    """Return the ids of the shapes of actors."""
    return frozenset(shape for entry in document.instances if entry.trajectory is not None for shape in entry.shapes)


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
    moving = actor_shapes(document)
    for shape in document.root.findall("shape"):
        twin = copy.deepcopy(shape)
        shape_id = str(twin.get("id"))
        for child in list(twin):
            is_material = child.tag == "bsdf" or (child.tag == "ref" and child.get("id") in bsdfs)
            is_place = child.get("name") == "to_world" and shape_id in moving
            if is_material or is_place:
                twin.remove(child)
            if is_place and (kept := kept_transform(child, document.path)) is not None:
                twin.append(kept)
        bsdf = bsdfs[document.bsdf_of_shape[shape_id]]
        ET.SubElement(twin, "ref", {"id": str(bsdf.get("id")), "name": "bsdf"})
        if inside and shape_id in inside:
            twin.append(inside[shape_id])
        root.append(twin)
    root.extend(extra)
    return ET.tostring(root, encoding="unicode")
