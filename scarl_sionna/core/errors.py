"""Typed errors: what is wrong, the value with its unit, what is allowed, and the remedy.

Every error raised on bad input derives from :class:`ScarlError`, so that a program can tell a user's mistake from a
bug. Each one keeps its data as attributes.
"""

from __future__ import annotations

import errno
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches


class ScarlError(Exception):
    """Base of all errors that scarl-sionna raises on purpose."""


def put_in_front(error: ScarlError, where: str) -> None:
    """Let an error say where it comes from, a file or a part of it, before what it says."""
    error.args = (f"{where}: {error}", *error.args[1:])


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a question with the known name nearest to a misspelt one, or nothing if none is near."""
    close = get_close_matches(str(name), list(known), n=1)
    return f"did you mean '{close[0]}'?" if close else ""


class ParameterRangeError(ScarlError, ValueError):
    """A parameter lies outside its allowed range."""

    def __init__(self, name: str, value: object, allowed: str, remedy: str = "") -> None:
        self.name, self.value, self.allowed, self.remedy = name, value, allowed, remedy
        super().__init__(f"{name} = {value} is not allowed (allowed: {allowed})" + (f"; {remedy}" if remedy else ""))


class BudgetError(ParameterRangeError):
    """A computation is expected to cost more than its budget; `cost` has the figures by name.

    For `sbr`: ``cpu_seconds`` [s], ``memory_gib`` [GiB], and the numbers ``first_tubes``, ``tubes`` and ``patches``.
    """

    def __init__(self, name: str, value: object, allowed: str, remedy: str, cost: Mapping[str, float]) -> None:
        self.cost = dict(cost)
        super().__init__(name, value, allowed, remedy)


class UnknownNameError(ScarlError, KeyError):
    """A name is not among the known ones."""

    def __init__(self, kind: str, name: str, known: Iterable[str], remedy: str = "") -> None:
        self.kind, self.name, self.known, self.remedy = kind, name, sorted(known), remedy
        close = did_you_mean(name, self.known)
        hint = f"; {close}" if close else ""
        listed = ", ".join(self.known) if self.known else "none"
        super().__init__(f"unknown {kind} '{name}' (known: {listed}){hint}" + (f"; {remedy}" if remedy else ""))

    def __str__(self) -> str:  # KeyError would show the repr
        return str(self.args[0])


class InputTypeError(ScarlError, TypeError):
    """A value of another type than the one that is needed."""

    def __init__(self, name: str, value: object, needed: str, remedy: str = "") -> None:
        self.name, self.value, self.needed, self.remedy = name, value, needed, remedy
        super().__init__(f"{name} is a {type(value).__name__}, not {needed}" + (f"; {remedy}" if remedy else ""))


class SpecError(ParameterRangeError):
    """A field of a specification has a value that is not allowed.

    Attributes
    ----------
    model : type
        The specification's class.
    path : tuple of str or int
        The field, and the way to the value inside it.
    """

    def __init__(self, model: type, path: Sequence[str | int], value: object, allowed: str, remedy: str = "") -> None:
        self.model, self.path = model, tuple(path)
        super().__init__(".".join([model.__name__, *map(str, path)]), value, allowed, remedy)


class UnknownFieldError(SpecError, UnknownNameError, TypeError):
    """A specification has no field of this name; `owner` is the class that lacks it, which may be a part of `model`."""

    def __init__(
        self, model: type, path: Sequence[str | int], known: Iterable[str], remedy: str = "", owner: type | None = None
    ) -> None:
        self.model, self.path, self.remedy, self.owner = model, tuple(path), remedy, owner or model
        self.kind, self.known = f"field of {self.owner.__name__}", sorted(known)
        self.name, self.value, self.allowed = ".".join([model.__name__, *map(str, path)]), None, ", ".join(self.known)
        close = did_you_mean(str(path[-1]), self.known)
        hints = "".join(f"; {hint}" for hint in (close, remedy) if hint)
        Exception.__init__(self, f"{self.name} is an unknown {self.kind} (fields: {self.allowed}){hints}")


class FrozenError(ScarlError, AttributeError, TypeError):
    """A specification or a result cannot be changed, only copied with changes."""


class SceneError(ScarlError):
    """A scene's files are missing, broken or contradict each other."""

    def __init__(self, message: str, path: object = None, remedy: str = "") -> None:
        self.path, self.remedy = path, remedy
        where = f"{path}: " if path is not None else ""
        super().__init__(where + message + (f"; {remedy}" if remedy else ""))


class MapError(SceneError):
    """A street map (OpenDRIVE) cannot be read, or says what cannot be; `line` (from 1): where, None if nowhere."""

    def __init__(self, message: str, path: object = None, remedy: str = "", line: int | None = None) -> None:
        self.line = line
        super().__init__((f"line {line}: " if line is not None else "") + message, path, remedy)


class MeshError(SceneError):
    """A mesh has no faces, vertices that are not finite, or cannot be read."""


class MaterialError(ScarlError):
    """A material is unknown or its entry is not usable."""


_LEAST_CARRIER = 1e6
"""Below it a frequency was meant in another unit than Hz: no radio material has data there."""


class MaterialRangeError(MaterialError):
    """A material has no data at the frequency asked for.

    `frequency` [Hz] lies outside of the interval `valid` [Hz]; the built-in materials `alternatives` have data there.
    """

    def __init__(
        self, material: str, frequency: float, valid: tuple[float, float], alternatives: Iterable[str]
    ) -> None:
        self.material, self.frequency, self.valid = material, frequency, valid
        self.alternatives = sorted(alternatives)
        is_slow = frequency < _LEAST_CARRIER
        shown = f"{frequency:.6g} Hz" if is_slow else f"{frequency / 1e9:.4g} GHz"
        hint = (
            f"choose one of {', '.join(self.alternatives)} or " if self.alternatives else "no built-in material has; "
        )
        hint += "add a sourced entry to a materials.toml"
        super().__init__(
            f"material '{material}' has no data at {shown} (valid: {valid[0] / 1e9:.4g}-{valid[1] / 1e9:.4g} GHz); "
            + ("frequencies are in Hz: 77 GHz is 77e9" if is_slow else hint)
        )


class TimeRangeError(ScarlError, ValueError):
    """A time lies outside the interval in which the scene's motion is known.

    `time` [s] lies outside of `start` to `stop` [s].
    """

    def __init__(self, time: float, start: float, stop: float, what: str) -> None:
        self.time, self.start, self.stop, self.what = time, start, stop, what
        super().__init__(
            f"time {time:.6g} s is outside the motion of {what} ({start:.6g} to {stop:.6g} s); "
            "ask for a time inside, or extend its trajectory"
        )


class PlacementError(ScarlError, ValueError):
    """A sensor or an antenna stands where it cannot work, for instance inside a mesh."""


class EngineError(ScarlError, RuntimeError):
    """The ray tracing engine cannot run on this machine."""


class OutputError(ScarlError, OSError):
    """A result cannot be written."""


class InputFileError(ScarlError, OSError):
    """A file is not what it should be: no regular file, too large, cut, damaged, or not of its format."""

    def __init__(self, message: str, path: object = None, remedy: str = "") -> None:
        self.path, self.remedy = path, remedy
        super().__init__(errno.EINVAL, message + (f"; {remedy}" if remedy else ""))

    def __str__(self) -> str:
        return f"{self.path}: {self.strerror}" if self.path is not None else str(self.strerror)


class MissingPackageError(ScarlError, ImportError):
    """An optional package is not installed."""

    def __init__(self, package: str, extra: str) -> None:
        self.package, self.extra = package, extra
        super().__init__(f"package '{package}' is not installed; pip install 'scarl-sionna[{extra}]'")


class DatasetError(ScarlError):
    """A dataset is not there, is damaged, is of a newer schema, or lacks what is asked for."""

    def __init__(self, message: str, path: object = None, remedy: str = "") -> None:
        self.path, self.remedy = path, remedy
        where = f"{path}: " if path is not None else ""
        super().__init__(where + message + (f"; {remedy}" if remedy else ""))


class DatasetDamage(DatasetError):
    """Bytes of a dataset are not those that were written.

    Attributes
    ----------
    file : str
        Name of the file in the dataset.
    scene : str
    frame : int or None
        The frame that was asked for; None where the damage is not of one frame.
    """

    def __init__(
        self, message: str, path: object = None, remedy: str = "", place: tuple[str, str, int | None] = ("", "", None)
    ) -> None:
        super().__init__(message, path, remedy)
        self.file, self.scene, self.frame = place


class DatasetUnreachable(DatasetError):
    """A server does not answer, or not as a file server does; the dataset may be whole."""


class TrajectoryFileError(ScarlError):
    """A file of recorded motion is not there, or what stands in it is not usable.

    `row` (from 1, without the header), `column`: where.
    """

    def __init__(
        self, message: str, path: object = None, remedy: str = "", row: int | None = None, column: str | None = None
    ) -> None:
        self.path, self.remedy, self.row, self.column = path, remedy, row, column
        where = f"{path}: " if path is not None else ""
        where += f"row {row}: " if row is not None else ""
        where += f"column '{column}': " if column is not None else ""
        super().__init__(where + message + (f"; {remedy}" if remedy else ""))


class SimulatorError(ScarlError, RuntimeError):
    """Another simulator (SUMO) refused its input or stopped."""


class SessionError(ScarlError, RuntimeError):
    """A session is closed, has no body left for an actor, or kept no record."""


class ExportError(ScarlError, RuntimeError):
    """An export stopped; what was finished is kept, and the same command goes on from there."""


@dataclass(frozen=True)
class ScenarioPlace:
    """Where something of a scenario was written.

    Attributes
    ----------
    key : str
        Path of the key, for instance ``"actors[1].trajectory.lanes[0]"``.
    file : str, optional
        The scenario's file; None for a scenario made in Python.
    line, column : int, optional
        In the file, counted from 1.
    """

    key: str = ""
    file: str | None = None
    line: int | None = None
    column: int | None = None

    def __str__(self) -> str:
        where = "scenario" if self.file is None else str(self.file)
        if self.line is not None:
            where += f", line {self.line}" + (f", column {self.column}" if self.column is not None else "")
        return f"{where}: {self.key}" if self.key else where


class ScenarioError(ParameterRangeError):
    """Something in a scenario is wrong. The message names file, line, column and key; so do the attributes.

    Attributes
    ----------
    place : ScenarioPlace
    message, remedy : str
    problems : tuple of ScenarioError
        All that was found wrong, in the order of the lines; the error raised is the first of them.
    """

    def __init__(self, message: str, place: ScenarioPlace | None = None, remedy: str = "", **data: object) -> None:
        self.place = place or ScenarioPlace()
        self.message, self.allowed, self.remedy = message, message, remedy
        self.problems: tuple[ScenarioError, ...] = (self,)
        self.name, self.value = self.place.key or "scenario", data.pop("value", None)
        for name, value in data.items():  # what the other base of a subclass keeps
            setattr(self, name, value)
        Exception.__init__(self, self.text)

    @property
    def file(self) -> str | None:
        """File of the scenario."""
        return self.place.file

    @property
    def line(self) -> int | None:
        """Line in the file, from 1."""
        return self.place.line

    @property
    def column(self) -> int | None:
        """Column in the file, from 1."""
        return self.place.column

    @property
    def key(self) -> str:
        """Path of the key in the scenario."""
        return self.place.key

    @property
    def text(self) -> str:
        """Message of this problem alone, without the others that were found."""
        between = " " if self.place.key and self.message.startswith("= ") else ": "
        return f"{self.place}{between}{self.message}" + (f"; {self.remedy}" if self.remedy else "")

    def __str__(self) -> str:
        others = [problem for problem in self.problems if problem is not self]
        if not others:
            return self.text
        return "\n  ".join([f"{len(self.problems)} problems:", *(problem.text for problem in self.problems)])

    def at(self, place: ScenarioPlace) -> ScenarioError:
        """Return this problem at another place."""
        other = type(self).__new__(
            type(self)
        )  # copy() may share the attributes where a library has registered exceptions with copyreg
        other.__dict__.update(self.__dict__)
        other.args = self.args
        other.place, other.name, other.problems = place, place.key or "scenario", (other,)
        return other

    @staticmethod
    def first_of(problems: Sequence[ScenarioError]) -> ScenarioError:
        """Return the first of some problems in the order of their lines; it tells of all."""
        ordered = sorted(problems, key=lambda one: (one.line is None, one.line or 0, one.column or 0))
        ordered[0].problems = tuple(ordered)
        return ordered[0]


class ScenarioFileError(ScenarioError):
    """A scenario's file, or one that it names, cannot be read, or is not YAML."""


class ScenarioKeyError(ScenarioError):
    """A key is unknown, stands twice or is missing."""


class ScenarioValueError(ScenarioError):
    """A value is of another type or unit, or outside its range."""


class UnsupportedElementError(ScenarioError):
    """An element of an OpenSCENARIO file would decide motion and is not read; the remedy says what would do."""


class ScenarioNameError(ScenarioError, UnknownNameError):
    """A scene, an actor model, a lane or another name is not known."""


class ScenarioTimeError(ScenarioError, TimeRangeError):
    """A motion begins after the first frame or ends before the last one."""


class OutsideSceneError(ScenarioError, PlacementError):
    """An actor stands, drives or walks where there is no ground of the scene."""


class CollisionError(ScenarioError, PlacementError):
    """Two bodies overlap."""


class ScarlWarning(UserWarning):
    """A result is outside the range in which its method is right."""


class MapWarning(ScarlWarning):
    """A street map holds what is not read; the scene's `findings` name the lines."""


class SmallMirrorWarning(ScarlWarning):
    """A mirror reflection comes from a surface smaller than its first Fresnel zone."""
