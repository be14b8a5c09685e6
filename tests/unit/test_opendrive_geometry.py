"""Reference lines and lane borders of OpenDRIVE against closed forms and against integration of another kind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import fresnel

from scarl_sionna.scene.streets.geometry.road import RoadShape
from scarl_sionna.scene.streets.opendrive.street import read_map
from tests import street_maps as maps

MILLIMETRE = 1e-3
X, Y, HEADING = 12.0, -7.0, 0.7


def _shape(folder: Path, text: str) -> RoadShape:
    file = folder / "map.xodr"
    file.write_text(text)
    return RoadShape(next(iter(read_map(file).roads.values())))


def _placed(u, v):
    c, s = np.cos(HEADING), np.sin(HEADING)
    return np.stack([X + c * u - s * v, Y + s * u + c * v], -1)


def _single(folder: Path, element: str, length: float) -> RoadShape:
    return _shape(folder, maps.street_map(maps.road(maps.piece(element, length, 0.0, X, Y, HEADING), length)))


def _clothoid(s, first, rate):
    """Point of a clothoid by Fresnel's integrals: curvature first + rate s."""
    scale = np.sqrt(np.pi / abs(rate))
    shift = first / rate
    start, stop = shift / scale, (s + shift) / scale
    s1, c1 = fresnel(stop)
    s0, c0 = fresnel(start)
    sign = np.sign(rate)
    turn = -sign * 0.5 * shift**2 * abs(rate)
    u, v = scale * (c1 - c0), sign * scale * (s1 - s0)
    return np.cos(turn) * u - np.sin(turn) * v, np.sin(turn) * u + np.cos(turn) * v


@pytest.mark.parametrize("curvature", [0.0, 0.1, -0.004])
def test_line_and_arc(tmp_path, curvature):
    s = np.linspace(0.0, 90.0, 37)
    element = f'<arc curvature="{curvature}"/>' if curvature else "<line/>"
    shape = _single(tmp_path, element, 90.0)
    u = np.sin(curvature * s) / curvature if curvature else s
    v = (1.0 - np.cos(curvature * s)) / curvature if curvature else 0.0 * s
    found = shape.point(s)
    assert np.abs(found[:, :2] - _placed(u, v)).max() < 1e-3 * MILLIMETRE
    assert np.abs(shape.heading(s) - HEADING - curvature * s).max() < 1e-9


@pytest.mark.parametrize("ends", [(0.0, 0.08), (0.05, -0.03), (-0.02, -0.12), (0.3, 0.0)])
def test_spiral(tmp_path, ends):
    s = np.linspace(0.0, 120.0, 61)
    shape = _single(tmp_path, f'<spiral curvStart="{ends[0]}" curvEnd="{ends[1]}"/>', 120.0)
    expected = _placed(*_clothoid(s, ends[0], (ends[1] - ends[0]) / 120.0))
    assert np.abs(shape.point(s)[:, :2] - expected).max() < 1e-3 * MILLIMETRE


def _inverted(u, v, s):
    """Parameter at an arc length, by adaptive integration and bisection."""
    du, dv = u.deriv(), v.deriv()

    def length(p):
        return quad(lambda x: np.hypot(du(x), dv(x)), 0.0, p, epsabs=1e-11, limit=200)[0]

    return length, np.array([brentq(lambda p, at=at: length(p) - at, -1e-9, 200.0) for at in s])


def test_poly3_runs_along_its_arc_length(tmp_path):
    s = np.linspace(0.0, 60.0, 13)
    v = np.polynomial.Polynomial([0.0, 0.1, -0.02, 4e-4])
    u = np.polynomial.Polynomial([0.0, 1.0])
    shape = _single(tmp_path, '<poly3 a="0" b="0.1" c="-0.02" d="0.0004"/>', 60.0)
    _, p = _inverted(u, v, s)
    assert np.abs(shape.point(s)[:, :2] - _placed(u(p), v(p))).max() < 1e-2 * MILLIMETRE


@pytest.mark.parametrize("range_", ["normalized", "arcLength"])
def test_param_poly3_runs_along_its_arc_length(tmp_path, range_):
    u = np.polynomial.Polynomial([0.0, 55.0, 9.0, -14.0])
    v = np.polynomial.Polynomial([0.0, 0.0, 30.0, -11.0])
    length, _ = _inverted(u, v, [])
    whole = length(1.0)
    scale = np.array([1.0, whole, whole**2, whole**3]) if range_ == "arcLength" else np.ones(4)
    numbers = " ".join(
        f'{key}{axis}="{value / by!r}"'
        for axis, poly in (("U", u), ("V", v))
        for key, value, by in zip("abcd", poly.coef.tolist(), scale.tolist(), strict=True)
    )
    shape = _single(tmp_path, f'<paramPoly3 pRange="{range_}" {numbers}/>', whole)
    s = np.linspace(0.0, whole, 11)
    p = np.array([brentq(lambda p, at=at: length(p) - at, -1e-9, 1.1) for at in s])
    assert np.abs(shape.point(s)[:, :2] - _placed(u(p), v(p))).max() < 1e-2 * MILLIMETRE


def test_lane_borders_with_offset_widths_superelevation_and_heights(tmp_path):
    widths = maps.cubic("width", (3.0, 0.02, 0.0, 0.0), 0.0, "sOffset") + maps.cubic(
        "width", (4.0, 0.0, 0.01, -1e-4), 50.0, "sOffset"
    )
    height = '<height sOffset="0" inner="0.12" outer="0.15"/>'
    text = maps.street_map(
        maps.road(
            maps.piece('<arc curvature="0.02"/>', 100.0),
            100.0,
            maps.section([maps.lane(2, 2.0, "sidewalk", more=height), maps.lane(1, widths)], [maps.lane(-1)]),
            offset=maps.cubic("laneOffset", (0.5, 0.0, 0.0, 0.0)),
            elevation=maps.cubic("elevation", (10.0, 0.03, 0.0, 0.0)),
            lateral=maps.cubic("superelevation", (0.0, 0.001, 0.0, 0.0)),
        )
    )
    shape = _shape(tmp_path, text)
    part = shape.road.sections[0]
    s = np.linspace(0.0, 100.0, 21)
    d = s - 50.0
    first = np.where(s < 50.0, 3.0 + 0.02 * s, 4.0 + 0.01 * d**2 - 1e-4 * d**3)
    inner, outer = shape.edges(part, 2, s)
    for found, t, up in ((inner, 0.5 + first, 0.12), (outer, 2.5 + first, 0.15)):
        roll, across = 0.001 * s, 50.0 - t * np.cos(0.001 * s)  # the arc's middle lies 50 m to the left
        expected = np.stack(
            [
                across * np.sin(0.02 * s),
                50.0 - across * np.cos(0.02 * s),
                10.0 + 0.03 * s + t * np.sin(roll) + up,
            ],
            -1,
        )
        assert np.abs(found - expected).max() < 1e-9


def test_crossfall_falls_to_both_sides_and_level_lanes_stay_level(tmp_path):
    level = maps.lane(-2, 2.0, "sidewalk").replace('level="false"', 'level="true"')
    text = maps.street_map(
        maps.road(
            maps.piece("<line/>", 40.0),
            40.0,
            maps.section([maps.lane(1)], [maps.lane(-1), level]),
            lateral='<crossfall side="both" s="0" a="0.03" b="0" c="0" d="0"/>',
        )
    )
    shape = _shape(tmp_path, text)
    part, s = shape.road.sections[0], np.array([20.0])
    for number, heights in ((1, (0.0, -3.5)), (-1, (0.0, -3.5)), (-2, (-3.5, -3.5))):
        for edge, fall in zip(shape.edges(part, number, s), heights, strict=True):
            assert edge[0, 2] == pytest.approx(fall * np.tan(0.03), abs=1e-12)


def test_shapes_between_two_cross_sections_in_proportion(tmp_path):
    rows = "".join(
        f'<shape s="{s}" t="{t}" a="{a}" b="{b}" c="0" d="0"/>'
        for s, t, a, b in ((0, -4, 0.0, 0.0), (0, 0, 0.0, 0.05), (100, -4, 0.4, -0.1), (100, 0, 0.0, 0.1))
    )
    shape = _shape(tmp_path, maps.street_map(maps.road(maps.piece("<line/>", 100.0), 100.0, lateral=rows)))
    found = shape.point([25.0, 25.0], [-2.0, 3.0])[:, 2]
    assert found == pytest.approx([0.25 * 0.2, 0.75 * 0.15 + 0.25 * 0.3])


def test_stations_keep_every_border_within_the_tolerance(tmp_path):
    text = maps.street_map(
        maps.road(
            maps.piece('<spiral curvStart="-0.06" curvEnd="0.09"/>', 100.0),
            100.0,
            elevation=maps.cubic("elevation", (0.0, 0.0, 2e-3, -1.5e-5)),
        )
    )
    shape = _shape(tmp_path, text)
    part = shape.road.sections[0]
    s, fine = shape.stations(part, 0.004), np.linspace(0.0, 100.0, 4001)
    coarse, exact = shape.profile(part, s), shape.profile(part, fine)
    chords = np.stack(
        [[np.interp(fine, s, coarse[:, k, axis]) for axis in range(3)] for k in range(coarse.shape[1])]
    ).transpose(2, 0, 1)
    assert np.linalg.norm(chords - exact, axis=-1).max() < 0.006
    assert len(s) < 200
