"""Radar paths from scattering centres: no ray is traced but one for each group of centres, to see what hides it.

What it is right for, where it breaks and what it costs stands in docs/scatterers.md.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning, UnknownNameError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.warn import WarningLevels
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.point_scatterers import MIN_DISTANCE, POINT_INTERACTION
from scarl_sionna.radar.scatterers.model import ScattererModel, loaded_models
from scarl_sionna.signal.link import spreading

from .antennas import check_antennas, refuse_receiver
from .multipath.images import spherical_basis
from .range_end import within_reach

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Columns = dict[str, npt.NDArray[Any]]


@dataclass(frozen=True, eq=False)
class PlacedModel:
    """A model that stands for an object of a scene.

    Attributes
    ----------
    name : str
    number : int
        Instance id.
    model : ScattererModel
    frame : Pose
        Frame of the model in that of the actor, or in the world for a static object.
    """

    name: str
    number: int
    model: ScattererModel
    frame: Pose

    def world_from_model(self, state: WorldState) -> Pose:
        """Return the pose of the model's frame."""
        info = state.world.instances[self.number]
        body = Pose() if info.actor is None else state.actor_pose(info.actor)
        return body.compose(self.frame)


def solve_scatterers(
    state: WorldState, radar: RadarSpec, mount: Mount, settings: RadarSettings, receiver: Mount | None = None
) -> RadarPaths:
    r"""Return the paths to the scattering centres of the objects that have a model.

    Parameters
    ----------
    state : WorldState
    radar : RadarSpec
    mount : Mount
        Pose and velocity of the radar.
    settings : RadarSettings
        Its `scatterers` and `max_distance` (centres beyond are left out; the unambiguous range if None). The body frame
        of an actor's model is the actor's frame; that of a static object is the world frame, in which its mesh stands,
        unless `placements` says otherwise: for a model such as ``ScattererModel.tr38901("car")``, whose origin is its
        centre. What has no model gives no path (it still hides what is behind it) and is named in
        ``diagnostics["left_out"]``.
    receiver : Mount, optional
        Refused: this solver is monostatic.

    Returns
    -------
    RadarPaths
        One path a centre, of depth 1, sorted by instance and length.

    Raises
    ------
    ParameterRangeError
        If no model is given or a number is out of range.
    UnknownNameError
        If a model's name is not in the scene.
    PlacementError
        If the radar or one of its antennas is inside a mesh.

    Warns
    -----
    ScarlWarning
        If an object is seen from outside of its model's aspects, is nearer than the model's ``nearest_distance``, or
        the model's frequency or cells do not fit the radar: the message names the object and the better method.

    Notes
    -----
    .. math:: a = \frac{\lambda}{4 \pi R^2} A_n(u_n), \quad L' = 2 d \cdot v, \quad
              L'' = 2 (|v|^2 - (d \cdot v)^2) / R + 2 d \cdot (\omega \times (\omega \times r))

    with each centre's own distance R, direction u and velocity v relative to the radar, so an object in the near field
    is right as long as each cell is in its own far field. *Not modelled*: multipath with the surroundings, part-hidden
    cells.
    """
    start = time.perf_counter()
    refuse_receiver("scatterers", receiver)
    knobs, pose = settings.scatterers, mount.pose
    models = loaded_models(knobs.models)
    if not models:
        raise ParameterRangeError(
            "models",
            knobs.models,
            "at least one name with a ScattererModel",
            "compile one with compile_scatterers(mesh), or take ScattererModel.tr38901('car')",
        )
    reach = radar.max_range if settings.max_distance is None else settings.max_distance
    numbers = _numbers(state, models)
    check_antennas(state, radar, pose)
    blocks = []
    for name, model in models.items():
        placed = PlacedModel(name, numbers[name], model, knobs.placements.get(name, Pose()))
        block = _columns(state, radar, mount, placed, settings.warn_at)
        blocks.append(_in_view(block, radar, pose, reach))
    columns = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    hidden = _hidden(state, pose, columns, knobs.group_size)
    columns = {name: column[~hidden] for name, column in columns.items()}
    order = np.lexsort((*columns["point"].T, columns["distance"], columns["instance"]))
    columns = {name: column[order] for name, column in columns.items()}
    left_out = [info.name for info in state.world.instances.values() if info.name not in models]
    diagnostics = {
        "method": "scatterers",
        "max_distance": reach,
        "group_size": knobs.group_size,
        "num_hidden": int(hidden.sum()),
        "models": {name: dict(model.error) for name, model in models.items()},
        "left_out": left_out,
        "seconds": time.perf_counter() - start,
    }
    return within_reach(_paths(columns, mount, diagnostics), reach)


def _numbers(state: WorldState, models: Mapping[str, ScattererModel]) -> dict[str, int]:
    """Return the instance id of each model's object."""
    known = {info.name: number for number, info in state.world.instances.items()}
    for name in models:
        if name not in known:
            raise UnknownNameError("object with a scatterer model", name, known)
    return {name: known[name] for name in models}


def _columns(state: WorldState, radar: RadarSpec, mount: Mount, placed: PlacedModel, levels: WarningLevels) -> Columns:
    """Return the columns of one object's centres."""
    model, pose = placed.model, mount.pose
    info = state.world.instances[placed.number]
    body, twist = Pose(), Twist()
    if info.actor is not None:
        body, twist = state.actor_pose(info.actor), state.actor_twist(info.actor)
    world_from_model = placed.world_from_model(state)
    point = world_from_model.apply(model.centers)
    offset = point - pose.position
    distance = np.maximum(np.linalg.norm(offset, axis=1), MIN_DISTANCE)
    direction = offset / distance[:, None]
    toward = -direction @ world_from_model.rotation
    matrix = model.matrices(toward, distance)
    echoing = matrix.any(axis=(1, 2))
    _warn(placed, radar, toward[echoing], levels)
    _warn_of_nearness(placed, matrix, distance)
    point, direction, distance = (column[echoing] for column in (point, direction, distance))
    matrix = matrix[echoing]
    body_basis = spherical_basis(world_from_model.rotation, -direction)
    radar_basis = spherical_basis(pose.rotation, direction)
    turn = radar_basis @ np.swapaxes(body_basis, 1, 2)
    scale = spreading(radar.wavelength, distance, distance)
    arm = point - body.position
    relative = twist.velocity_at(arm) - mount.twist.linear
    radial = np.einsum("ni,ni->n", direction, relative)
    centripetal = np.cross(twist.angular, np.cross(twist.angular, arm))
    across = np.maximum(np.einsum("ni,ni->n", relative, relative) - radial**2, 0.0)
    return {
        "point": point,
        "direction": direction,
        "distance": distance,
        "velocity": relative,
        "a": turn @ matrix @ np.swapaxes(turn, 1, 2) * scale[:, None, None],
        "length_rate": 2.0 * radial,
        "length_acceleration": 2.0 * (across / distance + np.einsum("ni,ni->n", direction, centripetal)),
        "instance": np.full(len(point), placed.number, dtype=np.int32),
        "semantic": np.full(len(point), info.semantic, dtype=np.uint8),
    }


def _warn_of_nearness(placed: PlacedModel, matrix: Complex, distance: Array) -> None:
    """Warn of a model that is nearer than its centres are right, which echo by `matrix`."""
    model, near = placed.model, float(distance.min(initial=np.inf))
    needed = model.nearest(matrix)
    if near >= needed:
        return
    reason, remedy = f"cells of {model.cell:g} m are in their far field", "compile with a smaller voxel, or use"
    if needed > model.nearest_distance:
        lost = 0.5 * (needed / near) ** 2
        reason = "the corners that it has there are: their mirrors span more than a cell, and as points they are "
        reason += f"{lost:.1f} dB too strong" if lost < 3.0 else "decibels too strong"
        remedy = "use"
    warnings.warn(
        f"scatterers of '{placed.name}': it is {near:.3g} m away, nearer than the {needed:.3g} m from which {reason}; "
        f"{remedy} method='sbr'",
        ScarlWarning,
        stacklevel=4,
    )


def _warn(placed: PlacedModel, radar: RadarSpec, toward: Array, levels: WarningLevels) -> None:
    """Warn of each way in which a model is used outside of what it is right for.

    `toward` holds the centres that echo.
    """
    model = placed.model
    outside = ~model.inside(toward)
    reasons = []
    if outside.any():
        reasons.append(
            f"{outside.sum()} of {len(outside)} centres are seen from outside of the model's aspects, whose nearest "
            "is used; compile more aspects, or use method='sbr'"
        )
    if abs(radar.center_frequency - model.frequency) > levels.detuning * model.frequency:
        reasons.append(
            f"the model is for {model.frequency / 1e9:.4g} GHz and the radar at {radar.center_frequency / 1e9:.4g} "
            "GHz; compile it for the radar's frequency"
        )
    if model.error and model.cell > 2.0 * radar.range_resolution:
        reasons.append(
            f"its cells of {model.cell:g} m are wider than two range cells of the radar ({radar.range_resolution:.3g} "
            "m each); compile with a smaller voxel, or use method='sbr'"
        )
    for reason in reasons:
        warnings.warn(f"scatterers of '{placed.name}': {reason}", ScarlWarning, stacklevel=4)


def _in_view(columns: Columns, radar: RadarSpec, pose: Pose, reach: float) -> Columns:
    """Leave out centres that are too far or out of the field of view."""
    x, y, z = (columns["direction"] @ pose.rotation).T
    seen = (np.abs(np.arctan2(y, x)) <= np.radians(radar.azimuth_fov_deg) / 2.0) & (columns["distance"] < reach)
    seen &= np.abs(np.arcsin(np.clip(z, -1.0, 1.0))) <= np.radians(radar.elevation_fov_deg) / 2.0
    return {name: column[seen] for name, column in columns.items()}


def _hidden(state: WorldState, pose: Pose, columns: Columns, group_size: float) -> npt.NDArray[np.bool_]:
    """Return the centres of groups whose strongest centre is behind another instance.

    Its own body hides nothing here.
    """
    count = len(columns["distance"])
    if not count:
        return np.zeros(0, dtype=bool)
    cube = np.column_stack([np.floor(columns["point"] / group_size).astype(np.int64), columns["instance"]])
    cube -= cube.min(axis=0)
    number = np.ravel_multi_index(tuple(cube.T), tuple(cube.max(axis=0) + 1))  # sorting rows takes ten times longer
    group = np.unique(number, return_inverse=True)[1].reshape(-1)
    power = np.sum(np.abs(columns["a"]) ** 2, axis=(1, 2))
    order = np.lexsort((-power, group))
    leader = order[np.flatnonzero(np.diff(group[order], prepend=-1))]
    distance = columns["distance"][leader]
    hits = state.cast(pose.position, columns["direction"][leader], max_distance=float(distance.max()))
    other = state.world.parts.instance[hits.part] != columns["instance"][leader][hits.ray]
    dark = np.zeros(len(leader), dtype=bool)
    dark[hits.ray[other & (hits.distance < distance[hits.ray])]] = True
    return np.asarray(dark[group])


def _paths(columns: Columns, mount: Mount, diagnostics: dict[str, Any]) -> RadarPaths:
    count = len(columns["distance"])
    return RadarPaths(
        tx_point=columns["point"],
        rx_point=columns["point"].copy(),
        inner_length=np.zeros(count),
        a=columns["a"],
        length_rate=columns["length_rate"],
        length_acceleration=columns["length_acceleration"],
        instance=columns["instance"][:, None],
        interaction=np.full((count, 1), POINT_INTERACTION, dtype=np.int32),
        depth=np.ones(count, dtype=np.int32),
        semantic=columns["semantic"],
        world_from_tx=mount.pose,
        world_from_rx=mount.pose,
        tx_velocity=columns["velocity"],
        rx_velocity=columns["velocity"].copy(),
        tx_twist=mount.twist,
        rx_twist=mount.twist,
        diagnostics=diagnostics,
    )
