"""Chains of mirrors from a radar back to itself, by images of the radar: no rays look for candidates."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.paths.tracing import NONE, SPECULAR, TracedPaths
from scarl_sionna.radar.channel.multipath.columns import joined_columns, mirror_columns
from scarl_sionna.radar.channel.multipath.images import Chain
from scarl_sionna.radar.channel.multipath.legs import Legs, legs_of
from scarl_sionna.radar.channel.multipath.station import EndPoints, points_beside, station_of
from scarl_sionna.radar.channel.multipath.visibility import warn_of_hidden_antennas
from scarl_sionna.radar.channel.range_end import within_reach
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.tuned import material_frequency

from .mirror_legs import MirrorView
from .mirrors import Mirror, Way, beyond_ends

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

MOST_CHAINS = 500_000
"""Chains that are looked at, at most: 0.5 s of CPU time; bounds the time."""
MOST_MIRRORS = 64
"""Mirrors that are looked at, at most, the largest ones: bounds the time."""
_PIECE = 100_000
"""Chains that are looked at together: bounds the memory, changes no result."""
_MARGIN = 0.1
"""Boxes of mirrors are widened by this where chains are sorted out before rays are cast [m]: more than the points
beside the radar are from it. Decides no accuracy."""


def most_mirrors(depth: int) -> int:
    """Return how many mirrors chains of up to `depth` reflections may be made of."""
    return next(count for count in range(MOST_MIRRORS, 0, -1) if _num_chains(count, depth) <= MOST_CHAINS or count == 2)


def _num_chains(num_mirrors: int, depth: int) -> int:
    """Return how many sequences of up to `depth` mirrors there are without the same one twice in a row."""
    return sum(num_mirrors * (num_mirrors - 1) ** (length - 1) for length in range(1, depth + 1))


def mirror_chains(view: MirrorView, depth: int, reach: float, wide_arm: float) -> RadarPaths:
    """Return the paths from a radar over the mirrors of a view back to itself.

    Parameters
    ----------
    view : MirrorView
        With no instances of its own: everything hides.
    depth : int
        Most reflections.
    reach : float
        Half of the longest length [m].
    wide_arm : float
        Visibility is tested for antennas if one is farther than this from the array's centre [m].

    Returns
    -------
    RadarPaths
        As :func:`~scarl_sionna.radar.channel.multipath.solve.solve_sionna` gives them for flat faces larger than their
        Fresnel zone, where its rays find them. ``diagnostics`` has the numbers of mirrors and of chains of them that
        were looked at, and how many paths antennas far from the array's centre do not see.

    Raises
    ------
    MaterialRangeError
        If a mirror's material has no data in the middle of the band.

    Warns
    -----
    ScarlWarning
        If antennas of a wide array do not see a path.

    Notes
    -----
    The image of the radar by a chain of planes gives the only points at which they can reflect; the chain is a path if
    each point is on its mirror and nothing is in between. Into a corner of 90 deg and back these points are one, on the
    edge: there the chain is a path if it leads to one of three points 5 cm beside the radar.
    """
    state, mount, radar = view.state, view.mount, view.radar
    station = station_of(mount, radar)
    ends = np.concatenate([station.position[None], points_beside(state, station.position, "optical")])
    shown: list[Way] = []
    possible = possible_chains(view.mirrors, station.position, depth, reach, view.tail)
    for _, group in groupby(possible, key=len):  # shorter ones come first
        some = list(group)
        rows = np.repeat([[mirror.number for mirror in way] for way in some], len(ends), axis=0)
        seen = view.shows(rows, np.tile(ends, (len(some), 1))).reshape(len(some), -1)
        shown += [way for way, ok in zip(some, seen, strict=True) if ok.any()]
    shown.sort(key=lambda way: (len(way), [mirror.part for mirror in way]))  # of equal paths the first stays
    arm = float(np.linalg.norm(station.arms, axis=1).max(initial=0.0))
    legs = legs_of(
        state,
        _as_traced(view, shown, depth),
        station,
        EndPoints(station.position[None], station.velocity[None], station.rotation, is_station=True),
        material_frequency(radar),
        arm / 2.0 if arm > wide_arm else 0.0,
    )
    num_hidden = warn_of_hidden_antennas(state, [(legs, station)], wide_arm)
    legs = _with_ends(view, legs)
    columns = joined_columns([mirror_columns(state, legs, station, station, radar.wavelength)])
    columns.pop("total")
    paths = RadarPaths(
        band=None,
        **columns,
        world_from_tx=mount.pose,
        world_from_rx=mount.pose,
        tx_twist=mount.twist,
        rx_twist=mount.twist,
        diagnostics={
            "num_mirrors": len(view.mirrors),
            "num_chains": _num_chains(len(view.mirrors), depth),
            "num_hidden_from_antennas": num_hidden,
        },
    )
    return within_reach(paths, reach)


def _with_ends(view: MirrorView, legs: Legs) -> Legs:
    """Return chains with what the ends of their mirrors leave of them; those of several mirrors have no ends."""
    rows = np.flatnonzero(legs.depth == 1)
    if view.ends is None or not len(rows):
        return legs
    face = view.state._triangles.first[legs.part[rows, 0]] + legs.face[rows, 0]
    number = [next(mirror.number for mirror in view.mirrors if one in mirror.faces) for one in face]
    ways = np.array(number, dtype=np.int64)[:, None]
    at = view.reflections(ways, np.broadcast_to(view.station.position, (len(rows), 3)))
    weight = np.ones(len(legs.length), dtype=np.complex128)
    weight[rows] = view.ends.weight(at)
    over = {name: getattr(legs, name) * weight[:, None, None, None] for name in ("slope", "end_slope")}
    return replace(legs, transfer=legs.transfer * weight[:, None, None], **over).select(weight != 0.0)


def possible_chains(
    mirrors: Sequence[Mirror], position: Array, depth: int, reach: float, tail: float = 0.0
) -> Iterator[Way]:
    """Yield the chains from a position back to itself that meet the boxes of their mirrors in the right order.

    They are shorter than twice `reach` [m]; whether the mirrors fill their boxes, and what hides them, is open. `tail`
    is that of :func:`~.mirrors.beyond_ends`.
    """
    normal = np.array([mirror.normal for mirror in mirrors]).reshape(-1, 3)
    offset = np.array([mirror.offset for mirror in mirrors])
    lower = np.array([mirror.corners.min(axis=0) for mirror in mirrors]).reshape(-1, 3) - _MARGIN
    upper = np.array([mirror.corners.max(axis=0) for mirror in mirrors]).reshape(-1, 3) + _MARGIN
    for chains in _chains(len(mirrors), depth):
        flat = np.ones(chains.shape, dtype=np.bool_)
        chain = Chain(flat, ~flat, normal[chains], offset[chains])
        images = chain.images(position)
        length = np.linalg.norm(images[:, 0] - position, axis=1)
        near = np.flatnonzero((length > 1e-6) & (length < 2.0 * reach))
        chain = Chain(flat[near], ~flat[near], normal[chains[near]], offset[chains[near]])
        points, right = chain.vertices(position, images[near])
        several = chains.shape[1] > 1  # they end sharply
        beyond = beyond_ends(chain, position, points, position, 0.0 if several else tail)[..., None]
        right &= ((points >= lower[chains[near]] - beyond) & (points <= upper[chains[near]] + beyond)).all(axis=(1, 2))
        for row in chains[near[right]]:
            yield tuple(mirrors[number] for number in row)


def _chains(num_mirrors: int, depth: int) -> Iterator[Index]:
    """Yield all sequences of 1, 2, .. `depth` mirrors without the same one twice in a row, (n, length), in pieces."""
    number = np.arange(num_mirrors)
    pieces = [number[:, None]] if num_mirrors else []
    for _ in range(depth):
        yield from pieces
        longer = []
        for piece in pieces:
            wide = np.column_stack([np.repeat(piece, num_mirrors, axis=0), np.tile(number, len(piece))])
            wide = wide[wide[:, -1] != wide[:, -2]]
            longer += np.array_split(wide, -(-len(wide) // _PIECE)) if len(wide) else []
        pieces = longer


def _as_traced(view: MirrorView, ways: Sequence[Way], depth: int) -> TracedPaths:
    """Return chains as a tracer gives them: each with the planes of the very triangles that it meets."""
    state, count = view.state, len(ways)
    position, triangles = view.station.position, state._triangles
    kind = np.full((count, depth), NONE, dtype=np.int32)
    part, face = np.full((count, depth), -1, dtype=np.int64), np.full((count, depth), -1, dtype=np.int64)
    vertex, normal, offset = np.zeros((count, depth, 3)), np.zeros((count, depth, 3)), np.zeros((count, depth))
    for row, way in enumerate(ways):
        chain = view.chain(np.array([[mirror.number for mirror in way]]))
        points, _ = chain.vertices(position, chain.images(position))
        for k, (mirror, point) in enumerate(zip(way, points[0], strict=True)):
            met = mirror.triangle_at(point)
            kind[row, k], part[row, k], face[row, k] = SPECULAR, mirror.part, met - triangles.first[mirror.part]
            vertex[row, k], normal[row, k], offset[row, k] = point, triangles.normal[met], triangles.offset[met]
    return TracedPaths(
        np.zeros(count, np.int64), kind, part, face, vertex, normal, offset, np.zeros((count, 2, 2), complex), 0, False
    )
