"""Builds the world of a scenario.

Scene, actors and their motions, traffic, weather and light, and the checks that all this can be.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import scenes_xml
from scarl_sionna.core.errors import (
    ScenarioError,
    ScenarioFileError,
    ScenarioNameError,
    ScenarioValueError,
    SceneError,
    UnknownNameError,
)
from scarl_sionna.scene.document.model import SceneDocument
from scarl_sionna.scene.document.scene_file import read_document
from scarl_sionna.scene.document.staging import stage
from scarl_sionna.scene.materials.table import MaterialTable, load_materials

from .cast import EGO, Member, cast_of, roles_of
from .checks.spec import check_collisions, check_gaits, check_places, check_speeds, check_times, touching
from .drawn import drawn
from .motion.motions import Setting
from .own_map import OWN_MAP, own_map
from .randomize import draw_materials, draw_reflectances
from .road_users import traffic_of, with_signals_of
from .spec.light import name_error
from .spec.scenario import ScenarioSpec

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World

ATTEMPTS = 20
"""How often placements are drawn again where bodies touch: that of the later of the two, from the half on of both."""


@dataclass(frozen=True, eq=False)
class Composition:
    """All that a scenario's world is made of, before it is loaded.

    Attributes
    ----------
    spec : ScenarioSpec
        With what its seed draws in place of the ranges.
    scene : SceneDocument
        The scene as its files have it.
    document : SceneDocument
        With the scenario's actors in it.
    members : tuple of Member
        The ego vehicle and the actors of the scenario, then traffic.
    materials : MaterialTable
        Radio materials.
    drawn : mapping
        What the seed drew of variant, hour, day and weather, see :func:`scarl_sionna.scenario.drawn.drawn`.
    """

    spec: ScenarioSpec
    scene: SceneDocument
    document: SceneDocument
    members: tuple[Member, ...]
    materials: MaterialTable
    drawn: Mapping[str, Any] = field(default_factory=dict)


def compose(spec: ScenarioSpec) -> Composition:
    """Return what a scenario's world is made of; every call with an equal scenario gives the same, in whatever process.

    Raises
    ------
    ScenarioError
        If a name is unknown, a motion is not possible or ends too early, or bodies overlap; it names the line.
    """
    spec, found = drawn(spec)
    scene = scene_of(spec)
    problems: list[ScenarioError] = []
    roles = roles_of(spec, problems)
    setting = Setting(spec.scene, scene.lanes, spec.times[0], spec.times[-1], spec.find)
    own: list[Member] = []
    attempts: Counter[str] = Counter()
    for turn in range(ATTEMPTS):
        try:
            own = cast_of(spec, scene, roles, setting, attempts)
        except ScenarioError as error:
            problems += error.problems
        if problems:
            raise ScenarioError.first_of(problems)
        pairs = touching(spec, own) if spec.randomization.placements is not None else []
        if not pairs:
            break
        attempts.update({name for pair in pairs for name in (pair[-1:] if 2 * turn < ATTEMPTS else pair)})
    kept = with_signals_of(spec, remaining(spec, scene), setting)
    check_times(spec, own, kept)
    check_speeds(spec, own)
    members = (*own, *traffic_of(spec, own, kept, setting))
    if spec.springs:
        members = tuple(member.on_springs() for member in members)
    document = kept
    if members:
        ego = EGO if spec.ego is not None else None
        document = stage(kept, [member.actor for member in members], ego=ego or kept.ego)
        check_gaits(spec, members, document)
    check_collisions(spec, members, kept)
    materials = load_materials()
    if spec.randomization.materials:
        materials, document = draw_materials(spec.seed, materials), draw_reflectances(spec.seed, document)
    if found:
        document = replace(document, info={**document.info, "drawn": found})
    return Composition(spec, scene, document, members, materials, found)


def build_world(spec: ScenarioSpec) -> World:
    """Return the world of a scenario.

    Parameters
    ----------
    spec : ScenarioSpec

    Returns
    -------
    World
        With the scenario's actors, light, weather and noise; its ego is the scenario's, else the scene's.

    Raises
    ------
    ScenarioError
        As `compose`, and if an actor stands, drives or walks beside the scene's ground.
    SceneError, MeshError, MaterialError
        If files of the scene are broken.
    """
    from scarl_sionna.engine.world import World

    composition = compose(spec)
    spec = composition.spec
    world = World(composition.document, composition.materials)
    check_places(spec, composition.members, world)
    if spec.lighting is not None:
        world = world.with_lighting(spec.lighting)
    if spec.weather is not None:
        world = world.with_weather(spec.weather)
    return world.with_changes(spec.changes).with_noise_of(spec.noise_name)


def scene_of(spec: ScenarioSpec) -> SceneDocument:
    """Return the scene that a scenario names, as its files have it."""
    from scarl_sionna.scene.document.find import MAP_SUFFIXES, find_scene

    text, around = spec.scene, None
    if text == OWN_MAP or text.endswith(".json"):
        text, around = own_map(spec)
    if text in scenes_xml.scene_names():
        try:
            path = find_scene(text, spec.variant, spec.detail)
        except SceneError as error:
            raise ScenarioFileError(str(error), spec.place("scene"), value=text) from error
        return read_document(path, spec.detail)
    if spec.variant != 0 and not text.endswith(MAP_SUFFIXES):
        raise ScenarioValueError(
            f"= {spec.variant}, but '{text}' is neither a scene that the package builds nor a map: it has no variants",
            spec.place("variant"),
            "leave it out",
            value=spec.variant,
        )
    is_path = text.endswith((".xml", *MAP_SUFFIXES)) or "/" in text
    if is_path and not spec.find(text).exists():
        raise ScenarioFileError(
            f"scene file '{text}' is not there",
            spec.place("scene"),
            "give the name of a scene, or the path of a Mitsuba XML or a map",
            value=text,
        )
    try:
        found = find_scene(spec.find(text) if is_path else text, spec.variant, spec.detail, around)
    except UnknownNameError as error:
        raise name_error(error, spec.place("scene")) from error
    return read_document(found, spec.detail)


def remaining(spec: ScenarioSpec, scene: SceneDocument) -> SceneDocument:
    """Return the scene without those of its own actors that a scenario does not keep."""
    names = {entry.name for entry in scene.instances if entry.trajectory is not None}
    gone = set() if spec.keeps_actors else names - {scene.ego}
    if spec.ego is not None and scene.ego is not None:
        gone.add(scene.ego)
    taken = {entry.name for entry in scene.instances} - gone
    for index, actor in enumerate(spec.actors):
        if actor.name in taken:
            raise ScenarioNameError(
                f"'{actor.name}' is the name of something in scene '{spec.scene}'",
                spec.place("actors", index, "name"),
                "give the actor another name",
                value=actor.name,
                kind="actor",
                known=[],
            )
    return without_actors(scene, gone)


def without_actors(document: SceneDocument, names: Collection[str]) -> SceneDocument:
    """Return a scene without some of its instances and their shapes."""
    if not names:
        return document
    shapes = {shape for entry in document.instances if entry.name in names for shape in entry.shapes}
    root = ET.Element(document.root.tag, dict(document.root.attrib))
    root.extend(child for child in document.root if not (child.tag == "shape" and child.get("id") in shapes))
    return replace(
        document,
        root=root,
        instances=tuple(entry for entry in document.instances if entry.name not in names),
        bsdf_of_shape={shape: bsdf for shape, bsdf in document.bsdf_of_shape.items() if shape not in shapes},
        ego=None if document.ego in names else document.ego,
    )
