"""What turns light into numbers behind the lens: wells, noise, converter, white balance and tone curve."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, field_validator

from scarl_sionna.core.spec import Spec


class ImageSensor(Spec):
    """An image sensor with its noise. Without one (``CameraSpec.sensor = None``) a camera is ideal.

    Three full colour planes; a filter mosaic is not modelled. The stages are in the order of the fields.
    """

    saturation: float = Field(
        2.0, gt=0.0, description="exposed linear value that fills the well; 1 is paper white in daylight"
    )
    full_well: float = Field(12_000.0, ge=1.0, le=1e9, description="electrons of a full well")
    veiling_glare: float = Field(0.0, ge=0.0, le=0.5, description="share of the light that the optics scatter widely")
    shot_noise: bool = Field(True, description="Poisson noise of the electrons")
    dark_electrons: float = Field(0.0, ge=0.0, description="mean dark signal, subtracted again [electrons]")
    read_noise: float = Field(3.0, ge=0.0, description="standard deviation of the read-out [electrons]")
    bits: int = Field(12, ge=1, le=24, description="of the converter, full scale = full well")
    white_balance: Literal["none", "grey_world"] | tuple[float, float, float] = Field(
        "none", description="gains of red, green, blue; or from the mean of the image"
    )
    tone_curve: Literal["shoulder", "linear"] = Field("shoulder", description="linear: clipped at 1")

    @field_validator("white_balance")
    @classmethod
    def _positive_gains(cls, value: str | tuple[float, ...]) -> str | tuple[float, ...]:
        if isinstance(value, tuple) and min(value) <= 0.0:
            raise ValueError("gains > 0")
        return value
