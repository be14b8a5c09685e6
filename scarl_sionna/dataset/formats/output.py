"""Output of an exporter: whole or not there, never over something else, with a mark of what made it."""

from __future__ import annotations

import glob
import gzip
import json
import os
import shutil
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from scarl_sionna.core.errors import OutputError
from scarl_sionna.core.temporary import is_running
from scarl_sionna.dataset.store.atomic import PARTIAL, partial_path
from scarl_sionna.dataset.store.files import output_error

MARK = "scarl_view.json"
"""File in every folder that an exporter writes; only a folder with it is ever overwritten."""
FILES = "scarl_view_files.txt.gz"
"""Beside it: the names of the files that the exporter wrote, a line each; only these are ever removed."""
_ASIDE = "old"
_SHOWN = 3


@contextmanager
def whole_folder(out: str | Path, mark: Mapping[str, Any], overwrite: bool = False) -> Iterator[Path]:
    """Yield an empty folder to write to; it gets its name when the block ends without an error.

    Parameters
    ----------
    out : path
        Must not be there; with `overwrite` it may be a folder that an exporter wrote, and that holds nothing else.
    mark : mapping
        Plain data written to `MARK`: what the folder is.
    overwrite : bool

    Raises
    ------
    OutputError
        If `out` is there, or holds files that no exporter wrote, or the folder cannot be written; what was there stays
        then.
    """
    out = Path(out)
    _clear_stale(out)
    if out.exists():
        if out.is_dir() and not any(out.iterdir()):
            pass
        elif not overwrite:
            raise OutputError(f"{out} is there; choose another folder or overwrite (--overwrite)")
        else:
            _check_own(out)
    out = out.absolute()  # the same place after `os.chdir`
    partial = partial_path(out)
    with _typed(out):
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
        try:
            yield partial
            names = "".join(f"{name}\n" for name in sorted(_files(partial)))
            (partial / FILES).write_bytes(gzip.compress(names.encode(), mtime=0))
            (partial / MARK).write_text(json.dumps(dict(mark), indent=1) + "\n", encoding="utf-8")
            _replace_folder(partial, out)
        finally:
            shutil.rmtree(partial, ignore_errors=True)


def _check_own(out: Path) -> None:
    """Raise if a folder is none that an exporter wrote, or if something else is in it, too.

    Raises
    ------
    OutputError
        With the names of what is not ours.
    """
    if not (out / MARK).is_file():
        raise OutputError(f"{out} was not written by an exporter (no {MARK} in it) and is kept; choose another folder")
    try:
        known = set(gzip.decompress((out / FILES).read_bytes()).decode().splitlines())
    except (OSError, EOFError, ValueError, zlib.error) as error:
        raise OutputError(
            f"{out} does not tell which of its files an exporter wrote ({FILES} is lost or damaged) and is kept; "
            "choose another folder, or remove it"
        ) from error
    others = sorted(_files(out) - known - {MARK, FILES})
    if others:
        more = f" and {len(others) - _SHOWN} more" if len(others) > _SHOWN else ""
        raise OutputError(
            f"{out} holds files that no exporter wrote ({', '.join(others[:_SHOWN])}{more}) and is kept; "
            "move them away, or choose another folder"
        )


def _files(folder: Path) -> set[str]:
    """Return the names of all files and links in a folder, relative to it; links are not followed."""
    names = set()
    for place, below, files in os.walk(folder):
        links = [name for name in below if os.path.islink(os.path.join(place, name))]
        names |= {Path(place, name).relative_to(folder).as_posix() for name in [*files, *links]}
    return names


@contextmanager
def whole_output_file(out: str | Path, overwrite: bool, is_ours: Callable[[Path], bool]) -> Iterator[Path]:
    """Yield a temporary file name; it becomes `out` when the block ends without an error.

    Parameters
    ----------
    out : path
    overwrite : bool
        Replace a file that is there, if it is one of ours.
    is_ours : callable
        Tells whether a file is one that this exporter wrote.

    Raises
    ------
    OutputError
        If `out` is there and not to be overwritten, or not ours, or cannot be written.
    """
    out = Path(out)
    _clear_stale(out)
    if out.is_dir():
        raise OutputError(f"{out} is a folder; give the name of a file")
    if out.exists() and not overwrite:
        raise OutputError(f"{out} is there; choose another file or overwrite (--overwrite)")
    if out.exists() and not is_ours(out):
        raise OutputError(f"{out} was not written by this exporter and is kept; choose another file, or move it away")
    out = out.absolute()  # the same place after `os.chdir`
    partial = partial_path(out)
    with _typed(out):
        out.parent.mkdir(parents=True, exist_ok=True)
        try:
            yield partial
            partial.replace(out)
        finally:
            partial.unlink(missing_ok=True)


def _clear_stale(out: Path) -> None:
    """Remove what killed exports to the same place left; a folder that one had moved aside to replace it comes back."""
    with suppress(OSError):
        for stale in sorted(out.parent.glob(f"{glob.escape(PARTIAL + out.name)}_*")):
            process, _, rest = stale.name.removeprefix(f"{PARTIAL}{out.name}_").partition("_")
            if not process.isdigit() or rest not in ("", _ASIDE) or is_running(int(process)):
                continue
            if rest == _ASIDE and not out.exists():
                stale.rename(out)
            elif stale.is_dir():
                shutil.rmtree(stale)
            else:
                stale.unlink()


def _replace_folder(partial: Path, out: Path) -> None:
    if not out.exists():
        partial.rename(out)
        return
    if any(out.iterdir()):
        _check_own(out)  # again: writing may have taken hours
    old = out.with_name(f"{partial.name}_{_ASIDE}")
    out.rename(old)
    try:
        partial.rename(out)
    except OSError:
        old.rename(out)
        raise
    shutil.rmtree(old)


@contextmanager
def _typed(out: Path) -> Iterator[None]:
    """Turn the system's errors into :class:`OutputError` with a remedy."""
    try:
        yield
    except OutputError:
        raise
    except FileNotFoundError:
        raise  # something to read is missing: not the output's fault
    except OSError as error:
        raise output_error(out, error) from error
