"""Backscatter of rough surfaces over the grazing angle: the law of all solvers beside what was measured.

python benchmarks/rough_surfaces.py
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from scarl_sionna.scene.materials.rough import Channel, diffuse_albedo, sigma0
from scarl_sionna.scene.materials.table import builtin_materials

ANGLES = (3.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0, 80.0)
MEASURED = {
    "asphalt": "-12 at 20 deg (dry, polarisation not stated)",
    "grass": "-8 to -3 at 20 to 30 deg (polarisation not stated)",
    "soil": "-8 to -3 at 40 to 80 deg (rough, bare, VV)",
    "concrete": "none at hand",
    "gravel": "none at hand",
}
"""sigma0 [dB] at 94 to 95 GHz against grazing angle: Ulaby, Nashashibi and Sarabandi, read second hand."""


def main(frequency: float = 77e9) -> None:
    """Print sigma0 [dB] of grounds, VV (HH is the same) and HV."""
    table = builtin_materials()
    print(f"| sigma0 [dB] | albedo | {' | '.join(f'{angle:g} deg' for angle in ANGLES)} | measured at 94 to 95 GHz |")
    print("|---|---|" + "---|" * len(ANGLES) + "---|")
    for name, measured in MEASURED.items():
        albedo = diffuse_albedo(table[name], frequency)
        channels: tuple[Channel, ...] = ("VV", "HV")
        for channel in channels:
            levels = 10.0 * np.log10(sigma0(table[name], frequency, np.radians(ANGLES), channel))
            shown = " | ".join(f"{level:.1f}" for level in levels)
            print(f"| {name}, {channel} | {albedo:.3f} | {shown} | {measured if channel == 'VV' else ''} |")


if __name__ == "__main__":
    main()
