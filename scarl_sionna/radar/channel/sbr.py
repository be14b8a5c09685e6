"""Shooting and bouncing rays with physical optics on a scene, seen from the radar with spherical waves.

What it is right for, where it breaks and what it costs stands in docs/sbr.md.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning, UnknownNameError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.radar_spec import RadarSpec
from scarl_sionna.core.units import dbm_to_watt
from scarl_sionna.radar.antenna import field_gain
from scarl_sionna.radar.noise import sample_noise_power
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.world import variant
from scarl_sionna.world.face_rays import FaceRays
from scarl_sionna.world.face_tracing import face_table
from scarl_sionna.world.path_tracing import DIFFUSE, SPECULAR

from .antennas import check_antennas
from .sbr_fields import radiated
from .sbr_patches import PatchSize
from .sbr_settings import DEFAULT_SBR_CHANNEL, SbrChannelSettings
from .sbr_surfaces import Surfaces
from .sbr_trace import Station, Tracer
from .sbr_tubes import Tubes

if TYPE_CHECKING:
    from scarl_sionna.world import WorldState

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Columns = dict[str, npt.NDArray[Any]]

SMALLEST_SIZE = 3.0
"""Largest extent [wavelengths] of an instance below which physical optics is off by decibels."""
GRAZING_COSINE = 0.1
"""Cosine of incidence below which a patch counts as grazing."""


def solve_sbr(
    state: WorldState,
    radar: RadarSpec,
    pose: Pose,
    *,
    radar_twist: Twist | None = None,
    instances: Sequence[str | int] | None = None,
    max_distance: float | None = None,
    settings: SbrChannelSettings = DEFAULT_SBR_CHANNEL,
    rx_pose: Pose | None = None,
) -> RadarPaths:
    r"""Return the paths of a monostatic radar by physical optics on the scene's meshes.

    Parameters
    ----------
    state : WorldState
    radar : RadarSpec
        Field of view, band, array and link budget.
    pose : Pose
        world_from_radar.
    radar_twist : Twist, optional
        Velocity of the radar, world axes; at rest if not given.
    instances : sequence of str or int, optional
        Names or ids of what scatters; by default every actor and every object. The rest (ground, verges, a wood) hides what is
        behind it and is named in ``diagnostics["left_out"]``.
    max_distance : float, optional
        Paths longer than twice this are left out [m]; the unambiguous range if not given.
    settings : SbrChannelSettings
        Bounces, size of the patches, rays, and what is too weak to be kept.
    rx_pose : Pose, optional
        Not available: a bistatic pair is refused.

    Returns
    -------
    RadarPaths
        One row a patch, sorted. `tx_point` is the patch as the radar sees it through the mirrors before it, `rx_point` the patch
        itself. The last interaction of a row is the scattering patch, those before are mirror reflections.

    Raises
    ------
    PlacementError
        If the radar or one of its antennas is inside a mesh.
    MaterialRangeError
        If a material that scatters has no data at the middle of the band.
    UnknownNameError
        If `instances` names something that is not in the scene.
    ParameterRangeError
        If the scene needs more patches than `settings.max_patches`, or a bistatic pair is asked for.

    Warns
    -----
    ScarlWarning
        If an instance in view is smaller than 3 wavelengths, or most of the power comes from grazing patches.

    Notes
    -----
    The direct and the reversed sense of a chain of bounces are both there, since tubes start on every face that is lit: no
    row is doubled by reciprocity.

    *Not modelled*: edge diffraction, creeping waves, what passes through a dielectric, the scattered part of rough surfaces
    (their coherent part is sqrt(1 - S^2)), acceleration of the length. *Convergence and validity*: docs/sbr.md.

    References
    ----------
    .. [1] H. Ling, R.-C. Chou, S.-W. Lee, "Shooting and Bouncing Rays", IEEE Trans. Antennas Propag. 37(2), 1989.
    """
    if rx_pose is not None:
        raise ParameterRangeError(
            "rx_pose", "a pose", "None", "'sbr' is monostatic; use method='sionna' for two radars"
        )
    reach = radar.max_range if max_distance is None else max_distance
    if not reach > 0.0:
        raise ParameterRangeError("max_distance", f"{reach} m", "> 0 m")
    check_antennas(state, radar, pose)
    clock = {"start": time.perf_counter()}
    faces = face_table(state)
    chosen_instances, left_out = _chosen(state, instances)
    chosen = np.isin(state.world.parts.instance, chosen_instances)[faces.part]
    velocity = (radar_twist or Twist()).linear
    station = Station.of(radar, pose, velocity)
    start = np.flatnonzero(chosen & station.may_see(faces, reach))
    size = PatchSize.of(radar, settings)
    used = np.flatnonzero(np.bincount(faces.part[chosen], minlength=len(state.world.parts.name)))
    blocks = []
    with variant.optical() as mi:
        rays = FaceRays(mi, state)
        surfaces = Surfaces(rays, state, faces, used, radar.center_frequency)
        tracer = Tracer(rays, faces, chosen, station, station, reach, size, settings)
        for tubes in tracer.bounces(start):
            if len(tubes):
                blocks.append(_rows(state, tracer, tubes, surfaces))
    columns = _sorted(_joined(blocks, settings.max_depth))
    diagnostics: dict[str, Any] = {
        "method": "sbr", "settings": settings.model_dump(), "max_distance": reach, "num_faces": len(start),
        "num_patches": len(columns["length"]), "left_out": left_out,
    }  # fmt: skip
    _warn(state, radar, pose, columns, chosen_instances, reach)
    columns, diagnostics["floor"] = _above_floor(columns, radar, pose, settings.floor_db)
    diagnostics["seconds"] = time.perf_counter() - clock["start"]
    return _paths(columns, pose, diagnostics)


def _chosen(state: WorldState, instances: Sequence[str | int] | None) -> tuple[list[int], list[str]]:
    """Return the ids of what scatters and the names of the rest."""
    table = state.world.instances
    if instances is None:
        chosen = [number for number, info in table.items() if info.is_object or info.actor is not None]
    else:
        by_name: dict[str, list[int]] = {}
        for number, info in table.items():
            by_name.setdefault(info.name, []).append(number)
        chosen = []
        for item in instances:
            if item not in by_name and item not in table:
                raise UnknownNameError("instance", str(item), sorted(by_name))
            chosen += [int(item)] if item in table else by_name[str(item)]
    kept = set(chosen)
    return sorted(kept), [info.name for number, info in table.items() if number not in kept]


def _rows(state: WorldState, tracer: Tracer, patches: Tubes, surfaces: Surfaces) -> Columns:
    """Return the columns of patches, those that leave out of view or come from too far left out."""
    tx, rx = tracer.tx, tracer.rx
    columns: Columns = radiated(
        tracer.rays, patches, surfaces, (tx.pose, tx.velocity), (rx.pose, rx.velocity), tracer.size.wavenumber,
        tracer.settings.integration_phase,
    )  # fmt: skip
    part = tracer.faces.part[patches.face]
    columns["instance"] = state.world.parts.instance[part]
    columns["semantic"] = state.world.parts.semantic[part[:, -1]]
    seen = columns["length"] < 2.0 * tracer.reach
    if patches.depth > 1:
        seen &= tx.sees(columns["tx_point"])
    return {name: column[seen] for name, column in columns.items()}


def _joined(blocks: list[Columns], max_depth: int) -> Columns:
    """Return the columns of all bounces, instances padded with -1."""
    columns: Columns = {
        "tx_point": np.zeros((0, 3)), "rx_point": np.zeros((0, 3)), "a": np.zeros((0, 2, 2), np.complex128),
        "length_rate": np.zeros(0), "length": np.zeros(0), "cosine": np.zeros(0), "semantic": np.zeros(0, np.uint8),
        "instance": np.zeros((0, max_depth), np.int32), "depth": np.zeros(0, np.int32),
    }  # fmt: skip
    for block in blocks:
        depth = block["instance"].shape[1]
        block["depth"] = np.full(len(block["length"]), depth, np.int32)
        block["instance"] = np.pad(block["instance"], [(0, 0), (0, max_depth - depth)], constant_values=-1)
    return {name: np.concatenate([column, *(block[name] for block in blocks)]) for name, column in columns.items()}


def _sorted(columns: Columns) -> Columns:
    """Return the rows by depth, instances, length and place."""
    keys = [columns["depth"], *columns["instance"].T, columns["length"], *columns["rx_point"].T, *columns["tx_point"].T]
    order = np.lexsort(keys[::-1])
    return {name: column[order] for name, column in columns.items()}


def _received(columns: Columns, radar: RadarSpec, pose: Pose) -> Array:
    """Return the amplitude that one antenna pair receives [sqrt(W)]."""
    entry = "VH".index(radar.polarization)
    gain = field_gain(radar.pattern, (columns["tx_point"] - pose.position) @ pose.rotation)
    gain = gain * field_gain(radar.pattern, (columns["rx_point"] - pose.position) @ pose.rotation)
    return np.abs(columns["a"][:, entry, entry]) * gain * np.sqrt(dbm_to_watt(radar.tx_power_dbm))


def _above_floor(
    columns: Columns, radar: RadarSpec, pose: Pose, floor_db: float | None
) -> tuple[Columns, dict[str, float | None]]:
    """Return the rows without the weakest of each range bin, and what was left out."""
    told: dict[str, float | None] = {
        "floor_db": floor_db,
        "num_dropped": 0,
        "dropped_power": 0.0,
        "in_phase_to_noise_db": None,
    }
    if floor_db is None or not len(columns["length"]):
        return columns, told
    cells = radar.num_samples * radar.num_chirps * radar.num_virtual
    noise = sample_noise_power(radar) / cells
    amplitude = _received(columns, radar, pose)
    bins = np.floor(columns["length"] / (2.0 * radar.range_resolution)).astype(np.int64)
    order = np.lexsort((amplitude, bins))
    total = np.cumsum(amplitude[order])
    first = np.flatnonzero(np.diff(bins[order], prepend=-1))
    before = np.repeat(total[first] - amplitude[order][first], np.diff(first, append=len(order)))
    dropped = np.zeros(len(order), dtype=bool)
    dropped[order] = (total - before) ** 2 <= noise * 10.0 ** (floor_db / 10.0)
    if dropped.any():
        told["num_dropped"] = int(dropped.sum())
        told["dropped_power"] = float(np.sum(amplitude[dropped] ** 2))
        worst = float(np.bincount(bins[dropped], amplitude[dropped]).max() ** 2 / noise)
        told["in_phase_to_noise_db"] = 10.0 * float(np.log10(worst)) if worst > 0.0 else None
    return {name: column[~dropped] for name, column in columns.items()}, told


def _warn(state: WorldState, radar: RadarSpec, pose: Pose, columns: Columns, chosen: list[int], reach: float) -> None:
    """Warn once of each way in which the scene is outside of what physical optics can do."""
    small = []
    for number in chosen:
        info = state.world.instances[number]
        if float(info.size.max()) < SMALLEST_SIZE * radar.wavelength and np.any(columns["instance"] == number):
            small.append((info.name, float(info.size.max())))
    if small:
        warnings.warn(
            f"{len(small)} instance(s) in view are smaller than {SMALLEST_SIZE:g} wavelengths, such as '{small[0][0]}' "
            f"({1e3 * small[0][1]:.3g} mm); physical optics is wrong by decibels there: use method='scatterers' or point targets",
            ScarlWarning, stacklevel=4,
        )  # fmt: skip
    power = _received(columns, radar, pose) ** 2
    grazing = float(power[columns["cosine"] < GRAZING_COSINE].sum())
    if grazing > 0.5 * float(power.sum()):
        warnings.warn(
            f"{100.0 * grazing / float(power.sum()):.0f} % of the patches' power comes from surfaces seen within 6 deg of "
            "grazing, where diffraction, which 'sbr' does not have, is as strong; method='sionna' has mirror multipath there",
            ScarlWarning, stacklevel=4,
        )  # fmt: skip


def _paths(columns: Columns, pose: Pose, diagnostics: dict[str, Any]) -> RadarPaths:
    count, width = columns["instance"].shape
    step = np.arange(width)
    depth = columns["depth"]
    interaction = np.where(step < depth[:, None] - 1, SPECULAR, np.where(step == depth[:, None] - 1, DIFFUSE, -1))
    return RadarPaths(
        tx_point=columns["tx_point"],
        rx_point=columns["rx_point"],
        inner_length=np.zeros(count),
        a=columns["a"],
        length_rate=columns["length_rate"],
        length_acceleration=np.zeros(count),
        instance=columns["instance"].astype(np.int32),
        interaction=interaction.astype(np.int32),
        depth=depth.astype(np.int32),
        semantic=columns["semantic"].astype(np.uint8),
        world_from_tx=pose,
        world_from_rx=pose,
        diagnostics=diagnostics,
    )
