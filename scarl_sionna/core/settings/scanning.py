"""How finely the turn of a scanning radar is computed; docs/scanning_radar.md has error and time of each knob."""

from __future__ import annotations

from pydantic import Field

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Decibels


class ScanningSettings(Spec):
    """Knobs of a turn: how often paths are solved, how far beside the beam they count, what is kept."""

    num_blocks: int = Field(
        8,
        ge=1,
        le=1024,
        description="times a turn at which paths are solved, each for the azimuths around it; between them everything "
        "moves straight on; docs/scanning_radar.md, blocks and rays",
    )
    beam_floor_db: Decibels = Field(
        80.0,
        gt=0.0,
        le=200.0,
        description="paths in directions where the two-way gain over azimuth is so far below its peak do not count "
        "[dB]; docs/scanning_radar.md, beam",
    )
    num_pointings: int = Field(
        3,
        ge=1,
        le=16,
        description="directions of the antenna within a ramp between which its gain is interpolated; 1: it stands "
        "still during a ramp; docs/scanning_radar.md, beam",
    )
    keep_power: bool = Field(False, description="keep the power as float32 beside the image of 8 bits")
