"""Files that nobody vouches for: read, or refused by a typed error, in bounded time and memory."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scarl_sionna.core.errors import DatasetError, MeshError, ParameterRangeError, ScarlError, TrajectoryFileError
from scarl_sionna.core.untrusted.json_text import parse_json
from scarl_sionna.core.untrusted.yaml_text import parse_yaml
from scarl_sionna.dataset import open_dataset
from scarl_sionna.dataset.store.files import LocalFiles
from scarl_sionna.dataset.store.manifest import read_manifest
from scarl_sionna.dataset.store.records import ShardRecord
from scarl_sionna.fusion.rig import Rig
from scarl_sionna.scenario.motion.tables import read_table
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.scene.document.mesh_files import check_mesh
from tests.children import with_parent
from tests.malformed_kinds import ALIASES, KINDS
from tests.scenes import box

REPO = Path(__file__).resolve().parents[2]
SLOW = 155
"""Cases of each kind in the slow run: 15 kinds without CommonRoad, 2,325 cases."""
FEW = 8


def kinds() -> list[str]:
    return [kind for kind in KINDS if kind != "commonroad" or find_spec("commonroad")]


def read_mutations(names: list[str], count: int, seed: int, folder: Path, seconds: float) -> None:
    """Let a process read mutated files; a crash or a hang is told with the case."""
    arguments = [sys.executable, "-W", "ignore", "-m", "tests.malformed", ",".join(names), str(count), str(seed)]
    done = subprocess.run(
        [*arguments, str(folder)],
        cwd=REPO,
        capture_output=True,
        text=True,
        check=False,
        timeout=seconds,
        **with_parent(),
    )
    lasts = {name: (folder / name / "last") for name in names}
    last = [path.read_text() for path in lasts.values() if path.is_file()]
    assert done.returncode == 0, f"ended with {done.returncode} at {last[-1:]}:\n{done.stderr[-2000:]}"
    rows = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[")]
    bad = [row for row in rows if len(row) == 4]
    assert not bad, f"{len(bad)} cases: {bad[0][:3]}\n{bad[0][3]}"
    assert [row[0] for row in rows] == names
    assert all(row[2] > 0.3 * row[1] for row in rows), rows  # most mutations are seen


def test_a_sample_of_mutated_files(tmp_path) -> None:
    """Of every second kind; the slow run has all."""
    read_mutations([kind for kind in kinds() if kind != "world"][::2], FEW, 7, tmp_path, 300.0)


def test_a_sample_of_mutated_worlds(tmp_path) -> None:
    read_mutations(["world"], FEW, 7, tmp_path, 300.0)


@pytest.mark.slow
@pytest.mark.parametrize("kind", kinds())
def test_mutated_files(kind: str, tmp_path) -> None:
    read_mutations([kind], SLOW, 1, tmp_path, 900.0)


SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
WORDS = st.sampled_from(
    ["name", "sensors", "kind", "radar", "camera", "spec", "settings", "vehicle_from_sensor", "position", "quaternion"]
    + ["scene", "num_frames", "actors", "trajectory", "weather", "format", "schema_version", "configuration", "rig"]
    + ["scenes", "shards", "storage", "shard_frames", "frames", "failed", "arrays", "files", "dtype", "shape", "axes"]
)
PLAIN = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(WORDS | st.text(max_size=5), inner, max_size=5),
    max_leaves=20,
)


@settings(max_examples=30, deadline=5000, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=PLAIN)
def test_any_plain_data_is_read_or_refused(tmp_path, data: object) -> None:
    text = json.dumps(data)
    path = tmp_path / "data.json"
    path.write_text(text)
    (tmp_path / "manifest.json").write_text(
        json.dumps({"format": "scarl-dataset", "schema_version": 2, **(data if isinstance(data, dict) else {})})
    )
    for read in (
        lambda: Rig.load(path),
        lambda: ScenarioSpec.load(path),
        lambda: ShardRecord.parse(text.encode()),
        lambda: read_manifest(LocalFiles(tmp_path)),
    ):
        with suppress(ScarlError):
            read()


def test_ten_lines_of_aliases_do_not_stand_for_ten_thousand_million_values(tmp_path) -> None:
    (tmp_path / "bomb.yaml").write_text(ALIASES)
    with pytest.raises(ParameterRangeError, match="100000 values"):
        Rig.load(tmp_path / "bomb.yaml")
    with pytest.raises(ScarlError, match="100000 values"):
        ScenarioSpec.load(tmp_path / "bomb.yaml")


@pytest.mark.skipif(sys.platform != "linux", reason="pipes")
def test_a_pipe_is_refused_at_once(tmp_path) -> None:
    for name in ("rig.yaml", "tracks.csv", "tracks.xml", "tracks.xml.gz"):
        os.mkfifo(tmp_path / name)
    with pytest.raises(ParameterRangeError, match="no regular file"):
        Rig.load(tmp_path / "rig.yaml")
    for name in ("tracks.csv", "tracks.xml", "tracks.xml.gz"):
        with pytest.raises(TrajectoryFileError, match="no regular file"):
            read_table(tmp_path / name)


def ply(folder: Path, vertex: float = 0.0, index: int = 2, ascii_form: bool = False) -> Path:
    """Write a box of which one coordinate and one index are given."""
    mesh = box([2.0, 2.0, 2.0])
    mesh.vertices[3, 1] = vertex
    path = folder / "mesh.ply"
    mesh.export(path, encoding="ascii" if ascii_form else "binary", vertex_normal=False)
    if ascii_form:
        lines = path.read_text().splitlines()
        words = lines[-1].split()
        lines[-1] = " ".join([words[0], str(index), *words[2:]])
        path.write_text("\n".join(lines) + "\n")
    else:
        data = path.read_bytes()
        path.write_bytes(data[:-12] + np.array([index], "<i4").tobytes() + data[-8:])
    return path


@pytest.mark.parametrize("ascii_form", [False, True])
def test_a_mesh_that_the_engine_would_not_survive(tmp_path, ascii_form: bool) -> None:
    check_mesh("a", ply(tmp_path, ascii_form=ascii_form), "ply")
    for index in (8, -1, 2**31 - 1):
        with pytest.raises(MeshError, match=f"face 11 with vertex {index}, there are 8"):
            check_mesh("a", ply(tmp_path, index=index, ascii_form=ascii_form), "ply")
    for vertex in (float("nan"), 1e30, float("-inf")):
        with pytest.raises(MeshError, match="vertex 3 at"):
            check_mesh("a", ply(tmp_path, vertex=vertex, ascii_form=ascii_form), "ply")


def test_a_jump_of_kilometres_is_named_by_its_row(tmp_path) -> None:
    rows = [f"{0.1 * i:.1f},a,{1.2 * i + (5000.0 if i > 20 else 0.0):.2f},0" for i in range(40)]
    (tmp_path / "t.csv").write_text("time,id,x,y\n" + "\n".join(rows) + "\n")
    with pytest.raises(TrajectoryFileError, match=r"row 22: 'a' goes 5001 m in 0.1 s"):
        read_table(tmp_path / "t.csv")


@pytest.mark.parametrize(("where", "value"), [("num_frames", 10**8), ("shard_frames", 0), ("shard_frames", "8")])
def test_a_manifest_of_impossible_numbers(tmp_path, where: str, value: object) -> None:
    KINDS["dataset"].write(tmp_path)
    path = tmp_path / "d/manifest.json"
    data = json.loads(path.read_text())
    (data["scenes"]["a"] if where == "num_frames" else data["configuration"]["storage"])[where] = value
    path.write_text(json.dumps(data))
    (tmp_path / "d/manifest.backup.json").unlink()
    with pytest.raises(DatasetError, match=f"manifest.json is damaged: .*{where}"):
        open_dataset(tmp_path / "d")


def test_json_escapes_of_one_character_are_one_character_in_yaml(tmp_path) -> None:
    whole = {"a": "\U00010000 é"}
    assert parse_yaml(json.dumps(whole)) == whole == parse_json(json.dumps(whole))
    with pytest.raises(ValueError, match="half a character"):
        parse_json(b'{"a": ["\\uD800"]}')
    path = tmp_path / "data.json"
    for text, words in (('{"weather": "\\ud800\\udc00"}', "weather"), ('{"weather": "\\ud800"}', "half a character")):
        path.write_text(text)
        with pytest.raises(ScarlError, match=words):
            ScenarioSpec.load(path)
