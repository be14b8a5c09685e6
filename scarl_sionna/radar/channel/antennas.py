"""What every channel solver refuses: an antenna inside a mesh, a receiver of its own where it is monostatic."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.rays.placement import check_placement

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState


def check_antennas(state: WorldState, radar: RadarSpec, pose: Pose, twin: str = "optical") -> None:
    """Refuse a radar or an antenna inside a mesh; `twin` is the one that rays are cast in.

    An antenna is inside only if the line to it from the radar's origin, which is outside, meets a surface: so only
    those antennas are tested further.
    """
    check_placement(state, pose.position, "radar")
    arms = np.concatenate([radar.tx_array, radar.rx_array])
    length = np.linalg.norm(arms, axis=1)
    reaching = np.flatnonzero(length > 0.0)
    if len(reaching) == 0:
        return
    hits = state.cast(
        pose.position, pose.rotate(arms[reaching] / length[reaching, None]), max_distance=2.0 * length.max(), twin=twin
    )
    for antenna in reaching[hits.ray[hits.distance <= length[reaching][hits.ray] * (1.0 + 1e-6)]]:
        kind, index = ("tx", antenna) if antenna < radar.num_tx else ("rx", antenna - radar.num_tx)
        check_placement(state, pose.apply(arms[antenna]), f"{kind} antenna {index}")


def refuse_receiver(method: str, receiver: Mount | None) -> None:
    """Raise :class:`ParameterRangeError` if a monostatic solver is given a receiver of its own."""
    if receiver is not None:
        raise ParameterRangeError(
            "receiver", "given", f"none: method='{method}' is monostatic", "use method='sbr' or method='sionna'"
        )
