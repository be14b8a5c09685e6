"""The dataset card: what a person reads first in the dataset's folder."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

_MARK = re.compile(r"<!-- scarl-sionna dataset card ([0-9a-f]{16}) -->\n")


def is_card(path: Path) -> bool:
    """Return whether a file is a dataset card as it was written: one with a line of somebody else's is theirs."""
    try:
        return is_card_text(path.read_text(encoding="utf-8") if path.is_file() else "")
    except (OSError, UnicodeDecodeError):
        return False


def is_card_text(text: str) -> bool:
    """Return whether a text is that of a dataset card as it was written."""
    body, _, mark = text.removesuffix("\n").rpartition("\n")
    return f"{mark}\n" == _mark(f"{body}\n") if _MARK.fullmatch(f"{mark}\n") else False


def _mark(text: str) -> str:
    return f"<!-- scarl-sionna dataset card {hashlib.sha256(text.encode()).hexdigest()[:16]} -->\n"


def dataset_card(manifest: Mapping[str, Any]) -> str:
    """Return the text of the dataset's ``README.md``.

    Its last line is a mark that tells it from a file of the user's.
    """
    text = unmarked_card(manifest)
    return text + _mark(text)


def unmarked_card(manifest: Mapping[str, Any]) -> str:
    """Return the card without its mark, as it was written before there was one."""
    scenes, shards = manifest["scenes"], manifest["shards"]
    rows = [row for items in shards.values() for row in items if row]
    planned = sum(item["num_frames"] for item in scenes.values())
    made, size = sum(row[1] for row in rows), sum(row[3] for row in rows)
    sensors = manifest["calibration"]
    kinds = sorted({item["kind"] for item in sensors.values()})
    software = manifest["configuration"]["software"]
    maps: dict[str, list[str]] = {}
    for name, item in manifest["configuration"]["scenes"].items():
        if "map_licence" in item:
            maps.setdefault(item["map_licence"], []).append(name)
    others = (
        "or any ZIP program for single images; `scarl-sionna repack` makes PNG files and a Zarr v3 hierarchy of all."
        if manifest["configuration"]["storage"].get("layout") == "packed"
        else "or any Zarr v3 reader for the arrays and any PNG reader for the images."
    )
    lines = [
        "# Dataset",
        "",
        manifest["description"]
        or "Synthetic drives: synchronized camera, lidar and MIMO radar, simulated with scarl-sionna.",
        "",
        f"- frames: {made} of {planned} in {len(scenes)} scenes, {size / 1e9:.3g} GB",
        f"- sensors: {len(sensors)} ({', '.join(kinds)})",
        f"- schema version {manifest['schema_version']}, configuration {manifest['configuration_hash'][:16]}",
        f"- licence: {manifest['licence']}",
        *(f"- map data of {', '.join(names)}: {licence}" for licence, names in maps.items()),
        f"- made with: {', '.join(f'{name} {version}' for name, version in software.items()) or 'not stated'}",
        "",
        "| scene | frames | split | seed |",
        "|---|---|---|---|",
        *(f"| {name} | {item['num_frames']} | {item['split']} | {item['seed']} |" for name, item in scenes.items()),
        "",
        "Reading: `scarl_sionna.open_dataset(folder)`, " + others,
        "`manifest.json` holds calibration, units, axes, conventions, the depth formula and a checksum of every shard.",
        "`scarl-sionna verify` checks all of it.",
        "",
        "All data is simulated. No person, vehicle or place is recorded in it."
        + (" Streets and buildings follow the map data named above." if maps else ""),
        "",
    ]
    return "\n".join(lines)
