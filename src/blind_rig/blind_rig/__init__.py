"""A virtual rig and subject that share no physics code with the software under test, and the sealed
cases made with them.

Nothing here imports `ankle_physics`, `model_discrepancy` or `ankle_sim`: what the diagnosis
recovers, it recovers from a recording.
"""

from typing import Any

__all__ = ["Trial", "record", "run"]


def __getattr__(name: str) -> Any:
    """Give an exported name; its module is imported when it is first used."""
    if name not in __all__:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    from blind_rig import trial

    return getattr(trial, name)
