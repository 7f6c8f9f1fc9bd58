"""Sphinx configuration; the figures and the numbers of the pages are made by the build."""

import sys
from pathlib import Path

from docutils.nodes import SkipNode
from latex2mathml.converter import convert

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))


import generate  # noqa: E402

import trueangle  # noqa: E402

generate.everything(HERE / "_generated")

project = "trueangle"
html_show_copyright = False
version = release = trueangle.__version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
]
myst_enable_extensions = ["deflist", "dollarmath", "amsmath"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "trueangle"
# Angles and shapes in docstrings are in single backticks: code, not cross-references.
default_role = "py:obj"
autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
html_math_renderer = "mathml"


def _inline(translator, node):
    translator.body.append(convert(node.astext(), display="inline"))
    raise SkipNode


def _display(translator, node):
    translator.body.append(f'<p class="math">{convert(node.astext(), display="block")}</p>')
    raise SkipNode


def setup(app):
    """Formulas as MathML, which browsers set themselves: the pages need no network."""
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
