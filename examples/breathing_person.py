"""A person who breathes and waves, before a radar in a room: a skinned glTF made by code, and the breath by its echo.

python examples/breathing_person.py
"""

from __future__ import annotations

import json
import struct
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh

Array = npt.NDArray[np.float64]

BREATH, BREATHS = 5e-3, 0.25
"""How far the chest moves to either side [m], and how often [Hz]."""
WAVE, WAVES = np.radians(35.0), 1.0
"""How far the forearm swings to either side [rad], and how often [Hz]."""
ELBOW = np.array([-0.3, 1.25, 0.0])
"""In the axes of glTF: x left, y up, z forward [m]."""
DURATION = 4.0
_TYPES = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Gltf:
    """Tables and bytes of a glTF file in the making."""

    def __init__(self) -> None:
        self.tables: dict[str, Any] = {"asset": {"version": "2.0"}, "bufferViews": [], "accessors": []}
        self._bytes = b""

    def add(self, values: npt.ArrayLike, kind: str, dtype: str = "<f4") -> int:
        """Add an array, and return the number of its accessor."""
        rows = np.asarray(values, dtype=dtype).reshape(-1, _TYPES[kind])
        data = rows.tobytes()
        self.tables["bufferViews"].append({"buffer": 0, "byteOffset": len(self._bytes), "byteLength": len(data)})
        self._bytes += data + b"\0" * (-len(data) % 4)
        component = {"<f4": 5126, "<u2": 5123, "<u4": 5125}[dtype]
        accessor = {"bufferView": len(self.tables["bufferViews"]) - 1, "componentType": component, "type": kind}
        self.tables["accessors"].append({**accessor, "count": len(rows)})
        return len(self.tables["accessors"]) - 1

    def channel(self, node: int, path: str, times: Array, values: Array, kind: str = "LINEAR") -> None:
        """Add a channel to the one animation."""
        clip = self.tables.setdefault("animations", [{"name": "clip", "channels": [], "samplers": []}])[0]
        width = {"rotation": "VEC4", "weights": "SCALAR"}.get(path, "VEC3")
        clip["channels"].append({"sampler": len(clip["samplers"]), "target": {"node": node, "path": path}})
        rows = self.add(times, "SCALAR"), self.add(values, width)
        clip["samplers"].append({"input": rows[0], "output": rows[1], "interpolation": kind})

    def write(self, path: Path) -> Path:
        """Write a binary file, and return its path."""
        head = json.dumps({**self.tables, "buffers": [{"byteLength": len(self._bytes)}]}).encode()
        head += b" " * (-len(head) % 4)
        chunks = struct.pack("<II", len(head), 0x4E4F534A) + head
        chunks += struct.pack("<II", len(self._bytes), 0x004E4942) + self._bytes
        path.write_bytes(struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks)
        return path


def capsule(first: Array, last: Array, radius: float) -> tuple[Array, npt.NDArray[np.int64]]:
    """Return vertices and faces of a round bar between two points [m]."""
    along = last - first
    length = float(np.linalg.norm(along))
    body = trimesh.creation.capsule(length, radius, count=(16, 12))
    turn = trimesh.geometry.align_vectors((0.0, 0.0, 1.0), along / length)[:3, :3]
    return (body.vertices - body.bounds.mean(axis=0)) @ turn.T + (first + last) / 2.0, body.faces


def write_person(path: Path) -> Path:
    """Write a person of 1.75 m as a skinned glTF: the chest breathes as a morph target, the right forearm waves."""
    up = np.array([0.0, 1.0, 0.0])
    limbs = [
        (np.array([0.0, 0.98, 0.0]), np.array([0.0, 1.35, 0.0]), 0.15),  # trunk
        (np.array([0.0, 1.55, 0.0]), np.array([0.0, 1.65, 0.0]), 0.1),  # head
        (np.array([0.22, 0.8, 0.0]), np.array([0.2, 1.38, 0.0]), 0.045),  # left arm
        (np.array([-0.2, 1.38, 0.0]), ELBOW, 0.045),  # right upper arm
        (ELBOW, ELBOW + 0.28 * up, 0.04),  # right forearm, raised
        *((np.array([x, 0.08, 0.0]), np.array([x, 0.9, 0.0]), 0.07) for x in (0.1, -0.1)),  # legs
    ]
    bodies = [capsule(*limb) for limb in limbs]
    first = np.cumsum([0, *(len(vertices) for vertices, _ in bodies)])
    vertices = np.concatenate([vertices for vertices, _ in bodies])
    faces = np.concatenate([faces + start for (_, faces), start in zip(bodies, first[:-1], strict=True)])
    joints, weights = np.zeros((len(vertices), 4)), np.zeros((len(vertices), 4))
    weights[:, 0] = 1.0
    joints[:, 1] = 1
    bend = np.clip((vertices[first[4] : first[5], 1] - ELBOW[1] + 0.04) / 0.08, 0.0, 1.0)  # the skin of the elbow
    weights[first[4] : first[5], :2] = np.stack([1.0 - bend, bend], axis=1)
    breathed = np.zeros_like(vertices)
    trunk = slice(first[0], first[1])
    breathed[trunk, 2] = np.where(vertices[trunk, 2] > 0.0, BREATH, 0.0)  # its front comes forward

    file = Gltf()
    attributes = {
        "POSITION": file.add(vertices, "VEC3"),
        "JOINTS_0": file.add(joints, "VEC4", "<u2"),
        "WEIGHTS_0": file.add(weights, "VEC4"),
    }
    bind = np.repeat(np.eye(4)[None], 2, axis=0)
    bind[1, :3, 3] = -ELBOW
    primitive = {"attributes": attributes, "indices": file.add(faces, "SCALAR", "<u4"), "material": 0}
    file.tables |= {
        "materials": [{"name": "skin", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.33, 0.25, 1.0]}}],
        "meshes": [{"primitives": [{**primitive, "targets": [{"POSITION": file.add(breathed, "VEC3")}]}]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": file.add(bind.transpose(0, 2, 1), "MAT4")}],
        "nodes": [
            {"name": "person", "mesh": 0, "skin": 0},
            {"name": "root", "children": [2]},
            {"name": "elbow", "translation": ELBOW.tolist()},
        ],
        "scenes": [{"nodes": [0, 1]}],
    }
    times = np.linspace(0.0, DURATION, 161)
    angle = WAVE * np.sin(2.0 * np.pi * WAVES * times)
    none = np.zeros_like(angle)
    file.channel(2, "rotation", times, np.stack([none, none, np.sin(angle / 2.0), np.cos(angle / 2.0)], axis=1))
    file.channel(0, "weights", times, np.sin(2.0 * np.pi * BREATHS * times))
    return file.write(path)


ROOM = """<scene version="3.0.0">
    <bsdf type="twosided" id="plaster"><bsdf type="diffuse"/></bsdf>
    <shape type="cube" id="room">
        <transform name="to_world"><scale x="3" y="2" z="1.3"/><translate x="2.5" z="1.3"/></transform>
        <ref id="plaster" name="bsdf"/>
    </shape>
    <emitter type="constant"><rgb name="radiance" value="1"/></emitter>
</scene>
"""
TABLES = """[scene]
name = "room"
[materials.plaster]
radio = "plasterboard"
[[instances]]
name = "room"
class = "Wall"
shapes = ["room"]
room = true
object = false
"""


def write_room(folder: Path) -> Path:
    """Write a room of 6 x 4 x 2.6 m as a scene, and return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.toml").write_text(TABLES, encoding="utf-8")
    (folder / "room.xml").write_text(ROOM, encoding="utf-8")
    return folder / "room.xml"


def breathing(folder: Path, times: Array) -> Array:
    """Return how far the chest has come towards a radar since the first time [m], by the phase of its echo."""
    import scarl_sionna as ss
    from scarl_sionna.scene.motion.trajectory import StaticTrajectory

    model = ss.actor_from_body(write_person(folder / "person.glb"), smooth=True, folder=folder / "person")
    place = StaticTrajectory(ss.Pose.from_euler([2.5, 0.0, 0.0], yaw=np.pi))
    world = ss.stage(ss.load_scene(write_room(folder / "room")), [ss.StagedActor("person", model, place)])
    radar = ss.RadarSpec().with_(tx_positions=((0.0, 0.0, 0.0),), rx_positions=((0.0, 0.0, 0.0),), num_chirps=1)
    echoes = []
    for time in times.tolist():
        paths = ss.solve_paths(world.at(time), radar, ss.Pose([0.0, 0.0, 1.1]), method="sbr")
        chest = np.abs(paths.length / 2.0 - 2.35) < 0.03
        turn = np.exp(-2j * np.pi * paths.length[chest] / radar.wavelength)
        echoes.append(np.sum(paths.a[chest, 0, 0] * turn))
    phase = np.unwrap(np.angle(np.array(echoes)))
    return (phase - phase[0]) * radar.wavelength / (4.0 * np.pi)


def main() -> None:
    """Print the breath as the radar has it, and as it is."""
    with tempfile.TemporaryDirectory() as folder:
        times = np.arange(0.0, 2.0, 0.1)  # 0.8 mm at most in a step, where 0.97 mm turn the phase half way round
        found = breathing(Path(folder), times)
    for time, one in zip(times, found, strict=True):
        print(
            f"{time:.1f} s: {1e3 * one:6.2f} mm, made with {1e3 * BREATH * np.sin(2.0 * np.pi * BREATHS * time):6.2f}"
        )


if __name__ == "__main__":
    main()
