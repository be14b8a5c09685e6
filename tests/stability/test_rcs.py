"""ss.rcs where ray methods fail: grazing rays, bad meshes, small and far things, touching faces, density of rays."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.radar.rcs import load_body, scattering_matrix
from tests.oracles import rcs as oracle

F77 = 77e9
LAMBDA = oracle.WAVELENGTH_77
PLATE = trimesh.Trimesh(0.1 * np.array(oracle.PLATE_MESH[0]), oracle.PLATE_MESH[1], process=False)
DIHEDRAL = trimesh.Trimesh(0.1 * np.array(oracle.DIHEDRAL_MESH[0]), oracle.DIHEDRAL_MESH[1], process=False)
SEAM = (np.pi / 2, np.pi / 4)


def dbsm(sigma):
    return 10 * np.log10(np.maximum(sigma, 1e-30))


def test_grazing_incidence():
    """Edge-on a plate has no RCS, and close to it nothing is NaN: PO falls as cos^2."""
    theta = np.pi / 2 - np.array([0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3])
    sigma = ss.rcs(PLATE, F77, theta, 0.0)
    assert np.all(np.isfinite(sigma))
    assert sigma[0] == 0.0
    assert np.allclose(sigma[4:], oracle.plate(0.1, 0.1, LAMBDA, theta[4:]), rtol=1e-3)


def test_rays_in_the_plane_of_one_face_of_a_corner():
    """Along one face of a dihedral the other one is a plate head-on; no ray may get lost between the two faces.

    The grazing face adds nothing at exactly 0, and at 1e-4 rad its two bounces add 1e-3 of the level.
    """
    exact = oracle.plate(0.1, 0.1, LAMBDA, 0.0)
    for phi in (0.0, 1e-9, 1e-6, 1e-4):
        found = ss.rcs(DIHEDRAL, F77, np.pi / 2, phi, "HH")
        assert dbsm(found) == pytest.approx(dbsm(exact), abs=0.1), phi


def test_degenerate_faces_are_left_out_and_reported():
    vertices = np.vstack([PLATE.vertices, [[0.0, 0.0, 0.0]]])
    faces = np.vstack([PLATE.faces, [[0, 0, 1], [0, 4, 2]]])  # a doubled vertex, and three points on a line
    mesh = trimesh.Trimesh(vertices, faces, process=False, validate=False)
    with pytest.warns(ss.ScarlWarning, match="2 faces without area"):
        found = ss.rcs(mesh, F77, 0.1, 0.0)
    assert found == pytest.approx(ss.rcs(PLATE, F77, 0.1, 0.0), rel=1e-12)


def test_sliver_triangles():
    """A plate of needles 1e-4 wide reflects like the plate: the sum of the pieces is exact."""
    x = np.linspace(-0.05, 0.05, 1001)
    vertices = np.array([[a, b, 0.0] for a in x for b in (-0.05, 0.05)])
    first = 2 * np.arange(1000)[:, None]
    mesh = trimesh.Trimesh(vertices, np.vstack([first + [0, 2, 3], first + [0, 3, 1]]), process=False)
    theta = np.deg2rad([0.0, 2.0, 5.0])
    assert np.allclose(ss.rcs(mesh, F77, theta, 0.3), ss.rcs(PLATE, F77, theta, 0.3), rtol=1e-9)


@pytest.mark.parametrize("flip", ["all", "half"])
def test_flipped_normals(flip):
    """The way that faces are turned does not matter: an open mesh is lit from both sides, a closed one from outside."""
    for mesh, angles in ((DIHEDRAL, SEAM), (trimesh.creation.box(extents=(0.06, 0.05, 0.04)), (0.02, 0.3))):
        turned = mesh.copy()
        faces = np.array(turned.faces)
        rows = slice(None) if flip == "all" else slice(None, None, 2)
        faces[rows] = faces[rows][:, ::-1]
        turned = trimesh.Trimesh(mesh.vertices, faces, process=False)
        # other orders of corners move the cuts along edges by 2^-11 of a quarter wavelength
        assert dbsm(ss.rcs(turned, F77, *angles)) == pytest.approx(dbsm(ss.rcs(mesh, F77, *angles)), abs=0.02)


def test_one_inverted_part_is_not_lost():
    """Two closed boxes, the smaller one inside out: together their volume is positive, and still both must echo."""
    big = trimesh.creation.box(extents=(0.08, 0.08, 0.08)).apply_translation([0.0, 0.0, -0.2])
    small = trimesh.creation.box(extents=(0.04, 0.04, 0.04)).apply_translation([0.5, 0.0, 0.1])
    right = ss.rcs(trimesh.util.concatenate([big, small]), F77, 0.0, 0.0)
    inverted = trimesh.Trimesh(small.vertices, small.faces[:, ::-1], process=False)
    found = ss.rcs(trimesh.util.concatenate([big, inverted]), F77, 0.0, 0.0)
    assert found == pytest.approx(right, rel=1e-6)
    assert found != pytest.approx(ss.rcs(big, F77, 0.0, 0.0), rel=1e-2)


def test_open_mesh_is_lit_from_behind():
    """A single sheet shows both its sides, with the same level."""
    assert ss.rcs(PLATE, F77, np.pi - 0.02, 0.0) == pytest.approx(ss.rcs(PLATE, F77, 0.02, 0.0), rel=1e-9)


def test_touching_and_doubled_faces():
    """A box that stands on a plate shares its ground with it: coplanar faces are shadowed once, not lit twice.

    Head-on the box's top is in front of the part of the plate that it hides: area by area that is again the plate, in
    two heights.
    """
    height = 5 * LAMBDA
    box = trimesh.creation.box(extents=(0.04, 0.04, height)).apply_translation([0.0, 0.0, height / 2])
    mesh = trimesh.util.concatenate([PLATE, box])
    k = 2 * np.pi / LAMBDA
    field = ((0.01 - 0.0016) + 0.0016 * np.exp(2j * k * height)) / LAMBDA  # metres
    # the shadow's edge is cut to 2^-11 of a quarter wavelength and insets are 1e-3 of a tube: 0.05 dB of an area
    assert dbsm(ss.rcs(mesh, F77, 0.0, 0.0)) == pytest.approx(dbsm(4 * np.pi * abs(field) ** 2), abs=0.05)


def test_t_junction_leaks_nothing():
    """A finely meshed face against a coarse one: no ray may slip through the seam where vertices do not meet."""
    fine = trimesh.Trimesh(DIHEDRAL.vertices, DIHEDRAL.faces[2:], process=False).subdivide().subdivide().subdivide()
    coarse = trimesh.Trimesh(DIHEDRAL.vertices, DIHEDRAL.faces[:2], process=False)
    mixed = trimesh.util.concatenate([coarse, fine])
    assert dbsm(ss.rcs(mixed, F77, *SEAM)) == pytest.approx(dbsm(ss.rcs(DIHEDRAL, F77, *SEAM)), abs=0.02)


def test_target_smaller_than_the_spacing_of_rays_is_found():
    """Tubes begin at the mesh's own faces: a small plate 100 m beside a large one is never missed between two rays."""
    small = PLATE.copy().apply_scale(0.02).apply_translation([50.0, 0.0, 0.0])  # 2 mm: half a wavelength
    both = trimesh.util.concatenate([PLATE, small])
    matrix = scattering_matrix(both, F77, 0.0, 0.0)[0, 0] - scattering_matrix(PLATE, F77, 0.0, 0.0)[0, 0]
    assert abs(matrix) == pytest.approx((0.002**2) / LAMBDA, rel=1e-6)


def test_mesh_far_from_the_origin_and_in_small_steps():
    """A corner at 300 m, moved in steps of lambda/20 along the line of sight.

    Its phase follows, its level does not flicker.
    """
    theta, phi = 0.9, 0.8
    r_hat = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    corner = trimesh.Trimesh(0.03 * np.array(oracle.TRIHEDRAL_MESH[0]), oracle.TRIHEDRAL_MESH[1], process=False)
    steps = np.arange(12) * LAMBDA / 20
    values = np.array(
        [scattering_matrix(corner.copy().apply_translation((300.0 + s) * r_hat), F77, theta, phi)[0, 0] for s in steps]
    )
    turned = np.unwrap(np.angle(values / values[0]))
    # coordinates at 300 m are rounded to 6e-14 m (1e-10 rad); the cuts along edges move by some 1e-4 of the area
    assert np.abs(turned - 2 * 2 * np.pi / LAMBDA * steps).max() < 1e-2
    assert np.ptp(20 * np.log10(np.abs(values))) < 0.05


def test_turning_in_small_steps_is_smooth():
    """An aspect changed by 1e-6 rad changes a corner's field by 1e-4 of it at most: no tube appears or vanishes."""
    corner = load_body(
        trimesh.Trimesh(0.05 * np.array(oracle.TRIHEDRAL_MESH[0]), oracle.TRIHEDRAL_MESH[1], process=False)
    )
    matrix = scattering_matrix(corner, F77, 0.9 + 1e-6 * np.arange(20), 0.8)[:, 0, 0]
    # the field turns by k * 0.05 m * 2 * 1e-6 = 1.6e-4 a step; the cuts add their own 1e-3
    assert np.abs(np.diff(matrix)).max() < 3e-3 * np.abs(matrix).max()
