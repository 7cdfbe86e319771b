"""The parts of which report pages are made: one file each, which needs no network."""

from __future__ import annotations

from html import escape
from pathlib import Path

from ankle_physics.joint_profile import joint_in_force

_STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:64rem;margin:2rem auto;\
padding:0 1rem;color:#222}
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem}h3{font-size:1rem;\
margin:1.4rem 0 .2rem}img{max-width:100%}
body{overflow-wrap:break-word}.wide{overflow-x:auto}
table{border-collapse:collapse;overflow-wrap:normal}td,th{padding:.2rem .8rem;\
border-bottom:1px solid #ddd;text-align:left}
@media(max-width:30rem){h1{font-size:1.2rem}td,th{padding:.2rem .35rem;font-size:.85rem;\
min-width:5rem}.wide img{max-width:44rem;width:auto}}"""


def write_page(title: str, parts: list[str], path: Path) -> None:
    """Write one HTML file without network from its parts, in the style of all reports."""
    head = (
        "<meta charset='utf-8'><meta name='viewport' content='width=device-width'>"
        f"<title>{escape(title)}</title><style>{_STYLE}</style>"
    )
    text = f"<!doctype html><html lang='en'>{head}<body>{''.join(parts)}</body></html>"
    path.write_text(joint_in_force().in_units(text), encoding="utf-8")


def image(data: str) -> str:
    """Return a picture in base64 PNG as an element, which scrolls where the screen is narrow."""
    return f"<div class='wide'><img alt='' src='data:image/png;base64,{data}'></div>"


def html_list(lines: list[str]) -> str:
    """Return plain sentences as a list."""
    return "<ul>" + "".join(f"<li>{escape(line)}</li>" for line in lines) + "</ul>"


def html_table(head: list[str], rows: list[list[str]]) -> str:
    """Return plain texts as a table, which scrolls where the screen is narrow."""
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f"<div class='wide'><table><tr>{top}</tr>{body}</table></div>"
