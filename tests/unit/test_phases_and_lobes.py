"""Numbers that the signal and its labels are made of, against plain formulas."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scarl_sionna.radar.labels.spread import _Lobe, main_lobe
from scarl_sionna.radar.synthesis.expansion import polynomials
from scarl_sionna.radar.synthesis.motion import Arms
from scarl_sionna.radar.synthesis.phase import phasor


def test_a_phasor_is_a_cosine_and_a_sine_to_the_last_digits() -> None:
    special = np.array([0.0, 0.125, 0.25, 0.5, -0.5, 0.75, 1.5, 2.5, 0.5 - 2.0**-53, 1e-300, 12345.0, -3.25])
    cycles = np.concatenate([np.random.default_rng(0).uniform(-40.0, 40.0, 10_000), special])
    angle = 2.0 * np.pi * (cycles - np.rint(cycles))
    found = phasor(cycles.reshape(-1, 4)).reshape(-1)
    assert np.abs(found - (np.cos(angle) + 1j * np.sin(angle))).max() < 2e-15  # a few roundings of 1.1e-16 each


def test_polynomials_are_cosines_of_multiples() -> None:
    values = np.concatenate([np.random.default_rng(3).uniform(-1.0, 1.0, 1000), [-1.0, 0.0, 1.0, 1.0 + 1e-9]])
    angle = np.arccos(np.clip(values, -1.0, 1.0))
    for count in (1, 2, 12):
        found = polynomials(values.reshape(4, -1), count).reshape(count, -1)
        np.testing.assert_allclose(found, np.cos(np.arange(count)[:, None] * angle), atol=1e-13)


@pytest.mark.parametrize("spin", [(0.0, 0.0, 0.0), (0.0, 0.0, 0.3), (0.4, -1.0, 2.0)])
def test_arms_turn_as_rotations_do(spin: tuple[float, float, float]) -> None:
    rng = np.random.default_rng(1)
    arms, times = Arms(rng.normal(size=(2, 3)), np.array(spin)), np.array([0.0, 0.01, 5.0])
    place, velocity, acceleration = arms.motion(1, times)
    expected = Rotation.from_rotvec(times[:, None] * arms.spin).apply(arms.start[1])
    np.testing.assert_allclose(place, expected, atol=1e-14)
    np.testing.assert_allclose(velocity, np.cross(arms.spin, expected), atol=1e-14)
    np.testing.assert_allclose(acceleration, np.cross(arms.spin, np.cross(arms.spin, expected)), atol=1e-13)


@pytest.mark.parametrize("num_bins", [64, 128, 192, 100])
@pytest.mark.parametrize("window", ["rect", "hann", "hamming"])
def test_a_lobe_on_bins_is_its_table_at_their_distances(window: str, num_bins: int) -> None:
    count, lobe = 64, main_lobe(window, 64)
    place = np.concatenate([np.random.default_rng(2).uniform(0.0, count, 200), [0.0, 5.0, 63.5, 10.0 / 256.0]])
    bins, value = _Lobe(lobe).bins(place.reshape(2, -1), count, num_bins)
    assert bins.min() >= 0
    assert bins.max() < num_bins
    apart = bins.reshape(len(place), -1) * (count / num_bins) - place[:, None]
    apart = np.abs(apart - count * np.rint(apart / count))
    step = np.arange(len(lobe)) / 256.0
    expected = np.where(apart <= step[-1], np.interp(apart, step, lobe), 0.0)
    cut = np.abs(apart - step[-1]) < 1e-9  # on either side of the lobe's end by rounding
    np.testing.assert_allclose(value.reshape(expected.shape)[~cut], expected[~cut], atol=1e-10 * lobe[0])
    covered = np.zeros((len(place), num_bins), dtype=np.bool_)
    np.put_along_axis(covered, bins.reshape(len(place), -1).astype(np.int64), True, axis=1)
    every = np.arange(num_bins) * (count / num_bins) - place[:, None]
    every = np.abs(every - count * np.rint(every / count))
    assert covered[every < step[-1] - 1e-9].all()  # no bin of the lobe is left out
