"""Folders of the user's cache.

Filled whole or not at all, by one process at a time, and removed when not used for weeks.
"""

from __future__ import annotations

import errno
import os
import shutil
import stat
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

__all__ = ["DamagedError", "cache_folder", "clean", "fallback_folder", "kept_folder"]

DAY = 86400.0
UNFINISHED = 1.0 * DAY
"""Age after which what a killed process left behind is removed [s]; the longest build takes a minute."""
SUPERSEDED = 14.0 * DAY
"""Time without use after which a folder is removed when another of its name was used later [s]."""
UNUSED = 60.0 * DAY
"""Time without use after which any folder is removed [s]."""
_CLEANED = ("scenes", "models", "maps")
"""Kinds of folders that can be made again at any time."""
_USERS = "actors"
"""Kind of folders that users made of their meshes, and may name in scenarios: they stay."""
_STAMP = 3600.0
"""Use is noted at most this often [s]."""
_PATIENCE = 600.0
"""Longest wait for another process that fills the same folder [s]; without the lock the work is done twice, with one
result."""


class DamagedError(OSError):
    """A file of the package is missing or not what was packed."""


_whole: set[Path] = set()
"""Folders that this process found whole."""


def cache_folder() -> Path:
    """Return where built scenes are kept: ``SCARL_CACHE_DIR``, else ``scarl-sionna`` in the user's cache folder.

    Without a home folder it is `fallback_folder`.
    """
    return _roots()[0]


def fallback_folder() -> Path:
    """Return the folder for temporary files that takes the cache where the user's own cannot be written."""
    return Path(tempfile.gettempdir()) / f"scarl-sionna-{os.getuid() if hasattr(os, 'getuid') else 'user'}"


def _roots() -> tuple[Path, ...]:
    """Return the folders that may hold the cache, the first choice first; a folder that the user chose stands alone."""
    if chosen := os.environ.get("SCARL_CACHE_DIR"):
        return (Path(chosen).expanduser().absolute(),)
    base = os.environ.get("XDG_CACHE_HOME", "")
    if os.path.isabs(base):  # the specification says to pass over any other
        return Path(base) / "scarl-sionna", fallback_folder()
    try:
        return Path.home() / ".cache" / "scarl-sionna", fallback_folder()
    except RuntimeError:  # an account without a home folder
        return (fallback_folder(),)


def kept_folder(kind: str, name: str, files: Sequence[str], fill: Callable[[Path], None]) -> Path:
    """Return a folder of the cache; it is filled first unless all of it is there.

    Parameters
    ----------
    kind, name : str
        The folder is ``<cache>/<kind>/<name>``; a name ends with a dash and a hash of all that decides the content.
    files : sequence of str
        Files by which a whole folder is known, none of them empty.
    fill : callable
        Writes all files into an empty folder; the same bytes whoever calls it.

    Returns
    -------
    pathlib.Path
        A folder that another process sees whole or not at all.

    Raises
    ------
    OSError
        If no cache folder can be written; the message says how to choose another.
    DamagedError
        What `fill` raises where it cannot read what it fills from.

    Warns
    -----
    UserWarning
        If the user's cache folder cannot be written and one for temporary files is used instead.
    """
    roots = _roots()
    for root in roots:
        if _is_own(root) and _is_whole(root / kind / name, files):
            return _used(root / kind / name)
    problem: OSError | None = None
    for root in roots:
        try:
            if root == fallback_folder():
                root.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not _is_own(root):
                raise PermissionError(errno.EACCES, f"{root} belongs to another user")
            folder = _filled(root, kind, name, files, fill)
        except DamagedError:
            raise
        except OSError as error:
            problem = problem or _explained(error, root / kind / name)
            continue
        if problem is not None:
            warnings.warn(f"{problem.strerror}. For now it lies in {folder}", UserWarning, stacklevel=3)
        clean(root)
        return folder
    assert problem is not None
    raise problem


def _explained(error: OSError, folder: Path) -> OSError:
    return OSError(
        error.errno,
        f"cannot write {folder.name} into the cache folder {folder.parent}: {error.strerror or error}; "
        "free space there, or set SCARL_CACHE_DIR to a folder that can be written",
    )


def _is_own(root: Path) -> bool:
    """Return whether a folder may be trusted.

    That among the temporary files must be this user's, since any user can make one there.
    """
    if root != fallback_folder():
        return True
    with suppress(OSError):
        found = root.lstat()
        return stat.S_ISDIR(found.st_mode) and (not hasattr(os, "getuid") or found.st_uid == os.getuid())
    return False


def _is_whole(folder: Path, files: Sequence[str]) -> bool:
    """Return whether all files are there and hold something.

    A folder that was found whole before is checked briefly.
    """
    try:
        for file in files[:1] if folder in _whole else files:
            if (folder / file).stat().st_size == 0:
                return False
    except OSError:
        return False
    _whole.add(folder)
    return True


def _used(folder: Path) -> Path:
    """Note that a folder is in use, by its time of change; one that another user keeps for us stays as it is."""
    with suppress(OSError):
        if time.time() - folder.stat().st_mtime > _STAMP:
            os.utime(folder)
    return folder


def _filled(root: Path, kind: str, name: str, files: Sequence[str], fill: Callable[[Path], None]) -> Path:
    """Fill a folder beside its place and rename it, unless another process was first."""
    folder = root / kind / name
    folder.parent.mkdir(parents=True, exist_ok=True)
    with _locked(root, f"{kind}-{name}", _PATIENCE):
        if _is_whole(folder, files):
            return _used(folder)
        temporary = Path(tempfile.mkdtemp(prefix=f".{name}-", dir=folder.parent))
        try:
            temporary.chmod(0o755)
            fill(temporary)
            _put(temporary, folder, files)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
    return folder


def _put(temporary: Path, folder: Path, files: Sequence[str]) -> None:
    """Give a filled folder its name; one of that name with holes makes way, one that is whole stays."""
    try:
        temporary.rename(folder)
    except OSError:
        if _is_whole(folder, files):  # a process that did not wait for the lock was first, with the same bytes
            return
        _remove(folder)
        temporary.rename(folder)
    _whole.discard(folder)


@contextmanager
def _locked(root: Path, name: str, patience: float) -> Iterator[None]:
    """Hold a lock while a folder is made. Where the file system has no locks, or its holder hangs, go on without."""
    lock = FileLock(root / "locks" / f"{name}.lock", timeout=patience)
    with suppress(Timeout, OSError, NotImplementedError):
        (root / "locks").mkdir(exist_ok=True)
        lock.acquire()
    try:
        yield
    finally:
        lock.release()  # does nothing where it was not acquired


def clean(root: Path, now: float | None = None) -> list[Path]:
    """Remove what can be made again and was not used for weeks, and return the folders that went.

    A folder goes after `SUPERSEDED` without use when another one of its name was used later, else after `UNUSED`. What
    cannot be removed stays.
    """
    now = time.time() if now is None else now
    gone: list[Path] = []
    for kind in (*_CLEANED, _USERS):
        latest: dict[str, float] = {}
        ages: dict[Path, float] = {}
        with suppress(OSError):
            for folder in (root / kind).iterdir():
                ages[folder] = folder.stat().st_mtime
                stem = folder.name.rpartition("-")[0]
                latest[stem] = max(latest.get(stem, 0.0), ages[folder])
        for folder, used in ages.items():
            if folder.name.startswith("."):
                limit = UNFINISHED
            elif kind == _USERS:
                continue
            else:
                limit = SUPERSEDED if used < latest[folder.name.rpartition("-")[0]] else UNUSED
            if now - used > limit:
                gone += _removed(root, kind, folder, used)
    with suppress(OSError):
        for lock in (root / "locks").glob("*.lock"):
            if now - lock.stat().st_mtime > UNUSED:
                lock.unlink()
    return gone


def _removed(root: Path, kind: str, folder: Path, used: float) -> list[Path]:
    """Remove a folder, unless somebody began to use or to fill it meanwhile."""
    try:
        with FileLock(root / "locks" / f"{kind}-{folder.name}.lock", timeout=0):
            if folder.stat().st_mtime != used:
                return []
            _remove(folder)
    except (Timeout, OSError, NotImplementedError):
        return []
    return [folder]


def _remove(folder: Path) -> None:
    """Remove a folder: out of sight in one step, then file by file."""
    _whole.discard(folder)
    away = Path(tempfile.mkdtemp(prefix=".gone-", dir=folder.parent))
    try:
        folder.rename(away / folder.name)
    finally:
        shutil.rmtree(away, ignore_errors=True)
