"""One simulated drive as plain data: the same in Python and in a YAML file."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import Field, PrivateAttr, model_validator

from scarl_sionna.core.errors import (
    OutputError,
    ParameterRangeError,
    ScenarioError,
    ScenarioPlace,
    ScenarioValueError,
    UnknownNameError,
)
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.spec import FieldValue, Spec
from scarl_sionna.core.units import Hertz, Seconds

from .actors import ActorSpec, EgoSpec, RandomizationSpec, TrafficSpec
from .files import Origin, place_of, read_marked
from .light import CLOCK, ConditionsSpec, LightingField, WeatherField
from .problems import problems_of

LIBRARY = Path(__file__).parents[1] / "library"
"""Folder of the ready scenarios."""
_WHOLE = 1e-6
"""Part of a frame by which a duration may miss a whole number of frames."""


class ScenarioSpec(Spec):
    """One drive: place, light, weather, who takes part and how they move, rig, instants and seed.

    Numbers are in SI units; times are those of the scene's motion. See docs/scenarios.md for the whole format.

    Raises
    ------
    ScenarioError
        If a value is not allowed or a key unknown; it names all of them, with file and line where it was read from
        one.

    Notes
    -----
    Give `num_frames` or `duration`; frames stand at ``start_time + k / frame_rate``. `duration` is kept as whole
    frames.
    """

    scene: str = Field("highway_guardrail", min_length=1, description="scene name or path of an XML file")
    variant: int = Field(0, ge=0, description="seed of the scene's own builder, or of a map's surroundings")
    detail: Literal["light", "detailed"] = Field("detailed", description="level of geometry")
    rig: str = Field("front", min_length=1, description="rig name or path of a rig file (.yaml, .json)")
    quality: Literal["draft", "full"] = Field("draft", description="effort of a named rig")
    radar: RadarSettings | None = Field(
        None, description="how every radar of the rig is simulated: the fields that stand here replace those of the rig"
    )
    num_frames: int = Field(5, ge=1, description="consecutive frames")
    duration: Seconds | None = Field(
        None, gt=0.0, le=1e6, exclude=True, description="instead of num_frames, rounded up to whole frames [s]"
    )
    frame_rate: Hertz = Field(10.0, gt=0.0, le=1e6, description="[Hz]")
    start_time: Seconds = Field(0.0, description="time of the first frame [s]")
    seed: int = Field(0, ge=0, description="root of all random numbers")
    name: str | None = Field(
        None, pattern=r"^[A-Za-z0-9_\-]+$", description="name of the sequence in a dataset; default: that of the scene"
    )
    noise_of: str | None = Field(
        None,
        pattern=r"^[A-Za-z0-9_\-]+$",
        description="drives that state the same name here have the same noise by seed, "
        "time and sensor; default: `name`, else the name of its file, else that of the scene",
    )
    split: Literal["train", "val", "test"] = Field("train", description="split of a dataset that it belongs to")
    lighting: LightingField = Field(None, description="default: that of the scene")
    weather: WeatherField = Field(None, description="default: clear")
    changes: tuple[ConditionsSpec, ...] = Field(
        (), description="light and weather from later times on, which rise; what one does not state stays as it was"
    )
    ego: EgoSpec | None = Field(None, description="default: the scene's own")
    actors: tuple[ActorSpec, ...] = Field((), description="with names of their own")
    keep_default_actors: bool | None = Field(
        None,
        description="whether the scene's own actors stay; default: if there are no others. Its ego leaves only for "
        "another",
    )
    traffic: TrafficSpec | None = None
    randomization: RandomizationSpec = Field(RandomizationSpec(), description="what is drawn at random")
    springs: bool = Field(True, description="whether bodies of vehicles pitch and roll on their springs")
    collisions: Literal["error", "warn", "allow"] = Field("error", description="what bodies that overlap do")

    _origin: Origin | None = PrivateAttr(None)

    def __init__(self, **data: object) -> None:
        try:
            super().__init__(**data)
        except ParameterRangeError as error:
            raise ScenarioError.first_of(problems_of(error, None, data)) from error

    @model_validator(mode="after")
    def _frames(self) -> ScenarioSpec:
        given = self.model_fields_set
        if self.duration is not None and "duration" in given:
            if "num_frames" in given:
                raise ScenarioValueError("stands beside `num_frames`: give one of them", ScenarioPlace("duration"))
            frames = max(math.ceil(self.duration * self.frame_rate - _WHOLE), 1)
            object.__setattr__(self, "num_frames", frames)
        object.__setattr__(self, "duration", self.num_frames / self.frame_rate)
        return self

    @model_validator(mode="before")
    @classmethod
    def _clock(cls, data: object) -> object:
        """Refuse a lighting by the clock beside an hour that is drawn: which of the two counts cannot be told."""
        if isinstance(data, Mapping) and isinstance(light := data.get("lighting"), Mapping):
            draws = data.get("randomization")
            hour = draws.get("hour") if isinstance(draws, Mapping) else getattr(draws, "hour", None)
            if hour is not None and (stated := next((key for key in CLOCK if key in light), None)):
                raise ScenarioValueError(
                    "stands beside `randomization.hour`, which draws the sun's place",
                    ScenarioPlace(f"lighting.{stated}"),
                    "leave it out; `randomization` has `day_of_year`, `latitude_deg` and `north_deg`",
                )
        return data

    @model_validator(mode="after")
    def _draws(self) -> ScenarioSpec:
        stated = {"variant": self.variant != 0, "weather": self.weather is not None}
        for name, is_stated in stated.items():
            if is_stated and getattr(self.randomization, name) is not None:
                said = f"stands beside `randomization.{name}`, which draws it"
                raise ScenarioValueError(said, ScenarioPlace(name), "leave one of them out")
        return self

    @model_validator(mode="after")
    def _changes(self) -> ScenarioSpec:
        for index, (before, after) in enumerate(pairwise(self.changes), start=1):
            if not after.time > before.time:
                said = f"= {after.time:g} s does not come after the change before it at {before.time:g} s"
                raise ScenarioValueError(said, ScenarioPlace(f"changes[{index}].time"), "let their times rise")
        return self

    @model_validator(mode="after")
    def _names(self) -> ScenarioSpec:
        seen = {"ego"} if self.ego is not None else set()
        for index, actor in enumerate(self.actors):
            if actor.name in seen:
                raise ScenarioValueError(
                    f"'{actor.name}' is the name of another actor",
                    ScenarioPlace(f"actors[{index}].name"),
                    "give it another name",
                )
            seen.add(actor.name)
        return self

    def __eq__(self, other: object) -> bool:
        """Return whether two scenarios say the same, wherever they were read."""
        if not isinstance(other, ScenarioSpec):
            return NotImplemented
        return self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        return hash(self.to_json())

    @property
    def scene_name(self) -> str:
        """Name of the sequence in a dataset."""
        return self.name or _word(self.scene)

    @property
    def noise_name(self) -> str:
        """Name that noise is drawn by, beside the seed: `noise_of`, `name`, that of its file or of the scene."""
        return self.noise_of or self.name or _word(self.scene if self._origin is None else self._origin.file)

    @property
    def folder(self) -> Path | None:
        """Folder of the scenario's file, beside which the files that it names are looked for first."""
        return None if self._origin is None else self._origin.folder

    @property
    def times(self) -> tuple[float, ...]:
        """Time of each frame [s]."""
        return tuple(self.start_time + index / self.frame_rate for index in range(self.num_frames))

    @property
    def keeps_actors(self) -> bool:
        """Whether the scene's own actors stay."""
        if self.keep_default_actors is not None:
            return self.keep_default_actors
        return self.ego is None and not self.actors and self.traffic is None

    def place(self, *path: str | int) -> ScenarioPlace:
        """Return where a key of this scenario stands, for an error about it.

        Without a line if it was made in Python.
        """
        return place_of(path, self._origin)

    def find(self, path: str) -> Path:
        """Return a file that the scenario names.

        Relative to the folder of the scenario's own file, else to the working one.
        """
        if self._origin is not None and (beside := self._origin.folder / path).exists():
            return beside
        return Path(path)

    def resolved(self) -> ScenarioSpec:
        """Return the scenario with absolute paths of files, the same in another process and folder."""

        def walk(value: FieldValue, key: str = "") -> FieldValue:
            if isinstance(value, dict):
                return {name: walk(item, name) for name, item in value.items()}
            if isinstance(value, list):
                return [walk(item, key) for item in value]
            is_path = key in ("file", "scene", "model") and isinstance(value, str)
            if is_path and ("/" in value or Path(value).suffix) and (found := self.find(value)).exists():
                return str(found.resolve())
            return value

        other = type(self)(**walk(self.to_dict()))
        other._origin = self._origin
        return other

    def with_(self, **changes: object) -> ScenarioSpec:
        """Return a copy with some fields changed; the copy is validated again.

        A `duration` replaces the number of frames.
        """
        values = {name: getattr(self, name) for name in type(self).model_fields if name in self.model_fields_set}
        values |= {"num_frames": self.num_frames}
        values.pop("duration", None)
        if "duration" in changes and "num_frames" not in changes:
            values.pop("num_frames")
        other = type(self)(**{**values, **changes})
        if self._origin is not None:
            other._origin = self._origin.without(changes)
        return other

    @classmethod
    def load(cls, path: str | Path) -> ScenarioSpec:
        """Return the scenario of a YAML or JSON file, where a key left out keeps its default, or of OpenSCENARIO XML.

        Raises
        ------
        ScenarioError
            If the file is not readable, or a key or value is not allowed. It names file, line and key, and all that was
            found.
        """
        path = Path(path)
        if path.suffix.lower() == ".xosc":
            from scarl_sionna.scenario.openscenario.actors import scenario_data

            data, marks = scenario_data(path)
            origin = Origin(str(path), path.resolve().parent, marks)
        else:
            data, origin = read_marked(path)
        if not isinstance(data, dict):
            raise ScenarioValueError(
                "scenario file holds no mapping",
                place_of((), origin),
                "write keys: " + ", ".join(cls.model_fields),
                value=path,
            )
        try:
            scenario = cls(**data)
        except ScenarioError as error:
            cause = error.__cause__ if isinstance(error.__cause__, ParameterRangeError) else error
            raise ScenarioError.first_of(problems_of(cause, origin, data)) from cause
        scenario._origin = origin
        return scenario

    @classmethod
    def preset(cls, name: str) -> ScenarioSpec:
        """Return a ready scenario: one of `scenario_names`.

        Raises
        ------
        UnknownNameError
            If there is none of this name.
        """
        if name not in scenario_names():
            raise UnknownNameError("scenario", name, scenario_names())
        return cls.load(LIBRARY / f"{name}.yaml")

    def to_dict(self) -> dict[str, Any]:
        """Return all that is not None as plain data.

        Without `springs` where they are at work, so that a scenario of before has the bytes of before.
        """
        plain = self.model_dump(mode="json", exclude_none=True)
        if plain["springs"]:
            del plain["springs"]
        return plain

    def to_json(self) -> str:
        """Return the canonical text: the same for scenarios that say the same."""
        return json.dumps(self.to_dict(), sort_keys=True, separators=(",", ":"))

    def save(self, path: str | Path) -> None:
        """Write the scenario to a YAML file (``.yaml``, ``.yml``) or a JSON file.

        What is given as a preset stands there with its values, so that the file keeps its meaning. A drive with neither
        `name` nor `noise_of` goes by the name of its file, so that each file has noise of its own: under another name
        it has other noise. ``with_(noise_of=drive.noise_name)`` keeps it.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        path = Path(path)
        data = self.to_dict()
        text = json.dumps(data, indent=2) + "\n" if path.suffix == ".json" else yaml.safe_dump(data, sort_keys=False)
        try:
            path.write_text(text, encoding="utf-8")
        except OSError as error:
            raise OutputError(
                f"cannot write the scenario to {path}: {error.strerror}; choose a writable folder"
            ) from error


def _word(file: str) -> str:
    """Return the name of a file, without folder and suffix, in letters, digits, ``_`` and ``-``."""
    return re.sub(r"[^A-Za-z0-9_\-]", "_", Path(file).stem)


def scenario_names() -> tuple[str, ...]:
    """Return the names of the ready scenarios, sorted."""
    return tuple(sorted(path.stem for path in LIBRARY.glob("*.yaml")))
