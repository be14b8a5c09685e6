"""Parts of a road tunnel: lining with niches, portal, jet fans, luminaires, lane signals, signs and equipment.

The tunnel follows a road curve; offsets are to the left of its reference line, heights above the carriageway [m].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry.mesh import Array, Mesh, box, grid, merge, outward, revolve
from .road import RoadCurve
from .sweep import stations, sweep

LOWER = 2.8
"""Height of the upright lower wall [m]; niches and doors are cut into it."""


@dataclass(frozen=True)
class Bore:
    """Inner shape of a tunnel [m].

    Half width between the walls, whether it is an arch, height of the crown or ceiling, and of the walkway.
    """

    half: float
    is_arch: bool
    height: float
    walkway: float
    kerb: float = 0.15

    def upper(self, segments: int = 14) -> Array:
        """Return the upper profile from the left wall to the right one, shape (n, 2)."""
        if not self.is_arch:
            return np.array(
                [(self.half, LOWER), (self.half, self.height), (-self.half, self.height), (-self.half, LOWER)]
            )
        angle = np.linspace(0.0, np.pi, segments + 1)
        return np.column_stack([self.half * np.cos(angle), LOWER + (self.height - LOWER) * np.sin(angle)])

    def ceiling(self, offset: float) -> float:
        """Return the height of the lining above an offset."""
        if not self.is_arch:
            return self.height
        return LOWER + (self.height - LOWER) * float(np.sqrt(1.0 - (offset / self.half) ** 2))


@dataclass(frozen=True)
class Opening:
    """A niche or a door recess in a wall: side (+1 left), from, to (arc length), height and depth [m]."""

    side: int
    start: float
    stop: float
    height: float
    depth: float


def lower_wall(
    curve: RoadCurve, start: float, stop: float, bore: Bore, side: int, openings: Sequence[Opening]
) -> tuple[Mesh, Mesh | None]:
    """Return the lower wall of one side, and the insides of its niches (None without)."""
    d = side * bore.half
    own = sorted((o for o in openings if o.side == side), key=lambda o: o.start)

    def upright(a: float, b: float, low: float, high: float, offset: float) -> Mesh:
        profile = np.array([(offset, low), (offset, high)])[::side]
        s = stations(curve, a, b)
        mesh = sweep(curve, s, profile)
        along, height = np.broadcast_arrays(s[:, None] / 5.0, profile[None, :, 1] / LOWER)
        return Mesh(mesh.vertices, mesh.faces, np.stack([along, height], -1).reshape(-1, 2))

    wall, inside, at = [], [], start
    for o in own:
        wall += [upright(at, o.start, 0.0, LOWER, d), upright(o.start, o.stop, o.height, LOWER, d)]
        back = d + side * o.depth
        inside.append(upright(o.start, o.stop, 0.0, o.height, back))
        for s, flip in ((o.start, side < 0), (o.stop, side > 0)):
            corners = curve.point(
                np.full((2, 2), s), np.array([[d, back], [d, back]]), np.array([[0.0, 0.0], [o.height, o.height]])
            )
            jamb = grid(corners, np.array([[(0, 0), (o.depth, 0)], [(0, o.height), (o.depth, o.height)]]) / LOWER)
            inside.append(jamb.flipped() if flip else jamb)
        s = np.array([o.start, o.stop])
        inside.append(sweep(curve, s, np.array([(back, o.height), (d, o.height)])[::side], (5.0, 5.0)))
        inside.append(sweep(curve, s, np.array([(d, bore.kerb), (back, bore.kerb)])[::side], (5.0, 5.0)))
        at = o.stop
    wall.append(upright(at, stop, 0.0, LOWER, d))
    return merge(wall), merge(inside) if inside else None


def portal(
    curve: RoadCurve, s: float, bore: Bore, outwards: int, half: float = 22.0, top: float = 9.0, thickness: float = 0.7
) -> Mesh:
    """Return a portal wall with the tunnel's mouth, facing against the road (`outwards` -1) or along it (+1)."""
    upper = bore.upper(14)
    inner = np.vstack([(bore.half, -0.3), upper, (-bore.half, -0.3)])
    # the outer edge: seen from the middle of the mouth, where the ray leaves the wall's rectangle
    centre = np.array([0.0, 0.5 * LOWER])
    ray = inner[1:-1] - centre
    with np.errstate(divide="ignore"):
        reach = np.minimum(
            half / np.maximum(np.abs(ray[:, 0]), 1e-9),
            np.where(ray[:, 1] > 1e-9, (top - centre[1]) / np.maximum(ray[:, 1], 1e-9), np.inf),
        )
    outer = np.vstack([(half, -0.3), centre + reach[:, None] * ray, (-half, -0.3)])
    for corner in (1, -1):  # the corners of the rectangle
        k = int(np.argmin(np.hypot(outer[:, 0] - corner * half, outer[:, 1] - top)))
        outer[k] = (corner * half, top)
    face, other = s + outwards * thickness, s
    parts = []
    for at, flip in ((face, outwards > 0), (other, outwards < 0)):
        line = np.stack([inner, outer])
        plane = grid(curve.point(np.full(line.shape[:2], at), line[..., 0], line[..., 1]), line / 4.0)
        parts.append(plane if flip else plane.flipped())
    for ring, flip in ((inner, outwards < 0), (outer, outwards > 0)):
        edge = sweep(curve, np.array([face, other]), ring, (4.0, 4.0))
        parts.append(edge.flipped() if flip else edge)
    return merge(parts)


def jet_fan(segments: int = 20, length: float = 3.2, radius: float = 0.45) -> dict[str, Mesh]:
    """Return ``case`` and ``core`` of a jet fan along x with hangers, its axis at the origin."""
    x = length / 2
    bell, throat = radius * 1.06, radius * 0.9
    profile = np.array(
        [
            (throat, -x * 0.96),
            (bell, -x),
            (radius, -x * 0.9),
            (radius, x * 0.9),
            (bell, x),
            (throat, x * 0.96),
            (throat, 0.0),
        ]
    )
    profile = np.vstack([profile, profile[:1]])
    shell = outward(revolve(profile, segments, "x"))
    hub = np.array([(0.001, -0.7), (0.12, -0.55), (0.17, -0.3), (0.17, 0.3), (0.12, 0.55), (0.001, 0.7)])
    blades = [box((0.05, throat * 1.98, 0.14))]
    hangers = [box((0.06, 0.05, 0.6), (px, py, radius + 0.2)) for px in (-x * 0.6, x * 0.6) for py in (-0.3, 0.3)]
    plain = [Mesh(m.vertices, m.faces) for m in (shell, *hangers)]
    return {
        "case": merge(plain),
        "core": merge([Mesh(m.vertices, m.faces) for m in (outward(revolve(hub, 12, "x")), *blades)]),
    }


def luminaire(length: float = 1.5) -> dict[str, Mesh]:
    """Return ``case`` and ``glass`` of a luminaire along x; its top is at the origin, light goes down."""
    corners = np.array(
        [
            [(-length / 2, -0.14, -0.121), (-length / 2, 0.14, -0.121)],
            [(length / 2, -0.14, -0.121), (length / 2, 0.14, -0.121)],
        ]
    )
    return {"case": box((length + 0.08, 0.34, 0.12), (0.0, 0.0, -0.06)), "glass": grid(corners).flipped()}


def lane_signal() -> dict[str, Mesh]:
    """Return ``case``, ``front`` and ``hanger`` of a lane signal over a lane that faces -x.

    Its lower edge is at the origin.
    """
    plate = np.array([[(-0.161, -0.4, 0.05), (-0.161, 0.4, 0.05)], [(-0.161, -0.4, 0.85), (-0.161, 0.4, 0.85)]])
    uv = np.array([[(1.0, 1.0), (0.0, 1.0)], [(1.0, 0.0), (0.0, 0.0)]])
    hanger = merge([box((0.05, 0.05, 1.2), (0.0, y, 1.5)) for y in (-0.3, 0.3)])
    return {"case": box((0.32, 0.9, 0.9), (0.0, 0.0, 0.45)), "front": grid(plate, uv).flipped(), "hanger": hanger}


def lane_arrow() -> dict[str, Mesh]:
    """Return ``green``: the lit arrow of a lane signal, pointing down, to be placed where the signal is."""
    x = -0.165
    outline = np.array(
        [(-0.06, 0.75), (0.06, 0.75), (0.06, 0.42), (0.24, 0.42), (0.0, 0.14), (-0.24, 0.42), (-0.06, 0.42)]
    )
    points = np.column_stack([np.full(len(outline), x), outline])
    faces = np.array(
        [
            (0, 1, 2),
            (0, 2, 6),
            (3, 4, 5),
        ]
    )
    return {"green": Mesh(points, faces[:, ::-1].astype(np.int64))}


def lane_cross() -> dict[str, Mesh]:
    """Return ``red``: the lit cross of a closed lane, to be placed where the signal is."""
    bars = []
    for turn in (np.pi / 4, -np.pi / 4):
        c, s = np.cos(turn), np.sin(turn)
        flat = np.array([(-0.36, -0.05), (0.36, -0.05), (0.36, 0.05), (-0.36, 0.05)]) @ np.array([[c, s], [-s, c]]) + (
            0.0,
            0.45,
        )
        bars.append(Mesh(np.column_stack([np.full(4, -0.165), flat]), np.array([(2, 1, 0), (3, 2, 0)])))
    return {"red": merge(bars)}


def cabinet() -> dict[str, Mesh]:
    """Return ``box``, ``door`` and ``sign`` of an emergency cabinet that stands at x = 0 and faces +x, for a niche."""
    front = np.array([[(0.205, -0.22, 0.75), (0.205, 0.22, 0.75)], [(0.205, -0.22, 1.65), (0.205, 0.22, 1.65)]])
    uv = np.array([[(0.0, 1.0), (1.0, 1.0)], [(0.0, 0.0), (1.0, 0.0)]])
    return {
        "box": merge([box((0.2, 0.55, 1.0), (0.1, 0.0, 1.2)), box((0.24, 0.12, 0.3), (0.12, 0.5, 0.9))]),
        "door": grid(front, uv),
        "sign": box((0.02, 0.4, 0.4), (0.03, 0.0, 2.05)),
    }


def exit_door() -> dict[str, Mesh]:
    """Return ``leaf``, ``frame`` and ``handle`` of a fire door 1.1 m wide that stands at x = 0 and faces +x."""
    frame = [box((0.1, 0.1, 2.15), (0.0, y, 1.075)) for y in (-0.6, 0.6)] + [box((0.1, 1.3, 0.1), (0.0, 0.0, 2.2))]
    return {
        "leaf": box((0.05, 1.1, 2.15), (0.0, 0.0, 1.075)),
        "frame": merge(frame),
        "handle": box((0.07, 0.9, 0.05), (0.06, 0.0, 1.05)),
    }


def box_sign(width: float = 0.6, height: float = 0.6) -> dict[str, Mesh]:
    """Return ``case`` and ``faces`` of a lit sign that stands out from a wall.

    It reaches from the origin to +y, faces +-x.
    """
    faces = []
    for x, flip in ((-0.061, False), (0.061, True)):
        corners = np.array([[(x, 0.05, 0.0), (x, 0.05 + width, 0.0)], [(x, 0.05, height), (x, 0.05 + width, height)]])
        uv = np.array([[(1.0, 1.0), (0.0, 1.0)], [(1.0, 0.0), (0.0, 0.0)]])
        if flip:
            uv[..., 0] = 1.0 - uv[..., 0]
        plate = grid(corners, uv)
        faces.append(plate if flip else plate.flipped())
    return {
        "case": box((0.12, width + 0.04, height + 0.04), (0.0, 0.05 + width / 2, height / 2)),
        "faces": merge(faces),
    }
