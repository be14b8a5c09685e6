"""Radar points of nuScenes, View-of-Delft, RadarScenes and of this project in one table."""

from __future__ import annotations

from dataclasses import replace

import h5py
import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import InputFileError, UnknownNameError
from scarl_sionna.dataset.derived.radar_points import SensedPoints, sensed_points
from scarl_sionna.dataset.formats.nuscenes_parts.files import radar_file
from scarl_sionna.dataset.statistics.groups import GROUP_NAMES
from tests.drive import drive
from tests.point_files import SCENES_ROW, write_pcd, write_radar_scenes, write_vod
from tests.radar_points import planted

NO_POINTS = planted(np.zeros((0, 2)), np.zeros(0))


def test_nuscenes(tmp_path) -> None:
    """Velocities are components along the line of sight; states that are not valid are left out."""
    moving = {"x": 30.0, "y": 40.0, "rcs": 12.5, "vx": -6.0, "vy": -8.0, "vx_comp": 0.6, "vy_comp": 0.8}
    front = [moving, {"x": 5.0, "invalid_state": 4}, {"x": 6.0, "ambig_state": 1}]
    back = [{"x": 3.0, "y": -4.0, "rcs": -5.0}]
    for sensor, stamp, points in (
        ("RADAR_FRONT", 1532402927664178, front),
        ("RADAR_BACK_LEFT", 1532402927700000, back),
    ):
        (tmp_path / sensor).mkdir()
        write_pcd(tmp_path / sensor / f"n015-2018-07-24-11-22-45+0800__{sensor}__{stamp}.pcd", points)
    table = ss.read_points(tmp_path, "nuscenes")
    assert table.sensors == ("RADAR_BACK_LEFT", "RADAR_FRONT") and table.num_scans == 2 and table.num_points == 2
    assert table.scan.tolist() == [0, 1] and table.sensor.tolist() == [1, 0]
    assert table.time == pytest.approx([0.0, 0.035822])
    assert table.range == pytest.approx([50.0, 5.0]) and table.azimuth == pytest.approx(np.arctan2([40, -4], [30, 3]))
    assert table.radial_velocity == pytest.approx([-10.0, 0.0]) and table.velocity_over_ground == pytest.approx(
        [1.0, 0]
    )
    assert table.rcs_dbsm.tolist() == [12.5, -5.0]
    assert table.lacks == ("elevation", "snr_db", "group", "track") and "2 points of states" in table.notes[1]
    assert ss.read_points(tmp_path / "RADAR_FRONT", "nuscenes", only_valid=False).num_points == 3
    assert "lacks" in repr(table) and not ss.count_points(table).scans.size


def test_a_sweep_of_nuscenes_without_points(tmp_path) -> None:
    """The dataset says it by a first point of nan, as our exporter does."""
    none = SensedPoints(NO_POINTS, np.zeros((0, 3)), np.zeros(0))
    (tmp_path / "a__RADAR_FRONT__1000000.pcd").write_bytes(radar_file(none, ss.RadarSpec()))
    write_pcd(tmp_path / "a__RADAR_FRONT__2000000.pcd", [{"x": 5.0}])
    table = ss.read_points(tmp_path, "nuscenes")
    assert table.num_scans == 2 and table.scan.tolist() == [1] and table.time.tolist() == [1.0]
    assert ss.read_points(tmp_path / "a__RADAR_FRONT__1000000.pcd", "nuscenes").num_points == 0
    write_pcd(tmp_path / "a__RADAR_FRONT__3000000.pcd", [{"x": 5.0}, {"x": float("nan")}])
    with pytest.raises(InputFileError, match="no numbers"):
        ss.read_points(tmp_path, "nuscenes")


def test_view_of_delft(tmp_path) -> None:
    write_vod(tmp_path / "00549.bin", [(3.0, 4.0, 0.0, -7.0, -2.0, 0.5, 0.0), (1.0, 0.0, 1.0, 3.0, 1.0, 0.0, -1.0)])
    write_vod(tmp_path / "00550.bin", [])
    write_vod(tmp_path / "00551.bin", [(8.0, -6.0, 10.0, 20.0, 4.0, 3.0, 0.0)])
    table = ss.read_points(tmp_path, "view_of_delft")
    assert table.num_scans == 3 and table.scan.tolist() == [0, 2]
    assert table.range == pytest.approx([5.0, np.sqrt(200.0)])
    assert np.degrees(table.elevation) == pytest.approx([0.0, 45.0])
    assert table.radial_velocity.tolist() == [-2.0, 4.0] and table.velocity_over_ground.tolist() == [0.5, 3.0]
    assert table.rcs_dbsm.tolist() == [-7.0, 20.0] and table.lacks == ("time", "snr_db", "group", "track")
    assert ss.read_points(tmp_path, "view_of_delft", only_latest=False).num_points == 3
    write_vod(tmp_path / "00552.bin", [(8.0, -6.0, 10.0, float("nan"), 4.0, 3.0, 0.0)])  # as our own export has it
    assert np.isnan(ss.read_points(tmp_path / "00552.bin", "view_of_delft").rcs_dbsm).all()
    write_vod(tmp_path / "00552.bin", [(8.0, -6.0, 10.0, float("inf"), 4.0, 3.0, 0.0)])
    with pytest.raises(InputFileError, match="no numbers"):
        ss.read_points(tmp_path, "view_of_delft")


CAR = {"label_id": 0, "track_id": b"a"}
FAR = {"range_sc": 20.0, "azimuth_sc": 0.1, "vr": -5.0, "vr_compensated": 2.0, "rcs": 8.0, **CAR}
NEAR = {"range_sc": 10.0, "azimuth_sc": -0.5, "vr_compensated": 1.0, "rcs": 10.0, **CAR}
GROUP = {"range_sc": 7.0, "label_id": 8, "track_id": b"b", "vr_compensated": 1.4}
SCANS = [
    (2_000_000, 3, [FAR, FAR]),
    (1_000_000, 1, [*({**NEAR, "vr": v} for v in (1.0, 2.0, 3.0)), {"range_sc": 40.0, "rcs": -20.0}, GROUP]),
]


def test_radar_scenes_and_its_counts(tmp_path) -> None:
    write_radar_scenes(tmp_path, SCANS)
    table = ss.read_points(tmp_path, "radar_scenes")
    assert table.num_points == 7 and table.num_scans == 2
    assert table.scan.tolist() == [1, 1, 0, 0, 0, 0, 0] and table.sensor.tolist() == [2, 2, 0, 0, 0, 0, 0]
    assert table.time.tolist() == [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert table.position[2] == pytest.approx([10 * np.cos(0.5), -10 * np.sin(0.5), 0.0])
    assert [GROUP_NAMES[group] for group in table.group if group >= 0] == ["car"] * 5 + ["pedestrian"]
    assert table.track[0] == table.track[2] != table.track[6] and table.track[5] == -1
    assert table.lacks == ("elevation", "snr_db")
    counts = ss.count_points(table)
    found = {(row["group"], round(float(row["range"]))): row for row in counts.scans}
    assert {key: int(row["points"]) for key, row in found.items()} == {(0, 10): 3, (0, 20): 2, (3, 7): 1}
    assert found[0, 10]["velocity_spread"] == pytest.approx(np.std([1, 2, 3])) and found[0, 10]["moving"]
    assert np.isnan(found[0, 20]["velocity_spread"])
    assert counts.points["rcs_dbsm"].tolist() == [8, 8, 10, 10, 10, -20, 0]
    figure = counts.charts()
    line = figure.axes[0].lines[0]
    assert line.get_label() == "car" and line.get_ydata()[1:3].tolist() == [3.0, 2.0]  # 10 to 20 m, 20 to 30 m
    assert "car" in repr(counts)


@pytest.fixture(scope="module")
def own() -> ss.PointTable:
    return ss.point_table(drive(2))


def test_ours_has_the_same_columns_and_the_same_counts(own) -> None:
    """Looks of road users and points are those of the statistics of datasets."""
    statistics = ss.dataset_statistics(drive(2))
    assert own.num_points == len(statistics.points) > 0
    counts = ss.count_points(own)
    for name in ("group", "range", "snr_db", "rcs_dbsm"):
        np.testing.assert_allclose(np.sort(counts.points[name]), np.sort(statistics.points[name]), rtol=1e-6)
    seen = statistics.scans[statistics.scans["points"] > 0]
    for number in range(len(GROUP_NAMES)):
        ours, theirs = (np.sort(rows["points"][rows["group"] == number]) for rows in (counts.scans, seen))
        assert ours.tolist() == theirs.tolist()
    assert own.source == "scarl-sionna" and own.num_scans > 0 and "radial_velocity" not in own.lacks
    np.testing.assert_allclose(np.linalg.norm(own.position, axis=1), own.range, rtol=1e-9)
    half = own.select(own.range > np.median(own.range))
    assert half.num_points == (own.range > np.median(own.range)).sum()


@pytest.mark.parametrize("wider", [1.0, 3.0])
def test_velocities_of_ours_are_folded_to_what_all_points_tell(monkeypatch, wider) -> None:
    def told(*arguments):
        sensed = sensed_points(*arguments)
        width = np.full(sensed.points.num_points, 3.0)
        width[-1:] = wider
        return replace(sensed, points=replace(sensed.points, velocity_interval=width))

    monkeypatch.setattr("scarl_sionna.dataset.point_clouds.own.sensed_points", told)
    assert ss.point_table(drive(2)).velocity_interval.tolist() == [wider, wider]
    monkeypatch.setattr(
        "scarl_sionna.dataset.point_clouds.own.sensed_points",
        lambda *arguments: replace(sensed_points(*arguments), points=NO_POINTS, compensated_velocity=np.zeros(0)),
    )
    assert np.isnan(ss.point_table(drive(2)).velocity_interval).all()


def test_radars_that_are_not_there() -> None:
    with pytest.raises(UnknownNameError):
        ss.point_table(drive(2), ["rear"])
    with pytest.raises(UnknownNameError, match="radar_scenes"):
        ss.read_points("x", "radarscenes")


def test_bad_files_are_told(tmp_path) -> None:
    for name in ("nuscenes", "view_of_delft"):
        with pytest.raises(InputFileError, match="has no"):
            ss.read_points(tmp_path, name)
    path = tmp_path / "a.pcd"
    write_pcd(path, [{"x": 1.0}])
    good = path.read_bytes()
    for old, new, message in (
        (b"DATA binary", b"DATA ascii", "binary data"),
        (b"WIDTH 1", b"WIDTH 99999999", "bytes for 99999999"),
        (b"WIDTH 1", b"WIDTH -1", "bytes for -1"),
        (b"WIDTH 1", b"WIDTH x", "damaged head"),
        (b"COUNT 1", b"COUNT 2", "damaged head"),
        (b"SIZE 4", b"SIZE 3", "damaged head"),
        (b"dyn_prop", b"rcs", "damaged head"),
        (b" rcs ", b" rcz ", "no field rcs"),
    ):
        assert old in good
        path.write_bytes(good.replace(old, new))
        with pytest.raises(InputFileError, match=message):
            ss.read_points(path, "nuscenes")
    path.write_bytes(
        good.replace(b"DATA binary\n" + np.float32(1.0).tobytes(), b"DATA binary\n" + np.float32(np.inf).tobytes())
    )
    with pytest.raises(InputFileError, match="no numbers"):
        ss.read_points(path, "nuscenes")
    write_vod(tmp_path / "a.bin", [(float("inf"),) * 7])
    with pytest.raises(InputFileError, match="no numbers"):
        ss.read_points(tmp_path, "view_of_delft")
    (tmp_path / "a.bin").write_bytes(bytes(30))
    with pytest.raises(InputFileError, match="multiple of 28"):
        ss.read_points(tmp_path, "view_of_delft")


def test_bad_sequences_of_radar_scenes_are_told(tmp_path) -> None:
    write_radar_scenes(tmp_path, SCANS)
    scenes, table = tmp_path / "scenes.json", tmp_path / "radar_data.h5"
    text = scenes.read_text()
    for old, new, message in (
        ("[2, 7]", "[2, 8]", "rows 2 to 8"),
        ("[2, 7]", "[2]", "is no scenes.json"),
        ('"sensor_id": 1', '"sensor_id": 9', "is no scenes.json"),
        ('"2000000"', '"soon"', "is no scenes.json"),
    ):
        assert old in text
        scenes.write_text(text.replace(old, new))
        with pytest.raises(InputFileError, match=message):
            ss.read_points(tmp_path, "radar_scenes")
    scenes.write_text(text)
    rows = np.zeros(7, SCENES_ROW)
    for change, message in (
        ({"label_id": 12}, "label that there is not"),
        ({"vr": np.nan}, "no numbers"),
        (None, "no vr"),
    ):
        bad = rows.copy()
        if change is None:
            bad = np.zeros(7, [item for item in SCENES_ROW.descr if item[0] != "vr"])
        else:
            bad[next(iter(change))][3] = next(iter(change.values()))
        with h5py.File(table, "w") as file:
            file["radar_data"] = bad
        with pytest.raises(InputFileError, match=message):
            ss.read_points(tmp_path, "radar_scenes")
    table.write_bytes(b"x")
    with pytest.raises(InputFileError, match="is no radar_data.h5"):
        ss.read_points(tmp_path, "radar_scenes")
    table.unlink()
    with pytest.raises(InputFileError, match="radar_data.h5"):
        ss.read_points(tmp_path, "radar_scenes")
