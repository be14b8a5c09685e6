"""The arrows between the packages hold, and importing the package starts no engine."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import scarl_sionna

REPO = Path(__file__).resolve().parents[2]
HEAVY = ("mitsuba", "drjit", "sionna", "tensorflow")
MOST_ARGUMENTS = 6
MOST_LONG_FUNCTIONS = 18
"""Functions with more arguments than that; the number may only fall. What stays are public functions with keyword
options."""
OURS = ("scarl_sionna", "scenes_xml", "camera_lidar", "benchmarks", "examples", "tests")
IMPORT = re.compile(r"^[ \t]*from ([\w.]+) import (?:\(([^)]*)\)|([\w, \t]+))", re.MULTILINE)


def imported_by(statement: str) -> set[str]:
    """Return the top-level modules that a fresh interpreter holds after a statement."""
    code = f"{statement}\nimport sys\nprint(*sorted({{name.partition('.')[0] for name in sys.modules}}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=REPO, check=True)
    return set(done.stdout.split())


@pytest.mark.some(1)  # the first imports all the others
@pytest.mark.parametrize(
    "statement",
    [
        "import scarl_sionna.cli",
        "import scarl_sionna",
        "import scarl_sionna; scarl_sionna.RadarSpec; scarl_sionna.Pose; dir(scarl_sionna)",
        "from scarl_sionna.core import registry, results, seeds, semantics, units",
        "import scarl_sionna.engine",
        "from scarl_sionna.engine.backend import bootstrap, doctor",
    ],
)
def test_import_starts_no_engine(statement: str) -> None:
    assert not imported_by(statement) & set(HEAVY)


def test_the_command_line_waits_for_no_science_library() -> None:
    """Its help and the completion of words, at every press of a key, take what this import takes."""
    assert not imported_by("import scarl_sionna.cli") & {"scipy", "trimesh", "shapely", "matplotlib", "zarr", "dask"}


def test_a_scene_of_the_package_waits_for_no_other_format() -> None:
    """Libraries for users' mesh files and for maps take half of the time of all imports."""
    statement = "from scarl_sionna.scenario import compose; from scarl_sionna.engine import load, world"
    assert not imported_by(f"{statement}; from scarl_sionna.radar import sensor") & {"trimesh", "shapely", "matplotlib"}


def test_the_check_sees_an_engine() -> None:
    """The test above can fail: it does see Dr.Jit when it is imported."""
    assert "drjit" in imported_by("import drjit")


@pytest.mark.slow  # `make test` checks them before, with the linters
def test_import_contracts_hold() -> None:
    done = subprocess.run(
        [sys.executable, "-c", "from importlinter.cli import lint_imports_command as run; run()", "--no-cache"],
        capture_output=True,
        text=True,
        cwd=REPO,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 broken" in done.stdout


@dataclass(frozen=True)
class Module:
    """What a module imports, TYPE_CHECKING blocks and functions included, and its functions with many arguments."""

    imports: frozenset[str]
    long_functions: tuple[str, ...]

    @classmethod
    def read(cls, name: str, code: str) -> Module:
        asked: set[str] = set()
        found = []
        for node in ast.walk(ast.parse(code)):
            if isinstance(node, ast.Import):
                asked |= {item.name for item in node.names}
            elif isinstance(node, ast.ImportFrom):
                above = name.split(".")[: -node.level] if node.level else []
                base = ".".join([*above, *([node.module] if node.module else [])])
                asked |= {base} | {f"{base}.{item.name}" for item in node.names}
            elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                count = num_arguments(node.args)
                found += [f"{node.name} ({count})"] * (count > MOST_ARGUMENTS)
        return cls(frozenset(asked), tuple(found))


def num_arguments(taken: ast.arguments) -> int:
    """Return the number of arguments, ``*args`` and ``**kwargs`` among them, without self."""
    entries = [*taken.posonlyargs, *taken.args, *taken.kwonlyargs, taken.vararg, taken.kwarg]
    return sum(entry is not None and entry.arg not in ("self", "cls") for entry in entries)


@pytest.fixture(scope="module")
def modules() -> dict[str, Module]:
    found = {}
    for package in ("scarl_sionna", "camera_lidar"):
        for path in (REPO / package).rglob("*.py"):
            name = ".".join(path.relative_to(REPO).with_suffix("").parts)
            found[name] = Module.read(name, path.read_text(encoding="utf-8"))
    return found


def test_no_file_imports_another_in_a_circle(modules: dict[str, Module]) -> None:
    files = {name: module for name, module in modules.items() if not name.endswith(".__init__")}
    graph = {name: module.imports & files.keys() - {name} for name, module in files.items()}
    assert sum(map(len, graph.values())) > len(graph) > 300
    TopologicalSorter(graph).prepare()  # raises CycleError, which names the circle


def test_the_checkout_weighs_at_most_25_mb() -> None:
    listed = subprocess.run(["git", "ls-files", "-z"], capture_output=True, text=True, cwd=REPO, check=False)
    if listed.returncode != 0:
        pytest.skip("no checkout of git")
    files = [REPO / name for name in listed.stdout.split("\0") if name]
    assert len(files) > 500
    weight = sum(file.lstat().st_size for file in files if file.exists())
    assert weight <= 25e6, "shrink figures (scripts/shrink_figures.py) or pack what scripts build"


def test_folders_hold_at_most_15_modules() -> None:
    for package in ("scarl_sionna", "camera_lidar", "scenes_xml"):
        for folder in [REPO / package, *(path for path in (REPO / package).rglob("*") if path.is_dir())]:
            assert len(list(folder.glob("*.py"))) <= 15, folder


def test_the_count_sees_all_kinds_of_arguments() -> None:
    assert Module.read("a", "def f(a, b, /, c, *d, e, f, **g): ...").long_functions == ("f (7)",)
    assert Module.read("a", "class A:\n    async def f(self, a, b, c, d, e, f): ...").long_functions == ()


def test_no_more_functions_with_many_arguments(modules: dict[str, Module]) -> None:
    found = [f"{name}: {function}" for name, module in modules.items() for function in module.long_functions]
    assert len(found) <= MOST_LONG_FUNCTIONS, "\n".join(found)


def file_of(module: str, root: Path) -> Path | None:
    """Return the file or the folder of a module below a root."""
    place = root.joinpath(*module.split("."))
    found = (place.with_suffix(".py"), place / "__init__.py", place)
    return next((one for one in found if one.exists()), None)


@cache
def names_of(file: Path) -> frozenset[str]:
    """Return the names that the outermost statements of a module, or its stub, bind for sure."""
    stub = file.with_suffix(".pyi")
    found = {path.stem for path in file.parent.iterdir()} if file.name == "__init__.py" else set()
    for node in ast.parse((stub if stub.exists() else file).read_text(encoding="utf-8")).body:
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            found |= {item.asname or item.name.partition(".")[0] for item in node.names}
        elif isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            found.add(node.name)
        elif isinstance(node, ast.Assign):
            bound = (item for target in node.targets for item in ast.walk(target))
            found |= {item.id for item in bound if isinstance(item, ast.Name)}
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value is not None:
            found.add(node.target.id)
    return frozenset(found)


def is_there(module: str, name: str) -> bool:
    """Return whether a module of ours has a name; it is imported only where its text does not tell."""
    file = file_of(module, REPO)
    if file is None:
        return False
    if name in names_of(file) if file.is_file() else file_of(name, file) is not None:
        return True
    return file.is_file() and hasattr(importlib.import_module(module), name)


def imports_of_ours(folder: str) -> Iterator[tuple[str, str, str]]:
    """Yield file, module and name of what scripts import from us, also inside functions and quoted programs."""
    for path in (REPO / folder).rglob("*.py"):
        for module, inside, plain in IMPORT.findall(path.read_text(encoding="utf-8")):
            if folder == "benchmarks" and file_of(module, path.parent) not in (None, path):  # scripts see neighbours
                module = ".".join([*path.parent.relative_to(REPO).parts, module])
            if module.partition(".")[0] in OURS:
                for item in re.sub(r"#.*", "", inside or plain).split(","):
                    if item.strip():
                        yield str(path.relative_to(REPO)), module, item.split()[0]


@pytest.mark.parametrize(("folder", "least"), [("benchmarks", 500), ("examples", 20), ("tests", 3000)])
def test_what_scripts_import_is_there(folder: str, least: int) -> None:
    """A benchmark that nobody has run for a while still starts."""
    found = list(imports_of_ours(folder))
    assert len(found) > least
    assert [one for one in found if not is_there(*one[1:])] == []


def test_the_check_sees_a_name_that_has_moved() -> None:
    assert is_there("scarl_sionna.scenario.openscenario", "SUFFIX") and is_there("scarl_sionna", "RadarSpec")
    assert not is_there("scarl_sionna.core.errors", "SUFFIX") and is_there("scarl_sionna.core.errors", "ScarlError")
    assert not is_there("scarl_sionna.gone", "SUFFIX") and not is_there("benchmarks", "gone")


def test_public_names_resolve() -> None:
    for name in scarl_sionna.__all__:
        assert getattr(scarl_sionna, name) is not None, name
    assert set(scarl_sionna.__all__) <= set(dir(scarl_sionna))


def test_the_list_of_public_names_is_what_the_stub_imports() -> None:
    stub = ast.parse(Path(scarl_sionna.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    imported = [name.name for node in stub.body if isinstance(node, ast.ImportFrom) for name in node.names]
    listed = next(node.value for node in stub.body if isinstance(node, ast.Assign))
    assert sorted(imported) == sorted(ast.literal_eval(listed)) == sorted(scarl_sionna.__all__)


def test_unknown_public_name() -> None:
    with pytest.raises(AttributeError, match="no attribute 'rader'"):
        scarl_sionna.rader  # noqa: B018
