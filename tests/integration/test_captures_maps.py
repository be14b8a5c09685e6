"""Tensors of CARRADA, RADDet and K-Radar from writers of their documents: planted points are where they are."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
import scipy.io

import scarl_sionna as ss
from scarl_sionna.core.errors import InputFileError, ParameterRangeError
from scarl_sionna.core.untrusted.mat_file import read_mat
from scarl_sionna.dataset.captures.datasets.kradar import PUBLISHED
from tests.dataset_captures import Point
from tests.dataset_maps import (
    KRADAR_AZIMUTH,
    KRADAR_DOPPLER,
    KRADAR_RANGE,
    RANGE_BIN,
    VELOCITY_BIN,
    kradar_tensor,
    rad_beat,
    rad_tensor,
    write_kradar,
)

POINT = Point(17.43, 3.1, 21.0)


def assert_point(rda, wanted: Point) -> None:
    points = ss.detect(rda)
    assert abs(points.range[0] - wanted.range) < 0.15 * RANGE_BIN
    assert abs(points.radial_velocity[0] - wanted.velocity) < 0.15 * VELOCITY_BIN
    assert abs(np.degrees(points.azimuth[0]) - wanted.azimuth) < 0.5


def assert_cell(rda, wanted: Point) -> None:
    row, column, azimuth = np.unravel_index(int(rda.data.argmax()), rda.data.shape)
    assert abs(rda.range[column] - wanted.range) <= 0.51 * RANGE_BIN
    assert abs(rda.radial_velocity[row] - wanted.velocity) <= 0.51 * VELOCITY_BIN
    assert abs(np.degrees(rda.azimuth[azimuth]) - wanted.azimuth) <= 0.3


def test_carrada(tmp_path) -> None:
    folder = tmp_path / "2019-09-16-12-52-12" / "RAD_numpy"
    folder.mkdir(parents=True)
    tensor = rad_tensor(rad_beat(POINT, 0.3))
    np.save(folder / "000017.npy", tensor)
    capture = ss.read_capture(folder.parent, window="hann")
    assert capture.format == "carrada" and capture.names == ("000017",) and len(capture) == 1
    rda = capture[0]
    assert_cell(rda, POINT)
    assert_point(rda, POINT)
    again = ss.read_capture(folder, "carrada", window="hann")[0]
    channels = rda.range_doppler
    np.testing.assert_array_equal(again.range_doppler.data, channels.data)
    beam = np.fft.fftshift(np.fft.fft(channels.data, 256, axis=0), axes=0) / 8.0  # the dataset's own last step
    seen = beam[np.abs(np.arange(-128, 128) * 76.8 / 77.0 / 128.0) <= 1.0]
    np.testing.assert_allclose(np.abs(seen.transpose(1, 2, 0)) ** 2, rda.data, rtol=1e-3, atol=1e-6 * rda.data.max())
    assert rda.plot(view="range_azimuth").collections and channels.plot().collections


def test_powers_alone_are_no_channels(tmp_path) -> None:
    """A tensor that is no transform of eight channels gives a map, and an error where channels are needed."""
    tensor = rad_tensor(rad_beat(POINT))
    (tmp_path / "RAD_numpy").mkdir()
    np.save(tmp_path / "RAD_numpy" / "000000.npy", np.abs(tensor).astype(np.complex64))
    capture = ss.read_capture(tmp_path)
    assert (
        "powers alone" in capture.notes[0] and capture[0].range_doppler is None and "powers alone" in repr(capture[0])
    )
    assert_cell(capture[0], POINT)
    with pytest.raises(ParameterRangeError, match="powers alone"):
        ss.detect(capture[0])


def test_raddet_tensors_and_raw_data(tmp_path) -> None:
    for part, name in (("part1", "000004"), ("part2", "000005")):
        (tmp_path / part).mkdir()
        np.save(tmp_path / part / f"{name}.npy", np.rint(500.0 * rad_beat(POINT, 0.1, seed=int(name))))
    raw = ss.read_capture(tmp_path, "raddet_adc")
    assert len(raw) == 2 and raw[0].adc_int.shape == (8, 64, 256, 2)
    assert raw[1].adc_int[3, 7, 9].tolist() == [
        int(value) for value in (lambda x: (x.real, x.imag))(np.load(tmp_path / "part2" / "000005.npy")[9, 3, 7])
    ]
    rda = ss.range_doppler_angle(raw.cube(0), raw.radar)
    _, column, azimuth = np.unravel_index(int(rda.data.argmax()), rda.data.shape)
    assert abs(rda.range[column] - POINT.range) <= 0.6 * RANGE_BIN  # of a moving point, before and after its coupling
    assert abs(np.degrees(rda.azimuth[azimuth]) - POINT.azimuth) < 3.0
    assert raw.radar.range_resolution == pytest.approx(RANGE_BIN) and raw.radar.max_range == pytest.approx(50.0)
    assert raw.radar.velocity_resolution == pytest.approx(VELOCITY_BIN, rel=1e-6)
    (tmp_path / "RAD").mkdir()
    np.save(tmp_path / "RAD" / "7.npy", rad_tensor(rad_beat(POINT, 0.3)).astype(np.complex128))
    maps = ss.read_capture(tmp_path / "RAD" / "7.npy", "raddet", window="hann")
    assert_cell(maps[0], POINT)
    assert any("RADDet does not tell" in note for note in maps.notes)
    np.save(tmp_path / "part1" / "000004.npy", np.full((256, 8, 64), 0.5 + 0j))
    with pytest.raises(InputFileError, match="no whole numbers"):
        ss.read_capture(tmp_path / "part1", "raddet_adc")[0]


@pytest.mark.parametrize("packed", [True, False])
def test_kradar(tmp_path, packed) -> None:
    point = Point(6.9, -0.36, 11.0, -6.0)
    write_kradar(tmp_path, [kradar_tensor(Point(1.0, 0.0, 0.0)), kradar_tensor(point)], packed)
    capture = ss.read_capture(tmp_path, axes=tmp_path)
    assert capture.format == "kradar" and capture.names == ("tesseract_00030", "tesseract_00031")
    rda = capture[1]
    row, column, azimuth, elevation = np.unravel_index(int(rda.data.argmax()), rda.data.shape)
    assert (rda.range[column], rda.radial_velocity[row]) == pytest.approx((6.9, -0.36))
    assert np.degrees([rda.azimuth[azimuth], rda.elevation[elevation]]) == pytest.approx([11.0, -6.0])
    assert np.all(np.diff(rda.azimuth) > 0) and np.all(np.diff(rda.elevation) > 0)
    assert rda.plot().collections and rda.plot(view="range_doppler").collections
    with pytest.raises(InputFileError, match=r"shape \(16, 24, 7, 41\), the axes have \(64, 256, 37, 107\)"):
        ss.read_capture(tmp_path, "kradar")[0]
    with pytest.raises(ParameterRangeError, match="powers alone"):
        ss.detect(rda)


def test_the_published_axes() -> None:
    """First, last and width, as the files of the dataset's repository have them."""
    assert PUBLISHED.shape == (64, 256, 37, 107)
    assert (PUBLISHED.range[1], PUBLISHED.range[-1]) == pytest.approx((0.46289062, 118.03710938), abs=1e-6)
    assert (PUBLISHED.doppler[0], PUBLISHED.doppler[-1]) == pytest.approx((-1.93259122, 1.87219774), abs=1e-8)
    assert (PUBLISHED.azimuth[0], PUBLISHED.azimuth[-1], PUBLISHED.elevation[-1]) == (-53.0, 53.0, 18.0)


def test_what_is_wrong_in_tensors_is_told(tmp_path) -> None:
    with pytest.raises(InputFileError, match=r"no \.npy file"):
        ss.read_capture(tmp_path, "raddet")
    file = tmp_path / "0.npy"
    for values, message in (
        (np.zeros((256, 8, 64)), "float64 of shape"),
        (np.zeros((256, 256, 63), np.complex64), "shape"),
        (np.full((256, 256, 64), np.nan, np.complex64), "no numbers"),
    ):
        np.save(file, values)
        with pytest.raises(InputFileError, match=message):
            ss.read_capture(file, "raddet")
    with pytest.raises(InputFileError, match="float64"):
        np.save(file, np.zeros((256, 8, 64)))
        ss.read_capture(file, "raddet_adc")
    file.write_bytes(file.read_bytes()[:1000])
    with pytest.raises(InputFileError, match="damaged"):
        ss.read_capture(file, "raddet")


def test_what_is_wrong_in_matlab_files_is_told(tmp_path) -> None:
    write_kradar(tmp_path, [kradar_tensor(POINT)], packed=False)
    path = tmp_path / "radar_tesseract" / "tesseract_00030.mat"
    good = path.read_bytes()
    capture = ss.read_capture(tmp_path, axes=tmp_path)
    bomb = zlib.compress(bytes(20_000_000))
    for data, message in (
        (good[:100], "level 5"),
        (good[:126] + b"MI" + good[128:], "little-endian"),
        (good[:1000], "are left"),
        (good.replace(b"arrDREA", b"arrDREB"), "no numbers arrDREA"),
        (
            good.replace(struct.pack("<4i", 16, 24, 7, 41), struct.pack("<4i", 2**30, 2**30, 7, 41)),
            "bytes of float64 for",
        ),
        (good[:128] + struct.pack("<II", 15, 7) + b"garbage", "damaged"),
        (good[:128] + struct.pack("<II", 15, 0), "damaged"),
    ):
        path.write_bytes(data)
        with pytest.raises(InputFileError, match=message):
            capture[0]
    path.write_bytes(good[:128] + struct.pack("<II", 15, len(bomb)) + bomb)
    with pytest.raises(InputFileError, match="becomes larger than 1000000"):
        read_mat(path, 1_000_000)
    for bad in (-1.0, np.inf):
        tensor = kradar_tensor(POINT)
        tensor[0, 0, 0, 0] = bad
        scipy.io.savemat(path, {"arrDREA": tensor})
        with pytest.raises(InputFileError, match="no power"):
            capture[0]
    scipy.io.savemat(tmp_path / "arr_doppler.mat", {"arr_doppler": KRADAR_DOPPLER[::-1]})
    with pytest.raises(InputFileError, match="does not rise"):
        ss.read_capture(tmp_path, axes=tmp_path)


def test_matlab_files_of_scipy_come_back(tmp_path) -> None:
    wanted = {
        "a": np.arange(24.0).reshape(2, 3, 4),
        "b": KRADAR_AZIMUTH,
        "c": np.float32([[1.5]]),
        "d": np.zeros((0, 3)),
        "e": np.uint8([[255, 0, 3]]),
        "f": KRADAR_RANGE[:, None],
    }
    for packed in (False, True):
        other = {"text": "x", "complex": np.array([1j]), "cell": np.array(["a", 2], dtype=object), "s": {"x": 1.0}}
        scipy.io.savemat(tmp_path / "x.mat", {**wanted, **other}, do_compression=packed)
        found = read_mat(tmp_path / "x.mat", 1_000_000)
        assert set(found) == set(wanted)
        for name, values in wanted.items():
            assert found[name].dtype == values.dtype
            np.testing.assert_array_equal(found[name].ravel(), values.ravel())
        assert found["a"].shape == (2, 3, 4)
