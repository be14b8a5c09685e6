"""Recordings of real radars as kinds of malformed files: small ones of every format, and what reads them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from tests.dataset_captures import (
    COLORADAR,
    RADELFT,
    Point,
    write_coloradar,
    write_coloradar_phases,
    write_radelft,
    write_radial,
)
from tests.dataset_maps import kradar_tensor, write_kradar
from tests.malformed import Kind, evil_text
from tests.point_files import write_pcd, write_radar_scenes, write_vod
from tests.ti_captures import cfg_text, log_text, write_bin, write_studio


def _kind(write: Callable[[Path], None], files: tuple[str, ...], *reads: Callable[[Path], object]) -> Kind:
    """Return a kind of which every reader has its turn; a refusal by one does not keep the others from theirs."""
    replace = evil_text()

    def read(folder: Path) -> None:
        from scarl_sionna.core.errors import ScarlError

        errors: list[ScarlError] = []
        for one in reads:
            try:
                one(folder)
            except ScarlError as error:
                errors.append(error)
        if errors:
            raise errors[0]

    return Kind(write, files, read, lambda folder, case: replace(folder / files[case % len(files)], case // len(files)))


def _capture(inner: str, format: str, **options: str) -> Callable[[Path], object]:
    def read(folder: Path) -> object:
        import scarl_sionna as ss

        places = {name: folder / value if name in ("calibration", "axes") else value for name, value in options.items()}
        found = ss.read_capture(folder / inner, format, **places)
        return found.cube(0) if isinstance(found, ss.Capture) else found[0]

    return read


def _points(inner: str, format: str) -> Callable[[Path], object]:
    def read(folder: Path) -> object:
        import scarl_sionna as ss

        return ss.count_points(ss.read_points(folder / inner, format))

    return read


def _write_ti(folder: Path) -> None:
    for name in ("cfg", "studio", "log"):
        (folder / name).mkdir()
        write_bin(folder / name / "adc_data.bin", np.ones((4, 6, 128, 2), dtype=np.int16))
    (folder / "cfg" / "a.cfg").write_text(cfg_text((0, 2, 1), 2))
    (folder / "log" / "LogFile.txt").write_text(log_text((0, 2, 1), 2))
    write_studio(folder / "studio", (0, 2, 1), 2, ["adc_data.bin"])


def _write_cascades(folder: Path) -> None:
    import h5py

    (folder / "radelft").mkdir()
    frame = np.ones((12, 16, RADELFT.loops, RADELFT.samples, 2), dtype=np.int16)
    write_radelft(folder / "radelft", [frame], list(range(12)))
    with h5py.File(folder / "table.mat", "w") as file:
        file["calibResult/RangeMat"] = np.ones((16, 12))
        file["calibResult/PeakValMat"] = np.ones((16, 12), dtype=[("real", "<f8"), ("imag", "<f8")])
        file["params/Slope_MHzperus"] = file["params/Sampling_Rate_sps"] = np.array([[30.0]])
    write_coloradar(folder, "cascade", [np.ones((12, 16, COLORADAR.loops, COLORADAR.samples, 2), dtype=np.int16)])
    write_coloradar_phases(folder, np.zeros((12, 16)), np.ones((12, 16)))


def _write_radial(folder: Path) -> None:
    write_radial(folder, [np.ones((16, 256, 512, 2), dtype=np.int16)]).rename(folder / "radial")


def _write_maps(folder: Path) -> None:
    write_kradar(folder, [kradar_tensor(Point(6.9, -0.36, 11.0))])
    np.save(folder / "000000.npy", np.ones((256, 8, 64), dtype=np.complex64))


def _write_points(folder: Path) -> None:
    write_pcd(folder / "a.pcd", [{"x": 1.0 + k, "vx": 3.0} for k in range(5)])
    write_vod(folder / "a.bin", [(1.0, 2.0, 0.0, -7.0, 1.0, 0.0, 0.0)] * 5)
    car = {"range_sc": 20.0, "label_id": 0, "track_id": b"a"}
    write_radar_scenes(folder, [(1000, 1, [car, car]), (2000, 2, [car])])


CAPTURES: Mapping[str, Kind] = {
    "ti": _kind(
        _write_ti,
        ("cfg/a.cfg", "studio/radar.mmwave.json", "studio/radar.setup.json", "cfg/adc_data.bin", "log/LogFile.txt"),
        _capture("cfg", "dca1000"),
        _capture("log", "dca1000"),
        _capture("studio", "dca1000"),
    ),
    "cascades": _kind(
        _write_cascades,
        (
            "radelft/radar.mmwave.json", "radelft/master_0000_idx.bin", "radelft/slave2_0000_data.bin", "table.mat",
            "calib/cascade/waveform_cfg.txt", "calib/cascade/antenna_cfg.txt",
            "calib/cascade/phase_frequency_calib.txt", "run0/cascade/adc_samples/timestamps.txt",
            "run0/cascade/adc_samples/data/frame_0.bin",
        ),
        _capture("radelft", "radelft", calibration="table.mat"),
        _capture("run0", "coloradar"),
    ),
    "radial": _kind(
        _write_radial,
        ("radial/RECORD@2020-11-22_12.28.47_events_log.rec", "radial/RECORD@2020-11-22_12.28.47_radar_ch1.bin"),
        _capture("radial", "radial"),
    ),
    "maps": _kind(
        _write_maps,
        ("radar_tesseract/tesseract_00030.mat", "info_arr.mat", "arr_doppler.mat", "000000.npy"),
        _capture("", "kradar", axes=""),
        _capture("000000.npy", "raddet_adc"),
    ),
    "point_clouds": _kind(
        _write_points,
        ("a.pcd", "a.bin", "radar_data.h5", "scenes.json"),
        _points("a.pcd", "nuscenes"),
        _points("", "view_of_delft"),
        _points("", "radar_scenes"),
    ),
}  # fmt: skip # a table
