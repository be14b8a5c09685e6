"""Pictures of the scenes for docs/scenes.md, from the ego's roof and from above.

python benchmarks/scene_figures.py [--figures docs/figures] [--only scene_urban_crossing_day]
"""

from __future__ import annotations

import argparse
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

from camera_lidar import Camera
from scarl_sionna.core.camera_spec import CameraSpec
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.world import load_scene

LARGEST_FILE = 300_000
PICTURES = {
    "scene_urban_crossing_day": ("urban_crossing", "day", 1.5, False),
    "scene_urban_crossing_night": ("urban_crossing", "night", 1.5, False),
    "scene_urban_crossing_above": ("urban_crossing", "day", 1.5, True),
    "scene_highway_guardrail_above": ("highway_guardrail", "day", 0.9, True),
}
"""Name -> scene, lighting, time [s], from above."""
ABOVE = Pose.from_euler([-12.0, -2.0, 13.0], yaw=np.radians(5.0), pitch=np.radians(27.0))
"""A camera above and behind the ego, relative to it; between the houses of the crossing."""


def picture(scene: str, lighting: str, time: float, above: bool) -> Image.Image:
    """Return a denoised image of 640 x 360."""
    state = load_scene(scene).with_lighting(lighting).at(time)
    ego = state.actor_pose("ego")
    mount = ABOVE if above else Pose.from_euler([0.3, 0.0, 1.62], pitch=np.radians(2.0))
    samples = 36 if lighting == "night" else 16
    spec = CameraSpec(
        width=640, height=360, horizontal_fov_deg=66.0 if above else 75.0, images=("rgb",),
        samples_per_pixel=samples, denoise=True,
    )  # fmt: skip
    frame = Camera(spec).observe(state, ego.compose(mount), Twist(), np.random.default_rng(0))
    return Image.fromarray(frame.rgb)


def save(image: Image.Image, path: Path) -> None:
    """Write a PNG below `LARGEST_FILE`: fewer colours where it is larger."""
    buffer = BytesIO()
    image.save(buffer, "PNG", optimize=True)
    if buffer.tell() > LARGEST_FILE:
        buffer = BytesIO()
        image.quantize(256, dither=Image.Dither.FLOYDSTEINBERG).save(buffer, "PNG", optimize=True)
    if buffer.tell() > LARGEST_FILE:
        raise SystemExit(f"{path.name} has {buffer.tell()} bytes")
    path.write_bytes(buffer.getvalue())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--figures", type=Path, default=Path("docs/figures"))
    parser.add_argument("--only", nargs="*", choices=PICTURES, default=list(PICTURES))
    arguments = parser.parse_args()
    for name in arguments.only:
        save(picture(*PICTURES[name]), arguments.figures / f"{name}.png")
        print(f"{name}: {(arguments.figures / f'{name}.png').stat().st_size // 1000} kB")


if __name__ == "__main__":
    main()
