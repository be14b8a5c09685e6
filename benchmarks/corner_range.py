"""Error and time of small corner reflectors from 5 to 250 m, over `sheet_share`.

Run: ``python benchmarks/corner_range.py``, three minutes on two quiet cores.
"""

from __future__ import annotations

import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import scarl_sionna as ss
from scarl_sionna.core.errors import ScarlWarning
from tests.oracles import rcs as oracle
from tests.scenes import Thing, write_scene

RADAR = ss.RadarSpec(elevation_fov_deg=120.0)
DISTANCES = (5.0, 20.0, 80.0, 150.0, 220.0, 250.0)
FINE = ss.SbrSettings(floor_db=None, ray_spacing=0.5, edge_spacing=0.125, bisections=12)
SHARES = (64.0, 0.3, 0.15, 0.1, 0.05)


def cases(count: int, seed: int = 3):
    """Yield leg [m], unit vector to the radar and distance [m] of corners: 3 to 20 cm, all aspects of the octant."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        leg, aspect = rng.uniform(0.03, 0.2), np.abs(rng.normal(size=3)) + 0.1
        yield leg, aspect / np.linalg.norm(aspect), DISTANCES[number % len(DISTANCES)]


def corner(leg: float) -> trimesh.Trimesh:
    vertices, faces = oracle.TRIHEDRAL_MESH
    return trimesh.Trimesh(leg * np.array(vertices), faces, process=False)


def level(state, aspect, distance: float, settings) -> float:
    """Return the level of the coherent sum, VV [dBsm]."""
    x, y, z = aspect
    pose = ss.Pose.from_euler(distance * aspect, yaw=np.pi + np.arctan2(y, x), pitch=np.arcsin(z))
    paths = ss.solve_paths(state, RADAR, pose, method="sbr", settings=settings)
    length = sum(np.linalg.norm(point - pose.position, axis=1) for point in (paths.tx_point, paths.rx_point))
    signal = np.sum(paths.a[:, 0, 0] * np.exp(-2j * np.pi / RADAR.wavelength * length))
    return float(20 * np.log10(abs(signal) * (4 * np.pi) ** 1.5 * distance**2 / RADAR.wavelength))


def main(count: int = 60) -> None:
    warnings.simplefilter("ignore", ScarlWarning)
    error: dict[float, list[float]] = {share: [] for share in SHARES}
    spent = dict.fromkeys(SHARES, 0.0)
    for leg, aspect, distance in cases(count):
        with tempfile.TemporaryDirectory() as folder:
            path = write_scene(Path(folder), [Thing("corner", corner(leg), "Static", "steel")])
            state = ss.load_scene(path).at(0.0)
            exact = level(state, aspect, distance, FINE)
            for share in SHARES:
                settings = ss.SbrSettings(floor_db=None, sheet_share=share)
                start = time.process_time()
                error[share].append(level(state, aspect, distance, settings) - exact)
                spent[share] += time.process_time() - start
    print("| sheet_share | largest error | " + " | ".join(f"{d:g} m" for d in DISTANCES) + " | CPU ms a solve |")
    print("|---" * (len(DISTANCES) + 3) + "|")
    for share in SHARES:
        size = np.abs(np.array(error[share])).reshape(-1, len(DISTANCES)).max(axis=0)
        cells = " | ".join(f"{value:.2f} dB" for value in size)
        print(f"| {share:g} | {size.max():.2f} dB | {cells} | {1e3 * spent[share] / count:.0f} |")


if __name__ == "__main__":
    main()
