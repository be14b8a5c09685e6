"""A driving scene: parts, instances and actors, and its immutable states over time.

The two know each other, so they share a file.
"""

from __future__ import annotations

import copy
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_cross
from scarl_sionna.core.errors import InputTypeError, ScarlWarning, TimeRangeError, UnknownNameError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.prompt.arguments import number
from scarl_sionna.core.prompt.describe import Described, Row, listed, quantity, short, span, vector
from scarl_sionna.core.results import ObjectState
from scarl_sionna.core.specs.conditions import Conditions
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.scene.bodies.bending import BentMesh
from scarl_sionna.scene.document.model import SceneDocument
from scarl_sionna.scene.document.staging import StagedActor, on_trajectories
from scarl_sionna.scene.document.staging import stage as stage_document
from scarl_sionna.scene.lanes import SIGNAL_COLORS
from scarl_sionna.scene.materials.lying_snow import with_lying_snow
from scarl_sionna.scene.materials.table import MaterialTable
from scarl_sionna.scene.materials.wet import wet_surfaces
from scarl_sionna.scene.motion.articulation import joints_on_ground
from scarl_sionna.scene.motion.trajectory import Motion, Trajectory, expect_trajectory, is_present
from scarl_sionna.scene.tables import Actor, InstanceInfo, RayHits, part_table

from .changing import Changes
from .instances import Shapes, check_bodies, describe_instance
from .light.lamps import Moment
from .rays.bent_faces import BentFaces, bent_faces
from .rays.cast import Target, cast_rays
from .rays.enclosure import enclosing, hits_above, is_left_behind
from .rays.footing import Footing
from .rays.geometry import Triangles, upright_box
from .rays.nearby import middle_of, release_near, scene_near
from .snow_cover import SKY, snow_covered
from .threads import many_threads
from .twins import MeshData, Twin
from .types import MitsubaObject

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .show.plan import Sensors
    from .show.preview import Drawn, Points

__all__ = ["World", "WorldState"]

Array = npt.NDArray[np.float64]


class World(Described):
    """A loaded scene. Make one with :func:`load_scene`; ask for its states with :meth:`at`."""

    def __init__(self, document: SceneDocument, materials: MaterialTable) -> None:
        self.document = document
        self.materials = materials
        self.weather = Weather()
        self.lighting = document.lighting
        self._dry = document, materials, document.lighting
        self._changes: Changes[World] = Changes()
        self.name = document.name
        self.noise_name = ""
        self.ego = document.ego
        self.parts, self._entries = part_table(document, materials)
        self._twins: dict[str, Twin] = {}
        self._meshes = dict(zip(self.parts.name, self.twin("optical").mesh_data(), strict=True))
        self._triangles = Triangles.from_meshes(
            [mesh.vertices for mesh in self._meshes.values()], [mesh.faces for mesh in self._meshes.values()]
        )
        footing = Footing(self._triangles, self.parts.actor < 0)
        self._entries = [
            replace(entry, joints=joints_on_ground(entry.joints, footing)) if entry.joints else entry
            for entry in self._entries
        ]
        self.actors = tuple(
            Actor.of(entry, number, entry.trajectory)
            for number, entry in enumerate(self._entries, start=1)
            if entry.trajectory is not None
        )
        check_bodies(self.actors, self._meshes)
        self._names: Mapping[str, str | None] = {}
        self._shapes = Shapes(self.parts, self._meshes)
        corners = self._triangles.corners.reshape(-1, 3) if document.is_foreign else None
        self.instances = {
            number: describe_instance(self._shapes, number, entry, corners)
            for number, entry in enumerate(self._entries, start=1)
        }

    def _facts(self) -> Iterable[Row]:
        static = [info.name for info in self.instances.values() if info.actor is None]
        yield "name", self.name
        yield "actors", f"{len(self.actors)}: {listed(actor.name for actor in self.actors)}"
        yield "ego", str(self.ego)
        yield "time_range", span(*self.time_range, "s") if self.actors else "any time: nothing moves"
        yield "static instances", f"{len(static)}: {listed(static)}"
        yield "parts", f"{len(self.parts.name)} with {len(self._triangles.corners)} triangles"
        materials = dict.fromkeys(self.parts.material)
        yield "radio materials", f"{len(materials)}: {listed(materials)}"
        lanes = self.document.lanes
        yield "lanes", "none" if lanes is None else f"{len(lanes.lanes)}, parking places: {len(lanes.parking)}"
        yield "lighting", "emitters of the scene's XML" if self.lighting is None else short(self.lighting)
        yield "weather", "clear" if self.weather.is_clear else short(self.weather)
        if self.changes:
            yield "changes", f"{len(self.changes)}: at {listed(quantity(one.time, 's') for one in self.changes)}"

    @cached_property
    def _moving_parts(self) -> tuple[tuple[int, int], ...]:
        """Part and index of its actor, of every part that has one."""
        index = self.parts.actor.tolist()
        return tuple((part, index[part]) for part in range(len(index)) if index[part] >= 0)

    @cached_property
    def _actor_of_name(self) -> dict[str, Actor]:
        return {actor.name: actor for actor in self.actors}

    def twin(self, kind: str) -> Twin:
        """Return a twin of the scene, ``"optical"`` or ``"radio"``, loaded on first use.

        Raises
        ------
        UnknownNameError
            If there is no such twin.
        """
        if kind not in self._twins:
            if kind not in ("optical", "radio"):
                raise UnknownNameError("twin", kind, ("optical", "radio"))
            with many_threads():
                self._twins[kind] = Twin(kind, self.document, self.materials, self.parts.name, self.lighting)
        return self._twins[kind]

    def with_lighting(self, lighting: Lighting | str | None) -> World:
        """Return this world under another lighting; it shares everything but the optical twin.

        Parameters
        ----------
        lighting : Lighting, str or None
            Or the name of a preset (``"day"``, ``"dusk"``, ``"night"``, ``"overcast"``, ``"rain"``); None: the emitters
            of the scene's own XML.
        """
        other = copy.copy(self)
        other._changes = self._changes.without("lighting")
        chosen = Lighting.preset(lighting) if isinstance(lighting, str) else lighting
        other.lighting = self.weather.over(chosen, self.is_indoors)
        other._dry = *self._dry[:2], chosen
        other._twins = {kind: twin for kind, twin in self._twins.items() if kind != "optical"}
        return other

    def with_weather(self, weather: Weather | str) -> World:
        """Return this world in another weather: its materials wet or under snow, its lighting by :meth:`Weather.over`.

        Sensors read `weather` for what is in the air; indoors (`is_indoors`) all stays dry unless it gives a `wetness`.
        The new world shares everything but the optical twin; geometry and instances stay.

        Parameters
        ----------
        weather : Weather or str
            Or the name of a preset, one of :data:`scarl_sionna.core.specs.weather.WEATHER_PRESETS`; ``"clear"`` goes
            back to the scene as it was loaded.
        """
        other = copy.copy(self)
        other._changes = self._changes.without("weather")
        chosen = Weather.preset(weather) if isinstance(weather, str) else weather
        other.weather = chosen.with_(wetness=0.0) if self.is_indoors and chosen.wetness is None else chosen
        document, materials, lighting = self._dry
        if other.weather.lying_snow != "none":
            covered = snow_covered(self.parts, self._meshes, self._sheltered, other.weather)
            document = with_lying_snow(document, covered, other.weather.snow)
        other.document, other.materials = wet_surfaces(document, materials, other.weather)
        other.parts = part_table(other.document, other.materials)[0]
        other.lighting = other.weather.over(lighting, self.is_indoors)
        if other.lighting != self.lighting or other.document.bsdf_of_shape != self.document.bsdf_of_shape:
            other._twins = {kind: twin for kind, twin in self._twins.items() if kind != "optical"}
        return other

    def with_changes(self, changes: Iterable[Conditions]) -> World:
        """Return this world with light and weather that change: states have those of their time, from the first one on.

        Raises
        ------
        ParameterRangeError
            If the times of the changes do not rise.
        """
        other = copy.copy(self)
        other._changes = Changes(changes)
        return other

    @property
    def changes(self) -> tuple[Conditions, ...]:
        """Changes of light and weather, in the order of their times."""
        return self._changes.steps

    @property
    def stated(self) -> tuple[Lighting | None, Weather]:
        """The lighting as it was chosen, without what the weather makes of it, and the weather."""
        return self._dry[2], self.weather

    def under(self, lighting: Lighting | None, weather: Weather) -> World:
        """Return this world under another lighting and in another weather, all the time."""
        other = copy.copy(self)
        other._changes = Changes()
        other._dry, other._twins = (*self._dry[:2], lighting), dict(self._twins)
        return other.with_weather(weather)

    def release(self, kind: str) -> None:
        """Let go of a twin; it is loaded again when it is asked for."""
        self._twins.pop(kind, None)
        release_near(self._triangles, kind)

    def _sheltered(self, places: Array) -> int:
        """Return how many of places (n, 3) [m] have something above them."""
        state = self.at(float(np.clip(0.0, *self.time_range)))
        return len(np.unique(hits_above(state.cast, places, SKY).ray))

    def with_actors(self, actors: Sequence[StagedActor], ego: str | None = None) -> World:
        """Return a world of its own in which this one's scene has more actors; see :func:`scarl_sionna.stage`."""
        document, materials, lighting = self._dry
        staged = World(stage_document(replace(document, lighting=lighting), actors, ego), materials)
        staged = staged if self.weather == Weather() else staged.with_weather(self.weather)
        return staged.with_changes(self.changes).with_names(self._names).with_noise_of(self.noise_name)

    def with_noise_of(self, name: str) -> World:
        """Return this world with the noise of a drive of some name; it shares everything else.

        Sensors draw their random numbers by `noise_name`, beside seed, time and their own names. It is that of the
        drive in the world of a scenario, so that drives of one seed have noise of their own, and empty in a scene.
        """
        other = copy.copy(self)
        other.noise_name = name
        return other

    def with_names(self, names: Mapping[str, str | None]) -> World:
        """Return this world with further names of actors; it shares everything else.

        Parameters
        ----------
        names : mapping of str to str or None
            What an actor is called -> its name in the scene, None of one that is not there and has no place; read
            whenever an actor is asked for; names in the scene go before them.
        """
        other = copy.copy(self)
        other._names = names
        return other

    def with_motion(self, trajectories: Mapping[str, Trajectory]) -> World:
        """Return this world with other trajectories of its actors, by their names; it shares everything else.

        Raises
        ------
        UnknownNameError
            If there is no such actor.
        InputTypeError
            If a value is no trajectory.
        """
        for name, trajectory in trajectories.items():
            self.actor(name)
            expect_trajectory(f"trajectory of '{name}'", trajectory)
        other = copy.copy(self)
        other.__dict__.pop("_actor_of_name", None)
        other._changes = self._changes.moved(trajectories)
        entries = {entry.name: entry for entry in on_trajectories(self._entries, trajectories)}
        other._entries = list(entries.values())
        other.document, dry = (
            replace(document, instances=tuple(entries[entry.name] for entry in document.instances))
            for document in (self.document, self._dry[0])
        )
        other._dry = dry, *self._dry[1:]
        other.actors = tuple(
            Actor.of(entries[actor.name], actor.instance, trajectories.get(actor.name, actor.trajectory))
            for actor in self.actors
        )
        moved = (actor for actor in other.actors if actor.name in trajectories)
        other.instances = self._shapes.with_boxes(self.instances, moved)
        return other

    def mesh(self, part: int) -> MeshData:
        """Return the mesh of a part: of a static one in the world's frame, else in its own (`WorldState.part_pose`)."""
        return self._meshes[self.parts.name[part]]

    def part_bounds(self) -> tuple[Array, Array]:
        """Return lower and upper corner of every part's box in its mesh's frame, each of shape (num_parts, 3) [m]."""
        return self._triangles.bounds()

    def actor(self, name: str) -> Actor:
        """Return an actor by name.

        Raises
        ------
        UnknownNameError
            If there is no such actor, or it is not there (:meth:`with_names`).
        """
        own = name if name in self._actor_of_name else self._names.get(name)
        if own not in self._actor_of_name:
            known = (other for other, actor in self._names.items() if actor is not None)
            raise UnknownNameError("actor", name, {*self._actor_of_name, *known})
        return self._actor_of_name[own]

    @property
    def is_indoors(self) -> bool:
        """Whether the scene is a tunnel or a car park (``enclosed = true`` in scene.toml)."""
        return self.document.is_enclosed

    @property
    def time_range(self) -> tuple[float, float]:
        """Interval in which all trajectories are known [s]; infinite for a static scene."""
        starts = [actor.trajectory.start for actor in self.actors]
        stops = [actor.trajectory.stop for actor in self.actors]
        return max(starts, default=-np.inf), min(stops, default=np.inf)

    def at(self, time: float) -> WorldState:
        """Return the state at a time.

        Parameters
        ----------
        time : float
            [s], within `time_range`.

        Raises
        ------
        TimeRangeError
            If a trajectory is not known at this time.
        InputTypeError
            If it is no number.
        """
        if isinstance(time, list | tuple | np.ndarray) and np.ndim(time):
            raise InputTypeError("time", time, "one number [s]", "give [world.at(one) for one in times]")
        time = number("time", time, "give seconds: world.at(0.5)")
        if not np.isfinite(time):
            raise TimeRangeError(time, *self.time_range, what=f"scene '{self.name}'")
        poses = {actor.name: actor.trajectory.pose(time) for actor in self.actors}
        twists = {actor.name: actor.trajectory.twist(time) for actor in self.actors}
        return WorldState(self._changes.world_at(self, time), time, poses, twists)

    def with_parts_at(self, places: Mapping[int, Pose], bent_at: float = 0.0) -> WorldState:
        """Return a state at rest in which parts of actors have given places, world_from_part by the row of the part.

        Those that bend are as at a time [s].
        """
        return _PlacedState(self, places, bent_at)

    def bent_faces(self, places: Mapping[int, Pose], time: float) -> BentFaces:
        """Return the faces that bend as at a time [s], their parts in given places."""
        return bent_faces(self._triangles.first, self.mesh, self._bent(time), places)

    def _bent(self, time: float) -> dict[int, BentMesh]:
        """Return the meshes of the parts that bend at a time [s], in the frames of their actors."""
        meshes = {shape: mesh for actor in self.actors for shape, mesh in actor.bent(time).items()}
        return {self.parts.name.index(shape): mesh for shape, mesh in meshes.items()}

    def plot(
        self,
        time: float | None = None,
        rig: Sensors | None = None,
        extent: tuple[float, float, float, float] | None = None,
        ax: Axes | None = None,
    ) -> Axes:
        """Draw the world from above: ground, lanes, actors with the way of their next second, and the sensors of a rig.

        Parameters
        ----------
        time : float, optional
            [s]; default: the start of the motion, 0 in a static scene.
        rig : Rig, optional
            Drawn on the ego vehicle, with the width of the fields of view.
        extent : tuple of float, optional
            West, east, south and north end [m]; default: around the actors, or all of a static scene.
        ax : matplotlib.axes.Axes, optional
            Drawn into; default: those of a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        TimeRangeError
            If the motion is not known at this time.
        PlacementError
            If a rig is given and there is no ego vehicle.
        """
        start = self.time_range[0]
        return self.at((start if np.isfinite(start) else 0.0) if time is None else time).plot(rig, extent, ax)

    def preview(
        self,
        rig: Sensors | None = None,
        paths: Drawn | None = None,
        points: Points | None = None,
        time: float | None = None,
    ) -> MitsubaObject:
        """Return a view of the world in three dimensions for a notebook.

        Sionna RT's previewer, in the colours of radio materials.

        Parameters
        ----------
        rig : Rig, optional
            Sensors on the ego vehicle, each a ball with its boresight.
        paths : RadarPaths, optional
            Lines from the receiver to where it sees each path, brighter where they are stronger; the strongest 3,000.
        points : RadarPoints, LidarScan or ndarray of shape (num_points, 3) [m, world], optional
            Coloured by radial velocity. Detections stand in the frame of the radar of `paths`, else of the rig's first
            radar.
        time : float, optional
            [s]; default: the start of the motion, 0 in a static scene.

        Returns
        -------
        sionna.rt.preview.Previewer
            Shows itself as the result of a notebook's cell, or by its ``display()``.

        Raises
        ------
        TimeRangeError
            If the motion is not known at this time.
        PlacementError
            If a rig is given and there is no ego vehicle.
        ParameterRangeError, InputTypeError
            If points are of another kind or shape, or detections stand without their radar.
        """
        from .show.preview import preview_state

        start = self.time_range[0]
        return preview_state(
            self.at((start if np.isfinite(start) else 0.0) if time is None else time), rig, paths, points
        )


class WorldState(Described):
    """Poses and velocities of everything at one time; immutable. Made by :meth:`World.at`."""

    def __init__(self, world: World, time: float, poses: Mapping[str, Pose], twists: Mapping[str, Twist]) -> None:
        self.world = world
        self.time = time
        self._poses = poses
        self._twists = twists

    def _facts(self) -> Iterable[Row]:
        yield "world", self.world.name
        yield "time", quantity(self.time, "s")
        for name, pose in self._poses.items():
            speed = float(np.linalg.norm(self._twists[name].linear))
            yield f"actor {name}", f"{vector(pose.position, 'm')}, yaw {np.degrees(pose.yaw):.4g} deg, {speed:.4g} m/s"

    def plot(
        self,
        rig: Sensors | None = None,
        extent: tuple[float, float, float, float] | None = None,
        ax: Axes | None = None,
    ) -> Axes:
        """Draw the state from above; see :meth:`World.plot`."""
        from .show.plan import plot_state

        return plot_state(self, rig, extent, ax)

    def actor_pose(self, name: str) -> Pose:
        """Return world_from_actor of an actor."""
        return self._poses[self.world.actor(name).name]

    def actor_twist(self, name: str) -> Twist:
        """Return the velocity of an actor."""
        return self._twists[self.world.actor(name).name]

    def mount(self, actor: str | None, actor_from_sensor: Pose | None = None) -> Mount:
        """Return pose and velocity of a sensor that rides on an actor.

        Parameters
        ----------
        actor : str
            Name of the actor, for instance ``world.ego``.
        actor_from_sensor : Pose, optional
            Where it sits: x forward, y left, z up from the actor's origin, on the ground below the middle of a car [m].
            It rides on the actor, not on what turns on that: of a lorry with a trailer on the tractor (docs/limits.md).

        Raises
        ------
        UnknownNameError
            If there is no such actor.
        InputTypeError
            If `actor_from_sensor` is no pose, or `actor` no name: ``world.ego`` of a scene without an ego vehicle.
        """
        if not isinstance(actor, str):
            remedy = f"the actors of this scene: {', '.join(sorted(self._poses)) or 'none'}; a Pose is a place at rest"
            raise InputTypeError("actor", actor, "a name (world.ego is None in a scene without an ego vehicle)", remedy)
        place = Pose() if actor_from_sensor is None else actor_from_sensor
        if not isinstance(place, Pose):
            raise InputTypeError("actor_from_sensor", place, "a Pose", "write ss.Pose([x, y, z])")
        return Mount(self.actor_pose(actor), self.actor_twist(actor), self.world.actor(actor).name).at(place)

    def as_mount(self, place: Mount | Pose) -> Mount:
        """Return a mount as it is, and a pose as one at rest; warn of a pose that stands on or in a moving actor.

        Raises
        ------
        InputTypeError
            If `place` is neither.
        """
        mount = Mount.of(place)
        if mount is place:
            return mount
        for box in self.boxes():
            if is_left_behind(mount.pose, box):
                warnings.warn(
                    f"a sensor is given by a pose, so it stands still, but that is on or in '{box.name}', "
                    f"which moves at {np.linalg.norm(box.twist.linear):.1f} m/s; "
                    f"state.mount('{box.name}', ss.Pose([x, y, z])) rides on it",
                    ScarlWarning,
                    stacklevel=3,
                )
        return mount

    @cached_property
    def _joints(self) -> dict[str, dict[str, Motion]]:
        """Motion of the shapes with a joint relative to their actor, by actor."""
        return {actor.name: actor.motions(self.time) for actor in self.world.actors if actor.joints}

    @cached_property
    def _part_motion(self) -> dict[int, Motion]:
        """Motion in the world of every part that belongs to an actor."""
        motions = {}
        wholes = {name: Motion(pose, self._twists[name]) for name, pose in self._poses.items()}
        moved: dict[int, Motion] = {}  # by the identity of the joint's motion, which several shapes can share
        for part, index in self.world._moving_parts:
            name = self.world.actors[index].name
            whole, own = wholes[name], self._joints.get(name, {}).get(self.world.parts.name[part])
            if own is None:
                motions[part] = whole
                continue
            if id(own) not in moved:
                moved[id(own)] = whole.then(own)
            motions[part] = moved[id(own)]
        return motions

    def part_pose(self, part: int) -> Pose:
        """Return world_from_part: the actor's pose and the part's joint; the identity for what stands still."""
        return self._part_motion[part].pose if part in self._part_motion else Pose()

    def part_corners(self, part: int) -> Array:
        """Return the triangles of a part in its own frame (`part_pose`), as it is bent now, (num_faces, 3, 3) [m]."""
        mesh = self._bent_meshes.get(self.world.parts.name[part]) or self.world.mesh(part)
        return mesh.vertices[mesh.faces]

    @property
    def _bent_at(self) -> float:
        return self.time

    @cached_property
    def _bent(self) -> dict[int, BentMesh]:
        return self.world._bent(self._bent_at)

    @cached_property
    def _bent_meshes(self) -> dict[str, MeshData]:
        names = self.world.parts.name
        return {names[part]: MeshData(mesh.vertices, self.world.mesh(part).faces) for part, mesh in self._bent.items()}

    @cached_property
    def _bent_faces(self) -> BentFaces | None:
        poses = {part: self._part_motion[part].pose for part in self._bent}
        return bent_faces(self.world._triangles.first, self.world.mesh, self._bent, poses) if self._bent else None

    def carried(
        self, face: npt.NDArray[np.int64], point: Array, later: WorldState
    ) -> tuple[npt.NDArray[np.int64], Array]:
        """Return which of some points (n, 3) [m, world] on faces (n,) bend, and where those are in another state."""
        if self._bent_faces is None or later._bent_faces is None:
            return np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        return self._bent_faces.carried(face, point, later._bent_faces)

    def point_velocity(self, part: npt.NDArray[Any], point: Array, face: npt.NDArray[np.int64] | None = None) -> Array:
        """Return the velocity of surface points.

        Parameters
        ----------
        part : ndarray of int, shape (n,)
            Row of the part table; -1 is at rest.
        point : ndarray of float64, shape (n, 3)
            [m, world].
        face : ndarray of int64, shape (n,), optional
            Triangle of each, a row of the state's :class:`~.face_planes.FaceTable`; without it, a point on a part that
            bends has the velocity of the nearest point of its surface.

        Returns
        -------
        ndarray of float64, shape (n, 3)
            [m/s, world].
        """
        velocity = np.zeros_like(point)
        rows = np.flatnonzero(np.where(part >= 0, self.world.parts.actor[part], -1) >= 0)
        parts, motion = np.unique(part[rows], return_inverse=True)
        motions = [self._part_motion[int(index)] for index in parts]
        if motions:
            offset = point[rows] - np.array([each.pose.position for each in motions])[motion]
            turning = np.array([each.twist.angular for each in motions])[motion]
            velocity[rows] = np.array([each.twist.linear for each in motions])[motion] + row_cross(turning, offset)
        if self._bent_faces is not None:
            bent = self._bent_faces
            velocity += bent.nearest(np.asarray(part), point) if face is None else bent.at(face, point)
        return velocity

    @cached_property
    def _triangles(self) -> Triangles:
        corners = {part: self.part_corners(part) for part in self._bent}
        triangles = self.world._triangles.with_meshes(corners)
        return triangles.moved({part: motion.pose for part, motion in self._part_motion.items()})

    @cached_property
    def _bounds(self) -> tuple[Array, Array]:
        return self._triangles.bounds()

    @cached_property
    def _instance_bounds(self) -> tuple[Array, Array]:
        """Lower and upper corners of the boxes of all instances, in the table's order."""
        parts = [list(info.parts) for info in self.world.instances.values()]
        if not parts:
            return np.zeros((0, 3)), np.zeros((0, 3))
        rows, first = np.concatenate(parts), np.cumsum([0, *(len(own) for own in parts[:-1])])
        lower, upper = self._bounds
        return np.minimum.reduceat(lower[rows], first), np.maximum.reduceat(upper[rows], first)

    @cached_property
    def _face_velocity(self) -> Array:
        """Velocity of the centroids of all triangles, shape (num_faces, 3) [m/s, world]; zero at rest."""
        corners, part = self._triangles.corners, self._triangles.part
        found = np.zeros((len(part), 3))
        rows = np.flatnonzero(self.world.parts.actor[part] >= 0)
        center = (corners[rows, 0] + corners[rows, 1] + corners[rows, 2]) / 3.0
        found[rows] = self.point_velocity(part[rows], center)
        found.flags.writeable = False
        return found

    def _applied(self, kind: str) -> Twin:
        """Return a twin that stands in this state."""
        twin = self.world.twin(kind)
        if not twin.stands_in(self):
            names = self.world.parts.name
            twin.apply(
                self,
                Moment(self.time, {actor.name: actor.trajectory for actor in self.world.actors}),
                {names[part]: motion.pose for part, motion in self._part_motion.items()},
                self.world._meshes,
                self._bent_meshes,
            )
        return twin

    @property
    def signals(self) -> dict[str, tuple[str, ...]]:
        """What traffic lights show: for each group its lit colours of ``("red", "amber", "green")``."""
        lanes = self.world.document.lanes
        plan = None if lanes is None else lanes.signals
        if plan is None:
            return {}
        return {
            group: tuple(color for color in SIGNAL_COLORS if color in plan.shown(group, self.time))
            for group in plan.green
        }

    def optical_scene(self) -> MitsubaObject:
        """Return the Mitsuba scene of the RGB variant in this state; use it inside ``variant.optical()``.

        Parts that do not shine are joined by their BSDF: they are not shapes of it by their ids.
        """
        return self._applied("optical").mi_scene

    @property
    def airlight(self) -> Array:
        """Radiance of the sky at the horizon in the units of the image, shape (3,), into which haze fades.

        Zeros where the lighting has no haze.
        """
        return np.asarray(self.world.twin("optical").airlight)

    def radio_scene(self) -> MitsubaObject:
        """Return the Sionna RT scene in this state, with the velocities set; use it inside ``variant.radio()``."""
        twin, names = self._applied("radio"), self.world.parts.name
        twin.set_velocities({names[part]: motion.twist for part, motion in self._part_motion.items()})
        return twin.sionna_scene

    def boxes(self) -> tuple[ObjectState, ...]:
        """Return the ground truth of every actor that is in the scene and of every static object."""
        return self._boxes

    @cached_property
    def _boxes(self) -> tuple[ObjectState, ...]:
        states = []
        for info in self.world.instances.values():
            if not info.is_object or (info.actor is not None and not self.is_present(info.actor)):
                continue
            if info.actor is None:
                box, twist, tight = info.frame_from_box, Twist(), {}
            else:
                pose, own = self._poses[info.actor], self._twists[info.actor]
                box, tight = pose.compose(info.frame_from_box), self._tight_box(info)
                twist = Twist(own.velocity_at(box.position - pose.position), own.angular)
            states.append(
                ObjectState(
                    info.name, info.instance, info.semantic, box, info.size, twist, info.actor is not None, **tight
                )
            )
        return tuple(states)

    def is_present(self, name: str) -> bool:
        """Return whether an actor is in the scene at this time: it may come later or be gone.

        Raises
        ------
        UnknownNameError
            If there is no such actor.
        """
        world = self.world
        if name not in world._actor_of_name and world._names.get(name, name) is None:
            return False
        return is_present(self.world.actor(name).trajectory, self.time)

    def _tight_box(self, info: InstanceInfo) -> dict[str, Any]:
        """Return what `ObjectState` says of the box of an actor at this time, as far as it is not that of its track."""
        actor = self.world.actor(str(info.actor))
        if actor.bending is None and not any(joint.changes_shape for joint in actor.joints):
            return {}
        moved = self._joints.get(actor.name, {})
        vertices = self.world._shapes.vertices(info.parts, moved, actor.bent(self._bent_at))
        box, size = upright_box(vertices, fixed_axes=True)
        return {"tight_center": box.position - info.frame_from_box.position, "tight_size": size}

    def cast(
        self, origins: npt.ArrayLike, directions: npt.ArrayLike, max_distance: float = np.inf, twin: str = "optical"
    ) -> RayHits:
        """Intersect rays with the scene.

        Parameters
        ----------
        origins : array_like of float, shape (3,) or (num_rays, 3)
            [m, world].
        directions : array_like of float, shape (num_rays, 3)
            Unit vectors [world].
        max_distance : float
            Nothing is hit beyond [m].
        twin : str
            Which twin is intersected: ``"optical"`` or ``"radio"``. The geometry is the same.

        Returns
        -------
        RayHits
            With distances and points in float64 on the plane of the triangle hit.
        """
        origin = np.asarray(origins, dtype=np.float64)
        direction = np.asarray(directions, dtype=np.float64).reshape(-1, 3)
        scene = scene_near(self, middle_of(origin), twin)
        return cast_rays(Target(scene, self._triangles, self.point_velocity), origin, direction, max_distance)

    def inside(self, point: npt.ArrayLike) -> str | None:
        """Return the name of the instance whose mesh encloses a point, shape (3,) [m, world], or None.

        An actor made of several shells (a cabin behind separate panes) encloses a point from which no ray gets out.
        Rooms (``room = true`` in scene.toml) are there to be stood in and do not count.
        """
        where, loaded = np.asarray(point, dtype=np.float64), "optical" in self.world._twins
        instances = list(self.world.instances.values())
        return enclosing(where, instances, self._instance_bounds, self._triangles, self.cast, loaded)


class _PlacedState(WorldState):
    """A state in which every part of an actor has a given place."""

    def __init__(self, world: World, places: Mapping[int, Pose], bent_at: float) -> None:
        poses = {actor.name: Pose() for actor in world.actors}
        super().__init__(world, 0.0, poses, {name: Twist() for name in poses})
        self._places, self._time_bent = places, bent_at

    @property
    def _bent_at(self) -> float:
        return self._time_bent

    @cached_property
    def _part_motion(self) -> dict[int, Motion]:
        return {part: Motion(pose) for part, pose in self._places.items()}
