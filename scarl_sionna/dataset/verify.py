"""Checks a dataset against its checksums, counts and cross-references, and removes what is damaged."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from scarl_sionna.core.errors import DatasetError, OutputError, ScarlError

from .encoding import decode_png
from .readers.reader import Dataset, Scene, open_dataset
from .schema import OBJECT, POINT
from .store.card import dataset_card
from .store.files import LocalFiles, output_error
from .store.manifest import ARRAYS, FROM_PLAN, IMAGES, MANIFEST, SHARDS, ScenePlan, dump_manifest, manifest_data
from .store.shard_writer import ShardRecord, metadata_texts, record_name
from .store.writer import CARD, DatasetFolder, shard_rows


@dataclass(frozen=True)
class Fault:
    """Something that is wrong: the file (or frame), what it is, and the shard that holds it, if one does."""

    name: str
    what: str
    scene: str | None = None
    shard: int | None = None

    def __str__(self) -> str:
        return f"{self.name}: {self.what}"


@dataclass
class Verification:
    """What :func:`verify` found.

    Attributes
    ----------
    num_frames, num_planned : int
        Frames that are there, and that the manifest plans.
    num_files, num_bytes : int
        Files whose checksum was computed.
    failed : dict of (str, int) to str
        Frames that could not be made, with the reason.
    faults : list of Fault
    removed : list of (str, int)
        Shards that were removed, to be made again.
    """

    num_frames: int = 0
    num_planned: int = 0
    num_files: int = 0
    num_bytes: int = 0
    failed: dict[tuple[str, int], str] = field(default_factory=dict)
    faults: list[Fault] = field(default_factory=list)
    removed: list[tuple[str, int]] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """Whether nothing is damaged (frames may still be missing)."""
        return not self.faults

    @property
    def complete(self) -> bool:
        """Whether nothing is damaged and no frame is missing."""
        return self.ok and self.num_frames == self.num_planned


def verify(
    root: str | Path, *, repair: bool = False, on_shard: Callable[[int, int], None] = lambda done, total: None
) -> Verification:
    """Check every file of a dataset.

    Checked are: the checksum of every record against the manifest, size and checksum of every file against its record, the
    ``zarr.json`` files against the schema, the dataset card, files that belong to nothing, the number of frames, that every chunk
    and image decodes, the number of objects and points, the sensors, and that time rises.

    Parameters
    ----------
    root : path
    repair : bool
        Remove damaged shards, so that the next export makes them again, and write anew what follows from the rest.
    on_shard : callable
        Called with the number of shards checked and their total.

    Raises
    ------
    DatasetError
        If there is no dataset, or its manifest cannot be read.
    OutputError
        If it is in use or cannot be repaired for lack of permission.
    """
    root = Path(root)
    dataset = open_dataset(root)
    found = Verification()
    shards = [
        (scene, shard) for scene in dataset.plan.scenes for shard in range(scene.num_shards(dataset.plan.options))
    ]
    known: set[str] = {MANIFEST, CARD}
    for position, (scene, shard) in enumerate(shards):
        on_shard(position, len(shards))
        found.num_planned += len(scene.shard_range(shard, dataset.plan.options))
        found.faults += _check_shard(dataset, scene, shard, found, known)
    on_shard(len(shards), len(shards))
    found.faults += _check_whole(dataset, root, known)
    found.faults += _check_order(dataset)
    if repair and found.faults:
        _repair(root, dataset, found)
    return found


def _check_shard(
    dataset: Dataset, scene: ScenePlan, shard: int, found: Verification, known: set[str]
) -> Iterator[Fault]:
    """Yield what is wrong with a shard's record and files."""
    name = record_name(scene.name, shard)
    rows = dataset.manifest["shards"].get(scene.name, [])
    row = rows[shard] if shard < len(rows) else None
    known.add(name)
    try:
        text = dataset.files.read(name)
        record = ShardRecord.parse(text, name)
    except FileNotFoundError:
        if row is not None:
            yield Fault(name, "stands in the manifest and is not there", scene.name, shard)
        return
    except (OSError, DatasetError) as error:
        yield Fault(name, str(error), scene.name, shard)
        return
    if row is None:
        yield Fault(name, "is not in the manifest (an export that was stopped; run it again)")
    elif row[0] != hashlib.sha256(text).hexdigest():
        yield Fault(name, "its checksum is not that of the manifest", scene.name, shard)
    found.failed.update({(scene.name, index): reason for index, reason in record.failed.items()})
    if record.configuration != dataset.plan.scene_hash(scene.name):
        yield Fault(name, "was made with another configuration than the manifest's", scene.name, shard)
    expected = set(scene.shard_range(shard, dataset.plan.options))
    if set(record.frames) | set(record.failed) != expected or len(set(record.frames)) != len(record.frames):
        yield Fault(name, f"holds the frames {list(record.frames)}, planned are {sorted(expected)}", scene.name, shard)
    known.update(record.files)
    damaged = False
    for file, (size, digest) in record.files.items():
        what = _check_file(dataset, file, size, digest)
        found.num_files += 1
        found.num_bytes += size
        if what is not None:
            damaged = True
            yield Fault(file, what, scene.name, shard)
    found.num_frames += len(record.frames)
    if not damaged:
        for index in record.frames:
            yield from _check_frame(dataset.scene(scene.name), index, shard)


def _check_file(dataset: Dataset, name: str, size: int, digest: str) -> str | None:
    if name.split("/")[0] not in (ARRAYS, IMAGES, SHARDS):
        return "is no place for data of a shard"
    try:
        data = dataset.files.read(name)
    except FileNotFoundError:
        return "is not there"
    except (OSError, DatasetError) as error:
        return f"cannot be read: {error}"
    if len(data) != size:
        return f"has {len(data)} bytes, {size} were written"
    return None if hashlib.sha256(data).hexdigest() == digest else "its checksum is wrong"


def _check_frame(scene: Scene, index: int, shard: int) -> Iterator[Fault]:
    """Yield what is wrong inside a frame whose files are whole."""
    where = f"{scene.name} frame {index}"
    try:
        meta, arrays = scene.meta(index), scene.arrays(index)
        lengths: dict[str, int] = {}
        for name in arrays:
            values = scene.read_array(index, name)
            group, _, short = name.rpartition("/")
            if values is not None and short in ("num_points", "num_objects"):
                lengths[group] = int(values)
                capacity = next(
                    (
                        item.shape[0]
                        for other, item in arrays.items()
                        if other.rpartition("/")[0] == group and item.axes[:1] in ((POINT,), (OBJECT,))
                    ),
                    0,
                )
                if not 0 <= lengths[group] <= capacity:
                    yield Fault(where, f"{name} = {lengths[group]} is outside of 0 to {capacity}", scene.name, shard)
        if lengths.get("objects") != len(meta["objects"]):
            yield Fault(where, f"{lengths.get('objects')} objects and {len(meta['objects'])} names", scene.name, shard)
        rig = set(scene.dataset.sensors)
        if set(meta["sensors"]) != rig:
            yield Fault(
                where, f"sensors {sorted(set(meta['sensors']) ^ rig)} are not those of the rig", scene.name, shard
            )
        for sensor in meta["sensors"]:
            for image in ("rgb", "depth", "semantic", "instance"):
                file = scene.image_file(index, sensor, image)
                if file is not None:
                    pixels, spec = decode_png(image, scene.read_file(file)), scene.dataset.spec(sensor)
                    if pixels.shape[:2] != (spec.height, spec.width):  # type: ignore[attr-defined]
                        yield Fault(file, f"is of {pixels.shape[1]} x {pixels.shape[0]} pixels", scene.name, shard)
    except (ScarlError, OSError, ValueError, KeyError, TypeError) as error:
        yield Fault(where, f"cannot be read: {error}", scene.name, shard)


def _check_whole(dataset: Dataset, root: Path, known: set[str]) -> Iterator[Fault]:
    """Yield what is wrong with the files that belong to no shard."""
    plan = dataset.plan
    rows = {}
    for scene in plan.scenes:
        rows[scene.name], arrays = shard_rows(root, scene, plan.options)
        for name, text in metadata_texts(scene, arrays, plan.options).items():
            known.add(name)
            try:
                if dataset.files.read(name).decode() != text:
                    yield Fault(name, "is not what the schema says")
            except (OSError, UnicodeDecodeError, DatasetError) as error:
                yield Fault(name, f"cannot be read: {error}")
    expected = manifest_data(plan, rows)
    if (
        dataset.manifest["schema_version"] != expected["schema_version"]
    ):  # its tables and conventions are of its own time
        expected = {**dataset.manifest, **{name: expected[name] for name in FROM_PLAN}}
    if dump_manifest(expected) != dump_manifest(dataset.manifest):
        yield Fault(MANIFEST, "is not what follows from the plan and the shards")
    try:
        card = dataset.files.read(CARD).decode()
    except (OSError, UnicodeDecodeError):
        card = ""
    if card != dataset_card(dataset.manifest):
        yield Fault(CARD, "is not the card of this dataset")
    for folder in (ARRAYS, IMAGES, SHARDS):
        for path in sorted((root / folder).rglob("*")):
            name = path.relative_to(root).as_posix()
            if path.is_symlink() or (path.is_file() and name not in known):
                yield Fault(name, "belongs to no finished shard")


def _check_order(dataset: Dataset) -> Iterator[Fault]:
    """Yield where time does not rise."""
    for name in dataset.scenes:
        scene, last = dataset.scene(name), None
        for index in scene.frames:
            try:
                time = scene.frame(index).timestamp_ns
            except ScarlError:
                continue  # reported already
            if last is not None and time <= last:
                yield Fault(f"{name} frame {index}", f"timestamp {time} ns is not after {last} ns")
            last = time


def _repair(root: Path, dataset: Dataset, found: Verification) -> None:
    """Remove damaged shards and what belongs to nothing, and write the rest anew."""
    damaged = {
        (fault.scene, fault.shard) for fault in found.faults if fault.scene is not None and fault.shard is not None
    }
    strays = [fault.name for fault in found.faults if fault.what == "belongs to no finished shard"]
    with DatasetFolder(root, dataset.plan) as folder:
        try:
            for scene, shard in sorted(damaged):
                place = root / record_name(scene, shard)
                try:
                    files = list(ShardRecord.parse(place.read_bytes()).files)
                except (OSError, DatasetError):
                    files = []
                place.unlink(missing_ok=True)  # first: without its record the shard is not there
                for name in files:
                    _remove(root, name)
                found.removed.append((scene, shard))
            for name in strays:
                _remove(root, name)
        except OSError as error:
            if isinstance(error, OutputError):
                raise
            raise output_error(root, error) from error
        folder.finalize(afresh=True)


def _remove(root: Path, name: str) -> None:
    """Remove a file of the dataset; a link is removed itself, and nothing outside of the dataset."""
    try:
        path = LocalFiles(root).path(name) if not (root / name).is_symlink() else root / name
    except DatasetError:
        return
    path.unlink(missing_ok=True)


def describe(found: Verification) -> str:
    """Return what was found, for people."""
    lines = [
        f"{found.num_frames} of {found.num_planned} frames, {found.num_files} files, {found.num_bytes / 1e6:.1f} MB checked"
    ]
    lines += [f"  {fault}" for fault in found.faults[:20]]
    if len(found.faults) > 20:
        lines.append(f"  and {len(found.faults) - 20} more")
    for (scene, index), reason in list(found.failed.items())[:10]:
        lines.append(f"  failed: {scene} frame {index}: {reason}")
    if found.removed:
        lines.append(
            f"{len(found.removed)} shards removed; the export makes them again: " + json.dumps(found.removed[:20])
        )
    elif found.faults:
        lines.append("damaged; `scarl-sionna verify --repair` removes what is damaged, then the export makes it again")
    elif not found.complete:
        lines.append("whole, but not complete; the export goes on where it was")
    else:
        lines.append("whole and complete")
    return "\n".join(lines)
