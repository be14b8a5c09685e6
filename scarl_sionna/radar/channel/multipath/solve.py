"""Multipath of a radar by Sionna RT's PathSolver.

Which surfaces a path touches is found by Sionna RT; the rest is the image method in float64.

What it models and where it breaks stands in docs/sionna_paths.md.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.sionna import SionnaSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine import variant
from scarl_sionna.engine.paths.tracing import PathBufferOverflowError, TracedPaths, trace_paths
from scarl_sionna.engine.rays.placement import check_placement
from scarl_sionna.radar.channel.antennas import check_antennas
from scarl_sionna.radar.channel.range_end import within_reach
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.point_scatterers import PointScatterers
from scarl_sionna.radar.tuned import material_frequency

from .columns import Columns, joined_columns, mirror_columns
from .diffuse import diffuse_columns
from .fresnel_zone import warn_of_edge_wavefronts, warn_of_small_mirrors
from .legs import Legs, joined_legs, legs_of
from .scattering import scattered_columns
from .station import ASIDE_DISTANCE, EndPoints, Station, points_beside, station_of
from .visibility import warn_of_hidden_antennas

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]
RAYS_APART = 3.5
"""Angle between neighbouring rays times the root of their number [rad]: that of an even grid over the sphere,
(4 pi)^0.5. Decides a warning only."""


@dataclass(frozen=True, eq=False)
class Sought:
    """Which paths are looked for.

    Attributes
    ----------
    scatterers : PointScatterers, optional
        Point targets in the scene: every pair of a way there and a way back is a path (two-ray, ghosts of type 1 and
        2).
    environment : bool
        Also the paths from the radar to itself, or to the receiver, that touch no scatterer.
    objects : bool
        Whether to warn of objects of the environment that may lie between the rays.
    """

    scatterers: PointScatterers | None = None
    environment: bool = True
    objects: bool = True


def solve_sionna(
    state: WorldState,
    radar: RadarSpec,
    mount: Mount,
    settings: RadarSettings,
    receiver: Mount | None = None,
    sought: Sought | None = None,
) -> RadarPaths:
    r"""Return the paths that Sionna RT's deterministic PathSolver finds, with float64 geometry and amplitudes.

    Parameters
    ----------
    state : WorldState
    radar : RadarSpec
    mount : Mount
        Pose and velocity of the radar, or of the transmitter.
    settings : RadarSettings
        Its `sionna` and `max_distance`.
    receiver : Mount, optional
        A separate receiver (bistatic); the transmitter if not given.
    sought : Sought, optional
        The environment alone if left out.

    Returns
    -------
    RadarPaths
        Environment first, then by scatterer, way there and way back, double bounces last; empty where nothing is found.
        Paths through a scatterer have depth k + 1 + m and the interaction kind ``POINT_INTERACTION`` at the scatterer.

    Raises
    ------
    PathBufferOverflowError
        If the solver's buffer was filled (``on_overflow="raise"``).
    PlacementError
        If the radar or one of its antennas is inside a mesh, or a scatterer stands at the radar.
    MaterialRangeError
        If a material that a path meets has no data in the middle of the band.

    Warns
    -----
    ScarlWarning
        If a mirror is smaller than the first Fresnel zone on it, or an edge shorter, once, naming the worst; if the
        wavefront of an edge is no sphere over the antennas; if antennas of a wide array do not see a path; if an object
        may lie between the rays; if the buffer was filled (``on_overflow="warn"``).

    Notes
    -----
    A mirror path of length L, and a path through a scatterer with ways L1 and L2:

    .. math:: a = \frac{\lambda}{4\pi L} J, \quad
              a = \frac{\lambda \sqrt{\sigma}}{(4\pi)^{3/2} L_1 L_2} J_2^T J_1

    with J the product of the reflections' Jones matrices at each end in the radar's spherical basis; J of the way back
    is the transpose of the way there (reciprocity).

    *Not modelled*: size and curvature of mirrors, more than one edge in a way, scattering from one scatterer to
    another.

    References
    ----------
    .. [1] Recommendation ITU-R P.2040-3, section 2.2.
    """
    knobs, pose, sought = settings.sionna, mount.pose, sought or Sought()
    scatterers = sought.scatterers
    tx = station_of(mount, radar)
    rx = tx if receiver is None else station_of(receiver, radar)
    if receiver is not None:
        check_placement(state, receiver.pose.position, "receiving radar")
    solver = _Solver(state, radar, knobs, settings.warn_at.wide_arm)
    if scatterers is not None:
        scatterers.require_apart(tx.position)
        scatterers.require_apart(rx.position)
    with variant.radio():
        check_antennas(state, radar, pose, twin="radio")
        blocks = solver.solve(tx, rx, scatterers, sought.environment)
    if solver.overflow:
        error = PathBufferOverflowError(knobs.max_num_paths)
        if knobs.on_overflow == "raise":
            raise error
        warnings.warn(str(error), ScarlWarning, stacklevel=2)
    num_small = warn_of_small_mirrors(state, radar.wavelength, solver.mirrors)
    spread = warn_of_edge_wavefronts(radar.wavelength, solver.mirrors, settings.warn_at.wavefront_error)
    num_hidden = warn_of_hidden_antennas(state, solver.mirrors, settings.warn_at.wide_arm)
    reach = radar.max_range if settings.max_distance is None else settings.max_distance
    sees_objects = sought.environment and sought.objects
    num_missed = _warn_of_small_objects(state, pose, solver.mirrors, knobs.num_samples, reach) if sees_objects else 0
    columns = joined_columns(blocks)
    columns.pop("total")
    diagnostics = {
        "method": "sionna",
        **knobs.model_dump(),
        "max_distance": reach,
        "num_candidates": solver.num_candidates,
        "overflow": solver.overflow,
        "num_small_mirrors": num_small,
        "edge_wavefront_error": spread,
        "num_hidden_from_antennas": num_hidden,
        "num_objects_maybe_missed": num_missed,
        "seconds": solver.clock,
    }
    paths = RadarPaths(
        band=None,
        **columns,
        world_from_tx=pose,
        world_from_rx=pose if receiver is None else receiver.pose,
        tx_twist=mount.twist,
        rx_twist=(receiver or mount).twist,
        diagnostics=diagnostics,
    )
    return within_reach(paths, reach)


def _warn_of_small_objects(
    state: WorldState, pose: Pose, found: list[tuple[Legs, Station]], num_samples: int, reach: float
) -> int:
    """Warn once of objects that no path touches and that may lie between the rays; return their number."""
    parts = [legs.part[legs.part >= 0] for legs, _ in found]
    touched = set(state.world.parts.instance[np.concatenate(parts)].tolist()) if parts else set()
    small = []
    for box in state.boxes():
        distance = float(np.linalg.norm(box.world_from_box.position - pose.position))
        width = float(np.sort(box.size)[1])  # what a plate or a pole shows at least along one direction
        if box.instance not in touched and distance < reach and 0.0 < width < distance * RAYS_APART / num_samples**0.5:
            small.append((width / distance, box.name, width, distance))
    if small:
        ratio, name, width, distance = min(small)
        warnings.warn(
            f"{len(small)} object(s) are smaller than the distance between rays and may be missed, most of all "
            f"'{name}' ({width:.2g} m at {distance:.3g} m); num_samples >= {(RAYS_APART / ratio) ** 2:.1e} would hit "
            "it, but the mirror of so small a thing is wrong: use method='sbr' for such objects",
            ScarlWarning,
            stacklevel=3,
        )
    return len(small)


class _Solver:
    """One solve: what was asked, and what it cost."""

    def __init__(self, state: WorldState, radar: RadarSpec, settings: SionnaSettings, wide_arm: float) -> None:
        self.state, self.radar, self.settings, self.wide_arm = state, radar, settings, wide_arm
        self.clock = {"trace": 0.0, "geometry": 0.0}
        self.num_candidates, self.overflow = 0, False
        self.mirrors: list[tuple[Legs, Station]] = []

    def _trace(self, source: Array, targets: Array, diffuse: bool) -> TracedPaths:
        asked = self.settings.with_(diffuse=diffuse, diffraction=self.settings.diffraction and not diffuse)
        start = time.perf_counter()
        traced = trace_paths(self.state, source, targets, asked)
        self.clock["trace"] += time.perf_counter() - start
        self.num_candidates = max(self.num_candidates, traced.num_candidates)
        self.overflow |= traced.overflow
        return traced

    def _legs(self, traced: TracedPaths, station: Station, ends: EndPoints) -> Legs:
        start = time.perf_counter()
        frequency = material_frequency(self.radar)
        arm = float(np.linalg.norm(station.arms, axis=1).max(initial=0.0))
        legs = legs_of(self.state, traced, station, ends, frequency, arm / 2.0 if arm > self.wide_arm else 0.0)
        self.mirrors.append((legs, station))
        self.clock["geometry"] += time.perf_counter() - start
        return legs

    def solve(self, tx: Station, rx: Station, points: PointScatterers | None, environment: bool) -> list[Columns]:
        """Return the columns of all paths asked for; what leaves the transmitter is traced at once."""
        ends = np.zeros((0, 3)) if points is None else points.positions
        own = self._own_targets(tx.position, rx.position)
        blocks = []
        if self.settings.diffuse and environment:
            traced = self._trace(tx.position, own[:1], True)
            blocks.append(diffuse_columns(self.state, traced, tx, rx, self.radar))
        targets = np.concatenate([own, ends]) if environment else ends
        if len(targets) == 0:
            return blocks
        traced = self._trace(tx.position, targets, False)
        if environment:
            back = EndPoints(own[:1], rx.velocity[None], rx.rotation, is_station=True)
            legs = self._legs(_at_one_target(traced.of_targets(0, len(own))), tx, back)
            blocks.insert(0, mirror_columns(self.state, legs, tx, rx, self.radar.wavelength))
        if points is not None:
            blocks.extend(self._scattered(traced.of_targets(len(targets) - len(ends)), tx, rx, points))
        return blocks

    def _own_targets(self, tx: Array, rx: Array) -> Array:
        """Return the receiver, and where it stands at the transmitter three points beside it that nothing hides.

        The way into a right-angled corner and back meets both faces in one point of the edge, where the engine finds
        nothing; to a point beside the transmitter it does. Lengths are then those of the receiver itself.
        """
        if np.linalg.norm(tx - rx) > ASIDE_DISTANCE:
            return rx[None]
        return np.concatenate([rx[None], points_beside(self.state, rx, "radio")])

    def _scattered(self, traced: TracedPaths, tx: Station, rx: Station, points: PointScatterers) -> list[Columns]:
        """Return the paths through scatterers: all pairs of a way there and a way back."""
        ends = EndPoints(points.positions, points.velocities, tx.rotation)
        there = self._legs(traced, tx, ends)
        back = there
        if rx is not tx:
            back = self._legs(self._trace(rx.position, ends.position, False), rx, ends)
        blocks = [scattered_columns(self.state, self.radar.wavelength, points, there, back)]
        if self.settings.double_bounce and len(ends.position):
            between = joined_legs([self._to_itself(index, points, tx.rotation) for index in range(len(ends.position))])
            blocks.append(scattered_columns(self.state, self.radar.wavelength, points, there, back, between))
        return blocks

    def _to_itself(self, index: int, points: PointScatterers, rotation: Array) -> Legs:
        """Return the ways of a scatterer by mirrors back to itself."""
        position, velocity = points.positions[index], points.velocities[index]
        targets = self._own_targets(position, position)
        traced = _at_one_target(self._trace(position, targets, False))
        itself = EndPoints(targets[:1], velocity[None], rotation)
        legs = self._legs(traced, Station(position, velocity, rotation), itself)
        return replace(legs, target=np.full(len(legs.target), index, dtype=np.int64))


def _at_one_target(traced: TracedPaths) -> TracedPaths:
    """Return the paths to the first target, with those to the points beside it but for lines of sight."""
    rows = (traced.target == 0) | (traced.depth > 0)
    arrays: dict[str, Any] = {
        name: value[rows] for name, value in vars(traced).items() if isinstance(value, np.ndarray)
    }
    return replace(traced, **{**arrays, "target": np.zeros(np.count_nonzero(rows), np.int64)})
