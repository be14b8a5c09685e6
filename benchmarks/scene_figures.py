"""Pictures of the scenes for docs/scenes.md, from the ego's roof and from above.

python benchmarks/scene_figures.py [--figures docs/figures] [--only scene_urban_crossing_day]
python benchmarks/scene_figures.py --sheet docs/figures/scenes_sheet.webp
                                       nine places by day, at night, in rain and in winter; tiles that lie there stay
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.photo import save_photo
from camera_lidar import Camera
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.engine.load import load_scene

STREET = Pose.from_euler([0.3, 0.0, 1.62], pitch=np.radians(2.0))
"""A camera on the ego's roof."""
ABOVE = Pose.from_euler([-12.0, -2.0, 13.0], yaw=np.radians(5.0), pitch=np.radians(27.0))
"""A camera above and behind the ego; between the houses of a street."""


def mount(x: float, y: float, z: float, yaw_deg: float, pitch_deg: float) -> Pose:
    """Return the pose of a camera relative to the ego [m, deg]; a positive pitch looks down."""
    return Pose.from_euler([x, y, z], yaw=np.radians(yaw_deg), pitch=np.radians(pitch_deg))


PICTURES: dict[str, tuple[str, str, float, Pose]] = {
    "scene_urban_crossing_day": ("urban_crossing", "day", 1.5, STREET),
    "scene_urban_crossing_night": ("urban_crossing", "night", 1.5, STREET),
    "scene_urban_crossing_above": ("urban_crossing", "day", 1.5, ABOVE),
    "scene_highway_guardrail_above": ("highway_guardrail", "day", 0.9, ABOVE),
    "scene_tunnel_street": ("tunnel", "day", 1.5, STREET),
    "scene_tunnel_above": ("tunnel", "day", 1.5, mount(-13.0, 1.6, 4.6, -1.0, 9.0)),
    "scene_parking_garage_street": ("parking_garage", "day", 2.5, STREET),
    "scene_parking_garage_above": ("parking_garage", "day", 5.0, mount(-4.6, 3.0, 2.15, -14.0, 9.0)),
    "scene_signalised_crossing_street": ("signalised_crossing", "day", 1.5, STREET),
    "scene_signalised_crossing_above": ("signalised_crossing", "day", 3.0, mount(-15.0, -2.0, 14.0, 5.0, 26.0)),
    "scene_motorway_street": ("motorway", "day", 2.0, STREET),
    "scene_motorway_above": ("motorway", "day", 1.0, mount(-20.0, 4.0, 13.0, -3.0, 17.0)),
    "scene_roundabout_street": ("roundabout", "day", 1.0, STREET),
    "scene_roundabout_above": ("roundabout", "day", 2.0, mount(-16.0, -24.0, 21.0, 34.0, 26.0)),
    "scene_suburban_street_street": ("suburban_street", "day", 1.0, STREET),
    "scene_suburban_street_above": ("suburban_street", "day", 2.6, mount(-12.0, -7.0, 17.0, 16.0, 27.0)),
    "scene_country_road_street": ("country_road", "day", 1.0, STREET),
    "scene_country_road_above": ("country_road", "day", 1.5, mount(-16.0, -14.0, 20.0, 18.0, 22.0)),
}
"""Name -> scene, lighting, time [s], camera relative to the ego."""


def picture(scene: str, lighting: str, time: float, camera: Pose) -> Image.Image:
    """Return a denoised image of 640 x 360."""
    world = load_scene(scene).with_lighting(lighting)
    state = world.at(time)
    samples = 36 if lighting == "night" or world.document.info.get("enclosed") else 16
    spec = CameraSpec(
        width=640,
        height=360,
        horizontal_fov_deg=75.0 if camera is STREET else 66.0,
        images=("rgb",),
        samples_per_pixel=samples,
        denoise=True,
    )
    frame = Camera(spec).observe(state, state.actor_pose("ego").compose(camera), np.random.default_rng(0))
    return Image.fromarray(frame.rgb)


def gallery(figures: Path) -> Path:
    """Write the street views of eight scenes as one picture."""
    names = (
        "signalised_crossing",
        "roundabout",
        "parking_garage",
        "tunnel",
        "motorway",
        "suburban_street",
        "country_road",
        "urban_crossing",
    )
    width, columns, gap = 420, 4, 6
    views = [
        Image.open(figures / f"scene_{n}_{'day' if n == 'urban_crossing' else 'street'}.webp").convert("RGB")
        for n in names
    ]
    tiles = [view.resize((width, round(width * 9 / 16)), Image.Resampling.LANCZOS) for view in views]
    rows = -(-len(tiles) // columns)
    height = tiles[0].height
    sheet = Image.new("RGB", (columns * (width + gap) - gap, rows * (height + gap) - gap), (255, 255, 255))
    for number, tile in enumerate(tiles):
        sheet.paste(tile, (number % columns * (width + gap), number // columns * (height + gap)))
    path = figures / "scenes_gallery.webp"
    save_photo(sheet, path)
    return path


LOOKS = {"day": ("day", "clear"), "night": ("night", "clear"), "rain": ("day", "rain"), "winter": ("day", "winter")}
"""Columns of the sheet: lighting and weather."""
VIEW = (480, 270)
"""Size of a view of the sheet, to be looked at."""
TILE = (240, 135)
"""Its size on the sheet."""
SHEET_QUALITY = 70
"""Of WebP."""


def view(place: str, look: str) -> Image.Image:
    """Return a picture of a place from its ego's roof."""
    lighting, weather = LOOKS[look]
    world = load_scene(place).with_lighting(lighting).with_weather(weather)
    time = next(time for scene, _, time, _ in PICTURES.values() if scene == place)
    state = world.at(time)
    spec = CameraSpec(width=VIEW[0], height=VIEW[1], horizontal_fov_deg=75.0, images=("rgb",))
    frame = Camera(spec).observe(state, state.mount("ego", STREET), np.random.default_rng(0))
    return Image.fromarray(frame.rgb)


def sheet(path: Path, views: Path, gap: int = 4) -> None:
    """Write a sheet to look through: a row for each place, a column for each look.

    Views that lie in the folder `views` are taken from there.
    """
    places = list(dict.fromkeys(scene for scene, *_ in PICTURES.values()))
    width, height = (len(LOOKS) * (TILE[0] + gap) - gap, len(places) * (TILE[1] + gap) - gap)
    whole = Image.new("RGB", (width, height), (255, 255, 255))
    views.mkdir(parents=True, exist_ok=True)
    for row, place in enumerate(places):
        for column, look in enumerate(LOOKS):
            kept = views / f"{place}_{look}.png"
            if not kept.exists():
                view(place, look).save(kept)
            tile = Image.open(kept).resize(TILE, Image.Resampling.LANCZOS)
            whole.paste(tile, (column * (TILE[0] + gap), row * (TILE[1] + gap)))
    save_photo(whole, path, SHEET_QUALITY)
    print(f"{path}: {path.stat().st_size // 1000} kB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sheet", type=Path, help="write the sheet of all places to this file, and nothing else")
    parser.add_argument("--views", type=Path, default=Path("scene_views"), help="folder of the sheet's full views")
    parser.add_argument("--figures", type=Path, default=Path("docs/figures"))
    parser.add_argument("--only", nargs="*", choices=PICTURES, default=list(PICTURES))
    arguments = parser.parse_args()
    if arguments.sheet is not None:
        sheet(arguments.sheet, arguments.views)
        return
    for name in arguments.only:
        save_photo(picture(*PICTURES[name]), arguments.figures / f"{name}.webp")
        print(f"{name}: {(arguments.figures / f'{name}.webp').stat().st_size // 1000} kB")
    print(gallery(arguments.figures))


if __name__ == "__main__":
    main()
