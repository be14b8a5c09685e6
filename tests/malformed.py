"""Malformed files of every kind that the project reads, and what its readers make of them.

``python -m tests.malformed KIND,KIND,... COUNT SEED FOLDER`` reads COUNT mutations of the real files of each kind and
prints a line of JSON for every case that did not end as it should: read, or refused by a typed error, within 5 s of CPU
and 2 GB. The last line of a kind has its name, the number of cases and how many of them were refused.
"""

from __future__ import annotations

import json
import os
import random
import re
import resource
import shutil
import signal
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from scarl_sionna.core.errors import ScarlError

SECONDS = 5.0
"""CPU time that a case may take."""
MEMORY = 2_000_000_000
"""Memory that a case may ask for [bytes]."""

EVIL = (
    "-1", "0", "1", "1e30", "-1e30", "1e308", "nan", ".nan", "NaN", "inf", ".inf", "-.inf", "1e400", "100000000",
    "4294967296", "18446744073709551616", "9" * 30, "9" * 5000, "-0.0", "1e-320", "true", "null", "[]", "{}", '""',
    '"x"', "[[]]", "[1, 2]", "[1, [2, [3]]]", "{a: 1}", '{"a": 1}', "../../etc/passwd", "/dev/zero", "\u0000",
    "\ud7ff", "*x", "&x [*x]", "!!python/object:os.system x", "!!int x", "!!binary x", "2001-13-45", "0x", "1_000",
    "18:30", "%", "'", '"', "[" * 40, "[" * 5000, "{" * 40, "<<", "<a>", "</a>", "&amp;", "&x;", ",", ":", "#", "\t",
)  # fmt: skip # a table
"""What replaces a number, a word or a line."""


class TooSlow(BaseException):
    """A case took too much CPU time."""


@dataclass(frozen=True)
class Kind:
    """One kind of input: real files in a folder, the ones that are mutated, and what reads them.

    `evil` makes a case of its own of a number and tells so; otherwise one of `files` is mutated.
    """

    write: Callable[[Path], None]
    files: tuple[str, ...]
    read: Callable[[Path], object]
    evil: Callable[[Path, int], bool] = lambda folder, case: False


def evil_text(*texts: str) -> Callable[[Path, int], bool]:
    """Return what replaces a file in the first cases: texts, a pipe, a folder, nothing."""

    def replace(file: Path, case: int) -> bool:
        whole = [text.encode("utf-8", "surrogatepass") for text in (*texts, "", "\0", "{", "[]", "3", "x" * 100_000)]
        if case >= len(whole) + 4:
            return False
        file.unlink()
        if case < len(whole):
            file.write_bytes(whole[case])
        elif case == len(whole):
            os.mkfifo(file)
        elif case == len(whole) + 1:
            file.mkdir()
        elif case == len(whole) + 2:
            file.symlink_to("/dev/zero")
        return True

    return replace


def mutated(data: bytes, rng: random.Random) -> bytes:
    """Return a file with one to four things changed."""
    is_text = b"\0" not in data[:2000] and _is_text(data)
    for _ in range(rng.choice((1, 1, 2, 4))):
        data = (_mutated_text if is_text and rng.random() < 0.8 else _mutated_bytes)(data, rng)
    return data


def _is_text(data: bytes) -> bool:
    try:
        data.decode()
    except UnicodeDecodeError:
        return False
    return True


def _mutated_bytes(data: bytes, rng: random.Random) -> bytes:
    if not data:
        return b"\0" * rng.randrange(9)
    start = rng.randrange(len(data))
    stop = min(len(data), start + rng.choice((1, 4, 8, 100)))
    block = rng.choice((b"", b"\xff" * (stop - start), b"\0" * (stop - start), b"\x7f" * (stop - start)))
    how = rng.randrange(5)
    if how == 0:
        return data[:start]
    if how == 1:
        flipped = bytearray(data)
        flipped[start] ^= 1 << rng.randrange(8)
        return bytes(flipped)
    if how == 2:
        return data[:start] + rng.randbytes(stop - start) + data[stop:]
    return data[:start] + block + data[stop:]


_WORD = re.compile(rb"[-+]?[0-9][0-9.eE+-]*|[A-Za-z_][A-Za-z_0-9]*")


def _mutated_text(data: bytes, rng: random.Random) -> bytes:
    evil = rng.choice(EVIL).encode("utf-8", "surrogatepass")
    lines = data.split(b"\n")
    number = rng.randrange(len(lines))
    how = rng.randrange(7)
    words = [match.span() for match in _WORD.finditer(data)]
    if how <= 2 and words:
        start, stop = rng.choice(words)
        return data[:start] + evil + data[stop:]
    if how == 3:
        return b"\n".join(lines[:number] + lines[number + 1 :])
    if how == 4:
        return b"\n".join([*lines[:number], lines[number], *lines[number:]])
    if how == 5:
        key, sign, _ = lines[number].partition(rng.choice((b":", b"=", b",", b" ")))
        return b"\n".join([*lines[:number], key + sign + b" " + evil, *lines[number + 1 :]])
    other = rng.randrange(len(lines))
    lines[number], lines[other] = lines[other], lines[number]
    return b"\n".join(lines)


@contextmanager
def bounded() -> Iterator[None]:
    """Let a block raise where it takes too much CPU time."""

    def stop(number: int, frame: object) -> None:
        raise TooSlow(f"more than {SECONDS:g} s")

    timers = ((signal.SIGPROF, signal.ITIMER_PROF, SECONDS), (signal.SIGALRM, signal.ITIMER_REAL, 6.0 * SECONDS))
    for number, timer, seconds in timers:
        signal.signal(number, stop)
        signal.setitimer(timer, seconds)
    try:
        yield
    finally:
        for _, timer, _ in timers:
            signal.setitimer(timer, 0.0)


def bound_memory() -> None:
    """Let allocations fail beyond 2 GB more than this process has now."""
    if resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY:
        return
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    now = next(1024 * int(line.split()[1]) for line in lines if line.startswith("VmSize"))
    resource.setrlimit(resource.RLIMIT_AS, (now + MEMORY, resource.RLIM_INFINITY))


def outcome(read: Callable[[Path], object], folder: Path) -> str:
    """Return "read", or "refused" and why, or the traceback of what should not have been raised."""
    try:
        with bounded(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read(folder)
    except ScarlError as error:
        return f"refused: {error}"[:300]
    except (Exception, TooSlow):
        return traceback.format_exc(limit=-6)
    return "read"


def main(names: list[str], count: int, seed: int, place: Path) -> None:
    """Read mutations of the files of some kinds; print those that did not end as they should, and what was refused."""
    from tests.malformed_kinds import KINDS

    os.fsync = lambda descriptor: None  # type: ignore[assignment]  # the disk's time is not meant
    for name in names:
        whole = place / name / "whole"
        shutil.rmtree(whole, ignore_errors=True)
        whole.mkdir(parents=True)
        KINDS[name].write(whole)
        first = outcome(KINDS[name].read, whole)
        assert first == "read", first
    bound_memory()
    for name in names:
        refused = sum(_case(KINDS[name], name, f"{name} {seed} {case}", place / name) for case in range(count))
        print(json.dumps([name, count, refused]), flush=True)


def _case(kind: Kind, name: str, case: str, place: Path) -> bool:
    """Read one mutation and return whether it was refused."""
    rng, folder, number = random.Random(case), place / "case", int(case.rpartition(" ")[2])
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(place / "whole", folder)
    file = folder / rng.choice(kind.files)
    if not kind.evil(folder, number):
        file.write_bytes(mutated(file.read_bytes(), rng))
    (place / "last").write_text(f"{case} {file.name}")
    found = outcome(kind.read, folder)
    if not found.startswith(("read", "refused")):
        print(json.dumps([name, number, file.name, found]), flush=True)
    return found.startswith("refused")


if __name__ == "__main__":
    main(sys.argv[1].split(","), int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))
