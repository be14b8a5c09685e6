"""The arrays of a scene as a Zarr hierarchy, also where they are members of ZIP files or behind an address."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from typing import TYPE_CHECKING

from zarr.abc.store import ByteRequest, OffsetByteRequest, RangeByteRequest, Store, SuffixByteRequest

if TYPE_CHECKING:
    from zarr.core.buffer import Buffer, BufferPrototype

ReadPart = Callable[[str, int | None, int | None], bytes]
"""Returns a file's bytes, or those from a start to a stop; raises `FileNotFoundError` where there is no such file."""


class SceneStore(Store):
    """A Zarr store that is read only.

    Parameters
    ----------
    texts : mapping of str to str
        The ``zarr.json`` files, by name relative to the scene.
    sizes : mapping of str to int
        Size of each file with chunks [bytes].
    read : callable
        Returns a part of a file with chunks.
    again : callable
        Opens the same in another process.
    """

    def __init__(
        self, texts: Mapping[str, str], sizes: Mapping[str, int], read: ReadPart, again: Callable[[], object]
    ) -> None:
        super().__init__(read_only=True)
        self._again = again
        self._texts, self._sizes, self._read = dict(texts), dict(sizes), read

    supports_writes = False
    supports_deletes = False
    supports_listing = True

    def __reduce__(self) -> tuple[Callable[[], object], tuple[()]]:
        return self._again, ()

    def __eq__(self, other: object) -> bool:
        return self is other

    def __hash__(self) -> int:
        return id(self)

    async def get(self, key: str, prototype: BufferPrototype, byte_range: ByteRequest | None = None) -> Buffer | None:
        """Return a file, or a part of it; None where there is no such file."""
        if key in self._texts:
            data = self._texts[key].encode()
            start, stop = _bounds(byte_range, len(data))
            return prototype.buffer.from_bytes(data[start:stop])
        if key not in self._sizes:
            return None
        start, stop = _bounds(byte_range, self._sizes[key])
        return prototype.buffer.from_bytes(await asyncio.to_thread(self._read, key, start, stop))

    async def get_partial_values(
        self, prototype: BufferPrototype, key_ranges: Iterable[tuple[str, ByteRequest | None]]
    ) -> list[Buffer | None]:
        """Return parts of files."""
        return list(await asyncio.gather(*(self.get(key, prototype, part) for key, part in key_ranges)))

    async def exists(self, key: str) -> bool:
        """Return whether there is such a file."""
        return key in self._texts or key in self._sizes

    async def set(self, key: str, value: Buffer) -> None:
        """Refuse to write."""
        self._check_writable()

    async def delete(self, key: str) -> None:
        """Refuse to remove."""
        self._check_writable()

    async def list(self) -> AsyncIterator[str]:
        """Yield all names."""
        for key in (*self._texts, *self._sizes):
            yield key

    async def list_prefix(self, prefix: str) -> AsyncIterator[str]:
        """Yield the names that begin with a text."""
        async for key in self.list():
            if key.startswith(prefix):
                yield key

    async def list_dir(self, prefix: str) -> AsyncIterator[str]:
        """Yield names of files and folders in a folder."""
        start = f"{prefix.rstrip('/')}/" if prefix.strip("/") else ""
        found = dict[str, None]()
        async for key in self.list_prefix(start):
            found[key[len(start) :].split("/")[0]] = None
        for name in found:
            yield name


def _bounds(part: ByteRequest | None, size: int) -> tuple[int, int]:
    """Return start and stop of a part of a file."""
    if isinstance(part, RangeByteRequest):
        return part.start, min(part.end, size)
    if isinstance(part, OffsetByteRequest):
        return part.offset, size
    if isinstance(part, SuffixByteRequest):
        return max(size - part.suffix, 0), size
    return 0, size
