"""The code of docs/getting_started.md and of the first notebook runs as it is printed."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.settings.reads import unread

pytestmark = pytest.mark.own_process(shared=True)  # what it leaves behind would stay in the worker

REPO = Path(__file__).resolve().parents[2]
PAGE = REPO / "docs" / "getting_started.md"


@pytest.fixture(params=[pytest.param("as printed", marks=pytest.mark.slow), "with less effort"])
def effort(request, monkeypatch) -> None:
    """Let the page's own calls have what they ask for, or a sixth of the CPU time: fewer rays, no budget of tubes."""
    if request.param == "as printed":
        return
    rays = ss.RadarSettings(method="raycast", raycast={"num_rays": 20_000})
    front = ss.Rig.front("draft")
    sensors = [replace(item, settings=rays) if item.kind == "radar" else item for item in front.sensors]
    unread(rays)  # what the qualities name is found once, not by the preset below
    monkeypatch.setattr(ss.Rig, "front", {"draft": ss.Rig("front", tuple(sensors))}.__getitem__)
    monkeypatch.setattr(ss.RadarSettings, "preset", {"draft": rays}.__getitem__)


def test_getting_started(tmp_path, monkeypatch, effort) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "docs"}
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    for number, block in enumerate(blocks):
        exec(compile(block, f"{PAGE.name}, block {number}", "exec"), names)
    frame, rd, data = names["frame"], names["rd"], names["ds"]
    assert names["image"].shape[2] == 3 and np.isfinite(rd.power).all()
    assert (tmp_path / "frame.png").stat().st_size > 10_000
    assert {"front_center/radar", "front_center/lidar"} <= set(frame.results)
    assert len(data) == 2 and data[1].radar["front/radar"].adc.shape == (4, 192, 512)


@pytest.mark.slow  # its names and keywords: test_docs_code.py; another notebook runs always
def test_first_notebook(tmp_path, monkeypatch, effort) -> None:
    """Its cells one after the other; its last asserts a law."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    cells = json.loads((REPO / "notebooks" / "01_first_frame.ipynb").read_text(encoding="utf-8"))["cells"]
    names: dict[str, object] = {"__name__": "notebook"}
    for number, cell in enumerate(cells):
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"cell {number}", "exec"), names)
    assert names["sheet"].stat().st_size > 10_000
    assert float(names["error"]) < 1e-3 and {"front_center/radar", "front_center/lidar"} <= set(names["frame"].results)
