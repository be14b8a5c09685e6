"""The preset of a real device beside captures of it, and the jitter of its ramps.

python benchmarks/validation/front_end.py
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import scarl_sionna as ss
from benchmarks.validation.rows import Row, around, run, share
from scarl_sionna.core.pose import Pose
from tests.physics.test_front_end_presets import profile

FITTED = "preset `awr1642`, target of 2.5 m2 at 2 m; fitted to these captures ([front end](front_end.md))"
JITTER = 1.1e-9
"""Largest error of a ramp's start [s]."""


def capture() -> tuple[ss.RadarSpec, np.ndarray]:
    """Return 256 chirps of one transmitter, a reflector of 2.5 m2 2 m away, as converted."""
    radar = ss.RadarSpec.preset("awr1642").with_(num_chirps=256, tx_positions=((0.0, 0.0, 0.0),))
    paths = ss.point_targets([[2.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 2.5, radar, Pose())
    rng = np.random.default_rng(11)
    codes, scale, _ = ss.quantize(ss.synthesize(paths, radar, rng), radar, rng)
    return radar, scale * (codes[..., 0] + 1j * codes[..., 1])


def device() -> list[Row]:
    """Return the rows of the AWR1642."""
    radar, adc = capture()
    spectra = profile(adc)
    mean = spectra.mean(axis=1)
    floor = 10.0 * np.log10((np.abs(spectra - mean[:, None]) ** 2).mean(axis=(0, 1)))
    floor = np.convolve(np.pad(floor, 1, "wrap"), np.ones(3) / 3, "valid")
    power, target = (np.abs(mean) ** 2).mean(axis=0), round(2.0 / radar.range_resolution)
    levels = 10.0 * np.log10(np.abs(mean[:, target]) ** 2)
    phase = [1e3 * np.angle(one / one.mean()).std() for one in spectra[:, :, target]]

    def one(name: str, what: str, unit: str, ours: float, limits: dict, basis="fitted", note=FITTED) -> Row:
        return Row(name, what, "awr1642", unit, **limits, basis=basis, ours=round(float(ours), 2), note=note)

    def stated(low: float | None, high: float | None) -> dict:
        return {"low": low, "high": high, "spread": "stated"}

    image = 10.0 * np.log10(power[-target] / power[target])
    return [
        one("floor_rise", "AWR1642, noise floor of bin 20 over bin 0", "dB", floor[20] - floor[0], around(6.5)),
        one("floor_fall", "AWR1642, noise floor of bin 20 over bin 120", "dB", floor[20] - floor[120], around(1.5)),
        one("leakage", "AWR1642, leakage in bins 0 to 3 over the target", "dB",
            10.0 * np.log10(power[:4].max() / power[target]), stated(-16.0, -15.0)),
        one("channels", "AWR1642, levels of the channels, peak to peak", "dB", np.ptp(levels), stated(0.8, 2.7)),
        one("image", "AWR1642, image over the target", "dB", image, stated(None, -40.0)),
        one("phase", "AWR1642, phase from chirp to chirp, mean of the channels", "mrad", np.mean(phase), stated(1.9,
        3.1),
            note="follows from noise and level, which are fitted; that no skirt of phase noise shows at 2 m is not"),
    ]  # fmt: skip # a table


def jitter_phase_deg(beat: float, chirps: int = 512) -> float:
    """Return the phase error of a ramp that starts `JITTER` late [deg]: the spread over ramps of such a jitter."""
    radar = ss.RadarSpec().with_(chirp_errors=ss.ChirpErrors(start_jitter=JITTER), num_chirps=chirps)
    distance = beat / radar.waveform.chirp_slope * 299_792_458.0 / 2.0
    if distance > 0.9 * radar.max_range:
        raise SystemExit(f"a beat of {beat:g} Hz is beyond this radar's range")
    paths = ss.point_targets([[distance, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 100.0, radar, Pose())
    adc = ss.synthesize(paths, radar.with_(noise_figure_db=0.0), np.random.default_rng(4))
    line = adc[0] @ np.exp(-2j * np.pi * beat * np.arange(adc.shape[-1]) / radar.sample_rate)
    return float(np.degrees(np.angle(line / line.mean()).std()))


def rows() -> list[Row]:
    """Return all rows of the theme."""
    return [
        *device(),
        Row("jitter_1mhz", "phase of a ramp that starts 1.1 ns late, beat of 1 MHz", "jitter", "deg", **share(0.4),
            basis="held out", ours=round(jitter_phase_deg(1e6), 3), note="spread over ramps of that jitter"),
    ]  # fmt: skip # a table


if __name__ == "__main__":
    run("front_end", rows)
