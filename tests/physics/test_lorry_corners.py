"""Corners of 90.0 deg are corner reflectors; real ones are off by half a degree, and lorries are drawn so."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.radar.rcs import actor_parts, scattering_matrix
from scarl_sionna.scene.motion.trajectory import StaticTrajectory

WAVELENGTH = 299_792_458.0 / 77e9
SIDE, HEIGHT = 0.5, 0.26
SETTINGS = SbrSettings(ray_spacing=16.0, edge_spacing=8.0, bisections=5)
LORRIES = {"lorry": (121.0, 225.0, 335.0), "articulated_lorry": (225.0, 335.0), "box_van": (41.0, 159.0)}
"""Azimuths at which right angles had sent 22 to 36 dBsm back [deg]: cab and rails, under-run bar and wheels, guards."""


def corner(off: float) -> trimesh.Trimesh:
    """Return two upright plates that meet at 90 deg and a little more [rad]."""
    found = []
    for angle in (0.0, np.pi / 2 + off):
        along = SIDE * np.array([np.cos(angle), np.sin(angle), 0.0])
        low, high = np.array([0.0, 0.0, -HEIGHT / 2]), np.array([0.0, 0.0, HEIGHT / 2])
        found.append(trimesh.Trimesh([low, along + low, along + high, high], [[0, 1, 2], [0, 2, 3]], process=False))
    return trimesh.util.concatenate(found)


@pytest.mark.parametrize("off_deg", [0.0, 0.1, 0.2])
def test_a_corner_loses_what_its_aperture_does_off_its_axis(off_deg: float) -> None:
    """Both ways over the corner leave by twice the error beside their way back, each from its half of the aperture."""
    off = np.radians(off_deg)
    found = ss.rcs(corner(off), 77e9, np.pi / 2, np.pi / 4 + off / 2)
    aperture = np.sqrt(2.0) * SIDE
    expected = 4.0 * np.pi * (aperture * HEIGHT / WAVELENGTH) ** 2 * np.sinc(aperture * off / WAVELENGTH) ** 2
    assert 10.0 * np.log10(found / expected) == pytest.approx(0.0, abs=0.15)


@pytest.fixture(scope="module")
def world() -> ss.World:
    still = StaticTrajectory(Pose())
    return ss.stage("highway_guardrail", [ss.StagedActor(name, name, still, detail="light") for name in LORRIES])


def level(world: ss.World, name: str, azimuth_deg: list[float]) -> np.ndarray:
    """Return the RCS at azimuths, VV [dBsm]."""
    body = actor_parts(world, name)
    s = scattering_matrix(body, 77e9, np.radians(90.6), np.radians(azimuth_deg), settings=SETTINGS)
    return 20.0 * np.log10(np.abs(s[:, 0, 0])) + 10.0 * np.log10(4.0 * np.pi)


@pytest.mark.parametrize("name", LORRIES)
def test_lorries_send_no_corners_back(world: ss.World, name: str) -> None:
    assert level(world, name, [LORRIES[name][0]])[0] < 20.0


@pytest.mark.slow
@pytest.mark.parametrize("name", LORRIES)
def test_nor_beside(world: ss.World, name: str) -> None:
    """Over 1 deg each: a single azimuth may be in a gap between lobes."""
    azimuth = [centre + aside for centre in LORRIES[name] for aside in (-0.4, 0.0, 0.5)]
    power = 10.0 ** (level(world, name, azimuth).reshape(-1, 3) / 10.0)
    assert 10.0 * np.log10(power.mean(axis=1)).max() < 20.0
