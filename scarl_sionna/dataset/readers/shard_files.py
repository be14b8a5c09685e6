"""The files of a scene's shards, each byte of them checked before it is handed out."""

from __future__ import annotations

import hashlib
import re
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from scarl_sionna.core.errors import DatasetDamage, DatasetError, DatasetUnreachable
from scarl_sionna.core.untrusted.checked import checked, plain
from scarl_sionna.core.untrusted.json_text import parse_json
from scarl_sionna.dataset.encoding import StoreOptions
from scarl_sionna.dataset.store.archives import shard_of
from scarl_sionna.dataset.store.files import Files, HeldFiles, read_small
from scarl_sionna.dataset.store.forms import MetasForm
from scarl_sionna.dataset.store.manifest import ARRAYS, SHARDS, ScenePlan
from scarl_sionna.dataset.store.records import (
    ShardRecord,
    array_key,
    image_name,
    meta_name,
    record_name,
    zarr_texts,
)
from scarl_sionna.dataset.store.shards import ArrayInfo, decode_chunk, index_length, parse_index

if TYPE_CHECKING:
    from .zarr_store import SceneStore

_CACHED_SHARDS = 64
"""Shards whose indices and JSON are kept in memory, a scene."""
_RECORD = re.compile(r"\d{6,7}\.json")
_ALTERED = ValueError("it is not what was written (size or checksum)")


class ShardFiles:
    """Reads the shards of one scene. Safe to use from several threads.

    Parameters
    ----------
    files : Files
        Of the dataset.
    place : str
        Of the dataset, for errors.
    plan : ScenePlan
    options : StoreOptions
    rows : sequence
        What the manifest states of each shard: checksum of its record and number of frames first; None: not finished.

    Attributes
    ----------
    faults : dict of int to str
        By shard, what is wrong with a record for which the manifest does not answer yet; after `frames`.
    """

    def __init__(
        self, files: Files, place: str, plan: ScenePlan, options: StoreOptions, rows: Sequence[list[Any] | None]
    ) -> None:
        self._files, self._place, self._plan, self._options, self._rows = HeldFiles(files), place, plan, options, rows
        self._lock = threading.Lock()
        self._shards: OrderedDict[int, _Shard] = OrderedDict()
        self.faults: dict[int, str] = {}

    def hold(self, name: str, data: bytes) -> None:
        """Read a file from memory from now on, until another is held."""
        self._files.hold(name, data)

    def arrays(self, index: int) -> dict[str, ArrayInfo]:
        """Return the arrays of a frame's shard by name."""
        return dict(self._shard(index).arrays)

    def read_array(self, index: int, name: str) -> npt.NDArray[Any] | None:
        """Return one array of one frame, or None if the frame does not have it.

        With the shape and in the unit that the schema states, see docs/dataset.md.

        Raises
        ------
        DatasetError
            If the file is missing, cut or damaged.
        """
        shard = self._shard(index)
        info = shard.arrays.get(name)
        if info is None:
            return None
        number, position = divmod(index, self._options.shard_frames)
        key = array_key(self._plan.name, name, number, info)
        try:
            places = shard.places.get(name)
            end = shard.record.files[key][0]
            if places is None:
                tail = shard.record.read(self._files, key, end - index_length(self._options.shard_frames), end)
                places = shard.places[name] = parse_index(tail, self._options.shard_frames)
            place = places[position]
            if place is None:
                return None
            if place[0] + place[1] > end:
                raise _ALTERED
            return decode_chunk(shard.record.read(self._files, key, place[0], place[0] + place[1]), info)
        except (OSError, DatasetError, RuntimeError, KeyError, ValueError) as error:
            raise self._damaged(key, error, index, shard.record) from error

    def read_file(self, name: str, index: int | None = None) -> bytes:
        """Return a file of the dataset; `index` is the frame that an error names.

        Raises
        ------
        DatasetError
            If the file is missing or cannot be read.
        """
        place = shard_of(name, self._options.shard_frames) if self._options.layout == "packed" else None
        if place is None or place[0] != self._plan.name or name == record_name(*place):
            return self._read(None, name, index)
        return self._read(self._shard(place[1] * self._options.shard_frames).record, name, index)

    def _read(self, record: ShardRecord | None, name: str, index: int | None) -> bytes:
        try:
            if record is None or name not in record.files:
                return self._files.read(name)
            return record.read(self._files, name)
        except (OSError, DatasetError) as error:
            raise self._damaged(name, error, index, record) from error

    def image_file(self, index: int, sensor: str, image: str) -> str | None:
        """Return the name of an image's PNG file in the dataset, or None if the frame does not have it."""
        name = image_name(self._plan.name, f"{sensor}/{image}/{index:06d}.png")
        return name if name in self._shard(index).record.files else None

    def read_image(self, index: int, sensor: str, image: str) -> bytes | None:
        """Return an image's PNG file, or None if the frame does not have it.

        Raises
        ------
        DatasetError
            If the file is missing, or is not the one that was written.
        """
        name = self.image_file(index, sensor, image)
        return None if name is None else self._read_checked(name, self._shard(index).record, index)

    def _read_checked(self, name: str, record: ShardRecord, index: int | None) -> bytes:
        """Return a file whose size and SHA-256 are those that its shard's record states."""
        data = self._read(record, name, index)
        if (len(data), hashlib.sha256(data).hexdigest()) != record.files[name]:
            raise self._damaged(name, _ALTERED, index, record)
        return data

    def meta(self, index: int) -> dict[str, Any]:
        """Return what of a frame stands in JSON."""
        try:
            return self._shard(index).metas[index]
        except KeyError as error:
            name = meta_name(self._plan.name, index // self._options.shard_frames)
            raise self._damaged(name, ValueError(f"it has no frame {index}"), index) from error

    def _damaged(
        self, key: str, error: Exception, index: int | None = None, record: ShardRecord | None = None
    ) -> DatasetError:
        if isinstance(error, DatasetUnreachable | DatasetDamage):
            return error
        where = "" if record is None or record.bundle is None else f" in {record.bundle[0]}"
        text = "is not there" if isinstance(error, FileNotFoundError) else f"cannot be read: {error}"
        frame = "" if index is None else f"frame {index} of {self._plan.name}: "
        return DatasetDamage(
            f"{frame}{key}{where} {text}",
            self._place,
            "run `scarl-sionna verify --repair`, then the export again",
            (key, self._plan.name, index),
        )

    def members(self, shard: int) -> tuple[ShardRecord, Iterator[tuple[str, list[bytes]]]] | None:
        """Return the record of a shard, and name and content of its files, each checked; None: it is not finished.

        Raises
        ------
        DatasetError
            If a file is missing, or is not the one that was written.
        """
        name = record_name(self._plan.name, shard)
        if self._row(shard) is None and name.rpartition("/")[2] not in self._files.names(f"{SHARDS}/{self._plan.name}"):
            return None
        record = self._record(shard)
        return record, ((name, [self._read_checked(name, record, None)]) for name in record.files)

    def zarr_store(self, again: Callable[[], object]) -> SceneStore:
        """Return the arrays of the shards that are there as a Zarr hierarchy; `again` opens it in another process.

        Raises
        ------
        DatasetError
            If a record is damaged.
        """
        from .zarr_store import SceneStore  # imports Zarr

        top = f"{ARRAYS}/{self._plan.name}/"
        arrays = dict[str, ArrayInfo]()
        places = dict[str, ShardRecord]()
        for number in sorted({index // self._options.shard_frames for index in self.frames()}):
            record = self._record(number)
            arrays |= record.arrays
            places |= {name: record for name in record.files if name.startswith(top)}
        texts = {
            name: text for name, text in zarr_texts(self._plan, arrays, self._options).items() if name.startswith(top)
        }

        def read(key: str, start: int | None, stop: int | None) -> bytes:
            return places[top + key].read(self._files, top + key, start, stop)

        sizes = {name.removeprefix(top): record.files[name][0] for name, record in places.items()}
        return SceneStore({name.removeprefix(top): text for name, text in texts.items()}, sizes, read, again)

    def frames(self) -> Iterator[int]:
        """Yield the frames of finished shards: from the manifest, and from records that came after it.

        A damaged one of these does not keep the rest from being read: its frames are left out.
        """
        full = {shard for shard in range(len(self._rows)) if self._is_full(shard)}
        shards, there = sorted(full), set[int]()
        if len(full) < self._plan.num_shards(self._options):
            names = self._files.names(f"{SHARDS}/{self._plan.name}")
            there = {int(name[:-5]) for name in names if _RECORD.fullmatch(name)} - full
            shards = sorted(full | {shard for shard in there if shard < self._plan.num_shards(self._options)})
        for shard in shards:
            frames: Sequence[int] = self._plan.shard_range(shard, self._options)
            yield from self._late_frames(shard, frames) if shard in there else frames

    def _late_frames(self, shard: int, planned: Sequence[int]) -> list[int]:
        """Return the frames of a record that is younger than what the manifest says of it; note what is wrong."""
        try:
            record = self._record(shard)
        except DatasetUnreachable:
            raise
        except DatasetError as error:
            self.faults[shard] = f"{error}; its frames are left out"
            return []
        if self._row(shard) is None and not record.has_checksum:  # of an earlier version
            name = record_name(self._plan.name, shard)
            self.faults[shard] = (
                f"{self._place}/{name}: nothing holds its checksum; `scarl-sionna verify --repair` does"
            )
        return [index for index in record.frames if index in planned]

    def _is_full(self, shard: int) -> bool:
        row = self._row(shard)
        return row is not None and row[1] == len(self._plan.shard_range(shard, self._options))

    def _row(self, shard: int) -> list[Any] | None:
        """Return what the manifest states of a shard: checksum of its record and number of frames first."""
        return self._rows[shard] if shard < len(self._rows) else None

    def _record(self, shard: int) -> ShardRecord:
        key = record_name(self._plan.name, shard)
        try:
            text = read_small(self._files, key)
        except (OSError, DatasetError) as error:
            raise self._damaged(key, error) from error
        row = self._row(shard)
        frames = row[1] if row is not None and row[0] != hashlib.sha256(text).hexdigest() else None
        if frames == len(self._plan.shard_range(shard, self._options)):
            raise self._damaged(key, _ALTERED)
        record = ShardRecord.parse(text, f"{self._place}/{key}")
        if frames == len(record.frames):  # one that came after the manifest has more
            raise self._damaged(key, _ALTERED)
        return record

    def _shard(self, index: int) -> _Shard:
        number = index // self._options.shard_frames
        with self._lock:
            if number in self._shards:
                self._shards.move_to_end(number)
                return self._shards[number]
        record = self._record(number)
        try:
            name = meta_name(self._plan.name, number)
            if name in record.files:
                text = self._read_checked(name, record, index)
            else:
                text = self._read(None, name, index)
            metas = {meta.index: plain(meta) for meta in checked(MetasForm, parse_json(text)).root}
        except ValueError as error:
            raise self._damaged(meta_name(self._plan.name, number), error, index) from error
        shard = _Shard(record, metas)
        with self._lock:
            self._shards[number] = shard
            while len(self._shards) > _CACHED_SHARDS:
                self._shards.popitem(last=False)
        return shard


class _Shard:
    """What is kept of a shard: its record, its JSON, and the indices that were read."""

    def __init__(self, record: ShardRecord, metas: dict[int, dict[str, Any]]) -> None:
        self.record, self.metas, self.arrays = record, metas, record.arrays
        self.places: dict[str, list[tuple[int, int] | None]] = {}
