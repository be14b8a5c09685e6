"""The ground bounce of the nine ready places with default settings, by the plan alone: nothing is traced."""

from __future__ import annotations

import warnings

import pytest

import scarl_sionna as ss
from benchmarks.street_scenes import PLACES
from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.radar.channel.compose.auto import _planned

LEVEL = 0.9
"""Of a mirror's normal, upwards: of a ground."""
IN_SIGHT = 0.4
"""Share of an object's surface that is seen straight, of a closed body 0.5 at most: of what is hidden more the ground
bounce may be hidden, too."""


@pytest.mark.parametrize("place", PLACES)
def test_what_stands_in_sight_is_seen_over_the_ground(place: str) -> None:
    state = ss.load_scene(place).at(2.7)
    mount = state.mount("ego", ss.Pose([3.8, 0.0, 0.6]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)
        view, chosen, plan = _planned(state, ss.RadarSpec(), mount, RadarSettings(method="auto"))
    instances = state.world.instances
    assert {"road", "floor"} & {instances[int(number)].name for number in plan.mirrors}
    seen = [choice for choice in chosen.choices if choice.method == "sbr" and choice.sight.share > 0.0]
    (share,) = (share for share in plan.shares if share.solver == "sbr")
    over: dict[int, set[int]] = {}
    for reflection in share.reflections:
        for number in reflection.instances:
            over.setdefault(int(number), set()).update(map(int, reflection.mirrors))
    grounds = {view.instance(mirror) for mirror in chosen.mirrors if abs(mirror.normal[2]) > LEVEL}
    without = [choice for choice in seen if not over.get(choice.item.number, set()) & grounds]
    assert len(seen) >= 6 and len(without) < len(seen) / 2.0  # others lie far off, on land, or behind something
    assert not [choice.item.name for choice in without if choice.sight.share > IN_SIGHT]
