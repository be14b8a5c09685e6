"""The bytes of Zarr v3 arrays: one chunk a frame, several chunks a shard file.

Written here and not by the library so that a frame can be compressed alone, in any process and any order, and a shard
is put together from finished chunks; any Zarr v3 reader opens the result.

References
----------
.. [1] Zarr core specification version 3.0; codec ``sharding_indexed`` 1.0: the chunks one after the other, then an
   index of (offset, length) as little-endian uint64 and its CRC-32C; a missing chunk is (2**64 - 1, 2**64 - 1).
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import google_crc32c
import numpy as np
import numpy.typing as npt
from numcodecs import Blosc  # type: ignore[import-untyped]

from scarl_sionna.core.errors import DatasetError
from scarl_sionna.dataset.codec import JsonValue

COMPRESSION = {"cname": "zstd", "clevel": 5, "shuffle": "bitshuffle", "blocksize": 0}
SMALL = 256
"""Chunks below this size [bytes] are not compressed."""
_MISSING = 2**64 - 1
_CRC_LENGTH = 4
_BLOSC_HEADER = 16


@dataclass(frozen=True)
class ArrayInfo:
    """Type and shape of one array of a scene, the frame's axis left out."""

    dtype: str
    shape: tuple[int, ...]
    axes: tuple[str, ...]
    attributes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def chunk_bytes(self) -> int:
        """Size of one frame's uncompressed chunk [bytes]."""
        return int(np.dtype(self.dtype).itemsize * math.prod(self.shape))

    @property
    def compressed(self) -> bool:
        """Whether chunks are compressed."""
        return self.chunk_bytes >= SMALL

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for a file."""
        return {
            "dtype": self.dtype,
            "shape": list(self.shape),
            "axes": list(self.axes),
            "attributes": dict(self.attributes),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> ArrayInfo:
        """Return the array of :meth:`to_dict`."""
        return cls(str(data["dtype"]), tuple(data["shape"]), tuple(data["axes"]), dict(data["attributes"]))


def encode_chunk(values: npt.NDArray[Any], info: ArrayInfo) -> bytes:
    """Return the chunk of one frame: little-endian values, compressed, with a CRC-32C at the end.

    Outside of the main thread the same values give the same bytes. In it, Blosc uses threads of its own and orders its
    blocks by which is ready first.
    """
    raw = np.asarray(values, dtype=np.dtype(info.dtype).newbyteorder("<"), order="C")
    if raw.shape != info.shape:
        raise ValueError(f"values of shape {raw.shape} for an array of {info.shape}")
    if info.compressed:
        codec = Blosc("zstd", COMPRESSION["clevel"], Blosc.BITSHUFFLE, typesize=raw.itemsize)
        data = bytes(codec.encode(raw.reshape(-1).view(np.uint8)))
    else:
        data = raw.tobytes()
    return data + _crc(data)


def decode_chunk(data: bytes, info: ArrayInfo) -> npt.NDArray[Any]:
    """Return the values of :func:`encode_chunk`.

    Raises
    ------
    DatasetError
        If the bytes are damaged.
    """
    body, crc = data[:-_CRC_LENGTH], data[-_CRC_LENGTH:]
    if len(data) < _CRC_LENGTH or _crc(body) != crc:
        raise DatasetError("a chunk is damaged (its checksum does not match)")
    if info.compressed:  # the size in Blosc's own header decides how much it sets aside
        head = np.frombuffer(body, dtype="<u4", count=4) if len(body) >= _BLOSC_HEADER else np.zeros(4, dtype="<u4")
        if (int(head[1]), int(head[3])) != (info.chunk_bytes, len(body)):
            raise DatasetError(f"a chunk claims {int(head[1])} bytes, it should have {info.chunk_bytes}")
        raw = Blosc().decode(body)
    else:
        raw = body
    if len(raw) != info.chunk_bytes:
        raise DatasetError(f"a chunk has {len(raw)} bytes, it should have {info.chunk_bytes}")
    values = np.frombuffer(raw, dtype=np.dtype(info.dtype).newbyteorder("<"))
    return values.astype(info.dtype, copy=False).reshape(info.shape)


def shard_index(lengths: Sequence[int | None]) -> bytes:
    """Return the index at a shard's end; `lengths` are those of the chunks in order, None where one is missing."""
    entries = np.full((len(lengths), 2), _MISSING, dtype="<u8")
    offset = 0
    for position, length in enumerate(lengths):
        if length is not None:
            entries[position] = offset, length
            offset += length
    data = entries.tobytes()
    return data + _crc(data)


def index_length(num_chunks: int) -> int:
    """Return the size of a shard's index [bytes]."""
    return 16 * num_chunks + _CRC_LENGTH


def parse_index(data: bytes, num_chunks: int) -> list[tuple[int, int] | None]:
    """Return (offset, length) of each chunk, None where one is missing.

    Raises
    ------
    DatasetError
        If the index is damaged or cut.
    """
    if len(data) != index_length(num_chunks) or _crc(data[:-_CRC_LENGTH]) != data[-_CRC_LENGTH:]:
        raise DatasetError("the index of a shard is damaged or cut")
    entries = np.frombuffer(data[:-_CRC_LENGTH], dtype="<u8").reshape(-1, 2)
    return [None if int(length) == _MISSING else (int(offset), int(length)) for offset, length in entries]


def shard_key(path: str, shard: int, info: ArrayInfo) -> str:
    """Return the name of an array's shard file."""
    return "/".join([path, "c", str(shard), *("0" for _ in info.shape)])


def array_metadata(info: ArrayInfo, num_frames: int, shard_frames: int) -> str:
    """Return the ``zarr.json`` of an array."""
    inner: list[dict[str, Any]] = [{"name": "bytes", "configuration": {"endian": "little"}}]
    if info.compressed:
        typesize = np.dtype(info.dtype).itemsize
        inner.append({"name": "blosc", "configuration": {"typesize": typesize, **COMPRESSION}})
    inner.append({"name": "crc32c"})
    sharding = {
        "chunk_shape": [1, *info.shape],
        "codecs": inner,
        "index_codecs": [{"name": "bytes", "configuration": {"endian": "little"}}, {"name": "crc32c"}],
        "index_location": "end",
    }
    document: dict[str, object] = {
        "zarr_format": 3,
        "node_type": "array",
        "shape": [num_frames, *info.shape],
        "data_type": info.dtype,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [shard_frames, *info.shape]}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "fill_value": _fill_value(info.dtype),
        "codecs": [{"name": "sharding_indexed", "configuration": sharding}],
        "dimension_names": ["frame", *info.axes],
        "attributes": dict(info.attributes),
    }
    return _json(document)


def group_metadata(attributes: Mapping[str, Any] | None = None) -> str:
    """Return the ``zarr.json`` of a group."""
    return _json({"zarr_format": 3, "node_type": "group", "attributes": dict(attributes or {})})


def _fill_value(dtype: str) -> JsonValue:
    kind = np.dtype(dtype).kind
    known: dict[str, JsonValue] = {"f": "NaN", "c": ["NaN", "NaN"], "b": False}
    return known.get(kind, 0)


def _crc(data: bytes) -> bytes:
    return int(google_crc32c.value(data)).to_bytes(_CRC_LENGTH, "little")


def _json(data: object) -> str:
    return json.dumps(data, indent=1) + "\n"
