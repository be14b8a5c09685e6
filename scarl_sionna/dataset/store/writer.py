"""A dataset folder that is open for writing: the manifest, the locks of the run, and what of ours is there."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from scarl_sionna.core.errors import DatasetError, DatasetUnreachable, OutputError, ScarlWarning
from scarl_sionna.dataset.encoding import StoreOptions

from .card import dataset_card, unmarked_card
from .files import Files, LocalFiles, holds_text, make_folder, output_error, write_whole
from .layout import (
    CARD,
    CONTACT_SHEET,
    DATA_FOLDERS,
    LOG_FILE,
    MARKED,
    METADATA,
    WORK_FOLDER,
    Layout,
    blocked_folders,
    clear_temporaries,
    clear_work,
    files_under,
    foreign_data,
    foreign_marked,
    is_contact_sheet,
    prune,
    remove_empty,
    remove_file,
)
from .locks import LOCK_FOLDER, FileLock
from .manifest import (
    BACKUP,
    MANIFEST,
    SHARDS,
    DatasetPlan,
    ManifestDamage,
    ManifestForeign,
    ManifestMissing,
    ScenePlan,
    dump_manifest,
    manifest_data,
    plan_of,
    recover_manifest,
)
from .records import (
    Row,
    ShardRecord,
    is_full,
    lost_file,
    meta_name,
    metadata_texts,
    record_name,
    shard_length,
    shard_rows,
)
from .shard_writer import ShardWriter, tidy_shard
from .shards import group_metadata

_RUN = "run"
MANIFEST_SECONDS = 900.0
"""How long to wait for the many jobs of an array that begin or end at once [s]."""


class DatasetFolder:
    """A dataset that this process writes; use it as a context.

    Parameters
    ----------
    root : path
        Made if it is not there.
    plan : DatasetPlan
        Scenes that are there and not in the plan stay; frames that are there are kept.
    overwrite : bool
        Remove the dataset that is there first: its own files (see `layout`) and no other.
    part : str, optional
        Name of this run among several that share the folder (``"0_of_4"``); without it no other run is let in.
    repair : bool
        Leave what is not ours where it is, also in the place of the card.

    Attributes
    ----------
    given : Path
        The folder as the caller names it, for messages.

    Warns
    -----
    ScarlWarning
        On entering and in `finalize`, if files of finished shards are not there with the size that was written, so that
        these shards count as not finished; on entering, if scenes that are there move to another split.

    Raises
    ------
    OutputError
        On entering, if the folder cannot be written, is in use, is no dataset but not empty, holds something that is
        not ours where a file of the dataset belongs (nothing is written then), or holds frames of another
        configuration; the files or the difference are named.
    """

    def __init__(
        self,
        root: str | Path,
        plan: DatasetPlan,
        *,
        overwrite: bool = False,
        part: str | None = None,
        repair: bool = False,
    ) -> None:
        self.given = Path(root)
        self.root = self.given.absolute()  # the same folder after `os.chdir`
        self.plan, self.overwrite, self.part, self.repair = plan, overwrite, part, repair
        self.rows: dict[str, list[Row]] = {}
        self._lost: list[str] = []
        self._told: set[str] = set()
        self._stack = ExitStack()

    def __enter__(self) -> DatasetFolder:
        try:
            self._check_foreign()  # before there is even a lock
            with ExitStack() as stack:
                self._lock(stack)
                with FileLock(
                    self.root, "manifest", timeout=MANIFEST_SECONDS, what="another export writes the manifest"
                ):
                    self._prepare()
                    self._tell_lost()
                self._stack = stack.pop_all()
        except OSError as error:
            if isinstance(error, OutputError):
                raise
            raise output_error(self.root, error) from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    def look(self) -> DatasetPlan:
        """Return the plan in shards as long as it would be carried out here; nothing is written."""
        self._take_shards(self._there())
        return self.plan

    def shard(self, scene: str, shard: int, lock_timeout: float = 120.0) -> ShardWriter:
        """Return the writer of a shard."""
        configuration = self.plan.scene_hash(scene)
        return ShardWriter(self.root, self.plan.scene(scene), shard, self.plan.options, configuration, lock_timeout)

    def is_finished(self, scene: str, shard: int) -> bool:
        """Return whether a shard was finished with all of its frames when the dataset was opened."""
        return is_full(self.rows[scene][shard], self.plan.scene(scene), shard, self.plan.options)

    def finalize(self, *, afresh: bool = False) -> dict[str, Any]:
        """Write the manifest with the checksums of all shards that are there, and the dataset card.

        Return the manifest.

        `afresh` reads the records of all shards, not only of those that the manifest lacks.
        """
        try:
            with FileLock(self.root, "manifest", timeout=MANIFEST_SECONDS, what="another export writes the manifest"):
                there = self._there().manifest
                if there is not None:  # other parts of the export may have added to it
                    self.plan = self.plan.merged(plan_of(there))
                self._lost.clear()
                data = self._write_manifest({} if there is None or afresh else there["shards"], there)
                self._tell_lost()
                self._tidy_work()
                return data
        except OSError as error:
            if isinstance(error, OutputError):
                raise
            raise output_error(self.root, error) from error

    def _lock(self, stack: ExitStack) -> None:
        what = "another export or repair works on it"
        self.root.mkdir(parents=True, exist_ok=True)
        stack.enter_context(FileLock(self.root, _RUN, shared=self.part is not None, what=what))
        if self.part is not None:
            stack.enter_context(
                FileLock(self.root, f"{_RUN}_{self.part}", what=f"another export of the part {self.part}")
            )

    def _tell_lost(self) -> None:
        """Warn of files that are not there and not told yet: without them their shards are not finished."""
        new = [name for name in dict.fromkeys(self._lost) if name not in self._told]
        self._told.update(new)
        if new and not self.repair:
            warnings.warn(
                f"not in {self.address} with the size that was written: {first_few(new)}; their shards count as not "
                "finished, and an export of their drives makes them again",
                ScarlWarning,
                stacklevel=4,
            )

    def _prepare(self) -> None:
        there = self._check_foreign()
        clear_temporaries(self.root, sheet=self.part is None)
        if self.overwrite and self.part is None:
            self._clear(there)
            there = There(self.root)
        old = there.plan or self._plan_of_shards(self._records(there))
        grows = self._merge(old, holds_frames(self.root))
        self._write_manifest({} if there.manifest is None or grows else there.manifest["shards"], there.manifest)
        self._tidy_work()

    def _merge(self, old: DatasetPlan | None, is_begun: bool) -> bool:
        """Add what is planned there to this plan; return whether there is more in it now than there.

        `is_begun`: whether there are frames.

        Raises
        ------
        OutputError
            If they are of another configuration.
        """
        if old is None:
            return True
        changes = self.plan.changes(old)
        if changes and is_begun:
            raise OutputError(
                f"{self.address} holds frames of another configuration ({first_few(changes, '; ')}); choose another "
                "folder or overwrite"
            )
        splits = {scene.name: scene.split for scene in old.scenes}
        moved = [
            f"'{scene.name}' moves from '{splits[scene.name]}' to '{scene.split}'"
            for scene in self.plan.scenes
            if splits.get(scene.name, scene.split) != scene.split
        ]
        if moved and not changes:
            warnings.warn(f"splits of {self.address}: {first_few(moved)}", ScarlWarning, stacklevel=4)
        self.plan = self.plan if changes else self.plan.merged(old)
        return [(s.name, s.num_frames) for s in self.plan.scenes] != [(s.name, s.num_frames) for s in old.scenes]

    @property
    def address(self) -> str:
        """Where the dataset is, for people."""
        return str(self.root)

    def _there(self) -> There:
        return There.look(LocalFiles(self.root), self.root)

    def _check_foreign(self) -> There:
        """Return what of ours is there, or raise if something that is not ours stands in the way; nothing is written.

        Raises
        ------
        OutputError
            With the names of the files.
        """
        if not self.root.is_dir():
            return There(self.root)
        there = self._there()
        self._take_shards(there)
        found = blocked_folders(self.root, [scene.name for scene in self.plan.scenes])
        where = "where files of the dataset belong"
        if not self.repair:
            found += foreign_marked(self.root, not there.is_empty, there.card)
            if there.is_empty:
                found += [name for name in self._others() if name not in found]
                where = "and no dataset"
            if not found:
                scenes = self._changed(there.plan)
                found = foreign_data(self.root, Layout(self.plan), there.layout(scenes), scenes)
        if found:
            raise OutputError(
                f"{self.root} holds other files ({first_few(found)}) {where}; they are kept: choose another folder, "
                "or move them away"
            )
        return there

    def _take_shards(self, there: There) -> None:
        """Go on with shards as long as those of the dataset that is there, where the plan leaves their length free.

        Where the manifest is lost with its copy the records of finished shards tell it.
        """
        if self.overwrite or not self.plan.has_free_shards:
            return
        found = there.plan.options.shard_frames if there.plan else shard_length(self.plan, self._records(there))
        if found is not None:
            self.plan = self.plan.in_shards_of(found)

    def _records(self, there: There) -> dict[tuple[str, int], ShardRecord]:
        """Return the records of the finished shards of the dataset, by scene and number."""
        return there.records()

    def _others(self) -> list[str]:
        """Return what is in a folder that holds no dataset: one belongs in a folder of its own."""
        names = []
        for path in sorted(self.root.iterdir()):
            if path.name in DATA_FOLDERS:
                inside = [name for name, folder in files_under(self.root, [path.name]) if not folder]
                names += [path.name] if any(not _is_group(self.root / name) for name in inside) else []
            elif not path.name.startswith(".") and path.name not in MARKED and not is_contact_sheet(path):
                names.append(path.name)
        return names

    def _changed(self, there: DatasetPlan | None) -> list[str]:
        """Return the scenes that have places for files which the dataset that is there has not."""
        old = {} if there is None or self.plan.changes(there) else {s.name: s.num_frames for s in there.scenes}
        return [scene.name for scene in self.plan.scenes if old.get(scene.name, 0) < scene.num_frames]

    def _plan_of_shards(self, records: Mapping[tuple[str, int], ShardRecord]) -> DatasetPlan | None:
        """Return this plan if the shards that are there are of it, None if there are none.

        For a manifest lost with its copy.
        """
        known = {scene.name: self.plan.scene_hash(scene.name) for scene in self.plan.scenes}
        for (scene, shard), record in records.items():
            name = record_name(scene, shard)
            if record.configuration != known.get(scene):
                raise OutputError(
                    f"{self.address} has lost its {MANIFEST}, and {name} is of another "
                    "configuration; give the configuration that made it, choose another folder or overwrite"
                )
            self._check_lost(name, record)
        return self.plan if records else None

    def _check_lost(self, name: str, record: ShardRecord) -> None:
        """Remove the record of a shard that has lost a file, so that it is made again."""
        if (lost := lost_file(self.root, record)) is not None:
            self._lost.append(lost)
            remove_file(self.root / name)

    def _clear(self, there: There) -> None:
        """Remove a dataset's own files; what is foreign stays.

        Records go first: without its record a shard is not there. The manifest stays until it is replaced, and tells
        what is ours; where it is lost the records tell that, and go last.
        """
        if there.is_empty:
            return
        layout = there.layout()
        names = [*files_under(self.root, reversed(DATA_FOLDERS))]
        if there.plan is None:
            names.sort(key=lambda item: item[0].startswith(f"{SHARDS}/"))
        own = [name for name, is_folder in names if not is_folder and layout.owns(name)]
        for name in own:
            remove_file(self.root / name)
        prune(self.root, own)
        for folder in self.root.glob(f"{WORK_FOLDER}/*/*"):
            clear_work(folder)
        for name in (LOG_FILE, *([CONTACT_SHEET] if is_contact_sheet(self.root / CONTACT_SHEET) else [])):
            remove_file(self.root / name)  # the log is ours, else this export would not have begun

    def _tidy_work(self) -> None:
        """Remove what killed runs left of shards on which no process works.

        All of a finished one, else what has no name yet.
        """
        scenes = {scene.name: scene for scene in self.plan.scenes}
        work = self.root / WORK_FOLDER
        left = {(path.parent.name, path.name) for path in work.glob("*/*")}
        left |= {
            (scene, shard)
            for scene, _, shard in (path.stem.rpartition("_") for path in self.root.glob(f"{LOCK_FOLDER}/*.lock"))
        }
        for scene, shard in sorted(left):
            if scene in scenes and shard.isdigit() and int(shard) < scenes[scene].num_shards(self.plan.options):
                with suppress(OutputError, DatasetError):  # in work, or damaged: that is for others to mend
                    tidy_shard(self.root, scenes[scene], int(shard), self.plan.options)
        for folder in [*work.glob("*"), work]:
            remove_empty(folder)

    def _write_manifest(self, known: Mapping[str, list[Row]], there: dict[str, Any] | None) -> dict[str, Any]:
        """Write card, manifest, its copy, and what of the arrays' metadata differs.

        `there`: the manifest that is there.
        """
        texts: dict[str, str] = {}
        for scene in self.plan.scenes:
            self.rows[scene.name], arrays = shard_rows(
                LocalFiles(self.root), scene, self.plan.options, known.get(scene.name, []), self._lost.append
            )
            texts.update(metadata_texts(scene, arrays, self.plan.options))
        data = manifest_data(self.plan, {scene.name: self.rows[scene.name] for scene in self.plan.scenes})
        manifest = dump_manifest(data)
        foreign = foreign_marked(self.root, True, None if there is None else unmarked_card(there))
        if there is None and MANIFEST not in foreign:
            _write_if_other(self.root, MANIFEST, manifest)  # first of all: it tells that the rest is ours
        texts.update({CARD: dataset_card(data), MANIFEST: manifest, BACKUP: manifest})
        for name, text in texts.items():
            if name not in foreign:
                _write_if_other(self.root, name, text)
        if foreign and not self.repair:
            warnings.warn(
                f"{', '.join(foreign)} in {self.root} became somebody else's during the export and stays",
                ScarlWarning,
                stacklevel=2,
            )
        return data


@dataclass(frozen=True)
class There:
    """What of ours is in a folder: the manifest or its copy, and its plan."""

    root: Path
    manifest: dict[str, Any] | None = None
    plan: DatasetPlan | None = None

    @classmethod
    def look(cls, files: Files, root: Path) -> There:
        """Look into a place; `root`: its folder, or that of what is on its way there.

        Raises
        ------
        OutputError
            If the dataset there is of a newer schema: what is its own is not known.
        """
        try:
            manifest, _ = recover_manifest(files)
            return cls(root, manifest, plan_of(manifest))
        except (ManifestDamage, ManifestMissing, ManifestForeign):
            return cls(root)
        except DatasetUnreachable:
            raise
        except DatasetError as error:
            raise OutputError(f"{error}; or choose another folder") from error

    @property
    def is_empty(self) -> bool:
        """Whether there is no dataset."""
        return self.plan is None and not self.records()

    @property
    def card(self) -> str | None:
        """Text of a card from before cards had a mark."""
        return None if self.manifest is None else unmarked_card(self.manifest)

    def records(self, scenes: Iterable[str] = ("*",)) -> dict[tuple[str, int], ShardRecord]:
        """Return the records of finished shards that are whole."""
        found = {}
        for path in (path for scene in scenes for path in sorted(self.root.glob(f"{SHARDS}/{scene}/*.json"))):
            if path.stem.isdigit():
                with suppress(DatasetError, OSError):
                    record = ShardRecord.load(path)
                    if all(_is_of_scene(name, path.parent.name) for name in record.on_disk):
                        found[path.parent.name, int(path.stem)] = record
        return found

    def layout(self, scenes: Iterable[str] = ("*",)) -> Layout:
        """Return the names that are ours; what only records tell, of some scenes."""
        names: set[str] = set()
        for (scene, shard), record in self.records(scenes).items():
            options = StoreOptions(layout="files" if record.bundle is None else "packed")
            texts = metadata_texts(ScenePlan(scene, 1), record.arrays, options)
            names |= {*record.on_disk, record_name(scene, shard), *texts}
            names |= {meta_name(scene, shard)} if record.bundle is None else set()
        return Layout(self.plan, names)


def first_few(items: Sequence[str], between: str = ", ") -> str:
    """Return the first five of some texts, and how many more there are."""
    more = [f"and {len(items) - 5} more"] if len(items) > 5 else []
    return between.join([*items[:5], *more])


def _is_of_scene(name: str, scene: str) -> bool:
    return any(name.startswith(f"{folder}/{scene}/") for folder in DATA_FOLDERS)


def _is_group(path: Path) -> bool:
    """Return whether a file is the metadata of an empty group, which an export writes as it begins."""
    return path.name == METADATA and holds_text(path, group_metadata())


def _write_if_other(root: Path, name: str, text: str) -> None:
    path = root / name
    if holds_text(path, text):
        return
    make_folder(path.parent)
    if path.is_dir() and not path.is_symlink():
        remove_empty(path)
    write_whole(path, text, root)


def holds_frames(root: Path) -> bool:
    """Return whether a folder holds finished shards or frames."""
    return any(root.glob(f"{SHARDS}/*/*.json")) or any(root.glob(f"{WORK_FOLDER}/*/*/*.pack"))
