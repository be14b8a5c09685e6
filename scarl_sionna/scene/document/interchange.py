"""What other programs write into a Mitsuba XML, as the plain shapes and BSDFs that a scene is made of here.

Parts in other files, instances of a group, BSDFs and textures that are referred to, lights without a surface, y up.
"""

from __future__ import annotations

import copy
import warnings
import xml.etree.ElementTree as ET
from contextlib import suppress
from pathlib import Path

import numpy as np

from scarl_sionna.core.errors import InputFileError, ParameterRangeError, ScarlWarning, SceneError
from scarl_sionna.core.untrusted.xml_text import read_xml

from .analytic import linear_part

UPS = ("y", "z")
"""Axes that may point up."""
_DEEPEST = 8
_MOST_INSTANCES = 100_000
_SKEWED = 0.7
"""Share of an axis in a camera's up from which on it counts as up."""


def included(root: ET.Element, path: Path, depth: int = 0) -> None:
    """Put the content of ``<include filename=...>`` in its place; names of files count from the whole scene's folder.

    Raises
    ------
    SceneError
        If a file is missing, cannot be read, is no scene, or includes others more than `_DEEPEST` deep.
    """
    for element in root.findall("include"):
        file = path.parent / str(element.get("filename"))
        if depth >= _DEEPEST:
            raise SceneError(f"files include each other more than {_DEEPEST} deep at '{file.name}'", path)
        try:
            part = read_xml(file)
        except InputFileError as error:
            raise SceneError(f"included file '{element.get('filename')}': {error.strerror}", path) from error
        except OSError as error:
            raise SceneError(
                f"included file '{element.get('filename')}' cannot be read ({error.strerror})",
                path,
                f"expected it at {file}",
            ) from error
        if part.tag != "scene":
            raise SceneError(f"the root of included file '{file.name}' is <{part.tag}>, not <scene>", path)
        included(part, path, depth + 1)
        place = list(root).index(element)
        root.remove(element)
        for number, child in enumerate(part):
            root.insert(place + number, child)


def with_plain_shapes(root: ET.Element, path: Path) -> None:
    """Put shapes of its own in the place of each instance of a group, and leave out shapes that only shine.

    The shapes of the n-th instance of a group are named ``<group>-<n>``, with the member's name where it has several.

    Raises
    ------
    SceneError
        If an instance names no group, or there are more than 100,000.

    Warns
    -----
    ScarlWarning
        If shapes with a BSDF of type ``null`` are left out: no surface is there, for no sensor.
    """
    groups = {str(shape.get("id")): shape for shape in root.findall("shape") if shape.get("type") == "shapegroup"}
    for group in groups.values():
        root.remove(group)
    instances = [shape for shape in root.findall("shape") if shape.get("type") == "instance"]
    if len(instances) > _MOST_INSTANCES:
        raise SceneError(f"has {len(instances)} instances, more than {_MOST_INSTANCES}", path, "export fewer")
    made: dict[str, int] = {}
    for shape in instances:
        named = str(next((child.get("id") for child in shape if child.tag == "ref"), None))
        if named not in groups:
            raise SceneError(f"instance '{shape.get('id')}' names the group '{named}', which is not there", path)
        made[named] = made.get(named, 0) + 1
        place = list(root).index(shape)
        root.remove(shape)
        for k, own in enumerate(_copies(groups[named], shape, f"{named}-{made[named]}")):
            root.insert(place + k, own)
    bodiless = [shape for shape in root.findall("shape") if _is_null(shape, root)]
    for shape in bodiless:
        root.remove(shape)
    if bodiless:
        warnings.warn(
            f"{path.name}: shapes whose BSDF is 'null' have no surface and are left out with their light: "
            f"{', '.join(str(shape.get('id')) for shape in bodiless[:5])}; state a [lighting] in a scene.toml",
            ScarlWarning,
            stacklevel=4,
        )


def _copies(group: ET.Element, instance: ET.Element, name: str) -> list[ET.Element]:
    """Return the shapes of a group where an instance has them."""
    members = group.findall("shape")
    steps = [step for child in instance.findall("transform") for step in child]
    found = []
    for k, member in enumerate(members):
        own = copy.deepcopy(member)
        own.set("id", name if len(members) == 1 else f"{name}-{member.get('id') or member.get('name') or k}")
        _append(own, [copy.deepcopy(step) for step in steps])
        found.append(own)
    return found


def _append(element: ET.Element, steps: list[ET.Element]) -> None:
    """Add steps at the end of an element's ``to_world``."""
    transform = next((child for child in element if child.get("name") == "to_world"), None)
    if transform is None:
        transform = ET.SubElement(element, "transform", {"name": "to_world"})
    transform.extend(steps)


def _is_null(shape: ET.Element, root: ET.Element) -> bool:
    for child in shape:
        if child.tag == "bsdf":
            return child.get("type") == "null"
        if child.tag == "ref":
            named = (one for one in root.findall("bsdf") if one.get("id") == child.get("id"))
            return any(one.get("type") == "null" for one in named)
    return False


def with_own_parts(root: ET.Element, path: Path) -> None:
    """Put copies in the place of references inside BSDFs to other BSDFs and textures of the scene.

    Raises
    ------
    SceneError
        If one is not there, or they refer to each other.
    """
    known = {str(one.get("id")): one for one in root if one.tag in ("bsdf", "texture") and one.get("id")}
    for bsdf in [*root.findall("bsdf"), *(one for shape in root.findall("shape") for one in shape.findall("bsdf"))]:
        _inline(bsdf, known, path, 0)


def _inline(element: ET.Element, known: dict[str, ET.Element], path: Path, depth: int) -> None:
    for place, child in enumerate(list(element)):
        if child.tag == "ref":
            name = str(child.get("id"))
            if name not in known:
                raise SceneError(f"'{name}', to which a BSDF refers, is not there", path)
            if depth >= _DEEPEST:
                raise SceneError(f"BSDFs refer to each other more than {_DEEPEST} deep at '{name}'", path)
            own = copy.deepcopy(known[name])
            del own.attrib["id"]
            if child.get("name"):
                own.set("name", str(child.get("name")))
            element.remove(child)
            element.insert(place, own)
            _inline(own, known, path, depth + 1)
        elif child.tag in ("bsdf", "texture"):
            _inline(child, known, path, depth)


def upright(root: ET.Element, up: object, path: Path) -> None:
    """Turn shapes and lights of a scene whose +y is up, so that +z is.

    Parameters
    ----------
    root : Element
    up : object
        ``"y"`` or ``"z"``; None: not stated, read as z.
    path : Path

    Raises
    ------
    ParameterRangeError
        If it is another axis.

    Warns
    -----
    ScarlWarning
        If it is not stated, and the file's cameras have +y up.
    """
    if up is None:
        if _camera_up(root, path) == "y":
            warnings.warn(
                f'{path.name}: its cameras have +y up, and it is read with +z up; state up = "y" below [scene] in a '
                "scene.toml beside it, or export it with z up",
                ScarlWarning,
                stacklevel=4,
            )
        return
    if up not in UPS:
        raise ParameterRangeError("up of [scene]", repr(up), "'y' or 'z'")
    if up == "z":
        return
    for element in [*root.findall("shape"), *root.findall("emitter")]:
        for child in element:
            if child.tag in ("point", "vector") and element.tag != "shape":
                x, y, z = (float(value) for value in _components(child))
                child.attrib = {"name": str(child.get("name")), "x": repr(x), "y": repr(-z), "z": repr(y)}
        has_place = any(child.get("name") == "to_world" for child in element)
        if has_place or element.tag == "shape" or element.get("type") == "envmap":
            _append(element, [ET.Element("rotate", {"x": "1", "angle": "90"})])


def _components(element: ET.Element) -> list[str]:
    if (value := element.get("value")) is not None:
        return value.replace(",", " ").split()
    return [element.get(axis, "0") for axis in "xyz"]


def _camera_up(root: ET.Element, path: Path) -> str:
    """Return the axis that is up for the cameras of a scene, empty where they do not tell."""
    total = np.zeros(3)
    for sensor in root.findall("sensor"):
        for transform in sensor.findall("transform"):
            with suppress(SceneError):  # a camera of the file takes no part
                up = linear_part(transform, path)[:, 1]
                total += up / max(float(np.linalg.norm(up)), 1e-12)
    length = float(np.linalg.norm(total))
    if not length > 1e-6:
        return ""
    return next((axis for axis, share in zip("xyz", total / length, strict=True) if share > _SKEWED), "")
