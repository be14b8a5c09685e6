"""Raw data of ColoRadar: one file a frame, and the calibration folder that belongs to all its runs.

References
----------
.. [1] A. Kramer, K. Harlow, C. Williams, C. Heckman, "ColoRadar: The direct 3D millimeter wave radar dataset", Int. J.
   Robotics Research 41(4), 2022; layout of files and signs of angles as in github.com/arpg/coloradar-library.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field

from scarl_sionna.core.errors import InputFileError, ParameterRangeError, UnknownNameError
from scarl_sionna.core.specs.radar.array import AntennaArray
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.core.untrusted.checked import Number, Table, checked
from scarl_sionna.core.untrusted.files import MEGABYTE
from scarl_sionna.core.untrusted.json_text import parse_json
from scarl_sionna.signal.converter import step_size

from ..capture import LEVELS, Capture, check_frame_size
from ..pieces import Pieces, numbered, text_of
from ..ti_setup import Profile, Setup, radar_of

FORMAT = "coloradar"
DEVICES = {"single_chip": "AWR1843BOOST", "cascade": "MMWCAS-RF-EVM"}
LARGEST = 16 * MEGABYTE
MOST_ANTENNAS = 64
SIGNS = "azimuth and elevation have the signs of the dataset's own library; transmitters take turns in their order"


def read_coloradar_capture(
    path: str | Path,
    *,
    device: str | None = None,
    calib: str | Path | None = None,
    full_scale_dbm: float | None = None,
) -> Capture:
    """Return the raw data of one radar of a run of ColoRadar.

    Parameters
    ----------
    path : str or Path
        Folder of a run: ``<device>/adc_samples/data/frame_*.bin`` and ``<device>/adc_samples/timestamps.txt``.
    device : {"single_chip", "cascade"}, optional
        Which radar; left out: the only one of the run.
    calib : str or Path, optional
        The calibration folder, ``<device>/waveform_cfg.txt`` and ``antenna_cfg.txt``; left out: ``calib`` in the run's
        folder, beside it or a level higher. Where it holds ``phase_frequency_calib.txt``, `Capture.cube` applies it.
    full_scale_dbm : float, optional
        Power at an antenna that a full-scale tone stands for [dBm]. Left out, powers are relative.

    Returns
    -------
    Capture

    Raises
    ------
    InputFileError
        If a file is missing, damaged, of another size than described, or describes no radar.
    UnknownNameError
        If there is no such device.
    """
    run = Path(path).absolute()
    device = _device(run, device)
    folder = _calibration(run, calib) / device
    setup, coupled = _setup(folder / "waveform_cfg.txt"), (folder / "coupling_calib.txt").exists()
    array = _array(folder / "antenna_cfg.txt", setup)
    radar = radar_of(setup, folder / "waveform_cfg.txt", array, full_scale_dbm)
    place = run / device / "adc_samples"
    frames = numbered(place / "data", "frame_", ".bin")
    calibration = folder / "phase_frequency_calib.txt"
    notes = [SIGNS]
    if coupled:
        notes.append("the coupling that coupling_calib.txt has is not subtracted")
    return Capture(
        format=FORMAT,
        radar=radar,
        num_frames=len(frames),
        timestamp_ns=_times(place / "timestamps.txt", list(frames)),
        notes=(*([LEVELS] if full_scale_dbm is None else []), *notes),
        scale=step_size(radar),
        read=_Frames(tuple(frames.values()), radar, folder / "waveform_cfg.txt").read,
        calibration=_factors(calibration, setup, radar) if calibration.exists() else None,
    )


@dataclass(frozen=True)
class _Frames:
    """Files of one frame each, in the order transmitter, receiver, chirp, sample, I and Q."""

    paths: Sequence[Path]
    radar: RadarSpec
    description: Path

    def __post_init__(self) -> None:
        check_frame_size(4 * math.prod(self.shape), self.description)

    @property
    def shape(self) -> tuple[int, int, int, int]:
        return self.radar.num_tx, self.radar.num_rx, self.radar.num_chirps, self.radar.num_samples

    def read(self, frame: int) -> npt.NDArray[np.int16]:
        """Return I and Q of a frame, shape (num_rx, num_chirps_total, num_samples, 2)."""
        raw = Pieces([self.paths[frame]]).whole(2 * math.prod(self.shape)).reshape(*self.shape, 2)
        turns = raw.transpose(1, 2, 0, 3, 4)
        return np.ascontiguousarray(turns).reshape(self.radar.num_rx, -1, self.radar.num_samples, 2)


def _device(run: Path, device: str | None) -> str:
    if device is not None:
        if device not in DEVICES:
            raise UnknownNameError("device", device, DEVICES)
        return device
    found = [name for name in DEVICES if (run / name / "adc_samples").is_dir()]
    if len(found) != 1:
        there = " and ".join(found) or "none"
        raise InputFileError(f"has raw data of {there}", run, "give device='single_chip' or device='cascade'")
    return found[0]


def _calibration(run: Path, calib: str | Path | None) -> Path:
    if calib is not None:
        return Path(calib)
    places = [place / "calib" for place in (run, run.resolve().parent, run.resolve().parent.parent)]
    found = next((place for place in places if place.is_dir()), None)
    if found is None:
        raise InputFileError("has no folder calib, nor one beside it or a level higher", run, "give calib=")
    return found


def _lines(path: Path) -> list[list[str]]:
    """Return the words of each line that is no comment."""
    text = text_of(path, LARGEST)
    return [words for line in text.splitlines() if (words := line.split()) and not words[0].startswith("#")]


def _numbers(path: Path, names: Sequence[str]) -> Mapping[str, float]:
    """Return the numbers that stand after names.

    Raises
    ------
    InputFileError
        If one is missing, or is no finite number.
    """
    found = {words[0].lower(): words[1] for words in _lines(path) if len(words) == 2}
    out = {}
    for name in names:
        if name not in found:
            raise InputFileError(f"has no {name}", path, "give the calibration of the dataset")
        out[name] = number(found[name], path)
    return out


def number(word: str, path: Path) -> float:
    """Return a finite number.

    Raises
    ------
    InputFileError
        If the word is none.
    """
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not abs(value) < 1e30:
        raise InputFileError(f"has '{word[:40]}' where a number stands", path)
    return value


def _count(value: float, name: str, most: int, path: Path) -> int:
    if not (1 <= value <= most and value == int(value)):
        raise InputFileError(f"has {name} {value:g}, counts of 1 to {most} are read", path)
    return int(value)


def _setup(path: Path) -> Setup:
    """Return what ``waveform_cfg.txt`` says, in Hz and s."""
    names = ("num_tx", "num_rx", "num_adc_samples_per_chirp", "num_chirps_per_frame", "adc_sample_frequency")
    times = ("start_frequency", "idle_time", "adc_start_time", "ramp_end_time", "frequency_slope")
    found = _numbers(path, (*names, *times))
    num_tx, num_rx = (_count(found[name], name, MOST_ANTENNAS, path) for name in names[:2])
    num_samples, num_chirps = (_count(found[name], name, 1_000_000, path) for name in names[2:4])
    return Setup(
        profile=Profile(
            start_frequency=found["start_frequency"],
            slope=found["frequency_slope"],
            idle_time=found["idle_time"],
            adc_start_time=found["adc_start_time"],
            ramp_time=found["ramp_end_time"],
            num_samples=num_samples,
            sample_rate=found["adc_sample_frequency"],
        ),
        transmitters=tuple(range(num_tx)),
        receivers=tuple(range(num_rx)),
        num_loops=num_chirps,
        frame_period=0.0,
    )


def _array(path: Path, setup: Setup) -> AntennaArray:
    """Return the antennas of ``antenna_cfg.txt``: places in half wavelengths of the frequency it is designed for.

    A place grows to the right and downwards: the dataset's library transforms over places and calls the direction of
    rising phase left and up.
    """
    half = SPEED_OF_LIGHT / (_numbers(path, ("f_design",))["f_design"] * 1e9 or math.nan) / 2.0
    if not 0.0 < half < 1.0:
        raise InputFileError("has an f_design that is no frequency in GHz", path)
    places: dict[str, dict[int, tuple[float, float]]] = {"tx": {}, "rx": {}}
    for words in _lines(path):
        if words[0] in places:
            if len(words) != 4:
                raise InputFileError(
                    f"has '{' '.join(words)[:40]}', read is: {words[0]} number azimuth elevation", path
                )
            index, azimuth, elevation = (number(word, path) for word in words[1:])
            places[words[0]][int(index)] = azimuth, elevation
    positions = {}
    for name, count in (("tx", len(setup.transmitters)), ("rx", len(setup.receivers))):
        if sorted(places[name]) != list(range(count)):
            raise InputFileError(f"has places of {len(places[name])} {name} antennas, waveform_cfg.txt {count}", path)
        grid = np.array([places[name][index] for index in range(count)])
        centred = -half * (grid - (grid.min(axis=0) + grid.max(axis=0)) / 2.0)
        positions[name] = tuple((0.0, float(y), float(z)) for y, z in centred)
    try:
        return AntennaArray(tx_positions=positions["tx"], rx_positions=positions["rx"])
    except ParameterRangeError as error:
        raise InputFileError(f"describes no antennas: {error}", path) from error


def _times(path: Path, numbers: Sequence[int]) -> npt.NDArray[np.int64]:
    """Return the time of each frame [ns]: as many lines as frames, or line k of frame k."""
    seconds = [number(words[0], path) for words in _lines(path)]
    if len(seconds) != len(numbers):
        if max(numbers) >= len(seconds):
            raise InputFileError(f"has {len(seconds)} times, there are {len(numbers)} frames to {max(numbers)}", path)
        seconds = [seconds[index] for index in numbers]
    if max(map(abs, seconds)) > 9e9:
        raise InputFileError("has a time that is none in seconds", path)
    return np.rint(np.array(seconds) * 1e9).astype(np.int64)


class _Antennas(Table):
    numRx: Annotated[int, Field(ge=1, le=MOST_ANTENNAS)]
    numTx: Annotated[int, Field(ge=1, le=MOST_ANTENNAS)]
    frequencySlope: Annotated[Number, Field(gt=0.0)]  # Hz/s
    samplingRate: Annotated[Number, Field(gt=0.0)]  # Hz
    frequencyCalibrationMatrix: list[Number]
    phaseCalibrationMatrix: list[Number]


class _Calibrated(Table):
    antennaCalib: _Antennas


def _factors(path: Path, setup: Setup, radar: RadarSpec) -> npt.NDArray[np.complex64]:
    """Return by what raw data is multiplied, shape (num_rx, num_chirps_total, num_samples).

    A pair's beat tone was so many bins off the first pair's, and had another amplitude and phase: both are undone, the
    tone for the slope and rate of this recording.
    """
    try:
        found = checked(_Calibrated, parse_json(text_of(path, LARGEST))).antennaCalib
    except InputFileError:
        raise
    except ValueError as error:
        raise InputFileError(f"is no calibration of antennas ({error})", path) from error
    pairs = radar.num_virtual
    bins, parts = np.array(found.frequencyCalibrationMatrix), np.array(found.phaseCalibrationMatrix)
    if (found.numTx, found.numRx) != (radar.num_tx, radar.num_rx) or bins.size != pairs or parts.size != 2 * pairs:
        raise InputFileError(
            f"has {found.numTx} x {found.numRx} antennas, {bins.size} frequencies and {parts.size} parts of phases; "
            f"the radar has {radar.num_tx} x {radar.num_rx}",
            path,
        )
    amplitude = parts[::2] + 1j * parts[1::2]
    if not np.all(np.abs(amplitude) > 0.0):
        raise InputFileError("has an amplitude of 0", path)
    one = setup.profile
    off = (bins - bins[0]) * (abs(one.slope) / found.frequencySlope) * (found.samplingRate / one.sample_rate)
    samples = np.arange(one.num_samples) / one.num_samples
    factor = (amplitude[0] / amplitude)[:, None] * np.exp(-2j * np.pi * off[:, None] * samples)
    turn = factor.reshape(radar.num_tx, radar.num_rx, -1).transpose(1, 0, 2)
    return np.tile(turn, (1, radar.num_chirps, 1)).astype(np.complex64)
