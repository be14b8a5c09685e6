"""Numbers that the signal and its labels are made of, against plain formulas."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.labels.labels import _distinct
from scarl_sionna.radar.labels.lobes import Lobe, lobe_of, sides_of, without_main
from scarl_sionna.radar.labels.spread import PathCells, _Footing
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis.expansion import polynomials
from scarl_sionna.radar.synthesis.motion import Arms, PairTerms
from scarl_sionna.radar.synthesis.phase import outer_phasor, phasor
from scarl_sionna.signal.windows import window_values


def test_a_phasor_is_a_cosine_and_a_sine_to_the_last_digits() -> None:
    special = np.array([0.0, 0.125, 0.25, 0.5, -0.5, 0.75, 1.5, 2.5, 0.5 - 2.0**-53, 1e-300, 12345.0, -3.25])
    cycles = np.concatenate([np.random.default_rng(0).uniform(-40.0, 40.0, 10_000), special])
    angle = 2.0 * np.pi * (cycles - np.rint(cycles))
    found = phasor(cycles.reshape(-1, 4)).reshape(-1)
    assert np.abs(found - (np.cos(angle) + 1j * np.sin(angle))).max() < 2e-15  # a few roundings of 1.1e-16 each


@pytest.mark.parametrize("count", [1, 7, 32, 100])
def test_rows_of_phasors_are_products(count: int) -> None:
    rng = np.random.default_rng(4)
    start, step = rng.uniform(-30.0, 30.0, (2, 5))
    expected = phasor(start + np.arange(count)[:, None] * step)
    assert np.abs(outer_phasor(count, start, step) - expected).max() < 1e-11  # of 3e3 cycles in float64
    assert np.abs(outer_phasor(count, start, step, np.complex64) - expected).max() < 1e-6


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
    count, lobe = 64, lobe_of(window_values(window, 64))
    place = np.concatenate([np.random.default_rng(2).uniform(0.0, count, 200), [0.0, 5.0, 63.5, 10.0 / 256.0]])
    first, value = Lobe(lobe).at(place.reshape(2, -1), count, num_bins)
    bins = (first[..., None] + Lobe(lobe).columns(count, num_bins)) % num_bins
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


@pytest.mark.parametrize("num_bins", [64, 128, 100])
def test_sidelobes_beside_a_main_lobe_leave_out_zeros_only(num_bins: int) -> None:
    count, main = 64, len(lobe_of(window_values("hann", 64)))
    beside = without_main(sides_of(window_values("hann", count), 6), main)
    place = np.concatenate([np.random.default_rng(5).uniform(0.0, count, 200), [0.0, 5.0, 63.5, 10.0 / 256.0]])
    found = []
    for hole in (0, main):
        first, value = Lobe(beside, hole).at(place, count, num_bins)
        bins = (first[:, None] + Lobe(beside, hole).columns(count, num_bins)) % num_bins
        assert bins.shape[1] <= 13 * num_bins // count + 1 - (3 * num_bins // count if hole else 0)
        found.append(np.zeros((len(place), num_bins)))
        np.put_along_axis(found[-1], bins.astype(np.int64), value, axis=1)
    assert found[0].any()
    assert np.array_equal(*found)


def test_complex_weights_have_no_symmetric_lobe() -> None:
    with pytest.raises(TypeError):
        lobe_of(np.array([0.5, 0.5j]))


@pytest.mark.parametrize("columns", [[0, 1, 2], [0, 1, 5, 6], list(range(8)), []])
def test_cells_of_lobes_go_around_the_range_axis(columns: list[int]) -> None:
    first, after = np.array([[0, 13], [7, 13], [21, 23]]), np.array(columns, dtype=np.int32)
    number, cells = _Footing(first, after, 8, np.ones((3, 2, len(after)))).reached(24)
    expected = first[..., None] // 8 * 8 + (first[..., None] % 8 + after) % 8
    assert cells.shape == (5, len(after))
    assert np.array_equal(cells[number[first]], expected)


def _linear(radar: RadarSpec, mount: Mount, positions: np.ndarray) -> RadarPaths:
    count = len(positions)
    velocity = np.random.default_rng(7).uniform(-30.0, 30.0, (count, 3))
    paths = point_targets(positions, velocity, 1.0, radar, mount)
    return dataclasses.replace(paths, linear_motion=np.ones(count, dtype=np.bool_))


@pytest.mark.parametrize("end", ["tx_array", "rx_array"])
@pytest.mark.parametrize("off", [0.0, np.nan])
def test_linear_paths_that_end_at_any_antenna_are_refused(end: str, off: float) -> None:
    radar = RadarSpec().with_(multiplexing="tdm")
    paths = _linear(radar, Mount(Pose([0.0, 0.0, 0.0])), np.array([[5.0, 1.0, 0.0], [7.0, 1.0, 0.0], [9.0, -1.0, 0.0]]))
    points = paths.tx_point.copy()
    points[1] = getattr(radar, end)[1] + off
    paths = dataclasses.replace(paths, tx_point=points, rx_point=points.copy())
    pairs = PairTerms.of(paths, radar)
    assert pairs.is_linear
    with pytest.raises(ParameterRangeError, match="path 1 ends at an antenna"):
        pairs.shares(slice(0, 3))
    cells = PathCells.of(paths, radar)
    with pytest.raises(ParameterRangeError, match="path 1 ends at an antenna"):
        cells.put_middle(np.empty((3, radar.num_virtual), dtype=np.complex128))


def test_fields_of_linear_paths_are_those_of_any_path(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(6)
    radar = RadarSpec().with_(multiplexing="tdm")
    mount = Mount(Pose([1.0, 2.0, 0.5]), Twist([20.0, 1.0, 0.0], [0.0, 0.1, 0.7]))
    positions = mount.pose.position + rng.uniform((5.0, -40.0, -2.0), (150.0, 40.0, 2.0), (50, 3))
    paths = _linear(radar, mount, positions)
    assert PairTerms.of(paths, radar).is_linear
    found = []
    for _ in range(2):
        cells = PathCells.of(paths, radar)
        found.append(cells.put_middle(np.empty((50, radar.num_virtual), dtype=np.complex128)))
        monkeypatch.setattr(PairTerms, "is_linear", False)  # the way of all others
    assert np.abs(found[0] / found[1] - 1.0).max() < 1e-9
    assert np.ptp(np.angle(found[0] / found[0][:, :1])) > 1.0  # the channels differ


@pytest.mark.parametrize("values", [[3, 0, 3, 7, 0], [-2, 5, 5], [10**9, 4, 10**9], []])
def test_distinct_numbers_and_their_places(values: list[int]) -> None:
    numbers, place = _distinct(np.array(values, dtype=np.int64))
    assert numbers.tolist() == sorted(set(values))
    assert numbers[place].tolist() == values
