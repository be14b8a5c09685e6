"""The page of a dataset's statistics: charts and tables in one HTML file that loads nothing from elsewhere."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Sequence

from .charts import charts, svg_text
from .counted import FARTHEST, FIELD_OF_VIEW_DEG, Counted
from .published import Published, compare

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #1c2430; background: #fff; max-width: 1080px;
       margin: 2em auto; padding: 0 1em; }
h1 { font-size: 1.5em; } h2 { font-size: 1.15em; margin-top: 2em; }
table { border-collapse: collapse; font-size: 0.87em; } td, th { padding: 3px 10px; border-bottom: 1px solid #e3e6ea;
       text-align: left; vertical-align: top; } .n { text-align: right; white-space: nowrap; }
tr.head td { font-weight: bold; padding-top: 1em; } .pale { color: #616a76; } svg { width: 100%; height: auto; }
"""


def page(found: Counted) -> str:
    """Return the page as HTML."""
    title = f"{found.num_frames} frames in {len({scene.name for scene in found.scenes})} scenes"
    body = "\n".join(
        (
            f"<h1>Statistics of a dataset: {title}</h1>",
            _table(("", ""), [(name, text) for name, text in found.facts()], 9),
            f'<p class="pale">{_explained(found)}</p>',
            svg_text(charts(found)),
            "<h2>Beside published figures</h2>",
            _published(found),
            "<h2>Classes</h2>",
            _classes(found),
            "<h2>Scenes</h2>",
            _scenes(found),
        )
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>Dataset: {title}</title><style>{_STYLE}</style></head>\n<body>\n{body}\n</body></html>\n"
    )


def _explained(found: Counted) -> str:
    kept = "" if found.most_points is None else f", the strongest {found.most_points} of a radar and frame"
    return html.escape(
        "Radar points are those of the project's detector on the stored cubes (probability of false alarm "
        f"{found.pfa:g}){kept}. A point belongs to the road user whose box, seen from above, is nearest and within "
        f"{found.margin:g} m. A radar looks at what is within {FIELD_OF_VIEW_DEG:g} deg of its axis and {FARTHEST:g} m "
        "(or its own reach), hidden or not. Other datasets have other sensors, detectors and labels: compare shapes "
        "and ratios before levels."
    )


def _published(found: Counted) -> str:
    rows: list[str] = []
    dataset = ""
    for item in compare(found):
        figure = item.published
        if figure.dataset != dataset:
            dataset = figure.dataset
            rows.append(f'<tr class="head"><td colspan="5">{html.escape(dataset)}</td></tr>')
        quantity = figure.quantity + (f" [{figure.unit}]" if figure.unit else "")
        here = "not told" if math.isnan(item.here) else _number(item.here)
        rows.append(
            f'<tr><td>{html.escape(quantity)}</td><td class="n">{here}</td><td class="n">{_figure(figure)}</td>'
            f'<td>{html.escape(figure.condition)}</td><td class="pale">{html.escape(figure.source)}</td></tr>'
        )
    head = '<tr><th></th><th class="n">here</th><th class="n">there</th><th>of what</th><th>source</th></tr>'
    return f"<table>{head}{''.join(rows)}</table>"


def _figure(figure: Published) -> str:
    span = "" if figure.low is None or figure.high is None else f"{_number(figure.low)} to {_number(figure.high)}"
    if figure.value is None:
        return span
    return _number(figure.value) + (f" ({span})" if span else "")


def _classes(found: Counted) -> str:
    total = len(found.objects)
    rows = [
        (name, str(labels), f"{100.0 * labels / total:.1f}", str(objects))
        for name, (labels, objects) in found.class_balance().items()
    ]
    return _table(("class", "labels", "share [%]", "objects"), rows, 1)


def _scenes(found: Counted) -> str:
    rows = [(scene.name, scene.split, scene.weather, str(scene.num_frames)) for scene in found.scenes]
    return _table(("scene", "split", "weather", "frames"), rows, 3)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]], first_number: int) -> str:
    """Return a table; columns from `first_number` on are numbers."""

    def line(cells: Sequence[str], kind: str) -> str:
        classes = ['class="n"' if column >= first_number else "" for column in range(len(cells))]
        inside = (f"<{kind} {style}>{html.escape(cell)}</{kind}>" for cell, style in zip(cells, classes, strict=True))
        return f"<tr>{''.join(inside)}</tr>"

    return f"<table>{line(head, 'th') if any(head) else ''}{''.join(line(row, 'td') for row in rows)}</table>"


def _number(value: float) -> str:
    """Return a number with three digits or so."""
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.1f}" if abs(value) >= 10.0 else f"{value:.3g}"
