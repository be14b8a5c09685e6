"""What a world is made of, as plain tables: its parts, instances and actors, and the hits of rays on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.describe import Described
from scarl_sionna.core.semantics import semantic_id

from .bodies.bending import Bending, BentMesh
from .document.model import InstanceEntry, SceneDocument
from .materials.table import MaterialTable, UnknownMaterialError
from .motion.articulation import Joint
from .motion.trajectory import Motion, Trajectory

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class PartTable(Described):
    """One row for each shape of the XML ("part").

    Attributes
    ----------
    name : tuple of str
        Shape ids.
    instance : ndarray of int32, shape (num_parts,)
        Instance ids, >= 1.
    semantic : ndarray of uint8, shape (num_parts,)
    material : tuple of str
        Radio materials.
    lidar_reflectance : ndarray of float64, shape (num_parts,)
        Diffuse reflectance at 1550 nm.
    lidar_transmittance : ndarray of float64, shape (num_parts,)
        Of a pane at 1550 nm, once through; 0 for what is opaque.
    retroreflection : ndarray of float64, shape (num_parts,)
        Of sheets and prisms, R_A at normal incidence [cd/(lx m2)]; 0 for most.
    retroreflected_luminance : ndarray of float64, shape (num_parts,)
        Of beads in markings, R_L [cd/(lx m2)]; 0 for most.
    actor : ndarray of int32, shape (num_parts,)
        Index into `World.actors`; -1 for a static part.
    """

    name: tuple[str, ...]
    instance: npt.NDArray[np.int32]
    semantic: npt.NDArray[np.uint8]
    material: tuple[str, ...]
    lidar_reflectance: Array
    lidar_transmittance: Array
    retroreflection: Array
    retroreflected_luminance: Array
    actor: npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False, repr=False)
class Actor(Described):
    """A moving instance: name, instance id, its trajectory, joints by which parts move on their own, how it bends."""

    name: str
    instance: int
    trajectory: Trajectory
    joints: tuple[Joint, ...] = ()
    bending: Bending | None = None

    @classmethod
    def of(cls, entry: InstanceEntry, number: int, trajectory: Trajectory) -> Actor:
        """Return the actor of an instance with a number, on a trajectory."""
        return cls(entry.name, number, trajectory, entry.joints, entry.bending)

    def bent(self, time: float) -> dict[str, BentMesh]:
        """Return the mesh of each shape that bends, in the actor's frame; beyond the trajectory, that at its end."""
        if self.bending is None:
            return {}
        return self.bending.at(min(max(time, self.trajectory.start), self.trajectory.stop))

    def motions(self, time: float) -> dict[str, Motion]:
        """Return the motion relative to the actor of each shape that has a joint.

        Beyond the trajectory, the motion at its end.
        """
        known = min(max(time, self.trajectory.start), self.trajectory.stop)
        return {shape: motion for joint in self.joints for shape, motion in joint.motions(known).items()}


@dataclass(frozen=True, eq=False, repr=False)
class InstanceInfo(Described, units={"size": "m"}):
    """One instance: its parts, and its box in its own frame (actors) or in the world (static)."""

    name: str
    instance: int
    semantic: int
    parts: tuple[int, ...]
    is_object: bool
    is_room: bool
    actor: str | None
    frame_from_box: Pose
    size: Array


@dataclass(frozen=True, eq=False, repr=False)
class RayHits(Described, units={"distance": "m", "point": "m", "velocity": "m/s"}):
    """Rays that hit something, in ray order.

    Attributes
    ----------
    ray : ndarray of int64, shape (num_hits,)
        Which ray.
    distance : ndarray of float64, shape (num_hits,)
        Along the ray [m].
    point : ndarray of float64, shape (num_hits, 3)
        Hit point [m, world].
    normal : ndarray of float64, shape (num_hits, 3)
        Unit normal of the triangle, towards the ray's origin.
    cos_incidence : ndarray of float64, shape (num_hits,)
        Cosine of the angle of incidence.
    part : ndarray of int32, shape (num_hits,)
        Row of the part table.
    velocity : ndarray of float64, shape (num_hits, 3)
        Velocity of the surface point [m/s, world].
    face : ndarray of int64, shape (num_hits,)
        Triangle, a row of the state's :class:`~.face_tracing.FaceTable`.
    """

    ray: npt.NDArray[np.int64]
    distance: Array
    point: Array
    normal: Array
    cos_incidence: Array
    part: npt.NDArray[np.int32]
    velocity: Array
    face: npt.NDArray[np.int64]

    @property
    def num_hits(self) -> int:
        """Number of hits."""
        return int(self.ray.shape[0])

    @classmethod
    def none(cls) -> RayHits:
        """Return no hits."""
        none, index = np.zeros((0, 3)), np.zeros(0, np.int64)
        return cls(
            index, np.zeros(0), none, none.copy(), np.zeros(0), index.astype(np.int32), none.copy(), index.copy()
        )


def part_table(document: SceneDocument, materials: MaterialTable) -> tuple[PartTable, list[InstanceEntry]]:
    """Return the parts, and the instances in the order of their ids (static first, then actors)."""
    entries = sorted(document.instances, key=lambda entry: entry.trajectory is not None)
    actors = [entry.name for entry in entries if entry.trajectory is not None]
    _check_materials(document, materials)
    rows = []
    for number, entry in enumerate(entries, start=1):
        for shape in entry.shapes:
            material = document.materials[document.bsdf_of_shape[shape]]
            actor = actors.index(entry.name) if entry.trajectory is not None else -1
            radio_entry = materials[material.radio]
            reflectance, transmittance = material.lidar_reflectance, material.lidar_transmittance
            rows.append(
                (
                    shape,
                    number,
                    semantic_id(entry.semantic),
                    radio_entry.name,
                    radio_entry.lidar_reflectance if reflectance is None else reflectance,
                    radio_entry.lidar_transmittance if transmittance is None else transmittance,
                    material.retroreflection,
                    material.retroreflected_luminance,
                    actor,
                )
            )
    name, instance, semantic, radio, reflectances, transmittances, sheets, beads, actor_index = zip(*rows, strict=True)
    table = PartTable(
        name=name,
        instance=np.array(instance, dtype=np.int32),
        semantic=np.array(semantic, dtype=np.uint8),
        material=radio,
        lidar_reflectance=np.array(reflectances, dtype=np.float64),
        lidar_transmittance=np.array(transmittances, dtype=np.float64),
        retroreflection=np.array(sheets, dtype=np.float64),
        retroreflected_luminance=np.array(beads, dtype=np.float64),
        actor=np.array(actor_index, dtype=np.int32),
    )
    return table, entries


def _check_materials(document: SceneDocument, materials: MaterialTable) -> None:
    """Raise for the BSDFs of a scene that name no radio material, with all of them."""
    lacking = [bsdf for bsdf, entry in sorted(document.materials.items()) if entry.radio not in materials]
    if not lacking:
        return
    listed = ", ".join(lacking[:8]) + (" ..." if len(lacking) > 8 else "")
    raise UnknownMaterialError(
        document.materials[lacking[0]].radio,
        materials,
        f"{len(lacking)} BSDFs name none: {listed}; state each in a scene.toml beside the XML, "
        f'as [materials."{lacking[0]}"] and radio = "concrete", or add a sourced entry to a materials.toml of your own',
    )
