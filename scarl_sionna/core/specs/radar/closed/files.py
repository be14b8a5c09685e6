"""Point spreads in files: one .npz, or a folder with a .csv for each axis."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputFileError, OutputError, SpecError
from scarl_sionna.core.untrusted.csv_text import columns_of
from scarl_sionna.core.untrusted.files import MEGABYTE, read_text
from scarl_sionna.core.untrusted.numpy_file import read_npz

from .table import AXES, PointSpread, pairs

OFFSETS = {"range": "range_offset_m", "velocity": "velocity_offset_mps", "azimuth": "azimuth_offset_deg"}
"""What offsets are called in files: the unit stands in the name."""
MOST_BYTES = 256 * MEGABYTE
_WORDS = ("kind", "azimuth_scale", "interpolation")
_SHEAR = "range_per_velocity_s"
_FIELDS = {"range": "range_offset", "velocity": "velocity_offset", "azimuth": "azimuth_offset_deg"}


def read_point_spread(path: str | Path, **fields: object) -> PointSpread:
    """Return the point spread of a file.

    Parameters
    ----------
    path : path
        An ``.npz`` with ``range_offset_m``, where the device has them ``velocity_offset_mps`` and
        ``azimuth_offset_deg``, and either ``range_response``, ``velocity_response``, ``azimuth_response`` or one
        ``response`` of shape (num_range[, num_velocity][, num_azimuth]), complex or real; ``kind``, ``azimuth_scale``
        and ``interpolation`` as words, ``range_per_velocity_s`` of factors. Or a folder with ``range.csv``, and
        ``velocity.csv``, ``azimuth.csv`` where the device has them: columns of the offset, of those names,
        ``level_db`` (of the power, 0 at the point) and, where it was measured, ``phase_deg``.
    **fields
        Of the specification that the file does not have. Tables of a folder without phases are of ``kind="power"``.

    Raises
    ------
    InputFileError
        If the file cannot be read, lacks an axis, or has one in another unit.
    SpecError
        If what it holds is no point spread.
    """
    where = Path(path)
    try:
        data = _of_folder(where) if where.is_dir() else _of_arrays(read_npz(where, MOST_BYTES))
        return PointSpread(**{**data, **fields})
    except (InputFileError, SpecError):
        raise
    except (OSError, ValueError) as error:
        remedy = "an .npz, or a folder with range.csv, as read_point_spread describes them"
        raise InputFileError(f"is no point spread: {error}", where, remedy) from error


def write_point_spread(spread: PointSpread, path: str | Path) -> Path:
    """Write a point spread to an ``.npz`` file, as :func:`read_point_spread` reads it; return the path.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    out = Path(path)
    rows: dict[str, npt.NDArray[Any]] = {name: np.array(getattr(spread, name)) for name in _WORDS}
    rows[_SHEAR] = np.array(spread.range_per_velocity)
    for axis in spread.axes:
        rows[OFFSETS[axis]] = np.array(getattr(spread, _FIELDS[axis]))
    if spread.is_separable:
        rows |= {f"{axis}_response": row for axis, row in zip(spread.axes, spread.factors, strict=True)}
    else:
        rows["response"] = spread.values
    try:
        with out.open("wb") as file:
            np.savez_compressed(file, **rows)  # type: ignore[arg-type]
    except OSError as error:
        raise OutputError(f"{out} cannot be written: {error}") from error
    return out


def _of_arrays(arrays: Mapping[str, npt.NDArray[Any]]) -> dict[str, object]:
    """Return the fields of a point spread from the arrays of a file."""
    known = {*OFFSETS.values(), *_WORDS, _SHEAR, "response", *(f"{axis}_response" for axis in AXES)}
    _check_names(set(arrays), known)
    data: dict[str, object] = {}
    for axis in AXES:
        offset = arrays.get(OFFSETS[axis])
        if offset is not None:
            if offset.ndim != 1:
                raise ValueError(f"{OFFSETS[axis]} has {offset.ndim} axes, not one")
            data[_FIELDS[axis]] = offset.astype(np.float64).tolist()
    for name in ("response", *(f"{axis}_response" for axis in AXES)):
        if name in arrays:
            data[name] = pairs(arrays[name])
    if "response" in arrays:
        shape = tuple(len(arrays[name]) for name in OFFSETS.values() if name in arrays)
        if arrays["response"].shape != shape:
            raise ValueError(f"response has the shape {arrays['response'].shape}, its axes {shape}")
    if _SHEAR in arrays:
        data["range_per_velocity"] = float(arrays[_SHEAR])
    return data | {name: str(arrays[name]) for name in _WORDS if name in arrays}


def _of_folder(folder: Path) -> dict[str, object]:
    """Return the fields of a point spread from a folder of tables."""
    data: dict[str, object] = {}
    phases = []
    for axis in AXES:
        file = folder / f"{axis}.csv"
        if axis != "range" and not file.exists():
            continue
        columns = columns_of(read_text(file, MOST_BYTES, "utf-8-sig"), ())
        _check_names(set(columns), {OFFSETS[axis], "level_db", "phase_deg"}, f"{file.name}: ")
        for name in (OFFSETS[axis], "level_db"):
            if name not in columns:
                raise ValueError(f"{file.name} has no column {name}")
        phases.append("phase_deg" in columns)
        phase = np.radians(columns["phase_deg"]) if phases[-1] else 0.0
        field = 10.0 ** (columns["level_db"] / 20.0) * np.exp(1j * phase)
        data[_FIELDS[axis]], data[f"{axis}_response"] = columns[OFFSETS[axis]].tolist(), field
    if len(set(phases)) > 1:
        raise ValueError("phase_deg in some tables only: either all are complex, or all are powers")
    for axis in AXES:
        if f"{axis}_response" in data:
            found = np.asarray(data[f"{axis}_response"])
            data[f"{axis}_response"] = pairs(found if phases[0] else np.abs(found) ** 2)
    return {"kind": "amplitude" if phases[0] else "power", **data}


def _check_names(found: set[str], known: set[str], where: str = "") -> None:
    """Raise if a name is not known: an offset in another unit is told apart by it."""
    for name in sorted(found - known):
        axis = next((axis for axis in AXES if name.startswith(f"{axis}_offset")), None)
        hint = f"give {OFFSETS[axis]}, in this unit" if axis else f"known: {', '.join(sorted(known))}"
        raise ValueError(f"{where}{name} is not read; {hint}")
    if not where and OFFSETS["range"] not in found:
        raise ValueError(f"{OFFSETS['range']} is missing")
