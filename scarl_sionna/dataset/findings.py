"""What a check of a dataset found: damage, traces of an export, and what is not the dataset's own."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

Kind = Literal["damage", "unfinished"]
STRAY = "belongs to no finished shard"
UNFINISHED_STRAY = "is of a shard that is not finished (an export that is running or was stopped)"


@dataclass(frozen=True)
class Fault:
    """Something that is wrong: the file (or frame), what it is, and the shard that holds it, if one does.

    `kind` "unfinished": what an export leaves that is running or was stopped; the next one mends it and no data is
    damaged.
    """

    name: str
    what: str
    scene: str | None = None
    shard: int | None = None
    kind: Kind = "damage"

    def __str__(self) -> str:
        return f"{self.name}: {self.what}"


@dataclass
class Verification:
    """What :func:`verify` found.

    Attributes
    ----------
    num_frames, num_planned : int
        Frames that are there, and that the manifest plans.
    num_files, num_bytes : int
        Files whose checksum was computed.
    failed : dict of (str, int) to str
        Frames that could not be made, with the reason.
    faults : list of Fault
        What is damaged.
    unfinished : list of Fault
        Traces of an export that is running or was stopped.
    foreign : list of str
        Files in the dataset's folders, or with names of its files, that are not its own; they are never touched.
    removed : list of (str, int)
        Shards that were removed, to be made again.
    """

    num_frames: int = 0
    num_planned: int = 0
    num_files: int = 0
    num_bytes: int = 0
    failed: dict[tuple[str, int], str] = field(default_factory=dict)
    faults: list[Fault] = field(default_factory=list)
    unfinished: list[Fault] = field(default_factory=list)
    foreign: list[str] = field(default_factory=list)
    removed: list[tuple[str, int]] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """Whether nothing is damaged (frames may still be missing)."""
        return not self.faults

    @property
    def complete(self) -> bool:
        """Whether nothing is damaged, no frame is missing and no export is under way."""
        return self.ok and not self.unfinished and self.num_frames == self.num_planned

    def add(self, faults: Iterable[Fault]) -> None:
        """Add what is wrong, each to its list."""
        for fault in faults:
            (self.faults if fault.kind == "damage" else self.unfinished).append(fault)


def describe(found: Verification) -> str:
    """Return what was found, for people."""
    lines = [
        f"{found.num_frames} of {found.num_planned} frames, {found.num_files} files, "
        f"{found.num_bytes / 1e6:.1f} MB checked"
    ]
    lines += [f"  {fault}" for fault in found.faults[:20]]
    if len(found.faults) > 20:
        lines.append(f"  and {len(found.faults) - 20} more")
    if found.unfinished:
        lines.append(
            f"  {len(found.unfinished)} traces of an export that is running or was stopped, "
            f"for instance {found.unfinished[0]}"
        )
    if found.foreign:
        more = f" and {len(found.foreign) - 10} more" if len(found.foreign) > 10 else ""
        lines.append(f"  not of the dataset, never touched: {', '.join(found.foreign[:10])}{more}")
    for (scene, index), reason in list(found.failed.items())[:10]:
        lines.append(f"  failed: {scene} frame {index}: {reason}")
    if found.removed:
        lines.append(
            f"{len(found.removed)} shards removed; the export makes them again: " + json.dumps(found.removed[:20])
        )
    elif found.faults:
        lines.append("damaged; `scarl-sionna verify --repair` removes what is damaged, then the export makes it again")
    elif not found.complete:
        lines.append("whole, not complete; the export goes on where it was")
    else:
        lines.append("whole and complete")
    return "\n".join(lines)
