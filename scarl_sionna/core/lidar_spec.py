"""What a scanning coherent lidar is."""

from __future__ import annotations

from pydantic import Field, model_validator

from .spec import Spec


class LidarSpec(Spec):
    """A scanning coherent (FMCW) lidar over a raster of azimuth and elevation.

    Noise and drop-out follow SCaRL, section 2.2; zeros switch them off.
    """

    azimuth_fov_deg: tuple[float, float] = Field((-60.0, 60.0), description="first and last azimuth [deg]")
    elevation_fov_deg: tuple[float, float] = Field((-20.0, 10.0), description="lowest and highest elevation [deg]")
    num_azimuth: int = Field(600, ge=1, description="shots a line")
    num_elevation: int = Field(64, ge=1, description="lines")
    wavelength: float = Field(1550e-9, gt=0.0, description="optical wavelength [m]")
    max_distance: float = Field(200.0, gt=0.0, description="no return beyond [m]")
    atmospheric_attenuation: float = Field(4e-4, ge=0.0, description="one-way power extinction coefficient [1/m]")
    drop_out_intensity: float = Field(
        0.0, ge=0.0, description="a return of intensity I is kept with probability 1 - exp(-I / drop_out_intensity); 0: all"
    )
    range_noise_variance_per_metre: float = Field(
        0.0, ge=0.0, description="variance of the distance noise divided by the distance [m2/m]"
    )
    velocity_noise_std: float = Field(0.0, ge=0.0, description="standard deviation of the radial velocity noise [m/s]")

    @model_validator(mode="after")
    def _check(self) -> LidarSpec:
        first, last = self.azimuth_fov_deg
        low, high = self.elevation_fov_deg
        azimuth, elevation = f"({first:g}, {last:g}) deg", f"({low:g}, {high:g}) deg"
        if abs(last - first) > 360.0:
            raise ValueError(f"azimuth_fov_deg of at most a full turn, not {azimuth}")
        if first == last and self.num_azimuth > 1:
            raise ValueError(f"azimuth_fov_deg with two different ends, or num_azimuth = 1; {azimuth} is empty")
        if not -90.0 <= low <= high <= 90.0:
            raise ValueError(f"elevation_fov_deg = (lowest, highest) within -90 to 90 deg, not {elevation}")
        if low == high and self.num_elevation > 1:
            raise ValueError(f"elevation_fov_deg with two different ends, or num_elevation = 1; {elevation} is empty")
        return self
