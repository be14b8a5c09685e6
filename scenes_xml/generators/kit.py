"""Kit of a scene's builder.

Collects shapes, what they are, lanes and actors, and writes the XML, meshes, textures and scene.toml.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .geometry import mesh
from .geometry.mesh import Array, Mesh
from .scene_toml import ActorEntry, Instance, Lane, Parking, scene_toml
from .surfaces import images
from .surfaces.palette import PALETTE
from .xml import Bsdf, Placement, scene_xml

Vector = tuple[float, float, float]
DETAILS = ("detailed", "light")


def head(origin: Vector = (2.35, 0.0, 0.8), target: Vector = (12.35, 0.0, 0.8)) -> tuple[str, str, str]:
    """Return integrator, default view [m, world] and sky of a scene's XML.

    Without a change, the view of a front sensor at +x.
    """
    start, end = (", ".join(f"{value:g}" for value in place) for place in (origin, target))
    return (
        '\t<integrator type="path">\n\t\t<integer name="max_depth" value="6"/>\n\t</integrator>',
        '\t<sensor type="perspective" id="front_view">\n'
        '\t\t<float name="fov" value="90"/>\n\t\t<string name="fov_axis" value="x"/>\n'
        '\t\t<float name="near_clip" value="0.05"/>\n\t\t<float name="far_clip" value="10000"/>\n'
        f'\t\t<transform name="to_world">\n\t\t\t<lookat origin="{start}" target="{end}" up="0, 0, 1"/>\n'
        "\t\t</transform>\n"
        '\t\t<sampler type="independent">\n\t\t\t<integer name="sample_count" value="64"/>\n\t\t</sampler>\n'
        '\t\t<film type="hdrfilm">\n\t\t\t<integer name="width" value="960"/>\n\t\t\t<integer name="height" '
        'value="540"/>\n'
        '\t\t\t<rfilter type="gaussian"/>\n\t\t</film>\n\t</sensor>',
        '\t<emitter type="sunsky" id="sky">\n\t\t<vector name="sun_direction" x="-0.42" y="0.70" z="0.58"/>\n'
        '\t\t<float name="turbidity" value="3.2"/>\n\t\t<float name="albedo" value="0.2"/>\n'
        '\t\t<float name="sun_scale" value="2"/>\n\t\t<float name="sky_scale" value="2"/>\n\t</emitter>',
    )


class Writer:
    """Collects shapes and writes each mesh once."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.placements: list[Placement] = []
        (folder / "meshes").mkdir(parents=True, exist_ok=True)
        (folder / "textures").mkdir(exist_ok=True)
        for old in (folder / "meshes").glob("*.ply"):
            old.unlink()

    def mesh(self, name: str, part: Mesh, crease_deg: float = 35.0) -> str:
        """Write a mesh and return its file name."""
        mesh.write_ply(mesh.finish(part, crease_deg), self.folder / "meshes" / f"{name}.ply")
        return f"{name}.ply"

    def add(self, shape: str, part: Mesh, bsdf: str, crease_deg: float = 35.0) -> None:
        """Write a mesh in world coordinates and add it as a shape."""
        self.placements.append(Placement(shape, self.mesh(shape, part, crease_deg), bsdf))


@dataclass(frozen=True)
class Prefab:
    """A thing to be placed many times: file and material of each part."""

    files: Mapping[str, str]
    bsdfs: Mapping[str, str]


@dataclass
class SceneKit:
    """Everything that a scene's builder collects; `write` makes the files.

    Parameters
    ----------
    folder : Path
        Where the files go; meshes that lie there are removed.
    table : mapping
        The table ``[scene]`` of the scene.toml; its `name` is the name of the XML.
    detail : str
        ``detailed`` or ``light``.
    seed : int
        Seed of the textures.
    """

    folder: Path
    table: Mapping[str, Any]
    detail: str = "detailed"
    seed: int = 0
    view: tuple[Vector, Vector] = ((2.35, 0.0, 0.8), (12.35, 0.0, 0.8))
    materials: dict[str, Bsdf] = field(default_factory=lambda: dict(PALETTE))
    textures: dict[str, Callable[[int], Any]] = field(default_factory=lambda: dict(images.IMAGES))
    instances: list[Instance] = field(default_factory=list)
    actors: list[ActorEntry] = field(default_factory=list)
    lanes: list[Lane] = field(default_factory=list)
    parking: list[Parking] = field(default_factory=list)
    signals: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_detail(self.detail)
        self.writer = Writer(self.folder)

    @property
    def is_light(self) -> bool:
        """Whether few shapes and triangles are asked for."""
        return self.detail == "light"

    def add(self, shape: str, part: Mesh, bsdf: str, crease_deg: float = 35.0) -> None:
        """Write a mesh in world coordinates and add it as a shape; an `instance` must name it."""
        self.writer.add(shape, part, bsdf, crease_deg)

    def instance(
        self,
        name: str,
        semantic: str,
        shapes: Sequence[str] = (),
        is_object: bool = False,
        signal: str | None = None,
    ) -> None:
        """Say what shapes are: patterns of their ids, by default ``<name>_*``; `signal` switches their lamps."""
        self.instances.append(Instance(name, semantic, tuple(shapes) or (f"{name}_*",), is_object, signal))

    def slim(self, parts: Mapping[str, Mesh], *joined: str) -> dict[str, Mesh]:
        """Return parts as they are, or at the light level with those named `joined` as one, under the last name."""
        if not self.is_light:
            return dict(parts)
        body = mesh.merge([Mesh(parts[name].vertices, parts[name].faces) for name in joined])
        return {name: part for name, part in parts.items() if name not in joined} | {joined[-1]: body}

    def prefab(
        self, prefix: str, parts: Mapping[str, Mesh], bsdfs: Mapping[str, str], crease_deg: float = 40.0
    ) -> Prefab:
        """Write the parts of a thing once, and return what `place` needs; `bsdfs` names the material of each part."""
        return Prefab(
            {part: self.writer.mesh(f"{prefix}_{part}", body, crease_deg) for part, body in parts.items()}, bsdfs
        )

    def place(
        self,
        thing: Prefab,
        name: str,
        semantic: str,
        where: Sequence[float] | Array,
        yaw_deg: float = 0.0,
        scale: float = 1.0,
        is_object: bool = True,
        signal: str | None = None,
        **bsdfs: str,
    ) -> None:
        """Place a copy as an instance of its own, foot at `where` [m, world].

        `bsdfs` replaces the material of a part; `signal` is the group of lights that switches its lamps.
        """
        x, y, z = (round(float(value), 4) for value in where)
        chosen = {**thing.bsdfs, **bsdfs}
        for part, file in thing.files.items():
            self.writer.placements.append(
                Placement(f"{name}_{part}", file, chosen[part], round(float(yaw_deg), 4), (x, y, z), scale)
            )
        self.instance(name, semantic, [f"{name}_{part}" for part in thing.files], is_object, signal)

    def copies(
        self,
        name: str,
        semantic: str,
        parts: Mapping[str, Mesh],
        bsdfs: Mapping[str, str],
        places: Sequence[tuple[Vector, float, float]],
    ) -> None:
        """Add copies of a thing (place [m], yaw [deg], scale) as one instance of few shapes, for the light level."""
        crease = 60.0 if semantic == "Vegetation" else 40.0
        for part, body in parts.items():
            placed = [body.moved(where, np.radians(yaw), scale) for where, yaw, scale in places]
            self.add(f"{name}_{part}", mesh.merge(placed), bsdfs[part], crease)
        self.instance(name, semantic)

    def actor(
        self,
        name: str,
        model: str,
        times: Array,
        positions: Array,
        variant: str | None = None,
        yaw_deg: Array | None = None,
        detail: str | None = None,
    ) -> None:
        """Add an actor by the name of its model, with waypoints at `times` [s], shape (n, 3) [m].

        Models are those of scenes_xml/actors.
        """
        entry = ActorEntry(name, "", times, np.asarray(positions), yaw_deg, model=model, variant=variant, detail=detail)
        self.actors.append(entry)

    def parked(self, name: str, model: str, place: Parking, variant: str | None = None) -> None:
        """Add an actor that stands in a parking place."""
        position = np.array([place.position], float)
        self.actor(name, model, np.zeros(1), position, variant, np.array([place.yaw_deg]))

    def write(self, script: str | None = None) -> None:
        """Write textures, XML and scene.toml; materials and textures that nothing uses are left out."""
        name = str(self.table["name"])
        script = script or f"scenes_xml/{name}/build.py"
        used = {p.bsdf for p in self.writer.placements}
        bsdfs = {key: bsdf for key, bsdf in self.materials.items() if key in used}
        if unknown := used - set(bsdfs):
            raise KeyError(f"no material {sorted(unknown)} in the palette of scene {name!r}")
        files = sorted({file for b in bsdfs.values() for file in (b.texture, b.puddles) if file})
        for old in (self.folder / "textures").glob("*.png"):
            old.unlink()
        for file in files:
            images.save(self.folder / "textures" / file, self.textures[file](self.seed))
        comment = f"{name}: written by {script}; do not edit"
        text = scene_xml(comment, head(*self.view), bsdfs, self.writer.placements)
        (self.folder / f"{name}.xml").write_text(text, encoding="utf-8", newline="\n")
        toml = scene_toml(
            self.table, bsdfs, self.instances, self.actors, lanes=self.lanes, parking=self.parking, signals=self.signals
        )
        (self.folder / "scene.toml").write_text(toml, encoding="utf-8", newline="\n")


def check_detail(detail: str) -> None:
    """Raise ValueError unless `detail` is one of `DETAILS`."""
    if detail not in DETAILS:
        raise ValueError(f"detail is {detail!r}; allowed are {' and '.join(DETAILS)}")
