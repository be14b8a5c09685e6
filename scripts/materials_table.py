"""Write the tables of docs/materials.md from scarl_sionna/scene/materials/materials.toml.

Usage: python scripts/materials_table.py [--check]. With --check nothing is written; the exit status is 1 if the page is
old.
"""

from __future__ import annotations

import sys
from pathlib import Path

from scarl_sionna.scene.materials.fresnel import power_reflectance
from scarl_sionna.scene.materials.table import RadioMaterial, builtin_materials

PAGE = Path(__file__).resolve().parents[1] / "docs" / "materials.md"
BEGIN, END = "<!-- table: begin (scripts/materials_table.py) -->", "<!-- table: end -->"
FREQUENCY = 77e9


def _millimetres(value: float | None) -> str:
    return "-" if not value else f"{value * 1e3:.3g}"


def _row(material: RadioMaterial) -> str:
    permittivity = material.at(FREQUENCY)
    value = (
        f"1 - {-permittivity.imag:.2g}j"
        if -permittivity.imag > 1e3
        else f"{permittivity.real:.4g} - {-permittivity.imag:.2g}j"
    )
    low, high = (f"{edge / 1e9:g}" for edge in material.frequency_range)
    reflectance = float(power_reflectance(material, FREQUENCY, 1.0)[0])
    cells = (
        f"`{material.name}`",
        value,
        _millimetres(material.thickness),
        f"{reflectance:.2g}",
        _millimetres(material.roughness_rms),
        f"{material.scattering_coefficient:g}",
        f"{material.xpd_coefficient:g}",
        f"{low} to {high}",
    )
    return "| " + " | ".join(cells) + " |"


def tables() -> str:
    """Return both tables: the numbers, and where they come from."""
    materials = builtin_materials().values()
    lines = [
        "| material | permittivity at 77 GHz | layer [mm] | reflectance | rms [mm] | S | K_x | valid [GHz] |",
        "|---|---|---|---|---|---|---|---|",
        *(_row(material) for material in materials),
        "",
        "| material | source | uncertainty |",
        "|---|---|---|",
        *(f"| `{material.name}` | {material.source} | {material.uncertainty} |" for material in materials),
    ]
    return "\n".join(lines)


def updated(page: str) -> str:
    """Return the page with its tables made again."""
    head, _, rest = page.partition(BEGIN)
    _, _, tail = rest.partition(END)
    if not rest or not tail:
        raise SystemExit(f"{PAGE} lacks the marks of its tables")
    return f"{head}{BEGIN}\n{tables()}\n{END}{tail}"


def main(arguments: list[str]) -> int:
    """Write the page, or only tell whether it is up to date."""
    old = PAGE.read_text()
    new = updated(old)
    if arguments == ["--check"]:
        return int(old != new)
    if arguments:
        raise SystemExit(__doc__)
    PAGE.write_text(new)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
