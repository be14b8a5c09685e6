"""Scanning radars by name, as the fields in which they differ from the defaults, with their sources.

No data sheet of these radars that was found states transmitted power, noise figure, gain or the shape of the beam
below the horizon: those are this project's assumptions, the same for all.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scarl_sionna.core.specs.radar.waveform import Fmcw
from scarl_sionna.core.units import SPEED_OF_LIGHT

START_FREQUENCY = 76.04e9
"""Start of the ramps [Hz]; as are the next two from the settings of the radar in VT&R3 (github.com/utiasASRL/vtr3,
radar.doppler_extractor: f_t 76.04 GHz, del_f 893 MHz, meas_freq 1600 a second, beta_corr_fact 0.944)."""
SWEEP = 893e6
"""What the frequency sweeps in a ramp [Hz]."""
SLOPE = SWEEP * 1600.0 / 0.944
"""Slope of the ramps [Hz/s], by which a Doppler shift becomes a range: 0.0505 m a m/s, 0.049 to 0.0502 in Boreas."""
CELLS_A_RESOLUTION = 4
"""Cells of the output a range resolution. Navtech states cells of 0.175 m (Colossus protocol, ``3768 * 0.175 m``), a
quarter of which, 0.0438 m, is the finer output of the same ramps."""


def _ramp(cell: float, num_cells: int) -> Fmcw:
    """Return the ramp whose transform with zero padding has cells of a width [m], and at least so many of them."""
    sampled = SPEED_OF_LIGHT / (2.0 * cell * CELLS_A_RESOLUTION)
    num_samples = -(-num_cells // CELLS_A_RESOLUTION)
    ramp_time = max(SWEEP, sampled) / SLOPE
    return Fmcw(
        start_frequency=START_FREQUENCY,
        bandwidth=SLOPE * ramp_time,
        ramp_time=ramp_time,
        idle_time=0.0,
        num_chirps=1,
        num_samples=num_samples,
        sampling_frequency=num_samples / (sampled / SLOPE),
    )


PRESETS: Mapping[str, Mapping[str, Any]] = {
    # Oxford Radar RobotCar (Barnes et al., ICRA 2020) and RADIATE (Sheeny et al., ICRA 2021). Cells of 0.0432 m and
    # 3768 of them: Oxford's SDK (robotcar-dataset-sdk, radar.py); 4 turns a second, 400 azimuths, 1.8 deg: RADIATE's
    # documentation (github.com/marcelsheeny/radiate_sdk)
    "cts350x": {"waveform": _ramp(0.0432, 3768), "num_range_bins": 3768},
    # Boreas (Burnett et al., IJRR 2023), and MulRan (Kim et al., ICRA 2020): cells of 0.0596 m, 3360 of them
    # (github.com/utiasASRL/pyboreas, DATA_REFERENCE.md)
    "cir204h": {"waveform": _ramp(0.0596, 3360), "num_range_bins": 3360},
    # Boreas Road Trip: cells of 0.0438 m up to 300 m, ramps that rise and fall in turn (DATA_RT_REFERENCE.md)
    "ras6": {"waveform": _ramp(0.0438, 6848), "num_range_bins": 6848, "alternating": True},
}
