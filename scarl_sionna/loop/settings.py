"""What a session is told before its first step."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Hertz, Seconds

Rate = Annotated[Hertz, Field(gt=0.0)]
Count = Annotated[int, Field(ge=1, le=1000)]


class SessionSettings(Spec):
    """How a session runs.

    Raises
    ------
    SpecError
        If a value is not allowed.
    """

    seed: int = Field(0, ge=0, description="root of all random numbers, as of an export")
    start: Seconds = Field(0.0, description="clock of the outside at the earliest step [s]; wheels turn from then on")
    rates: dict[str, Rate] = Field(
        default_factory=dict,
        description="frames a second by the name of a sensor or a shell pattern, the first that fits [Hz]; a sensor "
        "without a rate looks at every step",
    )
    bodies: dict[str, Count] = Field(
        default_factory=dict, description="how many actors of a model may be there at a time, beside those of the scene"
    )
    detail: str = Field("detailed", description="level of geometry of these bodies, 'detailed' or 'light'")
    keep: tuple[str, ...] = Field((), description="actors of the scene that keep the motion that the scene gives them")
    radar: RadarSettings | None = Field(None, description="fields that are set replace those of every radar of the rig")
    record: bool = Field(False, description="keep all motion, for `Session.recorded`; memory grows with the steps")
