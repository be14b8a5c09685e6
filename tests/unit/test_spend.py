"""What a tube budget pays for first: pure bookkeeping, without a scene."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.settings.auto import AutoSettings
from scarl_sionna.radar.channel.compose import choose
from scarl_sionna.radar.channel.compose.reflections import Change
from scarl_sionna.radar.channel.compose.spend import Choice, spend

GROUND, WALL = (SimpleNamespace(number=number, part=number) for number in (0, 1))


def objects(**changes: list[tuple[float, object]]) -> list[Choice]:
    """Return an object a keyword, in this order, with (change [dB], mirror) of each of its reflections."""
    return [
        Choice(
            SimpleNamespace(number=number, name=name, info=SimpleNamespace(actor=name if "car" in name else None)),  # type: ignore[arg-type]
            "sbr",
            "coherent body",
            changes=[Change(change, 1.0, mirror) for change, mirror in found],  # type: ignore[arg-type]
        )
        for number, (name, found) in enumerate(changes.items())
    ]


def paid_for(own: list[Choice]) -> dict[str, tuple[int, list[int]]]:
    return {choice.item.name: (choice.tubes, [mirror.number for mirror in choice.mirrors]) for choice in own}


def test_road_users_come_first_and_straight() -> None:
    own = objects(car=[(10.0, GROUND)], post=[(2.0, GROUND)])
    whole = spend(own, {0: 1000, 1: 10}, {0, 1}, budget=1999)  # the car's ground is one further way: 1,000 tubes

    assert not whole
    assert paid_for(own) == {"car": (1000, []), "post": (10, [0])}
    assert not any(choice.over_budget for choice in own)
    assert own[0].without is not None and own[0].without.change_db == 10.0
    spend(own, {0: 1000, 1: 10}, {0, 1}, budget=1019)
    assert [choice.over_budget for choice in own] == [False, False]
    assert not own[1].mirrors  # straight, since the ground's further way is more than is left


def test_of_the_others_as_many_as_possible_are_whole() -> None:
    own = objects(rail=[(10.0, GROUND)], sign=[(6.0, GROUND)], post=[(6.0, GROUND)])
    cost = {0: 1000, 1: 100, 2: 100}
    spend(own, cost, {0}, budget=1399)
    assert [choice.item.name for choice in own if not choice.over_budget] == ["sign", "post"]
    assert all(choice.mirrors for choice in own[1:])
    spend(own, cost, {0}, budget=1400)  # now the rail, too, but straight
    assert [len(choice.mirrors) for choice in own] == [0, 1, 1]
    assert not any(choice.over_budget for choice in own)


def test_reflections_are_bought_by_what_they_change_for_their_tubes() -> None:
    own = objects(car_1=[(10.0, GROUND)], car_2=[(6.0, GROUND)], car_3=[(0.6, GROUND)])
    cost = {0: 1000, 1: 100, 2: 100}
    straight = sum(cost.values())
    for budget, over_ground in (
        (straight + 100, ["car_2"]),
        (straight + 1100, ["car_1", "car_2"]),  # 10 dB for 1,000 tubes before 0.6 dB for 100
        (straight + 1200, ["car_1", "car_2", "car_3"]),
    ):
        whole = spend(own, cost, {0}, budget)
        assert [choice.item.name for choice in own if choice.mirrors] == over_ground
        assert whole == (len(over_ground) == 3)
        assert sum(choice.cost for choice in own) <= budget


def test_the_largest_reflection_of_each_comes_before_the_second_of_any() -> None:
    own = objects(car_1=[(10.0, GROUND), (9.0, WALL)], car_2=[(0.6, GROUND)])
    spend(own, {0: 10, 1: 100}, {0, 1}, budget=10 + 100 + 10 + 100 + 9)  # the second one is one further way

    assert paid_for(own) == {"car_1": (10, [0]), "car_2": (100, [0])}


def test_what_alone_shows_an_object_is_worth_a_finite_number_of_decibels() -> None:
    own = objects(hidden_car=[(np.inf, GROUND)], car=[(30.0, GROUND)])
    spend(own, {0: 1000, 1: 100}, {0}, budget=1100 + 999)

    assert paid_for(own) == {"hidden_car": (1000, []), "car": (100, [0])}


@pytest.mark.parametrize("budget", [0, 9, 10, 10**9])
def test_a_mirror_that_serves_nobody_costs_nothing(budget: int) -> None:
    own = objects(post=[(5.0, WALL)])
    whole = spend(own, {0: 10}, {0}, budget)

    assert own[0].over_budget == (budget < 10)
    assert whole == (budget >= 10)
    assert own[0].mirrors == []


def test_a_level_that_computes_road_users_comes_before_one_that_is_better_on_average(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    own = objects(car=[], post_1=[], post_2=[], post_3=[], post_4=[])
    for choice in own:
        choice.item.expected_db, choice.item.is_coherent, choice.item.info.is_object = 30.0, True, True  # type: ignore[misc]
    rules = AutoSettings()
    rough, fine = rules.levels[0], rules.levels[2]
    prices = {rough.tolerance_db: (100, 10), fine.tolerance_db: (1000, 10)}
    monkeypatch.setattr(
        choose, "num_tubes_of", lambda _, choice, level: prices[level.tolerance_db]["car" not in choice.item.name]
    )
    for budget, taken in ((1100, fine), (105, rough), (90, fine)):
        view = SimpleNamespace(rules=rules, settings=SimpleNamespace(accuracy=Accuracy(tube_budget=budget)))
        assert choose._level_to_take(view, own, [], (fine, rough)) is taken  # type: ignore[arg-type]
        assert own[0].over_budget == (budget == 90)


def test_levels_count_by_their_expected_error_not_by_their_tolerance(monkeypatch: pytest.MonkeyPatch) -> None:
    """A reflection of 4 dB that the level of 3 dB cannot pay for is worse than that of 6 dB with it: 2.9 dB."""
    own = objects(post_1=[(4.0, GROUND)], post_2=[(4.0, GROUND)])
    for choice in own:
        choice.item.expected_db, choice.item.is_coherent, choice.item.info.is_object = 30.0, True, True  # type: ignore[misc]
    rules = AutoSettings()
    rough, middle = rules.levels[:2]
    prices = {rough.tolerance_db: 10, middle.tolerance_db: 100}
    monkeypatch.setattr(choose, "num_tubes_of", lambda _, choice, level: prices[level.tolerance_db])
    assert choose.computed_error(rough, rules) == pytest.approx(2.92, abs=0.01)
    assert choose.computed_error(middle, rules) < choose.computed_error(rough, rules)
    for budget, change, taken in ((300, 4.0, rough), (300, 2.0, middle), (400, 4.0, middle)):
        for choice in own:
            choice.changes = [Change(change, 1.0, GROUND)]  # type: ignore[arg-type]
        view = SimpleNamespace(rules=rules, settings=SimpleNamespace(accuracy=Accuracy(tube_budget=budget)))
        mirrors = [GROUND]
        assert choose._level_to_take(view, own, mirrors, (middle, rough)) is taken  # type: ignore[arg-type]
        assert all(choice.mirrors for choice in own) == (taken is rough or budget == 400)


def test_memory_counts_patches_of_all_pairs_of_ways() -> None:
    """Two mirrors are three ways, traced once each, but six pairs of a way there and a way back."""
    for patches, mirrors in ((600, [0, 1]), (599, [0]), (299, []), (99, None)):
        own = objects(car=[(10.0, GROUND), (9.0, WALL)])
        spend(own, {0: 100}, {0, 1}, 10**6, patches)
        assert own[0].over_budget == (mirrors is None)
        assert [mirror.number for mirror in own[0].mirrors] == (mirrors or [])
        ways = 1 + len(mirrors or [])
        assert (own[0].cost, own[0].patches) == (100 * ways, 50 * ways * (ways + 1))
