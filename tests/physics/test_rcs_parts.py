"""ss.rcs and compile_scatterers of bodies of several materials.

Each part reflects as its own, shadows and bounces are common.
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.errors import MeshError, ParameterRangeError, UnknownNameError
from scarl_sionna.radar.optics.body.parts import actor_parts, load_body
from scarl_sionna.radar.rcs import scattering_matrix
from scarl_sionna.radar.scatterers.compile import compile_scatterers
from scarl_sionna.scene.materials.table import RadioMaterial, UnknownMaterialError
from scarl_sionna.scene.motion.trajectory import WaypointTrajectory
from tests.oracles import fresnel
from tests.oracles import rcs as oracle
from tests.scenes import Thing, write_scene

F77 = 77e9
PLATE = trimesh.Trimesh(0.1 * np.array(oracle.PLATE_MESH[0]), oracle.PLATE_MESH[1], process=False)
DIHEDRAL = trimesh.Trimesh(0.1 * np.array(oracle.DIHEDRAL_MESH[0]), oracle.DIHEDRAL_MESH[1], process=False)
RESIN = RadioMaterial(
    name="resin",
    relative_permittivity=4.0,
    conductivity=0.0,
    source="test",
    uncertainty="none",
    scattering_coefficient=0.6,
)
SEAM = (np.pi / 2, np.pi / 4)


def faces_of(mesh, rows):
    return trimesh.Trimesh(mesh.vertices, mesh.faces[rows], process=False)


def test_the_field_is_the_sum_of_the_parts():
    """Two plates side by side, head-on, in one plane.

    -j A / lambda of the metal one, a third of that of the resin (2 - 1) / (2 + 1).
    """
    beside = PLATE.copy().apply_translation([0.1, 0.0, 0.0])
    for parts in ([(PLATE, "metal"), (beside, RESIN)], {"metal": PLATE, 4.0: beside}):
        found = scattering_matrix(parts, F77, 0.0, 0.0)[0, 0]
        assert found == pytest.approx(-1j * 0.01 / oracle.WAVELENGTH_77 * (1 + 1 / 3), rel=1e-9)


@pytest.mark.parametrize("coated", [0, 1])
def test_a_dihedral_of_two_materials(coated):
    """At the seam both bounces are at 45 deg.

    The level is that of metal times one Fresnel coefficient, whichever face has it.

    The seam is vertical, so V is TE and H is TM. The faces' own echoes are -42 dB: 0.07 dB of metal, 0.3 dB where TM is
    weak.
    """
    halves = [faces_of(DIHEDRAL, slice(0, 2)), faces_of(DIHEDRAL, slice(2, 4))]
    parts = [(half, RESIN if number == coated else "metal") for number, half in enumerate(halves)]
    metal, mixed = (scattering_matrix(mesh, F77, *SEAM) for mesh in (DIHEDRAL, parts))
    exact = fresnel.reflection(4.0, np.pi / 4)
    for entry in (0, 1):
        ratio = 20 * np.log10(abs(mixed[entry, entry] / metal[entry, entry]))
        assert ratio == pytest.approx(20 * np.log10(abs(exact[entry])), abs=0.3)
    alone = sum(scattering_matrix([part], F77, *SEAM) for part in parts)
    assert abs(alone[0, 0]) < 0.05 * abs(mixed[0, 0])  # parts apart have no second bounce


def test_one_part_shadows_another():
    """A resin screen of the same size in front of a metal plate: only the screen echoes, as nothing passes through."""
    screen = PLATE.copy().apply_translation([0.0, 0.0, 0.05])
    found = ss.rcs([(PLATE, "metal"), (screen, RESIN)], F77, 0.0, 0.0)
    assert found == pytest.approx(ss.rcs(PLATE, F77, 0.0, 0.0, material=RESIN), rel=1e-6)


def test_parts_of_one_material_are_one_mesh():
    halves = [(faces_of(DIHEDRAL, slice(0, 2)), "metal"), (faces_of(DIHEDRAL, slice(2, 4)), "pec")]
    angles = (np.array([1.4, 1.5]), np.array([0.6, 0.8]))
    whole = scattering_matrix(DIHEDRAL, F77, *angles)
    assert np.abs(scattering_matrix(halves, F77, *angles) - whole).max() < 1e-9 * np.abs(whole).max()


def test_bad_parts():
    with pytest.raises(MeshError, match="empty"):
        ss.rcs([], F77, 0.0, 0.0)
    with pytest.raises(ParameterRangeError, match="pairs"):
        ss.rcs([PLATE, "metal"], F77, 0.0, 0.0)
    with pytest.raises(ParameterRangeError, match="materials of their own"):
        ss.rcs([(PLATE, "glass")], F77, 0.0, 0.0, material="asphalt")
    with pytest.raises(UnknownMaterialError, match="did you mean 'asphalt'"):
        ss.rcs([(PLATE, "metal"), (PLATE, "asfalt")], F77, 0.0, 0.0)
    with pytest.raises(MeshError, match="part 1"):
        ss.rcs(
            [(PLATE, "metal"), (trimesh.Trimesh(np.zeros((3, 3)), [[0, 1, 2]], process=False), "metal")], F77, 0.0, 0.0
        )
    with pytest.raises(ParameterRangeError, match="mesh"):
        load_body(7)  # type: ignore[arg-type]


def test_parts_of_a_scenes_actor(tmp_path):
    """The actor stands elsewhere and turned; its parts come in its own frame with the radio materials of the scene."""
    moving = {"kind": "static", "position": [30.0, 5.0, 0.0], "yaw_deg": 40.0}
    world = ss.load_scene(write_scene(tmp_path, actors=[Thing("target", PLATE, "Car", "white", trajectory=moving)]))
    parts = actor_parts(world, "target")
    assert [material.name for _, material in parts] == ["plastic"]
    found = ss.rcs(parts, F77, 0.02, 0.1)
    assert found == pytest.approx(ss.rcs(PLATE, F77, 0.02, 0.1, material="plastic"), rel=1e-4)  # PLY holds float32
    with pytest.raises(UnknownNameError, match="target"):
        actor_parts(world, "tarqet")


@pytest.mark.parametrize("time", [None, 0.9])
def test_limbs_of_an_actor_stand_where_its_gait_has_them(time):
    """The parts fill the height of the body, and moved by the actor's pose they are the triangles of the scene."""
    path = WaypointTrajectory([0.0, 4.0], [[5.0, 2.0, 0.0], [9.0, 5.0, 0.0]])
    world = ss.stage("highway_guardrail", [ss.StagedActor("walker", "adult_man", path)])
    parts = actor_parts(world, "walker", time)
    bounds = np.array([mesh.bounds for mesh, _ in parts])
    assert bounds[:, 0, 2].min() == pytest.approx(0.0, abs=0.02)
    assert bounds[:, 1, 2].max() == pytest.approx(ss.read_actor_model("adult_man").height, abs=0.05)
    state = world.at(time or 0.0)
    rows = next(info.parts for info in world.instances.values() if info.name == "walker")
    for row, (mesh, _) in zip(rows, parts, strict=True):
        there = state.actor_pose("walker").apply(mesh.triangles)
        np.testing.assert_allclose(there, state._triangles.of_parts([row]), atol=1e-9)


def test_compiled_parts():
    """Centres of a metal and a rough resin plate.

    The resin's mirror reflection loses sqrt(1 - S^2) = 0.8, as in the solver sbr.
    """
    upright = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0])
    left = PLATE.copy().apply_transform(upright)
    right = left.copy().apply_translation([0.0, 0.1, 0.0])
    options = {"azimuths_deg": (-1.0, 1.0), "azimuth_step_deg": 0.5, "voxel": 0.05, "progress": False, "num_checks": 0}
    model = compile_scatterers([(left, "metal"), (right, RESIN)], F77, **options)
    found = model.scattering_matrix(np.pi / 2, 0.0)
    # the table is in single precision
    assert found[0, 0] == pytest.approx(-1j * 0.01 / oracle.WAVELENGTH_77 * (1 + 0.8 / 3), rel=1e-4)
    assert model.provenance["material"] == "metal, resin"
