"""How a body of one's own, a skinned glTF or a BVH, is taken as an actor."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from scarl_sionna.core.spec import Spec

Axis = Literal["x", "y", "z", "-x", "-y", "-z"]


class BodySpec(Spec):
    """A body that bends; see `scarl_sionna.actor_from_body`."""

    semantic: str = Field("Pedestrian", description="semantic class")
    moved_by: str | None = Field(
        None, description="BVH whose bones have the names of the glTF's nodes, both at rest in the same posture"
    )
    clip: str | None = Field(None, description="animation of the glTF; default: its first")
    smooth: bool | None = Field(
        None,
        description="cubic splines through keys that the file joins by straight lines, whose velocity has steps; "
        "default: for BVH only",
    )
    loop: bool = Field(True, description="whether the motion begins again at its end; else the body stays as it was")
    speed: float = Field(1.0, gt=0.0, description="seconds of the motion in a second of the world")
    scale: float = Field(1.0, gt=0.0, description="metres in a unit of the file")
    unit: float = Field(1.0, gt=0.0, description="units of the file in a unit of `moved_by`")
    up: Axis = Field("y", description="axis of the file")
    forward: Axis = Field("z", description="axis of the file")
    motion: Literal["vehicle", "cycle", "walk", "stand"] | None = Field(None, description="default: by the class")
