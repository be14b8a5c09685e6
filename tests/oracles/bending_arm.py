"""An arm of two bones that swings and bends, and what a radar sees of its skin: numpy only.

The skin is a round bar with round ends that hangs from a shoulder; points near the elbow follow both bones (linear
blend skinning). Axes of the body: x left, y up, z forward [m].
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Place = Callable[[Array], Array]

SPEED_OF_LIGHT = 299_792_458.0
LENGTH, RADIUS = 0.6, 0.03
SHOULDER, ELBOW = 1.2, 0.3
"""Height of the shoulder, and way from it to the elbow [m]."""
BLEND = 0.1
"""Length about the elbow over which the skin goes from one bone to the other [m]."""
PERIOD = 1.25
"""Of the motion [s]."""


def angles(time: npt.ArrayLike) -> tuple[Array, Array]:
    """Turn of the shoulder and of the elbow [rad]; positive brings the hand forward."""
    phase = 2.0 * np.pi * np.asarray(time, dtype=np.float64) / PERIOD
    return 0.5 * np.sin(phase), 0.3 - 0.3 * np.cos(phase + 0.7)


def outline(step: float) -> tuple[Array, Array]:
    """Ways below the shoulder and radii of rings of the skin, the two poles left out [m]."""
    turn = np.linspace(0.0, np.pi / 2.0, 13)
    straight = np.arange(step, LENGTH - 0.5 * step, step)
    along = [-RADIUS * np.cos(turn[1:]), straight, LENGTH + RADIUS * np.sin(turn[:-1])]
    return np.concatenate(along), np.concatenate(
        [RADIUS * np.sin(turn[1:]), 0 * straight + RADIUS, RADIUS * np.cos(turn[:-1])]
    )


def share(along: Array) -> Array:
    """Weight of the lower bone."""
    return np.clip((along - ELBOW) / BLEND + 0.5, 0.0, 1.0)


def _turned(vectors: Array, angle: float) -> Array:
    x, y, z = vectors.T
    return np.stack([x, y * np.cos(angle) + z * np.sin(angle), z * np.cos(angle) - y * np.sin(angle)], axis=1)


def skinned(points: Array, time: float, tangents: tuple[Array, ...] = ()) -> list[Array]:
    """Points of the skin at a time, and what becomes of vectors along it; in the body's axes, from the rest posture."""
    shoulder, elbow = (float(angle) for angle in angles(time))
    middle, pivot = np.array([0.0, SHOULDER, 0.0]), np.array([0.0, -ELBOW, 0.0])
    low = share(SHOULDER - points[:, 1])[:, None]
    ahead = points - middle
    upper, lower = _turned(ahead, shoulder), _turned(pivot + _turned(ahead - pivot, elbow), shoulder)
    found = [middle + (1.0 - low) * upper + low * lower]
    slope = np.where((low > 0.0) & (low < 1.0), -1.0 / BLEND, 0.0)  # of the weight with height
    for one in tangents:
        turned = (1.0 - low) * _turned(one, shoulder) + low * _turned(one, shoulder + elbow)
        found.append(turned + slope * one[:, 1:2] * (lower - upper))
    return found


def _panels(start: float, stop: float, step: float) -> tuple[Array, Array]:
    """Nodes and weights of Gauss's rule of order four on panels of four steps."""
    edges = np.linspace(start, stop, max(1, int(np.ceil((stop - start) / (4.0 * step)))) + 1)
    nodes, weights = np.polynomial.legendre.leggauss(4)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (nodes + 1.0)).ravel(), (half * weights).ravel()


@cache
def skin(step: float) -> tuple[Array, Array, Array]:
    """Points of the skin at rest, their unit tangents (2, n, 3), and the areas that they stand for [m2]."""
    turn, arc = _panels(0.0, 2.0 * np.pi * RADIUS, step)
    turn = turn / RADIUS
    ends = (0.0, ELBOW - 0.5 * BLEND, ELBOW + 0.5 * BLEND, LENGTH)
    pieces = []  # way below the shoulder, latitude, width
    for start, stop in pairwise(ends):
        along, width = _panels(start, stop, step)
        pieces.append((along, 0.0 * along, width))
    for end, sign in ((0.0, -1.0), (LENGTH, 1.0)):
        way, width = _panels(0.0, 0.5 * np.pi * RADIUS, step)
        pieces.append((end + sign * RADIUS * np.sin(way / RADIUS), sign * way / RADIUS, width))
    along, latitude, width = (np.concatenate(column)[:, None] for column in zip(*pieces, strict=True))
    side, front = np.cos(turn), np.sin(turn)
    cosine, sine = np.cos(latitude), np.sin(latitude)
    full = np.ones((len(along), len(turn)))
    points = [RADIUS * cosine * side, SHOULDER - along * full, RADIUS * cosine * front]
    round_it, down = [-front * full, 0.0 * full, side * full], [-sine * side, -cosine * full, -sine * front]
    tangents = np.array([[column.ravel() for column in one] for one in (round_it, down)]).transpose(0, 2, 1)
    return np.stack([one.ravel() for one in points], axis=1), tangents, (width * arc * cosine).ravel()


def seen(time: float, placed: Place, eye: Array, step: float) -> tuple[Array, Array]:
    """Distances [m] of all points of the skin, and their areas across the line of sight [m2], 0 on the far side.

    `placed` takes points in the body's axes into the world; the arm does not hide itself from in front of it.
    """
    points, tangents, area = skin(step)
    now, around, down = skinned(points, time, tuple(tangents))
    normal = placed(np.cross(around, down)) - placed(np.zeros((1, 3)))
    sight = placed(now) - eye
    distance = np.sqrt(np.einsum("ij,ij->i", sight, sight))
    return distance, area * np.maximum(-np.einsum("ij,ij->i", sight, normal) / distance, 0.0)


def coherent(time: float, placed: Place, eye: Array, frequencies: Array, step: float) -> npt.NDArray[np.complex128]:
    """Sum of exp(-2j k r) over the skin in view by the radar equation of physical optics; evenly spaced frequencies."""
    distance, across = seen(time, placed, eye, step)
    distance, across = distance[across > 0.0], across[across > 0.0]
    wave, turn = 4.0 * np.pi / SPEED_OF_LIGHT * frequencies, 0.0
    turn = wave[1] - wave[0] if len(wave) > 1 else 0.0
    one, by = across / distance**2 * np.exp(-1j * wave[0] * distance), np.exp(-1j * turn * distance)
    sums = []
    for _ in frequencies:
        sums.append(one.sum())
        one = one * by
    return np.array(sums)


def rough(times: Array, placed: Place, eye: Array, frequency: float, step: float) -> npt.NDArray[np.complex128]:
    """Echo of each point of the skin as if alone, its power by its area across, shape (num_points, num_times)."""
    columns = []
    for time in times:
        distance, across = seen(float(time), placed, eye, step)
        columns.append(np.sqrt(across) / distance**2 * np.exp(-4j * np.pi * frequency / SPEED_OF_LIGHT * distance))
    return np.stack(columns, axis=1)
