"""The Python blocks of the README and of every page run as they are printed, one after the other within a page.

Pages that begin in the middle of a session find the names that a session has: a state, a radar, its pose.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
import trimesh
from ipywidgets import Widget

import scarl_sionna as ss
from scarl_sionna.core.pose import Twist
from scarl_sionna.dataset import write_dataset
from scarl_sionna.dataset.formats import convert
from tests.calibration_street import street
from tests.drive import drive
from tests.point_files import write_radar_scenes

REPO = Path(__file__).resolve().parents[2]
OWN_TESTS = ("getting_started.md", "reading.md", "formats.md")
"""Pages whose results are looked at by tests of their own."""
SLOW = (  # what they call is tested in files of its own; that the names are there, below for all pages
    "install.md", "scenes.md", "scenarios.md", "sionna_paths.md", "scanning_radar.md", "closed_radars.md",
    "communication.md", "weather.md", "tracking.md",
    "scatterers.md", "README.md", "rcs.md", "accuracy.md", "camera.md", "materials.md", "micro_doppler.md",
    "demo.md", "actors.md", "export.md", "interference.md", "session.md", "prompt.md",
    "radar_settings.md", "radar_labels.md", "calibration.md",
)  # fmt: skip # a table
PAGES = sorted(
    path
    for path in (REPO / "README.md", *(REPO / "docs").glob("*.md"))
    if "```python" in path.read_text(encoding="utf-8") and path.name not in OWN_TESTS
)
PATTERN = "azimuth_deg,elevation_deg,gain_dbi\n" + "".join(
    f"{azimuth},{elevation},{5.0 - 0.002 * (azimuth**2 + elevation**2):.3f}\n"
    for azimuth in range(-60, 61, 20)
    for elevation in range(-60, 61, 20)
)
MATERIAL = '[my_wall]\nsource = "own"\nrelative_permittivity = 3.0\nconductivity = 0.2\nuncertainty = "10 %"\n'


@dataclass(frozen=True, eq=False)
class SonarPing:
    """Result of the sensor that docs/dataset.md plugs in."""

    echo: np.ndarray


@pytest.fixture(scope="module")
def session() -> Iterator[dict[str, Any]]:
    """Return the names of a session."""
    world = ss.load_scene("highway_guardrail")
    state = world.at(0.5)
    pose = state.actor_pose("ego").compose(ss.Pose([2.36, 0.0, 0.8]))
    radar = ss.RadarSpec.preset("awr1843boost")
    targets = pose.apply(np.array([[12.0, 0.5, 0.0], [30.0, -2.0, 0.3]]))
    paths = ss.point_targets(targets, np.zeros((2, 3)), np.ones(2), radar, pose)
    names = {
        "__name__": "docs",
        "np": np,
        "ss": ss,
        "world": world,
        "state": state,
        "radar": radar,
        "pose": pose,
        "mount": state.mount("ego", ss.Pose([2.36, 0.0, 0.8])),
        "paths": paths,
        "twist": Twist(),
        "rng": np.random.default_rng(0),
        "world_from_camera": pose,
        "world_from_lidar": pose,
        "camera_spec": ss.CameraSpec(width=64, height=36),
        "points_camera_optical": np.array([[0.5, 0.2, 10.0]]),
        "positions": targets,
        "velocities": np.zeros((2, 3)),
        "rcs": np.ones(2),
        "mesh": corner(),
        "SonarSpec": object,
        "SonarPing": SonarPing,
    }
    yield names
    names.clear()


def corner() -> trimesh.Trimesh:
    """Return a trihedral of 5 cm."""
    points = 0.05 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    return trimesh.Trimesh(points, [[0, 1, 2], [0, 2, 3], [0, 3, 1]], process=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a working folder with the files that pages name."""
    root = tmp_path_factory.mktemp("docs_code")
    (root / "examples").symlink_to(REPO / "examples")
    (root / "patch.csv").write_text(PATTERN, encoding="utf-8")
    for name in ("my_materials.toml", "mine.toml"):
        (root / name).write_text(MATERIAL, encoding="utf-8")
    street(root / "street").rename(root / "street" / "street.xml")
    for file in (root / "street").iterdir():
        file.rename(root / file.name)
    for name in ("corner", "body", "windows", "tyres", "car"):
        corner().export(root / f"{name}.ply")
    source = drive(num_frames=13, ends=("front",), scenes=("drive",))
    write_dataset(root / "out", source.rig, {"drive": list(source.scenes[0])})
    shutil.copytree(root / "out", root / "demo_out")
    convert(root / "out", "dca1000", root / "cap")
    (root / "sequence_1").mkdir()
    write_radar_scenes(root / "sequence_1", [(10**6, 1, [{"range_sc": 12.0, "label_id": 0, "track_id": b"a"}])])
    return root


def case(page: Path) -> object:
    # what pages leave behind would stay in the worker for the files after them: a few processes share the pages
    is_slow = page.name in SLOW
    process = "tensorflow" if page.name == "calibration.md" else str(PAGES.index(page) % 5) if is_slow else "quick"
    marks = [pytest.mark.slow] * is_slow + [pytest.mark.own_process(process)]
    return pytest.param(page, id=page.name, marks=marks)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("page", [case(page) for page in PAGES])
def test_blocks_run(page: Path, folder: Path, session: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    names = dict(session)
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    try:
        for number, block in enumerate(blocks):
            exec(compile(block, f"{page.name}, block {number}", "exec"), names)
    finally:
        names.clear()  # what a page registers or traces keeps its names alive, and with them its worlds
        plt.close("all")
        Widget.close_all()  # those of a preview hold its scene


def texts(file: Path) -> list[str]:
    """Return the Python code of a page or a notebook."""
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".md":
        return re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    return ["".join(cell["source"]) for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]


def found(node: ast.expr, names: dict[str, Any]) -> Any:
    """Return what `ss.A.b` stands for, None where that depends on values; raise AttributeError where it is not."""
    if isinstance(node, ast.Name):
        return names.get(node.id)
    owner = found(node.value, names) if isinstance(node, ast.Attribute) else None
    if not inspect.isclass(owner) and not inspect.ismodule(owner):
        return None
    if inspect.isclass(owner) and node.attr in getattr(owner, "model_fields", ()):  # type: ignore[union-attr]
        return None
    return getattr(owner, node.attr)  # type: ignore[union-attr]


@pytest.mark.parametrize("file", [*PAGES, *sorted((REPO / "notebooks").glob("*.ipynb"))], ids=lambda file: file.name)
def test_names_and_keywords_are_there(file: Path) -> None:
    """What a page imports from here, takes from it by name, and calls it with, also where it runs only when asked."""
    names: dict[str, Any] = {"ss": ss}
    for text in texts(file):
        tree = ast.parse(text)
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and str(node.module).split(".")[0] in ("scarl_sionna", "camera_lidar"):
                module = importlib.import_module(str(node.module))
                names |= {item.asname or item.name: getattr(module, item.name) for item in node.names}
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute):
                found(node, names)
            target = found(node.func, names) if isinstance(node, ast.Call) else None
            if target is None or target in (ss.LidarSpec, ss.RadarSpec):  # these take fields of their parts as well
                continue
            known = inspect.signature(target).parameters
            if not any(one.kind is one.VAR_KEYWORD for one in known.values()):
                assert {one.arg for one in node.keywords} - {None} <= set(known), ast.unparse(node)
