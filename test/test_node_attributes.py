"""Nodes inherit from rclpy's `Node`, whose private attributes they must not replace by accident."""

import ast
import inspect
from functools import cache
from pathlib import Path

import pytest
from rclpy.lifecycle import LifecycleNodeMixin
from rclpy.node import Node

SRC = Path(__file__).resolve().parents[1] / "src"
BASES = {"Node", "NodeWithParameters", "AnkleNode", "ManagedNode"}


def assigned(tree):
    """Names of the attributes that a class or module assigns to `self`."""
    return {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and isinstance(node.ctx, ast.Store)
        and isinstance(node.value, ast.Name)
        and node.value.id == "self"
    }


@cache
def taken():
    """Names of the attributes that rclpy's own classes assign."""
    return {
        name
        for base in (Node, LifecycleNodeMixin)
        for name in assigned(ast.parse(inspect.getsource(base)))
    }


def nodes():
    for path in sorted(SRC.glob("*/*/*.py")):
        text = path.read_text()
        if "Node" not in text:
            continue  # every process that shares the tests would parse all modules
        for one in ast.parse(text).body:
            if isinstance(one, ast.ClassDef) and BASES & {ast.unparse(base) for base in one.bases}:
                yield pytest.param(one, id=f"{path.stem}.{one.name}")


@pytest.mark.parametrize("node", list(nodes()))
def test_a_node_keeps_the_attributes_of_rclpy(node):
    assert not assigned(node) & taken()


def test_what_is_taken_is_found():
    assert {"_services", "_subscriptions", "_timers"} <= taken()
    assert len(list(nodes())) > 10
