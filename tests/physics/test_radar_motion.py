"""Beat signal of moving points against closed forms, through point_targets and synthesize."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.radar.synthesis.blocks import shifted
from scarl_sionna.signal.angle import range_doppler_angle
from scarl_sionna.signal.processing import virtual_cube
from tests.oracles import fmcw

ORIGIN = ((0.0, 0.0, 0.0),)
FINE = Accuracy(synthesis_tolerance=1e-9)


def single_channel(**changes):
    """The radar of the closed forms: 76.5 GHz, 500 MHz in 25.6 us, 512 samples at 20 MHz, 256 chirps every 40 us."""
    values = {
        "start_frequency": 76.5e9,
        "bandwidth": 500e6,
        "ramp_time": 25.6e-6,
        "idle_time": 14.4e-6,
        "num_samples": 512,
        "num_chirps": 256,
        "tx_positions": ORIGIN,
        "rx_positions": ORIGIN,
        "pattern": IsotropicPattern(),
    }
    return RadarSpec().with_(**{**values, **changes})


def phase_difference(a, b):
    return np.abs(np.angle(np.exp(1j * (a - b))))


def slow_phase(radar, positions, velocities, accuracy=FINE, **kw):
    """Unwrapped phase of the first sample of every chirp."""
    paths = point_targets(positions, velocities, 1.0, radar, Pose(), **kw)
    return np.unwrap(np.angle(synthesize(paths, radar, accuracy=accuracy)[0, :, 0].astype(np.complex128)))


@pytest.mark.parametrize("method", ["nufft", "direct"])
def test_phase_of_a_moving_point(method):
    radar = single_channel()
    paths = point_targets([[50.0, 0.0, 0.0]], [[-30.0, 0.0, 0.0]], 1.0, radar, Pose())
    signal = synthesize(paths, radar, method=method)[0]
    phase = np.angle(signal[np.ix_([0, 128, 255], [0, 256, 511])])
    # vector's tolerance 1e-3 rad; the NUFFT's own error is 1e-4, complex64 rounds to 1e-7
    assert phase_difference(phase, fmcw.MOVING_POINT_PHASES).max() < 1e-3


def test_motion_within_a_chirp_is_kept():
    radar = single_channel()
    paths = point_targets([[50.0, 0.0, 0.0]], [[-30.0, 0.0, 0.0]], 1.0, radar, Pose())
    phase = np.angle(synthesize(paths, radar)[0][np.ix_([0, 128, 255], [0, 256, 511])])
    hop = fmcw.stop_and_hop_phase(
        76.5e9,
        radar.waveform.chirp_slope,
        50.0,
        -30.0,
        40e-6 * np.array([[0], [128], [255]]),
        np.array([0, 256, 511]) / 20e6,
    )
    assert phase_difference(hop - phase, fmcw.STOP_AND_HOP_ERRORS).max() < 1e-3
    assert fmcw.STOP_AND_HOP_ERRORS[:, -1].min() > 2.4  # what leaving it out would cost


def test_moving_radar_equals_moving_target():
    radar = single_channel(num_chirps=8)
    position = [[40.0, 9.0, 1.0]]
    still = point_targets(position, [[0.0, 0.0, 0.0]], 1.0, radar, Mount(Pose(), Twist([20.0, 1.0, 0.0])))
    moving = point_targets(position, [[-20.0, -1.0, 0.0]], 1.0, radar, Pose())
    assert np.array_equal(synthesize(still, radar), synthesize(moving, radar))


def test_beat_frequency_and_doppler():
    radar = single_channel()
    paths = point_targets([[50.0, 0.0, 0.0]], [[-30.0, 0.0, 0.0]], 1.0, radar, Pose())
    signal = synthesize(paths, radar, accuracy=FINE)[0].astype(np.complex128)
    ts = np.arange(512) / 20e6
    bin_width = 20e6 / 512

    def beat(chirp):  # slope of the phase at the ramp's start; the quadratic term is the motion's
        return np.polyfit(ts, np.unwrap(np.angle(signal[chirp])), 2)[1] / (2.0 * np.pi)

    assert beat(0) == pytest.approx(6499613.792781, rel=1e-4)
    assert beat(0) / bin_width == pytest.approx(166.3901130952, rel=1e-4)
    assert beat(255) / bin_width == pytest.approx(165.3694069639, rel=1e-4)
    still = point_targets([[50.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 1.0, radar, Pose())
    static = np.polyfit(ts, np.unwrap(np.angle(synthesize(still, radar, accuracy=FINE)[0, 0])), 1)[0] / (2.0 * np.pi)
    assert static == pytest.approx(6514923.734339, rel=1e-4)
    assert (beat(0) - static) / bin_width * 0.299792458 == pytest.approx(-0.1174990082966, rel=1e-3)
    # the bias is a difference of two values with rel 1e-4 each; measured, not the vector itself
    # the vector is the carrier's part, d(f tau)/dt; the slope takes S tau / f = 8.5e-5 off it, so it is left out here
    carrier = slow_phase(single_channel(bandwidth=1e3), [[50.0, 0.0, 0.0]], [[-30.0, 0.0, 0.0]])
    doppler = np.polyfit(np.arange(256) * 40e-6, carrier, 1)[0] / (2.0 * np.pi)
    # over half a turn a chirp: known modulo one turn a chirp, 25 kHz
    assert doppler % 25e3 - 25e3 == pytest.approx(-15310.59350171, rel=1e-4)
    assert (doppler * 40e-6 * 256) % 256 == pytest.approx(99.21952254244, rel=1e-4)
    assert radar.velocity_resolution * radar.center_frequency / 76.5e9 == pytest.approx(0.1913503740298, rel=1e-4)
    assert radar.unambiguous_velocity * radar.center_frequency / 76.5e9 == pytest.approx(24.49284787582, rel=1e-4)


@pytest.mark.parametrize(
    ("velocity", "shift"), [(-30.0, 15310.59350002), (30.0, -15310.59043397), (70.0, -35724.70625074)]
)
def test_exact_doppler_shift(velocity, shift):
    # (c - v) / (c + v): the second order in v / c is 3e-3 Hz here. A slope of 1 kHz a ramp leaves pure Doppler.
    radar = single_channel(bandwidth=1e3, ramp_time=5e-6, idle_time=5e-6, num_samples=4, num_chirps=1024)
    phase = slow_phase(radar, [[100.0, 0.0, 0.0]], [[velocity, 0.0, 0.0]])
    measured = (phase[-1] - phase[0]) / (2.0 * np.pi * 1023 * 10e-6)
    assert -measured == pytest.approx(shift, abs=0.01)  # beat = tx conj(rx): its frequency is minus the shift


@pytest.mark.parametrize(
    ("time", "distance", "radial_velocity", "doppler"),
    [
        (-0.5, 14.14213562373, -14.14213562373, 7217.482270454),
        (-0.1, 10.19803902719, -3.922322702764, 2001.769415836),
        (0.0, 10.0, 0.0, 0.0),
        (0.1, 10.19803902719, 3.922322702764, -2001.769415836),
        (0.5, 14.14213562373, 14.14213562373, -7217.482270454),
    ],
)
def test_crossing_target(time, distance, radial_velocity, doppler):
    radar = single_channel(bandwidth=1e3, num_samples=4, ramp_time=20e-6, idle_time=20e-6, num_chirps=64)
    position, velocity = [[10.0, 20.0 * time, 0.0]], [[0.0, 20.0, 0.0]]
    paths = point_targets(position, velocity, 1.0, radar, Pose())
    assert paths.length_rate[0] / 2.0 == pytest.approx(radial_velocity, rel=1e-4, abs=1e-9)
    t = np.arange(64) * 40e-6
    fit = np.polyfit(t, slow_phase(radar, position, velocity), 3) / (2.0 * np.pi)
    # abs 0.02 Hz at zero Doppler: complex64 phase noise of 1e-7 rad over 2.5 ms
    assert -fit[-2] == pytest.approx(doppler, rel=1e-4, abs=0.02)
    assert fmcw.crossing_distance(10.0, 20.0, time) == pytest.approx(distance, rel=1e-10)


def test_doppler_rate_of_a_crossing_target():
    radar = single_channel(bandwidth=1e3, num_samples=4, ramp_time=20e-6, idle_time=20e-6, num_chirps=500)
    phase = slow_phase(radar, [[10.0, 0.0, 0.0]], [[0.0, 20.0, 0.0]])
    t = np.arange(500) * 40e-6
    # of the frame's start: the exact length has a fourth order, which a parabola over 20 ms would take in (7e-4)
    rate = -2.0 * np.polyfit(t, phase, 4)[2] / (2.0 * np.pi)
    assert rate == pytest.approx(-20414.12262613, rel=1e-4)
    assert abs(rate) * 20e-3 * 20e-3 == pytest.approx(8.165649050451, rel=1e-4)  # bins over a frame of 20 ms


def test_phase_between_transmitters_of_tdm():
    wavelength = fmcw.C / 76.5e9
    radar = single_channel(
        bandwidth=1e3,
        num_samples=4,
        num_chirps=64,
        multiplexing="tdm",
        tx_positions=tuple((0.0, index * 2.0 * wavelength, 0.0) for index in (-1, 0, 1)),
    )
    assert radar.unambiguous_velocity == pytest.approx(8.164282625272, rel=1e-6)

    def first_samples(velocity):
        paths = point_targets([[100.0, 0.0, 0.0]], [[velocity, 0.0, 0.0]], 1.0, radar, Pose())
        return synthesize(paths, radar, accuracy=FINE)

    moving, still = first_samples(-10.0), first_samples(0.0)
    # over all 192 ramps of 40 us, so that the rounding of complex64 is divided by 191
    turn = np.unwrap(np.angle(moving[0, :, 0] * np.conj(still[0, :, 0])))
    assert (turn[-1] - turn[0]) / 191 == pytest.approx(-1.282657153434, rel=1e-6)

    def azimuth(compensate):
        rda = range_doppler_angle(virtual_cube(moving, radar), radar, num_azimuth=256, compensate_motion=compensate)
        return np.degrees(rda.azimuth[np.unravel_index(rda.data.argmax(), rda.data.shape)[2]])

    # bias asin(lambda dphi / (2 pi d_tx)) = 5.858 deg; a bin of sin(azimuth) is 1 / 512, 0.11 deg, half of it each side
    assert abs(azimuth(False)) == pytest.approx(5.858418101816, abs=0.06)


@pytest.mark.parametrize("time", [0.4, -0.3])
def test_paths_moved_on_follow_the_uniformly_accelerated_length(time):
    """L(t) = L + L' t + L'' t^2 / 2 and L'(t) = L' + L'' t.

    a mirror path's image moves along the line of sight by as much.
    """
    paths = point_targets([[30.0, 0.0, 0.0]], [[-5.0, 0.0, 0.0]], 1.0, single_channel(), Pose())
    paths = replace(paths, length_acceleration=np.array([6.0]))
    moved = shifted(paths, time)
    change = -10.0 * time + 3.0 * time**2
    assert moved.inner_length - paths.inner_length == pytest.approx([change], abs=1e-12)
    assert moved.length_rate == pytest.approx([-10.0 + 6.0 * time], abs=1e-12)
    assert moved.rx_image is None
    image = np.array([[[-1.0, 0.0, 0.0, 60.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]])  # of a wall at x = 30 m
    mirrored = shifted(replace(paths, rx_image=image), time)
    assert mirrored.rx_image[0, :, 3] == pytest.approx([60.0 + change, 0.0, 0.0], abs=1e-12)
    assert np.array_equal(mirrored.rx_image[0, :, :3], image[0, :, :3])
