"""Reference lines of OpenDRIVE: line, arc, spiral, cubic polynomials, as points at arc lengths.

A clothoid's point is the integral of the direction, by Gauss's rule with eight points a panel of at most half a radian,
which is right to 1e-13 of its length. A polynomial's arc length is integrated by the same rule, and inverted by
Newton's method.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model import Array, PlanPiece

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS
_PANELS = 64


@dataclass(frozen=True, eq=False)
class Frame:
    """Points of a line: position (n,), heading [rad] and curvature [1/m, positive to the left], all (n,)."""

    x: Array
    y: Array
    heading: Array
    curvature: Array


def evaluate(piece: PlanPiece, way: Array) -> Frame:
    """Return the points of a piece of a plan view at arc lengths `way` (n,) since its start [m]."""
    if piece.kind in ("line", "arc", "spiral"):
        u, v, turn, curvature = _clothoid(piece, way)
    else:
        u, v, turn, curvature = _polynomial(piece, way)
    cos, sin = np.cos(piece.heading), np.sin(piece.heading)
    return Frame(piece.x + cos * u - sin * v, piece.y + sin * u + cos * v, piece.heading + turn, curvature)


def _clothoid(piece: PlanPiece, way: Array) -> tuple[Array, Array, Array, Array]:
    """Return u, v, the turn and the curvature where the curvature grows evenly."""
    first, last = piece.numbers.get("curvStart", 0.0), piece.numbers.get("curvEnd", 0.0)
    rate = (last - first) / piece.length if piece.length > 0.0 else 0.0
    turn, curvature = way * (first + 0.5 * rate * way), first + rate * way
    panels = int(np.ceil(2.0 * float(np.max(np.abs(way) * np.maximum(np.abs(first), np.abs(curvature)), initial=0.0))))
    if panels == 0:
        return way, np.zeros_like(way), turn, curvature
    share = ((np.arange(panels)[:, None] + _NODES) / panels).ravel()
    weight = np.tile(_WEIGHTS, panels) / panels
    part = way[:, None] * share
    angle = part * (first + 0.5 * rate * part)
    return way * (np.cos(angle) @ weight), way * (np.sin(angle) @ weight), turn, curvature


def _polynomial(piece: PlanPiece, way: Array) -> tuple[Array, Array, Array, Array]:
    """Return u, v, the turn and the curvature of a poly3 or paramPoly3 piece.

    The parameter follows from the arc length. A paramPoly3 is stretched over the length that the file states, so that
    its ends are the polynomial's.
    """
    pu, pv, top = coefficients(piece)
    knots = np.linspace(0.0, top, _PANELS + 1)
    lengths = np.r_[0.0, np.cumsum(_arc(pu, pv, knots[:-1], knots[1:]))]
    stretch = lengths[-1] / piece.length if piece.kind == "paramPoly3" and piece.length > 0.0 else 1.0
    target = way * stretch
    panel = np.clip(np.searchsorted(lengths, target, "right") - 1, 0, _PANELS - 1)
    low = knots[panel]
    rest = target - lengths[panel]
    p = low + rest / np.maximum(_speed(pu, pv, low), 1e-12)
    for _ in range(4):
        p = p - (_arc(pu, pv, low, p) - rest) / np.maximum(_speed(pu, pv, p), 1e-12)
    p = np.clip(p, -0.1 * top, 1.1 * top)
    du, dv = np.polyval(np.polyder(pu), p), np.polyval(np.polyder(pv), p)
    ddu, ddv = np.polyval(np.polyder(pu, 2), p), np.polyval(np.polyder(pv, 2), p)
    curvature = (du * ddv - dv * ddu) / np.maximum(np.hypot(du, dv), 1e-12) ** 3
    return np.polyval(pu, p), np.polyval(pv, p), np.arctan2(dv, du), curvature


def coefficients(piece: PlanPiece) -> tuple[Array, Array, float]:
    """Return the polynomials u and v of a piece, highest power first, and the largest parameter."""
    n = piece.numbers
    if piece.kind == "poly3":
        return np.array([0.0, 0.0, 1.0, 0.0]), np.array([n["d"], n["c"], n["b"], n["a"]]), piece.length
    top = 1.0 if piece.is_normalized else piece.length
    return np.array([n[f"{k}U"] for k in "dcba"]), np.array([n[f"{k}V"] for k in "dcba"]), top


def _speed(pu: Array, pv: Array, p: Array) -> Array:
    return np.hypot(np.polyval(np.polyder(pu), p), np.polyval(np.polyder(pv), p))


def _arc(pu: Array, pv: Array, start: Array, stop: Array) -> Array:
    """Return the arc lengths between parameters, shape (n,)."""
    p = start[:, None] + (stop - start)[:, None] * _NODES
    return np.asarray((stop - start) * (_speed(pu, pv, p) @ _WEIGHTS))
