"""SCaRL's own method: a fixed grid of rays, each hit one isotropic point target (section 2.3 of the paper).

What it models, how its power is calibrated and where it breaks stands in docs/raycast.md.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core import seeds
from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.raycast import HitPhase, RaycastSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.channel.antennas import check_antennas, refuse_receiver
from scarl_sionna.radar.channel.compose.plan import ids_of
from scarl_sionna.radar.link import received_amplitude
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.tuned import material_frequency
from scarl_sionna.scene.materials.fresnel import power_reflectance, te_fraction_of_h
from scarl_sionna.signal.link import radar_gain

from .class_rcs import class_reflectivity, rough_ground
from .grid import RayGrid
from .thinning import ResolutionCells, thin

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState
    from scarl_sionna.scene.tables import RayHits

Array = npt.NDArray[np.float64]

RAYS_PER_BATCH = 1_000_000
"""Rays cast at once: bounds the memory of a batch to about 300 MB, changes no result."""
NEAREST_HIT = 1e-3
"""The radar equation is not used closer than this [m]; a housing touches nothing nearer. A guard against division by
zero."""
DIFFUSE = 2
"""Kind of the interaction of a hit, the number of Sionna RT's ``InteractionType.DIFFUSE``."""
REFERENCE_FOOTPRINT = 4.34e-4
"""Area of a ray of the default grid (10^6 rays over 120 x 30 deg) at 20 m [m2]: the unit of ``rcs_model="per_hit"``,
not its accuracy."""


@dataclass(frozen=True)
class _Model:
    """What turns hits into path amplitudes."""

    radar: RadarSpec
    pose: Pose
    gamma: Array
    knobs: RaycastSettings
    solid_angle: float
    reach: float
    velocity: Array
    owned: npt.NDArray[np.bool_]
    rough: Array


def solve_raycast(
    state: WorldState, radar: RadarSpec, mount: Mount, settings: RadarSettings, receiver: Mount | None = None
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

    Returns
    -------
    RadarPaths
        In ray order; empty where nothing is hit.

    Raises
    ------
    PlacementError
        If the radar or one of its antennas is inside a mesh.
    MaterialRangeError
        If a material that is hit has no data at the carrier frequency.
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
    `rough_ground` is off. The
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
    rays_of = RayGrid.over(*fov, knobs.num_rays, staggered=knobs.grid == "staggered")
    chosen_ids = list(state.world.instances) if instances is None else ids_of(state.world, instances)
    _warn_of_small_objects(state, radar, pose, rays_of, reach, chosen_ids)
    owned = np.isin(state.world.parts.instance, chosen_ids)
    gamma = class_reflectivity(knobs.class_rcs)
    rough = rough_ground(state.world, material_frequency(radar, radar.carrier_frequency), knobs)
    model = _Model(radar, pose, gamma, knobs, rays_of.solid_angle, reach, mount.twist.linear, owned, rough)
    phases = _fixed_phases(knobs.hit_phase)
    clock = {"cast": 0.0, "amplitude": 0.0, "thin": 0.0}
    batches = []
    for first in range(0, rays_of.num_rays, RAYS_PER_BATCH):
        stop = min(first + RAYS_PER_BATCH, rays_of.num_rays)
        start = time.perf_counter()
        rays = rays_of.directions(first, stop)
        world_rays = pose.rotate(rays)
        hits = state.cast(pose.position, world_rays, max_distance=reach)
        cast = time.perf_counter()
        batches.append(_columns(hits, rays, world_rays, state, model, phases(stop - first)))
        clock["cast"] += cast - start
        clock["amplitude"] += time.perf_counter() - cast
    columns = {name: np.concatenate([batch[name] for batch in batches]) for name in batches[0]}
    chosen = {
        "rcs_model": knobs.rcs_model,
        "hit_phase": knobs.hit_phase,
        "grid": knobs.grid,
        "max_distance": reach,
        "hits_per_cell": None,
    }
    chosen["num_hits"] = len(columns["length_rate"])
    if knobs.hits_per_cell is not None and knobs.hit_phase == "rough":
        start = time.perf_counter()
        columns = _thinned(columns, model, knobs.hits_per_cell)
        chosen["hits_per_cell"] = knobs.hits_per_cell
        clock["thin"] = time.perf_counter() - start
    return _paths(columns, mount, rays_of, clock, chosen)


def _fixed_phases(hit_phase: HitPhase) -> Callable[[int], Array | None]:
    """Return what gives the next rays' phases [cycles]: the same for every frame, so a scene at rest stays at rest."""
    if hit_phase == "geometric":
        return lambda count: None
    return seeds.generator(0, "raycast_surface_phase").random


def _columns(
    hits: RayHits, rays: Array, world_rays: Array, state: WorldState, model: _Model, cycles: Array | None
) -> dict[str, npt.NDArray[Any]]:
    """Return the columns of :class:`RadarPaths` for the hits of rays, given in the radar's and the world's frame."""
    parts = state.world.parts
    distance = np.maximum(hits.distance, NEAREST_HIT)
    footprint = REFERENCE_FOOTPRINT if model.knobs.rcs_model == "per_hit" else model.solid_angle * distance**2
    reflectance_v, reflectance_h = _reflectances(hits, rays[:, 2], state, model)
    rough = model.rough[hits.part] * hits.cos_incidence[:, None]  # sigma0 over the area across the ray
    by_law = ~np.isnan(rough[:, 0])
    reflectance_v[by_law] = reflectance_h[by_law] = rough[by_law, 0]
    crossed = np.where(by_law, rough[:, 1], 0.0)
    rcs = np.where(by_law, 1.0, model.gamma[parts.semantic][hits.part]) * footprint
    power = radar_gain(model.radar.wavelength, distance) * rcs
    keep = np.flatnonzero(
        (power > 0.0) & (reflectance_v + reflectance_h > 0.0) & (distance < model.reach) & model.owned[hits.part]
    )
    power, ray, part = power[keep], hits.ray[keep], hits.part[keep]
    a = np.zeros((len(keep), 2, 2), dtype=np.complex128)
    factor = 1.0 if cycles is None else np.exp(2j * np.pi * cycles[ray])
    a[:, 0, 0] = np.sqrt(power * reflectance_v[keep]) * factor
    a[:, 1, 1] = np.sqrt(power * reflectance_h[keep]) * factor
    a[:, 0, 1] = a[:, 1, 0] = np.sqrt(power * crossed[keep]) * factor
    relative = hits.velocity[keep] - model.velocity
    return {
        "point": hits.point[keep],
        "a": a,
        "velocity": relative,
        "length_rate": 2.0 * np.einsum("ij,ij->i", relative, world_rays[ray]),
        "instance": parts.instance[part].astype(np.int32),
        "semantic": parts.semantic[part].astype(np.uint8),
        "distance": distance[keep],
        "ray": rays[ray],
    }


def _thinned(columns: dict[str, npt.NDArray[Any]], model: _Model, hits_per_cell: int) -> dict[str, npt.NDArray[Any]]:
    """Return the columns of fewer hits with the same mean power in each of the radar's resolution cells."""
    x, y, z = columns["ray"].T
    cells = ResolutionCells.of(model.radar, model.knobs)
    cell = cells.number(columns["distance"], columns["length_rate"] / 2.0, y, z, columns["instance"])
    entry = 0 if model.radar.array.polarization == "V" else 1
    if model.radar.array.is_uniform:
        gain_db = model.radar.array.pattern.gain_db(np.arctan2(y, x), np.arcsin(np.clip(z, -1.0, 1.0)))
        received = np.abs(columns["a"][:, entry, entry]) ** 2 * 10.0 ** (gain_db / 5.0)
    else:
        received = np.abs(received_amplitude(columns["a"], columns["ray"], columns["ray"], model.radar)) ** 2
    tiny = np.finfo(np.float64).tiny ** 0.5
    kept, growth = thin(cell, np.maximum(received, tiny), hits_per_cell)
    columns = {name: column[kept] for name, column in columns.items()}
    columns["a"] *= np.sqrt(growth)[:, None, None]
    return columns


def _reflectances(hits: RayHits, sine_elevation: Array, state: WorldState, model: _Model) -> tuple[Array, Array]:
    """Return the power reflectance of each hit for the radar's vertical and horizontal polarisation."""
    names = state.world.parts.material
    known = sorted(set(names))
    material_of_hit = np.array([known.index(name) for name in names], dtype=np.int64)[hits.part]
    te, tm = np.zeros(len(material_of_hit)), np.zeros(len(material_of_hit))
    frequency = material_frequency(model.radar, model.radar.carrier_frequency)
    for index in np.flatnonzero(np.bincount(material_of_hit)):
        rows = np.flatnonzero(material_of_hit == index)
        material = state.world.materials[known[index]]
        te[rows], tm[rows] = power_reflectance(material, frequency, hits.cos_incidence[rows])
    normal_up = hits.normal @ model.pose.rotation[:, 2]
    fraction = te_fraction_of_h(sine_elevation[hits.ray], hits.cos_incidence, normal_up)
    return te + fraction * (tm - te), tm + fraction * (te - tm)


def _paths(
    columns: dict[str, npt.NDArray[Any]], mount: Mount, grid: RayGrid, clock: dict[str, float], chosen: dict[str, Any]
) -> RadarPaths:
    count = len(columns["length_rate"])
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
        instance=columns["instance"][:, None],
        interaction=np.full((count, 1), DIFFUSE, dtype=np.int32),
        depth=np.ones(count, dtype=np.int32),
        semantic=columns["semantic"],
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
