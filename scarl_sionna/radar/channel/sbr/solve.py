"""Shooting and bouncing rays with physical optics on a scene, seen from the radar with spherical waves.

What it is right for, where it breaks and what it costs stands in docs/sbr.md.
"""

from __future__ import annotations

import time
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ScarlWarning, UnknownNameError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.paths.tracing import DIFFUSE, SPECULAR
from scarl_sionna.engine.rays.overlap import seen_overlaps
from scarl_sionna.radar.channel.antennas import check_antennas
from scarl_sionna.radar.channel.range_end import within_reach
from scarl_sionna.radar.optics.edges.near_field import EdgeView, edge_rows
from scarl_sionna.radar.optics.elsewhere import with_changes
from scarl_sionna.radar.optics.near_field import NearField, radiated
from scarl_sionna.radar.optics.patches import PatchSize
from scarl_sionna.radar.optics.spherical_waves import Heard
from scarl_sionna.radar.optics.tubes.checks import Lit
from scarl_sionna.radar.optics.tubes.together import together
from scarl_sionna.radar.optics.viewpoint import Viewpoint
from scarl_sionna.radar.paths import RadarPaths, bend_of

from .bodies import Bodies
from .cost import Work, affordable, check_memory, coarser, with_knobs
from .curve_warnings import warn_of_curves
from .diffuse import rough_pieces, scattered_rows
from .edge_rows import with_edges
from .last_bounce import LOOK_FROM_DB, MORE, further_db, last_bounces_db, warn_of_further
from .reciprocity import of_both_senses
from .rows import CHANGES, OF_SMOOTH, Columns, above_floor, in_order, joined, received
from .senses import ROUGH_KINDS, Kind, kinds_of, mirrored_back, reversed_rows, scattering_bounce
from .shadows import shadows_db, warn_of_shadows
from .tracing import Pair, Shared, shared_tracings

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

_OF_ONE = 4
"""A tracing that asks about this part of `max_tubes` fills the calls of the rays alone: no other begins beside it, so
that not all of them hold their rows at once. Bounds the memory."""


def solve_sbr(
    state: WorldState, radar: RadarSpec, mount: Mount, settings: RadarSettings, receiver: Mount | None = None
) -> RadarPaths:
    r"""Return the paths of a radar, or of a bistatic pair, by physical optics on the scene's meshes.

    Parameters
    ----------
    state : WorldState
    radar : RadarSpec
        Field of view, band, array and link budget.
    mount : Mount
        Pose and velocity of the radar.
    settings : RadarSettings
        Its `sbr` (bounces, size of the patches, rays, and what is too weak to be kept), the budgets of its `accuracy`
        (what a solve over them becomes: docs/sbr.md, cost), `max_distance` (paths longer
        than twice this are left out; the unambiguous range if None) and `instances` (what scatters; every actor and
        every object if None. The rest, ground, verges, a wood, hides what is behind it and is named in
        ``diagnostics["left_out"]``).
    receiver : Mount, optional
        A second radar of the same specification that receives in place of the first.

    Returns
    -------
    RadarPaths
        ``diagnostics["estimate"]`` is what the solve was expected to cost, before it started, ``["shadows_db"]`` by
        how much the echo of an instance (id) may be off for unresolved shadows [dB], ``["last_bounce_db"]`` what the
        last bounce has of it, ``["further_db"]`` what more have (docs/sbr.md). One row a patch, sorted.
        `tx_point` is the patch as the transmitter sees it through the mirrors before
        it, `rx_point` as the receiver sees it. The interaction ``DIFFUSE`` of a row is the scattering patch, mostly the
        last one, the others are mirror reflections.

    Raises
    ------
    PlacementError
        If a radar or one of its antennas is inside a mesh.
    MaterialRangeError
        If a material that scatters has no data at the middle of the band.
    UnknownNameError
        If `instances` names something that is not in the scene.
    BudgetError
        If the solve is expected to take more processor time or memory than the budgets of `accuracy`, before it starts.
    ParameterRangeError
        If the scene needs more patches than `max_patches`.

    Warns
    -----
    ScarlWarning
        If an instance in view is smaller than 3 wavelengths or drawn with too few faces for a curve, most of the
        power comes from grazing patches, shadows are finer than the rays, or more bounces matter.

    Notes
    -----
    The direct and the reversed sense of a chain of bounces are both there, since tubes start on every face that is lit.
    Between bodies a monostatic radar takes both from the sense that ends at the narrower face (:mod:`.senses`), where
    the faces differ by a factor of two and the radar looks straight, not over a mirror. There and back over the same
    flat faces it hears the narrow one at its own image, the scatterer in the middle of the chain.

    *Not modelled*: edge diffraction (but with `edge_diffraction` that of single edges which both ends see), creeping
    waves, what passes through a dielectric between two bounces, diffuse scattering between mirrors, by the last side of
    what is heard there and back and, for a bistatic pair, before them, the direct path of such a pair,
    the acceleration of bodies themselves (wheels: :func:`scarl_sionna.synthesize_blocks`). *Validity*: docs/sbr.md.

    References
    ----------
    .. [1] H. Ling, R.-C. Chou, S.-W. Lee, "Shooting and Bouncing Rays", IEEE Trans. Antennas Propag. 37(2), 1989.
    """
    stations = [mount] if receiver is None else [mount, receiver]
    for station in stations:
        check_antennas(state, radar, station.pose)
    chosen, left_out = _chosen(state, settings.instances)
    place = np.mean([station.pose.position for station in stations], axis=0)
    bodies = Bodies(state, radar, settings, chosen, place)
    ends = [(mount, receiver)]
    if receiver is not None and bodies.knobs.reciprocal:
        ends.append((receiver, mount))
    work = [Work(bodies, stations_of(radar, *pair)) for pair in ends]
    knobs, cost = affordable(work, settings.accuracy, settings.auto.levels)
    bodies = with_knobs(bodies, knobs[0])
    both = [solve_bodies(bodies, *pair, left_out) for pair in ends]
    found = both[0] if len(both) == 1 else of_both_senses(state, both)
    table, errors = state.world.instances, found.diagnostics["shadows_db"]
    warn_of_shadows({table[number].name: error for number, error in errors.items()}, settings.warn_at)
    told = _beyond(bodies, found, mount, receiver)
    further = {table[number].name: share for number, share in told["further_db"].items()}
    warn_of_further(further, bodies.knobs.max_depth, settings.warn_at)
    return replace(found, diagnostics={**found.diagnostics, **told, "estimate": cost.report()})


def _beyond(bodies: Bodies, found: RadarPaths, mount: Mount, receiver: Mount | None) -> dict[str, dict[int, float]]:
    """Return what the last bounce has of echoes, and where that is much what a coarse look finds beyond it."""
    knobs = bodies.knobs
    shares = last_bounces_db(found, bodies.radar, knobs.max_depth)
    some = [number for number, share in shares.items() if share > LOOK_FROM_DB]
    further: dict[int, float] = {}
    if some:
        more = coarser(knobs, bodies.settings.auto.levels[0]).with_(max_depth=min(knobs.max_depth + MORE, 32))
        with warnings.catch_warnings():  # said by the solve itself
            warnings.simplefilter("ignore", ScarlWarning)
            paths = solve_bodies(with_knobs(bodies, more), mount, receiver, lit=some)
        further = further_db(found, paths, bodies.radar, knobs.max_depth)
    return {"last_bounce_db": shares, "further_db": further}


def stations_of(radar: RadarSpec, mount: Mount, receiver: Mount | None = None) -> tuple[Viewpoint, Viewpoint]:
    """Return transmitter and receiver of a solve, the same object for a monostatic radar."""
    tx = Viewpoint.of(radar, mount.pose, mount.twist.linear)
    return tx, tx if receiver is None else Viewpoint.of(radar, receiver.pose, receiver.twist.linear)


def solve_bodies(
    bodies: Bodies,
    mount: Mount,
    receiver: Mount | None = None,
    left_out: Sequence[str] = (),
    lit: Sequence[int] | None = None,
) -> RadarPaths:
    """Return the paths of :func:`solve_sbr` for bodies made ready, without checks of where the radars stand.

    Parameters
    ----------
    bodies : Bodies
    mount : Mount
    receiver : Mount, optional
    left_out : sequence of str
        Names for ``diagnostics["left_out"]``.
    lit : sequence of int, optional
        Instances on which tubes start; all that scatter if left out.

    Raises
    ------
    MaterialRangeError
        If a material that scatters has no data at the middle of the band.
    ParameterRangeError
        If the scene needs more patches than `max_patches`.
    """
    (found,) = solve_between(bodies, [Pair(*stations_of(bodies.radar, mount, receiver), lit)])
    return straight(bodies, found, mount, receiver, left_out)


def straight(
    bodies: Bodies,
    found: RadarPaths,
    mount: Mount,
    receiver: Mount | None = None,
    left_out: Sequence[str] = (),
) -> RadarPaths:
    """Return the paths between radars themselves with what is to be said of them; arguments as of :func:`solve_bodies`.

    Warns
    -----
    ScarlWarning
        Of bodies that are too small.
    """
    _warn_of_bodies(bodies, mount.pose.position, found)
    found = replace(
        found,
        tx_twist=mount.twist,
        rx_twist=(receiver or mount).twist,
        diagnostics={**found.diagnostics, "left_out": list(left_out)},
    )
    return within_reach(found, bodies.reach)


def solve_between(bodies: Bodies, pairs: Sequence[Pair]) -> list[RadarPaths]:
    """Return the paths between pairs of stations, without checks of where they stand; all are traced together.

    Pairs from one place share their tubes, so ``diagnostics["num_tubes"]`` of each are those of all that share them.

    Parameters
    ----------
    bodies : Bodies
        What scatters: the same for all pairs of stations of one solve.
    pairs : sequence of Pair

    Raises
    ------
    MaterialRangeError
        If a material that scatters has no data at the middle of the band.
    ParameterRangeError
        If the scene needs more patches than `max_patches`.
    """
    with bodies.active():
        solves = [_Solve(bodies, pair) for pair in pairs]
        shared = list(shared_tracings(bodies, pairs))
        for one in shared:
            for number in one.pairs:
                solves[number].tracings.append(one)
        for solve in solves:
            if not solve.tracings:
                solve.finish()
        fields = _Fields()
        tracings = [one.tracer.tracing(one.start) for one in shared]
        for number, found in together(tracings, bodies.knobs.max_tubes // _OF_ONE):
            if found is None:
                for pair in shared[number].pairs:
                    fields.end(solves[pair])
                continue
            fields.add(solves[shared[number].pairs[found.receiver]], found)
            if fields.num_patches >= bodies.knobs.max_tubes:
                fields.finish()
                check_memory(bodies, sum(solve.num_rows for solve in solves))
        fields.finish()
        check_memory(bodies, sum(solve.num_rows for solve in solves))
    return [solve.paths for solve in solves]


class _Fields:
    """Patches of some solves whose fields are still to be computed, alike ones of all solves together."""

    def __init__(self) -> None:
        self.num_patches = 0
        self._waiting: dict[tuple[int, bool, bool], list[tuple[_Solve, int, Heard]]] = {}
        self._ended: list[_Solve] = []

    def end(self, solve: _Solve) -> None:
        """End one of the tracings of a solve."""
        solve.num_ended += 1
        if solve.num_ended == len(solve.tracings):
            self._ended.append(solve)

    def add(self, solve: _Solve, heard: Heard) -> None:
        """Add patches that the receiver of a solve sees."""
        for is_curved, some in solve.near.kinds(heard.patches):
            one = solve, len(solve.blocks), heard._replace(patches=some)
            self._waiting.setdefault((some.depth, is_curved, heard.same_way), []).append(one)
            solve.blocks.append({})
            self.num_patches += len(some)

    def finish(self) -> None:
        """Compute the fields, and the paths of the solves that have ended."""
        for (_, _, same_way), waiting in self._waiting.items():
            nears, patches = [one.near for one, _, _ in waiting], [heard.patches for *_, heard in waiting]
            fields = radiated(nears, patches, same_way)
            with_changes(nears, patches, fields, waiting[0][0].bodies.faces.triangles.normal, same_way)
            for (solve, place, heard), columns in zip(waiting, fields, strict=True):
                solve.fill(place, heard, columns)
        for solve in self._ended:
            solve.finish()
        self.num_patches, self._waiting, self._ended = 0, {}, []


class _Solve:
    """The patches between two stations, until all are there."""

    def __init__(self, bodies: Bodies, pair: Pair) -> None:
        self.bodies, self.pair, self.clock = bodies, pair, time.perf_counter()
        self.size = size = PatchSize.of(bodies.radar, bodies.knobs, bodies.settings.warn_at.wide_arm)
        self.has_reverse = pair.tx is pair.rx and pair.tx.window is None
        self.tracings: list[Shared] = []
        self.near = NearField(
            bodies.rays,
            bodies.surfaces,
            pair.tx,
            pair.rx,
            size.wavenumber,
            bodies.knobs.integration_phase,
            bodies.curves,
            size.duration,
            size.max_turn,
            size.wide_arm,
            bodies.knobs.seed,
        )
        self.blocks: list[Columns] = []
        self.rough: dict[tuple[int, bool], list[Columns]] = {}
        self.num_rows, self.num_ended = 0, 0
        self.paths = RadarPaths.empty(pair.tx.pose)

    def fill(self, place: int, heard: Heard, columns: Columns) -> None:
        """Put the columns of patches in their place among the blocks, without what comes from out of view or too far.

        Rough pieces are added to those of their depth.
        """
        bodies, state, near, patches = self.bodies, self.bodies.state, self.near, heard.patches
        is_rough = near.surfaces.is_rough[patches.face[:, -1]] & bodies.knobs.diffuse
        part = bodies.faces.part[patches.face]
        columns["instance"] = state.world.parts.instance[part]
        columns["semantic"] = state.world.parts.semantic[part[:, -1]]
        columns["depth"] = np.full(len(patches), patches.depth, dtype=np.int32)
        columns["kind"] = np.full(len(patches), Kind.TRACED, dtype=np.int8)
        seen = columns["length"] < 2.0 * bodies.reach
        rows = np.flatnonzero(is_rough & seen)
        if len(rows):
            some = {name: column[rows] for name, column in columns.items() if name not in OF_SMOOTH}
            some["first_semantic"] = state.world.parts.semantic[part[rows, 0]]
            alike = self.rough.setdefault((patches.depth, heard.same_way), [])
            alike.append(rough_pieces(some, patches.take(rows)))
        columns.pop("scattered")
        if self.has_reverse and patches.depth > 1:
            columns["first_semantic"] = state.world.parts.semantic[part[:, 0]]
            if heard.same_way:
                columns = mirrored_back(columns, Kind.SAME_WAY)
            else:
                ends = bodies.widths[patches.face[:, 0]], bodies.widths[patches.face[:, -1]]
                columns["kind"] = kinds_of(*ends, columns["instance"])
        triangles = bodies.faces.triangles
        columns = with_edges(columns, patches, near, (triangles.normal, triangles.offset))
        seen = (columns["length"] < 2.0 * bodies.reach) & (columns["kind"] != Kind.LEFT_OUT)
        self.blocks[place] = block = {name: column[seen] for name, column in columns.items()}
        self.num_rows += len(block["length"])
        other = np.flatnonzero(block["kind"] == Kind.REVERSED)
        if len(other):
            twins = {name: column[other] for name, column in block.items()}
            block["kind"][other] = Kind.TRACED
            self.blocks.append(reversed_rows(twins, twins["first_semantic"], Kind.REVERSED))
            self.num_rows += len(other)

    def finish(self) -> None:
        """Make the paths of all patches; the rows are gone then."""
        bodies, (tx, rx, _) = self.bodies, self.pair
        knobs, blocks = bodies.knobs, self.blocks
        start = np.concatenate([bodies.faces.part[:0], *(one.start for one in self.tracings)])
        num_tubes: Counter[int] = sum((one.tracer.count for one in self.tracings), Counter())
        if knobs.edge_diffraction and tx.window is None and rx.window is None:
            limit = knobs.max_patches
            edges = EdgeView(bodies.state, bodies.faces, bodies.rays, tx, rx, bodies.reach, self.size, limit)
            seen = np.unique(bodies.state.world.parts.instance[bodies.faces.part[start]]).tolist()
            blocks.append(edge_rows(edges, edges.pieces(seen, float(np.radians(knobs.crease_angle_deg)))))
        for depth, same_way in sorted(self.rough):
            pieces = self.rough.pop((depth, same_way))
            blocks += _scattered(pieces, knobs.seed, tx is rx and depth > 1, same_way)
        columns = joined(blocks, knobs.max_depth)
        amplitude = received(columns, bodies.radar, tx, rx)
        diagnostics: dict[str, Any] = {
            "method": "sbr",
            "settings": knobs.model_dump(),
            "max_distance": bodies.reach,
            "num_faces": len(start),
            "num_tubes": dict(num_tubes),
            "num_patches": len(columns["length"]),
        }
        if tx.window is None and rx.window is None:  # of what the radar itself sees
            wrong = Lit.of(one.tracer.checked for one in self.tracings).wrong()
            diagnostics["shadows_db"] = shadows_db(wrong, columns, bodies.radar, knobs.floor_db, self.has_reverse)
            warn_of_curves(bodies, columns)
            _warn_of_grazing(bodies, columns["cosine"], amplitude**2)
        columns, diagnostics["floor"] = above_floor(columns, amplitude, bodies.radar, knobs.floor_db)
        columns = in_order(columns)
        self.blocks, self.num_rows = [], len(columns["length"])
        diagnostics["seconds"] = time.perf_counter() - self.clock
        self.paths = _paths(columns, tx.pose, rx.pose, diagnostics)


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


def _scattered(pieces: list[Columns], seed: int, has_reverse: bool, same_way: bool) -> list[Columns]:
    """Return the columns of what rough patches of one depth scatter, and for a monostatic radar of the way back."""
    whole = {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}
    block = scattered_rows(whole, seed)
    if same_way:
        return [mirrored_back(block, Kind.ROUGH_SAME_WAY)]
    first = block.pop("first_semantic")
    if not has_reverse:
        return [block]
    return [block, reversed_rows(block, first, Kind.ROUGH_REVERSED)]


def _warn_of_bodies(bodies: Bodies, origin: Array, found: RadarPaths) -> None:
    """Warn once of bodies that are too small for physical optics, and once of parts that both scatter in one place."""
    state, radar, chosen = bodies.state, bodies.radar, bodies.instances
    levels = bodies.settings.warn_at
    small = []
    for number in chosen:
        info = state.world.instances[number]
        if float(info.size.max()) < levels.smallest_body * radar.wavelength and np.any(found.instance == number):
            small.append((info.name, float(info.size.max())))
    if small:
        warnings.warn(
            f"{len(small)} instance(s) in view are smaller than {levels.smallest_body:g} wavelengths, such as "
            f"'{small[0][0]}' ({1e3 * small[0][1]:.3g} mm); physical optics is wrong by decibels there: use "
            "method='scatterers' or point targets",
            ScarlWarning,
            stacklevel=4,
        )
    names, of_part = state.world.parts.name, state.world.parts.instance
    double = [o for o in seen_overlaps(state, origin) if {of_part[o.first], of_part[o.second]} <= set(chosen)]
    if double:
        first, second = names[double[0].first], names[double[0].second]
        warnings.warn(
            f"{len(double)} pair(s) of parts overlap in one plane, such as '{first}' and '{second}': both scatter, up "
            "to 6 dB too strong where they overlap; move one by 0.1 mm, or leave it out with instances=",
            ScarlWarning,
            stacklevel=4,
        )


def _warn_of_grazing(bodies: Bodies, cosine: Array, power: Array) -> None:
    """Warn where most of the power comes from patches met at less than a cosine of incidence."""
    least = bodies.settings.warn_at.grazing_incidence
    grazing = float(power[cosine < least].sum())
    if grazing > 0.5 * float(power.sum()):
        bodies.warn_once(
            "grazing",
            f"{100.0 * grazing / float(power.sum()):.0f} % of the patches' power comes from surfaces seen within "
            f"{np.degrees(np.arcsin(least)):.0f} deg of grazing, where diffraction, of which 'sbr' has "
            "none or that of single edges, is as strong; method='sionna' has mirror multipath there",
        )


def _paths(columns: Columns, tx: Pose, rx: Pose, diagnostics: dict[str, Any]) -> RadarPaths:
    step = np.arange(columns["instance"].shape[1])
    depth = columns["depth"]
    scatterer = scattering_bounce(columns)[:, None]
    interaction = np.where(step == scatterer, DIFFUSE, np.where(step < depth[:, None], SPECULAR, -1))
    bend = bend_of(columns["tx_point"] - tx.position, columns["tx_velocity"])
    bend += bend_of(columns["rx_point"] - rx.position, columns["rx_velocity"])
    changes: dict[str, Any] = {name: columns.get(name) for name in CHANGES}
    return RadarPaths(
        tx_point=columns["tx_point"],
        rx_point=columns["rx_point"],
        inner_length=np.zeros(len(depth)),
        a=columns["a"],
        length_rate=columns["length_rate"],
        length_acceleration=bend,
        instance=columns["instance"].astype(np.int32),
        interaction=interaction.astype(np.int32),
        depth=depth.astype(np.int32),
        semantic=columns["semantic"].astype(np.uint8),
        world_from_tx=tx,
        world_from_rx=rx,
        tx_velocity=columns["tx_velocity"],
        rx_velocity=columns["rx_velocity"],
        random_phase=np.isin(columns["kind"], ROUGH_KINDS),
        diagnostics=diagnostics,
        **changes,
    )
