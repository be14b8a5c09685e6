"""Radio paths over curved bodies: by how much the amplitude of an endless mirror is too strong. Held as a limit."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.paths import tracing
from tests.oracles.link import friis
from tests.physics.test_radio_links import MANY, radio_variant, solve  # noqa: F401  # the fixture
from tests.scenes import Thing, write_scene

FREQUENCY = 28e9
REACH, HEIGHT = 10.0, 5.0
"""Of both ends from the crest, along the way and above it [m]."""


def divergence(radius: float, across: bool) -> float:
    """Amplitude over a round mirror by that over a flat one, both ends as far from it: geometrical optics.

    The radius R lies in the plane of incidence, or across it [m]: behind the mirror the wavefront has the curvature
    1 / s + 2 / (R cos) or 1 / s + 2 cos / R.
    """
    way = np.hypot(REACH, HEIGHT)
    cosine = HEIGHT / way
    return float(1.0 / np.sqrt(1.0 + way * (cosine / radius if across else 1.0 / (radius * cosine))))


def roof(radius: float, across: bool, turn: float) -> trimesh.Trimesh:
    """Return half a cylinder of facets of 0.1 m; with no turn one of them is level, at a height of 0."""
    count = round(2.0 * np.pi * radius / 0.1)
    step = 2.0 * np.pi / count
    angle = step * (np.arange(-(count // 4), count // 4 + 1) + 0.5 + turn)
    bent, up = radius * np.sin(angle), radius * (np.cos(angle) - np.cos(0.5 * step))
    rows = [np.stack([bent, 0.0 * bent + side, up], axis=1)[:, [1, 0, 2] if across else [0, 1, 2]] for side in (-3, 3)]
    here, last = np.arange(len(angle) - 1), len(angle)
    faces = np.concatenate(
        [np.stack([here, here + last, here + 1], 1), np.stack([here + 1, here + last, here + last + 1], 1)]
    )
    return trimesh.Trimesh(np.concatenate(rows), faces[:, ::-1] if across else faces, process=False)


def over(folder, radius: float, across: bool, turn: float = 0.0):
    """Return the mirrored paths between both ends, and their amplitudes by that of an endless flat mirror."""
    body = Thing("body", roof(radius, across, turn), "Car", "steel")
    state = load_scene(write_scene(folder, [body])).at(0.0)
    ends = (Mount(Pose([side * REACH, 0.0, HEIGHT])) for side in (-1.0, 1.0))
    found = solve(state, FREQUENCY, [next(ends)], sender=next(ends), settings=MANY)
    mirrored = found.kind[:, 0] == tracing.SPECULAR
    flat = abs(friis(FREQUENCY, 2.0 * np.hypot(REACH, HEIGHT)))
    return np.abs(found.a[mirrored, 0, 0]) / flat, found.small_mirror[mirrored]


@pytest.mark.parametrize(
    ("radius", "across", "too_strong"),
    [
        (1.0, False, 14.15),
        (1.0, True, 7.78),
        (3.0, False, 9.70),
        (3.0, True, 4.26),
        (10.0, False, 5.44),
        (10.0, True, 1.76),
    ],
)
def test_a_level_facet_has_the_amplitude_of_an_endless_mirror_and_is_marked(tmp_path, radius, across, too_strong):
    """Steel; docs/limits.md has the decibels. A solver that follows curvature makes this test fail, as it should."""
    amplitude, marked = over(tmp_path, radius, across)
    assert len(amplitude) == 1 and marked.all()
    excess = 20.0 * np.log10(amplitude[0] / divergence(radius, across))
    assert excess == pytest.approx(too_strong, abs=0.05)  # steel reflects all but 0.01 dB


def test_where_no_facet_has_the_mirrors_point_there_is_no_path(tmp_path):
    amplitude, _ = over(tmp_path, 3.0, False, turn=0.5)
    assert len(amplitude) == 0  # the round body has one at every place, 9.7 dB below a flat mirror's
