"""What a mechanically scanning radar is: its ramp, beam, turn, and what it puts out."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from scarl_sionna.core.errors import UnknownNameError
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import DecibelMilliwatts, Decibels, Degrees, Hertz

from ..antennas.fan import FanPattern
from ..array import AntennaArray
from ..front_end import FrontEnd
from ..pattern import AntennaPattern, TablePattern
from ..spec import RadarSpec
from ..waveform import Fmcw
from .presets import CELLS_A_RESOLUTION, PRESETS

Array = npt.NDArray[np.float64]
Window = Literal["rect", "hann", "hamming", "blackman", "blackmanharris", "chebyshev", "taylor"]

TWO_WAY_HALF_DB = 3.0
"""The beam's reach to here, two-way, is half of its width."""
_TABLE_STEP_DEG = 0.25
"""Of the table that stands for the beam's cut over elevation in all directions, which solvers choose by."""
_REACH_STEP_DEG = 0.05
"""Steps over azimuth in which the beam's peak and reach are looked for."""


class ScanningRadarSpec(Spec):
    r"""A radar with one narrow beam that turns about z, and an image over azimuth and range: power without velocity.

    At every azimuth it sends one ramp of linear frequency modulation and transforms it over range. Antenna `num` points
    to ``azimuth[num]`` of the sensor frame (x forward, y left, z up) in the middle of its samples. The beam goes on
    turning during a ramp. One antenna sends and receives, in the turn's axis.

    The defaults are those of the preset ``"cts350x"``.

    Raises
    ------
    ParameterRangeError
        If there is more than one ramp an azimuth, the ramps of a turn take longer than the turn, the front end has more
        than power and noise, more cells are asked for than there are, or the waveform is none of ramps.

    Notes
    -----
    A target at distance R with the radial velocity v (opening is positive) stands at

    .. math:: R + \frac{f_c}{S} v

    with the frequency :math:`f_c` in the middle of the samples and the slope S of the ramp, negative of one that falls,
    where R is that of this instant.

    References
    ----------
    .. [1] K. Burnett, A. P. Schoellig, T. D. Barfoot, "Do We Need to Compensate for Motion Distortion and Doppler
       Effects in Spinning Radar Navigation?", IEEE Robot. Autom. Lett. 6(2), 2021.

    Examples
    --------
    >>> radar = ScanningRadarSpec.preset("cir204h").with_(rotation_rate=2.0)
    """

    waveform: Fmcw = Field(PRESETS["cts350x"]["waveform"], description="one ramp, sent at every azimuth")
    alternating: bool = Field(False, description="every other azimuth the ramp goes the other way, for velocities")
    pattern: AntennaPattern = Field(FanPattern(cosecant_deg=25.0), description="of the antenna; x is its boresight")
    polarization: Literal["V", "H"] = Field("V", description="V along z, H along y at boresight")
    front_end: FrontEnd = Field(FrontEnd(tx_power_dbm=10.0, noise_figure_db=10.0), description="power and noise")
    rotation_rate: Hertz = Field(4.0, gt=0.0, le=100.0, description="turns a second [Hz]")
    num_azimuths: int = Field(400, ge=4, le=65_536, description="ramps a turn")
    rotation: Literal["clockwise", "counterclockwise"] = Field("clockwise", description="seen from above")
    start_azimuth_deg: Degrees = Field(
        0.0, ge=-360.0, le=360.0, description="of the first ramp, left positive, 0 is ahead [deg]"
    )
    window: Window = Field("hann", description="of the transform over range")
    cells_per_resolution: int = Field(
        CELLS_A_RESOLUTION, ge=1, le=16, description="range cells of the output a range resolution, by zero padding"
    )
    num_range_bins: int | None = Field(
        PRESETS["cts350x"]["num_range_bins"], ge=2, description="range cells of the output; None: all there are"
    )
    elevation_fov_deg: Degrees = Field(40.0, gt=0.0, le=180.0, description="full height that rays are sent over [deg]")
    image_floor_dbm: DecibelMilliwatts | None = Field(
        None, description="power of the image's code 0 [dBm]; None: 10 dB below the mean noise of a cell"
    )
    image_step_db: Decibels = Field(0.5, gt=0.0, le=20.0, description="from one code of the image to the next [dB]")
    encoder_counts: int = Field(5600, ge=4, le=65_536, description="counts of the angle encoder a turn")

    _derived = (("range_resolution", "m"), ("range_bin", "m"), ("max_range", "m"), ("doppler_range_shift", "s"))

    @model_validator(mode="after")
    def _check(self) -> ScanningRadarSpec:
        waveform = self.waveform
        if waveform.num_chirps != 1:
            raise ValueError(f"a waveform of one ramp an azimuth: num_chirps=1, not {waveform.num_chirps}")
        if waveform.ramp_time > self.azimuth_interval * (1 + 1e-9):
            raise ValueError(
                f"a waveform whose ramp fits into the time of an azimuth: ramp_time {waveform.ramp_time * 1e6:g} us, "
                f"1 / (rotation_rate * num_azimuths) = {self.azimuth_interval * 1e6:g} us"
            )
        if not self.front_end.is_ideal:
            raise ValueError("a front_end of power, noise figure and source temperature alone")
        available = waveform.num_samples * self.cells_per_resolution
        if self.num_range_bins is not None and self.num_range_bins > available:
            raise ValueError(
                f"num_range_bins <= {available}, the samples times cells_per_resolution; more samples a ramp, or None"
            )
        return self

    @classmethod
    def preset(cls, name: str) -> ScanningRadarSpec:
        """Return a named radar.

        ``"cts350x"``: Navtech CTS350-X as of the Oxford Radar RobotCar dataset and RADIATE.
        ``"cir204h"``: Navtech CIR204-H as of Boreas and MulRan.
        ``"ras6"``: Navtech RAS6 as of Boreas Road Trip, with ramps that rise and fall in turn.

        What none of the sources states, power, noise figure, gain and the beam's fill below the horizon, is assumed.

        Raises
        ------
        UnknownNameError
            If there is no radar of this name.
        """
        if name not in PRESETS:
            raise UnknownNameError("scanning radar preset", name, PRESETS)
        return cls(**PRESETS[name])

    @property
    def turn_time(self) -> float:
        """Duration of a turn [s]."""
        return 1.0 / self.rotation_rate

    @property
    def azimuth_interval(self) -> float:
        """Time from one azimuth to the next [s]."""
        return 1.0 / (self.rotation_rate * self.num_azimuths)

    @property
    def azimuth_rate(self) -> float:
        """Angular velocity of the antenna about z [rad/s], positive to the left."""
        return (-2.0 if self.rotation == "clockwise" else 2.0) * np.pi * self.rotation_rate

    @property
    def azimuth(self) -> Array:
        """Where the antenna points in the middle of each ramp's samples, shape (num_azimuths,) [rad], left positive.

        Not wrapped: from the start azimuth on it falls, or rises, by a turn.
        """
        steps = np.arange(self.num_azimuths) * (self.azimuth_rate * self.azimuth_interval)
        return np.asarray(np.radians(self.start_azimuth_deg) + steps, dtype=np.float64)

    @property
    def ramp_start(self) -> Array:
        """When each ramp starts after the turn [s], shape (num_azimuths,)."""
        return np.arange(self.num_azimuths, dtype=np.float64) * self.azimuth_interval

    @property
    def time(self) -> Array:
        """Middle of each ramp's samples after the turn's start [s], shape (num_azimuths,)."""
        return self.ramp_start + self.middle_time

    @property
    def middle_time(self) -> float:
        """From a ramp's start to the middle of its samples [s]."""
        waveform = self.waveform
        return waveform.adc_start_time + (waveform.num_samples - 1) / (2.0 * waveform.sample_rate)

    @property
    def is_up(self) -> npt.NDArray[np.bool_]:
        """Whether the frequency rises over each ramp, shape (num_azimuths,)."""
        turned = self.alternating & (np.arange(self.num_azimuths) % 2 == 1)
        return np.asarray((self.waveform.direction == "up") ^ turned)

    @property
    def range_resolution(self) -> float:
        """Width of a range bin without zero padding [m]."""
        return self.ramp().range_resolution

    @property
    def range_bin(self) -> float:
        """Width of a cell of the output [m]."""
        return self.range_resolution / self.cells_per_resolution

    @property
    def num_cells(self) -> int:
        """Range cells of the output."""
        return self.num_range_bins or self.waveform.num_samples * self.cells_per_resolution

    @property
    def range(self) -> Array:
        """Ranges of the cells, shape (num_cells,) [m]."""
        return np.asarray(np.arange(self.num_cells) * self.range_bin, dtype=np.float64)

    @property
    def max_range(self) -> float:
        """Range of the cell after the last one [m]."""
        return self.num_cells * self.range_bin

    @property
    def doppler_range_shift(self) -> float:
        """By how much a target that moves away stands too far, of a ramp that rises: f_c / S [m / (m/s)]."""
        up = self.ramp().waveform
        return up.center_frequency / up.sweep.slope

    def ramp(self, up: bool = True) -> RadarSpec:
        """Return the radar of one ramp, with the antenna ahead."""
        direction = "up" if up else "down"
        start = self.waveform.start_frequency
        if direction != self.waveform.direction:
            start += self.waveform.bandwidth if direction == "down" else -self.waveform.bandwidth
        return RadarSpec(
            waveform=self.waveform.with_(direction=direction, start_frequency=start),
            array=AntennaArray(
                tx_positions=((0.0, 0.0, 0.0),),
                rx_positions=((0.0, 0.0, 0.0),),
                pattern=self.pattern,
                polarization=self.polarization,
            ),
            front_end=self.front_end,
            elevation_fov_deg=self.elevation_fov_deg,
        )

    def fan(self, width_deg: float, resolved: bool = False) -> RadarSpec:
        """Return the radar of one ramp that looks into all azimuths of a width at once, each with the beam's peak.

        By it solvers choose what matters: the beam passes everything in this sector. `resolved`
        gives it receivers so far apart that it tells directions apart as well as the beam does.
        """
        up = np.arange(-90.0, 90.0 + 1e-9, _TABLE_STEP_DEG)
        across = np.radians(np.arange(-180.0, 180.0, _REACH_STEP_DEG))
        over_azimuth = self.pattern.gain_db(across, 0.0)
        best = int(np.argmax(over_azimuth))
        gain, peak = self.pattern.gain_db(across[best], np.radians(up)), float(over_azimuth[best])
        level = TablePattern(
            azimuth_deg=(-180.0, 180.0),
            azimuth_gain_dbi=(peak, peak),
            elevation_deg=tuple(up.tolist()),
            elevation_gain_dbi=tuple(gain.tolist()),
        )
        radar = self.ramp().with_(pattern=level, azimuth_fov_deg=width_deg)
        if not resolved:
            return radar
        apart = min(radar.wavelength / (2.0 * self.beam_reach(TWO_WAY_HALF_DB)), radar.array.max_array_extent)
        return radar.with_(rx_positions=((0.0, 0.0, 0.0), (0.0, apart, 0.0), (0.0, 0.0, apart)))

    def beam_reach(self, floor_db: float) -> float:
        """Return how far beside the boresight the two-way gain over azimuth is within a floor of its peak [rad].

        Looked for in steps of 0.05 deg, at elevation 0.
        """
        away = np.radians(np.arange(0.0, 180.0 + 1e-9, _REACH_STEP_DEG))
        gain = np.maximum(self.pattern.gain_db(away, 0.0), self.pattern.gain_db(-away, 0.0))
        within = np.flatnonzero(2.0 * (gain - gain.max()) >= -floor_db)
        return float(away[min(within[-1] + 1, len(away) - 1)])
