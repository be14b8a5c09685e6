"""Who computes what: a plan gives every instance of a scene to one solver, and names the surfaces that act as mirrors.

The rule of ownership, and what it does not cover, stands in docs/accuracy.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from scarl_sionna.core.errors import ParameterRangeError, ScarlError, UnknownNameError
from scarl_sionna.core.prompt.describe import Described
from scarl_sionna.core.semantics import SEMANTIC_CLASSES

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World

REST = "*"
"""Stands for every instance that no other share of the plan names."""
OBJECT_SOLVERS = ("sbr", "scatterers", "raycast")
"""Solvers that can own instances, in the order of their paths."""
COHERENT = ("sbr", "scatterers")
"""Of them, those whose paths have a phase that means something: what a mirror adds to them is coherent, too."""


class OwnershipError(ScarlError, ValueError):
    """Two parts of a plan would compute the same echo."""

    def __init__(self, instance: str, first: str, second: str, why: str, remedy: str) -> None:
        self.instance, self.owners = instance, (first, second)
        super().__init__(f"'{instance}' is given to {first} and to {second}: {why}; {remedy}")


@dataclass(frozen=True, repr=False)
class Share(Described):
    """Instances that one solver computes.

    Attributes
    ----------
    solver : {"sbr", "scatterers", "raycast"}
    instances : sequence of str or int
        Names, ids, semantic classes (all instances of a class), or ``"*"`` for all that no other share names.
    options : mapping
        Of the solver, without `instances` and `radar_twist`.
    through_mirrors : bool
        Also the echoes by the plan's mirrors; for the coherent solvers only.
    reason : str
        Why, for the diagnostics.
    """

    solver: str
    instances: tuple[str | int, ...] = (REST,)
    options: Mapping[str, Any] = field(default_factory=dict)
    through_mirrors: bool = False
    reason: str = ""

    def __post_init__(self) -> None:
        if self.solver not in OBJECT_SOLVERS:
            raise UnknownNameError(
                "solver of objects",
                self.solver,
                OBJECT_SOLVERS,
                "mirror chains ('sionna') belong to `mirrors` of the plan",
            )
        if isinstance(self.instances, str):
            raise ParameterRangeError("instances", repr(self.instances), "a sequence of names", "write ('name',)")
        object.__setattr__(self, "instances", tuple(self.instances))
        if self.through_mirrors and self.solver not in COHERENT:
            raise ParameterRangeError(
                "through_mirrors", f"True for '{self.solver}'", f"a coherent solver: {', '.join(COHERENT)}",
                "its paths have random phases, which mirrors cannot turn into a fixed interference",
            )  # fmt: skip
        if reserved := {"instances", "radar_twist", "rx_pose"} & set(self.options):
            raise ParameterRangeError("options", sorted(reserved)[0], "options of the solver other than these")


@dataclass(frozen=True, repr=False)
class ChannelPlan(Described):
    """Which solver computes what of a scene.

    Attributes
    ----------
    shares : sequence of Share
    mirrors : sequence of str or int
        Instances (names, ids or classes) that act as flat mirrors: `sionna` computes the chains of reflections between them,
        and the shares that ask for it are seen through them.
    echoes : bool
        Whether chains of mirrors only, from the radar back to itself, are computed.
    mirror_depth : int
        Most mirrors on one way, there or back, of an echo through mirrors.
    sionna_options : mapping
        Fields of :class:`scarl_sionna.radar.channel.multipath.solve.SionnaSettings`, for the chains of mirrors only.
    left_out : sequence of mapping
        What is not computed although it is in view, with the bound of its power; for the diagnostics.
    """

    shares: tuple[Share, ...]
    mirrors: tuple[str | int, ...] = ()
    echoes: bool = True
    mirror_depth: int = 1
    sionna_options: Mapping[str, Any] = field(default_factory=dict)
    left_out: tuple[Mapping[str, Any], ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "shares", tuple(self.shares))
        object.__setattr__(self, "mirrors", tuple(self.mirrors))
        object.__setattr__(self, "left_out", tuple(self.left_out))
        if not 0 <= self.mirror_depth <= 4:
            raise ParameterRangeError("mirror_depth", self.mirror_depth, "0 to 4")

    def resolve(self, world: World) -> ResolvedPlan:
        """Return the plan with the ids of a world's instances.

        Raises
        ------
        UnknownNameError
            If a name is neither an instance nor a class of the scene.
        OwnershipError
            If an instance is in two shares, or is a mirror and owned by a coherent solver.
        """
        named = [ids_of(world, [item for item in share.instances if item != REST]) for share in self.shares]
        owner: dict[int, int] = {}
        for index, numbers in enumerate(named):
            for number in numbers:
                if number in owner:
                    self._refuse(world, number, owner[number], index)
                owner[number] = index
        rest = [index for index, share in enumerate(self.shares) if REST in share.instances]
        if len(rest) > 1:
            free = next((number for number in world.instances if number not in owner), 1)
            self._refuse(world, free, rest[0], rest[1])
        away = set(ids_of(world, [entry["instance"] for entry in self.left_out]))
        mirrors = ids_of(world, self.mirrors)
        for number in world.instances:
            if rest and number not in owner and number not in away:
                owner[number] = rest[0]
        for number in mirrors:
            if number in owner and self.shares[owner[number]].solver in COHERENT:
                raise OwnershipError(
                    world.instances[number].name, f"'{self.shares[owner[number]].solver}'", "the mirrors ('sionna')",
                    "its coherent reflection would be there twice",
                    "take it out of one of them; a mirror's rough part may be given to 'raycast'",
                )  # fmt: skip
        owned = [
            tuple(number for number in sorted(owner) if owner[number] == index) for index in range(len(self.shares))
        ]
        return ResolvedPlan(self, tuple(owned), tuple(mirrors))

    def _refuse(self, world: World, number: int, first: int, second: int) -> None:
        raise OwnershipError(
            world.instances[number].name, f"'{self.shares[first].solver}' (share {first})",
            f"'{self.shares[second].solver}' (share {second})", "its echo would be counted twice",
            "name it in one share only",
        )  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return the plan as plain data for diagnostics; models and other objects by their type's name."""
        return {
            "shares": [
                {
                    "solver": share.solver, "instances": list(share.instances), "options": _plain(share.options),
                    "through_mirrors": share.through_mirrors, "reason": share.reason,
                }
                for share in self.shares
            ],
            "mirrors": list(self.mirrors), "echoes": self.echoes, "mirror_depth": self.mirror_depth,
        }  # fmt: skip


@dataclass(frozen=True)
class ResolvedPlan:
    """A plan with instance ids: those of each share, and the mirrors."""

    plan: ChannelPlan
    owned: tuple[tuple[int, ...], ...]
    mirrors: tuple[int, ...]


def ids_of(world: World, items: Sequence[str | int]) -> list[int]:
    """Return the instance ids of names, ids and semantic classes, rising.

    Raises
    ------
    UnknownNameError
        If an item is none of them.
    """
    chosen: set[int] = set()
    for item in items:
        by_name = [number for number, info in world.instances.items() if item in (number, info.name)]
        if not by_name and item in SEMANTIC_CLASSES:
            semantic = SEMANTIC_CLASSES.index(str(item))
            by_name = [number for number, info in world.instances.items() if info.semantic == semantic]
        elif not by_name:
            raise UnknownNameError("instance or class", str(item), [info.name for info in world.instances.values()])
        chosen.update(by_name)
    return sorted(chosen)


def _plain(value: Any) -> Any:
    """Return a value as JSON-plain data."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if hasattr(value, "model_dump"):
        return _plain(value.model_dump())
    return value if isinstance(value, (str, int, float, bool, type(None))) else type(value).__name__
