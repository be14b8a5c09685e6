"""The knobs of the channel solver `sionna`; docs/sionna_paths.md has the table of paths found against time."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from scarl_sionna.core.spec import Spec


class SionnaSettings(Spec):
    """Knobs of the multipath solver on Sionna RT's PathSolver."""

    max_depth: int = Field(
        2,
        ge=0,
        le=8,
        description="most interactions of a path, of each leg for scatterers; docs/sionna_paths.md, how many rays",
    )
    num_samples: int = Field(
        200_000,
        ge=1,
        le=100_000_000,
        description="rays over the whole sphere that look for surfaces: one smaller than 3.5 / sqrt(num_samples) rad "
        "as seen from the radar can be missed; docs/sionna_paths.md, how many rays",
    )
    max_num_paths: int = Field(
        1_000_000, ge=1, le=100_000_000, description="candidates that the solver can hold; a full buffer is an error"
    )
    on_overflow: Literal["raise", "warn"] = "raise"
    specular: bool = Field(True, description="mirror reflections")
    diffuse: bool = Field(False, description="diffuse scattering with Sionna RT's patterns, amplitudes in float32")
    refraction: bool = Field(False, description="straight passage through layers")
    diffraction: bool = Field(
        False, description="over one edge a way, by the uniform theory; also beside the edge, in the light"
    )
    double_bounce: bool = Field(
        False,
        description="scatterers also with a mirror and themselves again (target - own car - target); a trace for each",
    )
    seed: int = Field(0, ge=0, le=2**32 - 1, description="of the solver's choice between kinds of interaction")
