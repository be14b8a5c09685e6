"""Read access to the files of a dataset, in a folder or behind an fsspec URL, and writes that survive a power cut."""

from __future__ import annotations

import errno
import hashlib
import os
import re
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Protocol

from scarl_sionna.core.errors import DatasetError, OutputError

from .atomic import partial_path

_SAFE = re.compile(r"[A-Za-z0-9_\-][A-Za-z0-9_.\-]*(/[A-Za-z0-9_\-][A-Za-z0-9_.\-]*)*")
_SYNC_THREADS = 8
_MAKE_TRIES = 100
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.\-]+:(//|:)")


def check_name(name: object, what: str) -> str:
    """Return a name that stands in a file of a dataset, or raise if it could lead out of the dataset's folder.

    Raises
    ------
    DatasetError
        If the name is absolute, climbs up, or has characters that no writer of this project uses.
    """
    if not isinstance(name, str) or not _SAFE.fullmatch(name):
        raise DatasetError(
            f"the {what} {name!r:.80} could lead out of the dataset and is not followed",
            remedy="do not trust this dataset",
        )
    return name


class Files(Protocol):
    """Where a dataset's files are."""

    url: str

    def read(self, name: str, start: int | None = None, stop: int | None = None) -> bytes:
        """Return a file's bytes, or those from `start` to `stop`."""

    def names(self, folder: str) -> list[str]:
        """Return the names in a folder, sorted; none if it is not there."""


class LocalFiles:
    """A folder of this machine."""

    def __init__(self, root: str | Path) -> None:
        self.root = Path(root)
        self.url = str(root)
        self._real = os.path.realpath(self.root)
        self._checked: set[str] = set()

    def path(self, name: str) -> Path:
        """Return the path of a file.

        Raises
        ------
        DatasetError
            If a link leads it out of the dataset's folder.
        """
        path = self.root / name
        folder = os.path.dirname(path)
        if folder not in self._checked or path.is_symlink():
            real = os.path.realpath(path)
            if os.path.commonpath([real, self._real]) != self._real:
                raise DatasetError(
                    f"{name} leads out of the dataset to {real} and is not followed",
                    self.root,
                    "do not trust this dataset",
                )
            self._checked.add(folder)
        return path

    def read(self, name: str, start: int | None = None, stop: int | None = None) -> bytes:
        """Return a file's bytes, or those from `start` to `stop`."""
        with open(self.path(name), "rb") as file:
            if start is not None:
                file.seek(start)
            return file.read() if stop is None else file.read(stop - (start or 0))

    def names(self, folder: str) -> list[str]:
        """Return the names in a folder, sorted; none if it is not there."""
        try:
            return sorted(os.listdir(self.path(folder)))
        except (FileNotFoundError, NotADirectoryError):
            return []


class RemoteFiles:
    """A place behind an fsspec URL, for instance ``s3://bucket/dataset`` or ``https://host/dataset``."""

    def __init__(self, url: str) -> None:
        from scarl_sionna.core.packages import require

        fsspec = require("fsspec", "remote")
        self.url = url
        try:
            self._system, self._root = fsspec.core.url_to_fs(url)
        except (ValueError, ImportError) as error:
            raise DatasetError(
                f"cannot open this address: {error}", url, "install the fsspec package of its protocol"
            ) from error

    def read(self, name: str, start: int | None = None, stop: int | None = None) -> bytes:
        """Return a file's bytes, or those from `start` to `stop`."""
        return bytes(self._system.cat_file(f"{self._root.rstrip('/')}/{name}", start=start, end=stop))

    def names(self, folder: str) -> list[str]:
        """Return the names in a folder, sorted; none if it is not there."""
        try:
            found = self._system.ls(f"{self._root.rstrip('/')}/{folder}", detail=False)
        except (FileNotFoundError, NotADirectoryError):
            return []
        return sorted(str(name).rstrip("/").rpartition("/")[2] for name in found)


def open_files(place: str | Path) -> Files:
    """Return read access to a folder or an fsspec URL."""
    text = os.fspath(place)
    return RemoteFiles(text) if _URL.match(text) else LocalFiles(text)


class Batch:
    """Files that get their names together, once all of their bytes are on the disk.

    Parameters
    ----------
    root : path
        Names are relative to it.
    work : path
        Folder on the same file system for what has no name yet.
    """

    def __init__(self, root: Path, work: Path) -> None:
        self._root, self._work = root, work
        self._files: list[tuple[Path, Path]] = []

    def write(self, name: str, parts: Iterable[bytes]) -> tuple[int, str]:
        """Write a file and return its size [bytes] and SHA-256."""
        digest, size = hashlib.sha256(), 0
        partial = self._work / f"part_{len(self._files):06d}"
        self._files.append((partial, self._root / name))
        with open(partial, "wb") as file:
            for part in parts:
                file.write(part)
                digest.update(part)
                size += len(part)
        return size, digest.hexdigest()

    def publish(self) -> None:
        """Bring all bytes to the disk, then give every file its name."""
        with ThreadPoolExecutor(_SYNC_THREADS) as pool:  # a disk takes many at once in the time of one
            list(pool.map(_sync_path, [partial for partial, _ in self._files]))
            folders = sorted({path.parent for _, path in self._files})
            for folder in folders:
                make_folder(folder)
                self._check_folder(folder)
            for partial, path in self._files:
                if path.is_dir() and not path.is_symlink():
                    raise OutputError(
                        f"{path} is a folder where a file of the dataset belongs; it is kept: move it away"
                    )
                partial.replace(path)
            list(pool.map(_sync_path, folders))

    def _check_folder(self, folder: Path) -> None:
        inside = folder.relative_to(self._root)
        if os.path.realpath(folder) != os.path.join(os.path.realpath(self._root), inside):
            raise OutputError(f"{folder} is reached by a link and is not written to; move the link away")


def _sync_path(path: Path) -> None:
    """Bring a file's bytes, or a folder's names, to the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def make_folder(folder: Path) -> None:
    """Make a folder and those above it, also while another process tidies up empty ones."""
    for left in range(_MAKE_TRIES, -1, -1):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            return
        except FileNotFoundError:
            if left == 0:
                raise


def write_whole(path: Path, data: bytes | str, work: Path | None = None) -> None:
    """Write a file so that it is whole or not there, also after a power cut.

    `work`: folder of the same file system for what has no name yet; default: that of the file.
    """
    partial = partial_path(path if work is None else work / path.name)
    try:
        with open(partial, "wb") as file:
            file.write(data.encode() if isinstance(data, str) else data)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
        _sync_path(path.parent)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


def output_error(path: str | Path, error: OSError) -> OutputError:
    """Return the error of a write that the system refused, with the remedy."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        remedy = "free some space; the same command goes on from what is finished"
    else:
        remedy = "choose a folder that you may write to"
    return OutputError(f"cannot write {path}: {error.strerror or error}; {remedy}")
