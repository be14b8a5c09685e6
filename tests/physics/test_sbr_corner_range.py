"""A small corner reflector is as right far away as near by: rays follow its faces, not the patches' size."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from benchmarks.corner_range import RADAR, cases, corner, level
from tests.scenes import Thing, write_scene

DEFAULT = ss.SbrSettings(floor_db=None)
BAR_DB = 0.5  # of the project


@pytest.mark.some(3)
@pytest.mark.parametrize("number", [1, 9, 11, 28, 35, 41])
def test_random_corners_against_the_far_field(tmp_path, number: int) -> None:
    """3 to 20 cm, any aspect, 20 to 250 m; where k leg^2 / (4 R) < 0.5 rad the waves are plane to 0.1 dB."""
    leg, aspect, distance = list(cases(42))[number]
    assert 2.0 * np.pi / RADAR.wavelength * leg**2 / (4.0 * distance) < 0.5
    state = ss.load_scene(write_scene(tmp_path, [Thing("corner", corner(leg), "Static", "steel")])).at(0.0)
    theta, phi = np.arccos(aspect[2]), np.arctan2(aspect[1], aspect[0])
    exact = 10.0 * np.log10(ss.rcs(corner(leg), RADAR.center_frequency, theta, phi))
    assert abs(level(state, aspect, distance, DEFAULT) - exact) < BAR_DB


def test_it_is_the_sheets_that_do_it(tmp_path) -> None:
    """The worst of the sixty at 250 m: a decibel short where rays follow the patches alone."""
    leg, aspect, distance = max(
        (case for case in cases(60) if case[2] == 250.0), key=lambda case: abs(_error(tmp_path, *case, coarse=True))
    )
    assert abs(_error(tmp_path, leg, aspect, distance, coarse=True)) > 0.8
    assert abs(_error(tmp_path, leg, aspect, distance, coarse=False)) < BAR_DB


def _error(folder, leg, aspect, distance, coarse: bool) -> float:
    path = write_scene(folder / f"{leg:.6f}", [Thing("corner", corner(leg), "Static", "steel")])
    state = ss.load_scene(path).at(0.0)
    exact = 10.0 * np.log10(
        ss.rcs(corner(leg), RADAR.center_frequency, np.arccos(aspect[2]), np.arctan2(aspect[1], aspect[0]))
    )
    settings = DEFAULT.with_(sheet_share=64.0) if coarse else DEFAULT
    return level(state, aspect, distance, settings) - float(exact)
