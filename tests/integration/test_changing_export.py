"""A dataset of an OpenSCENARIO drive in changing weather has the same bytes after a kill, and by workers."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

import scarl_sionna as ss
from scarl_sionna.dataset.statistics.collect import dataset_statistics
from scarl_sionna.dataset.verify import verify
from scarl_sionna.fusion import Rig
from tests import exports
from tests import openscenario_files as files

pytestmark = pytest.mark.own_process(shared=True)


def environment(inside: str) -> str:
    return (
        f'<GlobalAction><EnvironmentAction><Environment name="e">{inside}</Environment></EnvironmentAction>'
        "</GlobalAction>"
    )


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """1.2 s behind another car: fog from 0.35 s on, rain at night from 0.75 s on."""
    folder = tmp_path_factory.mktemp("drive")
    fog = environment('<Weather><Fog visualRange="150"/></Weather>')
    rain = environment(
        '<TimeOfDay animation="false" dateTime="2024-06-21T23:00:00"/><Weather><Fog visualRange="90000"/>'
        '<Precipitation precipitationType="rain" precipitationIntensity="25"/></Weather>'
    )
    actions = files.init("Ego", files.on_lane(40.0), 10.0) + files.init("other", files.on_lane(60.0), 8.0)
    groups = files.group("", files.event(fog, files.after(0.35), "fog"), files.event(rain, files.after(0.75), "rain"))
    files.written(folder, files.scenario(files.vehicle("Ego") + files.vehicle("other"), actions, groups, 1.2))
    place = ss.Pose([2.7, 0.0, 1.0])
    rig = Rig("tiny", tuple(replace(one, vehicle_from_sensor=place) for one in exports.RIG.sensors))
    rig.save(folder / "rig.yaml")
    return folder


@pytest.mark.slow
def test_it_is_the_same_after_a_kill_and_by_workers(drive) -> None:
    arguments = (drive / "drive.xosc", "--rig", drive / "rig.yaml", "--out")
    done = exports.run(*arguments, drive / "whole")
    assert done.returncode == 0, done.stderr
    killed = exports.start(*arguments, drive / "killed")
    assert exports.wait_until(lambda: len(exports.kept_frames(drive / "killed")) >= 5, killed)
    killed.kill()
    killed.communicate()
    there = exports.kept_frames(drive / "killed")
    assert 5 <= len(there) < 12
    assert exports.run(*arguments, drive / "killed").returncode == 0
    assert exports.run(*arguments, drive / "workers", "--workers", "2").returncode == 0
    whole = exports.contents(drive / "whole")
    assert exports.contents(drive / "killed") == whole
    assert exports.contents(drive / "workers") == whole
    assert verify(drive / "whole").complete
    stated = json.loads(whole["manifest.json"])
    changes = json.dumps(stated)
    assert '"changes"' in changes
    weathers = dataset_statistics(drive / "whole").frames_by("weather")
    assert weathers == {"clear": 4, "fog 150 m": 4, "rain 25 mm/h": 4}
