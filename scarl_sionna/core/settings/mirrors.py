"""The knobs of flat mirrors, over which `hybrid` and `auto` see objects again; docs/accuracy.md has the charts."""

from __future__ import annotations

from pydantic import Field

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Metres


class MirrorSettings(Spec):
    """Which flat regions of the mirror instances are mirrors, and what lies on them."""

    max_mirrors: int = Field(
        16,
        ge=1,
        le=1000,
        description="the largest so many are used: tubes grow with their number, patches with its square; "
        "docs/accuracy.md, knobs of the rules",
    )
    flatness: Metres = Field(
        1e-3,
        gt=0.0,
        le=0.1,
        description="faces of a part whose corners are all this near to one plane are one mirror [m]: a quarter of "
        "the wavelength at 77 GHz; not charted",
    )
    thickness: Metres = Field(
        1e-2,
        gt=0.0,
        le=0.1,
        description="what lies this near to a mirror's plane, such as a road marking, belongs to it [m]; not charted",
    )
    end_reach: float = Field(
        4.0,
        ge=0.0,
        le=20.0,
        description="number of Fresnel units within which a mirror's free edges count: at one a reflection has half of "
        "its field, beyond it falls off smoothly; 0: mirrors end sharply; docs/accuracy.md, ends of mirrors",
    )


DEFAULT_MIRRORS = MirrorSettings()
