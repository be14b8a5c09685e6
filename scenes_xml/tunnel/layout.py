"""Where things are in the tunnel, for each variant.

The reference line is the middle of the carriageway; s runs along it from the ego's place, offsets are to the left [m].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..generators.roads.road import RoadCurve
from ..generators.roads.sweep import STRAIGHT
from ..generators.roads.tunnel import Bore, Opening

SEED = 300
ROAD = (-115.0, 205.0)
"""Arc lengths between which there is a carriageway [m]."""
LANE = 1.75
"""Offset of the middle of a lane; traffic keeps to the right [m]."""
EDGE = 3.75
TIMES = np.arange(0.0, 9.0 + 1e-9, 0.5)


@dataclass(frozen=True)
class Traffic:
    """An actor: model, place at time 0 [m], speed [m/s] (negative: in the other lane, against the reference line)."""

    name: str
    model: str
    start: float
    speed: float
    variant: int = 0


@dataclass(frozen=True)
class Layout:
    """All that a variant changes.

    `start`, `stop`: arc lengths of the portals; `lamps`: their spacing, `rows`: the offsets of their rows [m].
    """

    curve: RoadCurve
    start: float
    stop: float
    bore: Bore
    openings: tuple[Opening, ...]
    doors: tuple[float, ...]
    fans: tuple[float, ...]
    signals: tuple[float, ...]
    lamps: float
    rows: tuple[float, ...]
    coating: tuple[float, float, float]
    traffic: tuple[Traffic, ...]
    walker: float
    variant: int = 0


TRAFFIC = (
    Traffic("ego", "saloon", -26.0, 13.9),
    Traffic("lorry_ahead", "lorry", 6.0, 13.2),
    Traffic("follower", "suv", -47.0, 13.6, 1),
    Traffic("oncoming_car", "small_car", 44.0, -14.2),
    Traffic("oncoming_van", "van", 74.0, -13.6),
    Traffic("oncoming_bus", "bus", 108.0, -13.2),
    Traffic("oncoming_motorcycle", "motorcycle", 20.0, -15.0),
)


def _openings(start: float, stop: float, spacing: float, shift: float) -> tuple[Opening, ...]:
    places = np.arange(start + 18.0 + shift, stop - 12.0, spacing)
    niches = [Opening(1 if k % 2 == 0 else -1, float(s) - 1.5, float(s) + 1.5, 2.4, 0.9) for k, s in enumerate(places)]
    return tuple(niches)


def layout(variant: int = 0) -> Layout:
    """Return the layout of a variant; 0 is a straight tunnel of 160 m with an arched lining."""
    if variant == 0:
        start, stop, bore = -50.0, 110.0, Bore(4.9, True, 6.9, 1.15)
        return Layout(
            STRAIGHT,
            start,
            stop,
            bore,
            _openings(start, stop, 34.0, 0.0),
            (-8.0, 64.0),
            (-24.0, 36.0, 84.0),
            (-10.0, 70.0),
            7.0,
            (-1.9, 1.9),
            (1.0, 1.0, 1.0),
            TRAFFIC,
            33.0,
        )
    g = np.random.default_rng([SEED, variant])
    length = float(np.round(g.uniform(120.0, 200.0)))
    start = -50.0
    stop = start + length
    is_arch = bool(g.uniform() < 0.5)
    half = float(np.round(g.uniform(4.6, 5.3), 2))
    bore = Bore(half, is_arch, float(np.round(g.uniform(6.5, 7.3) if is_arch else g.uniform(5.6, 6.4), 2)), half - EDGE)
    radius = float(np.round(g.uniform(350.0, 900.0)))
    curve = RoadCurve(g.uniform(0.0, 20.0), 1e3, radius, 40.0) if g.uniform() < 0.7 else STRAIGHT
    rows = (-1.9, 1.9) if g.uniform() < 0.6 else (0.0,)
    traffic = []
    for t in TRAFFIC:
        same = t.name in ("ego", "lorry_ahead", "follower")
        shift = 0.0 if t.name == "ego" else float(g.uniform(0.0, 6.0)) * (1.0 if t.name != "follower" else -1.0)
        factor = 1.0 if same else float(g.uniform(0.97, 1.03))
        traffic.append(Traffic(t.name, t.model, t.start + shift, t.speed * factor, int(g.integers(0, 3))))
    fans = tuple(float(s) for s in np.arange(start + g.uniform(18.0, 30.0), stop - 15.0, g.uniform(45.0, 65.0)))
    spacing, shift = float(g.uniform(28.0, 42.0)), float(g.uniform(0.0, 8.0))
    first = start + 18.0 + shift
    return Layout(
        curve,
        start,
        stop,
        bore,
        _openings(start, stop, spacing, shift),
        (first + 0.5 * spacing, first + 2.5 * spacing),
        fans,
        (start + float(g.uniform(25.0, 45.0)), float(g.uniform(35.0, 75.0))),
        float(g.uniform(6.0, 11.0)),
        rows,
        tuple(float(v) for v in g.uniform([0.85, 0.85, 0.7], [1.0, 1.0, 1.0])),
        tuple(traffic),
        float(g.uniform(20.0, 40.0)),
        variant,
    )
