"""Temporary folders that a killed process does not leave for ever.

The next one that needs such a folder removes them, and the next export.
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .errors import OutputError

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Numbers of the errors of a disk, a quota or a file that takes no more."""
REFUSED = (errno.EROFS, errno.EACCES, errno.EPERM)
"""Numbers of the errors of a place that is not to be written, or read."""
_PREFIX = "scarl_sionna_" + re.sub(r"[^A-Za-z0-9\-]", "-", socket.gethostname()) + "_"
"""With the machine's name: a number of a process means nothing on another one that shares the folder."""
_NAME = re.compile(rf"{re.escape(_PREFIX)}(\d+)_[A-Za-z0-9_]+")


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Yield an empty folder in the system's place for such; it is removed when the block ends.

    Raises
    ------
    OutputError
        If there is no such place, or it takes no more.
    """
    clear_stale()
    try:
        made = tempfile.TemporaryDirectory(prefix=f"{_PREFIX}{os.getpid()}_")
    except OSError as error:
        raise _refused(error) from error
    with made as folder:
        try:
            yield Path(folder)
        except OutputError:
            raise
        except OSError as error:  # one of a write has no path
            if error.errno in FULL or str(error.filename).startswith(folder):
                raise _refused(error) from error
            raise


def _refused(error: OSError) -> OutputError:
    try:
        place = f"the temporary folder {tempfile.gettempdir()}"
    except OSError:  # none of those that the system knows can be written
        place = "to any temporary folder"
    return OutputError(
        f"cannot write {place}: {error.strerror or error}; free some space there, or set TMPDIR to a folder that you "
        "may write to"
    )


def clear_stale() -> None:
    """Remove the folders of `temporary_folder` whose processes, on this machine and of this user, are gone."""
    with suppress(OSError):
        for path in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
            found = _NAME.fullmatch(path.name)
            if found is None or path.is_symlink() or not path.is_dir() or not _is_mine(path):
                continue
            if not is_running(int(found[1])):
                shutil.rmtree(path, ignore_errors=True)


def _is_mine(path: Path) -> bool:
    """Return whether this user made a folder; Windows has no numbers of users, and a place for each."""
    return not hasattr(os, "getuid") or path.stat().st_uid == os.getuid()


def is_running(process: int) -> bool:
    """Return whether a process of this machine runs, by its number; on Windows, where asking would stop it, always."""
    if os.name == "nt":
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True
