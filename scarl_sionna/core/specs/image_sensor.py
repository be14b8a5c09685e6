"""What turns light into numbers behind the lens: wells, noise, converter, white balance and tone curve."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Unit


class ImageSensor(Spec):
    """An image sensor with its noise. Without one (``CameraSpec.sensor = None``) a camera is ideal.

    The stages are in the order of the fields; those that are not set are left out.
    """

    vignetting: float = Field(
        0.0, ge=0.0, le=1.0, description="share of the natural fall of light towards the corners, cos^4; 0: none"
    )
    auto_exposure: float | None = Field(
        None,
        gt=0.0,
        le=10.0,
        description="linear value to which the image's mean luminance is exposed, such as 0.18; None: fixed exposure",
    )

    saturation: float = Field(
        2.0, gt=0.0, description="exposed linear value that fills the well; 1 is paper white in daylight"
    )
    full_well: float = Field(12_000.0, ge=1.0, le=1e9, description="electrons of a full well")
    veiling_glare: float = Field(0.0, ge=0.0, le=0.5, description="share of the light that the optics scatter widely")
    shot_noise: bool = Field(True, description="Poisson noise of the electrons")
    dark_electrons: Annotated[float, Unit("electrons")] = Field(
        0.0, ge=0.0, description="mean dark signal, subtracted again [electrons]"
    )
    read_noise: Annotated[float, Unit("electrons")] = Field(
        3.0, ge=0.0, description="standard deviation of the read-out [electrons]"
    )
    bits: int = Field(12, ge=1, le=24, description="of the converter, full scale = full well")
    black_level: int = Field(
        0, ge=0, description="numbers added in the converter and subtracted again, so that noise about black is kept"
    )
    mosaic: Literal["rggb", "bggr", "grbg", "gbrg"] | None = Field(
        None, description="colour filters of the first 2 x 2 pixels by rows; None: three full colour planes"
    )
    white_balance: Literal["none", "grey_world"] | tuple[float, float, float] = Field(
        "none", description="gains of red, green, blue; or from the mean of the image"
    )
    tone_curve: Literal["shoulder", "linear"] = Field("shoulder", description="linear: clipped at 1")

    @field_validator("black_level")
    @classmethod
    def _below_full_scale(cls, value: int, info: ValidationInfo) -> int:
        scale = (1 << info.data.get("bits", 12)) - 1
        if value >= scale:
            raise ValueError(f"below the converter's full scale, {scale}")
        return value

    @field_validator("white_balance")
    @classmethod
    def _positive_gains(cls, value: str | tuple[float, ...]) -> str | tuple[float, ...]:
        if isinstance(value, tuple) and min(value) <= 0.0:
            raise ValueError("gains > 0")
        return value
