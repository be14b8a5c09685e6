"""Ideal returns: what rays over a beam's footprint hit, also through panes, gathered into separable returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.scene.tables import PartTable, RayHits

from .beam import beam_radius, sub_directions, widest_gap
from .scan import pane_reflectance, pane_transmittance, radial_velocity, return_intensity

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

MIRRORED = -1
"""Part of an echo that came over a mirror."""
_STEP_BEHIND = 1e-3
"""A ray goes on this far behind a pane [m], so that it does not meet the same triangle again."""
_SMALLEST_SHARE = 1e-4
"""A ray that panes have left less of its power is not followed."""

Cast = Callable[[Array, Array, Index, float, bool], RayHits]
"""origins, directions, the shot of every ray, longest distance, whether the rays start at the sensor -> hits."""


@dataclass(frozen=True, eq=False)
class Shots:
    """Shots in world axes, each at its own time.

    Attributes
    ----------
    number : ndarray of int64, shape (num_shots,)
        Of each within the scan, rising.
    origins, velocity : ndarray of float64, shape (3,) or (num_shots, 3)
        Of the sensor [m], [m/s].
    directions : ndarray of float64, shape (num_shots, 3)
        Unit vectors of the beams' axes.
    """

    number: Index
    origins: Array
    directions: Array
    velocity: Array

    def select(self, rows: Index) -> Shots:
        """Return some of the shots, by index, shape (num_selected,)."""
        return Shots(self.number[rows], _rows(self.origins, rows), self.directions[rows], _rows(self.velocity, rows))

    def sub_rays(self, spec: LidarSpec) -> Shots:
        """Return the rays over each beam's footprint in place of its axis."""
        if spec.sub_rays == 1:
            return self
        shot = np.repeat(np.arange(len(self.number)), spec.sub_rays)
        directions = sub_directions(spec, self.directions).reshape(-1, 3)
        return Shots(self.number[shot], _rows(self.origins, shot), directions, _rows(self.velocity, shot))


@dataclass(frozen=True, eq=False)
class Echoes:
    """What comes back to the lidar, one row a ray and surface, or one row a return.

    Attributes
    ----------
    shot : ndarray of int64, shape (num_echoes,)
        Rising.
    distance : ndarray of float64, shape (num_echoes,)
        [m].
    radial_velocity : ndarray of float64, shape (num_echoes,)
        Positive = opening [m/s].
    intensity : ndarray of float64, shape (num_echoes,)
        Relative to a white diffuser at 1 m that holds the whole beam, without air.
    cos_incidence : ndarray of float64, shape (num_echoes,)
    normal : ndarray of float64, shape (num_echoes, 3)
        World axes.
    part : ndarray of int64, shape (num_echoes,)
        Row of the part table; of a return the one with the most power. `MIRRORED` for what a pane mirrors: nothing is
        where the echo seems to come from.
    """

    shot: Index
    distance: Array
    radial_velocity: Array
    intensity: Array
    cos_incidence: Array
    normal: Array
    part: Index

    @property
    def number(self) -> int:
        """Number of echoes."""
        return int(self.shot.shape[0])


T = TypeVar("T")


def take(table: T, rows: npt.NDArray[Any]) -> T:
    """Return some rows of a table of arrays, by index or mask, shape (num_rows,)."""
    return type(table)(*(getattr(table, item.name)[rows] for item in fields(table)))  # type: ignore[arg-type]


def join(tables: list[T]) -> T:
    """Return tables of arrays one after the other."""
    names = [item.name for item in fields(tables[0])]  # type: ignore[arg-type]
    return type(tables[0])(*(np.concatenate([getattr(table, name) for table in tables]) for name in names))


def trace(spec: LidarSpec, parts: PartTable, cast: Cast, shots: Shots) -> Echoes:
    """Return the echo of every ray and surface of some shots, by shot and then by ray and surface.

    Parameters
    ----------
    spec : LidarSpec
    parts : PartTable
    cast : callable
        Intersects rays with the world at the time of their shots.
    shots : Shots
    """
    beams = shots.sub_rays(spec)
    rays = _Rays(
        beams.number,
        beams.origins,
        beams.directions,
        np.zeros(len(beams.number)),
        np.full(len(beams.number), 1.0 / spec.sub_rays),
        np.zeros(len(beams.number), dtype=np.bool_),
        radial_velocity(np.zeros(3), beams.velocity, beams.directions),
    )
    found: list[Echoes] = []
    for surface in range(spec.max_surfaces):
        first = surface == 0
        hits = cast(rays.origin, rays.direction, rays.shot, spec.max_distance, first)
        met = rays if hits.num_hits == len(rays.shot) else rays.select(hits.ray)
        distance = met.start + hits.distance
        velocity = radial_velocity(hits.velocity, np.zeros(3), met.direction) + met.velocity
        intensity = return_intensity(
            parts.lidar_reflectance[hits.part],
            hits.cos_incidence,
            distance,
            spec.extinction,
            parts.retroreflection[hits.part],
            parts.retroreflected_luminance[hits.part],
        )
        if spec.sub_rays > 1 or not first:
            intensity *= met.share
        part = np.where(met.mirrored, MIRRORED, hits.part.astype(np.int64))
        echoes = Echoes(met.shot, distance, velocity, intensity, hits.cos_incidence, hits.normal, part)
        found.append(echoes if first else take(echoes, np.flatnonzero(distance <= spec.max_distance)))
        if surface + 1 == spec.max_surfaces:
            break
        rays = _onward(spec, parts, met, hits, distance)
        if rays.shot.size == 0:
            break
    if len(found) == 1:
        return found[0]
    echoes = join(found)
    return take(echoes, np.argsort(echoes.shot, kind="stable"))


@dataclass(frozen=True, eq=False)
class _Rays:
    """Rays on their way: where each goes on, how far it has come, and what is left of its power, both ways.

    `velocity` is the rate at which the way grows that is not of the surface it meets next [m/s].
    """

    shot: Index
    origin: Array
    direction: Array
    start: Array
    share: Array
    mirrored: npt.NDArray[np.bool_]
    velocity: Array

    def select(self, rows: Index) -> _Rays:
        columns = {item.name: getattr(self, item.name) for item in fields(self) if item.name != "origin"}
        return _Rays(origin=_rows(self.origin, rows), **{name: values[rows] for name, values in columns.items()})


def _onward(spec: LidarSpec, parts: PartTable, met: _Rays, hits: RayHits, distance: Array) -> _Rays:
    """Return the rays that go on behind panes, and those that panes mirror; mirrored ones are not mirrored again."""
    transmittance = parts.lidar_transmittance[hits.part]
    pane = np.flatnonzero((transmittance > 0.0) & (distance < spec.max_distance))
    met, distance, cosine, transmittance = (
        met.select(pane),
        distance[pane],
        hits.cos_incidence[pane],
        transmittance[pane],
    )
    point, moved = hits.point[pane], hits.velocity[pane]
    least = _SMALLEST_SHARE / spec.sub_rays
    passed = met.share * pane_transmittance(transmittance, cosine) ** 2
    through = np.flatnonzero(passed > least)
    behind = replace(
        met,
        origin=point + _STEP_BEHIND * met.direction,
        start=distance + _STEP_BEHIND,
        share=passed,
    ).select(through)
    if not spec.pane_reflections:
        return behind
    share = met.share * pane_reflectance(transmittance, cosine) ** 2
    back = np.flatnonzero((share > least) & ~met.mirrored)
    normal, along = hits.normal[pane], met.direction
    turned = along - 2.0 * np.einsum("ij,ij->i", along, normal)[:, None] * normal
    turn = np.einsum("ij,ij->i", moved, along - turned)  # a pane that moves makes the way longer by this
    mirrored = replace(
        met,
        origin=point + _STEP_BEHIND * turned,
        direction=turned,
        start=distance + _STEP_BEHIND,
        share=share,
        mirrored=np.ones(len(share), dtype=np.bool_),
        velocity=met.velocity + turn,
    ).select(back)
    return join([behind, mirrored])


def _rows(values: Array, rows: Index) -> Array:
    return values if values.ndim == 1 else values[rows]


def gather(spec: LidarSpec, echoes: Echoes) -> Echoes:
    """Return the returns that echoes make: by shot and distance, the strongest `spec.max_returns` of each shot.

    Echoes of a shot whose distances follow each other within the range resolution and the depth of surface between
    neighbouring rays, and their radial velocities within the velocity resolution, are one return: its intensity is
    their sum, distance and radial velocity are their means weighted with the intensity, all else is that of the
    strongest.
    """
    if spec.sub_rays > 1 or spec.max_surfaces > 1:
        echoes = _merged(spec, echoes)
    return strongest(echoes, spec.max_returns)


def nearest_of(number: int, shot: Index, distance: Array) -> Array:
    """Return the least distance in each of `number` shots [m], of rows of any order; infinite where there is none."""
    nearest = np.full(number, np.inf)
    np.minimum.at(nearest, shot, distance)
    return nearest


def strongest(echoes: Echoes, number: int) -> Echoes:
    """Return the `number` strongest echoes of each shot, by shot and distance."""
    new_shot = np.diff(echoes.shot, prepend=-1) != 0
    if new_shot.all():
        return echoes
    order = np.lexsort((-echoes.intensity, echoes.shot))
    kept = order[place_in_group(echoes.shot[order]) < number]
    return take(echoes, kept[np.lexsort((echoes.distance[kept], echoes.shot[kept]))])


def place_in_group(group: npt.NDArray[np.integer]) -> Index:
    """Return the place of each row among the equal, neighbouring entries of `group`: 0, 1, ..."""
    start = np.flatnonzero(np.diff(group, prepend=group[:1] - 1) != 0)
    return np.arange(len(group)) - np.repeat(start, np.diff(np.append(start, len(group))))


def _extent(spec: LidarSpec, echoes: Echoes) -> Array:
    """Return by how much the distance of a surface differs between neighbouring rays at most [m]; 0 for a thin ray."""
    if spec.sub_rays == 1:
        return np.zeros(echoes.number)
    patch = widest_gap(spec.sub_rays) * beam_radius(spec, echoes.distance)
    cosine = np.maximum(echoes.cos_incidence, 1e-3)
    return patch * np.sqrt(1.0 - cosine**2) / cosine


def _merged(spec: LidarSpec, echoes: Echoes) -> Echoes:
    if echoes.number == 0:
        return echoes
    velocity_gap = spec.velocity_resolution
    echoes = take(echoes, np.lexsort((echoes.distance, echoes.shot)))
    extent = _extent(spec, echoes)
    gap = spec.range_resolution + (extent[1:] + extent[:-1]) / 2.0
    apart = (np.diff(echoes.shot) != 0) | (np.diff(echoes.distance) > gap)
    group = np.concatenate([[0], np.cumsum(apart)])
    order = np.lexsort((echoes.radial_velocity, group))
    echoes, group = take(echoes, order), group[order]
    apart = (np.diff(group) != 0) | (np.diff(echoes.radial_velocity) > velocity_gap)
    start = np.concatenate([[0], np.flatnonzero(apart) + 1])
    if start.size == echoes.number:
        return echoes
    group = np.concatenate([[0], np.cumsum(apart)])
    power = np.maximum(echoes.intensity, 1e-300)  # black surfaces still have a place
    total = np.add.reduceat(power, start)
    strongest_row = np.lexsort((power, group))[np.append(start[1:], echoes.number) - 1]
    rows = take(echoes, strongest_row)
    return Echoes(
        rows.shot,
        np.add.reduceat(power * echoes.distance, start) / total,
        np.add.reduceat(power * echoes.radial_velocity, start) / total,
        np.add.reduceat(echoes.intensity, start),
        rows.cos_incidence,
        rows.normal,
        rows.part,
    )
