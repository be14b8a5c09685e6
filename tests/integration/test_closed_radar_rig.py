"""A radar without raw data in a rig: its map of the frame's instant, stored, read back, and the points in it."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

import scarl_sionna as ss
from scarl_sionna.core.errors import InputTypeError, ParameterRangeError
from scarl_sionna.dataset import schema, write_dataset
from scarl_sionna.dataset.verify import verify
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.radar.closed.sensor import ClosedRadar
from tests.closed_radars import RADAR, apart_db, points, processed
from tests.scenes import Material, Thing, box, write_scene

FRONT = ss.Pose([2.3, 0.0, 0.8])
EGO = {"kind": "constant_twist", "position": [0, 0, 0], "velocity": [12, 0, 0]}
AHEAD = {"kind": "constant_twist", "position": [25, 3, 0], "velocity": [8, 0, 0]}
SETTINGS = ss.RadarSettings.of("raycast", num_rays=5_000)


@pytest.fixture(scope="module")
def device() -> ss.ClosedRadarSpec:
    return ss.closed_radar_of(processed(points(10.0, 0.0)), 8, 16, threshold_db=20.0)


@pytest.fixture(scope="module")
def rig(device) -> Rig:
    quiet = SETTINGS.with_(noise=False, cell_labels=False)
    return Rig(
        "street",
        (
            SensorMount("front/closed", "closed_radar", device, FRONT, SETTINGS),
            SensorMount("front/quiet", "closed_radar", device, FRONT, quiet),
            SensorMount("front/radar", "radar", RADAR, FRONT, quiet),
        ),
    )


@pytest.fixture(scope="module")
def frame(tmp_path_factory, rig) -> ss.Frame:
    path = write_scene(
        tmp_path_factory.mktemp("street"),
        [Thing("house", box((80.0, 6.0, 9.0), (40.0, 15.0, 4.5)), "Building")],
        [
            Thing("ego", box((4.0, 1.8, 1.5), (0.0, 0.0, 0.8)), "Car", "steel", EGO),
            Thing("ahead", box((4.0, 1.8, 1.5), (0.0, 0.0, 0.8)), "Car", "steel", AHEAD),
        ],
        {"road": Material(radio="asphalt")},
        ego="ego",
    )
    return ss.observe(ss.load_scene(path), rig, 0.25, seed=3)


def test_the_map_is_that_of_the_radar_with_raw_data(frame) -> None:
    closed = ss.map_of_frame(frame.closed_radars["front/quiet"])
    raw = frame.radars["front/radar"]
    true = ss.range_doppler_angle(raw, compensate_motion=False)
    # the table ends 16 cells beside each echo, and the converter rounds
    assert apart_db(true, closed) < -40.0
    assert np.array_equal(raw.world_from_sensor.position, frame.closed_radars["front/quiet"].world_from_sensor.position)


def test_the_car_ahead_is_among_the_points(frame) -> None:
    rda = ss.map_of_frame(frame.closed_radars["front/closed"])
    found = ss.peaks_of_map(rda, frame.closed_radars["front/closed"].spec.threshold_db)
    there = np.hypot(25.0 - 2.0 - 2.3 + 0.25 * (8.0 - 12.0), 3.0)
    near = (np.abs(found.range - there) < 1.5) & (np.abs(found.radial_velocity + 4.0) < 1.0)
    assert near.any()
    assert "closed_radars" in repr(frame) and "front/closed" in repr(frame)
    assert "num_velocity, num_range, num_azimuth" in repr(frame.closed_radars["front/closed"])


def test_it_is_stored_and_read_back(tmp_path, frame, rig) -> None:
    out = write_dataset(tmp_path / "out", rig.to_dict(), {"street": [frame]})
    assert verify(out).complete
    stored = ss.open_dataset(out)[0]
    assert np.array_equal(stored.closed_radar["front/closed"].power, frame.closed_radars["front/closed"].power)
    again = stored.to_frame().closed_radars["front/closed"]
    assert again.spec == rig.sensors[0].spec and again.num_paths == frame.closed_radars["front/closed"].num_paths
    assert np.array_equal(ss.map_of_frame(again).data, again.power)
    alone = Rig("street", rig.sensors[2:])
    assert "closed_radar" not in schema.tables_of(alone.to_dict())
    assert schema.tables_of(rig.to_dict())["closed_radar"] == schema.CLOSED_RADAR


def test_a_rig_file_holds_the_table(rig) -> None:
    text = yaml.safe_dump(rig.to_dict())
    again = Rig.from_dict(yaml.safe_load(text))
    assert [mount.spec for mount in again.sensors] == [mount.spec for mount in rig.sensors]
    assert [mount.settings for mount in again.sensors] == [mount.settings for mount in rig.sensors]


def test_what_needs_raw_data_is_refused(device) -> None:
    with pytest.raises(ParameterRangeError, match=r"settings.chirps_per_block = 8.*has no chirps"):
        ClosedRadar(device, SETTINGS.with_(chirps_per_block=8))
    with pytest.raises(InputTypeError, match="ClosedRadarSpec"):
        ClosedRadar(RADAR)
    with pytest.raises(InputTypeError, match="to_result"):
        ss.map_of_frame(RADAR)
