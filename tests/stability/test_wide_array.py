"""One solve for a wide array.

To -60 dB where all antennas see the path, dielectric mirrors included; reported where they do not.
"""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.plan import ChannelPlan, Share
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine import variant
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.point_scatterers import PointScatterers
from scarl_sionna.radar.points import solve_points
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.scene.materials.table import MaterialTable, builtin_materials
from tests.scenes import Material, Thing, box, plane, write_scene

ARMS = tuple((0.0, float(y), 0.0) for y in np.linspace(-0.5, 0.5, 5))
SINGLE = RadarSpec().with_(
    pattern=IsotropicPattern(),
    bandwidth=150e6,
    num_chirps=1,
    num_samples=64,
    tx_positions=((0, 0, 0),),
    rx_positions=((0, 0, 0),),
)
WIDE = SINGLE.with_(rx_positions=ARMS)
FEW = {"num_samples": 20_000, "max_depth": 1}
ORIGIN = np.zeros((1, 3))


@pytest.fixture(autouse=True, scope="module")
def radio_variant():
    """Stay in one variant: each switch takes longer than a solve."""
    with variant.radio():
        yield


@pytest.mark.some(1)
@pytest.mark.parametrize("mirror", ["steel", "glass", "pattern"])
def test_signal_of_every_antenna_at_5_m(tmp_path, mirror: str) -> None:
    """Complex signal of a 1 m array, walls and target at 5 m, against one solve for each antenna: the bar is -60 dB.

    For metal the reflection coefficient does not depend on the angle. Half a metre at 5 m aside that of concrete is
    5.6e-3 another, which paths follow to first order; a cosine pattern has 5e-2 less gain there.
    """
    smooth = builtin_materials()[{"steel": "metal"}.get(mirror, "concrete")].with_(
        name="smooth", scattering_coefficient=0.0, roughness_rms=0.0
    )
    table = MaterialTable([*builtin_materials().values(), smooth])
    wall = Thing("wall", plane(32.0, 64.0, (5, 0, 0), (-1, 0, 0)), "Wall", "face")
    state = load_scene(write_scene(tmp_path, [wall], materials={"face": Material(radio="smooth")}), table).at(0.0)
    points = PointScatterers([[3.0, 4.0, 0.5]], ORIGIN, 10.0)
    pattern = RadarSpec().array.pattern if mirror == "pattern" else IsotropicPattern()
    wide, single = WIDE.with_(pattern=pattern), SINGLE.with_(pattern=pattern)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        paths = solve_points(state, wide, Pose(), points, **FEW)
    together = synthesize(paths, wide)[:, 0]
    worst = []
    for antenna, arm in enumerate(ARMS):
        alone = solve_points(state, single, Pose(), points, receiver=Pose(arm), **FEW)
        expected = synthesize(alone, single)[0, 0]
        worst.append(20 * np.log10(max(np.abs(together[antenna] - expected).max(), 1e-30) / np.abs(expected).max()))
    assert worst[2] < -100.0  # the antenna at the centre
    assert max(worst) < -60.0
    unknown = replace(paths, tx_slope=None, rx_slope=None)  # the same with the coefficients of the centre
    plain = synthesize(unknown, wide)[0, 0]
    error = np.abs(plain - together[0]).max() / np.abs(together[0]).max()
    # V of a level ray at a level normal is TE: 8e-6 of change of the metal's coefficient
    least, most = {"steel": (0.0, 1e-4), "glass": (3e-3, 1e-2), "pattern": (3e-2, 0.1)}[mirror]
    assert least <= error < most


def errors_of_bodies(state, wide: RadarSpec, single: RadarSpec) -> list[float]:
    """Error of each antenna's signal by `sbr` against a solve for it alone [dB]."""
    fine = {"max_phase": 0.05, "edge_share": 0.0625, "floor_db": None, "diffuse": False}
    together = synthesize(solve_paths(state, wide, Pose(), "sbr", **fine), wide)[:, 0]
    found = []
    for antenna, arm in enumerate(ARMS):
        alone = synthesize(solve_paths(state, single, Pose(), "sbr", receiver=Pose(arm), **fine), single)[0, 0]
        found.append(float(20 * np.log10(np.abs(together[antenna] - alone).max() / np.abs(alone).max())))
    return found


@pytest.mark.some(2)
@pytest.mark.parametrize("pattern", ["isotropic", "default"])
@pytest.mark.parametrize("shape", ["plate", "box"])
def test_bodies_before_a_wide_array(tmp_path, shape: str, pattern: str) -> None:
    """A 1 m array, 5 m: transfers to first order, gains of each antenna, edges that keep their strength over it.

    With the centre's: the plate of concrete -44 dB isotropic, -30 dB with the pattern; the box -17 dB by its edges.
    What is left at the ends is second order, (0.5 / 5)^2 / 2; the middle of a half it is within -53 dB.
    """
    mesh = plane(0.3, 0.3, (4.5, 1.5, 0), (-3, -1, 0)) if shape == "plate" else box((0.3, 0.2, 0.4), (4.5, 1.5, 0))
    material = "face" if shape == "plate" else "steel"
    things = [Thing("body", mesh, "Car", material)]
    state = load_scene(write_scene(tmp_path, things, materials={"face": Material(radio="concrete")})).at(0.0)
    kind = IsotropicPattern() if pattern == "isotropic" else RadarSpec().array.pattern
    found = errors_of_bodies(state, WIDE.with_(pattern=kind), SINGLE.with_(pattern=kind))
    assert max(found) < -40.0
    if shape == "plate":
        assert max(found[1:4]) < -53.0 and found[2] < -80.0


def test_an_array_that_is_not_wide_has_one_transfer(tmp_path) -> None:
    state = load_scene(write_scene(tmp_path, [Thing("body", box((0.3, 0.2, 0.4), (4.5, 1.5, 0)), "Car", "steel")]))
    paths = solve_paths(state.at(0.0), RadarSpec(), Pose(), "sbr")
    assert paths.tx_slope is None and paths.over_time is None


def test_antennas_that_do_not_see_the_path_are_told(tmp_path) -> None:
    short = Thing("wall", plane(4.0, 8.0, (5.0, 0, 0), (-1, 0, 0)), "Wall", "steel")
    state = load_scene(write_scene(tmp_path, [short])).at(0.0)
    edge = 4.0 if np.ptp(short.mesh.vertices[:, 1]) > 6 else 2.0
    # Monostatic echo of the wall at right angles, its reflection point 0.2 m from the wall's end, where the array ends
    # at 0.5 m
    pose = Pose([0.0, edge - 0.2, 0.0])
    with pytest.warns(ScarlWarning, match="1 of 1 path.s. are not seen by all antennas"):
        paths = solve_paths(state, WIDE, pose, "sionna", **FEW)
    assert paths.num_paths == 1 and paths.diagnostics["num_hidden_from_antennas"] == 1
    outer = solve_paths(state, SINGLE, Pose(pose.position + ARMS[-1]), "sionna", **FEW)
    assert outer.num_paths == 0  # so the warning is right: alone, this antenna has no echo
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        inside = solve_paths(state, WIDE, Pose([0.0, edge - 1.0, 0.0]), "sionna", **FEW)
        small = SINGLE.with_(rx_positions=((0, 0.02, 0), (0, -0.02, 0)))
        solve_paths(
            state, small, pose, "sionna", **FEW
        )  # smaller than the Fresnel zone: no question of single antennas
    assert inside.num_paths == 1 and inside.diagnostics["num_hidden_from_antennas"] == 0


def test_an_obstacle_before_some_antennas_is_told(tmp_path) -> None:
    post = Thing("post", box((0.2, 0.2, 4), (2.0, -0.45, 0)), "Pole", "steel")
    state = load_scene(write_scene(tmp_path, [post])).at(0.0)
    points = PointScatterers([[30.0, 0.0, 0.0]], ORIGIN, 1.0)
    with pytest.warns(ScarlWarning, match="not seen by all antennas"):
        paths = solve_points(state, WIDE, Pose(), points, **FEW)
    assert paths.num_paths == 1
    hidden = solve_points(state, SINGLE, Pose(ARMS[0]), points, **FEW)
    assert hidden.num_paths == 0


def test_bodies_over_mirrors_change_over_a_wide_array(tmp_path) -> None:
    """A box over the ground, 1 m beside the outermost antenna: to first order 13 dB better than by the centre alone.

    The axes of what changes are those of the radar, not of its image.
    """
    things = [
        Thing("ground", plane(60.0, 60.0, (10, 0, -0.4)), "Ground", "steel", is_object=False),
        Thing("box", box((0.3, 0.4, 0.3), (9, 0.5, 0.1)), "Static", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    share = Share("sbr", ("box",), SbrSettings(floor_db=None, max_depth=1), through_mirrors=True)
    plan = ChannelPlan((share,), ("ground",), echoes=False)

    def ghosts(radar: RadarSpec, pose: Pose):
        paths = solve_paths(state, radar, pose, "hybrid", plan=plan, max_distance=40.0)
        return paths.select(paths.depth > 1)

    radar = SINGLE.with_(rx_positions=(*ARMS[:1], *ARMS[-1:]), tx_positions=ARMS[:1])
    there, alone = ghosts(radar, Pose()), synthesize(ghosts(SINGLE, Pose(list(ARMS[0]))), SINGLE).ravel()

    def error_db(paths) -> float:
        off = synthesize(paths, radar)[0].ravel() - alone
        return float(20.0 * np.log10(np.linalg.norm(off) / np.linalg.norm(alone)))

    assert error_db(there) < -12.0
    assert error_db(replace(there, tx_slope=None, rx_slope=None)) > -3.0
