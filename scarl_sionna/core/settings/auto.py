"""What ``method="auto"`` decides by, as numbers.

They say which object is left out, which is computed by class and which by physical optics, and how finely.
"""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, field_validator, model_validator

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Decibels, Metres, Seconds, Unit

from .sbr import SCENE_BISECTIONS, SMALLEST_SIZE, Wavelengths

BOUNCE_ERRORS = {6.0: 1.0, 3.0: 0.06, 1.0: 0.05, 0.3: 0.02}
"""Relative error of bounces between objects by tolerance [dB]: a ratio; docs/accuracy.md, expected error."""


class SbrLevel(Spec):
    """Knobs of `sbr` that hold from a tolerance on; docs/accuracy.md, whole streets."""

    tolerance_db: Decibels = Field(
        ge=0.0, description="smallest `channel_tolerance_db` for which this level is taken [dB]"
    )
    max_phase: Annotated[float, Unit("rad")] = Field(gt=0.0, le=3.0, description="as in SbrSettings [rad]")
    integration_phase: Annotated[float, Unit("rad")] = Field(gt=0.0, le=3.0, description="as in SbrSettings [rad]")
    edge_share: float = Field(gt=0.0, le=4.0, description="as in SbrSettings: a ratio")
    sheet_share: float = Field(0.15, gt=0.0, le=64.0, description="as in SbrSettings: a ratio")
    narrow_share: float = Field(1.0 / 12.0, gt=0.0, le=1.0, description="as in SbrSettings: a ratio")
    narrow_shadows: bool = Field(True, description="as in SbrSettings")
    corner_share: float = Field(0.125, gt=0.0, le=1.0, description="as in SbrSettings: a ratio")
    bisections: int = Field(SCENE_BISECTIONS, ge=1, le=24, description="as in SbrSettings")
    return_angle: Annotated[float, Unit("rad")] | None = Field(
        None, gt=0.0, le=math.pi, description="as in SbrSettings [rad]"
    )
    max_depth: int = Field(ge=1, le=32, description="number of bounces followed, as in SbrSettings")
    growth: float = Field(
        1050.0,
        gt=0.0,
        description="number of tubes of further bounces of an object of one face that reflects all of the wave on to "
        "another of one face; docs/accuracy.md, budget",
    )
    patch_error: float = Field(
        0.1,
        ge=0.0,
        description="relative error of the amplitude of one patch: a ratio; docs/accuracy.md, expected error",
    )
    bounce_error: float | None = Field(
        None,
        ge=0.0,
        description="relative error of all that bounces between objects along one chain of them, its patches alike: a "
        "ratio; None for that measured at the next coarser tolerance of 6, 3, 1 and 0.3 dB, beyond at 6 dB; "
        "docs/accuracy.md, expected error",
    )

    @property
    def error_of_bounces(self) -> float:
        """`bounce_error`, or what was measured for it."""
        if self.bounce_error is not None:
            return self.bounce_error
        coarser = [error for tolerance, error in BOUNCE_ERRORS.items() if tolerance >= self.tolerance_db]
        return min(coarser, default=max(BOUNCE_ERRORS.values()))


class TubeEstimate(Spec):
    """How many ray tubes `sbr` will need for an object: what the budget is counted in.

    num = least + first + growth of the level * turning. The first tubes are counted by the sizes of the
    faces; turning is the mean over what is seen of (faces of the object * faces of the object met)^spread where the
    wave is reflected on to an object, of 0 elsewhere. How right it is stands in docs/accuracy.md.
    """

    least: float = Field(30.0, ge=0.0, description="number of tubes of an object with no face; fit, not charted")
    spread: float = Field(
        0.4,
        ge=0.0,
        le=2.0,
        description="exponent by which the tubes of further bounces grow with the faces of the object and of what it "
        "reflects the wave to: a number; docs/accuracy.md, budget",
    )
    seconds: Seconds = Field(
        2e-5,
        ge=0.0,
        description="processor time of a tube on one core of 2025, by which a `cpu_budget` is one of tubes [s]; what a "
        "solve is expected to take stands in `cost`; docs/accuracy.md, budget",
    )


class CostEstimate(Spec):
    """Processor time that a solve by `auto` is expected to take, on one core of 2025; docs/accuracy.md, budget.

    seconds = ray * rays + instance * instances, and where anything is computed by `sbr` least + pair * pairs of ways +
    first * F + further * G / (1 + G / (most_further * F)), with F first tubes and G counted for bounces: of large
    bodies many of these do not come back. The second look, not known before, is in these by its mean.
    """

    ray: Seconds = Field(8e-8, ge=0.0, description="of a ray of `raycast` [s]; docs/accuracy.md, budget")
    instance: Seconds = Field(
        1e-3, ge=0.0, description="of planning, for each instance of the scene [s]; docs/accuracy.md, budget"
    )
    least: Seconds = Field(0.25, ge=0.0, description="of a solve by `sbr`, however small [s]; docs/accuracy.md, budget")
    pair: Seconds = Field(
        0.03,
        ge=0.0,
        description="of a way there and a way back that some object has, but for the straight ones [s]; "
        "docs/accuracy.md, budget",
    )
    first: Seconds = Field(
        4e-6, ge=0.0, description="of a tube that starts on an object, with its patches [s]; docs/accuracy.md, budget"
    )
    further: Seconds = Field(4e-5, ge=0.0, description="of a tube that a bounce sends on [s]; docs/accuracy.md, budget")
    most_further: float = Field(
        2.0,
        gt=0.0,
        description="number of tubes of bounces over that of first tubes, at most; docs/accuracy.md, budget",
    )
    again: float = Field(
        0.05,
        ge=0.0,
        description="where the first solve is coarser than the level asked for: time of what is computed at that "
        "level, over that of everything, in the mean: a ratio; docs/accuracy.md, budget",
    )


class ErrorEstimate(Spec):
    """What an object's echo is expected to be off by; docs/accuracy.md, expected error."""

    last_bounce: float = Field(
        0.3,
        ge=0.0,
        description="field of what bounces on, relative to that of the last bounce followed: a "
        "ratio; docs/accuracy.md, expected error",
    )
    way_error: float = Field(
        0.015,
        ge=0.0,
        description="relative error of what one object scatters by one way, straight or over mirrors, its own bounces "
        "included, all of its patches alike: a ratio; docs/accuracy.md, expected error",
    )
    median: float = Field(
        0.15,
        gt=0.0,
        description="half of the objects are off by less than this part of their expected error: a ratio; "
        "docs/accuracy.md, expected error",
    )
    tail: float = Field(
        1.6,
        gt=0.0,
        description="exponent by which the odds of being within an error grow with it: a number; docs/accuracy.md, "
        "expected error",
    )
    confidence: float = Field(
        0.85,
        gt=0.0,
        lt=1.0,
        description="probability with which the error is kept that a solve states: a ratio; docs/accuracy.md, expected "
        "error",
    )
    looked_at: float = Field(
        0.67,
        ge=0.0,
        description="expected error of an object that was computed at two levels, relative to that of one that was "
        "not: a ratio; docs/accuracy.md, expected error",
    )
    difference: float = Field(
        2.3,
        ge=0.0,
        description="expected error over what the echo differs by from that of the level before: a ratio; "
        "docs/accuracy.md, expected error",
    )
    doubt_share: float = Field(
        2.0,
        ge=0.0,
        description="a bounce that differs from its reverse by more than this multiple of the tolerance is doubtful: a "
        "ratio; docs/accuracy.md, expected error",
    )
    doubted_from_db: Decibels = Field(
        3.0,
        ge=0.0,
        description="tolerance of the finest level at which bounces are compared with their reverse: at finer ones "
        "what differs is side lobes without a twin, hardly what tubes lack; docs/accuracy.md, expected error",
    )
    by_class_db: Decibels = Field(
        38.0,
        ge=0.0,
        description="error of an object that is left to its class's reflectivity: 88 % of 1,555 objects that `raycast` "
        "computes keep it [dB]; docs/accuracy.md, whole streets",
    )
    by_class_crossed_db: Decibels = Field(
        68.0,
        ge=0.0,
        description="the same for a radar all of whose pairs of antennas are crossed, such as V that sends and H that "
        "hears: 88 % of the objects of 15 fields keep it [dB]; docs/accuracy.md, whole streets",
    )


_EARLIER = {"long_object", "vehicle_classes", "bounce_share", "max_bounces"}
"""Fields of the planner that looked at each object alone."""


class AutoSettings(Spec):
    """Rules of ``method="auto"``. Tolerance, floor and budget stand in :class:`~scarl_sionna.Accuracy`."""

    levels: tuple[SbrLevel, ...] = Field(
        (
            SbrLevel(
                tolerance_db=6.0,
                max_phase=3.0,
                integration_phase=0.02,
                edge_share=1.0,
                return_angle=0.3,
                narrow_share=1.0 / 3.0,
                narrow_shadows=False,
                corner_share=0.5,
                bisections=6,
                max_depth=5,
                growth=25.0,
                patch_error=0.4,
            ),
            SbrLevel(
                tolerance_db=3.0,
                max_phase=1.5,
                integration_phase=0.02,
                edge_share=0.25,
                sheet_share=0.08,
                return_angle=1.1,
                max_depth=5,
                growth=390.0,
                patch_error=0.07,
            ),
            SbrLevel(
                tolerance_db=1.0,
                max_phase=1.0,
                integration_phase=0.02,
                edge_share=0.125,
                sheet_share=0.08,
                return_angle=1.5,
                max_depth=5,
                growth=1050.0,
                patch_error=0.03,
            ),
            SbrLevel(
                tolerance_db=0.3,
                max_phase=0.4,
                integration_phase=0.01,
                edge_share=0.125,
                sheet_share=0.05,
                return_angle=2.0,
                max_depth=5,
                growth=2400.0,
                patch_error=0.01,
            ),
        ),
        description="knobs of 'sbr' by tolerance, the coarsest first; finer tolerances than the last are refused; "
        "docs/accuracy.md, whole streets",
    )
    tubes: TubeEstimate = Field(TubeEstimate(), description="what an object costs in the budget")
    cost: CostEstimate = Field(CostEstimate(), description="processor time that a solve is expected to take")
    errors: ErrorEstimate = Field(ErrorEstimate(), description="what each object is expected to be off by")
    coarse_first: bool = Field(
        True,
        description="where the finest level of all is asked for, the first solve is one level coarser, so that what "
        "the echo of each object differs by tells how far it is off; docs/accuracy.md, expected error",
    )
    look_share: float = Field(
        0.25,
        ge=0.0,
        le=4.0,
        description="number of tubes of what is computed at 3 dB where 6 dB is asked for, over that of the solve, at "
        "most; docs/accuracy.md, expected error",
    )
    few_probes: int = Field(
        5,
        ge=0,
        description="an object is doubtful if it is seen, but by no more than this number of its `num_probes` points; "
        "docs/accuracy.md, expected error",
    )
    refine_share: float = Field(
        0.5,
        ge=0.0,
        le=4.0,
        description="number of tubes of what is computed at a finer level, since it is doubtful or the tolerance is "
        "not met, over that of the solve, at most; docs/accuracy.md, expected error",
    )
    counts_from_db: Decibels = Field(
        10.0,
        description="objects that are this far over the noise of a cell by their class are counted in `met`: what can "
        "be detected; docs/accuracy.md, expected error",
    )
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
        0.2,
        ge=0.0,
        description="what stands nearer than this fills the radar's view: left to 'raycast' [m]; down to there 'auto' "
        "is 'sbr' within 0.4 dB of itself four times as fine, docs/accuracy.md",
    )
    carrier_near: Metres = Field(
        1.0,
        ge=0.0,
        description="the same for the actor that carries the radar, whose body it looks along [m]; not charted",
    )
    smallest_body: Wavelengths = Field(
        SMALLEST_SIZE,
        ge=0.0,
        description="smaller bodies are left to 'raycast' [wavelengths]: physical optics is decibels off; "
        "docs/rcs.md, accuracy",
    )
    num_probes: int = Field(
        256,
        ge=1,
        description="rays to each coherent object, straight and over each mirror, that find out what is seen of it; "
        "docs/accuracy.md, knobs of the rules",
    )
    mirror_candidates: int = Field(
        64,
        ge=1,
        le=1000,
        description="the largest so many flat faces are looked at; those that change the objects most become mirrors, "
        "at most `mirrors.max_mirrors`; docs/accuracy.md, knobs of the rules",
    )
    mirror_classes: tuple[str, ...] = Field(
        ("Roads", "SideWalks", "Ground", "Water", "Wall", "Building", "Bridge"),
        description="semantic classes whose large flat static faces act as mirrors; docs/accuracy.md, wall and two-ray",
    )
    smallest_change_db: Decibels = Field(
        0.5,
        ge=0.0,
        description="reflections that can change an object by more than this, by image theory with the part of it that "
        "they show, are computed also where the tolerance is coarser: a body may turn a flash to the mirror and none "
        "to the radar [dB]; docs/accuracy.md, what `auto` does",
    )
    smallest_mirror: Metres = Field(1.0, ge=0.0, description="narrower faces are no mirrors [m]; not charted")

    @model_validator(mode="before")
    @classmethod
    def _rules_before_whole_streets(cls, values: object) -> object:
        """Leave out the rules of earlier planners, as datasets of their time state them: those of today hold."""
        if not isinstance(values, dict):
            return values
        tubes = values.get("tubes")
        counted_otherwise = isinstance(tubes, dict) and {"growth", "per_face"} & set(tubes)
        if not (_EARLIER & set(values) or counted_otherwise):
            return values
        return {name: value for name, value in values.items() if name not in _EARLIER | {"levels", "tubes"}}

    @field_validator("levels")
    @classmethod
    def _falling(cls, levels: tuple[SbrLevel, ...]) -> tuple[SbrLevel, ...]:
        tolerances = [level.tolerance_db for level in levels]
        if not levels or tolerances != sorted(tolerances, reverse=True):
            raise ValueError("levels whose tolerances fall")
        return levels


DEFAULT_AUTO = AutoSettings()
