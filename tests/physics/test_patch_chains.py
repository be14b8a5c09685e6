"""What patches behind chains of moving mirrors radiate: the kernel against plain NumPy, bounce by bounce."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.seeds import uniform_hash
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.rays.face_rays import MISS
from scarl_sionna.radar.channel.sbr.bodies import Bodies
from scarl_sionna.radar.optics.faces.panes import MOST_PANES
from scarl_sionna.radar.optics.near_field import NearField, radiated
from scarl_sionna.radar.optics.spherical_waves import ImageTubes
from scarl_sionna.radar.optics.viewpoint import Viewpoint
from scarl_sionna.scene.materials.depolarization import rough_matrix
from scarl_sionna.scene.materials.fresnel import reflection
from scarl_sionna.scene.materials.rough import height_loss
from tests.kernels import kernels
from tests.scenes import Material, Thing, plane, write_scene

RADAR = RadarSpec()
FREQUENCY = RADAR.center_frequency
WAVENUMBER = 2.0 * np.pi * FREQUENCY / SPEED_OF_LIGHT
NORMALS = np.array([[-1.0, 0.2, 0.1], [0.3, -1.0, 0.2], [-0.2, 0.1, 1.0]])
CENTERS = np.array([[9.0, 0.0, 0.0], [8.0, 3.0, 0.5], [7.0, 2.0, -1.0]])
TX = Mount(Pose.from_euler([0.0, 0.2, 0.4], yaw=0.2, pitch=0.1), Twist([11.0, 0.3, -0.2]))
RX = Mount(Pose.from_euler([0.4, -0.6, 0.1], yaw=-0.1, roll=0.3), Twist([10.0, -0.4, 0.1]))


@pytest.fixture(scope="module", params=["asphalt", "grass"])
def bodies(tmp_path_factory, request) -> Bodies:
    rng = np.random.default_rng(0)
    names = ("one", "two", "three")
    things = []
    for name, center, normal in zip(names, CENTERS, NORMALS, strict=True):
        motion = {"kind": "constant_twist", "position": center.tolist(), "velocity": rng.normal(0.0, 5.0, 3).tolist()}
        motion["angular_velocity_z"] = float(rng.normal(0.0, 2.0))
        things.append(Thing(name, plane(2.0, 2.0, normal=normal), "Car", "rough", motion))
    rough = {"rough": Material(radio=request.param)}
    state = load_scene(write_scene(tmp_path_factory.mktemp("chains"), actors=things, materials=rough)).at(0.0)
    return Bodies(state, RADAR, RadarSettings(sbr=SbrSettings()), sorted(state.world.instances))


def mirrored(points, normal, offset):
    """Return points behind planes; everything (n, 3) and (n,)."""
    return points - 2.0 * (np.einsum("ij,ij->i", normal, points) - offset)[:, None] * normal


def chains(bodies: Bodies, depth: int, count: int) -> ImageTubes:
    """Return patches of 2 cm to 20 cm on random faces, which the transmitter lights over faces of the other plates."""
    rng, drawn = np.random.default_rng(depth), 20 * count
    plate = np.array([rng.permutation(3)[:depth] for _ in range(drawn)])
    face = 2 * plate + rng.integers(0, 2, plate.shape)
    normal, offset = (column[face] for column in (bodies.faces.triangles.normal, bodies.faces.triangles.offset))
    image = np.empty((drawn, depth, 3))
    image[:, 0] = TX.pose.position
    for k in range(depth - 1):
        image[:, k + 1] = mirrored(image[:, k], normal[:, k], offset[:, k])
    whole = bodies.faces.triangles.corners[face[:, -1]]
    share = rng.uniform(0.01, 0.1, drawn)[:, None, None]
    corners = whole.mean(axis=1, keepdims=True) * (1.0 - share) + whole * share
    here, lit = corners.mean(axis=1), np.ones(drawn, dtype=bool)
    for k in range(depth - 2, -1, -1):
        start, ray = image[:, k + 1], here - image[:, k + 1]
        along = (offset[:, k] - np.einsum("ni,ni->n", normal[:, k], start)) / np.einsum("ni,ni->n", normal[:, k], ray)
        here, lit = start + along[:, None] * ray, lit & (along > 0.0) & (along < 1.0)
    rows, way = np.flatnonzero(lit)[:count], np.full((count, MOST_PANES), MISS)
    return ImageTubes(corners[rows], face[rows], image[rows], np.arange(count), way, way)


def albedo(material, arriving, leaving):
    """Return the albedo of asphalt, or that of a deep layer of blades between two directions."""
    if material.name == "asphalt":
        return material.diffuse_albedo
    w = material.volume_albedo
    rises = [(1.0 + 2.0 * c) / (1.0 + 2.0 * c * np.sqrt(1.0 - w)) for c in (arriving, leaving)]
    return w / 4.0 * rises[0] * rises[1] / (arriving + leaving)


def plain(bodies: Bodies, tubes: ImageTubes) -> dict[str, np.ndarray]:
    """Return columns of `radiated`, patch by patch; `a` without the integral over the patch."""
    state, faces, rows = bodies.state, bodies.faces, []
    material = state.world.materials[state.world.parts.material[0]]
    place = np.linspace(0.0, 1.0, bodies.knobs.coefficient_nodes)
    table = [
        height_loss(material.roughness_rms, FREQUENCY, place**2) * c for c in reflection(material, FREQUENCY, place**2)
    ]
    cross = material.xpd_coefficient

    def basis(pose, direction):
        x, y, z = pose.rotation.T
        phi = np.arctan2(direction @ y, direction @ x)
        outward = np.cos(phi) * x + np.sin(phi) * y
        return np.array(
            [(direction @ z) * outward - np.hypot(direction @ x, direction @ y) * z, np.cos(phi) * y - np.sin(phi) * x]
        )

    for corner, chain, images, origin in zip(tubes.corners, tubes.face, tubes.image, tubes.origin, strict=True):
        normal, offset, part = faces.triangles.normal[chain], faces.triangles.offset[chain], faces.part[chain]
        center, receiver = corner.mean(axis=0), RX.pose.position
        points = [center]
        for k in range(len(chain) - 2, -1, -1):
            ray = points[0] - images[k + 1]
            points.insert(0, images[k + 1] + ray * (offset[k] - normal[k] @ images[k + 1]) / (normal[k] @ ray))
        line = [TX.pose.position, *points, receiver]
        travel = [(b - a) / np.linalg.norm(b - a) for a, b in pairwise(line)]
        moving = state.point_velocity(part, np.array(points))
        seen, drift = center, moving[-1]
        for k in range(len(chain) - 2, -1, -1):
            seen = mirrored(seen[None], normal[k][None], offset[k])[0]
            drift = drift - 2.0 * (normal[k] @ (drift - moving[k])) * normal[k]
        rate = travel[-1] @ (RX.twist.linear - moving[-1]) - travel[0] @ TX.twist.linear + travel[0] @ drift
        reflected = basis(TX.pose, travel[0]).T.astype(complex)
        for k in range(len(chain)):
            field, along = reflected, travel[k]
            n = -normal[k] * np.sign(normal[k] @ along)
            cosine = -n @ along
            te, tm = (
                np.interp(np.sqrt(cosine), place, c.real) + 1j * np.interp(np.sqrt(cosine), place, c.imag)
                for c in table
            )
            across = np.cross(along, n) / np.linalg.norm(np.cross(along, n))
            onward = along + 2.0 * cosine * n
            reflected = te * np.outer(across, across @ field)
            reflected = material.coherence * (
                reflected + tm * np.outer(np.cross(onward, across), np.cross(along, across) @ field)
            )
        back = travel[-1]
        current = np.cross(n, np.cross(along, field.T) + np.cross(onward, reflected.T))
        vector = current + np.cross(back, np.cross(n, field.T + reflected.T))
        out, home = np.linalg.norm(center - images[-1]), np.linalg.norm(receiver - center)
        sent = cosine * abs(n @ back) * albedo(material, cosine, abs(n @ back))
        level = np.sqrt(sent / np.pi) / (2.0 * WAVENUMBER * out * home)
        drawn = uniform_hash(np.array([[origin, *chain, 1]]), 0)
        turn = rough_matrix(*(np.full(1, np.sqrt(share)) for share in (1.0 - cross, 1.0 - cross, cross)), drawn)[0]
        rows.append(
            {
                "tx_point": seen,
                "rx_point": center,
                "tx_velocity": drift - TX.twist.linear,
                "rx_velocity": moving[-1] - RX.twist.linear,
                "length_rate": rate,
                "length": out + home,
                "cosine": abs(n @ back),
                "a": -1j / (8.0 * np.pi * out * home) * basis(RX.pose, -back) @ vector.T,
                "scattered": level * turn @ basis(TX.pose, along) @ field,
            }
        )
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def found_by(bodies: Bodies, tubes: ImageTubes) -> dict[str, np.ndarray]:
    stations = [Viewpoint.of(RADAR, mount.pose, mount.twist.linear) for mount in (TX, RX)]
    with bodies.active():
        near = NearField(bodies.rays, bodies.surfaces, *stations, WAVENUMBER, 0.1, bodies.curves, 1e-5, 0.1)
        return radiated([near], [tubes])[0]


@pytest.mark.parametrize("count", [1, 40])
@pytest.mark.parametrize("depth", [1, 2, 3])
def test_the_kernel_is_plain_numpy(bodies: Bodies, depth: int, count: int) -> None:
    """Below 1e-9 of each row; directions over mirrors have the rounding of coordinates over distances, some 1e-15."""
    tubes = chains(bodies, depth, count)
    found, expected = found_by(bodies, tubes), plain(bodies, tubes)
    for name, column in expected.items():
        error = found[name] - column
        if name == "a":  # of oblique patches for an integral of 1 m2; of others up to it, which other tests hold
            flat = column.reshape(count, 4)
            along = np.einsum("ni,ni->n", flat.conj(), found[name].reshape(count, 4))
            power = np.sum(np.abs(flat) ** 2, axis=1)
            share = np.divide(along, power, out=np.zeros_like(along), where=power > 1e-200)  # grass leaves no mirror
            share[found["oblique"]] = 1.0
            column = share[:, None, None] * column
            error = found[name] - column
        size = np.abs(column).reshape(count, -1).max(axis=1)
        assert np.all(np.abs(error).reshape(count, -1).max(axis=1) <= 1e-9 * size), name
    assert count == 1 or found["oblique"].any()


def test_one_kernel_serves_any_number_of_bounces(bodies: Bodies) -> None:
    with kernels() as of:
        found_by(bodies, chains(bodies, 1, 5))
        first = of(1000)
        for depth, count in ((2, 7), (3, 1)):
            found_by(bodies, chains(bodies, depth, count))
        assert len(first) == 1 and of(1000) == first
