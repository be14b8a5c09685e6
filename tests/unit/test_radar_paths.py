"""RadarPaths as a container: none, some, several blocks in one, and the lengths of all kinds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.pattern import CosinePattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import dbm_to_watt
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.link import path_amplitude, received_power
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.points import point_targets
from scarl_sionna.signal.antenna import field_gain
from scarl_sionna.signal.link import radar_gain, spreading
from scarl_sionna.signal.noise import angle_cell_noise_power, cell_noise_power, sample_noise_power

RADAR = RadarSpec()
POSE = Pose.from_euler([1.0, -2.0, 0.7], yaw=0.4, pitch=0.1)
BLOCK = point_targets([[9.0, 1.0, 0.2], [5.0, 3.0, 1.0]], np.ones((2, 3)), [2.0, 3.0], RADAR, POSE)
FLOOR = np.array([[[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0]]])
"""The mirror z = 0 as an isometry."""


def mirror_chain() -> RadarPaths:
    """One path by the floor straight back to the radar, with two columns of labels.

    Its points lie far from where it goes.
    """
    one = BLOCK.select([0])
    labels = {name: np.array([[3, 4]], dtype=np.int32) for name in ("instance", "interaction")}
    return replace(one, rx_image=FLOOR, depth=np.array([2], dtype=np.int32), **labels)


def test_length_is_that_between_the_array_centres() -> None:
    inner = replace(BLOCK, inner_length=np.array([0.0, 7.0]))
    legs = np.linalg.norm(BLOCK.tx_point - POSE.position, axis=1)
    assert inner.length == pytest.approx(2.0 * legs + [0.0, 7.0], rel=1e-15)
    assert mirror_chain().length == pytest.approx([2.0 * POSE.position[2]], rel=1e-15)  # there and back at right angles
    assert not inner.is_mirror_chain.any() and mirror_chain().is_mirror_chain.all()
    both = RadarPaths.concatenate([inner, mirror_chain()])
    assert np.array_equal(PathGeometry.of(both, RADAR).center_length(), both.length)


def test_a_mirror_chain_leaves_towards_the_image_and_arrives_from_it() -> None:
    tx_vector, rx_vector = mirror_chain().end_vectors()
    down = [[0.0, 0.0, -2.0 * POSE.position[2]]]
    assert tx_vector == pytest.approx(np.array(down), abs=1e-15) and rx_vector == pytest.approx(
        np.array(down), abs=1e-15
    )
    before = BLOCK.tx_point.copy()
    BLOCK.end_vectors()
    assert np.array_equal(BLOCK.tx_point, before)


def test_blocks_become_one_in_their_order() -> None:
    both = RadarPaths.concatenate([BLOCK, mirror_chain()], {"method": "test"})
    assert both.num_paths == 3 and both.diagnostics == {"method": "test"}
    assert both.instance.tolist() == [[1, -1], [2, -1], [3, 4]] and both.instance.dtype == np.int32
    assert np.isnan(both.rx_image[:2]).all() and np.array_equal(both.rx_image[2], FLOOR[0])
    for name in (
        "tx_point",
        "rx_point",
        "a",
        "length_rate",
        "length_acceleration",
        "depth",
        "semantic",
        "inner_length",
    ):
        joined, first, second = (getattr(paths, name) for paths in (both, BLOCK, mirror_chain()))
        assert np.array_equal(joined, np.concatenate([first, second])) and joined.dtype == first.dtype, name
    again = both.select([0, 1])
    assert np.array_equal(again.a, BLOCK.a) and np.array_equal(again.length, BLOCK.length)
    assert RadarPaths.concatenate([BLOCK, BLOCK]).rx_image is None


def test_nothing_is_a_block_like_any_other() -> None:
    none = RadarPaths.empty(POSE, max_depth=3)
    assert none.num_paths == 0 and none.length.shape == (0,) and none.instance.shape == (0, 3)
    assert none.world_from_rx is POSE
    both = RadarPaths.concatenate([none, BLOCK, none])
    assert np.array_equal(both.a, BLOCK.a) and both.instance.shape == (2, 3)
    assert received_power(none, RADAR).shape == (0,)


def test_blocks_of_two_radars_are_refused() -> None:
    same = replace(BLOCK, world_from_tx=Pose(POSE.position, POSE.quaternion))
    assert RadarPaths.concatenate([BLOCK, same]).num_paths == 4
    other = replace(BLOCK, world_from_rx=Pose(POSE.position + [0.0, 0.0, 1e-3], POSE.quaternion))
    with pytest.raises(ParameterRangeError, match="number 1 is of another radar pose"):
        RadarPaths.concatenate([BLOCK, other])
    with pytest.raises(ParameterRangeError, match=r"RadarPaths.empty"):
        RadarPaths.concatenate([])


@pytest.mark.parametrize("polarization", ["V", "H"])
def test_received_power_is_the_radar_equations(polarization: str) -> None:
    radar = RADAR.with_(pattern=CosinePattern(), polarization=polarization)
    local = POSE.inverse().apply(BLOCK.tx_point)
    gain = field_gain(radar.array.pattern, local) ** 4
    distance = np.linalg.norm(local, axis=1)
    expected = dbm_to_watt(radar.front_end.tx_power_dbm) * gain * np.array([2.0, 3.0])
    expected = expected * radar.wavelength**2 / ((4.0 * np.pi) ** 3 * distance**4)
    assert received_power(BLOCK, radar) == pytest.approx(expected, rel=1e-12)
    assert np.conj(path_amplitude(BLOCK, radar)) == pytest.approx(PathGeometry.of(BLOCK, radar).amplitude, rel=1e-12)


def test_radar_equation_and_spreading_are_one() -> None:
    distance = np.array([2.0, 40.0])
    assert radar_gain(0.004, distance) == pytest.approx(0.004**2 / ((4 * np.pi) ** 3 * distance**4), rel=1e-14)
    assert spreading(0.004, 2.0, 5.0, 3.0) == pytest.approx(0.004 / (4 * np.pi) / 30.0, rel=1e-14)


def test_noise_of_a_cell_falls_with_what_is_averaged() -> None:
    map_cell = sample_noise_power(RADAR) / (RADAR.num_samples * RADAR.num_chirps)
    assert cell_noise_power(RADAR, "rect") == pytest.approx(map_cell, rel=1e-12)
    assert angle_cell_noise_power(RADAR) == pytest.approx(map_cell / RADAR.num_virtual, rel=1e-12)
    # two long hann windows: 1.5 bins each, less by the finite length (1 / num_samples)
    assert cell_noise_power(RADAR, "hann") == pytest.approx(2.25 * map_cell, rel=0.03)
    assert cell_noise_power(RADAR, "hann", "rect") == pytest.approx(1.5 * map_cell, rel=0.02)
