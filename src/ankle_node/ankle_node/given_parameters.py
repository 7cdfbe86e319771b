"""The parameters that a node is given at its start: those that it does not have are refused, or
named where a file gives them to every node.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity
from ankle_interfaces.suggestion import TYPING_ERROR, closest, hint
from ankle_interfaces.yaml_text import parse_yaml, read_text
from ankle_node.declared_parameters import OVERRIDES_OF_RCLPY, RCLPY_PARAMETERS

EVERY_NODE = "/**"
"""Key of a parameter file whose parameters are given to every node."""
OF_A_NODE = "ros__parameters"
"""Key of a parameter file under which the parameters themselves are."""


def unknown(name: str, known: Iterable[str]) -> str:
    """Return the sentence about an unknown parameter."""
    return f"parameter '{name}' is unknown; {hint(name, known)}"


def check_given(
    given: Iterable[str], declared: Mapping[str, Quantity], shared: Iterable[str]
) -> list[str]:
    """Look through the parameters that were given at the start, on the command line or in a file.

    Parameters
    ----------
    given
        Names of the parameters that were given.
    declared
        Quantities of the node by name.
    shared
        Names that were given to every node and not to this one in particular.

    Returns
    -------
    list of str
        A warning for each shared one that the node does not have: it may be of another node.

    Raises
    ------
    QuantityError
        A name that the node does not have, and that was given to it or is a typing error of one
        that it has: a typing error must not leave a limit at its default.
    """
    warnings = []
    for name in given:
        if name in declared or name in RCLPY_PARAMETERS or name.startswith(OVERRIDES_OF_RCLPY):
            continue
        sentence = unknown(name, declared)
        if name not in shared or closest(name, declared, TYPING_ERROR):
            raise QuantityError(sentence)
        warnings.append(f"{sentence}; it is ignored")
    return warnings


def shared_names(arguments: Sequence[str], node: str) -> set[str]:
    """Return the parameters that files give to every node, and nothing to this one in particular.

    Parameters
    ----------
    arguments
        Command line of the process.
    node
        Name of the node.
    """
    shared, own = set(), set()
    for option, value in pairwise(arguments):
        if option in ("-p", "--param"):
            own.add(value.partition(":=")[0].rpartition(":")[2])
        elif option == "--params-file":
            for key, name in _entries(parse_yaml(read_text(value)), ""):
                if key == EVERY_NODE:
                    shared.add(name)
                elif key.rpartition("/")[2] in (node, "*"):
                    own.add(name)
    return shared - own


def _entries(content: Any, key: str) -> Iterator[tuple[str, str]]:
    """Give the node's key and the name of each parameter of a parameter file."""
    for word, inner in content.items() if isinstance(content, Mapping) else ():
        if word == OF_A_NODE:
            yield from ((key, name) for name in _names(inner, ""))
        else:
            yield from _entries(inner, f"{key}/{str(word).strip('/')}")


def _names(content: Any, prefix: str) -> Iterator[str]:
    """Give the names of the parameters, with dots where they are nested."""
    for word, inner in content.items() if isinstance(content, Mapping) else ():
        if isinstance(inner, Mapping):
            yield from _names(inner, f"{prefix}{word}.")
        else:
            yield f"{prefix}{word}"
