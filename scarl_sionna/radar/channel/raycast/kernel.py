"""Rays to hits, and hits to the columns of paths, in one Dr.Jit kernel each: float64 but for the engine's intersection.

Everything that differs from frame to frame or from radar to radar is an input of the kernels, so that they are compiled
once. No kernel knows the number of its rays.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.mount import Mount
from scarl_sionna.core.settings.raycast import RaycastSettings
from scarl_sionna.core.specs.radar.pattern import AntennaPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.rays.face_rays import StateRays
from scarl_sionna.engine.rays.moving_faces import MovingFaces
from scarl_sionna.engine.threads import many_threads
from scarl_sionna.engine.types import DeviceArray
from scarl_sionna.radar.optics.cosine_tables import CosineTable, table_cosines
from scarl_sionna.radar.tuned import material_frequency
from scarl_sionna.scene.materials.fresnel import film_of, te_fraction_of_h
from scarl_sionna.scene.materials.layers import layers
from scarl_sionna.scene.materials.rough import layer_albedo, scattered_part
from scarl_sionna.scene.materials.table import RadioMaterial
from scarl_sionna.signal.link import radar_gain

from .class_rcs import class_crossed, class_reflectivity, rough_ground
from .grid import RayGrid
from .thinning import ResolutionCells, cell_number

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

NEAREST_HIT = 1e-3
"""The radar equation is not used closer than this [m]; a housing touches nothing nearer. A guard against division by
zero."""
REFERENCE_FOOTPRINT = 4.34e-4
"""Area of a ray of the default grid (10^6 rays over 120 x 30 deg) at 20 m [m2]: the unit of ``rcs_model="per_hit"``,
not its accuracy."""
NO_PATH = -1.0
"""Received power of a ray that gives no path."""
_NODES = 1024
"""Of the table of what is scattered over the cosine of incidence."""
_GRIDS_KEPT = 4
"""Tables of antenna gains over a grid that are kept, 8 MB each for 10^6 rays: radars of one kind share one."""


class Hits(NamedTuple):
    """Rays that hit what gives a path, in ray order."""

    ray: Index
    """(num_hits,)"""
    face: npt.NDArray[np.int32]
    """Triangle that each hits, shape (num_hits,)."""
    distance: npt.NDArray[np.float32]
    """The engine's [m], shape (num_hits,)."""
    cell: Index
    """Resolution cell, :meth:`.thinning.ResolutionCells.number`, shape (num_hits,)."""
    received: Array
    """Power of the path by the radar's own polarisation and pattern in any unit, shape (num_hits,)."""

    def of(self, rows: Index) -> Hits:
        """Return some of the hits."""
        return Hits._make(np.take(column, rows) for column in self)

    @classmethod
    def joined(cls, batches: Sequence[Hits]) -> Hits:
        """Return the hits of several batches."""
        if len(batches) == 1:
            return batches[0]
        return cls._make(np.concatenate(column) for column in zip(*batches, strict=True))


class _Reflected(NamedTuple):
    """Powers of hits: vertical and horizontal co-polar, cross-polar, and whether they give a path."""

    vertical: DeviceArray
    horizontal: DeviceArray
    crossed: DeviceArray
    gives: DeviceArray


class _Hit(NamedTuple):
    """Where hits are: radar frame of the ray, the world's for the rest."""

    local: DeviceArray
    ray: DeviceArray
    distance: DeviceArray
    cosine: DeviceArray
    normal: DeviceArray
    part: DeviceArray
    point: DeviceArray
    velocity: DeviceArray


class Task(NamedTuple):
    """Which rays are cast, and what of their hits gives paths."""

    grid: RayGrid
    knobs: RaycastSettings
    reach: float
    """[m]"""
    owned: npt.NDArray[np.bool_]
    """Which parts give paths, shape (num_parts,)."""
    by_material: Sequence[int] = ()
    """Parts that go by the law of their material, whatever their class."""


class RaycastKernel:
    """The rays of one radar in one state of the world. Make it inside ``variant.use("optical")``.

    Parameters
    ----------
    rays : StateRays
    state : WorldState
    radar : RadarSpec
    mount : Mount
    task : Task
    """

    def __init__(
        self,
        rays: StateRays,
        state: WorldState,
        radar: RadarSpec,
        mount: Mount,
        task: Task,
    ) -> None:
        grid, knobs, reach, owned, by_material = task
        self._on, self._grid = rays, grid
        self._faces = MovingFaces.of(rays, state)
        self._arithmetic = _Complex(rays)
        cosines, sines, places = grid.columns()
        self._columns = rays.reals(np.stack([cosines, sines, places], axis=1))
        turns = grid.row_turns()
        self._turns = None if turns is None else rays.reals(np.stack([np.cos(turns), np.sin(turns)], axis=1))
        self._rotation = [rays.vector(column) for column in mount.pose.rotation.T]
        self._origin, self._own_velocity = rays.vector(mount.pose.position), rays.vector(mount.twist.linear)
        self._reach, self._gain = rays.real(reach), rays.real(float(radar_gain(radar.wavelength, 1.0)))
        per_hit = knobs.rcs_model == "per_hit"
        self._footprint = rays.real(REFERENCE_FOOTPRINT if per_hit else 0.0)
        self._solid_angle = rays.real(0.0 if per_hit else grid.solid_angle)
        cells = ResolutionCells.of(radar, knobs)
        self._sizes = [rays.real(size) for size in cells.sizes]
        counts = *cells.cosine_counts, int(state.world.parts.instance.max(initial=0)) + 1
        self._counts = [rays.dr.opaque(rays.dr.int64_array_t(rays.mi.Int32), count) for count in counts]
        array = radar.array
        self._vertical = rays.real(float(array.polarization == "V"))
        self._pattern = rays.reals(_grid_gain(array.pattern, grid) if array.is_uniform else np.zeros(grid.num_rays))
        frequency = material_frequency(radar)
        self._materials = [state.world.materials[name] for name in state.world.parts.material]
        self._frequency = frequency
        different = dict.fromkeys(state.world.parts.material)
        covered = {name: state.world.materials[name].covers(frequency) for name in different}
        self._covered = np.array([covered[name] for name in state.world.parts.material], dtype=np.bool_)
        stacks = {name: _stack(state.world.materials[name], frequency) for name in different if covered[name]}
        rough = rough_ground(state.world, frequency, knobs, by_material)
        gamma = class_reflectivity(knobs.class_rcs)[state.world.parts.semantic]
        by_law = ~np.isnan(rough[:, 0])
        by_class = np.zeros((len(by_law), rough.shape[1]))
        if not array.is_of_one_polarization:  # which does not hear what is cross-polar
            by_class[:, 1] = class_crossed(knobs.class_rcs)[state.world.parts.semantic]
        table = np.column_stack(
            [
                [stacks.get(name, np.ones(8)) for name in state.world.parts.material],
                np.where(by_law, 1.0, gamma) * owned,
                np.where(by_law[:, None], rough, by_class),
                by_law,
            ]
        )
        self._width, self._table = table.shape[1], rays.reals(table)
        lawful, cosine = {state.world.parts.material[part] for part in np.flatnonzero(by_law)}, table_cosines(_NODES)
        part = [
            scattered_part(state.world.materials[name], frequency, cosine) if name in lawful else np.ones(_NODES)
            for name in different
        ]
        self._scattered = CosineTable(rays, np.array(part)[:, :, None])
        row = {name: number for number, name in enumerate(different)}
        self._material = rays.index(np.array([row[name] for name in state.world.parts.material], dtype=np.uint32))
        self._instance = rays.label(state.world.parts.instance)

    @property
    def num_rays(self) -> int:
        """How many rays the grid has."""
        return self._grid.num_rays

    def hits(self, first: int, stop: int) -> Hits:
        """Return what rays `first` to `stop` hit.

        Raises
        ------
        MaterialRangeError
            If a material that is hit has no data in the middle of the band.
        """
        on, dr, mi = self._on, self._on.dr, self._on.mi
        whole = dr.int64_array_t(mi.Int32)
        number = dr.arange(mi.UInt32, stop - first) + dr.opaque(mi.UInt32, first)
        local, ray = self._directions(number)
        face, rough = on.first_within(self._origin, ray, self._reach, coherent=True)
        valid = face >= 0
        hit = self._hit(local, ray, dr.select(valid, mi.UInt32(face), 0), rough)
        reflected = self._reflected(hit)
        power = self._vertical * reflected.vertical + (1.0 - self._vertical) * reflected.horizontal
        power *= dr.gather(on.Real, self._pattern, number)
        received = dr.select(valid & reflected.gives, power, NO_PATH)
        radial = dr.dot(hit.velocity, ray)
        instance = whole(dr.gather(mi.Int32, self._instance, hit.part))
        place = hit.distance, radial, local.y, local.z
        cell = cell_number(lambda value: whole(dr.floor(value)), self._sizes, self._counts, place, instance)
        with many_threads(stop - first):
            dr.eval(face, rough, cell, received)
            faces, power = face.numpy(), received.numpy()
        if not self._covered.all():
            self._require(faces)
        rows = np.flatnonzero(power >= 0.0)
        of_hits = (np.take(column, rows) for column in (faces, rough.numpy(), cell.numpy(), power))
        return Hits(rows + first, *of_hits)

    def columns(self, hits: Hits) -> dict[str, npt.NDArray[Any]]:
        """Return columns of the paths of hits.

        Returns
        -------
        dict of str to ndarray
            "point" (num_hits, 3) [m, world], "velocity" (num_hits, 3), relative to the radar, "length_rate" [m/s],
            "amplitude" (num_hits, 3): the square roots of the powers, vertical and horizontal co-polar and cross-polar,
            "ray" (num_hits, 3), in the radar frame, and "part".
        """
        if not len(hits.ray):
            return no_columns()
        on, dr = self._on, self._on.dr
        local, ray = self._directions(on.index(hits.ray))
        hit = self._hit(local, ray, on.index(hits.face), on.single(hits.distance))
        reflected = self._reflected(hit)
        amplitude = on.Vector(*(dr.sqrt(power) for power in reflected[:3]))
        rate = 2.0 * dr.dot(hit.velocity, ray)
        with many_threads(len(hits.ray)):
            dr.eval(hit.point, hit.velocity, rate, amplitude, local, hit.part)
        return {
            "point": on.on_host(hit.point),
            "velocity": on.on_host(hit.velocity),
            "length_rate": on.on_host(rate),
            "amplitude": on.on_host(amplitude),
            "ray": on.on_host(local),
            "part": on.on_host(hit.part).astype(np.int64),
        }

    def _directions(self, number: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
        """Return unit directions of rays in the radar's frame and in the world's; see :class:`.grid.RayGrid`."""
        on, dr, mi, grid = self._on, self._on.dr, self._on.mi, self._grid
        wide = on.real(grid.num_azimuth)
        row = dr.floor((on.Real(number) + 0.5) / wide)  # never near a whole number, so exact
        column = number - mi.UInt32(row) * dr.opaque(mi.UInt32, grid.num_azimuth)
        cosine_azimuth, sine_azimuth, place = dr.gather(on.Vector, self._columns, column)
        sine = on.real(grid.height) * ((row + place) / on.real(grid.num_elevation) - 0.5)
        cosine = dr.sqrt(1.0 - sine * sine)
        x, y = cosine * cosine_azimuth, cosine * sine_azimuth
        if self._turns is not None:
            own = dr.gather(on.Real, self._turns, 2 * mi.UInt32(row))
            other = dr.gather(on.Real, self._turns, 2 * mi.UInt32(row) + 1)
            x, y = x * own - y * other, x * other + y * own
        across, left, up = self._rotation
        return on.Vector(x, y, sine), dr.fma(up, sine, dr.fma(left, y, across * x))

    def _hit(self, local: DeviceArray, ray: DeviceArray, face: DeviceArray, rough: DeviceArray) -> _Hit:
        dr = self._on.dr
        distance, cosine, normal = self._faces.meet(self._origin, ray, face, rough)
        point, part = self._origin + distance * ray, self._faces.part(face)
        normal = dr.select(cosine > 0.0, -normal, normal)
        velocity = self._faces.velocity(face, part, point) - self._own_velocity
        nearest = dr.maximum(distance, NEAREST_HIT)
        return _Hit(local, ray, nearest, dr.minimum(dr.abs(cosine), 1.0), normal, part, point, velocity)

    def _reflected(self, hit: _Hit) -> _Reflected:
        """Return the powers of hits by the radar equation for unit antenna gains."""
        on, dr, mi = self._on, self._on.dr, self._on.mi
        row = hit.part * dr.opaque(mi.UInt32, self._width)
        column = [dr.gather(on.Real, self._table, row + k) for k in range(self._width)]
        film_re, film_im, film_depth, re, im, depth, behind_re, behind_im = column[:8]
        gamma, rough, crossed, layer, by_law = column[8:]
        pair = self._arithmetic.pair
        media = pair(film_re, film_im), pair(re, im), pair(behind_re, behind_im)
        (te, tm), _ = layers(self._arithmetic, media, (film_depth, depth), hit.cosine)
        te, tm = dr.squared_norm(te), dr.squared_norm(tm)
        normal_up = dr.dot(hit.normal, self._rotation[2])
        fraction = te_fraction_of_h(hit.local.z, hit.cosine, normal_up, self._arithmetic)
        law, deep = by_law > 0.0, layer_albedo(layer, hit.cosine, dr.maximum(hit.cosine, 1e-9))
        (part,) = self._scattered.at(dr.gather(mi.UInt32, self._material, hit.part), hit.cosine)
        scattered = part * hit.cosine * dr.select(layer > 0.0, deep, 1.0)
        vertical = dr.select(law, rough * scattered, te + fraction * (tm - te))
        horizontal = dr.select(law, rough * scattered, tm + fraction * (te - tm))
        squared = hit.distance * hit.distance
        whole = dr.select(law, scattered, 0.5 * (te + tm))
        power = self._gain / (squared * squared) * gamma * (self._footprint + self._solid_angle * squared)
        gives = (power > 0.0) & (vertical + horizontal > 0.0) & (hit.distance < self._reach)
        return _Reflected(power * vertical, power * horizontal, power * crossed * whole, gives)

    def _require(self, face: npt.NDArray[np.int32]) -> None:
        """Raise if a material that is hit has no data."""
        hit = np.unique(self._faces.part_on_host[face[face >= 0]])
        for part in hit[~self._covered[hit]]:
            self._materials[part].at(self._frequency)


def no_columns() -> dict[str, npt.NDArray[Any]]:
    """Return :meth:`RaycastKernel.columns` of no hits."""
    vectors = {name: np.zeros((0, 3)) for name in ("point", "velocity", "amplitude", "ray")}
    return {**vectors, "length_rate": np.zeros(0), "part": np.zeros(0, dtype=np.int64)}


class _Complex:
    """Dr.Jit's float64 and its pairs; see :class:`.layers.Arithmetic`."""

    def __init__(self, on: StateRays) -> None:
        self._dr, self.pair = on.dr, on.dr.float64_array_t(on.mi.Complex2f)
        self.minimum, self.where = on.dr.minimum, on.dr.select

    def root(self, value: DeviceArray) -> DeviceArray:
        return self._dr.sqrt(value)

    def delayed(self, phase: DeviceArray) -> DeviceArray:
        sine, cosine = self._dr.sincos(phase.real)
        size = self._dr.exp(phase.imag)
        return self.pair(size * cosine, -size * sine)

    def interface(self, first: DeviceArray, second: DeviceArray) -> DeviceArray:
        total = first + second
        vanish = self._dr.squared_norm(total) == 0.0
        return self._dr.select(
            vanish, self.pair(0.0), (first - second) / self._dr.select(vanish, self.pair(1.0), total)
        )


def _stack(material: RadioMaterial, frequency: float) -> Array:
    """Return the film, the layer and what is behind: permittivities, and depths times the wavenumber in vacuum.

    What is not there has no depth; a half space goes on behind itself.
    """
    wave = 2.0 * np.pi * frequency / SPEED_OF_LIGHT
    film, film_depth = film_of(material, frequency) or (1.0 + 0j, 0.0)
    permittivity = material.at(frequency)
    depth, behind = (0.0, permittivity) if material.thickness is None else (material.thickness, 1.0 + 0j)
    pairs = [film.real, film.imag, wave * film_depth, permittivity.real, permittivity.imag, wave * depth]
    return np.array([*pairs, behind.real, behind.imag])


@lru_cache(maxsize=_GRIDS_KEPT)
def _grid_gain(pattern: AntennaPattern, grid: RayGrid) -> Array:
    """Return the two-way gain of a pattern along every ray of a grid."""
    x, y, z = grid.directions(0, grid.num_rays).T
    gain_db = pattern.gain_db(np.arctan2(y, x), np.arcsin(np.clip(z, -1.0, 1.0)))
    return np.asarray(10.0 ** (gain_db / 5.0))
