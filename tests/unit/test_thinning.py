"""Thinning of hits: shares, limits, order."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.channel.raycast.thinning import ResolutionCells, _sorted, thin
from tests.scenes import Thing, plane, write_scene


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(0, 3000), st.integers(1, 40), st.integers(1, 300))
def test_power_of_every_cell_is_kept(seed: int, num_hits: int, hits_per_cell: int, num_cells: int) -> None:
    generator = np.random.default_rng(seed)
    cell = generator.integers(0, num_cells, num_hits)
    power = 10.0 ** generator.uniform(-18, -8, num_hits)
    kept, growth = thin(cell, power, hits_per_cell)
    assert (np.diff(kept) > 0).all() and (growth > 0).all()
    before = np.bincount(cell, power, num_cells)
    after = np.bincount(cell[kept], power[kept] * growth, num_cells)
    # Shares are counted, not added up: what is left is the rounding of a product and of two sums of up to 3000 terms.
    assert after == pytest.approx(before, rel=1e-11)
    counts = np.bincount(cell, minlength=num_cells)
    left = np.bincount(cell[kept], minlength=num_cells)
    assert (left <= np.maximum(hits_per_cell, 0)).all()
    sparse = counts <= hits_per_cell
    assert np.array_equal(left[sparse], counts[sparse])
    assert (growth[sparse[cell[kept]]] == 1.0).all()
    assert (left[counts > 0] > 0).all()


def test_equal_hits_are_taken_at_even_steps() -> None:
    kept, growth = thin(np.zeros(88, dtype=np.int64), np.ones(88), 8)
    assert np.array_equal(np.diff(kept), np.full(7, 11)) and growth == pytest.approx(np.full(8, 11.0), rel=1e-12)


def test_a_dominant_hit_stays_with_its_power() -> None:
    power = np.full(1000, 1e-6)
    power[417] = 1.0
    kept, growth = thin(np.zeros(1000, dtype=np.int64), power, 8)
    place = int(np.flatnonzero(kept == 417)[0])
    # All 8 shares of 1.000999 fall on it, since the others hold less than half a share together.
    assert growth[place] == pytest.approx(1.000999, rel=1e-9) and len(kept) == 1


def test_cells_are_half_a_bin_wide() -> None:
    radar = RadarSpec()
    cells = ResolutionCells.of(radar)
    assert cells.range_width == pytest.approx(radar.range_resolution / 2)
    assert cells.velocity_width == pytest.approx(radar.velocity_resolution / 2)
    # Apertures of 8 + 3 half waves: a beam of 2 / 11 in the sine, in half; no aperture upwards: the coarsest cell.
    assert cells.cosine_widths == pytest.approx((1 / 11, 0.1))


def test_hits_of_different_cells_and_instances_get_different_numbers() -> None:
    cells = ResolutionCells(0.25, 0.3, (0.1, 0.1))
    base = {"distance": 10.1, "radial_velocity": -5.1, "y": 0.01, "z": 0.01, "instance": 1}
    rows = [base] + [
        {**base, **change}
        for change in (
            {"distance": 10.3},
            {"radial_velocity": -4.7},
            {"y": 0.11},
            {"z": -0.01},
            {"instance": 2},
            {"y": -1.0},
        )
    ]
    columns = {name: np.array([row[name] for row in rows]) for name in base}
    columns["instance"] = columns["instance"].astype(np.int32)
    numbers = cells.number(**columns)
    assert len(set(numbers.tolist())) == len(rows)
    same = {name: np.repeat(column[:1], 2) for name, column in columns.items()}
    same["distance"] = same["distance"] + [0.0, 0.05]
    assert len(set(cells.number(**same).tolist())) == 1


def test_options_of_the_solver(tmp_path) -> None:
    wall = Thing("wall", plane(16.0, 16.0, (10, 0, 0), (-1, 0, 0)), "Wall", "grey")
    state = load_scene(write_scene(tmp_path, [wall])).at(0.0)
    radar = RadarSpec()
    every = solve_paths(state, radar, Pose(), "raycast", hits_per_cell=None, num_rays=50_000)
    few = solve_paths(state, radar, Pose(), "raycast", hits_per_cell=4, num_rays=50_000)
    geometric = solve_paths(state, radar, Pose(), "raycast", hit_phase="geometric", num_rays=50_000)
    assert every.num_paths == geometric.num_paths == every.diagnostics["num_hits"] == few.diagnostics["num_hits"]
    assert few.num_paths < every.num_paths
    assert geometric.diagnostics["hits_per_cell"] is None and few.diagnostics["hits_per_cell"] == 4
    for bad in (0, -1, True):
        with pytest.raises(ParameterRangeError, match="hits_per_cell"):
            solve_paths(state, radar, Pose(), "raycast", hits_per_cell=bad, num_rays=50_000)


@pytest.mark.parametrize("highest", [1, 1 << 40, 1 << 62])
def test_cells_are_sorted_as_a_stable_sort_does(highest: int) -> None:
    rng = np.random.default_rng(0)
    cell = rng.integers(-highest, highest, 40, dtype=np.int64)[rng.integers(0, 40, 500)]
    for some in (cell, cell[:1], cell[:0]):
        order, ordered = _sorted(some)
        assert np.array_equal(order, np.argsort(some, kind="stable"))
        assert np.array_equal(ordered, some[order])
