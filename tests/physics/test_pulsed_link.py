"""The pulsed receiver's link budget and noise against closed forms and quadrature."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from camera_lidar.lidar.photons import ELEMENTARY_CHARGE, photon_energy, sun_irradiance
from camera_lidar.lidar.pulsed import (
    background_rate,
    detection_probability,
    excess_noise_factor,
    filtered,
    noise_density,
    noise_deviation,
    photoelectrons,
    pulse_spread,
    range_deviation,
    speckle_cells,
    threshold_ratio,
)
from camera_lidar.lidar.pulsed.link import full_scale, overlap
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.lidar.receiver import PulsedReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

RECEIVER = PulsedReceiver(pulse_width=4e-9, electrical_bandwidth=60e6)
SPEC = LidarSpec(wavelength=905e-9, beam_divergence=2e-3, receiver=RECEIVER, atmospheric_attenuation=0.0)
DENSITY = 7e9


def gaussian(time: np.ndarray | float, deviation: float) -> np.ndarray | float:
    return norm.pdf(time, scale=deviation)


def test_the_sun_as_a_black_body_has_the_solar_constant() -> None:
    total = quad(lambda nm: sun_irradiance(nm * 1e-9), 50.0, 1e5, limit=500, points=[500.0, 2000.0])[0]
    assert total == pytest.approx(1361.0, rel=2e-3)  # nominal total solar irradiance, IAU 2015 Resolution B3


def test_photoelectrons_follow_the_lidar_equation() -> None:
    distance, reflectance = 50.0, 0.3
    lens = math.pi * (25e-3 / 2.0) ** 2
    received = 2e-7 * reflectance / math.pi * lens / distance**2 * 0.5  # pulse energy, diffuser, solid angle, optics
    expected = received / photon_energy(905e-9) * 0.7
    assert photoelectrons(SPEC, reflectance / distance**2, distance) == pytest.approx(expected, rel=1e-12)


def test_beam_and_receiver_overlap_from_the_blind_distance_on() -> None:
    wide = RECEIVER.with_(field_of_view=0.5)
    spec = SPEC.with_(receiver=wide)
    assert np.allclose(overlap(spec, [0.1, 0.2, 0.6, 1.0, 50.0]), [0.0, 0.0, 0.5, 1.0, 1.0])
    at_once = SPEC.with_(receiver=wide.with_(blind_distance=(0.8, 0.8)))
    assert np.allclose(overlap(at_once, [0.79, 0.81]), [0.0, 1.0])


@pytest.mark.parametrize("distance", [1.5, 4.0, 8.0, 9.0, 60.0])
def test_a_lens_focused_at_infinity_loses_near_light(distance: float) -> None:
    """Rays from a point on the axis to places all over the lens, those that arrive within the field of view."""
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-12.5e-3, 12.5e-3, (2, 400_000))
    lens = np.hypot(x, y) < 12.5e-3
    angle = np.arctan(np.hypot(x, y)[lens] / distance)  # to the axis; the lens turns parallel rays to the middle
    assert float(overlap(SPEC, distance)) == pytest.approx(np.mean(angle <= 1.5e-3), abs=3e-3)


@pytest.mark.parametrize(("gain", "ratio", "factor"), [(1.0, 0.3, 1.0), (100.0, 0.0, 1.99), (50.0, 1.0, 50.0)])
def test_the_limits_of_avalanche_noise(gain: float, ratio: float, factor: float) -> None:
    assert excess_noise_factor(RECEIVER.with_(avalanche_gain=gain, ionization_ratio=ratio)) == pytest.approx(factor)


def test_noise_of_sunlight_is_its_photons() -> None:
    rate = float(background_rate(SPEC, 0.5, 10.0))
    side = 1.0  # [m] of a patch, all its light in one direction by Lambert
    radiance = 0.5 * sun_irradiance(905e-9) * 30.0 / math.pi  # W/(m2 sr) in 30 nm
    patch = radiance * side**2 * (math.pi * (25e-3 / 2.0) ** 2) / 10.0**2  # of one square metre at 10 m
    share = math.pi * (3e-3 / 2.0 * 10.0) ** 2 / side**2  # in the field of view
    assert rate == pytest.approx(patch * share * 0.5 * 0.7 / photon_energy(905e-9), rel=1e-12)
    thermal = (2e-12 / (100.0 * ELEMENTARY_CHARGE)) ** 2 / 2.0
    factor = excess_noise_factor(RECEIVER)
    assert noise_density(SPEC, rate) == pytest.approx(factor * (rate + 1e-10 / ELEMENTARY_CHARGE) + thermal)


def test_the_filter_by_quadrature() -> None:
    """Height, width, and noise of a filtered pulse: integrals over time of pulse, filter and squares."""
    own, spread, electrons = RECEIVER.filter_deviation, 3e-9, 500.0
    response = abs(quad(lambda t: gaussian(t, own) * math.cos(2 * math.pi * 60e6 * t), -1e-7, 1e-7, points=[0.0])[0])
    assert response**2 == pytest.approx(0.5, rel=1e-6)  # -3 dB at the bandwidth
    time, step = np.linspace(-6e-8, 6e-8, 60_001, retstep=True)
    unit = 1.0 / np.sum(gaussian(time, RECEIVER.pulse_deviation) * gaussian(time, own) * step)  # a plane's peak is N
    pulse, response_at = electrons * gaussian(time, spread), gaussian(time, own)
    slope_at = np.gradient(response_at, step)
    factor = excess_noise_factor(RECEIVER)
    white = unit**2 * DENSITY * np.sum(response_at**2) * step
    shot = unit**2 * factor * np.sum(pulse * response_at**2) * step
    white_slope = unit**2 * DENSITY * np.sum(slope_at**2) * step
    shot_slope = unit**2 * factor * np.sum(pulse * slope_at**2) * step
    found = filtered(SPEC, np.array([electrons]), np.array([spread]), np.array([DENSITY]))
    assert found.height == pytest.approx(unit * np.sum(pulse * response_at) * step, rel=1e-6)
    assert noise_deviation(SPEC, DENSITY) == pytest.approx(math.sqrt(white), rel=1e-6)
    assert found.noise == pytest.approx(math.sqrt(white + shot), rel=1e-6)
    assert found.slope_noise == pytest.approx(math.sqrt(white_slope + shot_slope), rel=1e-5)


def test_a_matched_filter_reaches_the_bound_of_delay() -> None:
    """White noise: the Cramer-Rao bound of a Gaussian pulse's delay, from the Fisher information by quadrature."""
    receiver = RECEIVER.with_(electrical_bandwidth=None, ionization_ratio=0.0, avalanche_gain=1.0)
    spec = SPEC.with_(receiver=receiver)
    electrons, deviation = 1e4, receiver.pulse_deviation
    density = 1e16  # far above the pulse's own shot noise
    time, step = np.linspace(-3e-8, 3e-8, 60_001, retstep=True)
    slope = electrons * np.gradient(gaussian(time, deviation), step)
    bound = SPEED_OF_LIGHT / 2.0 * math.sqrt(density / (np.sum(slope**2) * step))
    peaks = filtered(spec, np.array([electrons]), np.array([deviation]), np.array([density]))
    assert range_deviation(spec, peaks) == pytest.approx(bound, rel=2e-3)
    for bandwidth in (30e6, 50e6, 130e6):  # no other filter is better
        other = spec.with_(receiver=receiver.with_(electrical_bandwidth=bandwidth))
        worse = filtered(other, np.array([electrons]), np.array([deviation]), np.array([density]))
        assert range_deviation(other, worse) > 1.01 * bound


def test_a_slanting_surface_widens_the_pulse() -> None:
    rng = np.random.default_rng(3)
    distance, cosine = 40.0, 0.2
    radius = math.hypot(SPEC.aperture_diameter / 2.0, 1e-3 * distance)
    across = rng.normal(scale=radius / 2.0, size=400_000)  # intensity exp(-2 r2 / w2)
    times = 2.0 / SPEED_OF_LIGHT * across * math.sqrt(1.0 - cosine**2) / cosine
    expected = math.hypot(RECEIVER.pulse_deviation, float(np.std(times)))
    assert pulse_spread(SPEC, cosine, distance) == pytest.approx(expected, rel=3e-3)
    assert pulse_spread(SPEC, 1.0, distance) == pytest.approx(RECEIVER.pulse_deviation)


@pytest.mark.parametrize(("aperture", "tolerance"), [(0.05e-3, 1e-2), (0.3e-3, 0.15), (1e-3, 0.15), (40e-3, 0.02)])
def test_speckle_cells_by_quadrature_over_the_lens(aperture: float, tolerance: float) -> None:
    """Goodman: 1/M is the mean of the squared coherence factor over all pairs of points of a round lens."""
    spec = SPEC.with_(receiver=RECEIVER.with_(receiver_aperture=aperture))
    distance = 100.0
    radius = math.hypot(spec.aperture_diameter / 2.0, 1e-3 * distance)
    correlation = math.pi * radius / (spec.wavelength * distance)  # squared coherence exp(-(k w s / 2 R)^2)

    def pairs(ratio: float) -> float:
        """Density of the distance of two points of a circle of unit diameter."""
        return 16.0 / math.pi * ratio * (math.acos(ratio) - ratio * math.sqrt(1.0 - ratio**2))

    def weight(ratio: float) -> float:
        return pairs(ratio) * math.exp(-((correlation * ratio * aperture) ** 2))

    mean = quad(weight, 0.0, 1.0, limit=400, points=[min(1.0 / (correlation * aperture), 1.0)])[0]
    assert float(speckle_cells(spec, distance)) == pytest.approx(1.0 / mean, rel=tolerance)


def test_full_scale_is_the_energy_of_a_pulse_of_that_power() -> None:
    spec = SPEC.with_(receiver=RECEIVER.with_(saturation_power=1e-6))
    energy = quad(
        lambda t: 1e-6 * math.exp(-4.0 * math.log(2.0) * (t / 4e-9) ** 2), -2e-8, 2e-8, points=[0.0], epsabs=0.0
    )[0]
    assert full_scale(spec) == pytest.approx(energy * 0.5 * 0.7 / photon_energy(905e-9), rel=1e-9)
    assert full_scale(SPEC) == math.inf


def test_detection_is_one_half_at_the_level() -> None:
    spec = SPEC.with_(receiver=RECEIVER.with_(solar_irradiance=0.0, speckle=False))
    level = threshold_ratio(spec) * float(noise_deviation(spec, noise_density(spec)))
    reflectance = level / float(photoelectrons(spec, 1.0 / 100.0**2, 100.0))
    assert detection_probability(spec, reflectance, 100.0) == pytest.approx(0.5, abs=1e-9)
    probability = detection_probability(SPEC, 0.1, np.linspace(20.0, 2000.0, 50))
    assert np.all(np.diff(probability) <= 1e-12) and probability[0] > 0.999 and probability[-1] < 0.1


def test_a_false_alarm_rate_that_noise_exceeds_is_refused() -> None:
    with pytest.raises(ParameterRangeError, match="false_alarm_probability"):
        threshold_ratio(SPEC.with_(max_distance=1.0, receiver=RECEIVER.with_(false_alarm_probability=0.4)))
