"""RCS of detections where the antennas hear next to nothing: not known, in every table that has it."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.dataset.derived.radar_points import SensedPoints, velocity_over_ground
from scarl_sionna.dataset.formats.nuscenes_parts.files import RADAR_FIELDS, radar_file
from scarl_sionna.dataset.point_clouds.nuscenes import read_nuscenes_points
from scarl_sionna.dataset.statistics.counted import POINT_ROW
from scarl_sionna.dataset.statistics.of_points import count_points
from scarl_sionna.dataset.statistics.published import FEWEST, GROUP_NAMES, _rcs_by_range
from scarl_sionna.signal.antenna import beam_gain
from scarl_sionna.signal.detection.cross_section import DEAF_DB, cross_section
from scarl_sionna.signal.direction.manifold import directions
from tests.radar_points import planted

RADAR = ss.RadarSpec()


def test_it_is_not_known_where_the_antennas_are_deaf() -> None:
    """Elements of a cosine to the power of 20.4 over elevation: 60 dB down at 45 deg both ways."""
    sines = np.sin(np.radians([[0.0, 0.0], [30.0, -20.0], [0.0, 44.0], [0.0, 46.0], [88.0, 0.0]]))
    gain = beam_gain(RADAR.array, directions(*np.arcsin(sines).T))
    down = 10.0 * np.log10(gain / gain[0])
    assert down[2] > -DEAF_DB > down[3]
    distance, received = np.full(5, 20.0), 1e-12 * gain / gain[0]
    found = cross_section(RADAR, sines, distance, received)
    assert np.isnan(found).tolist() == [False, False, False, True, False]
    np.testing.assert_allclose(found[[1, 2, 4]], found[0], rtol=1e-9)


@pytest.mark.parametrize("sine", [1.0, -1.0, 1.3])
def test_it_is_not_known_at_the_ends_of_the_angles(sine: float) -> None:
    """Of antennas that hear everywhere alike, too."""
    radar = RADAR.with_(pattern=IsotropicPattern())
    for sines in ([[sine, 0.0]], [[0.0, sine]]):
        assert np.isnan(cross_section(radar, np.array(sines), np.ones(1), np.ones(1))).all()
    assert np.isfinite(cross_section(radar, np.array([[0.9999, 0.0]]), np.ones(1), np.ones(1))).all()


def test_it_is_not_known_at_range_0() -> None:
    found = cross_section(RADAR, np.zeros((2, 2)), np.array([0.0, 0.1]), np.ones(2))
    assert np.isnan(found).tolist() == [True, False]


def test_a_point_at_range_0_has_a_direction() -> None:
    """It stands at the radar; its velocity over ground is still that of its own line of sight."""
    there = planted(np.zeros((1, 2)), np.array([-8.66]))
    points = replace(there, azimuth=np.array([np.pi / 6]))
    assert velocity_over_ground(points, np.array([10.0, 0.0, 0.0])) == pytest.approx(10 * np.cos(np.pi / 6) - 8.66)


def cells(radar: ss.RadarSpec, waves: dict[float, float]) -> ss.RadarPoints:
    """Return the points of one cell: amplitudes by sines, which may be beyond the real angles, over noise of 1."""
    rng = np.random.default_rng(0)
    shape = radar.num_virtual, radar.num_chirps, radar.num_samples
    cube = (rng.normal(size=shape) + 1j * rng.normal(size=shape)) / np.sqrt(2.0)
    place = np.arange(radar.num_virtual)[:, None, None] * 0.4
    tone = np.exp(2j * np.pi * 20.0 / radar.num_samples * np.arange(radar.num_samples))
    for sine, amplitude in waves.items():
        cube = cube + amplitude * np.exp(-2j * np.pi * place * sine) * tone
    return ss.detect(ss.range_doppler_angle(cube.astype(np.complex64), radar), radar)


def test_a_wave_beyond_the_real_angles_has_no_rcs_and_is_no_further_direction() -> None:
    """Elements 0.4 wavelengths apart tell sines up to 1.25."""
    step = 0.4 * RADAR.wavelength
    radar = RADAR.with_(
        num_chirps=32,
        num_samples=64,
        tx_positions=((0, 0, 0),),
        rx_positions=tuple((0, step * index, 0) for index in range(8)),
    )
    lone = cells(radar, {1.05: 3.0})
    assert lone.num_points == 1 and abs(np.degrees(lone.azimuth[0])) == pytest.approx(90.0)
    assert np.isnan(lone.rcs[0]) and lone.snr_db[0] > 30.0
    both = cells(radar, {1.05: 1.0, 0.2: 6.0})
    assert both.num_points == 1
    assert np.sin(both.azimuth[0]) == pytest.approx(0.2, abs=0.03) and np.isfinite(both.rcs[0])
    real = cells(radar, {-0.7: 1.0, 0.2: 6.0})
    assert np.sin(real.azimuth) == pytest.approx([0.2, -0.7], abs=0.03) and np.isfinite(real.rcs).all()


def half_known() -> ss.RadarPoints:
    points = planted(np.array([[10.0, 0.0], [10.2, 0.3], [30.0, 0.0], [30.3, 0.2]]), np.zeros(4))
    return replace(points, rcs=np.array([np.nan, 2.0, np.nan, np.nan]))


def test_clusters_sum_what_is_known() -> None:
    found = ss.cluster(half_known())
    assert found.num_clusters == 2
    near = np.argmin(found.position[:, 0])
    assert found.rcs[near] == 2.0 and np.isnan(found.rcs[1 - near])


def test_files_of_nuscenes_keep_all_points(tmp_path: Path) -> None:
    """Their reader takes a cloud whose first point has a nan as empty, and leaves out points of unclear velocities."""
    points = replace(half_known(), velocity_interval=None)
    unit = points.position / points.range[:, None]
    data = radar_file(SensedPoints(points, unit, points.radial_velocity), RADAR)
    assert np.isfinite(np.frombuffer(data[data.index(b"binary\n") + 7 : -1][:15], "<f4", 3)).all()
    (tmp_path / "a__RADAR_FRONT__1.pcd").write_bytes(data)
    table = read_nuscenes_points(tmp_path / "a__RADAR_FRONT__1.pcd")
    assert table.num_points == 4
    np.testing.assert_allclose(table.rcs_dbsm, [np.nan, 10.0 * np.log10(2.0), np.nan, np.nan], rtol=1e-6)
    counted = count_points(table)
    with io.BytesIO() as picture:
        counted.charts().savefig(picture)


@pytest.mark.parametrize("radar", [RADAR, RADAR.with_(multiplexing="tdm")])
def test_files_of_nuscenes_tell_points_of_unclear_velocities(radar: ss.RadarSpec) -> None:
    wide, narrow = 2.0 * radar.unfolded_velocity, 2.0 * radar.unambiguous_velocity
    for told, states in (
        (np.array([wide, narrow, wide, narrow]), [3, 3, 3, 3] if wide == narrow else [3, 1, 3, 1]),
        (None, [3, 3, 3, 3]),
    ):
        points = replace(half_known(), velocity_interval=told)
        unit = points.position / points.range[:, None]
        data = radar_file(SensedPoints(points, unit, points.radial_velocity), radar)
        rows = np.frombuffer(data[data.index(b"binary\n") + 7 : -1], list(RADAR_FIELDS))
        assert rows["ambig_state"].tolist() == states


def test_medians_leave_it_out() -> None:
    rows = np.zeros(2 * FEWEST, POINT_ROW)
    rows["moving"], rows["range"], rows["rcs_dbsm"] = True, 15.0, 4.0
    rows["rcs_dbsm"][:FEWEST] = np.nan

    class Found:
        points = rows

    assert list(_rcs_by_range(Found(), (GROUP_NAMES[0],))) == [(1, 4.0)]  # type: ignore[arg-type]
