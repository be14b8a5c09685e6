"""The code of docs/getting_started.md runs as it is printed."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss

pytestmark = pytest.mark.own_process  # what it leaves behind would stay in the worker for the files after it

PAGE = Path(__file__).resolve().parents[2] / "docs" / "getting_started.md"


@pytest.fixture(params=[pytest.param("as printed", marks=pytest.mark.slow), "with less effort"])
def effort(request, monkeypatch) -> None:
    """Let the page's own calls have what they ask for, or a sixth of the CPU time: fewer rays, no budget of tubes."""
    if request.param == "as printed":
        return
    rays = ss.RadarSettings(method="raycast", raycast={"num_rays": 20_000})
    front = ss.Rig.front("draft")
    sensors = [replace(item, settings=rays) if item.kind == "radar" else item for item in front.sensors]
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
