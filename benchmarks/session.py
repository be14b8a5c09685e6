"""Real-time factor of a session with a light rig: one radar and one camera, poses from outside, and where time goes.

    python benchmarks/session.py [--seconds 3] [--step 0.05] [--method raycast] [--rays 20000] [--labels] [--cars 6]

Simulated seconds over wall seconds, after two warm-up steps in which kernels are compiled.
"""

from __future__ import annotations

import argparse
import time
import warnings

from harness import machine, peak_memory

import scarl_sionna as ss
from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.fusion.rig import SensorMount

CAMERA = ss.CameraSpec(width=320, height=180, samples_per_pixel=4, images=("rgb",))
PLACE = ss.Pose([2.36, 0.0, 0.8])


def light_rig(radar: ss.RadarSettings) -> ss.Rig:
    spec = ss.RadarSpec.preset("awr1843boost").with_(num_chirps=64, num_samples=128)
    return ss.Rig(
        "light", (SensorMount("radar", "radar", spec, PLACE, radar), SensorMount("camera", "camera", CAMERA, PLACE))
    )


def poses(now: float, cars: int) -> dict[str, ss.ActorPose]:
    """Cars on a straight road; each comes and goes with a period of its own."""
    told = {"ego": ss.ActorPose(ss.Pose([20.0 * now, 0.0, 0.0]), ss.Twist([20.0, 0.0, 0.0]))}
    for number in range(cars):
        if int(now * 2.0 + number) % (number + 3):
            place = ss.Pose([15.0 + 12.0 * number + 18.0 * now, 3.5 * (number % 2), 0.0])
            told[f"car {number}"] = ss.ActorPose(place, ss.Twist([18.0, 0.0, 0.0]), "small_car")
    return told


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="highway_guardrail")
    parser.add_argument("--detail", default="detailed")
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--step", type=float, default=0.05)
    parser.add_argument("--method", default="raycast")
    parser.add_argument("--rays", type=int, default=20_000)
    parser.add_argument("--labels", action="store_true", help="ground truth of every cell of the radar's map")
    parser.add_argument("--cars", type=int, default=6)
    args = parser.parse_args()
    print(machine())
    warnings.simplefilter("ignore", ScarlWarning)  # posts between the rays
    fields = {"cell_labels": args.labels} | ({"num_rays": args.rays} if args.method == "raycast" else {})
    world = ss.load_scene(args.scene, detail=args.detail)
    whole = light_rig(ss.RadarSettings.of(args.method, **fields))
    for name, rig in (("radar", whole.subset("radar")), ("radar and camera", whole)):
        rates = dict.fromkeys(rig.names, 10.0)
        settings = ss.SessionSettings(rates=rates, bodies={"small_car": args.cars}, detail="light")
        started = time.perf_counter()
        with ss.Session(world, rig, settings, vehicle="ego") as session:
            made = time.perf_counter() - started
            for step in range(4):  # both sensors twice
                session.step(step * args.step, poses(step * args.step, args.cars))
            session.seconds.clear()
            count, wall, cpu = round(args.seconds / args.step), time.perf_counter(), time.process_time()
            for step in range(4, 4 + count):
                session.step(step * args.step, poses(step * args.step, args.cars))
            wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        stages = ", ".join(f"{stage} {1e3 * taken / count:.1f} ms" for stage, taken in session.seconds.items())
        print(
            f"{name}: real-time factor {count * args.step / wall:.2f} wall, {count * args.step / cpu:.2f} CPU; "
            f"{1e3 * wall / count:.0f} ms wall a step ({stages}); made in {made:.1f} s",
            flush=True,
        )
    print(f"peak memory: {peak_memory():.2f} GiB")


if __name__ == "__main__":
    main()
