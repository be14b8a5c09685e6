"""Hooks of the documentation site.

Notebooks as pages, CONTRIBUTING.md, links that leave docs/, and equations as MathML.

Notebooks are taken with their figures from `build/notebooks`, where `make notebooks` puts them, else without outputs.
"""

from __future__ import annotations

import base64
import json
import re
import textwrap
from html import unescape
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
EXECUTED, SOURCES = ROOT / "build" / "notebooks", ROOT / "notebooks"
_OUTSIDE = re.compile(r"\[([^\]]+)\]\(\.\./([^)#\s]+)\)")
_FENCE_IN_LIST = re.compile(r"^  ```.*?^  ```$", re.MULTILINE | re.DOTALL)
_EQUATION = re.compile(r'<(span|div) class="arithmatex">(.*?)</\1>', re.DOTALL)
_ANSI = re.compile(r"\x1b\[[0-9;]*m")


def _text(value: str | list[str]) -> str:
    return value if isinstance(value, str) else "".join(value)


def _shown(output: dict[str, Any], picture: str) -> tuple[str, bytes | None]:
    """Return the Markdown of one output of a cell, and the PNG to which it refers as `picture`."""
    data = output.get("data", {})
    if "image/png" in data:
        return f"![output]({picture})\n", base64.b64decode(_text(data["image/png"]))
    is_log = output.get("name") == "stderr"
    text = "" if is_log else _ANSI.sub("", _text(output.get("text", data.get("text/plain", "")))).rstrip()
    return (f"```text\n{text}\n```\n" if text else ""), None


def notebook_page(notebook: dict[str, Any], name: str) -> tuple[str, dict[str, bytes]]:
    """Return a notebook as Markdown, and its pictures by file name."""
    parts: list[str] = []
    pictures: dict[str, bytes] = {}
    for cell in notebook["cells"]:
        source = _text(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source + "\n")
            continue
        parts.append(f"```python\n{source}\n```\n")
        for output in cell.get("outputs", []):
            text, png = _shown(output, f"{name}_{len(pictures)}.png")
            if png is not None:
                pictures[f"{name}_{len(pictures)}.png"] = png
            parts.append(text)
    parts.append(f"From `notebooks/{name}.ipynb`.\n")
    return "\n".join(part for part in parts if part), pictures


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add a page for every notebook with its pictures, and CONTRIBUTING.md."""
    for source in sorted(SOURCES.glob("*.ipynb")):
        executed = EXECUTED / source.name
        notebook = json.loads((executed if executed.is_file() else source).read_text(encoding="utf-8"))
        text, pictures = notebook_page(notebook, source.stem)
        files.append(File.generated(config, f"notebooks/{source.stem}.md", content=text))
        for picture, png in pictures.items():
            files.append(File.generated(config, f"notebooks/{picture}", content=png))
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").replace("](docs/", "](")
    files.append(File.generated(config, "contributing.md", content=text))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Make of GitHub's Markdown what the site needs.

    Links to notebooks lead to their pages, other files of the repository are named by their path, since the site has
    none of them, and blocks of code in lists are indented by four.
    """

    def inside(match: re.Match[str]) -> str:
        label, target = match.groups()
        if target.startswith("notebooks/"):
            return f"[{label}]({target.removesuffix('.ipynb')}.md)"
        return f"`{target}`"

    markdown = _FENCE_IN_LIST.sub(lambda match: textwrap.indent(match.group(0), "  "), markdown)
    return _OUTSIDE.sub(inside, markdown)


def on_page_content(html: str, **others: object) -> str:
    """Typeset equations here, so that the site loads nothing from elsewhere."""

    def typeset(match: re.Match[str]) -> str:
        inline, text = match.group(1) == "span", unescape(match.group(2)).strip()
        return str(convert(text[2:-2].strip(), display="inline" if inline else "block"))

    return _EQUATION.sub(typeset, html)
