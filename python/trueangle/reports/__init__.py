"""The report: one self-contained page from calibration runs, for people to hand on.

Content (plain values, put together by `composition.py`), figures (`figures.py`) and the page
(`page.py`) are apart: every number on the page is a value of the content, which it carries as JSON.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .composition import Report, report

if TYPE_CHECKING:
    from .demo import demo_report as demo_report

__all__ = ["Report", "demo_report", "report"]


def __getattr__(name: str) -> Any:
    # A report without a simulation needs no effects.
    if name == "demo_report":
        from .demo import demo_report

        return demo_report
    raise AttributeError(f"module 'trueangle.reports' has no attribute {name!r}")
