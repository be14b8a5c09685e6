"""What a scanning lidar is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated

from pydantic import Field, model_validator

from scarl_sionna.core.errors import UnknownNameError
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.specs.atmosphere import Atmosphere
from scarl_sionna.core.units import SPEED_OF_LIGHT, Hertz, Metres, Seconds, Unit, Watts

from .pattern import RasterScan, ScanPattern
from .presets import PRESETS
from .receiver import HeterodyneReceiver, LidarReceiver, PulsedReceiver, ScarlReceiver

MAX_RAW_BYTES = 1 << 29
"""Largest raw beat signal of one scan [bytes]."""


class LidarSpec(Spec):
    """A scanning lidar: coherent (FMCW) as SCaRL's, or pulsed (time of flight), by its receiver.

    Parameters of a raster scan and of SCaRL's receiver may also be given directly: ``LidarSpec(num_azimuth=300)`` is
    ``LidarSpec(scan=RasterScan(num_azimuth=300))``.

    The defaults are an ideal lidar with a flash of all shots, one thin ray a shot, as in SCaRL; noise, scan motion,
    beam footprint, several returns and weather are added by the fields that name them.
    """

    scan: ScanPattern = RasterScan()
    receiver: LidarReceiver = ScarlReceiver()
    wavelength: Metres = Field(1550e-9, ge=400e-9, le=2000e-9, description="optical wavelength [m]")
    max_distance: Metres = Field(200.0, gt=0.0, le=1e4, description="no return beyond [m]")
    atmospheric_attenuation: Annotated[float, Unit("1/m")] = Field(
        4e-4, ge=0.0, description="one-way power extinction coefficient of clear air [1/m]; a visibility replaces it"
    )
    atmosphere: Atmosphere = Field(Atmosphere(), description="fog and rain")
    transmit_power: Watts = Field(
        0.1,
        gt=0.0,
        description="optical, of one beam while it chirps [W]",
    )
    aperture_diameter: Metres = Field(
        10e-3, gt=0.0, description="of the beam at the lens, to 1/e2 of the intensity [m]"
    )
    beam_divergence: Annotated[float, Unit("rad")] | None = Field(
        None, gt=0.0, lt=0.2, description="full angle to 1/e2 of the intensity [rad]; None: the diffraction limit"
    )
    bandwidth: Hertz = Field(1e9, gt=0.0, description="swept by each chirp [Hz]")
    chirp_time: Seconds = Field(5e-6, gt=0.0, description="duration of the up chirp, and of the down chirp [s]")
    sub_rays: int = Field(1, ge=1, le=256, description="rays over the beam's footprint; 1: a thin ray")
    max_surfaces: int = Field(1, ge=1, le=16, description="surfaces a ray may meet through glass; 1: the first only")
    pane_reflections: bool = Field(
        True, description="echoes of what panes mirror, where max_surfaces lets rays go on after a pane"
    )
    max_returns: int = Field(1, ge=1, le=16, description="the strongest returns of a shot that are kept")
    deskew: bool = Field(
        False, description="positions in the sensor's frame at the timestamp, not at the shot's own time"
    )

    @model_validator(mode="before")
    @classmethod
    def _take_direct(cls, data: object) -> object:
        """Move parameters of a raster and of SCaRL's receiver that were given directly to where they belong."""
        if not isinstance(data, Mapping):
            return data
        data = dict(data)
        for name, kind in (("scan", RasterScan), ("receiver", ScarlReceiver)):
            direct = {key: data.pop(key) for key in kind.model_fields if key != "kind" and key in data}
            if not direct:
                continue
            base = data.get(name, {"kind": kind.model_fields["kind"].default})
            plain = base.model_dump() if isinstance(base, Spec) else dict(base)
            if plain.get("kind") != kind.model_fields["kind"].default:
                raise ValueError(
                    f"{', '.join(direct)} inside of `{name}`: a {name} of kind '{plain.get('kind')}' is given"
                )
            data[name] = {**plain, **direct}
        return data

    @model_validator(mode="after")
    def _check(self) -> LidarSpec:
        if self.divergence < self.diffraction_limit * (1.0 - 1e-9):
            raise ValueError(
                "beam_divergence of at least the diffraction limit of the aperture, "
                f"{self.diffraction_limit:.3g} rad at "
                f"{self.aperture_diameter * 1e3:g} mm, not {self.beam_divergence:.3g} rad"
            )
        receiver = self.receiver
        if isinstance(receiver, HeterodyneReceiver) and self.num_samples < 16:
            raise ValueError(f"16 or more samples a chirp; chirp_time * sampling_frequency is {self.num_samples}")
        if not isinstance(receiver, ScarlReceiver) and receiver.raw_signal and self.raw_bytes > MAX_RAW_BYTES:
            of_shot = self.raw_bytes // self.num_shots
            raise ValueError(
                f"raw_signal of at most {MAX_RAW_BYTES >> 20} MiB; {self.num_shots} shots of {of_shot} bytes "
                f"take {self.raw_bytes / 2**20:.0f} MiB; shoot at most {MAX_RAW_BYTES // of_shot}"
            )
        return self

    @classmethod
    def preset(cls, name: str) -> LidarSpec:
        """Return a named lidar.

        Sensors that could be: ``"spinning_64"``, 64 beams from -24.33 to 2 deg that turn at 10 Hz, 1800 columns, with
        the beam table of a common 64-beam scanner (1/3 deg apart in the upper, 1/2 deg in the lower half);
        ``"fmcw_forward"``, 120 x 28 deg, eight beams in parallel, 400 x 200 shots in 50 ms. Both receive by
        heterodyning, see glass and edges, and follow the motion.

        Devices, by published figures, see :mod:`scarl_sionna.core.specs.lidar.presets` for which these are:
        ``"hdl32e"``: Velodyne HDL-32E at 20 Hz, the lidar of nuScenes; pulsed.
        ``"os1_64"``: Ouster OS1-64 of the first generation, 1024 columns at 10 Hz; counts photons.
        ``"rs_lidar_m1"``: RoboSense RS-LiDAR-M1, solid state with a MEMS mirror; pulsed.
        ``"aeries_2"``: Aeva Aeries II; FMCW.

        Raises
        ------
        UnknownNameError
            If there is no lidar of this name.
        """
        if name not in PRESETS:
            raise UnknownNameError("lidar preset", name, PRESETS)
        return cls(**PRESETS[name])

    @property
    def num_shots(self) -> int:
        """Number of shots of a scan."""
        return self.scan.num_shots

    @property
    def num_azimuth(self) -> int:
        """Columns of the range view."""
        return self.scan.grid_shape[1]

    @property
    def num_elevation(self) -> int:
        """Rows of the range view."""
        return self.scan.grid_shape[0]

    @property
    def view_deg(self) -> tuple[float, float, float, float]:
        """Left, right, lower and upper limit of the field of view [deg]; azimuth is positive to the left."""
        azimuth, elevation = self.scan.angles()
        limits = azimuth.max(), azimuth.min(), elevation.min(), elevation.max()
        left, right, bottom, top = (float(math.degrees(value)) for value in limits)
        return left, right, bottom, top

    @property
    def diffraction_limit(self) -> float:
        """Full divergence of a collimated Gaussian beam of this aperture [rad], to 1/e2.

        4 wavelength / (pi diameter).
        """
        return 4.0 * self.wavelength / (math.pi * self.aperture_diameter)

    @property
    def divergence(self) -> float:
        """Full divergence of the beam in the far field [rad], to 1/e2 of the intensity."""
        return self.diffraction_limit if self.beam_divergence is None else self.beam_divergence

    @property
    def chirp_slope(self) -> float:
        """Frequency slope of the up chirp [Hz/s]."""
        return self.bandwidth / self.chirp_time

    @property
    def range_resolution(self) -> float:
        """Distance of two returns that can be told apart [m]: c / (2 bandwidth), or of two pulses."""
        if isinstance(self.receiver, PulsedReceiver):
            return self.receiver.range_resolution
        return SPEED_OF_LIGHT / (2.0 * self.bandwidth)

    @property
    def velocity_resolution(self) -> float:
        """Radial velocity that shifts the beat by one resolution cell [m/s]: wavelength / (2 chirp_time).

        Infinite for a pulsed receiver.
        """
        if isinstance(self.receiver, PulsedReceiver):
            return math.inf
        return self.wavelength / (2.0 * self.chirp_time)

    @property
    def num_samples(self) -> int:
        """Samples of a chirp, or of a pulse's waveform; 0 for a receiver without a signal."""
        if isinstance(self.receiver, HeterodyneReceiver):
            return round(self.receiver.sampling_frequency * self.chirp_time)
        if isinstance(self.receiver, PulsedReceiver):
            width = 5.0 * math.hypot(self.receiver.pulse_deviation, self.receiver.filter_deviation)
            return math.ceil(self.receiver.sampling_frequency * (2.0 * self.max_distance / SPEED_OF_LIGHT + width))
        return 0

    @property
    def raw_bytes(self) -> int:
        """Size of the raw signals of a scan [bytes]: two chirps a shot in complex64, or one waveform in float32."""
        of_shot = 4 if isinstance(self.receiver, PulsedReceiver) else 16
        return self.num_shots * of_shot * self.num_samples

    @property
    def extinction(self) -> float:
        """One-way power extinction coefficient of air, fog and rain at the lidar's wavelength [1/m]."""
        clear = self.atmospheric_attenuation if self.atmosphere.visibility is None else 0.0
        return clear + self.atmosphere.weather_extinction(self.wavelength)
