"""What pitch under braking and roll in bends change of a car: its echo, its box, and the velocity of its parts.

python benchmarks/body_attitude.py [--model saloon] [--detail light]

A body is tilted as a whole by what the springs of a car have at 3 m/s^2 of braking and at 2 m/s^2 across. A radar
behind or before it then sees it from another elevation, and so does one beside it.
"""

from __future__ import annotations

import argparse

import numpy as np

import scarl_sionna as ss
from benchmarks.actor_rcs import FREQUENCY, SETTINGS
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.units import power_to_db
from scarl_sionna.radar.rcs import actor_parts, load_body, scattering_matrix
from scarl_sionna.scenario.motion.tilt import GRAVITY, Springs
from scarl_sionna.scene.motion.trajectory import StaticTrajectory

CASES = {"pitch": (3.0, Springs().pitch, (0.0, 180.0)), "roll": (2.0, Springs().roll, (90.0, 270.0))}
"""Acceleration [m/s^2], gradient [deg/g], and azimuths of who sees it most [deg]."""
JERK = 2.0
"""Usual change of the acceleration [m/s^3]."""


def echoes(body: object, azimuth: np.ndarray, elevation_deg: float) -> np.ndarray:
    """Return the RCS at azimuths [rad], VV and HH together [m2]."""
    s = scattering_matrix(body, FREQUENCY, np.radians(90.6) + np.radians(elevation_deg), azimuth, settings=SETTINGS)
    return 4.0 * np.pi * np.abs(np.stack([s[:, 0, 0], s[:, 1, 1]])) ** 2


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", default="saloon")
    parser.add_argument("--detail", default="light")
    arguments = parser.parse_args()
    model = ss.read_actor_model(arguments.model)
    actor = ss.StagedActor("it", model, StaticTrajectory(Pose()), detail=arguments.detail)
    body = load_body(actor_parts(ss.stage("highway_guardrail", [actor]), "it"))
    for what, (acceleration, gradient, centres) in CASES.items():
        tilt = acceleration / GRAVITY * gradient
        azimuth = np.radians(np.concatenate([centre + np.arange(-6.0, 6.1, 2.0) for centre in centres]))
        level, tilted = (power_to_db(echoes(body, azimuth, angle)) for angle in (0.0, tilt))
        beside = power_to_db(echoes(body, azimuth + np.radians(0.05), 0.0))
        means = [power_to_db(np.mean(10 ** (values / 10))) for values in (level, tilted, beside)]
        lever = 0.5 * (model.length if what == "pitch" else model.width)
        rate = np.radians(JERK / GRAVITY * gradient)
        aspect = [float(np.median(np.abs(other - level))) for other in (tilted, beside)]
        edge, roof = (100.0 * arm * np.radians(tilt) for arm in (lever, model.height))
        print(f"{what} {tilt:.2f} deg: mean {means[0]:.2f} dBsm, tilted {means[1] - means[0]:+.2f} dB, ", end="")
        print(f"turned by 0.05 deg {means[2] - means[0]:+.2f} dB; ", end="")
        print(f"one aspect by {aspect[0]:.1f} and {aspect[1]:.1f} dB; ", end="")
        print(f"box edge {edge:.1f} cm, roof {roof:.1f} cm, {100.0 * model.height * rate:.1f} cm/s")


if __name__ == "__main__":
    main()
