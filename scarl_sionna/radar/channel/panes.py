"""Warns where a radar looks through a pane that the solver lets nothing pass."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.warn import WarningLevels
from scarl_sionna.core.specs.radar.spec import RadarSpec

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]


def warn_of_panes(state: WorldState, radar: RadarSpec, pose: Pose, method: str, levels: WarningLevels) -> float:
    """Warn where a layer right before the radar hides what lies behind, for solvers without refraction.

    Parameters
    ----------
    state : WorldState
    radar : RadarSpec
    pose : Pose
    method : str
        Named in the warning.
    levels : WarningLevels

    Returns
    -------
    float
        Part of the field of view that layers within `pane_distance` cover.
    """
    lower, upper = state._bounds
    gap = np.linalg.norm(np.maximum(np.maximum(lower - pose.position, pose.position - upper), 0.0), axis=1)
    table = state.world.parts
    near = [
        part
        for part in np.flatnonzero(gap < levels.pane_distance)
        if state.world.materials[table.material[part]].thickness is not None
    ]
    if not near:
        return 0.0
    azimuth, elevation = (
        np.radians(0.5 * width) * np.linspace(-0.9, 0.9, levels.pane_directions)
        for width in (radar.azimuth_fov_deg, radar.elevation_fov_deg)
    )
    az, el = (grid.ravel() for grid in np.meshgrid(azimuth, elevation))
    directions = pose.rotate(np.stack([np.cos(az) * np.cos(el), np.sin(az) * np.cos(el), np.sin(el)], axis=1))
    triangles = state._triangles
    covered = np.zeros((len(near), len(directions)), dtype=np.bool_)
    for row, part in enumerate(near):
        corners = triangles.corners[triangles.first[part] : triangles.first[part + 1]]
        first, second, third = corners.transpose(1, 0, 2)
        lowest, highest = (pick(pick(first, second), third) for pick in (np.minimum, np.maximum))
        away = np.maximum(np.maximum(lowest - pose.position, pose.position - highest), 0.0)
        corners = corners[np.linalg.norm(away, axis=1) < levels.pane_distance]
        covered[row] = _meets(pose.position, directions, corners, levels.pane_distance)
    share = float(covered.any(axis=0).mean())
    if share >= levels.pane_share:
        part = near[int(covered.sum(axis=1).argmax())]
        name = state.world.instances[int(table.instance[part])].name
        warnings.warn(
            f"a pane of '{table.material[part]}' ('{name}') within {levels.pane_distance:g} m covers "
            f"{100 * share:.0f} % of the radar's field of view; method='{method}' lets nothing pass a surface, so "
            "what lies behind is lost. Use method='sionna' with refraction=True, or take the pane out of the scene",
            ScarlWarning,
            stacklevel=3,
        )
    return share


def _meets(origin: Array, directions: Array, corners: Array, reach: float) -> npt.NDArray[np.bool_]:
    """Return which rays meet one of the triangles within `reach` [m].

    By the method of Moeller and Trumbore, J. Graphics Tools 2(1), 1997.
    """
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(directions[:, None], second[None])
    volume = np.einsum("dti,ti->dt", across, first)
    away = origin - corners[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("dti,ti->dt", across, away) / volume
        turned = np.cross(away, first)
        v = directions @ turned.T / volume
        distance = np.einsum("ti,ti->t", turned, second)[None] / volume
        inside = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (distance > 0.0) & (distance < reach)
    return np.asarray(inside.any(axis=1))
