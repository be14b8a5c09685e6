"""Datasets as files that nobody vouches for: in a folder, and in archives."""

from __future__ import annotations

import json
import random
import shutil
import zipfile
from collections.abc import Mapping
from pathlib import Path

from tests.malformed import Kind, evil_text, mutated


def _write_dataset(folder: Path) -> None:
    from scarl_sionna.dataset.encoding import StoreOptions
    from scarl_sionna.dataset.write import write_dataset
    from tests.frames import RIG as SMALL
    from tests.frames import make_frame

    frames = [make_frame(index) for index in range(3)]
    write_dataset(folder / "d", SMALL.to_dict(), {"a": frames}, options=StoreOptions(shard_frames=2, layout="files"))


def _read_dataset(folder: Path) -> object:
    from scarl_sionna.core.errors import ScarlError
    from scarl_sionna.dataset import open_dataset
    from scarl_sionna.dataset.verify import verify

    errors: list[ScarlError] = []
    try:
        dataset = open_dataset(folder / "d")
        for position in range(len(dataset)):
            try:
                dataset[position].to_frame()
            except ScarlError as error:
                errors.append(error)
        repr(dataset)
    except ScarlError as error:
        errors.append(error)
    try:
        verify(folder / "d", repair=True)
    except ScarlError as error:
        errors.append(error)
    if errors:
        raise errors[0]
    return None


def _evil_dataset(folder: Path, case: int) -> bool:
    """Change values inside of the JSON of a dataset, and put the checksums right that would show it."""
    import hashlib

    if case < 12:
        return evil_text()(folder / "d/manifest.json", case)
    root, rng = folder / "d", random.Random(case)
    (root / "manifest.backup.json").unlink(missing_ok=True)
    manifest = json.loads((root / "manifest.json").read_text())
    if case % 3 == 0:
        _change(manifest, rng)
    else:
        record_file, metas_file = root / "shards/a/000000.json", root / "shards/a/000000.frames.json"
        record, metas = json.loads(record_file.read_text()), json.loads(metas_file.read_text())
        _change(record if case % 3 == 1 else metas, rng)
        text = json.dumps(metas).encode()
        metas_file.write_bytes(text)
        if isinstance(record.get("files"), dict) and case % 3 == 2:
            record["files"]["shards/a/000000.frames.json"] = [len(text), hashlib.sha256(text).hexdigest()]
        text = json.dumps(record).encode()
        record_file.write_bytes(text)
        manifest["shards"]["a"][0][0] = hashlib.sha256(text).hexdigest()
    (root / "manifest.json").write_text(json.dumps(manifest))
    return case % 5 != 0


BAD_VALUES = (
    None, True, 0, -1, 1e30, 10**8, 10**30, "", "x", "../x", "/etc/passwd", [], [1], ["x"], {}, {"a": 1}, [[]], 1.5,
)  # fmt: skip # a table


def _change(data: object, rng: random.Random) -> None:
    """Replace, remove or add one value somewhere in plain data."""
    while True:
        keys = list(data) if isinstance(data, dict) else list(range(len(data)))  # type: ignore[arg-type, call-overload]
        if not keys:
            return
        key = rng.choice(keys)
        inner = data[key]  # type: ignore[index]
        if isinstance(inner, dict | list) and inner and rng.random() < 0.8:
            data = inner
            continue
        how = rng.randrange(6)
        if how == 0:
            del data[key]  # type: ignore[attr-defined]
        else:
            data[key] = rng.choice(BAD_VALUES)  # type: ignore[index]
        return


def _write_archives(folder: Path) -> None:
    from scarl_sionna.dataset.archive import archive_dataset

    _write_dataset(folder)
    archive_dataset(folder / "d", folder / "a")


def _read_archives(folder: Path) -> object:
    from scarl_sionna.core.errors import ScarlError
    from scarl_sionna.dataset import open_dataset
    from scarl_sionna.dataset.archive import restore_dataset
    from scarl_sionna.dataset.verify import verify

    shutil.rmtree(folder / "back", ignore_errors=True)
    errors: list[ScarlError] = []
    try:
        for frame in open_dataset(folder / "a"):
            frame.to_frame()
    except ScarlError as error:
        errors.append(error)
    for read in (lambda: verify(folder / "a"), lambda: restore_dataset(folder / "a", folder / "back")):
        try:
            read()
        except ScarlError as error:
            errors.append(error)
    if errors:
        raise errors[0]
    return None


def _evil_archives(folder: Path, case: int) -> bool:
    """Write an archive anew with a file in it mutated, of another name or compressed, and state its size."""
    if case < 12:
        return evil_text()(folder / "a/archived.json", case)
    rng = random.Random(case)
    index = json.loads((folder / "a/archived.json").read_text())
    if case % 4 == 0:
        _change(index, rng)
    elif case % 4 == 1:
        return False
    else:
        path = folder / ("a/archives/dataset.zip" if case % 4 == 2 else "a/archives/a/000000.zip")
        with zipfile.ZipFile(path) as archive:
            files = {name: archive.read(name) for name in archive.namelist()}
        name = rng.choice(list(files))
        how = rng.randrange(4)
        if how == 0:
            del files[name]
        elif how == 1:
            files[str(rng.choice(BAD_VALUES)) or "."] = files.pop(name)
        else:
            files[name] = mutated(files[name], rng)
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED if case % 11 == 0 else zipfile.ZIP_STORED) as archive:
            for key, content in files.items():
                archive.writestr(key, content)
        if case % 4 == 2:
            index["common"] = path.stat().st_size
        else:
            index["shards"]["a"][0] = path.stat().st_size
    (folder / "a/archived.json").write_text(json.dumps(index))
    return True


DATASETS: Mapping[str, Kind] = {
    "dataset": Kind(
        _write_dataset,
        ("d/manifest.json", "d/shards/a/000000.json", "d/shards/a/000000.frames.json",
         "d/arrays/a/objects/instance/c/0/0", "d/images/a/front/camera/rgb/000000.png"),
        _read_dataset,
        _evil_dataset,
    ),
    "archives": Kind(
        _write_archives,
        ("a/archived.json", "a/archives/dataset.zip", "a/archives/a/000000.zip", "a/archives/a/000001.zip"),
        _read_archives,
        _evil_archives,
    ),
}  # fmt: skip # a table
