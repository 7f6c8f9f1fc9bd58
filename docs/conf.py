"""Sphinx configuration; the figures and the numbers of the pages are made by the build."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))


import docstrings  # noqa: E402
import formulas  # noqa: E402
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
html_css_files = ["pages.css"]
html_js_files = ["pages.js"]
html_extra_path = ["_generated/pages"]
# Copied is what is typed: neither prompts nor output.
copybutton_exclude = ".linenos, .gp, .go"


def _with_reference(app, name, source):
    # The line that ends a doctest of the sources would stand as an empty one.
    source[0] = reference_pages.expanded(source[0]).replace("\n\n```\n", "\n```\n")


def setup(app):
    """Expand the reference and draw the formulas."""
    app.connect("source-read", _with_reference)
    docstrings.connect(app)
    app.add_html_math_renderer("drawn", *formulas.RENDERERS)
