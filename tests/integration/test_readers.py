"""Readers: what TensorFlow, PyTorch, pandas and xarray get from a dataset is what was simulated."""

from __future__ import annotations

import json
import pickle
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np
import pytest
from numcodecs import Blosc

import scarl_sionna as ss
from scarl_sionna.core import packages
from scarl_sionna.core.errors import DatasetError, MissingPackageError, ParameterRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.results import Frame, ObjectState, RadarFrame
from scarl_sionna.core.semantics import semantic_id
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import watt_to_dbm
from scarl_sionna.dataset import write_dataset
from scarl_sionna.dataset.derived.radar_points import sensed_points
from scarl_sionna.dataset.readers import reader
from scarl_sionna.dataset.readers.samples import FrameSamples
from scarl_sionna.dataset.readers.tables import BOX_UNITS, DETECTION_UNITS, box_table, detection_table
from scarl_sionna.dataset.readers.torch_data import TorchFrames
from scarl_sionna.dataset.readers.xarray_view import open_xarray, radar_maps_xarray
from scarl_sionna.dataset.repack import repack_dataset
from scarl_sionna.fusion import Rig, SensorMount
from tests.client_env import REPO, client_python, run_client
from tests.drive import OBJECT_LABELS, AllFrames, drive, with_labels

SOURCE = drive(num_frames=5, ends=("front",), scenes=("lane", "street"))
FRAMES = AllFrames(SOURCE)
RADAR, CAMERA, LIDAR = "front_center/radar", "front_center/camera", "front_center/lidar"


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    scenes = {scene.name: list(scene) for scene in SOURCE.scenes}
    return write_dataset(tmp_path_factory.mktemp("readers") / "ds", SOURCE.rig, scenes)


def boxes_by_hand(frame: Frame) -> np.ndarray:
    """Return x, y, z, yaw of all but the vehicle, by the poses' own algebra."""
    inverse = frame.world_from_vehicle.inverse()
    poses = [inverse @ item.world_from_box for item in frame.objects[1:]]
    return np.array([[*pose.position, pose.yaw] for pose in poses])


# -- samples ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("stored", [True, False])
def test_samples_are_what_was_simulated(place, stored) -> None:
    items = [f"{RADAR}:{name}" for name in ("adc", "adc_int", "cube", "range_doppler", "range_azimuth")]
    items += [f"{CAMERA}:{name}" for name in ("rgb", "semantic", "instance")]
    items += [f"{LIDAR}:{name}" for name in ("points", "instance")]
    items += ["boxes", "box_semantic", "box_instance", "timestamp_ns", "world_from_vehicle"]
    samples = FrameSamples(place if stored else FRAMES, items)
    assert len(samples) == 10
    for index in (7, 2):
        frame, sample = FRAMES[index], samples[index]
        radar, scan, image = frame.results[RADAR], frame.results[LIDAR], frame.results[CAMERA]
        np.testing.assert_array_equal(sample[f"{RADAR}:adc_int"], radar.adc_int)
        np.testing.assert_array_equal(sample[f"{RADAR}:adc"], radar.adc)
        np.testing.assert_array_equal(sample[f"{RADAR}:cube"], ss.virtual_cube(radar.adc, radar.spec))
        rd = ss.range_doppler(ss.virtual_cube(radar.adc, radar.spec), radar.spec)
        np.testing.assert_allclose(sample[f"{RADAR}:range_doppler"], watt_to_dbm(rd.power), rtol=1e-6)
        assert sample[f"{RADAR}:range_azimuth"].shape[0] == len(rd.range)
        for name in ("rgb", "semantic", "instance"):
            np.testing.assert_array_equal(sample[f"{CAMERA}:{name}"], getattr(image, name))
        np.testing.assert_array_equal(sample[f"{LIDAR}:points"][:, :3], scan.position)
        np.testing.assert_array_equal(sample[f"{LIDAR}:points"][:, 3], scan.intensity)
        np.testing.assert_array_equal(sample[f"{LIDAR}:instance"], scan.instance)
        np.testing.assert_allclose(sample["boxes"][:, [0, 1, 2, 6]], boxes_by_hand(frame), atol=1e-5)
        np.testing.assert_array_equal(sample["boxes"][:, 3:6], np.float32([item.size for item in frame.objects[1:]]))
        speed = np.linalg.norm(sample["boxes"][:, 7:], axis=1)
        np.testing.assert_allclose(speed, [np.linalg.norm(i.twist.linear) for i in frame.objects[1:]], atol=1e-5)
        assert sample["box_instance"].tolist() == [2, 3, 4]
        assert sample["timestamp_ns"] == frame.timestamp_ns
        np.testing.assert_array_equal(sample["world_from_vehicle"][:3], frame.world_from_vehicle.position)


def test_signature_tells_what_varies(place) -> None:
    samples = FrameSamples(place)
    for key, spec in samples.signature().items():
        for index in (0, 9):
            value = samples[index][key]
            assert value.dtype == spec.dtype
            assert len(value.shape) == len(spec.shape)
            assert all(want in (None, have) for want, have in zip(spec.shape, value.shape, strict=True))
    varies = {key for key, spec in samples.signature().items() if None in spec.shape}
    labels = {f"{LIDAR}:points", f"{LIDAR}:semantic", f"{LIDAR}:instance"}
    assert varies == {*labels, "boxes", "box_semantic", "box_instance"}


def test_signature_tells_that_labels_of_cameras_follow_the_objects() -> None:
    frame = with_labels(FRAMES[0])
    found = FrameSamples([frame]).signature()
    wanted = {name: (None, *getattr(frame.results[CAMERA], name).shape[1:]) for name in OBJECT_LABELS}
    assert wanted["object_box"] == (None, 4)
    assert {name: found[f"{CAMERA}:{name}"].shape for name in OBJECT_LABELS} == wanted
    assert found[f"{CAMERA}:instance"].shape == (90, 160)


@pytest.mark.parametrize("stored", [True, False])
def test_what_is_read_by_default_has_the_scale_of_codes_and_the_labels_of_returns(place, stored) -> None:
    sample = FrameSamples(place if stored else FRAMES)[3]
    codes, frame = sample[f"{RADAR}:adc_int"], FRAMES[3]
    beat = codes.astype(np.float64) @ [1.0, 1.0j] * sample[f"{RADAR}:adc_scale"]
    np.testing.assert_allclose(beat, frame.results[RADAR].adc, rtol=1e-5)
    assert len(sample[f"{LIDAR}:points"]) == len(sample[f"{LIDAR}:semantic"])
    np.testing.assert_array_equal(sample[f"{LIDAR}:instance"], frame.results[LIDAR].instance)


def test_only_what_is_asked_for_is_read(place, monkeypatch) -> None:
    read: list[str] = []
    for kind in ("read_array", "read_file"):
        original = getattr(reader.Scene, kind)

        def spy(self, *args, _original=original):
            read.append(str(args[-1]))
            return _original(self, *args)

        monkeypatch.setattr(reader.Scene, kind, spy)
    FrameSamples(place, [f"{LIDAR}:points"])[3]
    assert read and not [name for name in read if "radar" in name or name.endswith(".png")]


def test_unknown_items_are_refused_by_name(place) -> None:
    with pytest.raises(UnknownNameError, match="front_center/radar"):
        FrameSamples(place, ["front_centre/radar:adc"])
    with pytest.raises(UnknownNameError, match="range_doppler"):
        FrameSamples(place, [f"{RADAR}:range_dopler"])
    with pytest.raises(UnknownNameError, match="did you mean 'boxes'"):
        FrameSamples(place, ["boxs"])
    with pytest.raises(ParameterRangeError):
        FrameSamples(place, [])
    with pytest.raises(ParameterRangeError, match="without frames"):
        FrameSamples([])
    with pytest.raises(DatasetError):
        FrameSamples(place / "nothing")
    with pytest.raises(DatasetError, match="no 'flow'"):
        FrameSamples(place, [f"{CAMERA}:flow"]).signature()


def test_a_frame_without_a_sensor_is_named() -> None:
    partial = replace(FRAMES[1], results={LIDAR: FRAMES[1].results[LIDAR]})
    samples = FrameSamples([FRAMES[0], partial], [f"{RADAR}:adc"])
    with pytest.raises(DatasetError, match="frame 1 has no sensor"):
        samples[1]


def test_samples_travel_to_another_process(place) -> None:
    samples = FrameSamples(place, {"points": f"{LIDAR}:points"})
    again = pickle.loads(pickle.dumps(samples))
    np.testing.assert_array_equal(again[4]["points"], samples[4]["points"])


# -- TensorFlow ------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.own_process
def test_tf_data_gives_frames_in_order_and_ragged_batches(place) -> None:
    from scarl_sionna.dataset.readers.tf_data import tensorflow, tf_dataset

    tf = tensorflow()
    assert "drjit" in sys.modules  # imported first
    items = {
        "adc": f"{RADAR}:adc",
        "rgb": f"{CAMERA}:rgb",
        "points": f"{LIDAR}:points",
        "boxes": "boxes",
        "time": "timestamp_ns",
    }
    frames = list(tf_dataset(place, items))
    assert [int(frame["time"]) for frame in frames] == [frame.timestamp_ns for frame in FRAMES]
    np.testing.assert_array_equal(frames[6]["adc"].numpy(), FRAMES[6].results[RADAR].adc)
    batches = tf_dataset(place, items, batch_size=4)
    spec = batches.element_spec
    assert spec["adc"].shape.as_list() == [None, *FRAMES[0].results[RADAR].adc.shape]
    assert spec["adc"].dtype == tf.complex64
    assert isinstance(spec["points"], tf.RaggedTensorSpec) and isinstance(spec["boxes"], tf.RaggedTensorSpec)
    sizes = [int(batch["adc"].shape[0]) for batch in batches]
    assert sizes == [4, 4, 2]
    first = next(iter(batches))
    assert first["points"].row_lengths().numpy().tolist() == [f.results[LIDAR].num_points for f in FRAMES[:4]]
    np.testing.assert_array_equal(first["points"][2].numpy()[:, :3], FRAMES[2].results[LIDAR].position)


@pytest.mark.own_process
@pytest.mark.slow  # 12 frames of 6.3 MB are simulated
def test_tf_data_costs_little_more_than_to_decompress(tmp_path) -> None:
    """Of raw radar data of SCaRL's size, read from files: CPU time of all threads, beside that of the decoder alone."""
    from scarl_sionna.dataset.readers.tf_data import tf_dataset

    spec, rng = RadarSpec.preset("awr1843boost"), np.random.default_rng(0)
    shape = (spec.num_rx, spec.num_chirps_total, spec.num_samples, 2)
    frames = []
    for index in range(
        12
    ):  # receiver noise of some 15 steps, as in a simulated frame: it decides how well a file is packed
        codes = np.rint(rng.normal(0.0, 15.0, shape)).astype(np.int16)
        frames.append(
            Frame(index, index * 10**8, 0, Pose(), Twist(), {"radar": RadarFrame(spec, Pose(), codes, 1e-9)}, ())
        )
    rig = Rig("one", (SensorMount("radar", "radar", spec, Pose()),))
    dataset = write_dataset(tmp_path / "ds", rig.to_dict(), {"train": frames})
    data = iter(tf_dataset(dataset, ["radar:adc_int"], repeat=True, num_threads=2, prefetch=2))
    codec = Blosc(cname="zstd", clevel=5, shuffle=Blosc.BITSHUFFLE)
    packed = codec.encode(codes)

    def seconds(step: Callable[[], object]) -> float:
        """Return the CPU time of 12 frames."""
        start = process_time()
        for _ in range(12):
            step()
        return process_time() - start

    def read() -> None:
        assert next(data)["radar:adc_int"].numpy().nbytes == codes.nbytes

    seconds(read)
    ratios = [seconds(read) / seconds(lambda: codec.decode(packed)) for _ in range(4)]
    assert min(ratios) < 4.0, ratios


@pytest.mark.slow
@pytest.mark.own_process
def test_tf_data_shuffles_by_seed_anew_in_each_epoch(place) -> None:
    from scarl_sionna.dataset.readers.tf_data import tf_dataset

    def epochs(seed: int) -> list[list[tuple[int, ...]]]:
        dataset = tf_dataset(place, ["timestamp_ns", "box_instance"], shuffle_seed=seed)
        return [[int(item["timestamp_ns"]) for item in dataset] for _ in range(2)]

    first, second = epochs(1)
    assert first != second and sorted(first) == sorted(second) == sorted(f.timestamp_ns for f in FRAMES)
    repeated = tf_dataset(place, ["timestamp_ns"], repeat=True)
    assert len(list(repeated.take(25))) == 25
    with pytest.raises(ParameterRangeError, match="batch_size"):
        tf_dataset(place, ["boxes"], batch_size=0)


@pytest.mark.own_process
@pytest.mark.slow  # 160 frames are simulated, and a network is trained
def test_a_keras_network_learns_near_and_far_from_range_doppler_maps_in_one_epoch(tmp_path) -> None:
    """160 frames of one target each; the label comes from the boxes. A constant answer is right in half of them."""
    from scarl_sionna.dataset.readers.tf_data import tensorflow, tf_dataset

    tf = tensorflow()
    spec = RadarSpec().with_(
        num_chirps=32, num_samples=32, tx_positions=((0.0, 0.0, 0.0),), rx_positions=((0.0, 0.0, 0.0),)
    )
    rng = np.random.default_rng(3)
    half, frames = spec.max_range / 2.0, []
    for index in range(160):
        place_x = rng.uniform(0.1, 0.45) * spec.max_range + (index % 2) * half
        pose, motion = Pose([place_x, 0.0, 0.0]), np.array([rng.uniform(-10, 10), 0.0, 0.0])
        paths = ss.point_targets(pose.position[None], motion[None], 10.0, spec, Pose())
        codes, scale, _ = ss.quantize(ss.synthesize(paths, spec, rng=rng), spec)
        car = ObjectState("car", 1, semantic_id("Car"), pose, np.array([4.0, 2.0, 1.5]), Twist(motion), True)
        frames.append(
            Frame(index, index * 10**8, 0, Pose(), Twist(), {"radar": RadarFrame(spec, Pose(), codes, scale)}, (car,))
        )
    rig = Rig("one", (SensorMount("radar", "radar", spec, Pose()),))
    dataset = write_dataset(tmp_path / "ds", rig.to_dict(), {"train": frames})
    tf.keras.utils.set_random_seed(0)
    data = tf_dataset(dataset, {"map": "radar:range_doppler", "boxes": "boxes"}, shuffle_seed=0)
    pairs = data.map(
        lambda item: (
            tf.image.per_image_standardization(item["map"][..., None]),
            tf.cast(item["boxes"][0, 0] > half, tf.int32),
        )
    ).batch(8)
    network = tf.keras.Sequential(
        [
            tf.keras.Input((32, 32, 1)),
            tf.keras.layers.Conv2D(4, 3, padding="same", activation="relu"),
            tf.keras.layers.MaxPooling2D((32, 1)),  # over Doppler
            tf.keras.layers.Flatten(),
            tf.keras.layers.Dense(2),
        ]
    )
    loss = tf.keras.losses.SparseCategoricalCrossentropy(from_logits=True)
    network.compile(tf.keras.optimizers.Adam(0.02), loss, metrics=["accuracy"])
    before, _ = network.evaluate(pairs, verbose=0)
    network.fit(pairs, epochs=1, shuffle=False, verbose=0)
    after, accuracy = network.evaluate(pairs, verbose=0)
    assert after < before
    # by chance 0.5 +- 0.04; 0.9 is ten standard deviations above
    assert accuracy > 0.9


# -- PyTorch ---------------------------------------------------------------------------------------------------------


@pytest.mark.slow  # three processes import PyTorch
def test_torch_dataloader_with_workers(place, pytestconfig) -> None:
    python = client_python("torch", pytestconfig)
    found = json.loads(run_client(python, "torch_client.py", REPO, place).splitlines()[-1])
    assert found["length"] == 10
    assert found["engine"] == []  # reading starts no ray tracer
    assert found["0"] == found["2fork"] == found["2spawn"]
    first = found["0"][0]
    assert first["adc"]["dtype"] == "torch.complex64"
    assert first["adc"]["shapes"] == [[2, *FRAMES[0].results[RADAR].adc.shape]]
    assert first["ids"]["dtype"] == "torch.int32"
    assert first["points"]["shapes"] == [[f.results[LIDAR].num_points, 5] for f in FRAMES[:2]]
    assert first["boxes"]["shapes"] == [[3, 10], [3, 10]]
    total = sum(f.results[RADAR].adc.astype(complex).sum() for f in FRAMES[:2])
    np.testing.assert_allclose(complex(*first["adc"]["sums"][0]), total, rtol=1e-6)
    ids = sum(int(f.results[CAMERA].instance.sum()) for f in FRAMES[:2])
    assert first["ids"]["sums"][0][0] == ids
    assert found["gradient"] > 0


def test_torch_missing_names_the_remedy(place, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(MissingPackageError, match="torch"):
        TorchFrames(place)


@pytest.mark.parametrize(
    ("module", "extra", "call"),
    [
        ("pandas", "tables", lambda place: box_table(place)),
        ("xarray", "xarray", lambda place: open_xarray(place)),
    ],
)
def test_a_missing_package_names_its_extra(place, monkeypatch, module, extra, call) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingPackageError, match=rf"pip install 'scarl-sionna\[{extra}\]'"):
        call(place)


def test_a_package_that_is_there_but_broken_is_not_called_missing(tmp_path, monkeypatch) -> None:
    (tmp_path / "half_there.py").write_text("import not_there_at_all\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ModuleNotFoundError, match="not_there_at_all"):
        packages.require("half_there", "x")


# -- tables ----------------------------------------------------------------------------------------------------------


def test_box_table_has_every_object_of_every_frame(place) -> None:
    table = box_table(place)
    assert len(table) == sum(len(frame.objects) for frame in FRAMES)
    assert set(BOX_UNITS) <= set(table.columns)
    assert table.attrs["units"] == BOX_UNITS
    assert table.groupby(["scene", "frame"]).is_ego.sum().eq(1).all()
    row = table[(table.scene == "street") & (table.frame == 3) & (table.instance == 3)].iloc[0]
    item = SOURCE.scenes[1].frames[3].objects[2]
    np.testing.assert_array_equal(row[["x", "y", "z"]].astype(float), item.world_from_box.position)
    assert (row.semantic_class, row.num_pixels, row.vy) == ("Pedestrian", item.num_pixels, item.twist.linear[1])
    np.testing.assert_allclose(
        row[["vehicle_x", "vehicle_y", "vehicle_z", "vehicle_yaw"]].astype(float),
        boxes_by_hand(SOURCE.scenes[1].frames[3])[1],
    )
    assert box_table(SOURCE).equals(table)


def test_box_table_reads_no_sensor_data(place, monkeypatch) -> None:
    def refuse(*args: object) -> None:
        raise AssertionError("read a PNG")

    monkeypatch.setattr(reader.StoredFrame, "to_frame", refuse)
    assert len(box_table(place))


def test_detection_table_holds_the_detections(place) -> None:
    table = detection_table(place, [RADAR])
    frame = FRAMES[0]
    sensed = sensed_points(frame, frame.results[RADAR])
    part = table[(table.scene == "lane") & (table.frame == 0)]
    np.testing.assert_array_equal(part["range"], sensed.points.range)
    np.testing.assert_array_equal(part["velocity_over_ground"], sensed.compensated_velocity)
    assert {2, 3} <= set(part.instance)  # car and pedestrian were found where they are
    assert part.iloc[0].instance == 2
    assert set(DETECTION_UNITS) <= set(table.columns)
    with pytest.raises(UnknownNameError, match="radar"):
        detection_table(place, ["front_center/lidar"])


# -- xarray ----------------------------------------------------------------------------------------------------------


def test_xarray_sees_named_axes_coordinates_and_units(place) -> None:
    tree = open_xarray(place, "street")
    radar = tree[RADAR]
    assert radar.adc.dims == ("frame", "receiver", "chirp", "sample", "iq")
    np.testing.assert_array_equal(radar.adc.sel(frame=2).values, SOURCE.scenes[1].frames[2].results[RADAR].adc_int)
    assert radar.adc_scale.attrs["units"] == "sqrt(W)"
    assert radar.slow_time.attrs["units"] == "s"
    spec = SOURCE.scenes[1].frames[0].results[RADAR].spec
    np.testing.assert_allclose(radar.fast_time[-1], (spec.num_samples - 1) / spec.sample_rate)
    np.testing.assert_allclose(
        radar.slow_time.values[:: spec.num_tx], np.arange(spec.num_chirps) * spec.doppler_interval
    )
    np.testing.assert_allclose(tree["objects"].time, [0.0, 0.1, 0.2, 0.3, 0.4])
    assert tree["objects"].twist.dims == ("frame", "object", "velocity")
    speed = tree["objects"].twist.sel(velocity="vx").isel(frame=0, object=1)
    assert float(speed) == 6.0
    lidar = tree[LIDAR]
    assert lidar.position.attrs["units"] == "m"
    count = int(lidar.num_points[4])
    np.testing.assert_array_equal(lidar.position[4, :count], SOURCE.scenes[1].frames[4].results[LIDAR].position)
    with pytest.raises(UnknownNameError):
        open_xarray(place, "avenue")


def test_plain_xarray_opens_the_store(place, tmp_path) -> None:
    import xarray as xr

    files = repack_dataset(place, tmp_path / "files", "files")
    for opened in (
        xr.open_zarr(files / "arrays" / "lane" / RADAR, consolidated=False),
        xr.open_zarr(ss.open_dataset(place).scene("lane").zarr_place(), group=RADAR, consolidated=False),
    ):
        assert opened.adc.dims == ("frame", "receiver", "chirp", "sample", "iq")
        np.testing.assert_array_equal(opened.adc[1].values, FRAMES[1].results[RADAR].adc_int)


def test_xarray_maps_have_physical_axes(place) -> None:
    maps = radar_maps_xarray(ss.open_dataset(place)[0].radar[RADAR])
    peak = maps.range_doppler.isel(range_doppler_peak(maps))
    item, frame = FRAMES[0].objects[1], FRAMES[0]
    sensor = frame.results[RADAR].world_from_sensor
    distance = np.linalg.norm(item.world_from_box.position - sensor.position)
    assert float(peak.range) == pytest.approx(distance, abs=0.6 * frame.results[RADAR].spec.range_resolution)
    assert maps.range.attrs["units"] == "m" and maps.azimuth.attrs["units"] == "rad"
    assert maps.channels.shape == (12, 64, 128)


def range_doppler_peak(maps) -> dict[str, int]:
    row, column = np.unravel_index(int(np.argmax(maps.range_doppler.values)), maps.range_doppler.shape)
    return {"radial_velocity": int(row), "range": int(column)}
