"""Radars of version 0.1 in rig files: flat there, in parts today, the same radar."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

import scarl_sionna as ss
from scarl_sionna.calibration.spec import RadarMap
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.radar.pattern import Tr38901Pattern
from scarl_sionna.core.specs.radar.version_0_1 import lift_version_0_1, read_radar, split_version_0_1

FIXTURE = Path(__file__).parents[1] / "regression" / "schema" / "rig_0_1.yaml"
"""Written by `Rig.save` of version 0.1; `other` differs from the defaults in every field."""

OTHER = ss.RadarSpec(
    waveform=ss.Fmcw(
        start_frequency=76.5e9,
        bandwidth=1e9,
        ramp_time=25e-6,
        idle_time=3e-6,
        num_chirps=33,
        num_samples=64,
        sampling_frequency=20e6,
    ),
    multiplexing=ss.Tdm(),
    array=ss.AntennaArray(
        tx_positions=((0.0, -0.01, 0.0), (0.0, 0.01, 0.002)),
        rx_positions=((0.0, 0.0, 0.0),),
        pattern=Tr38901Pattern(peak_gain_dbi=7.0),
        polarization="H",
        max_array_extent=0.5,
    ),
    front_end=ss.FrontEnd(tx_power_dbm=9.0, noise_figure_db=15.0, source_temperature=250.0),
    adc=ss.Adc(bits=12, full_scale_dbm=-40.0),
    azimuth_fov_deg=90.0,
    elevation_fov_deg=20.0,
)


def _flat(name: str) -> dict:
    return next(item["spec"] for item in yaml.safe_load(FIXTURE.read_text())["sensors"] if item["name"] == name)


def test_a_rig_file_of_version_0_1_holds_the_same_radars(tmp_path) -> None:
    rig = ss.Rig.load(FIXTURE)
    assert rig["default"].spec == ss.RadarSpec()
    assert rig["other"].spec == OTHER
    assert rig["board"].spec == ss.RadarSpec.preset("awr1843boost_3d")
    # rays and labels are settings today; the budget of `auto` followed the rays
    assert rig["default"].settings == ss.RadarSettings()
    assert rig["other"].settings == ss.RadarSettings.of(num_rays=20_000, tube_budget=20_000, cell_labels=False)
    rig.save(tmp_path / "today.yaml")
    assert ss.Rig.load(tmp_path / "today.yaml").to_dict() == rig.to_dict()


def test_the_fixture_differs_from_the_defaults_in_every_field() -> None:
    default, other = _flat("default"), _flat("other")
    assert default.keys() == other.keys() and all(default[name] != other[name] for name in default)
    assert len(default) == 22


def test_what_is_no_property_of_a_radar_is_split_off() -> None:
    spec_data, left = split_version_0_1(_flat("other"))
    assert left == {"num_rays": 20_000, "cell_labels": False}
    assert ss.RadarSpec(**spec_data) == OTHER
    # what is in parts stays as it is
    assert split_version_0_1(spec_data) == (spec_data, {})
    assert split_version_0_1({}) == ({}, {})


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"bandwith": 1e9}, r"RadarSpec\.bandwith.*did you mean 'bandwidth'"),
        ({"bandwidth": -1.0}, r"RadarSpec\.waveform\.bandwidth = -1\.0"),
        (
            {"bandwidth": 1e9, "waveform": {"num_chirps": 3}},
            r"RadarSpec\.bandwidth = .*`waveform`, which is given, too.*move it there",
        ),
        ({"multiplexing": "pdm"}, "'ideal' or 'tdm'"),
        ({"adc_bits": 40}, r"RadarSpec\.adc\.bits = 40"),
    ],
)
def test_a_bad_file_is_refused(data, message) -> None:
    with pytest.raises(ParameterRangeError, match=message):
        read_radar(data)


def test_settings_stand_at_one_place_only() -> None:
    with pytest.raises(ParameterRangeError, match=r"RadarSpec\.num_rays = 5 .*in `settings`.*move it there"):
        lift_version_0_1({"num_rays": 5, "bandwidth": 1e9}, {"method": "raycast"})
    assert lift_version_0_1({"bandwidth": 1e9}, {"noise": False})[1] == {"noise": False}
    assert lift_version_0_1({"bandwidth": 1e9}) == ({"waveform": {"kind": "fmcw", "bandwidth": 1e9}}, None)


def test_the_radar_of_a_calibration_may_be_of_version_0_1() -> None:
    item = {"name": "corner", "scene": "highway_guardrail", "position": (0, 0, 1), "noise": 1e-9, "values": (1.0,)}
    item["targets"] = [{"position": (9, 0, 1), "rcs": 1.0}]
    old = RadarMap(**item, radar={"bandwidth": 600e6, "num_chirps": 1})
    assert old.radar == RadarMap(**item, radar={"waveform": {"bandwidth": 600e6, "num_chirps": 1}}).radar
    assert old.radar == ss.RadarSpec().with_(bandwidth=600e6, num_chirps=1)
