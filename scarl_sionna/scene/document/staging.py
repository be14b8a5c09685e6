"""Puts actor models into a scene: shapes with the actor's name before theirs, and BSDFs that alike actors share."""

from __future__ import annotations

import copy
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from scarl_sionna.core.errors import MaterialError, ParameterRangeError, SceneError, UnknownNameError
from scarl_sionna.core.prompt.describe import Described
from scarl_sionna.scene.actors.model import ActorModel, Color, ModelLevel, check_colors, read_actor_model
from scarl_sionna.scene.bodies.bending import bending_from_table
from scarl_sionna.scene.motion.articulation import joints_from_tables, joints_on
from scarl_sionna.scene.motion.trajectory import StaticTrajectory, Trajectory, expect_trajectory
from scenes_xml import DETAILS

from .analytic import kept_transform
from .model import InstanceEntry, MaterialEntry, SceneDocument

_NAME = re.compile(r"[A-Za-z0-9_\-]+")
_STAGED_ID = re.compile(r"^(actor-.*?)-\d+$")
_COLOR_SLOTS = ("base_color", "reflectance", "diffuse_reflectance", "specular_reflectance", "color")
"""Parameters of Mitsuba's BSDFs that are their colour, the first one found is set."""
_PHASED = ("walk", "pedal", "swing")
"""Joints that begin at a phase."""


@dataclass(frozen=True, eq=False, repr=False)
class StagedActor(Described):
    """An actor model in a scene.

    Attributes
    ----------
    name : str
        Letters, digits, ``_`` and ``-``; with no other instance's name in the scene.
    model : ActorModel, str or Path
        Or the name or path of one, see `read_actor_model`.
    trajectory : Trajectory
        Of the model's origin: on the ground below its middle.
    detail : str
        Level of geometry, ``"detailed"`` or ``"light"``.
    variant : str or None
        Colours by the name of a variant; None: the first one.
    colors : mapping, optional
        BSDF id -> linear RGB, each 0 to 1; goes before the variant.
    phase : float
        Of the gait or the pedals at the trajectory's start, of a body that bends at time 0 [cycles].
    radio : mapping, optional
        BSDF id -> radio material, in place of the model's.

    Raises
    ------
    ParameterRangeError, UnknownNameError, MaterialError, SceneError
        If a name, colour or phase is not allowed, or the model does not have what is named.
    InputTypeError
        If `trajectory` is none.
    """

    name: str
    model: ActorModel
    trajectory: Trajectory
    detail: str = "detailed"
    variant: str | None = None
    colors: Mapping[str, Color] | None = None
    phase: float = 0.0
    radio: Mapping[str, str] | None = None
    _looks: Mapping[str, Color] = field(init=False, repr=False, default_factory=dict)

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(str(self.name)):
            raise ParameterRangeError("name of an actor", repr(self.name), "letters, digits, '_' and '-'")
        expect_trajectory(f"trajectory of actor '{self.name}'", self.trajectory)
        model = self.model if isinstance(self.model, ActorModel) else read_actor_model(self.model)
        object.__setattr__(self, "model", model)
        if self.detail not in DETAILS:
            raise UnknownNameError(f"detail of actor '{self.name}'", str(self.detail), DETAILS)
        if not np.isfinite(self.phase):
            raise ParameterRangeError(f"phase of actor '{self.name}'", self.phase, "a finite number of cycles")
        own = check_colors(self.colors or {}, model.materials, f"actor '{self.name}' (model '{model.name}')")
        object.__setattr__(self, "_looks", {**model.colors(self.variant), **own})
        for bsdf in self.radio or {}:
            if bsdf not in model.materials:
                raise UnknownNameError(
                    f"BSDF in the radio materials of actor '{self.name}'", str(bsdf), model.materials
                )


def stage(document: SceneDocument, actors: Sequence[StagedActor], ego: str | None = None) -> SceneDocument:
    """Return a scene with actors put into it.

    Parameters
    ----------
    document : SceneDocument
        Stays as it is.
    actors : sequence of StagedActor
    ego : str, optional
        The actor that carries the rig from now on; None: that of the document.

    Raises
    ------
    SceneError
        If a name stands twice, or a shape's id would.
    UnknownNameError
        If `ego` is no actor of the scene.

    Notes
    -----
    BSDFs that look alike and have the same radio and lidar properties are one, whichever model they come from: the
    engine's cost of a ray grows with their number. Who sits in a vehicle that never moves (a `StaticTrajectory`) is
    left out: it is parked.
    """
    root = ET.Element(document.root.tag, dict(document.root.attrib))
    root.extend(document.root)
    stager = _Stager(root, dict(document.bsdf_of_shape), dict(document.materials))
    taken = {entry.name for entry in document.instances}
    entries = []
    for actor in actors:
        if actor.name in taken:
            raise SceneError(
                f"two instances have the name '{actor.name}'", document.path, "give every actor a name of its own"
            )
        taken.add(actor.name)
        entries.append(stager.add(actor, document.path))
    instances = (*document.instances, *entries)
    moving = [entry.name for entry in instances if entry.trajectory is not None]
    if ego is not None and ego not in moving:
        raise UnknownNameError("actor to carry the rig", ego, moving)
    return replace(
        document,
        root=root,
        instances=instances,
        bsdf_of_shape=stager.bsdf_of_shape,
        materials=stager.materials,
        ego=document.ego if ego is None else ego,
        files=tuple(dict.fromkeys((*document.files, *(file for actor in actors for file in actor.model.files)))),
    )


def on_trajectories(entries: Sequence[InstanceEntry], trajectories: Mapping[str, Trajectory]) -> list[InstanceEntry]:
    """Return instances of a scene, those whose name has a trajectory with that one and with joints that follow it."""
    return [
        replace(entry, trajectory=trajectories[entry.name], joints=joints_on(entry.joints, trajectories[entry.name]))
        if entry.name in trajectories
        else entry
        for entry in entries
    ]


class _Stager:
    """Adds shapes and BSDFs to a scene's XML."""

    def __init__(self, root: ET.Element, bsdf_of_shape: dict[str, str], materials: dict[str, MaterialEntry]) -> None:
        self.root, self.bsdf_of_shape, self.materials = root, bsdf_of_shape, materials
        self._used = {str(element.get("id")) for element in root.iter() if element.get("id")}
        self._shared: dict[tuple[bytes, MaterialEntry], str] = {}
        self._of_look: dict[tuple[Any, ...], dict[str, str]] = {}

    def add(self, actor: StagedActor, path: Path) -> InstanceEntry:
        """Add an actor, and return its entry."""
        level = actor.model.level(actor.detail)
        left_out = actor.model.occupants if isinstance(actor.trajectory, StaticTrajectory) else ()
        bsdfs = self._bsdfs(actor, level)
        members = {}
        for shape, element in level.shapes.items():
            if shape in left_out:
                continue
            name = members[shape] = f"{actor.name}_{shape}"
            if name in self._used:
                raise SceneError(
                    f"actor '{actor.name}': the scene has a '{name}' already", path, "give it another name"
                )
            self._used.add(name)
            own = ET.Element("shape", {**element.attrib, "id": name})
            for child in element:
                is_place = child.get("name") == "to_world"
                kept = kept_transform(child, path) if is_place else child
                if kept is not None and child.tag not in ("ref", "bsdf"):
                    own.append(kept)
            bsdf = bsdfs[level.bsdf_of_shape[shape]]
            ET.SubElement(own, "ref", {"id": bsdf, "name": "bsdf"})
            self.root.append(own)
            self.bsdf_of_shape[name] = bsdf
        shapes = tuple(members.values())
        joints = joints_from_tables(_joint_tables(actor, members), actor.name, shapes, actor.trajectory)
        bending, folder = actor.model.bending, actor.model.path.parent
        return InstanceEntry(
            actor.name,
            actor.model.semantic,
            shapes,
            True,
            actor.trajectory,
            joints=joints,
            bending=None if bending is None else bending_from_table(bending, folder, members, actor.phase),
        )

    def _bsdfs(self, actor: StagedActor, level: ModelLevel) -> dict[str, str]:
        """Return the id in the scene of each BSDF of a model in an actor's colours."""
        radio = dict(actor.radio or {})
        look = (id(level), tuple(sorted(actor._looks.items())), tuple(sorted(radio.items())))
        if look not in self._of_look:
            found = {}
            for bsdf, element in level.bsdfs.items():
                own = _recolored(element, actor._looks[bsdf], actor) if bsdf in actor._looks else element
                entry = actor.model.materials[bsdf]
                found[bsdf] = self._share(bsdf, own, replace(entry, radio=radio[bsdf]) if bsdf in radio else entry)
            self._of_look[look] = found
        return self._of_look[look]

    def _share(self, bsdf: str, element: ET.Element, entry: MaterialEntry) -> str:
        """Return the id of a BSDF of the scene that is like this one, made now or before."""
        own = copy.copy(element)
        own.attrib = {**element.attrib, "id": ""}
        own.tail = None
        key = ET.tostring(own), entry
        if key not in self._shared:
            number = 1
            while (name := _staged_id(bsdf, number)) in self._used:
                number += 1
            own.set("id", name)
            self._used.add(name)
            self.root.append(own)
            self.materials[name] = entry
            self._shared[key] = name
        return self._shared[key]


def _staged_id(bsdf: str, number: int) -> str:
    """Return the id in a scene of the n-th BSDF that actor models name alike, from 1."""
    return f"actor-{bsdf}" + (f"-{number}" if number > 1 else "")


def without_number(staged_id: str) -> str:
    """Return the id without the number that tells BSDFs of one name apart; others as they are."""
    return _STAGED_ID.sub(r"\1", staged_id)


def _recolored(element: ET.Element, color: Color, actor: StagedActor) -> ET.Element:
    """Return a copy of a BSDF in another colour."""
    own = copy.deepcopy(element)
    for slot in _COLOR_SLOTS:
        for parent in own.iter("bsdf"):
            for child in parent:
                if child.get("name") == slot and child.tag in ("rgb", "texture"):
                    for old in list(child):
                        child.remove(old)
                    child.tag, child.attrib = (
                        "rgb",
                        {"name": slot, "value": " ".join(f"{value:.9g}" for value in color)},
                    )
                    return own
    raise MaterialError(
        f"BSDF '{element.get('id')}' of model '{actor.model.name}' has no colour to set; "
        f"leave it out of the colours of '{actor.name}'"
    )


def _joint_tables(actor: StagedActor, members: Mapping[str, str]) -> list[dict[str, Any]]:
    """Return the model's joints with the shapes that this level has, by their ids in the scene."""
    tables = []
    for row in actor.model.joints:
        table = dict(row)
        if "shapes" in table:
            table["shapes"] = [members[shape] for shape in table["shapes"] if shape in members]
            if not table["shapes"]:
                continue
        if actor.phase and table.get("kind") in _PHASED:
            table["phase"] = float(table.get("phase", 0.0)) + actor.phase
        tables.append(table)
    return tables
