"""The engine bootstrap takes an LLVM that works, refuses one that would abort the process, and says the remedy.

What touches Dr.Jit runs in a process of its own, because Dr.Jit reads its environment once.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scarl_sionna.core.errors import EngineError
from scarl_sionna.engine.backend import bootstrap as engine
from scarl_sionna.engine.backend import doctor

KERNEL = """
import drjit as dr
x = dr.llvm.Float([1.0, 4.0, float("nan")])
print("LLVM", dr.detail.llvm_version()[0], "maximum", dr.maximum(x, 2.0)[1])
"""
"""dr.maximum is what LLVM 15 and 16 cannot compile: with them the process ends with SIGABRT."""

ENSURE = "from scarl_sionna.engine.backend.bootstrap import ensure_engine\nprint('backend', ensure_engine())"


def run(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run code in a fresh interpreter with a changed environment."""
    kept = {name: value for name, value in os.environ.items() if name not in ("DRJIT_LIBLLVM_PATH", "SCARL_BACKEND")}
    return subprocess.run(
        [sys.executable, "-c", code], env=kept | environment, capture_output=True, text=True, check=False
    )


def usable_llvm() -> str:
    library, refused = engine.find_llvm()
    assert library is not None, refused
    return library.path


def build_library(folder: Path, name: str, version: str | None) -> Path:
    """Compile a small shared library that answers LLVMGetVersion as told (None: does not have the function)."""
    source, library = folder / "fake.c", folder / name
    body = f"*a = {version}, *b = 0, *c = 6;" if version else ""
    function = "LLVMGetVersion" if version else "something_else"
    source.write_text(f"void {function}(unsigned *a, unsigned *b, unsigned *c) {{ {body} }}\n")
    try:
        subprocess.run(["cc", "-shared", "-fPIC", "-o", library, source], check=True, capture_output=True)
    except FileNotFoundError:
        pytest.skip("needs a C compiler to build a library of another version")
    return library


def test_finds_a_usable_llvm_and_dr_jit_compiles_with_it() -> None:
    done = run(ENSURE + KERNEL, SCARL_BACKEND="llvm")
    assert done.returncode == 0, done.stderr
    assert "backend llvm" in done.stdout
    words = done.stdout.split()
    assert int(words[words.index("LLVM") + 1]) >= engine.MIN_LLVM
    assert words[-1] == "4.0"


@pytest.mark.some(1)
@pytest.mark.parametrize("version", ["15", "16", None])
def test_too_old_llvm_is_refused_and_the_process_lives(tmp_path: Path, version: str | None) -> None:
    library = build_library(tmp_path, "libLLVM.so", version)
    done = run(
        "from scarl_sionna.core.errors import EngineError\n"
        "from scarl_sionna.engine.backend.bootstrap import ensure_engine\n"
        "import sys\n"
        "try:\n    ensure_engine()\nexcept EngineError as error:\n    print(error, 'drjit' in sys.modules)",
        DRJIT_LIBLLVM_PATH=str(library),
        SCARL_LLVM_DIRS=str(tmp_path / "empty"),
        SCARL_BACKEND="llvm",
    )
    assert done.returncode == 0, done.stderr
    for part in ("no LLVM >= 17", str(library), "libllvm19", "scarl-sionna[llvm]", "False"):
        assert part in done.stdout


@pytest.mark.slow
def test_too_old_llvm_in_the_environment_is_replaced_with_a_warning(tmp_path: Path) -> None:
    library = build_library(tmp_path, "libLLVM-15.so.1", "15")
    done = run(ENSURE + KERNEL, DRJIT_LIBLLVM_PATH=str(library), SCARL_BACKEND="llvm")
    assert done.returncode == 0, done.stderr
    assert "maximum 4.0" in done.stdout
    assert "ScarlWarning" in done.stderr and str(library) in done.stderr


@pytest.mark.slow
def test_real_old_llvm_loaded_by_an_earlier_import_is_named() -> None:
    old = [path for path in engine.llvm_candidates(engine._search_dirs()) if engine._major_in_name(path) == 15]
    if not old:
        pytest.skip("needs LLVM 15 installed")
    code = (
        "import drjit\nfrom scarl_sionna.core.errors import EngineError\n"
        "from scarl_sionna.engine.backend.bootstrap import ensure_engine\n"
        "try:\n    ensure_engine()\nexcept EngineError as error:\n    print(error)"
    )
    done = run(code, DRJIT_LIBLLVM_PATH=old[0], SCARL_BACKEND="llvm")
    assert done.returncode == 0, done.stderr
    assert "Dr.Jit runs on LLVM 15" in done.stdout and "imported before" in done.stdout


@pytest.mark.slow
def test_drjit_imported_first_with_a_good_llvm_is_accepted() -> None:
    done = run("import drjit\n" + ENSURE, DRJIT_LIBLLVM_PATH=usable_llvm(), SCARL_BACKEND="llvm")
    assert done.stdout.strip() == "backend llvm", done.stderr


def test_a_crashing_library_does_not_end_the_process(tmp_path: Path) -> None:
    source, library = tmp_path / "crash.c", tmp_path / "libLLVM.so"
    source.write_text("#include <stdlib.h>\n__attribute__((constructor)) static void die(void) { abort(); }\n")
    try:
        subprocess.run(["cc", "-shared", "-fPIC", "-o", library, source], check=True, capture_output=True)
    except FileNotFoundError:
        pytest.skip("needs a C compiler")
    assert engine.probe_llvm(str(library)) is None


def test_probe_of_a_file_that_is_no_library(tmp_path: Path) -> None:
    path = tmp_path / "libLLVM.so"
    path.write_text("not a library")
    assert engine.probe_llvm(str(path)) is None
    assert engine.probe_llvm(str(tmp_path / "missing.so")) is None


def test_candidates_are_sorted_and_told_apart(tmp_path: Path) -> None:
    for name in ("libLLVM-15.so.1", "libLLVM.so.19.1", "libLLVM-17-daa109ce.so", "libLLVMSupport.so", "libclang.so"):
        (tmp_path / name).touch()
    (tmp_path / "libLLVM-19.so").symlink_to("libLLVM.so.19.1")
    found = [Path(path).name for path in engine.llvm_candidates([tmp_path, tmp_path / "missing"])]
    assert found == ["libLLVM.so.19.1", "libLLVM-17-daa109ce.so", "libLLVM-15.so.1"]


def test_libraries_of_a_wheel_bring_their_companions(tmp_path: Path) -> None:
    folder = tmp_path / "tool.libs"
    folder.mkdir()
    for name in ("libLLVM-17-daa109ce.so", "libffi-3a37023a.so.6.0.2", "libtinfo-3a2cb85b.so.6.1", "libgmp-1.so"):
        (folder / name).touch()
    found = engine._companions(str(folder / "libLLVM-17-daa109ce.so"))
    assert [Path(path).name.partition("-")[0] for path in found] == ["libffi", "libtinfo"]
    assert engine._companions("/usr/lib/libLLVM-17.so") == ()


@pytest.mark.parametrize(
    ("modules", "expected"),
    [
        ({"numpy"}, None),
        ({"numpy", "tensorflow"}, "tensorflow"),
        ({"keras"}, "keras"),
        ({"drjit", "tensorflow"}, None),
        ({"tensorflow_datasets"}, None),
    ],
)
def test_modules_that_must_not_come_before_dr_jit(modules: set[str], expected: str | None) -> None:
    assert engine.imported_too_early(modules) == expected


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("tensorflow") is None, reason="needs the extra [tensorflow]")
def test_tensorflow_imported_first_does_not_crash() -> None:
    """Without the bootstrap the same lines end with a segmentation fault at the first kernel (TensorFlow 2.21)."""
    done = run("import tensorflow\n" + ENSURE + KERNEL, SCARL_BACKEND="llvm")
    assert done.returncode == 0, done.stderr
    assert "maximum 4.0" in done.stdout


def test_unknown_backend(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SCARL_BACKEND", "vulkan")
    with pytest.raises(EngineError, match=r"SCARL_BACKEND = 'vulkan'.*cuda, llvm"):
        engine._wanted_backend()


def test_cuda_without_a_device_is_an_error() -> None:
    if engine.cuda_device() is not None:
        pytest.skip("this machine has a CUDA device")
    done = run(ENSURE, SCARL_BACKEND="cuda")
    assert "EngineError" in done.stderr and "no CUDA device" in done.stderr


@pytest.fixture(scope="module")
def report() -> dict[str, doctor.Finding]:
    return {row.name: row for row in doctor.doctor_report()}


def test_doctor_reports_what_runs(report: dict[str, doctor.Finding]) -> None:
    for name in ("Python", "sionna-rt", "mitsuba", "drjit", "numpy", "finufft", "trimesh", "LLVM", "threads", "scenes"):
        assert report[name].found, name
    assert report["numpy"].found == np.__version__
    for twin in ("optical", "radio"):
        row = report[f"Mitsuba variant, {twin}"]
        assert row.status == "ok" and "traces rays" in row.found, row
    assert {f"sensor {name}" for name in doctor.REQUIRED_SENSORS} <= set(report)
    assert all(row.remedy for row in report.values() if row.status != "ok")


def test_doctor_lives_without_an_llvm(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    if engine.cuda_device() is not None:
        pytest.skip("with a CUDA device an LLVM is not required")
    monkeypatch.setenv("SCARL_LLVM_DIRS", str(tmp_path))
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    row = doctor._engine_findings()[0]
    assert row.status == "missing" and "libllvm19" in row.remedy
    variant = doctor.check_variant("optical")
    assert variant.status == "missing" and "no LLVM >= 17" in variant.found


def test_doctor_names_what_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "_PACKAGES", ("numpy", "no-such-package-here"))
    rows = {row.name: row for row in doctor._package_findings()}
    assert rows["numpy"].status == "ok"
    assert rows["no-such-package-here"].status == "missing"
    assert rows["no-such-package-here"].remedy == "pip install no-such-package-here"


def test_available_backends() -> None:
    backends = engine.available_backends()
    assert "llvm" in backends
    assert ("cuda" in backends) == (engine.cuda_device() is not None)
