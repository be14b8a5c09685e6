"""OpenDRIVE maps as texts, put together by the tests: independent of what reads them."""

from __future__ import annotations

import math
from collections.abc import Sequence

MARK = '<roadMark sOffset="0" type="{kind}" weight="standard" color="{color}" width="0.12"/>'


def piece(shape: str, length: float, s: float = 0.0, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> str:
    """Return a `<geometry>` that holds the element `shape`."""
    return f'<geometry s="{s!r}" x="{x!r}" y="{y!r}" hdg="{heading!r}" length="{length!r}">{shape}</geometry>'


def lane(
    number: int, width: str | float = 3.5, kind: str = "driving", mark: str = "solid", link: str = "", more: str = ""
) -> str:
    """Return a `<lane>`; `width` is a number or `<width>` elements, `link` the inside of its `<link>`."""
    text = (
        width if isinstance(width, str) else f'<width sOffset="0" a="{width!r}" b="0" c="0" d="0"/>' if number else ""
    )
    marks = MARK.format(kind=mark, color="standard")
    return f'<lane id="{number}" type="{kind}" level="false"><link>{link}</link>{text}{more}{marks}</lane>'


def section(left: Sequence[str] = (), right: Sequence[str] = (), s: float = 0.0, center: str = "broken") -> str:
    """Return a `<laneSection>`; lanes of the left from the outermost, of the right from the innermost."""
    middle = lane(0, kind="none", mark=center)
    sides = [f"<{name}>{''.join(own)}</{name}>" for name, own in (("left", left), ("right", right))]
    return f'<laneSection s="{s!r}">{sides[0]}<center>{middle}</center>{sides[1]}</laneSection>'


TWO_WAY = section([lane(1)], [lane(-1)])
"""One lane in each direction."""


def road(
    plan: str,
    length: float,
    sections: str = TWO_WAY,
    number: str = "1",
    junction: str = "-1",
    link: str = "",
    offset: str = "",
    elevation: str = "",
    lateral: str = "",
    more: str = "",
    kind: str = "town",
    rule: str = "RHT",
) -> str:
    """Return a `<road>`; `more` holds its objects and signals."""
    return (
        f'<road name="" length="{length!r}" id="{number}" junction="{junction}" rule="{rule}">\n<link>{link}</link>\n'
        f'<type s="0" type="{kind}"/>\n<planView>{plan}</planView>\n<elevationProfile>{elevation}</elevationProfile>\n'
        f"<lateralProfile>{lateral}</lateralProfile>\n<lanes>{offset}{sections}</lanes>\n{more}</road>\n"
    )


def street_map(*parts: str, minor: int = 7) -> str:
    """Return a whole file."""
    return (
        f'<?xml version="1.0"?>\n<OpenDRIVE>\n<header revMajor="1" revMinor="{minor}"/>\n{"".join(parts)}</OpenDRIVE>\n'
    )


def cubic(tag: str, values: Sequence[float], s: float = 0.0, start: str = "s") -> str:
    """Return an element with a polynomial."""
    letters = " ".join(f'{key}="{value!r}"' for key, value in zip("abcd", values, strict=True))
    return f'<{tag} {start}="{s!r}" {letters}/>'


def links(predecessor: str = "", successor: str = "") -> str:
    """Return the inside of a road's `<link>`; each as ``road 2 start`` or ``junction 9``."""
    found = ""
    for tag, text in (("predecessor", predecessor), ("successor", successor)):
        if text:
            kind, number, *contact = text.split()
            point = f' contactPoint="{contact[0]}"' if contact else ""
            found += f'<{tag} elementType="{kind}" elementId="{number}"{point}/>'
    return found


RADIUS, ARM = 15.0, 60.0
"""Of `crossing`: how far the arms begin from the middle, and their length [m]."""


def crossing(signals: bool = True, kerb: bool = True, rule: str = "RHT") -> str:
    """Return a crossing of four arms (roads 0 to 3, counter-clockwise from the east) with all turns, level.

    Lane -1 of an arm leads away from the crossing. Ways are the roads 10 i + j + 100.
    """
    walk = '<height sOffset="0" inner="0.12" outer="0.12"/>'
    parts, ways = [], []
    for i in range(4):
        angle = i * math.pi / 2.0
        left = ([lane(2, 2.0, "sidewalk", "none", more=walk)] if kerb else []) + [lane(1)]
        right = [lane(-1)] + ([lane(-2, 2.0, "sidewalk", "none", more=walk)] if kerb else [])
        light = (
            f'<signals><signal id="s{i}" s="2" t="6" zOffset="2.3" orientation="-" dynamic="yes" '
            'type="1000001"/></signals>'
            if signals
            else ""
        )
        start = (RADIUS * math.cos(angle), RADIUS * math.sin(angle))
        parts.append(
            road(
                piece("<line/>", ARM, 0.0, *start, angle),
                ARM,
                section(left, right),
                str(i),
                link=links("junction 9"),
                more=light,
                rule=rule,
            )
        )
        for j in range(4):
            if i == j:
                continue
            turn = ((j - i) * 90 + 180) % 360  # 90: left, 270: right, 0: straight on
            curvature = {90: 1.0, 270: -1.0, 0: 0.0}[turn] / RADIUS
            length = 2.0 * RADIUS if turn == 0 else 0.5 * math.pi * RADIUS
            shape = f'<arc curvature="{curvature!r}"/>' if turn else "<line/>"
            number = 100 + 10 * i + j
            own = '<predecessor id="1"/><successor id="-1"/>'
            inner = section((), [lane(-1, mark="none", link=own)], center="none")
            if rule == "LHT":
                own = '<predecessor id="-1"/><successor id="1"/>'
                inner = section([lane(1, mark="none", link=own)], (), center="none")
            parts.append(
                road(
                    piece(shape, length, 0.0, *start, angle + math.pi),
                    length,
                    inner,
                    str(number),
                    "9",
                    links(f"road {i} start", f"road {j} start"),
                    rule=rule,
                )
            )
            pair = 'from="1" to="-1"' if rule == "RHT" else 'from="-1" to="1"'
            ways.append(
                f'<connection id="{number}" incomingRoad="{i}" connectingRoad="{number}" contactPoint="start">'
                f"<laneLink {pair}/></connection>"
            )
    parts.append(f'<junction id="9" name="">{"".join(ways)}</junction>')
    return street_map(*parts)


def hill(length: float = 120.0) -> str:
    """Return a bend over a hill, with superelevation."""
    return street_map(
        road(
            piece('<arc curvature="0.01"/>', length),
            length,
            elevation=cubic("elevation", (2.0, 0.04, -3e-4, 0.0)),
            lateral=cubic("superelevation", (0.02, 2e-4, 0.0, 0.0)),
        )
    )


def widening() -> str:
    """Return a road of two sections; in the second a lane opens to the right, over a middle that moves."""
    wide = cubic("width", (0.0, 0.0, 3 * 3.5 / 40.0**2, -2 * 3.5 / 40.0**3), 0.0, "sOffset") + cubic(
        "width", (3.5, 0.0, 0.0, 0.0), 40.0, "sOffset"
    )
    one = section([lane(1, link='<successor id="1"/>')], [lane(-1, link='<successor id="-1"/>')])
    two = section(
        [lane(1, link='<predecessor id="1"/>')],
        [lane(-1, mark="broken", link='<predecessor id="-1"/>'), lane(-2, wide)],
        50.0,
    )
    return street_map(
        road(
            piece("<line/>", 140.0),
            140.0,
            one + two,
            offset=cubic("laneOffset", (0.0, 0.0, 3e-4, -2e-6)),
        )
    )


def bridge() -> str:
    """Return a road on a bridge 7 m above another."""
    over = "<objects><bridge s='20' length='60' id='b' type='concrete'/></objects>"
    return street_map(
        road(piece("<line/>", 100.0), 100.0),
        road(
            piece("<line/>", 100.0, 0.0, 50.0, -50.0, math.pi / 2),
            100.0,
            number="2",
            elevation=cubic("elevation", (0.0, 0.28, -0.0028, 0.0)),
            more=over,
        ),
    )


def furnished() -> str:
    """Return a street with a building, a row of poles, a fence, a tree, a crossing, signs and a parking place."""
    corners = "".join(f'<cornerLocal u="{u}" v="{v}" z="0" height="9"/>' for u, v in ((0, 0), (12, 0), (12, 8), (0, 8)))
    zebra = "".join(
        f'<cornerRoad s="{s}" t="{t}" dz="0" height="0"/>' for s, t in ((38, -3.4), (42, -3.4), (42, 3.4), (38, 3.4))
    )
    things = (
        f'<object id="1" type="building" s="20" t="12" hdg="0"><outlines><outline id="0">{corners}</outline></outlines>'
        "</object>"
        '<object id="2" type="pole" s="0" t="-6" radius="0.1" height="4">'
        '<repeat s="5" length="80" distance="20" tStart="-6" tEnd="-6" heightStart="4" heightEnd="4" zOffsetStart="0" '
        'zOffsetEnd="0"/></object>'
        '<object id="3" type="barrier" name="fence" s="0" t="-9" height="1.2">'
        '<repeat s="0" length="90" distance="0" tStart="-9" tEnd="-9" heightStart="1.2" heightEnd="1.2" '
        'zOffsetStart="0" zOffsetEnd="0"/></object>'
        '<object id="4" type="tree" s="60" t="8" height="9" radius="2"/>'
        f'<object id="5" type="crosswalk" s="40" t="0"><outlines><outline id="0">{zebra}</outline></outlines></object>'
        '<object id="6" type="parkingSpace" s="70" t="6" length="2.3" width="5.5" hdg="0"/>'
        '<object id="7" type="gantry" s="80" t="0"/>'
    )
    signs = (
        '<signal id="1" s="10" t="-5" zOffset="2.2" orientation="+" dynamic="no" type="274" value="30"/>'
        '<signal id="2" s="90" t="5" zOffset="2.2" orientation="-" dynamic="no" type="9999"/>'
    )
    return street_map(
        road(
            piece("<line/>", 100.0),
            100.0,
            section([lane(1, mark="solid solid")], [lane(-1, mark="curb")], center="broken"),
            more=f"<objects>{things}</objects><signals>{signs}</signals>",
        )
    )


def alone(element: str, length: float, **more: str) -> str:
    """Return one road of one piece, at a place and in a direction of its own."""
    return street_map(road(piece(element, length, 0.0, 12.0, -7.0, 0.7), length, **more))


MAPS = {
    "line": alone("<line/>", 80.0),
    "arc": alone('<arc curvature="-0.05"/>', 60.0),
    "spiral": alone('<spiral curvStart="-0.03" curvEnd="0.06"/>', 90.0),
    "poly3": alone('<poly3 a="0" b="0" c="0.004" d="-0.00002"/>', 80.0),
    "param_poly3": alone(
        '<paramPoly3 pRange="normalized" aU="0" bU="70" cU="0" dU="-4" aV="0" bV="0" cV="18" dV="-6"/>', 69.0
    ),
    "crossfall": alone("<line/>", 60.0, lateral='<crossfall side="both" s="0" a="0.025" b="0" c="0" d="0"/>'),
    "hill": hill(),
    "widening": widening(),
    "crossing": crossing(),
    "left_hand": crossing(False, False, "LHT"),
    "bridge": bridge(),
    "furnished": furnished(),
}
"""Twelve maps, which use every geometry and lane feature that is read."""
