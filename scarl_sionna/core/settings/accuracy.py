"""Tolerances and budgets: every number that bounds an error names the chart that justifies its default."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Decibels, Gibibytes, Seconds


class Accuracy(Spec):
    """Tolerance of the radar's signal synthesis; tolerance, floor and budgets of its channel."""

    synthesis_tolerance: float = Field(
        1e-4,
        gt=1e-14,
        lt=1.0,
        description="largest error of the synthesized beat signal relative to its peak; docs/performance_synthesis.md",
    )
    motion_tolerance: float | None = Field(
        1e-3,
        gt=0.0,
        le=1.0,
        description="largest error of a path in motion, relative to its amplitude: those that need more than one rate "
        "for all antennas move exactly. None: none does, directions stay those of the frame's start; "
        "docs/performance_synthesis.md, crossing motion",
    )
    channel_tolerance_db: Decibels = Field(
        1.0,
        gt=0.0,
        le=20.0,
        description="error of an object's echo that 'auto' aims at [dB]: sets the knobs of 'sbr'; docs/accuracy.md, "
        "car and plate",
    )
    channel_floor_db: Decibels = Field(
        -10.0,
        description="objects whose power is at most this far from the noise of one range-Doppler-angle cell [dB] are "
        "not computed by 'auto', nor patches below it where it is lower than the `floor_db` of 'sbr': far below the "
        "noise for data without noise; docs/accuracy.md, what is left out",
    )
    tube_budget: int = Field(
        1_000_000,
        ge=0,
        description="ray tubes that 'auto' may spend on physical optics in one solve: where they do not pay for "
        "`channel_tolerance_db`, coarser levels are taken before anything is left out; docs/accuracy.md, budget",
    )
    cpu_budget: Seconds | None = Field(
        120.0,
        gt=0.0,
        description="processor time that 'sbr', 'auto' and 'hybrid' may be expected to spend on physical optics in one "
        "solve [s]; None: any; docs/sbr.md, cost",
    )
    memory_budget: Gibibytes | None = Field(
        4.0,
        gt=0.5,
        description="memory that they may be expected to take for it [GiB]; None: any; docs/sbr.md, cost",
    )
    over_budget: Literal["refuse", "coarsen"] = Field(
        "refuse",
        description="what 'sbr' and 'hybrid' do where a solve is expected to be over one of these two: an error with "
        "the figures, or the first of the coarser levels of 'auto' that is within them, with a warning; 'auto' itself "
        "always takes a coarser level",
    )

    @model_serializer(mode="wrap")
    def _without_new(self, inner: SerializerFunctionWrapHandler) -> dict[str, object]:
        """Leave out what files of earlier versions do not have, where it is the default."""
        unused = {name for name in _QUIET if getattr(self, name) == type(self).model_fields[name].default}
        return {name: value for name, value in inner(self).items() if name not in unused}


_QUIET = ("cpu_budget", "memory_budget", "over_budget")

DEFAULT_ACCURACY = Accuracy()
