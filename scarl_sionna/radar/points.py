"""Ideal isotropic point targets as radar paths, for tests and for users who bring their own scatterers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.arguments import HOW_TO_RADAR, expect
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.reads import refuse_unread
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.signal.link import spreading

from .channel.multipath.solve import Sought, solve_sionna
from .paths import RadarPaths
from .point_scatterers import POINT_INTERACTION, PointScatterers

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState


def point_targets(
    positions: npt.ArrayLike,
    velocities: npt.ArrayLike,
    rcs: npt.ArrayLike,
    radar: RadarSpec,
    mount: Mount | Pose,
    state: WorldState | None = None,
    receiver: Mount | Pose | None = None,
    **fields: object,
) -> RadarPaths:
    r"""Return the paths of ideal isotropic point targets.

    Parameters
    ----------
    positions : array_like of float, shape (num_targets, 3)
        At the start of the frame [m, world].
    velocities : array_like of float, shape (num_targets, 3)
        Constant over the frame [m/s, world].
    rcs : array_like of float, shape (num_targets,)
        Radar cross-section [m2], >= 0, the same for V and H; nothing is cross-polarised. A scalar holds for all.
    radar : RadarSpec
    mount : Mount or Pose
        Of the radar at the start of the frame; a bare pose (`world_from_radar`) stands still.
    state : WorldState, optional
        Surroundings: the paths to the targets are then traced in them, with occlusion and mirror reflections (two-ray
        ground, ghosts); free space if left out.
    receiver : Mount or Pose, optional
        Of a separate receiver (bistatic); `mount` then is that of the transmitter.
    **fields
        With a `state` only: `settings` (a :class:`~scarl_sionna.RadarSettings`) or its fields, as in
        :func:`scarl_sionna.solve_paths`, for the solver ``"sionna"``; and `environment`, whether paths that touch no
        target are there, too (False).

    Returns
    -------
    RadarPaths
        In free space one path a target, in the order given, of depth 1; `instance` is the target's index + 1. In a
        scene see :func:`solve_sionna`; the targets' ids follow the scene's own.

    Raises
    ------
    ParameterRangeError
        If a shape is wrong, a value is not finite or an RCS is negative.
    PlacementError
        If a target stands at the radar's origin.

    Notes
    -----
    .. math:: |a| = \lambda \sqrt{\sigma} / ((4 \pi)^{3/2} R_1 R_2), \quad
              L' = \sum v_r, \quad L'' = \sum (|v|^2 - v_r^2) / R

    with v the velocity relative to each end, and both ends in one for a single radar. The received power is the radar
    equation's.

    References
    ----------
    .. [1] M. I. Skolnik, *Introduction to Radar Systems*, 3rd ed., 2001, Eq. (1.6).
    """
    expect("radar", radar, RadarSpec, HOW_TO_RADAR)
    targets = PointScatterers(positions, velocities, rcs)  # type: ignore[arg-type]
    if state is not None:
        return solve_points(state, radar, mount, targets, receiver=receiver, **cast("dict[str, Any]", fields))
    if fields:
        raise ParameterRangeError("options", ", ".join(sorted(fields)), "none in free space", "give a state")
    place = Mount.of(mount)
    other = place if receiver is None else Mount.of(receiver)
    there, back = _leg(targets, place), _leg(targets, other)
    gain = spreading(radar.wavelength, there.distance, back.distance) ** 2 / (4.0 * np.pi)
    amplitude = np.sqrt(gain * targets.rcs)
    points, count = targets.positions, len(targets.positions)
    return RadarPaths(
        tx_point=points,
        rx_point=points.copy(),
        inner_length=np.zeros(count),
        a=amplitude[:, None, None] * np.eye(2, dtype=np.complex128),
        length_rate=there.rate + back.rate,
        length_acceleration=there.acceleration + back.acceleration,
        instance=np.arange(1, count + 1, dtype=np.int32)[:, None],
        interaction=np.full((count, 1), POINT_INTERACTION, dtype=np.int32),
        depth=np.ones(count, dtype=np.int32),
        semantic=np.zeros(count, dtype=np.uint8),
        world_from_tx=place.pose,
        world_from_rx=other.pose,
        tx_velocity=there.relative,
        rx_velocity=back.relative.copy(),
        tx_twist=place.twist,
        rx_twist=other.twist,
    )


class _Leg(NamedTuple):
    """Distances [m] of targets from a radar, their rates [m/s] and accelerations [m/s2], and relative velocities."""

    distance: npt.NDArray[np.float64]
    rate: npt.NDArray[np.float64]
    acceleration: npt.NDArray[np.float64]
    relative: npt.NDArray[np.float64]


def _leg(targets: PointScatterers, place: Mount) -> _Leg:
    targets.require_apart(place.pose.position)
    offset = targets.positions - place.pose.position
    distance = np.linalg.norm(offset, axis=1)
    relative = targets.velocities - place.twist.linear
    radial = np.einsum("ij,ij->i", offset, relative) / distance
    across = np.maximum(np.einsum("ij,ij->i", relative, relative) - radial**2, 0.0)
    return _Leg(distance, radial, across / distance, relative)


def solve_points(
    state: WorldState,
    radar: RadarSpec,
    mount: Mount | Pose,
    points: PointScatterers,
    *,
    settings: RadarSettings | None = None,
    receiver: Mount | Pose | None = None,
    environment: bool = False,
    **fields: object,
) -> RadarPaths:
    """Return the paths of point targets in surroundings, with occlusion and multipath by the solver ``"sionna"``.

    Parameters
    ----------
    state : WorldState
    radar : RadarSpec
    mount : Mount or Pose
    points : PointScatterers
        Their ids follow the scene's own.
    settings : RadarSettings, optional
    receiver : Mount or Pose, optional
        Of a bistatic pair.
    environment : bool
        Whether paths that touch no target are there, too.
    **fields
        Fields of the settings, as in :func:`scarl_sionna.solve_paths`.
    """
    refuse_unread("sionna", fields)
    chosen = (settings or RadarSettings()).changed("sionna", **fields)
    second = None if receiver is None else state.as_mount(receiver)
    return solve_sionna(state, radar, state.as_mount(mount), chosen, second, Sought(points, environment))
