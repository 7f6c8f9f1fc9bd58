"""What Sphinx makes of docstrings that numpydoc allows and its reader does not."""

from __future__ import annotations

__all__ = ["connect", "formulas_as_text", "one_attribute_each"]


def connect(app):
    """Before napoleon, which reads sections."""
    app.connect("autodoc-process-docstring", _process, priority=400)
    app.connect("autodoc-skip-member", _skip)


def one_attribute_each(lines: list[str]) -> list[str]:
    """Attributes that share a description, each with it: else the first becomes a type.

    Examples
    --------
    >>> one_attribute_each(["Attributes", "----------", "a, b : float", "    In deg."])
    ['Attributes', '----------', 'a : float', '    In deg.', 'b : float', '    In deg.']
    """
    made: list[str] = []
    within, place = False, 0
    while place < len(lines):
        line = lines[place]
        if lines[place + 1 : place + 2] and set(lines[place + 1].strip()) == {"-"}:
            within = line.strip() == "Attributes"
            made += lines[place : place + 2]
            place += 2
            continue
        place += 1
        if not within or not line or line.startswith(" "):
            made.append(line)
            continue
        while line.rstrip().endswith(","):  # names over several lines
            line = f"{line.rstrip()} {lines[place].strip()}"
            place += 1
        names, colon, kind = line.partition(" : ")
        told = []
        while place < len(lines) and lines[place].startswith(" "):
            told.append(lines[place])
            place += 1
        for name in names.split(","):
            made += [f"{name.strip()}{colon}{kind}", *told]
    return made


def formulas_as_text(lines: list[str]) -> list[str]:
    """Blocks that begin with ``::`` on a line of its own, which are formulas, not Python.

    Examples
    --------
    >>> formulas_as_text(["::", "", "    ε = s θ"])
    ['.. code-block:: text', '', '    ε = s θ']
    """
    return [".. code-block:: text" if line.strip() == "::" else line for line in lines]


def _process(app, what, name, obj, options, lines):
    lines[:] = formulas_as_text(one_attribute_each(lines))


def _skip(app, what, name, obj, skip, options):
    """Fields of a named tuple stand in its signature; "Alias for field number 0" says nothing."""
    alias = (getattr(obj, "__doc__", None) or "").startswith("Alias for field number")
    return True if alias else None
