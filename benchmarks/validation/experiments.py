"""Experiments behind the causes of rows outside: one thing changed at a time.

python benchmarks/validation/experiments.py people | bicycle | car | bumpers | crowns     2, 1, 5, 5 and 1 minutes
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import scarl_sionna as ss
from benchmarks.measured_rcs import FAR_SETTINGS, alone, azimuths
from benchmarks.validation.people import by_sector, mean_db, powers, run_of
from benchmarks.validation.vehicles import SECTORS, in_sector, lobe
from scarl_sionna.core.pose import Pose
from scarl_sionna.radar.rcs import actor_parts, load_body, scattering_matrix
from scarl_sionna.scene.motion.trajectory import StaticTrajectory
from tests.scenes import Material, Thing, plane, write_scene

MOST_SHEETS = 60
"""Of crowns, that a ray is followed through."""
STANDS = StaticTrajectory(Pose())


def people(folder: Path) -> None:
    """Print a standing adult with fewer bounces, and what makes the cross-polar echo of a man."""
    world = alone("standing_adult", "detailed", STANDS, folder / "adult")
    for knobs in ({}, {"max_depth": 1}):
        found = powers(world, 0.0, azimuths(36), **knobs)
        print("standing_adult", knobs, round(10.0 * np.log10(found[:, 0].mean()), 2), "dBsm")
    world = alone("adult_man", "light", STANDS, folder / "man")
    for knobs in ({}, {"diffuse": False}, {"diffuse": False, "max_depth": 1}):
        found = powers(world, 0.0, azimuths(12), **knobs).mean(axis=0)
        print("HV over VV", knobs, round(10.0 * np.log10(found[1] / found[0]), 2), "dB")


def bicycle(folder: Path) -> None:
    """Print a bicycle near broadside, finely and from three distances."""
    world = alone("bicycle", "light", STANDS, folder)
    kept = run_of("bicycle", "light")
    aspect, level = np.asarray(kept["azimuth_deg"]), np.asarray(kept["rcs_dbsm"])
    folded = np.minimum(np.abs(aspect - 90.0), np.abs(aspect - 270.0))
    steps = np.arange(-5.75, 6.0, 0.5)
    found = 10.0 * np.log10(powers(world, 0.0, np.radians(np.r_[90.0 + steps, 270.0 + steps]), 10.0)[:, 0])
    print(
        "within 6 deg of both broadsides, every half degree:", mean_db(found), "largest", round(found.max(), 1), "dBsm"
    )
    flash, wings = 10.0 ** (mean_db(found) / 10.0), np.mean(10.0 ** (level[(folded > 6.0) & (folded <= 30.0)] / 10.0))
    side = 10.0 * np.log10(0.2 * flash + 0.8 * wings)
    print("side over oblique:", round(side - by_sector(aspect, level)["oblique"], 2), "dB")
    for distance in (10.0, 30.0, 100.0):
        found = 10.0 * np.log10(powers(world, 0.0, np.radians(np.arange(88.5, 91.6, 0.25)), distance)[:, 0])
        print(f"within 1.5 deg, {distance:g} m: largest {found.max():.1f} dBsm")


def car(folder: Path) -> None:
    """Print the saloon with fewer bounces, at other azimuths, without its plates, and from 20 m."""
    world = ss.stage("highway_guardrail", [ss.StagedActor("it", "saloon", STANDS)])
    parts, names = actor_parts(world, "it"), [name for name in world.parts.name if name.startswith("it_")]

    def far(phi: np.ndarray, depth: int = 3, without: str = "-") -> np.ndarray:
        kept = [part for part, name in zip(parts, names, strict=True) if without not in name]
        settings = FAR_SETTINGS.with_(max_depth=depth)
        s = scattering_matrix(load_body(kept), 77e9, np.radians(90.6), phi, settings=settings)
        return np.asarray(10.0 * np.log10(4.0 * np.pi * np.abs(s[:, 0, 0]) ** 2))

    def others(count: int) -> tuple[np.ndarray, np.ndarray]:
        phi = 2.0 * np.pi * (np.arange(count) + np.random.default_rng(78).uniform(size=count)) / count
        return phi, np.degrees(np.minimum(phi, 2.0 * np.pi - phi))

    def medians(aspect: np.ndarray, level: np.ndarray, names: Any) -> str:
        return ", ".join(f"{name} {np.median(in_sector(aspect, level, name)):.1f}" for name in names)

    phi = azimuths(72)
    aspect = np.degrees(np.minimum(phi, 2.0 * np.pi - phi))
    side = (aspect > 60.1) & (aspect < 119.9)
    print("side, one bounce", medians(aspect[side], far(phi[side], 1), ("side",)), "dBsm")
    other, there = others(72)
    side = (there > 60.1) & (there < 119.9)
    print("other azimuths", medians(there[side], far(other[side]), ("side",)), "dBsm")
    print("rear lobe", lobe(180.0), "without plates", lobe(180.0, "plate"), "dBsm")
    phi, aspect = others(36)
    level = 10.0 * np.log10(powers(alone("saloon", "detailed", STANDS, folder), 0.0, phi, 20.0, 0.6)[:, 0])
    level.sort()
    print("20 m, other azimuths: mean", mean_db(level), "without the three strongest", mean_db(level[:-3]), "dBsm")


def beam(front: bool) -> trimesh.Trimesh:
    """Return a crash beam of a car as a bent box, behind its bumper."""
    sign, x, low, half, bow = (1.0, 2.20, 0.42, 0.62, 0.10) if front else (-1.0, -2.21, 0.40, 0.60, 0.06)
    y = np.linspace(-half, half, 25)
    face = x - sign * bow * (y / half) ** 2
    around = ((0.0, 0.0), (0.0, 0.12), (-0.06, 0.12), (-0.06, 0.0))
    corners = np.stack([np.stack([face + sign * dx, y, np.full(25, low + dz)], axis=1) for dx, dz in around], axis=1)
    a = 4 * np.arange(24)[:, None] + np.arange(4)
    b = 4 * np.arange(24)[:, None] + (np.arange(4) + 1) % 4
    faces = np.concatenate([np.stack([a, a + 4, b], axis=-1), np.stack([b, a + 4, b + 4], axis=-1)]).reshape(-1, 3)
    return trimesh.Trimesh(corners.reshape(-1, 3), faces, process=False)


def bumpers(folder: Path) -> None:
    """Print the ends of the saloon from 20 m as it is, and with its bumpers of plastic over metal beams."""
    whole = ss.stage("highway_guardrail", [ss.StagedActor("it", "saloon", STANDS)])
    things, materials = [], {}
    for number, (mesh, material) in enumerate(actor_parts(whole, "it")):
        pieces = [(mesh, material.name)]
        if material.name == "car_paint" and np.ptp(mesh.vertices[:, 0]) > 4.0:
            middle = mesh.vertices[mesh.faces].mean(axis=1)
            bumper = (np.abs(middle[:, 0]) > 1.76) & (middle[:, 2] < 0.71)
            pieces = [
                (trimesh.Trimesh(mesh.vertices, mesh.faces[chosen], process=False), name)
                for chosen, name in ((~bumper, "car_paint"), (bumper, "plastic"))
            ]
        for piece, (part, name) in enumerate(pieces):
            materials[name] = Material(radio=name)
            things.append(Thing(f"part_{number}_{piece}", part, "Car", name))
    things += [Thing(f"beam_{front}", beam(front), "Car", "metal") for front in (True, False)]
    speck = Thing("it", plane(1e-3, 1e-3), "Car", "metal", trajectory={"kind": "static", "position": [0.0, 0.0, 0.0]})
    phi = azimuths(36)
    aspect = np.degrees(np.minimum(phi, 2.0 * np.pi - phi))
    worlds = {
        "as it is": alone("saloon", "detailed", STANDS, folder / "it"),
        "bumpers of plastic": ss.load_scene(write_scene(folder / "bumpers", things, [speck], materials)),
    }
    for label, world in worlds.items():
        level = 10.0 * np.log10(powers(world, 0.0, phi, 20.0, 0.6)[:, 0])
        print(f"{label}:", ", ".join(f"{n} {np.median(in_sector(aspect, level, n)):.1f}" for n in SECTORS), "dBsm")


def crowns(folder: Path) -> None:
    """Print what crowns of trees hide from a front radar: rays that meet one first, and what they would meet without.

    Three streets, three instants each, 8000 rays within 60 deg to each side and 5 deg below to 15 deg above.
    """
    rng, found = np.random.default_rng(0), []
    azimuth, sine = np.radians(rng.uniform(-60.0, 60.0, 8000)), np.sin(np.radians(rng.uniform(-5.0, 15.0, 8000)))
    level = np.sqrt(1.0 - sine**2)
    rays = np.column_stack([level * np.cos(azimuth), level * np.sin(azimuth), sine])
    for place in ("suburban_street", "country_road", "roundabout"):
        world = ss.load_scene(place)
        named = zip(world.parts.name, world.parts.material, strict=True)
        crown = np.array([material == "foliage" and name.endswith(("_core", "_leaves")) for name, material in named])
        for moment in np.linspace(*world.time_range, 3):
            state = world.at(float(moment))
            pose = state.actor_pose("ego")
            start, ways = pose.apply([[4.2, 0.0, 0.5]])[0], pose.rotate(rays)
            first = np.full(len(rays), -1)
            last, number, gone = first.copy(), np.zeros(len(rays)), np.zeros(len(rays))
            left = np.arange(len(rays))
            for _ in range(MOST_SHEETS):
                hits = state.cast(start + gone[left, None] * ways[left], ways[left], max_distance=150.0)
                rows, leaves = left[hits.ray], crown[hits.part]
                first[rows] = np.where(first[rows] < 0, hits.part, first[rows])
                last[rows] = np.where(leaves, last[rows], hits.part)
                number[rows] += leaves
                gone[rows] += hits.distance + 1e-3
                left = rows[leaves & (gone[rows] < 150.0)]
            users = world.parts.actor[last] >= 0
            behind = (first >= 0) & crown[np.maximum(first, 0)]
            seen = behind & (last >= 0)
            found.append(
                [behind.mean(), seen.mean(), np.mean(behind & users & (last >= 0)), np.mean(users & (last >= 0))]
            )
            found[-1].append(number[seen].mean() if seen.any() else np.nan)
        own = np.array(found[-3:])
        print(
            f"{place}: {100 * own[:, 0].mean():.1f} % of rays meet a crown first, {100 * own[:, 1].mean():.1f} % would "
            f"meet something behind it, {np.nanmean(own[:, 4]):.0f} sheets away; of rays to road users "
            f"{100 * own[:, 2].sum() / own[:, 3].sum():.2f} % are hidden by one"
        )


if __name__ == "__main__":
    chosen = {"people": people, "bicycle": bicycle, "car": car, "bumpers": bumpers, "crowns": crowns}[sys.argv[1]]
    with tempfile.TemporaryDirectory() as place:
        chosen(Path(place))
