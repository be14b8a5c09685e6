"""nuScenes' tables as the original has them, written record by record: 2 Hz boxes, poses at the sensors' times."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

START = 1_532_402_927_647_951
"""Time of the first sample [us]."""


@dataclass(frozen=True)
class Thing:
    """An object: category, size (width, length, height) [m], and where it is: t -> x, y, heading; None where unseen."""

    category: str
    size: tuple[float, float, float]
    at: Callable[[float], tuple[float, float, float] | None]


def write_tables(
    folder: Path,
    things: Mapping[str, Thing],
    ego: Callable[[float], tuple[float, float, float]],
    duration: float = 8.0,
    noise: float = 0.0,
    name: str = "scene-0061",
) -> Path:
    """Write the tables of one scene, and records of another one that must not be mixed up with it; return the folder.

    `ego` is the way of the middle of the rear axle; `noise` that of the boxes [m].
    """
    rng = np.random.default_rng(1)
    tables: dict[str, list[dict]] = {
        key: []
        for key in ("scene", "log", "sample", "sample_data", "ego_pose", "category", "instance", "sample_annotation")
    }
    for scene, shift in ((name, 0.0), ("scene-9999", 500.0)):
        tables["log"].append({"token": f"log-{scene}", "location": "singapore-onenorth"})
        keys = np.arange(0.0, duration + 1e-9, 0.5)
        tables["scene"].append(
            {"token": f"s-{scene}", "name": scene, "log_token": f"log-{scene}", "nbr_samples": len(keys)}
        )
        for index, time in enumerate(keys):
            tables["sample"].append(
                {"token": f"k-{scene}-{index}", "timestamp": _us(time), "scene_token": f"s-{scene}"}
            )
        for channel, rate in (("LIDAR_TOP", 20.0), ("CAM_FRONT", 12.0), ("RADAR_FRONT", 13.0)):
            for index, time in enumerate(np.arange(0.0, duration + 1e-9, 1.0 / rate)):
                token = f"d-{scene}-{channel}-{index}"
                sample = f"k-{scene}-{min(round(time / 0.5), len(keys) - 1)}"
                tables["sample_data"].append(
                    {"token": token, "sample_token": sample, "ego_pose_token": token, "timestamp": _us(time)}
                )
                x, y, heading = ego(time)
                tables["ego_pose"].append(
                    {
                        "token": token,
                        "timestamp": _us(time),
                        "translation": [x + shift, y, 0.0],
                        "rotation": _turn(heading),
                    }
                )
        for label, thing in things.items():
            own = [(index, thing.at(time)) for index, time in enumerate(keys)]
            seen = [(index, place) for index, place in own if place is not None]
            tables["instance"].append(
                {"token": f"i-{scene}-{label}", "category_token": f"c-{thing.category}", "nbr_annotations": len(seen)}
            )
            for index, (x, y, heading) in seen:
                dx, dy, turn = noise * rng.normal(size=3)
                tables["sample_annotation"].append({
                    "token": f"a-{scene}-{label}-{index}", "sample_token": f"k-{scene}-{index}",
                    "instance_token": f"i-{scene}-{label}", "size": list(thing.size),
                    "translation": [x + dx + shift, y + dy, 0.5 * thing.size[2]],
                    "rotation": _turn(heading + 0.1 * turn),
                })  # fmt: skip # a record
    for category in sorted({thing.category for thing in things.values()}):
        tables["category"].append({"token": f"c-{category}", "name": category})
    folder.mkdir(parents=True, exist_ok=True)
    for key, rows in tables.items():
        (folder / f"{key}.json").write_text(json.dumps(rows, indent=0))
    return folder


def change(folder: Path, table: str, index: int, **values: object) -> None:
    """Change values of a record; None takes the key away."""
    path = folder / f"{table}.json"
    rows = json.loads(path.read_text())
    for key, value in values.items():
        rows[index].pop(key, None)
        if value is not None:
            rows[index][key] = value
    path.write_text(json.dumps(rows))


def _us(time: float) -> int:
    return START + round(1e6 * time)


def _turn(heading: float) -> list[float]:
    return [float(np.cos(0.5 * heading)), 0.0, 0.0, float(np.sin(0.5 * heading))]
