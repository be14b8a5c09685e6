"""Build the scene: ``python -m scenes_xml.signalised_crossing.build`` writes the XML, scene.toml and packed files.

Those of variant 0.

Everything follows from the numbers in this package and the variant's number; a second run gives the same bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..generators.geometry.mesh import Array
from ..generators.kit import SceneKit
from ..generators.surfaces import interior, urban
from ..packing import write_packed
from . import layout as at
from . import static, years
from .lanes import lanes, walkways

NAME = "signalised_crossing"
DESCRIPTION = (
    "A crossing with traffic lights in a street canyon: four lanes meet two between tall houses, "
    "zebra crossings, masts and cantilevers, a "
    "bus at its stop, traffic in both directions, cars that wait at red, a cyclist and people on foot."
)


def build(folder: Path, variant: int = 0, detail: str = "detailed") -> None:
    """Write a variant of the scene into `folder`, ``detailed`` or ``light``."""
    plan = at.layout(variant)
    table = {
        "name": NAME,
        "title": "Crossing with traffic lights",
        "description": DESCRIPTION,
        "license": "Apache-2.0",
        "source": f"built by scenes_xml/{NAME}/build.py",
        "seed": at.SEED,
        "ego": "ego",
        "variant": variant,
        "detail": detail,
    }
    kit = SceneKit(folder, table, detail, at.SEED + variant)
    kit.materials |= interior.MATERIALS | urban.MATERIALS
    kit.textures |= interior.IMAGES | urban.IMAGES
    ground = static.add_ground(kit, plan)
    static.add_markings(kit, plan)
    static.add_houses(kit, plan)
    static.add_signals(kit, plan)
    static.add_furniture(kit, plan)
    if variant:
        years.add_years(kit, plan)
    kit.lanes += lanes(plan) + walkways(ground)
    kit.signals |= {"cycle": at.CYCLE, "green": at.GREEN}
    _traffic(kit, plan)
    kit.write()


def _along(x: float, y: float, speed: float) -> Array:
    return np.column_stack([x + speed * at.TIMES, np.full(len(at.TIMES), y), np.zeros(len(at.TIMES))])


def _kerb(distance: Array) -> Array:
    """Return the height of a foot on its way over a dropped kerb, at its distance behind the kerb's edge [m].

    A low step, then a ramp.
    """
    low = 0.15 * at.KERB
    u = np.clip(distance / 0.4 + 0.5, 0.0, 1.0)
    slope = np.clip((distance - 0.15) / (0.5 * (0.15 + at.RAMP) - 0.15), 0.0, 1.0)
    return low * u * u * (3.0 - 2.0 * u) + (at.KERB - low) * slope


def _traffic(kit: SceneKit, plan: at.Layout) -> None:
    t, inner, outer = at.TIMES, 0.5 * at.LANE, 1.5 * at.LANE
    still = t[[0, -1]]

    def stands(
        name: str,
        model: str,
        x: float,
        y: float,
        yaw: float,
        variant: str | None = None,
        z: float = 0.0,
        detail: str | None = None,
    ) -> None:
        kit.actor(name, model, still, np.tile([(x, y, z)], (2, 1)), variant, np.full(2, yaw), detail)

    kit.actor("ego", "saloon", t, _along(-40.0, -inner, plan.speed))
    kit.actor("car_ahead", "suv", t, _along(-22.0 + 0.5 * plan.shift, -inner, 9.5), "red")
    kit.actor("oncoming_van", "van", t, _along(48.0 + plan.shift, inner, -8.5))
    kit.actor("motorcycle", "motorcycle", t, _along(58.0 + plan.shift, outer, -10.0))
    kit.actor("cyclist", "bicycle", t, _along(-27.0, -at.MAIN + 0.9, 4.6))
    stands("bus", "bus", plan.stop_x + 1.0, -outer - 0.2, 0.0)
    stands("waiting_south", "small_car", 0.5 * at.LANE, -plan.stop[1] - 2.4, 90.0, detail="light")
    stands("waiting_north", "saloon", -0.5 * at.LANE, plan.stop[1] + 2.8, -90.0, "white", detail="light")
    for name, model, start, y, speed in (
        ("woman", "adult_woman", -6.0, -14.9, 1.25),
        ("child", "child", -6.4, -14.3, 1.25),
        ("man", "adult_man", 5.6, 14.6, -1.35),
    ):
        fine = np.linspace(t[0], t[-1], 10 * (len(t) - 1) + 1)  # the ground slopes below their feet
        x = start + speed * fine
        kit.actor(name, model, fine, np.column_stack([x, np.full(len(fine), y), _kerb(np.abs(x) - at.SIDE)]))
    stands("standing", "standing_adult", plan.stop_x + 2.7, -at.MAIN - 1.5, 90.0, z=at.KERB)


if __name__ == "__main__":
    write_packed(Path(__file__).resolve().parent, build)
