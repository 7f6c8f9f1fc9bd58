"""The report: one self-contained page from calibration runs, for people to hand on.

Content (plain values, `content.py`), figures (`figures.py`) and the page (`page.py`) are
apart: every number on the page is a value of the content, which the page carries as JSON.
"""

from __future__ import annotations

from .composition import Report, report
from .demo import demo_report

__all__ = ["Report", "demo_report", "report"]
