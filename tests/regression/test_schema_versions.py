"""Datasets of every released schema version still load, and hold what they held."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import pytest

from scarl_sionna.dataset import open_dataset
from scarl_sionna.dataset.schema import SCHEMA_VERSION
from scarl_sionna.dataset.verify import verify
from tests.regression.schema.make import digest

FOLDER = Path(__file__).parent / "schema"
VERSIONS = sorted(path.stem for path in FOLDER.glob("v*.zip"))


def test_the_version_of_today_has_a_fixture() -> None:
    assert f"v{SCHEMA_VERSION}" in VERSIONS


@pytest.mark.parametrize("version", VERSIONS)
def test_a_released_version_loads(version, tmp_path) -> None:
    with zipfile.ZipFile(FOLDER / f"{version}.zip") as archive:
        archive.extractall(tmp_path)
    dataset = open_dataset(tmp_path)
    expected = json.loads((FOLDER / f"{version}.json").read_text())
    assert [json.loads(json.dumps(digest(frame.to_frame()))) for frame in dataset] == expected
    damaged = [fault for fault in verify(tmp_path).faults if fault.shard is not None]
    assert not damaged
