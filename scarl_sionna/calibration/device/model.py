"""Raw data of reflectors at rest as a function of what a device is, and of what each capture leaves open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.impairments import Mixer
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.link import path_amplitude
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis.phase import FrameGrid, beat_cycles, phasor
from scarl_sionna.signal.front_end.mixer import image_factors

from .capture import ReflectorCapture
from .filtering import filter_matrix
from .settings import DeviceFitSettings

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

OF_CAPTURE = ("x", "y", "z", "level_db", "phase_deg")
"""What each capture leaves open: where the reflector is beside the survey [m], its level beside what is expected [dB],
and its phase."""
PULLED = OF_CAPTURE[:4]
"""Of it, what is stated with a standard deviation."""
COUPLING = "_coupling_"
"""In the names of parameters of coupling: ``rx_coupling_i[0,1]`` and ``..._q[0,1]`` are the real and imaginary part."""
STEPS = {"m": 1e-6, "dB": 1e-3, "deg": 1e-2, "noise": 1e-2, "": 1e-3}
"""Steps of the central differences: errors of derivatives are below 1e-6 of them."""


@dataclass(frozen=True)
class Parameter:
    """A number that is fitted.

    Attributes
    ----------
    name : str
    unit : str
    std : float
        Before the captures are seen, in its unit; infinite where nothing is known.
    """

    name: str
    unit: str
    std: float = np.inf


class DeviceModel:
    """Mean raw data of every transmit-receive pair for reflectors at rest.

    Parameters
    ----------
    radar : RadarSpec
        What is stated of the device. Of its front end only power, noise and filters are used.
    captures : sequence of ReflectorCapture
    settings : DeviceFitSettings
    noise : float
        Amplitude of a sample's noise [sqrt(W)], the unit of the constant.
    device : list of Parameter, optional
        What is fitted; by default what the settings say and the captures can show.

    Notes
    -----
    By definition of the front end's order: echoes and leakage, coupling, gains and phases of the channels, image,
    filters, constant; see :mod:`scarl_sionna.signal.front_end.chain`.
    """

    def __init__(
        self,
        radar: RadarSpec,
        captures: Sequence[ReflectorCapture],
        settings: DeviceFitSettings,
        noise: float,
        device: list[Parameter] | None = None,
    ) -> None:
        self.radar, self.captures, self.settings, self.noise = radar, list(captures), settings, noise
        if all(item.empty is not None for item in captures):  # what does not move is subtracted
            settings = settings.with_(leakage=False, dc_offset=False)
        self.device = _device_parameters(radar, settings) if device is None else device
        self.places = np.array([np.asarray(item.position, dtype=np.float64) for item in captures])
        rcs = [10.0 ** (item.rcs_dbsm / 10.0) for item in captures]
        paths = point_targets(self.places, np.zeros_like(self.places), rcs, radar, Pose())
        self.amplitude = np.abs(path_amplitude(paths, radar))
        """Expected of each capture [sqrt(W)], shape (num_captures,)."""
        self._has_static = np.array([item.empty is None for item in captures])
        self._grid = FrameGrid(radar)
        self._filter = filter_matrix(radar)

    @property
    def phase_per_metre(self) -> float:
        """Phase of the middle of the band over a way [deg/m].

        Phases are fitted as they are in the middle of the band: there they do not depend on the length.
        """
        return 360.0 * self._grid.center_frequency / SPEED_OF_LIGHT

    @property
    def names(self) -> list[str]:
        """Names of the device's parameters."""
        return [item.name for item in self.device]

    @property
    def of_captures(self) -> list[list[Parameter]]:
        """What each capture leaves open."""
        return [
            [
                *(Parameter(axis, "m", item.position_std) for axis in "xyz"),
                Parameter("level_db", "dB", float(np.hypot(item.rcs_std_db, self.settings.pattern_std_db))),
                Parameter("phase_deg", "deg"),
            ]
            for item in self.captures
        ]

    @property
    def known(self) -> tuple[Array, Array]:
        """Standard deviations known beforehand, of the device (num_device,) and of captures (num_captures, 5)."""
        own = [[one.std for one in items] for items in self.of_captures]
        return np.array([item.std for item in self.device]), np.array(own)

    def pulls(self, device: Array, own: Array) -> tuple[Array, Array]:
        """Return how far a fit moves what was stated, over its stated standard deviation.

        Parameters
        ----------
        device : ndarray of float64, shape (num_device,)
        own : ndarray of float64, shape (num_captures, 5)

        Returns
        -------
        tuple of ndarray of float64, shapes (num_device,) and (num_captures, 5)
            NaN where nothing is known beforehand, or all.
        """
        pairs = zip((device, own), self.known, strict=True)
        device, own = (
            np.where(np.isfinite(std) & (std > 0.0), moved / np.where(std > 0.0, std, 1.0), np.nan)
            for moved, std in pairs
        )
        return device, own

    def index(self, name: str) -> int | None:
        """Return the place of a parameter of the device, or None if it is not fitted."""
        return self.names.index(name) if name in self.names else None

    @property
    def has_coupling(self) -> bool:
        """Whether coupling between antennas is fitted."""
        return any(COUPLING in name for name in self.names)

    def lengths(self, device: Array, own: Array) -> Array:
        """Return the length of every way, range bias included, shape (num_captures, num_tx, num_rx) [m].

        Parameters
        ----------
        device : ndarray of float64, shape (num_device,)
        own : ndarray of float64, shape (num_captures, 5)
        """
        there, back = self._ways(device, own)
        bias = 2.0 * self._value(device, "range_bias")
        return np.asarray(there[:, :, None] + back[:, None, :] + bias, dtype=np.float64)

    def _ways(self, device: Array, own: Array) -> tuple[Array, Array]:
        """Return the distances to the transmitters and receivers, shapes (num_captures, num_tx), (..., num_rx) [m]."""
        tx, rx = self.antennas(device)
        point = self.places + own[:, :3]
        return np.linalg.norm(point[:, None] - tx, axis=2), np.linalg.norm(point[:, None] - rx, axis=2)

    def antennas(self, device: Array) -> tuple[Array, Array]:
        """Return the places of transmitters and receivers, shapes (num_tx, 3) and (num_rx, 3) [m, radar frame]."""
        out = []
        for end, stated in (("tx", self.radar.tx_array), ("rx", self.radar.rx_array)):
            moved = np.array(stated)
            for number in range(len(moved)):
                for axis in (1, 2):
                    moved[number, axis] += self._value(device, f"{end}_{'xyz'[axis]}[{number}]")
            out.append(moved)
        return out[0], out[1]

    def tones(self, length: Array) -> Complex:
        """Return the beat signal of ways [m] of amplitude one, shape (..., num_samples), before the filters."""
        delay = np.asarray(length)[..., None] / SPEED_OF_LIGHT
        return phasor(beat_cycles(self.radar, delay, self._grid.ts_center + self._grid.x))

    def filtered(self, data: Complex) -> Complex:
        """Return what is behind the filters, shape (..., num_samples)."""
        return data if self._filter is None else np.asarray(data @ self._filter)

    def channels(self, device: Array) -> Complex:
        """Return the factor of every pair, shape (num_tx, num_rx), without the gain that all have."""
        ends = []
        for end, count in (("tx", self.radar.num_tx), ("rx", self.radar.num_rx)):
            gain = np.array([self._value(device, f"{end}_gain_db[{k}]") for k in range(count)])
            phase = np.array([self._value(device, f"{end}_phase_deg[{k}]") for k in range(count)])
            ends.append(10.0 ** (gain / 20.0) * np.exp(-1j * np.radians(phase)))  # a beat has the conjugate
        return np.asarray(np.outer(ends[0], ends[1]))

    def coupling(self, device: Array, end: str) -> Complex:
        """Return the coupling matrix of the antennas of an end, ``"tx"`` or ``"rx"``, ones on its diagonal.

        As :class:`~scarl_sionna.core.specs.radar.impairments.ChannelErrors` has it: of fields, dimensionless.
        """
        out = np.eye(self.radar.num_tx if end == "tx" else self.radar.num_rx, dtype=np.complex128)
        for row, column in zip(*np.nonzero(out == 0.0), strict=True):
            parts = (self._value(device, f"{end}_coupling_{part}[{row},{column}]") for part in "iq")
            out[row, column] = complex(*parts)
        return out

    def coupled(self, device: Array, data: Complex) -> Complex:
        """Return what the channels make of pairs alone (..., num_tx, num_rx, num_samples), same shape [sqrt(W)]."""
        if self.has_coupling:
            both = (self.coupling(device, end).conj() for end in ("tx", "rx"))  # a beat has the conjugate
            data = np.einsum("ik,lj,...ijn->...kln", *both, data, optimize=True)
        return np.asarray(data * self.channels(device)[:, :, None])

    def value(self, device: Array, own: Array) -> Complex:
        """Return the mean raw data [sqrt(W)], shape (num_captures, num_tx, num_rx, num_samples).

        Parameters
        ----------
        device : ndarray of float64, shape (num_device,)
            In the units of :attr:`device`.
        own : ndarray of float64, shape (num_captures, 5)
            `OF_CAPTURE`.
        """
        length = self.lengths(device, own)
        turn = own[:, 4] - self.phase_per_metre * length.mean(axis=(1, 2))
        level = 10.0 ** ((self._value(device, "gain_db") + own[:, 3]) / 20.0) * self.amplitude
        strength = level * np.exp(1j * np.radians(turn % 360.0))
        there, back = self._ways(device, own)
        nearer = np.linalg.norm(self.places + own[:, :3], axis=1)[:, None, None] ** 2 / (
            there[:, :, None] * back[:, None, :]
        )
        data = (strength[:, None, None] * nearer)[..., None] * self.tones(length)
        static = self._has_static[:, None, None, None]
        if self.index("leakage_length") is not None:
            way = self._value(device, "leakage_length")
            field = complex(self._value(device, "leakage_i"), self._value(device, "leakage_q")) * self.noise
            turn = np.exp(-1j * np.radians(self.phase_per_metre * way))
            data = data + static * (field * turn * self.tones(np.array(way)))
        data = self.coupled(device, data)
        if self.index("iq_gain_db") is not None:
            kept, image = image_factors(self.mixer(device))
            data = kept * data + image * np.conj(data)
        data = self.filtered(data)
        if self.index("dc_i") is not None:
            constant = complex(self._value(device, "dc_i"), self._value(device, "dc_q")) * self.noise
            data = data + static * constant
        return np.asarray(data)

    def mixer(self, device: Array) -> Mixer:
        """Return the imbalance of I and Q."""
        return Mixer(iq_gain_db=self._value(device, "iq_gain_db"), iq_phase_deg=self._value(device, "iq_phase_deg"))

    def slopes(self, device: Array, own: Array) -> tuple[Complex, Complex]:
        """Return the derivatives of the raw data by central differences.

        Returns
        -------
        ndarray of complex128, shape (num_device, num_captures, num_tx, num_rx, num_samples)
            To the device's parameters [sqrt(W) over their units].
        ndarray of complex128, shape (5, num_captures, num_tx, num_rx, num_samples)
            To the captures' own.
        """
        shared, each = [], []
        for number, item in enumerate(self.device):
            step = np.zeros(len(device))
            step[number] = STEPS[item.unit]
            shared.append((self.value(device + step, own) - self.value(device - step, own)) / (2.0 * step[number]))
        for number, item in enumerate(self.of_captures[0]):
            moved = np.zeros((1, len(OF_CAPTURE)))
            moved[0, number] = STEPS[item.unit]
            high, low = self.value(device, own + moved), self.value(device, own - moved)
            each.append((high - low) / (2.0 * moved[0, number]))
        return np.array(shared), np.array(each)

    def _value(self, device: Array, name: str) -> float:
        place = self.index(name)
        return 0.0 if place is None else float(device[place])


def _device_parameters(radar: RadarSpec, settings: DeviceFitSettings) -> list[Parameter]:
    out = [Parameter("gain_db", "dB"), Parameter("range_bias", "m")]
    for end, count in (("tx", radar.num_tx), ("rx", radar.num_rx)):
        for number in range(1, count):
            out += [Parameter(f"{end}_gain_db[{number}]", "dB"), Parameter(f"{end}_phase_deg[{number}]", "deg")]
        if settings.antenna_std > 0.0:
            names = [f"{end}_{axis}[{number}]" for number in range(count) for axis in "yz"]
            out += [Parameter(name, "m", settings.antenna_std) for name in names]
        if settings.coupling_std > 0.0:
            pairs = [(row, column) for row in range(count) for column in range(count) if row != column]
            names = [f"{end}{COUPLING}{part}[{row},{column}]" for row, column in pairs for part in "iq"]
            out += [Parameter(name, "", settings.coupling_std) for name in names]
    if settings.mixer:
        out += [Parameter("iq_gain_db", "dB"), Parameter("iq_phase_deg", "deg")]
    if settings.leakage:
        names_units = (("leakage_length", "m"), ("leakage_i", "noise"), ("leakage_q", "noise"))
        out += [Parameter(name, unit) for name, unit in names_units]
    if settings.dc_offset:
        out += [Parameter("dc_i", "noise"), Parameter("dc_q", "noise")]
    return out
