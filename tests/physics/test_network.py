"""Networks of radars against closed forms: bistatic delay and Doppler, images and their resolution, clocks."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.link import received_power
from scarl_sionna.radar.weather.attenuation import weather_attenuation
from scarl_sionna.radar.weather.clutter import through_weather
from tests.oracles.waveforms import turns
from tests.scenes import Thing, box, plane, write_scene

ARRAY = ss.AntennaArray(
    tx_positions=((0.0, 0.0, 0.0),), rx_positions=((0.0, 0.0, 0.0),), pattern={"kind": "isotropic", "gain_dbi": 0.0}
)
RADAR = ss.RadarSpec(waveform=ss.Fmcw(num_chirps=32, num_samples=256), array=ARRAY)
LEFT, RIGHT = ss.Pose([0.0, 3.0, 0.0]), ss.Pose([1.0, -2.0, 0.5])
POINT, VELOCITY = np.array([30.0, 4.0, 1.0]), np.array([-7.0, 5.0, 0.0])


def legs(point=POINT, velocity=VELOCITY, own=(0.0, 0.0, 0.0)):
    ahead = [point - pose.position for pose in (LEFT, RIGHT)]
    length = sum(np.linalg.norm(a) for a in ahead)
    rate = sum(a @ (velocity - np.array(v)) / np.linalg.norm(a) for a, v in zip(ahead, ((0, 0, 0), own), strict=True))
    return length, rate


@pytest.mark.parametrize("own", [(0.0, 0.0, 0.0), (12.0, 0.0, 0.0)])
def test_a_bistatic_pair_measures_both_ways_and_both_rates(own) -> None:
    back = ss.Mount(RIGHT, ss.Twist(list(own)))
    paths = ss.point_targets(POINT[None], VELOCITY[None], 2.0, RADAR, LEFT, receiver=back)
    length, rate = legs(own=own)
    assert paths.length == pytest.approx([length]) and paths.length_rate == pytest.approx([rate])
    distances = [np.linalg.norm(POINT - pose.position) for pose in (LEFT, RIGHT)]
    expected = 1e-3 * 10 ** (RADAR.front_end.tx_power_dbm / 10) * 2.0 * RADAR.wavelength**2 / (4 * np.pi) ** 3
    assert received_power(paths, RADAR) == pytest.approx([expected / np.prod(distances) ** 2])
    adc = ss.synthesize(paths, RADAR)
    rd = ss.range_doppler(ss.virtual_cube(adc, RADAR), RADAR)
    row, column = np.unravel_index(np.abs(rd.data[0]).argmax(), rd.data[0].shape)
    assert rd.range[column] == pytest.approx(0.5 * length, abs=0.55 * RADAR.range_resolution)
    assert rd.radial_velocity[row] == pytest.approx(0.5 * rate, abs=0.55 * RADAR.velocity_resolution)
    # every sample, against the wave followed back in time: emitted at t - tau, scattered in between
    start = np.arange(32)[:, None] * RADAR.chirp_interval
    ts = np.arange(256) / RADAR.sample_rate
    time, tau = start + ts, np.full((32, 256), length / SPEED_OF_LIGHT)
    receiver = RIGHT.position + time[..., None] * np.array(own)
    for _ in range(4):
        at = time - np.linalg.norm(POINT + (time - tau / 2)[..., None] * VELOCITY - receiver, axis=-1) / SPEED_OF_LIGHT
        for _ in range(4):
            way = np.linalg.norm(POINT + at[..., None] * VELOCITY - receiver, axis=-1)
            at = time - way / SPEED_OF_LIGHT
        tau = time - at + np.linalg.norm(POINT + at[..., None] * VELOCITY - LEFT.position, axis=-1) / SPEED_OF_LIGHT
    slope = RADAR.waveform.chirp_slope
    exact = turns(77e9 * tau + slope * tau * (ts - 0.5 * tau)) * np.sqrt(expected) / np.prod(distances)
    turn = np.vdot(adc[0], exact)  # a common phase: motion before the echo leaves, v / c of the way
    assert abs(np.angle(turn)) < 0.05
    error = adc[0] * turn / abs(turn) - exact
    assert np.abs(error).max() < 3e-3 * np.abs(exact).max()


def line(count: int, spacing: float) -> tuple[ss.Pose, ...]:
    return tuple(ss.Pose([0.0, (k - (count - 1) / 2) * spacing, 0.0]) for k in range(count))


def image_of(network, points, values, **options):
    targets = np.asarray(points, dtype=float)
    paths = ss.network_paths(network, points=(targets, np.zeros_like(targets), np.ones(len(targets))))
    return ss.back_project(ss.synthesize_network(paths, network), values, **options)


def test_an_image_is_the_sum_over_exact_delays() -> None:
    """Closed form over a line across: mean of the pairs' phases at the middle frequency, and the range window."""
    network = ss.RadarNetwork(RADAR, line(6, 0.4))
    target = np.array([20.0, 0.5, 0.0])
    across = np.stack([np.full(401, 20.0), 0.5 + np.linspace(-0.4, 0.4, 401), np.zeros(401)], axis=1)
    found = image_of(network, [target], across)
    total, own = np.zeros(401, dtype=complex), 0.0
    middle, count, spacing = RADAR.center_frequency, 256, RADAR.waveform.chirp_slope / RADAR.sample_rate
    for tx, rx in network.pairs:
        ends = [network.places[k].pose.position for k in (tx, rx)]
        there = np.array([np.linalg.norm(target - end) for end in ends])
        here = sum(np.linalg.norm(across - end, axis=1) for end in ends)
        tau, at = there.sum() / SPEED_OF_LIGHT, here / SPEED_OF_LIGHT
        bend = -0.5 * RADAR.waveform.chirp_slope * (tau**2 - at**2)
        x = np.pi * spacing * (tau - at)
        window = np.sin(count * x) / np.where(x == 0.0, 1.0, np.sin(x)) / count
        total += np.where(x == 0.0, 1.0, window) / there.prod() * np.exp(2j * np.pi * (middle * (tau - at) + bend))
        own += 1.0 / there.prod()
    peak = np.abs(found).max()
    assert np.abs(across[np.abs(found).argmax(), 1] - 0.5) < 1e-9
    assert np.abs(found) / peak == pytest.approx(np.abs(total) / own, abs=0.01)


def test_resolution_is_that_of_the_aperture() -> None:
    """A line of N radars, each pair an element of the two-way pattern: the squared pattern of the line."""
    count, spacing, distance = 6, 0.05, 60.0
    network = ss.RadarNetwork(RADAR, line(count, spacing))
    sine = np.linspace(-0.03, 0.03, 1201)
    across = np.stack([distance * np.sqrt(1 - sine**2), distance * sine, np.zeros_like(sine)], axis=1)
    found = np.abs(image_of(network, [[distance, 0.0, 0.0]], across)) ** 2
    found /= found.max()
    x = np.pi * spacing * sine * RADAR.center_frequency / SPEED_OF_LIGHT
    pattern = np.abs(np.sin(count * x) / np.where(x == 0.0, 1.0, count * np.sin(x)))
    pattern[x == 0.0] = 1.0
    assert found == pytest.approx(pattern**4, abs=0.01)
    width = np.ptp(sine[(found > 0.5) & (np.abs(sine) < 0.02)])
    expected = np.ptp(sine[(pattern**4 > 0.5) & (np.abs(sine) < 0.02)])
    assert width == pytest.approx(expected, rel=0.02)
    alone = np.abs(image_of(network, [[distance, 0.0, 0.0]], across, pairs=[(0, 0)])) ** 2
    assert alone.min() > 0.99 * alone.max()  # one antenna resolves no angle


def test_together_two_points_are_two_alone_they_are_one() -> None:
    array = ss.RadarSpec().array
    radar = RADAR.with_(array=array)
    network = ss.RadarNetwork(radar, line(6, 0.4))
    points = [[20.0, -0.12, 0.0], [20.0, 0.12, 0.0]]
    y = np.linspace(-0.4, 0.4, 321)
    across = np.stack([np.full_like(y, 20.0), y, np.zeros_like(y)], axis=1)
    together = np.abs(image_of(network, points, across)) ** 2
    one = np.abs(image_of(network, points, across, pairs=[(2, 2)])) ** 2
    between, at = np.abs(y) < 0.005, np.abs(np.abs(y) - 0.12) < 0.005
    assert together[at].max() > 10.0 * together[between].max()
    assert one.min() > 0.7 * one.max()


def test_clocks_that_are_known_are_taken_out() -> None:
    offsets, phases = (0.0, 20e-9, 5e-9), (0.0, 80.0, -130.0)
    mounts = line(3, 0.4)
    exact, late = ss.RadarNetwork(RADAR, mounts), ss.RadarNetwork(RADAR, mounts, offsets, phases)
    target = [[25.0, 0.0, 0.0]]
    y = np.linspace(-0.6, 0.6, 241)
    across = np.stack([np.full_like(y, 25.0), y, np.zeros_like(y)], axis=1)
    first, second = image_of(exact, target, across), image_of(late, target, across)
    assert second == pytest.approx(first, abs=1e-3 * float(np.abs(first).max()))
    blurred = image_of(late, target, across, clocks=False)
    assert np.abs(blurred[120]) < 0.7 * np.abs(first[120])
    # phases alone: the closed form of their mean over all pairs
    turned = ss.RadarNetwork(RADAR, mounts, (), phases)
    wrong = image_of(turned, target, across[120:121], clocks=False)[0]
    mean = np.mean([np.exp(1j * np.radians(b - a)) for a in phases for b in phases])
    assert wrong / first[120] == pytest.approx(mean, abs=0.01)


def test_a_transmitter_that_starts_late_is_heard_late() -> None:
    """The raw data of each pair: delay and phase by both clocks."""
    late, target = 200e-9, np.array([[40.0, 0.0, 0.0]])
    one = ss.RadarNetwork(RADAR, line(2, 0.4))
    two = ss.RadarNetwork(RADAR, line(2, 0.4), (0.0, late))
    turned = ss.RadarNetwork(RADAR, line(2, 0.4), (), (0.0, 90.0))
    paths = ss.network_paths(one, points=(target, np.zeros((1, 3)), np.ones(1)))
    frames = [ss.synthesize_network(paths, network) for network in (one, two, turned)]
    for pair, sign in (((0, 0), 0), ((0, 1), -1), ((1, 0), 1), ((1, 1), 0)):
        seen = []
        for frame in frames[:2]:
            rd = ss.range_doppler(ss.virtual_cube(frame.adc[pair], RADAR), RADAR, num_range_bins=2048)
            seen.append(rd.range[np.abs(rd.data[0]).max(axis=0).argmax()])
        moved = 0.5 * sign * late * SPEED_OF_LIGHT
        assert seen[1] - seen[0] == pytest.approx(moved, abs=0.15 * RADAR.range_resolution)
        ratio = frames[2].adc[pair][0, 0, 0] / frames[0].adc[pair][0, 0, 0]
        assert ratio == pytest.approx(1j ** (-sign), abs=1e-4)  # transmit times conj(receive)


@pytest.mark.parametrize("sampling", ["complex", "real"])
def test_phases_of_oscillators_are_there_before_the_receiver(sampling) -> None:
    """A constant at the converter does not turn with them; the I of a turned beat is sampled, not a turned I."""
    radar = RADAR.with_(dc_offset_dbm=-125.0, sampling=sampling)
    network = ss.RadarNetwork(radar, line(2, 0.4), (), (0.0, 90.0))
    paths = ss.network_paths(network, points=(np.array([[25.0, 1.0, 0.0]]), np.zeros((1, 3)), np.ones(1)))
    found = ss.synthesize_network(paths, network)
    plain = ss.synthesize_network(paths, ss.RadarNetwork(RADAR, network.mounts))
    constant = np.sqrt(10.0**-15.5 / 2.0) * (1.0 + 1.0j)
    for pair, turn in (((0, 0), 1.0), ((0, 1), 1.0j), ((1, 0), -1.0j)):
        want = plain.adc[pair] * turn + constant
        want = want.real if sampling == "real" else want
        assert np.abs(found.adc[pair] - want).max() < 1e-4 * np.abs(plain.adc[pair]).max()


@pytest.mark.parametrize("waveform", [None, ss.Pmcw(num_chirps=4)])
def test_an_oscillator_that_leads_turns_echoes_of_every_waveform(waveform) -> None:
    """Of ramps transmit times conj(receive), of symbols as they arrive: the other way round."""
    radar = RADAR if waveform is None else RADAR.with_(waveform=waveform)
    network = ss.RadarNetwork(radar, line(2, 0.4), (), (0.0, 90.0))
    paths = ss.network_paths(network, points=(np.array([[25.0, 1.0, 0.0]]), np.zeros((1, 3)), np.ones(1)))
    found, plain = (ss.synthesize_network(paths, one) for one in (network, ss.RadarNetwork(radar, network.mounts)))
    turn = 1.0j if waveform is None else -1.0j
    level = np.abs(plain.adc[0, 1]).max()
    assert np.abs(found.adc[0, 1] - turn * plain.adc[0, 1]).max() < 1e-4 * level


def echoes_of_two(radar, distance: float = 3.0, seed: int = 4):
    """Phases of an echo in all pairs of two radars, from what they are without errors."""
    places = line(2, 0.4)
    networks = [ss.RadarNetwork(one, places) for one in (radar, radar.with_(front_end=radar.front_end.ideal()))]
    paths = ss.network_paths(networks[0], points=(np.array([[distance, 0.0, 0.0]]), np.zeros((1, 3)), np.full(1, 1e12)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ss.ScarlWarning)  # more than is sent
        noisy = ss.synthesize_network(paths, networks[0], np.random.default_rng(seed))
        clean = ss.synthesize_network(paths, networks[1])
        one = ss.synthesize(paths[0, 1], radar, np.random.default_rng(seed))
    turned = {pair: np.angle(data * clean.adc[pair].conj())[0] for pair, data in noisy.adc.items()}
    return turned, np.angle(one * clean.adc[0, 1].conj())[0]


def test_each_radar_has_an_oscillator_of_its_own_in_all_its_pairs() -> None:
    """A flat mask S a few metres away: 2 S f_s of two oscillators, 2 S f_s (1 - sinc(f_s tau)) of one."""
    level = 10.0**-10.5
    radar = RADAR.with_(num_chirps=128, phase_noise=ss.PhaseNoise(mask=((1e6, -105.0),)), noise_figure_db=0.0)
    turned, alone = echoes_of_two(radar)
    apart = 2.0 * level * radar.sample_rate
    near = apart * (1.0 - np.sinc(radar.sample_rate * 6.0 / SPEED_OF_LIGHT))
    for pair, want in (((0, 0), near), ((1, 1), near), ((0, 1), apart), ((1, 0), apart)):
        assert turned[pair].var() == pytest.approx(want, rel=0.05)
    assert alone.var() == pytest.approx(apart, rel=0.05)  # one pair alone
    # there and back the same two: what is left of the sum is the range correlation of both
    assert (turned[0, 1] + turned[1, 0]).var() == pytest.approx(2.0 * near, rel=0.05)


def test_ramps_of_each_radar_jitter_by_themselves() -> None:
    """Starts that differ by d shift the beat by S d, the other way in the other sense."""
    jitter = 1e-10
    radar = RADAR.with_(num_chirps=512, chirp_errors=ss.ChirpErrors(start_jitter=jitter), noise_figure_db=0.0)
    turned, alone = echoes_of_two(radar)
    ts = radar.waveform.sweep.first + np.arange(radar.num_samples) / radar.sample_rate
    slope = radar.waveform.chirp_slope
    sums = [np.polyfit(ts, turned[pair].T, 1) / (2.0 * np.pi * slope) for pair in ((0, 1), (1, 0))]
    assert sums[0][0].std() == pytest.approx(np.sqrt(2.0) * jitter, rel=0.1)
    assert sums[0][0] == pytest.approx(-sums[1][0], abs=0.01 * jitter)
    assert np.polyfit(ts, alone.T, 1)[0].std() / (2.0 * np.pi * slope) == pytest.approx(np.sqrt(2.0) * jitter, rel=0.1)
    delay = 2.0 * np.hypot(3.0, 0.2) / SPEED_OF_LIGHT
    for pair in ((0, 0), (1, 1)):  # one ramp for both: 2 pi S tau d
        assert turned[pair].mean(axis=1).std() == pytest.approx(2.0 * np.pi * slope * delay * jitter, rel=0.1)
    both = turned[0, 0].mean(axis=1) + turned[1, 1].mean(axis=1)
    assert (turned[0, 1] + turned[1, 0]).mean(axis=1) == pytest.approx(both, abs=0.02 * float(both.std()))


def test_ways_within_a_sensor_are_in_its_own_pair_alone() -> None:
    leaky = RADAR.with_(leakage=(ss.Leakage(length=0.1, level_db=-40.0),))
    network = ss.RadarNetwork(leaky, line(2, 0.4))
    point = (np.array([[25.0, 1.0, 0.0]]), np.zeros((1, 3)), np.ones(1))
    paths = ss.network_paths(network, points=point)
    found = ss.synthesize_network(paths, network)
    plain = ss.synthesize_network(paths, ss.RadarNetwork(RADAR, network.mounts))
    level = np.sqrt(1e-3 * 10.0 ** ((RADAR.front_end.tx_power_dbm - 40.0) / 10.0))
    for number in (0, 1):
        own = found.adc[number, number] - plain.adc[number, number]
        assert np.abs(own) == pytest.approx(np.full(own.shape, level), rel=1e-3)
        assert np.array_equal(found.adc[number, 1 - number], plain.adc[number, 1 - number])
    alone = ss.point_targets(*point, leaky, network.mounts[0], receiver=network.mounts[1])
    assert np.array_equal(ss.synthesize(alone, leaky), plain.adc[0, 1])


def test_motion_is_focused_and_pairs_sum_by_power() -> None:
    network = ss.RadarNetwork(RADAR, line(3, 0.4))
    place, velocity = np.array([[25.0, 0.0, 0.0]]), np.array([[-9.0, 3.0, 0.0]])
    paths = ss.network_paths(network, points=(place, velocity, np.ones(1)))
    frame = ss.synthesize_network(paths, network)
    level = np.sqrt(received_power(paths[1, 1], RADAR)[0])
    focused = ss.back_project(frame, place, velocity[0])
    assert np.abs(focused) == pytest.approx([level], rel=0.01)
    assert np.abs(ss.back_project(frame, place))[0] < 0.3 * level
    assert ss.back_project(frame, place, velocity[0], coherent=False) == pytest.approx([level], rel=0.01)


def test_what_is_refused_says_so() -> None:
    network = ss.RadarNetwork(RADAR, line(2, 0.4), (0.0, 1e-6))
    points = (np.array([[25.0, 0.0, 0.0]]), np.zeros((1, 3)), np.ones(1))
    with pytest.raises(ParameterRangeError, match="nearest echo"):
        ss.synthesize_network(ss.network_paths(network, points=points), network)
    with pytest.raises(ParameterRangeError, match="one a radar"):
        ss.RadarNetwork(RADAR, line(2, 0.4), (0.0,))
    with pytest.raises(ParameterRangeError, match="state of the world"):
        ss.network_paths(network)
    coded = ss.RadarNetwork(RADAR.with_(waveform=ss.Pmcw(num_chirps=4)), line(1, 0.4))
    with pytest.raises(ParameterRangeError, match="equal ramps"):
        image_of(coded, points[0], points[0])
    with pytest.raises(ParameterRangeError, match="pairs"):
        image_of(ss.RadarNetwork(RADAR, line(1, 0.4)), points[0], points[0], pairs=[(0, 3)])


@pytest.mark.some(1)
@pytest.mark.parametrize("method", ["sbr", "sionna"])
def test_pairs_in_a_scene_are_those_of_the_solver(tmp_path, method) -> None:
    wall = Thing("plate", plane(0.3, 0.3, (10.0, 0.0, 1.0), (-1, 0, 0)), "Static", "steel")
    state = ss.load_scene(write_scene(tmp_path, instances=[wall])).at(0.0)
    poses = (ss.Pose([0.0, 0.2, 1.0]), ss.Pose([0.0, -0.2, 1.0]))
    network = ss.RadarNetwork(RADAR, poses)
    settings = ss.RadarSettings.of(method)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ss.ScarlWarning)  # a small mirror
        paths = ss.network_paths(network, state, settings=settings)
        both = {"sbr": {"reciprocal": True}} if method == "sbr" else {}
        alone = ss.solve_paths(state, RADAR, poses[0], settings=settings, receiver=poses[1], **both)
    assert set(paths) == {(0, 0), (0, 1), (1, 0), (1, 1)}
    assert paths[0, 1].length == pytest.approx(alone.length)
    powers = {pair: np.abs(some.a[:, 0, 0].sum()) for pair, some in paths.items()}
    assert powers[0, 1] == pytest.approx(powers[1, 0], rel=0.01) and powers[0, 1] > 0.0
    found = paths[0, 1].length
    assert found[found > 1.0].min() == pytest.approx(2.0 * np.hypot(10.0, 0.2), abs=0.02)


def test_rain_lowers_all_pairs_and_sends_back_in_those_of_one_radar(tmp_path) -> None:
    wall = Thing("plate", plane(0.3, 0.3, (10.0, 0.0, -9.0), (-1, 0, 0)), "Static", "steel")
    world = ss.load_scene(write_scene(tmp_path, instances=[wall]))
    rain = ss.Weather(rain_rate=100.0)
    dry, wet = world.at(0.0), world.with_weather(rain).at(0.0)
    network = ss.RadarNetwork(RADAR, (ss.Pose([0.0, 0.2, 1.0]), ss.Pose([0.0, -60.0, 1.0])))
    points = (np.array([[50.0, 0.0, 1.0]]), np.zeros((1, 3)), np.full(1, 1e3))
    plain, lowered = (ss.network_paths(network, state, points=points) for state in (dry, wet))
    loss = weather_attenuation(rain, RADAR.center_frequency, "V") / 1e3
    for pair, some in plain.items():
        lost = 20.0 * np.log10(np.abs(some.a[0, 0, 0] / lowered[pair].a[0, 0, 0]))
        assert some.num_paths == lowered[pair].num_paths == 1
        assert lost == pytest.approx(loss * some.length[0], rel=1e-6) and lost > 2.0
    with_drops = ss.network_paths(network, wet, points=points, drops=np.random.default_rng(0))
    counts = {pair: some.num_paths for pair, some in with_drops.items()}
    assert counts[0, 0] > 100 and counts[1, 1] > 100 and counts[0, 1] == counts[1, 0] == 1
    assert "one radar" in with_drops[0, 1].diagnostics["weather"]["left_out"]
    alone = ss.point_targets(*points, RADAR, network.mounts[0], dry, receiver=network.mounts[1])
    pair = through_weather(alone, wet, RADAR, np.random.default_rng(0))
    assert np.array_equal(pair.a, lowered[0, 1].a)
    with pytest.raises(ParameterRangeError, match="in their weather already"):
        through_weather(lowered[0, 0], wet, RADAR, None)


@pytest.mark.parametrize("given", [None, False])
def test_pairs_of_a_network_are_reciprocal_without_a_further_solve(tmp_path, given) -> None:
    """A box seen 10 deg apart, beside its flashes: the mean of both senses, each solved once, or each by itself."""
    mesh = box((0.2, 0.15, 0.1), (12.0, 0.0, 0.0))
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.3, (0, 0, 1), (12.0, 0.0, 0.0)))
    state = ss.load_scene(write_scene(tmp_path, [Thing("target", mesh, "Static", "steel")])).at(0.0)
    network = ss.RadarNetwork(RADAR, (ss.Pose([0.0, 1.0, 0.0]), ss.Pose([0.0, -1.0, 0.0])))
    knobs = SbrSettings(floor_db=None, reciprocal=given)
    found = ss.network_paths(network, state, settings=ss.RadarSettings(method="sbr", sbr=knobs))

    def field(paths):
        wave = np.exp(-2j * np.pi * RADAR.center_frequency / SPEED_OF_LIGHT * paths.length)
        return np.einsum("nij,n->ij", paths.a, wave)

    there, back = field(found[0, 1]), field(found[1, 0])
    apart = np.abs(there - back.T).max() / np.abs(there).max()
    assert (apart < 1e-9) if given is None else (apart > 0.01)
    plain = ss.RadarSettings(method="sbr", sbr=knobs.with_(reciprocal=False))
    one, other = (
        field(ss.solve_paths(state, RADAR, network.mounts[a], settings=plain, receiver=network.mounts[b]))
        for a, b in ((0, 1), (1, 0))
    )
    want = (one + other.T) / 2.0 if given is None else one
    assert np.abs(there - want).max() < 1e-9 * np.abs(want).max()
    assert found[0, 0].a.tobytes() == ss.solve_paths(state, RADAR, network.mounts[0], settings=plain).a.tobytes()
