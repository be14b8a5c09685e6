"""Calibrated materials as entries of a user's ``materials.toml``."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np

from scarl_sionna.core.errors import OutputError
from scarl_sionna.scene.materials.table import RadioMaterial

from .errors import CalibrationError
from .estimate import INTERVAL, CalibrationResult


def calibrated_materials(result: CalibrationResult) -> list[RadioMaterial]:
    """Return the materials of a result with the estimated numbers, their source and their uncertainty.

    Uncertainties are widened by `misfit` where the model does not explain data and priors to within what was stated.
    """
    owners = dict.fromkeys(item.owner for item in result.problem.parameters)
    used = {id(item.spec): item.spec for item in result.model.channels if not item.spec.held_out}
    out = []
    for owner in owners:
        if owner not in result.model.table or owner in result.problem.targets:
            continue
        rows = [row for row, item in enumerate(result.problem.parameters) if item.owner == owner]
        names = [result.problem.parameters[row].field for row in rows]
        values = {name: float(result.values[row]) for name, row in zip(names, rows, strict=True)}
        widths = result.std * INTERVAL * result.misfit
        spread = ", ".join(
            f"{name} {values[name]:.4g} +- {widths[row]:.2g}" for name, row in zip(names, rows, strict=True)
        )
        state = "" if result.converged else f"; NOT CONVERGED: {result.reason}"
        widened = (
            f" (noise and priors taken {result.misfit:.2g} times as stated, to explain the misfit)"
            if result.misfit > 1.1
            else ""
        )
        base = result.model.base(owner)  # without an albedo that gave way: frames then read what was calibrated
        out.append(
            base.with_(
                **values,
                source=f"calibrated: {result.problem.source} ({', '.join(item.name for item in used.values())})",
                uncertainty=f"95 % intervals: {spread}{widened}; the rest as before ({base.uncertainty}){state}",
            )
        )
    return out


def save_materials(result: CalibrationResult, path: str | Path) -> Path:
    """Write the calibrated materials to a TOML file.

    :func:`scarl_sionna.scene.materials.table.load_materials` reads it.

    Raises
    ------
    CalibrationError
        If no material was free.
    OutputError
        If the file cannot be written.
    """
    entries = calibrated_materials(result)
    if not entries:
        raise CalibrationError("no parameter of a material was free, so there is no entry to save")
    blocks = []
    for entry in entries:
        lines = [f"[{_key(entry.name)}]"]
        for name in type(entry).model_fields:
            value = getattr(entry, name)
            if name == "name" or value is None:
                continue
            lines.append(f"{name} = {_toml(value)}")
        blocks.append("\n".join(lines))
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n\n".join(blocks) + "\n", encoding="utf-8")
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror}; choose a file that you may write to") from error
    return path


def _key(name: str) -> str:
    return name if name.replace("_", "").replace("-", "").isalnum() and name.isascii() else json.dumps(name)


def _toml(value: object) -> str:
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, (float, np.floating)):
        if not math.isfinite(value):
            raise CalibrationError(f"{value} cannot be saved in a material entry")
        return repr(float(value))
    return json.dumps(value, ensure_ascii=False)
