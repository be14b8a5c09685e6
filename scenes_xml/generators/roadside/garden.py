"""Things of streets and gardens: fences, walls, bins, manhole covers, post boxes.

Foot at the origin, or along a line on the ground.
"""

from __future__ import annotations

import numpy as np

from ..geometry.mesh import Array, Mesh, box, extrude, grid, merge, outward, revolve, tube
from ..geometry.polygon import length_along, resample, shifted


def _plain(part: Mesh) -> Mesh:
    return Mesh(part.vertices, part.faces)


def _along(line: Array, step: float) -> list[tuple[Array, float]]:
    """Return places at even steps along a line, shape (n, 3), with the direction there [rad]."""
    even = resample(np.asarray(line, float), step)
    heading = np.arctan2(*np.gradient(even[:, :2], axis=0).T[::-1])
    return list(zip(even, heading, strict=True))


def picket_fence(line: Array, height: float = 0.95, gap: float = 0.14) -> Mesh:
    """Return a fence of pointed laths on two rails with posts, along a line, shape (n, 3) [m]."""
    outline = np.array([(-0.04, 0.06), (0.04, 0.06), (0.04, height - 0.06), (0.0, height), (-0.04, height - 0.06)])
    lath = extrude(outline, -0.011, 0.011)
    lath = Mesh(lath.vertices[:, [0, 2, 1]], lath.faces[:, ::-1])
    parts = [lath.moved(place, turn) for place, turn in _along(line, gap)]
    parts += [
        box((0.09, 0.09, height + 0.25)).moved(place + _behind(turn, 0.09) + [0, 0, 0.5 * height - 0.1], turn)
        for place, turn in _along(line, 2.2)
    ]
    parts += [_rail(line, z, 0.035, 0.07, 0.031) for z in (0.25, height - 0.22)]
    return merge([_plain(p) for p in parts])


def _behind(turn: float, away: float) -> Array:
    return np.array([-np.sin(turn) * away, np.cos(turn) * away, 0.0])


def _rail(line: Array, z: float, thick: float, high: float, away: float) -> Mesh:
    """Return a bar of `thick` x `high` along a line at height `z`, its middle `away` to the left."""
    line = resample(np.asarray(line, float), 1.5)
    ring = np.array([(-thick / 2, -high / 2), (-thick / 2, high / 2), (thick / 2, high / 2), (thick / 2, -high / 2)])
    points = np.stack([np.column_stack([shifted(line, away + d), line[:, 2] + z + h]) for d, h in ring], 1)
    body = grid(points, close_columns=True)
    caps = [grid(np.stack([points[end, :2], points[end, :1:-1]])) for end in (0, -1)]
    return outward(merge([body, caps[0], caps[1].flipped()]))


def panel_fence(line: Array, height: float = 1.8) -> tuple[Mesh, Mesh]:
    """Return boards (uv in 1.2 m) and posts of a close fence along a line, shape (n, 3) [m]."""
    line = resample(np.asarray(line, float), 2.0)
    low, high = line[:, 2] + 0.05, line[:, 2] + height
    s = length_along(line[:, :2]) / 1.2
    sides = []
    for d, flip in ((0.012, True), (-0.012, False)):
        points = np.stack([np.column_stack([shifted(line, d), z]) for z in (low, high)], 1)
        uv = np.stack([np.column_stack([s, np.full(len(line), v)]) for v in (0.0, height / 1.2)], 1)
        part = grid(points, uv)
        sides.append(part.flipped() if flip else part)
    top = np.stack([np.column_stack([shifted(line, d), high]) for d in (-0.012, 0.012)], 1)
    sides.append(grid(top, np.zeros((len(line), 2, 2))))
    posts = [
        box((0.10, 0.10, height + 0.35)).moved(p + [0, 0, 0.5 * height - 0.12], turn) for p, turn in _along(line, 2.0)
    ]
    return merge(sides), merge([_plain(p) for p in posts])


def garden_wall(line: Array, height: float = 0.6, thick: float = 0.24) -> tuple[Mesh, Mesh]:
    """Return the wall (uv in 1.5 m) and its coping along a line, shape (n, 3) [m]."""
    line = resample(np.asarray(line, float), 1.0)
    s = length_along(line[:, :2])
    faces = []
    for d, flip in ((thick / 2, True), (-thick / 2, False)):
        points = np.stack([np.column_stack([shifted(line, d), line[:, 2] + z]) for z in (-0.3, height)], 1)
        uv = np.stack([np.column_stack([s, np.full(len(line), z)]) for z in (-0.3, height)], 1) / 1.5
        part = grid(points, uv)
        faces.append(part.flipped() if flip else part)
    for end, flip in ((0, False), (-1, True)):
        sides = [np.append(shifted(line, d)[end], 0.0) for d in (thick / 2, -thick / 2)]
        corners = np.array([[p + [0, 0, line[end, 2] + z] for z in (-0.3, height)] for p in sides])
        part = grid(corners, np.array([[(d, z) for z in (-0.3, height)] for d in (0.0, thick)]) / 1.5)
        faces.append(part.flipped() if flip else part)
    return merge(faces), _rail(line, height + 0.03, thick + 0.08, 0.06, 0.0)


def wire_fence(line: Array, height: float = 1.15, spacing: float = 3.0, wires: int = 4) -> tuple[Mesh, Mesh]:
    """Return the wooden posts and the wires of a field fence along a line, shape (n, 3) [m]."""
    line = np.asarray(line, float)
    posts = []
    for k, (place, turn) in enumerate(_along(line, spacing)):
        z = np.array([-0.4, 0.0, 0.7 * height, height + 0.1])
        lean = 0.03 * np.sin(1.7 * k)
        posts.append(
            tube(np.column_stack([lean * z, 0 * z, z]), np.array([0.06, 0.06, 0.057, 0.052]), 8).moved(place, turn)
        )
    even = resample(line, spacing)
    threads = [_rail(even, height * (k + 1) / wires - 0.04, 0.006, 0.006, 0.055) for k in range(wires)]
    return merge(posts), merge(threads)


def rail_fence(line: Array, height: float = 1.2) -> Mesh:
    """Return a paddock fence of posts and three boards along a line, shape (n, 3) [m]."""
    parts = [
        box((0.12, 0.10, height + 0.5)).moved(p + [0, 0, 0.5 * height - 0.2], turn) for p, turn in _along(line, 2.6)
    ]
    parts += [_rail(line, height * share, 0.03, 0.14, 0.066) for share in (0.3, 0.62, 0.93)]
    return merge([_plain(p) for p in parts])


def bin_on_wheels() -> dict[str, Mesh]:
    """Return ``tub``, ``lid`` and ``wheels`` of a waste bin of 240 l that faces -x."""
    low = np.array([(-0.22, -0.20), (0.24, -0.20), (0.24, 0.20), (-0.22, 0.20)])
    high = np.array([(-0.35, -0.28), (0.29, -0.28), (0.29, 0.28), (-0.35, 0.28)])
    rings = [np.column_stack([low, np.full(4, 0.06)]), np.column_stack([high, np.full(4, 0.95)])]
    floor = grid(np.stack([rings[0][[0, 1]], rings[0][[3, 2]]]))
    tub = merge([grid(np.stack(rings), close_columns=True).flipped(), floor])
    lid_line = np.array([(-0.40, 0.95), (-0.40, 0.98), (-0.1, 1.06), (0.2, 1.07), (0.33, 1.02), (0.33, 0.95)])
    lid = extrude(lid_line, -0.30, 0.30)
    lid = outward(Mesh(lid.vertices[:, [0, 2, 1]], lid.faces))
    profile = np.array([(0.001, 0.0), (0.10, 0.0), (0.10, 0.05), (0.001, 0.05)])[::-1]
    wheel = outward(revolve(profile, 14, "y"))
    wheels = merge(
        [wheel.moved((0.24, y, 0.10)) for y in (-0.27, 0.22)] + [_plain(box((0.05, 0.5, 0.04), (0.36, 0.0, 0.93)))]
    )
    return {"tub": tub, "lid": lid, "wheels": wheels}


def manhole_cover(radius: float = 0.32, height: float = 0.004) -> Mesh:
    """Return a cast cover that stands `height` [m] above the road; uv over its square."""
    angle = np.linspace(0.0, 2 * np.pi, 37)[:-1]
    ring = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    rim = np.column_stack([ring, np.full(36, height)])
    k = np.arange(36)
    fan = np.stack([k, (k + 1) % 36, np.full(36, 36)], 1).astype(np.int64)
    top = np.vstack([rim, [[0.0, 0.0, height]]])
    plate = Mesh(top, fan, 0.5 + 0.5 * top[:, :2] / radius)
    foot = np.column_stack([1.01 * ring, np.full(36, -0.02)])
    side = grid(np.stack([foot, rim]), np.tile(0.5 + 0.5 * ring / radius, (2, 1, 1)), close_columns=True).flipped()
    return merge([plate, side])


def gully_grate(length: float = 0.5, width: float = 0.3) -> Mesh:
    """Return the bars of a gully along x, 3 mm above the road."""
    bars = [box((length, 0.02, 0.02), (0.0, y, -0.007)) for y in np.linspace(-width / 2, width / 2, 7)]
    bars += [box((0.025, width + 0.02, 0.018), (x, 0.0, -0.007)) for x in (-length / 2, length / 2)]
    return merge([_plain(b) for b in bars])


def letter_box() -> dict[str, Mesh]:
    """Return ``box`` and ``post`` of a letter box on a post that faces -x."""
    outline = np.array([(-0.10, 0.95), (0.10, 0.95), (0.10, 1.28), (0.03, 1.36), (-0.10, 1.30)])
    case = extrude(outline, -0.19, 0.19)
    return {
        "box": outward(Mesh(case.vertices[:, [0, 2, 1]], case.faces)),
        "post": _plain(box((0.06, 0.06, 1.25), (0.02, 0.0, 0.325))),
    }
