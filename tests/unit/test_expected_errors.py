"""The error that an object's echo is expected to have, of paths whose sums are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.auto import AutoSettings, ErrorEstimate, SbrLevel
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.channel.compose.choose import computed_error
from scarl_sionna.radar.channel.compose.expected_error import expected_errors
from scarl_sionna.radar.points import point_targets

RADAR, GROUND = RadarSpec(), 9
LEVEL = AutoSettings().levels[1]
OWN = LEVEL.with_(patch_error=0.0)


def paths_of(chains: list[tuple[int, ...]], fields: list[float]):
    """Return paths of one length with chains of instances and fields."""
    count = len(chains)
    points = np.tile([20.0, 0.0, 0.0], (count, 1))
    paths = point_targets(points, np.zeros((count, 3)), np.ones(count), RADAR, Pose())
    instance = np.array([(*chain, *[-1] * (5 - len(chain))) for chain in chains], dtype=np.int32)
    a = np.array(fields)[:, None, None] * np.ones((count, *paths.a.shape[1:]))
    return replace(
        paths,
        a=a.astype(np.complex128),
        instance=instance,
        interaction=np.where(instance >= 0, 1, -1).astype(np.int32),
        depth=np.array([len(chain) for chain in chains], dtype=np.int32),
    )


def error_of(ratio: float) -> float:
    return float(20.0 * np.log10(1.0 + ratio))


def test_a_fade_between_ways_is_as_uncertain_as_the_ways_are() -> None:
    """Straight 3 in three patches, over the ground -1 and -1, both together -0.5: half a unit is left."""
    chains = [(1,), (1,), (1,), (GROUND, 1), (1, GROUND), (GROUND, 1, GROUND)]
    paths = paths_of(chains, [1.0, 1.0, 1.0, -1.0, -1.0, -0.5])
    found = expected_errors(paths, RADAR, [1], ErrorEstimate(last_bounce=0.0, way_error=0.1), OWN)
    assert found[1] == pytest.approx(error_of(0.1 * np.sqrt(9.0 + 1.0 + 1.0 + 0.25) / 0.5), rel=1e-6)


def test_all_patches_of_a_bounce_between_objects_are_off_alike() -> None:
    """The bounce of 3 in three patches and its reverse; the patches of another chain lie between them."""
    chains = [(1, 2), (1,), (1, 2), (2, 1), (1, 2), (2,)]
    paths = paths_of(chains, [1.0, -1.0, 1.0, 3.0, 1.0, 7.0])
    fit = ErrorEstimate(last_bounce=0.0, way_error=0.0)
    found = expected_errors(paths, RADAR, [1, 2], fit, OWN.with_(bounce_error=0.2))
    assert found[1] == pytest.approx(error_of(0.2 * 3.0 / 2.0), rel=1e-6)
    assert found[2] == pytest.approx(error_of(0.2 * 3.0 / 10.0), rel=1e-6)


def test_what_bounces_within_one_body_is_as_certain_as_what_it_scatters_at_once() -> None:
    """A corner of three bounces, also over the ground; what goes to another body or mirror and comes back is not."""
    fit, level = ErrorEstimate(last_bounce=0.0, way_error=0.1), OWN.with_(bounce_error=0.7)
    for chain, ratio in (
        ((1,), 0.1),
        ((1, 1), 0.1),
        ((1, 1, 1), 0.1),
        ((GROUND, 1, 1, GROUND), 0.1),
        ((1, 2), 0.7),
        ((1, 2, 1), 0.7),
        ((1, GROUND, 1), 0.7),
    ):
        found = expected_errors(paths_of([chain] * 100, [1.0] * 100), RADAR, [1, 2], fit, level)
        assert found == {1: pytest.approx(error_of(ratio), rel=1e-6)}, chain
    coarsest = AutoSettings().levels[0]
    corner = expected_errors(paths_of([(1, 1, 1)] * 100, [1.0] * 100), RADAR, [1], ErrorEstimate(), coarsest)
    assert corner[1] == pytest.approx(error_of(np.hypot(0.4 / 10.0, 0.015)), rel=1e-6)


@pytest.mark.parametrize("level", AutoSettings().levels, ids=lambda level: f"{level.tolerance_db:g} dB")
def test_a_plan_expects_what_a_run_states_of_patches_that_neither_add_up_nor_cancel(level: SbrLevel) -> None:
    """Two ways with as much power as their sum; then half of the power in a bounce: the same number as of the plan."""
    rules = AutoSettings()
    for other, onward in (((GROUND, 1), 0.0), ((1, 2), 0.5)):
        paths = paths_of([(1,), other], [1.0, 1.0])
        paths = replace(paths, a=paths.a * np.array([1.0, 1.0j])[:, None, None])
        run = expected_errors(paths, RADAR, [1, 2], rules.errors, level)[1]
        assert computed_error(level, rules, onward) == pytest.approx(run, rel=1e-6)
    assert computed_error(level, rules) >= error_of(rules.errors.way_error)


def test_what_patches_of_one_flash_may_be_off_by_is_small() -> None:
    paths = paths_of([(1,)] * 100, [1.0] * 100)
    found = expected_errors(paths, RADAR, [1, 2], ErrorEstimate(), LEVEL)
    assert set(found) == {1} and found[1] < 0.2
    assert expected_errors(paths, RADAR, [7], ErrorEstimate(), LEVEL) == {}
