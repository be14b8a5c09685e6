"""What this machine has.

Versions, engine, Mitsuba variants, memory, extras, sensors and scenes, with the remedy for gaps.

Everything that could crash runs in a process of its own, so the report itself always comes out.
"""

from __future__ import annotations

import importlib.util
import os
import platform
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import PackageNotFoundError, entry_points, version
from typing import Literal, NamedTuple

from scarl_sionna.core.cores import usable_cores
from scarl_sionna.core.registry import ENTRY_POINT_GROUP

from . import bootstrap as engine
from .cuda import find_cuda
from .platforms import places

Status = Literal["ok", "warn", "missing"]

REQUIRED_SENSORS = ("radar", "camera", "lidar")
_PACKAGES = (
    "sionna-rt",
    "mitsuba",
    "drjit",
    "numpy",
    "scipy",
    "finufft",
    "pydantic",
    "trimesh",
    "pillow",
    "matplotlib",
    "rich",
    "typer",
    "pyyaml",
)
_EXTRAS = {
    "tensorflow": ("tensorflow",), "dask": ("dask", "distributed"), "llvm": ("tadashi",), "viewer": ("rerun-sdk",),
    "dev": ("pytest", "hypothesis", "ruff", "mypy", "import-linter"),
}  # fmt: skip # a table
_MIN_MEMORY = 4 * 2**30
"""Memory that the main job may take at most [bytes]."""

_KERNELS = {
    "optical": """
mi = __import__("mitsuba")
mi.set_variant(backend + "_ad_rgb")
scene = mi.load_dict({"type": "scene", "light": {"type": "constant"}, "plate": {"type": "rectangle"}})
hit = scene.ray_intersect(mi.Ray3f(mi.Point3f(0, 0, 5), mi.Vector3f(0, 0, -1)))
distance = dr.maximum(hit.t, 0.0)[0]
""",
    "radio": """
mi = __import__("mitsuba")
mi.set_variant(backend + "_ad_mono_polarized")
rt = __import__("sionna.rt").rt
scene = rt.load_scene()
scene.tx_array = scene.rx_array = rt.PlanarArray(num_rows=1, num_cols=1, pattern="iso", polarization="V")
scene.add(rt.Transmitter("tx", position=[0.0, 0.0, 1.0]))
scene.add(rt.Receiver("rx", position=[5.0, 0.0, 1.0]))
distance = dr.maximum(rt.PathSolver()(scene, max_depth=0).tau, 0.0).numpy().max() * 299792458.0
""",
}
"""A ray over 5 m in each twin of a scene; dr.maximum is what an LLVM that is too old aborts at."""

_KERNEL_FRAME = """
import sys
from scarl_sionna.core.errors import EngineError
from scarl_sionna.engine.backend.bootstrap import ensure_engine
try:
    backend = ensure_engine()
except EngineError as error:
    sys.exit(str(error))  # to stderr, without a traceback
import drjit as dr
{kernel}
assert abs(distance - 5.0) < 1e-4, distance  # float32 holds 5 m to 5e-7 m
print("KERNEL", backend)
"""
_KERNEL_TIMEOUT = 180.0
"""Longest time of a kernel's process [s]; on two busy cores it takes a few seconds."""


class Finding(NamedTuple):
    """One row of the report.

    Attributes
    ----------
    name : str
        What was looked for.
    found : str
        What was found.
    status : str
        ``"ok"``; ``"missing"``: required and not there; ``"warn"``: optional or poor.
    remedy : str
        What to do about it; empty if nothing.
    """

    name: str
    found: str
    status: Status = "ok"
    remedy: str = ""


def _installed(package: str) -> str | None:
    """Return the version of an installed distribution, or None."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _package_findings() -> list[Finding]:
    """Look for Python and the required packages."""
    python_ok = sys.version_info >= (3, 10)
    python = Finding(
        "Python",
        f"{platform.python_version()} ({sys.executable})",
        "ok" if python_ok else "missing",
        "" if python_ok else "use Python >= 3.10",
    )
    findings = [python]
    for package in ("scarl-sionna", *_PACKAGES):
        found = _installed(package)
        remedy = "pip install -e ." if package == "scarl-sionna" else f"pip install {package}"
        findings.append(Finding(package, found) if found else Finding(package, "not installed", "missing", remedy))
    return findings


def _metal_findings() -> list[Finding]:
    """Look for Metal, which is not used."""
    metal = places().metal
    return [] if metal is None else [Finding("Metal", f"there, not used: {engine.NO_METAL}; LLVM runs instead")]


def _engine_findings() -> list[Finding]:
    """Look for LLVM, CUDA and Metal."""
    library, refused = engine.find_llvm()
    device = find_cuda()
    usable = device is not None and not device.refusal
    if library is not None:
        llvm = Finding("LLVM", str(library))
    else:
        found = "; ".join(refused) if refused else "none"
        llvm = Finding("LLVM", found, "warn" if usable else "missing", engine.llvm_remedy())
    if device is None:
        cuda = Finding("CUDA device", "none (optional; LLVM runs on the processor)")
    elif device.refusal:
        cuda = Finding("CUDA device", f"{device}, not used", "warn", device.refusal)
    else:
        cuda = Finding("CUDA device", str(device))
    return [llvm, cuda, *_metal_findings()]


def check_variant(twin: str) -> Finding:
    """Trace one ray in the Mitsuba variant of a twin, in a process of its own.

    Parameters
    ----------
    twin : str
        ``"optical"`` or ``"radio"``.
    """
    code = _KERNEL_FRAME.format(kernel=_KERNELS[twin])
    name = f"Mitsuba variant, {twin}"
    try:
        done = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            timeout=_KERNEL_TIMEOUT,
            stdin=subprocess.DEVNULL,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Finding(name, f"no answer in {_KERNEL_TIMEOUT:.0f} s", "missing", "see docs/install.md")
    words = done.stdout.split()
    if done.returncode == 0 and words[-2:-1] == ["KERNEL"]:
        suffix = {"optical": "ad_rgb", "radio": "ad_mono_polarized"}[twin]
        return Finding(name, f"{words[-1]}_{suffix} traces rays")
    reason = (done.stderr.strip().splitlines() or [f"the process ended with status {done.returncode}"])[-1]
    return Finding(name, reason[:300], "missing", "see the rows LLVM and CUDA device, and docs/install.md")


def _memory() -> tuple[int, int] | None:
    """Return the total and the available memory [bytes], or None where the system does not tell."""
    try:
        page = os.sysconf("SC_PAGE_SIZE")
        return page * os.sysconf("SC_PHYS_PAGES"), page * os.sysconf("SC_AVPHYS_PAGES")
    except (ValueError, OSError, AttributeError):
        return None


def _machine_findings() -> list[Finding]:
    """Look at processors and memory."""
    findings = [Finding("threads", f"{usable_cores()} of {os.cpu_count()}")]
    memory = _memory()
    if memory is not None:
        total, available = memory
        text = f"{available / 2**30:.1f} GiB free of {total / 2**30:.1f} GiB"
        if total < _MIN_MEMORY:
            findings.append(Finding("memory", text, "warn", "use --quality draft; the full quality may need 4 GiB"))
        else:
            findings.append(Finding("memory", text))
    return findings


def _extra_findings() -> list[Finding]:
    """Look for the optional extras."""
    findings = []
    for extra, packages in _EXTRAS.items():
        found = {package: _installed(package) for package in packages}
        absent = [package for package, number in found.items() if number is None]
        text = ", ".join(f"{package} {number}" for package, number in found.items() if number is not None)
        if absent and extra == "llvm" and engine.find_llvm()[0] is not None:
            findings.append(Finding(f"extra [{extra}]", "not installed, and not needed here"))
        elif absent:
            remedy = f"if wanted: pip install 'scarl-sionna[{extra}]'"
            findings.append(Finding(f"extra [{extra}]", f"not installed: {', '.join(absent)}", "warn", remedy))
        else:
            findings.append(Finding(f"extra [{extra}]", text))
    return findings


def _sensor_findings() -> list[Finding]:
    """Look for the sensors that are registered, whether each one can be found as a module."""
    registered = {entry.name: entry for entry in entry_points(group=ENTRY_POINT_GROUP)}
    findings = []
    for name in [*REQUIRED_SENSORS, *sorted(set(registered) - set(REQUIRED_SENSORS))]:
        entry = registered.get(name)
        if entry is None:
            findings.append(Finding(f"sensor {name}", "not registered", "missing", "pip install -e ."))
            continue
        try:
            present = importlib.util.find_spec(entry.module) is not None
        except ImportError:
            present = False
        if present:
            findings.append(Finding(f"sensor {name}", entry.value))
        else:
            remedy = f"install the package of {entry.module.partition('.')[0]}"
            findings.append(Finding(f"sensor {name}", f"{entry.value} is not there", "missing", remedy))
    return findings


def _scene_findings() -> list[Finding]:
    """Look for the scenes that come with the package."""
    from scarl_sionna.scene.document.find import scene_names

    names = scene_names()
    if not names:
        return [Finding("scenes", "none", "missing", "reinstall; the folder scenes_xml is empty")]
    return [Finding("scenes", ", ".join(names))]


def doctor_report() -> list[Finding]:
    """Return what this machine has and lacks; `scarl-sionna info` shows it.

    Returns
    -------
    list of Finding
        Rows (name, found, status, remedy). A program should exit with 1 if a status is ``"missing"``.
    """
    with ThreadPoolExecutor(len(_KERNELS)) as pool:  # the threads only wait for their processes
        variants = list(pool.map(check_variant, _KERNELS))
    return [
        *_package_findings(),
        *_engine_findings(),
        *variants,
        *_machine_findings(),
        *_extra_findings(),
        *_sensor_findings(),
        *_scene_findings(),
    ]
