"""Waveforms side by side: gain, Doppler tolerance and sidelobes against theory, cost of synthesis, one street.

    python benchmarks/waveforms.py [--paths 20000] [--no-speed] [--figure FILE.png]

All have 300 MHz, frames of 9.7 ms and one pair of antennas. Measured are maps without windows. Theory: the gain is the
number of averaged samples; a moving point loses ``sinc(nu T)`` by Doppler within a symbol of the duration T, and by
range migration the mean of ``exp(2j pi F u t)`` over frequencies F and times t of the frame; the sidelobes are those of
a rectangular band, -13.26 dB, of the code's periodic autocorrelation, or of the power of a code within ramps.
"""

from __future__ import annotations

import argparse
import time
import warnings
from pathlib import Path

import numpy as np
from harness import machine
from radar_labels import place

import scarl_sionna as ss
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.signal.noise import sample_noise_power

BAND, CHIRPS = 300e6, 256
SHARED = {"num_chirps": CHIRPS}
OFDM = {"num_subcarriers": 512, "subcarrier_spacing": BAND / 512, "cyclic_prefix": 1.7e-6}
CODE = {"chip_rate": BAND, "repetitions": 22} | SHARED
WAVEFORMS = {
    "FMCW": ss.Fmcw(**SHARED),
    "stepped FMCW, 4 x 75 MHz": ss.SteppedFmcw(**SHARED, bandwidth=BAND / 4, num_steps=4),
    "PC-FMCW, 31 chips within": ss.PcFmcw(**SHARED),
    "OFDM": ss.Ofdm(**SHARED, **OFDM, idle_time=34.6e-6),
    "OFDM, comb of 2": ss.Ofdm(**SHARED, **OFDM, idle_time=34.6e-6, comb=2),
    "PMCW, m-sequence": ss.Pmcw(**CODE, code_length=511),
    "PMCW, almost perfect": ss.Pmcw(**CODE, code="apas", code_length=504),
    "PMCW, Gold": ss.Pmcw(**CODE, code="gold", code_length=511, code_index=5),
    "PMCW, Zadoff-Chu": ss.Pmcw(**CODE, code="zadoff_chu", code_length=509),
    "PMCW, Golay pair": ss.Pmcw(**CODE | {"repetitions": 21}, code="golay", code_length=512, prefix_chips=512),
}
SHOWN = ("FMCW", "stepped FMCW, 4 x 75 MHz", "OFDM", "PMCW, m-sequence", "PMCW, Gold", "PMCW, Golay pair")
ONE = ((0.0, 0.0, 0.0),)
SPEEDS = (5.0, 20.0)
"""Of the tolerance of Doppler [m/s]."""


def radar_of(waveform, **fields) -> ss.RadarSpec:
    array = ss.AntennaArray(tx_positions=ONE, rx_positions=ONE, **fields)
    return ss.RadarSpec(waveform=waveform, array=array)


def symbol_time(waveform) -> float:
    """Return how long a chirp's samples are averaged at fixed tones [s]; 0 for ramps."""
    if waveform.kind not in ("ofdm", "pmcw"):
        return 0.0
    return getattr(waveform, "repetitions", 1) * waveform.num_samples / waveform.sample_rate


def point_map(radar, distance, speed, fine=1, rng=None):
    """Return the map of a point, and the power received of it [W]."""
    paths = ss.point_targets([[distance, 0.0, 0.0]], [[speed, 0.0, 0.0]], 1.0, radar, Pose())
    cube = ss.virtual_cube(ss.synthesize(paths, radar, rng), radar)
    bins = {"num_range_bins": fine * radar.num_range_bins, "num_doppler_bins": fine * radar.num_doppler_bins}
    power = abs(paths.a[0, 0, 0]) ** 2 * 1e-3 * 10 ** (radar.front_end.tx_power_dbm / 10.0)
    return ss.range_doppler(cube, radar, "rect", **bins), power


def decibels(value: float) -> float:
    return 10.0 * np.log10(value)


def gain(waveform) -> tuple[float, float]:
    """Return the gain of signal over noise, measured and as theory has it [dB]."""
    radar, rng = radar_of(waveform, pattern=IsotropicPattern()), np.random.default_rng(0)
    place_of_point = 64 * radar.range_resolution
    clean, power = point_map(radar, place_of_point, 0.0)
    noise = []
    for _ in range(4):
        noisy, _ = point_map(radar, place_of_point, 0.0, rng=rng)
        noise.append(np.mean(np.abs(noisy.data - clean.data) ** 2))
    before = sample_noise_power(radar) * getattr(waveform, "repetitions", 1)  # of a sample of the converter
    measured = clean.power.max() / np.mean(noise) / (power / before)
    samples = radar.num_samples * radar.num_chirps * getattr(waveform, "repetitions", 1)
    return decibels(measured), decibels(samples)


def migration(waveform, radar, speed: float) -> float:
    """Return the mean of the phasor that range migration leaves, over the frame's frequencies and times."""
    count = 400
    frequency = (np.arange(count) + 0.5) / count - 0.5
    turns = 2.0 * speed / SPEED_OF_LIGHT * radar.sampled_bandwidth * radar.slow_interval * radar.num_doppler_bins
    return float(np.abs(np.exp(2j * np.pi * turns * np.outer(frequency, frequency)).mean()))


def doppler_loss(waveform, speed: float) -> tuple[float, float]:
    """Return what a moving point loses of its power, measured and as theory has it [dB]; nan where it is ambiguous."""
    radar = radar_of(waveform, pattern=IsotropicPattern())
    if abs(speed) > radar.unambiguous_velocity:
        return np.nan, np.nan
    rd, power = point_map(radar, 120.0, speed, fine=8)
    kept = np.sinc(2.0 * speed / radar.wavelength * symbol_time(waveform)) * migration(waveform, radar, speed)
    return decibels(rd.power.max() / power), 2.0 * decibels(abs(kept))


def sidelobe(waveform) -> tuple[float, float]:
    """Return the highest range sidelobe of a point at rest, measured and as theory has it [dB]; -inf: none."""
    radar = radar_of(waveform, pattern=IsotropicPattern())
    coded = waveform.kind == "pmcw"
    fine = 1 if coded else 16
    bins = {"num_range_bins": fine * radar.num_range_bins}
    paths = ss.point_targets([[64 * radar.range_resolution, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 1.0, radar, Pose())
    rd = ss.range_doppler(ss.virtual_cube(ss.synthesize(paths, radar), radar), radar, "rect", **bins)
    power = rd.power[radar.num_doppler_bins // 2]
    shifted = np.roll(power, -int(power.argmax()))
    half = shifted[fine : len(shifted) // 2 - 1]  # beyond the first zero, up to half the range
    if waveform.kind == "pc_fmcw":
        return decibels(half.max() / shifted[0]), sidelobe_of_code(waveform)
    if not coded:
        return decibels(half.max() / shifted[0]), -13.26
    chips = waveform.chips
    correlation = np.abs(sum(np.fft.ifft(np.abs(np.fft.fft(code)) ** 2) for code in chips)) / len(chips)
    worst = correlation[1 : len(correlation) // 2 - 1].max() / correlation[0]
    return decibels(half.max() / shifted[0]), 2.0 * decibels(worst) if worst > 1e-9 else -np.inf


def sidelobe_of_code(waveform) -> float:
    """Return the highest sidelobe of ramps weighted with the power of their code, dispersed by the receiver [dB]."""
    order = np.fft.fftfreq(waveform.code_length, 1.0 / waveform.code_length)
    lines = np.zeros(waveform.num_samples, dtype=complex)
    dispersed = np.exp(-1j * np.pi * (order / waveform.ramp_time) ** 2 / waveform.chirp_slope)
    lines[order.astype(int)] = np.fft.fft(waveform.chips) * dispersed
    power = np.abs(np.fft.ifft(lines)) ** 2
    response = np.abs(np.fft.fft(power, 16 * len(power)))[: 8 * len(power)]
    return 2.0 * decibels(response[16:].max() / response[0])


def speeds(count: int) -> None:
    """Print the seconds of one pair by transforms, and by the plain sum of few paths, scaled by their number."""
    print(f"\n| Waveform | {count} paths within 30 m/s, transforms | plain sum, scaled | times |\n|---|---|---|---|")
    rng, few = np.random.default_rng(1), 4
    distance, azimuth = rng.uniform(3.0, 240.0, count), rng.uniform(-1.0, 1.0, count)
    rays = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(count)], axis=1)
    for name, waveform in WAVEFORMS.items():
        radar = radar_of(waveform)
        velocity = rng.uniform(-30.0, 30.0, count)[:, None] * rays
        paths = ss.point_targets(distance[:, None] * rays, velocity, 1e-3 * distance**4, radar, Pose())
        seconds = []
        for chosen, method in ((paths, "nufft"), (paths.select(np.arange(few)), "direct")):
            used = radar if method == "nufft" else radar.with_(waveform=waveform.chirps(0, 8))
            started = time.process_time()
            ss.synthesize(chosen, used, method=method)
            seconds.append(time.process_time() - started)
        plain = seconds[1] * count / few * CHIRPS / 8
        print(f"| {name} | {seconds[0]:.2f} s | {plain:.0f} s | {plain / seconds[0]:.0f} |", flush=True)


def draw(path: Path) -> None:
    """Draw one street as each waveform sees it."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from PIL import Image

    state, _, pose, twist = place("urban_crossing")
    colours = plt.get_cmap("viridis", 14)  # steps of 4 dB keep the file small
    figure, axes = plt.subplots(2, 3, figsize=(11, 6.2), sharex=True, sharey=True, layout="constrained")
    for axis, name in zip(axes.flat, SHOWN, strict=True):
        radar = radar_of(WAVEFORMS[name])
        paths = ss.solve_paths(state, radar, Mount(pose, twist), "raycast", num_rays=100_000, max_distance=120.0)
        adc = ss.synthesize(paths, radar, rng=np.random.default_rng(0))
        window = "rect" if name.startswith("PMCW") else "hann"
        rd = ss.range_doppler(ss.virtual_cube(adc, radar), radar, window, doppler_window="hann")
        level = decibels(np.maximum(rd.power, 1e-30)) + 30.0
        axis.set_facecolor("black")
        image = axis.pcolormesh(rd.radial_velocity, rd.range, level.T, vmin=-130.0, vmax=-74.0, cmap=colours)
        axis.set(title=name, xlim=(-25.0, 25.0), ylim=(0.0, 100.0))
    for axis in axes[:, 0]:
        axis.set_ylabel("range [m]")
    for axis in axes[1]:
        axis.set_xlabel("radial velocity [m/s]")
    figure.colorbar(image, ax=axes, label="power [dBm]")
    figure.savefig(path, dpi=70, pil_kwargs={"optimize": True})
    Image.open(path).convert("P", palette=Image.Palette.ADAPTIVE, colors=64).save(path, optimize=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--paths", type=int, default=20_000, help="of the measured synthesis")
    parser.add_argument("--no-speed", action="store_true", help="leave the synthesis' times out")
    parser.add_argument("--figure", type=Path, help="draw the street into this file, and stop")
    options = parser.parse_args()
    warnings.simplefilter("ignore", ss.ScarlWarning)
    if options.figure is not None:
        draw(options.figure)
        return
    print(machine())
    print("\nMeasured (theory) [dB]:\n")
    columns = " | ".join(f"loss at {speed:g} m/s" for speed in SPEEDS)
    print(f"| Waveform | range bin | velocity within | gain | {columns} | highest sidelobe |")
    print("|---|---|---|---|" + "---|" * len(SPEEDS) + "---|")
    for name, waveform in WAVEFORMS.items():
        radar = radar_of(waveform)
        pairs = [gain(waveform), *(doppler_loss(waveform, speed) for speed in SPEEDS), sidelobe(waveform)]
        values = " | ".join(f"{found:.2f} ({theory:.2f})" for found, theory in pairs)
        print(
            f"| {name} | {radar.range_resolution:.3f} m | {radar.unambiguous_velocity:.1f} m/s | {values} |", flush=True
        )
    if not options.no_speed:
        speeds(options.paths)


if __name__ == "__main__":
    main()
