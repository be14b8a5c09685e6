"""The problems of the work-precision charts.

a scene, an exact or converged reference, and the methods over their knobs.

A problem looks at its scene from several places. One answer is the paths of all of them, so seconds are those of one
radar frame: solver and synthesis of 12 channels x 256 chirps x 512 samples.
"""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.channel import ChannelPlan, Share, solve_paths
from scarl_sionna.signal.noise import angle_cell_noise_power
from tests.oracles import multipath
from tests.oracles import rcs as oracle
from tests.oracles.near_field_po import rectangle_transfer
from tests.scenes import Material, Thing, ball, plane, write_scene

RADAR = ss.RadarSpec().with_(pattern=IsotropicPattern(), elevation_fov_deg=90.0)
WAVELENGTH = SPEED_OF_LIGHT / RADAR.center_frequency
NOTHING_DB = 60.0
"""Error that stands for no echo at all, and for everything worse."""
_keep: list[Any] = []
_number = itertools.count()

Answer = list[Any]
Error = Callable[[Answer], float]


@dataclass(frozen=True)
class Point:
    """One setting of a method: what to solve from each place, and what was spent before, once."""

    label: str
    run: Callable[[], Answer]
    is_default: bool = False


@dataclass
class Curve:
    """One method over one knob."""

    method: str
    knob: str
    points: list[Point] = field(default_factory=list)


@dataclass(frozen=True)
class Problem:
    """A scene with a reference.

    `error` maps an answer to decibels; `noise_db` is the error that the radar's own thermal noise makes in one frame.
    """

    name: str
    title: str
    reference: str
    measure: str
    noise_db: float
    num_frames: int
    error: Error
    curves: list[Curve]


def folder() -> Path:
    """Return a new folder that lives as long as the process."""
    _keep.append(tempfile.TemporaryDirectory())
    return Path(_keep[-1].name)


def scene(things: Sequence[Thing], actors: Sequence[Thing] = (), materials: Any = None, table: Any = None) -> Any:
    """Return the state of a small scene."""
    path = write_scene(folder(), things, actors, materials=materials)
    return (ss.load_scene(path) if table is None else load_with(path, table)).at(0.0)


def load_with(path: Path, table: Any) -> Any:
    """Load a scene with a table of materials of one's own."""
    from scarl_sionna.engine.load import load_scene

    return load_scene(path, table)


def signal(paths: Any, wavelength: float = WAVELENGTH) -> complex:
    """Return the coherent sum (VV) at the middle of the band."""
    if not paths.num_paths:
        return 0j
    length = PathGeometry.of(paths, RADAR).center_length()
    return complex(np.sum(paths.a[:, 0, 0] * np.exp(-2j * np.pi * length / wavelength)))


def level_db(value: complex, exact: complex) -> float:
    """Return the error of a level, at most `NOTHING_DB`."""
    ratio = abs(value) / abs(exact)
    return float(min(abs(20.0 * np.log10(max(ratio, 1e-9))), NOTHING_DB))


def noise_error_db(amplitude: float, radar: Any = RADAR) -> float:
    """Return the rms error [dB] that noise makes of an echo in one cell: 20 / ln 10 / sqrt(2 SNR)."""
    snr = amplitude**2 * 10.0 ** (radar.front_end.tx_power_dbm / 10.0 - 3.0) / angle_cell_noise_power(radar)
    return float(20.0 / np.log(10.0) / np.sqrt(2.0 * snr))


def frames(state: Any, poses: Sequence[Pose], radar: Any = RADAR, **options: Any) -> Callable[[], Answer]:
    """Return what solves and synthesizes one radar frame from each place."""

    def run() -> Answer:
        answer = []
        for pose in poses:
            paths = solve_paths(state, radar, pose, **options)
            ss.synthesize(paths, radar)
            answer.append(paths)
        return answer

    return run


def over(
    method: str, knob: str, settings: Sequence[tuple[str, dict[str, Any]]], default: str, *scene_and: Any
) -> Curve:
    """Return the curve of a method over options."""
    radar = scene_and[2] if len(scene_and) > 2 else RADAR
    state, poses = scene_and[:2]
    return Curve(
        method,
        knob,
        [
            Point(label, frames(state, poses, radar, method=method.split(",")[0], **options), label == default)
            for label, options in settings
        ],
    )


def sbr_knobs(**others: Any) -> list[tuple[str, dict[str, Any]]]:
    """Return the settings of `sbr` over the size of its patches."""
    return [
        (f"{phase:g} rad", {"settings": SbrSettings(max_phase=phase, integration_phase=phase / 20.0, **others)})
        for phase in (2.0, 1.0, 0.4, 0.2)
    ]


def common(
    state: Any, poses: Sequence[Pose], radar: Any = RADAR, rays: Sequence[int] = (10_000, 100_000, 1_000_000)
) -> list[Curve]:
    """Return raycast, sionna, sbr and auto over their knobs."""
    return [
        over("raycast", "rays", [(f"{n:.0e}", {"num_rays": n}) for n in rays], "1e+06", state, poses, radar),
        over(
            "sionna",
            "rays",
            [(f"{n:.0e}", {"num_samples": n}) for n in (20_000, 200_000)],
            "2e+05",
            state,
            poses,
            radar,
        ),
        over("sbr", "max_phase", sbr_knobs(), "0.2 rad", state, poses, radar),
        over(
            "auto",
            "tolerance",
            [(f"{t:g} dB", {"accuracy": Accuracy(channel_tolerance_db=t)}) for t in (3.0, 1.0, 0.3)],
            "1 dB",
            state,
            poses,
            radar,
        ),
    ]


def looking_at_origin(azimuth: float, elevation: float, distance: float) -> Pose:
    """Return a pose that sees the origin from a direction [rad]."""
    direction = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    return Pose.from_euler(direction * distance, yaw=np.pi + azimuth, pitch=elevation)


def mean_level_error(exact: Sequence[complex]) -> Error:
    """Return the mean error of the level over the places."""
    return lambda answer: float(
        np.mean([level_db(signal(paths), one) for paths, one in zip(answer, exact, strict=True)])
    )


def scatterer_curve(
    state: Any, poses: Sequence[Pose], mesh: Any, name: str, voxels: Sequence[float], **table: Any
) -> Curve:
    """Return scattering centres over the size of their cells; compiling them is not part of a frame's time."""
    points = []
    for voxel in voxels:
        model = ss.compile_scatterers(mesh, RADAR.center_frequency, voxel=voxel, progress=False, **table)
        run = frames(state, poses, RADAR, method="scatterers", models={name: model})
        points.append(Point(f"{voxel:g} m", run, voxel == voxels[-1]))
    return Curve("scatterers", "voxel", points)


def plate() -> Problem:
    """Return a metal plate of 0.3 m at 10 m, which is in its near field (far field: 46 m)."""
    size, distance = 0.3, 10.0
    mesh = plane(size, size, normal=(1, 0, 0))
    state = scene([Thing("plate", mesh, "TrafficSign", "steel")])
    angles = np.radians([0.0, 0.3, 0.6, 1.0, 1.7])
    poses = [looking_at_origin(angle, 0.0, distance) for angle in angles]
    corner = np.array([0, -size / 2, -size / 2])
    exact = [
        rectangle_transfer(corner, [0, size, 0], [0, 0, size], pose.position, WAVELENGTH, np.array([0, 0, 1.0]))
        for pose in poses
    ]
    curves = common(state, poses)
    curves.append(
        scatterer_curve(
            state,
            poses,
            mesh,
            "plate",
            (0.15, 0.075),
            azimuths_deg=(-3.0, 3.0),
            azimuth_step_deg=0.2,
            elevations_deg=np.arange(-1.0, 1.01, 0.25),
        )
    )
    return Problem(
        "plate",
        "Metal plate 0.3 m at 10 m, 0 to 1.7 deg",
        "exact physical-optics integral by quadrature",
        "mean over 5 angles",
        noise_error_db(abs(exact[0])),
        len(poses),
        mean_level_error(exact),
        curves,
    )


def trihedral() -> Problem:
    """Return a corner reflector of 10 cm legs at 50 m, at boresight and beside it."""
    leg, distance = 0.1, 50.0
    vertices, faces = oracle.TRIHEDRAL_MESH
    mesh = trimesh.Trimesh(np.array(vertices) * leg, faces, process=False)
    state = scene([Thing("corner", mesh, "TrafficSign", "steel")])
    boresight = np.arcsin(1 / np.sqrt(3))
    angles = np.radians([45.0, 40.0, 35.0, 55.0])
    poses = [looking_at_origin(angle, boresight, distance) for angle in angles]
    sigma = ss.rcs(
        mesh, RADAR.center_frequency, np.pi / 2 - boresight, angles, settings=SbrSettings(edge_spacing=0.125)
    )
    sigma = np.concatenate([[oracle.trihedral(leg, WAVELENGTH)], sigma[1:]])
    exact = RADAR.wavelength * np.sqrt(sigma) / ((4 * np.pi) ** 1.5 * distance**2)
    curves = common(state, poses)
    curves.append(
        scatterer_curve(
            state,
            poses,
            mesh,
            "corner",
            (0.1, 0.05),
            azimuths_deg=(30.0, 60.0),
            azimuth_step_deg=0.5,
            settings=SbrSettings(max_depth=3),
            elevations_deg=(np.degrees(boresight),),
        )
    )
    return Problem(
        "trihedral",
        "Trihedral of 10 cm legs at 50 m, 0 to 10 deg off boresight",
        "closed form at boresight; ss.rcs at twice its default fineness beside it",
        "mean over 4 angles",
        noise_error_db(abs(exact[0])),
        len(poses),
        mean_level_error(list(exact)),
        curves,
    )


def sphere() -> Problem:
    """Return a metal sphere of 0.3 m radius at 20 m, over its tessellation."""
    radius, distance = 0.3, 20.0
    exact = RADAR.wavelength * radius / 2.0 / (4 * np.pi * (distance - radius) * distance)
    poses = [looking_at_origin(angle, 0.1, distance) for angle in (0.1, 0.5, 0.9)]
    curves = []
    states = {n: scene([Thing("ball", ball(radius, subdivisions=n), "Static", "steel")]) for n in (2, 3, 4, 5, 6)}
    for method, options, chosen in (
        ("sbr", {"settings": SbrSettings(max_depth=1)}, (2, 3, 4, 5, 6)),
        ("sionna", {"num_samples": 20_000}, (2, 4, 5)),
        ("raycast", {"num_rays": 100_000}, (2, 5)),
        ("auto", {}, (4, 5)),
    ):
        points = [
            Point(f"{20 * 4**n} faces", frames(states[n], poses, method=method, **options), n == 5) for n in chosen
        ]
        curves.append(Curve(method, "tessellation", points))
    return Problem(
        "sphere",
        "Metal sphere, radius 0.3 m (ka 490), at 20 m",
        "stationary phase on the exact sphere (Mie at this ka: 0.02 dB)",
        "mean over 3 views",
        noise_error_db(exact),
        len(poses),
        mean_level_error([exact] * len(poses)),
        curves,
    )


SMOOTH = "smooth_asphalt"


def _smooth_table() -> Any:
    from scarl_sionna.scene.materials.table import MaterialTable, builtin_materials

    smooth = builtin_materials()["asphalt"].with_(name=SMOOTH, scattering_coefficient=0.0)
    return MaterialTable([*builtin_materials().values(), smooth])


def _ball_amplitude(radius: float, distance: Any) -> Any:
    return RADAR.wavelength * radius / 2.0 / (4 * np.pi * (distance - radius) * distance)


def _ball_model(radius: float, middle: Any) -> Any:
    """Return one isotropic centre with the RCS of a large sphere."""
    amplitude = np.zeros((1, 2, 1, 2, 2), np.complex64)
    amplitude[..., 0, 0] = amplitude[..., 1, 1] = radius / 2.0
    half_turn = np.array([0.0, np.pi])
    return ss.ScattererModel(
        middle[None], half_turn, np.zeros(1), amplitude, RADAR.center_frequency, 0.0, 0.0, np.pi / 2
    )


def two_ray() -> Problem:
    """Return a small metal ball over smooth asphalt at ten ranges: an isotropic target, so the closed form holds."""
    radius, height = 0.1, 0.5
    ranges = np.array([10.0, 12.0, 15.0, 18.0, 21.0, 25.0, 30.0, 36.0, 43.0, 50.0])
    ground = Thing("ground", plane(256.0, 64.0), "Roads", "asphalt", is_object=False)
    states = {
        n: scene(
            [ground, Thing("ball", ball(radius, (0, 0, height), n), "Static", "steel")],
            (),
            {"asphalt": Material(radio=SMOOTH)},
            _smooth_table(),
        )
        for n in (3, 4, 5)
    }
    state = states[5]
    poses = [Pose.from_euler([x, 0, 0.5], yaw=np.pi) for x in ranges]
    material = state.world.materials[SMOOTH]
    straight, bounced = np.hypot(ranges, 0.5 - height), np.hypot(ranges, 0.5 + height)
    grazing = np.arcsin((0.5 + height) / bounced)
    eta = material.at(RADAR.center_frequency)
    root = np.sqrt(eta - np.cos(grazing) ** 2)
    tm = (eta * np.sin(grazing) - root) / (eta * np.sin(grazing) + root)  # V over level ground
    wave = 2 * np.pi / WAVELENGTH
    half_bistatic = (np.arctan2(0.5 + height, ranges) + np.arctan2(height - 0.5, ranges)) / 2.0
    one = np.exp(-1j * wave * (straight - radius)) / straight
    other = tm * np.exp(-1j * wave * (bounced - radius)) / bounced
    # Mixed pairs leave at the bisector's point of the ball, which is 2 a (1 - cos) less far in front of its middle.
    mixed = np.exp(-2j * wave * radius * (1.0 - np.cos(half_bistatic)))
    exact = _ball_amplitude(radius, ranges) * straight**2 * (one**2 + 2.0 * one * other * mixed + other**2)
    one_bounce = SbrSettings(floor_db=None, max_depth=1)
    through = ChannelPlan((Share("sbr", ("ball",), one_bounce, True),), ("ground",), echoes=False)
    point = {"ball": _ball_model(radius, np.array([0.0, 0.0, height]))}
    curves = [
        over(
            "raycast",
            "rays",
            [(f"{n:.0e}", {"num_rays": n, "instances": ["ball"]}) for n in (100_000, 1_000_000)],
            "1e+06",
            state,
            poses,
        ),
        over("sionna", "rays", [(f"{n:.0e}", {"num_samples": n}) for n in (20_000, 200_000)], "2e+05", state, poses),
        over("sbr", "max_phase", sbr_knobs(), "0.2 rad", state, poses),
        Curve(
            "hybrid",
            "tessellation of the ball",
            [
                Point(f"{20 * 4**n} faces", frames(one, poses, method="hybrid", plan=through), n == 5)
                for n, one in states.items()
            ],
        ),
        Curve(
            "scatterers + mirrors",
            "one centre",
            [
                Point(
                    "1 centre",
                    frames(
                        state,
                        poses,
                        method="hybrid",
                        plan=ChannelPlan(
                            (Share("scatterers", ("ball",), {"models": point}, True),), ("ground",), echoes=False
                        ),
                    ),
                    True,
                )
            ],
        ),
    ]
    peak = float(np.abs(exact).max())
    return Problem(
        "two_ray",
        "Metal ball over smooth asphalt, 10 to 50 m, heights 0.5 m",
        "closed form of the four two-ray paths",
        "mean over 10 ranges",
        noise_error_db(peak),
        len(poses),
        mean_level_error(list(exact)),
        curves,
    )


BALL_BESIDE_WALL = 2
"""Instance id: things are numbered in their order."""


def wall() -> Problem:
    """Return a metal ball beside a metal wall: the target, two ghosts at its range, and one behind the wall."""
    radius = 0.1
    position = np.array([20.0, -1.0, 0.0])
    things = [
        Thing("wall", plane(64.0, 32.0, (16, 4, 0), (0, -1, 0)), "Wall", "steel", is_object=False),
        Thing("ball", ball(radius, position, 5), "Static", "steel"),
    ]
    state, poses = scene(things), [Pose()]
    image = multipath.mirrored(position, (0, 1, 0), 4.0)
    near, far = np.linalg.norm(position), np.linalg.norm(image)
    gates = {
        "direct": (near, _ball_amplitude(radius, near)),
        "type 1": ((near + far) / 2, 2 * RADAR.wavelength * radius / 2 / (4 * np.pi * (near - radius) * far)),
        "type 2": (far, _ball_amplitude(radius, far)),
    }

    def error(answer: Answer) -> float:
        paths = answer[0].select((answer[0].instance == BALL_BESIDE_WALL).any(axis=1))  # not the wall's own clutter
        length = PathGeometry.of(paths, RADAR).center_length() / 2 if paths.num_paths else np.zeros(0)
        errors = []
        for middle, exact in gates.values():
            inside = np.abs(length + radius - middle) < 0.15
            errors.append(level_db(signal(paths.select(inside)), exact))
        return float(np.mean(errors))

    through = [
        (label, {"plan": ChannelPlan((Share("sbr", ("ball",), options["settings"], True),), ("wall",), echoes=False)})
        for label, options in sbr_knobs(floor_db=None, max_depth=1)
    ]
    one = Share("scatterers", ("ball",), {"models": {"ball": _ball_model(radius, position)}}, True)
    mirrored = ChannelPlan((one,), ("wall",), echoes=False)
    curves = [
        *(curve for curve in common(state, poses) if curve.method != "auto"),
        over("hybrid", "sbr's max_phase", through, "0.2 rad", state, poses),
        over(
            "auto",
            "tubes",
            [(f"{n:.0e}", {"accuracy": Accuracy(tube_budget=n)}) for n in (20_000, 100_000)],
            "1e+05",
            state,
            poses,
        ),
        Curve(
            "scatterers + mirrors",
            "one centre",
            [
                Point(
                    "1 centre",
                    frames(
                        state,
                        poses,
                        method="hybrid",
                        plan=mirrored,
                    ),
                    True,
                )
            ],
        ),
    ]
    return Problem(
        "wall",
        "Metal ball 5 m from a metal wall: target and ghosts",
        "image theory",
        "mean over direct, type 1, type 2",
        noise_error_db(gates["type 2"][1]),
        1,
        error,
        curves,
    )
