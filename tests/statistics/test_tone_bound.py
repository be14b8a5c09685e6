"""Range and Doppler between bins: against the Cramer-Rao bound by Monte-Carlo, and exact without noise."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.angle import range_doppler_angle
from scarl_sionna.signal.detection import detect
from scarl_sionna.signal.noise import sample_noise_power
from scarl_sionna.signal.processing import virtual_cube

HALF = 0.5 * RadarSpec().wavelength
RADAR = RadarSpec().with_(
    num_chirps=32,
    num_samples=64,
    tx_positions=((0, 0, 0),),
    rx_positions=tuple((0, (i - 1.5) * HALF, 0) for i in range(4)),
)
RAMP = {"num_chirps": 32, "num_samples": 64}
REGULAR = {
    "up": ss.Fmcw(**RAMP),
    "down": ss.Fmcw(**RAMP, direction="down"),
    "late": ss.Fmcw(**RAMP, adc_start_time=5e-6),
    "code across": ss.PcFmcw(**RAMP, coding="across"),
    "ofdm": ss.Ofdm(num_chirps=32, num_subcarriers=64),
    "comb": ss.Ofdm(num_chirps=32, num_subcarriers=128, comb=2, pilot_spacing=1),
    "pmcw": ss.Pmcw(num_chirps=32, code_length=127, chip_rate=150e6, repetitions=4),
}


def ratio_to_bound(window: str, snr_db: float, draws: int) -> np.ndarray:
    """Root mean square errors of range and velocity over the bound of a tone of unknown amplitude and phase.

    6 / (4 pi^2 snr) bins^2, Rife and Boorstyn; `snr_db` is that after all processing.
    """
    rng, errors = np.random.default_rng(11), []
    sigma, count = np.sqrt(sample_noise_power(RADAR)), RADAR.num_virtual * RADAR.num_chirps * RADAR.num_samples
    for _ in range(draws):
        distance = (rng.integers(20, 40) + rng.uniform(-0.5, 0.5)) * RADAR.range_resolution
        velocity = (rng.integers(-10, 10) + rng.uniform(-0.5, 0.5)) * RADAR.velocity_resolution
        azimuth = rng.uniform(-0.7, 0.7)
        unit = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        paths = point_targets([distance * unit], [velocity * unit], 1.0, RADAR, Pose())
        adc = synthesize(paths, RADAR).astype(np.complex128)
        adc *= sigma * np.sqrt(10.0 ** (snr_db / 10.0) / count / np.mean(np.abs(adc) ** 2))
        adc += sigma * np.sqrt(0.5) * (rng.normal(size=adc.shape) + 1j * rng.normal(size=adc.shape))
        rda = range_doppler_angle(virtual_cube(adc, RADAR), RADAR, window)
        points = detect(rda, pfa=1e-2 if snr_db < 18.0 else 1e-3)
        error = np.stack(
            [
                (points.range - distance) / RADAR.range_resolution,
                (points.radial_velocity - velocity) / RADAR.velocity_resolution,
            ],
            axis=1,
        )
        nearest = error[np.hypot(*error.T).argmin()] if len(error) else np.full(2, np.inf)
        if np.hypot(*nearest) < 0.5:  # seven sigma at 15 dB; else its cell is not found
            errors.append(nearest)
    assert len(errors) > 0.8 * draws
    bound = np.sqrt(6.0 / (4.0 * np.pi**2 * 10.0 ** (snr_db / 10.0)))
    return np.sqrt(np.mean(np.square(errors), axis=0)) / bound


@pytest.mark.slow
@pytest.mark.parametrize("window", ["hann", "rect"])
def test_estimates_reach_the_bound(window: str) -> None:
    """From the issue: within 1.2. The root mean square of 200 draws itself is known to 5 %, of 400 to 3.5 %."""
    ratio = ratio_to_bound(window, 30.0, 200)
    assert (ratio < 1.2).all() and (ratio > 0.85).all(), ratio


@pytest.mark.slow
@pytest.mark.parametrize("snr_db", [15.0, 18.0, 25.0, 45.0])
@pytest.mark.parametrize("window", ["rect", "hann"])
def test_estimates_reach_the_bound_from_15_to_45_db(window: str, snr_db: float) -> None:
    ratio = ratio_to_bound(window, snr_db, 400)
    assert (ratio < 1.2).all() and (ratio > 0.9).all(), ratio


@pytest.mark.some(5)
@pytest.mark.parametrize("window", ["rect", "hann"])
@pytest.mark.parametrize("name", REGULAR)
def test_a_point_without_noise_is_found_between_the_bins(name: str, window: str) -> None:
    """Whatever is sent, if its chirps are even: within a thousandth of a bin, a hundredth of a degree, 0.15 dB.

    A correlator's lines fall off by 0.1 dB with Doppler (:func:`numpy.sinc`), which the point does not know.
    """
    radar = ss.RadarSpec(waveform=REGULAR[name]).with_(pattern=IsotropicPattern())
    rng = np.random.default_rng(3)
    for _ in range(4):
        distance, azimuth = rng.uniform(0.2, 0.8) * radar.max_range, rng.uniform(-0.6, 0.6)
        velocity = rng.uniform(-0.8, 0.8) * min(radar.unambiguous_velocity, 60.0)
        unit = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        paths = point_targets([distance * unit], [velocity * unit], distance**4, radar, Pose())
        points = detect(range_doppler_angle(virtual_cube(synthesize(paths, radar), radar), radar, window))
        assert points.range[0] == pytest.approx(distance, abs=1e-3 * radar.range_resolution)
        assert points.radial_velocity[0] == pytest.approx(velocity, abs=1e-3 * radar.velocity_resolution)
        assert np.degrees(points.azimuth[0] - azimuth) == pytest.approx(0.0, abs=0.01)
        assert 10.0 * np.log10(points.rcs[0] / distance**4) == pytest.approx(0.0, abs=0.15)
