"""Previews of scenarios: actors are drawn where they are, at the time that they are there; files and mistakes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from scarl_sionna.app import preview as module
from scarl_sionna.app.preview import ACTOR_COLORS, EGO_COLOR, write_preview
from scarl_sionna.cli import app
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from tests.exports import scene_file

RUN = CliRunner()


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> ScenarioSpec:
    """Return 2 s of an ego at 10 m/s, turning by 0.2 rad/s, and a car ahead at 15 m/s."""
    return ScenarioSpec(scene=str(scene_file(tmp_path_factory.mktemp("scene"))), num_frames=5, frame_rate=2.5)


@pytest.fixture(scope="module")
def made(scenario: ScenarioSpec, tmp_path_factory: pytest.TempPathFactory) -> module.Preview:
    return write_preview(scenario, tmp_path_factory.mktemp("preview") / "drive.gif")


def centre_of(picture: np.ndarray, color: tuple[int, int, int]) -> np.ndarray:
    """Return the mean column and row of pixels of a colour, within what the palette changes."""
    rows, columns = np.nonzero(np.abs(picture.astype(int) - color).max(axis=-1) < 24)
    assert len(rows) > 20
    return np.array([columns.mean(), rows.mean()])


def test_actors_move_as_they_do(scenario: ScenarioSpec, made: module.Preview) -> None:
    world = module.load_world(scenario)
    with Image.open(made.animation) as gif:
        assert gif.n_frames == made.num_frames == 5
        lengths = []
        for index in range(5):
            gif.seek(index)
            lengths.append(gif.info["duration"])
        gif.seek(0)
        first = np.asarray(gif.convert("RGB"))
        gif.seek(4)
        last = np.asarray(gif.convert("RGB"))
    assert lengths == [400] * 5  # real time
    places = np.concatenate([[world.at(t).actor_pose(n).position[:2] for n in ("ego", "car")] for t in scenario.times])
    view = module._view_of(places)
    for picture, time in ((first, 0.0), (last, 1.6)):
        for name, color in (("ego", EGO_COLOR), ("car", ACTOR_COLORS["Car"])):
            box = {item.name: item for item in world.at(time).boxes()}[name]
            expected = view.pixel(box.world_from_box.position[None, :2])[0] / module.SMOOTH
            assert (
                np.abs(centre_of(picture, color) - expected).max() < 0.5 * view.scale
            )  # half a metre; the nose is dark


def test_strip_has_a_picture_a_time(made: module.Preview) -> None:
    assert made.strip is not None
    with Image.open(made.strip) as strip:
        camera = module.STRIP_CAMERA
        assert strip.size == (5 * camera.width + 4 * 4, camera.height)
        assert np.asarray(strip).std() > 10.0


def test_mp4(scenario: ScenarioSpec, tmp_path: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    made = write_preview(scenario, tmp_path / "drive.mp4", strip=False)
    assert made.strip is None
    count, seconds = ffmpeg.count_frames_and_secs(str(made.animation))
    assert count == 5 and seconds == pytest.approx(2.0, abs=0.05)


def test_command(scenario: ScenarioSpec, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    scenario.with_(name="drive").save(tmp_path / "drive.yaml")
    result = RUN.invoke(app, ["preview", "drive.yaml", "--duration", "0.8", "--no-strip"])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "drive.gif").stat().st_size > 1000
    assert "animation: drive.gif (2 pictures)" in result.output


def test_mistakes(scenario: ScenarioSpec, tmp_path: Path) -> None:
    with pytest.raises(ParameterRangeError, match=r"\.gif or \.mp4"):
        write_preview(scenario, tmp_path / "drive.avi")
    with pytest.raises(ParameterRangeError, match="frame_rate"):
        write_preview(scenario, tmp_path / "drive.gif", frame_rate=-1.0)
    result = RUN.invoke(app, ["preview", "cutin"])
    assert result.exit_code != 0 and "cut_in" in result.output
    (tmp_path / "file").write_text("")
    result = RUN.invoke(app, ["preview", "cut_in", "--out", str(tmp_path / "file" / "x.gif"), "--duration", "0.2"])
    assert result.exit_code != 0 and "cannot write" in result.output
