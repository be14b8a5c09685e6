"""SUMO in the loop: others see the ego that is driven from outside, poses and velocities agree, one at a time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import SessionError, SpecError
from scarl_sionna.fusion.rig import SensorMount
from scarl_sionna.scenario.motion.bodies import body_of
from scarl_sionna.scenario.spec.actors import TrafficSpec
from scarl_sionna.scene.lanes import LaneNetwork, lanes_from_tables
from tests.scenes import Thing, box, plane, write_scene

pytest.importorskip("libsumo")
from scarl_sionna.loop.sumo_traffic import SumoSettings, SumoTraffic

SALOON = {"saloon": 1.0}
LENGTH = body_of("saloon", None).length
STEP = 0.1
EGO = {"kind": "waypoints", "times": [0, 1], "positions": [[0, 0, 0], [10, 0, 0]]}


def lane(*points: list[float]) -> LaneNetwork:
    return lanes_from_tables([{"name": "a", "points": list(points)}])


def traffic(
    network: LaneNetwork, seed: int = 3, step: float = STEP, most: Mapping[str, int] | None = None
) -> SumoTraffic:
    spec = TrafficSpec(density=15.0, seed=seed, mix=SALOON)
    return SumoTraffic(network, spec, SumoSettings(step=step, warm_up=20.0), most=most)


STRAIGHT = lane([0.0, 0.0, 0.0], [600.0, 0.0, 0.0])


def test_others_stop_behind_an_ego_that_stands() -> None:
    stopped = ss.Pose([500.0, 0.0, 0.0])
    with traffic(STRAIGHT) as free:
        passing = [free.step() for _ in range(300)]
    assert any(one.pose.position[0] > 520.0 for poses in passing for one in poses.values())
    with traffic(STRAIGHT) as blocked:
        early = {name for name, one in blocked.step(stopped).items() if one.pose.position[0] > 450.0}
        for _ in range(300):
            poses = blocked.step(stopped)
            assert poses["ego"].pose is stopped
    queue = {name: one for name, one in poses.items() if name not in early}
    nearest = max(one.pose.position[0] for one in queue.values())
    assert 500.0 - 15.0 < nearest < 500.0 - 0.5 * (4.5 + LENGTH)  # close behind, and not in it
    last = max(queue.values(), key=lambda one: one.pose.position[0])
    assert last.twist is not None and np.linalg.norm(last.twist.linear) < 0.1


def test_vehicles_turn_smoothly_along_a_bend() -> None:
    """The yaw rate is speed over radius, the lane's corners smoothed; velocities carry on to the next step."""
    turn, step = np.linspace(0.0, 3.0, 80), 0.05
    bend = [[60.0 * np.sin(a), 60.0 * (1.0 - np.cos(a)), 0.0] for a in turn]
    with traffic(lane([-200.0, 0.0, 0.0], *bend), step=step, seed=5) as running:
        before, errors, rates = running.step(), [], []
        for _ in range(300):
            now = running.step()
            for name in before.keys() & now.keys():
                told, earlier = now[name].twist, before[name]
                assert told is not None and earlier.twist is not None
                errors.append(
                    np.linalg.norm(now[name].pose.position - earlier.pose.position - step * earlier.twist.linear)
                )
                x, y, _ = now[name].pose.position
                if x > 20.0 and 20.0 < y < 100.0:
                    rates.append(told.angular[2] * 60.0 / np.linalg.norm(told.linear))
            before = now
    assert len(errors) > 500 and max(errors) < 0.02  # [m]: 8 m/s2 over one step
    assert len(rates) > 100 and np.mean(rates) == pytest.approx(1.0, abs=0.05)
    # a corner of 2.3 m / 60 m, half of it to each side, over the mean angle of a front axle 3.5 m ahead; SUMO's own: 4
    assert np.abs(np.array(rates) - 1.0).max() < 0.5 * 2.3 / 3.5 + 0.02


def test_heights_and_pitch_are_those_of_the_road() -> None:
    with traffic(lane([0.0, 0.0, 0.0], [500.0, 0.0, 25.0])) as running:
        poses = running.step()
    assert poses
    for one in poses.values():
        assert one.pose.position[2] == pytest.approx(0.05 * one.pose.position[0], abs=0.05)
        assert one.pose.rotation[2, 0] == pytest.approx(np.sin(np.arctan(0.05)), abs=1e-3)


def test_same_seed_same_poses_and_only_one_at_a_time() -> None:
    ego = ss.Pose([100.0, 0.0, 0.0])
    found = []
    for seed in (3, 3, 4):
        with traffic(STRAIGHT, seed) as running:
            with pytest.raises(SessionError, match="already runs"):
                traffic(STRAIGHT)
            for _ in range(5):
                poses = running.step(ego)
            assert running.time == pytest.approx(5 * STEP)
            found.append({name: one.pose.position.tobytes() for name, one in poses.items()})
        with pytest.raises(SessionError, match="closed"):
            running.step(ego)
    assert found[0] == found[1] != found[2]
    with pytest.raises(SpecError, match="step"):
        traffic(STRAIGHT, step=2.0)


def test_a_session_sees_the_nearest_of_them(tmp_path: Path) -> None:
    scene = write_scene(
        tmp_path,
        instances=[Thing("ground", plane(1400, 40), "Roads", is_object=False)],
        actors=[Thing("ego", box((4, 2, 1.5), (0, 0, 0.95)), "Car", "steel", EGO)],
        ego="ego",
    )
    fast = ss.RadarSettings.of("raycast", num_rays=20_000)
    radar = SensorMount(
        "radar", "radar", ss.RadarSpec().with_(num_chirps=16, num_samples=64), ss.Pose([2.1, 0, 0.8]), fast
    )
    settings = ss.SessionSettings(bodies={"saloon": 2}, detail="light")
    with (
        traffic(STRAIGHT, most=settings.bodies) as running,
        ss.Session(scene, ss.Rig("r", (radar,)), settings) as session,
    ):
        for step in range(3):
            ego = ss.ActorPose(ss.Pose([300.0 + step, 0.0, 0.0]), ss.Twist([10.0, 0.0, 0.0]))
            poses = running.step(ego)
            frame = session.step(running.time, poses)
        everybody = running._others()
    assert {item.name for item in frame.objects if item.is_actor} == set(poses) and len(poses) == 3
    away = {name: abs(one.pose.position[0] - 302.0) for name, one in everybody.items()}
    assert set(poses) - {"ego"} == set(sorted(away, key=away.__getitem__)[:2]) and len(away) > 2
    assert frame.results["radar"].adc_int.any()


def test_the_example_runs(capsys: pytest.CaptureFixture[str]) -> None:
    from examples.sumo_ego import main

    frames = main(num_steps=4)
    assert ["radar" in frame.results for frame in frames] == [True, True, False, True]  # at 0.05, 0.1 and 0.2 s
    assert "m/s" in capsys.readouterr().out
