"""Spectrogram of a body that bends against the sum over its skin: windows, blocks, looks.

``python benchmarks/bending_spectrogram.py`` prints the table of docs/bodies.md; 77 GHz, without noise.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from tests.oracles.bending_arm import PERIOD
from tests.physics.test_bending_spectrogram import Swing, alike, alike_db, radar_of

TIMES = np.linspace(0.0, PERIOD, 12, endpoint=False)


def row(what: str, found: npt.NDArray[np.float64], exact: npt.NDArray[np.float64]) -> None:
    """Print correlations of magnitudes, of the worst column, of decibels over 30 and 50 dB, and the levels' ratio."""
    worst = min(alike(*columns) for columns in zip(found, exact, strict=True))
    in_db = ", ".join(f"{alike_db(found, exact, depth):.4f}" for depth in (30.0, 50.0))
    level = 10.0 * np.log10(found.sum() / exact.sum())
    print(
        f"{what:34s} {alike(found, exact):.4f}, worst column {worst:.3f}, dB {in_db}, level {level:+.2f} dB", flush=True
    )


def main() -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as folder:
        swing = Swing(Path(folder))
        for chirps in (16, 32, 64):
            radar = radar_of(chirps)
            exact = swing.exact(radar, TIMES)
            row(f"sbr, {chirps / 4:g} ms", swing.found(radar, TIMES, "sbr"), exact)
            if chirps == 64:
                row("sbr, 16 ms in blocks of 4 ms", swing.in_blocks(radar, TIMES, 16), exact)
        for chirps, counts in ((16, (1, 4, 16, 64)), (64, (16, 64))):
            radar = radar_of(chirps)
            exact = swing.rough(radar, TIMES)
            for looks in counts:
                found = swing.looked(radar, TIMES, looks)
                row(f"raycast, {chirps / 4:g} ms, {looks} looks", found * exact.sum() / found.sum(), exact)


if __name__ == "__main__":
    main()
