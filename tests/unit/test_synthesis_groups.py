"""Which paths are transformed together: each once, those of similar speed, at the least of the measured costs."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from scarl_sionna.core.specs.radar.array import HALF_WAVE, AntennaArray, uniform_line
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.tones import seen_by
from scarl_sionna.core.specs.radar.waveforms.coded import Ofdm, Pmcw
from scarl_sionna.radar.synthesis import chirpz, groups, nufft

RADAR = RadarSpec().with_(num_samples=128, num_chirps=64)
SAMPLES = 128 * 64


def rates(count: int, fastest: float) -> np.ndarray:
    return np.random.default_rng(0).uniform(-fastest, fastest, count)


def cost_of_equal_bins(rate: np.ndarray, count: int, tolerance: float) -> float:
    """Return the seconds of one pair with the paths in equal intervals of their rate, each with the box it needs."""
    edges = np.linspace(rate.min(), rate.max(), count + 1)[1:-1]
    number, total = np.searchsorted(edges, rate), 0.0
    for one in range(count):
        inside = rate[number == one]
        terms = np.prod(nufft.Box.of(RADAR, inside, np.zeros_like(inside), tolerance).num_terms)
        series = terms * (len(inside) * groups.SPREAD_COST + SAMPLES * groups.FFT_COST)
        total += min(len(inside) * SAMPLES * groups.DIRECT_COST, float(series))
    return total


@pytest.mark.parametrize(("fastest", "tolerance"), [(70.0, 1e-5), (200.0, 1e-3), (200.0, 1e-5), (200.0, 1e-7)])
def test_straight_paths_are_binned_as_is_cheapest(fastest: float, tolerance: float) -> None:
    rate = rates(30_000, fastest)
    found, cost = groups._series(RADAR, rate, np.zeros_like(rate), tolerance)
    tried = [cost_of_equal_bins(rate, count, tolerance) for count in range(1, groups.MAX_BINS + 1)]
    assert cost == pytest.approx(
        min(tried), rel=0.02
    )  # bins are chosen by their widths, boxes are as wide as their paths
    assert min(tried) < 0.9 * tried[0] and len(found) == 1 + int(np.argmin(tried))


@pytest.mark.parametrize("count", [1, 2, 40, 30_000])
def test_every_path_is_in_one_group_and_groups_do_not_overlap_in_speed(count: int) -> None:
    rate = rates(count, 200.0)
    acceleration = np.where(np.arange(count) % 2 == 0, 0.0, 30.0)
    found = groups.partition(RADAR, np.full(count, 80.0), rate, acceleration, 1e-5)
    assert np.array_equal(np.sort(np.concatenate([index for index, _ in found])), np.arange(count))
    for bends in (0.0, 30.0):
        spans = sorted(
            (rate[index].min(), rate[index].max()) for index, _ in found if np.all(acceleration[index] == bends)
        )
        assert all(first[1] < second[0] for first, second in pairwise(spans))
    assert all(len(np.unique(acceleration[index])) == 1 for index, _ in found)


def test_paths_of_one_speed_are_one_bin_and_a_gap_is_none() -> None:
    same = groups._velocity_bins(RADAR, np.full(9, 12.5), 1e-5)
    assert [index.tolist() for index in same] == [list(range(9))]
    two = groups._velocity_bins(RADAR, np.repeat([-300.0, 300.0], 20_000), 1e-5)
    assert [(int(index.min()), int(index.max()), len(index)) for index in two] == [
        (0, 19_999, 20_000),
        (20_000, 39_999, 20_000),
    ]


@pytest.mark.parametrize(("share", "chosen"), [(0.99, chirpz.Transform), (1.01, nufft.Transform)])
def test_straight_paths_take_the_cheaper_method_and_bent_ones_the_series(
    monkeypatch, share: float, chosen: type
) -> None:
    rate, straight = rates(2_000, 20.0), np.zeros(2_000)
    cost = groups._series(RADAR, rate, straight, 1e-5)[1]
    monkeypatch.setattr(groups, "_chirpz_cost", lambda *_: share * cost)
    length = np.linspace(10.0, 200.0, 2_000)
    assert {type(method) for _, method in groups.partition(RADAR, length, rate, straight, 1e-5)} == {chosen}
    bent = groups.partition(RADAR, length, rate, straight + 30.0, 1e-5)
    assert {type(method) for _, method in bent} == {nufft.Transform}


@pytest.mark.parametrize(("fastest", "most"), [(0.0, 1), (20.0, 3)])
def test_so_few_paths_that_transforms_do_not_pay_are_summed_plainly(fastest: float, most: int) -> None:
    """A term costs a transform of the frame, as dear as one path of the plain sum; 20 m/s need several."""
    for count in (most, most + 1):
        found = groups.partition(RADAR, np.full(count, 30.0), rates(count, fastest), np.zeros(count), 1e-5)
        assert all(method is None for _, method in found) == (count == most)


@pytest.mark.parametrize("fastest", [0.0, 5.0])
def test_paths_that_bend_are_halved_where_they_differ_most_until_their_series_is_short(fastest: float) -> None:
    """Bends of +-3000 m/s2 take 13 times 3 terms; a quarter of their range takes 7 times 3, below the limit of 24."""
    rng = np.random.default_rng(1)
    rate, bend = rates(20_000, fastest), rng.uniform(-3000.0, 3000.0, 20_000)
    bend[[0, 1]] = -3000.0, 3000.0
    assert np.prod(nufft.Box.of(RADAR, rate, bend, 1e-5).num_terms) > groups.MAX_TERMS
    found, cost = groups._series(RADAR, rate, bend, 1e-5)
    assert [set((bend[index] // 1500.0).astype(int).tolist()) - {2} for index, _ in found] == [{-2}, {-1}, {0}, {1}]
    terms = [np.prod(box.num_terms) for _, box in found if box is not None]
    assert len(terms) == 4 and max(terms) <= groups.MAX_TERMS
    assert cost == pytest.approx(
        sum(
            count * (len(index) * groups.SPREAD_COST + SAMPLES * groups.FFT_COST)
            for count, (index, _) in zip(terms, found, strict=True)
        )
    )


@pytest.mark.parametrize("waveform", [Ofdm(num_subcarriers=512), Pmcw(code_length=511)], ids=["ofdm", "pmcw"])
def test_tones_of_a_wide_array_take_one_spreading(waveform) -> None:
    """What is not mixed with ramps has no migration that differs between antennas: one term, as with one antenna."""
    wide = AntennaArray(tx_positions=uniform_line(12, 16 * HALF_WAVE), max_array_extent=1.0)
    radar = seen_by(RadarSpec(waveform=waveform, array=wide), every=True)
    box = np.array([6.0, 6.0, 500.0, 500.0]), np.array([-60.0, 60.0, -60.0, 60.0])
    assert chirpz.Layout.of(radar, *box, 4e-5).terms == ()
    assert isinstance(groups.straight(radar, *box, 100_000, 4e-5), chirpz.Transform)
