"""Methods for several directions of a cell, side by side: what they resolve, how accurate they are, what they cost.

    python benchmarks/directions.py                                  print the table
    python benchmarks/directions.py --write docs/radar_signal.md     and write it into the page

One snapshot of the default line of 12 elements, and of 8 places in a line of 26 (sparse). *Resolved*: exactly two
directions, each within half a beamwidth of its own. Powers are after beamforming. *Error over bound*: root mean square
of the sine's error, resolved snapshots only, over the Cramer-Rao bound (`tests/oracles/directions.py`). *False*: second
directions of a lone target. *CPU time*: a cell of two targets, on the machine named.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import scarl_sionna as ss
from benchmarks.harness import machine, write_block
from scarl_sionna.signal.direction.manifold import Manifold
from scarl_sionna.signal.direction.several import METHODS, pursue
from scarl_sionna.signal.direction.subspace import KINDS
from tests.oracles.directions import direction_bound

LINE = ss.RadarSpec()
SPARSE = LINE.with_(
    tx_positions=((0, 0, 0),),
    rx_positions=tuple((0, 0.5 * LINE.wavelength * place, 0) for place in (0, 1, 4, 10, 12, 17, 22, 25)),
)
ROWS = (("1.5", "20", 1.5, 20.0), ("1", "20", 1.0, 20.0), ("1.5", "30", 1.5, 30.0), ("3", "20", 3.0, 20.0))


def beamwidth(radar: ss.RadarSpec) -> float:
    """Return the width of the array's own beam at half the power, as a sine."""
    places = Manifold.of(radar, np.zeros(2), None).positions[:, 1] / radar.wavelength
    sines = np.linspace(0.0, 0.3, 3001)
    power = np.abs(np.exp(2j * np.pi * np.outer(sines, places)).mean(axis=1)) ** 2
    return float(2.0 * sines[np.argmax(power < 0.5)])


def snapshots(
    radar: ss.RadarSpec, apart: float, snr_db: float, draws: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return snapshots with noise of power 1, true sines (draws, 2) and amplitudes; `apart` 0: a lone target."""
    rng, places = np.random.default_rng(4), Manifold.of(radar, np.zeros(2), None).positions[:, 1] / radar.wavelength
    first = rng.uniform(-0.8, 0.8 - apart * beamwidth(radar), draws)
    sines = np.stack([first, first + apart * beamwidth(radar)], axis=1)[:, : 2 if apart else 1]
    amplitude = np.sqrt(10.0 ** (snr_db / 10.0) / len(places)) * np.exp(2j * np.pi * rng.random(sines.shape))
    beams = np.exp(-2j * np.pi * sines[:, :, None] * places)
    noise = np.sqrt(0.5) * (rng.normal(size=(draws, len(places))) + 1j * rng.normal(size=(draws, len(places))))
    return np.einsum("nk,nkc->nc", amplitude, beams) + noise, sines, amplitude


def measure(radar: ss.RadarSpec, method: str, apart: float, snr_db: float, draws: int) -> tuple[float, float, float]:
    """Return the share resolved, error over bound, and CPU time of a cell [s]."""
    snapshot, true, amplitude = snapshots(radar, apart, snr_db, draws)
    grid = ss.range_doppler_angle(
        np.zeros((radar.num_virtual, 4, 8), np.complex64), radar.with_(num_chirps=4, num_samples=8)
    )
    manifold = Manifold.of(radar, grid.azimuth, None)
    cpu = time.process_time()
    found = pursue(manifold, snapshot, np.full(draws, np.inf), 1.0, 3, method)
    cpu = (time.process_time() - cpu) / draws
    places, width, errors, resolved = manifold.positions[:, 1] / radar.wavelength, beamwidth(radar), [], 0
    for draw in range(draws):
        sines = np.sort(found.sines[found.cell == draw, 0])
        if len(sines) == true.shape[1] and (np.abs(sines - true[draw]) < 0.5 * width).all():
            resolved += 1
            errors.append((sines - true[draw]) ** 2 / direction_bound(places, true[draw], amplitude[draw], 1.0))
    return resolved / draws, float(np.sqrt(np.mean(errors))) if errors else np.nan, cpu


def table(draws: int) -> str:
    """Return the table of all methods."""
    names = [f"{apart} beamwidths, {level} dB" for apart, level, _, _ in ROWS]
    lines = [
        f"{draws} snapshots a number, {machine()}. Resolved [%] (error over bound):",
        "",
        f"| `direction` | {' | '.join(names)} | sparse, 1.5, 20 dB | one target, 20 dB | CPU time a cell [ms] |",
        "|---" * (len(names) + 4) + "|",
    ]
    for method in METHODS:
        cells, times = [], []
        for _, _, apart, snr_db in ROWS:
            share, error, cpu = measure(LINE, method, apart, snr_db, draws)
            cells.append(f"{100.0 * share:.0f} ({error:.2f})" if share else "0")
            times.append(cpu)
        if method in KINDS:
            cells.append("refused")
        else:
            share, error, _ = measure(SPARSE, method, 1.5, 20.0, draws)
            cells.append(f"{100.0 * share:.0f} ({error:.2f})" if share else "0")
        share, error, _ = measure(LINE, method, 0.0, 20.0, draws)
        cells.append(f"{100.0 * share:.1f} ({error:.2f})")
        lines.append(f'| `"{method}"` | {" | ".join(cells)} | {1e3 * times[0]:.2f} |')
    return "\n".join(lines)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=400)
    parser.add_argument("--write", type=Path, metavar="PAGE")
    arguments = parser.parse_args()
    text = table(arguments.draws)
    print(text)
    if arguments.write:
        write_block(arguments.write, "directions", text)


if __name__ == "__main__":
    main()
