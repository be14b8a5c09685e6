"""The 4D tensors of K-Radar: power over Doppler, range, elevation and azimuth, a MATLAB file a frame.

References
----------
.. [1] D.-H. Paek, S.-H. Kong, K. T. Wijaya, "K-Radar: 4D radar object detection for autonomous driving in various
   weather conditions", NeurIPS 2022; github.com/kaist-avelab/K-Radar, datasets/kradar_detection_v1_0.py and v2_1.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputFileError, ParameterRangeError
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveform import Fmcw
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.core.untrusted.files import MEGABYTE
from scarl_sionna.core.untrusted.mat_file import read_mat
from scarl_sionna.signal.angle import RangeDopplerAngle

from ..capture import MOST_FRAME
from ..map_capture import MapCapture
from ..pieces import numbered

FORMAT = "kradar"
NAME = "arrDREA"
CARRIER = 77e9
RAMP_SHARE = 0.7
"""Of a chirp's interval that is sampled: no document tells."""
NOTE = (
    "maps of powers alone: nothing to detect in; carrier, ramp and antennas are not published, nor the sign of the "
    "velocity: a positive one is taken to open"
)


@dataclass(frozen=True)
class Axes:
    """The axes of the tensors, as the dataset has them.

    Attributes
    ----------
    range, doppler : ndarray of float64
        [m], [m/s].
    azimuth, elevation : ndarray of float64
        [deg], positive to the right and downwards.
    """

    range: npt.NDArray[np.float64]
    doppler: npt.NDArray[np.float64]
    azimuth: npt.NDArray[np.float64]
    elevation: npt.NDArray[np.float64]

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Of a tensor."""
        return len(self.doppler), len(self.range), len(self.elevation), len(self.azimuth)


PUBLISHED = Axes(
    range=np.asarray(np.arange(256) * 0.462890625, dtype=np.float64),
    doppler=np.asarray(np.arange(-32, 32) * 0.06039347555, dtype=np.float64),
    azimuth=np.arange(-53.0, 54.0),
    elevation=np.arange(-18.0, 19.0),
)
"""Of ``resources/info_arr.mat`` and ``arr_doppler.mat`` of the dataset's repository."""


def read_kradar_capture(path: str | Path, *, axes: str | Path | None = None) -> MapCapture:
    """Return the tensors of a sequence of K-Radar.

    Parameters
    ----------
    path : str or Path
        Folder of a sequence with ``radar_tesseract/tesseract_*.mat``, or that folder.
    axes : str or Path, optional
        Folder with other ``info_arr.mat`` and ``arr_doppler.mat`` than those of the dataset's repository.

    Returns
    -------
    MapCapture
        A frame takes 260 MB, and twice that while it is read.

    Raises
    ------
    InputFileError
        If a file is missing, damaged, too large, or no such tensor.
    """
    folder = Path(path).absolute()
    inner = folder / "radar_tesseract"
    files = list(numbered(inner if inner.is_dir() else folder, "tesseract_", ".mat").values())
    along = PUBLISHED if axes is None else _axes(Path(axes))
    radar = _radar(along, folder)

    def read(frame: int) -> RangeDopplerAngle:
        return _map(_array(files[frame], NAME, MOST_FRAME), along, radar, files[frame])

    return MapCapture(FORMAT, radar, tuple(file.stem for file in files), (NOTE,), read)


def _map(tensor: npt.NDArray[Any], along: Axes, radar: RadarSpec, path: Path) -> RangeDopplerAngle:
    """Return a tensor as a map: azimuth to the left and elevation upwards, both rising."""
    if tensor.shape != along.shape:
        raise InputFileError(f"has {NAME} of shape {tensor.shape}, the axes have {along.shape}", path)
    if not (np.all(np.isfinite(tensor)) and tensor.min() >= 0.0):
        raise InputFileError(f"has values in {NAME} that are no power", path)
    power = np.ascontiguousarray(tensor[:, :, ::-1, ::-1].transpose(0, 1, 3, 2), dtype=np.float32)
    return RangeDopplerAngle(
        data=power,
        range=along.range,
        radial_velocity=along.doppler,
        azimuth=-np.radians(along.azimuth[::-1]),
        elevation=-np.radians(along.elevation[::-1]),
        radar=radar,
        range_doppler=None,
        noise_power=float(np.median(power)),
    )


def _radar(along: Axes, path: Path) -> RadarSpec:
    """Return a radar with the axes of the maps; its antennas are the default's."""
    num_doppler, num_range = along.shape[:2]
    try:
        interval = SPEED_OF_LIGHT / CARRIER / (2.0 * num_doppler * float(along.doppler[1] - along.doppler[0]))
        sampled = RAMP_SHARE * interval
        bandwidth = SPEED_OF_LIGHT / (2.0 * float(along.range[1] - along.range[0]))
        return RadarSpec(
            waveform=Fmcw(
                start_frequency=CARRIER - bandwidth / 2.0,
                bandwidth=bandwidth,
                ramp_time=sampled,
                idle_time=interval - sampled,
                num_chirps=num_doppler,
                num_samples=num_range,
                sampling_frequency=num_range / sampled,
            )
        )
    except (ParameterRangeError, ZeroDivisionError) as error:
        raise InputFileError(f"has axes of no radar ({error})", path) from error


def _axes(folder: Path) -> Axes:
    """Return the axes of two files of a folder."""
    info, doppler = folder / "info_arr.mat", folder / "arr_doppler.mat"
    found = [_array(info, name, MEGABYTE) for name in ("arrRange", "arrAzimuth", "arrElevation")]
    lines = [
        np.asarray(values, dtype=np.float64).ravel() for values in (*found, _array(doppler, "arr_doppler", MEGABYTE))
    ]
    if not all(line.size > 1 and np.all(np.isfinite(line)) and np.all(np.diff(line) > 0.0) for line in lines):
        raise InputFileError("has an axis that does not rise", folder)
    return Axes(range=lines[0], doppler=lines[3], azimuth=lines[1], elevation=lines[2])


def _array(path: Path, name: str, most: int) -> npt.NDArray[Any]:
    try:
        found = read_mat(path, most)
    except InputFileError:
        raise
    except OSError as error:
        raise InputFileError(f"cannot be read ({error.strerror})", path) from error
    if name not in found:
        raise InputFileError(f"has no numbers {name} (there: {', '.join(found) or 'none'})", path)
    return found[name]
