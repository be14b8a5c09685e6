"""How the channels of a radio are computed: Sionna RT's solver, and how many of its paths are kept."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from scarl_sionna.core.spec import Spec

from .sionna import SionnaSettings


class RadioSettings(Spec):
    """How the channels between a radio and its stations are computed, all of them by one call of ``PathSolver``.

    Raises
    ------
    ParameterRangeError
        If the solver is asked for `double_bounce`, which is for the radar's scatterers.
    """

    solver: SionnaSettings = Field(
        SionnaSettings(max_depth=3, num_samples=500_000, refraction=True),
        description="interactions that are looked for, and how many rays look for them",
    )
    max_paths: int = Field(
        64,
        ge=1,
        le=100_000,
        description="paths of each station that are kept, the strongest first; what the others carry is stated",
    )
    without_data: Literal["raise", "nearest"] = Field(
        "raise",
        description="where a material of the scene has no data at the carrier: an error that names it, or its values "
        "at the nearest frequency that has, which the diagnostics state",
    )

    @model_validator(mode="after")
    def _check(self) -> RadioSettings:
        if self.solver.double_bounce:
            raise ValueError("a solver without double_bounce, which is for the scatterers of a radar")
        return self
