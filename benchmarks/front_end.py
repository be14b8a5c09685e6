"""The front end's figure and costs: phase noise after range correlation, the profile of an AWR1642, seconds of a frame.

    python benchmarks/front_end.py [--figure docs/figures/front_end.png]

Prints the seconds of a frame of the default radar (12 channels, 256 chirps, 512 samples) with points at random places,
with an ideal front end and with every effect.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from harness import machine

import scarl_sionna as ss
from scarl_sionna.signal.front_end.oscillators import residual_density

NOISE = ss.PhaseNoise(mask=((1e5, -80.0), (1e6, -95.0), (1e7, -115.0)))
EVERYTHING = {
    "phase_noise": NOISE,
    "chirp_errors": ss.ChirpErrors(start_jitter=1e-9),
    "leakage": (ss.Leakage(length=0.1, level_db=-40.0),),
    "channels": ss.ChannelErrors(rx_gain_db=(0.5, 0.0, -0.5, 0.0)),
    "amplifier": ss.Amplifier(p1db_dbm=-8.0),
    "mixer": ss.Mixer(iq_gain_db=0.1),
    "filters": ss.IfFilter(high_pass=(175e3, 350e3), low_pass=10e6),
}


def point(radar: ss.RadarSpec, distance: float, rcs: float, seed: int | None) -> np.ndarray:
    """Return the raw data of a point that stands ahead."""
    paths = ss.point_targets([[distance, 0.0, 0.0]], [[0.0, 0.0, 0.0]], rcs, radar, ss.Pose())
    return ss.synthesize(paths, radar, None if seed is None else np.random.default_rng(seed), method="direct")


def seconds() -> None:
    """Print the time of a frame for several numbers of paths."""
    radar = ss.RadarSpec()
    for count in (100, 10_000):
        rng = np.random.default_rng(0)
        distance = rng.uniform(2.0, 200.0, count)
        places = np.stack([distance, rng.uniform(-0.3, 0.3, count) * distance, np.zeros(count)], axis=1)
        paths = ss.point_targets(places, np.zeros_like(places), 10.0 ** rng.uniform(-3, 1, count), radar, ss.Pose())
        found = []
        for effects in ({}, {name: EVERYTHING[name] for name in list(EVERYTHING)[2:]}, EVERYTHING):
            start = time.perf_counter()
            ss.synthesize(paths, radar.with_(**effects), np.random.default_rng(1))
            found.append(time.perf_counter() - start)
        print(f"{count} paths: ideal {found[0]:.2f} s, all but oscillators {found[1]:.2f} s, all {found[2]:.2f} s")


def draw(path: Path) -> None:
    """Draw the residual phase noise at three distances, and a range profile of the preset and of an ideal receiver."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.4), layout="constrained")
    one = ss.RadarSpec().with_(tx_positions=((0.0, 0.0, 0.0),), rx_positions=((0.0, 0.0, 0.0),), num_chirps=1024)
    window = np.hanning(one.num_samples)
    frequency = np.fft.rfftfreq(one.num_samples, 1.0 / one.sample_rate)
    for distance in (2.0, 10.0, 50.0):
        adc = point(one.with_(phase_noise=NOISE), distance, 1e14, 1)
        phase = np.angle(adc * point(one, distance, 1e14, None).conj())[0].astype(float)
        spectrum = np.abs(np.fft.rfft((phase - phase.mean()) * window, axis=1)) ** 2
        density = spectrum.mean(axis=0) / (window**2).sum() / one.sample_rate
        line = left.plot(frequency[2:] / 1e6, 10 * np.log10(density[2:]), lw=1.0, label=f"{distance:g} m")[0]
        theory = residual_density(NOISE, frequency[2:], 2.0 * distance / 299792458.0)
        left.plot(frequency[2:] / 1e6, 10 * np.log10(theory), "--", color=line.get_color(), lw=0.8)
    left.set(xlabel="offset [MHz]", ylabel="phase of the beat [dBc/Hz]", xscale="log", ylim=(-150, -75))
    left.legend(title="simulated; dashed: theory", fontsize=8, title_fontsize=8)
    radar = ss.RadarSpec.preset("awr1642").with_(num_chirps=256, tx_positions=((0.0, 0.0, 0.0),))
    window = np.hanning(radar.num_samples) / np.hanning(radar.num_samples).sum()
    ideal = radar.with_(front_end=radar.front_end.ideal(), enob=None, response=())
    for name, spec in (("ideal", ideal), ("awr1642", radar)):
        rng = np.random.default_rng(3)
        paths = ss.point_targets([[2.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 1.0, spec, ss.Pose())
        codes, scale, _ = ss.quantize(ss.synthesize(paths, spec, rng), spec, rng)
        spectra = np.fft.fft(scale * (codes[..., 0] + 1j * codes[..., 1]) * window, axis=-1)
        power = 10 * np.log10((np.abs(spectra) ** 2).mean(axis=(0, 1)) * 1e3)
        right.plot(np.arange(-64, 192), np.roll(power, 64), lw=1.0, label=name)
    right.set(xlabel="range bin (0.2 m)", ylabel="mean power of a chirp [dBm]")
    right.legend(fontsize=8)
    for axes in (left, right):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=80)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--figure", type=Path)
    arguments = parser.parse_args()
    if arguments.figure:
        draw(arguments.figure)
    else:
        print(machine())
        seconds()
