"""Straight passage through panes, against the exact slab.

Coefficients, paths at three angles, two panes, antenna behind glass.
"""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine import variant
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.point_scatterers import PointScatterers
from scarl_sionna.radar.points import point_targets, solve_points
from scarl_sionna.radar.tuned import tuned_to
from scarl_sionna.scene.materials.fresnel import transmission
from scarl_sionna.scene.materials.table import MaterialTable, RadioMaterial, builtin_materials
from tests.oracles import multipath as oracle
from tests.oracles.fresnel import ITU_GLASS
from tests.scenes import Material, Thing, plane, write_scene

RADAR = tuned_to(RadarSpec().with_(pattern=IsotropicPattern(), bandwidth=150e6), 77e9)
FEW = {"num_samples": 20_000, "refraction": True, "max_depth": 2}

TRANSMITTED = (
    # permittivity, thickness [m], incidence [deg], TE, TM: (1 - G^2) e^{-jq} / (1 - G^2 e^{-2jq}), ITU-R P.2040-3, at
    # 77 GHz
    (ITU_GLASS, 0.004, 0, (-0.4925898717006, 0.3253405066365), (-0.4925898717006, 0.3253405066365)),
    (ITU_GLASS, 0.004, 30, (-0.5754610831286, 0.1315798284328), (-0.6166742024205, 0.130810927992)),
    (ITU_GLASS, 0.004, 60, (-0.3404986297651, -0.2724343628506), (-0.5900491814381, -0.3161991076485)),
    (2.35 - 0.002j, 0.003, 0, (0.3603788146002, -0.8526903209996), (0.3603788146002, -0.8526903209996)),
    (2.35 - 0.002j, 0.003, 30, (0.656285585906, -0.6697578833009), (0.7033218930225, -0.6693225051637)),
    (2.35 - 0.002j, 0.003, 60, (0.9548922815081, 0.2236536311118), (0.9834297623447, 0.1583655096004)),
    (2.6 + 0j, 0.001207294738957, 30, (-0.9795721861018, -0.1785331248333), (-0.9843986034787, -0.1651665941856)),
)


@pytest.fixture(autouse=True, scope="module")
def radio_variant():
    """Stay in one variant: each switch takes longer than a solve."""
    with variant.radio():
        yield


def sheet(permittivity: complex, thickness: float) -> RadioMaterial:
    return RadioMaterial(
        name="sheet",
        relative_permittivity=permittivity.real,
        conductivity=-permittivity.imag * 2 * np.pi * 77e9 * 8.8541878128e-12,
        thickness=thickness,
        source="the test's own",
        uncertainty="none",
    )


def against_air(thickness: float, incidence_deg: float) -> complex:
    """Phase of the air that the layer replaces."""
    return complex(np.exp(1j * oracle.WAVENUMBER * thickness * np.cos(np.radians(incidence_deg))))


@pytest.mark.parametrize(("permittivity", "thickness", "incidence_deg", "te", "tm"), TRANSMITTED)
def test_coefficients_match_the_exact_values(permittivity, thickness, incidence_deg, te, tm) -> None:
    found = transmission(sheet(permittivity, thickness), 77e9, np.cos(np.radians(incidence_deg)))
    air = against_air(thickness, incidence_deg)
    assert abs(found[0] - complex(*te) * air) < 1e-9 and abs(found[1] - complex(*tm) * air) < 1e-9  # 13 digits


def behind(folder, material: RadioMaterial, incidence_deg: float, panes=(5.0,)):
    """Return the paths to a point behind panes that a level ray meets at an angle, and those in free space."""
    things = [
        Thing(f"pane{k}", plane(16.0, 60.0, (x, 0, 0), (-1, 0, 0)), "Building", "pane") for k, x in enumerate(panes)
    ]
    table = MaterialTable([*builtin_materials().values(), material])
    state = load_scene(write_scene(folder, things, materials={"pane": Material(radio="sheet")}), table).at(0.0)
    target = [[10.0, 10.0 * np.tan(np.radians(incidence_deg)), 0.0]]
    points = PointScatterers(target, np.zeros((1, 3)), 1.0)
    paths = solve_points(state, RADAR, Pose(), points, specular=False, **FEW)
    return paths, point_targets(target, [[0, 0, 0]], 1.0, RADAR, Pose())


@pytest.mark.some(1)
@pytest.mark.parametrize(("permittivity", "thickness", "incidence_deg", "te", "tm"), TRANSMITTED[1:6:2])
def test_path_through_a_pane(tmp_path, permittivity, thickness, incidence_deg, te, tm) -> None:
    paths, free = behind(tmp_path, sheet(permittivity, thickness), incidence_deg)
    assert paths.num_paths == 1 and paths.interaction[0, :3].tolist() == [4, 0, 4]
    assert np.allclose(paths.tx_point, free.tx_point, atol=1e-12)
    ratio = paths.a[0] / free.a[0, 0, 0]
    air = against_air(thickness, incidence_deg)
    expected = np.diag(
        [(complex(*te) * air) ** 2, (complex(*tm) * air) ** 2]
    )  # upright pane, level ray: V is TE, H is TM
    # The bar of a dielectric plate is 0.1 dB. float32 corners of the pane: 1e-7 rad.
    assert np.allclose(ratio, expected, atol=1e-6)
    assert np.abs(20 * np.log10(np.abs(np.diag(ratio)) / np.abs(np.diag(expected)))).max() < 1e-4


def test_two_panes_multiply(tmp_path) -> None:
    glass = sheet(ITU_GLASS, 0.004)
    one, free = behind(tmp_path / "one", glass, 30.0)
    two, _ = behind(tmp_path / "two", glass, 30.0, panes=(4.0, 6.0))
    # Passed once each; what goes back and forth between them is of higher order and longer
    assert two.num_paths == 1 and two.depth[0] == 5
    assert np.allclose(two.a[0] / free.a[0, 0, 0], (one.a[0] / free.a[0, 0, 0]) ** 2, atol=1e-6)


def test_antenna_behind_glass(tmp_path) -> None:
    """Through a windscreen right in front of the radar, and mirrored in the ground behind it.

    All pairs of ways pass it twice.
    """
    glass = sheet(ITU_GLASS, 0.004)
    table = MaterialTable([*builtin_materials().values(), glass])
    things = [
        Thing("screen", plane(1.0, 1.0, (0.1, 0, 1.0), (-1, 0, 0)), "Car", "pane"),
        Thing("ground", plane(256.0, 256.0), "Roads", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things, materials={"pane": Material(radio="sheet")}), table).at(0.0)
    points = PointScatterers([[30.0, 0.0, 1.0]], np.zeros((1, 3)), 1.0)
    pose = Pose([0, 0, 1.0])
    paths = solve_points(state, RADAR, pose, points, num_samples=200_000, refraction=True)
    shut = solve_points(state, RADAR, pose, points, num_samples=200_000)
    assert shut.num_paths == 0  # without refraction the radar sees the windscreen only
    assert sorted(paths.depth.tolist()) == [3, 4, 4, 5]
    direct = paths.select(paths.depth == 3)
    free = RADAR.wavelength / (4 * np.pi) ** 1.5 / 900.0
    assert 20 * np.log10(abs(direct.a[0, 0, 0]) / free) == pytest.approx(
        2 * -4.578081505089, abs=1e-4
    )  # the vector's T, twice
    # The kind of interaction is drawn for each ray: the ground's share is found too, or the number of samples is too
    # small


def test_a_half_space_lets_nothing_through(tmp_path) -> None:
    solid = builtin_materials()["concrete"].with_(name="sheet")
    assert behind(tmp_path, solid, 30.0)[0].num_paths == 0
