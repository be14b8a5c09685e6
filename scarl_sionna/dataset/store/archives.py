"""A dataset in archives: one ZIP file for each shard, from which single files are read without unpacking.

::

    archived.json                     sizes of the archives
    README.md
    archives/dataset.zip              manifest, dataset card, log, metadata of arrays
    archives/<scene>/<shard>.zip      all files of a shard under their own names, stored as they are
"""

from __future__ import annotations

import io
import json
import re
import threading
import zipfile
from collections import OrderedDict
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field

from scarl_sionna.core.errors import DatasetError
from scarl_sionna.core.untrusted.checked import Table, checked
from scarl_sionna.core.untrusted.json_text import parse_json

from .files import Files, check_name, read_member, read_small
from .manifest import ARRAYS, IMAGES, SHARDS

INDEX, FORMAT, VERSION = "archived.json", "scarl-dataset-archives", 1
FOLDER, COMMON = "archives", "archives/dataset.zip"
REMEDY = "run `scarl-sionna archive --restore` first"
_CACHED = 64
"""Archives whose tables of contents are kept in memory."""
_TAIL = 2**17
"""Read at once from the end of an archive, where its table of contents stands [bytes]."""
_MOST_TABLE = 2**28
_HEAD = 30
"""Bytes before the name of a file in an archive, as `zipfile` writes them; name and content follow."""
_CHUNK = re.compile(r"(.+?)/c/(0|[1-9]\d*)(?:/0)*")
_PICTURE = re.compile(r"(.+)/(\d{6,})\.png")
_RECORD = re.compile(r"(\d{6,})(?:\.frames)?\.json")


class IndexForm(Table):
    """Types of `archived.json`."""

    format: Literal["scarl-dataset-archives"]
    version: int
    shard_frames: int = Field(ge=1, le=100_000)
    common: int = Field(ge=0, le=2**48)
    shards: dict[str, list[Annotated[int, Field(ge=0, le=2**48)]]] = Field(max_length=1_000_000)


def archive_name(scene: str, shard: int) -> str:
    """Return the name of a shard's archive."""
    return f"{FOLDER}/{scene}/{shard:06d}.zip"


def index_text(shard_frames: int, common: int, shards: Mapping[str, list[int]]) -> str:
    """Return the text of `archived.json`: the size of every archive [bytes]."""
    data = {"format": FORMAT, "version": VERSION, "shard_frames": shard_frames, "common": common, "shards": shards}
    return json.dumps(data) + "\n"


def archived_files(files: Files) -> ArchivedFiles | None:
    """Return read access to what is in the archives of a place; None if it holds none.

    Raises
    ------
    DatasetError
        If they are of a newer version, or their index is damaged.
    """
    try:
        data = parse_json(read_small(files, INDEX))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError) as error:
        raise DatasetError(f"cannot read {INDEX}: {error!s:.200}", files.url, "copy the archives again") from error
    if isinstance(data, dict) and isinstance(data.get("version"), int) and data["version"] > VERSION:
        raise DatasetError(
            f"archives of version {data['version']} are newer than {VERSION}", files.url, "update scarl-sionna"
        )
    try:
        form = checked(IndexForm, data)
    except ValueError as error:
        raise DatasetError(f"{INDEX} is damaged: {error!s:.200}", files.url, "copy the archives again") from error
    for scene in form.shards:
        check_name(scene, "scene name")
    return ArchivedFiles(files, form)


class ArchivedFiles:
    """The files of a dataset, read out of its archives. Safe to use from several threads.

    Parameters
    ----------
    files : Files
        Of the place where the archives are.
    index : IndexForm
    """

    def __init__(self, files: Files, index: IndexForm) -> None:
        self.url = files.url
        self._files, self.index = files, index
        self._lock = threading.Lock()
        self._tables: OrderedDict[str, dict[str, tuple[int, int]]] = OrderedDict()

    def read(self, name: str, start: int | None = None, stop: int | None = None) -> bytes:
        """Return a file's bytes, or those from `start` to `stop`.

        Raises
        ------
        FileNotFoundError
            If no archive holds it.
        DatasetError
            If its archive is damaged.
        """
        place = self._place(name)
        if place is None:
            raise FileNotFoundError(f"{name} is in no archive")
        archive, size = place
        table = self.table(archive, size)
        if name not in table:
            raise FileNotFoundError(f"{name} is not in {archive}")
        return read_member(self._files, archive, name, table[name], start, stop)

    def names(self, folder: str) -> list[str]:
        """Return the records of a scene's shards; other folders are not listed."""
        kind, _, scene = folder.partition("/")
        if kind != SHARDS:
            return []
        return [f"{shard:06d}.json" for shard, size in enumerate(self.index.shards.get(scene, [])) if size]

    def archives(self) -> list[tuple[str, int]]:
        """Return name and size of every archive."""
        found = [(COMMON, self.index.common)]
        for scene, sizes in self.index.shards.items():
            found += [(archive_name(scene, shard), size) for shard, size in enumerate(sizes) if size]
        return found

    def table(self, archive: str, size: int) -> dict[str, tuple[int, int]]:
        """Return where the content of each file of an archive begins, and its length [bytes].

        Raises
        ------
        DatasetError
            If the archive is missing, cut or damaged.
        """
        with self._lock:
            if archive in self._tables:
                self._tables.move_to_end(archive)
                return self._tables[archive]
        try:
            table = _contents(_End(self._files, archive, size), size)
        except FileNotFoundError:
            raise DatasetError(f"{archive} is not there", self.url, "copy the archives again") from None
        except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError) as error:
            raise DatasetError(f"{archive} is damaged: {error!s:.200}", self.url, "copy the archives again") from error
        with self._lock:
            self._tables[archive] = table
            while len(self._tables) > _CACHED:
                self._tables.popitem(last=False)
        return table

    def _place(self, name: str) -> tuple[str, int] | None:
        """Return name and size of the archive that a file is in; None where it can be in none."""
        shard = shard_of(name, self.index.shard_frames)
        if shard is None:
            return COMMON, self.index.common
        scene, number = shard
        sizes = self.index.shards.get(scene, [])
        return (archive_name(scene, number), sizes[number]) if number < len(sizes) and sizes[number] else None


def shard_of(name: str, shard_frames: int) -> tuple[str, int] | None:
    """Return scene and shard of a file of a dataset; None for one that belongs to none."""
    folder, _, rest = name.partition("/")
    scene, _, rest = rest.partition("/")
    if folder == SHARDS and (found := _RECORD.fullmatch(rest)):
        return scene, int(found[1])
    if folder == IMAGES and (found := _PICTURE.fullmatch(rest)):
        return scene, int(found[2]) // shard_frames
    if folder == ARRAYS and (found := _CHUNK.fullmatch(rest)):
        return scene, int(found[2])
    return None


def _contents(end: _End, size: int) -> dict[str, tuple[int, int]]:
    """Return the place of every file of an archive, from its table of contents."""
    table = {}
    with zipfile.ZipFile(end) as archive:
        for entry in archive.infolist():
            begin = entry.header_offset + _HEAD + len(entry.orig_filename.encode())
            outside = entry.header_offset < 0 or begin + entry.file_size > size
            if outside or entry.compress_type != zipfile.ZIP_STORED or entry.flag_bits & 1:
                raise zipfile.BadZipFile(f"{entry.filename!r:.80} is compressed, encrypted or cut")
            table[check_name(entry.filename, "name in an archive")] = (begin, entry.file_size)
    return table


class _End(io.RawIOBase):
    """An archive as a file that can be searched; its end, where the table of contents stands, is read at once."""

    def __init__(self, files: Files, name: str, size: int) -> None:
        self._files, self._name, self._size, self._at = files, name, size, 0
        self._from = max(0, size - _TAIL)
        self._tail = files.read(name, self._from, size)
        if len(self._tail) != size - self._from:
            raise zipfile.BadZipFile(f"it has not the {size} bytes that were written")

    def seekable(self) -> bool:
        """Return that it can be searched."""
        return True

    def readable(self) -> bool:
        """Return that it can be read."""
        return True

    def tell(self) -> int:
        """Return the place of the next byte."""
        return self._at

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a place, and return it."""
        self._at = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._size}[whence] + offset
        if self._at < 0:
            raise ValueError("a place before the beginning")
        return self._at

    def read(self, size: int | None = -1) -> bytes:
        """Return the next bytes."""
        stop = self._size if size is None or size < 0 else min(self._at + size, self._size)
        if stop - self._at > _MOST_TABLE:
            raise ValueError("a table of contents larger than any that is written")
        if self._at >= self._from:
            data = self._tail[self._at - self._from : stop - self._from]
        else:
            data = self._files.read(self._name, self._at, stop)
        self._at += len(data)
        return data

    def readinto(self, buffer: Any) -> int:  # noqa: ANN401  # as io.RawIOBase states it
        """Read into a buffer."""
        data = self.read(len(buffer))
        buffer[: len(data)] = data
        return len(data)
