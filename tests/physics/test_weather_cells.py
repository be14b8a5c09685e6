"""Rain as Gaussian cells: exponential power of every cell, correlations over antennas and chirps, thinning."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.array import HALF_WAVE, uniform_line
from scarl_sionna.core.specs.radar.pattern import CosinePattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.radar.weather.cells import direction_steps, range_rows, thinned
from scarl_sionna.radar.weather.clutter import VolumeSampling, volume_clutter
from scarl_sionna.radar.weather.mean_clutter import falling
from scarl_sionna.signal.angle import range_doppler_angle
from scarl_sionna.signal.processing import virtual_cube

RADAR = RadarSpec().with_(num_chirps=64, num_samples=128, ramp_time=7.5e-6, bandwidth=150e6)
HEAVY = Weather(rain_rate=50.0)
SEEDS = 100


@pytest.fixture(scope="module")
def cubes():
    """Cubes of pure rain, without noise, shape (SEEDS, num_virtual, num_chirps, num_samples)."""
    return [
        virtual_cube(
            synthesize(
                volume_clutter(HEAVY, RADAR, Pose(), np.random.default_rng(s), sampling=VolumeSampling(110.0)), RADAR
            ),
            RADAR,
        )
        for s in range(SEEDS)
    ]


def ranged(cube, near: float, far: float):
    """Return the channels' chirps at ranges, by a transform with Hann's window, shape (num_virtual, chirps, bins)."""
    beat = np.fft.fft(cube * np.hanning(RADAR.num_samples), axis=-1)
    return beat[..., round(near / RADAR.range_resolution) : round(far / RADAR.range_resolution)]


@pytest.mark.slow
def test_cells_are_speckle_at_every_range(cubes) -> None:
    """E[P^2] = 2 E[P]^2, by the real processing, of the cells that are 10 dB over the noise, within 5 standard errors.

    The error is that of the means over eight groups of seeds. Random points instead of cells gave 2.3 to 4. Far away
    few cells are bright: over six hundreds of seeds 201 to 216 from 60 m on, which tell the ratio to 0.026 to 0.041
    (it was off by 1.5 errors at most), but 8 to 40 from 70 m on, to 0.041 to 0.114, too little for the bound of 0.05.
    All six together have 2.042 +- 0.013 from 8 to 16 m, 2.011 +- 0.008 from 25 to 40 m and 2.004 +- 0.013 beyond.
    """
    groups = np.array_split(np.arange(SEEDS), 8)
    first, second = (np.zeros((len(groups), *range_doppler_angle(cubes[0], RADAR).data.shape)) for _ in range(2))
    for group, part in enumerate(groups):  # one map at a time: a hundred of them are 0.6 GB
        for number in part:
            power = range_doppler_angle(cubes[number], RADAR).data.astype(np.float64)
            first[group] += power
            second[group] += power**2
    noise = range_doppler_angle(cubes[0], RADAR).noise_power
    bright = first.sum(axis=0) / SEEDS > 10.0 * noise
    for near, far in ((8.0, 16.0), (25.0, 40.0), (60.0, 100.0)):
        cells = np.zeros_like(bright)
        here = slice(round(near / RADAR.range_resolution), round(far / RADAR.range_resolution))
        cells[:, here] = bright[:, here]
        assert np.count_nonzero(cells) > 30
        ratio = []
        for group, part in enumerate(groups):
            size, square = len(part), second[group][cells].mean() / len(part)
            mean_squared = (np.mean(first[group][cells] ** 2) - size * square) / (size**2 - size)
            ratio.append(square / mean_squared)
        error = np.std(ratio, ddof=1) / np.sqrt(len(ratio))
        assert error < 0.05
        assert np.mean(ratio) == pytest.approx(2.0, abs=5.0 * error)


def directions() -> tuple[np.ndarray, np.ndarray]:
    """Return unit vectors over the front, and the two-way gain times the solid angle, on a grid of 0.25 deg."""
    angle = np.radians(np.arange(-90.0, 90.0, 0.25) + 0.125)
    azimuth, elevation = np.meshgrid(angle, angle, indexing="ij")
    weight = 10.0 ** (RADAR.array.pattern.gain_db(azimuth, elevation) / 5.0) * np.cos(elevation)
    unit = np.stack(
        [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)], axis=-1
    )
    return unit.reshape(-1, 3), weight.ravel() / weight.sum()


@pytest.mark.slow
def test_correlation_over_antennas_is_the_patterns(cubes) -> None:
    """Of all pairs of channels, to the ends of the array: the Fourier transform of the two-way gain (van Cittert)."""
    data = np.array([ranged(cube, 10.0, 60.0) for cube in cubes])
    virtual = (RADAR.tx_array[:, None] + RADAR.rx_array[None]).reshape(-1, 3)
    unit, weight = directions()
    power = np.mean(np.abs(data) ** 2)
    for lag in range(1, RADAR.num_virtual):
        first, second = data[:, :-lag], data[:, lag:]
        each = (second * first.conj()).mean(axis=(1, 2, 3)) / power
        shift = virtual[lag] - virtual[0]
        expected = np.exp(2j * np.pi / RADAR.wavelength * (unit @ shift)) @ weight
        error = np.std(each, ddof=1) / np.sqrt(SEEDS)
        assert error < 0.03
        assert min(abs(each.mean() - value) for value in (expected, expected.conj())) < 5.0 * error


@pytest.mark.slow
def test_correlation_over_chirps_is_the_spectrums(cubes) -> None:
    """Turbulence, a Gaussian, and fall, over the pattern; to lags of most of the frame, where nothing comes back."""
    data = np.array([ranged(cube, 10.0, 60.0) for cube in cubes])
    drops = falling(HEAVY, RADAR.center_frequency)[0]
    unit, weight = directions()
    power = np.mean(np.abs(data) ** 2)
    for lag in (1, 3, 10, 30, 50, 60):
        time = lag * RADAR.doppler_interval
        turn = 4.0 * np.pi / RADAR.wavelength * time
        fall = np.histogram(unit[:, 2], np.linspace(-1.0, 1.0, 401), weights=weight)[0]
        sine = np.linspace(-1.0, 1.0, 401)[:-1] + 0.0025
        phases = np.exp(1j * turn * np.outer(sine, drops.fall_speed)) @ drops.backscatter_share
        expected = abs(fall @ phases) * np.exp(-0.5 * (turn * HEAVY.turbulence) ** 2)
        each = (data[:, :, lag:] * data[:, :, :-lag].conj()).mean(axis=(1, 2, 3)) / power
        error = np.std(each, ddof=1) / np.sqrt(SEEDS)
        assert error < 0.03
        assert abs(abs(each.mean()) - expected) < 5.0 * error


def test_directions_of_the_lattice_are_those_of_the_array() -> None:
    """A line of 12 elements at half a wavelength: 12 directions over the sine; a single antenna tells none apart."""
    y, z = direction_steps(RADAR)
    assert y == pytest.approx(2.0 / 12.0, rel=0.01)
    assert np.isinf(z)
    flat = RadarSpec().with_(
        tx_positions=((0.0, 0.0, 0.0), (0.0, 0.0, HALF_WAVE)), rx_positions=uniform_line(4, HALF_WAVE)
    )
    assert direction_steps(flat) == pytest.approx((0.5, 1.0), rel=0.01)


def test_a_fine_array_has_a_point_in_every_beam() -> None:
    """120 x 120 elements at half a wavelength, 0.95 deg both ways: in no row a beam within 6 deg is empty."""
    upright = tuple((0.0, 0.0, k * HALF_WAVE) for k in range(120))
    narrow = CosinePattern(peak_gain_dbi=20.0, half_power_azimuth_deg=8.0, half_power_elevation_deg=8.0)
    square = RADAR.with_(
        num_chirps=4, tx_positions=upright, rx_positions=uniform_line(120, HALF_WAVE), pattern=narrow, tx_power_dbm=30.0
    )
    paths = volume_clutter(
        HEAVY, square, Pose(), np.random.default_rng(0), sampling=VolumeSampling(2.0, 1_000_000, 1.5)
    )
    distance = np.linalg.norm(paths.tx_point, axis=1)
    steps = direction_steps(square)
    assert steps == pytest.approx((1.0 / 60.0, 1.0 / 60.0), rel=0.01)
    for row in np.unique(distance.round(6)):
        sines = (paths.tx_point / distance[:, None])[distance.round(6) == row, 1:]
        cells = np.unique(np.floor(sines[np.all(np.abs(sines) < 0.1, axis=1)] / steps), axis=0)
        assert len(cells) >= 11 * 11


def test_rows_integrate_without_bias() -> None:
    """The mean over shifts of the sum of 1 / R^2 over rows is its integral; a row stands for an eighth of its range."""
    sums = []
    for seed in range(400):
        rows, width = range_rows(1.0, 0.25, 40.0, np.random.default_rng(seed))
        assert np.all(np.diff(rows) > 0.0)
        assert rows[0] >= 0.25
        assert rows[-1] <= 40.0
        assert np.all(width <= np.maximum(rows / 4.0, 0.04))
        sums.append(np.sum(width / rows**2))
    error = np.std(sums, ddof=1) / 20.0
    assert np.mean(sums) == pytest.approx(1.0 / 0.25 - 1.0 / 40.0, abs=5.0 * error)
    assert error < 0.01


def test_thinning_keeps_the_mean() -> None:
    rng = np.random.default_rng(0)
    power = rng.exponential(size=10_000) ** 3
    found = [thinned(power, 2_000, rng) for _ in range(50)]
    number = [len(kept) for kept, _ in found]
    assert np.mean(number) == pytest.approx(2_000, abs=5.0 * np.sqrt(2_000 / 50))
    sums = [raised.sum() for _, raised in found]
    assert np.mean(sums) == pytest.approx(power.sum(), abs=5.0 * np.std(sums, ddof=1) / np.sqrt(50))
    kept, same = thinned(power, 10_000, rng)
    assert np.array_equal(same, power)
    assert len(kept) == 10_000
