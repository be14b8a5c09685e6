"""A plan on a world: which instances each share owns, and that no echo is computed twice.

The rule of ownership, and what it does not cover, stands in docs/accuracy.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from scarl_sionna.core.errors import ParameterRangeError, ScarlError, UnknownNameError
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.core.settings.plan import COHERENT, REST, ChannelPlan

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World


class OwnershipError(ScarlError, ValueError):
    """Two parts of a plan would compute the same echo."""

    def __init__(self, instance: str, first: str, second: str, why: str, remedy: str) -> None:
        self.instance, self.owners = instance, (first, second)
        super().__init__(f"'{instance}' is given to {first} and to {second}: {why}; {remedy}")


class Seen(NamedTuple):
    """Ids of objects that are seen over mirrors, and of these.

    `weights` has what the field of an object over a mirror counts by, where that is not 1.
    """

    objects: tuple[int, ...]
    mirrors: tuple[int, ...]
    weights: Mapping[tuple[int, int], float] = MappingProxyType({})


@dataclass(frozen=True)
class ResolvedPlan:
    """A plan with instance ids: those of each share, the mirrors, and for each share which objects are seen over which.

    `reflections` has for each share which objects are seen over which mirrors, `lit` what of each share waves meet
    first.
    """

    plan: ChannelPlan
    owned: tuple[tuple[int, ...], ...]
    mirrors: tuple[int, ...]
    reflections: tuple[tuple[Seen, ...], ...] = ()
    lit: tuple[tuple[int, ...], ...] = ()


def resolve(plan: ChannelPlan, world: World) -> ResolvedPlan:
    """Return a plan with the ids of a world's instances.

    Raises
    ------
    UnknownNameError
        If a name is neither an instance nor a class of the scene.
    ParameterRangeError
        If a reflection, or what is lit of a share, names what the share does not own.
    OwnershipError
        If an instance is in two shares, or is a mirror and owned by a coherent solver.
    """
    named = [ids_of(world, [item for item in share.instances if item != REST]) for share in plan.shares]
    owner: dict[int, int] = {}
    for index, numbers in enumerate(named):
        for number in numbers:
            if number in owner:
                _refuse(plan, world, number, owner[number], index)
            owner[number] = index
    rest = [index for index, share in enumerate(plan.shares) if REST in share.instances]
    if len(rest) > 1:
        free = next((number for number in world.instances if number not in owner), 1)
        _refuse(plan, world, free, rest[0], rest[1])
    away = set(ids_of(world, [entry["instance"] for entry in plan.left_out if "instance" in entry]))
    mirrors = ids_of(world, plan.mirrors)
    for number in world.instances:
        if rest and number not in owner and number not in away:
            owner[number] = rest[0]
    for number in mirrors:
        if number in owner and plan.shares[owner[number]].solver in COHERENT:
            raise OwnershipError(
                world.instances[number].name,
                f"'{plan.shares[owner[number]].solver}'",
                "the mirrors ('sionna')",
                "its coherent reflection would be there twice",
                "take it out of one of them; a mirror's rough part may be given to 'raycast'",
            )
    owned = [tuple(number for number in sorted(owner) if owner[number] == index) for index in range(len(plan.shares))]
    lit = tuple(_lit(plan, world, index, owned[index]) for index in range(len(owned)))
    reflections = tuple(_reflections(plan, world, index, owned[index], mirrors) for index in range(len(owned)))
    return ResolvedPlan(plan, tuple(owned), tuple(mirrors), reflections, lit)


def _lit(plan: ChannelPlan, world: World, index: int, owned: tuple[int, ...]) -> tuple[int, ...]:
    """Return what of a share waves meet first: all of it unless it says so."""
    chosen = tuple(ids_of(world, plan.shares[index].lit)) or owned
    for number in chosen:
        if number not in owned:
            _refuse_foreign("lit", world, number, index)
    return chosen


def _refuse_foreign(field: str, world: World, number: int, index: int) -> None:
    name = world.instances[number].name
    raise ParameterRangeError(field, f"'{name}'", f"instances of the share (share {index})", "put it into `instances`")


def _reflections(
    plan: ChannelPlan, world: World, index: int, owned: Sequence[int], mirrors: Sequence[int]
) -> tuple[Seen, ...]:
    """Return the objects of a share and the mirrors over which they are seen, each pair of them once."""
    share = plan.shares[index]
    if not share.through_mirrors or not mirrors or not owned:
        return ()
    if not share.reflections:
        return (Seen(tuple(owned), tuple(mirrors)),)
    found, seen = [], set()
    for reflection in share.reflections:
        objects, over = ids_of(world, reflection.instances), ids_of(world, reflection.mirrors)
        for number in objects:
            name = world.instances[number].name
            if number not in owned:
                _refuse_foreign("reflections", world, number, index)
            if number in seen:
                raise OwnershipError(
                    name,
                    f"one reflection of share {index}",
                    "another",
                    "its echoes over mirrors would be counted twice",
                    "name it in one of them, with all mirrors",
                )
            seen.add(number)
        for number in over:
            if number not in mirrors:
                raise ParameterRangeError(
                    "reflections",
                    f"'{world.instances[number].name}'",
                    "mirrors of the plan",
                    "put it into `mirrors` of the plan",
                )
        weights: dict[tuple[int, int], float] = {}
        for item, row in zip(reflection.instances, reflection.weights, strict=False):
            for mirror, weight in zip(reflection.mirrors, row, strict=True):
                pairs = ((one, other) for one in ids_of(world, [item]) for other in ids_of(world, [mirror]))
                weights |= {pair: weight for pair in pairs if weight != 1.0}
        found.append(Seen(tuple(objects), tuple(over), weights))
    return tuple(found)


def _refuse(plan: ChannelPlan, world: World, number: int, first: int, second: int) -> None:
    raise OwnershipError(
        world.instances[number].name,
        f"'{plan.shares[first].solver}' (share {first})",
        f"'{plan.shares[second].solver}' (share {second})",
        "its echo would be counted twice",
        "name it in one share only",
    )


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
