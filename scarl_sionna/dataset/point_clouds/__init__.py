"""Radar points of published datasets and of this project's in one table type, one dataset a file."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from scarl_sionna.core.errors import UnknownNameError

if TYPE_CHECKING:
    from .table import PointTable

__all__ = ["FORMATS", "PointFormat", "read_points"]


class PointFormat(NamedTuple):
    """A format of radar points: its reader's module and name, and what it is."""

    module: str
    function: str
    description: str


FORMATS: Mapping[str, PointFormat] = {
    "nuscenes": PointFormat("nuscenes", "read_nuscenes_points", "radar sweeps of nuScenes (.pcd)"),
    "view_of_delft": PointFormat("view_of_delft", "read_view_of_delft_points", "radar frames of View-of-Delft (.bin)"),
    "radar_scenes": PointFormat(
        "radar_scenes", "read_radar_scenes_points", "a sequence of RadarScenes (radar_data.h5)"
    ),
}
"""Formats by name."""


def read_points(path: str | Path, format: str, **options: object) -> PointTable:
    """Return the radar points of a published dataset; those of this project's are :func:`~.own.point_table`.

    Parameters
    ----------
    path : str or Path
        File or folder, see the format's reader.
    format : str
        One of `FORMATS`.
    **options
        Of the format's reader.

    Returns
    -------
    PointTable

    Raises
    ------
    UnknownNameError
        If there is no such format.
    InputFileError
        If a file is missing, too large, cut, damaged, or not of its format.
    """
    if format not in FORMATS:
        raise UnknownNameError("format of points", format, FORMATS)
    chosen = FORMATS[format]
    module = import_module(f".{chosen.module}", __name__)
    result: PointTable = getattr(module, chosen.function)(path, **options)
    return result
