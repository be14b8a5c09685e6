"""Captures of a DCA1000: ``adc_data.bin`` with mmWave Studio's description or log, the SDK demo's commands, or ours."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from pydantic import Field

from scarl_sionna.core.errors import InputFileError, ParameterRangeError
from scarl_sionna.core.specs.radar.array import AntennaArray
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.untrusted.checked import Table, checked
from scarl_sionna.core.untrusted.files import read_text
from scarl_sionna.core.untrusted.json_text import parse_json
from scarl_sionna.signal.converter import step_size

from .capture import LEVELS, Capture, check_frame_size
from .lvds import Order, decode
from .pieces import Pieces
from .ti_cfg import read_cfg
from .ti_json import LARGEST, read_setup, read_studio
from .ti_log import read_log
from .ti_setup import array_of, radar_of

FORMAT = "dca1000"
CAPTURE, DESCRIPTION = "adc_data.bin", "adc_data.json"
"""Of this project's exporter."""
DESCRIPTIONS = ("*.setup.json", "*.mmwave.json", "*.cfg", "*[Ll]og[Ff]ile*.txt")
"""Those of TI's tools, the one that says most first."""


def read_dca1000_capture(
    path: str | Path,
    *,
    config: str | Path | None = None,
    board: str | None = None,
    array: AntennaArray | None = None,
    full_scale_dbm: float | None = None,
    q_first: bool | None = None,
) -> Capture:
    """Return a capture of a DCA1000.

    Parameters
    ----------
    path : str or Path
        Folder with the capture and its description, or the ``.bin`` file.
    config : str or Path, optional
        The description: ``.mmwave.json``, ``.setup.json``, ``.cfg``, or mmWave Studio's ``LogFile.txt``; left out: the
        only one of the folder, ``.setup`` first. A folder of this project's exporter needs none.
    board : str, optional
        Evaluation board, whose antennas are taken, see :data:`.ti_setup.BOARDS`; left out: by the name of the chip.
    array : AntennaArray, optional
        The device's antennas, instead of a board's.
    full_scale_dbm : float, optional
        Power at an antenna that a full-scale tone stands for [dBm]. Left out, powers are relative.
    q_first : bool, optional
        Whether Q stands before I; left out: as the description says. The wrong one mirrors range and velocity.

    Returns
    -------
    Capture

    Raises
    ------
    InputFileError
        If a file is missing, damaged, or describes what is not read.
    UnknownNameError, ParameterRangeError
        If there is no such board, or the array has too few antennas.
    """
    place = Path(path).absolute()
    folder = place if place.is_dir() else place.parent
    if config is None and (folder / DESCRIPTION).exists():
        return _exported(folder / DESCRIPTION)
    description, device, names = _description(folder, None if config is None else Path(config))
    if description.suffix == ".cfg":
        setup = read_cfg(description)
    else:
        setup = read_log(description) if description.suffix == ".txt" else read_studio(description, device)
    radar = radar_of(setup, description, array_of(setup, description, board, array), full_scale_dbm)
    order = Order(setup.num_lanes, setup.is_interleaved, setup.q_first if q_first is None else q_first, setup.is_real)
    frames = _Frames(Pieces([place] if place.is_file() else _files(folder, names)), radar, order, description)
    num_frames, rest = frames.count()
    return Capture(
        format=FORMAT,
        radar=radar,
        num_frames=num_frames,
        timestamp_ns=np.rint(np.arange(num_frames) * (setup.frame_period * 1e9)).astype(np.int64),
        notes=_notes(rest, full_scale_dbm is None, array is None, setup.has_image_band),
        scale=step_size(radar),
        read=frames.read,
    )


@dataclass(frozen=True)
class _Frames:
    """Frames of one size that follow each other in files."""

    pieces: Pieces
    radar: RadarSpec
    order: Order
    description: Path

    @property
    def shape(self) -> tuple[int, int, int]:
        return self.radar.num_rx, self.radar.num_chirps_total, self.radar.num_samples

    @property
    def size(self) -> int:
        """Of a frame [bytes]."""
        values = math.prod(self.shape) * (1 if self.order.is_real else 2)
        return check_frame_size(2 * values, self.description)

    def count(self) -> tuple[int, int]:
        """Return the number of whole frames, and the bytes after the last of them."""
        found, rest = divmod(self.pieces.num_bytes, self.size)
        if not found:
            raise InputFileError(f"has {self.pieces.num_bytes} bytes, one frame has {self.size}", self.pieces.paths[0])
        return found, rest

    def read(self, frame: int) -> npt.NDArray[np.int16]:
        """Return I and Q of a frame, shape (num_rx, num_chirps_total, num_samples, 2)."""
        raw = self.pieces.int16(frame * self.size, self.size // 2)
        try:
            return decode(raw, self.shape, self.order, self.radar.adc.bits)
        except ParameterRangeError as error:
            raise InputFileError(f"describes no capture: {error}", self.description) from error


class _Exported(Table):
    """What this project's exporter writes beside a capture, as far as it is needed."""

    spec: dict[str, Any]
    num_frames: Annotated[int, Field(ge=1, le=10**9)]
    timestamp_ns: list[int]
    scale: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


def _exported(description: Path) -> Capture:
    """Return a capture of this project's exporter."""
    try:
        about = checked(_Exported, parse_json(read_text(description, LARGEST)))
        radar = RadarSpec(**about.spec)
    except ParameterRangeError as error:
        raise InputFileError(f"describes no radar: {error}", description, "export it again") from error
    except ValueError as error:
        raise InputFileError(f"is no description of a capture ({error})", description, "export it again") from error
    frames = _Frames(Pieces([description.parent / CAPTURE]), radar, Order(is_real=radar.adc.is_real), description)
    if frames.count() != (about.num_frames, 0) or len(about.timestamp_ns) != about.num_frames:
        raise InputFileError(
            f"num_frames {about.num_frames}, {len(about.timestamp_ns)} times and {frames.pieces.num_bytes} bytes"
            " of data do not belong together",
            description,
            "export it again",
        )
    times = np.array(about.timestamp_ns, dtype=np.int64)
    return Capture(FORMAT, radar, about.num_frames, times, (), about.scale, frames.read)


def _description(folder: Path, config: Path | None) -> tuple[Path, str, list[str]]:
    """Return the description, the name of the chip and those of the captured files, as far as they are told."""
    if config is None:
        found = [sorted(folder.glob(pattern)) for pattern in DESCRIPTIONS]
        config = next((files[0] for files in found if len(files) == 1), None)
        if config is None:
            there = ", ".join(file.name for files in found for file in files) or "none"
            raise InputFileError(f"has no single description (there: {there})", folder, "give config=")
    if not config.name.endswith(".setup.json"):
        return config, "", []
    device, used, names = read_setup(config)
    return config.parent / used if used else config.with_name("missing.mmwave.json"), device, names


def _files(folder: Path, names: Sequence[str]) -> list[Path]:
    """Return the files of a capture in their order: as told, ``adc_data.bin``, or the only one."""
    if names:
        return [folder / name for name in names]
    if (folder / "adc_data.bin").exists():
        return [folder / "adc_data.bin"]
    numbered = sorted(folder.glob("adc_data*_*.bin"), key=lambda file: (len(file.name), file.name))
    files = numbered or sorted(folder.glob("*.bin"))
    if not files or (not numbered and len(files) > 1):
        raise InputFileError(f"has {len(files)} .bin files and no adc_data.bin", folder, "give the file itself")
    return files


def _notes(rest: int, is_relative: bool, is_board: bool, has_image_band: bool) -> tuple[str, ...]:
    notes = []
    if is_relative:
        notes.append(LEVELS)
    if is_board:
        notes.append("antennas as those of an evaluation board")
    if has_image_band:
        notes.append("complex 2x: the second half of the range axis is the image band, no targets stand there")
    if rest:
        notes.append(f"{rest} bytes after the last whole frame are left out")
    return tuple(notes)
