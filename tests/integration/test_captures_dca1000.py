"""Captures of a DCA1000, written from TI's documents: every number comes back, and what was planted is found."""

from __future__ import annotations

import json
import tracemalloc

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import InputFileError, ParameterRangeError, UnknownNameError
from scarl_sionna.core.results import Frame, RadarFrame
from scarl_sionna.dataset.captures.ti_cfg import read_cfg
from scarl_sionna.dataset.formats.dca1000 import export_dca1000
from scarl_sionna.dataset.formats.source import FrameSource, SceneFrames
from scarl_sionna.fusion import Rig, SensorMount
from tests.ti_captures import cfg_text, studio, write_bin, write_studio

SENDERS, LOOPS = (0, 2, 1), 32
BOARD = ss.RadarSpec.preset("awr1843boost_3d").array
RADAR = ss.RadarSpec(
    waveform=ss.Fmcw(
        start_frequency=77e9,
        bandwidth=30e12 * 40e-6,
        ramp_time=40e-6,
        idle_time=7e-6,
        adc_start_time=5e-6,
        num_samples=128,
        sampling_frequency=4e6,
        num_chirps=LOOPS,
    ),
    multiplexing=ss.Tdm(),
    array=BOARD.with_(tx_positions=tuple(BOARD.tx_positions[k] for k in SENDERS)),
)
"""What the description of the tests stands for, put together by hand."""
POINTS = ((5.2, -1.1, 20.0, 0.0), (9.7, 0.6, -25.0, 8.0))
"""Range [m], radial velocity [m/s], azimuth and elevation [deg]."""


def frame(radar: ss.RadarSpec = RADAR, seed: int = 0) -> np.ndarray:
    """Return I and Q of a frame with two points and noise."""
    distance, speed, azimuth, elevation = np.array(POINTS).T
    azimuth, elevation = np.radians(azimuth), np.radians(elevation)
    ray = np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=1
    )
    paths = ss.point_targets(ray * distance[:, None], ray * speed[:, None], 1e-3 * distance**4, radar, ss.Pose())
    return ss.quantize(ss.synthesize(paths, radar, rng=np.random.default_rng(seed)), radar)[0]


FRAMES = [frame(seed=seed) for seed in (0, 1)]


def assert_as_planted(capture: ss.Capture) -> None:
    """Assert numbers, axes and points; nothing that works on simulated data is told that this is none."""
    assert len(capture) == 2 and capture.radar.waveform == RADAR.waveform
    assert capture.radar.array == RADAR.array and capture.radar.multiplexing == RADAR.multiplexing
    assert capture.timestamp_ns.tolist() == [0, 50_000_000]
    for found, written in zip(capture, FRAMES, strict=True):
        np.testing.assert_array_equal(found.adc_int, written)
    radar = capture.radar
    rd = ss.range_doppler(capture.cube(1), radar)
    assert rd.range[1] == pytest.approx(radar.range_resolution)
    points = ss.detect(ss.range_doppler_angle(capture[1]))
    assert points.num_points >= 2
    for distance, speed, azimuth, elevation in POINTS:
        near = int(np.argmin(np.abs(points.range - distance)))
        assert abs(points.range[near] - distance) < 0.2 * radar.range_resolution
        assert abs(points.radial_velocity[near] - speed) < 0.2 * radar.velocity_resolution
        assert abs(np.degrees(points.azimuth[near]) - azimuth) < 1.0
        assert abs(np.degrees(points.elevation[near]) - elevation) < 2.0
    assert rd.plot().images or rd.plot().collections


def test_a_capture_with_the_commands_of_the_demo(tmp_path) -> None:
    (tmp_path / "profile.cfg").write_text(cfg_text(SENDERS, LOOPS))
    for one in FRAMES:
        write_bin(tmp_path / "adc_data.bin", one)
    assert_as_planted(ss.read_capture(tmp_path, "dca1000"))


def test_a_capture_of_mmwave_studio_in_two_files(tmp_path) -> None:
    for one in FRAMES:
        write_bin(tmp_path / "all.bin", one)
    data = (tmp_path / "all.bin").read_bytes()
    cut = len(data) // 2 - 1000  # a frame goes on in the next file
    (tmp_path / "cut_0.bin").write_bytes(data[:cut])
    (tmp_path / "cut_1.bin").write_bytes(data[cut:])
    write_studio(tmp_path, SENDERS, LOOPS, ["cut_0.bin", "cut_1.bin"])
    assert_as_planted(ss.read_capture(tmp_path, "dca1000"))


@pytest.mark.parametrize(("lanes", "interleaved"), [(2, False), (4, True), (4, False), (2, True)])
@pytest.mark.parametrize("q_first", [False, True])
def test_lanes_and_orders(tmp_path, lanes, interleaved, q_first) -> None:
    order = {"lanes": lanes, "interleaved": interleaved, "q_first": q_first}
    adc = np.random.default_rng(3).integers(-(2**15), 2**15, (4, 6, 128, 2)).astype(np.int16)
    write_studio(tmp_path, SENDERS, 2, ["adc_data.bin"], **order)
    write_bin(tmp_path / "adc_data.bin", adc, **order)
    np.testing.assert_array_equal(ss.read_capture(tmp_path, "dca1000")[0].adc_int, adc)
    other = ss.read_capture(tmp_path, "dca1000", q_first=not q_first)
    np.testing.assert_array_equal(other[0].adc_int, adc[..., ::-1])


def test_real_samples_and_a_part_of_the_receivers(tmp_path) -> None:
    adc = np.random.default_rng(4).integers(-(2**15), 2**15, (2, 8, 64, 2)).astype(np.int16)
    adc[..., 1] = 0
    (tmp_path / "a.cfg").write_text(cfg_text((1,), 8, rx_mask=0b1010, is_real=True, samples=64))
    write_bin(tmp_path / "adc_data.bin", adc, is_real=True)
    capture = ss.read_capture(tmp_path, "dca1000", full_scale_dbm=-20.0)
    np.testing.assert_array_equal(capture[0].adc_int, adc)
    assert capture.radar.adc.is_real and capture.radar.adc.full_scale_dbm == -20.0
    assert capture.radar.array.rx_positions == (BOARD.rx_positions[1], BOARD.rx_positions[3])
    assert capture.radar.array.tx_positions == (BOARD.tx_positions[1],)
    assert ss.range_doppler(capture[0]).data.shape == (2, 8, 32)


def test_complex_samples_with_the_image_band_and_of_12_bits(tmp_path) -> None:
    """Twelve bits have a step of their own; that half of the range axis is the image band is told."""
    text = cfg_text(SENDERS, LOOPS).replace("adcCfg 2 1", "adcCfg 0 2")
    (tmp_path / "a.cfg").write_text(text)
    write_bin(tmp_path / "adc_data.bin", FRAMES[0])
    capture = ss.read_capture(tmp_path, "dca1000", full_scale_dbm=-30.0)
    assert capture.radar.adc.bits == 12 and any("image band" in note for note in capture.notes)
    assert capture.scale == pytest.approx(np.sqrt(1e-6) / 2047)  # -30 dBm is 1 uW
    data = json.loads(json.dumps(studio(SENDERS, LOOPS)))
    data["mmWaveDevices"][0]["rfConfig"]["rlAdcOutCfg_t"]["fmt"].update(b2AdcOutFmt=2, b2AdcBits=0)
    (tmp_path / "a.mmwave.json").write_text(json.dumps(data))
    other = ss.read_capture(
        tmp_path, "dca1000", config=tmp_path / "a.mmwave.json", board="awr1843boost", full_scale_dbm=-30.0
    )
    assert other.radar == capture.radar and other.notes == capture.notes


@pytest.mark.parametrize("bits", [12, 14, 16])
@pytest.mark.parametrize("has_sign", [True, False])
def test_the_sign_of_fewer_bits(tmp_path, bits, has_sign) -> None:
    """Devices leave the bits above a sample's at zero; TI's reader and ours make them the sign."""
    least = -(2 ** (bits - 1))
    adc = np.random.default_rng(5).integers(least, -least, (4, 6, 128, 2)).astype(np.int16)
    adc[0, 0, 0] = least, -least - 1
    (tmp_path / "a.cfg").write_text(cfg_text(SENDERS, 2).replace("adcCfg 2 1", f"adcCfg {(bits - 12) // 2} 1"))
    write_bin(tmp_path / "adc_data.bin", adc if has_sign or bits == 16 else adc & (2**bits - 1))
    np.testing.assert_array_equal(ss.read_capture(tmp_path, "dca1000")[0].adc_int, adc)


def test_samples_of_more_bits_than_described(tmp_path) -> None:
    (tmp_path / "a.cfg").write_text(cfg_text(SENDERS, 2).replace("adcCfg 2 1", "adcCfg 0 1"))
    write_bin(tmp_path / "adc_data.bin", np.full((4, 6, 128, 2), 5000, dtype=np.int16))
    with pytest.raises(
        InputFileError, match=r"5000.*numbers of 12 bits.*; correct the bits in the description \(adcCfg\)"
    ):
        ss.read_capture(tmp_path, "dca1000")[0]


def test_a_falling_ramp_and_bytes_that_are_left_over(tmp_path) -> None:
    (tmp_path / "a.cfg").write_text(cfg_text((0,), 2, slope_mhz_us=-30.0))
    write_bin(tmp_path / "adc_data.bin", FRAMES[0][:, :2])
    with (tmp_path / "adc_data.bin").open("ab") as file:
        file.write(b"12345")
    capture = ss.read_capture(tmp_path, "dca1000")
    assert capture.radar.waveform.direction == "down" and len(capture) == 1
    assert any("5 bytes" in note for note in capture.notes)


def test_a_frame_alone_is_in_memory(tmp_path) -> None:
    """4 GB that are mostly a hole: reading the last frame takes what a frame takes."""
    (tmp_path / "a.cfg").write_text(cfg_text(SENDERS, LOOPS))
    size = FRAMES[0].nbytes
    with (tmp_path / "adc_data.bin").open("wb") as file:
        file.truncate(4_000_000_000 // size * size)
    tracemalloc.start()
    last = ss.read_capture(tmp_path, "dca1000")[-1]
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert not last.adc_int.any()
    assert peak < 10 * size  # bytes, their numbers, their order, and Python's own


@pytest.mark.parametrize("sampling", ["complex", "real"])
def test_what_the_exporter_writes_comes_back_with_its_levels(tmp_path, sampling) -> None:
    spec = RADAR.with_(sampling=sampling, num_chirps=4, full_scale_dbm=-40.0)
    rig = Rig("one", (SensorMount("front/radar", "radar", spec, ss.Pose()),))
    codes, scale, _ = ss.quantize(
        ss.synthesize(ss.point_targets([[9.0, 1, 0]], [[0.0] * 3], [1.0], spec, ss.Pose()), spec), spec
    )
    frames = [
        Frame(k, k * 10**8, 0, ss.Pose(), ss.Twist(), {"front/radar": RadarFrame(spec, ss.Pose(), codes, scale)}, ())
        for k in range(2)
    ]
    export_dca1000(FrameSource(rig.to_dict(), [SceneFrames("drive", frames)]), tmp_path / "out")
    capture = ss.read_capture(tmp_path / "out" / "drive" / "front_radar", "dca1000")
    assert capture.radar == spec and capture.timestamp_ns.tolist() == [0, 10**8] and not capture.notes
    np.testing.assert_array_equal(capture[1].adc_int, codes)
    assert capture[1].adc_scale == scale
    about = tmp_path / "out" / "drive" / "front_radar" / "adc_data.json"
    text = about.read_text()
    for old, new, message in (
        ('"kind": "fmcw"', '"kind": "fm"', "describes no radar"),
        ('"timestamp_ns": [\n  0,', '"timestamp_ns": [\n', "1 times"),
        ('"num_frames": 2', '"num_frames": 9', "num_frames"),
    ):
        assert old in text
        about.write_text(text.replace(old, new))
        with pytest.raises(InputFileError, match=message):
            ss.read_capture(about.parent, "dca1000")


CHANGES = [
    ("profileCfg 0 77", "profileCfg 1 77", "no profile 0"),
    ("frameCfg 0 2", "frameCfg 0 600", "chirps 0 to 600"),
    ("frameCfg 0 2 32", "frameCfg 0 2 99999999", "at most"),
    ("frameCfg 0 2 32", "frameCfg 0 2 0", "describes no radar"),
    ("frameCfg 0 2 32 0 50 1 0", "frameCfg 0 2 32 0", "frameCfg has 5 numbers"),
    ("channelCfg 15", "channelCfg 0", "receivers 0"),
    ("channelCfg 15", "channelCfg nan", "numbers or more"),
    ("chirpCfg 0 0 0 0 0 0 0 1", "chirpCfg 0 0 0 0 0 0 0 3", "2 transmitters at once"),
    ("chirpCfg 0 0 0 0", "chirpCfg 0 0 0 9", "varies the profile"),
    ("chirpCfg 1 1", "chirpCfg 9 9", "no chirpCfg for chirp 1"),
    ("adcCfg 2 1", "", "no adcCfg"),
    ("adcCfg 2 1", "adcCfg 2 3", "of form 3"),
    ("adcCfg 2 1", "adcCfg 5 1", "of bits 5"),
    ("dfeDataOutputMode 1", "dfeDataOutputMode 3", "dfeDataOutputMode 3"),
    ("lvdsStreamCfg -1 0 1 0", "lvdsStreamCfg -1 1 4 0", "enableHeader 1"),
    (" 30 1 128 4000 ", " 30 1 999999999 4000 ", "describes no radar"),
    ("Platform:xWR18xx", "Platform:", "antennas"),
]


def test_of_commands_that_stand_twice_the_last_one_counts(tmp_path) -> None:
    """As the device takes them in turn: the first chirpCfg of a chirp counted, and what was before flushCfg as well."""
    text = cfg_text(SENDERS, LOOPS)
    (tmp_path / "a.cfg").write_text(text)
    assert read_cfg(tmp_path / "a.cfg").transmitters == SENDERS
    twice = text.replace("frameCfg 0 2", "chirpCfg 1 2 0 0 0 0 0 1\nframeCfg 0 2 8 0 50 1 0\nframeCfg 0 2", 1)
    (tmp_path / "a.cfg").write_text(twice)
    assert read_cfg(tmp_path / "a.cfg").transmitters == (SENDERS[0], 0, 0)
    assert read_cfg(tmp_path / "a.cfg").num_loops == LOOPS
    for whole in (twice + text, text + twice.replace("lvdsStreamCfg -1 0 1 0", "") + "sensorStop\nflushCfg\n" + text):
        (tmp_path / "a.cfg").write_text(whole)
        assert read_cfg(tmp_path / "a.cfg").transmitters == SENDERS
    (tmp_path / "a.cfg").write_text(text + "flushCfg\nchirpCfg 0 0 0 0 0 0 0 1\n")
    with pytest.raises(InputFileError, match="has no channelCfg"):
        read_cfg(tmp_path / "a.cfg")


@pytest.mark.parametrize(("old", "new", "message"), CHANGES)
def test_what_is_wrong_in_the_commands_is_told(tmp_path, old, new, message) -> None:
    text = cfg_text(SENDERS, LOOPS)
    assert old in text
    (tmp_path / "a.cfg").write_text(text.replace(old, new))
    write_bin(tmp_path / "adc_data.bin", FRAMES[0])
    with pytest.raises(InputFileError, match=message):
        ss.read_capture(tmp_path, "dca1000")


def test_what_is_wrong_in_the_json_is_told(tmp_path) -> None:
    good = studio(SENDERS, LOOPS)
    write_bin(tmp_path / "adc_data.bin", FRAMES[0])
    path = tmp_path / "a.mmwave.json"
    for change, message in (
        (lambda d: d.pop("mmWaveDevices"), "mmWaveDevices"),
        (lambda d: d["mmWaveDevices"][0]["rfConfig"].pop("rlFrameCfg_t"), "rlFrameCfg_t"),
        (lambda d: d["mmWaveDevices"][0]["rfConfig"]["rlProfiles"].clear(), "rlProfiles"),
        (lambda d: d["mmWaveDevices"][0]["rfConfig"]["rlFrameCfg_t"].update(numLoops=1e300), "numLoops"),
        (lambda d: d["mmWaveDevices"][0]["rfConfig"]["rlChanCfg_t"].update(rxChannelEn="0x0"), "no receiver"),
        (lambda d: d["mmWaveDevices"][0]["rawDataCaptureConfig"]["rlDevLaneEnable_t"].update(laneEn="0x1"), "1 lanes"),
        (
            lambda d: d["mmWaveDevices"][0]["rawDataCaptureConfig"]["rlDevDataPathCfg_t"].update(transferFmtPkt0=9),
            "0x9",
        ),
    ):
        data = json.loads(json.dumps(good))
        change(data)
        path.write_text(json.dumps(data))
        with pytest.raises(InputFileError, match=message):
            ss.read_capture(tmp_path, "dca1000", board="awr1843boost")
    for text in ("", "[" * 100_000, "{}", "\xff"):
        path.write_text(text, encoding="latin-1")
        with pytest.raises(InputFileError):
            ss.read_capture(tmp_path, "dca1000", board="awr1843boost")


def test_names_files_and_antennas_that_are_not_there(tmp_path) -> None:
    with pytest.raises(UnknownNameError, match="dca1000"):
        ss.read_capture(tmp_path, "dca100")
    with pytest.raises(InputFileError, match="no single description"):
        ss.read_capture(tmp_path, "dca1000")
    (tmp_path / "a.cfg").write_text(cfg_text(SENDERS, LOOPS))
    with pytest.raises(InputFileError, match=r"0 \.bin files"):
        ss.read_capture(tmp_path, "dca1000")
    (tmp_path / "adc_data.bin").write_bytes(bytes(100))
    with pytest.raises(InputFileError, match="one frame has"):
        ss.read_capture(tmp_path, "dca1000")
    write_bin(tmp_path / "adc_data.bin", FRAMES[0])
    with pytest.raises(UnknownNameError, match="awr1642boost"):
        ss.read_capture(tmp_path, "dca1000", board="awr1443")
    with pytest.raises(ParameterRangeError, match="transmitter 3 is on"):
        ss.read_capture(tmp_path, "dca1000", board="awr1642boost")
    capture = ss.read_capture(tmp_path, "dca1000")
    (tmp_path / "adc_data.bin").write_bytes(bytes(100))
    with pytest.raises(InputFileError, match="shorter"):
        capture[0]
