"""Spectrograms of what moves on its own.

Of a whole target and of single parts of it, with estimates of their velocities.

Model, sources, measured errors and limits: docs/micro_doppler.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.describe import Described
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.signal.processing import doppler_axis, range_doppler, virtual_cube
from scarl_sionna.signal.windows import window_values

from .channel import solve_paths
from .paths import RadarPaths
from .synthesis import synthesize

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World, WorldState

Array = npt.NDArray[np.float64]

WHOLE = "whole"
"""Name of the spectrogram of all paths."""
SAME_POINT = 1e-4
"""Distance within which a path's point and the hit of a ray towards it are one [m], for each metre of distance from the
radar."""


@dataclass(frozen=True, eq=False, repr=False)
class Spectrogram(Described):
    """Doppler spectra over time.

    Attributes
    ----------
    time : ndarray of float64, shape (num_times,)
        Start of each spectrum's chirps [s].
    radial_velocity : ndarray of float64, shape (num_bins,)
        Rising, positive when opening [m/s].
    power : ndarray of float64, shape (num_times, num_bins)
        Summed over range, averaged over channels and looks [W]; zeros where nothing was hit.
    """

    time: Array
    radial_velocity: Array
    power: Array

    def mean_velocity(self) -> Array:
        """Return the power-weighted mean of the radial velocity at each time, shape (num_times,) [m/s].

        NaN without power.
        """
        total = self.power.sum(axis=1)
        first = self.power @ self.radial_velocity
        return np.divide(first, total, out=np.full(len(total), np.nan), where=total > 0.0)

    def edges(self, below_db: float = 35.0) -> Array:
        """Return the lowest and highest radial velocity at which a spectrum is within some decibels of its peak.

        Parameters
        ----------
        below_db : float
            How far below the peak of each spectrum [dB], > 0. The window widens the edges by up to
            :func:`window_half_width`.

        Returns
        -------
        ndarray of float64, shape (num_times, 2)
            [m/s]; between bins, interpolated on the decibel scale. nan without power.

        Raises
        ------
        ParameterRangeError
            If `below_db` is not positive.
        """
        if not below_db > 0.0:
            raise ParameterRangeError("below_db", f"{below_db} dB", "> 0 dB")
        found = np.full((len(self.time), 2), np.nan)
        for row, power in enumerate(self.power):
            if power.max() <= 0.0:
                continue
            level = 10.0 * np.log10(np.maximum(power / power.max(), 1e-30)) + below_db
            inside = np.flatnonzero(level >= 0.0)
            for column, (edge, step) in enumerate(((inside[0], -1), (inside[-1], 1))):
                found[row, column] = self._crossing(level, int(edge), step)
        return found

    def _crossing(self, level: Array, edge: int, step: int) -> float:
        beyond = edge + step
        if not 0 <= beyond < len(level):
            return float(self.radial_velocity[edge])
        share = level[edge] / (level[edge] - level[beyond])
        return float(self.radial_velocity[edge] + share * (self.radial_velocity[beyond] - self.radial_velocity[edge]))


def window_half_width(radar: RadarSpec, below_db: float, window: str = "hann") -> float:
    """Return half the width of a single Doppler line at some decibels below its peak [m/s].

    By how much a window widens edges.

    By definition of the line: found on the transform of the window itself.

    Raises
    ------
    ParameterRangeError
        If the line's side lobes are higher than that.
    """
    values = window_values(window, radar.num_slow_chirps)
    fine = 256
    line = np.abs(np.fft.rfft(values, fine * len(values)))
    level = 20.0 * np.log10(np.maximum(line / line[0], 1e-15)) + below_db
    inside = np.flatnonzero(level >= 0.0)
    if len(inside) != inside[-1] + 1:
        highest = below_db - level[np.flatnonzero(level < 0.0)[0] :].max()
        raise ParameterRangeError(
            "below_db", f"{below_db} dB", f"< {highest:.1f} dB, the side lobes of a {window} window"
        )
    return float(inside[-1] / fine * radar.velocity_resolution)


def part_of_paths(paths: RadarPaths, state: WorldState) -> npt.NDArray[np.int32]:
    """Return on which part of the scene the scattering point of each direct path lies.

    Parameters
    ----------
    paths : RadarPaths
        As solved in this state, by a solver whose paths end at surface points (``raycast``, ``sbr``).
    state : WorldState

    Returns
    -------
    ndarray of int32, shape (num_paths,)
        Row of ``world.parts``; -1 for what came by several bounces or is no point of a surface in view.
    """
    origin = paths.world_from_rx.position
    way = paths.rx_point - origin
    distance = np.linalg.norm(way, axis=1)
    part = np.full(paths.num_paths, -1, dtype=np.int32)
    hits = state.cast(origin, way / np.maximum(distance, 1e-12)[:, None])
    same = np.abs(hits.distance - distance[hits.ray]) <= SAME_POINT * np.maximum(distance[hits.ray], 1.0)
    direct = paths.depth[hits.ray] == 1
    part[hits.ray[same & direct]] = hits.part[same & direct]
    return part


def spectrograms(
    world: World,
    radar: RadarSpec,
    mount: Mount | Pose | Callable[[float], Mount | Pose],
    times: npt.ArrayLike,
    groups: Mapping[str, Sequence[int]] | None = None,
    *,
    looks: Sequence[float] = (0.0,),
    num_doppler_bins: int | None = None,
    window: str = "hann",
    method: str = "raycast",
    **fields: object,
) -> dict[str, Spectrogram]:
    """Return the spectrogram of a target and of groups of its parts, each column solved anew.

    Parameters
    ----------
    world : World
    radar : RadarSpec
        One frame of it makes one spectrum: its `frame_time` is the window. Of several channels the powers are averaged.
    mount : Mount, Pose or callable
        Of the radar, or that as a function of time [s].
    times : array_like of float, shape (num_times,)
        Start of each column [s].
    groups : mapping of str to sequence of int, optional
        Parts (rows of ``world.parts``) whose paths make a spectrogram of their own, as if the others were only in their
        way.
    looks : sequence of float
        Times that are added to each of `times` [s], for example whole cycles of a gait: the powers are averaged, which
        takes the speckle out.
    num_doppler_bins : int, optional
        More than the chirps interpolates.
    window : str
        Over the chirps and over range.
    method, **fields
        Of :func:`scarl_sionna.solve_paths`.

    Returns
    -------
    dict of str to Spectrogram
        ``"whole"`` and one for each group.

    References
    ----------
    .. [1] V. C. Chen, F. Li, S.-S. Ho, H. Wechsler, "Micro-Doppler effect in radar: phenomenon, model, and
       simulation study", IEEE Trans. Aerosp. Electron. Syst. 42(1), 2006.
    """
    columns = np.asarray(times, dtype=np.float64)
    groups = groups or {}
    axis = doppler_axis(radar, num_doppler_bins)
    power = {name: np.zeros((len(columns), len(axis))) for name in (WHOLE, *groups)}
    for look in looks:
        for row, time in enumerate(columns + look):
            state = world.at(float(time))
            place = mount(float(time)) if callable(mount) else mount
            paths = solve_paths(state, radar, place, method=method, **cast("dict[str, Any]", fields))
            power[WHOLE][row] += _spectrum(paths, radar, num_doppler_bins, window)
            part = part_of_paths(paths, state) if groups else np.zeros(0, dtype=np.int32)
            for name, parts in groups.items():
                own = paths.select(np.isin(part, parts))
                if own.num_paths:
                    power[name][row] += _spectrum(own, radar, num_doppler_bins, window)
    return {name: Spectrogram(columns, axis, total / len(looks)) for name, total in power.items()}


def _spectrum(paths: RadarPaths, radar: RadarSpec, num_doppler_bins: int | None, window: str) -> Array:
    cube = virtual_cube(synthesize(paths, radar), radar)
    return range_doppler(cube, radar, window, num_doppler_bins=num_doppler_bins).power.astype(np.float64).sum(axis=1)


@dataclass(frozen=True, eq=False, repr=False)
class SurfaceMotion(Described):
    """How the triangles of some parts move, as the kinematic model has it.

    Attributes
    ----------
    part : ndarray of int32, shape (num_triangles,)
        Row of ``world.parts``.
    radial_velocity : ndarray of float64, shape (num_triangles,)
        d(distance)/dt of the middle of each triangle [m/s].
    area : ndarray of float64, shape (num_triangles,)
        [m2]
    in_view : ndarray of float64, shape (num_triangles,)
        Area across the line of sight where the middle is in view, 0 where something hides it [m2].
    """

    part: npt.NDArray[np.int32]
    radial_velocity: Array
    area: Array
    in_view: Array

    def mean_velocity(self, parts: Sequence[int]) -> float:
        """Return the mean over what is in view of some parts [m/s]; nan if nothing is."""
        weight = np.where(np.isin(self.part, parts), self.in_view, 0.0)
        return float(self.radial_velocity @ weight / weight.sum()) if weight.any() else float("nan")

    def extremes(self, parts: Sequence[int]) -> tuple[float, float]:
        """Return the lowest and the highest velocity of some parts, in view or not [m/s]."""
        chosen = self.radial_velocity[np.isin(self.part, parts)]
        return float(chosen.min()), float(chosen.max())


def surface_motion(
    world: World, time: float, pose: Pose, parts: Sequence[int] | None = None, step: float = 1e-5
) -> SurfaceMotion:
    """Return how fast the surface of parts recedes from a place, from the poses alone, and how much is in view.

    Parameters
    ----------
    world : World
    time : float
        [s]
    pose : Pose
        Of the radar, at rest.
    parts : sequence of int, optional
        Rows of ``world.parts``; all if not given.
    step : float
        Of the central difference [s].

    Returns
    -------
    SurfaceMotion

    Notes
    -----
    No velocity of the world is used: an answer of the kinematic model that is independent of what the solvers take.
    """
    before, now, after = (world.at(time + sign * step) for sign in (-1.0, 0.0, 1.0))
    numbers, velocities, areas, across, points = [], [], [], [], []
    for part in range(len(world.parts.name)) if parts is None else parts:
        middles = [state.part_corners(part).mean(axis=1) for state in (before, now, after)]
        corners = now.part_corners(part)
        doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        ways = [
            np.linalg.norm(state.part_pose(part).apply(middle) - pose.position, axis=1)
            for state, middle in ((before, middles[0]), (after, middles[2]))
        ]
        point = now.part_pose(part).apply(middles[1])
        sight = point - pose.position
        sight /= np.linalg.norm(sight, axis=1)[:, None]
        numbers.append(np.full(len(point), part, dtype=np.int32))
        velocities.append((ways[1] - ways[0]) / (2.0 * step))
        areas.append(0.5 * np.linalg.norm(doubled, axis=1))
        across.append(0.5 * np.abs(np.einsum("ij,ij->i", now.part_pose(part).rotate(doubled), sight)))
        points.append(point)
    point = np.concatenate(points)
    way = point - pose.position
    distance = np.linalg.norm(way, axis=1)
    hits = now.cast(pose.position, way / distance[:, None])
    seen = np.zeros(len(point), dtype=bool)
    seen[hits.ray] = np.abs(hits.distance - distance[hits.ray]) <= SAME_POINT * distance[hits.ray]
    in_view = np.where(seen, np.concatenate(across), 0.0)
    return SurfaceMotion(np.concatenate(numbers), np.concatenate(velocities), np.concatenate(areas), in_view)
