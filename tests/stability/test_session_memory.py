"""A session of a thousand steps, with actors that come and go, keeps its memory."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.engine.memory import release_memory, resident_bytes
from scarl_sionna.fusion.rig import SensorMount
from tests.scenes import Thing, plane, write_scene

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
    pytest.mark.slow,
    pytest.mark.own_process("session"),
]
PLACE = ss.Pose([-3.0, 0.0, 1.0])


def poses(step: int) -> dict[str, ss.ActorPose]:
    """Each of nine comes and goes with a period of its own, under a new name each time."""
    found = {}
    for number in range(9):
        turn, inside = divmod(step + 5 * number, 11 + number)
        if inside < 6 + number % 4:
            place = ss.Pose([8.0 + 3.0 * number + 0.3 * inside, 3.0 - number, 0.0])
            body = "small_car" if number % 2 else "adult_man"
            found[f"{number}-{turn}"] = ss.ActorPose(place, ss.Twist([1.5, 0.1 * number, 0.0]), body)
    return found


def test_a_thousand_steps_keep_the_memory_and_replay_to_the_same_bytes(tmp_path) -> None:
    scene = write_scene(tmp_path, instances=[Thing("ground", plane(400, 400), "Roads", is_object=False)])
    radar = ss.RadarSpec().with_(num_chirps=16, num_samples=64)
    rig = ss.Rig(
        "small",
        (
            SensorMount("radar", "radar", radar, ss.Pose(), ss.RadarSettings.of("raycast", num_rays=20_000)),
            SensorMount("camera", "camera", ss.CameraSpec(width=32, height=24, samples_per_pixel=1), ss.Pose()),
        ),
    )
    bodies = {"small_car": 5, "adult_man": 5}
    settings = ss.SessionSettings(bodies=bodies, detail="light", rates={"camera": 5.0})
    taken, kept, times = [], {}, [0.05 * step for step in range(1000)]
    with ss.Session(scene, rig, settings, vehicle=PLACE) as session:
        for step, time in enumerate(times):
            frame = session.step(time, poses(step))
            assert len([item for item in frame.objects if item.is_actor]) == len(poses(step))
            if step % 199 == 0:
                kept[step] = frame
                release_memory()
                taken.append(resident_bytes()[0])
    # after the second reading all kernels are there; what grows is two numbers for each quarter of a second of a body
    assert taken[-1] - taken[1] < 10e6, taken
    again = ss.SessionSettings(bodies=bodies, detail="light", rates={"camera": 1e-3, "radar": 1e-3}, record=True)
    with ss.Session(scene, rig, again, vehicle=PLACE) as session:
        for step, time in enumerate(times):
            session.step(time, poses(step))
        recorded = session.recorded()
    for step, frame in kept.items():
        replayed = ss.observe(recorded, rig, times[step], vehicle=PLACE)
        assert replayed.results["radar"].adc_int.tobytes() == frame.results["radar"].adc_int.tobytes(), step
        if "camera" in frame.results:
            image = replayed.results["camera"].rgb
            np.testing.assert_array_equal(image, frame.results["camera"].rgb)
