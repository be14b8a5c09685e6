"""What is told of bodies in view whose curves are drawn too coarsely, or too unevenly."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .bodies import Bodies
    from .rows import Columns


def warn_of_curves(bodies: Bodies, columns: Columns) -> None:
    """Warn once of bodies in view that are drawn with too few faces for a curve, or with too uneven ones."""
    if not (bodies.coarse or bodies.uneven):
        return
    in_view = set(np.unique(columns["instance"]).tolist())
    names = bodies.state.world.instances
    coarse = {number: count for number, count in bodies.coarse.items() if number in in_view}
    if coarse:
        worst = max(coarse, key=lambda number: coarse[number])
        bodies.warn_once(
            "coarse faces",
            f"{len(coarse)} instance(s) in view consist of faces that bend by more than "
            f"{bodies.knobs.crease_angle_deg:g} deg from one to the next, such as "
            f"'{names[worst].name}' ({coarse[worst]} faces): they scatter as flat ones. If the "
            "body is round, draw it with 11 sides or more, or raise crease_angle_deg",
        )
    uneven = {number: told for number, told in bodies.uneven.items() if number in in_view}
    if uneven:
        worst = max(uneven, key=lambda number: uneven[number][1])
        count, error = uneven[worst]
        bodies.warn_once(
            "uneven faces",
            f"{len(uneven)} instance(s) in view have curves whose curvature changes more than 2.7 times from one "
            f"face to the next, such as '{names[worst].name}' ({count} faces, whose echo is right to some {error:.1f} "
            "dB): draw them with more sides",
        )
