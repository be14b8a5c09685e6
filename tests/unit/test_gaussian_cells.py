"""Cells of a volume against sums over its directions, row by row: power, velocity, and what is free."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.weather import cells
from scarl_sionna.radar.weather.cells import Rows, Scatter, gaussian_cells

RADAR = RadarSpec()
ROWS = Rows(np.linspace(1.0, 40.0, 31), np.linspace(2.0, 0.1, 31))
SHARE = np.array([0.2, 0.5, 0.3])


def scatter(spread: float, number: int = 400) -> Scatter:
    """Return directions to the front of weights over nine decades, half of them hidden beyond some distance."""
    rng = np.random.default_rng(3)
    direction = rng.standard_normal((number, 3)) * [1.0, 0.7, 0.4]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    free = np.where(rng.random(number) < 0.5, 60.0 * rng.random(number), np.inf)
    weight = 10.0 ** (-9.0 * rng.random(number))
    return Scatter(direction, weight, free, 3.0 * rng.standard_normal((number, 3)), SHARE, spread)


def exact(air: Scatter) -> tuple[np.ndarray, np.ndarray]:
    """Return power and power times mean velocity of each row."""
    is_free = ROWS.distance[:, None] <= air.free
    power = ROWS.strength * (is_free @ air.weight)
    return power, ROWS.strength * (is_free @ (air.weight * (air.velocity @ SHARE)))


@pytest.mark.parametrize("spread", [0.0, 0.01, 0.5])
@pytest.mark.parametrize("block", [1, 1 << 20])
def test_rows_have_the_power_of_what_is_free_there(monkeypatch, spread: float, block: int) -> None:
    """To 2e-9, the tail beyond six deviations; where a spectrum is narrower than its points the mean over shifts."""
    monkeypatch.setattr(cells, "BLOCK", block)
    air = scatter(spread)
    found = gaussian_cells(air, RADAR, ROWS, 1e-18, 10**9, np.random.default_rng(1))
    row = np.searchsorted(ROWS.distance, found.distance)
    power, moment = exact(air)
    shown = np.bincount(row, found.power, len(power))
    assert shown == pytest.approx(power, rel=1e-8 if spread == 0.5 else 0.1)
    bins = RADAR.velocity_resolution / cells.FINE
    assert np.bincount(row, found.power * found.velocity) / shown == pytest.approx(moment / power, abs=1.5 * bins)


def test_weak_cells_are_drawn_with_the_right_mean() -> None:
    """Within five standard errors of 200 draws, for rows of which most cells are below the threshold."""
    air = scatter(0.5)
    power, _ = exact(air)
    sums = np.zeros((200, len(power)))
    for seed, line in enumerate(sums):
        found = gaussian_cells(air, RADAR, ROWS, 2.0, 10**9, np.random.default_rng(seed))
        assert len(found.power) < 2_000 and found.power.min() >= 2.0 * (1.0 - 1e-12)
        line += np.bincount(np.searchsorted(ROWS.distance, found.distance), found.power, len(power))
    error = sums.std(axis=0, ddof=1) / np.sqrt(len(sums))
    assert (error > 0.0).all()
    assert (np.abs(sums.mean(axis=0) - power) < 5.0 * error).all()


def test_cells_lie_in_directions_that_are_free() -> None:
    """Two directions far apart, one hidden from 10 m on: the hidden one has no cells beyond."""
    unit = np.array([[0.8, 0.6, 0.0], [0.8, -0.6, 0.0]])
    air = Scatter(unit, np.ones(2), np.array([10.0, np.inf]), np.zeros((2, 3)), SHARE, 0.5)
    found = gaussian_cells(air, RADAR, ROWS, 1e-12, 10**9, np.random.default_rng(0))
    left = found.direction[:, 1] > 0.0
    assert found.distance[left].max() < 10.0 and found.distance[~left].max() == ROWS.distance[-1]


@pytest.mark.parametrize("free", [0.0, np.inf])
def test_nothing_where_nothing_is_in_sight(free: float) -> None:
    number = 0 if np.isinf(free) else 5
    air = Scatter(np.ones((number, 3)), np.ones(number), np.full(number, free), np.zeros((number, 3)), SHARE, 0.5)
    assert len(gaussian_cells(air, RADAR, ROWS, 1e-12, 100, np.random.default_rng(0)).power) == 0


def test_directions_without_weight_have_no_cells() -> None:
    """Nor do they spoil the others: the same cells as without them, whole directions of the lattice among them."""
    air = scatter(0.5)
    left = air.direction[:, 1] > 0.0
    some = Scatter(air.direction[left], air.weight[left], air.free[left], air.velocity[left], SHARE, 0.5)
    dark = Scatter(air.direction, np.where(left, air.weight, 0.0), air.free, air.velocity, SHARE, 0.5)
    expected, found = (gaussian_cells(one, RADAR, ROWS, 1e-12, 10**9, np.random.default_rng(0)) for one in (some, dark))
    assert len(found.power) > 1_000
    for name in ("distance", "velocity", "direction", "power"):
        assert np.array_equal(getattr(found, name), getattr(expected, name)), name


def test_a_wide_direction_does_not_widen_a_block_of_narrow_ones(monkeypatch) -> None:
    """Each level of a block has the bins of the widest: no array is larger than `BLOCK`, but of a single direction."""
    monkeypatch.setattr(cells, "BLOCK", 20_000)
    air = scatter(0.5, 4_000)
    velocity = np.where(np.arange(4_000)[:, None] == 17, [[-30.0, 0.0, 30.0]], 0.05 * air.velocity)
    sizes, spectra = [], cells._spectra

    def measured(scatter: Scatter, lattice: cells._Lattice, levels: slice) -> np.ndarray:
        found = spectra(scatter, lattice, levels)
        num_rows = (lattice.farthest - lattice.nearest)[levels].sum()
        if len(np.unique(lattice.owner[levels])) > 1:
            sizes.append(max(2 * found.size, num_rows * (found.shape[1] // cells.FINE + 2)))
        return found

    monkeypatch.setattr(cells, "_spectra", measured)
    wide = Scatter(air.direction, air.weight, air.free, velocity, SHARE, 0.5)
    gaussian_cells(wide, RADAR, ROWS, 1e-3, 10_000, np.random.default_rng(0))
    assert len(sizes) > 2 and max(sizes) <= cells.BLOCK


def test_a_wide_spectrum_takes_memory_by_its_width_not_by_its_square() -> None:
    """One antenna tells no directions apart, and what passes at 200 m/s makes 16,000 bins of it: 2 GB before."""
    air = scatter(0.5, 60)
    velocity = air.velocity + 200.0 * np.sign(air.velocity[:, :1])
    wide = Scatter(air.direction, air.weight, air.free, velocity, SHARE, 0.05)
    radar = RADAR.with_(tx_positions=((0.0, 0.0, 0.0),), rx_positions=((0.0, 0.0, 0.0),))
    tracemalloc.start()
    found = gaussian_cells(wide, radar, ROWS, 1e-18, 10**9, np.random.default_rng(1))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    power, moment = exact(wide)
    row = np.searchsorted(ROWS.distance, found.distance)
    assert np.bincount(row, found.power, len(power)) == pytest.approx(power, rel=0.01)
    assert np.bincount(row, found.power * found.velocity) == pytest.approx(moment, abs=0.02 * np.abs(moment).max())
    assert peak < 100e6
