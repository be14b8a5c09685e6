"""Every numerical knob that bounds an error, in one place: what it bounds, and the chart that justifies its default."""

from __future__ import annotations

from pydantic import Field

from .spec import Spec


class Accuracy(Spec):
    """Tolerances of the radar's signal synthesis."""

    synthesis_tolerance: float = Field(
        1e-4, gt=1e-14, lt=1.0,
        description="largest error of the synthesized beat signal relative to its peak; docs/performance_synthesis.md",
    )  # fmt: skip


DEFAULT_ACCURACY = Accuracy()
