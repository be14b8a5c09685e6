"""Turning, swinging and vibrating targets, their paths solved again for blocks of chirps, against closed forms."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
import pytest
import trimesh

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.sensor import Radar
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.radar.synthesis.blocks import later, retraced, synthesize_blocks
from scarl_sionna.signal.converter import quantize
from tests.oracles import micro_doppler as oracle
from tests.scenes import Thing, plane, write_scene

ORIGIN = ((0.0, 0.0, 0.0),)
FINE = Accuracy(synthesis_tolerance=1e-9)
SPIN = oracle.WHEEL_SPEED / oracle.WHEEL_RADIUS


def radar_of(**changes) -> RadarSpec:
    """Carrier 76.5 GHz, nearly no sweep: the slow-time phase is that of the carrier."""
    values = {
        "start_frequency": 76.5e9,
        "bandwidth": 1e3,
        "ramp_time": 16e-6,
        "idle_time": 4e-6,
        "num_samples": 4,
        "num_chirps": 256,
        "tx_positions": ORIGIN,
        "rx_positions": ORIGIN,
        "pattern": IsotropicPattern(),
    }
    return RadarSpec().with_(**{**values, **changes})


def slow_time(signal) -> np.ndarray:
    return signal[0, :, 0].astype(np.complex128)


def exact(radar, distance) -> np.ndarray:
    """Beat signal of one point whose distance is a function of time, shape (num_chirps, num_samples): the oracle."""
    ts = np.arange(radar.num_samples) / radar.sample_rate
    time = np.arange(radar.num_chirps)[:, None] * radar.doppler_interval + ts
    sent = time  # distance at reflection, half the delay before reception: 1e-7 s, 3 um at 30 m/s
    for _ in range(4):
        tau = 2.0 * distance(sent) / oracle.SPEED_OF_LIGHT
        sent = time - tau / 2.0
    return np.exp(
        2j * np.pi * (radar.waveform.start_frequency * tau + radar.waveform.chirp_slope * tau * (ts - tau / 2.0))
    )


def wheel_paths(radar, psi, hub, pose, turning: bool = True):
    """Return what gives the paths of points of the rim; without `turning` they are taken as moving straight."""

    def paths_at(time: float):
        offset, velocity, acceleration = oracle.rim(np.asarray(psi) + SPIN * time)
        position = np.asarray(hub) + [oracle.WHEEL_SPEED * time, 0.0, 0.0] + offset
        paths = point_targets(position, velocity, 1.0, radar, pose)
        if not turning:
            return paths
        sight = (position - pose.position) / np.linalg.norm(position - pose.position, axis=1, keepdims=True)
        bend = 2.0 * np.einsum("pi,pi->p", acceleration, sight)
        return dataclasses.replace(paths, length_acceleration=paths.length_acceleration + bend)

    return paths_at


@pytest.mark.parametrize("elevation_deg", [0.0, 5.0])
def test_doppler_of_a_rolling_wheel(elevation_deg: float) -> None:
    """Every point of the rim at its own Doppler shift, from nothing at the ground to twice the car's at the top."""
    expected = oracle.WHEEL_DOPPLER if elevation_deg == 0.0 else oracle.WHEEL_DOPPLER_5_DEG
    el, far = np.radians(elevation_deg), 1e5  # so far that all points are seen in one direction
    radar = radar_of(num_chirps=2, bandwidth=10.0)
    for psi_deg, shift in expected.items():
        offset, velocity, _ = oracle.rim(np.radians(psi_deg))
        pose = Pose.from_euler(offset[0] + far * np.array([np.cos(el), 0.0, np.sin(el)]), yaw=np.pi)
        paths = point_targets(offset, velocity, 1.0, radar, pose)
        doppler = -paths.length_rate[0] / oracle.WAVELENGTH
        assert doppler == pytest.approx(shift, rel=1e-4, abs=1e-6), psi_deg  # the vectors' tolerance


def test_wheel_span_is_exact() -> None:
    """The spectrum of a whole rim lies between 0 and twice the car's Doppler shift, and nowhere else."""
    radar = radar_of(ramp_time=8e-6, idle_time=2e-6, num_chirps=512)
    psi = np.linspace(0.0, 2.0 * np.pi, 120, endpoint=False)
    pose = Pose.from_euler([300.0, 0.0, 0.0], yaw=np.pi)
    wheel, phases = wheel_paths(radar, psi, (0, 0, 0), pose), np.random.default_rng(2).uniform(0, 2 * np.pi, len(psi))

    def rough(time: float):  # points of a rough tyre: each with a phase of its own
        paths = wheel(time)
        return dataclasses.replace(paths, a=paths.a * np.exp(1j * phases)[:, None, None])

    signal = slow_time(synthesize_blocks(rough, radar, 16, accuracy=FINE))
    window = np.blackman(radar.num_chirps)
    spectrum = np.abs(np.fft.fft(signal * window))
    shift = -np.fft.fftfreq(
        radar.num_chirps, radar.doppler_interval
    )  # beat = tx conj(rx): its frequency is minus the shift
    level = 20 * np.log10(spectrum / spectrum.max())
    strong = shift[level > -30.0]
    resolution = 1.0 / radar.frame_time
    # 4 v / lambda at the top, 0 at the ground; the window's main lobe is 3 bins to each side, and over 5.1 ms the wheel
    # turns by 0.24 rad: the points at the top lose (1 - cos 0.12) / 2 of the span
    assert strong.max() == pytest.approx(oracle.WHEEL_DOPPLER[0.0], abs=3 * resolution)
    assert strong.min() == pytest.approx(0.0, abs=3 * resolution)
    outside = (shift > oracle.WHEEL_DOPPLER[0.0] + 6 * resolution) | (shift < -6 * resolution)
    assert level[outside].max() < -57.0  # the Blackman window's highest side lobe: no floor of broken phases


@pytest.mark.parametrize(
    ("chirps", "turning", "bound"), [(16, True, 1e-2), (2, True, 1e-4), (2, False, 1e-2), (256, True, np.inf)]
)
def test_phase_of_a_point_of_the_rim_at_every_sample(chirps: int, turning: bool, bound: float) -> None:
    """Full sweep, every sample of every chirp: motion within the chirp and the bend of the way included.

    The bar is 1e-2 rad.
    """
    radar = radar_of(bandwidth=500e6, num_samples=64, num_chirps=128 if chirps < 256 else 256)
    pose, hub, psi = Pose(), np.array([10.0, 1.0, 0.0]), 1.3

    def distance(time):
        offset, _, _ = oracle.rim(psi + SPIN * np.ravel(time))
        position = hub + np.stack([oracle.WHEEL_SPEED * np.ravel(time), *np.zeros((2, np.size(time)))], axis=1) + offset
        return np.linalg.norm(position, axis=1).reshape(np.shape(time))

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)
        signal = synthesize_blocks(
            wheel_paths(radar, psi, hub, pose, turning), radar, chirps, accuracy=FINE, method="direct"
        )
    error = np.abs(np.angle(signal[0] * np.conj(exact(radar, distance))))
    # Third derivative of the length 2 r w^3 = 6.6e4 m/s3: over half a block of 16 chirps, 160 us, 4.5e-8 m or 7e-5 rad
    # more than the paths' own delay, 7e-8 s times 1400 m/s2. Not turning: 1400 m/s2 / 2 over half of 2 chirps, 20 us:
    # 2.8e-7 m.
    assert error.max() < bound
    if chirps == 256:
        assert error.max() > 2e-2  # what one trace for the whole frame would cost


def test_vibrating_point_has_bessel_lines() -> None:
    amplitude, rate, distance = 0.5e-3, 20.0, 20.0
    radar = radar_of(num_chirps=256, idle_time=200e-3 / 256 - 16e-6)  # 200 ms: four periods
    assert radar.frame_time == pytest.approx(0.2)

    def paths_at(time: float):
        phase = 2.0 * np.pi * rate * time
        x, v = distance + amplitude * np.sin(phase), 2.0 * np.pi * rate * amplitude * np.cos(phase)
        paths = point_targets([[x, 0, 0]], [[v, 0, 0]], 1.0, radar, Pose())
        bend = -2.0 * (2.0 * np.pi * rate) ** 2 * amplitude * np.sin(phase)
        return dataclasses.replace(paths, length_acceleration=np.array([bend]))

    signal = slow_time(synthesize_blocks(paths_at, radar, 4, accuracy=FINE))
    lines = np.abs(np.fft.fft(signal)) / radar.num_chirps / np.abs(signal[0])
    found = 20 * np.log10(lines[4 * np.arange(6)])
    # tolerance of the vectors, 0.1 dB; the spreading over 0.5 mm at 20 m is 4e-4 dB but for lines 50 dB down
    assert found == pytest.approx(oracle.VIBRATION_LINES_DB, abs=0.1)
    assert found[0] == pytest.approx(20 * np.log10(oracle.vibration_line(0, amplitude)), abs=0.01)
    assert lines[2] < 1e-4  # between the lines nothing


def test_pendulum_swings_with_its_exact_period() -> None:
    gravity, length, start = 9.80665, 1.0, np.radians(10.0)
    period = oracle.pendulum_period(length, start)
    assert period == pytest.approx(oracle.PENDULUM_PERIOD, rel=1e-10)
    radar = radar_of(num_chirps=64, idle_time=84e-6)
    speed = np.sqrt(2.0 * gravity * length * (1.0 - np.cos(start)))
    mid = radar.frame_time / 2.0

    def paths_at(time: float):
        # through the lowest point at the frame's middle: harmonic to the third order of the time from it
        after, omega = time - mid, np.sqrt(gravity / length)
        angle = speed / (length * omega) * np.sin(omega * after)
        rate = speed / length * np.cos(omega * after)
        position = [[50.0 + length * np.sin(angle), 0.0, -length * np.cos(angle)]]
        velocity = [[length * rate * np.cos(angle), 0.0, length * rate * np.sin(angle)]]
        return point_targets(position, velocity, 1.0, radar, Pose([0, 0, -length]))

    phase = np.unwrap(np.angle(slow_time(synthesize_blocks(paths_at, radar, 8, accuracy=FINE))))
    time = np.arange(64) * radar.doppler_interval - mid
    doppler = np.polyfit(time, phase, 3)[2] / (2.0 * np.pi)  # slope at the lowest point
    assert doppler == pytest.approx(oracle.PENDULUM_DOPPLER, rel=1e-5)  # the vectors' tolerance


def test_blocks_of_a_straight_way_equal_one_solve() -> None:
    radar = radar_of(bandwidth=150e6, num_samples=64, num_chirps=50)
    position, velocity = np.array([[30.0, 4.0, 1.0], [60.0, -9.0, 0.0]]), np.array([[-20.0, 3.0, 0.0], [5.0, 0.0, 1.0]])

    def paths_at(time: float):
        return point_targets(position + velocity * time, velocity, 1.0, radar, Pose())

    whole = synthesize(paths_at(0.0), radar, accuracy=FINE)
    for chirps in (1, 7, 50):
        blocks = synthesize_blocks(paths_at, radar, chirps, accuracy=FINE)
        # One solve keeps the amplitudes of the frame's start: 2 v T / R = 1.3e-3 for 20 m/s, 1 ms and 30 m
        assert np.abs(blocks - whole).max() < 2e-3 * np.abs(whole).max()


def test_noise_and_tdm_rows_are_as_in_synthesize() -> None:
    radar = radar_of(
        num_chirps=8, multiplexing="tdm", tx_positions=((0, 0, 0), (0, 0.01, 0)), bandwidth=150e6, num_samples=64
    )
    paths = point_targets([[30.0, 4.0, 1.0]], [[-20.0, 0.0, 0.0]], 1.0, radar, Pose())
    still = dataclasses.replace(paths, length_acceleration=np.zeros(1))
    fine = {"accuracy": FINE.with_(motion_tolerance=1e-9), "method": "direct"}
    whole = synthesize(still, radar, rng=np.random.default_rng(1), **fine)
    blocks = synthesize_blocks(lambda time: later(still, time), radar, 3, rng=np.random.default_rng(1), **fine)
    assert np.abs(blocks - whole).max() < 1e-6 * np.abs(whole).max()
    with pytest.raises(ParameterRangeError, match="chirps_per_block = 9 .*1 to num_chirps = 8"):
        synthesize_blocks(lambda _: still, radar, 9)


def test_blocks_that_do_not_follow_are_told() -> None:
    radar = radar_of(num_chirps=64)
    pose = Pose()
    with pytest.warns(ScarlWarning, match="do not follow the motion"):
        synthesize_blocks(wheel_paths(radar, 1.3, (10.0, 0, 0), pose, turning=False), radar, 32)

    def blinking(time: float):
        paths = point_targets([[20.0, 0, 0]], [[0, 0, 0]], 1.0, radar, pose)
        return paths.select(slice(0, int(time > 32 * radar.doppler_interval)))

    with pytest.warns(ScarlWarning, match="paths come and go"):
        synthesize_blocks(blinking, radar, 8)


@pytest.mark.some(1)
@pytest.mark.parametrize("method", ["sionna", "sbr"])
def test_retraced_chirps_of_a_moving_wall(tmp_path, method: str) -> None:
    """A plate comes at 30 m/s.

    Blocks that are traced again in the scene keep its phase, and its Doppler bin is 99.2195.

    As a mirror it is larger than the Fresnel zone, for sbr small against it: both then have the phase of one point.
    """
    size = 4.0 if method == "sionna" else 0.1
    plate = Thing(
        "plate",
        plane(size, size, (0, 0, 0), (-1, 0, 0)),
        "Static",
        "steel",
        {"kind": "constant_twist", "position": [50.0, 0, 0], "velocity": [-30.0, 0, 0]},
    )
    world = load_scene(write_scene(tmp_path, actors=[plate]))
    radar = radar_of(ramp_time=25.6e-6, idle_time=14.4e-6)  # the vectors' chirps
    options = {"num_samples": 20_000, "max_depth": 1} if method == "sionna" else {}
    paths_at = retraced(world, radar, Pose(), 0.0, method, **options)
    signal = slow_time(synthesize_blocks(paths_at, radar, 64, accuracy=FINE))
    phase = np.unwrap(np.angle(signal))
    time = np.arange(radar.num_chirps) * radar.doppler_interval
    doppler = np.polyfit(time, phase, 1)[0] / (2.0 * np.pi)
    assert (doppler * radar.frame_time) % 256 == pytest.approx(99.2195, abs=0.01)  # the bar
    tau = 2.0 * (50.0 - 30.0 * time) / (oracle.SPEED_OF_LIGHT - 30.0)
    left = np.unwrap(np.angle(signal * np.exp(-2j * np.pi * radar.waveform.start_frequency * tau)))
    assert np.ptp(left) < 1e-2  # the bar


def test_retraced_radar_that_turns(tmp_path) -> None:
    """A radar's own turn moves its antennas: the same signal as from a wall that is solved at every chirp."""
    wall = Thing("wall", plane(32.0, 32.0, (10, 0, 0), (-1, 0, 0)), "Wall", "steel")
    world = load_scene(write_scene(tmp_path, [wall]))
    radar = radar_of(num_chirps=4, rx_positions=((0.0, 0.1, 0.0),))
    twist = Twist([0, 0, 0], [0, 0, 2.0])
    paths_at = retraced(world, radar, Mount(Pose(), twist), 0.0, "sionna", num_samples=20_000, max_depth=1)
    time = 1.5 * radar.doppler_interval
    assert paths_at(time).world_from_tx.yaw == pytest.approx(2.0 * time)


def blade_scene(folder):
    """A car of one steel blade on a wheel.

    Upright at time 0, 0.22 to 0.32 m from the axle, its normal along the drive.
    """
    blade = plane(0.2, 0.1, (0, 0, 0.32 + 0.27), (1, 0, 0))
    corners = [(0.0, y, 0.32 + r) for y, r in ((-0.1, 0.22), (0.1, 0.22), (0.1, 0.32), (-0.1, 0.32))]
    blade.vertices = np.array(corners)
    blade.faces = [(0, 1, 2), (0, 2, 3)]
    trajectory = {"kind": "constant_twist", "position": [0, 0, 0], "velocity": [oracle.WHEEL_SPEED, 0, 0]}
    return load_scene(with_wheel(write_scene(folder, actors=[Thing("car", blade, "Car", "steel", trajectory)])))


def test_the_sensor_solves_its_frame_in_blocks(tmp_path) -> None:
    """Raw data: blocks give what `synthesize_blocks` gives; one solve differs for a turning blade."""
    world = blade_scene(tmp_path)
    radar = radar_of(ramp_time=8e-6, idle_time=2e-6, num_chirps=32, bandwidth=150e6, num_samples=64, tx_power_dbm=40.0)
    pose = Pose.from_euler([25.0, 0.0, 0.59], yaw=np.pi)
    frames = {
        chirps: Radar(radar, RadarSettings(method="sbr", noise=False, chirps_per_block=chirps)).observe(
            world.at(-16e-5), pose, np.random.default_rng(0)
        )
        for chirps in (None, 4)
    }
    paths_at = retraced(world, radar, pose, -16e-5, "sbr")
    expected = synthesize_blocks(paths_at, radar, 4)
    codes = [quantize(signal, radar)[0] for signal in (expected, synthesize(paths_at(0.0), radar))]
    assert np.array_equal(frames[4].adc_int, codes[0]) and np.array_equal(frames[None].adc_int, codes[1])
    assert not np.array_equal(codes[0], codes[1])
    assert frames[4].num_paths == frames[None].num_paths > 0


def with_wheel(path):
    """Make the only shape of the actor a wheel."""
    toml = path.parent / "scene.toml"
    joint = (
        '[[actors.joints]]\nkind = "wheel"\nshapes = ["shape-car"]\ncenter = [0, 0, 0.32]\nradius = '
        f"{oracle.WHEEL_RADIUS}\n"
    )
    toml.write_text(toml.read_text() + "\n" + joint)
    return path


def blade_field(time: float, radar: np.ndarray, wavenumber: float) -> complex:
    """Physical optics of the blade as an integral over its points, spherical waves: the oracle."""
    across, out = np.meshgrid((np.arange(60) + 0.5) / 60 * 0.2 - 0.1, (np.arange(200) + 0.5) / 200 * 0.1 + 0.22)
    angle = SPIN * time
    x = oracle.WHEEL_SPEED * time + out * np.sin(angle)
    z = 0.32 + out * np.cos(angle)
    away = np.stack([x - radar[0], across - radar[1], z - radar[2]], axis=-1)
    distance = np.linalg.norm(away, axis=-1)
    cosine = np.abs(away @ [np.cos(angle), 0.0, -np.sin(angle)]) / distance
    return complex(np.sum(np.exp(-2j * wavenumber * distance) * cosine / distance**2))


@pytest.mark.some(1)
@pytest.mark.parametrize(("chirps", "bound"), [(8, 0.1), (2, 0.03)])
def test_flash_of_a_blade_on_a_rolling_wheel(tmp_path, chirps: int, bound: float) -> None:
    """Traced again in the scene, wheel joint and all.

    Level, phase and Doppler of the flash are those of the integral.
    """
    world = blade_scene(tmp_path)
    radar = radar_of(ramp_time=8e-6, idle_time=2e-6, num_chirps=96, bandwidth=1e3, sampling_frequency=None)
    pose = Pose.from_euler([60.0, 0.0, 0.59], yaw=np.pi)
    start = -48 * radar.doppler_interval
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        paths_at = retraced(world, radar, pose, start, "sbr", settings=SbrSettings(floor_db=None))
        signal = slow_time(synthesize_blocks(paths_at, radar, chirps, accuracy=FINE))
    wavenumber = 2.0 * np.pi * radar.waveform.start_frequency / oracle.SPEED_OF_LIGHT
    time = start + np.arange(96) * radar.doppler_interval
    expected = np.conj([blade_field(t, pose.position, wavenumber) for t in time])  # beat = tx conj(rx)
    expected *= np.vdot(expected, signal) / np.vdot(expected, expected)  # the constant in front
    strong = np.abs(expected) > 0.1 * np.abs(expected).max()  # the main lobe and 20 dB down
    assert strong.sum() > 40
    # The amplitude of each patch, 5 cm tall, is kept over a block: half a block of 8 chirps, 40 us, turns the blade by
    # 1.9 mrad of the 20 mrad to its null: the error is 9 % there and goes with the length of the block.
    assert np.abs(signal - expected).max() < bound * np.abs(expected).max()
    assert np.abs(np.angle(signal[strong] * np.conj(expected[strong]))).max() < 3.0 * bound
    phase = np.unwrap(np.angle(signal[44:53]))
    doppler = np.polyfit(time[44:53], phase, 1)[0] / (2.0 * np.pi)
    at_middle = -2.0 * oracle.WHEEL_SPEED * (1.0 + 0.27 / oracle.WHEEL_RADIUS) / oracle.WAVELENGTH
    assert doppler == pytest.approx(at_middle, rel=2e-3)


def test_raycast_of_a_turning_tyre_is_told(tmp_path) -> None:
    """Rays meet other points of a turning tyre each time, at the distance of a tyre that does not turn.

    So its hits are those of the frame's start, and blocks change nothing.
    """
    tyre = trimesh.creation.cylinder(0.32, 0.2, sections=64)
    tyre.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    tyre.apply_translation([0, 0, 0.32])
    trajectory = {"kind": "constant_twist", "position": [0, 0, 0], "velocity": [oracle.WHEEL_SPEED, 0, 0]}
    path = write_scene(tmp_path, actors=[Thing("car", tyre, "Car", "steel", trajectory)])
    world = load_scene(with_wheel(path))
    radar = radar_of(
        ramp_time=8e-6,
        idle_time=2e-6,
        num_chirps=32,
        bandwidth=150e6,
        num_samples=64,
        azimuth_fov_deg=4.0,
        elevation_fov_deg=4.0,
    )
    pose = Pose.from_euler([10.0, 0, 0.4], yaw=np.pi)
    with pytest.warns(ScarlWarning, match="blocks of chirps change nothing"):
        paths_at = retraced(world, radar, pose, 0.0, "raycast", num_rays=20_000)
    one = synthesize(solve_paths(world.at(0.0), radar, pose, "raycast", num_rays=20_000), radar, accuracy=FINE)
    blocks = synthesize_blocks(paths_at, radar, 8, accuracy=FINE)
    assert np.abs(blocks - one).max() < 1e-3 * np.abs(one).max()
