"""Scanning and closed radars in other formats: what is written is what they gave, what is left out is said."""

from __future__ import annotations

import base64
import io
import json
import warnings

import numpy as np
import pytest
from PIL import Image

import scarl_sionna as ss
from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.dataset import write_dataset
from scarl_sionna.dataset.formats import FORMATS, convert
from scarl_sionna.dataset.formats.source import FrameSource, SceneFrames
from scarl_sionna.dataset.readers.samples import FrameSamples
from scarl_sionna.fusion import Rig, SensorMount
from tests.closed_radars import points, processed

PLACE = ss.Pose([0.0, 0.0, 1.5])
TURN = ss.ScanningRadarSpec(rotation_rate=4.0, num_azimuths=40)
TARGETS = ([[15.0, 0.0, 0.0], [0.0, 20.0, 0.0]], np.zeros((2, 3)), [10.0, 10.0])


@pytest.fixture(scope="module")
def source() -> FrameSource:
    """One frame: a turning radar and a closed one, each with two points before it, and a radio that gave nothing."""
    device = ss.closed_radar_of(processed(points(10.0, 0.0)), 8, 16, threshold_db=20.0)
    scan = ss.scan_paths(ss.point_targets(*TARGETS, TURN.ramp(), ss.Pose()), TURN, np.random.default_rng(0))
    rda = ss.map_of_paths(points([10.0, 25.0], [0.0, 20.0], [0.0, 3.0]), device, np.random.default_rng(1))
    closed = ss.ClosedRadarFrame(device, ss.Pose(), rda.data.astype(np.float32))
    stations = [{"name": "mast", "position": [60.0, 0.0, 8.0]}]
    rig = Rig(
        "radars",
        (
            SensorMount("roof/turning", "scanning_radar", TURN, PLACE),
            SensorMount("front/closed", "closed_radar", device, PLACE),
            SensorMount("roof/radio", "radio", ss.RadioSpec(stations=stations), PLACE),
        ),
    )
    frame = ss.Frame(0, 0, 0, ss.Pose(), ss.Twist(), {"roof/turning": scan, "front/closed": closed}, ())
    return FrameSource(rig.to_dict(), [SceneFrames("street", [frame])], {})


@pytest.fixture(scope="module")
def frame(source: FrameSource) -> ss.Frame:
    return source.scenes[0].frames[0]


def peaks(frame: ss.Frame) -> ss.RadarPoints:
    closed = frame.closed_radars["front/closed"]
    return ss.peaks_of_map(ss.map_of_frame(closed), closed.spec.threshold_db)


def test_the_points_are_in_what_is_written(frame: ss.Frame) -> None:
    found = peaks(frame)
    assert {10.0, 25.0} <= set(np.round(found.range))
    image = frame.radar_scans["roof/turning"].image
    assert np.argmax(image.max(axis=0)) > 0 and image.max() > image.min()


def test_a_ros_bag_has_polar_images_and_peaks(source: FrameSource, frame: ss.Frame, tmp_path) -> None:
    pytest.importorskip("rosbags")
    from tests.integration.test_views_rosbag import cloud_of, read

    with pytest.warns(ScarlWarning, match=r"ROS bag has no place for roof/radio \(radio\)"):
        convert(source, "rosbag", tmp_path / "bag")
    bag = read(tmp_path / "bag")
    scan = frame.radar_scans["roof/turning"]
    (_, message), (_, info) = bag["/roof/turning/polar_image"][0], bag["/roof/turning/polar_image_info"][0]
    assert message.encoding == "mono8" and (message.height, message.width) == scan.image.shape
    assert np.array_equal(message.data.reshape(scan.image.shape), scan.image)
    about = json.loads(info.data)
    assert np.array_equal(about["azimuth_rad"], scan.azimuth) and about["floor_dbm"] == scan.floor_dbm
    ranges = about["first_range_m"] + about["range_step_m"] * np.arange(scan.image.shape[1])
    np.testing.assert_allclose(ranges, scan.spec.range, rtol=0, atol=1e-9)
    cloud = cloud_of(bag["/front/closed/peaks"][0][1])
    np.testing.assert_allclose(np.stack([cloud[axis] for axis in "xyz"], axis=1), peaks(frame).position, atol=1e-5)
    np.testing.assert_allclose(cloud["radial_velocity"], peaks(frame).radial_velocity, atol=1e-6)


def test_mcap_has_polar_images_and_peaks(source: FrameSource, frame: ss.Frame, tmp_path) -> None:
    reader = pytest.importorskip("mcap.reader")
    jsonschema = pytest.importorskip("jsonschema")
    with pytest.warns(ScarlWarning, match=r"MCAP has no place for roof/radio \(radio\)"):
        convert(source, "mcap", tmp_path / "one.mcap")
    with open(tmp_path / "one.mcap", "rb") as file:
        found = {}
        for schema, channel, message in reader.make_reader(file).iter_messages():
            found[channel.topic] = json.loads(message.data)
            jsonschema.validate(found[channel.topic], json.loads(schema.data))
    scan = frame.radar_scans["roof/turning"]
    png = base64.b64decode(found["/roof/turning/polar_image"]["data"])
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(png))), scan.image)
    assert found["/roof/turning/polar_image_info"]["step_db"] == scan.spec.image_step_db
    size = found["/front/closed/peaks"]["point_stride"]
    assert len(base64.b64decode(found["/front/closed/peaks"]["data"])) == size * peaks(frame).num_points


@pytest.mark.parametrize(
    "form",
    [
        pytest.param(name, marks=[pytest.mark.own_process] * (name == "tfrecord"))  # TensorFlow keeps half a gigabyte
        for name in FORMATS
        if name not in ("rosbag", "mcap", "rerun")
    ],
)
def test_every_format_holds_a_sensor_or_says_that_it_does_not(source: FrameSource, form: str, tmp_path) -> None:
    """Formats of arrays take all; the others name each sensor that they leave out, also where then nothing is left."""
    without_radio = Rig.from_dict({**source.rig, "sensors": source.rig["sensors"][:2]}).to_dict()
    source = FrameSource(without_radio, source.scenes, {})
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            convert(source, form, tmp_path / "out")
        except ss.ScarlError as error:
            assert "camera" in str(error) or "radar" in str(error) or "lidar" in str(error), error
    said = [str(one.message) for one in caught if "has no place for" in str(one.message)]
    if form in ("hdf5", "tfrecord", "webdataset"):
        assert not said and (tmp_path / "out").exists()
    else:
        assert said and "roof/turning (scanning_radar)" in said[0] and "front/closed (closed_radar)" in said[0]


def test_maps_of_closed_radars_are_items_of_samples(source: FrameSource, frame: ss.Frame, tmp_path) -> None:
    power = frame.closed_radars["front/closed"].power
    rig = Rig.from_dict({**source.rig, "sensors": source.rig["sensors"][:2]})
    write_dataset(tmp_path / "data", rig, {"street": [frame]})
    for frames in ([frame], ss.open_dataset(tmp_path / "data").scene("street")):
        sample = FrameSamples(frames)[0]
        assert np.array_equal(sample["front/closed:power"], power) and sample["front/closed:power"].dtype == np.float32
        assert np.array_equal(sample["roof/turning:image"], frame.radar_scans["roof/turning"].image)
