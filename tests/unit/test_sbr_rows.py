"""What `sbr` leaves out below its floor, against a loop over range bins."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.channel.sbr.rows import above_floor
from scarl_sionna.signal.noise import angle_cell_noise_power

RADAR = RadarSpec()
NOISE = angle_cell_noise_power(RADAR)
"""[W]"""


def columns_of(length: np.ndarray) -> dict[str, np.ndarray]:
    return {"length": length, "number": np.arange(len(length))}


def test_the_weakest_of_each_range_bin_go_while_their_sum_is_below_the_floor() -> None:
    rng = np.random.default_rng(2)
    bins = rng.integers(3, 103, 400)  # some four in each
    length = (bins + rng.uniform(0.0, 1.0, 400)) * 2.0 * RADAR.range_resolution
    amplitude = np.sqrt(NOISE) * 10.0 ** rng.uniform(-1.2, 0.2, 400)
    floor_db = -3.0
    allowed = np.sqrt(NOISE * 10.0 ** (floor_db / 10.0))  # all of a bin in phase [sqrt(W)]
    kept, in_phase = [], []
    for number in range(3, 103):
        total, inside = 0.0, np.flatnonzero(bins == number)
        for row in inside[np.argsort(amplitude[inside])]:
            if total + amplitude[row] > allowed:
                kept.append(row)
            else:
                total += amplitude[row]
        in_phase.append(total**2)
    rows, report = above_floor(columns_of(length), amplitude, RADAR, floor_db)
    assert rows["number"].tolist() == sorted(kept)
    gone = np.setdiff1d(np.arange(400), kept)
    assert report["floor_db"] == floor_db and report["num_dropped"] == len(gone) > 20
    assert report["dropped_power"] == pytest.approx(np.sum(amplitude[gone] ** 2), rel=1e-9, abs=0.0)
    assert report["in_phase_to_noise_db"] == pytest.approx(10.0 * np.log10(max(in_phase) / NOISE)) and max(in_phase) > 0


def test_nothing_goes_without_a_floor_or_without_rows() -> None:
    length, amplitude = np.array([10.0, 10.0]), np.zeros(2)
    rows, report = above_floor(columns_of(length), amplitude, RADAR, None)
    assert len(rows["length"]) == 2 and report["num_dropped"] == 0 and report["in_phase_to_noise_db"] is None
    rows, report = above_floor(columns_of(length[:0]), amplitude[:0], RADAR, 20.0)
    assert len(rows["length"]) == 0 and report["num_dropped"] == 0
    rows, report = above_floor(columns_of(length), amplitude, RADAR, 20.0)
    assert len(rows["length"]) == 0 and report["num_dropped"] == 2 and report["in_phase_to_noise_db"] is None
