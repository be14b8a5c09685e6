"""Sample one-line mutants of the code and count how many the tests notice.

An answer to "would a test fail if this were wrong?".

On demand, not in CI: ``python scripts/mutants.py --count 120 --seed 0`` (needs ``pip install cosmic-ray``, which finds
and makes the mutants). Works in a copy, runs for each module only the tests that exercise it, and lists the survivors
for a person to judge.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from difflib import unified_diff
from pathlib import Path

REPO = Path(__file__).resolve().parents[1]

TESTS: dict[str, str] = {
    "signal/plots": "unit/test_prompt_plots",
    "signal/angle": "unit/test_angle unit/test_radar_chain unit/test_prompt_repr physics/test_radar_recovery",
    "signal/detection": (
        "unit/test_detection unit/test_radar_chain physics/test_radar_recovery statistics/test_radar_noise"
    ),
    "radar/path_plot": "unit/test_prompt_plots",
    "radar/synthesis/blocks": "stability/test_methods physics/test_micro_doppler",
    "signal/": (
        "unit/test_radar_chain physics/test_radar_recovery statistics/test_radar_noise physics/test_radar_link "
        "stability/test_wide_array"
    ),
    "radar/labels/": "physics/test_radar_labels",
    "radar/weather/": "physics/test_weather_clutter physics/test_radar_weather physics/test_weather_drops",
    "radar/channel/compose/": (
        "unit/test_mirrors unit/test_mirror_faces unit/test_auto physics/test_hybrid unit/test_channel_plan "
        "physics/test_mirror_faces stability/test_methods unit/test_enclosed_scenes"
    ),
    "radar/channel/raycast/": "unit/test_thinning physics/test_raycast stability/test_raycast unit/test_channel",
    "radar/channel/multipath/": (
        "physics/test_multipath physics/test_diffraction stability/test_multipath unit/test_sionna_paths "
        "physics/test_refraction physics/test_path_slopes"
    ),
    "radar/channel/scatterers": "unit/test_scatterers physics/test_scatterers",
    "radar/channel/sbr/": (
        "unit/test_sbr_rows physics/test_sbr_channel stability/test_sbr_channel physics/test_sbr_channel_bistatic "
        "unit/test_channel "
        "physics/test_sbr_channel_diffuse physics/test_sbr_layers"
    ),
    "radar/optics/replay": "physics/test_calibration_body",
    "radar/optics/": (
        "unit/test_tube_shape unit/test_optics unit/test_rcs physics/test_rcs_shapes physics/test_rcs_parts "
        "physics/test_rcs_fields physics/test_sbr_channel physics/test_radar_near_field"
    ),
    "radar/channel/": (
        "unit/test_channel stability/test_sbr_channel physics/test_sbr_channel physics/test_refraction "
        "unit/test_sionna_paths"
    ),
    "radar/scatterers/": "unit/test_scatterers physics/test_scatterers",
    "radar/synthesis/": (
        "unit/test_synthesis_groups unit/test_radar_chain stability/test_synthesis properties/test_radar_properties "
        "physics/test_radar_motion"
    ),
    "radar/micro_doppler": "physics/test_micro_doppler physics/test_limb_doppler",
    "radar/rcs": "unit/test_rcs physics/test_rcs_shapes physics/test_rcs_fields",
    "radar/": (
        "unit/test_radar_chain physics/test_radar_link physics/test_radar_near_field physics/test_radar_motion "
        "properties/test_radar_properties unit/test_channel physics/test_radar_labels physics/test_multipath "
        "unit/test_radar_paths unit/test_radar_parts"
    ),
    "fusion/": "unit/test_rig physics/test_visibility integration/test_demo_frame",
    "calibration/": (
        "statistics/test_calibration_covariance unit/test_calibration_result unit/test_calibration "
        "physics/test_calibration_gradients physics/test_calibration_body"
    ),
    "batch/": "unit/test_store unit/test_scenario_hash integration/test_export integration/test_scenario_export",
}
"""Test files by the beginning of a module's path; the first that fits counts, the quickest tests stand first."""

DEFAULT = ("signal/", "radar/", "fusion/", "calibration/", "batch/")

OPERATORS = (
    "ReplaceBinaryOperator_Add_Sub", "ReplaceBinaryOperator_Sub_Add", "ReplaceBinaryOperator_Mul_Div",
    "ReplaceBinaryOperator_Div_Mul", "ReplaceBinaryOperator_Pow_Mul", "ReplaceBinaryOperator_Mod_Mul",
    "ReplaceBinaryOperator_BitAnd_BitOr", "ReplaceBinaryOperator_BitOr_BitAnd", "ReplaceComparisonOperator_Lt_GtE",
    "ReplaceComparisonOperator_Lt_LtE", "ReplaceComparisonOperator_Gt_LtE", "ReplaceComparisonOperator_Gt_GtE",
    "ReplaceComparisonOperator_LtE_Lt", "ReplaceComparisonOperator_GtE_Gt", "ReplaceComparisonOperator_Eq_NotEq",
    "ReplaceComparisonOperator_NotEq_Eq", "ReplaceComparisonOperator_Is_IsNot", "ReplaceComparisonOperator_IsNot_Is",
    "ReplaceAndWithOr", "ReplaceOrWithAnd", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "AddNot", "NumberReplacer",
    "ReplaceUnaryOperator_USub_UAdd", "ReplaceUnaryOperator_Delete_Invert", "ReplaceUnaryOperator_Delete_Not",
    "ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "ZeroIterationForLoop",
)  # fmt: skip # a list of names
"""Of cosmic-ray: those whose result is a plausible slip. Others, such as + for |, fail on floats at once and flatter
the rate."""


@dataclass(frozen=True)
class Mutant:
    """One change of one file, and what the tests made of it."""

    path: str
    operator: str
    occurrence: int
    line: int
    outcome: str = ""
    seconds: float = 0.0
    diff: str = ""


def modules(prefixes: Sequence[str]) -> list[Path]:
    """Return the modules under the prefixes, sorted."""
    root = REPO / "scarl_sionna"
    found = [
        path for path in sorted(root.rglob("*.py")) if path.relative_to(root).as_posix().startswith(tuple(prefixes))
    ]
    return [path for path in found if path.name != "__init__.py" or path.stat().st_size > 1000]


def tests_of(path: str) -> list[str]:
    """Return the test files of a module."""
    inside = path.removeprefix("scarl_sionna/")
    names = next(names for prefix, names in TESTS.items() if inside.startswith(prefix))
    return [f"tests/{name}.py" for name in names.split()]


def silent_spans(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Return the spans that are left out.

    These are annotations, decorators, texts of errors and warnings, checks that zip's inputs are as long as each other,
    and numbers at the top of a module: choices that have a chart or a source.
    """
    module = ast.parse(source)
    quiet: list[ast.AST | None] = [node.value for node in module.body if isinstance(node, (ast.Assign, ast.AnnAssign))]
    for node in ast.walk(module):
        if isinstance(node, ast.FunctionDef):
            arguments = [
                *node.args.posonlyargs,
                *node.args.args,
                *node.args.kwonlyargs,
                node.args.vararg,
                node.args.kwarg,
            ]
            quiet += [node.returns, *node.decorator_list, *(item.annotation for item in arguments if item is not None)]
        elif isinstance(node, ast.AnnAssign):
            quiet.append(node.annotation)
        elif isinstance(node, ast.ClassDef):
            quiet += node.decorator_list
        elif isinstance(node, ast.keyword) and node.arg == "strict":
            quiet.append(node.value)
        elif isinstance(node, ast.Raise) or _is_text(node):
            quiet.append(node)
    return [
        ((item.lineno, item.col_offset), (item.end_lineno or 0, item.end_col_offset or 0))
        for item in quiet
        if isinstance(item, (ast.expr, ast.stmt))
    ]


def _is_text(node: ast.AST) -> bool:
    """Return whether a node only warns, or only counts for the type checker."""
    if isinstance(node, ast.If):
        return ast.unparse(node.test) == "TYPE_CHECKING"
    return isinstance(node, ast.Call) and ast.unparse(node.func) in ("warnings.warn", "_log.warning")


def mutants_of(path: Path) -> Iterator[Mutant]:
    """Return all mutants of a module."""
    import cosmic_ray.plugins
    from cosmic_ray.ast import ast_nodes, get_ast

    source = path.read_text(encoding="utf-8")
    tree, silent = get_ast(source), silent_spans(source)
    known = set(cosmic_ray.plugins.operator_names())
    for name in OPERATORS:
        if f"core/{name}" not in known:
            continue
        operator = cosmic_ray.plugins.get_operator(f"core/{name}")()
        positions = [start for node in ast_nodes(tree) for start, _ in operator.mutation_positions(node)]
        for occurrence, place in enumerate(positions):
            if not any(first <= place < last for first, last in silent):
                yield Mutant(path.relative_to(REPO).as_posix(), f"core/{name}", occurrence, place[0])


def mutated(mutant: Mutant) -> tuple[str, str]:
    """Return the module's text before and after."""
    import cosmic_ray.plugins
    from cosmic_ray.mutating import mutate_code

    source = (REPO / mutant.path).read_text(encoding="utf-8")
    changed = mutate_code(source, cosmic_ray.plugins.get_operator(mutant.operator)(), mutant.occurrence)
    return source, changed or source


def copy_of_repo(folder: Path) -> Path:
    """Return a copy in which code and tests are files and all else links."""
    target = folder / "repo"
    target.mkdir()
    for item in REPO.iterdir():
        if item.name in ("scarl_sionna", "camera_lidar", "tests"):
            shutil.copytree(item, target / item.name, ignore=shutil.ignore_patterns("__pycache__"))
        elif item.name not in (".git", "build"):
            (target / item.name).symlink_to(item)
    return target


def run_tests(repo: Path, tests: Sequence[str], cpu_seconds: int) -> tuple[str, float]:
    """Run tests in a fork of this process, which holds the slow imports.

    Return "killed", "survived" or "time", and the seconds.
    """
    start = time.monotonic()
    child = os.fork()
    if child == 0:
        code = 3
        try:
            code = _child(repo, tests, cpu_seconds)
        finally:
            os._exit(code)
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        taken = time.monotonic() - start
        if done:
            break
        if taken > 12 * cpu_seconds:  # other work on the machine makes a process slow, not wrong
            os.killpg(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return "time", taken
        time.sleep(0.05)
    if os.WIFSIGNALED(status):
        return ("time" if os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL) else "killed"), taken
    return ("survived" if os.WEXITSTATUS(status) == 0 else "killed"), taken


def _child(repo: Path, tests: Sequence[str], cpu_seconds: int) -> int:
    import pytest

    os.setsid()
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_seconds, cpu_seconds + 5))
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    os.chdir(repo)
    sys.path.insert(0, str(repo))
    os.environ |= {"PYTHONPATH": str(repo), "CI": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    sys.dont_write_bytecode = True
    return int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *tests]))


def import_what_tests_share() -> None:
    """Import the libraries that nothing mutates once, for all forks; the engine starts threads and is left to them."""
    import hypothesis
    import numpy
    import pydantic
    import pytest
    import scipy.interpolate
    import scipy.ndimage
    import scipy.optimize
    import scipy.signal
    import scipy.spatial
    import scipy.special
    import scipy.stats
    import trimesh
    import typer.testing
    import zarr

    assert all((hypothesis, numpy, pydantic, pytest, scipy, trimesh, typer, zarr))


def try_mutant(mutant: Mutant, repo: Path, cpu_seconds: int) -> Mutant:
    """Return the mutant with what the tests made of it."""
    before, after = mutated(mutant)
    changed = [line for line in unified_diff(before.splitlines(), after.splitlines(), lineterm="", n=0)][3:]
    file = repo / mutant.path
    try:
        file.write_text(after, encoding="utf-8")
        outcome, seconds = run_tests(repo, tests_of(mutant.path), cpu_seconds)
    finally:
        file.write_text(before, encoding="utf-8")
    return replace(mutant, outcome=outcome, seconds=round(seconds, 1), diff="\n".join(changed))


def draw(prefixes: Sequence[str], count: int, seed: int) -> list[Mutant]:
    """Return mutants drawn at random: within a package each line that can be mutated is as likely as any other.

    A package gets a share that grows with the root of its lines, so that the small ones are seen, too.
    """
    places: dict[str, dict[tuple[str, int], list[Mutant]]] = {}
    for path in modules(prefixes):
        for mutant in mutants_of(path):
            room = places.setdefault(mutant.path.split("/")[1], {})
            room.setdefault((mutant.path, mutant.line), []).append(mutant)
    rng = random.Random(seed)
    whole = sum(len(room) ** 0.5 for room in places.values())
    found = []
    for _, room in sorted(places.items()):
        share = min(round(count * len(room) ** 0.5 / whole), len(room))
        found += [rng.choice(room[place]) for place in rng.sample(sorted(room), share)]
    rng.shuffle(found)
    return found


def main() -> int:
    """Sample, run, report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--count", type=int, default=120, help="mutants to draw")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--modules", nargs="*", default=DEFAULT, help="beginnings of paths inside scarl_sionna")
    parser.add_argument(
        "--cpu-seconds", type=int, default=240, help="CPU time of the tests of one mutant; more counts as noticed"
    )
    parser.add_argument(
        "--out", type=Path, default=REPO / "build" / "mutants.jsonl", help="a line a mutant; goes on where it stopped"
    )
    options = parser.parse_args()
    options.out.parent.mkdir(parents=True, exist_ok=True)
    rows = [json.loads(line) for line in options.out.read_text().splitlines()] if options.out.exists() else []
    finished = {(row["path"], row["operator"], row["occurrence"]): Mutant(**row) for row in rows}
    import_what_tests_share()
    results: list[Mutant] = []
    with tempfile.TemporaryDirectory() as folder:
        repo = copy_of_repo(Path(folder))
        for mutant in draw(options.modules, options.count, options.seed):
            key = (mutant.path, mutant.operator, mutant.occurrence)
            if key not in finished:
                finished[key] = try_mutant(mutant, repo, options.cpu_seconds)
                with options.out.open("a") as file:
                    file.write(json.dumps(asdict(finished[key])) + "\n")
            results.append(finished[key])
            print(
                f"{len(results):4d} {results[-1].outcome:9s}{results[-1].seconds:6.0f} s  {mutant.path}:{mutant.line}",
                flush=True,
            )
    report(results)
    return 0


def report(results: Sequence[Mutant]) -> None:
    """Print the rate of each package and the survivors."""
    rooms = Counter(item.path.split("/")[1] for item in results)
    alive = Counter(item.path.split("/")[1] for item in results if item.outcome == "survived")
    for room, number in sorted(rooms.items()):
        print(f"{room:12s} {number - alive[room]:4d} of {number:4d} noticed")
    noticed = len(results) - sum(alive.values())
    print(f"{'all':12s} {noticed:4d} of {len(results):4d}: {100.0 * noticed / max(len(results), 1):.0f} %")
    for item in results:
        if item.outcome == "survived":
            print(f"\n{item.path}:{item.line}  {item.operator}\n{item.diff}")


if __name__ == "__main__":
    sys.exit(main())
