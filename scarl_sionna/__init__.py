"""Synchronized camera, lidar and MIMO radar data of driving scenes, from Mitsuba and Sionna RT.

Public names are imported when they are first used, so ``import scarl_sionna`` is fast and starts no engine.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .core.accuracy import Accuracy
    from .core.atmosphere import Atmosphere
    from .core.camera_spec import BrownConrady, CameraSpec, ImageSensor, KannalaBrandt, Pinhole
    from .core.errors import ScarlError, ScarlWarning
    from .core.lidar_pattern import RasterScan, RisleyScan, SpinningScan, TableScan
    from .core.lidar_receiver import HeterodyneReceiver, ScarlReceiver
    from .core.lidar_spec import LidarSpec
    from .core.lighting import Lighting
    from .core.pose import Pose, Twist
    from .core.radar_spec import RadarSpec
    from .core.results import Frame, ImageFrame, LidarScan, RadarFrame
    from .core.weather import Weather
    from .export.reader import open_dataset
    from .fusion import Rig
    from .generate import observe, simulate
    from .radar import (
        RadarPaths,
        attenuate_paths,
        detect,
        label_cells,
        label_paths,
        label_points,
        point_targets,
        quantize,
        range_doppler,
        range_doppler_angle,
        synthesize,
        virtual_cube,
    )
    from .radar.channel import solve_paths
    from .radar.rcs import rcs
    from .radar.scatterer_compile import compile_scatterers
    from .radar.scatterers import ScattererModel
    from .radar.synthesis.blocks import retraced, synthesize_blocks
    from .world import ActorModel, StagedActor, World, WorldState, load_scene, read_actor_model, stage
    from .world.actor_mesh import actor_from_mesh

__all__ = [
    "Accuracy",
    "ActorModel",
    "Atmosphere",
    "BrownConrady",
    "CameraSpec",
    "Frame",
    "HeterodyneReceiver",
    "ImageFrame",
    "ImageSensor",
    "KannalaBrandt",
    "LidarScan",
    "LidarSpec",
    "Lighting",
    "Pinhole",
    "Pose",
    "RadarFrame",
    "RadarPaths",
    "RadarSpec",
    "RasterScan",
    "Rig",
    "RisleyScan",
    "ScarlError",
    "ScarlReceiver",
    "ScarlWarning",
    "ScattererModel",
    "SpinningScan",
    "StagedActor",
    "TableScan",
    "Twist",
    "Weather",
    "World",
    "WorldState",
    "actor_from_mesh",
    "attenuate_paths",
    "compile_scatterers",
    "detect",
    "label_cells",
    "label_paths",
    "label_points",
    "load_scene",
    "observe",
    "open_dataset",
    "point_targets",
    "quantize",
    "range_doppler",
    "range_doppler_angle",
    "rcs",
    "read_actor_model",
    "retraced",
    "simulate",
    "solve_paths",
    "stage",
    "synthesize",
    "synthesize_blocks",
    "virtual_cube",
]

_HOME = {
    ".core.accuracy": ("Accuracy",),
    ".core.atmosphere": ("Atmosphere",),
    ".core.camera_spec": ("BrownConrady", "CameraSpec", "ImageSensor", "KannalaBrandt", "Pinhole"),
    ".core.errors": ("ScarlError", "ScarlWarning"),
    ".core.lidar_pattern": ("RasterScan", "RisleyScan", "SpinningScan", "TableScan"),
    ".core.lidar_receiver": ("HeterodyneReceiver", "ScarlReceiver"),
    ".core.lidar_spec": ("LidarSpec",),
    ".core.lighting": ("Lighting",),
    ".core.pose": ("Pose", "Twist"),
    ".core.radar_spec": ("RadarSpec",),
    ".core.results": ("Frame", "ImageFrame", "LidarScan", "RadarFrame"),
    ".core.weather": ("Weather",),
    ".export.reader": ("open_dataset",),
    ".fusion": ("Rig",),
    ".generate": ("observe", "simulate"),
    ".radar": (
        "RadarPaths", "attenuate_paths", "detect", "label_cells", "label_paths", "label_points", "point_targets", "quantize",
        "range_doppler", "range_doppler_angle", "synthesize", "virtual_cube",
    ),
    ".radar.channel": ("solve_paths",),
    ".radar.rcs": ("rcs",),
    ".radar.scatterer_compile": ("compile_scatterers",),
    ".radar.scatterers": ("ScattererModel",),
    ".radar.synthesis.blocks": ("retraced", "synthesize_blocks"),
    ".world": ("ActorModel", "StagedActor", "World", "WorldState", "load_scene", "read_actor_model", "stage"),
    ".world.actor_mesh": ("actor_from_mesh",),
}  # fmt: skip
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}

try:
    __version__ = version("scarl-sionna")
except PackageNotFoundError:  # used from a checkout that is not installed
    __version__ = "0+unknown"


def __getattr__(name: str) -> Any:
    """Import a public name on first use (PEP 562)."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'scarl_sionna' has no attribute '{name}'")
    value = getattr(import_module(_MODULE_OF[name], __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
