"""What a plan of ``method="auto"`` leaves out, as entries with a reason and with numbers over the noise of a cell."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.settings.auto import SbrLevel
from scarl_sionna.core.settings.plan import COHERENT
from scarl_sionna.core.units import power_to_db
from scarl_sionna.radar.channel.band_mean import NUM_FREQUENCIES, mean_power
from scarl_sionna.radar.channel.compose.budget import Estimate, cell_unit, smooth_share
from scarl_sionna.radar.channel.compose.choose import AT_RADAR, Chosen, View
from scarl_sionna.radar.channel.compose.expected_error import owners
from scarl_sionna.radar.channel.compose.mirror_chains import possible_chains
from scarl_sionna.radar.channel.compose.mirrors import Mirror, mirrored
from scarl_sionna.radar.channel.compose.spend import Choice
from scarl_sionna.radar.channel.raycast.class_rcs import class_reflectivity
from scarl_sionna.radar.link import path_unit
from scarl_sionna.radar.optics.viewpoint import Viewpoint
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.signal.antenna import largest_field_gain

from .reach import MirrorWays, Reach

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Entry = dict[str, Any]

MOST_CHAINS = 1500
"""Chains that are looked at with one reflection more than those computed, of the largest mirrors: bounds the time."""


def left_out(view: View, chosen: Chosen, echoing: Sequence[Mirror]) -> tuple[Entry, ...]:
    """Return what a plan does not compute: instances one by one, then everything else by its reason.

    Parameters
    ----------
    view : View
    chosen : Chosen
        What becomes of the instances.
    echoing : sequence of Mirror
        From which the radar sees itself.

    Returns
    -------
    tuple of dict
        Each with ``kind``, ``reason``, ``bound_to_noise_db`` (what it can send back at most [dB]) and
        ``expected_to_noise_db`` (an estimate by the reflectivity of classes [dB]; None where there is none). One of the
        kind ``"object"`` is about an ``instance``; of the others ``number`` says how many may be over the
        floor of the accuracy, the two numbers are those of the strongest single one, and ``strongest`` names the
        instances of that which is expected to be so.
    """
    by_number = {choice.item.number: choice for choice in chosen.choices}
    choices = [by_number[item.number] for item in view.items]  # rows of the view's tables
    entries = [_object(view, choice) for choice in choices if choice.method == "left out"]
    floor = view.settings.accuracy.channel_floor_db
    entries += _away(view, choices, floor)
    entries += _reflections(view, choices, chosen, floor)
    entries += _bounces(view, choices, {view.instance(mirror) for mirror in chosen.mirrors}, floor)
    entries += _chains(view, echoing, floor)
    entries += _edges(view, choices, chosen, floor)
    return tuple(entries)


def _object(view: View, choice: Choice) -> Entry:
    row = view.items.index(choice.item)
    mean = view.straight.mean[row, 0] ** 2
    if _is_whole(choice):
        mean += (view.over_mirrors.mean[row] ** 2).sum()
    return {
        "kind": "object",
        "instance": choice.item.name,
        "reason": choice.reason,
        "bound_to_noise_db": round(view.bound_db(choice.item), 1),
        "expected_to_noise_db": round(float(_decibels(mean**2)), 1),
    }


def _is_whole(choice: Choice) -> bool:
    """Return whether an instance is left out with all of its ghosts; those of rough ones count apart."""
    return choice.method == "left out" and choice.item.is_coherent


def _away(view: View, choices: Sequence[Choice], floor: float) -> list[Entry]:
    """Return what lies beyond the range and out of the field of view."""
    away = [choice for choice in choices if choice.method == "out of view"]
    found = []
    for kind, reason, some in (
        (
            "out of range",
            f"nearest point beyond {view.reach:.4g} m",
            [choice for choice in away if choice.item.distance >= view.reach],
        ),
        (
            "out of view",
            "straight, outside of the field of view",
            [choice for choice in away if choice.item.distance < view.reach],
        ),
    ):
        bound = np.array([choice.item.bound_db for choice in some])
        mean = np.minimum(bound, [choice.item.expected_db for choice in some])
        found += _entry(kind, reason, bound, mean, partial(_name, some), floor)
    return found


def _reflections(view: View, choices: Sequence[Choice], chosen: Chosen, floor: float) -> list[Entry]:
    """Return reflections and ghosts of objects, each reason with all ways that it takes away."""
    candidates, served = view.candidates, {mirror.number for mirror in chosen.mirrors}
    if not candidates:
        return []
    shape = len(choices), len(candidates)
    masks = {name: np.zeros(shape, dtype=np.bool_) for name in ("budget", "limit", "small", "class", "view", "rough")}
    computed = np.zeros(shape, dtype=np.bool_)
    for row, choice in enumerate(choices):
        if choice.reason == AT_RADAR or _is_whole(choice):
            continue
        shown = np.ones(len(candidates), dtype=np.bool_)
        if choice.shown is not None:
            shown = np.isin(np.arange(len(candidates)), list(choice.shown))
        if choice.method not in COHERENT:
            is_away = choice.method == "out of view"
            masks["rough" if not choice.item.info.is_object else "view" if is_away else "class"][row] = shown
            continue
        computed[row, [mirror.number for mirror in choice.mirrors]] = True
        wanted = [change.mirror.number for change in choice.changes]
        masks["small"][row] = shown
        masks["small"][row, wanted] = False
        for number in wanted:
            masks["budget" if number in served else "limit"][row, number] = not computed[row, number]
    straight, names = view.straight, partial(_name, choices)
    reasons = {
        "budget": ("reflections", "ground bounce or ghosts that the budget does not pay for"),
        "limit": ("reflections", f"ghosts over mirrors beyond max_mirrors = {view.settings.mirrors.max_mirrors}"),
        "small": ("reflections", "ways over mirrors that change the echo by too little, by classes and probes"),
        "class": ("reflections", "ground bounce and ghosts of what is left to 'raycast', which has no mirrors"),
        "view": ("ghosts", "ghosts of what is out of view or of range, rough or below the floor by its class"),
        "rough": ("reflections", "surfaces without an outline (ground, terrain, grass) over mirrors"),
    }
    found = []
    for name, (kind, reason) in reasons.items():
        bound, mean = _more(straight, view.over_mirrors.select(computed), view.over_mirrors.select(masks[name]))
        found += _entry(kind, reason, bound, mean, names, floor)
    used = chosen.mirrors
    if len(used) > 1:
        twice = MirrorWays.over_one(used, view.pose.position).and_another(view.tail)
        rows = np.array(
            [choice.item.info.is_object and choice.reason != AT_RADAR and not _is_whole(choice) for choice in choices]
        )
        over = view.looker.over(twice, view.items, view.boxes, view.tail).select(rows[:, None])
        bound, mean = _more(straight, view.over_mirrors, over)
        found += _entry("ghosts", "objects over two mirrors on one way", bound, mean, names, floor)
    return found


def _more(straight: Reach, computed: Reach, more: Reach) -> tuple[Array, Array]:
    """Return what further ways add to objects, with all pairs that hold one of them [dB].

    The bound is that of all of them in phase, the estimate the sum of their powers.
    """
    own = straight.most[:, 0] + computed.most.sum(axis=1)
    bound = _decibels(((own + more.most.sum(axis=1)) ** 2 - own**2) ** 2)
    power = straight.mean[:, 0] ** 2 + (computed.mean**2).sum(axis=1)
    return bound, _decibels((power + (more.mean**2).sum(axis=1)) ** 2 - power**2)


def _bounces(view: View, choices: Sequence[Choice], mirrors: set[int], floor: float) -> list[Entry]:
    r"""Return bounces from one object to another that no solver has both of.

    Notes
    -----
    What goes from a to b and back to the radar, and the reverse, is a tube no wider than the smaller of the two
    projected areas, and no wider than diffraction lets it stay over the gap s between them: with
    :math:`A = \min(A_a, A_b) \min(1, \max(A_a, A_b) / \lambda s)`

    .. math:: \sigma \le \min\left(\frac{4 \pi (2 A)^2}{\lambda^2},
              \frac{16 \pi d_a^2 d_b^2}{(d_a + s + d_b)^2}\right) q_a q_b

    which for two equal plates at a right angle is their dihedral; q is the share that is reflected coherently. A rough
    one instead brings :math:`4 \gamma \min(A_a, A_b)`, and `speckle_db`. The estimate takes both as points of the mean
    cross-section of their class, :math:`4 \sigma_a \sigma_b / 4 \pi r^2` with r between their middles.

    References
    ----------
    .. [1] E. F. Knott, J. F. Shaeffer, M. T. Tuley, *Radar Cross Section*, 2nd ed., 2004, section 6.3 (dihedral).
    """
    rows = [
        row
        for row, choice in enumerate(choices)
        if choice.item.in_view
        and choice.reason != AT_RADAR
        and not (choice.shown is not None and choice.sight.share == 0.0)
    ]
    items = [choices[row].item for row in rows]
    method = np.array([choices[row].method for row in rows])
    if len(items) < 2:
        return []
    boxes = view.boxes.take(rows)
    first, second = np.triu_indices(len(items), 1)
    apart = ~((method[first] == "sbr") & (method[second] == "sbr"))
    first, second = first[apart], second[apart]
    if not len(first):
        return []
    distance = np.array([view.nearest(item) for item in items])
    area, level = np.array([item.area for item in items]), np.array([item.expected_db for item in items])
    source = np.array([item.source_db for item in items])
    field = 10.0 ** ((level - source) / 40.0) * np.array([item.distance for item in items]) / distance
    gamma = np.asarray(class_reflectivity())[[item.info.semantic for item in items]]
    is_mirror = np.array([item.number in mirrors for item in items])  # its coherent part is in the reflections
    smooth = [1.0 if item.is_coherent else smooth_share(view.state, item.info) for item in items]
    share = np.where(is_mirror, 0.0, smooth)
    rough = np.where(np.array([item.is_coherent for item in items]) & ~is_mirror, 1.0, gamma)

    gap, least = boxes.gaps()[first, second], np.minimum(area[first], area[second])
    wide = np.minimum(1.0, np.maximum(area[first], area[second]) / np.maximum(view.radar.wavelength * gap, 1e-12))
    a, b = distance[first], distance[second]
    plates = 16.0 * np.pi * (least * wide / view.radar.wavelength) ** 2
    images = 16.0 * np.pi * (a * b / (a + gap + b)) ** 2
    most = np.minimum(plates, images) * share[first] * share[second]
    speckle = 10.0 ** (view.rules.speckle_db / 10.0)
    diffuse = rough[first] * rough[second]
    most += np.where(diffuse < 1.0, 4.0 * diffuse * least * speckle, 0.0)
    between = np.maximum(np.linalg.norm(boxes.center[first] - boxes.center[second], axis=1), 0.1)
    mean = (gamma * area)[first] * (gamma * area)[second] / (np.pi * between**2)
    unit = cell_unit(view.radar) * (field[first] * field[second]) ** 2
    bound, expected = _decibels(unit * most), _decibels(unit * np.minimum(mean, most))
    outlined = np.array([item.info.is_object for item in items])
    found = []
    for reason, some in (
        ("bounces between objects that are not both computed by 'sbr'", outlined[first] & outlined[second]),
        (
            "bounces between objects and surfaces without an outline, which are rough",
            outlined[first] != outlined[second],
        ),
        ("bounces between surfaces without an outline", ~outlined[first] & ~outlined[second]),
    ):
        pairs = np.stack([first[some], second[some]], axis=1)
        found += _entry("bounces", reason, bound[some], expected[some], partial(_pair, items, pairs), floor)
    return found


def _chains(view: View, echoing: Sequence[Mirror], floor: float) -> list[Entry]:
    """Return chains of mirrors back to the radar with one reflection more than are computed, by their length alone."""
    depth = view.settings.sionna.max_depth + 1
    some = sorted({mirror.number: mirror for mirror in [*echoing, *view.candidates]}.values(), key=lambda m: m.number)
    position, station = view.pose.position, Viewpoint.of(view.radar, view.pose, np.zeros(3))
    largest = some[: int(MOST_CHAINS ** (1.0 / depth)) + 1]
    ways = [way for way in possible_chains(largest, position, depth, view.reach) if len(way) == depth]
    if not ways:
        return []
    images = np.array([mirrored(way[::-1], position) for way in ways])
    seen = station.sees(images)
    ways = [way for way, ok in zip(ways, seen, strict=True) if ok]
    away = (images - position)[seen]
    gain = largest_field_gain(view.radar.array, away @ view.pose.rotation)
    length = np.linalg.norm(away, axis=1)
    bound = _decibels(cell_unit(view.radar) * gain**4 * 4.0 * np.pi / np.maximum(length, 1e-3) ** 2)
    table = view.state.world.instances
    reason = f"chains of {depth} mirrors back to the radar: max_depth = {depth - 1}"
    return _entry(
        "mirror chains", reason, bound, None, lambda row: [table[view.instance(one)].name for one in ways[row]], floor
    )


def _edges(view: View, choices: Sequence[Choice], chosen: Chosen, floor: float) -> list[Entry]:
    r"""Return what the edges of smooth walls send back, an estimate: they have no rough part, and only `sbr` has edges.

    Notes
    -----
    A straight edge across the line of sight at a distance s has :math:`\sigma = \lambda s / 2 \pi`: the coefficient
    of a half plane [1]_, :math:`\sqrt{\lambda} / 4 \pi \, |1 \mp \sec \phi|`, with 2 for what depends on the angle.

    References
    ----------
    .. [1] J. B. Keller, "Geometrical Theory of Diffraction", J. Opt. Soc. Am. 52(2), 1962, eq. (5).
    """
    smooth = set(view.state.world.parts.instance[list(chosen.by_material)].tolist())
    walls = [choice for choice in choices if choice.item.number in smooth]
    if not walls:
        return []
    near = np.array([view.nearest(choice.item) for choice in walls])
    level = np.array([choice.item.expected_db - choice.item.source_db for choice in walls])
    away = np.array([choice.item.distance for choice in walls])
    field = 10.0 ** (level / 40.0) * away / near
    power = cell_unit(view.radar) * field**4 * view.radar.wavelength * near / (2.0 * np.pi)
    reason = "edges of smooth walls, which are mirrors and have no other echo"
    return _entry("edges", reason, None, _decibels(power), partial(_name, walls), floor)


def beyond_last_bounce(view: View, paths: RadarPaths, numbers: Sequence[int], level: SbrLevel) -> list[Entry]:
    r"""Return what bounces on after the last bounce that is followed: an estimate by what the last one has.

    Parameters
    ----------
    view : View
    paths : RadarPaths
    numbers : sequence of int
        Instance ids of objects computed by `sbr`.
    level : SbrLevel

    Notes
    -----
    :math:`\kappa^2` of the power of the last bounce, of each object, as in
    :func:`~scarl_sionna.radar.channel.compose.expected_error.expected_errors`.
    """
    order = np.sort(np.asarray(numbers, dtype=np.int64))
    rows = np.flatnonzero(np.isin(paths.instance, order).sum(axis=1) >= level.max_depth)
    if not len(rows):
        return []
    owner = owners(paths.select(rows), order.tolist())
    own = np.searchsorted(order, owner)
    power = mean_power(paths, view.radar, rows, own, len(order), NUM_FREQUENCIES)
    expected = _decibels(path_unit(view.radar) * view.rules.errors.last_bounce**2 * power)
    reason = f"bounces after the {level.max_depth} that are followed"
    table, floor = view.state.world.instances, view.settings.accuracy.channel_floor_db
    return _entry("depth", reason, None, expected, lambda row: (table[int(order[row])].name,), floor)


def _name(choices: Sequence[Choice], row: int) -> Sequence[str]:
    return (choices[row].item.name,)


def _pair(items: Sequence[Estimate], pairs: npt.NDArray[np.int64], row: int) -> Sequence[str]:
    return [items[number].name for number in pairs[row]]


def _entry(
    kind: str,
    reason: str,
    bound: Array | None,
    expected: Array | None,
    names: Callable[[int], Sequence[str]],
    floor: float,
) -> list[Entry]:
    """Return the entry of what has one reason; none if there is nothing of it."""
    by = bound if expected is None else expected
    if by is None or not len(by) or by.max() <= _NOTHING:
        return []
    limit = by if bound is None else bound
    return [
        {
            "kind": kind,
            "reason": reason,
            "number": int(np.count_nonzero(limit >= floor)),
            "strongest": list(names(int(by.argmax()))),
            "bound_to_noise_db": None if bound is None else round(float(bound.max()), 1),
            "expected_to_noise_db": None if expected is None else round(float(expected.max()), 1),
        }
    ]


_NOTHING = -200.0
"""What is this weak is not there [dB]: stands for a power of nothing."""


def _decibels(power: npt.ArrayLike) -> Array:
    return power_to_db(power, _NOTHING)
