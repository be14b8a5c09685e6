"""The knobs of the channel solver `scatterers`; docs/scatterers.md has error and time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import ConfigDict, Field, field_serializer, field_validator

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Metres

TR38901 = "tr38901:"
"""Begin of the name of a sensing target of 3GPP TR 38.901, for instance ``"tr38901:car"``."""


class ScattererSettings(Spec):
    """Which objects have scattering centres, and how they are seen."""

    model_config = ConfigDict(arbitrary_types_allowed=True)

    models: dict[str, Any] = Field(
        default_factory=dict,
        description="for actors and static objects by their names: a ScattererModel, the path of a saved one, or "
        "'tr38901:' and a target of 3GPP TR 38.901; a file of a rig or a scenario takes the last two",
    )
    placements: dict[str, Pose] = Field(
        default_factory=dict,
        description="frame of the model in that of the actor, or in the world for a static object, where they are "
        "not the same",
    )
    group_size: Metres = Field(
        0.5,
        gt=0.0,
        description="centres in a cube of this side share one ray of occlusion [m]; a car has some 30 such groups; "
        "not charted",
    )

    @field_validator("models", mode="before")
    @classmethod
    def _none_is_empty(cls, value: object) -> object:
        return {} if value is None else value

    @field_validator("placements", mode="before")
    @classmethod
    def _poses(cls, value: object) -> object:
        if not isinstance(value, dict):
            return value
        return {name: Pose(**pose) if isinstance(pose, dict) else pose for name, pose in value.items()}

    @field_serializer("models", when_used="json")
    def _models_by_name(self, value: dict[str, Any]) -> dict[str, str]:
        for name, model in value.items():
            if not isinstance(model, (str, Path)):
                raise ParameterRangeError(
                    f"ScattererSettings.models['{name}']",
                    f"a {type(model).__name__} in memory",
                    "a path or 'tr38901:<target>'",
                    "save the model with ScattererModel.save(path) and name the file, so that it can be stored",
                )
        return {name: str(model) for name, model in value.items()}

    @field_serializer("placements", when_used="json")
    def _plain_poses(self, value: dict[str, Pose]) -> dict[str, Any]:
        return {name: pose.to_dict() for name, pose in value.items()}
