"""Lens models: against their formulas, inverse, field, and specifications that are refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

from camera_lidar.camera.projection import pixel_centres, pixel_rays
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.camera import BrownConrady, CameraSpec, KannalaBrandt, Pinhole
from tests.oracles import lens as oracle

BARREL = BrownConrady(k1=-0.31, k2=0.11, p1=8e-4, p2=-5e-4, k3=-0.018)
RATIONAL = BrownConrady(k1=0.52, k2=0.11, p1=-3e-4, p2=2e-4, k3=0.01, k4=0.81, k5=0.3, k6=0.05)
PINCUSHION = BrownConrady(k1=0.2, k2=0.05)
FISHEYE = KannalaBrandt(k1=-0.021, k2=0.0032, k3=-0.0008, k4=0.00004)

CAMERAS = [
    CameraSpec(horizontal_fov_deg=75.0, lens=BARREL),
    CameraSpec(focal_length_px=(610.0, 588.0), principal_point=(451.2, 287.9), lens=RATIONAL),
    CameraSpec(horizontal_fov_deg=60.0, lens=PINCUSHION),
    CameraSpec(horizontal_fov_deg=150.0, lens=FISHEYE),
    CameraSpec(horizontal_fov_deg=210.0, lens=KannalaBrandt()),
    CameraSpec(focal_length_px=700.0, principal_point=(400.0, 300.0)),
]


def directions(spec: CameraSpec, count: int, seed: int = 0) -> np.ndarray:
    """Return directions spread over the image."""
    rng = np.random.default_rng(seed)
    return spec.rays(rng.uniform(0.0, 1.0, (count, 2)) * [spec.width, spec.height])


@pytest.mark.parametrize("lens", [BARREL, RATIONAL, PINCUSHION])
def test_brown_conrady_is_its_formula(lens: BrownConrady) -> None:
    rng = np.random.default_rng(2)
    for x, y in rng.uniform(-0.5, 0.5, (50, 2)):
        expected = oracle.brown_conrady(x, y, lens.coefficients)
        # a dozen float64 operations on numbers of order 1
        np.testing.assert_allclose(lens.distort([3.0 * x, 3.0 * y, 3.0]), expected, atol=1e-14)


def test_fisheye_is_its_formula_ahead_and_behind() -> None:
    rng = np.random.default_rng(3)
    for x, y, z in rng.normal(size=(50, 3)) * [1.0, 1.0, 0.5]:
        expected = oracle.kannala_brandt(x, y, z, FISHEYE.coefficients)
        np.testing.assert_allclose(FISHEYE.distort([x, y, z]), expected, atol=1e-13)


@pytest.mark.parametrize("spec", CAMERAS, ids=lambda spec: spec.lens.model)
def test_projection_and_inverse_agree_to_a_millionth_of_a_pixel(spec: CameraSpec) -> None:
    rng = np.random.default_rng(1)
    pixel = rng.uniform(0.0, 1.0, (20_000, 2)) * [spec.width, spec.height]
    rays = spec.rays(pixel)
    assert np.isfinite(rays).all()
    assert np.allclose(np.linalg.norm(rays, axis=-1), 1.0, atol=1e-14)  # a few eps
    back, depth = spec.project(rays * rng.uniform(0.1, 500.0, (20_000, 1)))
    assert np.abs(back - pixel).max() < 1e-6  # the contract; the iteration ends below 1e-9 px
    points = spec.unproject(pixel, depth)
    again, depth_again = spec.project(points)
    away = np.abs(rays[:, 2]) > 1e-3  # a fisheye's rays in the camera's plane have no depth to tell their distance
    assert np.abs(again - pixel)[away].max() < 1e-6
    assert np.allclose(depth_again, depth, rtol=1e-12)


def test_field_of_view_ends_at_the_borders() -> None:
    for fov, lens in (
        (75.0, BrownConrady(k1=-0.3, k2=0.1)),
        (150.0, FISHEYE),
        (200.0, KannalaBrandt()),
        (80.0, Pinhole()),
    ):
        spec = CameraSpec(horizontal_fov_deg=fov, lens=lens)
        left, right = spec.rays([[0.0, spec.height / 2], [spec.width, spec.height / 2]])
        angles = np.degrees(np.arctan2(np.hypot(left[0], left[1]), left[2])), np.degrees(np.arctan2(right[0], right[2]))
        np.testing.assert_allclose(angles, fov / 2.0, atol=1e-9)  # degrees; Newton to 1e-13


def test_a_barrel_lens_folds_back_where_the_calculus_says() -> None:
    lens = BrownConrady(k1=-0.25)
    edge = 1.0 / np.sqrt(0.75)  # d/dr (r - r^3 / 4) = 0
    assert lens.field_radius == pytest.approx(edge - 0.25 * edge**3, rel=1e-12)
    inside, outside = np.array([0.999 * edge, 0.0, 1.0]), np.array([1.001 * edge, 0.0, 1.0])
    assert np.isfinite(lens.distort(inside)).all() and np.isnan(lens.distort(outside)).all()
    shown = lens.distort(inside)
    np.testing.assert_allclose(
        lens.undistort(shown), inside, atol=1e-9
    )  # slope 0.002 there: 1e-13 / 0.002, with a margin
    assert np.isnan(lens.undistort([1.01 * lens.field_radius, 0.0])).all()


def test_pixels_beyond_the_field_are_found() -> None:
    spec = CameraSpec(width=200, height=120, focal_length_px=90.0, lens=BrownConrady(k1=-0.25))
    rays = pixel_rays(spec)
    radius = np.hypot(*(pixel_centres(spec) - [100.0, 60.0]).T) / 90.0
    assert np.array_equal(np.isnan(rays[:, 0]), radius > spec.lens.field_radius)
    assert 0.05 < np.isnan(rays[:, 0]).mean() < 0.5
    circle = CameraSpec(width=100, height=100, focal_length_px=20.0, lens=KannalaBrandt(max_angle_deg=95.0))
    radius = np.hypot(*(pixel_centres(circle) - 50.0).T) / 20.0
    assert np.array_equal(np.isnan(pixel_rays(circle)[:, 0]), radius > np.radians(95.0))


def test_tangential_terms_can_close_the_field_too() -> None:
    lens = BrownConrady(p1=0.5)  # determinant (1 + y)(1 + 3 y) - x^2 is negative below y = -1/3
    assert np.isfinite(lens.distort([0.0, -0.3, 1.0])).all()
    assert np.isnan(lens.distort([0.0, -0.4, 1.0])).all()


@pytest.mark.parametrize("spec", CAMERAS, ids=lambda spec: spec.lens.model)
def test_a_specification_goes_through_a_file(spec: CameraSpec) -> None:
    assert CameraSpec(**json.loads(json.dumps(spec.model_dump(mode="json")))) == spec
    assert len(spec.distortion_coefficients) == {"pinhole": 0, "brown_conrady": 8, "kannala_brandt": 4}[spec.lens.model]


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"horizontal_fov_deg": 180.0}, "needs the lens KannalaBrandt"),
        ({"horizontal_fov_deg": 180.0, "lens": BARREL}, "needs the lens KannalaBrandt"),
        ({"horizontal_fov_deg": 361.0, "lens": KannalaBrandt()}, "360"),
        ({"horizontal_fov_deg": 120.0, "lens": BrownConrady(k1=-0.4)}, "folds back before 120 deg"),
        ({"focal_length_px": 300.0, "lens": BrownConrady(k1=-1.5)}, "folds back at"),
        ({"lens": BrownConrady(k1=-1.5)}, "a focal_length_px"),
        ({"horizontal_fov_deg": 200.0, "lens": KannalaBrandt(max_angle_deg=90.0)}, "folds back before 200"),
        ({"focal_length_px": 500.0, "horizontal_fov_deg": 60.0}, "not both"),
        ({"focal_length_px": -1.0}, "> 0 px"),
        ({"focal_length_px": (500.0, 0.0)}, "> 0 px"),
        ({"lens": {"model": "mirror"}}, "pinhole"),
        ({"lens": {"model": "kannala_brandt", "k1": float("nan")}}, "finite"),
        ({"height": 0}, "greater than or equal to 1"),
        ({"flow_interval": 0.0}, "greater than 0"),
        ({"exposure_time": -1e-3}, "greater than or equal to 0"),
        ({"sensor": {"read_noise": -1.0}}, "greater than or equal to 0"),
        ({"sensor": {"full_well": 0.0}}, "greater than or equal to 1"),
        ({"sensor": {"white_balance": (1.0, 0.0, 1.0)}}, "gains > 0"),
    ],
)
def test_bad_cameras_are_refused(bad: dict, message: str) -> None:
    with pytest.raises(ParameterRangeError, match=message):
        CameraSpec(**bad)


def test_the_default_lens_is_ideal() -> None:
    assert CameraSpec().lens == Pinhole()
    np.testing.assert_allclose(Pinhole().distort([0.2, -0.4, 2.0]), [0.1, -0.2], atol=1e-16)
