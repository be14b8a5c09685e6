"""Builds a map's scene as files: XML, scene.toml, meshes, textures, like the places of the package."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely

from scarl_sionna.scene.lanes import LaneNetwork
from scenes_xml.generators.geometry.mesh import Mesh, merge
from scenes_xml.generators.kit import SceneKit
from scenes_xml.generators.scene_toml import Lane as LaneEntry
from scenes_xml.generators.surfaces import interior, urban
from scenes_xml.generators.surfaces.palette import PALETTE

from ..geometry.decks import with_decks
from ..geometry.road import RoadShape
from ..model import Array, Finding, MapObject, StreetMap
from ..network.lanes import street_lanes
from ..surroundings.add import surroundings
from ..surroundings.lanes import with_kerbs
from ..surroundings.roadway import add_roadway
from . import structures
from .areas import paved_areas
from .buildings import building_meshes, building_plan
from .ground import GroundFrame, ground_sheets
from .heights import GroundHeight
from .marks import road_marks
from .objects import add_objects
from .signs import add_signals
from .surfaces import Piece, lane_pieces

TOLERANCE = {"detailed": 0.004, "light": 0.009}
"""Largest distance of a chord from the border that it stands for, by level [m]."""
BLOCK = 250.0
"""Surfaces of one material are one mesh in squares of this side [m]."""
FARTHEST = 5000.0
"""A map whose middle is farther from the origin is moved there [m]: meshes are single precision."""
_PAINTS = {
    "line_blue": (0.03, 0.10, 0.45), "line_green": (0.03, 0.30, 0.08), "line_red": (0.45, 0.03, 0.03),
    "line_orange": (0.70, 0.22, 0.02), "line_black": (0.02, 0.02, 0.02), "line_violet": (0.22, 0.05, 0.40),
}  # fmt: skip # a table


def scene_name(stem: str) -> str:
    """Return the name of a map's scene: that of its file, in letters, digits, dashes and underscores."""
    return re.sub(r"[^A-Za-z0-9_\-]", "_", stem) or "map"


def build_scene(street: StreetMap, folder: Path, detail: str = "detailed", variant: int = 0) -> None:
    """Write a map's scene into a folder.

    Parameters
    ----------
    street : StreetMap
    folder : Path
        Gets ``<name>.xml`` and ``scene.toml``, whose table ``[scene]`` lists the `findings`, with `meshes` and
        `textures`.
    detail : str
        ``detailed`` or ``light``.
    variant : int
        0: what the map states. Any other number is the seed of kerbs, verges, furniture, trees and houses where it
        states none.
    """
    if variant:
        street = with_kerbs(street)
    street, shift = centred(street)
    shapes = {name: RoadShape(road) for name, road in street.roads.items()}
    findings = list(street.findings)
    if np.any(shift):
        findings.append(Finding(1, f"the map is moved by x = {-shift[0]:.0f} m, y = {-shift[1]:.0f} m"))
    street = with_decks(street, shapes, findings)
    kit = SceneKit(folder, {"name": scene_name(street.name)}, detail)
    kit.materials |= interior.MATERIALS | urban.MATERIALS
    kit.materials |= {name: replace(kit.materials["line_white"], color=color) for name, color in _PAINTS.items()}
    kit.materials["paving"] = PALETTE["paving"]
    kit.textures |= interior.IMAGES | urban.IMAGES
    pieces = lane_pieces(street, shapes, TOLERANCE[detail])
    height = _add_surfaces(kit, street, pieces)
    _add_marks(kit, street, shapes, findings)
    _add_structures(kit, pieces, height)
    parking = add_objects(kit, street, shapes, GroundFrame(height), findings)
    network, lights, problems = street_lanes(street, shapes)
    findings += problems
    heads = add_signals(kit, street, shapes, lights, findings)
    if variant:
        _add_rows(kit, surroundings(kit, street, shapes, pieces, height, variant).rows, "beside_")
        _add_rows(kit, add_roadway(street, shapes, network, TOLERANCE[detail], variant), "roadway_")
    kit.parking += parking
    kit.lanes += [_entry(network, name) for name in (lane.name for lane in network.lanes)]
    if network.signals is not None:
        kit.signals |= {"cycle": network.signals.cycle, "green": dict(network.signals.green)}
    findings.sort(key=lambda finding: finding.line)
    kit.table = {
        "name": scene_name(street.name),
        "title": street.name,
        "source": street.source,
        "detail": detail,
        "variant": variant,
        "shift": [float(value) for value in shift],
        "findings": _distinct(findings),
    }
    if heads:
        kit.table = {**kit.table, "heads": [[light, head] for light, head in heads.items()]}
    if street.licence:
        kit.table = {**kit.table, "licence": street.licence}
    if network.lanes:
        start, heading = network.lanes[0].points[0], network.lanes[0].end_headings[0]
        eye = start + [0.0, 0.0, 1.5]
        target = eye + 10.0 * np.array([np.cos(heading), np.sin(heading), 0.0])
        kit.view = (tuple(eye.tolist()), tuple(target.tolist()))
    kit.write("scarl_sionna/scene/streets/building/scene.py")


def centred(street: StreetMap) -> tuple[StreetMap, np.ndarray]:
    """Return a map moved by whole kilometres so that its middle is near the origin, and the shift that was taken."""
    places = np.array([(piece.x, piece.y) for road in street.roads.values() for piece in road.plan])
    middle = 0.5 * (places.min(0) + places.max(0))
    shift = np.round(middle / 1000.0) * 1000.0 if np.abs(middle).max() > FARTHEST else np.zeros(2)
    if not shift.any():
        return street, shift
    roads = {
        name: replace(
            road, plan=tuple(replace(piece, x=piece.x - shift[0], y=piece.y - shift[1]) for piece in road.plan)
        )
        for name, road in street.roads.items()
    }
    areas = tuple(replace(one, rings=tuple(ring - shift for ring in one.rings)) for one in street.areas)
    buildings = tuple(replace(one, rings=tuple(ring - shift for ring in one.rings)) for one in street.buildings)
    objects = tuple(_moved(one, shift) for one in street.objects)
    return replace(street, roads=roads, areas=areas, buildings=buildings, objects=objects), shift


def _moved(thing: MapObject, shift: Array) -> MapObject:
    """Return an object of no road, moved."""
    outlines = tuple(
        replace(one, corners=tuple(replace(c, a=c.a - shift[0], b=c.b - shift[1]) for c in one.corners))
        for one in thing.outlines
    )
    return replace(thing, s=thing.s - shift[0], t=thing.t - shift[1], outlines=outlines)


def _entry(network: LaneNetwork, name: str) -> LaneEntry:
    lane = network[name]
    return LaneEntry(
        lane.name, lane.points, lane.kind, lane.width, lane.speed, lane.next, lane.left, lane.yield_to, lane.signal
    )


def _distinct(findings: Sequence[Finding]) -> list[str]:
    """Return findings as texts, those of one wording once."""
    first: dict[str, list[int]] = {}
    for finding in findings:
        first.setdefault(finding.text, []).append(finding.line)
    return [
        (f"line {lines[0]}: " if lines[0] else "")
        + text
        + (f" (and on {len(lines) - 1} more lines)" if len(lines) > 1 else "")
        for text, lines in first.items()
    ]


def _add_surfaces(kit: SceneKit, street: StreetMap, pieces: Sequence[Piece]) -> GroundHeight:
    parts: defaultdict[tuple[str, str, int, int], list[Mesh]] = defaultdict(list)
    for piece in pieces:
        parts[(piece.semantic, piece.material, *_block(piece.mesh))].append(piece.mesh)
    for kerb in structures.kerbs(pieces):
        parts[("SideWalks", "kerb_stone", *_block(kerb))].append(kerb)
    paved = list(paved_areas(pieces, street.areas))
    for one in paved:
        parts[(one.area.semantic, one.area.material, *_block(one.surface))].append(one.surface)
        for kerb in one.kerbs:
            parts[("SideWalks", "kerb_stone", *_block(kerb))].append(kerb)
    sheets, height = ground_sheets(pieces, paved, [building_plan(one) for one in street.buildings])
    for sheet in sheets:
        parts[("Terrain", "lawn", *_block(sheet))].append(sheet)
    for semantic, material, mesh in building_meshes(street.buildings, height, kit.is_light):
        parts[(semantic, material, *_block(mesh))].append(mesh)
    _add_blocks(kit, parts)
    return height


def _block(mesh: Mesh) -> tuple[int, int]:
    middle = mesh.vertices[:, :2].mean(0)
    return int(np.floor(middle[0] / BLOCK)), int(np.floor(middle[1] / BLOCK))


def _add_rows(kit: SceneKit, rows: Mapping[tuple[str, str], Sequence[Mesh]], prefix: str) -> None:
    """Add meshes by class and material, those of a block of the map as one."""
    parts: defaultdict[tuple[str, str, int, int], list[Mesh]] = defaultdict(list)
    for (semantic, material), meshes in rows.items():
        for mesh in meshes:
            parts[(semantic, material, *_block(mesh))].append(mesh)
    _add_blocks(kit, parts, prefix)


def _add_blocks(kit: SceneKit, parts: dict[tuple[str, str, int, int], list[Mesh]], prefix: str = "") -> None:
    """Add meshes by class, material and block of the map; each class of a block is an instance."""
    shapes: defaultdict[tuple[str, int, int], list[str]] = defaultdict(list)
    for (semantic, material, i, j), meshes in sorted(parts.items()):
        name = re.sub(r"[^a-z0-9_]", "", f"{prefix}{semantic.lower()}_{material}_{i}_{j}".replace("-", "m"))
        kit.add(name, merge(meshes), material, 25.0)
        shapes[semantic, i, j].append(name)
    for (semantic, i, j), names in shapes.items():
        kit.instance(f"{prefix}{semantic.lower()}_{i}_{j}", semantic, names)


def _add_marks(kit: SceneKit, street: StreetMap, shapes: dict[str, RoadShape], findings: list[Finding]) -> None:
    parts: defaultdict[tuple[str, str, int, int], list[Mesh]] = defaultdict(list)
    for road in street.roads.values():
        for section in road.sections:
            stations = shapes[road.id].stations(section, TOLERANCE[kit.detail])
            for material, mesh in road_marks(shapes[road.id], section, stations, findings):
                parts[("RoadLine", material, *_block(mesh))].append(Mesh(mesh.vertices, mesh.faces))
    _add_blocks(kit, parts)


def _add_structures(kit: SceneKit, pieces: Sequence[Piece], height: GroundHeight) -> None:
    ground = [piece.footprint for piece in pieces if piece.structure != "bridge"]
    taken = shapely.union_all(ground)
    looks = {
        "deck": "concrete_grey", "piers": "lining_concrete", "lining": "lining_coated", "shell": "concrete_grey",
        "lamps": "lamp_indoor",
    }  # fmt: skip # a table
    for number, (left, right) in enumerate(structures.spans(pieces, "bridge")):
        parts = structures.bridge(left, right, height, taken)
        for part, mesh in parts.items():
            kit.add(f"bridge_{number}_{part}", mesh, looks[part])
        kit.instance(f"bridge_{number}", "Bridge")
    for number, (left, right) in enumerate(structures.spans(pieces, "tunnel")):
        for part, mesh in structures.tunnel(left, right).items():
            kit.add(f"tunnel_{number}_{part}", mesh, looks[part])
        kit.instance(f"tunnel_{number}", "Wall")
