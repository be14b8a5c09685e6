"""Raw data of ColoRadar, RaDelft and RADIal from writers of their documents: planted points are where they are."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import InputFileError, ParameterRangeError, UnknownNameError
from tests.dataset_captures import (
    COLORADAR,
    RADELFT,
    Point,
    beat,
    codes,
    coloradar_places,
    radelft_places,
    radial_point,
    write_coloradar,
    write_coloradar_phases,
    write_radelft,
    write_radial,
)

NEAR, FAR = Point(4.3, -0.7, 24.0, 6.0), Point(9.1, 0.9, -15.0, -4.0)
TURN = list(range(11, -1, -1))


def assert_planted(capture: ss.Capture, frame: int, wanted: Point) -> None:
    """Assert that the strongest point is the planted one."""
    radar = capture.radar
    points = ss.detect(ss.range_doppler_angle(capture.cube(frame), radar))
    assert abs(points.range[0] - wanted.range) < 0.2 * radar.range_resolution
    assert abs(points.radial_velocity[0] - wanted.velocity) < 0.2 * radar.velocity_resolution
    assert abs(np.degrees(points.azimuth[0]) - wanted.azimuth) < 1.0
    assert abs(np.degrees(points.elevation[0]) - wanted.elevation) < 3.0


def assert_peak(capture: ss.Capture, frame: int, wanted: Point) -> float:
    """Assert that the strongest cell of the map is the planted point's, and return its power."""
    rda = ss.range_doppler_angle(capture.cube(frame), capture.radar)
    row, column, azimuth, elevation = np.unravel_index(int(rda.data.argmax()), rda.data.shape)
    for axis, index, value in (
        (rda.range, column, wanted.range),
        (rda.radial_velocity, row, wanted.velocity),
        (np.sin(rda.azimuth), azimuth, np.sin(np.radians(wanted.azimuth))),
        (np.sin(rda.elevation), elevation, np.sin(np.radians(wanted.elevation))),
    ):
        assert abs(axis[index] - value) < 0.6 * (axis[1] - axis[0])
    return float(rda.data.max())


def coloradar_frames(
    device: str, factor: np.ndarray | float = 1.0, points: tuple[Point, ...] = (NEAR, FAR)
) -> list[np.ndarray]:
    tx, rx = coloradar_places(device)
    signals = [beat(point, COLORADAR, tx, rx, list(range(len(tx)))) for point in points]
    return [codes(signal * factor, seed) for seed, signal in enumerate(signals)]


def test_coloradar_single_chip(tmp_path) -> None:
    frames = coloradar_frames("single_chip")
    run = write_coloradar(tmp_path, "single_chip", frames)
    capture = ss.read_capture(run)  # its format, device and calibration are found
    assert capture.format == "coloradar" and len(capture) == 2
    assert capture.timestamp_ns.tolist() == [1614000000_000000000, 1614000000_100000000]
    np.testing.assert_array_equal(capture[1].adc_int[2, 5 * 3 + 1], frames[1][1, 2, 5])  # rx 2, chirp 5 of tx 1
    assert capture.radar.waveform.num_chirps == 16 and capture.radar.array.num_virtual == 12
    assert_planted(capture, 0, NEAR)
    assert_planted(capture, 1, FAR)
    assert ss.range_doppler(capture[0]).plot().collections


def test_coloradar_cascade_with_its_calibration(tmp_path) -> None:
    """Tones and phases of the pairs are off; with the dataset's table a point is at its place, without it is not."""
    rng = np.random.default_rng(5)
    bins, amplitudes = rng.integers(0, 5, (12, 16)) / 5.0, rng.normal(size=(12, 16, 2)) @ np.array([1.0, 1j]) + 3.0
    samples = np.arange(COLORADAR.samples) / COLORADAR.samples
    off = (bins - bins[0, 0]) * 4.0  # half the slope and twice the rate when it was measured
    factor = np.exp(2j * np.pi * off[..., None] * samples) * (amplitudes / amplitudes[0, 0])[..., None]
    run = write_coloradar(tmp_path, "cascade", coloradar_frames("cascade", factor[:, :, None] / 3.0, (NEAR,)))
    spread = ss.range_doppler_angle(ss.read_capture(run)[0]).data.max()
    write_coloradar_phases(tmp_path, bins, amplitudes)
    assert assert_peak(ss.read_capture(run, "coloradar", device="cascade"), 0, NEAR) > 10.0 * spread


def test_radelft_in_two_recordings(tmp_path) -> None:
    tx, rx = radelft_places()
    turns = [TURN.index(k) for k in range(12)]
    frames = [codes(beat(point, RADELFT, tx, rx, turns), seed, 1000.0) for seed, point in enumerate((NEAR, FAR))]
    write_radelft(tmp_path, frames[:1], TURN, 0)
    write_radelft(tmp_path, frames[1:], TURN, 1)
    capture = ss.read_capture(tmp_path)
    assert capture.format == "radelft" and len(capture) == 2 and "without a gap" in capture.notes[-1]
    np.testing.assert_array_equal(capture[1].adc_int[6, 3 * 12 + 2], frames[1][9, 6, 3])  # third turn: transmitter 9
    assert_peak(capture, 0, NEAR)
    assert_peak(capture, 1, FAR)


def test_radelft_with_the_calibration_of_its_repository(tmp_path) -> None:
    rng = np.random.default_rng(6)
    bins, peaks = rng.integers(160, 164, (12, 16)).astype(float), np.exp(2j * np.pi * rng.random((12, 16)))
    samples = np.arange(RADELFT.samples) / RADELFT.samples
    off = (bins - bins[TURN[0], 0]) / 5.0 * (2.0 * RADELFT.rate / RADELFT.rate) * (30.0 / 60.0)
    factor = (peaks / peaks[TURN[0], 0])[..., None] * np.exp(2j * np.pi * off[..., None] * samples)
    turns = [TURN.index(k) for k in range(12)]
    signal = beat(NEAR, RADELFT, *radelft_places(), turns) * factor[:, :, None]
    write_radelft(tmp_path, [codes(signal, 0, 1000.0)], TURN)
    table = tmp_path / "calibrateResults.mat"
    with h5py.File(table, "w") as file:  # MATLAB writes the transpose
        file["calibResult/RangeMat"] = bins.T
        pairs = np.empty((16, 12), dtype=[("real", "<f8"), ("imag", "<f8")])
        pairs["real"], pairs["imag"] = peaks.T.real, peaks.T.imag
        file["calibResult/PeakValMat"] = pairs
        file["params/Slope_MHzperus"] = np.array([[60.0]])
        file["params/Sampling_Rate_sps"] = np.array([[2.0 * RADELFT.rate]])
    spread = ss.range_doppler_angle(ss.read_capture(tmp_path)[0]).data.max()
    assert assert_peak(ss.read_capture(tmp_path, calibration=table), 0, NEAR) > 10.0 * spread
    for name, bad in (("calibResult/RangeMat", np.full((16, 12), np.nan)), ("params/Slope_MHzperus", np.zeros((2, 2)))):
        with h5py.File(table, "a") as file:
            kept = file[name][()]
            del file[name]
            file[name] = bad
        with pytest.raises(InputFileError, match=r"no numbers|shape"):
            ss.read_capture(tmp_path, calibration=table)
        with h5py.File(table, "a") as file:
            del file[name]
            file[name] = kept
    table.write_bytes(table.read_bytes()[:500])
    with pytest.raises(InputFileError, match="no calibration of the cascade board"):
        ss.read_capture(tmp_path, calibration=table)


def test_radial(tmp_path) -> None:
    """Order of the chips' files and of the Doppler bands: each pair has its own phase, and comes out with it."""
    phases = np.random.default_rng(7).uniform(-np.pi, np.pi, (12, 16))
    frame = codes(radial_point(100.0, -37.0, phases), 0, 500.0)
    place = write_radial(tmp_path, [frame, frame, frame[::-1]], lost=(1, "radar_ch2"))
    capture = ss.read_capture(place)
    assert capture.format == "radial" and len(capture) == 2 and any("1 frames" in note for note in capture.notes)
    assert capture.timestamp_ns.tolist() == [
        6_820_000_000,
        7_220_000_000,
    ]  # issued at 7 s, less what DBReader takes off
    np.testing.assert_array_equal(capture[0].adc_int, frame)
    np.testing.assert_array_equal(capture[1].adc_int, frame[::-1])
    kept = [1, 9]  # a receiver of the first file, one of the third
    whole = capture.radar
    radar = whole.with_(array=whole.array.with_(rx_positions=tuple(whole.array.rx_positions[k] for k in kept)))
    rd = ss.range_doppler(ss.virtual_cube(capture[0].adc[kept], radar), radar, compensate_motion=False)
    row, column = np.unravel_index(rd.power.argmax(), rd.power.shape)
    assert rd.range[column] == pytest.approx(100.0 / 512.0 * 103.0, abs=0.01)
    assert rd.radial_velocity[row] == pytest.approx(-37.0 * 0.1, rel=0.05)  # 0.1 m/s is rounded in the paper
    found = rd.data[:, row, column].reshape(12, 2) * np.exp(-1j * phases[:, kept])
    np.testing.assert_allclose(np.angle(found / found[0, 0]), 0.0, atol=0.03)
    with pytest.raises(ParameterRangeError, match="12 different bands of 0 to 15"):
        whole.with_(multiplexing=whole.multiplexing.with_(bands=(0, *range(4, 15))).with_(bands=(0, *range(6, 17))))
    array = ss.AntennaArray(tx_positions=((0.0, 0.0, 0.0),) * 11, rx_positions=((0.0, 0.0, 0.0),) * 16)
    with pytest.raises(ParameterRangeError):
        ss.read_capture(place, array=array)


def test_names_that_do_not_tell_the_format(tmp_path) -> None:
    with pytest.raises(InputFileError, match="no names that tell its format"):
        ss.read_capture(tmp_path)
    (tmp_path / "x_events_log.rec").write_text("")
    (tmp_path / "a.cfg").write_text("")
    with pytest.raises(InputFileError, match="dca1000 and radial"):
        ss.read_capture(tmp_path)


def test_what_is_wrong_in_coloradar_is_told(tmp_path) -> None:
    run = write_coloradar(tmp_path, "single_chip", coloradar_frames("single_chip")[:1])
    with pytest.raises(UnknownNameError, match="single_chip"):
        ss.read_capture(run, device="double")
    calib = tmp_path / "calib" / "single_chip"
    data = run / "single_chip" / "adc_samples"
    for file, old, new, message in (
        (calib / "waveform_cfg.txt", "num_tx 3", "num_tx 999999999", "counts of 1 to 64"),
        (calib / "waveform_cfg.txt", "num_chirps_per_frame 16", "num_chirps_per_frame 99999999", "counts of 1 to"),
        (calib / "waveform_cfg.txt", "chirp 64", "chirp 999999", "describes no radar"),
        (calib / "waveform_cfg.txt", "num_chirps_per_frame 16", "num_chirps_per_frame 17", "one frame has"),
        (calib / "waveform_cfg.txt", "frequency_slope", "slope", "has no frequency_slope"),
        (calib / "waveform_cfg.txt", "idle_time 0", "idle_time nan", "'nan"),
        (calib / "antenna_cfg.txt", "F_design 76.8", "F_design 0", "no frequency"),
        (calib / "antenna_cfg.txt", "tx 2 4 0", "tx 1 4 0", "2 tx antennas"),
        (calib / "antenna_cfg.txt", "tx 2 4 0", "tx 2 4", "read is: tx number"),
        (calib / "antenna_cfg.txt", "tx 2 4 0", "tx 2 9999 0", "no antennas"),
        (data / "timestamps.txt", "1614000000.", "inf", "'inf"),
        (data / "timestamps.txt", "1614000000.000000000\n", "", "0 times"),
    ):
        text = file.read_text()
        assert old in text
        file.write_text(text.replace(old, new))
        with pytest.raises(InputFileError, match=message):
            ss.read_capture(run).cube(0)
        file.write_text(text)
    (data / "data" / "frame_0.bin").write_bytes(bytes(100))
    with pytest.raises(InputFileError, match="100 bytes"):
        ss.read_capture(run)[0]
    (data / "data" / "frame_0.bin").unlink()
    with pytest.raises(InputFileError, match="no file frame_"):
        ss.read_capture(run)
    (tmp_path / "calib").rename(tmp_path / "elsewhere")
    with pytest.raises(InputFileError, match="no folder calib"):
        ss.read_capture(run)
    cascade = write_coloradar(tmp_path / "two", "cascade", [])
    write_coloradar_phases(tmp_path / "two", np.zeros((12, 15)), np.ones((12, 16)))
    (cascade / "cascade/adc_samples/data/frame_0.bin").touch()
    (cascade / "cascade/adc_samples/timestamps.txt").write_text("0\n")
    with pytest.raises(InputFileError, match="180 frequencies"):
        ss.read_capture(cascade)


def test_what_is_wrong_in_radelft_is_told(tmp_path) -> None:
    frame = np.zeros((12, 16, RADELFT.loops, RADELFT.samples, 2), dtype=np.int16)
    write_radelft(tmp_path, [frame], TURN)
    path = tmp_path / "radar.mmwave.json"
    good = path.read_text()
    for change, message in (
        (lambda d: d["mmWaveDevices"].pop(), "3 chips"),
        (lambda d: d["mmWaveDevices"][1].update(mmWaveDeviceId=7), "4 chips"),
        (lambda d: d["mmWaveDevices"][2]["rfConfig"]["rlFrameCfg_t"].update(chirpEndIdx=5), "numbers of chirps"),
        (lambda d: d["mmWaveDevices"][2]["rfConfig"]["rlFrameCfg_t"].update(numLoops=5), "sample alike"),
        (
            lambda d: d["mmWaveDevices"][0]["rfConfig"]["rlChanCfg_t"].update(rxChannelEn="0x7"),
            "receivers that are off",
        ),
        (lambda d: d["mmWaveDevices"][0]["rfConfig"]["rlChirps"][0]["rlChirpCfg_t"].update(txEnable="0x7"), "4 trans"),
    ):
        data = json.loads(good)
        change(data)
        path.write_text(json.dumps(data))
        with pytest.raises(InputFileError, match=message):
            ss.read_capture(tmp_path)
    path.write_text(good)
    index = tmp_path / "master_0000_idx.bin"
    index.write_bytes(b"\xff" * 24)
    with pytest.raises(InputFileError, match="tells of 4294967295 frames"):
        ss.read_capture(tmp_path)
    index.unlink()
    (tmp_path / "slave2_0000_data.bin").write_bytes(bytes(10))
    with pytest.raises(InputFileError, match="frames of the four chips"):
        ss.read_capture(tmp_path)
    (tmp_path / "slave2_0000_data.bin").unlink()
    with pytest.raises(InputFileError, match="slave2"):
        ss.read_capture(tmp_path)


def test_what_is_wrong_in_radial_is_told(tmp_path) -> None:
    place = write_radial(tmp_path, [np.zeros((16, 256, 512, 2), dtype=np.int16)])
    log = next(place.glob("*.rec"))
    good = log.read_text()
    for old, new, message in (
        ("datasize: 2097152", "datasize: 2097150", "frame of 2097150 bytes"),
        ("data_sample: 0 - sensor: radar", "data_sample: x - sensor: radar", "no numbers"),
        ("offset: 0", "offset: -4", "none of a frame"),
        ("radar_ch1", "radar_ch9", "no frame of all four"),
    ):
        assert old in good
        log.write_text(good.replace(old, new))
        with pytest.raises(InputFileError, match=message):
            ss.read_capture(place)
    log.write_text(good.replace("offset: 0", "offset: 8"))
    with pytest.raises(InputFileError, match="ends 8 bytes before"):
        ss.read_capture(place)[0]
    log.unlink()
    with pytest.raises(InputFileError, match=r"no names|0 files"):
        ss.read_capture(place)
