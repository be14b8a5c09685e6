"""Reads a Mitsuba XML and checks its shapes; nothing here loads geometry."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from scarl_sionna.core.errors import InputFileError, SceneError
from scarl_sionna.core.untrusted.xml_text import read_xml

from .analytic import ANALYTIC_PLUGINS, mesh_element
from .interchange import included
from .mesh_files import check_mesh

MESH_PLUGINS = ("ply", "obj", "cube")
"""Shape plugins that a scene may use: the ones that are triangle meshes."""


def parse_xml(path: Path) -> ET.Element:
    """Return the root of a Mitsuba XML; raises `SceneError`.

    Included files and defaults are put in, and file names made absolute.
    """
    if not path.is_file():
        raise SceneError("scene file not found", path, "give the name of a scene or the path of a Mitsuba XML")
    try:
        root = read_xml(path)
    except InputFileError as error:
        raise SceneError(str(error.strerror), path) from error
    except OSError as error:
        raise SceneError(f"cannot be read ({error.strerror})", path, "check its permissions") from error
    if root.tag != "scene":
        raise SceneError(f"the root element is <{root.tag}>, not <scene>", path, "give a Mitsuba 3 scene")
    included(root, path)
    _substitute_defaults(root)
    for element in root.iter("string"):
        if element.get("name") == "filename":
            file = path.parent / str(element.get("value"))
            if not file.is_file():
                raise SceneError(f"file '{element.get('value')}' is missing", path, f"expected it at {file}")
            element.set("value", str(file.resolve()))
    return root


def _substitute_defaults(root: ET.Element) -> None:
    """Replace ``$name`` by the values of ``<default name= value=>`` and drop those elements."""
    defaults = {str(element.get("name")): str(element.get("value")) for element in root.findall("default")}
    for element in root.findall("default"):
        root.remove(element)
    for element in root.iter():
        for key, value in element.attrib.items():
            for name in sorted(defaults, key=len, reverse=True):
                value = value.replace(f"${name}", defaults[name])
            element.set(key, value)


def check_shapes(root: ET.Element, path: Path) -> dict[str, ET.Element]:
    """Return the shapes by id, in file order; analytic ones become meshes in place."""
    shapes: dict[str, ET.Element] = {}
    for shape in root.findall("shape"):
        shape_id, kind = shape.get("id"), shape.get("type")
        if kind not in MESH_PLUGINS + ANALYTIC_PLUGINS:
            raise SceneError(
                f"shape '{shape_id}' is a '{kind}'; only meshes ({', '.join(MESH_PLUGINS)}) and "
                f"{', '.join(ANALYTIC_PLUGINS)} can carry radio paths",
                path,
                "export it as PLY or OBJ, or convert it to a mesh, for instance with trimesh",
            )
        if not shape_id:
            raise SceneError(f"a shape of type '{kind}' has no id", path, 'add id="..." to every shape')
        if shape_id in shapes:
            raise SceneError(f"two shapes have the id '{shape_id}'", path)
        if kind in ANALYTIC_PLUGINS:
            mesh = mesh_element(shape, path)
            shape.clear()
            shape.attrib.update(mesh.attrib)
            shape.extend(mesh)
        if kind in ("ply", "obj"):
            check_mesh(shape_id, Path(property_of(shape, "filename")), kind)
        shapes[shape_id] = shape
    if not shapes:
        raise SceneError("the scene has no shapes", path)
    return shapes


def property_of(element: ET.Element, name: str) -> str:
    """Return the value of a plugin's property, an empty text where it has none of that name."""
    for child in element:
        if child.get("name") == name:
            return str(child.get("value"))
    return ""


def bsdf_of(shape: ET.Element, path: Path) -> str:
    """Return the id of a shape's BSDF; a nested one without id gets the shape's."""
    for child in shape:
        if child.tag == "ref" and child.get("id"):
            return str(child.get("id"))
        if child.tag == "bsdf":
            if not child.get("id"):
                child.set("id", f"bsdf-{shape.get('id')}")
            return str(child.get("id"))
    raise SceneError(f"shape '{shape.get('id')}' has no BSDF", path, "refer to one with <ref id=...>")
