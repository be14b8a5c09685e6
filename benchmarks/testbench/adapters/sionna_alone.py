"""Answers of Sionna RT's PathSolver alone, without anything of this project's channel.

    python benchmarks/testbench/adapters/sionna_alone.py ANSWERS [PROBLEM ...]

Mirror reflections up to four deep, transmitter and receiver in one place. It is made for links over large flat
surfaces: a body much smaller than its distance is a mirror to it, or nothing.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from benchmarks.harness import machine
from benchmarks.testbench.adapters.answers import run
from scarl_sionna.core.units import SPEED_OF_LIGHT, VACUUM_PERMITTIVITY
from scarl_sionna.engine.backend.bootstrap import ensure_engine

ensure_engine()  # only finds an LLVM for Dr.Jit
import sionna.rt as rt  # noqa: E402 - after the engine

METAL = (1.0, 1e7, 0.1)
"""Relative permittivity, conductivity [S/m], thickness [m]."""
RAYS = 1_000_000
NOTHING_DB = -300.0

Rows = Sequence[Mapping[str, str]]
Stuff = tuple[float, float, float]


def stuff(permittivity: complex, thickness: float) -> Stuff:
    """Return a material by its permittivity at 77 GHz."""
    return permittivity.real, -permittivity.imag * 2.0 * np.pi * 77e9 * VACUUM_PERMITTIVITY, thickness


def scene_of(folder: Path, things: Mapping[str, Stuff]) -> Any:
    """Return a scene of meshes with their materials."""
    lines = ['<scene version="2.1.0">']
    for name, (permittivity, conductivity, thickness) in things.items():
        lines += [
            f'<bsdf type="radio-material" id="stuff-{name}">'
            f'<float name="relative_permittivity" value="{permittivity!r}"/>'
            f'<float name="conductivity" value="{conductivity!r}"/>'
            f'<float name="thickness" value="{thickness!r}"/></bsdf>',
            f'<shape type="ply" id="{name}"><string name="filename" value={quoteattr(str(folder / name))[:-1]}.ply"/>'
            f'<boolean name="face_normals" value="true"/><ref id="stuff-{name}" name="bsdf"/></shape>',
        ]
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "scene.xml"
        path.write_text("\n".join([*lines, "</scene>"]), encoding="utf-8")
        scene = rt.load_scene(str(path), merge_shapes=False)
    scene.frequency = 77e9
    scene.tx_array = scene.rx_array = rt.PlanarArray(num_rows=1, num_cols=1, pattern="iso", polarization="V")
    return scene


def paths_of(scene: Any, place: Any, touched: str | None = None) -> tuple[Any, Any]:
    """Return amplitudes without the phase of the way, and delays [s], of the paths that touch an object."""
    for name in ("tx", "rx"):
        scene.remove(name)
    scene.add(rt.Transmitter("tx", position=list(map(float, place))))
    scene.add(rt.Receiver("rx", position=list(map(float, place))))
    paths = rt.PathSolver()(scene, max_depth=4, samples_per_src=RAYS, los=False, refraction=False, seed=1)
    real, imag = (np.asarray(part).reshape(-1) for part in paths.a)
    delay = np.asarray(paths.tau).reshape(-1).astype(np.float64)
    keep = delay >= 0.0
    if touched and keep.size:
        number = scene.get(touched).object_id
        keep &= (np.asarray(paths.objects).reshape(-1, keep.size) == number).any(axis=0)
    return (real + 1j * imag)[keep], delay[keep]


def gain(found: tuple[Any, Any], frequencies: Any, gate: tuple[float, float] | None = None) -> float:
    """Return the power gain [dB], mean over frequencies; `gate`: middle and half width of the ranges [m]."""
    a, delay = found
    if gate:
        inside = np.abs(delay * SPEED_OF_LIGHT / 2.0 - gate[0]) < gate[1]
        a, delay = a[inside], delay[inside]
    if not a.size:
        return NOTHING_DB
    power = np.abs(np.exp(-2j * np.pi * np.outer(np.atleast_1d(frequencies), delay)) @ a) ** 2
    return float(10.0 * np.log10(max(power.mean(), 1e-30)))


def near_plate(folder: Path, described: Mapping[str, Any], rows: Rows) -> list[float]:
    """Answer by the mirror image of the radar."""
    scene = scene_of(folder, {"target": METAL})
    places = [[float(row[f"radar_{axis}_m"]) for axis in "xyz"] for row in rows]
    return [gain(paths_of(scene, place), described["frequency_hz"]) for place in places]


def post_on_ground(folder: Path, described: Mapping[str, Any], rows: Rows) -> list[float]:
    """Answer by mirror images."""
    ground = stuff(complex(*described["materials"]["ground"]["permittivity"]), 10.0)
    scene = scene_of(folder, {"ground": ground, "post": METAL})
    band = np.linspace(*described["band_hz"], 41)
    return [gain(paths_of(scene, [float(row["distance_m"]), 0.0, 0.5], "post"), band) for row in rows]


def wall_ghosts(folder: Path, described: Mapping[str, Any], rows: Rows) -> list[float]:
    """Answer by mirror images."""
    found = paths_of(scene_of(folder, {"wall": METAL, "ball": METAL}), [0.0, 0.0, 0.0], "ball")
    return [gain(found, described["frequency_hz"], (float(row["range_m"]), 0.15)) for row in rows]


def slabs(folder: Path, described: Mapping[str, Any], rows: Rows) -> list[float]:
    """Answer by the mirror image of the radar."""
    found = []
    for row in rows:
        permittivity = complex(float(row["permittivity_real"]), float(row["permittivity_imag"]))
        scene = scene_of(folder, {"panel": stuff(permittivity, float(row["thickness_m"]))})
        distance = float(row["distance_m"])
        found.append(gain(paths_of(scene, [distance, 0.0, 0.0]), described["frequency_hz"], (distance, 0.02)))
    return found


SOLVERS = {
    "near_plate": near_plate,
    "post_on_ground": post_on_ground,
    "wall_ghosts": wall_ghosts,
    "slabs": slabs,
}

if __name__ == "__main__":
    run(__doc__, SOLVERS, {"simulator": "sionna-rt alone", "version": version("sionna-rt"), "machine": machine()})
