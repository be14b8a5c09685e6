"""Poses, seeds, units, semantic classes and the base of the specifications."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scarl_sionna.core import seeds, units
from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose, Twist
from scarl_sionna.core.registry import sensor_class
from scarl_sionna.core.semantics import SEMANTIC_CLASSES, SEMANTIC_COLORS, semantic_id
from scarl_sionna.core.specs.camera import CameraSpec

coordinate = st.floats(-1e3, 1e3)
angle = st.floats(-3.1, 3.1)


@given(st.tuples(coordinate, coordinate, coordinate), angle, st.floats(-1.5, 1.5), angle)
def test_pose_inverse_and_composition(
    position: tuple[float, float, float], yaw: float, pitch: float, roll: float
) -> None:
    pose = Pose.from_euler(position, yaw, pitch, roll)
    points = np.array([[1.0, -2.0, 3.0], [0.0, 0.0, 0.0]])
    # rounding: a few ulp of coordinates up to 2e3 m
    np.testing.assert_allclose(pose.inverse().apply(pose.apply(points)), points, atol=1e-11)
    np.testing.assert_allclose((pose @ pose.inverse()).matrix, np.eye(4), atol=1e-11)  # type: ignore[union-attr]
    np.testing.assert_allclose(pose.rotation @ pose.rotation.T, np.eye(3), atol=1e-12)


def test_pose_conventions() -> None:
    turned = Pose.from_euler([0, 0, 0], yaw=np.pi / 2)
    np.testing.assert_allclose(turned.rotate([1, 0, 0]), [0, 1, 0], atol=1e-15)  # yaw turns to the left
    down = Pose.from_euler([0, 0, 0], pitch=0.1)
    assert down.rotate([1, 0, 0])[2] == pytest.approx(-np.sin(0.1))  # positive pitch: nose down
    np.testing.assert_allclose(turned.quaternion, [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    np.testing.assert_array_equal(CAMERA_OPTICAL_FROM_SENSOR @ [1, 0, 0], [0, 0, 1])  # forward is z
    np.testing.assert_array_equal(CAMERA_OPTICAL_FROM_SENSOR @ [0, 1, 0], [-1, 0, 0])  # left is -x
    np.testing.assert_array_equal(CAMERA_OPTICAL_FROM_SENSOR @ [0, 0, 1], [0, -1, 0])  # up is -y
    assert np.linalg.det(CAMERA_OPTICAL_FROM_SENSOR) == 1.0


@pytest.mark.parametrize("quaternion", [[0, 0, 0, 0], [1, 0, 0], [np.nan, 0, 0, 1]])
def test_bad_quaternion(quaternion: list[float]) -> None:
    with pytest.raises(ParameterRangeError, match="quaternion"):
        Pose([0, 0, 0], quaternion)


def test_pose_is_frozen() -> None:
    with pytest.raises(ValueError, match="read-only"):
        Pose([1, 2, 3]).position[0] = 5.0


def test_twist_at_an_offset() -> None:
    np.testing.assert_allclose(Twist([1, 0, 0], [0, 0, 2]).velocity_at([[0, 3, 0], [1, 0, 0]]), [[-5, 0, 0], [1, 2, 0]])


def test_seed_tree() -> None:
    draw = lambda *args, **names: seeds.generator(*args, **names).integers(0, 2**63)  # noqa: E731
    assert draw(0, "noise", frame=1, sensor="a") == draw(0, "noise", sensor="a", frame=1)
    values = {
        draw(0, "noise", frame=1),
        draw(1, "noise", frame=1),
        draw(0, "noise", frame=2),
        draw(0, "other", frame=1),
        draw(0, "noise", frame="1"),
        draw(0, "noise"),
    }
    assert len(values) == 6
    for bad in (-1, 0.5, True):
        with pytest.raises(ParameterRangeError):
            seeds.generator(bad, "noise")  # type: ignore[arg-type]


def test_sign_of_doppler() -> None:
    assert units.doppler_from_radial_velocity(10.0, 0.004) == pytest.approx(-5000.0)  # opening lowers the frequency


def test_decibels() -> None:
    assert units.db_to_power(3.0) == pytest.approx(1.99526, rel=1e-5)
    assert units.power_to_db(0.0) == -400.0
    assert units.watt_to_dbm(units.dbm_to_watt(12.0)) == pytest.approx(12.0)


def test_thermal_noise() -> None:
    # kT = -173.9752 dBm/Hz at 290 K (Friis 1944; link vector); F = 12 dB, B = 20 MHz adds 12 + 73.0103 dB
    expected = -173.9751871942 + 12 + 73.0102999566
    assert units.watt_to_dbm(units.thermal_noise_power(20e6, 12.0)) == pytest.approx(expected, abs=1e-8)
    assert units.thermal_noise_power(1.0, 0.0, source_temperature=0.0) == 0.0
    with pytest.raises(ParameterRangeError, match="bandwidth = 0"):
        units.thermal_noise_power(0.0, 3.0)
    with pytest.raises(ParameterRangeError, match="noise_figure_db"):
        units.thermal_noise_power(1.0, -1.0)


def test_semantic_classes() -> None:
    assert semantic_id("Car") == 14 and semantic_id("GuardRail") == 28 and semantic_id("Roads") == 1
    assert SEMANTIC_COLORS.shape == (len(SEMANTIC_CLASSES), 3)
    assert len({tuple(color) for color in SEMANTIC_COLORS}) == len(SEMANTIC_CLASSES)
    with pytest.raises(UnknownNameError, match="did you mean 'Car'"):
        semantic_id("Cars")


def test_spec_refuses_and_copies() -> None:
    spec = CameraSpec(width=640)
    assert spec.with_(height=360).height == 360 and spec.with_(height=360).width == 640
    for bad in ({"width": 0}, {"horizontal_fov_deg": 180.0}, {"widht": 3}, {"exposure": float("inf")}):
        with pytest.raises(ParameterRangeError, match=f"CameraSpec.{next(iter(bad))}"):
            CameraSpec(**bad)
    with pytest.raises(ParameterRangeError):
        spec.with_(width=-1)
    with pytest.raises(Exception, match="frozen"):
        spec.width = 3  # type: ignore[misc]


def test_intrinsics() -> None:
    matrix = CameraSpec(width=960, height=540, horizontal_fov_deg=90.0).intrinsics
    np.testing.assert_allclose(matrix, [[480, 0, 480], [0, 480, 270], [0, 0, 1]], rtol=1e-12)


def test_unknown_sensor_kind() -> None:
    with pytest.raises(UnknownNameError, match="sonar"):
        sensor_class("sonar")
