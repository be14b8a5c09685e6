"""Groups of paths that bend alike: each series is found once, and sharing them changes no plan."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import moving
from scarl_sionna.radar.synthesis.motion import PathMotion

Tried = list[tuple[bytes, int]]


def test_groups_share_the_series_of_the_same_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    radar, rng = RadarSpec(), np.random.default_rng(5)
    places = np.column_stack([10.0 ** rng.uniform(0.3, 2.0, 6000), rng.uniform(-3.0, 3.0, 6000), np.zeros(6000)])
    velocities = rng.uniform(-15.0, 15.0, (6000, 3))
    paths = point_targets(places, velocities, np.ones(6000), radar, Mount(Pose(), Twist([10.0, 0.0, 0.0])))
    asked: Tried = []
    found = moving._ended

    def ended(motion: PathMotion, spec: RadarSpec, size: int, tolerance: float) -> object:
        asked.append((motion.reach.tobytes(), size))
        return found(motion, spec, size, tolerance)

    monkeypatch.setattr(moving, "_ended", ended)
    shared = moving.grouped(paths, radar, Accuracy().motion_tolerance)
    assert asked and len(asked) == len(set(asked))
    once = len(asked)
    monkeypatch.setattr(moving._Planner, "_tried", lambda self, worst: _alone(self, worst))
    apart = moving.grouped(paths, radar, Accuracy().motion_tolerance)
    assert len(asked) - once > 1.5 * once and set(asked) == set(asked[:once])  # many would be found again
    for (one, plan), (other, same) in zip(shared, apart, strict=True):
        np.testing.assert_array_equal(one, other)
        assert (plan.size, plan.pairwise, plan.cost) == (same.size, same.pairwise, same.cost)


def _alone(planner: moving._Planner, worst: np.ndarray) -> moving._Tried:
    motion = PathMotion.of(planner.paths.select(worst), planner.radar)
    return moving._Tried(motion, planner.radar, planner.tolerance)
