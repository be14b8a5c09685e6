"""The problems of the work-precision charts with the car of highway_guardrail."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
import trimesh

import scarl_sionna as ss
from benchmarks.accuracy_problems import (
    NOTHING_DB,
    RADAR,
    Answer,
    Problem,
    common,
    folder,
    noise_error_db,
    over,
    scatterer_curve,
)
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.scatterers.compile import range_profile
from scenes_xml import scene_path

SPEED_OF_LIGHT = 299792458.0


def car_alone() -> tuple[Any, trimesh.Trimesh]:
    """Return the state of a world with the highway's car ahead alone as one metal mesh, and that mesh."""
    where = folder()
    parts = sorted((scene_path("highway_guardrail").parent / "meshes").glob("car_ahead_*.ply"))
    mesh = trimesh.util.concatenate([trimesh.load(path, process=False) for path in parts])
    mesh.export(where / "car.ply")
    root = ET.Element("scene", version="3.0.0")
    bsdf = ET.SubElement(root, "bsdf", type="twosided", id="steel")
    ET.SubElement(bsdf, "bsdf", type="diffuse")
    shape = ET.SubElement(root, "shape", type="ply", id="car")
    ET.SubElement(shape, "string", name="filename", value="car.ply")
    ET.SubElement(shape, "ref", id="steel", name="bsdf")
    ET.ElementTree(root).write(where / "alone.xml")
    (where / "scene.toml").write_text(
        '[scene]\nname = "alone"\n[materials.steel]\nradio = "metal"\nlidar_reflectance = 0.4\nsource = "estimate"\n'
        '[[actors]]\nname = "car"\nclass = "Car"\nshapes = ["car"]\n'
        '[actors.trajectory]\nkind = "static"\nposition = [0.0, 0.0, 0.0]\n'
    )
    return ss.load_scene(where / "alone.xml").at(0.0), mesh


def profile(paths: Any, start: float) -> np.ndarray:
    """Return the power per range cell (VV) over the radar's band."""
    if not paths.num_paths:
        return np.full(64, 1e-300)
    length = PathGeometry.of(paths, RADAR).center_length()
    frequency = RADAR.center_frequency + np.arange(-32, 32) * (RADAR.sampled_bandwidth / 64)
    phase = np.exp(-2j * np.pi * frequency[:, None] * (length - 2.0 * start)[None] / SPEED_OF_LIGHT)
    return np.maximum(range_profile(phase @ paths.a[:, 0, 0]), 1e-300)


def _car(distance: float) -> Problem:
    state, mesh = car_alone()
    pose = Pose([-distance - 2.15, 0.9, 0.6])
    fine = SbrSettings(max_phase=0.1, integration_phase=0.01, edge_share=0.125, floor_db=None, max_depth=3)
    truth = profile(solve_paths(state, RADAR, pose, method="sbr", settings=fine), distance)
    strong = truth > truth.max() * 1e-3

    def error(answer: Answer) -> float:
        found = profile(answer[0], distance)[strong]
        return float(np.median(np.minimum(np.abs(10.0 * np.log10(found / truth[strong])), NOTHING_DB)))

    curves = common(state, [pose])
    curves.insert(
        3,
        over(
            "sbr, 1 rad",
            "bounces",
            [
                (f"{d} bounces", {"settings": SbrSettings(max_phase=1.0, integration_phase=0.05, max_depth=d)})
                for d in (1, 2, 3)
            ],
            "2 bounces",
            state,
            [pose],
        ),
    )
    middle = np.degrees(np.arctan2(0.9, -distance - 2.15)) % 360.0
    below = np.degrees(np.arctan2(0.6 - 0.8, distance))
    curves.append(
        scatterer_curve(
            state,
            [pose],
            mesh,
            "car",
            (0.3, 0.15),
            azimuths_deg=(middle - 4.0, middle + 4.0) if distance < 50 else (178.5, 180.5),
            azimuth_step_deg=0.25,
            elevations_deg=np.arange(below - 2.5, below + 2.6, 0.5 if distance < 50 else 0.25)
            if distance < 50
            else np.arange(below - 0.75, below + 0.8, 0.25),
            trace_step_deg=4.0,
            settings=SbrSettings(max_depth=2, ray_spacing=32.0, edge_spacing=16.0),
        )
    )
    return Problem(
        "car_near" if distance < 50 else "car_far",
        f"Metal car from behind at {distance:g} m",
        "sbr with max_phase 0.1, 3 bounces, no floor",
        f"median over the {int(strong.sum())} range cells within 30 dB",
        noise_error_db(float(np.sqrt(np.median(truth[strong])))),
        1,
        error,
        curves,
    )


def car_near() -> Problem:
    """Return the car at 16 m."""
    return _car(16.0)


def car_far() -> Problem:
    """Return the car at 100 m."""
    return _car(100.0)
