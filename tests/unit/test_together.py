"""Tracings that ask the rays together find what each finds alone, with fewer questions."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel.compose.ghosts import Meshes, image_pairs
from scarl_sionna.radar.channel.compose.mirror_legs import MirrorView
from scarl_sionna.radar.channel.compose.mirrors import find_mirrors
from scarl_sionna.radar.channel.sbr.bodies import Bodies
from scarl_sionna.radar.channel.sbr.solve import solve_between, stations_of
from scarl_sionna.radar.channel.sbr.tracing import Pair, shared_tracings
from scarl_sionna.radar.optics.tubes.together import Branch, Question, Tracing, together
from scarl_sionna.radar.paths import RadarPaths
from tests.scenes import Thing, box, plane, write_scene


@dataclass(frozen=True)
class Square(Question):
    place: tuple[int, ...]
    number: int
    kind: str = "square"
    log: list[int] = field(default_factory=list)

    @property
    def key(self) -> Hashable:
        return self.kind

    def __len__(self) -> int:
        return 10

    @classmethod
    def answered(cls, questions: Sequence[Square]) -> list[int]:
        questions[0].log.append(len(questions))
        return [one.number**2 for one in questions]


def squares(first: int, count: int, log: list[int], kind: str = "square") -> Tracing[int]:
    for step in range(count):
        yield step
        yield (yield Square((step,), first + step, kind, log)) + 100


def found_by(tracings: list[Tracing[int]], most: int) -> dict[int, list[int | None]]:
    found: dict[int, list[int | None]] = {}
    for number, value in together(tracings, most):
        found.setdefault(number, []).append(value)
    return found


def test_answers_come_back_to_who_asked_and_the_end_is_told() -> None:
    log: list[int] = []
    found = found_by([squares(1, 2, log), squares(5, 3, log), squares(0, 0, log)], 100)
    assert found == {0: [0, 101, 1, 104, None], 1: [0, 125, 1, 136, 2, 149, None], 2: [None]}
    assert log == [2, 2, 1]  # three of the five questions would be their own
    assert found_by([], 100) == {}


def test_only_what_is_alike_is_asked_together() -> None:
    log: list[int] = []
    found_by([squares(1, 2, log), squares(1, 2, log, "cube"), squares(1, 2, log)], 100)
    assert sorted(log) == [1, 1, 2, 2]


@pytest.mark.parametrize(("most", "groups"), [(1, [1] * 9), (11, [2, 2, 2, 1, 1, 1]), (30, [3, 3, 3])])
def test_few_run_at_once_where_memory_is_short(most, groups) -> None:
    log: list[int] = []
    found_by([squares(1, 3, log) for _ in range(3)], most)
    assert log == groups


def test_those_behind_are_asked_first() -> None:
    """One that has begun later catches up, so that both ask the next question together."""
    log: list[int] = []
    late = Square((0,), 2, "other", log)

    def after() -> Tracing[int]:
        yield late
        yield from squares(3, 2, log)

    found_by([squares(1, 2, log), after()], 100)
    assert log == [1, 1, 2, 1]


def test_a_branch_goes_on_beside_the_rest_and_ends_before_the_whole_does() -> None:
    log: list[int] = []

    def branching() -> Tracing[int]:
        yield Branch(squares(10, 3, log))
        yield Branch(squares(20, 1, log))
        yield from squares(1, 1, log)

    found = found_by([branching(), squares(5, 1, log)], 100)
    assert found == {0: [0, 0, 0, 101, 200, 1, 500, 221, 2, 244, None], 1: [0, 125, None]}
    assert log == [4, 1, 1]


def field_of(paths: RadarPaths, number: int, radar: RadarSpec) -> float:
    """Return the co-polar field of what comes from one instance first."""
    wave = paths.a[:, 0, 0] * np.exp(-2j * np.pi * radar.center_frequency / SPEED_OF_LIGHT * paths.length)
    return float(np.abs(wave[paths.instance[:, 0] == number].sum()))


def test_pairs_of_ways_give_together_what_each_gives_alone(tmp_path) -> None:
    """Two boxes over the ground and beside a wall: straight, there and back over either, four bounces."""
    things = [
        Thing("ground", plane(60.0, 40.0, (25, 0, 0)), "Ground", "steel", is_object=False),
        Thing("wall", box((40, 0.2, 4), (20, 6.1, 2.1)), "Wall", "steel"),
        Thing("one", box((1.0, 1.0, 1.0), (14, 1, 0.6)), "Static", "steel"),
        Thing("other", box((0.5, 2.0, 1.5), (18, -1, 1)), "Static", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    radar, mount = RadarSpec(elevation_fov_deg=60.0), state.as_mount(Pose([0.0, 0.0, 0.8]))
    knobs = SbrSettings(max_phase=3.0, edge_share=1.0, return_angle=0.8, max_depth=4)
    settings = RadarSettings(method="sbr", sbr=knobs)
    mirrors = find_mirrors(state, [1, 2], mount.pose.position, radar.wavelength)
    meshes = Meshes(Bodies(state, radar, settings, (3, 4)))
    view = MirrorView(state, radar, mount, (3, 4), mirrors, settings.mirrors)
    images = image_pairs(view, mirrors, 1, 60.0)
    pairs = [Pair(*stations_of(radar, mount)), *meshes.pairs(view, images)]
    assert len(pairs) >= 6
    with meshes.bodies.active():
        shared = list(shared_tracings(meshes.bodies, pairs))
    assert sum(len(one.pairs) for one in shared) == len(pairs) > len(shared) == len({pair.tx.key for pair in pairs})
    joined = solve_between(meshes.bodies, pairs)
    assert sum(paths.num_paths > 20 for paths in joined) >= 6
    apart = [solve_between(meshes.bodies, [pair])[0] for pair in pairs]
    strongest = max(field_of(paths, number, radar) for paths in apart for number in (3, 4))
    for pair, paths, alone in zip(pairs, joined, apart, strict=True):
        if pair.rx.key != pair.tx.key:  # its first tubes are cut for the transmitter before they are for it
            for number in (3, 4):
                wanted = field_of(alone, number, radar)
                assert abs(field_of(paths, number, radar) - wanted) < 0.03 * wanted + 1e-3 * strongest
            continue
        assert paths.num_paths == alone.num_paths
        np.testing.assert_allclose(paths.length, alone.length, rtol=1e-12)
        np.testing.assert_array_equal(paths.instance, alone.instance)
        np.testing.assert_allclose(paths.a, alone.a, rtol=0.0, atol=1e-9 * np.abs(alone.a).max(initial=0.0))
