"""Damage done to files: to the values of a document, and to bytes."""

from __future__ import annotations

import copy
import math
import random
import re
from typing import Any

#: Values that files were seen with, and those that arithmetic trips over.
NASTY: tuple[Any, ...] = (
    None,
    True,
    False,
    0,
    -1,
    1,
    2,
    -0.0,
    5e-324,
    1e-300,
    1e300,
    -1e308,
    1.7976931348623157e308,
    2**31,
    2**32,
    2**53 + 1,
    2**63,
    2**64,
    10**9,
    10**10,
    10**400,
    math.nan,
    math.inf,
    -math.inf,
    "",
    "1",
    "1_0",
    "output",
    "motor",
    "\x1b[31mred",
    "\x00",
    "\u0661",
    "\ud800",
    "x" * 4000,
    [],
    [0],
    [1, 2, 3],
    [[]],
    [None],
    {},
    {"kind": "backlash"},
    {"": 0},
)

#: Texts that stand where a number belongs.
CELLS = (
    "",
    " ",
    "nan",
    "inf",
    "-inf",
    "1e999",
    "1_0",
    "\u0661\u0662",
    "1\u00b22",
    "0x10",
    "1,5",
    "1.5.5",
    "--1",
    "+1.5",
    "1e-400",
    "9" * 500,
    "true",
    "\x00",
    '"',
    '"1"',
    '"1\n2"',
    "#",
    "# 1",
    "x" * 20_000,
    "\x1b[2J",
    "\ud7ff",
)


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of every value inside ``value``, itself included."""
    found = [path]
    if isinstance(value, dict):
        for key, entry in value.items():
            found += places(entry, (*path, key))
    elif isinstance(value, list):
        for i, entry in enumerate(value):
            found += places(entry, (*path, i))
    return found


def mutated_document(document: Any, rng: random.Random) -> Any:
    """A copy of ``document`` with one to four of its values changed.

    In two of five, numbers stay numbers and texts stay texts of the document: such a file gets
    past the checks of types, to those of what belongs together.
    """
    made = copy.deepcopy(document)
    if rng.random() < 0.4:
        for _ in range(rng.choice((1, 1, 2, 4))):
            _change_gently(made, rng)
        return made
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        path = rng.choice(places(made))
        if not path:
            if rng.random() < 0.1:
                made = copy.deepcopy(rng.choice(NASTY))
            continue
        holder = made
        for step in path[:-1]:
            holder = holder[step]
        key = path[-1]
        action = rng.random()
        if action < 0.6:
            holder[key] = _changed(holder[key], rng)
        elif action < 0.7:
            del holder[key]
        elif isinstance(holder, dict):
            name = rng.choice(("period", "orders", "x", "kind", str(key) + "s"))
            holder[name] = copy.deepcopy(rng.choice(NASTY))
        else:
            holder.insert(key, copy.deepcopy(rng.choice((holder[key], *NASTY))))
    return made


def _change_gently(made: Any, rng: random.Random) -> None:
    """Put another number, or another text of the document, in the place of one."""
    found = [path for path in places(made) if path]
    if not found:
        return
    path = rng.choice(found)
    holder = _inside(made, path[:-1])
    value = holder[path[-1]]
    if isinstance(value, bool):
        holder[path[-1]] = not value
    elif isinstance(value, int) and abs(value) > 2**1000:  # beyond any float
        holder[path[-1]] = -value
    elif isinstance(value, int | float):
        step = rng.choice((value + 1, value - 1, -value, 2 * value, 0, 1, value / 2, value * 1e6))
        near = (value + 1e-9, value * 1e-12, 1e300, -1e300, 5e-324, 2**31, 2**53, 10**6)
        number = rng.choice((step, step, rng.choice(near)))
        whole = isinstance(value, int) and abs(number) < 1e18
        holder[path[-1]] = int(number) if whole else float(number)
    elif isinstance(value, str):
        values = (_inside(made, other) for other in found)
        holder[path[-1]] = rng.choice([v for v in values if isinstance(v, str)])
    elif isinstance(value, list) and value:
        i = rng.randrange(len(value))
        if rng.random() < 0.5:
            value.insert(i, copy.deepcopy(rng.choice(value)))
        else:
            del value[i]


def _inside(made: Any, path: tuple[Any, ...]) -> Any:
    for step in path:
        made = made[step]
    return made


def _changed(value: Any, rng: random.Random) -> Any:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or rng.random() < 0.6:
        return copy.deepcopy(rng.choice(NASTY))
    factor = rng.choice((-1, 0, 0.5, 2, 1e3, 1e6, 1e9, 1e-9, 1e30, 1e200))
    try:
        return type(value)(value * factor)
    except (OverflowError, ValueError):
        return value


def mutated_bytes(data: bytes, rng: random.Random) -> bytes:
    """``data`` cut, doubled, overwritten or enlarged in a few places."""
    made = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4, 16))):
        if not made:
            return bytes(rng.randrange(256) for _ in range(8))
        at = rng.randrange(len(made))
        action = rng.randrange(7)
        if action == 0:
            made[at] = rng.randrange(256)
        elif action == 1:
            made[at] ^= 1 << rng.randrange(8)
        elif action == 2:
            del made[at:]
        elif action == 3:
            del made[at : at + rng.choice((1, 4, 64, 1024))]
        elif action == 4:
            stop = at + rng.choice((1, 8, 256))
            made[at:at] = made[at:stop] * rng.choice((1, 2, 50))
        elif action == 5:
            size = rng.choice((1, 2, 4, 8))
            number = rng.choice((0, 1, 2**31 - 1, 2**32 - 1, 2**63 - 1, 2**64 - 1, 1000))
            made[at : at + size] = (number % 256**size).to_bytes(
                size, rng.choice(("little", "big"))
            )
        else:
            made[at:at] = bytes(rng.randrange(256) for _ in range(rng.choice((1, 3, 17))))
    return bytes(made)


def mutated_table(lines: list[list[str]], rng: random.Random) -> bytes:
    """A CSV with cells, rows, separators and line ends changed."""
    made = [list(row) for row in lines]
    for _ in range(rng.choice((1, 1, 2, 5))):
        i = rng.randrange(len(made))
        row = made[i]
        action = rng.randrange(8)
        if action < 4 and row:
            row[rng.randrange(len(row))] = rng.choice((*CELLS, *made[0]))
        elif action == 4:
            made.insert(i, list(rng.choice(made)))
        elif action == 5:
            made[i] = row[: rng.randrange(len(row) + 1)] + rng.choice(([], ["1"], [""]))
        elif action == 6:
            made.insert(i, rng.choice(([], ["# note"], ["deg", "deg", "s"], ["Name", "x"])))
        elif len(made) > 1:
            del made[i]
    separator = rng.choice((",", ",", ";", "\t"))
    ending = rng.choice(("\n", "\n", "\r\n", "\r", rng.choice(("", separator)) + "\n"))
    text = ending.join(separator.join(row) for row in made) + rng.choice(("", ending))
    if rng.random() < 0.1 and separator != ",":
        text = text.replace(".", ",")
    mark = rng.choice(("", "", "\ufeff"))
    data = (mark + text).encode("utf-8", "surrogatepass")
    return mutated_bytes(data, rng) if rng.random() < 0.15 else data


#: A word, a number, a mark or blanks.
_WORDS = re.compile(r"[-+]?\d[\d.eE+-]*|\w+|[ \t]+|\n|.", re.DOTALL)
_MARKS = (",", ";", "=", "{", "}", "[", "]", "(", ")", "\n", " ", "//", "/*", "*/", '"', ":", "-")
_NUMBERS = ("0", "1", "-1", "1e9", "1e308", "-0.0", "0x10", "65535", "2147483648", "360", "0.001")


def mutated_words(text: str, rng: random.Random) -> bytes:
    """A text with words, numbers, marks or lines exchanged, left out or doubled."""
    words = _WORDS.findall(text)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        i = rng.randrange(len(words))
        action = rng.randrange(10)
        if action < 4:  # a number, most often
            found = [k for k in range(i, min(i + 40, len(words))) if words[k][-1:].isdigit()]
            i = found[0] if found else i
            words[i] = rng.choice((rng.choice(CELLS), rng.choice(_NUMBERS), rng.choice(words)))
        elif action == 4:
            words[i] = rng.choice((*_MARKS, rng.choice(words)))
        elif action == 5:
            words[i : i + rng.choice((1, 1, 2, 20, 1000))] = []
        elif action == 6:
            words[i:i] = words[i : i + rng.choice((1, 5, 40))] * rng.choice((1, 1, 2, 60))
        elif action == 7:
            j = rng.randrange(len(words))
            words[i], words[j] = words[j], words[i]
        elif action == 8:
            words.insert(i, rng.choice((*CELLS, *_MARKS)))
        else:
            del words[i:]
        words = words or ["x"]
    data = "".join(words).encode("utf-8", "surrogatepass")
    return mutated_bytes(data, rng) if rng.random() < 0.1 else data
