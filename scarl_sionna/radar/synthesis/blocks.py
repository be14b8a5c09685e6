"""Beat signal of a frame whose paths are traced again for blocks of chirps.

Wheels, limbs, all that turns or bends its way.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.accuracy import DEFAULT_ACCURACY, Accuracy
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveforms.coded import is_coded
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.signal.front_end.mixer import in_phase
from scarl_sionna.signal.multiplexing import multiplex
from scarl_sionna.signal.noise import add_noise

from . import alone, codes_of
from .fading import fading_from, over_time
from .motion import center_terms, is_known
from .phase import chirps_of

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World

PathsAt = Callable[[float], RadarPaths]
"""Time since the start of the first ramp [s] -> the paths at that time."""


def synthesize_blocks(
    paths_at: PathsAt,
    radar: RadarSpec,
    chirps_per_block: int = 8,
    rng: np.random.Generator | None = None,
    accuracy: Accuracy = DEFAULT_ACCURACY,
    method: Literal["nufft", "direct"] = "nufft",
    block_tolerance: float = 0.1,
) -> npt.NDArray[np.complex64]:
    r"""Return the de-chirped signal of a frame, its paths solved anew in the middle of every block of chirps.

    Parameters
    ----------
    paths_at : callable
        Time since the start of the first ramp [s] -> :class:`RadarPaths` at that time, with their motion. For a scene:
        :func:`retraced`.
    radar : RadarSpec
    chirps_per_block : int
        Chirps of each transmitter in a block, 1 to ``radar.num_chirps``; the last block may be shorter.
    rng : numpy.random.Generator, optional
        Adds the receiver's thermal noise; left out: no noise.
    accuracy, method
        As of :func:`synthesize`.
    block_tolerance : float
        Largest error at the blocks' borders, relative to the strongest block, before there is a warning.

    Returns
    -------
    ndarray of complex64, shape (num_rx, num_chirps_total, num_samples)
        As of :func:`synthesize`.

    Raises
    ------
    ParameterRangeError
        If `chirps_per_block` is out of range, or the radar's front end is not ideal.

    Warns
    -----
    ScarlWarning
        If blocks do not follow the motion. Each block is carried on to the middle of the next and compared with what is
        found there; a quarter of the difference stands for the error at the border, half as far (it grows with the
        square of time).

    Notes
    -----
    Within a block, end points move straight on, and what their acceleration does to the length is quadratic in time
    about the middle. With the true rate and acceleration the phase is off by at most
    :math:`2\pi f_0/c \cdot \dddot L (T/2)^3/6` at the borders of a block that lasts T; where a solver takes turning
    parts as moving straight, by :math:`2\pi f_0/c \cdot \ddot L (T/2)^2/2`. What patches
    change by (`over_time`) is exact from the start of the paths to the end of their frame; before the start, where the
    first half of a block lies whose paths are those of its middle, it is a quadratic extrapolation.

    References
    ----------
    .. [1] V. Chen, *The Micro-Doppler Effect in Radar*, Artech House, 2011, chapter 2.
    """
    if not 1 <= chirps_per_block <= radar.num_chirps:
        raise ParameterRangeError("chirps_per_block", chirps_per_block, f"1 to num_chirps = {radar.num_chirps}")
    if not radar.front_end.is_ideal or radar.array.has_echo:
        raise ParameterRangeError(
            "chirps_per_block",
            chirps_per_block,
            "None with effects of the front end, which need the whole frame",
            "use radar.with_(front_end=radar.front_end.ideal()) and a radome with echo=False, or leave the blocks out",
        )
    chirps = chirps_per_block * (radar.num_slow_chirps // radar.num_chirps)
    both = radar.with_(sampling="complex") if radar.adc.is_real else radar
    adc, error = _Blocks(paths_at, both.separated, accuracy, method, codes_of(both)).joined(chirps)
    if error > block_tolerance:
        warnings.warn(
            f"blocks of {chirps_per_block} chirps do not follow the motion: "
            f"the signal is off by about {error:.2g} of its largest at "
            "their borders. Parts turn too fast, or paths come and go; use fewer chirps_per_block",
            ScarlWarning,
            stacklevel=2,
        )
    if radar.multiplexing.is_coded:
        adc = multiplex(adc, radar)
    adc = adc if rng is None else add_noise(adc, radar, rng)
    return in_phase(adc) if radar.adc.is_real else adc


@dataclass(frozen=True, eq=False)
class _Blocks:
    """A frame in blocks of chirps, each transmitter in rows of its own; see :func:`synthesize_blocks`."""

    paths_at: PathsAt
    radar: RadarSpec
    accuracy: Accuracy
    method: Literal["nufft", "direct"]
    codes: npt.NDArray[np.complex128] | None

    def joined(self, size: int) -> tuple[npt.NDArray[np.complex64], float]:
        """Return the signal of blocks of so many chirps, and their error at the borders, relative to the strongest."""
        radar = self.radar
        adc = np.zeros((radar.num_rx, radar.num_chirps_total, radar.num_samples), dtype=np.complex64)
        apart, strongest, before = 0.0, 0.0, None
        for first in range(0, radar.num_chirps, size):
            count = min(size, radar.num_chirps - first)
            middle = (first + count / 2.0) * radar.doppler_interval
            paths = self.paths_at(middle)
            adc[:, first * radar.num_tx : (first + count) * radar.num_tx] = self._block(paths, middle, first, count)
            if before is not None:
                carried, found = self._single(later(before[0], middle - before[1])), self._single(paths)
                apart = max(apart, float(np.linalg.norm(carried - found)))
                strongest = max(strongest, float(np.linalg.norm(carried)), float(np.linalg.norm(found)))
            before = paths, middle
        return adc, 0.25 * apart / strongest if strongest > 0.0 else 0.0

    def _block(self, paths: RadarPaths, middle: float, first: int, count: int) -> npt.NDArray[np.complex64]:
        """Return some chirps, from paths in their middle; with symbols those before them that reach into them."""
        lead = min(first, 2) if self._reaches_on else 0
        some = slice(first - lead, first + count)
        codes = None if self.codes is None else self.codes[some]
        moved = later(paths, some.start * self.radar.doppler_interval - middle)
        found = alone(moved, chirps_of(self.radar, some.start, lead + count), self.accuracy, self.method, codes)
        return found[:, lead * self.radar.num_tx :]

    @property
    def _reaches_on(self) -> bool:
        """Whether a chirp depends on the one before."""
        waveform = self.radar.waveform
        return is_coded(waveform) and (self.codes is not None or math.isfinite(waveform.prefix_time))

    def _single(self, paths: RadarPaths) -> npt.NDArray[np.complex64]:
        return alone(paths, chirps_of(self.radar, 0, 1), self.accuracy, self.method, None)


def later(paths: RadarPaths, time: float) -> RadarPaths:
    """Return paths as they are some time later [s], or earlier if negative, seen from the radar as it is then.

    Where velocities are known, end points move straight on and strengths follow their distances and `over_time`; points
    and velocities are those in the radar's frame, which stays where it is. The other paths are :func:`shifted`.

    By definition of straight motion.
    """
    known = is_known(paths)
    if not known.all():
        order = np.argsort(np.concatenate([np.flatnonzero(known), np.flatnonzero(~known)]), kind="stable")
        blocks = [later(paths.select(known), time)] if known.any() else []
        return RadarPaths.concatenate([*blocks, shifted(paths.select(~known), time)], paths.diagnostics).select(order)
    offsets, velocities = paths.end_vectors(), [paths.filled(name) for name in ("tx_velocity", "rx_velocity")]
    twists, poses = (paths.tx_twist, paths.rx_twist), (paths.world_from_tx, paths.world_from_rx)
    mirror, linear = paths.is_mirror_chain, paths.filled("linear_motion")
    back = [Rotation.from_rotvec(-twist.angular * time) for twist in twists]
    changed: dict[str, Any] = {}
    for name, offset, velocity, turn, pose in zip(("tx", "rx"), offsets, velocities, back, poses, strict=True):
        changed[f"{name}_point"] = pose.position + turn.apply(offset + time * velocity)
        changed[f"{name}_velocity"] = turn.apply(velocity)
    if mirror.any():
        image = paths.filled("rx_image").copy()
        arms = back[0].as_matrix() @ image[mirror, :, :3] @ back[1].inv().as_matrix()
        moved = back[0].apply(offsets[0][mirror] + time * velocities[1][mirror])
        image[mirror, :, :3] = arms
        image[mirror, :, 3] = poses[0].position + moved - arms @ poses[1].position
        for name in ("tx", "rx"):  # of a path of mirrors only the points are labels
            changed[f"{name}_point"][mirror] = getattr(paths, f"{name}_point")[mirror]
        changed["rx_velocity"][mirror] = back[0].apply(velocities[1][mirror])
        changed["rx_image"] = image
    return _timed(replace(paths, **changed), paths, time, linear)


def _timed(moved: RadarPaths, paths: RadarPaths, time: float, linear: npt.NDArray[np.bool_]) -> RadarPaths:
    """Return moved paths with the lengths, rates and amplitudes of that time."""
    length, rate, bend, strength = center_terms(paths, time)
    rate, bend = np.where(linear, paths.length_rate, rate), np.where(linear, paths.length_acceleration, bend)
    length = np.where(linear, paths.length + time * paths.length_rate, length)
    mirror, missing = moved.is_mirror_chain, length - moved.length
    if mirror.any():  # by what its image has not moved, that moves along the line of sight
        ahead = moved.end_vectors()[0][mirror]
        image = moved.filled("rx_image").copy()
        image[mirror, :, 3] += missing[mirror, None] * ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
        moved = replace(moved, rx_image=image)
    return replace(
        moved.scaled(np.where(linear, 1.0, strength * over_time(paths, time))),
        inner_length=np.where(mirror, moved.inner_length, moved.inner_length + missing),
        length_rate=rate,
        length_acceleration=bend,
        over_time=fading_from(paths, time),
    )


def shifted(paths: RadarPaths, time: float) -> RadarPaths:
    """Return paths as they are some time later [s], or earlier if negative, by their own rates and accelerations.

    Directions and amplitudes stay. Lengths change by the same amount for every antenna, as :func:`synthesize` takes it
    where velocities are not known.

    By definition of a second-order series in time.
    """
    change = paths.length_rate * time + 0.5 * paths.length_acceleration * time**2
    image = paths.rx_image
    if image is not None:
        # A path of mirrors only is as long as the way to the receiver's image: that moves along the line of sight
        image = image.copy()
        rx, tx = paths.world_from_rx.position, paths.world_from_tx.position
        ahead = np.einsum("pij,j->pi", image[:, :, :3], rx) + image[:, :, 3] - tx
        length = np.linalg.norm(ahead, axis=1, keepdims=True)
        image[:, :, 3] += np.divide(ahead, length, out=np.zeros_like(ahead), where=length > 0.0) * change[:, None]
    return replace(
        paths,
        inner_length=paths.inner_length + change,
        length_rate=paths.length_rate + paths.length_acceleration * time,
        rx_image=image,
    )


def retraced(
    world: World,
    radar: RadarSpec,
    mount: Mount | Pose,
    time: float = 0.0,
    method: str | None = None,
    *,
    settings: RadarSettings | None = None,
    **fields: object,
) -> PathsAt:
    """Return what solves the paths of a world at any time, for :func:`synthesize_blocks`.

    Exact geometry: each call solves the paths anew. Only hits of ``raycast`` are those of the frame's start, moved by
    their rates as without blocks: they stay on their rays, so a new cast from a radar that moves has other hits with
    other phases, and what stands still would come apart. ``"auto"`` keeps the plan of the frame's start.

    Parameters
    ----------
    world : World
        Its trajectories must cover the frame.
    radar : RadarSpec
    mount : Mount or Pose
        At the frame's start. One that rides on an actor follows the actor; another moves straight on and turns about
        its own origin.
    time : float
        Of the frame's start [s].
    method, settings, **fields
        As of :func:`scarl_sionna.solve_paths`.

    Warns
    -----
    ScarlWarning
        If the method is ``"raycast"``: then blocks change nothing.
    """
    from scarl_sionna.radar.channel import settings_of

    return retraced_after(world, radar, world.at(time).as_mount(mount), time, settings_of(method, settings, fields))


def retraced_after(
    world: World,
    radar: RadarSpec,
    start: Mount,
    time: float,
    settings: RadarSettings,
    first: RadarPaths | None = None,
) -> PathsAt:
    """Return :func:`retraced` of full settings; `first` are the paths at the frame's start, where they are known.

    Exact geometry.
    """
    from scarl_sionna.radar.channel import plan_channel, solve_paths

    if settings.method == "raycast":
        warnings.warn(
            "hits of method 'raycast' are cast once a frame and move by their rates, since each new cast has other "
            "phases: blocks of chirps change nothing. Use 'sbr' or 'auto' for wheels and limbs, or leave them out",
            ScarlWarning,
            stacklevel=3,
        )
    elif settings.method == "auto":  # who computes an object must not change within a frame
        plan = plan_channel(world.at(time), radar, start, settings=settings)
        settings = settings.changed("hybrid", plan=plan)
    held = None
    if settings.method in ("raycast", "hybrid"):
        first = solve_paths(world.at(time), radar, start, settings=settings) if first is None else first
        held = first.select(first.filled("linear_motion"))

    def paths_at(after: float) -> RadarPaths:
        moved = carried(world, start, time, after)
        if held is not None and settings.method == "raycast":
            return _seen_from(later(held, after), moved)
        found = solve_paths(world.at(time + after), radar, moved, settings=settings)
        if held is None or not held.num_paths:
            return found
        own = found.select(~found.filled("linear_motion"))
        return RadarPaths.concatenate([own, _seen_from(later(held, after), moved)], found.diagnostics)

    return paths_at


def _seen_from(paths: RadarPaths, mount: Mount) -> RadarPaths:
    """Return hits as they are in the radar's frame, at another place of the radar."""
    changed: dict[str, Any] = {"world_from_tx": mount.pose, "world_from_rx": mount.pose}
    for name in ("tx", "rx"):
        before = getattr(paths, f"world_from_{name}")
        changed[f"{name}_point"] = mount.pose.apply(before.inverse().apply(getattr(paths, f"{name}_point")))
        velocity = before.inverse().rotate(paths.filled(f"{name}_velocity"))
        changed[f"{name}_velocity"] = mount.pose.rotate(velocity)
        changed[f"{name}_twist"] = mount.twist
    return replace(paths, **changed)


def carried(world: World, start: Mount, time: float, after: float) -> Mount:
    """Return the mount of a radar some time after an instant [s], of which `start` is.

    One that rides on an actor follows the actor; another moves straight on and turns about its own origin.

    Exact geometry of the trajectory.

    Raises
    ------
    TimeRangeError
        If the actor's trajectory is not known at that time.
    """
    if start.actor is None:
        return straight_on(start, after)
    trajectory = world.actor(start.actor).trajectory
    vehicle = Mount(trajectory.pose(time + after), trajectory.twist(time + after), start.actor)
    return vehicle if start.actor_from_sensor is None else vehicle.at(start.actor_from_sensor)


def straight_on(mount: Mount, after: float) -> Mount:
    """Return a mount some time later [s] that has moved straight on and turned about its own origin.

    By definition of the twist.
    """
    return replace(mount, pose=_moved(mount.pose, mount.twist, after))


def _moved(pose: Pose, twist: Twist, time: float) -> Pose:
    turn = Rotation.from_rotvec(twist.angular * time).as_matrix()
    return Pose.from_rotation(pose.position + twist.linear * time, turn @ pose.rotation)
