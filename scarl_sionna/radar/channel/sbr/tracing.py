"""The tracer of a solve, and the faces on which its tubes start."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from scarl_sionna.radar.optics.patches import PatchSize
from scarl_sionna.radar.optics.spherical_waves import Tracer, Viewpoint

from .bodies import Bodies

Index = npt.NDArray[np.int64]


def first_faces(bodies: Bodies, stations: tuple[Viewpoint, Viewpoint], lit: Sequence[int] | None = None) -> Index:
    """Return the faces that scatter and may be in the transmitter's view, those with the corners of another once.

    Parameters
    ----------
    bodies : Bodies
    stations : tuple of two Viewpoint
        Transmitter and receiver.
    lit : sequence of int, optional
        Instances on which tubes start; all that scatter if left out.
    """
    faces, (tx, rx) = bodies.faces, stations
    apart = float(np.linalg.norm(tx.pose.position - rx.pose.position))  # the way there is at most half of it longer
    start = np.flatnonzero((bodies.scatters if lit is None else bodies.of(lit)) & ~faces.repeated)
    return start[tx.may_see(faces, start, bodies.reach + apart / 2.0)]


def tracer_between(bodies: Bodies, stations: tuple[Viewpoint, Viewpoint]) -> Tracer:
    """Return the tracer of tubes between two stations; use it inside :meth:`.Bodies.active`."""
    return Tracer(
        bodies.rays,
        bodies.faces,
        bodies.scatters,
        bodies.sheets,
        *stations,
        bodies.reach,
        PatchSize.of(bodies.radar, bodies.knobs),
        bodies.knobs.for_scene(),
        bodies.panes,
        bodies.velocity,
        bodies.narrow,
    )
