"""What an export did."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from scarl_sionna.core.prompt.describe import Described

from .job import ShardReport


@dataclass(repr=False)
class ExportReport(Described, units={"num_bytes": "bytes", "wall_seconds": "s"}):
    """What an export did.

    Attributes
    ----------
    root : Path
        Folder of the dataset; of one in an object store, where what is not finished is kept.
    num_frames : int
        Frames asked for.
    num_made, num_kept : int
        Frames made now, and there from before.
    failed : dict of (str, int) to str
        Frames that could not be made, by scene and number, with the reason.
    num_bytes : int
        Size of the shards that this export looked at [bytes].
    wall_seconds : float
    seconds : dict of str to float
        By stage, summed over workers.
    address : str
        Of a dataset in an object store.
    """

    root: Path
    num_frames: int
    num_made: int = 0
    num_kept: int = 0
    failed: dict[tuple[str, int], str] = field(default_factory=dict)
    num_bytes: int = 0
    wall_seconds: float = 0.0
    seconds: dict[str, float] = field(default_factory=dict)
    address: str = ""

    def add(self, report: ShardReport) -> None:
        """Add a shard."""
        self.num_made += report.num_made
        self.num_kept += report.num_kept
        self.num_bytes += report.num_bytes
        self.failed.update({(report.scene, index): reason for index, reason in report.failed.items()})
        for stage, taken in report.seconds.items():
            self.seconds[stage] = self.seconds.get(stage, 0.0) + taken

    def __str__(self) -> str:
        kept = f", {self.num_kept} kept from before" if self.num_kept else ""
        stages = ", ".join(f"{stage} {taken:.1f}" for stage, taken in self.seconds.items())
        lines = [f"{self.num_made} frames written{kept} in {self.wall_seconds:.1f} s ({stages})"]
        lines.append(f"dataset: {self.address or self.root}   {self.num_bytes / 1e6:.1f} MB")
        if self.failed:
            lines.append(f"{len(self.failed)} frames failed; the same command tries them again:")
            shown = list(self.failed.items())[:10]
            lines += [f"  {scene} frame {index}: {reason}" for (scene, index), reason in shown]
            lines += [f"  and {len(self.failed) - 10} more (see export.log)"] if len(self.failed) > 10 else []
        return "\n".join(lines)
