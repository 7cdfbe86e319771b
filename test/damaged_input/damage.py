"""How input is damaged: bytes, values and texts that do not belong where they stand."""

from __future__ import annotations

import math
import string
from collections.abc import Callable
from typing import Any

import numpy as np

Case = Callable[[np.random.Generator], bool]
ROS = 1.76e9  # s
NUMBERS = (0, 1, -1, 2**31, 2**63, -(2**63), 10**30, 0.5, 1e-300, 1e300, math.inf, -math.inf)
NUMBERS += (math.nan, True, False, None)
TEXTS = ("", "nan", "-", "1e999", "°", "\0", "a" * 5000, "../../etc/passwd", "2026-13-45", "{", "[")
TEXTS += ("&a [*a]", "!!python/object:os.system {}", "1,5", "0x1f", "\ud800", "=1+1", "~", "<<: 1")
WORDS = string.printable + "äµ°\u2028\U0001f9b6"


def damaged(data: bytes, random: np.random.Generator) -> bytes:
    """Bytes flipped, cut out, doubled or put in."""
    found = bytearray(data)
    for _ in range(int(random.integers(1, 6))):
        at, size = int(random.integers(0, len(found) + 1)), int(random.integers(1, 40))
        what = int(random.integers(5))
        if what == 0 and found:
            found[at % len(found)] = int(random.integers(256))
        elif what == 1:
            del found[at : at + size]
        elif what == 2:
            found[at:at] = found[at : at + size]
        elif what == 3:
            found[at:at] = random.bytes(size)
        else:
            found[at:at] = str(random.choice(TEXTS)).encode("utf-8", "surrogatepass")[:60]
    return bytes(found)


def unexpected(random: np.random.Generator, depth: int = 0) -> Any:
    """A value that does not belong here."""
    what = int(random.integers(4 if depth < 3 else 2))
    if what == 0:
        return NUMBERS[int(random.integers(len(NUMBERS)))]
    if what == 1:
        return TEXTS[int(random.integers(len(TEXTS)))]
    if what == 2:
        return [unexpected(random, depth + 1) for _ in range(int(random.integers(0, 3)))]
    return {word(random): unexpected(random, depth + 1) for _ in range(int(random.integers(0, 3)))}


def word(random: np.random.Generator) -> str:
    """Some characters."""
    return "".join(WORDS[int(i)] for i in random.integers(0, len(WORDS), random.integers(0, 20)))


def altered(content: Any, random: np.random.Generator) -> Any:
    """Another value, key or length somewhere in lists and mappings."""
    if not isinstance(content, (dict, list)) or not content or random.random() < 0.15:
        return unexpected(random)
    if isinstance(content, list):
        place = int(random.integers(len(content)))
        if random.random() < 0.2:
            return content[:place] + content[place + 1 :]
        return [altered(v, random) if k == place else v for k, v in enumerate(content)]
    key = list(content)[int(random.integers(len(content)))]
    what = random.random()
    if what < 0.15:
        return {k: v for k, v in content.items() if k != key}
    if what < 0.3:
        return {(word(random) if k == key else k): v for k, v in content.items()}
    return {k: altered(v, random) if k == key else v for k, v in content.items()}


def text_of(content: Any, random: np.random.Generator, write: Callable[[Any], str]) -> bytes:
    """An altered content as a file, or a file that is damaged."""
    if random.random() < 0.5:
        return damaged(write(content).encode("utf-8", "surrogatepass"), random)
    return write(altered(content, random)).encode("utf-8", "surrogatepass")


def number(random: np.random.Generator, *usual: float) -> float:
    """A usual number, or one at the edges of what fits."""
    edges = (0.0, -1.0, 1e9, 1e18, 1e300, -1e300, math.nan, math.inf, 5e-324)
    return float((usual + edges)[int(random.integers(len(usual) + len(edges)))])


def integer(random: np.random.Generator, bits: int, signed: bool = False) -> int:
    """An integer that fits, at the edges mostly."""
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
    choices = (low, low + 1, 0, 1, high - 1, high, int(random.integers(low, high, endpoint=True)))
    if signed:
        choices += (int(ROS * 1e9) + int(random.integers(-(10**10), 10**10)),)
    return choices[int(random.integers(len(choices)))]
