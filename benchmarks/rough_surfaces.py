"""Rough surfaces over the grazing angle: backscatter beside what was measured, and what the mirror keeps.

python benchmarks/rough_surfaces.py     prints the tables of docs/materials.md and draws docs/figures/rough_surfaces.png
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from scarl_sionna.scene.materials.fresnel import reflection
from scarl_sionna.scene.materials.rough import Channel, coherent_share, diffuse_albedo, sigma0
from scarl_sionna.scene.materials.table import builtin_materials

ANGLES = (3.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0, 80.0)
MIRROR_ANGLES = (1.0, 3.0, 5.0, 10.0, 20.0, 30.0, 90.0)
MEASURED = {
    "asphalt": "-12 at 20 deg (dry, polarisation not stated)",
    "grass": "-8 to -3 at 20 to 30 deg (polarisation not stated)",
    "soil": "-8 to -3 at 40 to 80 deg (rough, bare, VV)",
    "concrete": "none at hand",
    "gravel": "none at hand",
}
"""sigma0 [dB] at 94 to 95 GHz against grazing angle: Ulaby, Nashashibi and Sarabandi, read second hand."""
DRAWN = {
    "asphalt": (20.0, 20.0, -12.0, -12.0),
    "grass": (20.0, 30.0, -8.0, -3.0),
    "soil": (40.0, 80.0, -8.0, -3.0),
    "concrete": None,
    "gravel": None,
}
"""The same as angles [deg] and levels [dB]."""
FIGURE = Path(__file__).resolve().parents[1] / "docs/figures/rough_surfaces.png"


def backscatter(frequency: float) -> None:
    """Print sigma0 [dB] of grounds, VV (HH is the same) and HV."""
    table = builtin_materials()
    print(f"| sigma0 [dB] | albedo | {' | '.join(f'{angle:g} deg' for angle in ANGLES)} | measured at 94 to 95 GHz |")
    print("|---|---|" + "---|" * len(ANGLES) + "---|")
    for name, measured in MEASURED.items():
        albedo = table[name].volume_albedo or diffuse_albedo(table[name], frequency)
        channels: tuple[Channel, ...] = ("VV", "HV")
        for channel in channels:
            levels = 10.0 * np.log10(sigma0(table[name], frequency, np.radians(ANGLES), channel))
            shown = " | ".join(f"{level:.1f}" for level in levels)
            print(f"| {name}, {channel} | {albedo:.3f} | {shown} | {measured if channel == 'VV' else ''} |")


def mirror(frequency: float) -> None:
    """Print the coherent reflection [dB] of grounds and walls over the grazing angle."""
    table, sine = builtin_materials(), np.sin(np.radians(MIRROR_ANGLES))
    print(f"\n| reflection [dB] | {' | '.join(f'{angle:g} deg' for angle in MIRROR_ANGLES)} |")
    print("|---|" + "---|" * len(MIRROR_ANGLES))
    for name in ("asphalt", "concrete", "brick", "soil"):
        kept = 20.0 * np.log10(np.maximum(coherent_share(table[name], frequency, sine), 1e-3))
        heights = f"{name}, {1e3 * table[name].roughness_rms:g} mm"
        te, tm = (20.0 * np.log10(np.abs(value)) for value in reflection(table[name], frequency, sine))
        rows = {f"{heights}, kept": kept}
        if name == "asphalt":
            rows |= {"smooth, H": te, "smooth, V": tm, "H": te + kept, "V": tm + kept}
        for label, level in rows.items():
            shown = " | ".join("below -60" if value <= -60.0 else f"{value:.2f}" for value in level)
            print(f"| {label} | {shown} |")


def draw(frequency: float) -> None:
    """Draw sigma0 of grounds, co- and cross-polar, and the measured ranges."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes, angle = figure.add_subplot(), np.linspace(1.0, 89.0, 200)
    for number, name in enumerate(DRAWN):
        material, colour = builtin_materials()[name], f"C{number}"
        for channel, style, label in (("VV", "-", f"{name}, VV = HH"), ("HV", ":", f"{name}, HV")):
            level = 10.0 * np.log10(sigma0(material, frequency, np.radians(angle), channel))
            axes.plot(angle, level, style, color=colour, lw=1.2, label=label)
        place = DRAWN[name]
        if place is not None:
            left, right, low, high = place
            if left == right:
                axes.plot(left, low, "o", color=colour, ms=7, label=f"{name}, measured")
            else:
                axes.fill_between([left, right], low, high, color=colour, alpha=0.25, label=f"{name}, measured")
    axes.set(xlabel="grazing angle [deg]", ylabel="sigma0 [dB]", xlim=(0, 90), ylim=(-45, 3))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7, ncols=2, loc="lower right")
    figure.savefig(FIGURE, dpi=80)


def main(frequency: float = 77e9) -> None:
    backscatter(frequency)
    mirror(frequency)
    draw(frequency)


if __name__ == "__main__":
    main()
