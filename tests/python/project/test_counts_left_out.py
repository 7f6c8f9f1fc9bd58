"""A list that is cut says how many of it are left out: those shown and those told are all."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from fleets.made import units
from trueangle.diagnosis.finding import named_quantity
from trueangle.estimation.quantity import quantity
from trueangle.export.export import _source
from trueangle.export.pattern import TurnPattern
from trueangle.fitting.unlikeruns import unlike_runs_sentence
from trueangle.fleets.fleet import Fleet
from trueangle.formats.columns import listed_columns
from trueangle.model.records import Provenance
from trueangle.plots.orderlines import OrderLine, largest_orders_text
from trueangle.reports.diagnosed import unknown_content
from trueangle.reports.wording import shortened_list
from trueangle.support.display_units import ErrorUnit
from trueangle.support.files import InputFile
from trueangle.support.suggestions import listed_names

PLAIN = ErrorUnit("arcsec", 1.0)

#: Of so many things: a few more than any list holds, and no two lists as many as each other.
COUNTS = (53, 67)


def names(count: int) -> list[str]:
    return [f"name{k}" for k in range(count)]


def model(count: int) -> ta.HarmonicModel:
    sine = [1e-3 / k for k in range(1, count + 1)]
    return ta.HarmonicModel(
        [ta.Shaft("output", 1, range(1, count + 1), [0.0] * count, sine)], period=360.0
    )


def fitted_from(count: int) -> str:
    """The first line of an export: its model's files."""
    files = tuple(InputFile(name, "0" * 64) for name in names(count))
    one = model(2).replace(provenance=Provenance(files, ""))
    return _source(TurnPattern(one), "0" * 64, None)[0]


def fleet_of(count: int) -> Fleet:
    """Units that are fine, of a fleet of three."""
    fleet = ta.fleet(units(np.random.default_rng(71_000), 3, runs=1), orders=[1, 2])
    fine = replace(fleet.units[0], verdict="fine", because="")
    return replace(fleet, units=tuple(replace(fine, unit=name) for name in names(count)))


def folded(count: int) -> str:
    """What a report cannot know of orders that others look like."""
    rows = [
        SimpleNamespace(
            order=float(k), retained=True, aliases=(k + 0.5,), amplitude=1.0 / k, explanations=()
        )
        for k in range(1, count + 1)
    ]
    run = ta.CalibrationRun([0.0, 1.0, 2.0], [0.0, 1.0, 2.0], period=360.0)
    return unknown_content([run, run], SimpleNamespace(table=rows), None)[0]["what"]


def selected(count: int) -> str:
    """So many candidates, of which the readings show one."""
    theta = np.arange(0.0, 360.0, 1.0)
    error = np.sin(np.radians(theta)) + np.random.default_rng(71_001).normal(0.0, 0.1, 360)
    run = ta.CalibrationRun(theta, theta + error, period=360.0)
    return ta.select_orders(run, range(1, count + 1)).summary()


#: What is said of so many things, and what each of those shown looks like.
LISTS: dict[str, tuple[Callable[[int], str], str]] = {
    "orders of a model": (lambda n: model(n).summary(), r"^output +\d+ "),
    "orders of a comparison": (
        lambda n: ta.compare(model(n), model(1)).summary(), r"^ +\d+ +\S+ +\d+\.\d +\S+$"
    ),
    "candidates of a selection": (selected, r"^ +\d+ +\d\S* +\d\S* +\d"),
    "units of a fleet": (lambda n: fleet_of(n).summary(), r"^  name\d+ +fine "),
    "files of an export": (fitted_from, r"\bname\d+"),
    "orders that others look like": (folded, r"order \d+ is really"),
    "orders of a picture": (
        lambda n: largest_orders_text([OrderLine(k, 1.0 / k) for k in range(1, n + 1)], PLAIN),
        r"\d+ \(\S+ arcsec\)",
    ),
    "runs unlike the others": (lambda n: unlike_runs_sentence(names(n), n + 1), r"\bname\d+"),
    "columns of a log": (lambda n: listed_columns(names(n)), r"\bname\d+"),
    "names in a message": (lambda n: listed_names(names(n)), r"\bname\d+"),
    "lines of a page's cell": (lambda n: "\n".join(shortened_list(names(n))), r"\bname\d+"),
    "numbers of a finding": (
        lambda n: named_quantity("orders", quantity([k + 0.25 for k in range(n)]), PLAIN)[1],
        r"\d+\.25",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", LISTS)
def test_what_is_shown_and_what_is_told_are_all(what: str) -> None:
    told, one = LISTS[what]
    for count in COUNTS:
        text = told(count)
        shown = len(re.findall(one, text, re.M))
        left = [
            int(n) for n in re.findall(r"\band (\d+) (?:more|smaller|weaker|that are fine)\b", text)
        ]
        assert 0 < shown < count, text
        assert [shown + n for n in left] == [count], f"{what}: {shown} shown, {left} told: {text}"
