"""Checks a dataset against its checksums, counts and cross-references, and removes what is damaged."""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from scarl_sionna.core.errors import DatasetError, ScarlError, ScarlWarning

from .encoding import decode_png
from .findings import STRAY, UNFINISHED_STRAY, Fault, Kind, Verification
from .readers.reader import Dataset, Scene, open_dataset
from .repair import repair_folder, repair_store
from .schema import OBJECT, POINT
from .store.archives import REMEDY, ArchivedFiles
from .store.card import dataset_card, is_card, unmarked_card
from .store.files import LocalFiles, RemoteFiles
from .store.layout import (
    CARD,
    DATA_FOLDERS,
    MARKED,
    WORK_FOLDER,
    Layout,
    files_under,
    is_manifest,
    is_temporary,
)
from .store.manifest import (
    BACKUP,
    FROM_PLAN,
    MANIFEST,
    ScenePlan,
    dump_manifest,
    manifest_data,
    read_manifest,
    without_later,
)
from .store.records import Row, ShardRecord, bundle_name, metadata_texts, record_name, shard_rows

_BLOCK = 2**26
"""Read at once of a file whose checksum is computed [bytes]."""
_HELD = 2**28
"""Largest ZIP file of a shard that is held in memory while its frames are checked [bytes]."""


def verify(
    root: str | Path, *, repair: bool = False, on_shard: Callable[[int, int], None] = lambda done, total: None
) -> Verification:
    """Check every file of a dataset.

    Checked are: the checksum of every record against the manifest, size and checksum of every file against its record,
    the ``zarr.json`` files against the schema, the dataset card, files that belong to nothing, the number of frames,
    that every chunk and image decodes, the number of objects and points, the sensors, and that time rises. Of a dataset
    in archives the files of the shards are checked, as they stand in them.

    Parameters
    ----------
    root : path or str
        A folder, or an fsspec address; of a place that lists no folders (most web servers) only the shards are checked.
    repair : bool
        Remove damaged shards, so that the next export makes them again, and write anew what follows from the rest. Only
        files of the dataset's own are removed or replaced.
    on_shard : callable
        Called with the number of shards checked and their total.

    Raises
    ------
    DatasetError
        If there is no dataset, its manifest cannot be read, or it is in archives and to be repaired.
    OutputError
        If it is in use or cannot be repaired for lack of permission.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)  # a manifest that is lost is a fault here
        dataset = open_dataset(root)
    if isinstance(dataset.files, ArchivedFiles) and repair:
        raise DatasetError("archives are written once and cannot be repaired", root, REMEDY)
    found = Verification()
    if dataset.manifest_fault is not None:
        found.add([Fault(MANIFEST, f"{dataset.manifest_fault} (its copy {BACKUP} is whole)")])
    shards = [
        (scene, shard) for scene in dataset.plan.scenes for shard in range(scene.num_shards(dataset.plan.options))
    ]
    known: set[str] = set()
    layout = Layout(dataset.plan)
    for position, (scene, shard) in enumerate(shards):
        on_shard(position, len(shards))
        found.num_planned += len(scene.shard_range(shard, dataset.plan.options))
        found.add(_check_shard(dataset, layout, (scene, shard), found, known))
    on_shard(len(shards), len(shards))
    if isinstance(dataset.files, LocalFiles):
        folder = dataset.files.root
        found.add(_check_manifest(dataset, folder, known))
        found.add(_check_marked(dataset, folder, found))
        found.add(_check_strays(dataset, folder, known, found))
    elif isinstance(dataset.files, RemoteFiles):
        found.add(_check_store(dataset, dataset.files, known, found))
    found.add(_check_order(dataset))
    if repair and isinstance(dataset.files, RemoteFiles):
        repair_store(dataset, found)
    elif repair and (found.faults or found.unfinished or not (Path(root) / BACKUP).exists()):
        repair_folder(Path(root), dataset, found)
    return found


def _check_shard(
    dataset: Dataset, layout: Layout, place: tuple[ScenePlan, int], found: Verification, known: set[str]
) -> Iterator[Fault]:
    """Yield what is wrong with a shard's record and files."""
    scene, shard = place
    name = record_name(scene.name, shard)
    rows = dataset.manifest["shards"].get(scene.name, [])
    row = rows[shard] if shard < len(rows) else None
    try:
        text = dataset.files.read(name)
        known.add(name)
        record = ShardRecord.parse(text, name)
    except FileNotFoundError:
        if row is not None and _is_kept(dataset, scene, shard, row):
            yield Fault(name, "is made again from kept frames (an export that was stopped)", kind="unfinished")
        elif row is not None:
            yield Fault(name, "stands in the manifest and is not there", scene.name, shard)
        return
    except (OSError, DatasetError) as error:
        known.add(name)
        yield Fault(name, str(error), scene.name, shard)
        return
    if row is None:
        yield Fault(name, "is not in the manifest yet (an export that is running or was stopped)", kind="unfinished")
    elif _is_remade(row, [hashlib.sha256(text).hexdigest(), len(record.frames)], scene, shard, dataset):
        yield Fault(
            name, "has more frames than in the manifest (an export that is running or was stopped)", kind="unfinished"
        )
    elif row[0] != hashlib.sha256(text).hexdigest():
        yield Fault(name, "its checksum is not that of the manifest", scene.name, shard)
    found.failed.update({(scene.name, index): reason for index, reason in record.failed.items()})
    if record.configuration != dataset.plan.scene_hash(scene.name):
        yield Fault(name, "was made with another configuration than the manifest's", scene.name, shard)
    expected = set(scene.shard_range(shard, dataset.plan.options))
    if set(record.frames) | set(record.failed) != expected or len(set(record.frames)) != len(record.frames):
        yield Fault(name, f"holds the frames {list(record.frames)}, planned are {sorted(expected)}", scene.name, shard)
    known.update(file for file in record.on_disk if layout.shard_of(file) == (scene.name, shard))
    if (dataset.plan.options.layout == "packed") != (record.bundle is not None) or (
        record.bundle is not None and record.bundle[0] != bundle_name(scene.name, shard)
    ):
        yield Fault(name, "is not of the layout that the manifest states", scene.name, shard)
    damaged = False
    for file, (size, digest) in record.on_disk.items():
        what, data = _misplaced(layout, file, scene.name, shard), b""
        if what is None:
            what, data = _check_file(dataset, file, size, digest)
        if record.bundle is not None and what is None and data:
            dataset.scene(scene.name).hold(file, data)
        found.num_files += 1
        found.num_bytes += size
        if what is not None:
            damaged = True
            yield Fault(file, what, scene.name, shard)
    found.num_frames += len(record.frames)
    if not damaged:
        for index in record.frames:
            yield from _check_frame(dataset.scene(scene.name), index, shard)


def _misplaced(layout: Layout, name: str, scene: str, shard: int) -> str | None:
    """Return what is wrong with the name of a file in the record of a shard: another shard answers for it, or none."""
    owner = layout.shard_of(name)
    if owner is None:
        return "is no place for data of a shard"
    return None if owner == (scene, shard) else f"is no file of shard {shard} of {scene}, whose record names it"


def _check_file(dataset: Dataset, name: str, size: int, digest: str) -> tuple[str | None, bytes]:
    """Return what is wrong with a file, and its bytes if they are few enough to be held."""
    found, length, parts = hashlib.sha256(), 0, []
    try:
        while data := dataset.files.read(name, length, length + _BLOCK):
            found.update(data)
            length += len(data)
            if size <= _HELD:
                parts.append(data)
            if len(data) < _BLOCK:
                break
    except FileNotFoundError:
        return "is not there", b""
    except (OSError, DatasetError) as error:
        return f"cannot be read: {error}", b""
    if length != size:
        return f"has {length} bytes, {size} were written", b""
    return (None, b"".join(parts)) if found.hexdigest() == digest else ("its checksum is wrong", b"")


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
                    pixels, spec = (
                        decode_png(image, scene.read_image(index, sensor, image) or b""),
                        scene.dataset.spec(sensor),
                    )
                    if pixels.shape[:2] != (spec.height, spec.width):  # type: ignore[attr-defined]
                        yield Fault(file, f"is of {pixels.shape[1]} x {pixels.shape[0]} pixels", scene.name, shard)
    except (ScarlError, OSError, ValueError, KeyError, TypeError) as error:
        yield Fault(where, f"cannot be read: {error}", scene.name, shard)


def _is_kept(dataset: Dataset, scene: ScenePlan, shard: int, row: list[Any]) -> bool:
    """Return whether the frames of a shard that is being made again, because frames are added to it, are kept ones."""
    planned = len(scene.shard_range(shard, dataset.plan.options))
    packs = dataset.files.names(f"{WORK_FOLDER}/{scene.name}/{shard:06d}")
    return bool(row[1] < planned and sum(name.endswith(".pack") for name in packs) >= row[1])


def _is_remade(old: list[Any], new: list[Any], scene: ScenePlan, shard: int, dataset: Dataset) -> bool:
    """Return whether a shard, of which frames were missing, was made again since the manifest was written."""
    planned = len(scene.shard_range(shard, dataset.plan.options))
    return bool(old[0] != new[0] and old[1] < planned and new[1] >= old[1])


def _check_manifest(dataset: Dataset, root: Path, known: set[str]) -> Iterator[Fault]:
    """Yield what is wrong with the manifest and with the metadata of arrays."""
    plan, there = dataset.plan, dataset.manifest["shards"]
    rows: dict[str, list[Row]] = {}
    for scene in plan.scenes:
        now, arrays = shard_rows(dataset.files, scene, plan.options)
        old = [*there.get(scene.name, []), *[None] * len(now)][: len(now)]
        rows[scene.name] = [  # those that an export has changed meanwhile were reported with their shards
            was
            if (was is None)
            or (now is None and _is_kept(dataset, scene, shard, was))
            or (now is not None and _is_remade(was, now, scene, shard, dataset))
            else now
            for shard, (was, now) in enumerate(zip(old, now, strict=True))
        ]
        for name, text in metadata_texts(scene, arrays, plan.options).items():
            known.add(name)
            try:
                if (found := dataset.files.read(name).decode()) != text:
                    grown = _without_length(found) == _without_length(text)
                    yield Fault(name, "is not what the schema says", kind="unfinished" if grown else "damage")
            except FileNotFoundError:
                yield Fault(name, "is not there", kind=_lost(dataset, root))
            except (OSError, UnicodeDecodeError, DatasetError) as error:
                yield Fault(name, f"cannot be read: {error}")
    expected = manifest_data(plan, rows)
    if (
        dataset.manifest["schema_version"] != expected["schema_version"]
    ):  # its tables and conventions are of its own time
        expected = {**dataset.manifest, **{name: expected[name] for name in FROM_PLAN}}
    if dump_manifest(dataset.manifest) != dump_manifest(without_later(expected, dataset.manifest)):
        yield Fault(MANIFEST, "is not what follows from the plan and the shards")


def _lost(dataset: Dataset, root: Path) -> Kind:
    """Return what a missing file means: an export writes the manifest first, these next, then the manifest's copy."""
    begins = not (root / BACKUP).exists() and not any(
        row for rows in dataset.manifest["shards"].values() for row in rows
    )
    return "unfinished" if begins else "damage"


def _without_length(text: str) -> object:
    """Return the metadata of an array without the number of frames, which an export that adds frames changes first."""
    try:
        data = json.loads(text)
        return {**data, "shape": data.get("shape", [0])[1:]}
    except (ValueError, TypeError, AttributeError):
        return text


def _check_marked(dataset: Dataset, root: Path, found: Verification) -> Iterator[Fault]:
    """Yield what is wrong with the card and the manifest's copy; list those that are somebody else's."""
    for name in (CARD, BACKUP):
        if (root / name).is_dir():
            yield Fault(name, "is a folder")
    try:
        card = dataset.files.read(CARD).decode()
    except FileNotFoundError:
        yield Fault(CARD, "is not there", kind=_lost(dataset, root))
    except (OSError, UnicodeDecodeError, DatasetError):
        found.foreign.append(CARD)
    else:
        if card not in (dataset_card(dataset.manifest), unmarked_card(dataset.manifest)):
            if is_card(root / CARD):
                yield Fault(
                    CARD, "is the card of another state (an export that is running or was stopped)", kind="unfinished"
                )
            else:
                found.foreign.append(CARD)
    if not (root / BACKUP).is_file() or dataset.manifest_fault is not None:
        return  # written before there was a copy; or read from it
    try:
        same = read_manifest(dataset.files, BACKUP) == dataset.manifest
    except DatasetError as error:
        if is_manifest(root / BACKUP, in_dataset=True):
            yield Fault(BACKUP, str(error))
        else:
            found.foreign.append(BACKUP)
        return
    if not same:
        yield Fault(
            BACKUP, "is the manifest of another state (an export that is running or was stopped)", kind="unfinished"
        )


def _check_strays(dataset: Dataset, root: Path, known: set[str], found: Verification) -> Iterator[Fault]:
    """Yield files of the dataset that belong to no finished shard; list those that are not its own."""
    layout, options = Layout(dataset.plan, known), dataset.plan.options
    waiting = {
        scene.name
        for scene in dataset.plan.scenes
        if any(record_name(scene.name, shard) not in known for shard in range(scene.num_shards(options)))
    }
    for name, is_folder in files_under(root, DATA_FOLDERS):
        if is_folder or (name in known and not (root / name).is_symlink()):
            continue
        if is_temporary(name):
            yield Fault(name, "has no name yet (an export that is running or was stopped)", kind="unfinished")
        elif (root / name).is_symlink() and layout.is_folder(name):
            found.foreign.append(name)
            yield Fault(name, "is a link where a folder of the dataset belongs")
        elif not layout.owns(name):
            found.foreign.append(name)
        else:
            shard = layout.shard_of(name)
            begun = name.split("/")[1] in waiting if shard is None else record_name(*shard) not in known
            finished = name in known or not begun
            yield Fault(name, STRAY if finished else UNFINISHED_STRAY, kind="damage" if finished else "unfinished")


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


def _check_store(dataset: Dataset, files: RemoteFiles, known: set[str], found: Verification) -> Iterator[Fault]:
    """Yield what is wrong beside the shards of a dataset behind an address, as far as it lists its files."""
    names = files.walk()
    if MANIFEST not in names:
        return
    if dataset.plan.options.layout == "packed":
        yield from _check_manifest(dataset, Path(), known)
    layout = Layout(dataset.plan, known)
    for name in names:
        if name in known or name in MARKED:
            continue
        shard = layout.shard_of(name)
        if not layout.owns(name) or shard is None:
            if not layout.owns(name):
                found.foreign.append(name)
            continue
        finished = record_name(*shard) in known
        yield Fault(name, STRAY if finished else UNFINISHED_STRAY, kind="damage" if finished else "unfinished")
