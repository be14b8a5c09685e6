"""Locks between processes that the kernel releases when their holder dies, however it dies."""

from __future__ import annotations

import os
import time
from pathlib import Path
from types import TracebackType

from scarl_sionna.core.errors import OutputError

from .files import output_error

LOCK_FOLDER = ".locks"
_POLL = 0.1


class FileLock:
    """An advisory lock of a file in a dataset's ``.locks`` folder.

    Parameters
    ----------
    root : path
        The dataset.
    name : str
    shared : bool
        Several may hold it shared, or one alone.
    timeout : float
        How long to wait for the others [s].
    what : str
        For the error: what the others do.

    Raises
    ------
    OutputError
        On entering, if it is held by another for longer than `timeout`.
    """

    def __init__(
        self, root: Path, name: str, *, shared: bool = False, timeout: float = 0.0, what: str = "work"
    ) -> None:
        self.path = root / LOCK_FOLDER / f"{name}.lock"
        self.shared, self.timeout, self.what = shared, timeout, what
        self._descriptor: int | None = None

    def __enter__(self) -> FileLock:
        try:
            import fcntl  # reading a dataset needs no lock, and works where there is no fcntl
        except ImportError as error:
            raise OutputError(
                f"{self.path.parent.parent} cannot be locked: writing a dataset needs POSIX file locks, which this "
                "system does not have; on Windows use WSL"
            ) from error
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        except OSError as error:
            raise output_error(self.path, error) from error
        deadline = time.monotonic() + self.timeout
        while True:
            try:
                fcntl.flock(self._descriptor, (fcntl.LOCK_SH if self.shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
                return self
            except BlockingIOError as error:
                if time.monotonic() >= deadline:
                    self.release()
                    raise OutputError(
                        f"{self.path.parent.parent} is in use: {self.what}; wait until it is done, or stop it"
                    ) from error
                time.sleep(_POLL)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()

    def release(self, remove: bool = False) -> None:
        """Release the lock; `remove` deletes its file too, for work that is done for good."""
        if self._descriptor is not None:
            if remove:
                self.path.unlink(missing_ok=True)
            os.close(self._descriptor)
            self._descriptor = None
