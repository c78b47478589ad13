"""The frame of a self-contained HTML page: no scripts, no external resources, printable."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from supermap_cli.version import __version__

STYLE = """
:root { --ink: #1d2733; --soft: #5c6a79; --line: #d9dfe6; --paper: #ffffff; --ground: #f4f6f8;
  --appeared: #15803d; --disappeared: #c0152f; --moved: #b45309; --relabelled: #6d28d9; --unchanged: #94a3b3;
  --unsure: #2563a8; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--ink);
  font: 15px/1.45 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
main { max-width: 1320px; margin: 0 auto; padding: 28px 24px 40px; }
h1 { font-size: 26px; margin: 0 0 4px; letter-spacing: -0.01em; }
h2 { font-size: 18px; margin: 34px 0 10px; }
p { margin: 6px 0; max-width: 78em; }
.soft { color: var(--soft); }
.chips { display: flex; flex-wrap: wrap; gap: 8px; margin: 16px 0 4px; }
.chip { border-radius: 999px; padding: 3px 12px; background: var(--paper); border: 1px solid var(--line); }
.chip b { font-variant-numeric: tabular-nums; }
.badge { display: inline-block; border-radius: 4px; padding: 1px 7px; color: #fff; font-size: 12.5px; font-weight: 600;
  background: var(--unchanged); white-space: nowrap; }
.badge.appeared { background: var(--appeared); } .badge.disappeared { background: var(--disappeared); }
.badge.moved { background: var(--moved); } .badge.relabelled { background: var(--relabelled); }
.badge.not-observed-again, .badge.first-observed { background: var(--unsure); }
.panels { display: grid; grid-template-columns: repeat(auto-fit, minmax(430px, 1fr)); gap: 16px; }
figure { margin: 0; background: var(--paper); border: 1px solid var(--line); border-radius: 8px; padding: 10px; }
figcaption { color: var(--soft); font-size: 13.5px; padding: 0 2px 6px; }
.panels.single { max-width: 640px; }
.plan { width: 100%; height: auto; max-height: 620px; display: block; }
.grid { stroke: #eef1f4; stroke-width: 1; fill: none; }
.way { stroke: #a9c3e2; stroke-width: 1.4; fill: none; }
.scale { stroke: var(--soft); fill: none; } text.scale { stroke: none; fill: var(--soft); }
.thing { fill: #c9d1da; fill-opacity: .45; stroke: #8c99a7; stroke-width: 1; }
.thing.appeared { fill: var(--appeared); stroke: var(--appeared); stroke-width: 1.6; }
.thing.disappeared { fill: var(--disappeared); stroke: var(--disappeared); stroke-width: 1.6; }
.thing.moved { fill: var(--moved); stroke: var(--moved); stroke-width: 1.6; }
.thing.relabelled { fill: var(--relabelled); stroke: var(--relabelled); stroke-width: 1.6; }
.thing.not-observed-again, .thing.first-observed { fill: none; stroke: var(--unsure); stroke-dasharray: 3 2; }
.thing.not-looked-at, .thing.at-neither, .thing.doubted { fill: none; stroke-dasharray: 3 2; }
.thing.ghost { fill: none; stroke-dasharray: 4 3; }
.arrow { stroke: var(--moved); stroke-width: 1.8; marker-end: url(#tip); } .tip { fill: var(--moved); }
.name { font-size: 10.5px; text-anchor: middle; fill: var(--ink); paint-order: stroke; stroke: #fff;
  stroke-width: 2.5px; font-weight: 600; } .name.unchanged { font-weight: 400; fill: #6b7885; font-size: 9px; }
.name.appeared { fill: var(--appeared); } .name.disappeared { fill: var(--disappeared); }
.name.moved { fill: var(--moved); } .name.relabelled { fill: var(--relabelled); }
.name.not-observed-again, .name.first-observed { fill: var(--unsure); }
.cards { display: grid; grid-template-columns: repeat(auto-fill, minmax(400px, 1fr)); gap: 14px; }
.card { background: var(--paper); border: 1px solid var(--line); border-radius: 8px; padding: 12px 14px;
  break-inside: avoid; }
.card h3 { margin: 0 0 2px; font-size: 16px; display: flex; gap: 8px; align-items: baseline; }
.card p { margin: 3px 0; font-size: 13.5px; }
.pair { display: grid; grid-template-columns: 1fr 1fr; gap: 10px; margin-top: 8px; }
.picture { font-size: 12px; color: var(--soft); min-width: 0; }
.picture img { display: block; width: 100%; height: 132px; object-fit: contain; background: #e9edf1;
  border-radius: 5px; }
.picture .none { display: flex; height: 132px; align-items: center; justify-content: center; background: #f0f3f6;
  border-radius: 5px; text-align: center; padding: 8px; }
.cards.pictures { grid-template-columns: repeat(auto-fill, minmax(170px, 1fr)); }
.table { overflow-x: auto; background: var(--paper); border: 1px solid var(--line); border-radius: 8px; }
table { border-collapse: collapse; width: 100%; font-size: 13px; }
th { text-align: left; color: var(--soft); font-weight: 600; border-bottom: 1px solid var(--line); }
th, td { padding: 5px 9px; vertical-align: top; } tbody + tbody tr:first-child td { border-top: 1px solid #e6eaef; }
tr.below td { padding: 0 9px 6px; color: var(--soft); font-size: 12px; } tbody { break-inside: avoid; }
td.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.whole { white-space: nowrap; } .why { display: inline-block; min-width: 12em; }
ol.story { margin: 0; padding: 12px 14px 12px 34px; background: var(--paper); border: 1px solid var(--line);
  border-radius: 8px; }
footer { margin-top: 32px; color: var(--soft); font-size: 12.5px; }
@media print { body { background: #fff; font-size: 11px; } main { max-width: none; padding: 0; }
  .panels { grid-template-columns: 1fr 1fr; } .cards { grid-template-columns: 1fr 1fr; }
  * { -webkit-print-color-adjust: exact; print-color-adjust: exact; } h2 { break-after: avoid; }
  tr, figure { break-inside: avoid; } .table { overflow: visible; } }
"""


def page(title: str, body: Iterable[str]) -> str:
    """A page; the parts of `body` are HTML."""
    policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
    content = "\n".join(body)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<title>{escape(title)}</title>
<style>{STYLE}</style>
</head>
<body>
<main>
{content}
<footer>Made by supermap {escape(__version__)}.
Times are sensor time; places are metres in the map frame, z up.</footer>
</main>
</body>
</html>
"""


def table(columns: Sequence[str], rows: Iterable[tuple[Sequence[str], str]]) -> str:
    """A table of HTML cells; each row may have a line of HTML below it. Columns that end in "#" are numeric."""
    head = "".join(f"<th>{escape(column.removesuffix('#'))}</th>" for column in columns)
    kinds = [' class="number"' if column.endswith("#") else "" for column in columns]
    bodies = []
    for row, below in rows:
        cells = "".join(f"<td{kind}>{cell}</td>" for kind, cell in zip(kinds, row, strict=True))
        below_row = f'<tr class="below"><td colspan="{len(kinds)}">{below}</td></tr>' if below else ""
        bodies.append(f"<tbody><tr>{cells}</tr>{below_row}</tbody>")
    return f'<div class="table"><table><thead><tr>{head}</tr></thead>{"".join(bodies)}</table></div>'


def badge(kind: str) -> str:
    """A kind of change, in its colour."""
    return f'<span class="badge {css_name(kind)}">{escape(kind)}</span>'


def picture(jpeg_uri: str | None, caption: str, missing: str = "no picture") -> str:
    """An image with its caption, or a text if it is missing."""
    shown = (
        f'<div class="none">{escape(missing)}</div>'
        if jpeg_uri is None
        else f'<img src="{jpeg_uri}" alt="{escape(caption, quote=True)}">'
    )
    return f'<div class="picture">{shown}{escape(caption)}</div>'


def css_name(kind: str) -> str:
    """A kind of change as a CSS class."""
    return kind.replace(" ", "-")
