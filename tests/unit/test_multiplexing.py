"""Multiplexing: separation of the transmitters, ambiguities against theory, refusals, and what is made of raw data."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.array import HALF_WAVE, uniform_line
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.synthesis.blocks import later
from scarl_sionna.signal.detection import cfar
from scarl_sionna.signal.noise import add_noise, cell_noise_power

SMALL = ss.RadarSpec().with_(num_chirps=64, num_samples=64)
CASCADE = ss.RadarSpec(
    waveform=ss.Fmcw(num_chirps=64, num_samples=32),
    array=ss.AntennaArray(
        tx_positions=uniform_line(12, 4 * HALF_WAVE), rx_positions=uniform_line(4, HALF_WAVE), max_array_extent=2.0
    ),
)
KINDS = {
    "ddm": ss.Ddm(),
    "ddm4": ss.Ddm(num_empty_bands=4),
    "bpm": ss.Bpm(),
    "cdm": ss.Cdm(code_seed=3),
    "tdm": ss.Tdm(),
    "random": ss.Tdm(order_seed=5),
}


def coded(radar, kind):
    """A radar with a multiplexing, of the nearest number of chirps that its codes allow."""
    period = KINDS[kind].code_period(radar.num_tx) or 1
    return radar.with_(num_chirps=-(-radar.num_chirps // period) * period, multiplexing=KINDS[kind])


def raw(radar, points, velocities, rcs=1.0, rng=None):
    paths = ss.point_targets(points, velocities, rcs, radar, Pose())
    return ss.synthesize(paths, radar, rng=rng, method="direct")


def on_bin(radar, share):
    """A velocity on a Doppler bin, at a share of the unambiguous one."""
    count = radar.separated.num_chirps
    return round(share * count / 2) * 2.0 * radar.unambiguous_velocity / count


@pytest.mark.some(8)
@pytest.mark.parametrize("kind", ["ddm", "ddm4", "bpm", "cdm"])
@pytest.mark.parametrize("base", [SMALL, CASCADE], ids=["12", "48"])
@pytest.mark.parametrize("share", [0.0, 0.31, -0.77])
def test_transmitters_are_separated_below_60_db(kind, base, share):
    """One transmitter alone leaves nothing in the channels of the others, in the cell of a target of known Doppler."""
    radar = coded(base, kind)
    velocity = on_bin(radar, share)
    alone = raw(radar.separated, [[9.0, 2.0, 0.0]], [[0.0, 0.0, 0.0]]).reshape(
        radar.num_rx, radar.num_chirps, radar.num_tx, -1
    )[:, :1, :, :]
    cycles = 2.0 * velocity * radar.center_frequency / SPEED_OF_LIGHT * radar.chirp_interval
    turn = np.exp(2j * np.pi * cycles * np.arange(radar.num_chirps))
    codes = radar.multiplexing.codes(radar.num_chirps, radar.num_tx)
    row = round(velocity / radar.velocity_resolution) + radar.num_chirps // 2
    for sender in {0, radar.num_tx // 2, radar.num_tx - 1}:
        adc = alone[:, :, sender] * (turn * codes[:, sender])[:, None]
        cube = ss.virtual_cube(adc.astype(np.complex64), radar)
        spectrum = np.fft.fftshift(np.fft.fft(cube, axis=1), axes=1)[:, row]
        level = (np.abs(spectrum) ** 2).sum(axis=1).reshape(radar.num_tx, radar.num_rx).sum(axis=1)
        others = np.delete(level, sender)
        assert others.max() < 1e-6 * level[sender]


@pytest.mark.some(5)
@pytest.mark.parametrize("kind", list(KINDS))
@pytest.mark.parametrize("base", [SMALL, CASCADE], ids=["12", "48"])
def test_channels_are_those_of_ideal_transmitters(kind, base):
    """In the cell of a moving target the channels are the ideal ones, whatever the multiplexing."""
    radar = coded(base, kind)
    ideal = radar.with_(multiplexing="ideal")
    velocity, sight = on_bin(radar, 0.4), np.array([9.0, 2.0, 0.0]) / np.hypot(9.0, 2.0)
    target = [9.2 * sight], [velocity * sight]
    maps = [
        ss.range_doppler(ss.virtual_cube(raw(item, *target), item), item, doppler_window="rect")
        for item in (ideal, radar)
    ]
    cells = [rd.data[(slice(None), *np.unravel_index(rd.power.argmax(), rd.power.shape))] for rd in maps]
    places = [rd.radial_velocity[rd.power.argmax() // rd.power.shape[1]] for rd in maps]
    assert places[1] == pytest.approx(places[0], abs=maps[0].radar.velocity_resolution)
    apart = np.abs(np.vdot(cells[0], cells[1])) / np.linalg.norm(cells[0]) / np.linalg.norm(cells[1])
    assert apart > 0.999 if kind != "random" else apart > 0.97  # random order leaves a floor of 1 / num_chirps


def test_a_transmitter_separated_under_a_window_off_the_bins():
    """With a window the bands of Doppler division are apart at any velocity, up to the window's side lobes."""
    radar = coded(SMALL.with_(num_chirps=256), "ddm")
    codes = radar.multiplexing.codes(256, 3)
    turn = np.exp(2j * np.pi * 17.37 / 256 * np.arange(256))
    window = np.blackman(256)
    for sender in range(3):
        channels = [np.fft.fft(window * turn * codes[:, sender] * codes[:, tx].conj())[17] for tx in range(3)]
        others = np.delete(np.abs(channels), sender).max()
        assert 20 * np.log10(others / abs(channels[sender])) < -60.0


@pytest.mark.parametrize(("kind", "factor"), [("tdm", 3), ("random", 1), ("ddm", 1), ("bpm", 1), ("cdm", 1)])
def test_unambiguous_velocity(kind, factor):
    radar = coded(SMALL, kind)
    assert radar.unambiguous_velocity == pytest.approx(
        SPEED_OF_LIGHT / radar.center_frequency / (4.0 * factor * radar.chirp_interval)
    )
    assert radar.num_chirps_total == radar.num_chirps * (1 if kind in ("ddm", "bpm", "cdm") else 3)


@pytest.mark.some(7)
@pytest.mark.parametrize("kind", ["ddm", "ddm4", "bpm", "cdm", "random"])
@pytest.mark.parametrize("share", [-0.83, -0.4, 0.1, 0.55, 0.91])
def test_velocity_and_direction_over_the_whole_interval(kind, share):
    """One target at any velocity within lambda / (4 T) is found once, at its place."""
    radar = coded(SMALL, kind)
    velocity = share * radar.unambiguous_velocity
    sight = np.array([8.0, 3.0, 0.0]) / np.hypot(8.0, 3.0)
    adc = raw(radar, [8.5 * sight], [velocity * sight], 1.0, np.random.default_rng(7))
    rda = ss.range_doppler_angle(ss.virtual_cube(adc, radar), radar)
    rd = rda.range_doppler
    rows = np.unique(np.flatnonzero(rd.power.max(axis=1) > rd.power.max() / 100.0))
    points = ss.detect(rda)
    strongest = points.power.argmax()
    assert points.radial_velocity[strongest] == pytest.approx(velocity, abs=0.1 * rd.radar.velocity_resolution)
    assert points.azimuth[strongest] == pytest.approx(np.arctan2(3.0, 8.0), abs=np.radians(0.5))
    if kind not in ("cdm", "random"):  # no image stands within 20 dB
        assert np.ptp(rows) <= 4 or np.ptp(rows) >= len(rd.power) - 4


@pytest.mark.parametrize("kind", [ss.Bpm(), ss.Ddm(), ss.Bpm(block_length=32)])
@pytest.mark.parametrize("num_tx", [2, 3, 4, 6, 7, 8, 12, 16])
def test_every_image_reaches_codes_that_nobody_sends(kind, num_tx):
    """What tells a velocity from its images: turned by each of them, the codes are no sum of those that are sent."""
    used, unused = np.split(kind.matrix(num_tx), [num_tx], axis=1)
    period = len(used)
    for image in range(1, period):
        turned = np.exp(2j * np.pi * image * np.arange(period) / period)[:, None] * used
        in_unused = (np.abs(unused.conj().T @ turned / period) ** 2).sum(axis=0).mean()  # of a power of 1
        assert in_unused > 0.99 * min(0.5, (period - num_tx) / (2 * num_tx)), image


@pytest.mark.parametrize("num_tx", [2, 4, 6])
def test_an_even_number_of_binary_transmitters_has_one_velocity(num_tx):
    array = ss.AntennaArray(tx_positions=uniform_line(num_tx, 4 * HALF_WAVE), rx_positions=uniform_line(4, HALF_WAVE))
    radar = SMALL.with_(array=array, multiplexing=ss.Bpm())
    sight = np.array([np.cos(0.28), np.sin(0.28), 0.0])
    for seed, velocity in enumerate((3.0, -7.0, 14.0)):
        adc = raw(radar, [8.5 * sight], [velocity * sight], 1.0, np.random.default_rng(seed))
        points = ss.detect(ss.range_doppler_angle(ss.virtual_cube(adc, radar), radar))
        strongest = points.power.argmax()
        assert points.radial_velocity[strongest] == pytest.approx(velocity, abs=0.1 * radar.velocity_resolution)
        assert points.azimuth[strongest] == pytest.approx(0.28, abs=np.radians(0.5))


@pytest.mark.parametrize("kind", ["cdm", "random"])
def test_residual_of_irregular_codes_is_as_theory_says(kind):
    """The floor over other velocities: 1 / num_chirps a code, (num_tx - 1) / (num_tx num_chirps) of random order."""
    radar = coded(SMALL.with_(num_chirps=256, num_samples=4), kind)
    cube = ss.virtual_cube(np.ones((4, radar.num_chirps_total, 4), dtype=np.complex64), radar)
    if kind == "cdm":  # a static point that only transmitter 0 lights
        codes = radar.multiplexing.codes(256, 3)
        cube = ss.virtual_cube(np.tile(codes[:, :1], (4, 1, 4)).astype(np.complex64), radar)
        floor = np.abs(np.fft.fft(cube[4, :, 0]) / 256) ** 2
        assert floor.mean() == pytest.approx(1 / 256, rel=1e-5)  # Parseval
        assert floor.max() < 10 / 256 and floor[0] < 1e-6
        return
    floor = np.abs(np.fft.fft(cube[0, :, 0]) / len(cube[0])) ** 2
    assert floor[0] == pytest.approx(1.0)
    # the zeros of one turn in three, but for the lines that every turn shares
    assert np.sort(floor[1:])[:-2].mean() == pytest.approx(2 / 3 / 256, rel=0.15)


@pytest.mark.parametrize("kind", list(KINDS))
def test_noise_of_a_cell(kind):
    radar = coded(SMALL, kind)
    adc = np.zeros((4, radar.num_chirps_total, radar.num_samples), dtype=np.complex64)
    rd = ss.range_doppler(ss.virtual_cube(add_noise(adc, radar, np.random.default_rng(1)), radar), radar)
    assert rd.noise_power / cell_noise_power(radar) == pytest.approx(1.0)
    assert (np.abs(rd.data) ** 2).mean() / rd.noise_power == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("kind", ["ddm", "bpm", "cdm", "random"])
def test_blocks_of_chirps_are_the_whole_frame(kind):
    radar = coded(SMALL, kind)
    paths = ss.point_targets([[9.0, 2.0, 0.0]], [[3.0, 0.0, 0.0]], 1.0, radar, Pose())
    whole = ss.synthesize(paths, radar, method="direct")
    blocks = ss.synthesize_blocks(lambda time: later(paths, time), radar, 16, method="direct")
    assert np.linalg.norm(whole - blocks) < 1e-3 * np.linalg.norm(whole)


@pytest.mark.parametrize(
    ("multiplexing", "num_chirps", "text"),
    [
        (ss.Ddm(), 63, r"num_chirps = 63 .*multiple of 4"),
        (ss.Bpm(block_length=8), 60, r"multiple of 8"),
        (ss.Bpm(block_length=6), 60, r"block_length = 6 .*power of 2"),
        (ss.Bpm(block_length=2), 64, r"block_length = 2 .*above num_tx = 3"),
        (ss.Cdm(), 2, r"num_chirps = 2 .*>= num_tx = 3"),
        (ss.Cdm(phases_deg=((0.0, 90.0),)), 64, r"phases_deg = 1 codes of \[2\] chirps"),
    ],
)
def test_frames_that_cannot_be_coded_are_refused(multiplexing, num_chirps, text):
    with pytest.raises(ParameterRangeError, match=text):
        ss.RadarSpec(waveform=ss.Fmcw(num_chirps=num_chirps), multiplexing=multiplexing)


def test_doppler_bins_must_hold_whole_bands():
    radar = coded(SMALL, "ddm")
    cube = ss.virtual_cube(raw(radar, [[9.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]]), radar)
    assert ss.range_doppler(cube, radar, num_doppler_bins=128).data.shape[1] == 128
    with pytest.raises(ParameterRangeError, match="num_doppler_bins = 70 .*multiple of 4"):
        ss.range_doppler(cube, radar, num_doppler_bins=70)


def test_given_codes_are_sent():
    phases = tuple(tuple(float(v) for v in row) for row in np.random.default_rng(0).uniform(0, 360, (3, 64)))
    radar = SMALL.with_(multiplexing=ss.Cdm(phases_deg=phases))
    assert np.allclose(np.angle(radar.multiplexing.codes(64, 3)[5, 2]), np.angle(np.exp(1j * np.radians(phases[2][5]))))
    assert ss.RadarSpec(**radar.model_dump(mode="json")) == radar


MANY = ss.RadarSpec.preset("radial_hd").with_(num_samples=64, bandwidth=64 * SPEED_OF_LIGHT / 206.0, num_chirps=128)
"""192 channels and 16 rows of images."""
SIGHT = np.array([np.cos(0.2), np.sin(0.2), 0.0])


@lru_cache
def unit_target(velocity):
    """Raw data of a target of the radar MANY whose beam is as strong as the noise."""
    adc = ss.synthesize(ss.point_targets([18.0 * SIGHT], [velocity * SIGHT], 1.0, MANY, Pose()), MANY)
    beam = np.mean(np.abs(adc) ** 2) * MANY.num_rx  # the transmitters' powers add up over a period of their codes
    return adc / np.sqrt(beam / cell_noise_power(MANY))


def found_at(seed, *targets):
    """Points of targets (velocity, beam over the noise in dB) at one range."""
    adc = sum(10 ** (snr_db / 20.0) * unit_target(velocity) for velocity, snr_db in targets)
    adc = add_noise(adc, MANY, np.random.default_rng(seed))
    return ss.detect(ss.range_doppler_angle(ss.virtual_cube(adc, MANY), MANY))


@pytest.mark.parametrize(("snr_db", "most"), [(22.0, 1), (26.0, 1), (40.0, 3), (73.0, 6)])
def test_many_channels_leave_no_images(snr_db, most):
    """Weak in each of 192 channels, an image stood out of their sum, and one scaled to the noise of their beams."""
    points = found_at(3, (1.7, snr_db))
    assert points.radial_velocity[0] == pytest.approx(1.7, abs=0.5 * MANY.velocity_resolution)
    assert points.num_points <= most


def test_a_weak_target_beside_a_strong_one_is_no_image():
    """Another velocity at the same range, which is none of the strong target's images."""
    velocity = 1.7 + 2.5 * 2.0 * MANY.unambiguous_velocity / 16.0
    for seed in range(2):
        points = found_at(seed, (1.7, 60.0), (velocity, 26.0))
        assert np.abs(points.radial_velocity - velocity).min() < 0.5 * MANY.velocity_resolution


@pytest.mark.parametrize("kind", ["ddm", "bpm"])
def test_noise_with_periodic_codes_keeps_the_rate(kind):
    """Images of noise are taken out where they exceed it, and what they are filled with has its rate."""
    radar, alarms, cells = coded(SMALL, kind), 0, 0
    for seed in range(12):
        adc = np.zeros((4, radar.num_chirps_total, radar.num_samples), dtype=np.complex64)
        rd = ss.range_doppler(ss.virtual_cube(add_noise(adc, radar, np.random.default_rng(seed)), radar), radar)
        found = cfar(rd, 1e-3)
        alarms, cells = alarms + int(found.sum()), cells + found.size
    assert 0.7e-3 < alarms / cells < 1.3e-3
