"""Light of lamps that fog scatters towards the camera, against integrals along single rays."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from camera_lidar.camera import render, render_radiance
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar_ratio import FOG_LIDAR_RATIO
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.engine import variant
from scarl_sionna.engine.light import glow
from scarl_sionna.engine.light.lamp_table import lamp_table
from scarl_sionna.engine.light.lamps import STREET_LAMP_FLUX, low_beam
from scarl_sionna.engine.light.sky import LUMINANCE_WEIGHTS, UNIT_LUMINANCE
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.world import WorldState
from tests.scenes import Material, Thing, box, plane, write_scene

pytestmark = pytest.mark.own_process  # a shared process held other worlds, and kernels hold how many there are

SPEC = CameraSpec(width=24, height=14, horizontal_fov_deg=40.0, samples_per_pixel=1024, denoise=False, images=("rgb",))
VISIBILITY = 150.0
FOG = Lighting(
    sun_elevation_deg=-40.0, night_sky_luminance=0.0, street_lamps=True, headlamps=True, visibility=VISIBILITY
)
EXTINCTION = 3.0 / VISIBILITY
POSE = Pose([0.0, 0.0, 1.6])
LAMP = np.array([30.0, 3.0, 3.0])
Strength = Callable[[np.ndarray], float]
"""Intensity of a lamp [cd] towards a unit direction."""


def lit(folder: Path, things: list[Thing], lamp: str = "street_lamp") -> WorldState:
    path = write_scene(
        folder, things, materials={"lens": Material((0.0, 0.0, 0.0)), "black": Material((0.0, 0.0, 0.0))}
    )
    toml = folder / "scene.toml"
    toml.write_text(toml.read_text().replace("[materials.lens]", f'[materials.lens]\nlamp = "{lamp}"'))
    return load_scene(path).with_lighting(FOG).at(0.0)


def scattered(cosine: np.ndarray | float) -> np.ndarray:
    return np.asarray(glow.scattered_share(np, cosine))


def along(
    direction: np.ndarray, lamp: np.ndarray, strength: Strength, start: float = 0.0, stop: float = 300.0
) -> float:
    """Return the luminance of the air along a ray from the camera by one lamp, in the scenes' unit."""

    def density(distance: float) -> float:
        way = lamp - POSE.position - distance * direction
        far = float(np.linalg.norm(way))
        through = np.exp(-EXTINCTION * (distance + far))
        return float(EXTINCTION * scattered(way @ direction / far) * through * strength(-way / far) / far**2)

    near = float((lamp - POSE.position) @ direction)
    return float(quad(density, 0.0, 300.0, points=[near], limit=400)[0]) / UNIT_LUMINANCE


def directions() -> np.ndarray:
    """Return where the middles of the pixels look, shape (height, width, 3)."""
    inverse = np.linalg.inv(SPEC.intrinsics)
    x, y = np.meshgrid(np.arange(SPEC.width) + 0.5, np.arange(SPEC.height) + 0.5)
    optical = np.stack([x, y, np.ones_like(x)], axis=-1) @ inverse.T
    found = np.stack([optical[..., 2], -optical[..., 0], -optical[..., 1]], axis=-1)
    return found / np.linalg.norm(found, axis=-1, keepdims=True)


def image_of(state: WorldState, seed: int = 0, spec: CameraSpec = SPEC) -> np.ndarray:
    return render_radiance(state, spec, POSE, np.random.default_rng(seed)).astype(float) @ LUMINANCE_WEIGHTS


def test_the_droplets_send_all_light_on_with_their_mean_and_straight_back_what_lidars_see() -> None:
    cosine = np.linspace(-1.0, 1.0, 400_001)
    share = scattered(cosine)
    assert 2.0 * np.pi * np.trapezoid(share, cosine) == pytest.approx(1.0, abs=1e-4)
    assert 2.0 * np.pi * np.trapezoid(share * cosine, cosine) == pytest.approx(glow.ASYMMETRY, abs=1e-4)
    assert scattered(-1.0) == pytest.approx(1.0 / FOG_LIDAR_RATIO, rel=1e-9)


def test_the_mean_cosine_is_that_of_droplets_by_the_mie_series() -> None:
    """Droplets of 4 to 30 um [diameter] in green light; what is bent around them, half of the light, goes ahead."""
    from scarl_sionna.radar.weather import mie

    for diameter in (4e-6, 10e-6, 20e-6, 30e-6):
        sizes = np.pi * diameter / 550e-9 * np.linspace(0.9, 1.1, 9)
        found = []
        for size in sizes:
            a, b = (np.ravel(part) for part in mie._coefficients(1.333 + 0j, np.array([size]))[:2])
            n = np.arange(1, len(a) + 1)
            power = ((2 * n + 1) * (np.abs(a) ** 2 + np.abs(b) ** 2)).sum()
            m = n[:-1]
            turned = m * (m + 2) / (m + 1) * (a[:-1] * a[1:].conj() + b[:-1] * b[1:].conj()).real
            turned = 2.0 * (turned.sum() + ((2 * n + 1) / (n * (n + 1)) * (a * b.conj()).real).sum())
            found.append(turned / power)
        assert np.mean(found) == pytest.approx(glow.ASYMMETRY, abs=0.03), diameter


def test_a_glow_around_a_lamp_is_the_integral_along_each_ray(tmp_path: Path) -> None:
    """A street lamp that faces the camera: 9,000 lm by Lambert's law."""
    state = lit(tmp_path, [Thing("lamp", plane(0.1, 0.1, tuple(LAMP), (-1.0, 0.0, 0.0)), "Pole", "lens")])
    image = image_of(state)
    looks = directions()
    apart = np.degrees(np.arccos(np.clip(looks @ (LAMP - POSE.position) / np.linalg.norm(LAMP - POSE.position), -1, 1)))

    def facing(direction: np.ndarray) -> float:
        return STREET_LAMP_FLUX / np.pi * max(-direction[0], 0.0)

    checked = 0
    for row, column in zip(*np.nonzero((apart > 6.0) & (apart < 25.0)), strict=True):
        if (row + column) % 5 == 0:
            assert image[row, column] == pytest.approx(along(looks[row, column], LAMP, facing), rel=0.06), (row, column)
            checked += 1
    assert checked > 30


def test_beams_of_headlamps_are_the_integral_along_each_ray(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The own beam, from below the camera: the veil that it lays over the image. The lens itself is left out."""
    thing = Thing("beam", box((0.02, 0.2, 0.1), (1.0, 0.6, 0.7)), "Static", "lens")
    state = lit(tmp_path, [thing], "headlamp")
    with variant.optical() as mi:
        table = lamp_table(mi, state.optical_scene())
    assert table is not None
    beam, other = np.flatnonzero(table.kind == 1)  # the left and the right half of the lens, here at one place
    assert np.array_equal(table.center[beam], table.center[other])
    axis, side, center = table.axis[beam], table.side[beam], table.center[beam]
    up = np.cross(axis, side)

    def beam_of(direction: np.ndarray) -> float:
        ahead = direction @ axis
        if ahead <= 0.05:
            return 0.0
        right, high = -(direction @ side), direction @ up
        return float(
            low_beam(np.degrees(np.arctan2(right, ahead)), np.degrees(np.arctan2(high, np.hypot(ahead, right))))
        )

    monkeypatch.setattr(
        render, "lamp_table", lambda *_: table._replace(strength=np.where(table.kind == 1, table.strength, 0.0))
    )
    image, looks = image_of(state), directions()
    expected = np.array([[2.0 * along(look, center, beam_of) for look in row] for row in looks[::3, ::4]])
    found = image[::3, ::4]
    assert np.median(np.abs(found / expected - 1.0)) < 0.04 and np.abs(found / expected - 1.0).max() < 0.15


def test_what_stands_between_lamp_and_air_throws_a_shadow(tmp_path: Path) -> None:
    """A roof over the lamp that the air above cannot see: no glow there, the same below."""
    lamp = Thing("lamp", plane(0.1, 0.1, tuple(LAMP), (-1.0, 0.0, 0.0)), "Pole", "lens")
    roof = Thing("roof", plane(60.0, 60.0, (30.0, 0.0, LAMP[2] + 0.2), (0.0, 0.0, -1.0)), "Building", "black")
    free, under = (image_of(lit(tmp_path / name, things)) for name, things in (("a", [lamp]), ("b", [lamp, roof])))
    looks = directions()
    # rays that stay below the roof for 150 m see the same air; those that meet it at once see little of it
    below = looks[..., 2] < 0.0
    np.testing.assert_allclose(under[below], free[below], rtol=0.12)
    above = looks[..., 2] > 0.15
    assert above.any() and (under[above] < 0.7 * free[above]).all()


def test_glow_can_be_left_out_and_clear_air_has_none(tmp_path: Path) -> None:
    state = lit(tmp_path, [Thing("lamp", plane(0.1, 0.1, tuple(LAMP), (-1.0, 0.0, 0.0)), "Pole", "lens")])
    few = SPEC.with_(samples_per_pixel=16)
    dark = image_of(state.world.with_lighting(FOG.with_(glow=False)).at(0.0), spec=few)
    clear = image_of(state.world.with_lighting(FOG.with_(visibility=None)).at(0.0), spec=few)
    hazy = image_of(state, spec=few)
    assert (dark == 0.0).mean() > 0.95 and (clear == 0.0).mean() > 0.95 and (hazy > 0.0).mean() > 0.95
