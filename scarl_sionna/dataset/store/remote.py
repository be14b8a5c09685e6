"""A dataset that is written to an object store: whole shards, put there as they are finished, and the manifest last.

Objects of such a store appear whole or not at all, so a shard that is there is whole: its ZIP file is put first and its
record last, as on a disk. What is not finished is kept in a folder of this machine, the *scratch*, under the same names
and with the same locks; a finished shard leaves it.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache
from pathlib import Path, PurePosixPath
from types import TracebackType
from typing import Any

from scarl_sionna.core.errors import DatasetError, OutputError

from .card import dataset_card, is_card_text
from .files import RemoteFiles, make_folder, output_error, write_whole
from .layout import CARD, WORK_FOLDER, Layout, prune, remove_empty, remove_file
from .manifest import BACKUP, MANIFEST, SHARDS, DatasetPlan, ScenePlan, dump_manifest, manifest_data
from .records import Row, ShardRecord, record_name, shard_rows
from .writer import DatasetFolder, There, first_few, holds_frames

STORES = ("s3", "s3a", "gs", "gcs", "az", "abfs", "abfss", "oss", "memory")
"""Protocols of places where a file appears whole or not at all."""
_URL = re.compile(r"([A-Za-z][A-Za-z0-9+.\-]*)://.+")


def is_address(place: str | Path) -> bool:
    """Return whether a text is an address, not a folder."""
    return isinstance(place, str) and _URL.fullmatch(place) is not None


def scratch_folder(url: str) -> Path:
    """Return where an export to an address keeps what is not finished: a folder of the user's cache for each."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    name = re.sub(r"[^A-Za-z0-9]+", "_", url.partition("://")[2]).strip("_")[-60:]
    return home / "scarl-sionna" / "exports" / f"{name}_{hashlib.sha256(url.encode()).hexdigest()[:12]}"


class RemoteTarget(RemoteFiles):
    """A place in an object store that files are put to.

    Raises
    ------
    OutputError
        If it is no object store, or the package for its protocol is not installed.
    """

    def __init__(self, url: str) -> None:
        found = _URL.fullmatch(url)
        if found is None or found[1] not in STORES:
            raise OutputError(
                f"cannot export to {url}: give a folder, or an object store, where a file appears whole or not at all "
                f"({', '.join(f'{name}://' for name in STORES[:-1])})"
            )
        super().__init__(url.rstrip("/"))

    def names(self, folder: str) -> list[str]:
        """Return the names in a folder, sorted; none if it is not there.

        Raises
        ------
        OutputError
            If the store does not let it be listed: a manifest of what seems to be nothing would be written.
        """
        try:
            return self._listed(folder)
        except Exception as error:
            raise self._refused(f"a list of {folder}", error) from error

    def write(self, name: str, data: bytes) -> None:
        """Put a small file."""
        try:
            self._system.pipe_file(self._path(name), data)
        except Exception as error:  # every protocol has errors of its own
            raise self._refused(name, error) from error

    def put(self, path: Path, name: str) -> None:
        """Put a file of this machine.

        Raises
        ------
        OutputError
            If the store does not take it, or says another size afterwards.
        """
        try:
            self._system.put_file(str(path), self._path(name))
            self._system.invalidate_cache()
            size = self._system.info(self._path(name))["size"]
        except Exception as error:
            raise self._refused(name, error) from error
        if size != path.stat().st_size:
            raise OutputError(f"{self.url}/{name} has {size} bytes there, {path.stat().st_size} were sent")

    def get(self, name: str, path: Path) -> None:
        """Copy a file to this machine."""
        data = self.read(name)
        try:
            make_folder(path.parent)
            write_whole(path, data)
        except OSError as error:
            raise output_error(path, error) from error

    def remove(self, name: str) -> None:
        """Remove a file if it is there."""
        try:
            self._system.rm_file(self._path(name))
        except FileNotFoundError:
            pass
        except Exception as error:
            raise self._refused(name, error) from error

    def _refused(self, name: str, error: Exception) -> OutputError:
        reason = str(error) or type(error).__name__
        if isinstance(error, PermissionError):
            what, remedy = "refuses", "check your credentials and permissions"
        elif isinstance(error, FileNotFoundError):
            what, remedy = "has no such place for", "make the bucket first"
        else:
            what, remedy = "does not take", "the same command goes on from what is finished"
        return OutputError(f"{self.url} {what} {name} ({reason:.200}); {remedy}")


class RemoteFolder(DatasetFolder):
    """A dataset in an object store that this process writes; use it as a context. See `DatasetFolder`.

    Parameters
    ----------
    url : str
    plan : DatasetPlan
        In the layout "packed".
    overwrite : bool
    part : str, optional
    scratch : path, optional
        Folder of this machine for what is not finished (default: `scratch_folder`).
    repair : bool

    Raises
    ------
    OutputError
        As `DatasetFolder`; if the store refuses, or the layout is "files".
    DatasetError
        If the store does not answer.
    """

    def __init__(
        self,
        url: str,
        plan: DatasetPlan,
        *,
        overwrite: bool = False,
        part: str | None = None,
        scratch: str | Path | None = None,
        repair: bool = False,
    ) -> None:
        self.target = RemoteTarget(url)
        if plan.options.layout != "packed":
            raise OutputError(f"{url} takes datasets of the layout 'packed' only; leave the layout out")
        super().__init__(
            scratch if scratch is not None else scratch_folder(self.target.url),
            plan,
            overwrite=overwrite,
            part=part,
            repair=repair,
        )

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        super().__exit__(kind, error, trace)
        if kind is None and not any(self.root.glob(f"{WORK_FOLDER}/*")):
            for folder in [*self.root.glob(f"{SHARDS}/*"), self.root / SHARDS]:
                remove_empty(folder)

    @property
    def address(self) -> str:
        """Where the dataset is, for people."""
        return self.target.url

    def _there(self) -> There:
        return There.look(self.target, self.root)

    def _records(self, there: There) -> dict[tuple[str, int], ShardRecord]:
        found = {}
        for path in map(PurePosixPath, self.target.walk()):
            if len(path.parts) == 3 and path.parts[0] == SHARDS and path.suffix == ".json" and path.stem.isdigit():
                text = self.target.read(str(path))
                with suppress(DatasetError):
                    found[path.parent.name, int(path.stem)] = ShardRecord.parse(text)
        return found

    def _check_lost(self, name: str, record: ShardRecord) -> None:
        """Nothing: the rows of the manifest are made of shards whose ZIP file is there."""

    def _check_foreign(self) -> There:
        """Return what of ours is there, or raise if something that is not ours stands there and no dataset."""
        there = self._there()
        self._take_shards(there)
        if there.plan is None and not self.repair:
            found = self.target.walk()
            layout = Layout(self.plan)
            names = [name for name in found if not layout.owns(name) and not (name == CARD and self._has_card())]
            if names:
                raise OutputError(
                    f"{self.address} holds other files ({first_few(names)}) and no dataset; they are kept: choose "
                    "another place"
                )
        return there

    def _prepare(self) -> None:
        there = self._check_foreign()
        if self.overwrite and self.part is None:
            self._clear_remote(there.plan or self.plan)
            there = There(self.root)
        old = there.plan or self._plan_of_shards(self._records(there))
        begun = there.manifest is not None and any(any(rows) for rows in there.manifest["shards"].values())
        grows = self._merge(old, begun or holds_frames(self.root))
        self._write_manifest({} if there.manifest is None or grows else there.manifest["shards"], there.manifest)
        self._tidy_shards()
        self._tidy_work()

    def _tidy_shards(self) -> None:
        """Remove shards from the scratch that are there already, or of another configuration."""
        hashes = {scene.name: self.plan.scene_hash(scene.name) for scene in self.plan.scenes}
        for (scene, shard), record in There(self.root).records().items():
            if record.configuration != hashes.get(scene):
                for name in (record_name(scene, shard), *record.on_disk):
                    remove_file(self.root / name)
        for path in self.root.glob(f"{SHARDS}/*/*"):  # of a process that was killed when it had put them
            scene, number = path.parent.name, path.stem
            if (
                number.isdigit()
                and int(number) < len(self.rows.get(scene, []))
                and self.is_finished(scene, int(number))
            ):
                remove_file(path)

    def _clear_remote(self, plan: DatasetPlan) -> None:
        """Remove a dataset's own files; records go first, the manifest stays until it is replaced."""
        layout = Layout(plan)
        own = [name for name in self.target.walk() if layout.owns(name)]
        for name in sorted(own, key=lambda name: not name.endswith(".json")):
            self.target.remove(name)

    def _write_manifest(self, known: Mapping[str, list[Row]], there: dict[str, Any] | None) -> dict[str, Any]:
        """Put card, copy of the manifest and manifest, those that differ; the manifest first where there is none."""
        for scene in self.plan.scenes:
            self.rows[scene.name], _ = shard_rows(
                self.target, scene, self.plan.options, known.get(scene.name, []), self._lost.append
            )
        data = manifest_data(self.plan, {scene.name: self.rows[scene.name] for scene in self.plan.scenes})
        manifest = dump_manifest(data)
        texts = {CARD: dataset_card(data), BACKUP: manifest, MANIFEST: manifest}
        names = list(texts) if there is not None else [MANIFEST, CARD, BACKUP]
        for name in names:
            old = self._text(name)
            is_theirs = name == CARD and old is not None and not is_card_text(old)
            if old != texts[name] and not is_theirs:
                self.target.write(name, texts[name].encode())
        return data

    def _has_card(self) -> bool:
        text = self._text(CARD)
        return text is not None and is_card_text(text)

    def _text(self, name: str) -> str | None:
        try:
            return self.target.read(name).decode()
        except (FileNotFoundError, UnicodeDecodeError):
            return None


@lru_cache(maxsize=4)
def _target(url: str) -> RemoteTarget:
    return RemoteTarget(url)


def fetch_shard(url: str, root: Path, scene: ScenePlan, shard: int) -> None:
    """Copy a shard that lacks frames to this machine, so that it can be made whole; nothing if it is here or not there.

    Raises
    ------
    DatasetError
        If the store does not give it, or it is not what was written.
    """
    target, name = _target(url), record_name(scene.name, shard)
    if (root / name).exists():
        return
    try:
        text = target.read(name)
    except FileNotFoundError:
        return
    record = ShardRecord.parse(text, f"{url}/{name}")
    for file, (size, digest) in record.on_disk.items():
        target.get(file, root / file)
        data = (root / file).read_bytes()
        if (len(data), hashlib.sha256(data).hexdigest()) != (size, digest):
            raise DatasetError(f"{file} is not what was written", url, "run `scarl-sionna verify --repair` first")
    write_whole(root / name, text)


def send_shard(url: str, root: Path, scene: ScenePlan, shard: int, record: ShardRecord) -> None:
    """Put a finished shard into the store, its record last, and remove it here.

    Raises
    ------
    OutputError
        If the store does not take it; it stays here then.
    """
    target, name = _target(url), record_name(scene.name, shard)
    target.remove(name)  # of the shard before frames were added: without its record a shard is not there
    for file in record.on_disk:
        target.put(root / file, file)
    target.write(name, (root / name).read_bytes())
    for file in (name, *record.on_disk):  # without its record it is not here, either
        remove_file(root / file)
    prune(root, [name])


def check_workers(url: str) -> None:
    """Raise if other processes cannot write to an address.

    Raises
    ------
    OutputError
        For the memory of this process.
    """
    if url.startswith("memory:"):
        raise OutputError(f"{url} is the memory of this process, other processes do not see it; export without workers")
