"""The fringe currents of a wedge: against the exact currents, integrated, and Keller's coefficients on the cone."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.radar.optics.edges.fringe import Faces, far_fringe, fringe_current, transition
from tests.oracles import wedge

OPENINGS = (2.0, 1.5, 1.25)
"""Half plane, edge of a box, obtuse edge: over pi."""


def face(ratio):
    return Faces(np.array([[1.0, 0, 0]]), np.array([[0, 1.0, 0]]), np.array([ratio * np.pi]))


def both_faces(ratio):
    """Return the first face, and the second one of the same wedge."""
    end = ratio * np.pi
    second = np.array([[np.cos(end), np.sin(end), 0]]), np.array([[np.sin(end), -np.cos(end), 0]])
    return face(ratio), Faces(*second, np.array([end]))


def wave(angle, source):
    """Return the direction of a plane wave, and its two polarisations as columns."""
    direction = np.array([-np.sin(angle) * np.cos(source), -np.sin(angle) * np.sin(source), np.cos(angle)])
    first = np.cross(direction, [0.0, 0.0, 1.0])
    first /= np.linalg.norm(first)
    return direction, np.stack([first, np.cross(direction, first)], axis=1).astype(complex)


@pytest.mark.some(1)
@pytest.mark.parametrize("ratio", OPENINGS)
def test_current_is_the_exact_one_less_physical_optics_integrated(ratio) -> None:
    """Any direction of the source and of the observer; the integral along the grazing ray is done by numbers."""
    random = np.random.default_rng(int(10 * ratio))
    for _ in range(4):
        angle, source = random.uniform(0.5, 2.6), random.uniform(0.1, ratio * np.pi - 0.1)
        observer = random.normal(size=3)
        observer /= np.linalg.norm(observer)
        sine, cosine = np.sin(angle), np.cos(angle)
        mu = (observer @ [sine, 0, cosine] - cosine**2) / sine**2
        if abs(mu - 1.0) < 0.4:  # the numerical integral converges too slowly
            mu, observer = 0.0, np.array([0.0, sine, cosine])
        direction, field = wave(angle, source)
        found = fringe_current(face(ratio), direction[None], field[None], observer[None])[0]
        hard, soft, tip = wedge.fringe_integrals(ratio, source, mu)
        electric, magnetic = field[2], np.cross(direction, field.T)[:, 2]
        across = magnetic * hard / sine
        along = electric * soft / sine**2 - magnetic * (1j * cosine * tip - cosine * mu * hard) / sine**2
        expected = np.stack([across, np.zeros(2), along])
        assert np.abs(found - expected).max() < 5e-3 * max(np.abs(expected).max(), 0.5)


@pytest.mark.parametrize("ratio", OPENINGS)
@pytest.mark.parametrize("angle_deg", [90.0, 55.0])
def test_on_the_cone_keller_less_physical_optics(ratio, angle_deg) -> None:
    """Both faces together: f - f0 and g - g0 of Ufimtsev; one face lit, both lit, backscatter."""
    angle = np.radians(angle_deg)
    for source_deg, observer_deg in ((40.0, 40.0), (100.0, 100.0), (60.0, 170.0), (150.0, 20.0), (75.0, 215.0)):
        source, azimuth = np.radians([source_deg, observer_deg])
        if azimuth > ratio * np.pi or source > ratio * np.pi:
            continue
        direction, field = wave(angle, source)
        observer = np.array([np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), np.cos(angle)])
        total = sum(fringe_current(one, direction[None], field[None], observer[None])[0] for one in both_faces(ratio))
        # along theta-hat of the edge E is E_z over the sine, along phi-hat eta H_z is
        theta = np.array([np.cos(angle) * np.cos(azimuth), np.cos(angle) * np.sin(azimuth), -np.sin(angle)])
        phi = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        exact, plain = wedge.keller(ratio, source, azimuth), wedge.optics(ratio, source, azimuth)
        electric, magnetic = field[2], np.cross(direction, field.T)[:, 2]
        # E_z of the far field is -sin b E_theta, H_z is sin b E_phi over eta. Across, physical optics of one lit face
        # turns H into E at an oblique angle: the first polarisation has no E_z, the second no H_z
        assert -1j * -np.sin(angle) * (theta @ total)[1] == pytest.approx(2 * (exact[0] - plain[0]) * electric[1])
        assert -1j * np.sin(angle) * (phi @ total)[0] == pytest.approx(2 * (exact[1] - plain[1]) * magnetic[0])
        assert abs((phi @ total)[1]) < 1e-12


def test_strip_edge_on_scatters_like_a_half_plane() -> None:
    """The front edge of a thin strip, edge-on, E along it: sigma = L^2 / pi (both coefficients of Keller are -1/2)."""
    direction, field = np.array([[-1.0, 0, 0]]), np.array([[[0.0], [0.0], [1.0]]], dtype=complex)
    away = [Faces(np.array([[-1.0, 0, 0]]), np.array([[0, side, 0]]), np.array([2 * np.pi])) for side in (1.0, -1.0)]
    total = sum(fringe_current(one, direction, field, -direction)[0, 2, 0] for one in away)
    assert 4 * np.pi * abs(total / (4 * np.pi)) ** 2 == pytest.approx(1 / np.pi, rel=1e-9)


@pytest.mark.parametrize("ratio", OPENINGS)
def test_no_infinity_where_the_mirror_direction_is_observed(ratio) -> None:
    """Both the exact current and that of physical optics are infinite there; their difference is smooth."""
    field = np.array([[[0.3], [-0.2], [0.7]]], dtype=complex)
    observer = np.array([[np.cos(1), np.sin(1), 0]])
    turns, currents = np.array([-3e-2, -5e-3, -1e-7, 0.0, 1e-7, 5e-3, 3e-2]), []
    for turn in turns:
        direction, _ = wave(np.pi / 2, np.pi - 1 + turn)
        currents.append(fringe_current(face(ratio), direction[None], field, observer)[0, :, 0])
    found = np.array(currents)
    assert np.all(np.isfinite(found))
    slope = [(found[k] - found[-1 - k]) / (turns[k] - turns[-1 - k]) for k in (0, 1)]
    assert np.abs(slope[0] - slope[1]).max() < 0.02 * np.abs(slope[0]).max()
    assert np.abs(found[2:5] - found[[1, 5]].mean(axis=0)).max() < 1e-4


@pytest.mark.parametrize("ratio", OPENINGS)
def test_wave_far_across_a_face_is_the_exact_one(ratio) -> None:
    for source in (0.01, 1.0, 2.5, 3.1, 3.3, 3.8):
        if source > ratio * np.pi:
            continue
        for distance in (20.0, 60.0):
            exact = wedge.face_currents(ratio, source, np.array([distance]))[0][0]
            exact -= 2 * np.exp(1j * distance * np.cos(source)) * (source < np.pi)
            found = far_fringe(np.array(ratio), np.array(source), np.array(distance))
            assert abs(found - exact) < 3e-3


def test_transition_function() -> None:
    """Limits of Kouyoumjian and Pathak: 1 + j / (2 x) for large, sqrt(pi x) exp(j (pi / 4 + x)) for small arguments."""
    assert transition(np.array(200.0)) == pytest.approx(1 + 1j / 400, abs=1e-4)
    assert transition(np.array(1e-8)) == pytest.approx(np.sqrt(np.pi * 1e-8) * np.exp(0.25j * np.pi), rel=1e-3)
