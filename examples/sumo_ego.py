"""SUMO in the loop: an ego vehicle drives among SUMO's traffic and keeps its distance by what stands before it.

python -m examples.sumo_ego            (needs the extra ``sumo``)
"""

from __future__ import annotations

import numpy as np

import scarl_sionna as ss
from scarl_sionna.fusion.rig import SensorMount
from scarl_sionna.loop.sumo_traffic import SumoSettings, SumoTraffic
from scarl_sionna.scenario.spec.actors import TrafficSpec
from scarl_sionna.scene.lanes import Lane

SCENE, LANE = "signalised_crossing", "west_in_0"
STEP, SPEED, BRAKE = 0.05, 10.0, 3.0
"""Step [s], wanted speed [m/s], and braking that is comfortable [m/s2]."""


def along(lane: Lane, way: float, speed: float) -> ss.ActorPose:
    """Return the ego on a lane's centre line."""
    here, ahead = lane.at(np.array([way, way + 0.5]))
    course = (ahead - here) / np.linalg.norm(ahead - here)
    return ss.ActorPose(ss.Pose.from_heading(here, float(np.arctan2(course[1], course[0]))), ss.Twist(speed * course))


def gap(ego: ss.Pose, others: dict[str, ss.ActorPose]) -> float:
    """Return the distance to whoever is next in the ego's own lane [m]."""
    places = [ego.inverse().apply(one.pose.position) for name, one in others.items() if name != "ego"]
    return min((float(x) - 5.0 for x, y, _ in places if x > 0.0 and abs(y) < 1.5), default=np.inf)


def main(num_steps: int = 100) -> list[ss.Frame]:
    """Drive, print what the radar's strongest echo is, and return the frames."""
    world = ss.load_scene(SCENE, detail="light")
    network = world.document.lanes
    assert network is not None
    lane = next(one for one in network.lanes if one.name == LANE)
    radar = ss.RadarSpec.preset("awr1843boost").with_(num_chirps=64, num_samples=128)
    fast = ss.RadarSettings.of("raycast", num_rays=100_000, cell_labels=False)
    rig = ss.Rig("one", (SensorMount("radar", "radar", radar, ss.Pose([2.36, 0.0, 0.8]), fast),))
    settings = ss.SessionSettings(bodies={"saloon": 6, "van": 2}, detail="light", rates={"radar": 10.0})
    mix = TrafficSpec(density=12.0, seed=1, mix={"saloon": 3.0, "van": 1.0})
    way, speed, frames = 20.0, SPEED, []
    with (
        SumoTraffic(network, mix, SumoSettings(step=STEP), most=settings.bodies) as traffic,
        ss.Session(world, rig, settings) as session,
    ):
        ego = along(lane, way, speed)
        for _ in range(num_steps):
            poses = traffic.step(ego)
            frames.append(session.step(traffic.time, poses))
            room = min(gap(ego.pose, poses), lane.length - way - 5.0)
            speed = min(speed + 2.0 * STEP, SPEED, float(np.sqrt(2.0 * BRAKE * max(room, 0.0))))
            way += speed * STEP
            ego = along(lane, way, speed)
            if "radar" in frames[-1].results:
                rd = ss.range_doppler(frames[-1].radars["radar"])
                row, column = np.unravel_index(rd.power.argmax(), rd.power.shape)
                print(
                    f"{traffic.time:5.2f} s, ego {speed:4.1f} m/s, {len(poses) - 1} others, {room:5.1f} m of room; "
                    f"strongest echo {rd.range[column]:5.1f} m, {rd.radial_velocity[row]:+.1f} m/s"
                )
    return frames


if __name__ == "__main__":
    main()
