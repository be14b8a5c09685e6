"""Units of motion files: stated speeds and headings against positions and times, columns that are not known."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from scarl_sionna.core.errors import ScarlWarning, TrajectoryFileError
from scarl_sionna.scenario.motion.tables import read_table
from scarl_sionna.scenario.traffic.recorded.fcd import read_fcd

COURSE = np.radians(30.0)
TIMES = np.arange(0.0, 6.01, 0.25)


def table(folder: Path, columns: dict[str, object]) -> Path:
    """Write a car at 10 m/s towards 30 deg; columns that are given go before its own or stand beside them."""
    own = {"time": TIMES, "x": 10.0 * TIMES * np.cos(COURSE), "y": 10.0 * TIMES * np.sin(COURSE)} | columns
    rows = [["a", *(np.broadcast_to(value, TIMES.shape)[k] for value in own.values())] for k in range(len(TIMES))]
    path = folder / "t.csv"
    path.write_text("\n".join(",".join(map(str, row)) for row in [["id", *own], *rows]) + "\n")
    return path


@pytest.mark.parametrize(
    "columns",
    [
        {},
        {"speed": 10.0, "yaw_deg": 30.0},
        {"speed": 11.0, "yaw_deg": np.where(np.arange(len(TIMES)) % 2, 30.0, 390.0)},
        {"speed": ""},
        {"speed": -10.0, "yaw_deg": 210.0},
        {"yaw_deg": np.degrees(COURSE) - 20.0},
    ],
)
def test_what_fits_is_read_without_a_word(tmp_path: Path, columns: dict[str, object]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        motion = read_table(table(tmp_path, columns))["a"]
    assert np.linalg.norm(motion.twist(3.0).linear) == pytest.approx(10.0, rel=1e-6)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"speed": 36.0}, "says 36 m/s in the median, positions and times make 10 m/s"),
        ({"speed": 10.0, "time": 1000.0 * TIMES}, "positions and times make 0.01 m/s"),
        ({"speed": 10.0, "x": 11.5 + TIMES * 1.3e-4, "y": 48.1}, "not degrees"),
        ({"yaw_deg": COURSE}, "is 29 deg off the course of the positions in the median, and not if it is in radians"),
    ],
)
def test_other_units_are_refused_with_numbers(tmp_path: Path, columns: dict[str, object], message: str) -> None:
    with pytest.raises(TrajectoryFileError, match=message):
        read_table(table(tmp_path, columns))


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"speed": 15.0}, "'speed' says 15 m/s in the median, positions and times make 10 m/s"),
        ({"yaw_deg": 90.0}, "'yaw_deg' is 60 deg off the course"),
        ({"time": 1000.0 * TIMES}, "250 s apart and nothing is faster than 0.01 m/s"),
        ({"yaw": COURSE, "vx": 3.0}, "not used: yaw, vx; known columns: time, id"),
    ],
)
def test_what_hardly_fits_is_said_with_numbers(tmp_path: Path, columns: dict[str, object], message: str) -> None:
    with pytest.warns(ScarlWarning, match=message):
        read_table(table(tmp_path, columns))


def test_floating_car_data_in_degrees_are_refused(tmp_path: Path) -> None:
    """As ``--fcd-output.geo`` writes them: the car stood where 1 m was a degree."""

    def step(time: float) -> str:
        vehicle = f'<vehicle id="v" x="{11.5 + 10.0 * time / 74e3:.7f}" y="48.1" angle="90" type="t" speed="10"/>'
        return f'<timestep time="{time:.2f}">{vehicle}</timestep>'

    path = tmp_path / "geo.fcd.xml"
    path.write_text("<fcd-export>" + "".join(map(step, np.arange(0.0, 10.0, 0.5))) + "</fcd-export>")
    with pytest.raises(TrajectoryFileError, match="says 10 m/s in the median, positions and times make 0.000135 m/s"):
        read_fcd(path)


def test_tracks_whose_times_repeat_are_not_compared(tmp_path: Path) -> None:
    """They are left out later on; the one beside them is read."""

    def step(time: float, again: float) -> str:
        rows = [("v", 10.0 * time, 10.0), *[("r", shift + 10.0 * time, 10.0) for shift in (0.0, again)]]
        return (
            f'<timestep time="{time:.2f}">'
            + "".join(
                f'<vehicle id="{name}" x="{x:.2f}" y="0" angle="90" type="t" speed="{speed}"/>'
                for name, x, speed in rows
            )
            + "</timestep>"
        )

    path = tmp_path / "twice.fcd.xml"
    path.write_text("<fcd-export>" + "".join(step(time, 3.0) for time in np.arange(0.0, 3.0, 0.5)) + "</fcd-export>")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert [actor.name for actor in read_fcd(path)] == ["v"]
    assert [one.category for one in caught] == [ScarlWarning] and "'r' is left out" in str(caught[0].message)
