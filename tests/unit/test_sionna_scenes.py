"""Sionna RT's built-in scenes and users' own XML run at 77 GHz with the project's materials."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from scarl_sionna.core.errors import MaterialError, MaterialRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine import variant
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.scene.materials.table import builtin_materials, load_materials

RADAR = RadarSpec()

# Place of a radar, height above the scene's lowest point [m], and materials that Sionna's own table lacks at 77 GHz
SCENES = [
    ("floor_wall", (-0.5, 0.2, 1.0), {"brick"}),
    ("simple_street_canyon", (0.3, 0.2, 1.5), {"brick", "marble"}),
]
MORE = [
    ("box", (0.3, 0.2, 1.5), set()),
    ("simple_street_canyon_with_cars", (0.3, 0.2, 1.5), {"brick", "marble"}),
    ("simple_wedge", (15.3, -14.8, 1.5), set()),
    ("double_reflector", (-5.0, 1.0, 2.0), set()),
]
BIG = [("etoile", (0.3, 0.2, 1.5), {"marble"}), ("munich", (10.0, 40.0, 1.5), {"marble"})]


def solve(name: str, place, lacking):
    world = load_scene(name)
    assert lacking <= set(world.parts.material)
    state = world.at(0.0)
    lowest = float(world._triangles.corners[..., 2].min())
    with variant.radio():
        pose = Pose([place[0], place[1], lowest + place[2]])
        return world, solve_paths(state, RADAR, pose, "sionna", num_samples=50_000, max_depth=2)


@pytest.mark.some(1)
@pytest.mark.parametrize(("name", "place", "lacking"), SCENES)
def test_built_in_scenes_solve_at_77_ghz(name: str, place, lacking) -> None:
    world, paths = solve(name, place, lacking)
    assert paths.num_paths > 0 and np.isfinite(paths.a).all()
    assert set(world.parts.material) <= set(builtin_materials())


@pytest.mark.slow
@pytest.mark.parametrize(("name", "place", "lacking"), BIG)
def test_cities_solve_at_77_ghz(name: str, place, lacking) -> None:
    world, paths = solve(name, place, lacking)
    assert len(world.parts.name) > 500 and paths.num_paths > 0 and np.isfinite(paths.a).all()


@pytest.mark.slow
@pytest.mark.parametrize(("name", "place", "lacking"), MORE)
def test_more_built_in_scenes_solve_at_77_ghz(name: str, place, lacking) -> None:
    test_built_in_scenes_solve_at_77_ghz(name, place, lacking)


@pytest.mark.slow
def test_every_built_in_scene_loads_with_known_materials() -> None:
    import sionna.rt as rt

    names = [
        name
        for name in dir(rt.scene)
        if isinstance(getattr(rt.scene, name), str) and getattr(rt.scene, name).endswith(".xml")
    ]
    small = [name for name in names if name not in ("munich", "etoile", "florence", "san_francisco")]
    assert len(small) >= 10
    for name in small:
        world = load_scene(name)
        for material in set(world.parts.material):
            assert world.materials[material].at(77e9).real >= 1.0, (name, material)


def xml(folder, bsdfs: str, used: str) -> str:
    trimesh.creation.box(extents=(2, 2, 2)).export(folder / "box.ply")
    path = folder / "own.xml"
    path.write_text(
        f"""<scene version="3.0.0">{bsdfs}
        <shape type="ply" id="mesh-box"><string name="filename" value="box.ply"/><ref id="{used}" name="bsdf"/></shape>
        </scene>"""
    )
    return str(path)


SLOW = pytest.mark.slow
OWN = [
    # Sionna's naming, as Blender exports it; a name of our table; Sionna's radio materials
    ('<bsdf type="diffuse" id="mat-itu_brick"/>', "mat-itu_brick", "brick"),
    pytest.param('<bsdf type="diffuse" id="asphalt_wet"/>', "asphalt_wet", "asphalt_wet", marks=SLOW),
    (
        '<bsdf type="itu-radio-material" id="road"><string name="type" value="asphalt_concrete"/></bsdf>',
        "road",
        "asphalt_concrete",
    ),
    pytest.param(
        '<bsdf type="itu-radio-material" id="pane"><string name="type" value="clear_acrylic"/></bsdf>',
        "pane",
        "clear_acrylic",
        marks=SLOW,
    ),
]


@pytest.mark.some(1)
@pytest.mark.parametrize(("bsdf", "used", "expected"), OWN)
def test_a_users_own_xml_gets_our_materials(tmp_path, bsdf: str, used: str, expected: str) -> None:
    state = load_scene(xml(tmp_path, bsdf, used)).at(0.0)
    assert state.world.parts.material == (expected,)
    with variant.radio():
        paths = solve_paths(state, RADAR, Pose([-8.0, 0.1, 0.2]), "sionna", num_samples=50_000, max_depth=1)
    assert paths.num_paths == 1
    q = np.sqrt(builtin_materials()[expected].at(RADAR.center_frequency))
    material = builtin_materials()[expected]
    if material.thickness is None:
        coherent = np.sqrt(1 - material.scattering_coefficient**2)
        coherent *= np.exp(
            -2 * (2 * np.pi * material.roughness_rms * RADAR.center_frequency / 299792458.0) ** 2
        )  # Ament, along the normal
        expected_level = abs((1 - q) / (1 + q)) * coherent * RADAR.wavelength / (4 * np.pi * 14.0)
        assert abs(paths.a[0, 0, 0]) == pytest.approx(expected_level, rel=1e-6)


def test_a_users_own_material_in_a_users_own_xml(tmp_path) -> None:
    table = tmp_path / "mine.toml"
    table.write_text(
        '[slate]\nrelative_permittivity = 6.5\nconductivity = 0.6\nsource = "mine"\nuncertainty = "10 %"\n'
    )
    path = xml(tmp_path, '<bsdf type="diffuse" id="slate"/>', "slate")
    with pytest.raises(MaterialError, match="unknown radio material 'slate'"):
        load_scene(path)
    world = load_scene(path, load_materials([table]))
    with variant.radio():
        paths = solve_paths(world.at(0.0), RADAR, Pose([-8.0, 0.1, 0.2]), "sionna", num_samples=50_000, max_depth=1)
    q = np.sqrt(world.materials["slate"].at(77e9))
    assert abs(paths.a[0, 0, 0]) == pytest.approx(
        abs((1 - q) / (1 + q)) * RADAR.wavelength / (4 * np.pi * 14.0), rel=1e-6
    )


def test_outside_the_band_the_error_names_what_has_data(tmp_path) -> None:
    state = load_scene(xml(tmp_path, '<bsdf type="diffuse" id="asphalt"/>', "asphalt")).at(0.0)
    with variant.radio(), pytest.raises(MaterialRangeError, match="'asphalt' has no data at 60.15 GHz.*concrete"):
        solve_paths(
            state, RADAR.with_(start_frequency=60e9), Pose([-8.0, 0.1, 0.2]), "sionna", num_samples=50_000, max_depth=1
        )
