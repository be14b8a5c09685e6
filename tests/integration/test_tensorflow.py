"""What needs TensorFlow, in one process: TFRecord files, two pages of the docs, a Keras model with the simulation."""

from __future__ import annotations

import importlib.util
import re
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scarl_sionna.calibration import CalibrationProblem, ForwardModel, FreeParameter, SlabMeasurement
from scarl_sionna.calibration.keras_layer import simulation_layer, whitened_data
from scarl_sionna.core.errors import DatasetError, ParameterRangeError, ScarlWarning
from scarl_sionna.dataset import write_dataset
from scarl_sionna.dataset.formats import FrameSource, convert
from scarl_sionna.dataset.formats.source import SceneFrames
from scarl_sionna.dataset.formats.tfrecord import export_tfrecord, read_tfrecord
from scarl_sionna.dataset.readers.tf_data import tensorflow
from tests.drive import AllFrames, drive, with_labels

pytestmark = [
    pytest.mark.own_process,
    pytest.mark.skipif(importlib.util.find_spec("tensorflow") is None, reason="needs the extra [tensorflow]"),
]
DOCS = Path(__file__).resolve().parents[2] / "docs"
SOURCE = drive(num_frames=4, ends=("front",), scenes=("highway",))
DRIVE = drive(num_frames=3, ends=("front",), scenes=("lane", "street"))
FRAMES = AllFrames(DRIVE)
RADAR, CAMERA, LIDAR = "front_center/radar", "front_center/camera", "front_center/lidar"


# -- TFRecord ----------------------------------------------------------------------------------------------------------


@pytest.mark.some(1)
@pytest.mark.parametrize("compression", ["", "GZIP"])
def test_tfrecord_comes_back_as_it_was(tmp_path, compression) -> None:
    items = {
        "adc": f"{RADAR}:adc",
        "rgb": f"{CAMERA}:rgb",
        "points": f"{LIDAR}:points",
        "boxes": "boxes",
        "t": "timestamp_ns",
    }
    export_tfrecord(DRIVE, tmp_path / "out", items, frames_per_file=2, compression=compression)
    names = sorted(path.name for path in (tmp_path / "out").glob("*.tfrecord"))
    assert names[:2] == ["lane-00000-of-00002.tfrecord", "lane-00001-of-00002.tfrecord"]
    found = list(read_tfrecord(tmp_path / "out"))
    assert len(found) == 6
    for item, frame in zip(found, FRAMES, strict=True):
        np.testing.assert_array_equal(item["adc"].numpy(), frame.results[RADAR].adc)
        np.testing.assert_array_equal(item["rgb"].numpy(), frame.results[CAMERA].rgb)
        np.testing.assert_array_equal(item["points"].numpy()[:, :3], frame.results[LIDAR].position)
        assert item["boxes"].shape == (3, 10)
        assert int(item["t"]) == frame.timestamp_ns
    batch = next(iter(read_tfrecord(tmp_path / "out", ["street"], batch_size=3)))
    assert batch["adc"].shape == (3, *FRAMES[0].results[RADAR].adc.shape)
    assert batch["points"].row_lengths().numpy().tolist() == [f.results[LIDAR].num_points for f in FRAMES[3:]]


def test_scenes_of_more_and_fewer_objects_are_one_conversion(tmp_path) -> None:
    """Cameras label each object of a frame; what does differ from scene to scene is named."""
    whole = with_labels(FRAMES[0])
    fewer = with_labels(replace(FRAMES[3], objects=FRAMES[3].objects[:2]))
    export_tfrecord(FrameSource(DRIVE.rig, [SceneFrames("a", [whole]), SceneFrames("b", [fewer])]), tmp_path / "out")
    found = [item[f"{CAMERA}:object_box"].shape for item in read_tfrecord(tmp_path / "out")]
    assert found == [(4, 4), (2, 4)]
    image = whole.results[CAMERA]
    other = replace(whole, results={**whole.results, CAMERA: replace(image, depth=image.depth[:, :80])})
    with pytest.raises(DatasetError, match=rf"scene b has float32 \(90, 80\) as '{CAMERA}:depth', .* \(90, 160\)"):
        export_tfrecord(FrameSource(DRIVE.rig, [SceneFrames("a", [whole]), SceneFrames("b", [other])]), tmp_path / "no")


def test_tfrecord_bad_input(tmp_path) -> None:
    with pytest.raises(ParameterRangeError, match="frames_per_file"):
        export_tfrecord(DRIVE, tmp_path / "out", frames_per_file=0)
    with pytest.raises(ParameterRangeError, match="no frames"):
        export_tfrecord(FrameSource(DRIVE.rig, []), tmp_path / "out")
    with pytest.raises(DatasetError, match="dataset_info"):
        read_tfrecord(tmp_path)
    export_tfrecord(DRIVE, tmp_path / "out", ["boxes"])
    with pytest.raises(DatasetError, match="no scene 'avenue'"):
        read_tfrecord(tmp_path / "out", ["avenue"])
    info = tmp_path / "out" / "dataset_info.json"
    text = info.read_text()
    info.write_text(text.replace('"format_version": 1', '"format_version": 9'))
    with pytest.raises(DatasetError, match="update scarl-sionna"):
        read_tfrecord(tmp_path / "out")
    info.write_text(text)
    (tmp_path / "out" / "lane-00000-of-00001.tfrecord").unlink()
    with pytest.raises(DatasetError, match="is not there"):
        read_tfrecord(tmp_path / "out")


# -- docs/reading.md and docs/formats.md run as they are printed -------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the dataset and the conversions that the pages name."""
    root = tmp_path_factory.mktemp("docs")
    write_dataset(root / "out", SOURCE.rig, {"highway": list(SOURCE.scenes[0])})
    for form, name in (("dca1000", "cap"), ("hdf5", "drive.h5")):
        convert(root / "out", form, root / name)
    convert(root / "out", "webdataset", root / "wds", frames_per_file=2)
    convert(root / "out", "tfrecord", root / "tfr", items=["boxes", "timestamp_ns"])
    return root


def blocks(page: str) -> list[str]:
    """Return the Python blocks of a page; the drive of the tests has one camera for all images."""
    text = (DOCS / page).read_text(encoding="utf-8")
    text = text.replace("front_center/rgb:", "front_center/camera:").replace(
        "front_center_rgb_rgb", "front_center_camera_rgb"
    )
    return re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)


def run(page: str, names: dict[str, Any], without: tuple[str, ...]) -> dict[str, Any]:
    """Run the blocks of a page one after the other, without those that need a package of another environment."""
    for number, block in enumerate(blocks(page)):
        if any(package in block for package in without):
            continue
        exec(compile(block, f"{page}, block {number}", "exec"), names)
    return names


def test_reading(folder, monkeypatch) -> None:
    monkeypatch.chdir(folder)
    without = () if importlib.util.find_spec("torch") else ("torch",)
    names = run("reading.md", {"__name__": "docs"}, without)
    assert names["samples"][0]["map"].shape == (64, 128)
    assert len(names["near"]) and set(names["near"].instance) <= {2, 3}
    assert names["batch"]["adc"].shape[0] == 2
    assert names["first"].shape == (192, 128)
    assert np.isfinite(names["network"].count_params())


def test_formats(folder, monkeypatch) -> None:
    monkeypatch.chdir(folder)
    tf = tensorflow()
    record = next(iter(tf.data.TFRecordDataset(str(folder / "tfr" / "highway-00000-of-00001.tfrecord"))))
    without = ("nuscenes",) if importlib.util.find_spec("webdataset") else ("nuscenes", "webdataset")
    names = run("formats.md", {"tf": tf, "record": record}, without)
    if "pairs" in names:
        assert sorted(len(boxes) for _, boxes in names["pairs"]) == [3] * 4
    frame = SOURCE.scenes[0].frames
    np.testing.assert_allclose(names["adc"], frame[3].radars["front_center/radar"].adc, rtol=1e-5)
    np.testing.assert_array_equal(names["points"], frame[3].lidars["front_center/lidar"].position)
    assert names["boxes"].shape == (3, 10)
    assert names["spectrum"][1].shape == (128, 12, 64)


# -- A Keras model with the simulation inside --------------------------------------------------------------------------


ANGLES = tuple(np.linspace(0.0, 75.0, 8))


@pytest.fixture(scope="module")
def model() -> ForwardModel:
    free = [
        FreeParameter(name="asphalt.relative_permittivity", lower=2.0, upper=8.0),
        FreeParameter(name="asphalt.conductivity", lower=0.1, upper=6.0),
    ]
    specs = [
        SlabMeasurement(
            name=mode,
            material="asphalt",
            polarization=mode,
            angle_deg=ANGLES,
            values=(0.0,) * 8,
            noise=0.02,
            form="amplitude",
        )
        for mode in ("TE", "TM")
    ]
    return ForwardModel(CalibrationProblem(parameters=free, measurements=specs))


def test_gradient_of_the_layer(model: ForwardModel) -> None:
    tf = tensorflow()
    layer = simulation_layer(model)
    units, weights = tf.constant([[0.3, 0.4], [0.7, 0.2]]), tf.constant(np.linspace(-1, 1, 16)[None], tf.float32)
    with tf.GradientTape() as tape:
        tape.watch(units)
        total = tf.reduce_sum(layer(units) * weights)
    slope = tape.gradient(total, units).numpy()
    numeric = np.zeros((2, 2))

    def value(row: int, column: int, step: float) -> float:
        point = units.numpy()[row].astype(np.float64)
        point[column] += step
        point = model.lower + model.span * point
        parts = [model.predict(item, point) / item.sigma for item in model.channels]
        return float(np.concatenate(parts) @ np.linspace(-1, 1, 16))

    for row, column in np.ndindex(2, 2):
        numeric[row, column] = (value(row, column, 1e-4) - value(row, column, -1e-4)) / 2e-4
    np.testing.assert_allclose(slope, numeric, rtol=1e-3)


def test_what_the_layer_is_not_given(model: ForwardModel) -> None:
    """One vector would be taken as a batch of lone parameters; beyond the bounds a material may be impossible."""
    tf = tensorflow()
    layer = simulation_layer(model)
    for shape in ((2,), (3, 1), (3, 5), (1, 2, 2)):
        with pytest.raises(ValueError, match="incompatible with the layer"):
            layer(tf.zeros(shape))
    with warnings.catch_warnings():
        warnings.simplefilter("error", ScarlWarning)
        layer(tf.constant([[0.0, 1.0]]))
    with pytest.warns(ScarlWarning, match=r"asphalt\.conductivity \(by 0\.25\)"):
        layer(tf.constant([[0.5, 0.5], [0.5, 1.25]]))


def test_an_encoder_learns_to_invert_the_simulation(model: ForwardModel) -> None:
    """A network reads permittivity and loss from measured curves.

    It sees curves only, the layer turns its guess into them.
    """
    tf = tensorflow()
    tf.keras.utils.set_random_seed(1)
    rng = np.random.default_rng(1)
    truth = rng.uniform(0.1, 0.9, (48, 2))
    layer = simulation_layer(model)
    curves = layer(tf.constant(truth, tf.float32)).numpy()
    inputs = tf.keras.Input((16,))
    scaled = tf.keras.layers.Rescaling(0.1)(inputs)
    hidden = tf.keras.layers.Dense(24, "tanh")(scaled)
    guess = tf.keras.layers.Dense(2, "sigmoid", name="guess")(hidden)
    network = tf.keras.Model(inputs, layer(guess))
    network.compile(tf.keras.optimizers.Adam(0.02), "mse")
    history = network.fit(curves, curves, batch_size=16, epochs=20, verbose=0).history["loss"]
    assert history[-1] < 0.1 * history[0]
    guessed = tf.keras.Model(inputs, guess)(curves).numpy()
    before = np.sqrt(np.mean((truth[:, 0] - truth[:, 0].mean()) ** 2))
    assert np.sqrt(np.mean((guessed[:, 0] - truth[:, 0]) ** 2)) < 0.4 * before  # it never saw the permittivity itself


def test_target_of_the_loss_is_the_data(model: ForwardModel) -> None:
    assert whitened_data(model).shape == (16,)
