"""Radars of every waveform through rig file, command line, dataset, readers and captures."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.dataset import open_dataset
from scarl_sionna.dataset.formats.dca1000 import export_dca1000
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from tests.exports import FEW_RAYS, PLACE, run, scene_file

RADARS = {
    "ramps": ss.Fmcw(num_chirps=8, num_samples=64, direction="down", adc_start_time=2e-6, chirp_jitter=3e-6),
    "bursts": ss.SteppedFmcw(num_chirps=8, num_samples=32, num_steps=2),
    "coded": ss.PcFmcw(num_chirps=8, num_samples=64),
    "ofdm": ss.Ofdm(num_chirps=8, num_subcarriers=64, comb=2),
    "pmcw": ss.Pmcw(num_chirps=8, code_length=63),
    "divided": ss.Ofdm(num_chirps=8, num_subcarriers=96),
}
HOW = {"divided": ss.Fdm(interleaving=4)}


def test_every_waveform_goes_through_the_command_line_and_comes_back(tmp_path) -> None:
    radars = {name: ss.RadarSpec(waveform=wave, multiplexing=HOW.get(name, "ideal")) for name, wave in RADARS.items()}
    mounts = (SensorMount(name, "radar", radars[name], PLACE, FEW_RAYS) for name in RADARS)
    Rig("many", tuple(mounts)).save(tmp_path / "rig.yaml")
    scenario = ScenarioSpec(
        scene=str(scene_file(tmp_path)), rig=str(tmp_path / "rig.yaml"), num_frames=1, frame_rate=50.0, name="one"
    )
    scenario.save(tmp_path / "one.yaml")
    report = run(tmp_path / "one.yaml", "--out", tmp_path / "data")
    assert report.returncode == 0, report.stderr
    frame = open_dataset(tmp_path / "data")[0]
    for name in RADARS:
        radar = frame.radar[name].to_result()
        assert radar.spec == radars[name]
        rd = ss.range_doppler(radar)
        assert rd.power.shape == (radar.spec.num_doppler_bins, radar.spec.num_range_bins) == radar.cell_instance.shape
        assert np.isfinite(rd.power).all() and radar.cell_power.max() > 0.0
    with pytest.raises(ParameterRangeError, match="radar 'ofdm' = a waveform of kind 'ofdm'"):
        export_dca1000(tmp_path / "data", tmp_path / "captures", radars=["ofdm"])
