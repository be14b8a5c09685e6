"""Readers of what real radars recorded, one format a file, and a table of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Literal, overload

from scarl_sionna.core.errors import UnknownNameError

from .recognise import format_of

if TYPE_CHECKING:
    from .capture import Capture
    from .map_capture import MapCapture

__all__ = ["FORMATS", "CaptureFormat", "read_capture"]


@dataclass(frozen=True)
class CaptureFormat:
    """A format of captures."""

    module: str
    function: str
    description: str


FORMATS: Mapping[str, CaptureFormat] = {
    "dca1000": CaptureFormat("dca1000", "read_dca1000_capture", "DCA1000 with mmWave Studio or the mmWave SDK's demo"),
    "coloradar": CaptureFormat("datasets.coloradar", "read_coloradar_capture", "a run of ColoRadar, raw data"),
    "radelft": CaptureFormat("datasets.radelft", "read_radelft_capture", "RaDelft: TI's cascade board with its TDA2"),
    "radial": CaptureFormat("datasets.radial", "read_radial_capture", "a sequence of RADIal, raw data"),
    "raddet_adc": CaptureFormat("datasets.rad_tensor", "read_raddet_adc_capture", "raw data of RADDet"),
    "raddet": CaptureFormat("datasets.rad_tensor", "read_raddet_capture", "range-azimuth-Doppler tensors of RADDet"),
    "carrada": CaptureFormat("datasets.rad_tensor", "read_carrada_capture", "range-azimuth-Doppler tensors of CARRADA"),
    "kradar": CaptureFormat("datasets.kradar", "read_kradar_capture", "4D tensors of K-Radar"),
}
"""Formats by name."""


@overload
def read_capture(
    path: str | Path, format: Literal["dca1000", "coloradar", "radelft", "radial", "raddet_adc"], **options: object
) -> Capture: ...


@overload
def read_capture(path: str | Path, format: Literal["raddet", "carrada", "kradar"], **options: object) -> MapCapture: ...


@overload
def read_capture(path: str | Path, format: str | None = None, **options: object) -> Capture | MapCapture: ...


def read_capture(path: str | Path, format: str | None = None, **options: object) -> Capture | MapCapture:
    """Return what a real radar recorded.

    Parameters
    ----------
    path : str or Path
        File or folder, see the format's reader.
    format : str, optional
        One of `FORMATS`; left out: by the names of the files in the folder.
    **options
        Of the format's reader.

    Returns
    -------
    Capture or MapCapture
        Raw data, or maps where a dataset has maps alone. Frames are read one by one, when they are asked for.

    Raises
    ------
    UnknownNameError
        If there is no such format.
    InputFileError
        If a file is missing, too large, cut, damaged, or not of its format, or the format is left out and not plain.

    Examples
    --------
    >>> capture = read_capture("recording", "dca1000", board="awr1843boost")  # doctest: +SKIP
    >>> rd = ss.range_doppler(capture.cube(0), capture.radar)  # doctest: +SKIP
    """
    if format is None:
        format = format_of(path)
    if format not in FORMATS:
        raise UnknownNameError("format of captures", format, FORMATS)
    chosen = FORMATS[format]
    module = import_module(f".{chosen.module}", __name__)
    result: Capture | MapCapture = getattr(module, chosen.function)(path, **options)
    return result
