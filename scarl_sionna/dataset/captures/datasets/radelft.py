"""Raw data of RaDelft: four chips of a cascade board, a file each, with mmWave Studio's description.

References
----------
.. [1] I. Roldan et al., "A deep automotive radar detector using the RaDelft dataset", IEEE Trans. Radar Systems 2,
   2024; order of the samples as in github.com/RaDelft/RaDelft-Dataset, signal_processing_matlab/DataLoader.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputFileError
from scarl_sionna.core.packages import require
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.untrusted.files import MEGABYTE
from scarl_sionna.signal.converter import step_size

from ..capture import LEVELS, Capture, check_frame_size
from ..pieces import Pieces, numbered
from ..ti_json import NUM_CHIPS, read_cascade
from ..ti_setup import Setup, array_of, radar_of

FORMAT = "radelft"
CHIPS = ("master", "slave1", "slave2", "slave3")
INTERPOLATION = 5
"""Bins of the calibration's range transform a sample (module_param.m, calibrationInterp)."""
LARGEST_CALIBRATION = 64 * MEGABYTE
FIRST = "the first frame of each recording is incomplete by the dataset's own code, which leaves it out"


def read_radelft_capture(
    path: str | Path,
    *,
    config: str | Path | None = None,
    calibration: str | Path | None = None,
    full_scale_dbm: float | None = None,
) -> Capture:
    """Return the raw data of a scene of RaDelft, or of another recording of TI's cascade board with its TDA2.

    Parameters
    ----------
    path : str or Path
        Folder with ``master_0000_data.bin``, ``slave1_0000_data.bin`` and so on, and ``.mmwave.json``.
    config : str or Path, optional
        The description, where the folder has several.
    calibration : str or Path, optional
        ``calibrateResults_*.mat`` of the dataset's repository (needs the extra ``hdf5``); `Capture.cube` then corrects
        phase and tone of every pair, as the dataset's code does; amplitudes stay.
    full_scale_dbm : float, optional
        Power at an antenna that a full-scale tone stands for [dBm]. Left out, powers are relative.

    Returns
    -------
    Capture

    Raises
    ------
    InputFileError
        If a file is missing, damaged, shorter than the others, or describes what is not read.
    MissingPackageError
        If a calibration is given and h5py is not installed.
    """
    folder = Path(path).absolute()
    description = _description(folder, config)
    setup = read_cascade(description)
    if setup.is_real:
        raise InputFileError("has real samples, complex ones are read", description)
    radar = radar_of(setup, description, array_of(setup, description, "mmwcas", None), full_scale_dbm)
    recordings = _recordings(folder, radar, description, setup.q_first)
    counts = [one.num_frames for one in recordings]
    frames = [(one, index) for one, count in zip(recordings, counts, strict=True) for index in range(count)]

    def read(frame: int) -> npt.NDArray[np.int16]:
        recording, index = frames[frame]
        return recording.read(index)

    notes = [*([LEVELS] if full_scale_dbm is None else []), FIRST]
    if len(recordings) > 1:
        notes.append(f"{len(recordings)} recordings one after the other, without a gap in time")
    return Capture(
        format=FORMAT,
        radar=radar,
        num_frames=len(frames),
        timestamp_ns=np.rint(np.arange(len(frames)) * (setup.frame_period * 1e9)).astype(np.int64),
        notes=tuple(notes),
        scale=step_size(radar),
        read=read,
        calibration=None if calibration is None else _factors(Path(calibration), setup, radar),
    )


@dataclass(frozen=True)
class _Recording:
    """Files of the four chips: receiver fastest, then sample, chirp of a loop, loop; I and Q side by side."""

    chips: Sequence[Pieces]
    radar: RadarSpec
    num_frames: int
    q_first: bool

    def read(self, frame: int) -> npt.NDArray[np.int16]:
        """Return I and Q of a frame, shape (num_rx, num_chirps_total, num_samples, 2)."""
        count = _chip_values(self.radar)
        parts = []
        for chip in self.chips:
            raw = chip.int16(2 * count * frame, count).reshape(
                self.radar.num_chirps_total, self.radar.num_samples, 4, 2
            )
            parts.append(raw.transpose(2, 0, 1, 3))
        whole = np.concatenate(parts)
        return np.ascontiguousarray(whole[..., ::-1]) if self.q_first else whole


def _chip_values(radar: RadarSpec) -> int:
    """Return the numbers of 16 bits of a frame of one chip."""
    return 2 * 4 * radar.num_chirps_total * radar.num_samples


def _description(folder: Path, config: str | Path | None) -> Path:
    if config is not None:
        return Path(config)
    found = sorted(folder.glob("*.mmwave.json"))
    if len(found) != 1:
        raise InputFileError(f"has {len(found)} descriptions (.mmwave.json)", folder, "give config=")
    return found[0]


def _recordings(folder: Path, radar: RadarSpec, description: Path, q_first: bool) -> list[_Recording]:
    size = check_frame_size(2 * NUM_CHIPS * _chip_values(radar), description) // NUM_CHIPS
    out = []
    for number, master in numbered(folder, "master_", "_data.bin").items():
        digits = master.name[len("master_") : -len("_data.bin")]
        chips = [Pieces([folder / f"{chip}_{digits}_data.bin"]) for chip in CHIPS]
        counts = [chip.num_bytes // size for chip in chips]
        if len(set(counts)) != 1:
            raise InputFileError(f"has recording {number} with {counts} frames of the four chips", folder)
        told = _told(folder / f"master_{digits}_idx.bin")
        if told is not None and told > counts[0]:
            raise InputFileError(
                f"tells of {told} frames, the data has {counts[0]}", folder, "copy the recording again"
            )
        out.append(_Recording(chips, radar, counts[0] if told is None else told, q_first))
    if not sum(one.num_frames for one in out):
        raise InputFileError(f"has no frame of {size} bytes a chip", folder)
    return out


def _told(path: Path) -> int | None:
    """Return the number of frames in the head of an index file; None without one."""
    if not path.exists():
        return None
    head = Pieces([path]).int16(0, 12).view("<u4")
    return int(head[3])


def _factors(path: Path, setup: Setup, radar: RadarSpec) -> npt.NDArray[np.complex64]:
    """Return by what raw data is multiplied, shape (num_rx, num_chirps_total, num_samples)."""
    tables = _calibration(path)
    bins, peaks = tables["RangeMat"][:, list(setup.order)], tables["PeakValMat"][:, list(setup.order)]
    slope, rate = tables["Slope_MHzperus"].item() * 1e12, tables["Sampling_Rate_sps"].item()
    if not (slope > 0.0 and rate > 0.0 and np.all(np.abs(peaks) > 0.0)):
        raise InputFileError("has a slope, a rate or an amplitude that is not above 0", path)
    one = setup.profile
    off = (bins - bins[0, 0]) * (rate / one.sample_rate) * (abs(one.slope) / slope) / INTERPOLATION
    phase = peaks[0, 0] / peaks
    samples = np.arange(one.num_samples) / one.num_samples
    factor = (phase / np.abs(phase))[:, :, None] * np.exp(-2j * np.pi * off[:, :, None] * samples)
    return np.tile(factor, (1, radar.num_chirps, 1)).astype(np.complex64)


def _calibration(path: Path) -> dict[str, npt.NDArray[Any]]:
    """Return the tables of a calibration file: those of pairs as (16 receivers, 12 transmitters)."""
    h5py = require("h5py", "hdf5")
    shapes = {
        "calibResult/RangeMat": (16, 12),
        "calibResult/PeakValMat": (16, 12),
        "params/Slope_MHzperus": (1, 1),
        "params/Sampling_Rate_sps": (1, 1),
    }
    Pieces([path])  # a regular file
    if path.stat().st_size > LARGEST_CALIBRATION:
        raise InputFileError(f"has {path.stat().st_size} bytes, at most {LARGEST_CALIBRATION} are read", path)
    out = {}
    try:
        with h5py.File(path, "r") as file:
            for name, shape in shapes.items():
                table = file[name]
                if table.shape != shape:
                    raise InputFileError(f"has {name} of shape {table.shape}, read is {shape}", path)
                values = table[()]
                if values.dtype.names:
                    values = values["real"] + 1j * values["imag"]
                out[name.rsplit("/", 1)[-1]] = np.asarray(values, dtype=np.complex128)
    except InputFileError:
        raise
    except (OSError, KeyError, AttributeError, ValueError, TypeError, RuntimeError) as error:
        raise InputFileError(f"is no calibration of the cascade board ({error})", path) from error
    if not all(np.all(np.isfinite(values)) for values in out.values()):
        raise InputFileError("has values that are no numbers", path)
    return {name: values if name == "PeakValMat" else values.real for name, values in out.items()}


__all__ = ["read_radelft_capture"]
