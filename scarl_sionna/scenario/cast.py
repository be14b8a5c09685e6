"""Who takes part in a scenario: models, looks and motions of the ego vehicle, the actors and the traffic."""

from __future__ import annotations

import functools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from scarl_sionna.core.errors import ScarlError, ScenarioError, ScenarioFileError, ScenarioValueError, UnknownNameError
from scarl_sionna.core.untrusted.files import Stamps, stamps
from scarl_sionna.scene.actors.model import ActorModel, Color, read_actor_model
from scarl_sionna.scene.document.model import SceneDocument
from scarl_sionna.scene.document.staging import StagedActor
from scarl_sionna.scene.materials.table import load_materials
from scarl_sionna.scene.motion.trajectory import Trajectory

from .motion.bodies import ActorBody
from .motion.motions import Setting, trajectory_of
from .motion.tilt import Springs, on_springs
from .randomize import Jitter, draw_jitter, draw_look
from .spec.actors import ActorSpec, BodyFileSpec, EgoSpec, MeshSpec
from .spec.files import KeyPath
from .spec.light import name_error
from .spec.scenario import ScenarioSpec

EGO = "ego"
"""Name of the ego vehicle of a scenario."""


@dataclass(frozen=True, eq=False)
class Member:
    """A participant: where the scenario states it, and what is put into the scene."""

    path: KeyPath
    actor: StagedActor

    @property
    def body(self) -> ActorBody:
        """Its measures."""
        return ActorBody.of(self.actor.model)

    def on_springs(self) -> Member:
        """Return the same participant with a body that pitches and rolls, if it has springs."""
        springs = Springs.of(self.actor.model)
        if springs is None:
            return self
        return replace(self, actor=replace(self.actor, trajectory=on_springs(self.actor.trajectory, springs)))


@dataclass(frozen=True, eq=False)
class Role:
    """One whom a scenario names, before it moves: model and look are known."""

    path: KeyPath
    name: str
    spec: EgoSpec | ActorSpec
    model: ActorModel
    variant: str | None
    colors: dict[str, Color]


def roles_of(spec: ScenarioSpec, problems: list[ScenarioError]) -> list[Role]:
    """Return whom a scenario names; what is wrong with them is added to `problems`."""
    roles = []
    for path, name, one in _named(spec):
        try:
            roles.append(_role(spec, path, name, one))
        except ScenarioError as error:
            problems.append(error)
    return roles


def _named(spec: ScenarioSpec) -> Iterator[tuple[KeyPath, str, EgoSpec | ActorSpec]]:
    if spec.ego is not None:
        yield ("ego",), EGO, spec.ego
    for index, actor in enumerate(spec.actors):
        yield ("actors", index), actor.name, actor


def _role(spec: ScenarioSpec, path: KeyPath, name: str, one: EgoSpec | ActorSpec) -> Role:
    model = _model(spec, path, one)
    if one.variant is not None and one.variant not in model.variants:
        error = UnknownNameError(f"variant of '{model.name}'", one.variant, model.variants)
        raise name_error(error, spec.place(*path, "variant"))
    for bsdf in one.colors:
        if bsdf not in model.materials:
            error = UnknownNameError(f"BSDF of '{model.name}'", bsdf, model.materials)
            raise name_error(error, spec.place(*path, "colors", bsdf))
    variant, colors = one.variant, {bsdf: (red, green, blue) for bsdf, (red, green, blue) in one.colors.items()}
    if spec.randomization.colors and one.variant is None:
        variant, drawn = draw_look(spec.seed, name, model.variants, model.motion)
        colors = {**drawn, **colors}
    return Role(path, name, one, model, variant, colors)


def _model(spec: ScenarioSpec, path: KeyPath, one: EgoSpec | ActorSpec) -> ActorModel:
    own = one.mesh or one.body if isinstance(one, ActorSpec) else None
    if not isinstance(one, ActorSpec) or own is None:
        place = spec.place(*path, "model")
        text = str(one.model)
        try:
            return read_actor_model(spec.find(text) if "/" in text else text)
        except UnknownNameError as error:
            raise name_error(error, place) from error
        except ScarlError as error:
            raise ScenarioFileError(str(error), place, value=text) from error
    key = "mesh" if isinstance(own, MeshSpec) else "body"
    file = spec.find(own.file)
    if not file.is_file():
        raise ScenarioFileError(f"'{own.file}' is not there", spec.place(*path, key, "file"), value=own.file)
    moved_by: Path | None = None
    if isinstance(own, BodyFileSpec) and own.moved_by is not None:
        moved_by = spec.find(own.moved_by).resolve()
        own = own.with_(moved_by=str(moved_by))
    try:
        model = _own_model(file.resolve(), stamps(file, moved_by), one.name, own.model_dump_json(), key)
        table = load_materials()
        for entry in model.materials.values():
            table[entry.radio]  # an unknown one raises here, where its line is known
        return model
    except UnknownNameError as error:
        raise name_error(error, spec.place(*path, key)) from error
    except ScarlError as error:
        raise ScenarioFileError(str(error), spec.place(*path, key), value=own.file) from error


@lru_cache(maxsize=64)
def _own_model(file: Path, changed: Stamps, name: str, text: str, key: str) -> ActorModel:
    """Return the model of a mesh or of a body.

    `changed`: of it and of what moves it, so that new ones are read; `text` holds the `MeshSpec` or `BodyFileSpec`.
    """
    fields = json.loads(text)
    materials = fields.pop("materials")
    del fields["file"]
    if key == "body":
        from scarl_sionna.scene.actors.body import actor_from_body

        return actor_from_body(file, name, materials, **fields)
    from scarl_sionna.scene.actors.mesh import actor_from_mesh  # trimesh takes half a second

    return actor_from_mesh(file, name, fields.pop("semantic"), materials, **fields)


def cast_of(
    spec: ScenarioSpec, scene: SceneDocument, roles: Sequence[Role], setting: Setting, attempts: Mapping[str, int]
) -> list[Member]:
    """Return the ego vehicle and the actors with their motions; `attempts`: how often each was drawn in vain, by name.

    Raises
    ------
    ScenarioError
        If a motion is not possible; it tells of all such motions.
    """
    members, problems = [], []
    for role in roles:
        jitter = draw_jitter(spec.seed, role.name, spec.randomization.placements, attempts.get(role.name, 0))
        try:
            members.append(Member(role.path, _staged(spec, role, _motion(spec, scene, role, setting, jitter))))
        except ScenarioError as error:
            problems.append(error)
    if problems:
        raise ScenarioError.first_of(problems)
    return members


def _motion(spec: ScenarioSpec, scene: SceneDocument, role: Role, setting: Setting, jitter: Jitter) -> Trajectory:
    stated = role.spec.trajectory
    if stated is None:
        entry = next((one for one in scene.instances if one.name == scene.ego and one.trajectory is not None), None)
        if entry is None or entry.trajectory is None:
            raise ScenarioValueError(
                f"states no motion, and scene '{spec.scene}' has no ego vehicle whose motion it could take",
                spec.place(*role.path),
                "give it a `trajectory`",
            )
        return entry.trajectory
    place = functools.partial(spec.place, *role.path, "trajectory")
    return trajectory_of(stated, role.name, ActorBody.of(role.model), setting, place, jitter)


def _staged(spec: ScenarioSpec, role: Role, trajectory: Trajectory) -> StagedActor:
    return StagedActor(
        role.name,
        role.model,
        trajectory,
        detail=role.spec.detail or spec.detail,
        variant=role.variant,
        colors=role.colors or None,
    )
