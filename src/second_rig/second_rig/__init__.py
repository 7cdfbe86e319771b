"""A third engine: a simulated laboratory that shares no code with any other package of ours.

A rig with a servo moves an ankle of a subject who holds some torque. Recordings are drawn by a
seed: some hold the plain joint, some hide one effect or two, and some hide physics that nobody
lists. Nothing here imports another package of the workspace: what the diagnosis recovers, it
recovers from a recording.
"""

from typing import Any

__all__ = ["Case", "draw_cases", "record"]


def __getattr__(name: str) -> Any:
    """Give an exported name; its module is imported when it is first used."""
    if name not in __all__:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    from second_rig import draw, recording

    return getattr(recording if name == "record" else draw, name)
