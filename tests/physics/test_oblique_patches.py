"""Flat patches seen obliquely are rows of their corners and edges: against the exact surface integral."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.device import device
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import ChannelPlan, Share, solve_paths
from scarl_sionna.radar.optics.faces.oblique import Ends, edge_terms, is_oblique
from tests.oracles.near_field_po import rectangle_transfer
from tests.scenes import Thing, box, plane, write_scene

RADAR = RadarSpec(elevation_fov_deg=60.0)
WAVENUMBER = 2.0 * np.pi * RADAR.center_frequency / SPEED_OF_LIGHT
FIELD = SbrSettings(max_phase=3.0, integration_phase=0.1, max_depth=1, floor_db=None)


def field(paths, frequency: float = RADAR.center_frequency) -> complex:
    wave = np.exp(-2j * np.pi * frequency / SPEED_OF_LIGHT * paths.length)
    return complex(np.sum(paths.a[:, 0, 0] * wave))


def by_quadrature(corners, source, receiver, nodes: int = 400) -> complex:
    """Return the integral of w exp(-jk length) over a triangle, w of :func:`edge_terms`, by Duffy's map."""
    x, weight = np.polynomial.legendre.leggauss(nodes)
    x, weight = (x + 1.0) / 2.0, weight / 2.0
    s, t = np.meshgrid(x, x, indexing="ij")
    a, b, c = corners
    point = a + s[..., None] * (b - a) + (s * t)[..., None] * (c - b)
    jacobian = np.outer(weight * x, weight) * np.linalg.norm(np.cross(b - a, c - a))
    normal = np.cross(b - a, c - a) / np.linalg.norm(np.cross(b - a, c - a))

    def strength(point):
        legs = [point - source, point - receiver]
        far = [np.linalg.norm(leg, axis=-1) for leg in legs]
        cosines = [np.abs(leg @ normal) / d for leg, d in zip(legs, far, strict=True)]
        return (cosines[0] + cosines[1]) / (far[0] * far[1]), far[0] + far[1]

    value, length = strength(point)
    return complex(np.sum(value / strength(corners.mean(axis=0))[0] * np.exp(-1j * WAVENUMBER * length) * jacobian))


@pytest.mark.some(1)
@pytest.mark.parametrize("turn_deg", [20.0, 45.0, 70.0])
def test_corners_and_edges_are_the_integral_over_a_triangle(turn_deg: float) -> None:
    """Random triangles of 5 to 20 cm, 8 m away, bistatic: within the part that is left out, 2 %, and 200 times less."""
    rng = np.random.default_rng(int(turn_deg))
    turn = np.radians(turn_deg)
    axes = np.array([[0.0, 1.0, 0.0], [np.sin(turn), 0.0, np.cos(turn)]])  # of the face; the ray runs along x
    corners = rng.uniform(-0.1, 0.1, (20, 3, 2)) @ axes + np.array([8.0, 0.0, 0.0])
    source, receiver = np.zeros(3), np.array([0.0, 0.3, 0.2])
    with device() as on:
        corner = on.corners(corners)
        ends = Ends(corner, on.vector(source), on.vector(receiver), WAVENUMBER)
        oblique = is_oblique(on.dr, ends).numpy()
        terms = np.array([re.numpy() + 1j * im.numpy() for re, im in edge_terms(on, ends)])
    assert oblique.all()
    middles = (corners + np.roll(corners, -1, axis=1)) / 2.0
    points = np.concatenate([corners, middles], axis=1)
    length = np.linalg.norm(points - source, axis=2) + np.linalg.norm(points - receiver, axis=2)
    found = np.einsum("en,ne->n", terms, np.exp(-1j * WAVENUMBER * length))
    expected = np.array([by_quadrature(one, source, receiver) for one in corners])
    scale = np.abs(terms).max(axis=0)  # the parts may cancel
    assert np.abs(found - expected).max() < 0.02 * scale.max()
    assert np.median(np.abs(found - expected) / scale) < 0.01


def test_a_face_seen_head_on_is_not_oblique() -> None:
    corners = np.array([[[8.0, -0.1, 0.0], [8.0, 0.1, 0.0], [8.0, 0.0, 0.1]]])
    with device() as on:
        ends = Ends(on.corners(corners), on.vector(np.zeros(3)), on.vector(np.zeros(3)), WAVENUMBER)
        assert not is_oblique(on.dr, ends).numpy().any()
        moving = ends._replace(steady=1e6)
        assert not is_oblique(on.dr, moving).numpy().any()


@pytest.mark.some(1)
@pytest.mark.parametrize("aspect_deg", [12.0, 30.0, 50.0])
def test_a_large_oblique_plate_is_exact_over_the_band_with_a_few_rows(tmp_path, aspect_deg: float) -> None:
    """1 m x 0.5 m at 12 m, patches of 3 rad (0.3 m), 30 dB and more below its flash: 0.1 dB over 300 MHz."""
    aspect = np.radians(aspect_deg)
    side = np.array([np.sin(aspect), np.cos(aspect), 0.0])
    up = np.array([0.0, 0.0, 0.5])
    origin = np.array([12.0, 0.0, 0.1]) - side / 2.0
    mesh = plane(2.0, 1.0, (0.0, 0.0, 0.0))
    mesh.vertices = origin + np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float) @ np.array([side, up])
    mesh.faces = [[0, 1, 2], [0, 2, 3]]
    state = load_scene(write_scene(tmp_path, [Thing("plate", mesh, "Static", "steel")])).at(0.0)
    paths = solve_paths(state, RADAR, Pose(), "sbr", sbr=FIELD)
    band = RADAR.center_frequency + RADAR.sampled_bandwidth * np.linspace(-0.5, 0.5, 5)
    found = np.array([field(paths, frequency) for frequency in band])
    exact = np.array(
        [rectangle_transfer(origin, side, up, np.zeros(3), SPEED_OF_LIGHT / f, 2.0 * up, nodes=900) for f in band]
    )
    assert 10.0 * np.log10(np.mean(np.abs(found) ** 2) / np.mean(np.abs(exact) ** 2)) == pytest.approx(0.0, abs=0.1)
    assert np.linalg.norm(found - exact) < 0.03 * np.linalg.norm(exact)  # CURVATURE is 2 %
    assert paths.num_paths < 100


def test_what_is_partly_out_of_view_is_cut_there(tmp_path) -> None:
    """A wall across the edge of the field of view is that part of it which is inside, whatever the patches."""
    edge = 10.0 * np.tan(np.radians(60.0))
    levels = []
    for name, end in (("whole", edge + 3.0), ("inside", edge)):
        wall = box((0.1, end - 10.0, 1.0), (10.05, (end + 10.0) / 2.0, 0.0))
        state = load_scene(write_scene(tmp_path / name, [Thing("wall", wall, "Wall", "steel")])).at(0.0)
        for phase in (3.0, 0.5):
            knobs = FIELD.with_(max_phase=phase)
            levels.append(20.0 * np.log10(abs(field(solve_paths(state, RADAR, Pose(), "sbr", sbr=knobs)))))
    assert np.ptp(levels) < 0.3


def test_the_way_to_the_mirror_is_hidden_by_what_stands_there(tmp_path) -> None:
    """A screen on the road hides all ways by the ground that pass it, before the reflection or behind it.

    Image theory: the plate's points from 1 to 3 m at x = 20 m reflect at x = 20 * 0.6 / (0.6 + z), 3.3 to 7.5 m, before
    and behind a screen of 0.3 m at x = 6 m.
    """
    plate = box((0.1, 2.0, 2.0), (20.05, 0.0, 2.0))

    def ground_paths(screen: bool, phase: float):
        things = [
            Thing("road", plane(30.0, 30.0, (15.0, 0.0, 0.0)), "Roads", "steel", is_object=False),
            Thing("plate", plate, "Static", "steel"),
        ]
        if screen:
            things.append(Thing("screen", box((0.2, 6.0, 0.3), (6.0, 0.0, 0.15)), "Static", "steel"))
        folder = tmp_path / f"{screen}{phase}"
        state = load_scene(write_scene(folder, things)).at(0.0)
        share = Share("sbr", ("plate",), SbrSettings(max_phase=phase, max_depth=1, floor_db=None), through_mirrors=True)
        plan = ChannelPlan((share,), ("road",), echoes=False)
        paths = solve_paths(state, RADAR, Pose([0.0, 0.0, 0.6]), "hybrid", plan=plan)
        return paths.select((paths.instance[:, 0] == 1) & (paths.depth == 3))

    def open_heights() -> tuple[float, float]:
        """Heights of the plate's points whose ray passes the screen, 5.9 to 6.1 m, 0.3 m high, by image theory."""
        z = np.linspace(1.0, 3.0, 20001)
        met = 20.0 * 0.6 / (0.6 + z)
        clear = np.ones(len(z), dtype=bool)
        for x in np.linspace(5.9, 6.1, 21):
            height = np.where(x < met, 0.6 * (1.0 - x / met), z * (x - met) / (20.0 - met))
            clear &= height > 0.3
        return float(z[clear].min()), float(z[clear].max())

    low, high = open_heights()
    assert low > 1.2  # the screen hides a part of the plate
    free, hidden = ground_paths(False, 1.0), ground_paths(True, 1.0)
    assert -free.rx_point[:, 2].max() < 1.01  # as the radar sees them: mirrored
    assert -hidden.rx_point[:, 2].max() == pytest.approx(low, abs=0.01)
    assert -hidden.rx_point[:, 2].min() == pytest.approx(high, abs=0.01)
    levels = [20.0 * np.log10(abs(field(ground_paths(True, phase)))) for phase in (2.0, 0.5)]
    assert levels[0] == pytest.approx(levels[1], abs=0.2)
