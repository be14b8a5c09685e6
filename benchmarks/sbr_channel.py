"""Error and time of the channel solver sbr: a plate near by against the exact integral, and a car against a finer run.

Run: ``python benchmarks/sbr_channel.py [plate] [car]`` (both by default, about two minutes on two cores).
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import scarl_sionna as ss
from benchmarks.harness import machine
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.radar_spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.channel.sbr_settings import SbrChannelSettings
from tests.oracles.near_field_po import rectangle_transfer
from tests.scenes import Thing, plane, write_scene

ALL = SbrChannelSettings(floor_db=None)


def plate() -> None:
    """Print the largest error over +-5 deg of plates at 10 m for each knob."""
    radar = RadarSpec(elevation_fov_deg=120.0)
    wavelength = SPEED_OF_LIGHT / radar.center_frequency
    for size in (0.1, 1.0):
        with tempfile.TemporaryDirectory() as folder:
            mesh = plane(size, size, normal=(1, 0, 0))
            state = ss.load_scene(write_scene(Path(folder), [Thing("plate", mesh, "Static", "steel")])).at(0.0)
        for max_phase, integration_phase in ((2.0, 0.1), (1.0, 0.05), (0.4, 0.02), (0.2, 0.01)):
            knobs = ALL.with_(max_phase=max_phase, integration_phase=integration_phase)
            errors, spent = [], 0.0
            for angle in np.radians(np.linspace(-5, 5, 21)):
                position = 10.0 * np.array([np.cos(angle), np.sin(angle), 0.0])
                pose = Pose.from_euler(position, yaw=np.pi + angle)
                start = time.perf_counter()
                paths = solve_paths(state, radar, pose, method="sbr", settings=knobs)
                spent += time.perf_counter() - start
                length = 2 * np.linalg.norm(paths.rx_point - position, axis=1)
                found = np.sum(paths.a[:, 0, 0] * np.exp(-2j * np.pi * length / wavelength))
                edges = np.array([0, -size / 2, -size / 2]), [0, size, 0], [0, 0, size]
                exact = rectangle_transfer(*edges, position, wavelength, np.array([0, 0, 1.0]))
                errors.append(abs(20 * np.log10(abs(found / exact))))
            print(
                f"plate {size:g} m  max_phase {max_phase:g} integration_phase {integration_phase:g}: {paths.num_paths:5d} paths, "
                f"largest error {max(errors):.3f} dB, mean {np.mean(errors):.3f} dB, {spent / 21:.3f} s a solve"
            )


def car() -> None:
    """Print error in the range cells of the car ahead of highway_guardrail against a finer run, and time."""
    state = ss.load_scene("highway_guardrail").at(0.0)
    radar = RadarSpec.preset("awr1843boost").with_(num_chirps=1)
    pose = state.actor_pose("ego").compose(Pose([2.40, 0.0, 0.6]))

    def cells(knobs: SbrChannelSettings) -> tuple[np.ndarray, int, float]:
        start = time.perf_counter()
        paths = solve_paths(state, radar, pose, method="sbr", instances=["car_ahead"], settings=knobs)
        spent = time.perf_counter() - start
        rd = ss.range_doppler(ss.virtual_cube(ss.synthesize(paths, radar), radar), radar)
        inside = (rd.range > 16.0) & (rd.range < 21.5)
        return np.mean(np.abs(rd.data[:, 0, inside]) ** 2, axis=0), paths.num_paths, spent

    cells(SbrChannelSettings(max_depth=1))
    exact, num_paths, spent = cells(ALL.with_(max_phase=0.1, edge_spacing=0.125, integration_phase=0.01))
    print(f"car  reference (max_phase 0.1): {num_paths} paths, {spent:.1f} s, {len(exact)} cells")
    for name, changed in (
        ("default", {}),
        ("edge_spacing 0.25", {"edge_spacing": 0.25}),
        ("edge_spacing 1, probe_spacing 1", {"edge_spacing": 1.0, "probe_spacing": 1.0}),
        ("max_phase 1", {"max_phase": 1.0}),
        ("max_phase 2, edge_spacing 1, probe_spacing 1", {"max_phase": 2.0, "edge_spacing": 1.0, "probe_spacing": 1.0}),
        ("max_depth 2", {"max_depth": 2}),
        ("max_depth 1", {"max_depth": 1}),
    ):
        power, num_paths, spent = cells(SbrChannelSettings(**changed))
        error = np.abs(10 * np.log10(power / exact))
        print(
            f"car  {name}: {num_paths} paths, median {np.median(error):.2f} dB, largest {error.max():.2f} dB, {spent:.1f} s"
        )


if __name__ == "__main__":
    print(machine())
    chosen = sys.argv[1:] or ["plate", "car"]
    for task in (plate, car):
        if task.__name__ in chosen:
            task()
