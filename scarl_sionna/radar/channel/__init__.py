"""Channel solvers: from a state of the world to the paths of a radar. One room a solver."""

from __future__ import annotations

from collections.abc import Callable

from scarl_sionna.core.errors import InputTypeError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.plan import ChannelPlan, Share
from scarl_sionna.core.settings.radar import METHODS, RadarSettings
from scarl_sionna.core.settings.reads import refuse_unread, warn_of_unread
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.paths.tracing import PathBufferOverflowError
from scarl_sionna.engine.threads import few_threads
from scarl_sionna.engine.world import World, WorldState
from scarl_sionna.radar.paths import RadarPaths

from .band import solved_over_band, warn_of_band
from .compose.auto import plan_channel, solve_auto
from .compose.hybrid import solve_hybrid
from .compose.plan import OwnershipError, resolve
from .multipath.solve import solve_sionna
from .panes import warn_of_panes
from .raycast.solve import solve_raycast
from .sbr.reciprocity import with_reverses
from .sbr.solve import solve_sbr
from .scatterers import solve_scatterers

__all__ = ["ChannelPlan", "OwnershipError", "PathBufferOverflowError", "Share", "plan_channel", "solve_paths"]

SOLVERS: dict[str, Callable[[WorldState, RadarSpec, Mount, RadarSettings, Mount | None], RadarPaths]] = {
    "raycast": solve_raycast,
    "sionna": solve_sionna,
    "sbr": solve_sbr,
    "scatterers": solve_scatterers,
    "hybrid": solve_hybrid,
    "auto": solve_auto,
}


def solve_paths(
    state: WorldState,
    radar: RadarSpec,
    mount: Mount | Pose,
    method: str | None = None,
    *,
    settings: RadarSettings | Spec | None = None,
    receiver: Mount | Pose | None = None,
    **fields: object,
) -> RadarPaths:
    """Return the propagation paths of a radar in a state of the world.

    Parameters
    ----------
    state : WorldState
        ``world.at(time)``.
    radar : RadarSpec
    mount : Mount or Pose
        ``state.mount("ego", pose)`` for a radar that rides on an actor; a bare pose (world_from_radar) stands still.
    method : str, optional
        Short form of ``settings.method``; ``"auto"`` if neither is given. ``"auto"``: chooses for each object among the
        others, by the rules of docs/accuracy.md. ``"raycast"``: SCaRL's own. ``"sionna"``: multipath by Sionna RT's
        PathSolver. ``"sbr"``: physical optics on the meshes. ``"scatterers"``: the scattering centres of the objects
        that have a model. ``"hybrid"``: several of them by a :class:`ChannelPlan`.
    settings : RadarSettings, optional
        Tolerances, budget, reach and the knobs of each solver; or the settings of `method` alone. Paths go out
        smoothly over the last 0.25 m of the reach, or its last 5 % where that is less.
    receiver : Mount or Pose, optional
        Of a separate receiver (bistatic), for ``"sbr"`` and ``"sionna"``.
    **fields
        Short form: fields of the settings, for instance ``solve_paths(state, radar, mount, "raycast",
        num_rays=10_000)``; see :meth:`scarl_sionna.RadarSettings.of`. What has no effect with the method is refused;
        in `settings`, which may be those of many methods, it is warned of.

    Returns
    -------
    RadarPaths

    Raises
    ------
    UnknownNameError
        If there is no such method or field.
    InputTypeError
        If an argument has another type.
    ParameterRangeError
        If a value is not allowed, or a field has no effect with the method.

    Warns
    -----
    ScarlWarning
        If a bare pose stands on or in a moving actor, the solver is used where it is not right, or something in
        `settings` that is neither the default nor of a quality has no effect with the method.
    """
    if isinstance(state, World):
        raise InputTypeError("state", state, "a WorldState", "give world.at(time), for instance world.at(0.0)")
    if not isinstance(state, WorldState):
        raise InputTypeError("state", state, "a WorldState", "make one with load_scene(name).at(time)")
    if not isinstance(radar, RadarSpec):
        raise InputTypeError("radar", radar, "a RadarSpec", "for instance RadarSpec.preset('awr1843boost')")
    chosen = settings_of(method, settings, fields)
    warn_of_unread(chosen)
    place = state.as_mount(mount)
    if chosen.method in ("raycast", "scatterers") or (chosen.method == "sbr" and chosen.sbr.pane_loss_db is None):
        warn_of_panes(state, radar, place.pose, chosen.method, chosen.warn_at)
    other = None if receiver is None else state.as_mount(receiver)
    solve = SOLVERS[chosen.method]
    if chosen.num_band_frequencies > 1:
        count, level = chosen.num_band_frequencies, chosen.warn_at.band_error
        with few_threads():
            found = solved_over_band(lambda tuned: solve(state, tuned, place, chosen, other), radar, count, level)
    else:
        warn_of_band(state, radar, chosen.warn_at)
        with few_threads():
            found = solve(state, radar, place, chosen, other)
    if other is not None or radar.array.is_of_one_polarization or chosen.method not in ("sbr", "hybrid", "auto"):
        return found  # the two senses of physical optics look alike to antennas of one polarisation
    return with_reverses(state, found, _as_traced(state, chosen))


def _as_traced(state: WorldState, settings: RadarSettings) -> set[int]:
    """Return the instances whose chains of bounces are to have no reverse, by the settings of who computes them."""
    if settings.method != "hybrid" or settings.plan is None:
        return set(state.world.instances) if settings.sbr.reciprocal is False else set()
    left: set[int] = set()
    for share, owned in zip(settings.plan.shares, resolve(settings.plan, state.world).owned, strict=True):
        if share.solver == "sbr" and (share.settings or settings.sbr).reciprocal is False:
            left.update(owned)
    return left


def settings_of(method: str | None, settings: RadarSettings | Spec | None, fields: dict[str, object]) -> RadarSettings:
    """Return the settings of a solve, from their full form or a short one."""
    if settings is not None and not isinstance(settings, RadarSettings):
        name = _part_of(settings)
        fields = {name: settings, **fields}
        method = name if method is None and name in METHODS else method
        settings = None
    chosen = (settings or RadarSettings()).changed(method)
    refuse_unread(chosen.method, fields)
    return chosen.changed(None, **fields)


def _part_of(settings: Spec) -> str:
    """Return which part of the settings has this class."""
    for name, field in RadarSettings.model_fields.items():
        if isinstance(settings, Spec) and field.annotation is type(settings):
            return name
    raise InputTypeError("settings", settings, "a RadarSettings, or the settings of one solver")
