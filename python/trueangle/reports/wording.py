"""Words of the page that depend on the content; numbers are set in by the template."""

from __future__ import annotations

from typing import Any, Final

__all__ = [
    "FIGURE_TITLES",
    "cause_name",
    "gain_paths",
    "joined",
    "paths",
    "residual_signals",
    "verdict",
]

FIGURE_TITLES: Final = {
    "errors": "Measured error of every run, and the model",
    "measured-simulated": "Measured error and what the simulation expects",
    "error-left": "What is left of held-out runs without each cause",
    "gains": "Gain of each cause on held-out runs",
    "spectrum": "Size of every order",
    "phases": "Phase and size of every order, run by run",
    "before-after": "Held-out runs before and after correction",
}

#: Reduction, in percent, from which a correction is worth having.
_WORTH: Final = 1.0


def verdict(content: dict[str, Any]) -> str:
    """``"gain"``, ``"no-gain"``, ``"unchecked"`` or ``"no-model"``."""
    if content["model"] is None:
        return "no-model"
    gain = content["gain"]
    if gain is None:
        return "unchecked"
    low = gain["reduction_low_percent"]
    low = gain["reduction_percent"] if low is None else low
    return "gain" if low >= _WORTH else "no-gain"


def cause_name(cause: str) -> str:
    """A cause of the fixed vocabulary as words.

    Examples
    --------
    >>> cause_name("zero_slip")
    'zero slip'
    """
    return cause.replace("_", " ")


def joined(items: list[Any]) -> str:
    """Items as a list in a sentence.

    Examples
    --------
    >>> joined([1, 2, 3])
    '1, 2 and 3'
    """
    texts = [f"{item:g}" if isinstance(item, float) else str(item) for item in items]
    return texts[0] if len(texts) == 1 else f"{', '.join(texts[:-1])} and {texts[-1]}"


def residual_signals(figures: dict[str, Any]) -> list[str]:
    """Signals that the residual is drawn against."""
    return [name.removeprefix("residual-") for name in figures if name.startswith("residual-")]


def paths(pattern: str, entries: list[Any]) -> list[str]:
    """Where the same number of every entry stands in the content.

    Examples
    --------
    >>> paths("runs.{}.rms", ["a", "b"])
    ['runs.0.rms', 'runs.1.rms']
    """
    return [pattern.format(i) for i in range(len(entries))]


def gain_paths(findings: list[dict[str, Any]]) -> list[str]:
    """Where what is left after each finding stands."""
    every = enumerate(findings)
    return [f"diagnosis.findings.{i}.gain.rms_after_arcsec" for i, f in every if f["gain"]]
