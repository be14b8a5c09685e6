"""Bootstrap of the ray tracing engine: find an LLVM or a CUDA device that works before Dr.Jit is imported.

Dr.Jit 1.5 accepts LLVM 15 and 16 and then aborts the whole process at its first kernel. So the library is chosen here:
each candidate is asked for its version in a process of its own, the first one that is new enough is handed to Dr.Jit by
``DRJIT_LIBLLVM_PATH``, and where there is none an :class:`~scarl_sionna.core.errors.EngineError` names the remedy.
What is asked of a CUDA device stands in :mod:`.cuda`.

Environment: ``SCARL_BACKEND`` (``llvm`` or ``cuda``) overrides the choice of the backend, ``DRJIT_LIBLLVM_PATH`` names
a library, ``SCARL_LLVM_DIRS`` (folders, separated like PATH) replaces the folders that are searched.
"""

from __future__ import annotations

import ctypes
import os
import re
import site
import sys
import sysconfig
import warnings
from collections.abc import Container, Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType

from scarl_sionna.core.errors import EngineError, ScarlWarning

from .cuda import activate_cuda, cuda_device, find_cuda
from .platforms import places
from .probing import run_probe

MIN_LLVM = 17
"""Oldest LLVM that Dr.Jit 1.5 compiles correctly with (17, 19 and 22 were tried; 15 and 16 abort the process)."""

BACKENDS = ("cuda", "llvm")
NO_METAL = "Metal has no numbers of double precision, which the phases of radar and lidar need"
"""Why a Metal device is not used (Metal Shading Language Specification: there is no type ``double``)."""
_LIBLLVM_VARIABLE = "DRJIT_LIBLLVM_PATH"
_LLVM_PROBE = """
import ctypes, sys
for name in sys.argv[2:]:
    ctypes.CDLL(name)
function = getattr(ctypes.CDLL(sys.argv[1]), "LLVMGetVersion", None)  # new in LLVM 16
parts = [ctypes.c_uint() for _ in range(3)]
if function is not None:
    function(*[ctypes.byref(part) for part in parts])
print("LLVM", *[part.value for part in parts])
"""


@dataclass(frozen=True)
class Llvm:
    """A shared LLVM library.

    Attributes
    ----------
    path : str
    version : tuple of int
        (major, minor, patch); (0, 0, 0) for one older than 16, which cannot tell.
    companions : tuple of str
        Libraries that have to be loaded before it.
    """

    path: str
    version: tuple[int, int, int]
    companions: tuple[str, ...] = ()

    @property
    def usable(self) -> bool:
        """True if Dr.Jit can compile with it."""
        return self.version[0] >= MIN_LLVM

    def __str__(self) -> str:
        version = ".".join(map(str, self.version)) if any(self.version) else "older than 16"
        return f"{self.path} (version {version})"


def _companions(path: str) -> tuple[str, ...]:
    """Return what a library bundled in a wheel needs: libffi and libtinfo of the same ``*.libs`` folder."""
    folder = Path(path).parent
    if folder.suffix != ".libs":
        return ()
    return tuple(str(found) for name in ("libffi-*", "libtinfo-*") for found in sorted(folder.glob(name)))


def probe_llvm(path: str) -> Llvm | None:
    """Ask a library for its version, in a process of its own.

    Parameters
    ----------
    path : str
        A shared library.

    Returns
    -------
    Llvm or None
        None if it cannot be loaded.
    """
    companions = _companions(path)
    words = run_probe(_LLVM_PROBE, path, *companions)
    if len(words) != 4 or words[0] != "LLVM":
        return None
    major, minor, patch = (int(word) for word in words[1:])
    return Llvm(path, (major, minor, patch), companions)


def _search_dirs() -> list[Path]:
    """Return the folders to look into, in order: the system's, then those of this Python and its packages."""
    chosen = os.environ.get("SCARL_LLVM_DIRS")
    if chosen:
        return [Path(name) for name in chosen.split(os.pathsep) if name]
    dirs = [*places().llvm_folders, Path(sys.prefix) / "lib", Path(sys.prefix) / "Library/bin"]  # Conda's on Windows
    packages = {sysconfig.get_path("platlib"), *site.getsitepackages(), site.getusersitepackages()}
    for folder in sorted(packages):
        dirs += sorted(Path(folder).glob("*.libs"))
    return dirs


def _major_in_name(path: str) -> int | None:
    """Return the major version that the file's name tells, for instance 19 for ``libLLVM.so.19.1``, or None."""
    found = re.search(r"libLLVM(?:-|\.so\.|\.)(\d+)", Path(path).name)
    return int(found.group(1)) if found else None


def llvm_candidates(dirs: Iterable[Path], patterns: Iterable[str] | None = None) -> list[str]:
    """Return the LLVM libraries in some folders, each once: the new enough ones first, newest first.

    `patterns`: names of the library; default: those of this system.
    """
    names = tuple(patterns or places().llvm_patterns)
    paths: dict[Path, str] = {}
    for folder in dirs:
        for pattern in names:
            for path in sorted(folder.glob(pattern)):
                paths.setdefault(path.resolve(), str(path))
    majors = {path: _major_in_name(path) or _major_in_name(str(real)) for real, path in paths.items()}
    return sorted(paths.values(), key=lambda path: -(majors[path] or MIN_LLVM))  # stable: the folders' order is kept


def find_llvm() -> tuple[Llvm | None, list[str]]:
    """Return the LLVM library that will be used, and what was refused.

    Returns
    -------
    Llvm or None
        The one of ``DRJIT_LIBLLVM_PATH`` if it is usable, else the newest usable one that is found.
    list of str
        The libraries that cannot be used, with the reason.
    """
    named = os.environ.get(_LIBLLVM_VARIABLE)
    refused: list[str] = []
    for path in ([named] if named else []) + llvm_candidates(_search_dirs()):
        major = _major_in_name(path)
        if path != named and major is not None and major < MIN_LLVM:
            refused.append(f"{path} (version {major})")
            continue
        library = probe_llvm(path)
        if library is not None and library.usable:
            return library, refused
        refused.append(f"{path} (cannot be loaded)" if library is None else str(library))
    return None, refused


def available_backends() -> tuple[str, ...]:
    """Return the backends that this machine can run, best first: of ``"cuda"`` and ``"llvm"``."""
    usable = {"cuda": cuda_device() is not None, "llvm": find_llvm()[0] is not None}
    return tuple(name for name in BACKENDS if usable[name])


def imported_too_early(modules: Container[str]) -> str | None:
    """Return the module that must not be imported before Dr.Jit but was, or None.

    TensorFlow carries an LLVM of its own whose symbols mix with the one that Dr.Jit loads, and the process crashes.

    Parameters
    ----------
    modules : container of str
        Names of the imported modules, for instance ``sys.modules``.
    """
    if "drjit" in modules:
        return None
    return next((name for name in ("tensorflow", "keras") if name in modules), None)


def llvm_remedy() -> str:
    """Return what to do on a machine without a usable LLVM."""
    return (
        f"install one: {places().llvm_remedy}, "
        f"or set {_LIBLLVM_VARIABLE} to the shared library of an LLVM >= {MIN_LLVM}"
    )


def _wanted_backend() -> str | None:
    """Return the backend that the environment asks for, or None."""
    wanted = os.environ.get("SCARL_BACKEND", "").strip().lower()
    if wanted == "metal":
        raise EngineError(f"SCARL_BACKEND = 'metal': {NO_METAL}; use SCARL_BACKEND=llvm, or leave it unset")
    if wanted and wanted not in BACKENDS:
        raise EngineError(f"SCARL_BACKEND = '{wanted}' is not a backend (allowed: {', '.join(BACKENDS)}, or unset)")
    return wanted or None


def _activate(library: Llvm, refused: list[str]) -> None:
    """Hand a library to Dr.Jit, loading first what it needs."""
    named = os.environ.get(_LIBLLVM_VARIABLE)
    if named and named != library.path:
        reason = next((text for text in refused if text.startswith(named)), named)
        warnings.warn(
            f"{_LIBLLVM_VARIABLE}: Dr.Jit cannot use {reason}; {library} is taken instead", ScarlWarning, stacklevel=3
        )
    for companion in library.companions:
        ctypes.CDLL(companion)
    early = imported_too_early(sys.modules)
    if early is not None:
        deepbind = getattr(os, "RTLD_DEEPBIND", None)
        if deepbind is None:
            raise EngineError(f"{early} was imported before Dr.Jit; import scarl_sionna.engine before {early}")
        ctypes.CDLL(library.path, mode=os.RTLD_NOW | os.RTLD_LOCAL | deepbind)  # its symbols bind to itself first
    os.environ[_LIBLLVM_VARIABLE] = library.path


def _complete_typing() -> None:
    """Give Python 3.10 the name ``typing.Self``: Sionna RT 2.2 allows that Python, but imports the name from there."""
    if sys.version_info < (3, 11):
        import typing

        import typing_extensions

        if not hasattr(typing, "Self"):
            typing.Self = typing_extensions.Self


def _loaded_drjit() -> ModuleType:
    """Import Dr.Jit; raise what to install where a library of the system that it needs is missing."""
    try:
        import drjit
    except (ImportError, NameError) as error:  # its own look for a reason stumbles over the name that is not there
        reason = error.__context__ or error
        remedy = "reinstall the package 'drjit'"
        if "libatomic" in str(reason):  # a slim Debian has none until a compiler brings it
            remedy = "install 'libatomic1' ('apt-get install libatomic1' as root; 'libatomic' in other distributions)"
        raise EngineError(f"Dr.Jit cannot be loaded: {reason}; {remedy}") from error
    return drjit


def _drjit_has(backend: str) -> bool:
    """Return whether Dr.Jit, now imported, has started a backend."""
    dr = _loaded_drjit()
    return bool(dr.has_backend(dr.JitBackend.LLVM if backend == "llvm" else dr.JitBackend.CUDA))


def _check_loaded(backend: str) -> None:
    """Raise if Dr.Jit, now imported, cannot run a backend."""
    dr = _loaded_drjit()
    if not _drjit_has(backend):
        remedy = llvm_remedy() if backend == "llvm" else "check the NVIDIA driver, or set SCARL_BACKEND=llvm"
        raise EngineError(f"Dr.Jit has no {backend} backend in this process; {remedy}")
    if backend == "llvm" and dr.detail.llvm_version()[0] < MIN_LLVM:
        version = ".".join(map(str, dr.detail.llvm_version()))
        raise EngineError(
            f"Dr.Jit runs on LLVM {version} (allowed: >= {MIN_LLVM}), with which it aborts the process; "
            "drjit was imported "
            "before scarl_sionna could choose: call scarl_sionna.engine.backend.bootstrap.ensure_engine() first, "
            f"or {llvm_remedy()}"
        )


def _no_cuda() -> str:
    """Return why there is no CUDA device to trace rays on, and what to do."""
    found = find_cuda()
    return f"{found} cannot be used: {found.refusal}" if found else "there is no CUDA device; install the NVIDIA driver"


@cache
def ensure_engine() -> str:
    """Make the engine ready and return its backend. Call it before anything imports mitsuba or drjit.

    Returns
    -------
    str
        ``"cuda"`` if a CUDA device can be used, else ``"llvm"``; ``SCARL_BACKEND`` overrides it.

    Raises
    ------
    EngineError
        If there is no usable LLVM (or no CUDA device where one is asked for), if Dr.Jit was imported earlier with an
        LLVM that is too old, if a library that Dr.Jit needs is missing, or if TensorFlow was imported first where that
        cannot be cured.

    Warns
    -----
    ScarlWarning
        If ``DRJIT_LIBLLVM_PATH`` names a library that is too old and another one is taken, or if Dr.Jit cannot start on
        a CUDA device that nobody asked for and LLVM is taken.
    """
    wanted = _wanted_backend()
    if wanted == "cuda" and cuda_device() is None:
        raise EngineError(f"SCARL_BACKEND = 'cuda', but {_no_cuda()}, or set SCARL_BACKEND=llvm")
    backend = wanted or ("cuda" if cuda_device() is not None else "llvm")
    if "drjit" not in sys.modules:
        library, refused = find_llvm()
        if library is not None:
            _activate(library, refused)
        elif backend == "llvm":
            found = f" (found: {'; '.join(refused)})" if refused else ""
            raise EngineError(f"no LLVM >= {MIN_LLVM} on this machine{found}; {llvm_remedy()}")
        if backend == "cuda":
            activate_cuda()
    if backend == "cuda" and wanted is None and not _drjit_has("cuda"):
        warnings.warn(f"Dr.Jit does not start on {find_cuda()}; LLVM is taken instead", ScarlWarning, stacklevel=2)
        backend = "llvm"
    _check_loaded(backend)
    _complete_typing()
    return backend
