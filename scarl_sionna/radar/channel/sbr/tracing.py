"""What tubes are traced for pairs of stations, and on which faces they start."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.radar.optics.patches import PatchSize
from scarl_sionna.radar.optics.spherical_waves import Tracer
from scarl_sionna.radar.optics.viewpoint import Viewpoint

from .bodies import Bodies

Index = npt.NDArray[np.int64]


class Pair(NamedTuple):
    """Two stations, which may be images of a radar, and on what the tubes between them start."""

    tx: Viewpoint
    rx: Viewpoint
    """The same object for a monostatic radar."""
    lit: Sequence[int] | None = None
    """Instances; all that scatter if left out."""


@dataclass(frozen=True, eq=False)
class Shared:
    """One tracing for some pairs with the same transmitter.

    Attributes
    ----------
    tracer : Tracer
        With one receiver for each of the pairs.
    start : ndarray of int64
        Faces on which its tubes start.
    pairs : tuple of int
        Numbers of the pairs.
    """

    tracer: Tracer
    start: Index
    pairs: tuple[int, ...]


def first_faces(bodies: Bodies, stations: Sequence[Viewpoint], lit: Sequence[int] | None = None) -> Index:
    """Return the faces that scatter and may be in the transmitter's view, those with the corners of another once.

    Parameters
    ----------
    bodies : Bodies
    stations : sequence of Viewpoint
        Transmitter and receivers.
    lit : sequence of int, optional
        Instances on which tubes start; all that scatter if left out.
    """
    faces, (tx, *receivers) = bodies.faces, stations
    apart = max(float(np.linalg.norm(tx.pose.position - rx.pose.position)) for rx in receivers)
    start = np.flatnonzero((bodies.scatters if lit is None else bodies.of(lit)) & ~faces.repeated)
    return start[tx.may_see(faces, start, bodies.reach + apart / 2.0)]  # the way there is at most half of it longer


def tracer_between(bodies: Bodies, stations: Sequence[Viewpoint]) -> Tracer:
    """Return the tracer of tubes from a transmitter to its receivers; use it inside :meth:`.Bodies.active`."""
    tx, *receivers = stations
    same_way = bodies.heard_the_same_way if tx.window is None and tx in receivers else None
    return Tracer(
        bodies.rays,
        bodies.faces,
        bodies.scatters,
        bodies.sheets,
        tx,
        tuple(receivers),
        bodies.reach,
        PatchSize.of(bodies.radar, bodies.knobs, bodies.settings.warn_at.wide_arm),
        bodies.knobs.for_scene(),
        bodies.panes,
        bodies.velocity,
        bodies.narrow,
        same_way,
        bodies.owner,
    )


def shared_tracings(bodies: Bodies, pairs: Sequence[Pair]) -> Iterator[Shared]:
    """Yield the tracings that serve some pairs: tubes from one place onto one instance are the same for all receivers.

    Parameters
    ----------
    bodies : Bodies
        What scatters.
    pairs : sequence of Pair
    """
    alike: dict[Hashable, list[int]] = {}
    for number, pair in enumerate(pairs):
        alike.setdefault(pair.tx.key, []).append(number)
    for numbers in alike.values():
        wanted: dict[int, list[int]] = {}
        for number in numbers:
            lit = pairs[number].lit
            for instance in bodies.instances if lit is None else lit:
                wanted.setdefault(instance, []).append(number)
        served: dict[tuple[int, ...], list[int]] = {}
        for instance, by in wanted.items():
            served.setdefault(tuple(by), []).append(instance)
        for some, instances in served.items():
            tx = pairs[some[0]].tx
            ends = (pairs[number].rx for number in some)
            stations = [tx, *(tx if rx.key == tx.key else rx for rx in ends)]
            yield Shared(tracer_between(bodies, stations), first_faces(bodies, stations, instances), some)
