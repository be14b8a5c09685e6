"""From where on solvers warn that they are used where they are not right. No path depends on these numbers."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Decibels, Metres, Unit

from .sbr import SMALLEST_SIZE, Wavelengths


class WarningLevels(Spec):
    """Thresholds of warnings; they change what is said, never what is computed."""

    smallest_body: Wavelengths = Field(
        SMALLEST_SIZE,
        ge=0.0,
        description="'sbr' warns of smaller bodies [wavelengths]: it is wrong there by decibels; docs/rcs.md, accuracy",
    )
    grazing_incidence: float = Field(
        0.1,
        ge=0.0,
        le=1.0,
        description="'sbr' warns if most of the power comes from patches met at less than this cosine: 6 deg, where "
        "diffraction is as strong; docs/sbr.md, where it breaks",
    )
    shadow_error: Decibels = Field(
        1.0,
        ge=0.0,
        description="'sbr' warns if the echo of an instance may be off by more than this for shadows that its tubes "
        "have not resolved [dB]; docs/sbr.md, where it breaks",
    )
    further_bounces: Decibels = Field(
        3.0,
        ge=0.0,
        description="'sbr' warns if two more bounces than `max_depth` may change the echo of an instance by more than "
        "this, by a coarse look [dB]; docs/sbr.md, where it breaks",
    )
    detuning: float = Field(
        0.01,
        ge=0.0,
        description="'scatterers' warns if model and radar differ in frequency by more than this share; "
        "docs/scatterers.md",
    )
    wide_arm: Metres = Field(
        0.1,
        ge=0.0,
        description="an array is wide if an antenna is farther than this from its centre [m]: 'sionna' tests whether "
        "all antennas see a path (at 77 GHz the first Fresnel zone is 0.2 m across half-way to 10 m; "
        "docs/sionna_paths.md, where it breaks), 'sbr' gives patches nearer than 100 times this their change over the "
        "array (docs/sbr.md)",
    )
    wavefront_error: Annotated[float, Unit("rad")] = Field(
        0.1,
        gt=0.0,
        description="'sionna' warns if an antenna is off by more than this behind an edge [rad]: 20 dB below the "
        "path; docs/sionna_paths.md",
    )
    band_change: float = Field(
        0.05,
        ge=0.0,
        description="a layer whose reflection differs by more than this from that in the middle of a band above "
        "1 GHz, which stands for all of it; docs/waveforms.md, wide bands",
    )
    band_error: float = Field(
        1e-3,
        gt=0.0,
        description="error of a transfer over the band, and part of the power without one; docs/waveforms.md, wide "
        "bands",
    )
    pane_distance: Metres = Field(
        1.0,
        ge=0.0,
        description="a pane this close before the radar is part of its mounting: a windscreen, a grille, a bumper "
        "[m]; docs/radar_settings.md, warnings",
    )
    pane_share: float = Field(
        0.2,
        ge=0.0,
        le=1.0,
        description="share of the field of view that such panes must cover for a warning; docs/radar_settings.md, "
        "warnings",
    )
    pane_directions: int = Field(
        7,
        ge=2,
        le=100,
        description="directions over the field of view, in azimuth and in elevation, in which panes are looked for",
    )


DEFAULT_WARNINGS = WarningLevels()
