"""Which format a folder of a capture has, by the names of what is in it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from scarl_sionna.core.errors import InputFileError

MARKS: Mapping[str, tuple[str, ...]] = {
    "dca1000": ("*.setup.json", "*.mmwave.json", "*.cfg", "adc_data.json", "*[Ll]og[Ff]ile*.txt"),
    "coloradar": ("single_chip/adc_samples", "cascade/adc_samples"),
    "radelft": ("master_*_data.bin",),
    "radial": ("*_events_log.rec",),
    "carrada": ("RAD_numpy/*.npy",),
    "kradar": ("radar_tesseract/tesseract_*.mat", "tesseract_*.mat"),
}
"""Names of files that a folder of a format has one of."""
STRONGER = (("radelft", "dca1000"),)
"""Pairs of formats that share a description, and of which the first has more."""


def format_of(path: str | Path) -> str:
    """Return the format of a capture's folder.

    Raises
    ------
    InputFileError
        If none or several fit; single files do not tell.
    """
    folder = Path(path)
    found = [name for name, patterns in MARKS.items() if any(True for one in patterns for _ in folder.glob(one))]
    for stronger, weaker in STRONGER:
        if stronger in found and weaker in found:
            found.remove(weaker)
    if len(found) != 1:
        told = f"could be of {' and '.join(found)}" if found else "has no names that tell its format"
        raise InputFileError(told, folder, f"give format= (known by their names: {', '.join(MARKS)})")
    return found[0]
