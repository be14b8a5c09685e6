"""Every numerical knob that bounds an error, in one place: what it bounds, and the chart that justifies its default."""

from __future__ import annotations

from pydantic import Field

from scarl_sionna.core.units import Decibels

from .spec import Spec


class Accuracy(Spec):
    """Tolerances of the radar's signal synthesis and of ``method="auto"`` of its channel."""

    synthesis_tolerance: float = Field(
        1e-4, gt=1e-14, lt=1.0,
        description="largest error of the synthesized beat signal relative to its peak; docs/performance_synthesis.md",
    )  # fmt: skip
    channel_tolerance_db: Decibels = Field(
        1.0, gt=0.0, le=20.0,
        description="error of an object's echo that 'auto' aims at [dB]: sets the knobs of 'sbr'; docs/accuracy.md, car and plate",
    )  # fmt: skip
    channel_floor_db: Decibels = Field(
        -10.0,
        description="objects whose power is at most this far from the noise of one range-Doppler-angle cell [dB] are not "
        "computed by 'auto'; docs/accuracy.md, what is left out",
    )  # fmt: skip
    sbr_tubes_per_ray: float = Field(
        0.1, ge=0.0,
        description="ray tubes that 'auto' may spend on physical optics for each ray of 'raycast'; docs/accuracy.md, highway frame",
    )  # fmt: skip


DEFAULT_ACCURACY = Accuracy()
