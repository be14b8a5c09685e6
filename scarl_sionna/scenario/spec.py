"""One simulated drive as plain data: the same in Python and in a YAML file."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Literal

import yaml
from pydantic import Field

from scarl_sionna.core.errors import OutputError, ParameterRangeError
from scarl_sionna.core.spec import Spec


class ScenarioSpec(Spec):
    """Scene, rig, instants and seed of one export."""

    scene: str = Field("highway_guardrail", min_length=1, description="scene name or path of an XML file")
    rig: str = Field("front", min_length=1, description="rig name or path of a rig file (.yaml, .json)")
    quality: Literal["draft", "full"] = Field("draft", description="effort of a named rig")
    num_frames: int = Field(5, ge=1, description="consecutive frames")
    frame_rate: float = Field(10.0, gt=0.0, le=1e6, description="[Hz]")
    start_time: float = Field(0.0, description="time of the first frame [s]")
    seed: int = Field(0, ge=0, description="root of all random numbers")
    name: str | None = Field(
        None, pattern=r"^[A-Za-z0-9_\-]+$", description="name of the sequence in a dataset; default: that of the scene"
    )
    split: Literal["train", "val", "test"] = Field("train", description="split of a dataset that it belongs to")

    @property
    def scene_name(self) -> str:
        """Name of the sequence in a dataset."""
        return self.name or re.sub(r"[^A-Za-z0-9_\-]", "_", Path(self.scene).stem)

    @property
    def times(self) -> tuple[float, ...]:
        """Time of each frame [s]."""
        return tuple(self.start_time + index / self.frame_rate for index in range(self.num_frames))

    @classmethod
    def load(cls, path: str | Path) -> ScenarioSpec:
        """Return the scenario of a YAML or JSON file; a key left out keeps its default.

        Raises
        ------
        ParameterRangeError
            If the file is not readable as a mapping, or a key or value is not allowed.
        """
        path = Path(path)
        try:
            data = yaml.safe_load(path.read_text(encoding="utf-8"))  # JSON is a subset of YAML
        except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
            raise ParameterRangeError("scenario file", path, "a readable YAML or JSON file", str(error)) from error
        if not isinstance(data, dict) or not all(isinstance(key, str) for key in data):
            raise ParameterRangeError("scenario file", path, "keys " + ", ".join(cls.model_fields))
        return cls(**data)

    def save(self, path: str | Path) -> None:
        """Write the scenario to a YAML file (``.yaml``, ``.yml``) or a JSON file."""
        path = Path(path)
        data = self.model_dump(mode="json")
        text = json.dumps(data, indent=2) + "\n" if path.suffix == ".json" else yaml.safe_dump(data, sort_keys=False)
        try:
            path.write_text(text, encoding="utf-8")
        except OSError as error:
            raise OutputError(
                f"cannot write the scenario to {path}: {error.strerror}; choose a writable folder"
            ) from error
