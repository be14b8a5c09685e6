"""The one physical optics: its formulas on NumPy and on Dr.Jit, its settings for a body and for a scene."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.device import device
from scarl_sionna.engine.rays.geometry import Triangles
from scarl_sionna.radar.optics import spherical_waves
from scarl_sionna.radar.optics.fields import (
    HOST,
    SERIES_BELOW,
    OnDevice,
    Wave,
    radiating_vector,
    reflected_field,
    second_difference,
)
from scarl_sionna.radar.optics.patches import PatchSize
from scarl_sionna.radar.optics.phase import many_plane_wave_integrals, plane_wave_integral
from scarl_sionna.radar.optics.surfaces import Surface
from scarl_sionna.radar.optics.tubes.trace import Tubes, depth_first, face_of_plane, landing

COUNT = 200
GLASS = Surface(6.3 - 0.5j, 4e-3, 77e9, 0.9)


def unit(rng: np.random.Generator) -> np.ndarray:
    vectors = rng.normal(size=(COUNT, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def lit(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return directions, normals on the lit side, and transverse fields of two polarisations.

    One of ten hits head-on.
    """
    direction, normal = unit(rng), unit(rng)
    normal[::10] = -direction[::10]
    normal *= -np.sign(np.einsum("ij,ij->i", direction, normal))[:, None]
    field = rng.normal(size=(COUNT, 3, 2)) + 1j * rng.normal(size=(COUNT, 3, 2))
    field -= HOST.along(direction, HOST.component(direction, field))
    return direction, normal, field


def on_device(on, field: np.ndarray) -> list:
    return [(on.vectors(field[:, :, p].real), on.vectors(field[:, :, p].imag)) for p in range(2)]


def on_host(field: list) -> np.ndarray:
    return np.stack([(re.numpy() + 1j * im.numpy()).T for re, im in field], axis=2)


def test_reflection_and_currents_are_the_same_on_both_arithmetics() -> None:
    rng = np.random.default_rng(1)
    direction, normal, field = lit(rng)
    scattered = unit(rng)
    expected, onward = GLASS.reflect(field, direction, normal)
    vector = radiating_vector(HOST, Wave(field, direction), Wave(expected, onward), normal, scattered)
    with device() as on:
        kernel = OnDevice(on.dr)
        te, tm = GLASS.coefficients(-np.einsum("ij,ij->i", direction, normal))

        def coefficients(cosine):
            assert np.allclose(cosine.numpy(), -np.einsum("ij,ij->i", direction, normal), atol=1e-15)
            return [(on.reals(GLASS.coherence * c.real), on.reals(GLASS.coherence * c.imag)) for c in (te, tm)]

        d, n, s = (on.vectors(v) for v in (direction, normal, scattered))
        found, went = reflected_field(kernel, coefficients, on_device(on, field), d, n)
        currents = radiating_vector(kernel, Wave(on_device(on, field), d), Wave(found, went), n, s)
        # head-on any tangent serves: TE and TM differ by their sign only, so the field does not depend on it
        assert np.abs(on_host(found) - expected).max() < 1e-13
        assert np.abs(went.numpy().T - onward).max() < 1e-14
        assert np.abs(on_host(currents) - vector).max() < 1e-13


def test_a_conductor_is_the_limit_of_the_formula() -> None:
    direction, normal, field = lit(np.random.default_rng(2))
    short, onward = Surface().reflect(field, direction, normal)
    whole, same = reflected_field(HOST, Surface().coefficients, field, direction, normal)
    assert np.abs(short - whole).max() < 1e-13 and np.abs(onward - same).max() < 1e-14


def test_divided_difference_is_the_same_on_both_arithmetics_and_smooth_where_the_series_ends() -> None:
    rng = np.random.default_rng(3)
    phase = rng.normal(size=(3, COUNT)) * 10.0 ** rng.uniform(-6, 3, COUNT)
    phase -= phase.mean(axis=0)
    expected = second_difference(HOST, *phase)
    with device() as on:
        found = second_difference(OnDevice(on.dr), *(on.reals(one) for one in phase))
        for one, other in zip(found, expected, strict=True):
            assert np.abs(one.numpy() - other).max() < 1e-15
    a, c = -0.6 * SERIES_BELOW, 0.4 * SERIES_BELOW  # their difference is where the branches meet
    below, above = (
        np.array(second_difference(HOST, *(np.array([v * (1 + s)]) for v in (a, -a - c, c)))) for s in (-1e-12, 1e-12)
    )
    assert np.abs(below - above).max() < 1e-11  # the slope is below 1, the step 2e-12


def test_single_precision_of_many_aspects_is_the_exact_integral() -> None:
    rng = np.random.default_rng(4)
    corners = 0.05 * rng.normal(size=(COUNT, 1, 3)) + 0.01 * rng.normal(size=(COUNT, 3, 3))
    q = 1600.0 * rng.normal(size=(4, 3))
    twice_area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    found = many_plane_wave_integrals(corners, twice_area, q)
    for row, vector in zip(found, q, strict=True):
        exact = plane_wave_integral(corners, np.broadcast_to(vector, (COUNT, 3)))
        # phases of some 300 rad in float32 are 3e-5 rad off, the integral is at most half of twice the area
        assert np.abs(row - exact).max() < 1e-4 * 0.5 * twice_area.max()


def test_settings_of_a_body_follow_its_size_where_nothing_is_said() -> None:
    fine, car = SbrSettings().for_size(100.0), SbrSettings().for_size(1100.0)
    assert (fine.ray_spacing, fine.edge_spacing, fine.bisections) == (1.0, 0.25, 11)
    assert (car.ray_spacing, car.edge_spacing, car.bisections) == (8.0, 4.0, 5)
    given = SbrSettings(ray_spacing=2.0, edge_spacing=0.5).for_size(1100.0)
    assert (given.ray_spacing, given.edge_spacing, given.bisections) == (2.0, 0.5, 11)
    assert SbrSettings(edge_spacing=2.0).for_size(10.0).ray_spacing == 2.0  # never finer than the edges
    assert SbrSettings(ray_spacing=0.1).for_size(10.0).edge_spacing == 0.1
    assert SbrSettings(bisections=7).for_size(1100.0).bisections == 7
    assert car.for_size(3.0) == car  # once is enough


def test_settings_of_a_scene_follow_the_distance_or_are_in_wavelengths_too() -> None:
    side = np.array([0.1, 0.2])
    wide, fine = SbrSettings(ray_share=0.5, edge_share=0.25).spacings(0.004, side)
    assert np.allclose(wide, 0.5 * side) and np.allclose(fine, 0.25 * side)
    wide, fine = SbrSettings(ray_spacing=8.0, edge_spacing=2.0).spacings(0.004, side)
    assert np.allclose(wide, 0.032) and np.allclose(fine, 0.008)
    assert SbrSettings().for_scene().bisections == 9
    with pytest.raises(ParameterRangeError, match="for_size"):
        SbrSettings().spacings(0.004)


def test_landing_is_the_projection_of_parallel_and_of_central_rays() -> None:
    rng = np.random.default_rng(5)
    corners, normal, offset = rng.normal(size=(COUNT, 3, 3)), unit(rng), rng.normal(size=COUNT)
    direction, source = unit(rng), rng.normal(size=(COUNT, 3))
    for ray in (direction[:, None], corners - source[:, None]):
        share, slope = landing(corners, ray, normal, offset)
        points = corners + share[:, :, None] * ray
        height = np.einsum("nij,nj->ni", points, normal) - offset[:, None]
        assert np.abs(height / (1.0 + np.abs(share))).max() < 1e-13
        assert np.allclose(slope, np.einsum("nij,nj->ni", ray, normal))


def test_planes_are_named_by_their_first_face() -> None:
    assert face_of_plane(np.array([2, 0, 2, 5, 0])).tolist() == [1, 0, 0, 0, 0, 3]


def test_bounces_go_deep_before_they_go_wide() -> None:
    order = []

    def arrive(depth: int, tubes: Tubes):
        order.append((depth, len(tubes)))
        yield tubes

    def go_on(tubes: Tubes):
        return tubes.batches(max(len(tubes) // 2, 1))

    tubes = Tubes(np.arange(36.0).reshape(4, 3, 3))
    assert len(list(depth_first([tubes, tubes], arrive, go_on, 2))) == 6
    assert order == [(1, 4), (2, 2), (2, 2)] * 2
    joined = Tubes.joined(tubes.batches(3))
    assert np.array_equal(joined.corners, tubes.corners)
    assert np.array_equal(tubes.take(np.array([2])).corners, tubes.corners[2:3])


def two_way(size: PatchSize, points: np.ndarray, source: np.ndarray, receiver: np.ndarray) -> np.ndarray:
    """Return the phase of the ways from the source by points to the receiver [rad]."""
    length = np.linalg.norm(points - source, axis=-1) + np.linalg.norm(points - receiver, axis=-1)
    return size.wavenumber * length


@pytest.mark.parametrize("apart", [0.0, 7.0])
def test_a_side_is_too_long_by_the_quadratic_phase_over_it(apart: float) -> None:
    """Against the phases at both ends and the middle of each side, wherever the world's origin is."""
    rng = np.random.default_rng(8)
    source, receiver = np.array([30.0, -20.0, 11.0]), np.array([30.0, -20.0 + apart, 11.0])
    size = PatchSize(1600.0, 0.0, 0.0, 0.2, 0.5)
    center = source + 40.0 * unit(rng)
    side = rng.normal(size=(COUNT, 3))
    # across both legs, so that the sagitta is the part of the phase that is quadratic; elsewhere it is the leading one
    normal = np.cross(center - source, center - receiver) if apart else np.cross(center - source, side)
    side = normal / np.linalg.norm(normal, axis=1)[:, None] * rng.uniform(0.05, 0.1, COUNT)[:, None]
    third = 0.02 * unit(rng)
    first = center - side / 2.0 - third / 3.0
    corners = np.stack([first, first + side, center + third * 2.0 / 3.0], axis=1)
    found = size.excess(corners, source[None], np.zeros(COUNT, np.int64), receiver)[:, 0]
    ends = two_way(size, corners[:, :2], source, receiver)
    sagitta = np.abs(ends.mean(axis=1) - two_way(size, corners[:, :2].mean(axis=1), source, receiver))
    np.testing.assert_allclose(found, np.sqrt(sagitta / 0.2), rtol=0.01)
    np.testing.assert_allclose(size.length(np.array([40.0])), np.sqrt(4.0 * 0.2 * 40.0 / 1600.0))


def test_a_side_is_too_long_by_what_another_antenna_or_frequency_turns_over_it() -> None:
    """At half a side: k D e / R for an antenna D from the centre, half the band times the difference of the ways."""
    radar = RadarSpec()
    size = replace(PatchSize.of(radar, SbrSettings()), max_phase=1e9)
    arms = np.linalg.norm(np.concatenate([radar.tx_array, radar.rx_array]), axis=1)
    source = np.array([5.0, 6.0, 7.0])
    point = replace(size, aperture=0.0)
    tilted, edge_on = 0.5 * np.array([np.sin(0.03), np.cos(0.03), 0.0]), np.array([0.5, 0.0, 0.0])
    band = np.pi * radar.sampled_bandwidth / 299792458.0
    for limits, side, wanted in (
        (size, (0.0, 0.02, 0.0), 2.0 * np.pi * radar.center_frequency / 299792458.0 * arms.max() * 0.02 / 9.0),
        (point, tilted, band * tilted[0]),
        (point, edge_on, 0.0),  # its edges represent it, right over the band
    ):
        corners = np.array([[[9.0, 0.0, 0.0], [9.0, 0.0, 0.0], [9.0, 0.0, 1e-6]]])
        corners[0, 0] -= np.array(side) / 2.0
        corners[0, 1] += np.array(side) / 2.0
        found = limits.excess(corners + source, source[None], np.zeros(1, np.int64), source)[0, 0]
        assert found == pytest.approx(wanted / 0.5, rel=1e-3, abs=1e-9)
    slanted = np.array([[[9.0, 0.0, 0.0], [9.05, 0.05, 0.0], [9.0, 0.05, 0.0]]]) + source
    phases = PatchSize(1600.0, 0.0, 0.0, 0.2, 0.5).excess(slanted, source[None], np.zeros(1, np.int64), source)[0]
    across = np.sqrt(1600.0 * 2.0 * 0.05**2 / 9.0 / 8.0 / 0.2)
    assert phases == pytest.approx([across, 0.0, across], abs=0.005)  # only what lies across the ways; 0.05 m of 9 m
    long = PatchSize(1e-3, 0.0, 0.0, 3.0, 0.5, longest=0.25)
    assert long.excess(corners + source, source[None], np.zeros(1, np.int64), source)[0, 0] == pytest.approx(2.0)
    assert size.excess(corners[:0], source[None], np.zeros(0, np.int64), source).shape == (0, 3)


@pytest.mark.parametrize("given_in_wavelengths", [False, True])
def test_grazed_footprints_are_not_cut_along_edges(given_in_wavelengths) -> None:
    """Below a cosine of 0.02 rays have no spacing; above, shares of the side that the phase allows or wavelengths."""
    radar, settings = RadarSpec(), SbrSettings(grazing_cosine=0.02).for_scene()
    if given_in_wavelengths:
        settings = settings.with_(ray_spacing=8.0, edge_spacing=2.0)
    floor = np.array([[0.0, -1e3, 2.0], [1e3, 0.0, 2.0], [0.0, 1e3, 2.0]])  # its normal is +z
    faces = SimpleNamespace(triangles=Triangles.from_meshes([floor], [np.array([[0, 1, 2]])]))
    size = PatchSize.of(radar, settings)
    tracer = spherical_waves.Tracer(None, faces, np.ones(1, bool), np.full(1, 1e3), None, None, 1e3, size, settings)
    sine = np.array([0.0195, 0.0205, 0.0195, 0.0205, 0.5, 1.0])
    distance = np.array([0.3, 0.3, 200.0, 200.0, 40.0, 40.0])
    for side in (1.0, -1.0):  # seen from above or from below
        source = np.array([5.0, 6.0, 2.0 + side * 3.0])
        middle = source + distance[:, None] * np.column_stack([np.sqrt(1.0 - sine**2), 0.0 * sine, -side * sine])
        triangle = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 2.0, 0.0]]) * 1e-3
        tubes = spherical_waves.ImageTubes(
            middle[:, None] + triangle,
            np.zeros((6, 1), np.int64),
            np.tile(source, (6, 1, 1)),
            np.arange(6),
            *np.full((2, 6, 4), -1),
        )
        found = tracer._spacings(tubes, source, is_way_in=True)
        length = np.sqrt(4.0 * size.max_phase * distance / size.wavenumber)
        wide, fine = settings.ray_share * length, settings.edge_share * length
        if given_in_wavelengths:
            wide, fine = (number * 299792458.0 / radar.center_frequency for number in (8.0, 2.0))
        grazed = np.array([True, False, True, False, False, False])
        np.testing.assert_allclose(found.wide, np.where(grazed, np.inf, wide), rtol=1e-6)
        np.testing.assert_allclose(found.fine, np.where(grazed, np.inf, fine), rtol=1e-6)
