"""The store: a frame comes back as it was written, other readers understand it, and what is not known is refused."""

from __future__ import annotations

import json
import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, make_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from PIL import Image

import scarl_sionna as ss
from scarl_sionna.core import registry
from scarl_sionna.core.errors import DatasetError, OutputError, ParameterRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.results import ImageFrame, LidarScan, ObjectState, RadarFrame
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.dataset import StoreOptions, open_dataset, write_dataset
from scarl_sionna.dataset.codec import DEPTH_RATIO, decode_depth, encode_depth
from scarl_sionna.dataset.encoding import encode_frame
from scarl_sionna.dataset.schema import RESULT_TYPES, TABLES, Field, check_fields, check_schema
from scarl_sionna.dataset.schema_docs import schema_page
from scarl_sionna.dataset.store.manifest import DatasetPlan, ScenePlan
from scarl_sionna.dataset.store.shards import (
    ArrayInfo,
    array_metadata,
    decode_chunk,
    encode_chunk,
    parse_index,
    shard_index,
    shard_key,
)
from scarl_sionna.dataset.store.writer import DatasetFolder
from scarl_sionna.dataset.verify import verify
from scarl_sionna.fusion import Rig, SensorMount
from tests.frames import CAMERA, RIG, assert_same, make_frame

FRAMES = [make_frame(index) for index in range(5)]
OPTIONS = StoreOptions(shard_frames=4, layout="files")


def contents(out: Path) -> dict[str, bytes]:
    """Return all data files of a dataset."""
    names = {path.relative_to(out): path for path in sorted(out.rglob("*")) if path.is_file()}
    return {name.as_posix(): path.read_bytes() for name, path in names.items() if not name.parts[0].startswith(".")}


@pytest.fixture(scope="module")
def dataset_path(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("store") / "deep" / "out"
    return write_dataset(out, RIG.to_dict(), {"b": FRAMES[:2], "a": FRAMES}, options=OPTIONS)


def test_frames_come_back_as_they_were_written(dataset_path) -> None:
    dataset = ss.open_dataset(dataset_path)
    assert (len(dataset), dataset.scenes) == (7, ["a", "b"])
    for position, frame in enumerate([*FRAMES, *FRAMES[:2]]):
        assert_same(dataset[position].to_frame(), frame)
    assert_same(dataset[-1].to_frame(), FRAMES[1])
    assert [item.index for item in dataset[3:6]] == [3, 4, 0]
    assert dataset.rig == json.loads(json.dumps(RIG.to_dict()))


@pytest.mark.parametrize("url", ["file://{}", "{}", "simplecache::file://{}"])
def test_any_place_that_fsspec_knows_can_be_read(dataset_path, url) -> None:
    dataset = open_dataset(url.format(dataset_path))
    assert_same(dataset[4].to_frame(), FRAMES[4])


def test_the_suite_stands_for_its_sensors(dataset_path) -> None:
    frame = open_dataset(dataset_path)[2]
    assert list(frame.image) == ["front/camera", "front/depth"]
    assert frame.image["front"].rgb.shape == (16, 24, 3)
    assert frame.lidar["front"].num_points == FRAMES[2].lidars["front/lidar"].num_points
    with pytest.raises(UnknownNameError, match=r"unknown radar 'rader' \(known: radar\).*did you mean 'radar'"):
        frame.radar["rader"]
    with pytest.raises(AttributeError, match="no field 'colour'"):
        _ = frame.image["front/camera"].colour
    assert [item.name for item in frame.labels] == ["car", "man"]


def test_zarr_reads_slices_and_finds_axes_and_units(dataset_path) -> None:
    scene = open_dataset(dataset_path).scene("a")
    adc = scene.group["radar/adc"]
    expected = np.stack([frame.radars["radar"].adc_int for frame in FRAMES])
    np.testing.assert_array_equal(adc[3, :, 2:5], expected[3, :, 2:5])
    np.testing.assert_array_equal(adc[:], expected)
    assert (adc.shards, adc.chunks) == ((4, *expected.shape[1:]), (1, *expected.shape[1:]))
    assert adc.metadata.dimension_names == ("frame", "receiver", "chirp", "sample", "iq")
    assert scene.group["front/lidar/distance"].attrs["units"] == "m"
    times = scene.group["timestamp_ns"][:]
    np.testing.assert_array_equal(times, [frame.timestamp_ns for frame in FRAMES])
    np.testing.assert_array_equal(scene.array("timestamp_ns"), times)


def test_the_whole_hierarchy_is_plain_zarr(dataset_path) -> None:
    """No folder in it puzzles a reader of Zarr, and the library reads the same as this package."""
    group = zarr.open_group(str(dataset_path / "arrays"), mode="r")
    with pytest.warns() as caught:
        members = dict(group.members(max_depth=None))
        import warnings

        warnings.warn("one at least", UserWarning, stacklevel=1)
    assert [str(item.message) for item in caught] == ["one at least"]
    arrays = {name: item for name, item in members.items() if isinstance(item, zarr.Array)}
    assert len(arrays) == 2 * (3 + 11 + 8 + 1 + 17 + 11)
    scene = open_dataset(dataset_path).scene("a")
    for name, array in arrays.items():
        if name.startswith("a/"):
            np.testing.assert_array_equal(array[4], scene.read_array(4, name.removeprefix("a/")))


def test_xarray_opens_a_sensor(dataset_path) -> None:
    xarray = pytest.importorskip("xarray")
    with xarray.open_zarr(str(dataset_path / "arrays" / "a"), group="radar", consolidated=False) as opened:
        assert opened.sizes["frame"] == 5
        assert opened["adc"].dims == ("frame", "receiver", "chirp", "sample", "iq")
        assert opened["adc_scale"].attrs["units"] == "sqrt(W)"


def test_plain_readers_understand_images_and_manifest(dataset_path) -> None:
    images = FRAMES[0].images["front/camera"]
    folder = dataset_path / "images" / "a" / "front" / "camera"
    with Image.open(folder / "semantic" / "000000.png") as image:
        np.testing.assert_array_equal(np.array(image), images.semantic)
        car = np.array(image.convert("RGB"))[images.semantic == 14]
        assert (car == (0, 0, 142)).all()  # CARLA's colour of a car
    with Image.open(folder / "instance" / "000000.png") as image:
        np.testing.assert_array_equal(np.array(image), images.instance)
    manifest = json.loads((dataset_path / "manifest.json").read_text())
    assert manifest["calibration"]["front/camera"]["intrinsics"] == CAMERA.intrinsics.tolist()
    assert manifest["schema"]["lidar"]["distance"] == {
        "dtype": "float32",
        "axes": ["point"],
        "unit": "m",
        "description": "length along the ray",
        "storage": "array",
    }
    assert "a frame" not in (dataset_path / "README.md").read_text()


def test_the_manifest_and_the_records_hold_no_path_and_no_time_of_day(dataset_path, tmp_path) -> None:
    again = write_dataset(tmp_path / "elsewhere", RIG.to_dict(), {"a": FRAMES, "b": FRAMES[:2]}, options=OPTIONS)
    assert contents(again) == contents(dataset_path)


def test_complex_radar_data_by_choice(tmp_path) -> None:
    options = StoreOptions(radar_format="complex64")
    dataset = open_dataset(write_dataset(tmp_path / "out", RIG.to_dict(), {"a": FRAMES}, options=options))
    assert dataset.scene("a").group["radar/adc"].dtype == np.complex64
    for position, frame in enumerate(FRAMES):
        assert_same(dataset[position].to_frame(), frame)  # the codes come back exactly
        np.testing.assert_array_equal(dataset[position].radar["radar"].adc, frame.radars["radar"].adc)


def test_more_frames_later_give_the_same_bytes_as_at_once(dataset_path, tmp_path) -> None:
    out = tmp_path / "out"
    write_dataset(out, RIG.to_dict(), {"a": FRAMES[:3]}, options=OPTIONS)
    assert len(open_dataset(out)) == 3
    write_dataset(out, RIG.to_dict(), {"b": FRAMES[:2]}, options=OPTIONS)
    assert len(open_dataset(out)) == 5
    write_dataset(out, RIG.to_dict(), {"a": FRAMES}, options=OPTIONS)
    assert contents(out) == contents(dataset_path)


def test_another_configuration_is_refused_and_the_difference_named(tmp_path) -> None:
    out = write_dataset(tmp_path / "out", RIG.to_dict(), {"a": FRAMES}, configuration={"seed": 0})
    other = json.loads(json.dumps(RIG.to_dict()))
    other["sensors"][3]["spec"]["waveform"]["bandwidth"] = 1e9
    before = contents(out)
    with pytest.raises(OutputError, match=r"bandwidth: 300000000\.0 there.*seed: 0 there, 5 asked for.*overwrite"):
        write_dataset(out, other, {"a": FRAMES}, configuration={"seed": 5})
    assert contents(out) == before
    write_dataset(out, other, {"a": FRAMES[:1]}, configuration={"seed": 5}, overwrite=True)
    assert len(open_dataset(out)) == 1


def test_readers_may_work_in_threads_and_in_other_processes(dataset_path) -> None:
    dataset = pickle.loads(pickle.dumps(open_dataset(dataset_path)))
    with ThreadPoolExecutor(4) as pool:
        for frame, read in zip(FRAMES * 8, pool.map(lambda i: dataset[i % 5].to_frame(), range(40)), strict=True):
            assert_same(read, frame)


def test_a_chunk_is_one_frame_and_its_damage_is_seen() -> None:
    info = ArrayInfo("float32", (40, 3), ("point", "xyz"))
    values = np.random.default_rng(0).normal(size=(40, 3)).astype(np.float32)
    chunk = encode_chunk(values, info)
    np.testing.assert_array_equal(decode_chunk(chunk, info), values)
    for position in (0, len(chunk) // 2, len(chunk) - 1):
        damaged = bytearray(chunk)
        damaged[position] ^= 1
        with pytest.raises(DatasetError, match="damaged"):
            decode_chunk(bytes(damaged), info)
    index = shard_index([3, None, 5])
    assert parse_index(index, 3) == [(0, 3), None, (3, 5)]
    with pytest.raises(DatasetError, match="cut"):
        parse_index(index[:-1], 3)


def test_compression_does_not_depend_on_the_thread() -> None:
    """In the main thread Blosc uses threads of its own and orders its blocks by who is ready first.

    Frames are never there.
    """
    info = ArrayInfo("int16", (1 << 20,), ("sample",))
    values = np.random.default_rng(0).normal(scale=300.0, size=1 << 20).astype(np.int16)
    with ThreadPoolExecutor(4) as pool:
        chunks = set(pool.map(lambda _: encode_chunk(values, info), range(16)))
    assert len(chunks) == 1
    np.testing.assert_array_equal(decode_chunk(encode_chunk(values, info), info), values)


@pytest.mark.parametrize("dtype", ["bool", "uint8", "int16", "int64", "float16", "float64", "complex64"])
def test_every_type_is_read_by_zarr_and_a_missing_frame_is_the_fill_value(tmp_path, dtype) -> None:
    shape = (17, 5) if dtype == "int64" else (3,)  # one large enough to be compressed
    info = ArrayInfo(dtype, shape, ("x", "y")[: len(shape)])
    values = (np.random.default_rng(1).normal(size=shape) * 3).astype(dtype)
    place = tmp_path / "array"
    target = tmp_path / shard_key("array", 0, info)
    target.parent.mkdir(parents=True)
    chunk = encode_chunk(values, info)
    target.write_bytes(chunk + shard_index([None, len(chunk), None]))
    (place / "zarr.json").write_text(array_metadata(info, 5, 3))
    array = zarr.open_array(str(place), mode="r")
    np.testing.assert_array_equal(array[1], values)
    empty = np.asarray(array[0])
    assert np.isnan(empty).all() if empty.dtype.kind in "fc" else not empty.any()


def test_the_schema_names_every_field_of_every_result() -> None:
    check_schema()
    for kind in RESULT_TYPES.values():
        for item in TABLES[kind]:
            assert item.description and (item.storage == "json" or np.dtype(item.dtype))


@pytest.mark.parametrize("base", [ImageFrame, LidarScan, RadarFrame, ObjectState])
def test_a_field_that_the_schema_does_not_know_is_an_error(base) -> None:
    extended = make_dataclass("Extended", [("novelty", Any, None)], bases=(base,), frozen=True)
    kind = RESULT_TYPES.get(base, "objects")
    with pytest.raises(OutputError, match="does not know the field novelty of Extended"):
        check_fields(extended, TABLES[kind])


def test_an_unknown_result_and_too_many_objects_are_refused(tmp_path) -> None:
    frame = FRAMES[1]
    with ThreadPoolExecutor(1) as pool:
        with pytest.raises(OutputError, match="cannot store the result of sensor 'radar' of type object"):
            encode_frame(replace(frame, results={"radar": object()}), OPTIONS, pool)
        with pytest.raises(OutputError, match="holds 1 objects, the dataset has room for 0"):
            encode_frame(frame, StoreOptions(object_capacity=0), pool)


class SonarSpec(Spec):
    """Specification of a kind of sensor that is not built in."""

    num_beams: int = 7


@dataclass(frozen=True, eq=False)
class SonarPing:
    """Result of a sensor that is not built in."""

    spec: SonarSpec
    world_from_sensor: Pose
    echo: np.ndarray
    gain: float
    kind: str = "sonar"


class Sonar:
    """A sensor of another package that tells what is to be stored of it."""

    spec_type = SonarSpec
    result_type = SonarPing
    stored_fields = (
        Field("echo", "float32", ("beam",), "Pa", "pressure"),
        Field("gain", "float64", (), "", "amplification"),
    )

    def __init__(self, spec: SonarSpec) -> None:
        self.spec = spec


class Mute(Sonar):
    """A sensor of another package that does not."""

    stored_fields = None


@pytest.fixture
def sonar(monkeypatch: pytest.MonkeyPatch) -> None:
    kinds = {"sonar": Sonar, "mute": Mute}
    real = registry.sensor_class
    for module in (
        "scarl_sionna.core.registry",
        "scarl_sionna.dataset.encoding",
        "scarl_sionna.dataset.readers.stored",
    ):
        monkeypatch.setattr(f"{module}.sensor_class", lambda kind: kinds.get(kind) or real(kind))


def test_a_sensor_of_another_package_is_stored_by_what_its_class_declares(tmp_path, sonar) -> None:
    spec = SonarSpec()
    ping = SonarPing(spec, Pose([1.0, 2.0, 3.0]), np.arange(7, dtype=np.float32), 2.5)
    rig = Rig("sea", (SensorMount("hull/sonar", "sonar", spec, Pose()),))
    frame = replace(FRAMES[0], results={"hull/sonar": ping})
    dataset = open_dataset(write_dataset(tmp_path / "out", rig.to_dict(), {"sea": [frame]}))
    again = dataset[0].to_frame().results["hull/sonar"]
    assert type(again) is SonarPing and again.gain == 2.5
    np.testing.assert_array_equal(again.echo, ping.echo)
    assert dataset.scene("sea").group["hull/sonar/echo"].attrs["units"] == "Pa"


def test_a_sensor_of_another_package_that_declares_nothing_is_refused_before_it_works(sonar) -> None:
    from scarl_sionna.batch.plan import check_storable

    check_storable("hull/sonar", "sonar")
    with pytest.raises(ParameterRangeError, match="declare `stored_fields` and `result_type`"):
        check_storable("hull/mute", "mute")


@pytest.mark.parametrize("name", ["objects/lidar", "timestamp_ns", "front"])
def test_a_sensor_may_not_take_the_name_of_something_else(name) -> None:
    rig = Rig("bad", (SensorMount(name, "camera", CAMERA, Pose()), *RIG.sensors)).to_dict()
    with pytest.raises(ParameterRangeError, match="no group of other sensors"):
        DatasetPlan(rig, (ScenePlan("a", 1),))


@pytest.mark.parametrize("name", ["", "../up", "a/b", ".hidden", "white space"])
def test_a_scene_may_not_have_a_name_that_is_a_path(name) -> None:
    with pytest.raises(ParameterRangeError, match="scene name"):
        ScenePlan(name, 1)


def test_a_folder_with_other_files_and_a_place_that_is_none_are_refused(tmp_path) -> None:
    (tmp_path / "thesis.doc").write_text("years of work")
    for overwrite in (False, True):
        with pytest.raises(OutputError, match=r"holds other files \(thesis.doc\)"):
            write_dataset(tmp_path, RIG.to_dict(), {"a": FRAMES}, overwrite=overwrite)
    for out in (tmp_path / "thesis.doc", tmp_path / "thesis.doc" / "out"):  # holds for root, too
        with pytest.raises(OutputError, match="choose a folder"):
            write_dataset(out, RIG.to_dict(), {"a": FRAMES})
    assert (tmp_path / "thesis.doc").read_text() == "years of work"


def test_a_lost_or_damaged_manifest_is_made_again_only_for_the_same_configuration(tmp_path) -> None:
    out = write_dataset(tmp_path / "out", RIG.to_dict(), {"a": FRAMES}, configuration={"seed": 1})
    before = contents(out)
    for damage in ("", before["manifest.json"].decode()[:900], None):
        (out / "manifest.json").unlink()
        (out / "manifest.backup.json").unlink()
        if damage is not None:
            (out / "manifest.json").write_text(damage)
        with pytest.raises(OutputError, match="of another configuration; give the configuration that made it"):
            write_dataset(out, RIG.to_dict(), {"a": FRAMES}, configuration={"seed": 2})
        write_dataset(out, RIG.to_dict(), {"a": FRAMES}, configuration={"seed": 1})
        assert contents(out) == before


def test_two_writers_exclude_each_other_and_parts_of_one_export_do_not(tmp_path) -> None:
    plan = DatasetPlan(RIG.to_dict(), (ScenePlan("a", 5),), OPTIONS)
    with DatasetFolder(tmp_path, plan):
        for part in (None, "0_of_2"):
            with (
                pytest.raises(OutputError, match="is in use: another export"),
                DatasetFolder(tmp_path, plan, part=part),
            ):
                pass
    with DatasetFolder(tmp_path, plan, part="0_of_2") as folder, DatasetFolder(tmp_path, plan, part="1_of_2"):
        with pytest.raises(OutputError, match="another export of the part 0_of_2"):
            DatasetFolder(tmp_path, plan, part="0_of_2").__enter__()
        with pytest.raises(OutputError, match="is in use"):
            DatasetFolder(tmp_path, plan).__enter__()
        with folder.shard("a", 0), pytest.raises(OutputError, match="another process makes shard 0 of a"):
            folder.shard("a", 0, lock_timeout=0.0).__enter__()
    with DatasetFolder(tmp_path, plan):
        pass


def test_depth_code_is_within_half_a_step() -> None:
    depth = np.geomspace(0.06, 1000.0, 20_001).astype(np.float32)
    again = decode_depth(encode_depth(depth, 1000.0), 1000.0)
    # half a step of the logarithm, and two float32 roundings of 6e-8
    bound = np.expm1(np.log(DEPTH_RATIO) / 65534 / 2) + 1.2e-7
    assert np.max(np.abs(again / depth - 1.0)) <= bound


def test_depth_code_of_nothing_too_near_and_too_far() -> None:
    code = encode_depth(np.array([np.inf, 1e-9, 1000.0, 2000.0], np.float32), 1000.0)
    assert code.tolist() == [0, 1, 65535, 65535]
    assert np.isinf(decode_depth(code, 1000.0)[0])


@pytest.mark.parametrize("layout", ["files", "packed"])
def test_depth_that_no_code_holds_comes_back_exactly(tmp_path, layout) -> None:
    """Of a fisheye, on both sides of its plane, and of a camera that sees to 5 km; one of 158 deg keeps the code."""
    lens, size = ss.KannalaBrandt(max_angle_deg=105.0), {"width": 24, "height": 16, "images": ("depth",)}
    specs = {
        "fish": CameraSpec(lens=lens, horizontal_fov_deg=200.0, **size),
        "far": CameraSpec(max_distance=5000.0, **size),
        "coded": CameraSpec(lens=lens, focal_length_px=10.5, **size),  # to 79 deg in the corners
    }
    rng = np.random.default_rng(0)
    depth = rng.normal(size=(16, 24)).astype(np.float32) ** 3
    depth[0, :3] = np.inf, 0.0, -0.01
    images = {"fish": depth, "far": np.abs(depth), "coded": np.abs(depth) + np.float32(0.06)}
    results = {name: ImageFrame(spec, Pose(), depth=images[name]) for name, spec in specs.items()}
    rig = Rig("eyes", tuple(SensorMount(name, "camera", spec, Pose()) for name, spec in specs.items()))
    frame = replace(FRAMES[0], results=results, objects=())
    options = StoreOptions(layout=layout)
    out = write_dataset(tmp_path / "out", rig.to_dict(), {"a": [frame]}, options=options)
    assert not list(verify(out).faults)
    dataset = open_dataset(out)
    again = dataset[0].to_frame().results
    for name in ("fish", "far"):
        np.testing.assert_array_equal(again[name].depth, images[name])
        assert dataset[0].image[name].depth.dtype == np.float32
    np.testing.assert_allclose(again["coded"].depth, images["coded"], rtol=7.7e-5)
    conventions = json.loads((out / "manifest.json").read_text())["conventions"]
    assert "negative behind the camera's plane" in conventions["depth of fish, far"]


def test_every_field_of_the_made_frame_is_there() -> None:
    """The round trip above is worth something only if no optional field is left out.

    Those of other radars are in tests/integration/test_interference_export.py: only a rig with interferers has them.
    The waveforms of a pulsed lidar are in tests/unit/test_pulsed_lidar.py.
    """
    results = FRAMES[0].results
    elsewhere = {"interference_hit", "interference_power", "waveform"}
    for name in ("front/camera", "front/lidar", "radar"):
        own = [item.name for item in fields(results[name]) if item.name not in elsewhere]
        assert all(getattr(results[name], item) is not None for item in own), name


def test_the_page_of_the_schema_is_up_to_date() -> None:
    page = Path(__file__).parents[2] / "docs" / "dataset.md"
    assert page.read_text(encoding="utf-8") == schema_page(), (
        "python -m scarl_sionna.dataset.schema_docs > docs/dataset.md"
    )


def test_the_manifest_is_typed_and_the_plain_data_that_it_was(tmp_path) -> None:
    write_dataset(tmp_path / "ds", RIG.to_dict(), {"lane": FRAMES[:3]})
    manifest = open_dataset(tmp_path / "ds").manifest
    plain = json.loads((tmp_path / "ds" / "manifest.json").read_text())
    del plain["checksum"]
    assert manifest == plain and json.loads(json.dumps(manifest)) == plain
    scene = manifest.scenes["lane"]
    assert (scene.num_frames, scene.split) == (plain["scenes"]["lane"]["num_frames"], plain["scenes"]["lane"]["split"])
    assert manifest.schema_version == plain["schema_version"] and manifest.storage.shard_frames == 3
    assert manifest.licence == plain["licence"] and manifest.configuration_hash == plain["configuration_hash"]
    assert [list(row) for row in manifest.shards["lane"]] == plain["shards"]["lane"]
    assert manifest.splits == plain["splits"] and manifest.calibration == plain["calibration"]
    again = pickle.loads(pickle.dumps(manifest))
    assert again == manifest and again.scenes["lane"].num_frames == 3
