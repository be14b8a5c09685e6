"""Other radars in the raw data, against closed forms of bursts, levels and times."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.fft

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.units import SPEED_OF_LIGHT, dbm_to_watt
from scarl_sionna.signal.receivers import noise_share

DISTANCE = 40.0
DELAY = DISTANCE / SPEED_OF_LIGHT
ARRAY = ss.AntennaArray(
    tx_positions=((0.0, 0.0, 0.0),),
    rx_positions=((0.0, 0.0, 0.0), (0.0, 0.03, 0.0)),
    pattern={"kind": "isotropic", "gain_dbi": 3.0},
)
RAMPS = ss.Fmcw(bandwidth=300e6, ramp_time=30e-6, num_samples=512, num_chirps=4)
VICTIM = ss.RadarSpec(waveform=RAMPS, array=ARRAY)
FACING = ss.Pose([DISTANCE, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])


def level(sender: ss.RadarSpec) -> float:
    """Friis, both gains 3 dBi [W]."""
    gain = 10.0 ** (6.0 / 10.0)
    return float(dbm_to_watt(sender.front_end.tx_power_dbm)) * gain * (sender.wavelength / (4 * np.pi * DISTANCE)) ** 2


def left_by(sender, victim=VICTIM, mount=FACING, own=None, **when):
    paths = ss.one_way_paths(sender, mount, ss.Pose() if own is None else own)
    return ss.synthesize_interference(paths, sender, victim, **when)


@pytest.mark.parametrize(
    ("bandwidth", "direction", "start"),
    [
        (345e6, "up", 76.98e9),
        (255e6, "up", 77.02e9),
        (600e6, "up", 76.85e9),
        (150e6, "up", 77.08e9),
        (300e6, "down", 77.3e9),
    ],
)
def test_a_ramp_of_another_slope_is_a_burst(bandwidth, direction, start) -> None:
    sender = VICTIM.with_(waveform=RAMPS.with_(bandwidth=bandwidth, direction=direction, start_frequency=start))
    own, rate = VICTIM.waveform.chirp_slope, VICTIM.sample_rate
    slope = sender.waveform.chirp_slope
    ahead = VICTIM.carrier_frequency - sender.carrier_frequency + slope * DELAY  # beat at the ramp's start
    middle = (0.5 * rate - ahead) / (own - slope)
    data = left_by(sender)
    power = np.abs(data[0]) ** 2 / level(sender)
    length = rate / abs(own - slope)
    assert 3e-6 < middle < 27e-6  # the burst is in the samples
    for row in power[1:3]:
        assert row.sum() / rate == pytest.approx(length, rel=0.01)
        time = np.arange(len(row)) / rate
        inside = np.abs(time - middle) < 0.35 * length
        if length > 10e-6:  # the ripple at an ideal filter's edges dies out within
            assert row[inside].mean() == pytest.approx(1.0, rel=0.01)
        assert row[np.abs(time - middle) > 0.8 * length].max() < 0.05
        # time: from the phase of the burst, which turns at 0.5 rate in its middle
        turn = np.unwrap(np.angle((data[0, 1] * np.exp(-1j * np.pi * rate * time))[inside]))
        frequency = np.polynomial.Polynomial.fit(time[inside], turn, 2).deriv()(middle) / (2.0 * np.pi)
        assert frequency / (own - slope) == pytest.approx(0.0, abs=0.01 * length)


def test_ramps_of_one_slope_are_a_ghost_at_half_the_way() -> None:
    victim, late = VICTIM.with_(num_chirps=32), 0.3e-6
    moving = ss.Mount(FACING, ss.Twist([-8.0, 0.0, 0.0]))
    data = left_by(victim, victim, moving, start_time=late)
    found = ss.range_doppler(ss.virtual_cube(data, victim), victim)
    power = np.abs(found.data[0]) ** 2
    row, column = np.unravel_index(power.argmax(), power.shape)
    seen = 0.5 * (DISTANCE + late * SPEED_OF_LIGHT)
    assert found.range[column] == pytest.approx(seen, abs=0.6 * victim.range_resolution)
    assert found.radial_velocity[row] == pytest.approx(-4.0, abs=0.6 * victim.velocity_resolution)
    assert np.abs(data[0]).max() ** 2 == pytest.approx(level(victim), rel=0.01)
    # it is there from its arrival to the ramp's end, at one level
    power, rate = np.abs(data[0, 1]) ** 2 / level(victim), victim.sample_rate
    length = 30e-6 - late - DELAY
    assert power.sum() / rate == pytest.approx(length, rel=0.01)
    begins = np.arange(len(power))[power > 0.25][0] / rate
    assert begins == pytest.approx(late + DELAY, abs=0.01 * length)
    assert power[64:448] == pytest.approx(np.ones(384), rel=0.01)
    # phases between the receivers are those of a plane wave, and its delay along the line of sight
    turned = left_by(victim, victim, ss.Pose([0.0, DISTANCE, 0.0]), start_time=late)
    apart = DISTANCE - np.hypot(DISTANCE - 0.03, 0.0)
    cycles = np.angle(turned[1, 0, 256] / turned[0, 0, 256]) / (2.0 * np.pi)
    assert (cycles + apart * 77.15e9 / SPEED_OF_LIGHT + 0.5) % 1.0 - 0.5 == pytest.approx(0.0, abs=0.01)


def test_ramps_that_start_too_late_stay_out_of_the_band() -> None:
    late = 1.05 * VICTIM.sample_rate / VICTIM.waveform.chirp_slope
    far = left_by(VICTIM, start_time=late - DELAY, frame_interval=1.0)
    near = left_by(VICTIM, start_time=0.9 * late - DELAY, frame_interval=1.0)
    middle = slice(64, 448)
    assert np.mean(np.abs(far[0, 1, middle]) ** 2) < 1e-3 * level(VICTIM)
    assert np.mean(np.abs(near[0, 1, middle]) ** 2) == pytest.approx(level(VICTIM), rel=0.01)


def test_a_low_pass_makes_the_burst_as_long_as_its_noise_bandwidth() -> None:
    corner = 4e6
    victim = VICTIM.with_(filters=ss.IfFilter(low_pass=corner, low_pass_order=2))
    sender = VICTIM.with_(waveform=RAMPS.with_(bandwidth=600e6, start_frequency=76.85e9))
    power = np.abs(left_by(sender, victim)[0, 0]) ** 2 / level(sender)
    width = 2.0 * corner * np.pi / 4.0 / np.sin(np.pi / 4.0)  # of a Butterworth filter of order 2, both sides
    slope = sender.waveform.chirp_slope - VICTIM.waveform.chirp_slope
    assert power.sum() / VICTIM.sample_rate == pytest.approx(width / slope, rel=0.01)


def test_a_ramp_in_a_phase_coded_radar() -> None:
    """A chirp in the band of the chips: it enters and leaves when its frequency does, at the level of Friis."""
    code = ss.Pmcw(code_length=255, repetitions=1, num_chirps=64, carrier_frequency=77e9)
    victim = VICTIM.with_(waveform=code)
    sender = VICTIM.with_(waveform=RAMPS.with_(bandwidth=900e6, start_frequency=76.55e9, num_chirps=1))
    slope, rate = sender.waveform.chirp_slope, victim.sample_rate
    power = np.abs(left_by(sender, victim)[0].ravel()) ** 2 / level(sender)
    enters = (77e9 - 0.5 * rate - 76.55e9) / slope + DELAY
    leaves = enters + rate / slope
    time = np.arange(len(power)) / rate
    inside = (time > enters + 0.2e-6) & (time < leaves - 0.2e-6)
    whole = (time > enters - 1e-6) & (time < leaves + 1e-6)
    assert power[inside].mean() == pytest.approx(1.0, rel=0.01)
    assert power[whole].sum() / rate == pytest.approx(rate / slope, rel=0.01)
    edges = time[whole][power[whole] > 0.5][[0, -1]]
    assert edges == pytest.approx([enters, leaves], abs=0.01 * (leaves - enters))
    # the correlator spreads it over all of range and Doppler, as noise of its mean power
    data = left_by(sender, victim)
    rd = ss.range_doppler(ss.virtual_cube(data, victim), victim, "rect")
    cells = np.abs(rd.data[0]) ** 2
    assert cells.mean() == pytest.approx(np.mean(np.abs(data[0]) ** 2) * noise_share(victim, "rect") / 64, rel=0.01)
    assert np.mean(cells, axis=0).max() < 2.0 * cells.mean()
    averaged = left_by(sender, victim.with_(repetitions=4, num_chirps=16))[0].ravel()
    plain = left_by(sender, victim)[0].reshape(16, 4, 255).mean(axis=1).ravel()
    assert np.abs(averaged - plain).max() < 0.02 * np.sqrt(level(sender))


@pytest.mark.parametrize(
    "waveform",
    [
        ss.Pmcw(code_length=255, repetitions=3, num_chirps=4, prefix_chips=20),
        ss.Ofdm(num_subcarriers=256, subcarrier_spacing=1.2e6, num_chirps=4, idle_time=5e-6),
    ],
    ids=["pmcw", "ofdm"],
)
def test_codes_in_a_receiver_of_ramps_are_what_their_tones_leave(waveform) -> None:
    """Against the sum over all tones at a high rate, and the same ideal filter."""
    sender = VICTIM.with_(waveform=waveform)
    data = left_by(sender, start_time=-3e-6, frame_interval=1.0)
    rate, over = VICTIM.sample_rate, 64
    time = np.arange(-64 * over, (512 + 64) * over) / (over * rate)
    sent = np.zeros(len(time), dtype=complex)
    tones = waveform.spacing * (waveform.sent - waveform.num_samples // 2)
    for number in range(4):
        after = time - DELAY + 3e-6 - number * waveform.chirp_interval - waveform.prefix_time
        on = (after >= -waveform.prefix_time) & (after < waveform.repetitions / waveform.spacing)
        row = waveform.spectrum[number % len(waveform.spectrum)]
        sent[on] += np.exp(2j * np.pi * np.outer(after[on], tones)) @ row
    mixer = 0.5 * VICTIM.waveform.chirp_slope * time**2
    beat = np.conj(sent * np.exp(2j * np.pi * (-77e9 * DELAY - mixer)))
    spectrum = scipy.fft.fft(beat)
    frequency = scipy.fft.fftfreq(len(beat), 1.0 / (over * rate))
    through = np.cos(0.5 * np.pi * np.clip((np.abs(frequency - 0.5 * rate) - 0.45 * rate) / (0.1 * rate), 0.0, 1.0))
    expected = scipy.fft.ifft(spectrum * through)[64 * over :: over][:512]
    error = data[0, 0] / np.sqrt(level(sender)) - expected
    starts = np.arange(4) * waveform.chirp_interval - 3e-6 + DELAY
    ends = starts + waveform.prefix_time + waveform.repetitions / waveform.spacing
    at = time[64 * over :: over][:512]
    switched = np.min(np.abs(at[:, None] - np.concatenate([starts, ends])), axis=1) < 0.3e-6
    assert switched.mean() < 0.2
    assert np.abs(error[~switched]).max() < 0.01 * np.abs(expected).max()
    assert np.abs(error).max() < 0.15 * np.abs(expected).max()  # switched on at once: tones far from the band count


@pytest.mark.parametrize("bandwidth", [300e6, 345e6])
def test_coded_ramps_in_a_receiver_of_ramps_are_what_their_lines_leave(bandwidth) -> None:
    """Against the sum over all lines at a high rate: of one slope they stay in the band, of another they sweep."""
    ramps = ss.PcFmcw(bandwidth=bandwidth, ramp_time=30e-6, num_chirps=2, code_length=31, start_frequency=76.995e9)
    late, rate, over = 2e-7, VICTIM.sample_rate, 16
    data = left_by(VICTIM.with_(waveform=ramps), start_time=late, frame_interval=1.0)[0, 0]
    time = np.arange(-64 * over, (512 + 64) * over) / (over * rate)
    u = time - DELAY - late
    line, strength = ramps.lines
    cycles = 76.995e9 * (time - DELAY) - 77e9 * time + 0.5 * (ramps.chirp_slope * u**2 - 1e13 * time**2)
    sent = (np.exp(2j * np.pi * np.outer(u, line)) @ strength) * np.exp(2j * np.pi * cycles) * ((u >= 0) & (u < 30e-6))
    spectrum = scipy.fft.fft(np.conj(sent))
    frequency = scipy.fft.fftfreq(len(time), 1.0 / (over * rate))
    through = np.cos(0.5 * np.pi * np.clip((np.abs(frequency - 0.5 * rate) - 0.45 * rate) / (0.1 * rate), 0.0, 1.0))
    expected = scipy.fft.ifft(spectrum * through)[64 * over :: over][:512]
    inside = slice(24, -24)  # away from where it is switched on
    error = data / np.sqrt(level(VICTIM.with_(waveform=ramps))) - expected
    assert np.abs(expected[inside]).max() > 0.5
    assert np.abs(error[inside]).max() < 0.01 * np.abs(expected).max()


def test_all_kinds_meet_all_kinds_at_their_level() -> None:
    """Long enough for a mean: what is sent in the receiver's band arrives with its power."""
    kinds = {
        "fmcw": RAMPS,
        "stepped": ss.SteppedFmcw(bandwidth=75e6, num_steps=4, num_chirps=8, num_samples=256),
        "pc": ss.PcFmcw(bandwidth=300e6, num_chirps=4, code_length=31),
        "ofdm": ss.Ofdm(num_subcarriers=128, subcarrier_spacing=2.4e6, num_chirps=8, idle_time=0.0),
        "pmcw": ss.Pmcw(code_length=127, repetitions=8, num_chirps=8),
    }
    for sent in kinds.values():
        for heard in kinds.values():
            sender, victim = VICTIM.with_(waveform=sent), VICTIM.with_(waveform=heard)
            data = left_by(sender, victim, start_time=1.3e-6)
            assert data.shape == (2, victim.num_chirps_total, victim.num_samples)
            assert np.isfinite(data).all()
            assert np.mean(np.abs(data) ** 2) < 1.5 * level(sender)


def test_turns_and_codes_of_the_transmitters() -> None:
    places = ((0.0, 0.01, 0.0), (0.0, -0.01, 0.0))
    array = ARRAY.with_(tx_positions=places)
    victim = VICTIM.with_(num_chirps=16)
    # in turn, one at a time: the level of one
    tdm = VICTIM.with_(array=array, multiplexing=ss.Tdm(), num_chirps=8)
    data = left_by(tdm, victim)
    assert np.mean(np.abs(data[0]) ** 2) == pytest.approx(level(VICTIM), rel=0.01)
    # at once with codes: their fields add, in phase or against each other from chirp to chirp
    ddm = VICTIM.with_(array=array, multiplexing=ss.Bpm(), num_chirps=16)
    power = np.mean(np.abs(left_by(ddm, victim)[0, :, 100:400]) ** 2, axis=1) / level(VICTIM)
    assert np.sort(np.round(power, 1)).tolist() == [0.0] * 8 + [4.0] * 8


def test_rows_of_the_listening_radar_have_their_times() -> None:
    """Rows that share a chirp hold the same; transmitters in turn hear at the times of their own rows."""
    array = ARRAY.with_(tx_positions=((0.0, 0.01, 0.0), (0.0, -0.01, 0.0)))
    sender = VICTIM.with_(num_chirps=64, bandwidth=310e6, idle_time=7.9e-6)
    ideal, tdm, coded = (
        VICTIM.with_(array=array, multiplexing=kind, num_chirps=count)
        for kind, count in ((ss.IdealMimo(), 8), (ss.Tdm(), 4), (ss.Bpm(), 8))
    )
    together = left_by(sender, ideal)
    assert together.shape == (2, 16, 512)
    assert np.array_equal(together[:, 0::2], together[:, 1::2])
    assert np.array_equal(left_by(sender, tdm), together[:, 0::2])
    assert np.array_equal(left_by(sender, coded), together[:, 0::2])
    assert not np.allclose(together[0, 0], together[0, 2])


def test_transmit_and_receive_polarisation_and_pattern() -> None:
    other = VICTIM.with_(polarization="H")
    crossed = left_by(other)
    assert np.abs(crossed).max() < 1e-9 * np.sqrt(level(VICTIM))
    rolled = ss.Pose.from_euler([DISTANCE, 0.0, 0.0], yaw=np.pi, roll=np.pi / 4.0)
    half = np.mean(np.abs(left_by(VICTIM, mount=rolled)[0, 1, 64:448]) ** 2)
    assert half == pytest.approx(0.5 * level(VICTIM), rel=0.01)


def test_the_mixer_s_image_and_channel_gains() -> None:
    sender = VICTIM.with_(waveform=RAMPS.with_(bandwidth=600e6, start_frequency=76.85e9))
    plain = left_by(sender)
    gains = ss.ChannelErrors(rx_gain_db=(0.0, -6.0), rx_phase_deg=(0.0, 90.0))
    other = left_by(sender, VICTIM.with_(channels=gains))
    assert other[1] == pytest.approx(
        plain[1] * 10.0 ** (-6.0 / 20.0) * np.exp(-0.5j * np.pi), abs=1e-6 * float(np.abs(plain).max())
    )
    unbalanced = left_by(sender, VICTIM.with_(mixer=ss.Mixer(iq_gain_db=1.0), filters=ss.IfFilter(low_pass=4e6)))
    balanced = left_by(sender, VICTIM.with_(filters=ss.IfFilter(low_pass=4e6)))
    turn = 10.0 ** (1.0 / 20.0)
    expected = 0.5 * (1.0 + turn) * balanced + 0.5 * (1.0 - turn) * np.conj(balanced)
    assert unbalanced == pytest.approx(expected, abs=1e-5 * float(np.abs(plain).max()))


def test_the_amplifier_warns() -> None:
    with pytest.warns(ss.ScarlWarning, match="compression point"):
        left_by(VICTIM, VICTIM.with_(amplifier=ss.Amplifier(p1db_dbm=-80.0)))


def test_the_noise_floor_of_a_burst_is_its_energy() -> None:
    """Seen in the map, a burst is noise whose power is its energy over all samples, times the window's."""
    victim = VICTIM.with_(num_chirps=64)
    sender = VICTIM.with_(
        waveform=RAMPS.with_(bandwidth=600e6, start_frequency=76.85e9, num_chirps=64, idle_time=8.37e-6)
    )
    data = left_by(sender, victim, start_time=-1e-6)
    found = ss.range_doppler(ss.virtual_cube(data, victim), victim, window="rect")
    mean = np.mean(np.abs(found.data[0]) ** 2)
    assert mean == pytest.approx(np.sum(np.abs(data[0]) ** 2) / data[0].size ** 2, rel=0.01)


@pytest.mark.parametrize("share", [0.5, -1.0, 0.0, float("nan")])
def test_frames_closer_than_they_last_are_refused(share) -> None:
    with pytest.raises(ParameterRangeError, match="frame_interval"):
        left_by(VICTIM, frame_interval=share * VICTIM.frame_time)
