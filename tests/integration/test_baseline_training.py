"""The baseline from an exported dataset to detections: TensorFlow, two steps of training of each network."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import DatasetError, OutputError
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from tests.exports import PLACE, scene_file

pytestmark = [pytest.mark.slow, pytest.mark.own_process]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two frames of a drive to train on and two of one to test: a car ahead and a wall."""
    folder = tmp_path_factory.mktemp("baseline")
    radar = ss.RadarSpec().with_(bandwidth=375e6, num_chirps=16, num_samples=192)
    few = RadarSettings(method="raycast", raycast={"num_rays": 2000})
    camera = CameraSpec(width=64, height=36, samples_per_pixel=1, images=("rgb", "instance"))
    mounts = (
        SensorMount("front/camera", "camera", camera, PLACE),
        SensorMount("raycast/radar", "radar", radar, PLACE, few),
    )
    Rig("tiny", mounts).save(folder / "rig.yaml")
    scene = scene_file(folder)
    drives = [
        ScenarioSpec(scene=str(scene), rig=str(folder / "rig.yaml"), num_frames=2, seed=seed, name=name, split=split)
        for seed, (name, split) in enumerate([("a_s000000", "train"), ("a_s000001", "test")])
    ]
    ss.export(drives, folder / "data")
    return folder / "data"


def test_every_network_trains_and_answers(dataset, tmp_path) -> None:
    from examples.baseline.data import CAMERA, GRID, INPUTS, read_samples
    from examples.baseline.experiments import experiments, finished, run_experiments
    from examples.baseline.training import TrainingSettings, batches, detection_loss, train

    samples = read_samples(dataset)
    assert samples.methods == ("raycast",) and samples.splits.tolist() == ["train"] * 2 + ["test"] * 2
    assert samples.images.shape == (4, 36, 64, 3) and CAMERA == "front/camera"
    frame = ss.open_dataset(dataset)[0]
    car = next(item for item in frame.labels if item.name == "car")
    place = frame.radar["raycast/radar"].world_from_sensor.inverse().apply(car.world_from_box.position)
    np.testing.assert_allclose(samples.objects[0].places, [place[:2]])
    row, column = (int(value) for value in GRID.coordinates(samples.objects[0].places)[0])
    near = samples.maps["raycast"][0, row - 4 : row + 2, column - 1 : column + 2].max()
    assert near > 0.3  # the back of the car, 2 m nearer than its middle, is 20 dB above the noise and more

    chosen = [one for one in experiments(samples.methods, 1) if one.frames == "all"]
    assert [one.inputs for one in chosen] == list(INPUTS)
    done: list[str] = []
    for _ in range(2):  # the second time all is there
        run_experiments(samples, chosen, tmp_path / "out.jsonl", 2, done.append)
    outcomes = finished(samples, tmp_path / "out.jsonl", 2)
    assert len(done) == len(outcomes) == 3
    assert all(len(outcome.found) == 2 for outcome in outcomes)

    with pytest.raises(OutputError, match="another number of steps"):
        run_experiments(samples, chosen, tmp_path / "out.jsonl", 3)
    nothing = replace(samples, splits=np.full(len(samples), "train"))
    with pytest.raises(DatasetError, match="'test'"):
        run_experiments(nothing, chosen, tmp_path / "other.jsonl", 2)

    few, many = (TrainingSettings(num_steps=steps, batch_size=2, width=8) for steps in (1, 40))
    fed, wanted = next(batches(samples, np.arange(2), "map", "raycast", few))
    untrained, trained = (
        float(detection_loss(wanted, train(samples, np.arange(2), "map", "raycast", settings)(fed, training=True)))
        for settings in (few, many)
    )
    assert trained < 0.5 * untrained


def test_a_mirrored_frame_is_answered_mirrored(dataset) -> None:
    """The target of mirrored objects is the mirrored target; and image columns lie where the grid's cells do."""
    from examples.baseline.data import read_samples
    from examples.baseline.grid import Objects
    from examples.baseline.model import pixel_weights
    from examples.baseline.training import OUT_GRID, mirror, network_inputs, target

    samples = read_samples(dataset)
    there = Objects(np.array([[20.3, 1.0], [10.0, -3.3]]), np.array([0, 3]), np.ones(2))
    turned = Objects(there.places * (1.0, -1.0), there.kinds, there.scores)
    wanted, fed = target(there)[None].copy(), network_inputs(samples, [0], "points", "raycast")
    mirror(fed, wanted, 0)
    np.testing.assert_allclose(wanted[0], target(turned), atol=1e-6)
    np.testing.assert_allclose(fed["points"][0, :, 1], -samples.points["raycast"][0, :, 1])
    # a cell straight ahead at the camera's height lies in the middle of the image, one 45 deg to the left at its edge
    pixels, weights = pixel_weights(OUT_GRID, 0.8, (36, 64))
    rows, columns = np.divmod(pixels, 64)
    place = np.stack([np.sum(weights * columns, axis=1) + 0.5, np.sum(weights * rows, axis=1) + 0.5], axis=1)
    x, y = OUT_GRID.centers().reshape(-1, 2).T
    inside = weights.sum(axis=1) > 0.999
    np.testing.assert_allclose(place[inside, 0], np.clip(32.0 - 32.0 * (y / x)[inside], 0.5, 63.5), atol=1e-3)
    np.testing.assert_allclose(place[inside, 1], 18.0, atol=1e-3)
    assert (weights.sum(axis=1)[np.abs(y) > 1.02 * x] == 0).all()
