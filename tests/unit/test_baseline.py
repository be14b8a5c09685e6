"""The baseline's grid, targets and average precision, against values worked out by hand. No TensorFlow."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import scarl_sionna as ss
from examples.baseline import __main__ as command
from examples.baseline.data import FULL_SNR_DB, MOST_POINTS, VELOCITY_BINS, Samples, velocity_map
from examples.baseline.experiments import experiments, finished, training_rows
from examples.baseline.grid import CLASSES, HEAT_RADIUS, Objects, PolarGrid, decode, encode
from examples.baseline.methods import Seen, chosen_methods, strongest, table
from examples.baseline.metrics import average_precision, match, mean_precision, precision_table
from examples.baseline.outcomes import Experiment, MadeWith, Outcome, add_outcomes, read_outcomes
from examples.baseline.tables import Results, markdown
from scarl_sionna.core.errors import InputFileError, OutputError
from scarl_sionna.signal.angle import RangeDopplerAngle

GRID = PolarGrid(40, 24, 1.6, 0.75)


def objects(places: list[list[float]], kinds: list[int], scores: list[float] | None = None) -> Objects:
    values = np.ones(len(kinds)) if scores is None else np.array(scores)
    return Objects(np.array(places, float).reshape(-1, 2), np.array(kinds, int), values)


def test_a_place_has_its_range_and_sine() -> None:
    # 20 m away, 30 deg to the left: the sine is 0.5, so (0.5 + 0.75) / (1.5 / 24) = 20 cells from the right
    place = [20.0 * np.cos(np.pi / 6), 10.0]
    np.testing.assert_allclose(GRID.coordinates([place]), [[12.5, 20.0]])
    np.testing.assert_allclose(GRID.places([[12.5, 20.0]]), [place])
    assert GRID.inside([place, [-5.0, 0.0], [65.0, 0.0], [1.0, 5.0]]).tolist() == [True, False, False, False]
    assert GRID.max_range == 64.0 and GRID.coarser(2).sine_step == 2 * GRID.sine_step


def test_targets_are_heat_of_the_distance_and_offsets_in_the_cell() -> None:
    there = objects([[20.3, 1.0]], [3])
    heat, offset, holds = encode(GRID, there)
    row, column = (int(value) for value in GRID.coordinates(there.places)[0])
    assert (row, column) == (12, 12) and holds.sum() == 1 and holds[row, column] == 1
    assert heat[row, column, 3] == 1 and not heat[..., :3].any()
    np.testing.assert_allclose(offset[row, column], GRID.coordinates(there.places)[0] - (12, 12), atol=1e-6)
    center = GRID.places([[13.5, 12.5]])[0]  # the next cell along range
    expected = np.exp(-np.sum((center - there.places[0]) ** 2) / (2 * HEAT_RADIUS**2))
    assert heat[13, 12, 3] == pytest.approx(expected, rel=1e-5)


def test_what_is_encoded_is_decoded() -> None:
    there = objects([[20.3, 1.0], [40.0, -12.0], [8.0, 4.0], [30.0, 15.0]], [0, 1, 2, 3])
    heat, offset, _ = encode(GRID, there)
    found = decode(GRID, heat, offset, least_score=0.99)
    order = np.argsort(found.kinds)
    assert found.kinds[order].tolist() == [0, 1, 2, 3]
    np.testing.assert_allclose(found.places[order], there.places, atol=1e-4)  # float32 offsets of cells of 1.6 m


def test_neighbours_of_a_peak_are_no_detections_and_the_best_come_first() -> None:
    heat, offset = np.zeros((*GRID.shape, len(CLASSES)), np.float32), np.full((*GRID.shape, 2), 0.5, np.float32)
    heat[10, 10, 0], heat[10, 11, 0], heat[0, 0, 0], heat[20, 5, 2] = 0.5, 0.4, 0.3, 0.9
    found = decode(GRID, heat, offset, most=2)
    assert found.kinds.tolist() == [2, 0] and found.scores.tolist() == pytest.approx([0.9, 0.5])
    np.testing.assert_allclose(found.places[1], GRID.places([[10.5, 10.5]])[0], rtol=1e-6)


def test_average_precision_by_hand() -> None:
    """Right, wrong, right, of two objects.

    Precision is 1 below a recall of 0.5, 0.5 at it, then rises linearly to 2/3. Over recall 0.11 to 1: 39 values of
    0.9 above the least precision, one of 0.4, and 50 of 0.4 + k / 300; as a part of 0.9.
    """
    there = objects([[10.0, 0.0], [30.0, 0.0]], [0, 0])
    found = objects([[10.2, 0.0], [20.0, 0.0], [30.0, 0.3]], [0, 0, 0], [0.9, 0.8, 0.7])
    value = average_precision([match(found, there, 0)])
    expected = (39 * 0.9 + 0.4 + sum(0.4 + k / 300 for k in range(1, 51))) / 90 / 0.9
    np.testing.assert_allclose(value, [expected] * 4, rtol=1e-12)
    assert average_precision([match(there, there, 0)]) == pytest.approx(np.ones(4))  # the truth itself scores all
    assert average_precision([match(objects([], []), there, 0)]).tolist() == [0.0] * 4
    assert np.isnan(average_precision([match(found, objects([], []), 0)])).all()


def test_matches_take_the_best_first_and_no_object_twice() -> None:
    there = objects([[10.0, 0.0], [10.0, 3.0]], [0, 0])
    found = objects([[10.0, 1.4], [10.0, 0.0], [10.0, 0.1]], [0, 0, 0], [0.5, 0.9, 0.8])
    right = match(found, there, 0).right
    assert right[0].tolist() == [True, False, False]  # 0.5 m
    assert right[2].tolist() == [True, False, True]  # 2 m: the first object is taken, the second is 1.6 m away
    assert right[3].tolist() == [True, True, False]  # 4 m: the second best takes the other one
    assert match(found, there, 1).num_objects == 0
    near = match(found, objects([[10.0, 0.0], [25.0, 0.0]], [0, 0]), 0, 0.0, 20.0)
    assert near.num_objects == 1 and len(near.scores) == 3


def test_the_mean_is_over_classes_that_are_there() -> None:
    there, found = objects([[10.0, 0.0], [20.0, 0.0]], [0, 3]), objects([[10.0, 0.0]], [0], [0.5])
    assert mean_precision(precision_table([found], [there])) == pytest.approx(0.5)


def test_a_standing_world_is_in_the_first_group_whatever_the_vehicle_does() -> None:
    """An echo from 60 deg to the left closes at half of the vehicle's 10 m/s; a car ahead that keeps its distance."""
    radar = ss.RadarSpec()
    velocity, azimuth = (np.arange(64) - 32) * 0.5, np.arcsin(np.arange(-16, 16) / 16)
    data = np.full((64, 40, 32), 1e-12, np.float32)
    data[32 - 10, 10, 16 + 12] = 1e-6  # sine 0.75: cos is 0.66, own speed 6.6 m/s, here -5 m/s
    data[32 - 20, 20, 16] = 1e-6  # straight ahead, -10 m/s: stands
    data[32, 30, 16] = 1e-8  # straight ahead, no change of distance: as fast as the vehicle
    rda = RangeDopplerAngle(data, np.arange(40) * 0.8 + 0.4, velocity, azimuth, None, radar, None, 1e-12)  # type: ignore[arg-type]
    grid = PolarGrid(40, 24, 0.8, 0.75)
    found = velocity_map(rda, np.array([10.0, 0.0, 0.0]), grid)
    assert found.shape == (40, 24, len(VELOCITY_BINS))
    assert found[20, 12, 0] == pytest.approx(60.0 / FULL_SNR_DB) and found[20, 12, 1:].max() == 0
    assert found[30, 12, 5] == pytest.approx(40.0 / FULL_SNR_DB) and found[30, 12, :5].max() == 0
    still = velocity_map(rda, np.zeros(3), grid)
    assert still[30, 12, 0] == pytest.approx(40.0 / FULL_SNR_DB) and still[20, 12, 0] == 0


@pytest.fixture
def samples() -> Samples:
    drives = [f"town_s{seed:06d}" for seed in range(6) for _ in range(4)]
    weather = np.array(["clear", "clear", "rain", "rain"] * 6)
    splits = np.array(["test" if drive[-1] in "05" else "train" for drive in drives])
    maps = {"auto": np.zeros((24, 2, 2, 2), np.float16), "raycast": np.zeros((24, 2, 2, 2), np.float16)}
    points = {method: np.zeros((24, MOST_POINTS, 6), np.float32) for method in maps}
    there = [objects([[10.0 + row, 0.0], [30.0, 5.0]], [0, 3]) for row in range(24)]
    images = np.zeros((24, 2, 2, 3), np.uint8)
    return Samples(("auto", "raycast"), np.array(drives), weather, splits, maps, points, images, there)


def test_experiments_learn_from_the_frames_that_they_name(samples) -> None:
    assert len(training_rows(samples, "all", 0)) == 16
    assert set(samples.weather[training_rows(samples, "clear", 0)]) == {"clear"}
    one = [set(samples.drives[training_rows(samples, "one seed", run)]) for run in range(3)]
    assert one == [{"town_s000001"}, {"town_s000002"}, {"town_s000003"}]
    thinned = training_rows(samples, "three seeds, thinned", 1)
    assert len(thinned) == 4 and set(samples.drives[thinned]) == {"town_s000002", "town_s000003", "town_s000004"}
    assert len(training_rows(samples, "three seeds", 2)) == 12
    assert not set(samples.drives[samples.rows("test")]) & set(samples.drives[samples.rows("train")])
    assert all(one.method == "raycast" for one in experiments(("raycast",)))
    assert len(set(experiments(("auto", "raycast")))) == len(experiments(("auto", "raycast")))


MADE = MadeWith(steps=300, dataset="frames")


def test_tables_tell_what_networks_found(samples) -> None:
    test = samples.rows("test")
    perfect = [samples.objects[row] for row in test]
    cars = [some.chosen(some.kinds == 0) for some in perfect]
    outcomes = [
        Outcome(Experiment("map", method, "all", run), other, 16, 1.0, cars if method == "raycast" else perfect, MADE)
        for method in samples.methods
        for other in samples.methods
        for run in range(2)
    ]
    results = Results(samples, outcomes)
    auto, raycast = results.runs("map", "auto", "all"), results.runs("map", "raycast", "all", "auto")
    assert results.value(auto) == pytest.approx((1.0, 1.0, 1.0))
    assert results.value(raycast) == pytest.approx((0.5, 0.5, 0.5))
    assert results.value(raycast, kind=0, weather="rain") == pytest.approx((1.0, 1.0, 1.0))
    assert results.difference(auto, raycast) == pytest.approx((0.5, 0.5, 0.5))
    assert results.num_objects(0, (20.0, 40.0)) == sum(10 + row >= 20 for row in test)
    text = markdown(results)
    assert "| pedestrian, 20 to 40 m | 8 | 100 | - | - |" in text
    # trained and tested on auto, on raycast, trained on raycast and tested on auto, the other way; what auto is above
    assert "| map | all classes | 100 ± 0 | 50 ± 0 | 50 ± 0 | 100 ± 0 | 50 (50 to 50) |" in text
    assert "| map | car | 100 ± 0 | 100 ± 0 | 100 ± 0 | 100 ± 0 | 0 (0 to 0) |" in text
    assert "| map | car | 100 ± 0 | 100 ± 0 | - | - | - |" in text  # clear and rain, nothing trained on clear alone


def test_scatter_is_that_of_trainings(samples) -> None:
    perfect = [samples.objects[row] for row in samples.rows("test")]
    found = [perfect, [some.chosen(some.kinds == 0) for some in perfect], [objects([], []) for _ in perfect]]
    outcomes = [Outcome(Experiment("map", "auto", "all", run), "auto", 16, 1.0, found[run], MADE) for run in range(3)]
    results = Results(samples, outcomes)
    assert results.scatter([0, 1, 2]) == pytest.approx((0.5, 0.5))  # 1, 1/2 and 0
    assert results.scatter([0, 1], kind=0) == pytest.approx((1.0, 0.0))
    assert results.difference([0], [1], weather="rain") == pytest.approx((0.5, 0.5, 0.5))
    assert results.difference([0], [2], 0) == pytest.approx((1.0, 1.0, 1.0))
    assert np.isnan(results.scatter([0])[1])


def test_results_of_other_frames_are_refused_and_a_cut_line_does_not_count(samples, tmp_path) -> None:
    file, number = tmp_path / "outcomes.jsonl", len(samples.rows("test"))
    made_with = MadeWith(steps=300, dataset=samples.digest()).model_dump()
    about = {"num_frames": 16, "seconds": 2.0, "made_with": made_with}
    nothing = objects([], [])
    found = {"auto": [objects([[1.0, 2.0]], [3]), *[nothing] * (number - 1)], "raycast": [nothing] * number}
    assert finished(samples, file) == []
    add_outcomes(file, Experiment("map", "auto", "all", 1), about, found)
    line = file.read_text()
    file.write_text(line + line[:-5])
    outcomes = finished(samples, file, 300)
    assert [outcome.test_method for outcome in outcomes] == ["auto", "raycast"]
    assert outcomes[0].experiment == Experiment("map", "auto", "all", 1) and outcomes[0].found[0].kinds.tolist() == [3]
    with pytest.raises(OutputError, match="another number of steps"):
        finished(samples, file, 200)
    with pytest.raises(OutputError, match="other frames"):
        finished(replace(samples, weather=samples.weather[::-1].copy()), file)
    add_outcomes(file, Experiment("map", "auto", "all", 2), about, found)
    assert file.read_text().count("\n") == 2 and len(finished(samples, file)) == 4  # what was cut is gone
    add_outcomes(file, Experiment("map", "auto", "all", 3), about, {"auto": found["auto"][:-1]})
    with pytest.raises(OutputError, match="other frames"):
        finished(samples, file)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda line: line.pop("made_with"), "made_with"),
        (lambda line: line["made_with"].update(steps=0), "steps"),
        (lambda line: line["found"]["auto"][0].update(scores=[]), "0 scores"),
        (lambda line: line["found"]["auto"][0].update(kinds=[99]), "kinds"),
        (lambda line: line.update(found=[]), "found"),
    ],
)
def test_results_of_an_old_version_are_refused_with_their_line(change, told, tmp_path) -> None:
    file = tmp_path / "outcomes.jsonl"
    about = {"num_frames": 16, "seconds": 2.0, "made_with": MADE.model_dump()}
    for run in range(2):
        add_outcomes(file, Experiment("map", "auto", "all", run), about, {"auto": [objects([[1.0, 2.0]], [3])]})
    first, second = file.read_text().splitlines()
    changed = json.loads(second)
    change(changed)
    file.write_text(f"{first}\n{json.dumps(changed)}\n")
    with pytest.raises(InputFileError, match=rf"line 2 is no result.*{told}.*remove the file"):
        list(read_outcomes(file))
    file.write_text(f"{first}\nnot json\n")
    with pytest.raises(InputFileError, match="line 2"):
        list(read_outcomes(file))


def test_what_auto_says_of_a_frame_is_checked() -> None:
    told = {"choices": [{"instance": "car", "method": "sbr", "reason": "near"}], "met": True}
    assert chosen_methods(told) == {"car": "sbr"}
    for old in ({}, {"choices": {}}, {"choices": [{"instance": "car"}]}, None):
        with pytest.raises(ValueError, match=r"choices|method|table|mapping|dict"):
            chosen_methods(old)


def test_methods_are_compared_where_an_object_is() -> None:
    grid = PolarGrid(40, 24, 1.6, 0.75)
    levels = np.zeros((40, 24, 2), np.float16)
    levels[12, 12, 1], levels[20, 12, 0], levels[12, 20, 0] = 0.5, 1.0, 1.0  # the others are beyond what is looked at
    assert strongest(levels, [20.3, 1.0], grid) == 0.5 * FULL_SNR_DB
    levels[0, 12, 0] = 0.25
    assert strongest(levels, [0.5, 0.0], grid) == 0.25 * FULL_SNR_DB  # at the edge of the map
    seen = [Seen(0, "sbr", (50.0, 27.0)), Seen(0, "sbr", (30.0, 31.0)), Seen(0, "raycast", (40.0, 40.0))]
    text = table(seen)
    assert "| car | sbr | 2 | 1 | -1.0 to 23.0, median 11.0 |" in text
    assert "| car | raycast | 1 | 0 | 0.0 to 0.0, median 0.0 |" in text


def test_the_command_says_what_is_wrong(tmp_path, monkeypatch, capsys) -> None:
    def run(*arguments: str) -> int:
        monkeypatch.setattr("sys.argv", ["baseline", *arguments])
        return command.main()

    assert run(str(tmp_path / "nothing"), "--out", str(tmp_path / "out")) == 2
    assert "error: " in capsys.readouterr().err
    for wrong in (["--steps", "0"], ["--inputs", "lidar"], ["--frames", "some"]):
        with pytest.raises(SystemExit):
            run("data", *wrong)
    monkeypatch.setattr(command, "read_samples", _interrupted)
    assert run("data", "--out", str(tmp_path / "out")) == 130
    assert "go on with the same command" in capsys.readouterr().err


def _interrupted(*_: object) -> None:
    raise KeyboardInterrupt
