"""Options about scenarios and radars that several commands share: the same flags with the same meaning on all."""

from __future__ import annotations

import functools
import inspect
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields
from typing import Annotated, Any, cast

import typer
import yaml

import scenes_xml
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.settings.radar import PLAIN_METHODS, QUALITIES, RadarSettings
from scarl_sionna.core.specs.lighting import LIGHTING_PRESETS
from scarl_sionna.core.specs.weather import WEATHER_PRESETS
from scarl_sionna.core.untrusted.yaml_text import parse_yaml
from scarl_sionna.fusion.rig import RIG_PRESETS
from scarl_sionna.scenario.spec.fields import with_field
from scarl_sionna.scenario.spec.scenario import ScenarioSpec

from .common import completing

_DEFAULTS = ScenarioSpec()
_RADAR = RadarSettings()

SCENARIO_OPTIONS: Mapping[str, Any] = {
    "num_frames": Annotated[
        int | None, typer.Option("--frames", help=f"Number of frames (default: {_DEFAULTS.num_frames}).")
    ],
    "duration": Annotated[float | None, typer.Option(help="Length instead of a number of frames [s].")],
    "frame_rate": Annotated[
        float | None, typer.Option(help=f"Frames a second [Hz] (default: {_DEFAULTS.frame_rate:g}).")
    ],
    "quality": Annotated[
        str | None,
        typer.Option(
            autocompletion=completing(lambda: QUALITIES),
            help=f"{' or '.join(QUALITIES)}: effort of all sensors (default: {_DEFAULTS.quality}).",
        ),
    ],
    "variant": Annotated[
        int | None, typer.Option(help=f"Variant of the scene, built on first use (default: {_DEFAULTS.variant}).")
    ],
    "detail": Annotated[
        str | None,
        typer.Option(
            autocompletion=completing(lambda: scenes_xml.DETAILS),
            help=f"Level of geometry, light or detailed (default: {_DEFAULTS.detail}).",
        ),
    ],
    "lighting": Annotated[
        str | None,
        typer.Option(
            autocompletion=completing(lambda: LIGHTING_PRESETS),
            help=f"{', '.join(LIGHTING_PRESETS)} (default: that of the scene).",
        ),
    ],
    "weather": Annotated[
        str | None,
        typer.Option(
            autocompletion=completing(lambda: WEATHER_PRESETS),
            help=f"{', '.join(WEATHER_PRESETS)} (default: clear).",
        ),
    ],
    "rig": Annotated[
        str | None,
        typer.Option(
            autocompletion=completing(lambda: RIG_PRESETS),
            help="front: one suite of five sensors; scarl: six suites all around; or the path of a rig file "
            f"(default: {_DEFAULTS.rig}).",
        ),
    ],
    "seed": Annotated[int | None, typer.Option(help=f"Root of all random numbers (default: {_DEFAULTS.seed}).")],
}
"""Fields of a :class:`ScenarioSpec` by their names."""

RADAR_OPTIONS: Mapping[str, tuple[str, Any]] = {
    "method": (
        "method",
        Annotated[
            str | None,
            typer.Option(
                autocompletion=completing(lambda: PLAIN_METHODS),
                help=f"Radar channel: {', '.join(PLAIN_METHODS)} (default: that of the rig).",
            ),
        ],
    ),
    "tolerance_db": (
        "accuracy.channel_tolerance_db",
        Annotated[float | None, typer.Option(help="Error of an object's echo that auto aims at [dB].")],
    ),
    "tube_budget": (
        "accuracy.tube_budget",
        Annotated[int | None, typer.Option(help="Ray tubes that auto may spend on physical optics in one solve.")],
    ),
    "max_distance": (
        "max_distance",
        Annotated[float | None, typer.Option(help="Farthest radar echo [m] (default: the unambiguous range).")],
    ),
    "noise": ("noise", Annotated[bool | None, typer.Option("--noise/--no-noise", help="Thermal noise of the radars.")]),
    "chirps_per_block": (
        "chirps_per_block",
        Annotated[
            int | None,
            typer.Option(help="Solve the radar paths again for blocks of so many chirps (wheels, limbs; not raycast)."),
        ],
    ),
}
"""Fields of :class:`RadarSettings` by their paths."""

_SET = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="FIELD=VALUE",
        help="Any other field of the scenario, for instance radar.raycast.num_rays=50000 or radar.sbr.max_depth=2. "
        "May be repeated. Of export also several values with commas, all combinations: weather=rain,clear.",
    ),
]


@dataclass(frozen=True)
class ScenarioOptions:
    """What a command line says about its scenarios."""

    fields: Mapping[str, Any] = field(default_factory=dict)
    radar: Mapping[str, Any] = field(default_factory=dict)
    further: tuple[str, ...] = ()

    def apply(self, scenario: ScenarioSpec) -> ScenarioSpec:
        """Return a scenario with what the command line says; all of it is checked.

        Raises
        ------
        UnknownNameError
            If ``--set`` names no field.
        ParameterRangeError
            If a value is not allowed.
        """
        changes = {name: value for name, value in self.fields.items() if value is not None}
        scenario = scenario.with_(**changes) if changes else scenario
        for name, value in self.radar.items():
            if value is not None:
                scenario = with_field(scenario, f"radar.{RADAR_OPTIONS[name][0]}", value)
        for path, values in self._further():
            if len(values) > 1:
                raise ParameterRangeError(
                    f"--set {path}", f"{len(values)} values", "one value", "only export takes several; a list is [1, 2]"
                )
            try:
                scenario = with_field(scenario, path, values[0])
            except ParameterRangeError as error:
                if isinstance(values[0], list):
                    listed = ",".join(map(str, values[0]))
                    raise ParameterRangeError(
                        f"--set {path}", values[0], "no list", f"for a drive of each value: --set '{path}={listed}'"
                    ) from error
                raise
        return scenario

    def divided(self) -> tuple[ScenarioOptions, dict[str, list[object]]]:
        """Return what is one value for all, and the fields of which several values are given: ``weather=rain,clear``.

        Raises
        ------
        ParameterRangeError
            If a text is not FIELD=VALUE, or a value is not YAML.
        """
        several = {path: values for path, values in self._further() if len(values) > 1}
        single = tuple(text for text in self.further if text.partition("=")[0].strip() not in several)
        return ScenarioOptions(self.fields, self.radar, single), several

    def _further(self) -> Iterator[tuple[str, list[object]]]:
        """Yield the path and the values of each ``--set``."""
        seen = set[str]()
        options = {name: name for name, value in self.fields.items() if value is not None}
        options |= {f"radar.{RADAR_OPTIONS[name][0]}": name for name, value in self.radar.items() if value is not None}
        for text in self.further:
            path, equals, value = text.partition("=")
            if not equals or not path.strip():
                raise ParameterRangeError("--set", text, "FIELD=VALUE, for instance radar.raycast.num_rays=50000")
            path = path.strip()
            if path in options:
                option = f"--{options[path].replace('_', '-')}"
                raise ParameterRangeError(
                    "--set", f"{path} beside {option}", "each field once", "leave one of them out"
                )
            if path in seen:
                remedy = f"several values stand in one, with commas: --set {path}=a,b"
                raise ParameterRangeError("--set", f"{path} twice", "each field once", remedy)
            seen.add(path)
            yield path, _values(text, value)

    @property
    def says_anything(self) -> bool:
        """Whether any option is given."""
        return bool(self.further) or any(value is not None for value in (*self.fields.values(), *self.radar.values()))


def _values(text: str, value: str) -> list[object]:
    """Return the values of a text with commas between them; those in brackets, braces and quotes separate none."""
    try:
        several = parse_yaml(f"[{value}]")
    except yaml.YAMLError:
        several = None
    if isinstance(several, list) and len(several) > 1:
        return list(several)
    return [_value(text, value)]


def _value(text: str, value: str) -> object:
    """Return a value as YAML has it: numbers, true, null, lists, texts."""
    try:
        return parse_yaml(value)
    except yaml.YAMLError as error:
        raise ParameterRangeError("--set", text, "a value as in YAML", str(error).splitlines()[0]) from error


def scenario_options(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the shared options; it takes them as one argument, ``chosen``, a :class:`ScenarioOptions`."""
    shared = {**SCENARIO_OPTIONS, **{name: entry[1] for name, entry in RADAR_OPTIONS.items()}, "further": _SET}

    def build(**given: object) -> ScenarioOptions:
        return ScenarioOptions(
            {name: given[name] for name in SCENARIO_OPTIONS},
            {name: given[name] for name in RADAR_OPTIONS},
            tuple(cast("Iterable[str]", given["further"] or ())),
        )

    parameters, hints = _parameters(command)
    own = [entry for entry in parameters if entry.name != "chosen"]
    options = [_parameter(name, kind, None) for name, kind in shared.items()]
    return _taking(command, [*own, *options], {"chosen": (build, tuple(shared))}, {**hints, **shared})


def grouped_options(*names: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the options that the fields of dataclasses state; it takes each dataclass as one argument.

    Parameters
    ----------
    *names : str
        Of the command's arguments that are such groups: annotated with a dataclass whose fields are annotated as Typer
        has it. The options stand where the group stands.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        parameters, hints = _parameters(command)
        groups: dict[str, tuple[Callable[..., Any], tuple[str, ...]]] = {}
        taken: list[inspect.Parameter] = []
        for entry in parameters:
            if entry.name not in names:
                taken.append(entry)
                continue
            kind = hints[entry.name]
            inner = typing.get_type_hints(kind, include_extras=True)
            empty = inspect.Parameter.empty
            taken += [
                _parameter(item.name, inner[item.name], empty if item.default is MISSING else item.default)
                for item in fields(kind)
            ]
            groups[entry.name] = (kind, tuple(inner))
            hints |= inner
        return _taking(command, taken, groups, hints)

    return decorate


def _parameter(name: str, kind: object, default: object) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)


def _parameters(command: Callable[..., None]) -> tuple[list[inspect.Parameter], dict[str, Any]]:
    """Return what a command takes, and the types of it."""
    hints = typing.get_type_hints(command, include_extras=True)
    entries = inspect.signature(command).parameters.values()
    return [_parameter(entry.name, hints[entry.name], entry.default) for entry in entries], hints


def _taking(
    command: Callable[..., None],
    parameters: list[inspect.Parameter],
    groups: Mapping[str, tuple[Callable[..., Any], tuple[str, ...]]],
    hints: Mapping[str, Any],
) -> Callable[..., None]:
    """Return a command that takes some parameters and gathers those of each group into one argument of the command."""

    @functools.wraps(command)
    def wrapped(**given: object) -> None:
        gathered = {
            argument: build(**{name: given.pop(name) for name in names}) for argument, (build, names) in groups.items()
        }
        command(**given, **gathered)

    wrapped.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    wrapped.__annotations__ = {entry.name: hints[entry.name] for entry in parameters}
    return wrapped
