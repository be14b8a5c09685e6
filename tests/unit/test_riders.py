"""Riders hold the grips and stand on what carries them, with limbs of the body's own lengths."""

from __future__ import annotations

import numpy as np
import pytest

from scenes_xml.actors import cycles

RIDING = {
    "bicycle": (cycles.CYCLIST, cycles.SEAT, 0.014),
    "scooter": (cycles.COMMUTER, cycles.UPRIGHT, 0.012),
    "motorcycle": (cycles.BIKER, cycles.ASTRIDE, 0.014),
}
"""Model -> who rides it, how, and the radius of the bar [m]."""


@pytest.mark.parametrize("name", RIDING)
@pytest.mark.parametrize("light", [False, True])
def test_hands_close_about_the_grips(name, light):
    """Around the bar, skin is on all four sides, nowhere inside it and nowhere farther off than a hand is thick."""
    person, posture, radius = RIDING[name]
    who = cycles.rider(person, posture, light)
    hand = np.unique(who.surface.faces[who.surface.regions == "hand"])
    points = who.bent(who.surface.points)[hand]
    for sign in (1.0, -1.0):
        away = points - np.array(posture.grip) * [1.0, sign, 1.0]
        away = away[np.abs(away[:, 1]) < 0.05]  # along the bar
        reach = np.hypot(away[:, 0], away[:, 2])
        assert reach.min() > radius
        near = away[reach < 0.06]
        angles = np.degrees(np.arctan2(near[:, 2], near[:, 0]))
        assert {int(quadrant) for quadrant in angles // 90.0} == {-2, -1, 0, 1}


@pytest.mark.parametrize("name", RIDING)
def test_limbs_keep_their_lengths_and_reach_what_they_stand_on(name):
    person, posture, _ = RIDING[name]
    who = cycles.rider(person, posture, False)
    frames = who.frames()
    for side in ("left", "right"):
        hip, knee, ankle = (frames[f"{side}_{part}"][1] for part in ("upper_leg", "lower_leg", "foot"))
        assert np.linalg.norm(knee - hip) == pytest.approx(who.lengths["upper_leg"], abs=1e-12)
        assert np.linalg.norm(ankle - knee) == pytest.approx(who.lengths["lower_leg"], abs=1e-12)
        assert knee[0] > 0.5 * (hip + ankle)[0]  # bent forward
    for rotation, _ in frames.values():
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0, abs=1e-12)


def test_a_shoe_stands_on_the_footboard():
    who = cycles.rider(cycles.COMMUTER, cycles.UPRIGHT, False)
    shoes, _ = who.shapes()["rider_shoes"]
    assert shoes.vertices[:, 2].min() == pytest.approx(cycles.SCOOTER.deck_top, abs=3e-3)
