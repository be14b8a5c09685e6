"""The hall: floor, walls, ceiling with beams, columns, ramps, the block of stairs, ducts, pipes, lamps and signs."""

from __future__ import annotations

import numpy as np

from ..generators.geometry.mesh import Mesh, box, extrude, grid, merge, tube
from ..generators.kit import SceneKit
from ..generators.roads import tunnel
from ..generators.roads.sweep import STRAIGHT, row
from . import layout as at

MARK = 0.004


def plane(x: tuple[float, float], y: tuple[float, float], z: float, tile: float = 4.0, down: bool = False) -> Mesh:
    """Return a level rectangle that looks up, or `down`."""
    corners = np.array([[(x[0], y[0], z), (x[0], y[1], z)], [(x[1], y[0], z), (x[1], y[1], z)]])
    mesh = grid(corners, corners[..., :2] / tile)
    return mesh.flipped() if down else mesh


def upright(a: tuple[float, float], b: tuple[float, float], low: float, high: float, tile: float = 4.0) -> Mesh:
    """Return a wall from a to b; it looks to the left of this direction."""
    length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
    corners = np.array([[(*a, low), (*a, high)], [(*b, low), (*b, high)]])
    uv = np.array([[(0.0, low), (0.0, high)], [(length, low), (length, high)]]) / tile
    return grid(corners, uv).flipped()


def add_hall(kit: SceneKit, plan: at.Layout) -> None:
    """Add floor, walls, ceiling, beams and columns."""
    x, y, top = plan.wall_x, at.WALL_Y, plan.ceiling
    kit.add("floor_slab", plane((-x, x), (-y, y), 0.0, 8.0), "garage_floor")
    kit.instance("floor", "Roads", ["floor_slab"])
    gap = [(sign * at.AISLE - at.RAMP_HALF, sign * at.AISLE + at.RAMP_HALF) for sign in (-1.0, 1.0)]
    ends = [(-y, gap[0][0]), (gap[0][1], gap[1][0]), (gap[1][1], y)]
    walls = [
        upright((-x, -y), (x, -y), 0.0, top),
        upright((x, y), (-x, y), 0.0, top),
        upright((-x, y), (-x, -y), 0.0, top),
    ]
    walls += [upright((x, a), (x, b), 0.0, top) for a, b in ends]
    walls += [upright((x, a), (x, b), top - plan.beam, top) for a, b in gap if plan.beam]
    kit.add("walls_hall", merge(walls), "garage_concrete")
    kit.instance("walls", "Wall", ["walls_*"])
    ceiling = [plane((-x, x), (-y, y), top, down=True)]
    if plan.beam:
        low = top - plan.beam
        for px in (*plan.column_x, -x + 0.2, x - 0.2):
            ceiling += [box((0.36, 2 * y + 0.1, plan.beam), (px, 0.0, low + plan.beam / 2))]
    kit.add(
        "ceiling_slab",
        merge([Mesh(m.vertices, m.faces, m.uv if k == 0 else m.uv / 4.0) for k, m in enumerate(ceiling)]),
        "garage_concrete",
    )
    kit.instance("ceiling", "Wall", ["ceiling_slab"])
    guard = [box((0.04, 0.04, 0.94), (sx * 0.145, sy * 0.295, 0.43)) for sx in (-1, 1) for sy in (-1, 1)]
    guard.append(box((at.COLUMN[0] + 0.012, at.COLUMN[1] + 0.012, 0.22), (0.0, 0.0, 1.75)))
    guards = []
    if kit.is_light:
        shafts = [box((*at.COLUMN, top + 0.1), (px, py, top / 2)) for px in plan.column_x for py in at.COLUMN_Y]
        kit.add("columns_shafts", merge(shafts), "garage_concrete")
        kit.instance("columns", "Pole", ["columns_shafts"])
        return
    column = kit.prefab(
        "column", {"shaft": box((*at.COLUMN, top + 0.1), (0.0, 0.0, top / 2))}, {"shaft": "garage_concrete"}
    )
    for n, px in enumerate(plan.column_x):
        for m, py in enumerate(at.COLUMN_Y):
            if not (m in (1, 2) and plan.core[0] - 0.1 < px < plan.core[1] + 0.1):
                kit.place(column, f"column_{n}_{m}", "Pole", (px, py, 0.0))
                guards.append(merge(guard).moved((px, py, 0.0)))
    kit.add("guards_columns", merge(guards), plan.guard)
    kit.instance("column_guards", "Static", ["guards_columns"])


def add_markings(kit: SceneKit, plan: at.Layout) -> None:
    """Add the lines of the bays, arrows in the aisles and wheel stops."""
    lines, stops = [], []
    for k in range(plan.spans):
        for n in range(4):
            px = -plan.half + at.SPAN * k + 0.15 + at.BAY * n
            for low in (-16.0, 11.0, -5.0, 0.0):
                if low in (-5.0, 0.0) and k == plan.core_left:
                    continue
                depth = (
                    (low + 0.3, low + 5.0) if low == -16.0 else (low, low + 4.7) if low == 11.0 else (low, low + 5.0)
                )
                lines.append(plane((px - 0.05, px + 0.05), depth, MARK))
    kit.add("marking_bays", merge(lines), plan.line)
    arrows = []
    for sign, flip in ((-1.0, 0.0), (1.0, np.pi)):
        for px in np.arange(-plan.half + 4.0, plan.half, 11.0):
            outline = np.array(
                [(-1.0, -0.08), (0.2, -0.08), (0.2, -0.32), (1.0, 0.0), (0.2, 0.32), (0.2, 0.08), (-1.0, 0.08)]
            )
            faces = np.array([(0, 1, 5), (0, 5, 6), (2, 3, 4)])
            arrows.append(
                Mesh(np.column_stack([outline, np.full(7, MARK)]), faces.astype(np.int64)).moved(
                    (px, sign * at.AISLE, 0.0), flip
                )
            )
    kit.add("marking_arrows", merge(arrows), "line_white")
    kit.instance("markings", "RoadLine", ["marking_*"])
    if not kit.is_light:
        for bay in plan.free:
            if bay.row in (0, 3):
                stops.append(box((1.6, 0.15, 0.12), (bay.x, bay.y + np.sign(bay.y) * 1.75, 0.04)))
        kit.add("wheel_stops", merge(stops), "paint_yellow")
        kit.instance("wheel_stops", "Static", ["wheel_stops"])


def add_ramps(kit: SceneKit, plan: at.Layout) -> None:
    """Add the two ramps in their housings, and the street they lead to."""
    x, top = plan.wall_x, plan.level
    u = np.linspace(0.0, at.RAMP_LENGTH, 25)
    heights = at.ramp_height(u, top)
    floors, walls, roof = [], [], top + 2.5
    for sign in (-1.0, 1.0):
        low, high = sign * at.AISLE - at.RAMP_HALF, sign * at.AISLE + at.RAMP_HALF
        z = np.broadcast_to(heights[:, None], (len(u), 2))
        points = np.stack([*np.broadcast_arrays(x + u[:, None], np.array([low, high])[None, :]), z], -1)
        floors.append(grid(points, points[..., :2] / 8.0))
        for y, flip in ((low, False), (high, True)):
            side = np.stack(
                [
                    np.column_stack([x + u, np.full(len(u), y), heights - 0.05]),
                    np.column_stack([x + u, np.full(len(u), y), np.full(len(u), roof)]),
                ],
                1,
            )
            uv = np.stack([np.column_stack([u, heights]), np.column_stack([u, np.full(len(u), roof)])], 1) / 4.0
            wall = grid(side, uv)
            walls.append(wall if flip else wall.flipped())
            walls.append(
                box(
                    (at.RAMP_LENGTH, 0.2, roof - top + 0.2),
                    (x + at.RAMP_LENGTH / 2, y + (0.101 if flip else -0.101), 0.5 * (roof + top) + 0.1),
                )
            )
        walls.append(upright((x + 0.01, low), (x + 0.01, high), plan.ceiling, roof))
        walls.append(
            box((at.RAMP_LENGTH, high - low + 0.4, 0.2), (x + at.RAMP_LENGTH / 2, sign * at.AISLE, roof + 0.1))
        )
    kit.add("ramp_floor", merge(floors), "garage_floor")
    kit.add("ramp_walls", merge([Mesh(m.vertices, m.faces, m.uv) for m in walls]), "garage_concrete")
    kit.instance("ramps", "Roads", ["ramp_floor"])
    kit.instance("ramp_walls", "Wall", ["ramp_walls"])
    end, out = x + at.RAMP_LENGTH, x + at.RAMP_LENGTH + 25.0
    holes = (-at.AISLE - at.RAMP_HALF, -at.AISLE + at.RAMP_HALF, at.AISLE - at.RAMP_HALF, at.AISLE + at.RAMP_HALF)
    ground = [plane((-x - 6.0, x + 0.02), (-40.0, 40.0), top), plane((end, out), (-40.0, 40.0), top)]
    ground += [
        plane((x + 0.02, end), span, top)
        for span in ((-40.0, holes[0] - 0.2), (holes[1] + 0.2, holes[2] - 0.2), (holes[3] + 0.2, 40.0))
    ]
    kit.add("street_ground", merge(ground), "paving")
    kit.instance("street", "Ground", ["street_ground"])
    kit.add(
        "street_house",
        box((0.6, 80.0, 12.0), (out, 0.0, top + 6.0)),
        "garage_concrete",
    )
    kit.instance("house", "Building", ["street_house"], True)


def add_core(kit: SceneKit, plan: at.Layout) -> None:
    """Add the block of stairs and lift with its doors and lit signs."""
    a, b = plan.core
    half = 4.3
    outline = [(a, -half), (b, -half), (b, half), (a, half)]
    walls = [
        upright(p, q, 0.0, plan.ceiling).flipped() for p, q in zip(outline, [*outline[1:], outline[0]], strict=True)
    ]
    kit.add("core_walls", merge(walls), "garage_core")
    kit.instance("core", "Building", ["core_walls"], True)
    door = kit.prefab(
        "exit_door", tunnel.exit_door(), {"leaf": "paint_green", "frame": "grey_steel", "handle": "galvanized_steel"}
    )
    middle = 0.5 * (a + b)
    for name, dx, y, yaw in (("right", 1.6, -half, -90.0), ("left", -1.6, half, 90.0)):
        kit.place(door, f"door_{name}", "Static", (middle + dx, y, 0.01), yaw)
    if kit.is_light:
        return
    sign = kit.prefab("sign_exit", tunnel.box_sign(), {"case": "black_plastic", "faces": "sign_exit"})
    for name, dx, y, yaw in (("right", 2.7, -half, 180.0), ("left", -2.7, half, 0.0)):
        kit.place(
            sign, f"sign_exit_{name}", "TrafficSign", (middle + dx, y, 2.1 if plan.ceiling < 3 else 2.3), yaw, scale=0.7
        )
    machine = {
        "box": box((0.55, 0.9, 1.8), (0.285, 0.0, 0.85)),
        "panel": box((0.02, 0.5, 0.5), (0.56, 0.0, 1.25)),
        "plate": box((0.03, 0.9, 0.2), (0.56, 0.0, 1.85)),
    }
    ready = kit.prefab("pay_machine", machine, {"box": "paint_blue", "panel": "black_gloss", "plate": "sign_parking"})
    kit.place(ready, "pay_machine", "Static", (middle - 1.6, -half, 0.0), -90.0)


def add_services(kit: SceneKit, plan: at.Layout) -> None:
    """Add lamps, ducts, pipes, cable trays, hose cabinets, mirrors and signs under the ceiling."""
    x, top = plan.wall_x, plan.ceiling
    low = top - plan.beam
    parts = tunnel.luminaire(1.25)
    places = np.arange(-x + 2.2, x - 1.5, plan.lamps)
    places = np.array([p for p in places if np.abs(plan.column_x - p).min() > 0.9 or not plan.beam])
    # rows over the aisles, and over the backs of the inner bays beside the core
    rows = (-at.AISLE, at.AISLE, 0.0)
    for part, bsdf in (("glass", "lamp_indoor"), ("case", "white_plastic")):
        copies = []
        for y in rows:
            chosen = [p for p in places if y != 0.0 or not plan.core[0] - 0.8 < p < plan.core[1] + 0.8]
            copies.append(row(STRAIGHT, chosen, parts[part], y, top - 0.02))
        for px in (-x + at.CROSS / 2, x - at.CROSS / 2):
            copies += [parts[part].moved((px, y, top - 0.02), np.pi / 2) for y in (-13.0, -4.0, 4.0, 13.0)]
        kit.add(f"lamps_{part}", merge(copies), bsdf)
    kit.instance("lamps", "Other", ["lamps_*"])
    ducts = [box((2 * x - 3.0, 0.7, 0.32), (0.0, sign * 13.3, low - 0.18)) for sign in (-1.0, 1.0)]
    kit.add("duct_air", merge(ducts), "duct_steel")
    kit.instance("ducts", "Other", ["duct_*"])
    if kit.is_light:
        return
    grilles = [
        box((0.8, 0.02, 0.2), (px, sign * (13.3 - 0.36), low - 0.18))
        for px in np.arange(-x + 5.0, x - 4.0, 6.0)
        for sign in (-1.0, 1.0)
    ]
    kit.add("duct_grilles", merge(grilles), "black_gloss")
    pipes = [
        tube(np.array([(-x + 0.3, y, low - 0.09), (0.0, y, low - 0.09), (x - 0.3, y, low - 0.09)]), 0.045, 8)
        for y in (-5.6, 5.6, -11.2, 11.2)
    ]
    kit.add("pipe_sprinkler", merge(pipes), "paint_red")
    drain = [
        tube(np.array([(-x + 0.3, y, low - 0.14), (0.0, y, low - 0.12), (x - 0.3, y, low - 0.10)]), 0.06, 10)
        for y in (-1.2, 15.2)
    ]
    kit.add("pipe_drain", merge(drain), "grey_steel")
    kit.instance("pipes", "Other", ["pipe_*"])
    trays = [box((2 * x - 1.0, 0.3, 0.06), (0.0, y, low - 0.05)) for y in (-9.8, 9.8)]
    kit.add("tray_cables", merge(trays), "galvanized_steel")
    kit.instance("cable_trays", "Other", ["tray_cables"])
    hose = kit.prefab(
        "hose",
        {"box": box((0.22, 0.6, 0.7), (0.11, 0.0, 1.3)), "glass": box((0.01, 0.3, 0.3), (0.225, 0.0, 1.35))},
        {"box": "paint_red", "glass": "black_gloss"},
    )
    for n, px in enumerate(plan.column_x[1::3]):
        kit.place(hose, f"hose_{n}_right", "Static", (px, -at.WALL_Y + 0.005, 0.0), 90.0)
        kit.place(hose, f"hose_{n}_left", "Static", (px, at.WALL_Y - 0.005, 0.0), -90.0)
    bar = {
        "tube": merge(
            [
                tube(np.array([(0.0, -2.0, 0.0), (0.0, 0.0, 0.0), (0.0, 2.0, 0.0)]), 0.05, 10),
                box((0.02, 0.02, 0.35), (0.0, -1.4, 0.2)),
                box((0.02, 0.02, 0.35), (0.0, 1.4, 0.2)),
            ]
        ),
        "plate": tunnel.box_sign(0.5, 0.5)["faces"].moved((0.0, -0.3, -0.25)),
    }
    bar["tube"] = Mesh(bar["tube"].vertices, bar["tube"].faces)
    ready = kit.prefab("height_bar", bar, {"tube": "paint_yellow", "plate": "sign_height"})
    for sign, name in ((-1.0, "out"), (1.0, "in")):
        kit.place(ready, f"height_bar_{name}", "TrafficSign", (x - 0.6, sign * at.AISLE, low - 0.3), 0.0)
    grates = [
        plane((px - 0.3, px + 0.3), (y - 0.3, y + 0.3), MARK / 2)
        for px in np.arange(-x + 8.0, x, 16.0)
        for y in (-at.AISLE, at.AISLE)
    ]
    kit.add("grate_drains", merge(grates), "cast_iron")
    kit.instance("drains", "Static", ["grate_drains"])
    round_bars = extrude(
        np.column_stack(
            [
                0.06 * np.cos(np.linspace(0, 2 * np.pi, 12, endpoint=False)),
                0.06 * np.sin(np.linspace(0, 2 * np.pi, 12, endpoint=False)),
            ]
        ),
        -0.05,
        0.9,
    )
    ready = kit.prefab("bollard", {"steel": round_bars}, {"steel": plan.guard})
    for n, dx in enumerate((-2.6, 0.2, 3.2)):
        kit.place(ready, f"bollard_{n}", "Pole", (0.5 * sum(plan.core) + dx, -5.15, 0.0))
