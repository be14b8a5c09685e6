"""Write the tables of docs/actors.md from the models in scenes_xml/actors.

Usage: python scripts/actors_table.py [--check]. With --check nothing is written; the exit status is 1 if the page is
old.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import scarl_sionna as ss
from scarl_sionna.scene.actors.model import ActorModel, actor_names, person_ages
from scenes_xml.actors.bodies.table import PEOPLE, Person

REPO = Path(__file__).resolve().parents[1]
PAGE = REPO / "docs" / "actors.md"
VEHICLES = (
    "small_car", "saloon", "estate", "suv", "pickup", "van", "box_van", "lorry", "articulated_lorry", "bus", "coach",
    "tram",
)  # fmt: skip # a table
GROUPS = ("vehicles", "people", "ages")
HEAD = (
    "| model | length x width x height [m] | wheelbase [m] | shapes, triangles | light: shapes, "
    "triangles | joints | radio materials | variants |",
    "|---|---|---|---|---|---|---|---|",
)


def _triangles(file: Path) -> int:
    found = re.search(rb"element face (\d+)", file.read_bytes()[:1000])
    assert found is not None
    return int(found[1])


def _level(model: ActorModel, suffix: str) -> str:
    folder = model.path.parent
    files = re.findall(r'value="(meshes/[^"]+)"', (folder / f"{model.name}{suffix}.xml").read_text(encoding="utf-8"))
    return f"{len(files)}, {sum(_triangles(folder / file) for file in files):,}"


def _row(name: str) -> str:
    model = ss.read_actor_model(name)
    kinds = [str(joint["kind"]) for joint in model.joints]
    joints = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds)) or "-"
    cells = (
        f"`{name}`",
        f"{model.length:g} x {model.width:g} x {model.height:g}",
        f"{model.wheelbase:g}" if model.wheelbase else "-",
        _level(model, ""),
        _level(model, "_light"),
        joints,
        ", ".join(sorted({entry.radio for entry in model.materials.values()})),
        ", ".join(model.variants),
    )
    return "| " + " | ".join(cells) + " |"


PEOPLE_HEAD = (
    "| model | age | height [m] | length x width x height, walking [m] | clothes | shapes, triangles | light: shapes, "
    "triangles | variants |",
    "|---|---|---|---|---|---|---|---|",
)


def _person(person: Person) -> str:
    model = ss.read_actor_model(person.name)
    below = f", {person.bottom}" if person.bottom else ""
    cells = (
        f"`{person.name}`",
        f"{person.years}",
        f"{person.height:g}",
        f"{model.length:g} x {model.width:g} x {model.height:g}",
        f"{person.top.replace('_', '-')}{below}",
        _level(model, ""),
        _level(model, "_light"),
        ", ".join(model.variants),
    )
    return "| " + " | ".join(cells) + " |"


def _table(group: str) -> list[str]:
    if group == "ages":
        return [*PEOPLE_HEAD, *(_person(person) for person in PEOPLE)]
    others = [name for name in actor_names() if name not in VEHICLES and name not in person_ages()]
    return [*HEAD, *(_row(name) for name in (VEHICLES if group == "vehicles" else others))]


def updated(page: str, groups: tuple[str, ...] = GROUPS) -> str:
    """Return the page with its tables made again."""
    for group in groups:
        begin, end = f"<!-- {group}: begin (scripts/actors_table.py) -->", f"<!-- {group}: end -->"
        head, _, rest = page.partition(begin)
        _, _, tail = rest.partition(end)
        if not rest or not tail:
            raise SystemExit(f"{PAGE} lacks the marks of its table '{group}'")
        table = "\n".join(_table(group))
        page = f"{head}{begin}\n{table}\n{end}{tail}"
    return page


def main() -> None:
    """Write the page, or check it."""
    page = PAGE.read_text(encoding="utf-8")
    new = updated(page)
    if "--check" in sys.argv[1:]:
        raise SystemExit(0 if new == page else 1)
    PAGE.write_text(new, encoding="utf-8")


if __name__ == "__main__":
    main()
