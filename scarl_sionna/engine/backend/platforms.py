"""Where each operating system keeps the libraries that Dr.Jit needs: names and places on Linux, macOS and Windows.

Nothing here loads a library. The names are those under which Dr.Jit 1.5 itself asks for them, the places those of the
usual packages (Debian, Fedora, Alpine, Homebrew, MacPorts, Conda, LLVM's own installer, NVIDIA's drivers, WSL).
"""

from __future__ import annotations

import os
import platform
import sys
import sysconfig
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

_MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}
"""Other names of the same processors."""
_METAL = "System/Library/Frameworks/Metal.framework"


@dataclass(frozen=True)
class Places:
    """Names and places on one machine; folders that are not there are in it, too.

    Attributes
    ----------
    system : str
        ``"Linux"``, ``"Darwin"`` or ``"Windows"``; others are taken for a Linux.
    machine : str
        Processor: ``"x86_64"``, ``"aarch64"`` or another.
    llvm_patterns : tuple of str
        Names of LLVM's shared library, as patterns.
    llvm_folders : tuple of Path
        Folders to look into, in order.
    cuda, optix : tuple of str
        Names or paths of the CUDA driver and of OptiX for the system's loader, in order; empty where there are none.
    metal : Path or None
        Apple's Metal, where the machine has it.
    llvm_remedy : str
        How to install an LLVM there.
    """

    system: str
    machine: str
    llvm_patterns: tuple[str, ...]
    llvm_folders: tuple[Path, ...]
    cuda: tuple[str, ...]
    optix: tuple[str, ...]
    metal: Path | None
    llvm_remedy: str


def _unfold(root: Path, *patterns: str) -> tuple[Path, ...]:
    """Return folders below a root, each once: those of a pattern with ``*`` in falling order."""
    folders: list[Path] = []
    for pattern in patterns:
        folders += sorted(root.glob(pattern), reverse=True) if "*" in pattern else [root / pattern]
    return tuple(dict.fromkeys(folders))


def _linux(machine: str, root: Path) -> Places:
    multiarch = sysconfig.get_config_var("MULTIARCH")
    named = [f"usr/lib/{name}" for name in (multiarch, f"{machine}-linux-gnu") if name]
    wheel = ", or 'pip install \"scarl-sionna[llvm]\"' (without root)" if machine == "x86_64" else ""
    return Places(
        system="Linux",
        machine=machine,
        llvm_patterns=("libLLVM.so*", "libLLVM-[0-9]*.so*"),
        llvm_folders=_unfold(
            root,
            *named,
            "usr/lib64",
            "usr/lib",
            "usr/local/lib",
            "usr/lib/llvm-*/lib",  # Debian
            "usr/lib64/llvm[0-9]*/lib*",  # Fedora
            "usr/lib/llvm[0-9]*/lib",  # Alpine
        ),
        cuda=("libcuda.so.1", str(root / "usr/lib/wsl/lib/libcuda.so.1")),
        optix=("libnvoptix.so.1", str(root / "usr/lib/wsl/lib/libnvoptix.so.1")),
        metal=None,
        llvm_remedy=f"'apt-get install libllvm19' (as root), or the package of another distribution{wheel}",
    )


def _darwin(machine: str, root: Path) -> Places:
    homebrew = ("opt/homebrew/opt", "usr/local/opt")  # Apple's processors; Intel's
    own = homebrew if machine == "aarch64" else homebrew[::-1]
    metal = root / _METAL
    return Places(
        system="Darwin",
        machine=machine,
        llvm_patterns=("libLLVM.dylib", "libLLVM-[0-9]*.dylib", "libLLVM.[0-9]*.dylib"),
        llvm_folders=_unfold(
            root,
            *(f"{folder}/{name}/lib" for folder in own for name in ("llvm", "llvm@*")),
            "opt/local/libexec/llvm-*/lib",  # MacPorts
            "usr/local/lib",
        ),
        cuda=(),
        optix=(),
        metal=metal if metal.is_dir() else None,
        llvm_remedy="'brew install llvm'",
    )


def _windows(machine: str, root: Path, environment: Mapping[str, str]) -> Places:
    programs = [environment.get(name) for name in ("ProgramW6432", "ProgramFiles")]
    folders = [Path(folder) / "LLVM/bin" for folder in programs if folder] or [root / "Program Files/LLVM/bin"]
    system = Path(environment.get("SystemRoot") or root / "Windows") / "System32"
    store = sorted(system.glob("DriverStore/FileRepository/nv*/nvoptix.dll"), reverse=True)
    return Places(
        system="Windows",
        machine=machine,
        llvm_patterns=("LLVM-C.dll",),
        llvm_folders=tuple(dict.fromkeys(folders)),
        cuda=("nvcuda.dll",),
        optix=("nvoptix.dll", *map(str, store)),
        metal=None,
        llvm_remedy="'winget install LLVM.LLVM' (LLVM's own installer)",
    )


def places(
    system: str | None = None,
    machine: str | None = None,
    root: str | Path | None = None,
    environment: Mapping[str, str] | None = None,
) -> Places:
    """Return where a machine keeps the libraries.

    Parameters
    ----------
    system, machine : str, optional
        As `platform.system` and `platform.machine` name them; default: this machine.
    root : str or Path, optional
        Where its file system begins; default: that of this machine.
    environment : mapping, optional
        Its environment variables; default: those of this process.
    """
    system = system or platform.system()
    given = (machine or platform.machine()).lower()
    machine = _MACHINES.get(given, given)
    start = Path(root) if root is not None else Path(Path(sys.executable).anchor or "/")
    if system == "Darwin":
        return _darwin(machine, start)
    if system == "Windows":
        return _windows(machine, start, os.environ if environment is None else environment)
    return _linux(machine, start)
