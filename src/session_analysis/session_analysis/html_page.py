"""One HTML file that needs no network: headings, tables, interactive figures."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:72rem;margin:2rem auto;padding:0 1rem;
color:#222}h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem}img{max-width:100%}
table{border-collapse:collapse}td,th{padding:.2rem .8rem;border-bottom:1px solid #ddd;
text-align:left;vertical-align:top}td{white-space:nowrap}.wide{overflow-x:auto}
body{overflow-wrap:break-word}.wide table{overflow-wrap:normal}
.wide{margin:.8rem 0}@media(max-width:30rem){h1{font-size:1.2rem}td,th{padding:.2rem .35rem;
font-size:.85rem}.wide th{min-width:4.2rem}.wide img{max-width:none;width:44rem}}
.loss{background:#fdf0e2;padding:.5rem 1rem}.answer{font-size:1.1rem}ul.loss{padding-left:2rem}
@media print{body{font-size:10px;margin:0;max-width:none}.wide{overflow-x:visible}
.wide table{overflow-wrap:anywhere}td{white-space:normal}td,th{padding:.1rem .3rem}}"""


def page(title: str, parts: Sequence[str], interactive: bool = True) -> str:
    """Return a whole document.

    Parameters
    ----------
    title
        Of the window and the first heading.
    parts
        Pieces of HTML in their order.
    interactive
        Whether a part comes from `figure`; the script that draws is then part of the document.
    """
    script = ""
    if interactive:
        from plotly.offline import get_plotlyjs

        script = f"<script>{get_plotlyjs()}</script>"
    return (
        f"<!doctype html><html lang='en'><head><meta charset='utf-8'><meta name='viewport' "
        f"content='width=device-width'><title>{escape(title)}</title><style>{STYLE}</style>{script}</head><body><h1>{escape(title)}</h1>{''.join(parts)}"
        "</body></html>"
    )


def figure(drawn: Any) -> str:
    """Return a Plotly figure as a piece of `page`."""
    drawn.update_layout(template="plotly_white", margin={"l": 70, "r": 20, "t": 40, "b": 50})
    drawn.update_layout(legend={"orientation": "h", "y": 1.01, "yanchor": "bottom"})
    # Keeps the words of the x axis away from the lowest of the y axis.
    drawn.update_xaxes(ticks="outside", ticklen=7, tickcolor="#ddd")
    return str(drawn.to_html(full_html=False, include_plotlyjs=False))


def heading(text: str) -> str:
    """Return a heading."""
    return f"<h2>{escape(text)}</h2>"


def paragraph(text: str, kind: str = "") -> str:
    """Return a paragraph; `kind` is a class of `STYLE`."""
    return f"<p class='{kind}'>{escape(text)}</p>" if kind else f"<p>{escape(text)}</p>"


def table(rows: Sequence[Sequence[str]]) -> str:
    """Return a table, which scrolls where the screen is narrow; the first row names the columns."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in rows[0])
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows[1:]
    )
    return f"<div class='wide'><table><tr>{head}</tr>{body}</table></div>"


def bullets(sentences: Sequence[str], kind: str = "", nothing: str = "Nothing.") -> str:
    """Return a list of sentences, or `nothing` where there are none."""
    if not sentences:
        return paragraph(nothing)
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences)
    return f"<ul class='{kind}'>{items}</ul>"


def linked_bullets(items: Sequence[tuple[str, Sequence[tuple[str, str]]]]) -> str:
    """Return a list of sentences with links to files behind each.

    Parameters
    ----------
    items
        Each sentence with the title and the target of its links; a target is relative to the page.
    """
    lines = []
    for sentence, links in items:
        shown = ", ".join(f"<a href='{escape(to)}'>{escape(title)}</a>" for title, to in links)
        lines.append(f"<li>{escape(sentence)} {shown}</li>")
    return f"<ul>{''.join(lines)}</ul>"


def image(path: Path) -> str:
    """Return a PNG picture, which becomes part of the page and scrolls where it is narrow."""
    content = base64.b64encode(path.read_bytes()).decode()
    source = f"data:image/png;base64,{content}"
    return f"<div class='wide'><img alt='{escape(path.stem)}' src='{source}'></div>"
