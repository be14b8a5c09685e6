"""Figure of a traffic run: plan view and time-space diagram, and the cost of planning against the number of actors.

``python benchmarks/traffic.py [--output docs/figures/traffic.png]``; with ``--speeds``: mean speed over time in all
places.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.patches import Polygon

from scarl_sionna.scenario.checks.collisions import find_collisions
from scarl_sionna.scenario.motion.paths import sample_motion
from scarl_sionna.scenario.spec.actors import TrafficSpec
from scarl_sionna.scenario.traffic.planned import PlannedActor
from scarl_sionna.scenario.traffic.simulated import simulate_traffic
from scarl_sionna.scene.document.find import find_scene, scene_names
from scarl_sionna.scene.document.scene_file import read_document
from scarl_sionna.scene.lanes import LaneNetwork, lanes_from_tables

COLORS = {"vehicle": "tab:blue", "cycle": "tab:green", "walk": "tab:orange"}


def outline(actor: PlannedActor, instant: float) -> np.ndarray:
    """Return the corners (4, 2) [m] of an actor's box."""
    motion = sample_motion(actor.trajectory, [instant])
    cos, sin = np.cos(motion.heading[0]), np.sin(motion.heading[0])
    corners = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) * [actor.body.length / 2, actor.body.width / 2]
    return corners @ np.array([[cos, sin], [-sin, cos]]) + motion.position[0, :2]


def draw_plan(axes: plt.Axes, network: LaneNetwork, actors: list[PlannedActor], instant: float, reach: float) -> None:
    for lane in network.lanes:
        axes.plot(
            *lane.points[:, :2].T,
            color="0.75" if lane.kind == "drive" else "0.88",
            lw=1.0 if lane.kind == "drive" else 0.6,
            zorder=0,
        )
    for actor in actors:
        past = np.linspace(max(actor.trajectory.start, instant - 3.0), instant, 20)
        trace = sample_motion(actor.trajectory, past).position if "parked" not in actor.name else np.zeros((0, 3))
        color = "0.45" if "parked" in actor.name else COLORS[actor.body.motion]
        axes.plot(trace[:, 0], trace[:, 1], color=color, lw=0.9, alpha=0.7)
        axes.add_patch(Polygon(outline(actor, instant), facecolor=color, edgecolor="k", lw=0.3, zorder=3))
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xlabel="x [m]", ylabel="y [m]")


def draw_time_space(
    axes: plt.Axes, network: LaneNetwork, actors: list[PlannedActor], lane_name: str, times: np.ndarray
) -> None:
    """Draw the ways of all vehicles along the straight line of one lane, and where its signal is red."""
    lane = network[lane_name]
    start, direction = lane.points[0, :2], (lane.points[-1] - lane.points[0])[:2] / lane.length
    image = None
    for actor in actors:
        if actor.body.motion != "vehicle" or "parked" in actor.name:
            continue
        motion = sample_motion(actor.trajectory, times)
        away = motion.position[:, :2] - start
        along, beside = away @ direction, np.abs(away @ [-direction[1], direction[0]])
        speed = np.linalg.norm(motion.velocity, axis=1)
        ahead = np.cos(motion.heading) * direction[0] + np.sin(motion.heading) * direction[1]
        shown = (beside < 1.5) & (ahead > 0.9) & (along > -40.0) & (along < lane.length + 90.0)
        segments = np.stack([np.column_stack([times, along])[:-1], np.column_stack([times, along])[1:]], axis=1)
        lines = LineCollection(segments[shown[:-1] & shown[1:]], cmap="viridis", norm=plt.Normalize(0.0, 14.0), lw=1.2)
        lines.set_array(speed[:-1][shown[:-1] & shown[1:]])
        image = axes.add_collection(lines)
    if lane.signal is not None and network.signals is not None:
        red = np.array([not network.signals.is_green(lane.signal, float(one)) for one in times])
        axes.fill_between(times, lane.length - 1.0, lane.length + 1.0, where=red, color="tab:red", lw=0, label="red")
        axes.legend(loc="lower right", frameon=True)
    axes.set(
        xlim=(times[0], times[-1]),
        ylim=(-40.0, lane.length + 90.0),
        xlabel="time [s]",
        ylabel=f"way along lane {lane_name} [m]",
    )
    if image is not None:
        plt.colorbar(image, ax=axes, label="speed [m/s]")


def costs() -> list[tuple[int, float]]:
    """Return number of actors and CPU seconds of planning 10 s."""
    rows = []
    for count in (2, 4, 8, 12):
        network = lanes_from_tables(
            [{"name": f"l{row}", "points": [[0.0, 8.0 * row, 0.0], [500.0, 8.0 * row, 0.0]]} for row in range(count)]
        )
        begin = time.process_time()
        actors = simulate_traffic(network, TrafficSpec(density=26.0))
        rows.append((len(actors), time.process_time() - begin))
    return rows


def speeds(place: str, density: float, num_seeds: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Return mean speed [m/s] and number of the vehicles on the lanes, in each 10 s of a minute, over some seeds."""
    network = read_document(find_scene(place)).lanes
    assert network is not None
    times = np.arange(0.0, 60.0)
    total, count = np.zeros(60), np.zeros(60)
    for seed in range(num_seeds):
        for actor in simulate_traffic(network, TrafficSpec(density=density, seed=seed), (0.0, 60.0)):
            there = (times >= actor.active[0]) & (times <= actor.active[1])
            total += there * np.linalg.norm(sample_motion(actor.trajectory, times).velocity[:, :2], axis=1)
            count += there
    number = count.reshape(6, 10).sum(1)
    return total.reshape(6, 10).sum(1) / number, number / (10.0 * num_seeds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", default="signalised_crossing")
    parser.add_argument("--lane", default="west_in_0")
    parser.add_argument("--output", type=Path, default=Path("docs/figures/traffic.png"))
    parser.add_argument("--speeds", action="store_true")
    parser.add_argument("--density", type=float, default=6.0, help="vehicles on a kilometre, with --speeds")
    arguments = parser.parse_args()
    if arguments.speeds:
        for place in scene_names():
            mean, number = speeds(place, arguments.density)
            print(f"{place}: {np.round(mean, 1).tolist()} m/s, {np.round(number, 1).tolist()} vehicles", flush=True)
        return
    network = read_document(find_scene(arguments.scene)).lanes
    assert network is not None
    begin = time.process_time()
    spec = TrafficSpec(density=16.0, pedestrians=24, cyclists=3, parked=0.6, seed=4)
    actors = simulate_traffic(network, spec, (0.0, 60.0))
    print(f"{len(actors)} actors, 60 s: {time.process_time() - begin:.2f} s CPU")
    times = np.linspace(0.0, 60.0, 1201)
    hits = find_collisions([(one.name, one.trajectory, one.body) for one in actors], times)
    print(f"collisions at 1201 instants: {len(hits)}")
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 5.0), width_ratios=(1.0, 1.25), constrained_layout=True)
    draw_plan(left, network, actors, 28.0, 62.0)
    left.set_title("plan at 28 s, traces of 3 s")
    for kind, color in COLORS.items():
        left.plot([], [], "s", color=color, label={"vehicle": "vehicles", "cycle": "cyclists", "walk": "on foot"}[kind])
    left.legend(loc="upper right", fontsize=8)
    draw_time_space(right, network, actors, arguments.lane, times)
    right.set_title("time-space diagram of one approach")
    figure.savefig(arguments.output, dpi=130)
    for count, seconds in costs():
        print(f"{count} actors for 10 s: {seconds:.2f} s CPU")


if __name__ == "__main__":
    main()
