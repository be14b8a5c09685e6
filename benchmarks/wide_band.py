"""How far off one transfer for a whole band is for thin layers, and what transfers at K frequencies leave.

    python benchmarks/wide_band.py

Layers of the table of materials at normal incidence, from 77 GHz on: the largest error over the band relative to the
transfer of its middle. K frequencies are Chebyshev's nodes, as `num_band_frequencies` has them; between them the
polynomial through them. Reference: the formula of a slab (ITU-R P.2040-3) at 513 frequencies.
"""

from __future__ import annotations

import numpy as np

from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.paths import band_nodes
from scarl_sionna.scene.materials.fresnel import reflection, transmission
from scarl_sionna.scene.materials.table import RadioMaterial, builtin_materials

LAYERS = {"plastic": "3 mm of plastic", "car_glass": "5 mm of car glass"}
BANDS = (1e9, 4e9)
NODES = (3, 5)
START = 77e9


def transfer(material: RadioMaterial, frequency: np.ndarray, through: bool) -> np.ndarray:
    """Return what a layer reflects, or lets through there and back, at frequencies [Hz]."""
    if through:
        return np.array([complex(transmission(material, value, 1.0)[0]) ** 2 for value in frequency])
    return np.array([complex(reflection(material, value, 1.0)[0]) for value in frequency])


def errors(material: RadioMaterial, width: float, through: bool) -> list[float]:
    """Return the largest errors of one transfer and of those at K frequencies [dB]."""
    band = START, START + width
    place = np.linspace(-1.0, 1.0, 513)
    exact = transfer(material, START + 0.5 * width * (1.0 + place), through)
    found = [np.full(len(exact), exact[len(exact) // 2])]
    for count in NODES:
        nodes = band_nodes(band, count)
        at_nodes = 2.0 * (nodes - START) / width - 1.0
        series = np.polynomial.chebyshev.chebfit(at_nodes, transfer(material, nodes, through), count - 1)
        found.append(np.polynomial.chebyshev.chebval(place, series))
    return [20.0 * np.log10(np.abs((each - exact) / exact[len(exact) // 2]).max()) for each in found]


def main() -> None:
    materials = builtin_materials()
    print("| | band | one number | " + " | ".join(f"K = {count}" for count in NODES) + " |")
    print("|---|---|---|" + "---|" * len(NODES))
    for name, shown in LAYERS.items():
        assert f"{materials[name].thickness * 1e3:g} mm" in shown
        for through in (False, True):
            for width in BANDS:
                values = " | ".join(f"{value:.0f}" for value in errors(materials[name], width, through))
                what = "through it and back" if through else "reflection"
                print(f"| {shown}, {what} | {width / 1e9:g} GHz | {values} |")
    step, middle = 1e6, START + 2e9
    ends = transfer(materials["plastic"], np.array([middle - step, middle + step]), False)
    late = -np.angle(ends[1] / ends[0]) / (2.0 * np.pi * 2.0 * step) * SPEED_OF_LIGHT / 2.0
    bins = late / (SPEED_OF_LIGHT / (2.0 * 4e9))
    print(f"\nThe echo of the plastic sheet comes from {late * 1e3:.1f} mm behind its front, {bins:.2f} bins at 4 GHz.")


if __name__ == "__main__":
    main()
