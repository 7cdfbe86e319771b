"""`ankle graphs`: what `ankle up` can start."""

from __future__ import annotations

from ankle_bringup.terminal import console


def verb() -> dict[str, str]:
    """List the graphs that come with the package.

    Example: ankle graphs
    """
    from ankle_bringup.graph import known_graphs, load_graph

    found = {name: load_graph(name).description for name in known_graphs()}
    for name, description in found.items():
        console.print(f"{name}: {description}")
    return found
