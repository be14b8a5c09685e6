"""Pictures of `highway_guardrail` at day, dusk, night and in rain, from a roof camera and a bird's view.

    python benchmarks/camera_figures.py [--figures docs/figures] [--only camera_dusk camera_rain]

Each is 960 x 540 and denoised.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.photo import save_photo
from camera_lidar import Camera
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.camera import CameraSpec, ImageSensor
from scarl_sionna.engine.load import load_scene

TIME = 0.9
NIGHT_SENSOR = ImageSensor(veiling_glare=0.06, full_well=20_000, saturation=4.0, read_noise=1.5)
"""Light scattered in the optics shows what a picture cannot: how bright lamps are."""

View = Callable[[Any], tuple[Pose, Twist]]


def roof(state: Any) -> tuple[Pose, Twist]:
    """Return pose and velocity of a camera above the ego's windscreen."""
    ego, motion = state.actor_pose("ego"), state.actor_twist("ego")
    pose = ego.compose(Pose.from_euler([0.3, 0.0, 1.62], pitch=np.radians(3.0)))
    return pose, Twist(motion.velocity_at(pose.position - ego.position), motion.angular)


def bird(state: Any) -> tuple[Pose, Twist]:
    """Return a standing camera beside the road, 12 m high."""
    return Pose.from_euler([-13.0, -13.0, 12.0], yaw=np.radians(30.0), pitch=np.radians(23.0)), Twist()


PICTURES: dict[str, tuple[str, View, float, int, ImageSensor | None]] = {
    "camera_day": ("day", roof, 70.0, 25, None),
    "camera_dusk": ("dusk", roof, 70.0, 25, None),
    "camera_night": ("night", roof, 70.0, 49, NIGHT_SENSOR),
    "camera_rain": ("rain", roof, 70.0, 25, None),
    "camera_bird_day": ("day", bird, 62.0, 25, None),
    "camera_bird_dusk": ("dusk", bird, 62.0, 25, None),
    "camera_bird_night": ("night", bird, 62.0, 49, None),
}
"""Name -> lighting, view, field of view [deg], samples, image sensor."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--figures", type=Path, default=Path("docs/figures"))
    parser.add_argument("--only", nargs="*", default=list(PICTURES), choices=list(PICTURES))
    options = parser.parse_args()
    world = load_scene("highway_guardrail")
    options.figures.mkdir(parents=True, exist_ok=True)
    for name in options.only:
        lighting, view, field, samples, sensor = PICTURES[name]
        state = world.with_lighting(lighting).at(TIME)
        spec = CameraSpec(images=("rgb",), horizontal_fov_deg=field, samples_per_pixel=samples, sensor=sensor)
        frame = Camera(spec).observe(state, *view(state), np.random.default_rng(1))
        assert frame.rgb is not None
        save_photo(Image.fromarray(frame.rgb), options.figures / f"{name}.webp")
        print(name, flush=True)


if __name__ == "__main__":
    main()
