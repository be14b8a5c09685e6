"""Range-azimuth-Doppler tensors of CARRADA and RADDet, and the raw data of RADDet: one radar, one processing.

The tensors are complex and made by Fourier transforms, so that the eight channels come back from them.

References
----------
.. [1] A. Ouaknine et al., "CARRADA dataset: camera and automotive radar with range-angle-Doppler annotations", ICPR
   2020; github.com/valeoai/carrada_dataset, utils/transform_data.py and transform_annotations.py.
.. [2] A. Zhang, F. E. Nowruzi, R. Laganiere, "RADDet: range-azimuth-Doppler based radar object detection for dynamic
   road users", CRV 2021; github.com/ZhangAoCanada/RADDet, README.md and util/helper.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputFileError
from scarl_sionna.core.specs.radar.array import AntennaArray
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveform import Fmcw
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.core.untrusted.numpy_file import read_npy
from scarl_sionna.signal.angle import RangeDopplerAngle
from scarl_sionna.signal.converter import step_size
from scarl_sionna.signal.detection.detector import noise_floor
from scarl_sionna.signal.processing import RangeDoppler, doppler_axis, range_axis
from scarl_sionna.signal.windows import window_values

from ..capture import LEVELS, MOST_FRAME, Capture
from ..map_capture import MapCapture

NUM_RANGE, NUM_AZIMUTH, NUM_DOPPLER, NUM_CHANNELS = 256, 256, 64, 8
RANGE_BIN = 0.1953125
"""[m] in both datasets."""
VELOCITY_BIN = 0.41968030701528203
"""[m/s] in both datasets."""
CARRIER, DESIGN = 77e9, 76.8e9
"""Frequency, and the one that the antennas' spacing of half a wavelength is for (RADDet's README) [Hz]."""
RAMP_SHARE = 0.7
"""Of a chirp's interval that is sampled: no document tells."""
MOST_BEYOND = 1e-3
"""Power of a tensor that its eight channels may leave out before it is taken for one of powers alone."""
WINDOWS = "the windows of the transforms are not published: window= says which, no direction depends on it"
ORDER = "levels are relative; time division and its order are not published: motion between transmitters is not undone"
AS_CARRADA = "order of rows, columns and velocities as in CARRADA, which has the same radar; RADDet does not tell"
POWERS_ALONE = "the first tensor is no transform of eight channels: maps have powers alone, nothing to detect in"


def read_carrada_capture(path: str | Path, *, window: str = "rect") -> MapCapture:
    """Return the range-azimuth-Doppler tensors of a sequence of CARRADA.

    Parameters
    ----------
    path : str or Path
        Folder of a sequence with ``RAD_numpy/*.npy``, or that folder.
    window : str
        Of the transforms over range and Doppler, see :func:`scarl_sionna.range_doppler`.

    Returns
    -------
    MapCapture

    Raises
    ------
    InputFileError
        If a file is missing, damaged, or no such tensor.
    """
    folder = Path(path).absolute()
    inner = folder / "RAD_numpy"
    return _capture("carrada", _files(inner if inner.is_dir() else folder), window, ())


def read_raddet_capture(path: str | Path, *, window: str = "rect") -> MapCapture:
    """Return the range-azimuth-Doppler tensors of RADDet.

    Parameters
    ----------
    path : str or Path
        Folder ``RAD`` with ``part1/*.npy`` and so on, one such part, or a file.
    window : str
        Of the transforms over range and Doppler, see :func:`scarl_sionna.range_doppler`.

    Returns
    -------
    MapCapture

    Raises
    ------
    InputFileError
        If a file is missing, damaged, or no such tensor.
    """
    return _capture("raddet", _files(Path(path).absolute()), window, (AS_CARRADA,))


def read_raddet_adc_capture(path: str | Path, *, full_scale_dbm: float | None = None) -> Capture:
    """Return the raw data of RADDet.

    Parameters
    ----------
    path : str or Path
        Folder ``ADC`` with ``part1/*.npy`` and so on, one such part, or a file: (256 samples, 8 antennas, 64 chirps).
    full_scale_dbm : float, optional
        Power at an antenna that a full-scale tone stands for [dBm]. Left out, powers are relative.

    Returns
    -------
    Capture
        Times are the numbers of frames in seconds: the dataset has single frames.

    Raises
    ------
    InputFileError
        If a file is missing, damaged, or no such array of whole numbers.
    """
    radar, files = raddet_radar(), _files(Path(path).absolute())
    if full_scale_dbm is not None:
        radar = radar.with_(full_scale_dbm=full_scale_dbm)
    _complex(files[0], (NUM_RANGE, NUM_CHANNELS, NUM_DOPPLER))

    def read(frame: int) -> npt.NDArray[np.int16]:
        found = _complex(files[frame], (NUM_RANGE, NUM_CHANNELS, NUM_DOPPLER))
        pairs = np.stack([found.real, found.imag], axis=-1).transpose(1, 2, 0, 3)
        whole = np.rint(pairs)
        if np.abs(pairs - whole).max() > 1e-3 or np.abs(whole).max() > 32768:
            raise InputFileError("has samples that are no whole numbers of 16 bits", files[frame])
        return np.ascontiguousarray(np.clip(whole, -32768, 32767).astype(np.int16))

    times = np.arange(len(files), dtype=np.int64) * 10**9
    notes = (
        *([LEVELS] if full_scale_dbm is None else []),
        ORDER,
        "sign of velocities and order of antennas are a guess",
    )
    return Capture("raddet_adc", radar, len(files), times, notes, step_size(radar), read)


def raddet_radar() -> RadarSpec:
    """Return a radar with the axes of both datasets: eight receivers in a row, their places growing to the right."""
    interval = SPEED_OF_LIGHT / CARRIER / (2.0 * NUM_DOPPLER * VELOCITY_BIN)
    sampled, bandwidth = RAMP_SHARE * interval, SPEED_OF_LIGHT / (2.0 * RANGE_BIN)
    half = SPEED_OF_LIGHT / DESIGN / 2.0
    places = tuple((0.0, -half * (index - (NUM_CHANNELS - 1) / 2), 0.0) for index in range(NUM_CHANNELS))
    return RadarSpec(
        waveform=Fmcw(
            start_frequency=CARRIER - bandwidth / 2.0 * (1.0 - 1.0 / NUM_RANGE),
            bandwidth=bandwidth,
            ramp_time=sampled,
            idle_time=interval - sampled,
            num_chirps=NUM_DOPPLER,
            num_samples=NUM_RANGE,
            sampling_frequency=NUM_RANGE / sampled,
        ),
        array=AntennaArray(tx_positions=((0.0, 0.0, 0.0),), rx_positions=places),
    )


def _capture(name: str, files: Sequence[Path], window: str, notes: tuple[str, ...]) -> MapCapture:
    maps = _Maps(files, raddet_radar(), window)
    has_channels = maps.read(0).range_doppler is not None
    told = (WINDOWS, ORDER) if has_channels else (POWERS_ALONE, ORDER)
    return MapCapture(name, maps.radar, tuple(file.stem for file in files), (*told, *notes), maps.read)


@dataclass(frozen=True)
class _Maps:
    """Tensors of one frame each, (range, azimuth, Doppler), turned by 180 degrees over the first two."""

    files: Sequence[Path]
    radar: RadarSpec
    window: str

    def read(self, frame: int) -> RangeDopplerAngle:
        """Return the map of a frame: levels as if a step of the converter were the radar's."""
        tensor = _complex(self.files[frame], (NUM_RANGE, NUM_AZIMUTH, NUM_DOPPLER))
        tensor = _opening(np.rot90(tensor, 2)) * self._scale()
        power = np.abs(tensor.transpose(2, 0, 1)).astype(np.float32) ** 2 / np.float32(NUM_CHANNELS**2)
        rd = self._channels(tensor)
        noise = float(np.median(power)) if rd is None else rd.noise_power / NUM_CHANNELS
        sine = np.arange(-NUM_AZIMUTH // 2, NUM_AZIMUTH // 2) * (2.0 / NUM_AZIMUTH) * DESIGN / CARRIER
        seen = np.abs(sine) <= 1.0
        return RangeDopplerAngle(
            data=np.ascontiguousarray(power[..., seen]),
            range=range_axis(self.radar),
            radial_velocity=doppler_axis(self.radar),
            azimuth=np.arcsin(sine[seen]),
            elevation=None,
            radar=self.radar,
            range_doppler=rd,
            noise_power=noise,
        )

    def _scale(self) -> float:
        """Return what makes a tone of one step a peak of one step: windows here have a sum of 1."""
        gain = 1.0
        for count in (NUM_RANGE, NUM_DOPPLER):
            values = window_values(self.window, count)
            gain *= float(values.max() / values.sum())
        return step_size(self.radar) * gain

    def _channels(self, tensor: npt.NDArray[np.complexfloating]) -> RangeDoppler | None:
        """Return the maps of the channels; None if others than the first eight have power."""
        taps = np.fft.ifft(np.fft.ifftshift(tensor, axes=1), axis=1)
        total, beyond = (float(np.sum(np.abs(part) ** 2)) for part in (taps, taps[:, NUM_CHANNELS:]))
        if beyond > MOST_BEYOND * total:
            return None
        rd = RangeDoppler(
            data=np.ascontiguousarray(taps[:, :NUM_CHANNELS].transpose(1, 2, 0), dtype=np.complex64),
            range=range_axis(self.radar),
            radial_velocity=doppler_axis(self.radar),
            radar=self.radar,
            window=(self.window, self.window),
            noise_power=0.0,
            is_compensated=False,
        )
        return replace(rd, noise_power=noise_floor(rd, rd.power))


def _opening(tensor: npt.NDArray[np.complexfloating]) -> npt.NDArray[np.complexfloating]:
    """Return a tensor whose Doppler axis rises with velocities that open, from one that approach.

    That of chirps in the opposite order: an even number of bins has -N/2 first, which is its own opposite, and a tone's
    phase counts from the other end.
    """
    count = tensor.shape[-1]
    row = np.arange(-(count // 2), count - count // 2)
    return tensor[..., -row - count // 2] * np.exp(2j * np.pi * row / count)


def _files(place: Path) -> list[Path]:
    """Return the ``.npy`` files of a folder and of the folders in it, by their names; or the one file."""
    if place.is_file():
        return [place]
    found = sorted([*place.glob("*.npy"), *place.glob("*/*.npy")], key=lambda file: (len(file.stem), file.stem))
    if not found:
        raise InputFileError("has no .npy file, nor has a folder in it", place)
    return found


def _complex(path: Path, shape: tuple[int, ...]) -> npt.NDArray[np.complexfloating]:
    """Return a complex array of a shape, of finite numbers."""
    try:
        found: npt.NDArray[Any] = read_npy(path, MOST_FRAME)
    except InputFileError:
        raise
    except OSError as error:
        raise InputFileError(f"cannot be read ({error.strerror})", path) from error
    if found.shape != shape or found.dtype.kind != "c":
        raise InputFileError(f"holds {found.dtype} of shape {found.shape}, read is complex of shape {shape}", path)
    if not np.all(np.isfinite(found)):
        raise InputFileError("has values that are no numbers", path)
    return found
