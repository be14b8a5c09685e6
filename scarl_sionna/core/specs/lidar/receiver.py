"""Receivers of a lidar: the post-processing of SCaRL, the heterodyne receiver, and the pulsed (time-of-flight) one."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import SPEED_OF_LIGHT, Hertz, Metres, MetresPerSecond, Seconds, Unit, Watts

_FWHM = 2.0 * math.sqrt(2.0 * math.log(2.0))
"""Full width at half maximum of a Gaussian over its standard deviation."""


class ScarlReceiver(Spec):
    """What SCaRL's post-processing does to ideal returns (its section 2.2); a zero switches an effect off."""

    kind: Literal["scarl"] = "scarl"
    drop_out_intensity: float = Field(
        0.0,
        ge=0.0,
        description="a return of intensity I is kept with probability 1 - exp(-I / drop_out_intensity); 0: all",
    )
    range_noise_variance_per_metre: Annotated[float, Unit("m2/m")] = Field(
        0.0, ge=0.0, description="variance of the distance noise divided by the distance [m2/m]"
    )
    velocity_noise_std: MetresPerSecond = Field(
        0.0, ge=0.0, description="standard deviation of the radial velocity noise [m/s]"
    )


class HeterodyneReceiver(Spec):
    """A coherent receiver with in-phase and quadrature detection of the beat with the local oscillator.

    Every effect can be switched off: `speckle`, `backscatter`, `noise`; thermal and intensity noise by 0 and None.
    """

    kind: Literal["heterodyne"] = "heterodyne"
    quantum_efficiency: float = Field(0.8, gt=0.0, le=1.0, description="photoelectrons a photon")
    system_efficiency: float = Field(0.3, gt=0.0, le=1.0, description="optics, polarization and mixing, both ways")
    local_oscillator_power: Watts = Field(1e-3, gt=0.0, description="on the detectors [W]")
    thermal_current_density: Annotated[float, Unit("A/sqrt(Hz)")] = Field(
        3e-12, ge=0.0, description="input noise current of the amplifier [A/sqrt(Hz)]"
    )
    intensity_noise_db: Annotated[float, Unit("dB/Hz")] | None = Field(
        -175.0, le=-100.0, description="relative intensity noise left after balancing [dB/Hz]; None: none"
    )
    sampling_frequency: Hertz = Field(500e6, gt=0.0, description="complex samples a second [Hz]")
    chirps: Literal["up_down", "up"] = Field("up_down", description='"up": range and velocity cannot be told apart')
    num_looks: int = Field(1, ge=1, le=1024, description="pairs of chirps with independent speckle, averaged in power")
    false_alarm_probability: float = Field(1e-4, gt=0.0, lt=0.5, description="of a shot that hits nothing")
    max_velocity: MetresPerSecond = Field(70.0, gt=0.0, description="radial velocities searched: -max to max [m/s]")
    saturation_power: Watts | None = Field(
        1e-6, gt=0.0, description="received power at which I and Q reach full scale [W]; None: never"
    )
    speckle: bool = Field(True, description="fully developed speckle of rough surfaces")
    backscatter: bool = Field(True, description="returns from fog and rain")
    noise: bool = Field(True, description="noise of the beat: detection, false alarms and estimates; False: ideal")
    raw_signal: bool = Field(False, description="make the beat signals, and estimate from them")

    @model_validator(mode="after")
    def _check(self) -> HeterodyneReceiver:
        if self.raw_signal and self.num_looks != 1:
            raise ValueError("raw_signal with num_looks = 1: the raw data hold one pair of chirps a shot")
        if self.raw_signal and self.chirps != "up_down":
            raise ValueError('raw_signal with chirps = "up_down"')
        return self


class PulsedReceiver(Spec):
    """A time-of-flight receiver: pulses on an avalanche photodiode, filtered, sampled and searched for peaks.

    It measures no velocity. Every effect can be switched off: `speckle`, `backscatter`, `noise`; thermal noise, dark
    current and sunlight by 0. With `avalanche_gain=1`, `noise_current_density=0` and `ionization_ratio=0` it counts
    photons, as an array of single-photon diodes far from saturation does.
    """

    kind: Literal["pulsed"] = "pulsed"
    pulse_energy: Annotated[float, Unit("J")] = Field(2e-7, gt=0.0, description="of one pulse, out of the window [J]")
    pulse_width: Seconds = Field(5e-9, ge=1e-10, le=1e-6, description="of a Gaussian pulse at half its power [s]")
    num_pulses: int = Field(1, ge=1, le=4096, description="pulses a shot whose waveforms are averaged")
    receiver_aperture: Metres = Field(
        25e-3, gt=0.0, le=1.0, description="diameter of the receiver's lens, focused at infinity [m]"
    )
    optical_efficiency: float = Field(0.5, gt=0.0, le=1.0, description="of the receiver's optics and filter")
    field_of_view: Annotated[float, Unit("rad")] = Field(
        3e-3, gt=0.0, lt=1.0, description="full angle that the detector sees, round [rad]"
    )
    optical_bandwidth: Metres = Field(30e-9, gt=0.0, le=1e-6, description="width of the optical filter [m]")
    solar_irradiance: Annotated[float, Unit("W/(m2 nm)")] | None = Field(
        None,
        ge=0.0,
        description="sunlight on what is seen [W/(m2 nm)], 0: night; None: by the world's lighting, a black body sun "
        "without air where no world or no lighting is known",
    )
    quantum_efficiency: float = Field(0.7, gt=0.0, le=1.0, description="photoelectrons a photon")
    avalanche_gain: float = Field(100.0, ge=1.0, le=1e7, description="electrons a photoelectron")
    ionization_ratio: float = Field(
        0.02, ge=0.0, le=1.0, description="of holes over electrons: silicon 0.02, InGaAs 0.4"
    )
    dark_current: Annotated[float, Unit("A")] = Field(1e-10, ge=0.0, description="before the gain [A]")
    noise_current_density: Annotated[float, Unit("A/sqrt(Hz)")] = Field(
        2e-12, ge=0.0, description="input noise current of the amplifier [A/sqrt(Hz)]"
    )
    electrical_bandwidth: Hertz | None = Field(
        None, gt=0.0, description="of the Gaussian filter at -3 dB [Hz]; None: matched to the pulse"
    )
    sampling_frequency: Hertz = Field(1e9, gt=0.0, description="samples of the waveform a second [Hz]")
    false_alarm_probability: float = Field(1e-4, gt=0.0, lt=0.5, description="of a shot into clear air")
    saturation_power: Watts | None = Field(
        None, gt=0.0, description="received power of a pulse's peak at which the output clips [W]; None: never"
    )
    blind_distance: tuple[Metres, Metres] = Field(
        (0.2, 1.0), description="beam and receiver begin to overlap, and do so wholly [m]"
    )
    timing_jitter: Seconds = Field(0.0, ge=0.0, le=1e-6, description="standard deviation of the trigger [s]")
    range_step: Metres = Field(0.0, ge=0.0, le=10.0, description="distances are multiples of it [m]; 0: any")
    speckle: bool = Field(True, description="speckle of rough surfaces, averaged over the receiver's lens")
    backscatter: bool = Field(True, description="echoes from fog, rain, snow and spray")
    noise: bool = Field(True, description="noise of the waveform: detection, false alarms and estimates; False: ideal")
    raw_signal: bool = Field(False, description="make the waveforms, and estimate from them")

    @model_validator(mode="after")
    def _check(self) -> PulsedReceiver:
        first, whole = self.blind_distance
        if not 0.0 <= first <= whole or whole == 0.0:
            raise ValueError(f"blind_distance with 0 <= first <= second and second > 0 m, not {self.blind_distance}")
        if self.sampling_frequency * self.filter_deviation < 1.0:
            raise ValueError(
                f"sampling_frequency of at least {1.0 / self.filter_deviation:.3g} Hz, one sample in the standard "
                f"deviation of the filter, {self.filter_deviation:.3g} s; it is {self.sampling_frequency:.3g} Hz"
            )
        return self

    @property
    def pulse_deviation(self) -> float:
        """Standard deviation of the Gaussian pulse in time [s]."""
        return self.pulse_width / _FWHM

    @property
    def filter_deviation(self) -> float:
        """Standard deviation of the filter's Gaussian impulse response in time [s]."""
        if self.electrical_bandwidth is None:
            return self.pulse_deviation
        return math.sqrt(math.log(2.0)) / (2.0 * math.pi * self.electrical_bandwidth)

    @property
    def range_resolution(self) -> float:
        """Distance of two returns that can be told apart [m]: the filtered pulse's width at half its height, c / 2."""
        return SPEED_OF_LIGHT / 2.0 * _FWHM * math.hypot(self.pulse_deviation, self.filter_deviation)


LidarReceiver = Annotated[ScarlReceiver | HeterodyneReceiver | PulsedReceiver, Field(discriminator="kind")]
