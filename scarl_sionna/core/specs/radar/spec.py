"""What a MIMO FMCW radar is: waveform, array, link budget, converter and field of view."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from scarl_sionna.core.errors import UnknownNameError
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import SPEED_OF_LIGHT

from .pattern import AntennaPattern, CosinePattern

Position = tuple[float, float, float]


def _uniform_line(count: int, spacing: float) -> tuple[Position, ...]:
    """Return `count` positions along y (left), centred [m]."""
    return tuple((0.0, float((index - (count - 1) / 2) * spacing), 0.0) for index in range(count))


_HALF_WAVE = SPEED_OF_LIGHT / 77e9 / 2.0


class RadarSpec(Spec):
    """A MIMO FMCW radar. Positions are in the radar frame: x boresight, y left, z up.

    The defaults are Table 1 of SCaRL. Amplitudes: the beat signal is in sqrt(W), so abs(sample)**2 is received power.
    Transmitters count before chirps: chirp m of transmitter i is row ``m * num_tx + i`` of the raw data. With multiplexing
    ``"ideal"`` (the paper's) all transmitters send at once and are told apart perfectly, so rows of one m share their time;
    with ``"tdm"`` they follow each other, one chirp interval apart.
    """

    start_frequency: float = Field(77e9, gt=0.0, description="carrier frequency at the start of the ramp [Hz]")
    bandwidth: float = Field(300e6, gt=0.0, description="swept over ramp_time [Hz]")
    ramp_time: float = Field(30e-6, gt=0.0, description="duration of a ramp [s]")
    idle_time: float = Field(8e-6, ge=0.0, description="pause between ramps [s]")
    num_chirps: int = Field(256, ge=1, description="chirps of each transmitter in a frame")
    num_samples: int = Field(512, ge=1, description="complex samples a chirp")
    sampling_frequency: float | None = Field(None, gt=0.0, description="[Hz]; None: num_samples / ramp_time")
    multiplexing: Literal["ideal", "tdm"] = "ideal"
    tx_positions: tuple[Position, ...] = Field(_uniform_line(3, 4 * _HALF_WAVE), min_length=1, description="[m]")
    rx_positions: tuple[Position, ...] = Field(_uniform_line(4, _HALF_WAVE), min_length=1, description="[m]")
    pattern: AntennaPattern = Field(
        CosinePattern(half_power_azimuth_deg=45.0, half_power_elevation_deg=15.0), description="of every antenna"
    )
    polarization: Literal["V", "H"] = "V"
    tx_power_dbm: float = Field(12.0, description="of each transmitter [dBm]")
    noise_figure_db: float = Field(12.0, ge=0.0, description="[dB]")
    source_temperature: float = Field(290.0, ge=0.0, description="noise temperature at the antenna [K]")
    adc_bits: int = Field(16, ge=2, le=16, description="bits of each of I and Q")
    adc_full_scale_dbm: float = Field(-30.0, description="input-referred power of a full-scale tone [dBm]")
    azimuth_fov_deg: float = Field(120.0, gt=0.0, le=180.0, description="full width that rays are sent over [deg]")
    elevation_fov_deg: float = Field(30.0, gt=0.0, le=180.0, description="full height that rays are sent over [deg]")
    max_array_extent: float = Field(
        1.0, gt=0.0, description="an antenna farther than this from the origin is refused [m]"
    )

    @model_validator(mode="after")
    def _check(self) -> RadarSpec:
        if self.sampling_frequency is not None and self.num_samples / self.sampling_frequency > self.ramp_time * (
            1 + 1e-9
        ):
            raise ValueError(
                f"num_samples / sampling_frequency <= ramp_time: {self.num_samples} samples at "
                f"{self.sampling_frequency / 1e6:g} MHz take {self.num_samples / self.sampling_frequency * 1e6:g} us, "
                f"the ramp {self.ramp_time * 1e6:g} us; take fewer samples or sample faster"
            )
        for name in ("tx_positions", "rx_positions"):
            for index, position in enumerate(getattr(self, name)):
                if np.linalg.norm(position) > self.max_array_extent:
                    raise ValueError(
                        f"{name}[{index}] = {position} m within {self.max_array_extent} m of the radar's origin; "
                        "positions are metres in the radar frame (raise max_array_extent for a larger array)"
                    )
        return self

    @classmethod
    def preset(cls, name: str) -> RadarSpec:
        """Return a named radar.

        ``"awr1843boost"``: Table 1 of SCaRL, an ideal 12-element virtual line in azimuth.
        ``"awr1843boost_3d"``: the board's own layout, Tx 2 raised by half a wavelength, with time multiplexing.
        """
        presets: dict[str, Callable[[], RadarSpec]] = {"awr1843boost": cls, "awr1843boost_3d": cls._board_layout}
        if name not in presets:
            raise UnknownNameError("radar preset", name, presets)
        return presets[name]()

    @classmethod
    def _board_layout(cls) -> RadarSpec:
        # TI AWR1843BOOST user's guide (SPRUIM4): Rx in a row at half a wavelength; Tx1 and Tx3 two wavelengths apart,
        # Tx2 between them and half a wavelength higher.
        half = _HALF_WAVE
        return cls(
            tx_positions=((0.0, -2 * half, 0.0), (0.0, 0.0, half), (0.0, 2 * half, 0.0)),
            rx_positions=_uniform_line(4, half),
            multiplexing="tdm",
        )

    @property
    def num_tx(self) -> int:
        """Number of transmit antennas."""
        return len(self.tx_positions)

    @property
    def num_rx(self) -> int:
        """Number of receive antennas."""
        return len(self.rx_positions)

    @property
    def num_virtual(self) -> int:
        """Number of transmit-receive pairs; pair (i, j) is channel ``i * num_rx + j``."""
        return self.num_tx * self.num_rx

    @property
    def num_chirps_total(self) -> int:
        """Rows of the raw data of one receiver: num_chirps * num_tx."""
        return self.num_chirps * self.num_tx

    @property
    def chirp_slope(self) -> float:
        """Frequency slope S [Hz/s]."""
        return self.bandwidth / self.ramp_time

    @property
    def sample_rate(self) -> float:
        """Complex sampling frequency [Hz]."""
        return self.sampling_frequency or self.num_samples / self.ramp_time

    @property
    def chirp_interval(self) -> float:
        """Time from ramp to ramp [s]."""
        return self.ramp_time + self.idle_time

    @property
    def doppler_interval(self) -> float:
        """Time between two chirps of the same transmitter [s]."""
        return self.chirp_interval * (self.num_tx if self.multiplexing == "tdm" else 1)

    @property
    def frame_time(self) -> float:
        """Time from the first ramp's start to the end of the last interval [s]."""
        return self.doppler_interval * self.num_chirps

    @property
    def wavelength(self) -> float:
        """Wavelength at the start frequency [m]: the one of the radar equation and of array spacings."""
        return SPEED_OF_LIGHT / self.start_frequency

    @property
    def center_frequency(self) -> float:
        """Frequency in the middle of the sampled ramp [Hz]: the one of Doppler and angle after a range transform."""
        return self.start_frequency + self.chirp_slope * (self.num_samples - 1) / (2.0 * self.sample_rate)

    @property
    def sampled_bandwidth(self) -> float:
        """Bandwidth that the samples cover [Hz]."""
        return self.chirp_slope * self.num_samples / self.sample_rate

    @property
    def range_resolution(self) -> float:
        """Width of a range bin without zero padding [m]."""
        return SPEED_OF_LIGHT / (2.0 * self.sampled_bandwidth)

    @property
    def max_range(self) -> float:
        """Unambiguous range of complex samples [m]."""
        return self.range_resolution * self.num_samples

    @property
    def unambiguous_velocity(self) -> float:
        """Radial velocities within +- this value are told apart [m/s]."""
        return SPEED_OF_LIGHT / self.center_frequency / (4.0 * self.doppler_interval)

    @property
    def velocity_resolution(self) -> float:
        """Width of a Doppler bin [m/s]."""
        return 2.0 * self.unambiguous_velocity / self.num_chirps

    @cached_property
    def tx_array(self) -> npt.NDArray[np.float64]:
        """Transmit positions, shape (num_tx, 3) [m, radar frame]."""
        return np.array(self.tx_positions, dtype=np.float64)

    @cached_property
    def rx_array(self) -> npt.NDArray[np.float64]:
        """Receive positions, shape (num_rx, 3) [m, radar frame]."""
        return np.array(self.rx_positions, dtype=np.float64)
