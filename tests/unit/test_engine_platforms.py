"""Where each system keeps LLVM, CUDA and Metal, on file systems that are simulated: no macOS or Windows was at hand."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from scarl_sionna.core.errors import EngineError, OutputError
from scarl_sionna.core.temporary import is_running, temporary_folder
from scarl_sionna.dataset.store.locks import FileLock
from scarl_sionna.engine.backend import bootstrap, cuda, doctor, platforms
from tests.unit.test_engine import build_library, usable_llvm
from tests.unit.test_engine_cuda import DRIVER, LIBRARIES, build

SYSTEMS = {
    "Debian": ("Linux", "x86_64", ["usr/lib/x86_64-linux-gnu/libLLVM.so.19.1", "usr/lib/llvm-17/lib/libLLVM.so"]),
    "Debian on ARM": ("Linux", "aarch64", ["usr/lib/aarch64-linux-gnu/libLLVM.so.19.1"]),
    "Fedora": ("Linux", "x86_64", ["usr/lib64/libLLVM.so.20.1", "usr/lib64/llvm18/lib/libLLVM-18.so"]),
    "Alpine": ("Linux", "x86_64", ["usr/lib/llvm20/lib/libLLVM.so.20.1"]),
    "Homebrew, Apple's processor": ("Darwin", "arm64", ["opt/homebrew/opt/llvm/lib/libLLVM.dylib"]),
    "Homebrew, an older one": ("Darwin", "arm64", ["opt/homebrew/opt/llvm@18/lib/libLLVM-18.dylib"]),
    "Homebrew, Intel": ("Darwin", "x86_64", ["usr/local/opt/llvm/lib/libLLVM.dylib"]),
    "MacPorts": ("Darwin", "arm64", ["opt/local/libexec/llvm-19/lib/libLLVM.dylib"]),
    "LLVM's installer": ("Windows", "AMD64", ["Program Files/LLVM/bin/LLVM-C.dll"]),
}


def lay(root: Path, *files: str) -> None:
    for name in files:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(name)  # of its own each, as files of one content are not one file


def found_in(there: platforms.Places, root: Path) -> list[str]:
    candidates = bootstrap.llvm_candidates(there.llvm_folders, there.llvm_patterns)
    return [Path(path).relative_to(root).as_posix() for path in candidates]


@pytest.mark.parametrize("name", SYSTEMS)
def test_llvm_is_found_where_the_system_keeps_it(tmp_path: Path, name: str) -> None:
    system, machine, files = SYSTEMS[name]
    lay(tmp_path, *files, "usr/lib/libclang.so", "Program Files/LLVM/bin/libclang.dll")
    assert found_in(platforms.places(system, machine, tmp_path, {}), tmp_path) == files


def test_each_system_looks_at_its_own_places_only(tmp_path: Path) -> None:
    lay(tmp_path, *(file for _, _, files in SYSTEMS.values() for file in files))
    for system, machine in {(system, machine) for system, machine, _ in SYSTEMS.values()}:
        found = found_in(platforms.places(system, machine, tmp_path, {}), tmp_path)
        foreign = {"Linux": (".dylib", ".dll"), "Darwin": (".so", ".dll"), "Windows": (".so", ".dylib")}[system]
        assert found and not [path for path in found if path.endswith(foreign)], system


def test_a_mac_takes_the_library_of_its_own_processor_first(tmp_path: Path) -> None:
    """Homebrew for Intel and for Apple's processors can stand on one machine, and Python may be either."""
    both = ["opt/homebrew/opt/llvm/lib/libLLVM.dylib", "usr/local/opt/llvm/lib/libLLVM.dylib"]
    lay(tmp_path, *both)
    assert found_in(platforms.places("Darwin", "arm64", tmp_path, {}), tmp_path) == both
    assert found_in(platforms.places("Darwin", "x86_64", tmp_path, {}), tmp_path) == both[::-1]


def test_windows_folders_follow_from_its_variables(tmp_path: Path) -> None:
    lay(
        tmp_path,
        "D/Programs/LLVM/bin/LLVM-C.dll",
        "D/Win/System32/DriverStore/FileRepository/nv_dispi.inf_amd64_1/nvoptix.dll",
    )
    variables = {"ProgramFiles": str(tmp_path / "D/Programs"), "SystemRoot": str(tmp_path / "D/Win")}
    there = platforms.places("Windows", "AMD64", tmp_path, variables)
    assert found_in(there, tmp_path) == ["D/Programs/LLVM/bin/LLVM-C.dll"] and there.machine == "x86_64"
    assert there.cuda == ("nvcuda.dll",) and there.optix[0] == "nvoptix.dll"
    assert Path(there.optix[1]).is_file()


@pytest.mark.parametrize(
    ("system", "remedy"), [("Linux", "apt-get install"), ("Darwin", "brew install"), ("Windows", "winget install")]
)
def test_the_remedy_is_that_of_the_system(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, system: str, remedy: str
) -> None:
    there = platforms.places(system, "arm64", tmp_path, {})
    monkeypatch.setattr(bootstrap, "places", lambda: there)
    assert remedy in bootstrap.llvm_remedy() and "DRJIT_LIBLLVM_PATH" in bootstrap.llvm_remedy()
    assert "pip install" not in bootstrap.llvm_remedy(), "the wheel is for x86-64 Linux"


def test_metal_is_told_and_not_used(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "System/Library/Frameworks/Metal.framework").mkdir(parents=True)
    assert platforms.places("Linux", "x86_64", tmp_path).metal is None
    there = platforms.places("Darwin", "arm64", tmp_path)
    assert there.metal is not None and there.cuda == () and there.optix == ()
    monkeypatch.setattr(doctor, "places", lambda: there)
    (row,) = doctor._metal_findings()
    assert row.status == "ok" and "not used" in row.found and "double precision" in row.found
    monkeypatch.setenv("SCARL_BACKEND", "metal")
    with pytest.raises(EngineError, match=r"SCARL_BACKEND = 'metal'.*double precision.*SCARL_BACKEND=llvm"):
        bootstrap.ensure_engine.__wrapped__()


def test_a_mac_is_not_asked_for_cuda(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("DRJIT_LIBCUDA_PATH", raising=False)
    monkeypatch.setattr(cuda, "places", lambda: platforms.places("Darwin", "arm64", tmp_path))
    cuda.find_cuda.cache_clear()
    assert cuda.find_cuda() is None
    cuda.find_cuda.cache_clear()


def test_the_driver_of_a_linux_under_windows_is_found(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """WSL keeps NVIDIA's libraries where the loader does not always look."""
    for name in LIBRARIES:
        monkeypatch.setenv(name, "")  # so that it is taken back in the end
    folder = tmp_path / "usr/lib/wsl/lib"
    folder.mkdir(parents=True)
    build(folder, "libcuda.so.1", DRIVER % {"major": 8, "minor": 9, "driver": 12080})
    build(folder, "libnvoptix.so.1", "int x;")
    there = platforms.places("Linux", "x86_64", tmp_path)
    if cuda.loadable(there.cuda[:1]):
        pytest.skip("this machine has a CUDA driver of its own")
    monkeypatch.setattr(cuda, "places", lambda: there)
    cuda.find_cuda.cache_clear()
    assert cuda.cuda_device() == "First Card"
    cuda.activate_cuda()
    assert [Path(os.environ[name]).parent for name in LIBRARIES] == [folder, folder]
    cuda.find_cuda.cache_clear()


def test_an_old_library_of_one_place_is_passed_over_for_a_good_one_of_another(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    monkeypatch.delenv("SCARL_LLVM_DIRS", raising=False)
    old, good = tmp_path / "usr/lib64", tmp_path / "usr/lib64/llvm19/lib64"
    good.mkdir(parents=True)
    build_library(old, "libLLVM.so", "16")
    (good / "libLLVM.so").symlink_to(usable_llvm())
    monkeypatch.setattr(bootstrap, "places", lambda: platforms.places("Linux", "x86_64", tmp_path))
    monkeypatch.setattr(bootstrap.site, "getsitepackages", lambda: [])
    library, refused = bootstrap.find_llvm()
    assert library is not None and library.usable and Path(library.path).parent == good
    (good / "libLLVM.so").unlink()
    library, refused = bootstrap.find_llvm()
    assert library is None and len(refused) == 1 and "16.0.6" in refused[0]


def test_this_machine_is_one_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    here = platforms.places()
    assert here.system in ("Linux", "Darwin", "Windows") and here.llvm_folders
    assert any(folder.is_dir() for folder in here.llvm_folders)


def test_without_posix_locks_an_export_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "fcntl", None)
    with pytest.raises(OutputError, match=r"POSIX file locks.*on Windows use WSL"), FileLock(tmp_path, "export"):
        pass


def test_temporary_folders_where_users_have_no_numbers(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.delattr("os.getuid")
    with temporary_folder() as folder:
        assert folder.is_dir()


def test_windows_is_not_asked_whether_a_process_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """There a signal of number 0 is Ctrl-C."""
    asked: list[Callable[..., None] | tuple[int, ...]] = []
    monkeypatch.setattr("os.kill", lambda *given: asked.append(given))
    monkeypatch.setattr("scarl_sionna.core.temporary.os.name", "nt")
    running = is_running(4_000_000)
    monkeypatch.undo()
    assert running and not asked


@pytest.mark.parametrize(
    ("missing", "remedy"),
    [("libatomic.so.1: cannot open shared object file", "libatomic1"), ("no module named nanobind", "reinstall")],
)
def test_a_dr_jit_that_lacks_a_library_says_what_to_install(
    missing: str, remedy: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "drjit" / "__init__.py"
    package.parent.mkdir()
    package.write_text(f"try:\n    raise ImportError({missing!r})\nexcept ImportError:\n    _drjit_ext.__file__\n")
    monkeypatch.delitem(sys.modules, "drjit", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(EngineError, match=missing[:9]) as refused:
        bootstrap._loaded_drjit()
    assert remedy in str(refused.value)
