"""Read access to the files of a dataset, in a folder or behind an fsspec URL, and writes that survive a power cut."""

from __future__ import annotations

import errno
import hashlib
import os
import re
import warnings
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import IO, Protocol, TypeVar

from scarl_sionna.core.errors import DatasetError, DatasetUnreachable, InputFileError, OutputError, ScarlWarning
from scarl_sionna.core.untrusted.files import MEGABYTE, open_regular, read_bytes

from .atomic import partial_path

T = TypeVar("T")

_SAFE = re.compile(r"[A-Za-z0-9_\-][A-Za-z0-9_.\-]*(/[A-Za-z0-9_\-][A-Za-z0-9_.\-]*)*")
_SYNC_THREADS = 8
_MAKE_TRIES = 100
MOST_BYTES = 2**40
"""Largest file that is read."""
MOST_JSON_BYTES = 100 * MEGABYTE
_NO_LISTING = (401, 403, 404, 405, 501)
"""Answers of HTTP servers that give files and list no folders."""
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
        self.root = Path(root).absolute()  # the same folder after `os.chdir`
        self.url = str(self.root)
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
        with open_regular(self.path(name), MOST_BYTES) as file:
            size = os.fstat(file.fileno()).st_size
            first, last = start or 0, size if stop is None else min(stop, size)
            if first < 0:
                raise DatasetError(f"{name} is asked for from byte {first} on: it is shorter than what ends it")
            file.seek(first)
            return file.read(max(last - first, 0))

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
        self._warned = False
        try:
            self._system, self._root = fsspec.core.url_to_fs(url)
        except (ValueError, ImportError) as error:
            raise DatasetError(
                f"cannot open this address: {error}",
                url,
                "install the fsspec package of its protocol (s3: pip install 'scarl-sionna[s3]')",
            ) from error

    def read(self, name: str, start: int | None = None, stop: int | None = None) -> bytes:
        """Return a file's bytes, or those from `start` to `stop`.

        Warns
        -----
        ScarlWarning
            Once, if the server sends whole files where a part was asked for.

        Raises
        ------
        FileNotFoundError
            If the server says that there is no such file.
        DatasetUnreachable
            If it does not answer, or refuses.
        """
        try:
            data = bytes(self._system.cat_file(self._path(name), start=start, end=stop))
        except (FileNotFoundError, NotADirectoryError):
            raise
        except Exception as error:  # every protocol has errors of its own
            raise self._unreachable(name, error) from error
        if stop is not None and len(data) > stop - (start or 0):
            if not self._warned:
                self._warned = True
                warnings.warn(
                    f"{self.url}: the server sends whole files where parts are asked for (no HTTP ranges); "
                    "reading is slow: use another server, or copy the dataset",
                    ScarlWarning,
                    stacklevel=2,
                )
            data = data[start or 0 : stop]
        return data

    def names(self, folder: str) -> list[str]:
        """Return the names in a folder, sorted; none if it is not there, or the server lists no folders.

        Raises
        ------
        DatasetUnreachable
            If the server does not answer.
        """
        try:
            return self._listed(folder)
        except (PermissionError, NotImplementedError):
            return []
        except Exception as error:
            if getattr(error, "status", None) in _NO_LISTING:
                return []
            raise self._unreachable(folder, error) from error

    def _listed(self, folder: str) -> list[str]:
        """Return the names in a folder, sorted; none if it is not there. Errors are those of the server."""
        try:
            self._system.invalidate_cache()  # of listings: another process may be writing
            found = self._system.ls(self._path(folder), detail=False)
        except (FileNotFoundError, NotADirectoryError):
            return []
        return sorted(str(name).rstrip("/").rpartition("/")[2] for name in found)

    def walk(self) -> list[str]:
        """Return the names of all files, sorted; none if the server lists no folders.

        Raises
        ------
        DatasetUnreachable
            If the server does not answer.
        """
        top = self._root.rstrip("/")
        try:
            self._system.invalidate_cache()
            found = self._system.find(top)
        except (FileNotFoundError, NotADirectoryError, NotImplementedError):
            return []
        except Exception as error:
            raise self._unreachable("a list of files", error) from error
        prefix = f"{self._system._strip_protocol(top)}/"
        return sorted(str(name).removeprefix(prefix) for name in found)

    def _path(self, name: str) -> str:
        return f"{self._root.rstrip('/')}/{name}"

    def _unreachable(self, name: str, error: Exception) -> DatasetUnreachable:
        status = getattr(error, "status", None)
        what = f"answers {status} for {name}" if status is not None else f"does not give {name}"
        reason = str(error) or type(error).__name__
        return DatasetUnreachable(
            f"the server {what} ({reason:.200})", self.url, "check the address, the network and your permissions"
        )


class HeldFiles:
    """Files of a dataset, one of which may be held in memory, so that its parts are read at once."""

    def __init__(self, files: Files) -> None:
        self.url, self._files = files.url, files
        self._held: tuple[str, bytes] | None = None

    def hold(self, name: str, data: bytes) -> None:
        """Hold a file, and forget the one before it."""
        self._held = name, data

    def read(self, name: str, start: int | None = None, stop: int | None = None) -> bytes:
        """Return a file's bytes, or those from `start` to `stop`."""
        held = self._held
        return held[1][start:stop] if held is not None and held[0] == name else self._files.read(name, start, stop)

    def names(self, folder: str) -> list[str]:
        """Return the names in a folder, sorted; none if it is not there."""
        return self._files.names(folder)


def read_member(
    files: Files, archive: str, name: str, place: tuple[int, int], start: int | None, stop: int | None
) -> bytes:
    """Return the bytes from `start` to `stop` of a file inside of another one; `place`: where it begins, its length.

    Raises
    ------
    DatasetError
        If they begin before the file does.
    """
    begin, length = place
    first, last = start or 0, length if stop is None else min(stop, length)
    if first < 0:
        raise DatasetError(f"{name} is asked for from byte {first} on: it is shorter than what ends it")
    return files.read(archive, begin + first, begin + last) if last > first else b""


def read_small(files: Files, name: str) -> bytes:
    """Return the bytes of a JSON file.

    Raises
    ------
    DatasetError
        If it is larger than any that is written.
    """
    data = files.read(name, 0, MOST_JSON_BYTES + 1)
    if len(data) > MOST_JSON_BYTES:
        raise DatasetError(f"{name} has more than {MOST_JSON_BYTES} bytes", files.url, "do not trust this dataset")
    return data


def absolute_place(place: str | Path) -> str:
    """Return a folder's path, or an address, so that it means the same in another working folder."""
    text = os.fspath(place)
    return text if _URL.match(text) else str(Path(text).absolute())


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
        with open(self._partial(name), "wb") as file:
            for part in parts:
                file.write(part)
                digest.update(part)
                size += len(part)
        return size, digest.hexdigest()

    def write_with(self, name: str, write: Callable[[IO[bytes]], T]) -> tuple[int, str, T]:
        """Let a function write a file, also back and forth, and return its size [bytes], SHA-256 and the result."""
        with open(self._partial(name), "w+b") as file:
            result = write(file)
            size = file.seek(0, os.SEEK_END)
            file.seek(0)
            return size, hashlib.file_digest(file, "sha256").hexdigest(), result

    def _partial(self, name: str) -> Path:
        partial = self._work / f"part_{len(self._files):06d}"
        self._files.append((partial, self._root / name))
        return partial

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


def holds_text(path: Path, text: str) -> bool:
    """Return whether a file holds a text and nothing else; a folder or a pipe does not."""
    data = text.encode()
    try:
        return read_bytes(path, len(data) + 1) == data
    except (FileNotFoundError, IsADirectoryError, InputFileError):
        return False


def output_error(path: str | Path, error: OSError) -> OutputError:
    """Return the error of a write that the system refused, with the remedy."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        remedy = "free some space; the same command goes on from what is finished"
    else:
        remedy = "choose a folder that you may write to"
    return OutputError(f"cannot write {path}: {error.strerror or error}; {remedy}")
