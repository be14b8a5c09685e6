"""The demo: one scenario as a small dataset, with a contact sheet of its first frame."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

from scarl_sionna.batch import ExportSettings, export
from scarl_sionna.core.errors import DatasetError, OutputError
from scarl_sionna.dataset.contact_sheet import write_contact_sheet
from scarl_sionna.dataset.encoding import StoreOptions
from scarl_sionna.dataset.readers.reader import open_dataset
from scarl_sionna.dataset.store.layout import CONTACT_SHEET, is_contact_sheet
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.simulation import OnStage


@dataclass(frozen=True)
class RunSummary:
    """What :func:`run` did: folder, contact sheet, frames written now and kept from before, seconds by stage."""

    folder: Path
    contact_sheet: Path
    num_written: int
    num_kept: int
    timings: dict[str, float] = field(default_factory=dict)


def _ignore(stage: str, num_done: float) -> None:
    """Report nothing."""


def run(scenario: ScenarioSpec, out: str | Path, *, overwrite: bool = False, on_stage: OnStage = _ignore) -> RunSummary:
    """Simulate a scenario, write it as a dataset, and draw a contact sheet of the first frame.

    Parameters
    ----------
    scenario : ScenarioSpec
    out : path
        Folder to write to. Frames that it holds from the same configuration are kept.
    overwrite : bool
        Remove the dataset that is there first; files that are not its own stay.
    on_stage : callable
        Called with the stage's name and the number of finished frames.

    Raises
    ------
    OutputError
        If the folder cannot be written, holds frames of another configuration, or something that is not ours has the
        name of a file of ours.
    TimeRangeError
        If a frame's time lies outside the scene's motion.
    UnknownNameError
        If the scene or the rig is unknown.
    """
    sheet = Path(out) / CONTACT_SHEET
    if os.path.lexists(sheet) and not is_contact_sheet(sheet):
        raise OutputError(f"{sheet} was not drawn by the demo; it is kept: choose another folder, or move it away")
    done = 0

    def on_event(kind: str, data: dict[str, Any]) -> None:
        nonlocal done
        if kind == "plan":
            done = data["done"]
            on_stage("scene", done)
        elif kind == "stage":
            on_stage(data["stage"], done + data["part"])
        elif kind == "frame":
            done += 1

    settings = ExportSettings(options=StoreOptions(layout="files"), overwrite=overwrite)  # pictures to look at
    report = export([scenario], out, settings, on_event=on_event)
    on_stage("contact sheet", done)
    started = perf_counter()
    sheet = write_sheet(report.root, 0, report.root / CONTACT_SHEET)
    on_stage("done", done)
    seconds = {**report.seconds, "contact sheet": perf_counter() - started}
    return RunSummary(report.root, sheet, report.num_made, report.num_kept, seconds)


def write_sheet(place: str | Path, number: int, path: Path, suite: str | None = None) -> Path:
    """Draw the contact sheet of a frame of a dataset.

    Parameters
    ----------
    place : path or str
        Dataset.
    number : int
        Position of the frame in the dataset.
    path : path
        PNG file to write.
    suite : str, optional
        Group of sensors to show.

    Raises
    ------
    DatasetError
        If there is no such dataset or frame.
    """
    dataset = open_dataset(place)
    if not -len(dataset) <= number < len(dataset):
        raise DatasetError(f"no frame {number}: it holds {len(dataset)} frames", dataset.place, "count from 0")
    stored = dataset[number]
    write_contact_sheet(stored.to_frame(), path, title=stored.scene.name, suite=suite)
    return path
