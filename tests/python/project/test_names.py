"""A class name means one thing: what two classes share has a reason."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

import trueangle

#: Names of several classes (leading underscores left out), and why.
SHARED = {
    "HeldOut": "public in two results, of a fit and of a self-calibration; each names its own",
}


def test_class_names_are_unique():
    root = Path(trueangle.__file__).parent
    places = defaultdict(list)
    for path in sorted(root.rglob("*.py")):
        for node in ast.parse(path.read_text("utf-8")).body:
            if isinstance(node, ast.ClassDef):
                places[node.name.lstrip("_")].append(path.relative_to(root).as_posix())
    several = {name: found for name, found in places.items() if len(found) > 1}
    assert several.keys() == SHARED.keys(), several
