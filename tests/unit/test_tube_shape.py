"""Footprints of tubes: exact triangles."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.radar.optics.tubes.probes import Probe
from scarl_sionna.radar.optics.tubes.tube_shape import (
    LARGEST_LATTICE,
    TOO_LONG,
    cut_off,
    halved,
    layouts,
    sides_and_height,
)


def area(tri: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.cross(tri[:, 1] - tri[:, 0], tri[:, 2] - tri[:, 0]), axis=1) / 2.0


def test_longest_side_and_height_of_known_triangles() -> None:
    right = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 3.0, 0.0]]  # sides 3, 4, 5
    flat = [[0.0, 0.0, 1.0], [10.0, 0.0, 1.0], [5.0, 0.0, 1.0]]
    longest, height = sides_and_height(np.array([right, flat]))
    assert longest == pytest.approx([5.0, 10.0], rel=1e-15)
    assert height == pytest.approx([3.0 * 4.0 / 5.0, 0.0], abs=1e-15)
    tri = np.random.default_rng(0).normal(size=(100, 3, 3))
    longest, height = sides_and_height(tri)
    assert longest * height / 2.0 == pytest.approx(area(tri), rel=1e-12)


def test_halves_share_the_area_and_the_longest_side_is_cut() -> None:
    tri = np.random.default_rng(1).normal(size=(50, 3, 3))
    halves = halved(tri)
    assert area(halves[:50]) == pytest.approx(area(tri) / 2.0, rel=1e-12)
    assert area(halves[50:]) == pytest.approx(area(tri) / 2.0, rel=1e-12)
    assert (sides_and_height(halves)[0].reshape(2, 50) <= sides_and_height(tri)[0] * (1.0 + 1e-12)).all()


def test_a_cut_loses_nothing() -> None:
    tri = np.random.default_rng(2).normal(size=(50, 3, 3))
    part = np.random.default_rng(3).uniform(0.1, 0.9, (50, 2, 1))
    border = tri[:, :1] + part * (tri[:, 1:] - tri[:, :1])
    tip, *rest = cut_off(tri, border)
    assert area(tip) == pytest.approx(area(tri) * part[:, 0, 0] * part[:, 1, 0], rel=1e-12)
    assert area(tip) + sum(map(area, rest)) == pytest.approx(area(tri), rel=1e-12)


def test_layouts_follow_length_and_width() -> None:
    wide, point = np.full(5, 0.1), np.full(5, 0.01)
    longest = np.array([0.005, 0.09, 0.35, 5.0, 0.35])
    height = np.array([0.005, 0.09, 0.3, 5.0, 0.05])
    kinds = layouts(longest, height, wide, point)
    assert kinds.tolist() == [
        0,
        1,
        4,
        TOO_LONG,
        LARGEST_LATTICE + 1,
    ]  # a point, few segments, a lattice, halved first, a sliver


def test_no_footprint_needs_no_probe() -> None:
    none = np.zeros(0, dtype=np.int64)
    assert Probe(None).within(np.zeros((0, 3, 3)), none, none, none).shape == (0,)
