"""The configuration of a dataset holds all that decides its frames: another value, another hash.

Another folder, the same.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import trimesh

from scarl_sionna.batch.plan import plan_export, scene_configuration
from scarl_sionna.dataset.encoding import StoreOptions
from scarl_sionna.dataset.store.manifest import hash_of as hash_of_plan
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from tests.exports import RIG
from tests.lane_scene import lane_scene

TABLE = "id,time,x,y,z\n" + "".join(f"t,{t},{10.0 * t - 100.0},7.0,0.0\n" for t in range(6))
TEXT = """\
scene: synthetic.xml
num_frames: 4
ego:
  trajectory: {kind: route, lanes: [east], start: 100, speed: 8}
actors:
  - name: a
    model: suv
    trajectory: {kind: route, lanes: [east_2], start: 40, speed: 8, events: [{kind: brake, time: 0.1}]}
  - name: cone
    mesh: {file: cone.ply, semantic: Static, materials: {"*": plastic}}
    trajectory: {kind: static, parking: 1}
  - name: t
    model: van
    trajectory: {kind: table, file: drive.csv}
traffic: {density: 3, mix: {small_car: 1}, seed: 2}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("hash")
    lane_scene(folder)
    (folder / "drive.csv").write_text(TABLE)
    trimesh.creation.box((0.5, 0.5, 0.8)).apply_translation((0.0, 0.0, 0.4)).export(folder / "cone.ply")
    (folder / "drive.yaml").write_text(TEXT)
    return folder


@pytest.fixture(scope="module")
def base(folder) -> ScenarioSpec:
    return ScenarioSpec.load(folder / "drive.yaml")


@pytest.fixture(scope="module")
def configuration(base) -> dict:
    return scene_configuration(base)


CHANGES = [
    {"seed": 1},
    {"name": "x"},  # noise is drawn by it
    {"noise_of": "y"},
    {"frame_rate": 11.0},
    {"start_time": 0.1},
    {"detail": "light"},
    {"lighting": "night"},
    {"lighting": {"preset": "night", "cloud_cover": 0.5}},
    {"weather": "rain"},
    {"weather": {"rain_rate": 3.0}},
    {"keep_default_actors": True},
    {"springs": False},
    {"randomization": {"colors": True}},
    {"randomization": {"materials": True}},
    {"randomization": {"placements": True}},
    {"randomization": {"placements": {"along": 1.0}}},
    {"randomization": {"traffic": False}},
    {"traffic.density": 4.0},
    {"traffic.mix": {"small_car": 1, "van": 1}},
    {"traffic.pedestrians": 1},
    {"traffic.parked": 0.5},
    {"traffic.seed": 3},
    {"ego": {"model": "van", "trajectory": {"kind": "route", "lanes": ["east"], "start": 100, "speed": 8}}},
    {"ego": {"variant": "red", "trajectory": {"kind": "route", "lanes": ["east"], "start": 100, "speed": 8}}},
    {"ego": {"detail": "light", "trajectory": {"kind": "route", "lanes": ["east"], "start": 100, "speed": 8}}},
    {"ego": {"trajectory": {"kind": "route", "lanes": ["east"], "start": 100, "speed": 9}}},
    {"actor.name": "b"},
    {"actor.model": "van"},
    {"actor.variant": "white"},
    {"actor.colors": {"paint": [0.1, 0.2, 0.3]}},
    {"actor.detail": "light"},
    {"actor.trajectory": {"kind": "route", "lanes": ["east_2"], "start": 40, "speed": 8}},
    {"actor.trajectory": {"kind": "static", "parking": 0}},
    {"mesh.semantic": "Pole"},
    {"mesh.scale": 1.1},
    {"mesh.materials": {"*": "metal"}},
]


def changed(base: ScenarioSpec, change: dict) -> ScenarioSpec:
    """Return the scenario with a field of its own, of its traffic or of its first actor changed."""
    ((key, value),) = change.items()
    head, _, name = key.partition(".")
    if head == "traffic" and name:
        return base.with_(traffic=base.traffic.with_(**{name: value}))
    if head == "actor":
        return base.with_(actors=(base.actors[0].with_(**{name: value}), *base.actors[1:]))
    if head == "mesh":
        cone = base.actors[1].with_(mesh=base.actors[1].mesh.with_(**{name: value}))
        return base.with_(actors=(base.actors[0], cone, base.actors[2]))
    return base.with_(**change)


def test_every_field_that_decides_frames_changes_it(base, configuration) -> None:
    """Each change of the scenario without its traffic, which takes half of the time, but for those of the traffic."""
    bare, changes = base.with_(traffic=None), [{}, {"traffic": None}, *CHANGES]
    found = [configuration, scene_configuration(bare)]
    found += [scene_configuration(changed(base if "traffic" in str(change) else bare, change)) for change in CHANGES]
    for index, one in enumerate(found):
        same = [number for number, other in enumerate(found) if other == one and number != index]
        assert not same, (changes[index], [changes[number] for number in same])


@pytest.mark.parametrize(
    "change",
    [
        {"noise_of": "drive"},  # the name of its file
        {"split": "test"},
        {"collisions": "allow"},
        {"num_frames": 3},
        {"quality": "full"},
        {"rig": "scarl"},
    ],
)
def test_what_does_not_decide_the_frames_does_not(base, configuration, change) -> None:
    assert scene_configuration(base.with_(**change)) == configuration


def test_the_folder_does_not_matter_and_the_files_do(folder, configuration, tmp_path) -> None:
    other = tmp_path / "elsewhere"
    shutil.copytree(folder, other)
    spec = ScenarioSpec.load(other / "drive.yaml")
    assert scene_configuration(spec) == scene_configuration(spec.resolved()) == configuration
    (other / "drive.csv").write_text(TABLE.replace("7.0", "7.1"))
    table = scene_configuration(spec)
    assert table != configuration
    trimesh.creation.box((0.5, 0.6, 0.8)).apply_translation((0.0, 0.0, 0.4)).export(other / "cone.ply")
    mesh = scene_configuration(spec)
    assert mesh != table
    toml = other / "scene.toml"
    toml.write_text(toml.read_text() + "\n[[parking]]\nposition = [42.0, -4.0, 0.0]\n")
    assert scene_configuration(spec) != mesh


def test_no_paths_stand_in_it(folder, configuration) -> None:
    assert str(folder) not in str(configuration) and "drive.csv" not in str(configuration)


def test_a_plain_scenario_has_the_configuration_it_always_had(folder) -> None:
    plain = scene_configuration(ScenarioSpec(scene=str(folder / "synthetic.xml")))
    assert set(plain) == {"scene", "scene_files", "start_time", "frame_rate", "seed", "noise_of"}


def test_the_hash_of_a_plan(base, folder, monkeypatch) -> None:
    rig = folder / "rig.yaml"
    RIG.save(rig)
    monkeypatch.chdir("/")  # everything is found beside the scenario's file

    def hash_of(spec: ScenarioSpec) -> str:
        return hash_of_plan(plan_export([spec.with_(rig="rig.yaml")], StoreOptions()).dataset.configuration)

    first = hash_of(base)
    assert first == hash_of(base) != hash_of(base.with_(weather="fog"))
