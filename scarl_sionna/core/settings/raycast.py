"""The knobs of the channel solver `raycast`; docs/raycast.md has error and time of each."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from scarl_sionna.core.spec import Spec

RcsModel = Literal["footprint", "per_hit"]
HitPhase = Literal["rough", "geometric"]
GridKind = Literal["staggered", "scattered", "regular"]


class RaycastSettings(Spec):
    """Knobs of the paper's own method: a fixed grid of rays, each hit one isotropic point target."""

    num_rays: int = Field(
        1_000_000,
        ge=1,
        strict=True,
        description="rays over the radar's field of view (SCaRL: 10^6); docs/raycast.md, error against rays",
    )
    rcs_model: RcsModel = Field(
        "footprint",
        description="'footprint': class reflectivity times the area across the ray, so the power does not depend on "
        "the number of rays; 'per_hit': a constant RCS a hit by class, the paper's literal reading, whose power "
        "grows with the number of rays",
    )
    class_rcs: Path | dict[str, float] | None = Field(
        None,
        description="replaces entries of rcs_by_class.toml: dimensionless reflectivity by class, or path of a TOML, "
        "which may have the ratio of cross-polar power as well",
    )
    rough_ground: bool = Field(
        True,
        description="the ground (roads, pavements, terrain) scatters by the law of its material, as in the other "
        "solvers; False: by class, as in the paper. A class that class_rcs names is always taken from there",
    )
    hit_phase: HitPhase = Field(
        "rough",
        description="'rough': each hit stands for many unresolved scatterers and gets a fixed random phase; "
        "'geometric': only the phase of its distance, as in the paper; hits at exactly the same distance then add in "
        "phase, but for the cross-polar part, which is random in either case",
    )
    hits_per_cell: int | None = Field(
        8,
        ge=1,
        strict=True,
        description="kept hits of one instance that the radar cannot tell apart (a cell of cells_per_resolution in "
        "range, velocity and direction), with the power of all; None keeps every hit; docs/raycast.md, kept hits",
    )
    cells_per_resolution: float = Field(
        2.0,
        gt=0.0,
        description="the cells within which hits are thinned are this much finer than the radar's resolution in "
        "range, velocity and each direction cosine; docs/raycast.md, cells",
    )
    widest_cosine: float = Field(
        0.1,
        gt=0.0,
        le=2.0,
        description="widest such cell in a direction cosine, for arrays of little or no aperture: 6 deg, within "
        "which gains hardly change; docs/raycast.md, cells",
    )
    grid: GridKind = Field(
        "staggered",
        description="'staggered': elevation shifted within the cell, column by column, so that a road is hit at all "
        "distances; 'scattered': azimuth as well, row by row, so that walls along the line of sight are, too; "
        "'regular': through the centres of the cells",
    )
