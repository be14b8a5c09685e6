"""The documentation site is whole.

Links lead somewhere, every page is in its menu, and the API pages name what exists.
"""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest
import yaml

REPO = Path(__file__).resolve().parents[2]
PAGES = sorted((REPO / "docs").glob("*.md"))
NOTEBOOKS = sorted((REPO / "notebooks").glob("*.ipynb"))
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
MADE = {"contributing.md", *(f"notebooks/{path.stem}.md" for path in NOTEBOOKS)}
"""Pages that scripts/docs_hooks.py makes."""


def menu(entry: object) -> list[str]:
    """Return the pages of a part of the site's menu."""
    if isinstance(entry, str):
        return [entry]
    parts = entry.values() if isinstance(entry, dict) else entry
    return [page for part in parts for page in menu(part)]


@pytest.mark.parametrize("page", [REPO / "README.md", *PAGES], ids=lambda page: page.name)
def test_links_lead_to_files(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    targets = [target.split("#")[0] for target in LINK.findall(re.sub(r"`[^`\n]*`", "", text))]
    missing = [one for one in targets if one and "://" not in one and not (page.parent / one).exists()]
    assert not missing


def test_every_page_and_notebook_is_in_the_menu_once() -> None:
    nav = yaml.safe_load((REPO / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]
    assert sorted(menu(nav)) == sorted({*MADE, *(page.name for page in PAGES)})


@pytest.mark.parametrize("page", [page for page in PAGES if page.name.startswith("api_")], ids=lambda page: page.name)
def test_the_api_pages_name_what_exists(page: Path) -> None:
    names = re.findall(r"^::: (\S+)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert names
    for name in names:
        module, _, attribute = name.rpartition(".")
        found = getattr(import_module(module), attribute, None) or import_module(name)
        assert found.__doc__


def test_public_names_are_in_the_reference() -> None:
    import scarl_sionna

    text = (REPO / "docs" / "api.md").read_text(encoding="utf-8")
    shown = {*re.findall(r"`(\w+)`", text)}
    beside = {
        "Atmosphere",
        "BrownConrady",
        "HeterodyneReceiver",
        "ImageSensor",
        "KannalaBrandt",
        "Pinhole",
        "RasterScan",
        "RisleyScan",
        "ScarlReceiver",
        "SpinningScan",
        "TableScan",
    }
    assert set(scarl_sionna.__all__) - shown - beside == set()  # parts of specifications stand with those
