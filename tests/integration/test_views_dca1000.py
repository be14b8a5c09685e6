"""DCA1000 captures: openradar organizes them and finds the planted points in our bins.

Pyroomacoustics finds their angles.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from mmwave import dsp
from mmwave.dataloader import DCA1000

import scarl_sionna as ss
from scarl_sionna.core.errors import DatasetError, OutputError, ParameterRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.results import Frame, RadarFrame
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.dataset.formats.dca1000 import decode_dca1000, encode_dca1000, export_dca1000, read_dca1000
from scarl_sionna.dataset.formats.source import FrameSource, SceneFrames
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.signal.antenna import virtual_positions
from tests.drive import drive

BOARD = ss.RadarSpec.preset("awr1843boost").with_(num_chirps=64, num_samples=256)
TDM = BOARD.with_(multiplexing="tdm")
# range [m], radial velocity [m/s], azimuth [deg]; far apart in range, so that every one is the peak of its bin
POINTS = ((14.3, -6.1, 20.0), (33.2, 0.0, -31.0), (60.9, 9.4, 4.0))


def planted(spec: ss.RadarSpec, points=POINTS, index: int = 0) -> Frame:
    """Return a frame of one radar with points at places in its frame, and receiver noise."""
    distance, speed, azimuth = np.array(points).T
    ray = np.stack([np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth)), 0 * azimuth], axis=1)
    rcs = 1e-4 * distance**4 / np.cos(np.radians(azimuth)) ** 8  # about equal power
    paths = ss.point_targets(ray * distance[:, None], ray * speed[:, None], rcs, spec, Pose())
    codes, scale, _ = ss.quantize(ss.synthesize(paths, spec, rng=np.random.default_rng(index)), spec)
    radar = RadarFrame(spec, Pose(), codes, scale)
    return Frame(index, index * 10**8, 0, Pose(), Twist(), {"front/radar": radar}, ())


def source_of(spec: ss.RadarSpec, num_frames: int = 2) -> FrameSource:
    rig = Rig("one", (SensorMount("front/radar", "radar", spec, Pose()),))
    return FrameSource(rig.to_dict(), [SceneFrames("planted", [planted(spec, index=k) for k in range(num_frames)])])


def our_peaks(radar: RadarFrame) -> list[tuple[int, int]]:
    """Return (Doppler bin, range bin) of the planted points in our maps, by the plain, unshifted transform."""
    spec = radar.spec
    rd = ss.range_doppler(ss.virtual_cube(radar.adc, spec), spec, window="rect", compensate_motion=False)
    out = []
    for distance, _, _ in POINTS:
        near = slice(int(distance / spec.range_resolution) - 3, int(distance / spec.range_resolution) + 5)
        row, column = np.unravel_index(rd.power[:, near].argmax(), rd.power[:, near].shape)
        out.append(((int(row) - spec.num_chirps // 2) % spec.num_chirps, int(column) + near.start))
    return out


def openradar_peaks(chirps: np.ndarray, spec: ss.RadarSpec) -> list[tuple[int, int]]:
    """Return the same bins by openradar, from (num_chirps_total, num_rx, num_samples)."""
    cube = dsp.range_processing(chirps)
    _, spectrum = dsp.doppler_processing(cube, num_tx_antennas=spec.num_tx, interleaved=True, accumulate=False)
    power = (np.abs(spectrum) ** 2).sum(axis=1)  # (range, Doppler)
    out = []
    for distance, _, _ in POINTS:
        start = int(distance / spec.range_resolution) - 3
        row, column = np.unravel_index(power[start : start + 8].argmax(), power[start : start + 8].shape)
        out.append((int(column), int(row) + start))
    return out


@pytest.mark.parametrize("spec", [BOARD, TDM], ids=["ideal", "tdm"])
def test_openradar_finds_the_points_in_our_bins_from_the_file(tmp_path, spec) -> None:
    source = source_of(spec)
    export_dca1000(source, tmp_path / "out")
    folder = tmp_path / "out" / "planted" / "front_radar"
    about = json.loads((folder / "adc_data.json").read_text())
    raw = np.fromfile(folder / "adc_data.bin", np.int16).reshape(about["num_frames"], -1)
    assert raw.nbytes == about["num_frames"] * about["bytes_per_frame"]
    for frame, row in zip(source.scenes[0], raw, strict=True):
        radar = frame.radars["front/radar"]
        chirps = DCA1000.organize(row, spec.num_chirps_total, spec.num_rx, spec.num_samples)
        np.testing.assert_allclose(chirps * about["scale"], radar.adc.transpose(1, 0, 2), rtol=1e-6, atol=1e-12)
        found = openradar_peaks(chirps, spec)
        assert found == our_peaks(radar)
        for (doppler, column), (distance, speed, _) in zip(found, POINTS, strict=True):
            # the plain transform: half a bin, and range-Doppler coupling below 0.2 bins at 9 m/s
            assert abs(column * about["range_resolution"] - distance) < 0.8 * about["range_resolution"]
            signed = (doppler + spec.num_chirps // 2) % spec.num_chirps - spec.num_chirps // 2
            interval = 2 * spec.unambiguous_velocity
            off = (signed * about["velocity_resolution"] - speed + interval / 2) % interval - interval / 2
            assert abs(off) < 0.6 * about["velocity_resolution"]


def test_openradar_finds_the_points_in_our_bins_from_the_arrays() -> None:
    radar = planted(BOARD).radars["front/radar"]
    assert openradar_peaks(radar.adc.transpose(1, 0, 2), BOARD) == our_peaks(radar)


def test_pyroomacoustics_music_finds_the_angles() -> None:
    """Two points at one range, told apart by MUSIC over the chirps of that range bin; a third one alone."""
    pra = pytest.importorskip("pyroomacoustics")
    points = ((30.0, -5.0, 12.0), (30.0, 7.0, -25.0), (55.0, 2.0, 40.0))
    radar = planted(BOARD, points).radars["front/radar"]
    cube = ss.virtual_cube(radar.adc, BOARD)
    profile = np.fft.fft(cube * np.hanning(BOARD.num_samples), axis=2)
    position = virtual_positions(BOARD)
    grid = np.radians(np.arange(-60.0, 60.01, 0.25))
    for distance, expected in ((30.0, (-25.0, 12.0)), (55.0, (40.0,))):
        # pyroomacoustics knows waves of sound: the array's length is in metres, the bin 1 of 4 is the centre frequency.
        # Its delay is that of a wave received, ours of the beat signal: transmit times conj(receive)
        music = pra.doa.MUSIC(
            position[:, :2].T,
            fs=4 * BOARD.center_frequency,
            nfft=4,
            c=SPEED_OF_LIGHT,
            num_src=len(expected),
            azimuth=grid,
        )
        snapshots = np.conj(profile[:, :, round(distance / BOARD.range_resolution)])
        music.locate_sources(snapshots[:, None, :].repeat(3, axis=1), num_src=len(expected), freq_bins=[1])
        found = np.sort((np.degrees(music.azimuth_recon) + 180.0) % 360.0 - 180.0)
        # grid of 0.25 deg, spherical wavefront over 2 cm at 30 m below 0.01 deg; noise at 30 dB and more below 0.1 deg
        np.testing.assert_allclose(found, expected, atol=0.3)


def test_the_layout_is_that_of_the_two_lanes() -> None:
    adc = np.arange(2 * 3 * 4 * 2, dtype=np.int16).reshape(2, 3, 4, 2)
    raw = encode_dca1000(adc)
    first = adc[0, 0]  # receiver 0, chirp 0
    assert raw[:8].tolist() == [*first[:2, 0], *first[:2, 1], *first[2:, 0], *first[2:, 1]]
    assert raw[8:10].tolist() == adc[1, 0, :2, 0].tolist()  # then receiver 1
    assert raw[16:18].tolist() == adc[0, 1, :2, 0].tolist()  # then chirp 1
    np.testing.assert_array_equal(decode_dca1000(raw, 2, 3, 4), adc)
    with pytest.raises(ParameterRangeError, match="even"):
        encode_dca1000(adc[:, :, :3])
    with pytest.raises(ParameterRangeError):
        decode_dca1000(raw[:-1], 2, 3, 4)


@pytest.mark.parametrize("sampling", ["complex", "real"])
def test_every_frame_comes_back_and_a_cut_file_is_noticed(tmp_path, sampling) -> None:
    source = source_of(BOARD.with_(sampling=sampling), 3)
    calls: list[tuple[int, int]] = []
    export_dca1000(source, tmp_path / "out", on_progress=lambda *state: calls.append(state))
    assert calls == [(1, 3), (2, 3), (3, 3)]
    folder = tmp_path / "out" / "planted" / "front_radar"
    for index, frame in enumerate(source.scenes[0]):
        np.testing.assert_array_equal(read_dca1000(folder, index), frame.radars["front/radar"].adc_int)
    with pytest.raises(DatasetError, match="no frame 3"):
        read_dca1000(folder, 3)
    data = (folder / "adc_data.bin").read_bytes()
    per_sample = 2 if sampling == "real" else 4
    assert len(data) == 3 * BOARD.num_rx * BOARD.num_chirps_total * BOARD.num_samples * per_sample
    (folder / "adc_data.bin").write_bytes(data[:-2])
    with pytest.raises(DatasetError, match="ends within frame 2"):
        read_dca1000(folder, 2)
    with pytest.raises(DatasetError, match="no capture"):
        read_dca1000(tmp_path)


def test_radars_are_chosen_by_name(tmp_path) -> None:
    source = drive(num_frames=1)
    export_dca1000(source, tmp_path / "out", radars=["back_center/radar"])
    assert [path.name for path in (tmp_path / "out" / "street").iterdir()] == ["back_center_radar"]
    with pytest.raises(UnknownNameError, match="back_center/radar"):
        export_dca1000(source, tmp_path / "other", radars=["back/radar"])
    assert not (tmp_path / "other").exists()


def test_what_a_capture_cannot_hold_is_refused(tmp_path) -> None:
    source = source_of(BOARD, 2)
    first, second = source.scenes[0]
    louder = replace(second.radars["front/radar"], adc_scale=1.0)
    changed = FrameSource(source.rig, [SceneFrames("x", [first, replace(second, results={"front/radar": louder})])])
    with pytest.raises(ParameterRangeError, match="another scale"):
        export_dca1000(changed, tmp_path / "out")
    assert not list(tmp_path.iterdir())
    lidar = drive(num_frames=1)
    rig = {"name": "blind", "sensors": [m for m in lidar.rig["sensors"] if m["kind"] != "radar"]}
    with pytest.raises(ParameterRangeError, match="without a radar"):
        export_dca1000(FrameSource(rig, lidar.scenes), tmp_path / "out")
    export_dca1000(source, tmp_path / "out")
    with pytest.raises(OutputError, match="--overwrite"):
        export_dca1000(source, tmp_path / "out")
