"""What a tube budget pays for in the ready scenes, by the plan of `auto` alone: nothing is traced.

    python benchmarks/tube_budget.py --write docs/accuracy.md
    python benchmarks/tube_budget.py --time 3.7 --budgets 1000000 50000

The front radar of the README in each place at one time. Of the objects that count: those left to the RCS of their
class, those without a reflection that can change them by more than the tolerance, and the error that 90 % are to keep
by what is paid for.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import scarl_sionna as ss
from benchmarks.harness import machine, write_block
from benchmarks.street_scenes import PLACES
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.radar.channel.compose.choose import View, choose, counts, expected_error

BUDGETS = (1_000_000, 300_000, 100_000, 50_000)


def planned(name: str, when: float, budget: int) -> tuple[int, str]:
    """Return the number of objects that count, and the cell of the table."""
    state = ss.load_scene(name).at(when)
    accuracy = ss.Accuracy(channel_tolerance_db=1.0, tube_budget=budget)
    settings = RadarSettings(method="auto", accuracy=accuracy)
    view = View(state, ss.RadarSpec.preset("awr1843boost"), state.mount("ego", ss.Pose([2.36, 0.0, 0.8])), settings, {})
    chosen = choose(view)
    own = [choice for choice in chosen.choices if choice.method == "sbr" or choice.over_budget]
    own = [choice for choice in own if counts(choice, view.rules)]
    by_class = sum(choice.over_budget for choice in own)
    without = sum(choice.without is not None and choice.without.change_db > 1.0 for choice in own)
    kept = expected_error(chosen, view.rules)
    return len(own), f"{chosen.level.tolerance_db:g}: {by_class} / {without}, {kept:.1f}"


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--time", type=float, default=0.5, help="of each scene [s]")
    parser.add_argument("--budgets", type=int, nargs="+", default=BUDGETS, help="in tubes")
    parser.add_argument("--write", type=Path, metavar="PAGE")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    heads = " | ".join(f"{budget:,}" for budget in arguments.budgets)
    rows = [
        f"`python benchmarks/tube_budget.py --time {arguments.time:g}`, tolerance 1 dB, {machine()}. Each cell: level "
        "[dB]: left to class / without a reflection, error that 90 % keep [dB]. CPU: of a plan.",
        "",
        f"| place | objects | {heads} | CPU [s] |",
        "|---|---|" + "---|" * (len(arguments.budgets) + 1),
    ]
    for name in PLACES:
        start = time.process_time()
        cells = [planned(name, arguments.time, budget) for budget in arguments.budgets]
        cpu = (time.process_time() - start) / len(cells)
        rows.append(f"| {name} | {cells[0][0]} | {' | '.join(text for _, text in cells)} | {cpu:.1f} |")
        print(rows[-1], flush=True)
    if arguments.write is not None:
        write_block(arguments.write, "tube budget", "\n".join(rows))


if __name__ == "__main__":
    main()
