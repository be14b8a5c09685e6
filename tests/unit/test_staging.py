"""Actor models put into a scene are the same bodies as actors written in it by hand, and cost no BSDF twice."""

from __future__ import annotations

import copy
import pickle
import shutil
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import InputTypeError, MaterialError, ParameterRangeError, SceneError, UnknownNameError
from scarl_sionna.scene.actors.model import actor_names, read_actor_model
from scarl_sionna.scene.document.find import find_scene
from scarl_sionna.scene.document.scene_file import read_document
from scarl_sionna.scene.document.staging import StagedActor, stage
from scarl_sionna.scene.motion.trajectory import Trajectory, trajectory_from_table
from tests.scenes import Thing, plane, write_scene

TABLE = {
    "kind": "constant_twist",
    "position": [3.0, 1.0, 0.0],
    "velocity": [2.0, 0.3, 0.0],
    "yaw_deg": 7.0,
    "angular_velocity_z": 0.2,
}
TOML = (
    'kind = "constant_twist"\nposition = [3.0, 1.0, 0.0]\nvelocity = [2.0, 0.3, 0.0]\nyaw_deg = '
    "7.0\nangular_velocity_z = 0.2\n"
)
"""The same motion for `trajectory_from_table` and in a scene.toml."""


def drive() -> Trajectory:
    return trajectory_from_table(TABLE, "test")


def street(folder: Path) -> Path:
    return write_scene(folder, instances=[Thing("ground", plane(200.0, 200.0), "Roads")])


def _toml(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)


def by_hand(folder: Path, model: str, detail: str) -> Path:
    """Write the street with a model's shapes, materials and joints in its own files."""
    path = street(folder)
    source = read_actor_model(model)
    suffix = "_light" if detail == "light" else ""
    actor = ET.parse(source.path.parent / f"{model}{suffix}.xml").getroot()
    whole = ET.parse(path)
    for element in actor:
        own = copy.deepcopy(element)
        own.set("id", f"car_{element.get('id')}")
        for child in own.iter("string"):
            child.set("value", str(source.path.parent / str(child.get("value"))))
        for child in own.iter("ref"):
            child.set("id", f"car_{child.get('id')}")
        whole.getroot().append(own)
    whole.write(path)
    lines = [
        "",
        "[[actors]]",
        'name = "car"',
        f'class = "{source.semantic}"',
        'shapes = ["car_*"]',
        "[actors.trajectory]",
        TOML,
    ]
    shapes = source.level(detail).shapes
    for joint in source.joints:
        table = {**joint}
        if "shapes" in table:
            table["shapes"] = [f"car_{shape}" for shape in table["shapes"] if shape in shapes]
            if not table["shapes"]:
                continue
        lines += ["[[actors.joints]]", *(f"{key} = {_toml(value)}" for key, value in table.items())]
    for bsdf, entry in source.materials.items():
        if bsdf in source.level(detail).bsdfs:
            lines += [
                f"[materials.car_{bsdf}]",
                f'radio = "{entry.radio}"',
                f"lidar_reflectance = {entry.lidar_reflectance!r}",
            ]
    toml = path.parent / "scene.toml"
    toml.write_text(toml.read_text() + "\n".join(lines))
    return path


def rays() -> np.ndarray:
    generator = np.random.default_rng(3)
    targets = generator.uniform([0.0, -1.0, 0.0], [8.0, 3.0, 2.0], (4000, 3))
    directions = targets - EYE
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


EYE = np.array([-6.0, -5.0, 2.5])


@pytest.mark.parametrize(("model", "detail"), [("saloon", "light"), ("adult_man", "light"), ("bicycle", "detailed")])
def test_a_staged_actor_is_the_same_body_as_one_written_by_hand(tmp_path, model, detail):
    hand = ss.load_scene(by_hand(tmp_path / "hand", model, detail))
    staged = ss.stage(
        street(tmp_path / "street"), [StagedActor("car", read_actor_model(model), drive(), detail=detail)]
    )
    assert staged.parts.name == hand.parts.name
    assert staged.parts.material == hand.parts.material
    np.testing.assert_array_equal(staged.parts.lidar_reflectance, hand.parts.lidar_reflectance)
    np.testing.assert_array_equal(staged.parts.semantic, hand.parts.semantic)
    for time in (0.0, 0.37):
        ours, theirs = staged.at(time), hand.at(time)
        (box,), (expected,) = ([one for one in state.boxes() if one.name == "car"] for state in (ours, theirs))
        np.testing.assert_array_equal(box.size, expected.size)
        np.testing.assert_array_equal(box.world_from_box.position, expected.world_from_box.position)
        np.testing.assert_array_equal(box.twist.linear, expected.twist.linear)
        for twin in ("optical", "radio"):
            hits, known = (state.cast(EYE, rays(), twin=twin) for state in (ours, theirs))
            assert np.count_nonzero(known.part > 0) > 200  # the actor is hit, not the ground alone
            for name, column in vars(known).items():
                assert getattr(hits, name).tobytes() == column.tobytes(), name


def test_alike_bsdfs_are_one_and_colours_make_another(tmp_path):
    saloon = read_actor_model("saloon")
    variants = list(saloon.variants)
    actors = [StagedActor(f"a{n}", saloon, drive(), "light", variants[n % 2]) for n in range(6)]
    document = stage(
        read_document(street(tmp_path)),
        [*actors, StagedActor("own", saloon, drive(), "light", colors={"paint": (0.1, 0.2, 0.3)})],
    )
    paints = {document.bsdf_of_shape[f"{name}_body"] for name in ("a0", "a1", "own")}
    assert len(paints) == 3
    assert document.bsdf_of_shape["a4_body"] == document.bsdf_of_shape["a0_body"]
    rest = {bsdf for shape, bsdf in document.bsdf_of_shape.items() if shape.startswith(("a1_", "own_"))} - paints
    assert rest <= {bsdf for shape, bsdf in document.bsdf_of_shape.items() if shape.startswith("a0_")}
    ids = [element.get("id") for element in document.root if element.tag == "bsdf"]
    assert len(ids) == len(set(ids))
    own = next(e for e in document.root if e.get("id") == document.bsdf_of_shape["own_body"])
    assert [e.get("value") for e in own.iter("rgb")] == ["0.1 0.2 0.3"]


def test_models_share_the_bsdfs_that_they_have_in_common(tmp_path):
    document = read_document(street(tmp_path))
    cars = [StagedActor(name, read_actor_model(name), drive(), "light") for name in ("saloon", "suv", "van")]
    one = len(stage(document, cars[:1]).materials) - len(document.materials)
    assert len(stage(document, cars).materials) - len(document.materials) < 2 * one


def test_radio_materials_of_an_actor_replace_those_of_its_model(tmp_path):
    saloon = read_actor_model("saloon")
    actors = [
        StagedActor("metal", saloon, drive(), "light", radio={"paint": "metal"}),
        StagedActor("plain", saloon, drive(), "light"),
    ]
    document = stage(read_document(street(tmp_path)), actors)
    radio = {name: document.materials[document.bsdf_of_shape[f"{name}_body"]].radio for name in ("metal", "plain")}
    assert radio == {"metal": "metal", "plain": "car_paint"}


def test_a_scene_toml_names_models(tmp_path):
    path = street(tmp_path)
    toml = path.parent / "scene.toml"
    toml.write_text(
        toml.read_text().replace('name = "synthetic"', 'name = "synthetic"\nego = "ego"')
        + f'\n[[actors]]\nname = "ego"\nmodel = "saloon"\nvariant = "red"\n[actors.trajectory]\n{TOML}'
        + '\n[[actors]]\nname = "walker"\nmodel = "child"\ndetail = "light"\nphase = '
        f"0.25\n[actors.trajectory]\n{TOML.replace('2.0, 0.3', '1.0, 0.1')}"
    )
    document = read_document(path, "light")
    again = stage(
        read_document(street(tmp_path / "other")),
        [
            StagedActor("ego", read_actor_model("saloon"), drive(), "light", "red"),
            StagedActor("walker", read_actor_model("child"), drive(), "light", phase=0.25),
        ],
        ego="ego",
    )
    assert document.ego == again.ego == "ego"
    assert document.bsdf_of_shape == again.bsdf_of_shape
    assert {path.parent.name for path in document.files} == {"saloon", "child"}
    assert len(read_document(path).bsdf_of_shape) > len(document.bsdf_of_shape)  # the saloon in detail
    walk = next(entry for entry in document.instances if entry.name == "walker").joints[0]
    assert walk.phase_offset == 0.25


def test_the_phase_moves_the_legs(tmp_path):
    child, path = read_actor_model("child"), street(tmp_path)
    slow = trajectory_from_table(
        {**TABLE, "velocity": [1.0, 0.0, 0.0], "yaw_deg": 0.0, "angular_velocity_z": 0.0}, "walker"
    )
    boxes = [
        ss.stage(path, [StagedActor("walker", child, slow, "light", phase=phase)]).at(0.0).boxes()[-1].tight_size[0]
        for phase in (0.0, 0.25)
    ]
    assert boxes[0] - boxes[1] > 0.1  # legs apart at the heel's strike, together in the middle of the step


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"name": "two words"}, ParameterRangeError, "letters"),
        ({"variant": "pink"}, UnknownNameError, "variant of actor model 'saloon'"),
        ({"detail": "coarse"}, UnknownNameError, "detail of actor 'car'"),
        ({"colors": {"pant": (0.1, 0.1, 0.1)}}, UnknownNameError, "did you mean 'paint'"),
        ({"colors": {"paint": (0.1, 0.1, 1.7)}}, ParameterRangeError, "0 to 1"),
        ({"colors": {"paint": "red"}}, ParameterRangeError, "three numbers"),
        ({"radio": {"pant": "metal"}}, UnknownNameError, "did you mean 'paint'"),
        ({"phase": float("nan")}, ParameterRangeError, "finite"),
        ({"trajectory": ss.Pose()}, InputTypeError, "a Pose, not a trajectory: it has no pose, twist, start, stop"),
        ({"model": "saloone"}, UnknownNameError, "did you mean 'saloon'"),
        ({"model": "models/tractor"}, SceneError, "no actor model lies here"),
    ],
)
def test_wrong_actors_are_told(change, error, words):
    with pytest.raises(error, match=words):
        StagedActor(**{"name": "car", "model": read_actor_model("saloon"), "trajectory": drive(), **change})


def test_wrong_scenes_are_told(tmp_path):
    document, saloon = read_document(street(tmp_path)), read_actor_model("saloon")
    car = StagedActor("car", saloon, drive(), "light")
    with pytest.raises(SceneError, match="two instances have the name 'car'"):
        stage(document, [car, car])
    with pytest.raises(SceneError, match="two instances have the name 'ground'"):
        stage(document, [StagedActor("ground", saloon, drive())])
    with pytest.raises(UnknownNameError, match="actor to carry the rig"):
        stage(document, [car], ego="bus")
    with pytest.raises(MaterialError, match="unobtainium"):
        ss.stage(
            tmp_path / "synthetic.xml", [StagedActor("car", saloon, drive(), "light", radio={"paint": "unobtainium"})]
        )
    toml = tmp_path / "scene.toml"
    toml.write_text(
        toml.read_text() + f'\n[[actors]]\nname = "car"\nmodel = "saloon"\nclass = "Bus"\n[actors.trajectory]\n{TOML}'
    )
    with pytest.raises(UnknownNameError, match="key of \\[\\[actors\\]\\] 'car'"):
        read_document(tmp_path / "synthetic.xml")


def test_staging_a_loaded_world_keeps_it_and_its_light(tmp_path):
    world = ss.load_scene(street(tmp_path)).with_lighting("dusk")
    staged = ss.stage(world, [StagedActor("car", read_actor_model("saloon"), drive(), "light")], ego="car")
    assert not world.actors
    assert staged.ego == "car"
    assert staged.lighting == world.lighting


def test_models_go_to_other_processes():
    model = pickle.loads(pickle.dumps(read_actor_model("bicycle")))
    assert set(model.level("light").shapes) == set(read_actor_model("bicycle").level("light").shapes)
    assert StagedActor("one", model, drive()).model.name == "bicycle"


def test_variants_and_details_of_scenes():
    assert find_scene("urban_crossing").parent.name.startswith("urban_crossing-v0-detailed-")
    with pytest.raises(UnknownNameError, match="detail"):
        find_scene("urban_crossing", detail="fine")
    with pytest.raises(ParameterRangeError, match="variant"):
        find_scene("urban_crossing", -1)
    with pytest.raises(ParameterRangeError, match="no variants"):
        find_scene("munich", 3)


def test_parts_that_do_not_move_are_not_written_again(tmp_path):
    """A second state costs the moving ones alone, and what is hit is the same as in a world that was just loaded."""
    parked = trajectory_from_table({"kind": "static", "position": [3.0, -2.0, 0.0]}, "parked")
    actors = [
        StagedActor("car", read_actor_model("saloon"), drive(), "light"),
        StagedActor("parked", read_actor_model("van"), parked, "light"),
    ]
    world, fresh = (ss.stage(street(tmp_path / name), actors) for name in "ab")
    for time in (0.0, 0.5, 1.0):
        world.at(time).cast(EYE, rays(), twin="radio")
    again, once = (one.at(0.25).cast(EYE, rays(), twin="radio") for one in (world, fresh))
    for name, column in vars(once).items():
        assert getattr(again, name).tobytes() == column.tobytes(), name


def test_all_models_can_be_named():
    assert {"saloon", "bus", "bicycle", "adult_woman", "child"} <= set(actor_names())


def test_an_edited_xml_of_a_model_is_read_anew(tmp_path):
    folder = tmp_path / "child"
    shutil.copytree(read_actor_model("child").path.parent, folder)
    file = folder / "child.xml"

    def color() -> str | None:
        return next(read_actor_model(folder).levels["detailed"].bsdfs["shoes"].iter("rgb")).get("value")

    assert color() == "0.6 0.6 0.58"
    file.write_text(file.read_text().replace("0.6 0.6 0.58", "0.1 0.2 0.3"))
    assert color() == "0.1 0.2 0.3"
