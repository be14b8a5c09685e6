"""Strips of the grid that straight paths are spread onto: what each holds, and that no order of the paths matters."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.synthesis import chirpz, direct
from scarl_sionna.radar.synthesis.spreading import GUARD, LOOSE, Spreader, Strips, along

RADAR = RadarSpec().with_(num_chirps=128)
TOLERANCE = 1e-4


def paths(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return amplitudes, lengths [m] up to the edges of the band, and rates [m/s]."""
    rng = np.random.default_rng(seed)
    length, rate = rng.uniform(1.0, 511.0, count), rng.uniform(-140.0, 140.0, count)
    length[:2], rate[:4] = (1.0, 511.0), (-140.0, 140.0, 140.0, -140.0)
    return np.exp(2j * np.pi * rng.uniform(size=count)), length, rate


def transform(length: np.ndarray, rate: np.ndarray, tolerance: float = TOLERANCE) -> chirpz.Transform:
    layout = chirpz.Layout.of(RADAR, length, rate, tolerance)
    assert layout is not None
    return chirpz.Transform(RADAR, layout, tolerance)


def test_order_of_paths_does_not_matter():
    amplitude, length, rate = paths(300)
    made = transform(length, rate)
    order = made.order(length, rate)
    assert sorted(order) == list(range(300)) and made._points(length, rate, 0).order is not None
    ordered = amplitude[order], length[order], rate[order]
    assert made._points(*ordered[1:], 0).order is None
    one, other = (made.signal(*rows, np.zeros(300), 0) for rows in ((amplitude, length, rate), ordered))
    exact = direct.sum_paths(amplitude, length, rate, np.zeros(300), RADAR, 0)
    assert np.abs(one - exact).max() < TOLERANCE * np.abs(exact).max()
    assert np.abs(one - other).max() < 1e-6 * np.abs(exact).max()


def test_strips_without_paths_stay_silent():
    amplitude, length, rate = paths(60)
    made = transform(length, rate)
    some = np.abs(rate - 100.0) < 60.0  # the strips of the others are empty, and the same memory was full before
    made.signal(amplitude, length, rate, np.zeros(60), 0)
    found = made.signal(amplitude[some], length[some], rate[some], np.zeros(some.sum()), 0)
    exact = direct.sum_paths(amplitude[some], length[some], rate[some], np.zeros(some.sum()), RADAR, 0)
    assert np.abs(found - exact).max() < TOLERANCE * np.abs(exact).max()


def test_correction_by_cells_is_that_by_paths(monkeypatch):
    amplitude, length, rate = paths(12)
    by_cell = transform(length, rate)
    assert by_cell._by_cell is not None and list(by_cell._spreaders) == [""]
    assert transform(length, rate, 1e-6)._by_cell is None  # too coarse there
    bound = by_cell._cell_error(1.0 + RADAR.waveform.sweep.slope * by_cell._grid.x / RADAR.center_frequency)
    assert bound <= chirpz.CORRECTION_SHARE * TOLERANCE
    monkeypatch.setattr(chirpz.Transform, "_cell_error", lambda *_: np.inf)
    by_path = transform(length, rate)
    assert list(by_path._spreaders) == ["", "migration"]
    for row in range(12):  # alone, at the ends of range and speed too
        lone = amplitude[[row]], length[[row]], rate[[row]], np.zeros(1), 0
        apart = np.abs(by_cell.signal(*lone) - by_path.signal(*lone)).max()
        assert apart < bound + 0.5 * chirpz.CORRECTION_SHARE * TOLERANCE  # the narrow kernel's own error


@pytest.mark.parametrize("span", [(3.0, 40.0), (-4.0, 69.5), (60.0, 140.0)])
def test_fold_adds_what_goes_round(span):
    strips = Strips.over(64, span, 300.0)
    rng = np.random.default_rng(0)
    cells = rng.normal(size=strips.shape) + 1j * rng.normal(size=strips.shape)
    weights = rng.normal(size=(strips.reach, 1))
    found = [np.full((64, strips.shape[1]), 7.0 + 0j) for _ in range(2)]
    strips.fold(cells, found[0], (found[1], weights))
    for values, expected in zip(found, (cells, cells * weights), strict=True):
        whole = np.zeros_like(values)
        np.add.at(whole, (strips.first_row + np.arange(strips.reach)) % 64, expected)
        assert np.abs(values - whole).max() < 1e-12


def test_strips_hold_their_points_and_cover_all_cells():
    strips = Strips.over(768, (0.0, 768.0), 1000.0)
    column = GUARD + np.sort(np.random.default_rng(0).uniform(0.0, 1000.0, 5000))
    slices = strips.slices(column)
    assert slices is not None and slices[-1].stop == 5000
    for number, inside in enumerate(slices):
        place = column[inside] - number * strips.width  # in the strip's own cells
        assert place.min() >= GUARD and place.max() <= GUARD + strips.width
    done = np.concatenate([np.arange(strips.columns)[strips.columns_of(number)] for number in range(strips.count)])
    assert np.array_equal(done, np.arange(strips.columns))
    # a little out of order is held by the guard, more is not
    for aside, held in ((0.9 * LOOSE, True), (1.1 * LOOSE, False)):
        late = column.copy()
        late[slices[3].stop - 1] = GUARD + 3 * strips.width - aside
        assert (strips.slices(late) is not None) == held


@pytest.mark.parametrize(("num_samples", "num_chirps"), [(512, 256), (64, 1), (5, 3)])
def test_a_kernel_over_samples_and_chirps_is_that_of_each(num_samples: int, num_chirps: int) -> None:
    kernel = Spreader("complex128", 1e-9, 2.0).kernel_transform()
    x = (np.arange(num_samples) - (num_samples - 1) / 2.0) * 5e-8
    y = (np.arange(num_chirps) - (num_chirps - 1) / 2.0) * 6e-5
    stretch = (1.0 + 0.006 * x / x[-1]) * 0.25 / (x[-1] + y[-1])
    expected = kernel((x[:, None] + y) * stretch[:, None])
    np.testing.assert_allclose(along(kernel, x, stretch, y), expected, rtol=1e-12)
