"""Pictures of the actor models for docs/actors.md.

Contact sheets of all models, detailed and light, and of their colours.

python benchmarks/actor_figures.py [--figures docs/figures] [--sheets vehicles people ages companions running colours]
python benchmarks/actor_figures.py --only saloon bus [--views front rear] [--width 560] [--samples 12]

With --only, one sheet of those models is written (actors_chosen.webp), for a look while a model is made.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import scarl_sionna as ss
from benchmarks.photo import save_photo
from camera_lidar import Camera
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.scenario.motion.bodies import ActorBody, usual_pace
from scarl_sionna.scene.actors.model import actor_names, person_ages
from scarl_sionna.scene.motion.trajectory import ConstantTwistTrajectory, StaticTrajectory
from scenes_xml.actors.bodies import family
from scenes_xml.actors.bodies.companions import MODELS as COMPANIONS

VEHICLES = (
    "small_car", "saloon", "estate", "suv", "pickup", "van", "box_van", "lorry", "articulated_lorry", "bus", "coach",
    "tram",
)  # fmt: skip # a table
COLORFUL = ("saloon", "van", "lorry", "bus")
VIEWS = {
    "front": (33.0, 11.0),
    "rear": (147.0, 14.0),
    "right": (-33.0, 11.0),
    "side": (90.0, 8.0),
    "above": (30.0, 45.0),
}
"""Name -> azimuth from the model's +x to its left and elevation of the eye [deg]."""
FOV_DEG = 24.0
SPEEDS = {"vehicle": 1e-3, "cycle": 4.0, "walk": 1.4, "stand": 0.0}
"""By the kind of motion [m/s]; people sit in cars that move."""
TIME = 0.35
STUDIO = """<scene version="3.0.0"><bsdf type="twosided" id="asphalt"><bsdf type="principled">
<rgb name="base_color" value="0.24 0.24 0.245"/><float name="roughness" value="0.9"/></bsdf></bsdf>
<shape type="cube" id="ground"><transform name="to_world"><scale x="300" y="300" z="0.5"/>
<translate z="-0.5"/></transform>
<ref id="asphalt" name="bsdf"/></shape></scene>"""


class Studio:
    """An empty plain under the day's sky, in which one model after another is photographed."""

    def __init__(self, folder: Path) -> None:
        (folder / "studio.xml").write_text(STUDIO, encoding="utf-8")
        self.world = ss.load_scene(folder / "studio.xml").with_lighting(Lighting.preset("day").with_(exposure=0.62))

    def picture(
        self,
        name: str,
        level: str,
        view: str,
        size: tuple[int, int],
        samples: int,
        variant: str | None = None,
        tall: bool = False,
        running: tuple[float, float] | None = None,
    ) -> Image.Image:
        """Return a denoised picture of a model.

        `tall`: all at one scale, that of an adult; `running`: speed [m/s] and time in the gait [cycles].
        """
        model = ss.read_actor_model(name)
        speed = SPEEDS[model.motion] * usual_pace(ActorBody.of(model)) if running is None else running[0]
        turned = Pose.from_euler(
            [0.0, 0.0, 0.0], yaw=np.radians(125.0)
        )  # the sun stands behind the camera's right shoulder
        path = (
            StaticTrajectory(turned)
            if speed == 0.0
            else ConstantTwistTrajectory(turned, Twist(turned.rotate([speed, 0.0, 0.0])))
        )
        world = ss.stage(self.world, [ss.StagedActor("it", model, path, detail=level, variant=variant)])
        when = TIME
        if running is not None:
            when = running[1] / next(one for one in world.actor("it").joints if hasattr(one, "gait")).gait.cadence(
                speed
            )
        state = world.at(when)
        half = 0.5 * (np.array([1.0, 0.6, 1.92]) if tall else np.array([model.length, model.width, model.height]))
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
        azimuth, elevation = np.radians(VIEWS[view])
        eye = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
        right = np.array([-eye[1], eye[0], 0.0]) / np.hypot(eye[0], eye[1])
        tangent = np.tan(np.radians(FOV_DEG / 2))
        reach = np.maximum(np.abs(corners @ right), np.abs(corners @ np.cross(eye, right)) * size[0] / size[1])
        distance = 1.06 * float((corners @ eye + reach / tangent).max())
        mount = Pose.from_euler(eye * distance + [0.0, 0.0, half[2]], yaw=azimuth + np.pi, pitch=elevation)
        spec = CameraSpec(
            width=size[0],
            height=size[1],
            horizontal_fov_deg=FOV_DEG,
            images=("rgb",),
            samples_per_pixel=samples,
            denoise=True,
        )
        frame = Camera(spec).observe(state, state.actor_pose("it").compose(mount), np.random.default_rng(0))
        return Image.fromarray(frame.rgb)


def sheet(tiles: list[tuple[str, Image.Image]], columns: int) -> Image.Image:
    """Return tiles with their captions, row by row."""
    width, height = tiles[0][1].size
    rows = -(-len(tiles) // columns)
    image = Image.new("RGB", (columns * (width + 4) - 4, rows * (height + 4) - 4), "white")
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(size=13)
    for number, (caption, tile) in enumerate(tiles):
        at = ((number % columns) * (width + 4), (number // columns) * (height + 4))
        image.paste(tile, at)
        draw.text((at[0] + 8, at[1] + 6), caption, fill="white", font=font, stroke_width=2, stroke_fill=(40, 40, 40))
    return image


def _sheets(studio: Studio, wanted: list[str], folder: Path, samples: int) -> None:
    if "vehicles" in wanted:
        size = (360, 202)
        tiles = [
            (f"{name}, {level}", studio.picture(name, level, "front", size, samples))
            for level in ("detailed", "light")
            for name in VEHICLES
        ]
        save_photo(sheet(tiles, 3), folder / "actors_vehicles.webp")
        tiles = [
            (name, studio.picture(name, "detailed", "right" if name == "bus" else "rear", size, samples))
            for name in VEHICLES
        ]
        save_photo(sheet(tiles, 3), folder / "actors_rear.webp")
    if "people" in wanted:
        size = (230, 300)
        names = [name for name in actor_names() if name not in VEHICLES and name not in family.names()]
        tiles = [
            (f"{name}{', light' if level == 'light' else ''}", studio.picture(name, level, "front", size, samples))
            for level in ("detailed", "light")
            for name in names
        ]
        save_photo(sheet(tiles, len(names)), folder / "actors_people.webp")
    if "ages" in wanted:
        tiles = [
            (name, studio.picture(name, "detailed", "front", (118, 208), samples, tall=True)) for name in person_ages()
        ]
        save_photo(sheet(tiles, 11), folder / "actors_ages.webp")
    if "companions" in wanted:
        tiles = [(name, studio.picture(name, "detailed", "front", (240, 250), samples)) for name in COMPANIONS]
        save_photo(sheet(tiles, len(tiles)), folder / "actors_companions.webp")
    if "running" in wanted:
        tiles = [
            (
                name if time == 0.0 else "",
                studio.picture(name, "detailed", "side", (96, 150), samples, None, True, (v, time)),
            )
            for name, v in (("man_27", 3.0), ("woman_19", 5.0), ("boy_8", 2.5))
            for time in np.arange(7) / 12.0
        ]
        save_photo(sheet(tiles, 7), folder / "actors_running.webp")
    if "colours" in wanted:
        tiles = []
        for name in COLORFUL:
            for variant in list(ss.read_actor_model(name).variants)[:5]:
                tiles.append(
                    (f"{name}: {variant}", studio.picture(name, "detailed", "front", (256, 144), samples, variant))
                )
        save_photo(sheet(tiles, 5), folder / "actors_colours.webp")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--figures", type=Path, default=Path("docs/figures"))
    parser.add_argument(
        "--sheets", nargs="*", default=["vehicles", "people", "ages", "companions", "running", "colours"]
    )
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--views", nargs="*", default=["front", "rear"], choices=VIEWS)
    parser.add_argument("--levels", nargs="*", default=["detailed", "light"])
    parser.add_argument("--width", type=int, default=560)
    parser.add_argument("--samples", type=int, default=24)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        studio = Studio(Path(folder))
        if not arguments.only:
            _sheets(studio, arguments.sheets, arguments.figures, arguments.samples)
            return
        size = (arguments.width, arguments.width * 9 // 16)
        tiles = [
            (f"{name}, {level}", studio.picture(name, level, view, size, arguments.samples))
            for name in arguments.only
            for level in arguments.levels
            for view in arguments.views
        ]
        save_photo(sheet(tiles, len(arguments.views)), arguments.figures / "actors_chosen.webp")


if __name__ == "__main__":
    main()
