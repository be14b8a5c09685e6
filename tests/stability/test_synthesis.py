"""Where fast synthesis can fail: high speed, long frames, bends, many orders of magnitude, threads, empty input."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
import pytest

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import chirpz, direct, groups, synthesize
from tests.oracles.direct_sum import point_scatterer_signal

PAIR = {"tx_positions": ((0.0, -0.008, 0.0),), "rx_positions": ((0.0, 0.003, 0.0),)}


@pytest.fixture
def never_direct(monkeypatch):
    """Make every group of paths, however small, go through a transform."""
    monkeypatch.setattr(groups, "DIRECT_COST", np.inf)


@pytest.fixture(params=["series", "chirp-z"])
def each_method(request, monkeypatch, never_direct):
    """Make straight paths go through one method, whatever it costs."""
    module = {"series": groups.nufft, "chirp-z": chirpz}[request.param]
    made = []
    monkeypatch.setattr(groups, "_chirpz_cost", lambda *_: np.inf if request.param == "series" else -1.0)

    class Counted(module.Transform):
        def __init__(self, *arguments):
            made.append(self)
            super().__init__(*arguments)

    monkeypatch.setattr(module, "Transform", Counted)
    yield request.param
    assert made  # the method under test did run


def scene(radar, count, speed, seed=0, bend=False):
    """Points over the whole range and all radial velocities within +- speed."""
    rng = np.random.default_rng(seed)
    distance = rng.uniform(2.0, 250.0, count)
    azimuth = rng.uniform(-1.0, 1.0, count)
    direction = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(count)], axis=1)
    velocity = rng.uniform(-speed, speed, count)
    velocity[:2] = np.array([-speed, speed])[:count]
    across = np.stack([-direction[:, 1], direction[:, 0], direction[:, 2]], axis=1) * (15.0 if bend else 0.0)
    positions = distance[:, None] * direction
    return point_targets(positions, velocity[:, None] * direction + across, 1e-3 * distance**4, radar, Pose())


def error_db(radar, paths, tolerance):
    accuracy = Accuracy(synthesis_tolerance=tolerance, motion_tolerance=tolerance)
    fast = synthesize(paths, radar, accuracy=accuracy)
    exact = synthesize(paths, radar, accuracy=accuracy, method="direct")
    return 20.0 * np.log10(np.abs(fast - exact).max() / np.abs(exact).max())


@pytest.mark.some(4)
@pytest.mark.usefixtures("each_method")
@pytest.mark.parametrize("multiplexing", ["ideal", "tdm"])
@pytest.mark.parametrize("speed", [0.0, 20.0, 70.0])
@pytest.mark.parametrize("count", [2, 24])
def test_fast_synthesis_equals_the_exact_sum(multiplexing, speed, count):
    radar = RadarSpec().with_(multiplexing=multiplexing, rx_positions=((0.0, 0.0, 0.0),))
    assert error_db(radar, scene(radar, count, speed), 1e-5) < -100.0


@pytest.mark.some(2)
@pytest.mark.usefixtures("each_method")
@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4, 1e-6])
def test_error_stays_below_the_tolerance(tolerance):
    radar = RadarSpec().with_(**PAIR)
    for count in (1, 2, 16):
        assert error_db(radar, scene(radar, count, 70.0), tolerance) < 20.0 * np.log10(tolerance)


@pytest.mark.some(3)
@pytest.mark.parametrize(
    ("tolerance", "fastest"),
    [
        (1e-3, 70.0),
        (Accuracy().synthesis_tolerance, 70.0),
        (1e-5, 70.0),
        (1e-6, 70.0),
        (1e-7, 70.0),
        (1e-9, 0.5),
        (1e-9, 0.0),
    ],
)
def test_lone_paths_among_all_ranges_and_speeds_stay_below_the_tolerance(tolerance, fastest):
    # the group spans 1..255 m and +-fastest, so no correction is at rest; alone, no path hides another's error
    radar = RadarSpec().with_(**PAIR)
    rng = np.random.default_rng(3)
    distance = np.concatenate([[2.0, 2.0, 250.0, 250.0, 126.0, 1.0, 255.5], rng.uniform(2.0, 250.0, 5)])
    speed = fastest * np.concatenate([[1.0, -1.0, 1.0, -1.0, 0.0, 1.0, -1.0], rng.uniform(-1.0, 1.0, 5)])
    zero = np.zeros_like(distance)
    paths = point_targets(np.stack([distance, zero, zero], 1), np.stack([speed, zero, zero], 1), 1.0, radar, Pose())
    geometry = PathGeometry.of(paths, radar)
    layout = chirpz.Layout.of(radar, geometry.center_length(), paths.length_rate, tolerance)
    assert chirpz.Layout.of(radar, geometry.center_length(), paths.length_rate, 0.99 * chirpz.MIN_TOLERANCE) is None
    transform = chirpz.Transform(radar, layout, tolerance)
    for index in range(len(distance)):
        lone = (np.ones(1, dtype=complex), geometry.length(0, 0)[[index]], paths.length_rate[[index]], np.zeros(1))
        error = np.abs(transform.signal(*lone, 0) - direct.sum_paths(*lone, radar, 0)).max()
        assert error <= tolerance, (distance[index], speed[index])


def test_default_tolerance_is_the_bar():
    assert Accuracy().synthesis_tolerance == 1e-4  # -80 dB of the peak


@pytest.mark.usefixtures("never_direct")
def test_rounding_of_the_motion_does_not_make_a_path_bend():
    radar = RadarSpec().with_(**PAIR)
    straight = chirpz.is_straight(radar, np.array([0.0, 1e-5, -1e-5, 1.0]), 1e-4)
    assert straight.tolist() == [True, True, True, False]  # 1 m/s2 over 9.7 ms: 0.5 x (4.9 ms)**2 = 12 um = 0.04 rad
    paths = dataclasses.replace(scene(radar, 30, 70.0), length_acceleration=np.full(30, 1e-5))
    assert error_db(radar, paths, 1e-4) < -80.0


@pytest.mark.parametrize("forced", [False, True])
def test_bending_paths(forced, monkeypatch):
    if forced:
        monkeypatch.setattr(groups, "DIRECT_COST", np.inf)
    radar = RadarSpec().with_(num_chirps=128, **PAIR)
    paths = scene(radar, 40, 30.0, bend=True)
    assert paths.length_acceleration.max() > 10.0
    assert error_db(radar, paths, 1e-5) < -100.0


@pytest.mark.some(4)
@pytest.mark.usefixtures("each_method")
@pytest.mark.parametrize(("num_samples", "num_chirps"), [(1, 1), (1, 64), (64, 1), (127, 63), (128, 63)])
def test_odd_and_tiny_frames(num_samples, num_chirps):
    radar = RadarSpec().with_(
        num_samples=num_samples, num_chirps=num_chirps, sampling_frequency=10e6 if num_samples < 300 else None
    )
    paths = scene(radar, 20, 50.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)
        assert error_db(radar, paths, 1e-5) < -100.0


@pytest.mark.usefixtures("never_direct")
def test_long_frame_and_steep_slope():
    # 4 GHz in 40 us over 20 ms: migration of 38 bins at 70 m/s, residual phase of 120 rad
    radar = RadarSpec().with_(bandwidth=4e9, ramp_time=40e-6, idle_time=40e-6, num_chirps=256, num_samples=512, **PAIR)
    rng = np.random.default_rng(0)
    distance = rng.uniform(2.0, 18.0, 30)
    velocity = rng.uniform(-70.0, 70.0, 30)
    x = np.stack([np.ones(30), np.zeros(30), np.zeros(30)], axis=1)
    paths = point_targets(distance[:, None] * x, velocity[:, None] * x, 1.0, radar, Pose())
    assert error_db(radar, paths, 1e-5) < -100.0


def test_exact_sum_equals_an_independent_oracle():
    # the oracle moves every point and traces every antenna; points far enough that the length rates of the antennas,
    # 11 mm from the centre, agree: 0.011 m / 150 m x 5 m/s across x 2.5 ms = 1 um = 1.5e-3 rad
    radar = RadarSpec().with_(
        num_chirps=64, num_samples=128, sampling_frequency=10e6, pattern=IsotropicPattern(), tx_power_dbm=30.0, **PAIR
    )
    positions = np.array([[100.0, 10.0, 1.0], [140.0, -30.0, 0.0]])
    velocities = np.array([[-40.0, 5.0, 0.0], [25.0, -5.0, 0.0]])
    paths = point_targets(positions, velocities, 1e4, radar, Pose())
    expected = point_scatterer_signal(
        positions,
        velocities,
        paths.a[:, 0, 0].real,
        radar.tx_array[0],
        radar.rx_array[0],
        77e9,
        radar.waveform.chirp_slope,
        10e6,
        128,
        np.arange(64) * radar.doppler_interval,
    )
    for method in ("direct", "nufft"):
        signal = synthesize(paths, radar, method=method)[0]
        # 1.5e-3 rad from the length rates, and 2 x 1.1 cm / 150 m = 1.5e-4 from the spreading over both ways
        assert np.abs(signal - expected).max() < 2e-3 * np.abs(expected).max()


@pytest.mark.some(1)
@pytest.mark.usefixtures("each_method")
def test_same_bytes_for_any_number_of_threads(monkeypatch):
    radar = RadarSpec().with_(num_chirps=64)
    paths = scene(radar, 3000, 70.0)
    one = synthesize(paths, radar)
    again = synthesize(paths, radar)
    monkeypatch.setattr("scarl_sionna.radar.synthesis.MAX_THREADS", 1)
    alone = synthesize(paths, radar)
    assert one.tobytes() == again.tobytes() == alone.tobytes()


@pytest.mark.usefixtures("each_method")
def test_chunks_change_nothing(monkeypatch):
    radar = RadarSpec().with_(num_chirps=32, **PAIR)
    paths = scene(radar, 900, 70.0)
    fine = Accuracy(synthesis_tolerance=1e-5)
    whole = synthesize(paths, radar, accuracy=fine)
    monkeypatch.setattr(groups, "MAX_CHUNK_PATHS", 100)
    monkeypatch.setattr(groups, "MAX_CHIRPZ_PATHS", 100)
    assert (
        np.abs(synthesize(paths, radar, accuracy=fine) - whole).max() < 2e-5 * np.abs(whole).max()
    )  # each within 1e-5


def test_no_paths_give_silence():
    radar = RadarSpec().with_(num_chirps=4)
    paths = point_targets([], [], 1.0, radar, Pose())
    adc = synthesize(paths, radar)
    assert adc.shape == (4, 12, 512) and adc.dtype == np.complex64 and not adc.any()


def test_paths_beyond_the_filter_are_left_out_with_a_warning():
    radar = RadarSpec().with_(num_chirps=8)
    near = point_targets([[50.0, 0.0, 0.0]], [[0.0] * 3], 1.0, radar, Pose())
    both = point_targets([[50.0, 0.0, 0.0], [300.0, 0.0, 0.0]], [[0.0] * 3] * 2, 1.0, radar, Pose())
    with pytest.warns(ScarlWarning, match="1 of 2 paths"):
        adc = synthesize(both, radar)
    assert np.array_equal(adc, synthesize(near, radar))


def test_weak_point_beside_a_strong_one_keeps_its_amplitude():
    # 60 dB apart: the error of 1e-5 of the strong one is 1 % of the weak one, spread over all cells
    radar = RadarSpec().with_(num_chirps=64, **PAIR)
    strong = point_targets([[30.0, 0.0, 0.0]], [[-60.0, 0.0, 0.0]], 1e4, radar, Pose())
    weak = point_targets([[30.0, 0.0, 0.0]], [[5.0, 0.0, 0.0]], 1e-2, radar, Pose())
    pair = point_targets([[30.0, 0.0, 0.0]] * 2, [[-60.0, 0.0, 0.0], [5.0, 0.0, 0.0]], [1e4, 1e-2], radar, Pose())
    fine = Accuracy(synthesis_tolerance=1e-5)
    rest = synthesize(pair, radar, accuracy=fine) - synthesize(strong, radar, accuracy=fine)
    alone = synthesize(weak, radar, accuracy=fine)
    assert np.abs(rest - alone).max() < 2e-5 * np.abs(synthesize(strong, radar)).max()


def test_paths_of_nan_are_refused():
    radar = RadarSpec().with_(num_chirps=4)
    paths = point_targets([[50.0, 0.0, 0.0]], [[0.0] * 3], 1.0, radar, Pose())
    with pytest.raises(ValueError, match="length_rate"):
        synthesize(dataclasses.replace(paths, length_rate=np.array([np.nan])), radar)
