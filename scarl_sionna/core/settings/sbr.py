"""The knobs of the channel solver `sbr`: what error each one bounds; docs/sbr.md has error and time of each."""

from __future__ import annotations

from pydantic import Field

from scarl_sionna.core.spec import Spec


class SbrChannelSettings(Spec):
    """Knobs of :func:`scarl_sionna.radar.channel.sbr.solve_sbr`."""

    max_depth: int = Field(3, ge=1, le=16, description="largest number of bounces")
    num_tubes: int | None = Field(
        None, ge=1,
        description="cut the faces in view into about this many first tubes of equal sides, where max_phase does not ask for "
        "smaller ones; None: as few as it allows",
    )  # fmt: skip
    max_phase: float = Field(
        0.2, gt=0.0, le=3.0,
        description="largest departure of the phase over a patch from a linear one, at half of its longest side [rad]: size of "
        "what is one path, and distance of the rays",
    )  # fmt: skip
    integration_phase: float = Field(
        0.01, gt=0.0, le=3.0,
        description="the same for the parts over which the field of a patch is integrated with a linear phase [rad]",
    )  # fmt: skip
    max_ramp: float = Field(
        0.5, gt=0.0, le=3.0,
        description="largest change of the phase between the middle and the end of a patch's side that another antenna, or the "
        "end of the band, makes [rad]",
    )  # fmt: skip
    probe_spacing: float = Field(
        0.5, gt=0.0, le=4.0,
        description="distance of the rays that probe a patch, in the length of side that max_phase allows there: what is "
        "smaller can be missed as an obstacle or as the next thing hit",
    )  # fmt: skip
    edge_spacing: float = Field(
        0.125,
        gt=0.0,
        le=4.0,
        description="patches that straddle an edge are halved to this, same unit, then cut along it",
    )
    diffuse: bool = Field(True, description="whether rough surfaces scatter the part S of their reflection diffusely")
    seed: int = Field(0, ge=0, le=2**63 - 1, description="of the random phases of the diffusely scattering patches")
    floor_db: float | None = Field(
        -10.0,
        description="patches of a range bin are left out as long as the power of all of them in phase stays this far from the "
        "noise of one cell of the range-Doppler-angle cube [dB]; None keeps all",
    )
    max_patches: int = Field(20_000_000, ge=1, description="more patches than this are refused")
    tubes_per_batch: int = Field(250_000, ge=100, description="tubes worked at once: bounds the memory")


DEFAULT_SBR_CHANNEL = SbrChannelSettings()
