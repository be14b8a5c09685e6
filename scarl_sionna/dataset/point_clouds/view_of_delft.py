"""Radar frames of View-of-Delft: seven numbers a point, one file a frame.

References
----------
.. [1] A. Palffy et al., "Multi-class road user detection with 3+1D radar in the View-of-Delft dataset", IEEE Robotics
   and Automation Letters 7(2), 2022; fields as in github.com/tudelft-iv/view-of-delft-dataset,
   docs/SENSORS_AND_DATA.md.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scarl_sionna.core.errors import InputFileError
from scarl_sionna.core.untrusted.files import MEGABYTE, read_bytes

from .table import PointTable, table_of

LARGEST = 64 * MEGABYTE
FIELDS = 7
"""Of a point: x, y, z [m], RCS [dBsm], radial velocity, the same over ground [m/s], number of the scan before."""
RCS = 3
"""Column of the RCS, which is nan in our own exports where it is not known."""


def read_view_of_delft_points(path: str | Path, *, only_latest: bool = True) -> PointTable:
    """Return radar points of View-of-Delft.

    Parameters
    ----------
    path : str or Path
        A ``.bin`` file, or the folder of them, ``radar/training/velodyne``.
    only_latest : bool
        Of files that hold several scans only the latest one; else all, as points of one scan.

    Returns
    -------
    PointTable
        No times, SNR, groups and tracks: times are in no file, boxes in files of their own.

    Raises
    ------
    InputFileError
        If there is no file, or one is damaged.
    """
    place = Path(path).absolute()
    files = [place] if place.is_file() else sorted(place.glob("*.bin"))
    if not files:
        raise InputFileError("has no .bin file", place)
    frames = []
    for file in files:
        rows = _rows(file)
        frames.append(rows[rows[:, 6] == 0.0] if only_latest else rows)
    rows = np.concatenate(frames)
    columns = {
        "scan": np.repeat(np.arange(len(files)), [len(frame) for frame in frames]),
        "sensor": np.zeros(len(rows)),
        "position": rows[:, :3],
        "rcs_dbsm": rows[:, RCS],
        "radial_velocity": rows[:, 4],
        "velocity_over_ground": rows[:, 5],
    }
    notes = ("positions are moved by the dataset to the instant of the camera's image",)
    return table_of("view_of_delft", ("front",), notes, len(files), columns)


def _rows(path: Path) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    try:
        data = read_bytes(path, LARGEST)
    except InputFileError:
        raise
    except OSError as error:
        raise InputFileError(f"cannot be read ({error.strerror})", path) from error
    if len(data) % (4 * FIELDS):
        raise InputFileError(f"has {len(data)} bytes, no multiple of {4 * FIELDS}", path, "copy it again")
    rows = np.frombuffer(data, "<f4").astype(np.float64).reshape(-1, FIELDS)
    if not np.all(np.isfinite(np.delete(rows, RCS, axis=1))) or np.isinf(rows[:, RCS]).any():
        raise InputFileError("has values that are no numbers", path)
    return rows
