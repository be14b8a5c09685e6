"""Many drives of a few scenarios: seeds, values of any field, and splits that keep variants of a drive together."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.dataset.store.manifest import SPLITS
from scarl_sionna.scenario.spec.fields import with_field
from scarl_sionna.scenario.spec.scenario import ScenarioSpec

MOST_DRIVES = 100_000
_LONGEST_NAME = 120


@dataclass(frozen=True)
class Sweep:
    """Which drives are made of each scenario: all seeds times all combinations of values.

    Attributes
    ----------
    seeds : sequence of int
        None: the scenario's own.
    grid : mapping of str to sequence
        Values by the dotted path of a field: ``{"weather": ["rain", "clear"], "radar.max_distance": [80.0, 150.0]}``.
    splits : (float, float, float), optional
        Shares of train, val and test. A drive is drawn by the hash of its scenario's name and seed, so that all
        combinations of values of one seed fall into one split, and more seeds later move none. Left out: each
        scenario's own.

    Raises
    ------
    ParameterRangeError
        If a field has no values or one of them twice, or shares are negative or do not sum to 1.
    """

    seeds: Sequence[int] = ()
    grid: Mapping[str, Sequence[object]] = field(default_factory=dict)
    splits: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        for name, values in self.grid.items():
            if not len(values):
                raise ParameterRangeError(f"grid of {name}", "no values", "one or more")
            if len(set(map(repr, values))) != len(values):
                raise ParameterRangeError(f"values of {name}", "one of them twice", "each once")
        if len(set(self.seeds)) != len(self.seeds):
            raise ParameterRangeError("seeds", "one of them twice", "each once")
        if self.splits is not None and (
            len(self.splits) != len(SPLITS)
            or not all(0.0 <= share <= 1.0 for share in self.splits)
            or abs(sum(self.splits) - 1.0) > 1e-9
        ):
            raise ParameterRangeError("splits", self.splits, "shares of train, val and test that sum to 1")

    def apply(self, scenarios: Iterable[ScenarioSpec]) -> list[ScenarioSpec]:
        """Return the drives of scenarios, named ``cut_in_s000012_weather-rain``.

        Raises
        ------
        ParameterRangeError, UnknownNameError
            If there are more than 100,000, a name would be too long, or a field or a value is not allowed.
        """
        chosen = list(scenarios)
        count = len(chosen) * max(len(self.seeds), 1)
        for values in self.grid.values():
            count *= len(values)
        if count > MOST_DRIVES:
            raise ParameterRangeError("drives", count, f"at most {MOST_DRIVES}", "export them into several folders")
        return [drive for scenario in chosen for drive in self._drives(scenario)]

    def _drives(self, scenario: ScenarioSpec) -> Iterable[ScenarioSpec]:
        labels = [_labels(path, values) for path, values in self.grid.items()]
        variants = []
        for choice in product(*(range(len(values)) for values in self.grid.values())):
            variant = scenario
            for index, (path, values) in zip(choice, self.grid.items(), strict=True):
                variant = with_field(variant, path, values[index])
            suffix = "".join(f"_{names[index]}" for index, names in zip(choice, labels, strict=True))
            variants.append((variant, suffix))
        for seed in self.seeds or (scenario.seed,):
            drive = f"{scenario.scene_name}_s{seed:06d}" if self.seeds else scenario.scene_name
            split = scenario.split if self.splits is None else split_of(scenario.scene_name, seed, self.splits)
            for variant, suffix in variants:
                name = drive + suffix
                if len(name) > _LONGEST_NAME:
                    raise ParameterRangeError("name", name, f"at most {_LONGEST_NAME} characters", "sweep fewer fields")
                yield variant.with_(name=name, seed=seed, split=split)


def split_of(name: str, seed: int, shares: tuple[float, float, float]) -> str:
    """Return the split of a drive, drawn by the hash of its name and seed.

    Shares are those of train, val and test; of n drives each share is met within some sqrt(n).
    """
    draw = int.from_bytes(hashlib.sha256(f"{name} {seed}".encode()).digest()[:8], "big") / 2.0**64
    bound = 0.0
    for split, share in zip(SPLITS, shares, strict=True):
        bound += share
        if draw < bound:
            return split
    return next(split for split, share in reversed(list(zip(SPLITS, shares, strict=True))) if share > 0.0)


def parse_seeds(text: str) -> tuple[int, ...]:
    """Return the seeds of a text: ``0:1900`` (the last one left out), ``0:100:5``, ``3,7,9``, or several of them.

    Raises
    ------
    ParameterRangeError
        If it is none, or they are more than 100,000.
    """
    seeds: list[int] = []
    for part in text.split(","):
        if not re.fullmatch(r"\d{1,18}(:\d{1,18}(:\d{1,9})?)?", part.strip()):
            raise ParameterRangeError(
                "seeds", repr(text), "a:b, a:b:step or numbers with commas", "for instance 0:1900"
            )
        first, *rest = (int(number) for number in part.split(":"))
        step = rest[1] if len(rest) > 1 else 1
        if step == 0:
            raise ParameterRangeError("seeds", repr(text), "a step of at least 1")
        found = range(first, rest[0] if rest else first + 1, step)
        if not len(found) or len(seeds) + len(found) > MOST_DRIVES:
            raise ParameterRangeError("seeds", repr(text), f"1 to {MOST_DRIVES} of them")
        seeds += found
    return tuple(seeds)


def _labels(path: str, values: Sequence[object]) -> list[str]:
    """Return a short name of each value of a field, of letters, digits, ``_`` and ``-``."""
    field_name = path.rpartition(".")[2]
    short = [re.sub(r"[^A-Za-z0-9_\-]+", "-", str(value)).strip("-")[:30] for value in values]
    plain = len(set(short)) == len(short) and all(short) and not any(isinstance(value, dict | list) for value in values)
    return [f"{field_name}-{text if plain else index}" for index, text in enumerate(short)]
