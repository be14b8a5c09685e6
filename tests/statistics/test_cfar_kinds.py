"""False-alarm rates of all thresholds: in noise down to 1e-6, and at an edge of clutter."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.special

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.signal.detection.statistics import Halves, factor, rate_of_each
from scarl_sionna.signal.detection.threshold import (
    GUARD,
    KINDS,
    RANK,
    TRAINING,
    Statistic,
    TrainingWindow,
    _level,
    cfar,
    exceeds,
)
from scarl_sionna.signal.processing import RangeDoppler, range_doppler
from scarl_sionna.signal.windows import window_values

RADAR = RadarSpec().with_(num_chirps=64, num_samples=128)
ONE = RADAR.with_(tx_positions=((0, 0, 0),), rx_positions=((0, 0, 0),))


def noise(radar: RadarSpec, window: str, rng: np.random.Generator) -> tuple[RangeDoppler, float]:
    """Return a map of noise and the mean power of its cells."""
    shape = (radar.num_virtual, 64, 128)
    cube = (rng.normal(size=shape) + 1j * rng.normal(size=shape)).astype(np.complex64)
    mean = 2.0 * np.sum(window_values(window, 64) ** 2) * np.sum(window_values(window, 128) ** 2)
    return range_doppler(cube, radar, window), float(mean)


@pytest.mark.some(7)  # all thresholds, all radars and windows
@pytest.mark.parametrize(("radar", "window"), [(ONE, "rect"), (RADAR, "rect"), (RADAR, "hann"), (ONE, "hann")])
@pytest.mark.parametrize("kind", KINDS)
def test_false_alarms_from_1e_2_to_1e_6(radar: RadarSpec, window: str, kind: str) -> None:
    """The levels of the training cells are measured; the cell itself, independent beyond the guard, is gamma."""
    rng, levels = np.random.default_rng(1), []
    for _ in range(12 if radar is RADAR else 24):
        rd, mean = noise(radar, window, rng)
        training = TrainingWindow.of(rd, GUARD, TRAINING)
        offsets, side = training.offsets(kind)
        rows, columns = (axis.ravel() for axis in np.meshgrid(range(0, 64, 2), range(11, 117, 2), indexing="ij"))
        values = rd.power[(rows[:, None] + offsets[:, 0]) % 64, columns[:, None] + offsets[:, 1]] / mean
        halves = [
            _level(part, np.ones_like(part, bool), np.full(len(part), part.shape[1]), kind, RANK)
            for part in (values[:, side == half] for half in range(side.max() + 1))
        ]
        levels.append(np.min(halves, axis=0) if kind == "so" else np.max(halves, axis=0))
    counts = [int((side == half).sum()) for half in (0, 1)]
    for pfa in (1e-2, 1e-4, 1e-6):
        threshold = factor(kind, pfa, radar.num_virtual, Halves(*counts, training.loss), RANK)
        threshold *= training.linked(kind, pfa, radar.num_virtual, RANK)
        scaled = radar.num_virtual * threshold * np.concatenate(levels)
        rate = scipy.special.gammaincc(radar.num_virtual, scaled).mean() / pfa
        assert rate == pytest.approx(1.0, abs=0.15)  # from the issue


@pytest.mark.some(7)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("along", ["either", "both", "range", "doppler"])
def test_alarms_are_as_many_as_asked_for(kind: str, along: str) -> None:
    """The whole detector, counted; without a window, where training cells are independent."""
    rng, alarms, cells = np.random.default_rng(7), 0, 0
    for _ in range(10):
        rd, _ = noise(RADAR, "rect", rng)
        alarms, cells = alarms + int(cfar(rd, 1e-2, kind=kind, along=along).sum()), cells + rd.power.size
    # 820 alarms expected: sigma 3.5 %, and what a map's shared training cells add
    assert alarms / cells == pytest.approx(1e-2, rel=0.15)


def test_the_ordered_statistic_is_the_closed_form_for_one_look() -> None:
    """Rohling's product for exponential cells: Pfa = prod (n - i) / (n - i + T), i < k."""
    count = 16
    threshold = factor("os", 1e-4, 1, Halves(count, 0, 1.0), 0.75)
    rest = count - np.arange(12)
    assert np.prod(rest / (rest + threshold)) == pytest.approx(1e-4, rel=1e-6)
    # cell averaging: (1 + T / n)^-n; greatest of two halves of m: 2 (1 + T/m)^-m - 2 sum (..) (Hansen and Sawyers)
    mean = factor("ca", 1e-4, 1, Halves(count, 0, 1.0), 0.75)
    assert (1.0 + mean / count) ** -count == pytest.approx(1e-4, rel=1e-6)
    greatest, half = factor("go", 1e-4, 1, Halves(8, 8, 1.0), 0.75), 8
    terms = scipy.special.comb(half - 1 + np.arange(half), np.arange(half)) * (2.0 + greatest / half) ** -np.arange(
        half
    )
    exact = 2.0 * (1.0 + greatest / half) ** -half - 2.0 * (2.0 + greatest / half) ** -half * terms.sum()
    assert exact == pytest.approx(1e-4, rel=1e-6)


EDGES = 20
"""Maps: 1280 cells for each of the 24 distances from the edge, a rate of 0.1 to 8 % (one sigma)."""


def edge_rate(kind: str, pfa: float) -> float:
    """Return the largest false-alarm rate over the cells about a step of 25 dB, over the nominal one."""
    rng, rates = np.random.default_rng(11), []
    rd, mean = noise(RADAR, "rect", rng)
    training = TrainingWindow.of(rd, GUARD, TRAINING)
    columns = range(52, 76)
    hits = np.zeros(24)
    for _ in range(EDGES):
        rd, mean = noise(RADAR, "rect", rng)
        power = rd.power / mean
        power[:, 64:] *= 10.0**2.5
        rows, where = np.meshgrid(range(64), columns, indexing="ij")
        found = exceeds(training, power, (rows.ravel(), where.ravel()), RADAR.num_virtual, pfa, Statistic(kind))
        hits += found.reshape(64, -1).sum(axis=0)
    rates = hits / (EDGES * 64)
    return float(rates.max() / pfa)


def test_an_edge_of_clutter_makes_few_false_alarms() -> None:
    assert edge_rate("go", 1e-2) < 10.0 and edge_rate("osgo", 1e-2) < 10.0
    assert edge_rate("os", 1e-2) < 10.0
    assert edge_rate("so", 1e-2) > 50.0  # as theory says: it hears the quiet half


@pytest.mark.some(3)  # all thresholds, both windows
@pytest.mark.parametrize("window", ["rect", "hann"])
@pytest.mark.parametrize("kind", ["ca", "go", "os"])
def test_either_of_two_thresholds_has_the_rate_asked_for(kind: str, window: str) -> None:
    """Down to 1e-6, by the measured levels along Doppler and range of the same cells; the cell itself is gamma."""
    rng, looks, levels = np.random.default_rng(3), RADAR.num_virtual, []
    for _ in range(30):
        rd, mean = noise(RADAR, window, rng)
        rows, columns = (axis.ravel() for axis in np.meshgrid(range(0, 64, 4), range(11, 117, 4), indexing="ij"))
        both = []
        for along in ("doppler", "range"):
            training = TrainingWindow.of(rd, GUARD, TRAINING, along)
            offsets, side = training.offsets(kind)
            values = rd.power[(rows[:, None] + offsets[:, 0]) % 64, columns[:, None] + offsets[:, 1]] / mean
            parts = [values[:, side == half] for half in range(side.max() + 1)]
            found = [
                _level(part, np.ones_like(part, bool), np.full(len(part), part.shape[1]), kind, RANK) for part in parts
            ]
            both.append((np.max(found, axis=0), training))
        levels.append(np.stack([level for level, _ in both]))
        windows = both[0][1], both[1][1]
    measured = np.concatenate(levels, axis=1)
    for pfa in (1e-2, 1e-4, 1e-6):
        each = rate_of_each(kind, pfa, looks, (windows[0].halves(kind), windows[1].halves(kind)), RANK)
        assert 0.5 * pfa <= each < pfa
        thresholds = [
            factor(kind, each, looks, one.halves(kind), RANK) * one.linked(kind, each, looks, RANK) for one in windows
        ]
        lowest = np.min([threshold * level for threshold, level in zip(thresholds, measured, strict=True)], axis=0)
        rate = scipy.special.gammaincc(looks, looks * lowest).mean() / pfa
        assert rate == pytest.approx(1.0, abs=0.15)  # from the issue
