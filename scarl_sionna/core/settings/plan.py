"""Which solver computes what, as plain data.

A plan gives every instance of a scene to one solver, and names the mirrors.

The rule of ownership, and what it does not cover, stands in docs/accuracy.md.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal, TypeVar

from scarl_sionna.core.errors import InputTypeError, ParameterRangeError, UnknownNameError
from scarl_sionna.core.prompt.describe import Described
from scarl_sionna.core.spec import Spec

from .raycast import RaycastSettings
from .sbr import SbrSettings
from .scatterers import ScattererSettings
from .sionna import SionnaSettings

PartOfPlan = TypeVar("PartOfPlan", "ChannelPlan", "Share", "Reflection")

REST = "*"
"""Stands for every instance that no other share of the plan names."""
OBJECT_SOLVERS: Mapping[str, type[Spec]] = {
    "sbr": SbrSettings,
    "scatterers": ScattererSettings,
    "raycast": RaycastSettings,
}
"""Solvers that can own instances, in the order of their paths, with their settings."""
COHERENT = ("sbr", "scatterers")
CHAIN_SOLVERS = ("sionna", "images")
"""Of them, those whose paths have a phase that means something: what a mirror adds to them is coherent, too."""


def _settings(kind: type[Spec], value: Spec | Mapping[str, Any] | None, name: str) -> Spec | None:
    """Return settings of a kind, from a mapping of its fields where one is given."""
    if value is None or isinstance(value, kind):
        return value
    if isinstance(value, Mapping):
        return kind.of(**value)
    raise InputTypeError(name, value, f"a {kind.__name__} or a mapping of its fields")


def of_mapping(kind: type[PartOfPlan], data: Mapping[str, Any]) -> PartOfPlan:
    """Return a :class:`ChannelPlan` or a :class:`Share` of a mapping of its fields.

    Raises
    ------
    UnknownNameError
        If it has no such field.
    """
    known = [item.name for item in fields(kind)]
    for name in data:
        if name not in known:
            raise UnknownNameError(f"field of a {kind.__name__}", str(name), known)
    return kind(**data)


@dataclass(frozen=True)
class Reflection:
    """Objects of a share, and the mirrors over which they are seen.

    Attributes
    ----------
    instances : sequence of str or int
        Names, ids or classes, all of the share.
    mirrors : sequence of str or int
        Names, ids or classes, all of them mirrors of the plan.
    weights : sequence of sequences of float
        By which the field of each object over each mirror counts, 0 to 1, a row for each object, once for each leg over
        the mirror; all 1 if empty.

    Raises
    ------
    ParameterRangeError
        If a field is a text, or the weights are not as many as objects and mirrors, or not from 0 to 1.
    """

    instances: tuple[str | int, ...]
    mirrors: tuple[str | int, ...]
    weights: tuple[tuple[float, ...], ...] = ()

    def __post_init__(self) -> None:
        for name in ("instances", "mirrors"):
            value = getattr(self, name)
            if isinstance(value, str):
                raise ParameterRangeError(name, repr(value), "a sequence of names", "write ('name',)")
            object.__setattr__(self, name, tuple(value))
        weights = tuple(tuple(float(weight) for weight in row) for row in self.weights)
        shape = [len(self.mirrors)] * len(self.instances)
        if weights and [len(row) for row in weights] != shape:
            allowed = f"{len(shape)} rows of {len(self.mirrors)}"
            raise ParameterRangeError("weights", f"rows of {[len(row) for row in weights]}", allowed)
        for weight in (weight for row in weights for weight in row):
            if not 0.0 <= weight <= 1.0:
                raise ParameterRangeError("weights", weight, "0 to 1")
        object.__setattr__(self, "weights", weights)

    def only(self, instances: Collection[str | int]) -> Reflection:
        """Return the part for some of the instances."""
        kept = [place for place, item in enumerate(self.instances) if item in instances]
        rows = tuple(self.weights[place] for place in kept) if self.weights else ()
        return Reflection(tuple(self.instances[place] for place in kept), self.mirrors, rows)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        weights = [list(row) for row in self.weights]
        return {"instances": list(self.instances), "mirrors": list(self.mirrors), "weights": weights}


@dataclass(frozen=True, repr=False)
class Share(Described):
    """Instances that one solver computes.

    Attributes
    ----------
    solver : {"sbr", "scatterers", "raycast"}
    instances : sequence of str or int
        Names, ids, semantic classes (all instances of a class), or ``"*"`` for all that no other share names.
    settings : SbrSettings, ScattererSettings or RaycastSettings, or a mapping of their fields, optional
        Of the solver; those of the :class:`~scarl_sionna.RadarSettings` of the solve if left out.
    through_mirrors : bool
        Also the echoes by the plan's mirrors; for the coherent solvers only.
    reflections : sequence of Reflection, or mappings of their fields
        Which of the objects are seen over which mirrors; all over all if empty and `through_mirrors` is true.
    reason : str
        Why, for the diagnostics.
    lit : sequence of str or int
        Names, ids or classes, all of the share: what waves meet first. The others of the share only take part in
        bounces. All if empty; for `sbr` only.
    by_material : sequence of int
        Rows of the table of parts: flat mirrors whose rough part follows the law of their material, none if that is
        smooth, and not their class; for `raycast` only.

    Raises
    ------
    UnknownNameError
        If there is no such solver of objects, or no such field in its settings.
    ParameterRangeError
        If `instances` or `lit` is a text, `through_mirrors` is asked of a solver that is not coherent, `lit` of
        another one than `sbr`, or `by_material` of another one than `raycast`.
    """

    solver: str
    instances: tuple[str | int, ...] = (REST,)
    settings: Any = None
    through_mirrors: bool = False
    reason: str = ""
    reflections: tuple[Reflection, ...] = ()
    lit: tuple[str | int, ...] = ()
    by_material: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if self.solver not in OBJECT_SOLVERS:
            raise UnknownNameError(
                "solver of objects",
                self.solver,
                OBJECT_SOLVERS,
                "mirror chains ('sionna') belong to `mirrors` of the plan",
            )
        for name in ("instances", "lit"):
            value = getattr(self, name)
            if isinstance(value, str):
                raise ParameterRangeError(name, repr(value), "a sequence of names", "write ('name',)")
            object.__setattr__(self, name, tuple(value))
        if self.lit and self.solver != "sbr":
            raise ParameterRangeError("lit", f"given for '{self.solver}'", "'sbr', whose bodies bounce", "leave it out")
        object.__setattr__(self, "by_material", tuple(int(part) for part in self.by_material))
        if self.by_material and self.solver != "raycast":
            raise ParameterRangeError(
                "by_material", f"given for '{self.solver}'", "'raycast', which has classes", "leave it out"
            )
        object.__setattr__(self, "settings", _settings(OBJECT_SOLVERS[self.solver], self.settings, "Share.settings"))
        over = tuple(
            item if isinstance(item, Reflection) else of_mapping(Reflection, item) for item in self.reflections
        )
        object.__setattr__(self, "reflections", over)
        if over:
            object.__setattr__(self, "through_mirrors", True)
        if self.through_mirrors and self.solver not in COHERENT:
            raise ParameterRangeError(
                "through_mirrors",
                f"True for '{self.solver}'",
                f"a coherent solver: {', '.join(COHERENT)}",
                "its paths have random phases, which mirrors cannot turn into a fixed interference",
            )

    def to_dict(self, mode: str = "json") -> dict[str, Any]:
        """Return plain data; ``mode="python"`` keeps models that are in memory as their type's name."""
        return {
            "solver": self.solver,
            "instances": list(self.instances),
            "settings": _plain(self.settings, mode),
            "through_mirrors": self.through_mirrors,
            "reflections": [item.to_dict() for item in self.reflections],
            "reason": self.reason,
            "lit": list(self.lit),
            **({"by_material": list(self.by_material)} if self.by_material else {}),
        }


@dataclass(frozen=True, repr=False)
class ChannelPlan(Described):
    """Which solver computes what of a scene.

    Attributes
    ----------
    shares : sequence of Share
    mirrors : sequence of str or int
        Instances (names, ids or classes) that act as flat mirrors: `sionna` computes the chains of reflections between
        them, and the shares that ask for it are seen through them.
    mirror_faces : sequence of int
        Faces of the mirrors, rows of the table of all triangles of the state, whose flat regions are mirrors whatever
        their size, beside the largest ``MirrorSettings.max_mirrors`` of all.
    echoes : bool
        Whether chains of mirrors only, from the radar back to itself, are computed.
    mirror_depth : int
        Most mirrors on one way, there or back, of an echo through mirrors.
    chains : {"sionna", "images"}
        Who finds the chains of mirrors only: rays of the solver `sionna`, over any faces of the mirrors, with the
        interactions of its settings; or images of the radar in their flat faces that are larger than the first Fresnel
        zone, up to its `max_depth` reflections, which needs no rays.
    sionna : SionnaSettings or a mapping of its fields, optional
        For the chains of mirrors only; those of the solve if left out.
    left_out : sequence of mapping
        What is not computed, with the reason and with numbers for its power; for the diagnostics. What names an
        ``instance`` is not among those that ``"*"`` stands for.
    predicted : mapping
        What the maker of the plan expects: ``tubes``, ``cpu_seconds`` of the whole solve by `auto` with planning,
        clutter and second look, ``memory_gib``, ``tolerance_db`` and ``expected_error_db``, the error that 90 % of the
        objects that count keep by the level and by what the budget leaves to class or without reflections; empty for a
        plan by hand.

    Raises
    ------
    ParameterRangeError
        If `mirror_depth` is not 0 to 4, or `chains` none of its two.
    """

    shares: tuple[Share, ...]
    mirrors: tuple[str | int, ...] = ()
    echoes: bool = True
    mirror_depth: int = 1
    chains: Literal["sionna", "images"] = "sionna"
    sionna: Any = None
    left_out: tuple[Mapping[str, Any], ...] = field(default=())
    predicted: Mapping[str, float] = field(default_factory=dict)
    mirror_faces: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        shares = (of_mapping(Share, share) if isinstance(share, Mapping) else share for share in self.shares)
        object.__setattr__(self, "shares", tuple(shares))
        object.__setattr__(self, "mirrors", tuple(self.mirrors))
        object.__setattr__(self, "left_out", tuple(self.left_out))
        object.__setattr__(self, "mirror_faces", tuple(int(face) for face in self.mirror_faces))
        object.__setattr__(self, "sionna", _settings(SionnaSettings, self.sionna, "ChannelPlan.sionna"))
        for share in self.shares:
            if not isinstance(share, Share):
                raise InputTypeError("ChannelPlan.shares", share, "a Share or a mapping of its fields")
        if not 0 <= self.mirror_depth <= 4:
            raise ParameterRangeError("mirror_depth", self.mirror_depth, "0 to 4")
        if self.chains not in CHAIN_SOLVERS:
            raise ParameterRangeError("chains", repr(self.chains), " or ".join(map(repr, CHAIN_SOLVERS)))

    def to_dict(self, mode: str = "json") -> dict[str, Any]:
        """Return plain data, from which ``ChannelPlan(**data)`` makes the plan again; see :meth:`Share.to_dict`."""
        return {
            "shares": [share.to_dict(mode) for share in self.shares],
            "mirrors": list(self.mirrors),
            "mirror_faces": list(self.mirror_faces),
            "echoes": self.echoes,
            "mirror_depth": self.mirror_depth,
            "chains": self.chains,
            "sionna": _plain(self.sionna, mode),
            "left_out": [dict(entry) for entry in self.left_out],
            "predicted": dict(self.predicted),
        }


def _plain(settings: Spec | None, mode: str) -> dict[str, Any] | None:
    """Return the fields that were set, as plain data."""
    if settings is None:
        return None
    data = settings.model_dump(mode=mode, exclude_unset=True)
    if mode == "python" and "models" in data:
        data["models"] = {
            name: model if isinstance(model, str) else type(model).__name__ for name, model in data["models"].items()
        }
    return data
