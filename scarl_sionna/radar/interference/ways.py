"""One-way paths from one radar to another: line of sight, and reflections by the scene's surfaces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scarl_sionna.core.errors import PlacementError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.channel.multipath.images import spherical_basis
from scarl_sionna.radar.channel.multipath.solve import Sought, solve_sionna
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.weather.attenuation import attenuate, weather_attenuation
from scarl_sionna.signal.link import spreading

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

FARTHEST = 1e6
"""Half of the longest path [m] where the settings give none: another radar's maximum range says nothing here."""

ONE_PLACE = 1e-6
"""Radars nearer than this [m] stand at one place: what is left is rounding."""


def one_way_paths(
    sender: RadarSpec,
    sender_mount: Mount | Pose,
    receiver_mount: Mount | Pose,
    state: WorldState | None = None,
    settings: RadarSettings | None = None,
) -> RadarPaths:
    r"""Return the paths from one radar to another.

    Parameters
    ----------
    sender : RadarSpec
        The radar that sends: its frequency and where its antennas are.
    sender_mount, receiver_mount : Mount or Pose
        Of the two radars; a bare pose stands still.
    state : WorldState, optional
        Surroundings: what blocks the line of sight, and mirror reflections, by the solver ``"sionna"``; the air of its
        weather. Free space if left out.
    settings : RadarSettings, optional
        Its `sionna`, and `max_distance`, half of the longest path (paths nearly as long fade).

    Returns
    -------
    RadarPaths
        `a` is the one-way transfer of isotropic antennas; all paths are of mirror reflections only.

    Raises
    ------
    PlacementError
        If both radars stand at one place, or one of them in a mesh.

    Notes
    -----
    .. math:: |a| = \lambda / (4 \pi L)

    of the line of sight, times the reflection coefficients of the surfaces.

    References
    ----------
    .. [1] H. T. Friis, "A note on a simple transmission formula", Proc. IRE 34(5), 1946.
    """
    if state is not None:
        here, there = state.as_mount(sender_mount), state.as_mount(receiver_mount)
        _apart(here, there)
        knobs = settings or RadarSettings()
        knobs = knobs.with_(max_distance=knobs.max_distance or FARTHEST)
        paths = solve_sionna(state, sender, here, knobs, there, Sought(objects=False))
        weather = state.world.weather
        if weather.is_clear:
            return paths
        frequency = sender.center_frequency
        losses = weather_attenuation(weather, frequency, "V"), weather_attenuation(weather, frequency, "H")
        return attenuate(paths, sender, losses)
    here, there = Mount.of(sender_mount), Mount.of(receiver_mount)
    ahead = there.pose.position - here.pose.position
    length = _apart(here, there)
    towards = ((there, -ahead / length), (here, ahead / length))
    bases = [spherical_basis(place.pose.rotation, direction[None])[0] for place, direction in towards]
    relative = there.twist.linear - here.twist.linear
    rate = float(ahead @ relative) / length
    middle = 0.5 * (here.pose.position + there.pose.position)[None]
    return RadarPaths(
        tx_point=middle,
        rx_point=middle.copy(),
        inner_length=np.zeros(1),
        a=(bases[0] @ bases[1].T * spreading(sender.wavelength, length))[None].astype(np.complex128),
        length_rate=np.array([rate]),
        length_acceleration=np.array([max(float(relative @ relative) - rate * rate, 0.0) / length]),
        instance=np.full((1, 1), -1, dtype=np.int32),
        interaction=np.full((1, 1), -1, dtype=np.int32),
        depth=np.zeros(1, dtype=np.int32),
        semantic=np.zeros(1, dtype=np.uint8),
        world_from_tx=here.pose,
        world_from_rx=there.pose,
        rx_image=np.concatenate([np.eye(3), np.zeros((3, 1))], axis=1)[None],
        tx_velocity=np.zeros((1, 3)),
        rx_velocity=relative[None],
        tx_twist=here.twist,
        rx_twist=there.twist,
        diagnostics={"method": "free space"},
    )


def _apart(here: Mount, there: Mount) -> float:
    """Return how far two radars are apart [m]; raise if they stand at one place."""
    length = float(np.linalg.norm(there.pose.position - here.pose.position))
    if length < ONE_PLACE:
        raise PlacementError("two radars stand at one place; move one of them")
    return length
