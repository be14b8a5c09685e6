"""Recordings of a real radar, read and processed by this project, beside the same radar simulated.

python benchmarks/validation/captures.py FOLDER [--figure docs/figures/captures.png]
python benchmarks/validation/captures.py FOLDER --fit "new data"         the preset's `Adc.response`

FOLDER: ``pipe-no-vibration-1000-1-256-1`` of the public project OnurhanTALAN/mmwave-signal-processing, five recordings
of an AWR1642 with mmWave Studio's logs (4 MB each; none of them is in this repository). The preset `awr1642` was fitted
to three other recordings of that project, of another day, in its folder ``new data``.
"""

from __future__ import annotations

import argparse
import functools
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import scarl_sionna as ss
from benchmarks.validation.rows import Row, run
from scarl_sionna.core.pose import Pose

SOURCE = "awr1642_held_out"
NUM = 5
"""Recordings."""
BINS = (0, 5, 20, 60, 120, 200)
"""Range bins at which the noise floor is compared."""
TARGET_BINS = slice(5, 40)
"""Where the target is looked for: behind the leakage, in the room."""


FITTED = ("pipe", "phone", "vantilator")
"""Recordings of ``new data`` that the preset is fitted to, each without vibration."""
KNOTS = (0, 2, 5, 10, 15, 20, 25, *range(28, 229, 4), 232, 235, 238, 240, 242, 244, 246, 248, 250, 253)
"""Range bins between which the response of the converter is linear, in decibels; the pass band ripples every 16."""


class Look(NamedTuple):
    """What a burst of chirps of the radar at rest shows, of each channel.

    Attributes
    ----------
    power : ndarray, shape (num_rx, num_samples)
        Of the mean over the chirps, in squared steps of the converter, under a Hann window.
    floor : ndarray, shape (num_samples,)
        Noise, from differences of chirps that follow each other, mean of the channels.
    target : int
        Strongest bin behind the leakage.
    phase : ndarray, shape (num_rx,)
        Of the target from chirp to chirp, from such differences [rad].
    """

    power: npt.NDArray[np.float64]
    floor: npt.NDArray[np.float64]
    target: int
    phase: npt.NDArray[np.float64]

    @property
    def thermal(self) -> npt.NDArray[np.float64]:
        """Phase that the noise alone would give [rad], shape (num_rx,)."""
        return np.sqrt(0.5 * self.floor[self.target] / self.power[:, self.target])


def look(adc: npt.NDArray[np.complex128]) -> Look:
    """Return what chirps show, shape (num_rx, num_chirps, num_samples)."""
    window = np.hanning(adc.shape[-1])
    spectra = np.fft.fft(adc * window / window.sum(), axis=-1)
    mean = spectra.mean(axis=1)
    floor = 0.5 * (np.abs(np.diff(spectra, axis=1)) ** 2).mean(axis=(0, 1))
    power = np.abs(mean) ** 2
    target = int(power.mean(axis=0)[TARGET_BINS].argmax()) + TARGET_BINS.start
    turned = np.angle(spectra[..., target] * mean[:, target].conj()[:, None])
    return Look(power, floor, target, np.diff(turned, axis=1).std(axis=1) / np.sqrt(2.0))


def recorded(folder: Path) -> tuple[ss.RadarSpec, list[Look]]:
    """Return the radar that the logs describe, and what each recording shows."""
    found = []
    for number in range(NUM):
        files = folder / f"adc_data_{number}.bin", folder / f"LogFile_{number}.txt"
        burst = ss.read_capture(files[0], "dca1000", config=files[1]).burst()
        codes = burst[0].adc_int.astype(np.float64)
        found.append(look(codes[..., 0] + 1j * codes[..., 1]))
    return burst.radar, found


def preset_like(like: ss.RadarSpec) -> ss.RadarSpec:
    """Return the preset with one transmitter and the chirps of the recordings."""
    fields = ("num_chirps", "idle_time", "ramp_time", "bandwidth", "adc_start_time", "sampling_frequency")
    chirps = {name: getattr(like.waveform, name) for name in fields}
    return ss.RadarSpec.preset("awr1642").with_(tx_positions=((0.0, 0.0, 0.0),), **chirps)


def simulated(like: ss.RadarSpec, seen: Sequence[Look]) -> list[Look]:
    """Return the same bursts by the preset: a point where the target stands, as strong as it was."""
    radar = preset_like(like)
    found, rcs = [], 1.0
    for number, one in enumerate(seen):
        for _ in range(2):  # the level is linear in the cross-section: the second time it is the recorded one
            where = [[one.target * radar.range_resolution, 0.0, 0.0]]
            paths = ss.point_targets(where, [[0.0, 0.0, 0.0]], rcs, radar, Pose())
            rng = np.random.default_rng(number)
            codes = ss.quantize(ss.synthesize(paths, radar, rng), radar, rng)[0].astype(np.float64)
            this = look(codes[..., 0] + 1j * codes[..., 1])
            rcs *= float(one.power[:, one.target].mean() / this.power[:, one.target].mean())
        found.append(this)
    return found


def response(like: ss.RadarSpec, log: Path, folder: Path, bursts: int = 8) -> list[tuple[int, float]]:
    """Return the preset's `Adc.response` by range bin [dB]: noise floors of the three recordings, by least squares.

    Their own log is of other chirps: `log` is that of a later recording, of as many samples as fast. The median of the
    three, since the phone moved; 0 dB in the mean of bins 100 to 200, whose level full scale makes.
    """
    floors = []
    for name in FITTED:
        file = folder / f"{name}-no-vibration-256adc-1chirp-1000frames-1ms.bin"
        codes = ss.read_capture(file, "dca1000", config=log).burst()[0].adc_int.astype(np.float64)
        floors.append(look(codes[..., 0] + 1j * codes[..., 1]).floor)
    silent = ss.point_targets([[2.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 1e-6, preset_like(like), Pose())
    count = like.num_samples
    basis = np.stack([np.interp(np.arange(count), KNOTS, row, period=count) for row in np.eye(len(KNOTS))], axis=1)
    gain = np.zeros(len(KNOTS))
    for _ in range(3):  # the window smears notches, so one step does not reach them
        points = tuple((knot / count, float(value)) for knot, value in zip(KNOTS, gain, strict=True))
        radar, made = preset_like(like).with_(response=points), []
        for number in range(bursts):
            rng = np.random.default_rng(number)
            codes = ss.quantize(ss.synthesize(silent, radar, rng), radar, rng)[0].astype(np.float64)
            made.append(look(codes[..., 0] + 1j * codes[..., 1]).floor)
        missing = np.median(decibels(np.array(floors) / np.mean(made, axis=0)), axis=0)
        level = missing[100:200].mean()
        gain = gain + np.linalg.lstsq(basis, missing - level, rcond=None)[0]
    print(f"level of bins 100 to 200 over the preset's: {level:.2f} dB")
    return [(knot, round(float(value), 1)) for knot, value in zip(KNOTS, gain, strict=True)]


def decibels(power: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return a power in decibels."""
    return np.asarray(10.0 * np.log10(power))


def figures(one: Look) -> dict[str, float]:
    """Return the figures that are compared, by the names of their rows."""
    floor = decibels(np.convolve(np.pad(one.floor, 1, "wrap"), np.ones(3) / 3, "valid")).tolist()
    image = -one.target % one.power.shape[1]
    return {
        "rise": floor[60] - floor[0],
        "fall": floor[20] - floor[120],
        "far": floor[60] - floor[200],
        "edge": floor[200] - floor[240],
        "noise": float(np.sqrt(one.floor[100:200].mean() * len(one.floor) / 1.5)),
        "leakage": float(decibels(one.power[:, :4].max(axis=1).mean() / one.floor[100:200].mean())),
        "channels": float(np.ptp(decibels(one.power[:, one.target]))),
        "image": float(decibels(one.power[:, image].mean() / one.power[:, one.target].mean())),
        "phase": float((one.phase / one.thermal).mean()),
    }


WHAT = {
    "rise": ("noise floor of bin 60 over bin 0", "dB"),
    "fall": ("noise floor of bin 20 over bin 120", "dB"),
    "far": ("noise floor of bin 60 over bin 200", "dB"),
    "edge": ("noise floor of bin 200 over bin 240, the notch below zero", "dB"),
    "noise": ("noise of a sample, bins 100 to 200", "LSB"),
    "leakage": ("strongest of bins 0 to 3 over the floor of bins 100 to 200", "dB"),
    "channels": ("levels of the channels at the target, peak to peak", "dB"),
    "image": ("bin of the image over the target", "dB"),
    "phase": ("phase from chirp to chirp over what the noise gives", "1"),
}
"""Quantity and unit of each row."""
WHY = {
    "channels": "1.8 to 4.3 dB among five recordings of one device, 0.8 to 2.1 among the three fitted to: echoes of "
    "the room in the target's cell, not gains of channels, which stay",
    "phase": "1 % and more above the noise in the recordings: something moves or drifts by a tenth of a milliradian, "
    "0.03 um",
}
"""Causes of rows outside, by their names."""


def rows(folder: Path) -> list[Row]:
    """Return all rows of the theme."""
    like, seen = recorded(folder)
    there = [figures(one) for one in seen]
    here = [figures(one) for one in simulated(like, seen)]
    found = []
    for name, (what, unit) in WHAT.items():
        levels, ours = [one[name] for one in there], float(np.mean([one[name] for one in here]))
        low, high = min(levels), max(levels)
        print(name, np.round(levels, 2), np.round([one[name] for one in here], 2))
        found.append(
            Row(
                f"capture_{name}",
                f"AWR1642, recorded: {what}",
                SOURCE,
                unit,
                None if name == "image" else round(low, 2),
                round(high, 2),
                "between",
                "bound" if name == "image" else "held out",
                round(ours, 2),
                "five recordings of a pipe at 2.1 m, preset `awr1642` with a point as strong as it, mean of five",
                WHY.get(name, ""),
            )
        )
    return found


def draw(folder: Path, path: Path) -> None:
    """Draw spectra and noise floors, recorded and simulated."""
    from matplotlib.figure import Figure

    like, seen = recorded(folder)
    made = simulated(like, seen)
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    distance = np.arange(like.num_samples) * like.range_resolution
    for number, (there, here) in enumerate(zip(seen, made, strict=True)):
        for one, color, label in ((there, "C3", "recorded, five times"), (here, "C0", "simulated")):
            text = label if number == 0 else None
            left.plot(distance, decibels(one.power.mean(axis=0)), color=color, lw=0.7, label=text)
            right.plot(distance, decibels(one.floor), color=color, lw=0.7, label=text)
    left.set(title="mean over the chirps", xlabel="range [m]", ylabel="power [dB over one step squared]")
    right.set(title="from chirp to chirp", xlabel="range [m]")
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    figure.savefig(path, dpi=64)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--fit", type=Path, metavar="FOLDER", help="print the preset's response, nothing else")
    arguments = parser.parse_args()
    if arguments.fit is not None:
        print(response(recorded(arguments.folder)[0], arguments.folder / "LogFile_0.txt", arguments.fit))
        return
    run("captures", functools.partial(rows, arguments.folder))
    if arguments.figure is not None:
        draw(arguments.folder, arguments.figure)


if __name__ == "__main__":
    main()
