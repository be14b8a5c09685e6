"""A dataset folder that is open for writing: the manifest, the locks of the run, and a simple writer of frames."""

from __future__ import annotations

import hashlib
import shutil
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

from scarl_sionna.core.errors import DatasetError, OutputError
from scarl_sionna.core.results import Frame
from scarl_sionna.dataset.encoding import StoreOptions, encode_frame

from .atomic import PARTIAL
from .card import dataset_card
from .files import LocalFiles, output_error, write_whole
from .locks import LOCK_FOLDER, FileLock
from .manifest import (
    ARRAYS,
    IMAGES,
    MANIFEST,
    SHARDS,
    DatasetPlan,
    ManifestDamage,
    ScenePlan,
    dump_manifest,
    manifest_data,
    plan_of,
    read_manifest,
)
from .shard_writer import WORK_FOLDER, ShardRecord, ShardWriter, metadata_texts, record_name

CARD = "README.md"
LOG_FILE = "export.log"
_OWN = frozenset({MANIFEST, CARD, LOG_FILE, ARRAYS, IMAGES, SHARDS})
_RUN = "run"
MANIFEST_SECONDS = 900.0
"""How long to wait for the many jobs of an array that begin or end at once [s]."""
Row = list[Any] | None
"""Checksum, number of frames, failed frames and bytes of a shard, as the manifest holds them."""


class DatasetFolder:
    """A dataset that this process writes; use it as a context.

    Parameters
    ----------
    root : path
        Made if it is not there.
    plan : DatasetPlan
        Scenes that are there and not in the plan stay; frames that are there are kept.
    overwrite : bool
        Remove what is there first.
    part : str, optional
        Name of this run among several that share the folder (``"0_of_4"``); without it no other run is let in.

    Raises
    ------
    OutputError
        On entering, if the folder cannot be written, is in use, is no dataset but not empty, or holds frames of another
        configuration; the difference is named.
    """

    def __init__(
        self, root: str | Path, plan: DatasetPlan, *, overwrite: bool = False, part: str | None = None
    ) -> None:
        self.root, self.plan, self.overwrite, self.part = Path(root), plan, overwrite, part
        self.rows: dict[str, list[Row]] = {}
        self._stack = ExitStack()

    def __enter__(self) -> DatasetFolder:
        try:
            with ExitStack() as stack:
                self._lock(stack)
                with FileLock(
                    self.root, "manifest", timeout=MANIFEST_SECONDS, what="another export writes the manifest"
                ):
                    self._prepare()
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

    def shard(self, scene: str, shard: int, lock_timeout: float = 120.0) -> ShardWriter:
        """Return the writer of a shard."""
        configuration = self.plan.scene_hash(scene)
        return ShardWriter(self.root, self.plan.scene(scene), shard, self.plan.options, configuration, lock_timeout)

    def is_finished(self, scene: str, shard: int) -> bool:
        """Return whether a shard was finished with all of its frames when the dataset was opened."""
        return _is_full(self.rows[scene][shard], self.plan.scene(scene), shard, self.plan.options)

    def finalize(self, *, afresh: bool = False) -> dict[str, Any]:
        """Write the manifest with the checksums of all shards that are there, and the dataset card; return the manifest.

        `afresh` reads the records of all shards, not only of those that the manifest lacks.
        """
        try:
            with FileLock(self.root, "manifest", timeout=MANIFEST_SECONDS, what="another export writes the manifest"):
                there = self._manifest_there()
                if there is not None:  # other parts of the export may have added to it
                    self.plan = self.plan.merged(plan_of(there))
                data = self._write_manifest({} if there is None or afresh else there["shards"])
                work = self.root / WORK_FOLDER
                for folder in [*sorted(work.glob("*")), work]:
                    if folder.is_dir() and not any(folder.iterdir()):
                        folder.rmdir()
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

    def _prepare(self) -> None:
        if self.overwrite and self.part is None:
            self._clear()
        manifest = None if self.overwrite else self._manifest_there()
        there = self._plan_there()
        grows = True
        if there is not None:
            changes = self.plan.changes(there)
            if changes and holds_frames(self.root):
                shown = "; ".join(changes[:5]) + (f"; and {len(changes) - 5} more" if len(changes) > 5 else "")
                raise OutputError(
                    f"{self.root} holds frames of another configuration ({shown}); choose another folder or overwrite"
                )
            self.plan = self.plan if changes else self.plan.merged(there)
            grows = [(s.name, s.num_frames) for s in self.plan.scenes] != [(s.name, s.num_frames) for s in there.scenes]
        for stale in self.root.glob(f"{PARTIAL}*"):
            stale.unlink()
        self._write_manifest({} if manifest is None or grows else manifest["shards"])

    def _manifest_there(self) -> dict[str, Any] | None:
        try:
            return read_manifest(LocalFiles(self.root))
        except DatasetError:
            return None

    def _plan_there(self) -> DatasetPlan | None:
        if not (self.root / MANIFEST).exists():
            foreign = [
                path.name for path in self.root.iterdir() if path.name not in _OWN and not path.name.startswith(".")
            ]
            if foreign:
                raise OutputError(
                    f"{self.root} holds other files ({', '.join(sorted(foreign)[:3])}) and no {MANIFEST}; choose another folder"
                )
            return self._plan_of_shards()
        try:
            return plan_of(read_manifest(LocalFiles(self.root)))
        except ManifestDamage:
            return self._plan_of_shards()
        except DatasetError as error:
            raise OutputError(f"{error}; or choose another folder or overwrite") from error

    def _plan_of_shards(self) -> DatasetPlan | None:
        """Return this plan if the shards that are there are of it, None if there are none: for a manifest that is lost."""
        known = {scene.name: self.plan.scene_hash(scene.name) for scene in self.plan.scenes}
        places = [path for path in sorted(self.root.glob(f"{SHARDS}/*/*.json")) if path.stem.isdigit()]
        for path in places:
            try:
                same = ShardRecord.parse(path.read_bytes()).configuration == known.get(path.parent.name)
            except DatasetError:
                same = False
            if not same:
                raise OutputError(
                    f"{self.root} has lost its {MANIFEST}, and {path.relative_to(self.root)} is damaged or of another "
                    "configuration; give the configuration that made it, choose another folder or overwrite"
                )
        return self.plan if places else None

    def _clear(self) -> None:
        """Remove a dataset; a folder that is none stays as it is."""
        if not (self.root / MANIFEST).exists() and not (self.root / SHARDS).exists():
            return
        for path in list(self.root.iterdir()):
            if path.name == LOCK_FOLDER:
                continue
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            else:
                path.unlink()

    def _write_manifest(self, known: Mapping[str, list[Row]]) -> dict[str, Any]:
        for scene in self.plan.scenes:
            self.rows[scene.name], arrays = shard_rows(self.root, scene, self.plan.options, known.get(scene.name, []))
            for name, text in metadata_texts(scene, arrays, self.plan.options).items():
                _write_if_other(self.root / name, text)
        data = manifest_data(self.plan, {scene.name: self.rows[scene.name] for scene in self.plan.scenes})
        _write_if_other(self.root / CARD, dataset_card(data))
        _write_if_other(self.root / MANIFEST, dump_manifest(data))
        return data


def _is_full(row: Row, scene: ScenePlan, shard: int, options: StoreOptions) -> bool:
    return row is not None and row[1] == len(scene.shard_range(shard, options))


def _write_if_other(path: Path, text: str) -> None:
    try:
        if path.read_text(encoding="utf-8") == text:
            return
    except (FileNotFoundError, UnicodeDecodeError):
        path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, text)


def shard_rows(
    root: Path, scene: ScenePlan, options: StoreOptions, known: Sequence[Row] = ()
) -> tuple[list[Row], dict[str, Any]]:
    """Return checksum, frames, failed frames and bytes of each finished shard (None where there is none), and the arrays.

    A shard that `known` lists with all of its frames is not read again: its record is the largest part of a large dataset's
    bookkeeping. The arrays are those of the shards that were read.
    """
    rows: list[Row] = []
    arrays: dict[str, Any] = {}
    for shard in range(scene.num_shards(options)):
        path = root / record_name(scene.name, shard)
        if shard < len(known) and _is_full(known[shard], scene, shard, options) and path.exists():
            rows.append(known[shard])
            continue
        try:
            text = path.read_bytes()
            record = ShardRecord.parse(text)
        except (FileNotFoundError, DatasetError):
            rows.append(None)
            continue
        rows.append([hashlib.sha256(text).hexdigest(), len(record.frames), sorted(record.failed), record.num_bytes])
        arrays.update(record.arrays)
    return rows, arrays


def holds_frames(root: Path) -> bool:
    """Return whether a folder holds finished shards or frames."""
    return any(root.glob(f"{SHARDS}/*/*.json")) or any(root.glob(f"{WORK_FOLDER}/*/*/*.pack"))


def write_dataset(
    root: str | Path,
    rig: Mapping[str, Any],
    scenes: Mapping[str, Iterable[Frame]],
    *,
    options: StoreOptions | None = None,
    configuration: Mapping[str, Any] | None = None,
    overwrite: bool = False,
) -> Path:
    """Write frames that are at hand as a dataset.

    Parameters
    ----------
    root : path
    rig : mapping
        `Rig.to_dict()` of the rig that made all frames.
    scenes : mapping of str to iterable of Frame
        Frames by scene; their indices begin at 0 and have no gaps.
    options : StoreOptions, optional
    configuration : mapping, optional
        Plain data on how the frames were made, the same for all scenes.
    overwrite : bool
        Remove what is there first.

    Raises
    ------
    OutputError
        If the folder cannot be written, holds other data, or a frame has something that the schema does not know.
    """
    options = options or StoreOptions()
    frames = {name: list(items) for name, items in scenes.items()}
    plans = tuple(ScenePlan(name, len(items), configuration or {}) for name, items in frames.items())
    plan = DatasetPlan(rig, plans, options)
    with DatasetFolder(root, plan, overwrite=overwrite) as folder, ThreadPoolExecutor(2) as pool:
        for name, items in frames.items():
            shards = defaultdict(list)
            for frame in items:
                shards[frame.index // options.shard_frames].append(frame)
            for number, group in shards.items():
                with folder.shard(name, number) as shard:
                    for frame in group:
                        if frame.index in shard.missing:
                            shard.add(encode_frame(frame, options, pool))
                    shard.commit()
        folder.finalize()
    return Path(root)
