"""OpenDRIVE maps as texts, put together by the tests: independent of what reads them."""

from __future__ import annotations

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
