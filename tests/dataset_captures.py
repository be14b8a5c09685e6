"""Recordings as published datasets have them: a point from its closed form, files value by value from documents.

No reader of this project is in sight; the signs of angles are those of each dataset's own documents.
"""

from __future__ import annotations

import copy
import json
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.ti_captures import PROFILE, studio

C = 299_792_458.0


@dataclass(frozen=True)
class Point:
    """Range [m], opening velocity [m/s], azimuth (left) and elevation (up) [deg]."""

    range: float
    velocity: float
    azimuth: float
    elevation: float = 0.0

    @property
    def sines(self) -> np.ndarray:
        """Of the direction along left and up."""
        azimuth, elevation = np.radians(self.azimuth), np.radians(self.elevation)
        return np.array([np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


@dataclass(frozen=True)
class Ramps:
    """Ramps of equal slope that transmitters send in turns; SI units."""

    start: float
    slope: float
    idle: float
    adc_start: float
    ramp: float
    samples: int
    rate: float
    loops: int


def beat(point: Point, ramps: Ramps, tx: np.ndarray, rx: np.ndarray, turn: list[int]) -> np.ndarray:
    """Return the beat signal, shape (num_tx, num_rx, loops, samples): phase 2 pi f times the delay.

    `tx` and `rx` are places (n, 2) in metres along left and up: the way to a place that is nearer is shorter. `turn`
    has the turn of each transmitter in a loop.
    """
    fast = np.arange(ramps.samples) / ramps.rate
    out = np.empty((len(tx), len(rx), ramps.loops, ramps.samples), dtype=complex)
    frequency = ramps.start + ramps.slope * (ramps.adc_start + fast)
    for i, j, m in np.ndindex(len(tx), len(rx), ramps.loops):
        time = (m * len(tx) + turn[i]) * (ramps.idle + ramps.ramp) + fast
        way = 2.0 * (point.range + point.velocity * time) - (tx[i] + rx[j]) @ point.sines
        out[i, j, m] = np.exp(2j * np.pi * frequency * way / C)
    return out


def codes(signal: np.ndarray, seed: int, amplitude: float = 2000.0) -> np.ndarray:
    """Return a signal with noise as whole numbers, a last axis for I and Q."""
    noise = np.random.default_rng(seed).normal(0.0, amplitude / 20.0, (*signal.shape, 2))
    return np.rint(amplitude * np.stack([signal.real, signal.imag], -1) + noise).astype(np.int16)


def write_values(path: Path, values: np.ndarray, place: np.ndarray) -> None:
    """Append I and Q (..., 2) to a file, each pair at its place (...) in it."""
    out = np.empty((values[..., 0].size, 2), dtype="<i2")
    out[place.ravel()] = values.reshape(-1, 2)
    with path.open("ab") as file:
        file.write(out.tobytes())


# ColoRadar

CASCADE_AZIMUTH = (
    (11, 10, 9, 32, 28, 24, 20, 16, 12, 8, 4, 0),
    (*range(11, 15), *range(50, 54), *range(46, 50), *range(4)),
)
CASCADE_ELEVATION = ((6, 4, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0), (0,) * 16)
SINGLE_AZIMUTH = ((0, 2, 4), (0, 1, 2, 3))
SINGLE_ELEVATION = ((0, 1, 0), (0, 0, 0, 0))
GRIDS = {"single_chip": (SINGLE_AZIMUTH, SINGLE_ELEVATION), "cascade": (CASCADE_AZIMUTH, CASCADE_ELEVATION)}
DESIGN = 76.8e9
COLORADAR = Ramps(77e9, 30e12, 10e-6, 5e-6, 40e-6, 64, 2e6, 16)


def coloradar_places(device: str) -> tuple[np.ndarray, np.ndarray]:
    """Return places of transmitters and receivers [m, left and up]: indices grow to the right and downwards."""
    azimuth, elevation = GRIDS[device]
    half = C / DESIGN / 2.0
    tx, rx = (-half * np.array([azimuth[k], elevation[k]], dtype=float).T for k in range(2))
    return tx, rx


def write_coloradar(folder: Path, device: str, frames: list[np.ndarray], ramps: Ramps = COLORADAR) -> Path:
    """Write a run and, beside it, the calibration; frames are (num_tx, num_rx, chirps, samples, 2)."""
    calib = folder / "calib" / device
    calib.mkdir(parents=True)
    azimuth, elevation = GRIDS[device]
    lines = ["# antennas", f"num_rx {len(azimuth[1])}", f"num_tx {len(azimuth[0])}", f"F_design {DESIGN / 1e9:g}"]
    for name, which in (("rx", 1), ("tx", 0)):
        for k, (a, e) in enumerate(zip(azimuth[which], elevation[which], strict=True)):
            lines.append(f"{name} {k} {a} {e}")
    (calib / "antenna_cfg.txt").write_text("\n".join(lines) + "\n")
    (calib / "waveform_cfg.txt").write_text(
        f"# waveform\nnum_rx {len(azimuth[1])}\nnum_tx {len(azimuth[0])}\n"
        f"num_adc_samples_per_chirp {ramps.samples}\nnum_chirps_per_frame {ramps.loops}\n"
        f"adc_sample_frequency {ramps.rate:f}\nstart_frequency {ramps.start:f}\nidle_time {ramps.idle:.9f}\n"
        f"adc_start_time {ramps.adc_start:.9f}\nramp_end_time {ramps.ramp:.9f}\nfrequency_slope {ramps.slope:f}\n"
    )
    run = folder / "run0"
    place = run / device / "adc_samples"
    (place / "data").mkdir(parents=True)
    (place / "timestamps.txt").write_text("".join(f"{1614000000.0 + 0.1 * k:.9f}\n" for k in range(len(frames))))
    for k, frame in enumerate(frames):
        tx, rx, chirp, sample = np.indices(frame.shape[:-1])
        n_rx, n_chirp, n_sample = frame.shape[1:4]
        order = sample + n_sample * (chirp + n_chirp * (rx + n_rx * tx))
        write_values(place / "data" / f"frame_{k}.bin", frame, order)
    return run


def write_coloradar_phases(folder: Path, bins: np.ndarray, amplitudes: np.ndarray, ramps: Ramps = COLORADAR) -> None:
    """Write the cascade's ``phase_frequency_calib.txt``, measured with half the slope and twice the rate."""
    parts = np.stack([amplitudes.real, amplitudes.imag], -1).ravel()
    table = {
        "antennaCalib": {
            "numRx": 16,
            "numTx": 12,
            "frequencySlope": ramps.slope / 2.0,
            "samplingRate": 2.0 * ramps.rate,
            "frequencyCalibrationMatrix": bins.ravel().tolist(),
            "phaseCalibrationMatrix": parts.tolist(),
        }
    }
    (folder / "calib" / "cascade" / "phase_frequency_calib.txt").write_text(json.dumps(table))


# RaDelft

RADELFT = Ramps(
    PROFILE["start_ghz"] * 1e9,
    PROFILE["slope_mhz_us"] * 1e12,
    PROFILE["idle_us"] * 1e-6,
    PROFILE["adc_start_us"] * 1e-6,
    PROFILE["ramp_us"] * 1e-6,
    int(PROFILE["samples"]),
    PROFILE["rate_ksps"] * 1e3,
    8,
)


def radelft_places() -> tuple[np.ndarray, np.ndarray]:
    """Return places [m, left and up]: there, indices grow so (the lidar is flipped to match the cube)."""
    tx, rx = coloradar_places("cascade")
    return -tx, -rx


def write_radelft(folder: Path, frames: list[np.ndarray], turn: list[int], number: int = 0) -> None:
    """Write a recording of four chips; frames are (num_tx, 16, loops, samples, 2), `turn` the senders in order."""
    one = studio((0,), RADELFT.loops)
    chips = []
    for chip in range(4):
        other = copy.deepcopy(one["mmWaveDevices"][0])
        other["mmWaveDeviceId"] = chip
        other["rfConfig"]["rlChirps"] = [
            {
                "rlChirpCfg_t": {
                    "chirpStartIdx": k,
                    "chirpEndIdx": k,
                    "profileId": 0,
                    "txEnable": hex(1 << sender % 3 if sender // 3 == chip else 0),
                }
            }
            for k, sender in enumerate(turn)
        ]
        other["rfConfig"]["rlFrameCfg_t"]["chirpEndIdx"] = len(turn) - 1
        chips.append(other)
    one["mmWaveDevices"] = chips
    (folder / "radar.mmwave.json").write_text(json.dumps(one))
    for chip, name in enumerate(("master", "slave1", "slave2", "slave3")):
        for frame in frames:
            part = frame[turn, 4 * chip : 4 * chip + 4]  # transmitters in the order of their turns
            chirp, rx, loop, sample = np.indices(part.shape[:-1])
            order = rx + 4 * (sample + RADELFT.samples * (chirp + len(turn) * loop))
            write_values(folder / f"{name}_{number:04d}_data.bin", part, order)
        (folder / f"{name}_{number:04d}_idx.bin").write_bytes(struct.pack("<6I", 1, 2, 3, len(frames), 0, 0))


# RADIal

RADIAL_TX, RADIAL_RX, RADIAL_CHIRPS, RADIAL_SAMPLES = 12, 16, 256, 512


def radial_point(range_bin: float, doppler_bin: float, phases: np.ndarray) -> np.ndarray:
    """Return (16, 256, 512) of a point: `phases` (12, 16) of the pairs [rad]; sender k >= 1 is 16 (k + 4) bins up."""
    chirp, sample = np.arange(RADIAL_CHIRPS), np.arange(RADIAL_SAMPLES)
    tone = np.exp(2j * np.pi * range_bin * sample / RADIAL_SAMPLES)
    out = np.zeros((RADIAL_RX, RADIAL_CHIRPS, RADIAL_SAMPLES), dtype=complex)
    for k in range(RADIAL_TX):
        line = doppler_bin + (16 * (k + 4) if k else 0)
        slow = np.exp(2j * np.pi * line * chirp / RADIAL_CHIRPS)
        out += np.exp(1j * phases[k])[:, None, None] * slow[:, None] * tone
    return out


def write_radial(folder: Path, frames: list[np.ndarray], lost: tuple[int, str] | None = None) -> Path:
    """Write a sequence; frames are (16, 256, 512, 2). `lost` is a frame and a chip that the log lacks."""
    name = "RECORD@2020-11-22_12.28.47"
    place = folder / name
    place.mkdir()
    lines = ["timestamp: 99 - timeofissue: 100 - data_sample: 0 - sensor: camera - offset: 0 - datasize: 5"]
    offsets = dict.fromkeys(("radar_ch3", "radar_ch0", "radar_ch2", "radar_ch1"), 0)
    for k, frame in enumerate(frames):
        for later, chip in enumerate(offsets):
            first = 4 * {"radar_ch3": 0, "radar_ch0": 1, "radar_ch1": 2, "radar_ch2": 3}[chip]
            part = frame[first : first + 4]
            rx, chirp, sample = np.indices(part.shape[:-1])
            write_values(place / f"{name}_{chip}.bin", part, sample + RADIAL_SAMPLES * (rx + 4 * chirp))
            size = 2 * part.size
            if (k, chip) != lost:
                lines.append(
                    f"timestamp: {5_000_000 + 200_000 * k} - timeofissue: {7_000_000 + 200_000 * k} - "
                    f"data_sample: {4 * k + later} - sensor: {chip} - offset: {offsets[chip]} - datasize: {size}"
                )
            offsets[chip] += size
    (place / f"{name}_events_log.rec").write_text("\n".join(lines) + "\n")
    return place
