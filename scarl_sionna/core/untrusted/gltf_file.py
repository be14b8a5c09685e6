"""glTF 2.0: its tables, checked, and the arrays that its accessors name, within the bytes that are there."""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt
from pydantic import Field

from .checked import Number, Table, Text, checked
from .files import MEGABYTE, read_bytes
from .json_text import parse_json

MOST_BYTES = 500 * MEGABYTE
"""Largest file, and largest buffer beside it."""
_MAGIC, _JSON, _BINARY = 0x46546C67, 0x4E4F534A, 0x004E4942
_COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_SCALES = {"i1": 127.0, "u1": 255.0, "<i2": 32767.0, "<u2": 65535.0}
"""Largest value of the integers that may stand for 0 to 1."""

_Index = int
RowT = TypeVar("RowT")


class _Buffer(Table):
    size: int = Field(alias="byteLength", ge=1)
    uri: str | None = None


class _View(Table):
    buffer: _Index = Field(ge=0)
    offset: int = Field(0, alias="byteOffset", ge=0)
    size: int = Field(alias="byteLength", ge=1)
    stride: int | None = Field(None, alias="byteStride", ge=4, le=252)


class _Accessor(Table):
    view: _Index | None = Field(None, alias="bufferView", ge=0)
    offset: int = Field(0, alias="byteOffset", ge=0)
    component: int = Field(alias="componentType")
    kind: Text = Field(alias="type")
    count: int = Field(ge=1, le=100_000_000)
    normalized: bool = False
    sparse: dict[str, Any] | None = None


class GltfNode(Table):
    """A node: its children, its place (translation [x, y, z], rotation [x, y, z, w], scale, or a matrix by columns)."""

    name: Text = ""
    children: list[_Index] = Field(default_factory=list)
    mesh: _Index | None = None
    skin: _Index | None = None
    matrix: list[Number] | None = Field(None, min_length=16, max_length=16)
    translation: list[Number] = Field([0.0, 0.0, 0.0], min_length=3, max_length=3)
    rotation: list[Number] = Field([0.0, 0.0, 0.0, 1.0], min_length=4, max_length=4)
    scale: list[Number] = Field([1.0, 1.0, 1.0], min_length=3, max_length=3)
    weights: list[Number] | None = None


class GltfSkin(Table):
    """A skin: its joints as nodes, and the accessor of their inverse bind matrices."""

    joints: list[_Index] = Field(min_length=1, max_length=10_000)
    inverse_bind: _Index | None = Field(None, alias="inverseBindMatrices")


class GltfPrimitive(Table):
    """Triangles of one material: accessors by attribute."""

    attributes: dict[str, _Index]
    indices: _Index | None = None
    material: _Index | None = None
    mode: int = 4
    targets: list[dict[str, _Index]] = Field(default_factory=list)


class _Mesh(Table):
    name: Text = ""
    primitives: list[GltfPrimitive] = Field(min_length=1)
    weights: list[Number] | None = None


class _Sampler(Table):
    input: _Index
    output: _Index
    interpolation: Text = "LINEAR"


class _Target(Table):
    node: _Index | None = None
    path: Text


class _Channel(Table):
    sampler: _Index
    target: _Target


class GltfAnimation(Table):
    """A clip: channels, each a sampler and what it moves."""

    name: Text = ""
    channels: list[_Channel]
    samplers: list[_Sampler]


class _TextureInfo(Table):
    index: _Index
    coordinates: int = Field(0, alias="texCoord", ge=0, le=7)


class _Pbr(Table):
    color: list[Number] | None = Field(None, alias="baseColorFactor")
    texture: _TextureInfo | None = Field(None, alias="baseColorTexture")


class _Texture(Table):
    source: _Index | None = None


class _Image(Table):
    uri: str | None = None
    view: _Index | None = Field(None, alias="bufferView", ge=0)


class GltfMaterial(Table):
    """A material: its name, its colour and the texture of that."""

    name: Text = ""
    pbr: _Pbr = Field(default_factory=_Pbr, alias="pbrMetallicRoughness")


class GltfTables(Table):
    """What stands in a glTF file, as far as it is read."""

    required: list[Text] = Field(default_factory=list, alias="extensionsRequired")
    buffers: list[_Buffer] = Field(default_factory=list)
    views: list[_View] = Field(default_factory=list, alias="bufferViews")
    accessors: list[_Accessor] = Field(default_factory=list)
    nodes: list[GltfNode] = Field(default_factory=list, max_length=100_000)
    meshes: list[_Mesh] = Field(default_factory=list)
    skins: list[GltfSkin] = Field(default_factory=list)
    animations: list[GltfAnimation] = Field(default_factory=list)
    materials: list[GltfMaterial] = Field(default_factory=list)
    textures: list[_Texture] = Field(default_factory=list)
    images: list[_Image] = Field(default_factory=list)


@dataclass(frozen=True, eq=False)
class GltfFile:
    """A glTF file: its tables, its buffers and where it lies."""

    tables: GltfTables
    text: dict[str, Any]
    buffers: tuple[bytes, ...]
    path: Path

    def array(self, number: int, kind: str) -> npt.NDArray[np.float64]:
        """Return the values of an accessor, integers that stand for 0 to 1 as such.

        Parameters
        ----------
        number : int
            Of the accessor.
        kind : str
            What it has to be: ``"SCALAR"``, ``"VEC2"``, ``"VEC3"``, ``"VEC4"`` or ``"MAT4"``.

        Returns
        -------
        ndarray of float64, shape (count, width)

        Raises
        ------
        ValueError
            If it is not there, of another kind, not finite, or reaches beyond its buffer.
        """
        accessor = _at(self.tables.accessors, number, "accessor")
        if accessor.kind != kind or accessor.component not in _COMPONENTS:
            raise ValueError(f"accessor {number} is {accessor.kind} of type {accessor.component}, {kind} is needed")
        if accessor.sparse is not None or accessor.view is None:
            raise ValueError(f"accessor {number} is sparse or has no bytes, which is not read")
        view = _at(self.tables.views, accessor.view, "bufferView")
        data = _at(self.buffers, view.buffer, "buffer")
        kind_of_one, width = np.dtype(_COMPONENTS[accessor.component]), _WIDTHS[kind]
        row = kind_of_one.itemsize * width
        stride = view.stride or row
        last = accessor.offset + stride * (accessor.count - 1) + row
        if stride < row or last > view.size or view.offset + view.size > len(data):
            raise ValueError(f"accessor {number} reaches beyond its bytes")
        rows: npt.NDArray[Any] = np.ndarray(
            (accessor.count, width), kind_of_one, data, view.offset + accessor.offset, (stride, kind_of_one.itemsize)
        )
        values = rows.astype(np.float64)
        if accessor.normalized and kind_of_one.kind != "f":
            values = np.maximum(values / _SCALES.get(_COMPONENTS[accessor.component], 1.0), -1.0)
        if not np.isfinite(values).all():
            raise ValueError(f"accessor {number} has values that are not finite")
        return values

    def image(self, texture: int) -> bytes | None:
        """Return the bytes of a texture's image; None where the file states none that is read.

        Raises
        ------
        ValueError
            If it is not there, or not within its bytes or beside the file.
        InputFileError, OSError
            If a file of an image is too large or cannot be opened.
        """
        source = _at(self.tables.textures, texture, "texture").source
        if source is None:
            return None
        image = _at(self.tables.images, source, "image")
        if image.view is not None:
            view = _at(self.tables.views, image.view, "bufferView")
            data = _at(self.buffers, view.buffer, "buffer")
            if view.offset + view.size > len(data):
                raise ValueError(f"image {source} reaches beyond its bytes")
            return data[view.offset : view.offset + view.size]
        return None if image.uri is None else _bytes_of(self.path, image.uri, f"image {source}")

    def packed(self) -> bytes:
        """Return the same as one binary file (``.glb``) without references to others."""
        text = dict(self.text)
        starts = np.cumsum([0, *(-(-len(data) // 4) * 4 for data in self.buffers)]).tolist()
        views = zip(self.text.get("bufferViews", []), self.tables.views, strict=True)
        text["bufferViews"] = [
            {**view, "buffer": 0, "byteOffset": starts[known.buffer] + known.offset} for view, known in views
        ]
        body = b"".join(data + b"\0" * (-len(data) % 4) for data in self.buffers)
        text["buffers"] = [{"byteLength": len(body)}]
        head = json.dumps(text, separators=(",", ":")).encode()
        head += b" " * (-len(head) % 4)
        chunks = struct.pack("<II", len(head), _JSON) + head + struct.pack("<II", len(body), _BINARY) + body
        return struct.pack("<III", _MAGIC, 2, 12 + len(chunks)) + chunks


def _at(rows: Sequence[RowT], number: int, what: str) -> RowT:
    if not 0 <= number < len(rows):
        raise ValueError(f"{what} {number} is not there, there are {len(rows)}")
    return rows[number]


def read_gltf(path: Path) -> GltfFile:
    """Return a ``.glb`` or ``.gltf`` file with its buffers.

    Raises
    ------
    ValueError
        If it is cut, damaged, of another version, compressed, or names buffers outside of its folder.
    InputFileError
        If a file is no regular one, or too large.
    OSError
        If a file cannot be opened.
    """
    data = read_bytes(path, MOST_BYTES)
    head, binary = _chunks(data) if data[:4] == b"glTF" else (data, None)
    text = parse_json(head)
    tables = checked(GltfTables, text)
    if unread := [name for name in tables.required if name in _COMPRESSED]:
        raise ValueError(f"it needs the extension {unread[0]}, which is not read; export it without compression")
    buffers = tuple(_buffer(path, buffer, binary) for buffer in tables.buffers)
    for number, view in enumerate(tables.views):
        _at(buffers, view.buffer, f"the buffer of bufferView {number},")
    return GltfFile(tables, text, buffers, path)


_COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_mesh_quantization")


def _chunks(data: bytes) -> tuple[bytes, bytes | None]:
    """Return the JSON and the binary chunk of a ``.glb`` file."""
    if len(data) < 20:
        raise ValueError("it is cut")
    _, version, _ = struct.unpack_from("<III", data)
    if version != 2:
        raise ValueError(f"it has version {version} of glTF, 2 is read")
    found: dict[int, bytes] = {}
    start = 12
    while start + 8 <= len(data):
        size, kind = struct.unpack_from("<II", data, start)
        if start + 8 + size > len(data):
            raise ValueError("it is cut")
        found.setdefault(kind, data[start + 8 : start + 8 + size])
        start += 8 + size
    if _JSON not in found:
        raise ValueError("it has no JSON")
    return found[_JSON], found.get(_BINARY)


def _buffer(path: Path, buffer: _Buffer, binary: bytes | None) -> bytes:
    data = (binary or b"") if buffer.uri is None else _bytes_of(path, buffer.uri, "buffer")
    if len(data) < buffer.size:
        raise ValueError(f"a buffer has {len(data)} bytes, it states {buffer.size}")
    return data[: buffer.size]


def _bytes_of(path: Path, uri: str, what: str) -> bytes:
    """Return what a URI names: bytes within it, or a file beside the glTF."""
    if uri.startswith("data:"):
        try:
            return base64.b64decode(uri.partition("base64,")[2], validate=True)
        except binascii.Error as error:
            raise ValueError(f"a {what} is no base64 ({error})") from error
    name = Path(unquote(uri))
    if name.is_absolute() or ".." in name.parts or ":" in uri:
        raise ValueError(f"{what} '{uri[:60]}' is not beside the file")
    return read_bytes(path.parent / name, MOST_BYTES)
