"""The knobs of shooting and bouncing rays: what error each one bounds, and the table that justifies its default."""

from __future__ import annotations

from pydantic import Field, model_validator

from scarl_sionna.core.spec import Spec


class SbrSettings(Spec):
    """Knobs of the tracer; docs/rcs.md has the table of error against time for each."""

    max_depth: int = Field(3, ge=1, le=32, description="largest number of bounces; 3 covers every corner reflector")
    ray_spacing: float = Field(
        1.0, gt=0.0, le=64.0,
        description="largest distance between the rays that probe a tube [wavelengths]: what is smaller can be missed "
        "as an obstacle or as the second thing hit",
    )  # fmt: skip
    edge_spacing: float = Field(
        0.25, gt=0.0, le=16.0,
        description="tubes that straddle an edge are halved down to this size [wavelengths] and then cut along it",
    )  # fmt: skip
    max_rays: int = Field(
        1_000_000, ge=1000, description="rays and tubes worked at once: bounds the memory (docs/rcs.md)"
    )

    @model_validator(mode="after")
    def _check(self) -> SbrSettings:
        if self.edge_spacing > self.ray_spacing:
            raise ValueError("edge_spacing <= ray_spacing")
        return self


DEFAULT_SBR = SbrSettings()
