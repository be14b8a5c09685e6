"""Tables of numbers as text: a head line with names, then lines of values."""

from __future__ import annotations

import csv
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def columns_of(text: str, needed: Sequence[str]) -> dict[str, Array]:
    """Return the columns of a table by name; lines that are empty or start with # do not count.

    Parameters
    ----------
    text : str
    needed : sequence of str
        Names of columns that must be there, in small letters.

    Raises
    ------
    ValueError
        If a column is missing, a line has too few or too many values, or one of them is no finite number.
    """
    head: list[str] = []
    rows: list[list[float]] = []
    for number, cells in enumerate(csv.reader(text.splitlines()), start=1):
        cells = [cell.strip() for cell in cells]
        if not any(cells) or cells[0].startswith("#"):
            continue
        if not head:
            head = [cell.lower() for cell in cells]
            missing = [name for name in needed if name not in head]
            if missing:
                raise ValueError(f"line {number} has no column {missing[0]}; it has {', '.join(head)[:80]}")
            continue
        if len(cells) != len(head):
            raise ValueError(f"line {number} has {len(cells)} values, the head line {len(head)}")
        try:
            rows.append([float(cell) for cell in cells])
        except ValueError:
            wrong = next(cell for cell in cells if not _is_number(cell))
            raise ValueError(f"line {number} holds {wrong[:20]!r}, which is no number") from None
        if not np.isfinite(rows[-1]).all():
            raise ValueError(f"line {number} holds a value that is not finite")
    if not rows:
        raise ValueError("there is no line of numbers")
    return dict(zip(head, np.array(rows).T, strict=True))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
