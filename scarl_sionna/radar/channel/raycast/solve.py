"""SCaRL's own method: a fixed grid of rays, each hit one isotropic point target (section 2.3 of the paper).

What it models, how its power is calibrated and where it breaks stands in docs/raycast.md.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core import seeds
from scarl_sionna.core.arrays.rows import row_norm
from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.raycast import HitPhase
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine import variant
from scarl_sionna.engine.rays.face_rays import StateRays
from scarl_sionna.radar.channel.antennas import check_antennas, refuse_receiver
from scarl_sionna.radar.channel.compose.plan import ids_of
from scarl_sionna.radar.channel.range_end import within_reach
from scarl_sionna.radar.link import received_amplitude
from scarl_sionna.radar.optics.viewpoint import Viewpoint
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.scene.materials.depolarization import rough_matrix

from .grid import RayGrid
from .kernel import Hits, RaycastKernel, Task, no_columns
from .thinning import thin

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.int64]

RAYS_PER_BATCH = 1_000_000
"""Rays cast at once: bounds the memory of a batch to about 100 MB, changes no result."""
_PHASES_KEPT = 2
"""Numbers of rays whose phases are kept, 16 MB for 10^6 rays."""
DIFFUSE = 2
"""Kind of the interaction of a hit, the number of Sionna RT's ``InteractionType.DIFFUSE``."""


def solve_raycast(
    state: WorldState,
    radar: RadarSpec,
    mount: Mount,
    settings: RadarSettings,
    receiver: Mount | None = None,
    by_material: Sequence[int] = (),
) -> RadarPaths:
    r"""Return the paths to the first surfaces that a fixed grid of rays hits.

    Parameters
    ----------
    state : WorldState
    radar : RadarSpec
        Field of view, carrier and array.
    mount : Mount
        Pose and velocity of the radar.
    settings : RadarSettings
        Its `raycast`, `max_distance` (the unambiguous range if None, since the filter before the converter takes away
        what lies beyond) and `instances` (what gives paths; the rest hides what is behind it).
    receiver : Mount, optional
        Refused: this solver is monostatic.
    by_material : sequence of int
        Parts that go by the law of their material as the ground does, see :class:`~scarl_sionna.Share`.

    Returns
    -------
    RadarPaths
        In ray order; empty where nothing is hit. No ray is cast if nothing of `instances` can be in view and in reach.

    Raises
    ------
    PlacementError
        If the radar or one of its antennas is inside a mesh.
    MaterialRangeError
        If a material that is hit has no data in the middle of the band.
    UnknownNameError
        If `instances` names something that is not in the scene.
    ParameterRangeError
        If a receiver is given.

    Warns
    -----
    ScarlWarning
        If an object in view is smaller than the distance between rays there.

    Notes
    -----
    Radar equation with unit antenna gains; the synthesis applies the angle-dependent gains:

    .. math:: |a|^2 = \frac{\sigma \lambda^2}{(4\pi)^3 d^4}, \quad
              \sigma = \gamma_{class}\, d^2 \Delta\Omega\, R(\theta)

    with the power reflectance R of the part's radio material for the vertical and the horizontal polarisation; on the
    ground :math:`\sigma = \sigma^0 d^2 \Delta\Omega / \cos\theta` with the law of :func:`.rough.sigma0`, unless
    `rough_ground` is off. Cross-polar is what the class or the material has of it, with the matrix of
    :func:`.depolarization.rough_matrix`; of a class only where the antennas are not all V or all H. The
    paper prints lambda = f0 / c under its Eq. (4); the wavelength is c / f0.

    *Not modelled*: multiple reflections, coherence between neighbouring hits, shadow of the road bounce, acceleration
    (the length of every antenna pair is linear in time, as SCaRL has it).

    References
    ----------
    .. [1] A. Nittur Ramesh, A. Correas-Serrano, M. Gonzalez-Huici, "SCaRL - A Synthetic Multi-Modal Dataset for
           Autonomous Driving", section 2.3, Eq. (4).
    """
    refuse_receiver("raycast", receiver)
    knobs, pose, instances = settings.raycast, mount.pose, settings.instances
    reach = radar.max_range if settings.max_distance is None else settings.max_distance
    check_antennas(state, radar, pose)
    fov = np.radians(radar.azimuth_fov_deg), np.radians(radar.elevation_fov_deg)
    rays_of = RayGrid.over(*fov, knobs.num_rays, kind=knobs.grid)
    chosen_ids = list(state.world.instances) if instances is None else ids_of(state.world, instances)
    _warn_of_small_objects(state, radar, pose, rays_of, reach, chosen_ids)
    owned = np.isin(state.world.parts.instance, chosen_ids)
    chosen = {
        "rcs_model": knobs.rcs_model,
        "hit_phase": knobs.hit_phase,
        "grid": knobs.grid,
        "max_distance": reach,
        "num_hits": 0,
        "hits_per_cell": knobs.hits_per_cell if knobs.hit_phase == "rough" else None,
    }
    task = Task(rays_of, knobs, reach, owned, by_material)
    if not _may_hit(state, Viewpoint.of(radar, pose, np.zeros(3)), task):
        nothing = no_columns()
        nothing["a"] = _transfer(nothing, 0, np.zeros(0, dtype=np.int64), None)
        return _paths(nothing, state, mount, rays_of, dict.fromkeys(("cast", "thin", "amplitude"), 0.0), chosen)
    with variant.optical() as mi:
        start = time.perf_counter()
        kernel = RaycastKernel(StateRays(mi, state, pose.position), state, radar, mount, task)
        found = Hits.joined(
            [
                kernel.hits(first, min(first + RAYS_PER_BATCH, rays_of.num_rays))
                for first in range(0, rays_of.num_rays, RAYS_PER_BATCH)
            ]
        )
        cast = time.perf_counter()
        chosen["num_hits"] = len(found.ray)
        growth = None
        if knobs.hits_per_cell is not None and knobs.hit_phase == "rough":
            received = found.received if radar.array.is_uniform else _received(kernel, found, radar)
            tiny = np.finfo(np.float64).tiny ** 0.5
            kept, growth = thin(found.cell, np.maximum(received, tiny), knobs.hits_per_cell)
            found = found.of(kept)
        thinned = time.perf_counter()
        columns = kernel.columns(found)
    phases = _fixed_phases(knobs.hit_phase, rays_of.num_rays)
    columns["a"] = _transfer(columns, rays_of.num_rays, found.ray, growth)
    if phases is not None:
        columns["a"] *= np.take(phases, found.ray)[:, None, None]
    clock = {"cast": cast - start, "thin": thinned - cast, "amplitude": time.perf_counter() - thinned}
    return within_reach(_paths(columns, state, mount, rays_of, clock, chosen), reach)


def _may_hit(state: WorldState, station: Viewpoint, task: Task) -> bool:
    """Return whether a part that gives paths may be in the field of view and in reach, by its box."""
    lower, upper = (bound[task.owned] for bound in state._bounds)
    position = station.pose.position
    near = row_norm(np.clip(position, lower, upper) - position) < task.reach
    return bool((near & station.may_hold((lower + upper) / 2.0, row_norm(upper - lower) / 2.0)).any())


def _received(kernel: RaycastKernel, found: Hits, radar: RadarSpec) -> Array:
    """Return the power that an antenna pair receives by each hit, where antennas are described one by one."""
    columns = kernel.columns(found)
    transfer = _transfer(columns, kernel.num_rays, found.ray, None)
    return np.asarray(np.abs(received_amplitude(transfer, columns["ray"], columns["ray"], radar)) ** 2)


def _transfer(columns: dict[str, npt.NDArray[Any]], num_rays: int, ray: Index, growth: Array | None) -> Complex:
    """Return the polarimetric transfer (num_hits, 2, 2) of the hits of rays; `growth` is of power."""
    size = columns["amplitude"] if growth is None else columns["amplitude"] * np.sqrt(growth)[:, None]
    vertical, horizontal, crossed = size.T
    if not crossed.any():
        out = np.zeros((len(size), 2, 2), dtype=np.complex128)
        out[:, 0, 0], out[:, 1, 1] = vertical, horizontal
        return out
    return rough_matrix(vertical, horizontal, crossed, np.take(_fixed_draws(num_rays), ray))


@lru_cache(maxsize=_PHASES_KEPT)
def _fixed_draws(num_rays: int) -> Array:
    """Return of which numbers the rays' cross-polar phases are made: the same for every frame."""
    drawn = seeds.generator(0, "raycast_cross_polar").random(num_rays)
    drawn.flags.writeable = False
    return drawn


@lru_cache(maxsize=_PHASES_KEPT)
def _fixed_phases(hit_phase: HitPhase, num_rays: int) -> Complex | None:
    """Return what the rays' echoes are turned by: the same for every frame, so a scene at rest stays at rest."""
    if hit_phase == "geometric":
        return None
    turned = np.exp(2j * np.pi * seeds.generator(0, "raycast_surface_phase").random(num_rays))
    turned.flags.writeable = False
    return np.asarray(turned)


def _paths(
    columns: dict[str, npt.NDArray[Any]],
    state: WorldState,
    mount: Mount,
    grid: RayGrid,
    clock: dict[str, float],
    chosen: dict[str, Any],
) -> RadarPaths:
    count, parts = len(columns["length_rate"]), state.world.parts
    diagnostics = {
        "method": "raycast",
        **chosen,
        "num_rays": grid.num_rays,
        "ray_spacing_deg": float(np.degrees(grid.spacing)),
        "solid_angle": float(grid.solid_angle),
        "seconds": clock,
    }
    return RadarPaths(
        tx_point=columns["point"],
        rx_point=columns["point"],
        inner_length=np.zeros(count),
        a=columns["a"],
        length_rate=columns["length_rate"],
        length_acceleration=np.zeros(count),
        instance=parts.instance[columns["part"]].astype(np.int32)[:, None],
        interaction=np.full((count, 1), DIFFUSE, dtype=np.int32),
        depth=np.ones(count, dtype=np.int32),
        semantic=parts.semantic[columns["part"]].astype(np.uint8),
        world_from_tx=mount.pose,
        world_from_rx=mount.pose,
        tx_velocity=columns["velocity"],
        rx_velocity=columns["velocity"],
        linear_motion=np.ones(count, dtype=np.bool_),
        tx_twist=mount.twist,
        rx_twist=mount.twist,
        diagnostics=diagnostics,
    )


def _warn_of_small_objects(
    state: WorldState, radar: RadarSpec, pose: Pose, grid: RayGrid, reach: float, chosen: Sequence[int]
) -> None:
    """Warn of objects in view that may fall between the rays."""
    radar_from_world = pose.inverse()
    small = []
    for box in state.boxes():
        if box.instance not in chosen:
            continue
        x, y, z = radar_from_world.apply(box.world_from_box.position)
        distance = float(np.linalg.norm((x, y, z)))
        width = float(np.sort(box.size)[1])  # what a plate or a pole shows at least along one direction
        in_view = (
            abs(np.degrees(np.arctan2(y, x))) <= radar.azimuth_fov_deg / 2
            and abs(np.degrees(np.arcsin(z / max(distance, 1e-9)))) <= radar.elevation_fov_deg / 2
        )
        if in_view and distance < reach and 0.0 < width < distance * grid.spacing:
            small.append((box.name, width, distance))
    if small:
        name, width, distance = max(small, key=lambda item: item[2] / item[1])
        needed = grid.num_rays * (distance * grid.spacing / width) ** 2
        warnings.warn(
            f"{len(small)} object(s) in view are smaller than the distance between rays and may be missed, most of all "
            f"'{name}' ({width:.2f} m at {distance:.0f} m, rays {distance * grid.spacing:.2f} m apart); "
            f"num_rays >= {needed:.1e} or a narrower field of view would hit it",
            ScarlWarning,
            stacklevel=3,
        )
