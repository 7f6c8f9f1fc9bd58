"""Sphinx configuration; the figures and the numbers of the pages are made by the build."""

import html
import sys
from pathlib import Path

import ziamath
from docutils.nodes import SkipNode

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))


import generate  # noqa: E402
import reference_pages  # noqa: E402

import trueangle  # noqa: E402

generate.everything(HERE / "_generated")

project = "trueangle"
html_show_copyright = False
version = release = trueangle.__version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_design",
]
myst_enable_extensions = ["deflist", "dollarmath", "amsmath", "colon_fence"]
myst_heading_anchors = 3
exclude_patterns = ["_build", "_generated"]
autosummary_generate = False
html_theme = "furo"
html_title = "trueangle"
# Angles and shapes in docstrings are in single backticks: code, not cross-references.
default_role = "py:obj"
autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
html_math_renderer = "drawn"
html_static_path = ["static"]
html_css_files = ["formulas.css"]
# Copied is what is typed: neither prompts nor output.
copybutton_exclude = ".linenos, .gp, .go"

#: Size of formulas in px: the height of the letters is that of the text beside them.
FORMULA_PX = 17.0
ziamath.config.svg2 = False  # no identifiers, which would repeat over the page


def _drawn(tex, block):
    """A formula as outlines of STIX Two Math, in the colour of the text; its TeX is the text."""
    formula = ziamath.Latex(tex.strip(), size=FORMULA_PX, color="currentColor", inline=not block)
    picture = formula.svg().replace("<svg ", f'<svg role="img" aria-label="{html.escape(tex)}" ', 1)
    below = formula.getyofst() if not block else 0.0
    return picture.replace("<svg ", f'<svg style="vertical-align:{below:.2f}px" ', 1)


def _inline(translator, node):
    translator.body.append(f'<span class="formula">{_drawn(node.astext(), False)}</span>')
    raise SkipNode


def _display(translator, node):
    translator.body.append(f'<div class="formula">{_drawn(node.astext(), True)}</div>')
    raise SkipNode


def _with_reference(app, name, source):
    source[0] = reference_pages.expanded(source[0])


def setup(app):
    """Formulas are drawn by the build: they look alike everywhere and need no network."""
    app.connect("source-read", _with_reference)
    app.add_html_math_renderer("drawn", (_inline, None), (_display, None))
