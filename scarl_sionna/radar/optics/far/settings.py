"""The knobs of shooting and bouncing rays: what error each one bounds, and the table that justifies its default."""

from __future__ import annotations

import math

from pydantic import Field, model_validator

from scarl_sionna.core.spec import Spec

FINE_SIZE = 140.0
"""Bodies up to 1.4 times this many wavelengths have the finest default; then rays stand twice as far apart with each doubling."""
COARSEST = 4
"""Doublings at most: rays 16 wavelengths apart."""
COARSE_BISECTIONS = 5


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
    bisections: int = Field(
        11, ge=1, le=24, description="the place of an edge is found to 2^-bisections of the tube that it cuts"
    )
    max_rays: int = Field(
        1_000_000, ge=1000, description="rays and tubes worked at once: bounds the memory (docs/rcs.md)"
    )

    @model_validator(mode="after")
    def _check(self) -> SbrSettings:
        if self.edge_spacing > self.ray_spacing:
            raise ValueError("edge_spacing <= ray_spacing")
        return self

    @classmethod
    def for_size(cls, size: float) -> SbrSettings:
        """Return the default for a body whose largest extent is `size` wavelengths.

        What a cut along one edge can be wrong by is an area of some `edge_spacing` squared, while a body's echo grows with its
        own size: so rays of a large body stand farther apart. docs/rcs.md has the measured error of a car (1,100 wavelengths).
        """
        steps = int(min(max(round(math.log2(max(size, 1.0) / FINE_SIZE)), 0), COARSEST))
        if not steps:
            return DEFAULT_SBR
        return cls(ray_spacing=2.0**steps, edge_spacing=2.0 ** (steps - 1), bisections=COARSE_BISECTIONS)

    @property
    def limits(self) -> tuple[int, int]:
        """Rays at once and bisections: the last two arguments of :func:`.tubes.refine`."""
        return self.max_rays, self.bisections


DEFAULT_SBR = SbrSettings()
