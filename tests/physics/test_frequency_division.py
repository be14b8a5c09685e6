"""Frequency division of OFDM: each transmitter's subcarriers, their separation, and the ambiguities."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.specs.radar.array import HALF_WAVE, uniform_line
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.synthesis.blocks import later
from scarl_sionna.signal.noise import add_noise
from tests.oracles.waveforms import received, symbol_train

OFDM = ss.Ofdm(num_subcarriers=96, subcarrier_spacing=600e3, num_chirps=32)
THREE = ss.RadarSpec(waveform=OFDM.with_(num_subcarriers=192), multiplexing="fdm").with_(pattern=IsotropicPattern())
CASCADE = ss.RadarSpec(
    waveform=OFDM.with_(num_subcarriers=384, num_chirps=32),
    multiplexing="fdm",
    array=ss.AntennaArray(
        tx_positions=uniform_line(12, 4 * HALF_WAVE),
        rx_positions=uniform_line(16, HALF_WAVE),
        max_array_extent=2.0,
        pattern=IsotropicPattern(),
    ),
)
SIGHT = np.array([np.cos(0.35), np.sin(0.35), 0.0])


def point(radar, distance, speed=0.0, rcs=1.0):
    return ss.point_targets([distance * SIGHT], [speed * SIGHT], rcs, radar, ss.Pose())


def maps(adc, radar, window="hann"):
    return ss.range_doppler(ss.virtual_cube(adc, radar), radar, window)


@pytest.mark.parametrize("waveform", [OFDM, OFDM.with_(comb=2, comb_offset=1)], ids=["all", "comb"])
def test_a_receiver_gets_what_each_transmitter_sent_a_delay_earlier(waveform) -> None:
    """Three antennas at one place, each with every third of the sent subcarriers, against an exact sum of symbols."""
    here = ((0.0, 0.0, 0.0),)
    radar = THREE.with_(waveform=waveform.with_(num_chirps=4), tx_positions=3 * here, rx_positions=here)
    paths = point(radar, 40.0, 70.0)
    period, prefix = 1.0 / waveform.subcarrier_spacing, waveform.cyclic_prefix
    times = np.arange(4)[:, None] * waveform.chirp_interval + prefix + np.arange(96) / waveform.sample_rate
    wanted = np.zeros(times.shape, complex)
    for tx in range(3):
        tones = (np.arange(96) - 48)[waveform.comb_offset :: waveform.comb][tx::3] * waveform.subcarrier_spacing
        own = radar.waveform_of(tx)
        data = own.spectrum
        assert np.allclose(np.abs(data) ** 2, 1.0 / len(tones))  # the whole power of each
        train = [data, tones, own.chirp_interval, prefix, period]
        sent = lambda time, train=train: symbol_train(*train, time)  # noqa: E731
        wanted += received(40.0 * SIGHT, 70.0 * SIGHT, times, waveform.carrier_frequency, sent)
    wanted *= abs(paths.a[0, 0, 0]) * np.sqrt(1e-3 * 10.0 ** (radar.front_end.tx_power_dbm / 10.0))
    for method in ("nufft", "direct"):
        error = np.abs(ss.synthesize(paths, radar, method=method)[0] - wanted).max() / np.abs(wanted).max()
        assert error < Accuracy().synthesis_tolerance + Accuracy().motion_tolerance


@pytest.mark.parametrize("radar", [THREE, CASCADE], ids=["12", "192"])
@pytest.mark.parametrize("share", [0.0, 0.4])
def test_transmitters_are_separated_below_60_db(radar, share) -> None:
    """One transmitter alone leaves nothing in the channels of the others, at rest and at 20 m/s."""
    paths = point(radar, 9.0, share * radar.unambiguous_velocity)
    for sender in (0, radar.num_tx - 1):
        place = (radar.array.tx_positions[sender],)
        alone = radar.with_(multiplexing="ideal", waveform=radar.waveform_of(sender), tx_positions=place)
        rd = maps(ss.synthesize(paths, alone), radar)
        row, column = np.unravel_index(rd.power.argmax(), rd.power.shape)
        level = (np.abs(rd.data[:, row, column]) ** 2).reshape(radar.num_tx, radar.num_rx).sum(axis=1)
        others = np.delete(level, sender)
        assert others.max() < 1e-6 * level[sender]
        if share == 0.0:
            assert others.max() < 1e-10 * level[sender]


@pytest.mark.parametrize("radar", [THREE, CASCADE], ids=["12", "192"])
def test_channels_are_those_of_ideal_transmitters(radar) -> None:
    """Phases too: the carriers' part is removed at rest and in motion, in the point's cell and between cells."""
    radar = radar.with_(num_subcarriers=96, num_chirps=8)
    ideal = radar.with_(multiplexing="ideal")
    for bins, speed in ((4.0, 0.0), (3.7, 15.0)):
        paths = point(radar, bins * radar.range_resolution, speed)
        found, wanted = (maps(ss.synthesize(paths, item), item) for item in (radar, ideal))
        assert len(wanted.range) == radar.num_tx * len(found.range)
        cell = np.unravel_index(found.power.argmax(), found.power.shape)
        one, other = (rd.data[(slice(None), *cell)] for rd in (found, wanted))
        turn = np.angle(one * np.conj(other))
        # off the bin's middle what is left is the carriers' phase over that distance, 0.3 bins of all subcarriers
        assert np.ptp(turn) < 2.0 * np.pi * (bins % 1.0 > 0.0) * 0.3 * radar.num_tx / 96 + 0.01
        if not speed:
            assert np.abs(one - other).max() < 1e-2 * np.abs(other).max()


@pytest.mark.parametrize("interleaving", [None, 4])
@pytest.mark.parametrize(("distance", "speed"), [(30.0, 0.0), (31.13, 20.0), (47.4, -24.0)])
def test_points_are_found_where_they_are(interleaving, distance, speed) -> None:
    radar = THREE.with_(multiplexing=ss.Fdm(interleaving=interleaving))
    assert radar.max_range == pytest.approx(SPEED_OF_LIGHT / 2 / 600e3 / (interleaving or 3))
    assert radar.unambiguous_velocity == THREE.with_(multiplexing="ideal").unambiguous_velocity
    paths = point(radar, distance, speed, 3e4)
    paths.instance[:] = 5
    rda = ss.range_doppler_angle(ss.virtual_cube(ss.synthesize(paths, radar, np.random.default_rng(0)), radar), radar)
    points = ss.detect(rda, most_directions=1)
    best = points.power.argmax()
    assert points.range[best] == pytest.approx(distance, abs=0.05 * radar.range_resolution)
    assert points.radial_velocity[best] == pytest.approx(speed, abs=0.05 * radar.velocity_resolution)
    assert np.sin(points.azimuth[best]) == pytest.approx(SIGHT[1], abs=0.05 * 2.0 / 12)
    labels = ss.label_points(points, paths, radar)
    assert labels.instance[best] == 5 and labels.explained[best] == pytest.approx(1.0, abs=0.12)


def test_beyond_the_range_a_point_is_nearer_and_its_phases_are_wrong() -> None:
    """By one ambiguity: the carriers turn by 1 / 3 of a cycle from transmitter to transmitter."""
    near, far = (maps(ss.synthesize(point(THREE, place), THREE), THREE) for place in (20.0, THREE.max_range + 20.0))
    cell = (slice(None), *np.unravel_index(near.power.argmax(), near.power.shape))
    assert far.power.argmax() == near.power.argmax()
    turns = np.angle(far.data[cell] * np.conj(near.data[cell])).reshape(3, 4).mean(axis=1)
    assert np.exp(1j * (turns - turns[0])) == pytest.approx(np.exp(2j * np.pi / 3.0 * np.arange(3)), abs=0.01)


@pytest.mark.parametrize("window", ["hann", "rect"])
def test_noise_of_a_cell(window) -> None:
    adc = np.zeros((4, 32, 192), dtype=np.complex64)
    rd = maps(add_noise(adc, THREE, np.random.default_rng(1)), THREE, window)
    assert rd.power.mean() / rd.noise_power == pytest.approx(1.0, abs=0.03)
    single = maps(ss.synthesize(point(THREE, 20.0, 0.0), THREE), THREE, window).power.max()
    alone = THREE.with_(multiplexing="ideal")
    assert single == pytest.approx(maps(ss.synthesize(point(alone, 20.0), alone), alone, window).power.max(), rel=0.1)
    assert rd.noise_power == pytest.approx(maps(np.zeros((4, 96, 192)), alone, window).noise_power, rel=0.02)


def test_two_paths_in_a_cell_are_labelled_by_their_fields_at_all_carriers() -> None:
    """They add up otherwise at each transmitter's carriers: cells' powers are those of the synthesis."""
    radar = THREE.with_(num_subcarriers=96, num_chirps=16)
    places = np.stack([7.0 * SIGHT, 8.2 * SIGHT])
    paths = ss.point_targets(places, [[0.0, 0.0, 0.0], 0.3 * SIGHT], [1.0, 1.5], radar, ss.Pose())
    paths.instance[:] = 3
    rd = maps(ss.synthesize(paths, radar), radar)
    found = ss.label_cells(rd, paths)
    shown = found.power > 0.1 * found.power.max()
    assert shown.sum() > 3
    assert np.abs(found.power - rd.power)[shown].max() < 0.01 * rd.power.max()


def test_blocks_of_symbols_and_errors_of_channels() -> None:
    radar = THREE.with_(num_subcarriers=96, num_chirps=16)
    paths = point(radar, 9.0, 3.0)
    whole = ss.synthesize(paths, radar)
    blocks = ss.synthesize_blocks(lambda time: later(paths, time), radar, 4)
    assert np.linalg.norm(whole - blocks) < 1e-3 * np.linalg.norm(whole)
    gains = ss.ChannelErrors(tx_gain_db=(0.0, -3.0, 6.0), tx_phase_deg=(0.0, 40.0, -70.0))
    real = radar.with_(front_end=radar.front_end.with_(channels=gains))
    ratio = maps(ss.synthesize(paths, real), real).data[:, 8] / maps(whole, radar).data[:, 8]
    wanted = 10.0 ** (np.array([0.0, -3.0, 6.0]) / 20.0) * np.exp(-1j * np.radians([0.0, 40.0, -70.0]))  # as of ramps
    column = maps(whole, radar).power[8].argmax()
    assert np.allclose(ratio[:, column], np.repeat(wanted, 4), rtol=1e-3)


def test_as_an_interferer_each_transmitter_sends_its_own_subcarriers() -> None:
    both = THREE.with_(num_subcarriers=96, num_chirps=4, tx_positions=((0.0, 0.0, 0.0), (0.0, 0.05, 0.0)))
    victim, facing = ss.RadarSpec().with_(num_chirps=4), ss.Pose([20.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])

    def left(sender):
        return ss.synthesize_interference(ss.one_way_paths(sender, facing, ss.Pose()), sender, victim)

    own = [
        both.with_(multiplexing="ideal", waveform=both.waveform_of(tx), tx_positions=(both.array.tx_positions[tx],))
        for tx in range(2)
    ]
    wanted = left(own[0]) + left(own[1])
    assert np.linalg.norm(left(both) - wanted) < 1e-5 * np.linalg.norm(wanted)


def test_own_data_goes_to_the_transmitters_in_turn_and_comes_back_from_files() -> None:
    phases = tuple(tuple(float(v) for v in row) for row in np.random.default_rng(0).uniform(0.0, 360.0, (4, 12)))
    waveform = ss.Ofdm(num_subcarriers=12, num_chirps=4, data_phases_deg=phases)
    radar = ss.RadarSpec(waveform=waveform, multiplexing="fdm")
    second = radar.waveform_of(1).spectrum
    assert np.allclose(second, np.exp(1j * np.radians(np.array(phases)[:, 1::3])) / 2.0)
    assert ss.RadarSpec(**radar.model_dump(mode="json")) == radar
    assert not np.array_equal(*(THREE.waveform_of(tx).spectrum for tx in (0, 1)))


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"waveform": ss.Fmcw()}, "'fdm' with 'fmcw'.*subcarriers.*take 'tdm'"),
        ({"waveform": ss.Pmcw()}, "'fdm' with 'pmcw'"),
        ({"waveform": ss.Ofdm(num_subcarriers=512)}, "num_subcarriers = 512.*multiple of 3.*take 513"),
        ({"waveform": ss.Ofdm(num_subcarriers=512, comb=2)}, "multiple of 6"),
        (
            {"waveform": ss.Ofdm(num_subcarriers=516), "multiplexing": ss.Fdm(interleaving=2)},
            "interleaving = 2.*>= num_tx = 3",
        ),
    ],
)
def test_what_cannot_be_divided_is_refused(parts, message) -> None:
    with pytest.raises(ParameterRangeError, match=message):
        ss.RadarSpec(**({"multiplexing": "fdm"} | parts))
