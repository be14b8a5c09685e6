"""mmWave Studio's log as the description of a capture, and frames of one chirp as one burst."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import InputFileError, ParameterRangeError
from tests.ti_captures import log_text, write_bin

ORIGINAL = os.environ.get("SCARL_TEST_CAPTURE", "")
"""Folder with a recording of an AWR1642 and its log, of the public project OnurhanTALAN/mmwave-signal-processing."""


def written(folder: Path, senders: tuple[int, ...], loops: int, frames: int = 2, **log: object) -> np.ndarray:
    """Write random frames and their log; return them, shape (num_frames, num_rx, num_chirps, num_samples, 2)."""
    shape = (frames, 4, len(senders) * loops, 128, 2)
    adc = np.random.default_rng(5).integers(-(2**15), 2**15, shape).astype(np.int16)
    (folder / "adc_data_LogFile.txt").write_text(log_text(senders, loops, frames, **log))
    for one in adc:
        write_bin(folder / "adc_data.bin", one)
    return adc


def test_the_setup_of_the_last_start_is_read(tmp_path) -> None:
    adc = written(tmp_path, (0, 2), 4)
    capture = ss.read_capture(tmp_path)
    wave = capture.radar.waveform
    assert wave.start_frequency == pytest.approx(77e9, abs=60.0)
    assert wave.chirp_slope == pytest.approx(30e12, abs=25e9)
    assert (wave.idle_time, wave.adc_start_time, wave.ramp_time) == pytest.approx((7e-6, 5e-6, 40e-6))
    assert (wave.num_samples, wave.sampling_frequency, wave.num_chirps) == (128, 4e6, 4)
    assert capture.radar.num_tx == 2 and capture.timestamp_ns.tolist() == [0, 50_000_000]
    board = ss.RadarSpec.preset("awr1843boost_3d").array
    assert capture.radar.array.tx_positions == (board.tx_positions[0], board.tx_positions[2])
    np.testing.assert_array_equal([frame.adc_int for frame in capture], adc)


def test_steps_of_a_60_ghz_chip(tmp_path) -> None:
    """Its synthesiser has another reference: the same numbers would be 102 GHz."""
    written(tmp_path, (0,), 2, chip="AR6843")
    radar = ss.read_capture(tmp_path, "dca1000", board="awr1843boost").radar
    assert radar.waveform.start_frequency == pytest.approx(77e9, abs=60.0)
    assert radar.waveform.chirp_slope == pytest.approx(30e12, abs=20e9)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("API:FrameConfig", "API:Other", "FrameConfig"),
        ("API:DataPathConfig,1,1", "API:DataPathConfig,1,9", "samples alone"),
        ("API:LaneConfig,3", "API:LaneConfig,1", "lanes"),
        ("API:ChannelConfig,7,15", "API:ChannelConfig,7,0", "receiver"),
        ("API:AdcOutConfig,2,1", "API:AdcOutConfig,2,3", "samples of form"),
        ("API:ChirpConfig,0,0,0,0", "API:ChirpConfig,0,0,0,5", "varies"),
        ("API:ChirpConfig,0,0,0", "API:ChirpConfig,0,0,1", "profile"),
        ("API:FrameConfig,0,0,2,2", "API:FrameConfig,0,600,2,2", "chirps 0 to 600"),
        ("API:ProfileConfig,0,", "API:ProfileConfig,x,", "whole numbers"),
        (",128,4000,", ",128,-4000,", "describes no radar"),
    ],
)
def test_what_is_not_read_is_said(tmp_path, old, new, told) -> None:
    written(tmp_path, (0,), 2)
    file = tmp_path / "adc_data_LogFile.txt"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    with pytest.raises(InputFileError, match=told):
        ss.read_capture(tmp_path, "dca1000")


def test_frames_of_one_chirp_are_a_burst(tmp_path) -> None:
    adc = written(tmp_path, (0,), 1, frames=6, period_ms=1.0)
    burst = ss.read_capture(tmp_path, "dca1000").burst(1, 5)
    np.testing.assert_array_equal(burst[0].adc_int, np.concatenate(adc[1:5], axis=1))
    assert burst.radar.num_chirps == 4 and burst.radar.waveform.chirp_interval == pytest.approx(1e-3)
    assert burst.timestamp_ns.tolist() == [1_000_000] and len(burst) == 1
    rd = ss.range_doppler(burst[0])
    assert np.diff(rd.radial_velocity)[0] == pytest.approx(burst.radar.wavelength / (2 * 4 * 1e-3), rel=0.01)
    with pytest.raises(ParameterRangeError, match="two or more of 6"):
        ss.read_capture(tmp_path, "dca1000").burst(5)


def test_frames_of_several_chirps_are_no_burst(tmp_path) -> None:
    written(tmp_path, (0,), 2)
    with pytest.raises(ParameterRangeError, match="one chirp a frame"):
        ss.read_capture(tmp_path, "dca1000").burst()


@pytest.mark.skipif(not ORIGINAL, reason="SCARL_TEST_CAPTURE names no recording")
def test_an_original_recording() -> None:
    """Something stands 2 m away in front of an AWR1642: the strongest cell, at rest, and its channels agree."""
    folder = Path(ORIGINAL)
    capture = ss.read_capture(folder / "adc_data_0.bin", "dca1000", config=folder / "LogFile_0.txt")
    assert len(capture) == 1000 and capture.radar.num_rx == 4
    rd = ss.range_doppler(capture.burst()[0], window="hann")
    power = (np.abs(rd.data) ** 2).mean(axis=0)
    velocity, distance = np.unravel_index(power[:, 5:60].argmax(), (len(rd.radial_velocity), 55))
    assert rd.range[distance + 5] == pytest.approx(2.1, abs=0.2)
    assert abs(rd.radial_velocity[velocity]) < 2.0 * np.diff(rd.radial_velocity)[0]
