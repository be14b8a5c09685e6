"""Pictures of the actor models for docs/actors.md: contact sheets of all models, detailed and light, and of their colours.

python benchmarks/actor_figures.py [--figures docs/figures] [--only saloon bus] [--views front rear] [--width 420] [--samples 48]

With --only, one sheet of those models is written (actors_chosen.png), for a look while a model is made.
"""

from __future__ import annotations

import argparse
import sys
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from camera_lidar.camera import denoise
from scarl_sionna.world import variant

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ACTORS = Path(__file__).resolve().parents[1] / "scenes_xml" / "actors"
VEHICLES = ("small_car", "saloon", "suv", "van", "lorry", "bus")
LARGEST_FILE = 300_000
VIEWS = {
    "front": (33.0, 11.0),
    "rear": (147.0, 14.0),
    "right": (-33.0, 11.0), "side": (90.0, 6.0),
    "below": (40.0, -25.0),
    "above": (30.0, 45.0),
}
"""Name -> azimuth from the model's +x to its left and elevation of the eye [deg]."""
FOV_DEG = 22.0
SKY = (
    '<emitter type="sunsky"><vector name="sun_direction" x="0.35" y="0.72" z="0.60"/><float name="turbidity" value="4"/>'
    '<float name="sun_scale" value="1.6"/><float name="sky_scale" value="2.4"/></emitter>'
)
GROUND = (
    '<shape type="rectangle"><transform name="to_world"><scale value="400"/></transform><bsdf type="principled">'
    '<rgb name="base_color" value="0.26 0.26 0.265"/><float name="roughness" value="0.9"/></bsdf></shape>'
)


def picture(
    name: str, level: str, view: str, size: tuple[int, int], samples: int, colors: dict[str, Any] | None = None
) -> Image.Image:
    """Return a denoised picture of a model."""
    folder = ACTORS / name
    actor = tomllib.loads((folder / "actor.toml").read_text(encoding="utf-8"))["actor"]
    file = folder / f"{name}{'' if level == 'detailed' else '_light'}.xml"
    body = file.read_text(encoding="utf-8").split('<scene version="3.0.0">')[1].rsplit("</scene>", 1)[0]
    body = body.replace('value="meshes/', f'value="{folder}/meshes/')
    azimuth, elevation = np.radians(VIEWS[view])
    middle = np.array([0.0, 0.0, 0.5 * actor["height"]])
    eye = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    right = np.array([-eye[1], eye[0], 0.0]) / np.hypot(*eye[:2])
    up = np.cross(eye, right)
    half = 0.5 * np.array([actor["length"], actor["width"], actor["height"]])
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    tangent = np.tan(np.radians(FOV_DEG / 2))
    aspect = size[0] / size[1]
    distance = max(
        (corners @ eye + np.abs(corners @ right) / tangent).max(),
        (corners @ eye + np.abs(corners @ up) * aspect / tangent).max(),
    )
    origin = middle + eye * distance * 1.08
    sensor = (
        f'<sensor type="perspective"><float name="fov" value="{FOV_DEG}"/><string name="fov_axis" value="x"/>'
        f'<transform name="to_world"><lookat origin="{_text(origin)}" target="{_text(middle)}" up="0, 0, 1"/></transform>'
        f'<film type="hdrfilm"><integer name="width" value="{size[0]}"/><integer name="height" value="{size[1]}"/>'
        '<rfilter type="box"/></film></sensor>'
    )
    ground = "" if view == "below" else GROUND
    integrator = '<integrator type="aov"><string name="aovs" value="albedo:albedo,normal:sh_normal"/><integrator type="path"><integer name="max_depth" value="6"/></integrator></integrator>'
    with variant.optical() as mi:
        scene = mi.load_string(f'<scene version="3.0.0">{integrator}{sensor}{SKY}{ground}{body}</scene>')
        if colors:
            _paint(mi, scene, colors)
        image = np.array(mi.render(scene, spp=samples, seed=0))
    radiance = np.ascontiguousarray(image[..., :3], dtype=np.float32)
    guides = np.ascontiguousarray(image[..., -6:], dtype=np.float32)
    return Image.fromarray(_tone(denoise(radiance, guides)))


def _paint(mi: Any, scene: Any, colors: dict[str, Any]) -> None:
    params = mi.traverse(scene)
    for bsdf, rgb in colors.items():
        key = next((k for k in params.keys() if k.startswith(f"{bsdf}.") and k.endswith("base_color.value")), None)  # noqa: SIM118
        if key is not None:
            params[key] = mi.Color3f(*rgb)
    params.update()


def _tone(linear: np.ndarray) -> np.ndarray:
    """Return 8-bit sRGB, exposed so that a white diffuse wall in the sun is just white."""
    x = np.clip(linear * 1.35, 0.0, None)
    x = x * (1.0 + x / 2.2) / (1.0 + x)
    srgb = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.clip(x, 1e-9, None) ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(255.0 * np.clip(srgb, 0.0, 1.0)), dtype=np.uint8)


def _text(values: np.ndarray) -> str:
    return ", ".join(f"{float(v):.6f}" for v in values)


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


def save(image: Image.Image, path: Path) -> None:
    """Write a PNG below `LARGEST_FILE`: fewer colours where it is larger."""
    for colors in (None, 256, 128, 64):
        buffer = BytesIO()
        (image if colors is None else image.quantize(colors, dither=Image.Dither.NONE)).save(
            buffer, "PNG", optimize=True
        )
        if buffer.tell() <= LARGEST_FILE:
            path.write_bytes(buffer.getvalue())
            print(f"{path}: {buffer.tell() // 1000} kB")
            return
    raise SystemExit(f"{path.name} has {buffer.tell()} bytes")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--figures", type=Path, default=Path("docs/figures"))
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--views", nargs="*", default=["front"], choices=VIEWS)
    parser.add_argument("--levels", nargs="*", default=["detailed", "light"])
    parser.add_argument("--width", type=int, default=320)
    parser.add_argument("--samples", type=int, default=48)
    arguments = parser.parse_args()
    size = (arguments.width, arguments.width * 9 // 16)
    if arguments.only:
        tiles = [
            (f"{name}, {level}", picture(name, level, view, size, arguments.samples))
            for name in arguments.only for level in arguments.levels for view in arguments.views
        ]  # fmt: skip
        save(
            sheet(tiles, len(arguments.views) * (2 if len(arguments.views) < 2 else 1)),
            arguments.figures / "actors_chosen.png",
        )
        return


if __name__ == "__main__":
    main()
