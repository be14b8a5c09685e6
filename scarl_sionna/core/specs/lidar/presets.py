"""Named lidars, as the parts in which they differ from the defaults.

Makers publish where a lidar looks, how far and how well it measures; pulse energy, lens and noise they do not. So a
device here has the published scan, and of the unknown numbers one, the pulse energy, is fitted to one published range;
what else is published is held out (``tests/physics/test_lidar_devices.py``).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .pattern import RasterScan, SpinningScan
from .receiver import HeterodyneReceiver, PulsedReceiver

HDL32E_ELEVATION_DEG = (
    -30.67, -9.33, -29.33, -8.00, -28.00, -6.67, -26.67, -5.33, -25.33, -4.00, -24.00, -2.67, -22.67, -1.33, -21.33,
    0.00, -20.00, 1.33, -18.67, 2.67, -17.33, 4.00, -16.00, 5.33, -14.67, 6.67, -13.33, 8.00, -12.00, 9.33, -10.67,
    10.67,
)  # fmt: skip # a table
"""In firing order: lowest beam first, lower and upper bank by turns (HDL-32E user's manual, laser firing sequence)."""
HDL32E_CYCLE = 46.08e-6
"""Time from one firing of all lasers to the next [s]; 1.152 us between lasers (Velodyne 63-9277, by the drivers)."""

OS1_ELEVATION_DEG = (
    16.729, 16.118, 15.543, 14.995, 14.526, 13.937, 13.381, 12.837, 12.378, 11.801, 11.251, 10.704, 10.251, 9.693,
    9.138, 8.603, 8.149, 7.594, 7.049, 6.513, 6.056, 5.504, 4.961, 4.419, 3.967, 3.424, 2.881, 2.328, 1.880, 1.337,
    0.787, 0.239, -0.205, -0.756, -1.390, -1.854, -2.300, -2.839, -3.386, -3.935, -4.391, -4.929, -5.472, -6.028,
    -6.471, -7.020, -7.563, -8.116, -8.572, -9.112, -9.660, -10.227, -10.687, -11.226, -11.777, -12.350, -12.807,
    -13.347, -13.902, -14.490, -14.968, -15.504, -16.078, -16.679,
)  # fmt: skip # a table
OS1_AZIMUTH_DEG = (
    3.073, 0.904, -1.261, -3.384, 3.048, 0.900, -1.235, -3.335, 3.029, 0.915, -1.200, -3.301, 3.026, 0.921, -1.179,
    -3.268, 3.032, 0.933, -1.156, -3.230, 3.028, 0.953, -1.131, -3.209, 3.059, 0.976, -1.112, -3.182, 3.071, 0.990,
    -1.087, -3.155, 3.097, 1.014, -1.103, -3.133, 3.118, 1.035, -1.039, -3.116, 3.144, 1.061, -1.013, -3.101, 3.178,
    1.092, -0.993, -3.089, 3.217, 1.125, -0.972, -3.072, 3.265, 1.159, -0.949, -3.066, 3.321, 1.204, -0.921, -3.055,
    3.381, 1.252, -0.898, -3.071,
)  # fmt: skip # a table
"""Beam angles of one OS1-64 (public example metadata of the maker's SDK, serial 991913000010)."""

_GAUSSIAN = 1.699
"""Full width of a Gaussian beam at 1/e2 over that at half its intensity: sqrt(2 / ln 2)."""

_SEES_EDGES: Mapping[str, Any] = {"sub_rays": 5, "max_surfaces": 4}

PRESETS: Mapping[str, Mapping[str, Any]] = {
    "spinning_64": {
        "scan": SpinningScan(
            elevation_deg=tuple(
                round(value, 4)
                for value in [2.0 - index / 3.0 for index in range(32)]
                + [-8.83 - index * 15.5 / 31.0 for index in range(32)]
            )
        ),
        "receiver": HeterodyneReceiver(),
        "max_returns": 2,
        **_SEES_EDGES,
    },
    "fmcw_forward": {
        "scan": RasterScan(
            elevation_fov_deg=(-18.0, 10.0),
            num_azimuth=400,
            num_elevation=200,
            scan_time=0.05,
            lines_at_once=8,
            serpentine=True,
        ),
        "receiver": HeterodyneReceiver(),
        "max_distance": 250.0,
        "max_returns": 2,
        **_SEES_EDGES,
    },
    # Velodyne HDL-32E user's manual: angles, 100 m (here of 80 %: energy), steps of 2 mm, a spot of 4 x 2 inches at 100
    # feet (2.9 x 1.5 mrad without that at the window; here round). Wavelength and 5 ns: sister models. +-2 cm: jitter.
    "hdl32e": {
        "scan": SpinningScan(
            elevation_deg=HDL32E_ELEVATION_DEG,
            firing_time=tuple(1.152e-6 * laser for laser in range(32)),
            num_azimuth=1085,
            rotation_rate=20.0,
        ),
        "receiver": PulsedReceiver(pulse_energy=12.8e-9, pulse_width=5e-9, range_step=2e-3, timing_jitter=1e-10),
        "wavelength": 903e-9,
        "beam_divergence": 2.1e-3,
        "max_distance": 100.0,
        **_SEES_EDGES,
    },
    # Ouster OS1 data sheet (850 nm): 40 m at 10 % in 100 klx with false alarms of 1e-4 (energy), 10 cm at a ratio of 12
    # (pulse width), from 0.8 m, steps of 1.2 cm, a beam of 10 mm and 0.13 deg at half its intensity. Held out: 120 m at
    # 80 %, 3 and 1.5 cm at 100 and 250. Pulses a shot, dark counts and filter are ours.
    "os1_64": {
        "scan": SpinningScan(
            elevation_deg=OS1_ELEVATION_DEG,
            azimuth_offset_deg=OS1_AZIMUTH_DEG,
            firing_time=(0.0,) * 64,
            num_azimuth=1024,
            rotation_rate=10.0,
        ),
        "receiver": PulsedReceiver(
            pulse_energy=2.82e-9,
            pulse_width=10e-9,
            num_pulses=100,
            receiver_aperture=10e-3,
            quantum_efficiency=0.1,
            avalanche_gain=1.0,
            ionization_ratio=0.0,
            noise_current_density=0.0,
            dark_current=2e-11,
            optical_bandwidth=1e-9,
            field_of_view=2.3e-3,
            blind_distance=(0.8, 0.8),
            range_step=1.2e-2,
        ),
        "wavelength": 850e-9,
        "beam_divergence": _GAUSSIAN * 2.27e-3,
        "max_distance": 150.0,
        **_SEES_EDGES,
    },
    # RoboSense RS-LiDAR-M1 user manual 1.7: 120 x 25 deg, 0.2 deg, 10 Hz, 78,750 points a frame, 150 m at 10 %, up to
    # 200 m, from 0.5 m, steps of 5 mm, 5 cm (jitter); its five channels side by side are one here, its beam is ours.
    "rs_lidar_m1": {
        "scan": RasterScan(
            azimuth_fov_deg=(60.0, -60.0),
            elevation_fov_deg=(-12.5, 12.5),
            num_azimuth=625,
            num_elevation=126,
            scan_time=0.1,
            serpentine=True,
        ),
        "receiver": PulsedReceiver(
            pulse_energy=112e-9, pulse_width=5e-9, blind_distance=(0.5, 0.5), range_step=5e-3, timing_jitter=3e-10
        ),
        "wavelength": 905e-9,
        "beam_divergence": 2e-3,
        "max_distance": 200.0,
        "max_returns": 2,
        **_SEES_EDGES,
    },
    # Aeva Aeries II, as papers and data sets give it: 120 x 30 deg, about 100 lines, 10 Hz, up to 400 m or more,
    # precision of 2 cm and 3 cm/s; columns and chirps are ours: 10 us a shot, the most that ten beams have time for.
    "aeries_2": {
        "scan": RasterScan(
            azimuth_fov_deg=(60.0, -60.0),
            elevation_fov_deg=(-15.0, 15.0),
            num_azimuth=1000,
            num_elevation=100,
            scan_time=0.1,
            lines_at_once=10,
        ),
        "receiver": HeterodyneReceiver(sampling_frequency=1e9),
        "max_distance": 400.0,
        "max_returns": 1,
        **_SEES_EDGES,
    },
}
"""Arguments of :class:`~scarl_sionna.core.specs.lidar.spec.LidarSpec` by name."""
