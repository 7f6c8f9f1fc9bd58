"""Formulas as outlines of STIX Two Math: they look alike everywhere and need no network."""

from __future__ import annotations

import html

import ziamath
from docutils.nodes import SkipNode

__all__ = ["RENDERERS", "drawn"]

#: Size of formulas in px: the height of the letters is that of the text beside them.
FORMULA_PX = 17.0
ziamath.config.svg2 = False  # no identifiers, which would repeat over the page


def drawn(tex, block):
    """A formula as SVG in the colour of the text; its TeX is the text for who does not see it."""
    formula = ziamath.Latex(tex.strip(), size=FORMULA_PX, color="currentColor", inline=not block)
    picture = formula.svg().replace("<svg ", f'<svg role="img" aria-label="{html.escape(tex)}" ', 1)
    below = formula.getyofst() if not block else 0.0
    return picture.replace("<svg ", f'<svg style="vertical-align:{below:.2f}px" ', 1)


def _inline(translator, node):
    translator.body.append(f'<span class="formula">{drawn(node.astext(), False)}</span>')
    raise SkipNode


def _display(translator, node):
    translator.body.append(f'<div class="formula">{drawn(node.astext(), True)}</div>')
    raise SkipNode


#: Visitors of Sphinx, for formulas in a line and on their own.
RENDERERS = (_inline, None), (_display, None)
