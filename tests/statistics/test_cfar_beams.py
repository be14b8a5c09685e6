"""False-alarm rates of thresholds over few linked cells, of one look as in a beam or a single channel, and of more."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.signal.angle import range_doppler_angle
from scarl_sionna.signal.detection.beams import beams_above
from scarl_sionna.signal.detection.correlated import Links, factor_of_links
from scarl_sionna.signal.detection.statistics import factor
from scarl_sionna.signal.detection.threshold import KINDS, RANK, TrainingWindow
from scarl_sionna.signal.processing import range_doppler

ONE = RadarSpec().with_(num_chirps=64, num_samples=128, tx_positions=((0, 0, 0),), rx_positions=((0, 0, 0),))
SMALL = RadarSpec().with_(num_chirps=32, num_samples=64)


def noise(radar: RadarSpec, seed: int) -> np.ndarray:
    rng, shape = np.random.default_rng(seed), (radar.num_virtual, radar.num_chirps, radar.num_samples)
    return (rng.normal(size=shape) + 1j * rng.normal(size=shape)).astype(np.complex64)


@pytest.fixture(scope="module")
def levels() -> dict[str, np.ndarray]:
    """Levels of 16 training cells beside many cells of noise under Hann, by the transform itself; numpy only."""
    rng = np.random.default_rng(2)
    lines = rng.normal(size=(16000, 64)) + 1j * rng.normal(size=(16000, 64))
    taper = np.sin(np.pi * (np.arange(64) + 0.5) / 64) ** 2
    power = np.abs(np.fft.fft(lines * taper, axis=1)) ** 2 / (2.0 * np.sum(taper**2))
    below = np.stack([power[:, middle - 11 : middle - 3] for middle in range(11, 53, 3)], axis=1).reshape(-1, 8)
    above = np.stack([power[:, middle + 4 : middle + 12] for middle in range(11, 53, 3)], axis=1).reshape(-1, 8)
    both = np.sort(np.concatenate([below, above], axis=1), axis=1)
    means = below.mean(axis=1), above.mean(axis=1)
    ranked = np.sort(below, axis=1)[:, 5], np.sort(above, axis=1)[:, 5]
    return {
        "ca": both.mean(axis=1),
        "go": np.maximum(*means),
        "so": np.minimum(*means),
        "os": both[:, 11],
        "osgo": np.maximum(*ranked),
    }


@pytest.mark.parametrize("kind", KINDS)
def test_the_factor_of_linked_cells_makes_the_rate_asked_for(kind: str, levels: dict[str, np.ndarray]) -> None:
    """One row of one look under Hann; counting independent cells made 0.04 to 0.5 of the alarms at 1e-6."""
    rd = range_doppler(noise(ONE, 0), ONE.with_(num_samples=128), "hann")
    window = TrainingWindow.of(rd, (3, 3), (6, 8), "range")
    for pfa in (1e-2, 1e-4, 1e-6):
        independent = factor(kind, pfa, 1, window.halves(kind), RANK)
        rates = np.exp(-independent * window.linked(kind, pfa, 1, RANK) * levels[kind])
        # from the issue: 15 %; and what so many levels cannot tell of their rare quiet ones
        scatter = rates.std() / rates.mean() / np.sqrt(len(rates))
        assert rates.mean() == pytest.approx(pfa, rel=0.15 + 3.0 * scatter)
        if pfa < 1e-5 and kind != "osgo":
            assert np.mean(np.exp(-independent * levels[kind])) < 0.7 * pfa


def test_independent_cells_have_the_known_factors() -> None:
    """The nodes against the integrals that hold for independent cells."""
    rect = TrainingWindow.of(range_doppler(noise(ONE, 0), ONE, "rect"), (3, 3), (6, 8), "range")
    assert rect.linked("os", 1e-6, 1, RANK) == 1.0
    for kind in KINDS:
        links = Links(*[np.eye(16 if kind in ("ca", "os") else 8, dtype=complex)] * (1 if kind in ("ca", "os") else 2))
        for pfa, num_looks in ((0.5, 1), (1e-3, 1), (1e-6, 1), (1e-6, 12)):
            exact = factor(kind, pfa, num_looks, rect.halves(kind), RANK)
            # of one look, 0.06 in the factor is about 15 % of the rate at 1e-6
            found = factor_of_links(kind, pfa, num_looks, links, RANK)
            assert found == pytest.approx(exact, rel=0.05 / np.sqrt(num_looks))


@pytest.mark.parametrize("window", ["rect", "hann"])
@pytest.mark.parametrize("along", ["either", "both"])
def test_alarms_of_beams_are_as_many_as_asked_for(window: str, along: str) -> None:
    """Counted over the beams of a map, every twelfth of a turn, which are independent of each other."""
    alarms, cells = 0, 0
    for seed in range(3):
        rda = range_doppler_angle(noise(SMALL, seed), SMALL, window, num_azimuth=SMALL.num_virtual)
        found = beams_above(rda, 1e-2, ((3, 3), (6, 8)), along=along)
        alarms, cells = alarms + int(found.sum()), cells + found.size
    # some 700 alarms: sigma 4 %, more where a window links cells
    assert alarms / cells == pytest.approx(1e-2, rel=0.15)
