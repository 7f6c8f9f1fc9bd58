"""Faults drawn with a seed from all that cosmic-ray's operators could plant in some files."""

from __future__ import annotations

import ast
import random
import tomllib
from pathlib import Path
from typing import NamedTuple

from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator

from faults import changed_line

ROOT = Path(__file__).resolve().parents[2]

OPERATORS = (
    *(
        f"ReplaceBinaryOperator_{a}"
        for a in ("Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "Pow_Mul")
    ),
    *(
        f"ReplaceComparisonOperator_{a}"
        for a in (
            "Lt_LtE",
            "Lt_GtE",
            "LtE_Lt",
            "Gt_GtE",
            "Gt_LtE",
            "GtE_Gt",
            "Eq_NotEq",
            "NotEq_Eq",
        )
    ),
    "ReplaceUnaryOperator_Delete_USub",
    "ReplaceUnaryOperator_Delete_Not",
    "ReplaceAndWithOr",
    "ReplaceOrWithAnd",
    "ReplaceTrueWithFalse",
    "ReplaceFalseWithTrue",
    "NumberReplacer",
    "AddNot",
    "ZeroIterationForLoop",
)

#: What stops at lengths that never differ; no test can notice that it is gone.
GUARD = "strict=True"


class Drawn(NamedTuple):
    """A fault by its place: what the operator makes of which line."""

    file: str
    operator: str
    occurrence: int
    line: int
    before: str
    after: str
    text: str


def drawn(count: int, seed: int, files: list[Path]) -> list[Drawn]:
    """So many faults of all that the operators could plant in ``files``."""
    chance = random.Random(seed)
    weights = [len(p.read_text("utf-8").splitlines()) for p in files]
    found: dict[tuple[str, str, int], Drawn] = {}
    beyond: dict[tuple[Path, str], int] = {}
    for _ in range(200 * count):
        if len(found) == count:
            break
        path = chance.choices(files, weights)[0]
        operator = chance.choice(OPERATORS)
        occurrence = chance.randrange(40)
        if occurrence >= beyond.get((path, operator), 40):
            continue
        code = path.read_text("utf-8")
        changed = mutate_code(code, get_operator(f"core/{operator}")(), occurrence)
        if changed is None or changed == code:
            beyond[path, operator] = occurrence
            continue
        made = mutation(path, operator, occurrence, code, changed)
        if made is not None:
            found[made.file, made.operator, made.occurrence] = made
    return list(found.values())


def mutation(path: Path, operator: str, occurrence: int, code: str, changed: str) -> Drawn | None:
    """The fault at one occurrence; None where it is none, or none that runs."""
    line, before, after = changed_line(code, changed)
    # Lengths that never differ: without the guard nothing changes.
    if after == before.replace(GUARD, GUARD.replace("True", "False")):
        return None
    if before.lstrip().startswith(("from ", "import ", "@", "__all__", "*,")):
        return None
    try:
        if ast.dump(ast.parse(code)) == ast.dump(ast.parse(changed)):
            return None
    except SyntaxError:
        return None
    file = path.relative_to(ROOT).as_posix()
    return Drawn(file, operator, occurrence, line, before.strip(), after.strip(), changed)


def listed(path: Path) -> list[Drawn]:
    """The faults of a list that somebody else made, as those of `faults` but without tests."""
    found = []
    for entry in tomllib.loads(path.read_text("utf-8"))["fault"]:
        file, old, new = entry["file"], entry["old"], entry["new"]
        code = (ROOT / file).read_text("utf-8")
        if code.count(old) != 1:
            raise SystemExit(f"{entry['name']}: {file} holds its text {code.count(old)} times")
        changed = code.replace(old, new)
        line, before, after = changed_line(code, changed)
        found.append(Drawn(file, entry["name"], 0, line, before.strip(), after.strip(), changed))
    return found
