"""What ``method="auto"`` decides by, as numbers.

They say which object is left out, which is computed by class and which by physical optics, and how finely.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, field_validator

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Decibels, Metres, Unit

from .sbr import SMALLEST_SIZE, Wavelengths


class SbrLevel(Spec):
    """Knobs of `sbr` that hold from a tolerance on; docs/accuracy.md, plate (patches) and car (bounces)."""

    tolerance_db: Decibels = Field(
        ge=0.0, description="smallest `channel_tolerance_db` for which this level is taken [dB]"
    )
    max_phase: Annotated[float, Unit("rad")] = Field(gt=0.0, le=3.0, description="as in SbrSettings [rad]")
    integration_phase: Annotated[float, Unit("rad")] = Field(gt=0.0, le=3.0, description="as in SbrSettings [rad]")
    vehicle_bounces: int = Field(
        ge=1, le=32, description="most bounces on a vehicle, and number of bounces on things longer than `long_object`"
    )


class TubeEstimate(Spec):
    """How many ray tubes `sbr` will need for an object: what the budget is counted in.

    num = growth^(bounces - 1) * (least + per_face * faces + per_edge * size / edge spacing * sqrt(faces / 100)), right
    to a factor of three for the objects of highway_guardrail (docs/accuracy.md, what `auto` does).
    """

    least: float = Field(1000.0, ge=0.0, description="number of tubes of an object with no face; fit, not charted")
    per_face: float = Field(0.5, ge=0.0, description="number of tubes a face: half of the faces are lit")
    per_edge: float = Field(
        1.5, ge=0.0, description="number of tubes a step of the edge spacing along long edges; fit, not charted"
    )
    growth: float = Field(2.0, ge=1.0, description="factor for each further bounce; fit, not charted")
    growth_long: float = Field(
        6.0,
        ge=1.0,
        description="the same factor on things longer than `long_object`, seen along their length",
    )


class AutoSettings(Spec):
    """Rules of ``method="auto"``. Tolerance, floor and budget stand in :class:`~scarl_sionna.Accuracy`."""

    levels: tuple[SbrLevel, ...] = Field(
        (
            SbrLevel(tolerance_db=2.0, max_phase=2.0, integration_phase=0.1, vehicle_bounces=2),
            SbrLevel(tolerance_db=1.0, max_phase=1.0, integration_phase=0.05, vehicle_bounces=2),
            SbrLevel(tolerance_db=0.2, max_phase=0.4, integration_phase=0.02, vehicle_bounces=3),
            SbrLevel(tolerance_db=0.0, max_phase=0.2, integration_phase=0.01, vehicle_bounces=3),
        ),
        description="knobs of 'sbr' by tolerance, the coarsest first, the last from 0 dB; docs/accuracy.md, plate "
        "and car",
    )
    tubes: TubeEstimate = Field(TubeEstimate(), description="what an object costs in the budget")
    speckle_db: Decibels = Field(
        10.0,
        ge=0.0,
        description="a rough surface is taken to send back at most this much more than its mean [dB]: 4.5e-5 of "
        "exponential speckle is above; docs/accuracy.md, what `auto` does",
    )
    smooth_share: float = Field(
        0.5,
        ge=0.0,
        le=1.0,
        description="an object is a coherent body if its parts reflect more than this share of the power coherently "
        "(1 - S^2); not charted",
    )
    diffuse_classes: tuple[str, ...] = Field(
        ("Roads", "SideWalks", "RoadLine", "Ground", "Terrain", "Vegetation", "Water", "Pedestrian", "Rider", "Sky"),
        description="semantic classes without coherent bodies: rough or soft, many unresolved scatterers in a "
        "resolution cell",
    )
    too_near: Metres = Field(
        1.0,
        ge=0.0,
        description="what stands nearer than this carries the radar, or fills its view: left to 'raycast' [m]; not "
        "charted",
    )
    smallest_body: Wavelengths = Field(
        SMALLEST_SIZE,
        ge=0.0,
        description="smaller bodies are left to 'raycast' [wavelengths]: physical optics is decibels off; "
        "docs/rcs.md, accuracy",
    )
    long_object: Metres = Field(
        20.0,
        gt=0.0,
        description="longer things (guardrails, walls) see themselves along their length: two bounces, many more "
        "tubes after each [m]; docs/accuracy.md, whole highway frame",
    )
    vehicle_classes: tuple[str, ...] = Field(
        ("Car", "Truck", "Bus", "Train", "Motorcycle", "Bicycle"),
        description="semantic classes whose further bounces are weak: the tolerance limits their number; "
        "docs/accuracy.md, car",
    )
    num_probes: int = Field(
        256,
        ge=1,
        description="rays that find out how often an object reflects to itself; docs/accuracy.md, knobs of the rules",
    )
    bounce_share: float = Field(
        0.01,
        gt=0.0,
        le=1.0,
        description="share of those rays that must go on for another bounce to count: a corner reflector on a body "
        "is often small; docs/accuracy.md, knobs of the rules",
    )
    max_bounces: int = Field(
        3, ge=1, le=8, description="most bounces looked for; 3 covers every corner reflector (docs/rcs.md)"
    )
    mirror_classes: tuple[str, ...] = Field(
        ("Roads", "SideWalks", "Ground", "Water", "Wall", "Building", "Bridge"),
        description="semantic classes whose large flat static faces act as mirrors; docs/accuracy.md, wall and two-ray",
    )
    smallest_mirror: Metres = Field(1.0, ge=0.0, description="narrower faces are no mirrors [m]; not charted")

    @field_validator("levels")
    @classmethod
    def _down_to_zero(cls, levels: tuple[SbrLevel, ...]) -> tuple[SbrLevel, ...]:
        tolerances = [level.tolerance_db for level in levels]
        if not levels or tolerances[-1] != 0.0 or tolerances != sorted(tolerances, reverse=True):
            raise ValueError("levels whose tolerances fall, the last 0 dB")
        return levels


DEFAULT_AUTO = AutoSettings()
