"""Scenarios that state what cannot be: the error names what, where and the line."""

from pathlib import Path

import pytest
import trimesh

from scarl_sionna.core.errors import ScenarioFileError, ScenarioNameError, ScenarioValueError
from scarl_sionna.scenario.compose import compose
from scarl_sionna.scenario.spec.scenario import ScenarioSpec

HEAD = "scene: urban_crossing\nduration: 1.0\n"


def _load(folder: Path, text: str) -> ScenarioSpec:
    file = folder / "one.yaml"
    file.write_text(text)
    return ScenarioSpec.load(file)


def test_a_cache_folder_that_is_a_file_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "taken").touch()
    monkeypatch.setenv("SCARL_CACHE_DIR", str(tmp_path / "taken"))
    with pytest.raises(ScenarioFileError, match="set SCARL_CACHE_DIR to a folder that can be written") as caught:
        compose(_load(tmp_path, "scene: roundabout\nvariant: 12345\nduration: 1.0\n"))
    assert caught.value.line == 1


def test_a_motion_that_jumps_names_speed_and_line(tmp_path: Path) -> None:
    ways = "trajectory: {kind: waypoints, positions: [[22, -1.7], [122, -1.7]], times: [0, 1.2]}"
    with pytest.raises(ScenarioValueError, match="speed of 'a' is 83.3 m/s") as caught:
        compose(_load(tmp_path, HEAD + f"actors:\n  - name: a\n    model: saloon\n    {ways}\n"))
    assert caught.value.line == 6


def test_a_mesh_of_unknown_material_names_the_line(tmp_path: Path) -> None:
    box = trimesh.creation.box(extents=(4.5, 1.8, 1.5))
    box.apply_translation((0.0, 0.0, 0.75))
    box.export(tmp_path / "box.stl")
    text = 'actors:\n  - name: a\n    mesh: {file: box.stl, semantic: Car, materials: {"*": gold}}\n'
    with pytest.raises(ScenarioNameError, match="unknown radio material 'gold'") as caught:
        compose(_load(tmp_path, HEAD + text + "    trajectory: {kind: static, position: [30, -1.7, 0]}\n"))
    assert caught.value.line == 5
