"""The kinds of files that the project reads: how real ones are made, and what reads them."""

from __future__ import annotations

import gzip
import random
import shutil
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from tests.exports import RIG
from tests.malformed import EVIL, Kind, evil_text, mutated
from tests.malformed_captures import CAPTURES
from tests.malformed_datasets import DATASETS
from tests.osi_traces import Moving, truth, write_trace
from tests.scenes import Thing, box, plane, write_scene

REPO = Path(__file__).resolve().parents[1]
ALIASES = "\n".join(
    ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    + [f"a{level + 1}: &a{level + 1} [{', '.join([f'*a{level}'] * 10)}]" for level in range(9)]
)
"""Ten lines of YAML that stand for 10^10 values."""
ENTITIES = (
    '<?xml version="1.0"?><!DOCTYPE lolz [<!ENTITY a0 "lol">'
    + "".join(f'<!ENTITY a{level + 1} "{f"&a{level};" * 10}">' for level in range(9))
    + "]><scene>&a9;</scene>"
)
DEEP = "<scene>" * 50_000


def _kind(write: Callable[[Path], None], files: tuple[str, ...], read: Callable[[Path], object], *texts: str) -> Kind:
    replace = evil_text(*texts)
    return Kind(write, files, read, lambda folder, case: replace(folder / files[0], case))


# scenarios and rigs


def _write_scenario(folder: Path) -> None:
    from scarl_sionna.scenario.spec.scenario import LIBRARY

    for file in sorted(LIBRARY.glob("*.yaml"))[:3]:
        shutil.copy(file, folder / file.name)


def _read_scenario(folder: Path) -> object:
    from scarl_sionna.scenario.spec.scenario import ScenarioSpec

    for file in sorted(folder.glob("*.yaml")):
        spec = ScenarioSpec.load(file)
        spec.to_json()
    return None


DRIVE = """
scene: lanes.xml
rig: rig.yaml
num_frames: 5
frame_rate: 10.0
start_time: 0.5
actors:
  - name: a
    model: saloon
    trajectory: {kind: waypoints, positions: [[60, -1.7, 0], [80, -1.5, 0], [100, -1.7, 0]], speed: 9.0}
  - name: b
    model: van
    trajectory: {kind: table, file: tracks.csv}
  - name: c
    model: saloon
    trajectory: {kind: route, lanes: [east, east_on], start: 10, speed: 14}
lighting: {preset: overcast}
weather: {rain_rate: 4.0}
radar: {method: raycast, raycast: {num_rays: 1000}}
"""
TRACKS = "time,id,x,y,z,yaw_deg\n" + "".join(f"{0.1 * i:.1f},b,{140 + 1.2 * i:.2f},1.75,0,0\n" for i in range(30))


def _write_drive(folder: Path) -> None:
    from tests.lane_scene import lane_scene

    path = lane_scene(folder)
    if path.name != "lanes.xml":
        path.rename(folder / "lanes.xml")
    RIG.save(folder / "rig.yaml")
    (folder / "drive.yaml").write_text(DRIVE)
    (folder / "tracks.csv").write_text(TRACKS)


def _read_drive(folder: Path) -> object:
    from scarl_sionna.batch.plan import plan_export
    from scarl_sionna.dataset.encoding import StoreOptions
    from scarl_sionna.scenario.spec.scenario import ScenarioSpec

    return plan_export([ScenarioSpec.load(folder / "drive.yaml")], StoreOptions())


def _write_rig(folder: Path) -> None:
    from scarl_sionna.fusion.rig import Rig

    Rig.front().save(folder / "rig.yaml")
    Rig.front().save(folder / "rig.json")
    shutil.copy(REPO / "tests/regression/schema/rig_0_1.yaml", folder / "old.yaml")


def _read_rigs(folder: Path) -> object:
    from scarl_sionna.fusion.rig import Rig

    return [Rig.load(folder / name).to_dict() for name in ("rig.yaml", "rig.json", "old.yaml")]


def _write_option(folder: Path) -> None:
    (folder / "value.txt").write_text("{num_rays: 500, class_rcs: {Car: 3.0}}")


def _read_option(folder: Path) -> object:
    from scarl_sionna.cli.options import ScenarioOptions
    from scarl_sionna.scenario.spec.scenario import ScenarioSpec

    text = (folder / "value.txt").read_bytes().decode(errors="replace")
    options = ScenarioOptions({}, {}, (f"radar.raycast={text}",))
    return options.apply(ScenarioSpec(scene="tunnel"))


# calibrations and materials


def _write_calibration(folder: Path) -> None:
    shutil.copytree(REPO / "examples/calibration_data", folder / "calibration_data")
    for name in ("calibration_rexolite.yaml", "calibration_drywall.yaml", "calibration_car_rcs.yaml"):
        shutil.copy(REPO / "examples" / name, folder / name)


def _read_calibration(folder: Path) -> object:
    from scarl_sionna.calibration.spec import CalibrationProblem

    return [CalibrationProblem.load(file) for file in sorted(folder.glob("*.yaml"))]


def _write_materials(folder: Path) -> None:
    shutil.copy(REPO / "scarl_sionna/scene/materials/materials.toml", folder / "materials.toml")
    shutil.copy(REPO / "scarl_sionna/radar/channel/raycast/rcs_by_class.toml", folder / "rcs.toml")


def _read_materials(folder: Path) -> object:
    from scarl_sionna.radar.channel.raycast.class_rcs import class_reflectivity
    from scarl_sionna.scene.materials.table import load_materials

    return load_materials([folder / "materials.toml"]), class_reflectivity(folder / "rcs.toml")


# scenes, actors, meshes


def _write_world(folder: Path) -> None:
    path = write_scene(
        folder,
        instances=[Thing("road", plane(40.0, 10.0), "Roads"), Thing("wall", box([1.0, 4.0, 2.0], [9, 0, 1]), "Wall")],
        actors=[
            Thing(
                "ego",
                box([4.0, 1.6, 0.6], [0, 0, 0.4]),
                "Car",
                trajectory={"kind": "waypoints", "times": [0.0, 1.0], "positions": [[0.0, 0, 0], [5.0, 0, 0]]},
            ),
        ],
        ego="ego",
    )
    path.rename(folder / "scene.xml")
    wall = folder / "wall.ply"
    mesh = box([1.0, 4.0, 2.0], [9, 0, 1])
    mesh.export(folder / "wall.obj")
    wall.unlink()
    text = (folder / "scene.xml").read_text()
    place = text.index("wall.ply")
    start = text.rindex('type="ply"', 0, place)
    text = text[:start] + 'type="obj"' + text[start + len('type="ply"') : place] + "wall.obj" + text[place + 8 :]
    (folder / "scene.xml").write_text(text)
    mesh.export(folder / "ego.ply", encoding="ascii")


def _read_world(folder: Path) -> object:
    from scarl_sionna.engine.load import load_scene

    state = load_scene(folder / "scene.xml").at(0.5)
    return state.boxes(), state.cast(np.array([0.0, 0.0, 5.0]), np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]))


def _read_document(folder: Path) -> object:
    from scarl_sionna.scene.document.scene_file import read_document

    return read_document(next(folder.glob("*.xml")))


def _write_lanes(folder: Path) -> None:
    from tests.lane_scene import lane_scene

    lane_scene(folder)


def _write_actor(folder: Path) -> None:
    import scenes_xml

    shutil.copytree(scenes_xml.actor_path("bicycle").parent, folder, dirs_exist_ok=True)


def _read_actor(folder: Path) -> object:
    from scarl_sionna.core.pose import Pose
    from scarl_sionna.scene.actors.model import read_actor_model
    from scarl_sionna.scene.document.scene_file import StagedActor
    from scarl_sionna.scene.motion.trajectory import StaticTrajectory

    model = read_actor_model(folder)
    return StagedActor("x", model, StaticTrajectory(Pose([0.0, 0.0, 0.0])))


MESHES = ("mesh.ply", "ascii.ply", "mesh.obj", "mesh.stl", "mesh.glb")


def _write_mesh(folder: Path) -> None:
    mesh = box([4.0, 1.8, 1.5])
    for name in MESHES:
        mesh.export(folder / name, **({"encoding": "ascii"} if name == "ascii.ply" else {}))


def _read_mesh(folder: Path) -> object:
    from scarl_sionna.core.errors import ScarlError
    from scarl_sionna.radar.optics.body.parts import load_body
    from scarl_sionna.scene.actors.mesh import actor_from_mesh

    errors: list[ScarlError] = []
    for name in MESHES:
        try:
            up, forward = ("z", "x")
            actor_from_mesh(folder / name, up=up, forward=forward, folder=folder / f"out_{name}")
            load_body(folder / name)
        except ScarlError as error:
            errors.append(error)
    if errors:
        raise errors[0]
    return None


def _write_body(folder: Path) -> None:
    from examples.breathing_person import write_person
    from tests.unit.test_body_files import BVH

    write_person(folder / "person.glb")
    (folder / "leg.bvh").write_text(BVH)


def _read_body(folder: Path) -> object:
    from scarl_sionna.core.errors import ScarlError
    from scarl_sionna.scene.actors.body import actor_from_body

    errors: list[ScarlError] = []
    for name in ("person.glb", "leg.bvh"):
        try:
            actor_from_body(folder / name, folder=folder / f"out_{name}")
        except ScarlError as error:
            errors.append(error)
    if errors:
        raise errors[0]
    return None


# motion


FCD = (
    "<fcd-export>"
    + "".join(
        f'<timestep time="{0.5 * i:.2f}"><vehicle id="v" x="{6.0 * i:.1f}" y="0" angle="90" type="car" speed="12"/>'
        f'<person id="p" x="{0.7 * i:.1f}" y="5" angle="90" speed="1.4"/></timestep>\n'
        for i in range(12)
    )
    + "</fcd-export>"
)


MOTIONS = ("t.csv", "path.csv", "f.xml", "f.xml.gz", "t.parquet", "t.osi")


def _write_motion(folder: Path) -> None:
    import pandas

    (folder / "t.csv").write_text(TRACKS)
    (folder / "path.csv").write_text("".join(",".join(line.split(",")[:4]) + "\n" for line in TRACKS.splitlines()))
    (folder / "f.xml").write_text(FCD)
    moving = [[Moving(1, (1.0 * step, 0.0, 0.8), velocity=(10.0, 0.0, 0.0))] for step in range(12)]
    write_trace(folder / "t.osi", [truth(0.1 * step, one, host=1) for step, one in enumerate(moving)])
    (folder / "f.xml.gz").write_bytes(gzip.compress(FCD.encode(), mtime=0))
    pandas.DataFrame({"time": [0.0, 1.0, 2.0], "id": ["a"] * 3, "x": [0.0, 5, 10], "y": [0.0] * 3}).to_parquet(
        folder / "t.parquet"
    )


def _read_motion(folder: Path) -> object:
    from scarl_sionna.core.errors import ScarlError
    from scarl_sionna.scenario.motion.tables import read_table

    errors: list[ScarlError] = []
    for name in MOTIONS:
        try:
            for trajectory in read_table(folder / name).values():
                trajectory.pose(trajectory.start)
        except ScarlError as error:
            errors.append(error)
    if errors:
        raise errors[0]
    return None


def _commonroad(folder: Path) -> None:
    from tests.unit.test_sumo import COMMONROAD, commonroad_state

    states = "".join(
        f"<state>{commonroad_state(step)}<velocity><exact>10</exact></velocity></state>" for step in range(1, 31)
    )
    (folder / "c.xml").write_text(COMMONROAD.format(first=commonroad_state(0), states=states))


def _read_commonroad(folder: Path) -> object:
    from scarl_sionna.scenario.motion.tables import read_table

    return read_table(folder / "c.xml")


def _nuscenes(folder: Path) -> None:
    from tests.integration.test_nuscenes_drives import THINGS, rear
    from tests.nuscenes_tables import write_tables

    write_tables(folder, {name: THINGS[name] for name in ("ahead", "walker")}, rear, 1.0)


def _read_nuscenes(folder: Path) -> object:
    from scarl_sionna.scenario.motion.bodies import ActorBody
    from scarl_sionna.scenario.traffic.planned import Conversion
    from scarl_sionna.scenario.traffic.recorded.nuscenes import nuscenes_motion, read_nuscenes

    nuscenes_motion(folder, "scene-0061", "ego", ActorBody(), Conversion())
    return read_nuscenes(folder, "scene-0061", span=(0.0, 1.0))


# packed tables of numbers


def _write_numbers(folder: Path) -> None:
    from tests.unit.test_scatterers import one_point

    one_point().save(folder / "model.npz")
    angles = np.linspace(-0.5, 0.5, 20)
    columns = {"azimuth_deg": np.degrees(angles), "elevation_deg": np.degrees(angles) / 3.0, "time": angles + 0.5}
    np.savez_compressed(folder / "scan.npz", **columns)
    rows = "".join(",".join(f"{value:.4f}" for value in row) + "\n" for row in zip(*columns.values(), strict=True))
    (folder / "scan.csv").write_text(",".join(columns) + "\n" + rows)


def _read_numbers(folder: Path) -> object:
    from scarl_sionna.core.errors import ScarlError
    from scarl_sionna.core.specs.lidar.pattern import TableScan
    from scarl_sionna.radar.scatterers.model import ScattererModel

    errors: list[ScarlError] = []
    for read in (
        lambda: ScattererModel.load(folder / "model.npz").scattering_matrix(np.pi / 2, 0.2),
        lambda: TableScan.read(folder / "scan.npz"),
        lambda: TableScan.read(folder / "scan.csv"),
    ):
        try:
            read()
        except ScarlError as error:
            errors.append(error)
    if errors:
        raise errors[0]
    return None


def _evil_numbers(folder: Path, case: int) -> bool:
    """Change what is inside a packed file, so that its checksums are right."""
    if case % 2:
        return evil_text()(folder / "model.npz", case // 2)
    rng = random.Random(case)
    name = rng.choice(("model.npz", "scan.npz"))
    with zipfile.ZipFile(folder / name) as old:
        members = {item: old.read(item) for item in old.namelist()}
    chosen = rng.choice(sorted(members))
    how = rng.randrange(4)
    if how == 0:
        del members[chosen]
    elif how == 1:
        members[chosen] = mutated(members[chosen], rng)
    else:
        header = rng.choice(EVIL).encode("utf-8", "surrogatepass")[:60]
        members[chosen] = members[chosen][:10] + b"{'descr': '<f8', 'fortran_order': False, 'shape': (%b,)}" % header
    with zipfile.ZipFile(folder / name, "w") as new:
        for item, data in members.items():
            new.writestr(item, data)
    return True


KINDS: Mapping[str, Kind] = {
    "scenario": _kind(
        _write_scenario, ("backing_out_of_a_drive.yaml", "car_park_search.yaml"), _read_scenario, ALIASES
    ),
    "drive": _kind(_write_drive, ("drive.yaml", "tracks.csv", "scene.toml"), _read_drive, ALIASES),
    "rig": _kind(_write_rig, ("rig.yaml", "rig.json", "old.yaml"), _read_rigs, ALIASES),
    "option": Kind(_write_option, ("value.txt",), _read_option),
    "calibration": _kind(
        _write_calibration,
        ("calibration_rexolite.yaml", "calibration_drywall.yaml", "calibration_car_rcs.yaml"),
        _read_calibration,
        ALIASES,
    ),
    "materials": _kind(_write_materials, ("materials.toml", "rcs.toml"), _read_materials),
    "lanes": _kind(_write_lanes, ("scene.toml",), _read_document),
    "world": _kind(
        _write_world, ("scene.xml", "scene.toml", "road.ply", "ego.ply", "wall.obj"), _read_world, ENTITIES, DEEP
    ),
    "actor": _kind(_write_actor, ("actor.toml", "bicycle.xml"), _read_actor, ENTITIES),
    "mesh": _kind(_write_mesh, MESHES, _read_mesh),
    "body": _kind(_write_body, ("person.glb", "leg.bvh"), _read_body),
    "motion": _kind(_write_motion, MOTIONS, _read_motion, ENTITIES),
    "commonroad": _kind(_commonroad, ("c.xml",), _read_commonroad, ENTITIES),
    "nuscenes": _kind(_nuscenes, ("sample_annotation.json", "ego_pose.json", "scene.json"), _read_nuscenes),
    "numbers": Kind(_write_numbers, ("model.npz", "scan.npz", "scan.csv"), _read_numbers, _evil_numbers),
    **DATASETS,
    **CAPTURES,
}  # fmt: skip # a table
