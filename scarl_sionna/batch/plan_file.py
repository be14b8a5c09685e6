"""A plan on the disk, computed once and shared by all jobs of an array: what each drive's frames follow from.

To plan a drive its world is composed and checked; of thousands of drives that takes minutes, which each job would
otherwise spend anew. A job that makes a shard compares the plan with the files as they are then.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from filelock import FileLock

from scarl_sionna.core.errors import OutputError, ParameterRangeError
from scarl_sionna.core.untrusted.checked import Table, Text, checked
from scarl_sionna.core.untrusted.files import MEGABYTE, read_bytes
from scarl_sionna.core.untrusted.json_text import parse_json
from scarl_sionna.dataset.store.files import write_whole
from scarl_sionna.scenario.spec.scenario import ScenarioSpec

_FORMAT = "scarl-plan"
_MOST_BYTES = 500 * MEGABYTE


class _Drive(Table):
    scenario: Text
    configuration: dict[str, Any]


class _Plan(Table):
    format: Text
    software: dict[str, Text]
    drives: dict[str, _Drive]


@contextmanager
def shared_plan(
    path: str | Path | None, software: Mapping[str, str], compute: Callable[[ScenarioSpec], dict[str, Any]]
) -> Iterator[Callable[[ScenarioSpec], dict[str, Any]]]:
    """Yield what gives the configuration of a scenario: from a plan file if it is there, else computed and kept in it.

    One job at a time: the others wait, and read what it computed.

    Parameters
    ----------
    path : path, optional
        Of the plan file; None: all is computed.
    software : mapping
        Versions with which a plan is right.
    compute : callable
        Plans one scenario.

    Raises
    ------
    ParameterRangeError
        If the file is no plan, or one of other versions.
    OutputError
        If it cannot be written.
    """
    if path is None:
        yield compute
        return
    place = Path(path)
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        lock = FileLock(f"{place}.lock")
        lock.acquire()
    except OSError as error:
        raise OutputError(f"cannot write {place}: {error.strerror}; choose another --plan") from error
    try:
        drives = _read(place, software)
        before = len(drives)

        def planned(scenario: ScenarioSpec) -> dict[str, Any]:
            key = _key(scenario)
            known = drives.get(scenario.scene_name)
            if known is None or known["scenario"] != key:
                known = drives[scenario.scene_name] = {"scenario": key, "configuration": compute(scenario)}
                changed.append(scenario.scene_name)
            return dict(known["configuration"])

        changed: list[str] = []
        yield planned
        if changed or len(drives) != before:
            data = {"format": _FORMAT, "software": dict(software), "drives": drives}
            try:
                write_whole(place, json.dumps(data) + "\n")
            except OSError as error:
                raise OutputError(f"cannot write {place}: {error.strerror}; choose another --plan") from error
    finally:
        lock.release()


def _key(scenario: ScenarioSpec) -> str:
    """Return a hash of what a scenario says and of where it lies."""
    return hashlib.sha256(f"{scenario.folder}\n{scenario.to_json()}".encode()).hexdigest()


def _read(path: Path, software: Mapping[str, str]) -> dict[str, dict[str, Any]]:
    try:
        plan = checked(_Plan, parse_json(read_bytes(path, _MOST_BYTES)))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise ParameterRangeError("plan", path, "a plan of an export", f"remove it ({error!s:.100})") from error
    if plan.format != _FORMAT:
        raise ParameterRangeError("plan", path, "a plan of an export", "choose another name")
    if plan.software != dict(software):
        raise ParameterRangeError("plan", path, "a plan of the versions that are installed now", "remove it")
    return {
        name: {"scenario": item.scenario, "configuration": item.configuration} for name, item in plan.drives.items()
    }
