"""Things beside a road: delineator posts, signs, lamp posts, concrete barriers.

Local frames: foot at the origin; what faces a driver faces -x (the driver travels along +x).
"""

from __future__ import annotations

import numpy as np

from ..geometry.mesh import Array, Mesh, box, extrude, grid, merge, outward, revolve, signed_volume, tube


def delineator() -> dict[str, Mesh]:
    """Return ``post``, ``band`` and ``reflector`` of a 1 m delineator post with a slanted top and a dark band."""
    angle = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    section = np.column_stack([0.045 * np.sign(np.cos(angle)) * np.abs(np.cos(angle)) ** 0.7, 0.06 * np.sin(angle)])

    post = extrude(section, -0.3, 1.02)
    slanted = post.vertices.copy()
    slanted[:, 2] += 0.35 * slanted[:, 1] * (slanted[:, 2] > 0.5)
    band = extrude(section * 1.03, 0.70, 0.94)
    tilted = band.vertices.copy()
    tilted[:, 2] += 0.6 * tilted[:, 1]
    faces = [box((0.008, 0.045, 0.16), (x, 0.0, 0.82)) for x in (-0.049, 0.049)]
    return {"post": Mesh(slanted, post.faces), "band": Mesh(tilted, band.faces), "reflector": merge(faces)}


def _face(outline: Array, z: float, x: float, thickness: float = 0.012) -> tuple[Mesh, Mesh]:
    """Return the printed front (at -x) and the rest of a flat sign.

    `outline` (n, 2) in y and z about its middle [m].
    """
    outline = np.asarray(outline, float)
    n = len(outline)
    ring = np.column_stack([np.full(n, x - thickness), outline[:, 0], outline[:, 1] + z])
    centre = np.array([[x - thickness, *(outline.mean(0) + [0.0, z])]])
    k = np.arange(n)
    fan = np.stack([(k + 1) % n, k, np.full(n, n)], 1).astype(np.int64)
    span = np.ptp(outline, axis=0)
    low = outline.min(0)
    flat = np.vstack([outline, outline.mean(0)])
    uv = 1.0 - (flat - low) / span  # v = 0 is the upper edge of an image
    front = Mesh(np.vstack([ring, centre]), fan, uv)
    back = ring + [thickness, 0.0, 0.0]
    rim = grid(np.stack([ring, back]), close_columns=True)
    back_centre = centre + [thickness, 0.0, 0.0]
    rear = Mesh(np.vstack([back, back_centre]), fan[:, ::-1].copy())
    closed = merge([Mesh(front.vertices, front.faces), rim, rear])
    if signed_volume(closed) < 0.0:
        front, rim, rear = front.flipped(), rim.flipped(), rear.flipped()
    return front, merge([rim, rear])


def sign(kind: str, height: float = 2.15) -> dict[str, Mesh]:
    """Return ``face``, ``back`` and ``pole`` of a sign: ``round``, ``triangle``, ``square`` or ``board``.

    `height` of its middle [m].
    """
    if kind == "round":
        angle = np.linspace(0, 2 * np.pi, 36, endpoint=False)
        outline = 0.32 * np.column_stack([np.cos(angle), np.sin(angle)])
    elif kind == "triangle":
        side, r = 0.90, 0.05
        tips = np.array([(-0.5, -0.39), (0.5, -0.39), (0.0, 0.476)]) * side
        arcs = []
        for tip, start in zip(tips, (210.0, 330.0, 90.0), strict=True):
            angle = np.radians(start + np.linspace(-60, 60, 6))
            inward = -tip / np.linalg.norm(tip) * 2 * r
            arcs.append(tip + inward + r * np.column_stack([np.cos(angle), np.sin(angle)]))
        outline = np.concatenate(arcs)
    elif kind == "square":
        outline = np.array([(-0.32, -0.32), (0.32, -0.32), (0.32, 0.32), (-0.32, 0.32)])
    elif kind == "board":
        outline = np.array([(-0.75, -0.1875), (0.75, -0.1875), (0.75, 0.1875), (-0.75, 0.1875)])
    else:
        raise ValueError(f"unknown sign kind {kind!r}; choose round, triangle, square or board")
    front, back = _face(outline, height, -0.042)
    feet = (-0.5, 0.5) if kind == "board" else (0.0,)
    top = height + outline[:, 1].max() - 0.02
    poles = [tube(np.array([(0.0, y, -0.3), (0.0, y, 0.5 * top), (0.0, y, top)]), 0.038, 12) for y in feet]
    clamps = [box((0.05, 0.10, 0.03), (-0.022, y, height + dz)) for y in feet for dz in (-0.12, 0.12)]
    return {
        "face": front,
        "back": back,
        "pole": merge([*(Mesh(p.vertices, p.faces) for p in poles), *(Mesh(c.vertices, c.faces) for c in clamps)]),
    }


def lamp_post(height: float = 8.0, reach: float = 1.8) -> dict[str, Mesh]:
    """Return ``pole``, ``head`` and ``glass`` of a lamp post whose arm reaches towards +y [m]."""
    bend = np.radians(np.linspace(0, 80, 8))
    r = 1.0
    arc = np.column_stack([np.zeros(8), r * (1 - np.cos(bend)), height - r + r * np.sin(bend)])
    direction = np.array([0.0, np.cos(np.radians(10)), np.sin(np.radians(10))])
    path = np.vstack([[(0, 0, -0.4), (0, 0, 0.0), (0, 0, 2.5), (0, 0, 5.0)], arc, arc[-1] + (reach - r) * direction])
    radius = np.interp(path[:, 2] + path[:, 1], [0.0, height + reach], [0.095, 0.038])
    pole = tube(path, radius, 14)
    end = path[-1]
    angle = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    section = np.column_stack([0.15 * np.cos(angle), 0.36 * np.sign(np.sin(angle)) * np.abs(np.sin(angle)) ** 0.6])
    head = merge([extrude(section * k, a, b) for k, a, b in ((1.0, -0.02, 0.06), (0.8, 0.06, 0.10))])
    base = tube(np.array([(0, 0, -0.4), (0, 0, 0.2), (0, 0, 0.7), (0, 0, 0.9)]), np.array([0.13, 0.13, 0.13, 0.10]), 14)
    place = end + [0.0, 0.25, 0.0]
    glass = extrude(section * 0.78, -0.035, -0.018)
    pole = merge([Mesh(pole.vertices, pole.faces), Mesh(base.vertices, base.faces)])
    return {"pole": pole, "head": head.moved(place), "glass": glass.moved(place)}


def barrier(length: float = 6.0) -> Mesh:
    """Return a concrete safety barrier element (0.81 m high, New Jersey profile) along x."""
    half = np.array([(0.30, -0.1), (0.30, 0.075), (0.175, 0.255), (0.09, 0.78), (0.07, 0.81)])
    section = np.concatenate([half, half[::-1] * [-1.0, 1.0]])
    low, high = (np.column_stack([np.full(len(section), x), section]) for x in (-length / 2, length / 2))
    distance = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(np.vstack([section, section[:1]]), axis=0), axis=1))]
    ring = np.vstack([low, low[:1]]), np.vstack([high, high[:1]])
    uv = np.stack([np.stack([np.full(len(distance), x), distance], -1) for x in (0.0, length)]) / 2.0
    parts = [grid(np.stack(ring), uv)]
    k = np.arange(len(section))
    for vertices, order in ((low, 1), (high, -1)):
        centre = np.array([[vertices[0, 0], 0.0, 0.3]])
        fan = np.stack([(k + 1) % len(k), k, np.full(len(k), len(k))], 1)[:, ::order].astype(np.int64)
        all_points = np.vstack([vertices, centre])
        parts.append(Mesh(all_points, fan, all_points[:, 1:] / 2.0))
    return outward(merge(parts))


def bollard() -> Mesh:
    """Return a steel bollard, 0.95 m high, with a rounded cap and a collar."""
    z = np.array([-0.2, 0.0, 0.78, 0.80, 0.84, 0.86, 0.91, 0.94, 0.95])
    r = np.array([0.055, 0.055, 0.055, 0.062, 0.062, 0.055, 0.052, 0.035, 0.0005])
    return outward(revolve(np.column_stack([r, z])[::-1], 20))


def bench() -> dict[str, Mesh]:
    """Return ``wood`` and ``frame`` of a bench along x that faces +y, 1.8 m long."""
    slats = [box((1.8, 0.09, 0.035), (0.0, y, 0.45)) for y in (-0.16, -0.05, 0.06, 0.17)]
    slats += [box((1.8, 0.03, 0.09), (0.0, -0.24 - 0.02 * k, 0.58 + 0.12 * k)) for k in range(3)]
    frame = []
    for x in (-0.75, 0.75):
        frame.append(tube(np.array([(x, 0.2, -0.05), (x, 0.19, 0.2), (x, 0.18, 0.43)]), 0.022, 8))
        frame.append(tube(np.array([(x, -0.2, -0.05), (x, -0.2, 0.43), (x, -0.28, 0.90)]), 0.022, 8))
        frame.append(box((0.04, 0.42, 0.03), (x, 0.0, 0.42)))
    return {"wood": merge(slats), "frame": merge([Mesh(m.vertices, m.faces) for m in frame])}


def street_lamp(height: float = 5.2) -> dict[str, Mesh]:
    """Return ``pole``, ``head`` and ``glass`` of a post-top lamp of a town street."""
    pole = tube(
        np.array([(0, 0, -0.3), (0, 0, 0.0), (0, 0, 0.9), (0, 0, height - 0.6), (0, 0, height - 0.45)]),
        np.array([0.10, 0.10, 0.055, 0.045, 0.045]),
        14,
    )
    glass = revolve(
        np.array([(0.0005, 0.0), (0.10, 0.0), (0.19, 0.36), (0.0005, 0.36)])[::-1] + [0.0, height - 0.45], 18
    )
    cap = revolve(
        np.array([(0.0005, 0.0), (0.27, 0.0), (0.25, 0.05), (0.06, 0.14), (0.0005, 0.15)])[::-1] + [0.0, height - 0.08],
        20,
    )
    return {"pole": Mesh(pole.vertices, pole.faces), "head": outward(cap), "glass": outward(glass)}


def sign_stack(*signs: tuple[str, float]) -> dict[str, Mesh]:
    """Return ``face_0``, ``face_1`` ..., ``back`` and ``pole`` of signs on one pole, the highest first.

    Signs are pairs of kind and height of the middle [m].

    A kind ``yield`` is a triangle on its tip.
    """
    faces, backs, pole = {}, [], None
    for number, (kind, height) in enumerate(signs):
        if kind == "yield":
            parts = sign("triangle", 0.0)
            turned = {key: _upside_down(parts[key], height) for key in ("face", "back")}
            single = sign("triangle", height)["pole"]
        else:
            turned = single_parts = sign(kind, height)
            single = single_parts["pole"]
        faces[f"face_{number}"] = turned["face"]
        backs.append(Mesh(turned["back"].vertices, turned["back"].faces))
        pole = single if pole is None else pole
    assert pole is not None
    return {**faces, "back": merge(backs), "pole": pole}


def _upside_down(part: Mesh, height: float) -> Mesh:
    """Return a part of a sign at height 0, turned by 180 deg about x and lifted.

    The picture turns with it, so uv is turned back.
    """
    uv = None if part.uv is None else np.column_stack([1.0 - part.uv[:, 0], 1.0 - part.uv[:, 1]])
    return Mesh(part.vertices * [1.0, -1.0, -1.0] + [0.0, 0.0, height], part.faces, uv)
