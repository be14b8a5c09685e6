"""A drive past a body that bends: exported by any number of workers, simulated alone, and stepped in a session."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from examples.breathing_person import BREATH, BREATHS, write_person
from scarl_sionna.batch import ExportSettings, export
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.dataset import StoreOptions, open_dataset
from scarl_sionna.dataset.verify import verify
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.simulation import load_world, observe
from tests.exports import PLACE, RIG, contents, scene_file
from tests.frames import assert_same

TEXT = """\
scene: synthetic.xml
rig: rig.yaml
name: past
num_frames: 3
frame_rate: 5.0
seed: 4
actors:
  - name: person
    body: {file: person.glb, smooth: true, materials: {"*": clothed_skin}}
    trajectory: {kind: static, position: [16.0, 3.0, 0.0], yaw_deg: 180.0}
keep_default_actors: true
"""
RADAR = ss.RadarSpec().with_(num_chirps=8, num_samples=64)
BODIES = SensorMount("front/bodies", "radar", RADAR, PLACE, RadarSettings.of("sbr", instances=("person",)))
PAST = Rig("past", (*RIG.sensors, BODIES))


@pytest.fixture(scope="module")
def spec(tmp_path_factory) -> ScenarioSpec:
    folder = tmp_path_factory.mktemp("past")
    scene_file(folder).rename(folder / "synthetic.xml")
    write_person(folder / "person.glb")
    PAST.save(folder / "rig.yaml")
    (folder / "past.yaml").write_text(TEXT)
    return ScenarioSpec.load(folder / "past.yaml")


def exported(spec: ScenarioSpec, out: Path, workers: int) -> Path:
    made = export([spec], out, ExportSettings(workers=workers, options=StoreOptions(shard_frames=2)))
    assert (made.num_made, made.failed) == (3, {})
    return out


@pytest.fixture(scope="module")
def alone(spec, tmp_path_factory) -> Path:
    return exported(spec, tmp_path_factory.mktemp("alone") / "out", 0)


@pytest.mark.some(1)
@pytest.mark.parametrize("workers", [2, 1])
def test_workers_give_the_same_bytes(spec, alone, tmp_path, workers) -> None:
    assert contents(exported(spec, tmp_path / "out", workers)) == contents(alone)


def test_the_dataset_holds_what_observe_gives(spec, alone) -> None:
    assert verify(alone).complete
    world = load_world(spec)
    assert world.actor("person").bending is not None
    dataset = open_dataset(alone)
    for index in (2, 0):  # another order than the export's
        direct = observe(world, PAST, spec.times[index], spec.seed, index=index)
        stored = dataset.scene("past").frame(index).to_frame()
        assert_same(stored.results["front/lidar"], direct.results["front/lidar"])
        for name in ("front/radar", "front/bodies"):
            assert_same(stored.radars[name].adc_int, direct.radars[name].adc_int)
        assert_same(stored.objects, direct.objects)


def test_its_motion_is_in_the_frames(spec, alone) -> None:
    """The forearm waves: the tight box of the track follows it, and the stored lidar has the velocity of the chest."""
    dataset, world = open_dataset(alone), load_world(spec)
    sizes = []
    for index, time in enumerate(spec.times):
        frame = dataset.scene("past").frame(index).to_frame()
        (person,) = (item for item in frame.objects if item.name == "person")
        sizes.append(person.tight_size)
        chest = world.at(time).cast([10.0, 3.0, 1.1], [[1.0, 0.0, 0.0]])
        rate = BREATH * 2.0 * np.pi * BREATHS * np.cos(2.0 * np.pi * BREATHS * time)
        np.testing.assert_allclose(chest.velocity, [[-rate, 0.0, 0.0]], atol=1e-6)
        assert frame.radars["front/bodies"].num_paths > 0
    assert np.ptp(np.array(sizes), axis=0).max() > 0.05


def test_a_session_keeps_the_body(spec) -> None:
    """Told where the actors of the scenario are, it gives the frames of the scenario: the file still bends the body."""
    world = load_world(spec)
    with ss.Session(world, PAST, ss.SessionSettings(seed=spec.seed)) as session:
        for index, time in enumerate(spec.times[:2]):
            state = world.at(time)
            poses = {
                actor.name: ss.ActorPose(state.actor_pose(actor.name), state.actor_twist(actor.name))
                for actor in world.actors
            }
            mine = session.step(time, poses)
            assert session.world.actor("person").bending is not None
            direct = observe(world, PAST, time, spec.seed, index=index)
            for name, result in direct.results.items():
                for field, value in vars(result).items():
                    if isinstance(value, np.ndarray):
                        assert_same(getattr(mine.results[name], field), value, f"{name}.{field}")
            assert repr(mine.objects) == repr(direct.objects)
