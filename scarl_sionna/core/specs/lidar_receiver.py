"""Receivers of the coherent lidar: the post-processing of SCaRL, and the physical heterodyne receiver."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from scarl_sionna.core.spec import Spec


class ScarlReceiver(Spec):
    """What SCaRL's post-processing does to ideal returns (its section 2.2); a zero switches an effect off."""

    kind: Literal["scarl"] = "scarl"
    drop_out_intensity: float = Field(
        0.0,
        ge=0.0,
        description="a return of intensity I is kept with probability 1 - exp(-I / drop_out_intensity); 0: all",
    )
    range_noise_variance_per_metre: float = Field(
        0.0, ge=0.0, description="variance of the distance noise divided by the distance [m2/m]"
    )
    velocity_noise_std: float = Field(0.0, ge=0.0, description="standard deviation of the radial velocity noise [m/s]")


class HeterodyneReceiver(Spec):
    """A coherent receiver with in-phase and quadrature detection of the beat with the local oscillator.

    Every effect can be switched off: `speckle`, `backscatter`, `noise`; thermal and intensity noise by 0 and None.
    """

    kind: Literal["heterodyne"] = "heterodyne"
    quantum_efficiency: float = Field(0.8, gt=0.0, le=1.0, description="photoelectrons a photon")
    system_efficiency: float = Field(0.3, gt=0.0, le=1.0, description="optics, polarization and mixing, both ways")
    local_oscillator_power: float = Field(1e-3, gt=0.0, description="on the detectors [W]")
    thermal_current_density: float = Field(
        3e-12, ge=0.0, description="input noise current of the amplifier [A/sqrt(Hz)]"
    )
    intensity_noise_db: float | None = Field(
        -175.0, le=-100.0, description="relative intensity noise left after balancing [dB/Hz]; None: none"
    )
    sampling_frequency: float = Field(500e6, gt=0.0, description="complex samples a second [Hz]")
    chirps: Literal["up_down", "up"] = Field("up_down", description='"up": range and velocity cannot be told apart')
    num_looks: int = Field(1, ge=1, le=1024, description="pairs of chirps with independent speckle, averaged in power")
    false_alarm_probability: float = Field(1e-4, gt=0.0, lt=0.5, description="of a shot that hits nothing")
    max_velocity: float = Field(70.0, gt=0.0, description="radial velocities searched: -max to max [m/s]")
    saturation_power: float | None = Field(
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


LidarReceiver = Annotated[ScarlReceiver | HeterodyneReceiver, Field(discriminator="kind")]
