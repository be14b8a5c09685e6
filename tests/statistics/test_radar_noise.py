"""Moments of the receiver's noise and the false-alarm rate of the detector."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
import scipy.stats

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.seeds import generator
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.signal.converter import quantize
from scarl_sionna.signal.detection import cfar
from scarl_sionna.signal.noise import add_noise
from scarl_sionna.signal.processing import range_doppler, virtual_cube
from tests.oracles import link

RADAR = RadarSpec()
SHAPE = (4, 768, 512)


@pytest.fixture(scope="module")
def noise():
    return add_noise(np.zeros(SHAPE, dtype=np.complex64), RADAR, generator(0, "radar_noise", frame=0))


def test_power_is_ktbf(noise):
    expected = link.noise_power(RADAR.sample_rate, 10**1.2)
    count = noise.size
    # 1 % of the issue; sigma of the mean of 1.6e6 exponential powers is 0.08 %, so this is 12 sigma
    assert np.mean(np.abs(noise.astype(np.complex128)) ** 2) == pytest.approx(expected, rel=0.01)
    assert abs(np.mean(noise.astype(np.complex128))) < 5.0 * np.sqrt(expected / count)


def test_i_and_q_are_equal_independent_gaussians(noise):
    sample = noise.reshape(-1)[:200_000].astype(np.complex128)
    sigma = np.sqrt(link.noise_power(RADAR.sample_rate, 10**1.2) / 2.0)
    for part in (sample.real, sample.imag):
        assert scipy.stats.kstest(part / sigma, "norm").pvalue > 1e-4
    correlation = np.corrcoef(sample.real, sample.imag)[0, 1]
    assert abs(correlation) < 5.0 / np.sqrt(len(sample))
    lag = np.vdot(sample[:-1], sample[1:]) / np.vdot(sample, sample).real
    assert abs(lag) < 5.0 / np.sqrt(len(sample))


def test_floor_of_a_cell(noise):
    rd = range_doppler(virtual_cube(noise, RADAR), RADAR)
    # 12 x 131,072 cells, a Hann window in two dimensions leaves 1 in 2.25 independent: sigma 0.12 %
    assert rd.power.mean() == pytest.approx(rd.noise_power, rel=0.01)


@pytest.mark.parametrize("window", ["rect", "hann"])
@pytest.mark.parametrize("pfa", [1e-2, 1e-3])
def test_false_alarm_rate(window, pfa):
    alarms, cells = 0, 0
    for seed in range(6):
        draw = add_noise(np.zeros((4, 384, 512), dtype=np.complex64), RADAR, np.random.default_rng(seed))
        small = RADAR.with_(num_chirps=128)
        rd = range_doppler(virtual_cube(draw, small), small, window=window)
        found = cfar(rd, pfa)
        alarms += int(found.sum())
        cells += found.size
    # alarms of neighbouring cells under Hann come in clusters of up to 2.25: sigma grows by its root; 5 sigma.
    # the effective number of training cells is an approximation of their sum's distribution: 5 % on top
    sigma = np.sqrt(cells * pfa * (2.25 if window == "hann" else 1.0))
    assert abs(alarms - cells * pfa) < 5.0 * sigma + 0.05 * cells * pfa


def test_quantization_noise():
    radar = RADAR.with_(bits=8)
    rng = np.random.default_rng(2)
    amplitude = 0.5 * np.sqrt(10 ** ((radar.adc.full_scale_dbm - 30) / 10))
    tone = (amplitude * np.exp(2j * np.pi * rng.random(200_000))).astype(np.complex64)
    codes, scale, saturated = quantize(tone, radar)
    error = codes.astype(np.float64) @ [1.0, 1j] * scale - tone
    assert saturated == 0
    # uniform in +- half a step for each of I and Q; over 64 steps of a random phase the bound of 2 % is 5 sigma
    assert np.mean(np.abs(error) ** 2) == pytest.approx(scale**2 / 6.0, rel=0.02)


@pytest.mark.parametrize(("guard", "training", "pfa"), [((3, 3), (6, 8), 1e-4), ((2, 2), (1, 1), 1e-2)])
def test_correlated_training_cells_keep_the_false_alarm_rate(guard, training, pfa):
    """One channel under Hann.

    The field of the training cells has the covariance C, so exactly Pfa = 1 / det(1 + T C / N).
    """
    radar = RADAR.with_(num_chirps=64, num_samples=64, tx_positions=((0, 0, 0),), rx_positions=((0, 0, 0),))
    rd = range_doppler(np.zeros((1, 64, 64), np.complex64), radar)

    def detected(factor: float) -> bool:
        cells = np.ones((1, 64, 64), np.complex64)
        cells[0, 32, 32] = np.sqrt(factor)
        return bool(cfar(replace(rd, data=cells), pfa, guard, training, along="both")[32, 32])

    low, high = 1.0, 1e3
    assert not detected(low) and detected(high)
    while high / low > 1.0 + 1e-6:
        middle = np.sqrt(low * high)
        low, high = (low, middle) if detected(middle) else (middle, high)
    reach = np.add(guard, training)
    ring = np.argwhere(np.ones(2 * reach + 1)) - reach
    ring = ring[(np.abs(ring) > guard).any(axis=1)]
    # Noise of bins 1 and 2 apart under Hann: the sums of w^2 exp(j 2 pi k n / N) are 2/3 and 1/6 of that of w^2; a
    # symmetric window of 64 chirps instead of an endless one changes them by 1/64 of what is left to 1: below 1 %.
    hann = np.array([1.0, 2.0 / 3.0, 1.0 / 6.0, 0.0])
    apart = np.minimum(np.abs(ring[:, None] - ring[None]), 3)
    covariance = hann[apart[..., 0]] * hann[apart[..., 1]]
    count = len(ring)
    exact = 1.0 / np.linalg.det(np.eye(count) + high / count * covariance)
    # links count one by one (without them 29 % and 42 % more alarms); what is left is the endless window of this oracle
    assert exact == pytest.approx(pfa, rel=0.02)


@pytest.mark.parametrize(
    ("window", "guard", "most"),
    [("hann", (0, 0), 0.3), ("blackmanharris", (0, 0), 0.2)],
)
def test_a_guard_too_narrow_for_the_window_is_told(window, guard, most):
    small = RADAR.with_(num_chirps=64, num_samples=256)
    draw = add_noise(np.zeros((4, 192, 256), dtype=np.complex64), small, np.random.default_rng(3))
    rd = range_doppler(virtual_cube(draw, small), small, window=window)
    with pytest.warns(ScarlWarning, match=r"guard = .* link a cell to its training cells, .* suffices") as told:
        found = cfar(rd, 1e-2, guard, (2, 3))
    assert found.mean() < most * 1e-2
    wider = tuple(int(part) for part in re.findall(r"guard = \((\d+), (\d+)\) suffices", str(told[0].message))[0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = cfar(rd, 1e-2, wider, (2, 3))
    assert found.mean() == pytest.approx(1e-2, rel=0.35)
