"""Channel solvers: from a state of the world to the paths of a radar. One solver a file."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from scarl_sionna.core.errors import UnknownNameError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.arguments import HOW_TO_POSE, HOW_TO_RADAR, HOW_TO_STATE, expect
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.paths import RadarPaths

from .compose.auto import plan_channel, solve_auto
from .compose.hybrid import solve_hybrid
from .compose.plan import ChannelPlan, OwnershipError, Share
from .multipath.solve import PathBufferOverflowError, solve_sionna
from .panes import warn_of_panes
from .raycast.solve import solve_raycast
from .sbr import solve_sbr
from .scatterers import solve_scatterers

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

__all__ = ["ChannelPlan", "OwnershipError", "PathBufferOverflowError", "Share", "plan_channel", "solve_paths"]

SOLVERS: dict[str, Callable[..., RadarPaths]] = {
    "raycast": solve_raycast,
    "sionna": solve_sionna,
    "sbr": solve_sbr,
    "scatterers": solve_scatterers,
    "hybrid": solve_hybrid,
    "auto": solve_auto,
}


def solve_paths(state: WorldState, radar: RadarSpec, pose: Pose, method: str = "auto", **options: Any) -> RadarPaths:
    """Return the propagation paths of a radar in a state of the world.

    Parameters
    ----------
    state : WorldState
    radar : RadarSpec
    pose : Pose
        world_from_radar.
    method : str
        ``"auto"``: chooses for each object among the others, by the rules of docs/accuracy.md. ``"raycast"``: SCaRL's own.
        ``"sionna"``: multipath by Sionna RT's PathSolver. ``"sbr"``: physical optics on the meshes. ``"scatterers"``: the
        scattering centres of the objects that have a model. ``"hybrid"``: several of them by a :class:`ChannelPlan`.
    **options
        Of the solver; see :func:`scarl_sionna.radar.channel.compose.auto.solve_auto` (`accuracy`, `models`, and what `raycast` takes),
        :func:`scarl_sionna.radar.channel.raycast.solve.solve_raycast` (`radar_twist`, `num_rays`, ...),
        :func:`scarl_sionna.radar.channel.multipath.solve.solve_sionna`, :func:`scarl_sionna.radar.channel.sbr.solve_sbr` and
        :func:`scarl_sionna.radar.channel.scatterers.solve_scatterers` (`models`) and
        :func:`scarl_sionna.radar.channel.compose.hybrid.solve_hybrid` (`plan`).

    Returns
    -------
    RadarPaths

    Raises
    ------
    UnknownNameError
        If there is no such method.
    InputTypeError
        If a world stands where a state belongs, a tuple where a pose belongs, and so on.
    """
    from scarl_sionna.engine.world import WorldState

    expect("state", state, WorldState, HOW_TO_STATE)
    expect("radar", radar, RadarSpec, HOW_TO_RADAR)
    expect("pose", pose, Pose, HOW_TO_POSE)
    if method not in SOLVERS:
        raise UnknownNameError("channel solver", method, SOLVERS)
    if method in ("raycast", "sbr", "scatterers"):
        warn_of_panes(state, radar, pose, method)
    return SOLVERS[method](state, radar, pose, **options)
