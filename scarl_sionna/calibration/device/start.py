"""Where searches begin: range bias from a grid, channels from the tones, leakage from what a search has left."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.calibration.errors import CalibrationError
from scarl_sionna.signal.windows import window_values

from .model import OF_CAPTURE, DeviceModel

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

GRID = 8
"""Points of a grid over a range cell."""
LEAST_SNR = 20.0
"""A reflector's echo over the noise, both summed over the pairs, below which it is not taken for one."""


def first_guess(model: DeviceModel, data: Complex, device: Array | None = None) -> tuple[Array, Array]:
    """Return a start for the device, shape (num_device,), and for what captures leave open, shape (num_captures, 5).

    Parameters
    ----------
    model : DeviceModel
    data : ndarray of complex128, shape (num_captures, num_tx, num_rx, num_samples)
        Mean raw data [sqrt(W)].
    device : ndarray of float64, shape (num_device,), optional
        Known already: the captures' part is looked for only. Otherwise the model has no leakage.

    Raises
    ------
    CalibrationError
        If a reflector does not stand out of the noise where it should be.
    """
    own = np.zeros((len(data), len(OF_CAPTURE)))
    if device is not None:
        seen = _amplitudes(model, data, device)
        own[:, 4] = np.degrees(np.angle(np.sum(np.conj(model.channels(device)) * seen, axis=(1, 2))))
        return device, own
    device = np.zeros(len(model.device))
    device[_place(model, "range_bias")] = _range_bias(model, data, device)
    own[:, 4] = _set_channels(model, _amplitudes(model, data, device), device)
    if model.index("dc_i") is not None:
        static = [number for number, item in enumerate(model.captures) if item.empty is None]
        constant = (data - model.value(device, own))[static].mean() / model.noise
        device[_place(model, "dc_i")], device[_place(model, "dc_q")] = constant.real, constant.imag
    return device, own


def _place(model: DeviceModel, name: str) -> int:
    place = model.index(name)
    assert place is not None
    return place


def _window(model: DeviceModel) -> Array:
    values = window_values("hann", model.radar.num_samples)
    return np.asarray(values / values.max())


def _cell(model: DeviceModel) -> float:
    """Return the length of a way, there and back, that is one cell [m]."""
    return 2.0 * model.radar.range_resolution


def _range_bias(model: DeviceModel, data: Complex, device: Array) -> float:
    """Return the bias on a grid at which the captures have most power where they should be [m]."""
    window, expected = _window(model), model.lengths(device, np.zeros((len(data), len(OF_CAPTURE)))).mean(axis=(1, 2))
    most = model.settings.max_range_bias
    bias = np.linspace(-most, most, 2 * int(np.ceil(GRID * 2.0 * most / _cell(model))) + 1)
    lengths = expected[:, None] + 2.0 * bias
    tones = window * model.filtered(model.tones(np.maximum(lengths, 0.0)))
    seen = np.abs(np.einsum("cbn,ctrn->cbtr", tones.conj(), window * data)) ** 2
    power = seen.sum(axis=(2, 3)) / np.maximum(np.sum(np.abs(tones) ** 2, axis=2), 1e-300)
    power[lengths < _cell(model)] = 0.0
    best = int(np.argmax(np.sum(power / np.maximum(power.max(axis=1, keepdims=True), 1e-300), axis=0)))
    pairs = model.radar.num_tx * model.radar.num_rx
    for number, item in enumerate(model.captures):
        noise = pairs * model.noise**2 * model.radar.num_tx / item.adc.shape[1]
        if power[number, best] < LEAST_SNR * noise:
            snr = 10.0 * np.log10(max(power[number, best], 1e-300) / noise)
            label = f"capture {number}" + (f" ({item.name})" if item.name else "")
            raise CalibrationError(
                f"{label}: the reflector at {expected[number] / 2.0:.3g} m is {snr:.1f} dB over the noise "
                f"(needed: {10.0 * np.log10(LEAST_SNR):.0f} dB); more chirps, a larger reflector, a nearer place, or a "
                f"larger max_range_bias than {most} m"
            )
    return float(bias[best])


def _amplitudes(model: DeviceModel, data: Complex, device: Array) -> Complex:
    """Return the amplitude of each capture and pair over the expected one, shape (num_captures, num_tx, num_rx)."""
    own = np.zeros((len(data), len(OF_CAPTURE)))
    unit = device.copy()
    for number, item in enumerate(model.device):
        if item.name.startswith(("gain", "tx_gain", "tx_phase", "rx_gain", "rx_phase", "iq", "dc", "leakage")):
            unit[number] = 0.0
    window = _window(model)
    tones = window * model.value(unit, own)
    strength = np.sum(tones.conj() * (window * data), axis=-1)
    return np.asarray(strength / np.sum(np.abs(tones) ** 2, axis=-1))


def _set_channels(model: DeviceModel, seen: Complex, device: Array) -> Array:
    """Set gains and phases of the channels from amplitudes; return the phases of the captures [deg]."""
    shape = np.asarray(seen[int(np.argmax(np.sum(np.abs(seen) ** 2, axis=(1, 2))))])
    for _ in range(4):
        turn = np.sum(shape.conj() * seen, axis=(1, 2)) / np.sum(np.abs(shape) ** 2)
        shape = np.einsum("c,ctr->tr", turn.conj(), seen) / np.sum(np.abs(turn) ** 2)
    left, size, right = np.linalg.svd(shape)
    ends = {"tx": left[:, 0] / left[0, 0], "rx": right[0] / right[0, 0]}
    for end, factors in ends.items():
        for number in range(1, len(factors)):
            device[_place(model, f"{end}_gain_db[{number}]")] = 20.0 * np.log10(max(abs(factors[number]), 1e-10))
            device[_place(model, f"{end}_phase_deg[{number}]")] = -np.degrees(np.angle(factors[number]))
    first = turn * size[0] * left[0, 0] * right[0, 0]
    device[_place(model, "gain_db")] = float(np.mean(20.0 * np.log10(np.maximum(np.abs(first), 1e-10))))
    return np.degrees(np.angle(first))


def add_leakage(model: DeviceModel, data: Complex, device: Array, own: Array) -> float:
    """Set the leakage that explains most of what is left, and the constant beside it.

    Parameters
    ----------
    model : DeviceModel
    data : ndarray of complex128, shape (num_captures, num_tx, num_rx, num_samples)
        Mean raw data [sqrt(W)].
    device : ndarray of float64, shape (num_device,)
        Changed in place: length, level and phase of the leakage, and the constant.
    own : ndarray of float64, shape (num_captures, 5)

    Returns
    -------
    float
        By how much it lowers the sum of squares over the mean noise.
    """
    device[_place(model, "leakage_i")] = device[_place(model, "leakage_q")] = 0.0
    static = [number for number, item in enumerate(model.captures) if item.empty is None]
    rest = (data - model.value(device, own))[static].mean(axis=0).ravel()
    pairs, constant = np.ones((model.radar.num_tx, model.radar.num_rx, 1)), np.ones((len(rest), 1), dtype=np.complex128)
    has_constant, step = model.index("dc_i") is not None, _cell(model) / (2.0 * GRID)
    before = best = float(np.linalg.norm(rest) ** 2)
    if has_constant:
        before = best = float(np.linalg.norm(rest - rest.mean()) ** 2)
    for length in np.arange(step / 4.0, model.settings.max_leakage_length + step, step):
        way = model.filtered(model.tones(np.array(length)))
        column = model.coupled(device, pairs * way).reshape(-1, 1)
        matrix = np.hstack([column, constant]) if has_constant else column
        solution = np.linalg.lstsq(matrix, rest, rcond=1e-9)[0]
        size = float(np.linalg.norm(rest - matrix @ solution) ** 2)
        if size < best:
            best = size
            field = solution[0] * np.exp(1j * np.radians(model.phase_per_metre * length)) / model.noise
            device[_place(model, "leakage_length")] = length
            device[_place(model, "leakage_i")], device[_place(model, "leakage_q")] = field.real, field.imag
            if has_constant:
                more = solution[1] / model.noise
                found = np.array([more.real, more.imag])
    if has_constant and best < before:
        device[_place(model, "dc_i")] += found[0]
        device[_place(model, "dc_q")] += found[1]
    looks = sum(model.captures[number].adc.shape[1] // model.radar.num_tx for number in static)
    return (before - best) / (model.noise**2 / looks)
