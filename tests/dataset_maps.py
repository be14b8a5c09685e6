"""Tensors as published datasets have them, of a point from its closed form; no reader of this project is in sight."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.io

from tests.dataset_captures import Point

RANGE_BIN, VELOCITY_BIN, ANTENNAS = 0.1953125, 0.41968030701528203, 8


def rad_beat(point: Point, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    """Return (256 samples, 8 antennas, 64 chirps): places grow to the right, an approaching phase rises over chirps."""
    n, j, m = np.ogrid[:256, :8, :64]
    across = 0.5 * 77.0 / 76.8 * np.sin(np.radians(point.azimuth))
    cycles = point.range / RANGE_BIN * n / 256 - point.velocity / VELOCITY_BIN * m / 64 + across * j
    rng = np.random.default_rng(seed)
    return np.exp(2j * np.pi * cycles) + noise * (rng.normal(size=(256, 8, 64, 2)) @ np.array([1.0, 1j]))


def rad_tensor(beat: np.ndarray) -> np.ndarray:
    """Return CARRADA's tensor: transforms over range, Doppler and azimuth, turned by 180 degrees."""
    windows = np.hanning(258)[1:-1, None, None] * np.hanning(66)[1:-1]
    over = np.fft.fft(np.fft.fft(beat * windows, axis=0), axis=2)
    over = np.fft.fftshift(np.fft.fft(np.fft.fftshift(over, axes=2), 256, axis=1), axes=1)
    return np.rot90(over, 2).astype(np.complex64)


KRADAR_RANGE, KRADAR_DOPPLER = np.arange(24) * 0.46, np.arange(-8, 8) * 0.12
KRADAR_AZIMUTH, KRADAR_ELEVATION = np.arange(-20, 21, dtype=np.int16), np.arange(-9, 10, 3, dtype=np.int16)


def kradar_tensor(point: Point) -> np.ndarray:
    """Return power over Doppler, range, elevation (down), azimuth (to the right)."""
    out = np.ones((16, 24, 7, 41))
    place = (
        np.argmin(np.abs(KRADAR_DOPPLER - point.velocity)),
        np.argmin(np.abs(KRADAR_RANGE - point.range)),
        np.argmin(np.abs(KRADAR_ELEVATION + point.elevation)),
        np.argmin(np.abs(KRADAR_AZIMUTH + point.azimuth)),
    )
    out[place] = 1e4
    return out


def write_kradar(folder: Path, tensors: list[np.ndarray], packed: bool = True) -> None:
    """Write a sequence with its axes beside it, by SciPy."""
    (folder / "radar_tesseract").mkdir()
    for k, tensor in enumerate(tensors):
        path = folder / "radar_tesseract" / f"tesseract_{k + 30:05d}.mat"
        scipy.io.savemat(path, {"arrDREA": tensor, "note": "text"}, do_compression=packed)
    axes = {"arrRange": KRADAR_RANGE, "arrAzimuth": KRADAR_AZIMUTH, "arrElevation": KRADAR_ELEVATION}
    scipy.io.savemat(folder / "info_arr.mat", axes)
    scipy.io.savemat(folder / "arr_doppler.mat", {"arr_doppler": KRADAR_DOPPLER})
