"""A network of SUMO for tests, written by hand: three arms at a junction with lights, a pavement and a crossing."""

from __future__ import annotations

import numpy as np

CUT, FAR, HALF = 10.0, 100.0, 1.6
"""Where lanes end before the junction, where they begin, and half a lane's width [m]."""

EDGES: dict[str, tuple[str, str, list[tuple[float, float]]]] = {
    "wj": ("W", "J", [(-FAR, -HALF), (-CUT, -HALF)]),
    "jw": ("J", "W", [(-CUT, HALF), (-FAR, HALF)]),
    "je": ("J", "E", [(CUT, -HALF), (FAR, -HALF)]),
    "ej": ("E", "J", [(FAR, HALF), (CUT, HALF)]),
    "sj": ("S", "J", [(HALF, -FAR), (HALF, -CUT)]),
    "js": ("J", "S", [(-HALF, -CUT), (-HALF, -FAR)]),
}
"""Edges: from, to, centre line of the lane for cars."""
LINKS = [("wj", "je"), ("wj", "js"), ("ej", "jw"), ("ej", "js"), ("sj", "je"), ("sj", "jw")]
RESPONSES = ["000000", "000000", "000000", "000011", "000001", "001101"]
"""Row k: whom link k gives way to; the last letter is link 0."""


def way(link: tuple[str, str], count: int = 15) -> np.ndarray:
    """Return the points of a way through the junction, shape (count, 2): a straight line or a quarter of an ellipse."""
    start, stop = np.array(EDGES[link[0]][2][1]), np.array(EDGES[link[1]][2][0])
    along = start - np.array(EDGES[link[0]][2][0])
    along = along / np.linalg.norm(along)
    ahead = along * ((stop - start) @ along)
    aside = stop - start - ahead
    angle = np.linspace(0.0, 0.5 * np.pi, count)[:, None]
    if np.linalg.norm(aside) < 1e-9:
        return start + (stop - start) * angle / angle[-1]
    return np.asarray(start + np.sin(angle) * ahead + (1.0 - np.cos(angle)) * aside)


def _shape(points: object) -> str:
    return " ".join(f"{x:.4f},{y:.4f}" for x, y in np.asarray(points))


def network(*, lights: bool = False, pavement: bool = False, left_hand: bool = False, extra: str = "") -> str:
    """Return the file; in left-hand networks everything is mirrored."""
    side = -1.0 if left_hand else 1.0

    def mirrored(points: object) -> str:
        return _shape(np.asarray(points) * [side, 1.0])

    rows = []
    for k, link in enumerate(LINKS):
        lane = f'<lane id=":J_{k}_0" index="0" speed="6" length="1" shape="{mirrored(way(link))}"/>'
        rows.append(f'<edge id=":J_{k}" function="internal">{lane}</edge>')
    for name, (start, stop, shape) in EDGES.items():
        line = np.array(shape)
        place = f'id="{name}_{int(pavement)}" index="{int(pavement)}"'
        lanes = f'<lane {place} speed="13.9" length="90" shape="{mirrored(line)}"/>'
        if pavement:
            step = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
            beside = line + (HALF + 1.0) * np.array([step[1], -step[0]])
            lanes = (
                f'<lane id="{name}_0" index="0" allow="pedestrian" speed="1.5" length="90" width="2.0" '
                f'shape="{mirrored(beside)}"/>{lanes}'
            )
        rows.append(f'<edge id="{name}" from="{start}" to="{stop}">{lanes}</edge>')
    if pavement:
        rows.append(
            '<edge id=":J_c0" function="crossing"><lane id=":J_c0_0" index="0" allow="pedestrian" speed="1" '
            f'length="6.4" width="4" shape="{mirrored([(12.0, -3.2), (12.0, 3.2)])}"/></edge>'
        )
    if lights:
        rows.append(
            '<tlLogic id="J" type="static" programID="0" offset="0"><phase duration="30" state="GGGgrr"/>'
            '<phase duration="5" state="yyyyrr"/><phase duration="20" state="rrrrGG"/>'
            '<phase duration="5" state="rrrryy"/></tlLogic>'
        )
    corners = [(-CUT, 3.2), (CUT, 3.2), (CUT, -3.2), (3.2, -CUT), (-3.2, -CUT), (-CUT, -3.2)]
    requests = "".join(
        f'<request index="{k}" response="{row}" foes="{row}" cont="0"/>' for k, row in enumerate(RESPONSES)
    )
    inside = " ".join(f":J_{k}_0" for k in range(len(LINKS)))
    rows.append(
        f'<junction id="J" type="priority" x="0" y="0" incLanes="" intLanes="{inside}" shape="{mirrored(corners)}">'
        f"{requests}</junction>"
    )
    rows += [f'<junction id="{one}" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape=""/>' for one in "WES"]
    for k, (first, second) in enumerate(LINKS):
        tl = f' tl="J" linkIndex="{k}"' if lights else ""
        lane = int(pavement)
        rows.append(
            f'<connection from="{first}" to="{second}" fromLane="{lane}" toLane="{lane}" via=":J_{k}_0"{tl} dir="s" '
            'state="M"/>'
        )
    head = ' lefthand="true"' if left_hand else ""
    return f'<net version="1.20"{head}>\n' + "\n".join([*rows, extra]) + "\n</net>\n"
