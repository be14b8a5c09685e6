"""What an object can send back at most, and what it costs to compute: the numbers that ``method="auto"`` decides by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_max, row_norm
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.core.settings.accuracy import DEFAULT_ACCURACY, Accuracy
from scarl_sionna.core.settings.auto import DEFAULT_AUTO, AutoSettings, SbrLevel
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import dbm_to_watt
from scarl_sionna.engine.rays.geometry import closest_in_triangles
from scarl_sionna.radar.channel.raycast.class_rcs import class_reflectivity, heard_share
from scarl_sionna.radar.channel.sbr.cost import patches_in
from scarl_sionna.radar.optics.patches import PatchSize
from scarl_sionna.radar.optics.tubes.tube_shape import middle, spread
from scarl_sionna.radar.optics.viewpoint import Viewpoint
from scarl_sionna.signal.antenna import boresights, largest_field_gain
from scarl_sionna.signal.link import radar_gain
from scarl_sionna.signal.noise import angle_cell_noise_power

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World, WorldState
    from scarl_sionna.scene.tables import InstanceInfo

Array = npt.NDArray[np.float64]

WIDE_BOX = np.radians(10.0)
"""Half the angle from which on a box is taken to stand where the antenna is best: only loosens the bound of its
power."""


@dataclass(frozen=True)
class Estimate:
    """What an instance can be for a radar.

    Attributes
    ----------
    number : int
        Instance id.
    info : InstanceInfo
    distance : float
        To the nearest point of its box [m].
    size : float
        Largest extent [m].
    area : float
        Of its box projected across the line of sight, the part within the field of view's width at most [m2].
    in_view : bool
    bound_db : float
        Largest power that it can send back over the noise of a range-Doppler-angle cell [dB].
    expected_db : float
        The same by the mean reflectivity of its class [dB].
    is_coherent : bool
        Whether its echo is that of smooth bodies, with a phase that means something.
    source_db : float
        Power over the noise of a cell by the mean reflectivity of its class for a field (gain over length) of 1/m in
        each direction [dB].
    """

    number: int
    info: InstanceInfo
    distance: float
    size: float
    area: float
    in_view: bool
    bound_db: float
    expected_db: float
    is_coherent: bool
    source_db: float

    def level_db(self, field: float) -> float:
        """Return the power over the noise of a cell for a field (gain over length) there and back [dB]."""
        return self.source_db + 40.0 * float(np.log10(max(field, 1e-12)))

    @property
    def name(self) -> str:
        """Name of the instance."""
        return self.info.name


def estimate(
    state: WorldState, radar: RadarSpec, pose: Pose, number: int, reach: float, rules: AutoSettings = DEFAULT_AUTO
) -> Estimate:
    r"""Return distance, size and bounds of an instance.

    Notes
    -----
    A body of projected area A at the distance d has at most the RCS of a flat plate of that area, or of an infinite
    mirror:

    .. math:: \sigma \le \min(4 \pi A^2 / \lambda^2, \pi d^2)

    The second is the image source, :math:`\lambda / (4 \pi \cdot 2 d)`. Concave bodies that focus can exceed it. Of a
    diffuse class it is its mean, gamma A, and `speckle_db`.
    """
    return Estimates(state, radar, pose, reach, rules).of(number)


@dataclass(frozen=True, eq=False)
class Estimates:
    """What instances can be for a radar, see :func:`estimate`; what does not depend on the instance is found once."""

    state: WorldState
    radar: RadarSpec
    pose: Pose
    reach: float
    rules: AutoSettings = DEFAULT_AUTO

    @cached_property
    def _unit(self) -> float:
        """Power over the noise of a cell by 1 m2 at 1 m [1]."""
        return cell_unit(self.radar)

    @cached_property
    def _station(self) -> Viewpoint:
        return Viewpoint.of(self.radar, self.pose, np.zeros(3))

    @cached_property
    def _reflectivity(self) -> Array:
        """Of each class, as the best pair of antennas hears it."""
        return np.asarray(class_reflectivity() * heard_share(self.radar.array))

    def of(self, number: int) -> Estimate:
        """Return what an instance can be."""
        state, radar, pose, rules = self.state, self.radar, self.pose, self.rules
        info = state.world.instances[number]
        box = world_from_box(state, info)
        half = info.size / 2.0
        local = box.inverse().apply(pose.position)
        nearest = box.apply(np.clip(local, -half, half))
        distance = max(float(np.linalg.norm(nearest - pose.position)), 1e-3)
        direction = _unit(pose.position - box.position)
        sides = np.array([half[1] * half[2], half[0] * half[2], half[0] * half[1]]) * 4.0
        in_view, gain = _view(radar, self._station, box, info.size, nearest)
        area = min(float(np.abs(direction @ box.rotation) @ sides), view_width(radar, info) * distance)
        semantic = SEMANTIC_CLASSES[info.semantic]
        mean = float(self._reflectivity[info.semantic]) * area
        flat = min(4.0 * np.pi * area**2 / radar.wavelength**2, np.pi * distance**2)
        coherent = semantic not in rules.diffuse_classes and smooth_share(state, info) > rules.smooth_share
        largest = flat if coherent else mean * 10.0 ** (rules.speckle_db / 10.0)
        scale = self._unit * gain**2 / distance**4
        return Estimate(
            number,
            info,
            distance,
            float(info.size.max()),
            area,
            in_view and distance < self.reach,
            _db(scale * largest),
            _db(scale * mean),
            coherent,
            _db(self._unit * mean),
        )


def cell_unit(radar: RadarSpec) -> float:
    """Return the power over the noise of a range-Doppler-angle cell of 1 m2 at 1 m, for isotropic antennas [1/m2]."""
    sent = dbm_to_watt(radar.front_end.tx_power_dbm) * float(radar_gain(radar.wavelength, 1.0))
    return float(sent / angle_cell_noise_power(radar))


def view_width(radar: RadarSpec, info: InstanceInfo) -> float:
    """Return the width that is in view of an instance, for each metre of its distance, by definition."""
    return float(2.0 * np.tan(min(np.radians(radar.azimuth_fov_deg), 2.9) / 2.0) * (info.size[2] + 1.0))


def surface_distance(state: WorldState, number: int, position: Array) -> float:
    """Return the distance of a position from the nearest point of an instance's faces [m]."""
    corners = state._triangles.of_parts(state.world.instances[number].parts)
    if not len(corners):
        return float("inf")
    center = middle(corners)
    arm, away = row_max(row_norm(corners - center[:, None])), row_norm(center - position)
    corners = corners[away - arm <= (away + arm).min()]  # no others can hold the nearest point
    return float(closest_in_triangles(position, corners)[0].min())


def world_from_box(state: WorldState, info: InstanceInfo) -> Pose:
    """Return where the box of an instance stands."""
    return info.frame_from_box if info.actor is None else state.actor_pose(info.actor).compose(info.frame_from_box)


BOX_POINTS = 9
"""Points of :func:`box_points`: of each instance, by definition."""


def box_points(state: WorldState, number: int) -> Array:
    """Return the corners and the middle of an instance's box, shape (`BOX_POINTS`, 3) [m, world]."""
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)] + [(0, 0, 0)]) / 2.0
    info = state.world.instances[number]
    return world_from_box(state, info).apply(signs * info.size)


@lru_cache(maxsize=64)
def sbr_settings(level: SbrLevel, channel_floor_db: float = DEFAULT_ACCURACY.channel_floor_db) -> SbrSettings:
    """Return the knobs of `sbr` at a level; its floor is that of the channel where that is lower [dB]."""
    others = {"tolerance_db", "growth", "patch_error", "bounce_error"}
    own = SbrSettings.model_fields["floor_db"].default
    return SbrSettings(
        **level.model_dump(exclude=others), max_turn=level.max_phase, floor_db=min(own, channel_floor_db)
    )


def num_tubes(first: float, turning: float, level: SbrLevel, rules: AutoSettings = DEFAULT_AUTO) -> int:
    """Return about how many tubes `sbr` traces for an object, by :class:`.TubeEstimate`.

    Parameters
    ----------
    first : float
        Tubes that start on it, :meth:`Surface.first_tubes`.
    turning : float
        Of :class:`.Sight`.
    level : SbrLevel
    rules : AutoSettings
    """
    return int(rules.tubes.least + first + level.growth * turning)


def affordable_tubes(accuracy: Accuracy, rules: AutoSettings = DEFAULT_AUTO) -> tuple[int, str]:
    """Return how many tubes a solve may take by all budgets, and the name of the budget that says so."""
    seconds, memory = accuracy.cpu_budget, accuracy.memory_budget
    limits = {"tube_budget": accuracy.tube_budget}
    if seconds is not None and rules.tubes.seconds > 0.0:
        limits["cpu_budget"] = int(seconds / rules.tubes.seconds)
    if memory is not None:
        limits["memory_budget"] = patches_in(memory)
    name = min(limits, key=lambda one: limits[one])
    return limits[name], name


@dataclass(frozen=True, eq=False)
class Surface:
    """The faces of an instance in one state, `corners` (n, 3, 3) [m], to be looked at from many positions."""

    corners: Array

    @classmethod
    def of(cls, state: WorldState, number: int) -> Surface:
        """Return the faces of an instance; made once a state, for all radars."""
        known = _surfaces.setdefault(state, {})
        if number not in known:
            known[number] = cls(state._triangles.of_parts(state.world.instances[number].parts))
        return known[number]

    @cached_property
    def _middle(self) -> Array:
        """Centroids, a row each of x, y and z, shape (3, n) [m]."""
        return np.ascontiguousarray(middle(self.corners).T)

    @cached_property
    def _cross(self) -> Array:
        """Normals as long as the areas, a row each of x, y and z, shape (3, n) [m2]."""
        (ax, ay, az), (bx, by, bz) = (np.ascontiguousarray((self.corners[:, k] - self.corners[:, 0]).T) for k in (1, 2))
        return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]) / 2.0

    def seen_from(self, station: Viewpoint, reach: float) -> SurfaceView:
        """Return what of the faces a station sees within a distance [m]."""
        sight = station.pose.position - self._middle.T
        distance = np.maximum(np.sqrt(np.einsum("ij,ij->i", sight, sight)), 1e-3)
        sides = self.corners[:, [1, 2, 0]] - self.corners
        along = np.einsum("nij,nj->ni", sides, sight / distance[:, None])
        across = np.sqrt(np.maximum(np.einsum("nij,nij->ni", sides, sides) - along**2, 0.0))
        points = np.concatenate([self.corners, self._middle.T[:, None]], axis=1)
        in_view = station.sees(points.reshape(-1, 3)).reshape(-1, 4).mean(axis=1)
        near = distance < reach
        return SurfaceView(across, distance, in_view * near if in_view.any() else near)

    def lit_points(self, position: Array, count: int) -> Array:
        """Return points on the faces, evenly over their area as seen from a position, shape (count, 3)."""
        return self.lit_from([position], count)[0]

    def lit_from(self, positions: Sequence[Array], count: int) -> list[Array]:
        """Return :meth:`lit_points` of several positions."""
        (u, v, w), found = self._cross, []
        x, y, z, shown, part = room = np.empty((5, len(self.corners)))
        step, first, second = spread(count)
        for position in positions:
            np.subtract(position[:, None], self._middle, out=room[:3])
            np.multiply(u, x, out=shown)
            for along, towards in ((w, z), (v, y)):
                shown += np.multiply(along, towards, out=part)
            np.abs(shown, out=shown)
            x *= x
            for towards in (z, y):
                x += np.multiply(towards, towards, out=part)
            shown /= np.maximum(np.sqrt(x, out=x), 1e-9, out=x)
            reach = np.cumsum(shown, out=part)
            if not len(reach) or reach[-1] <= 0.0:
                found.append(np.zeros((0, 3)))
                continue
            a, b, c = np.moveaxis(self.corners[np.searchsorted(reach, step * reach[-1])], 1, 0)
            found.append(np.asarray(a + first[:, None] * (b - a) + second[:, None] * (c - a)))
        return found


_surfaces: WeakKeyDictionary[WorldState, dict[int, Surface]] = WeakKeyDictionary()


class SurfaceView(NamedTuple):
    """Faces as a station sees them."""

    across: Array
    """Their sides across the line of sight, shape (n, 3) [m]."""
    distance: Array
    """Of their middles, shape (n,) [m]."""
    share: Array
    """Of faces that are partly in view the part of their corners and middle that is, 0 out of reach; of an object that
    is wholly out of view 1, as seen over mirrors. Shape (n,)."""

    def first_tubes(self, size: PatchSize) -> float:
        """Return about how many tubes of a size start on the faces."""
        pieces = size.pieces_of(self.across / size.length(self.distance)[:, None])
        return float(pieces @ self.share)


def _db(ratio: float) -> float:
    return float(10.0 * np.log10(max(ratio, 1e-40)))


def _unit(vector: Array) -> Array:
    return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-9))


def smooth_share(state: WorldState, info: InstanceInfo) -> float:
    """Return the coherently reflected share of the power, 1 - S^2, of the parts' materials, weighted by their area."""
    world, parts = state.world, list(info.parts)
    if world not in _areas:
        _areas[world] = _areas_of(world)
    area = _areas[world][parts]
    rough = np.array([world.materials[world.parts.material[part]].scattering_coefficient for part in parts])
    total = float(area.sum())
    return float(area @ (1.0 - rough**2)) / total if total > 0.0 else 0.0


def _areas_of(world: World) -> Array:
    """Return the area of each part, of one that bends at rest, shape (num_parts,) [m2]."""
    triangles = world._triangles
    corners = triangles.corners
    twice = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.sqrt(np.einsum("ij,ij->i", twice, twice)) / 2.0
    return np.asarray(np.bincount(triangles.part, area, len(triangles.first) - 1))


_areas: WeakKeyDictionary[World, Array] = WeakKeyDictionary()


def _view(radar: RadarSpec, station: Viewpoint, box: Pose, size: Array, nearest: Array) -> tuple[bool, float]:
    """Return whether a box may be in view, and the antenna's largest power gain over it.

    The box is taken as its sphere; one wider than 20 deg as if it stood where the antenna is best.
    """
    pose, radius = station.pose, float(np.linalg.norm(size)) / 2.0
    far = float(np.linalg.norm(box.position - pose.position))
    may_hold = bool(station.may_hold(box.position[None], np.array([radius]))[0])
    if far <= radius or np.arcsin(radius / far) > WIDE_BOX:
        x, y, _ = (nearest - pose.position) @ pose.rotation
        behind = far > radius and np.abs(np.arctan2(y, x)) > station.azimuth_fov / 2.0 and not may_hold
        return not behind, float(largest_field_gain(radar.array, boresights(radar.array)).max()) ** 2
    signs = np.array([(i, j, k) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)] + [(0, 0, 0)]) / 2.0
    corners = (box.apply(signs * size) - pose.position) @ pose.rotation
    gain = float(largest_field_gain(radar.array, corners).max()) ** 2
    return may_hold, gain
